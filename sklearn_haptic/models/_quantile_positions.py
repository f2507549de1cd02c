"""Positions in the population of raters: what observations stand for a trial.

Every rating of an object is a stretch of its population; a position p in (0, 1) is
one of its people, lowest ratings first.
"""

from functools import lru_cache

import numpy as np

from .._distributions import level_at

_GOLDEN = (np.sqrt(5) - 1) / 2


def training_observations(counts, n_duplicates, sampling, balance, random_state):
    """Choose positions for each trial; label and weight them by its ratings.

    Parameters
    ----------
    counts : ndarray of shape (n_trials, n_levels)
        How many people gave each rating.
    n_duplicates : int
        Number of observations of each trial; their weights sum to it.
    sampling : {"level", "lattice", "stratified", "random"}
        How positions are chosen, as `DistributionalOrdinalRegressor` says.
    balance : {"macro", None}
        Whether the levels of a trial count equally.
    random_state : RandomState instance

    Returns
    -------
    positions : ndarray of shape (n_trials, n_observations)
        Positions strictly between 0 and 1.
    level : ndarray of int of shape (n_trials, n_observations)
        Index of the rating at each position.
    weight : ndarray of shape (n_trials, n_observations)
    """
    n_trials, n_levels = counts.shape
    if sampling == "level":
        positions, level, weight = _level_nodes(counts, n_duplicates)
    else:
        cell = np.arange(n_duplicates) / n_duplicates
        if sampling == "lattice":  # turned a little for each trial
            shift = (_GOLDEN * (np.arange(n_trials)[:, None] + 1)) % 1
        else:
            shift = random_state.uniform(size=(n_trials, n_duplicates))
        positions = shift if sampling == "random" else cell + shift / n_duplicates
        tiny = np.finfo(float).eps
        positions = np.clip(positions, tiny, 1 - tiny)
        level = level_at(counts, positions)
        weight = np.ones_like(positions)
    if balance == "macro":
        total = np.stack([(weight * (level == k)).sum(1) for k in range(n_levels)], 1)
        total, n_used = np.take_along_axis(total, level, axis=1), (total > 0).sum(1)
        weight = np.divide(weight, total, out=np.zeros_like(weight), where=total > 0)
        weight *= n_duplicates / n_used[:, None]
    return positions, level, weight


def _level_nodes(counts, n_duplicates):
    """Gauss–Legendre nodes within the stretch of the population at each level."""
    n_trials, n_levels = counts.shape
    share = counts / counts.sum(axis=1, keepdims=True)
    start = np.cumsum(share, axis=1) - share
    nodes, node_weight = unit_gauss_legendre(max(1, n_duplicates // n_levels))
    positions = (start[:, :, None] + share[:, :, None] * nodes).reshape(n_trials, -1)
    weight = (share[:, :, None] * node_weight).reshape(n_trials, -1) * n_duplicates
    level = np.broadcast_to(np.arange(n_levels).repeat(len(nodes)), weight.shape)
    tiny = np.finfo(float).eps
    return np.clip(positions, tiny, 1 - tiny), level, weight


def share_below(latent, thresholds, inputs, to_position):
    """Share of the population whose latent response is at most each threshold.

    The response is taken as linear between the inputs given, so that of a linear
    model is exact but for the population beyond the outer inputs, of which all is
    taken to be like them.

    Parameters
    ----------
    latent : ndarray of shape (n_trials, n_inputs)
        The response at each input.
    thresholds : ndarray of shape (n_levels - 1,)
        Increasing thresholds, possibly infinite.
    inputs : ndarray of shape (n_inputs,)
        Increasing functions of the position, such as its log-odds.
    to_position : callable
        Gives the positions in the population, from 0 to 1, of inputs.

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
    """Positions that crowd at both ends, the outer ones next to 0 and 1."""
    q = np.linspace(0, 1, n_nodes)
    return np.clip(q**2 * (3 - 2 * q), 1e-6, 1 - 1e-6)


def unit_gauss_legendre(n_nodes):
    """Nodes and weights of Gauss–Legendre quadrature on (0, 1)."""
    nodes, weight = np.polynomial.legendre.leggauss(n_nodes)
    return (nodes + 1) / 2, weight / 2


@lru_cache
def population_quadrature(n_nodes):
    """Nodes and weights for averages over the population.

    Gauss–Legendre quadrature in q with p = q² (3 - 2q), whose nodes crowd at both
    ends, where functions of the log-odds of p are hard to integrate.
    """
    q, weight = unit_gauss_legendre(n_nodes)
    nodes, weight = q**2 * (3 - 2 * q), 6 * q * (1 - q) * weight
    nodes.flags.writeable = weight.flags.writeable = False  # one pair for all callers
    return nodes, weight


def population_cells(n_cells):
    """Nodes and weights for averages of functions that may jump, over the population.

    The midpoint rule in q with p = q² (3 - 2q), whose cells crowd at both ends. Where
    a function jumps between two nodes the average is off by at most half the larger of
    their weights, times the jump.
    """
    q = np.linspace(0, 1, 2 * n_cells + 1)
    p = q**2 * (3 - 2 * q)
    return p[1::2], np.diff(p[::2])


def largest_jump_error(cdf, weight):
    """Largest error that jumps between nodes give the average of each trial.

    Parameters
    ----------
    cdf : ndarray of shape (n_trials, n_nodes, ..., n_levels)
        Distribution function at each node of `population_cells`.
    weight : ndarray of shape (n_nodes,)
        Their weights.

    Returns
    -------
    error : ndarray of shape (n_trials,)
        Of the level where it is largest, if nothing happens between two nodes but one
        jump.
    """
    half = np.maximum(weight[1:], weight[:-1]) / 2
    error = np.einsum("tp...,p->t...", np.abs(np.diff(cdf, axis=1)), half)
    return error.reshape(len(error), -1).max(axis=1)
