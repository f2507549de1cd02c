"""Shares, cumulative distributions and their inverse, and errors of levels."""

import numpy as np


def _proportions(counts):
    return counts / counts.sum(axis=1, keepdims=True)


def _cdf(counts):
    """Return the proportion at or below each level but the last, where it is 1."""
    below = np.cumsum(counts, axis=1)
    return below[:, :-1] / below[:, -1:]


def _macro_mae(predicted, true, counted=True):
    """Absolute error of each trial, averaged over the levels that are true in it.

    Parameters
    ----------
    predicted, true : ndarray of int of shape (n_trials, n_observations)
        Indices of levels.
    counted : bool or ndarray of bool of shape (n_trials, n_observations), default=True
        Which observations count; at least one a trial.

    Returns
    -------
    error : ndarray of shape (n_trials,)
    """
    error = np.abs(predicted - true)
    total = np.zeros(len(error))
    n_levels = np.zeros(len(error))
    for level in np.unique(true):
        here = (true == level) & counted
        n_here = here.sum(axis=1)
        total += (error * here).sum(axis=1) / np.maximum(n_here, 1)
        n_levels += n_here > 0
    return total / n_levels


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
    below = np.ldexp(below, -np.frexp(below[:, -1:])[1])  # totals in [1/2, 1)
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


def level_at(counts, p):
    """Return the inverse CDF, as indices of levels, for any axes of distributions.

    Parameters
    ----------
    counts : ndarray of shape (..., n_levels)
        As `_level_index` takes them.
    p : ndarray of shape (n_p,) or (..., n_p)
        Quantile positions within [0, 1]; a vector is shared by all distributions.

    Returns
    -------
    index : ndarray of shape (..., n_p)
    """
    rows = counts.reshape(-1, counts.shape[-1])
    index = _level_index(rows, p if p.ndim == 1 else p.reshape(len(rows), -1))
    return index.reshape(*counts.shape[:-1], -1)


def cdf_of_shares(shares):
    """Return the share at or below each level, over the last axis, which ends in 1."""
    cdf = np.cumsum(shares, axis=-1)
    cdf[..., -1] = 1.0
    return np.minimum(cdf, 1.0)
