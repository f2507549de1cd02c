"""Quantile positions at which a trial is observed.

The people who rate an object are ordered by their rating, lowest first. A quantile
position p in (0, 1) is a place in this order, so every rating takes up an interval of
positions as long as its share of the people.
"""

from functools import lru_cache

import numpy as np

from ..ratings._distributions import level_at


def training_observations(counts, n_duplicates, sampling, random_state):
    """Choose quantile positions of each trial; label and weight them by its ratings.

    Parameters
    ----------
    counts : ndarray of shape (n_trials, n_levels)
        How many people gave each rating.
    n_duplicates : int
        Total weight of the observations of each trial; with "random" also their number.
    sampling : {"level", "random"}
        How positions are chosen, as `DistributionalOrdinalRegressor` says.
    random_state : RandomState instance

    Returns
    -------
    positions : ndarray of shape (n_trials, n_observations)
        Positions strictly between 0 and 1.
    level : ndarray of int of shape (n_trials, n_observations)
        Index of the rating at each position.
    weight : ndarray of shape (n_trials, n_observations)
    """
    if sampling == "level":
        return _level_nodes(counts, n_duplicates)
    positions = random_state.uniform(size=(len(counts), n_duplicates))
    positions = clip_positions(positions)
    return positions, level_at(counts, positions), np.ones_like(positions)


def _level_nodes(counts, n_duplicates):
    """Return Gauss–Legendre nodes in the interval of positions of each level."""
    n_trials, n_levels = counts.shape
    share = counts / counts.sum(axis=1, keepdims=True)
    start = np.cumsum(share, axis=1) - share
    nodes, node_weight = unit_gauss_legendre(max(1, n_duplicates // n_levels))
    positions = (start[:, :, None] + share[:, :, None] * nodes).reshape(n_trials, -1)
    weight = (share[:, :, None] * node_weight).reshape(n_trials, -1) * n_duplicates
    level = np.broadcast_to(np.arange(n_levels).repeat(len(nodes)), weight.shape)
    return clip_positions(positions), level, weight


def clip_positions(positions):
    """Return positions strictly between 0 and 1, whose log-odds are finite."""
    tiny = np.finfo(float).eps
    return np.clip(positions, tiny, 1 - tiny)


def share_below(latent, thresholds, inputs, to_position):
    """Return the share of the population with a response at or below each threshold.

    Interpolate linearly between the inputs; beyond the outer inputs, extrapolate as
    constant. For a linear model the result is exact between the outer inputs.

    Parameters
    ----------
    latent : ndarray of shape (n_trials, n_inputs)
        The response at each input.
    thresholds : ndarray of shape (n_levels - 1,)
        Increasing thresholds, possibly infinite.
    inputs : ndarray of shape (n_inputs,)
        Increasing functions of the position, such as its log-odds.
    to_position : callable
        Returns the positions, from 0 to 1, of inputs.

    Returns
    -------
    share : ndarray of shape (n_trials, n_levels - 1)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.models._quantile_positions import share_below
    >>> latent = np.array([[-1.0, 1.0, 3.0]])
    >>> share_below(latent, np.array([0.0, 2.0]), np.linspace(0, 1, 3), np.positive)
    array([[0.25, 0.75]])
    """
    excess = latent - thresholds[:, None, None]
    below = excess <= 0
    share = below[:, :, -1].astype(np.float64)
    crossing = np.nonzero(below[:, :, 1:] != below[:, :, :-1])
    left, right = excess[:, :, :-1][crossing], excess[:, :, 1:][crossing]
    j = crossing[2]
    crossed = inputs[j] + (inputs[j + 1] - inputs[j]) * left / (left - right)
    np.add.at(share, crossing[:2], np.where(left <= 0, 1, -1) * to_position(crossed))
    return share.T


def crossing_positions(n_nodes):
    """Return positions that crowd at both ends, the outer ones next to 0 and 1."""
    return np.clip(_crowded(np.linspace(0, 1, n_nodes)), 1e-6, 1 - 1e-6)


def _crowded(q):
    """Move points of [0, 1] towards its ends, where they crowd."""
    return q**2 * (3 - 2 * q)


def unit_gauss_legendre(n_nodes):
    """Return nodes and weights of Gauss–Legendre quadrature on (0, 1)."""
    nodes, weight = np.polynomial.legendre.leggauss(n_nodes)
    return (nodes + 1) / 2, weight / 2


@lru_cache
def population_quadrature(n_nodes):
    """Return nodes and weights for averages over the population.

    Gauss–Legendre quadrature in q with p = q² (3 - 2q). Its nodes crowd at both ends,
    where functions of the log-odds of p are hard to integrate.
    """
    q, weight = unit_gauss_legendre(n_nodes)
    nodes, weight = _crowded(q), 6 * q * (1 - q) * weight
    nodes.flags.writeable = weight.flags.writeable = False  # one pair for all callers
    return nodes, weight


def population_cells(n_cells):
    """Return nodes and weights for averages over the population of stepwise functions.

    The midpoint rule in q with p = q² (3 - 2q), whose cells crowd at both ends. A jump
    of the function between two nodes puts the average off by at most half the larger
    of their weights, times the jump.
    """
    p = _crowded(np.linspace(0, 1, 2 * n_cells + 1))
    return p[1::2], np.diff(p[::2])


def largest_jump_error(cdf, weight):
    """Return the largest error that a jump between nodes gives a trial's average.

    The distribution function at each node of `population_cells`, of shape (n_trials,
    n_nodes, ..., n_levels), may have one jump between two nodes; `weight` has the
    nodes' weights. The error, of shape (n_trials,), is that at the level where it is
    largest.
    """
    half = np.maximum(weight[1:], weight[:-1]) / 2
    error = np.einsum("tp...,p->t...", np.abs(np.diff(cdf, axis=1)), half)
    return error.reshape(len(error), -1).max(axis=1)
