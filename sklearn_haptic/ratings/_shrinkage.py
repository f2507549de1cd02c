"""Counts of objects that few people rated, drawn towards those of the others."""

from __future__ import annotations

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..utils._sklearn import Interval, validate_params
from ._checks import check_counts
from ._distributions import cdf, shares

# Candidates for the strength, in people.
_STRENGTHS = np.r_[0, 2.0 ** np.arange(-3, 11, 0.5), np.inf]


@validate_params(
    {
        "counts": ["array-like"],
        "strength": [Interval(Real, 0, np.inf, closed="both"), None],
    },
    prefer_skip_nested_validation=True,
)
def shrink_counts(
    counts: ArrayLike, strength: float | None = None
) -> NDArray[np.float64]:
    r"""Draw the counts of each object towards the population of objects.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people gave each object each level; one row per object.
    strength : float, default=None
        Number of people that the population counts for, from 0 (counts stay as they
        are) to infinity (all objects are alike). By default each rating is predicted
        from the other ratings of its object and from the other objects, and the
        strength is chosen that has the lowest ranked probability score, every object
        counting equally.

    Returns
    -------
    counts : ndarray of shape (n_objects, n_levels)
        Shrunken counts, as many as before in each row.

    Raises
    ------
    ValueError
        If there are fewer than two objects; or if no strength is given, and counts are
        not whole numbers or no object has two ratings, so that none can be left out.

    Notes
    -----
    With the counts :math:`n_k` of N people and the mean distribution :math:`\pi` of the
    other objects, the share at level k is
    :math:`(n_k + m \pi_k) / (N + m)` for the strength m: the mean of the posterior if
    objects have a Dirichlet prior of this mean and concentration.

    Examples
    --------
    >>> from sklearn_haptic.ratings import shrink_counts
    >>> shrink_counts([[2, 0, 0], [0, 1, 1], [0, 2, 0]], strength=1)
    array([[1.33333333, 0.5       , 0.16666667],
           [0.33333333, 1.        , 0.66666667],
           [0.33333333, 1.5       , 0.16666667]])
    """
    counts, _ = check_counts(counts)
    if strength is None:
        strength = leave_one_out_strength(counts)
    n = counts.sum(axis=1, keepdims=True)
    drawn = 1.0 if np.isinf(strength) else strength / (n + strength)
    return (1 - drawn) * counts + drawn * n * mean_of_others(counts)


def mean_of_others(counts):
    """Return the mean distribution of all other objects, for each object."""
    if len(counts) < 2:
        raise ValueError("counts has one object; shrinkage needs others beside it.")
    share = shares(counts)
    return np.maximum(share.sum(axis=0) - share, 0) / (len(share) - 1)


def leave_one_out_strength(counts):
    """Choose the strength, in people, by which the others best predict each rating."""
    if (counts % 1 != 0).any():
        raise ValueError(
            "counts must be whole numbers of people, of whom one is left out at a time."
        )
    population = cdf(mean_of_others(counts))[:, :-1]
    several = counts.sum(axis=1) >= 2
    if not several.any():
        raise ValueError(
            "counts has no object with two ratings, so that no strength can be chosen "
            "by leaving one out; have some objects rated again, or give strength."
        )
    counts, population = counts[several], population[several]
    n = counts.sum(axis=1, keepdims=True)
    below, share = np.cumsum(counts, axis=1)[:, :-1], cdf(counts)[:, :-1]

    def score(strength):
        kept = 0 if np.isinf(strength) else 1 / (n - 1 + strength)
        drawn = 1 - (n - 1) * kept
        of_lower = (below - 1) * kept + drawn * population  # a rating here or below
        of_higher = below * kept + drawn * population
        return (share * (of_lower - 1) ** 2 + (1 - share) * of_higher**2).sum()

    return float(_STRENGTHS[np.argmin([score(each) for each in _STRENGTHS])])
