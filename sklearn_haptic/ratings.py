"""Ratings given by people: counts per level, inverse CDF, agreement, correlation.

People rate an object on an ordered scale, so an object's ratings are a table of
*counts*: how many people chose each level. Everything else follows from it.
"""

import numpy as np
from sklearn.utils.validation import check_array

from ._validation import check_ratings


def inverse_cdf(counts, p, *, levels=None):
    r"""Rating given by the person at position ``p`` of the population.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level; any non-negative weights or
        probabilities will do.
    p : float or array-like of shape (n_p,)
        Positions in the population, from 0 (lowest rating) to 1 (highest).
    levels : array-like of shape (n_levels,), default=None
        The ordered levels; by default 1, 2, …, n_levels.

    Returns
    -------
    ratings : ndarray of shape (n_objects, n_p), or (n_objects,) for a scalar p
        The levels at ``p``.

    Raises
    ------
    ValueError
        If ``p`` lies outside [0, 1], or the counts are negative, not finite or
        all zero for an object.

    Notes
    -----
    With :math:`n_k` people at level k of :math:`N` people in all,

    .. math:: F^{-1}(p) = \min\{k : n_k > 0,\; n_1 + \dots + n_k \ge p N\}.

    Cumulative counts are compared with :math:`pN`, never cumulative proportions
    with :math:`p`, and :math:`pN` is lowered by a few rounding errors, so that a
    double ``p = i / 100`` gives what the exact fraction would. A level that nobody
    chose is never returned: ``p = 0`` gives the lowest level used, ``p = 1`` the
    highest.

    References
    ----------
    B. A. Richardson and K. J. Kuchenbecker, "Learning to predict perceptual
    distributions of haptic adjectives", Frontiers in Neurorobotics 13, 2020,
    section 2.3.1. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.ratings import inverse_cdf
    >>> inverse_cdf([[0, 3, 6, 3, 0]], [0, 0.25, 0.26, 0.75, 1])
    array([[2, 2, 3, 3, 4]])
    """
    counts, levels = _check_counts(counts, levels)
    p = check_array(p, ensure_2d=False, dtype=np.float64, input_name="p")
    if p.ndim > 1 or (p < 0).any() or (p > 1).any():
        raise ValueError(
            "p must be a number or a one-dimensional array of positions within [0, 1]."
        )
    index = _level_index(counts, p)
    return levels[index[:, 0] if p.ndim == 0 else index]


def _level_index(counts, p):
    """Return the index of the level at each position of the population.

    Parameters
    ----------
    counts : ndarray of shape (n_objects, n_levels)
        Non-negative counts, weights or probabilities, not all zero in a row.
    p : float or ndarray broadcastable to (n_objects, n_p)
        Positions within [0, 1]: shared (n_p,) or a row an object (n_objects, n_p).

    Returns
    -------
    index : ndarray of shape (n_objects, n_p)
        Index of the level, from 0.
    """
    below = np.cumsum(counts, axis=1, dtype=np.float64)
    # A rank lowered by less than any real difference between ranks, yet by more
    # than the rounding of p, of p * N and of the sum; above 0, so that levels
    # below the lowest one used are passed over.
    tolerance = 4 * below.shape[1] * np.finfo(np.float64).eps
    rank = np.maximum(
        p * below[:, -1:] * (1 - tolerance), np.finfo(np.float64).smallest_subnormal
    )
    index = np.zeros(rank.shape, dtype=np.intp)
    for column in below.T[:-1]:
        index += column[:, None] < rank
    return index


def _check_counts(counts, levels):
    """Validate a table of counts, which unlike ratings is always two-dimensional."""
    counts = check_array(
        counts, dtype=np.float64, ensure_min_features=2, input_name="counts"
    )
    return check_ratings(counts, levels, name="counts")
