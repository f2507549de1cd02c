"""Observations of trials: which levels they have, with what weights.

Observations are rows of arrays with one row per trial: a level each, a weight, and
perhaps a position. Those of several adjectives have a further axis behind the trials'.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..ratings._checks import validate_rated_trials, weighted
from ..utils._sklearn import FloatArray
from ..utils._validation import check_groups, check_weights

# In units of the total weight; more would make no difference but overflow.
_LARGEST_PENALTY = 1e300


def relative_weights(sample_weight):
    """Return the weights of trials in units of the largest; all stay above 0."""
    relative = sample_weight / sample_weight.max()
    return np.maximum(relative, np.finfo(np.float64).tiny)


def used_trials(estimator, X, y, levels, sample_weight, groups=None):
    """Validate what is given to ``fit``, and leave out trials of weight 0.

    Returns
    -------
    X : ndarray of shape (n_trials, n_features)
    counts : ndarray of shape (n_trials, ..., n_levels)
    levels : ndarray of shape (n_levels,)
    sample_weight : ndarray of shape (n_trials,)
    groups : ndarray of shape (n_trials,), or None
    """
    trials = X  # whose row labels tell whether others are in their order
    X, counts, levels = validate_rated_trials(estimator, trials, y, levels)
    groups = check_groups(groups, trials)
    sample_weight = check_weights(sample_weight, trials)
    used = sample_weight > 0
    if used.all():
        used = slice(None)  # which copies nothing
    groups = None if groups is None else groups[used]
    return X[used], counts[used], levels, sample_weight[used], groups


def single_ratings(counts, sample_weight):
    """Turn counts into observations without positions: one per level of a trial.

    Parameters
    ----------
    counts : ndarray of shape (n_trials, ..., n_levels)
    sample_weight : ndarray of shape (n_trials,)

    Returns
    -------
    level, weight : ndarray of the shape of `counts`
        What `NNPOM.fit_with_positions` trains on.
    validation_weight : ndarray of the shape of `counts`
        Takes the place of `weight` where the trial validates: a trial counts by its
        own weight, however many people rated it.
    """
    level = np.broadcast_to(np.arange(counts.shape[-1]), counts.shape)
    validation_weight = ((counts > 0).T * relative_weights(sample_weight)).T
    return level, weighted(counts, sample_weight), validation_weight


def one_trial_each(X, positions, level, weight):
    """Make each observation a trial of its own.

    Parameters
    ----------
    X : ndarray of shape (n_trials, ..., n_observations, n_features)
    positions, level, weight : ndarray of shape (n_trials, ..., n_observations)
        For several adjectives with an axis for them, and so has `X`. Positions may be
        None. Observations of zero weight are left out.

    Returns
    -------
    X : ndarray of shape (n_rows, n_features)
        Rows of an adjective follow one another.
    positions, level, weight : ndarray of shape (n_rows, 1) or (n_rows, n_adjectives, 1)
        The weight is zero for all adjectives but the row's own.
    """
    given = X, positions, level, weight
    several = weight.ndim == 3
    if several:  # by adjective, then by trial
        given = [None if each is None else each.swapaxes(0, 1) for each in given]
    used = given[-1] > 0
    X, *observed = (None if each is None else each[used] for each in given)
    observed = (None if each is None else each[:, None] for each in observed)
    if several:
        own = np.nonzero(used)[0][:, None] == np.arange(len(used))
        observed = (
            each if each is None else (each * own)[..., None] for each in observed
        )
    return X, *observed


def scaled_to_unit_weight(weight, alpha):
    """Bring the total weight near 1, and the penalty along, by a power of four.

    Only the ratio of weights and penalty matters. A power of four changes no digit,
    under a square root neither.
    """
    exponent = 2 * (np.frexp(weight.sum())[1] // 2)
    with np.errstate(over="ignore"):
        alpha = min(np.ldexp(float(alpha), -exponent), _LARGEST_PENALTY)
    return np.ldexp(weight, -exponent), alpha


def of_each_adjective(positions, level, weight):
    """Return the positions, levels and weights of each adjective."""
    if weight.ndim == 2:
        return [(positions, level, weight)]
    return [
        (None if positions is None else positions[:, i], level[:, i], weight[:, i])
        for i in range(weight.shape[1])
    ]


class RankedRatings(NamedTuple):
    """The ratings of one adjective, their levels ranked from 0 without gaps."""

    present: NDArray[np.intp]
    """Indices of the levels that ratings have."""

    observations: tuple[FloatArray | None, NDArray[np.intp], FloatArray]
    """Positions, ranks and weights; where the weight is not zero, a rank is an index
    into `present`."""


def rank_levels(positions, level, weight, n_levels):
    """Rank the levels that ratings of each adjective have.

    Parameters
    ----------
    positions, level, weight : ndarray
        As `NNPOM.fit_with_positions` takes them.
    n_levels : int
        Number of all levels.

    Returns
    -------
    ranked : list of RankedRatings
    """
    ranked = []
    for at, given, counted in of_each_adjective(positions, level, weight):
        present = np.flatnonzero(np.bincount(given.ravel(), counted.ravel(), n_levels))
        observations = at, np.searchsorted(present, given), counted
        ranked.append(RankedRatings(present, observations))
    return ranked
