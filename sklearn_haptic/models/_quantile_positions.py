"""Quantile positions at which a trial is observed.

The people who rate an object are ordered by their rating, lowest first. A quantile
position p in (0, 1) is a place in this order, so every rating takes up an interval of
positions as long as its share of the people. Trials are observed at such positions, and
distributions are decoded from what is predicted along the population.

There, `predict` is a function of the features of some trials, of shape (n_trials,
n_features), and of quantile positions, of shape (n_positions,). It returns the
probability of each level, of shape (n_trials, n_positions, n_levels), with an axis of
adjectives before that of the levels if there are several.
"""

from functools import lru_cache

import numpy as np
from sklearn.utils import gen_batches

from ..ratings._distributions import level_at, quantile_grid, shares

# Cells of the population in which a trial is observed. Where nine of ten people agree,
# the mean of a linear model's predictions is off by .006 with 10, .003 with 16.
_TRAINING_CELLS = 16

# Share of the people below which those of a level in a cell are a rounding error.
_ROUNDING = 4 * np.finfo(float).eps

# With 20 nodes the CDF is off by less than 1e-4 for weights of the log-odds up to 2, by
# less than 1e-3 up to 4. They are used if on some training trials they differ from the
# smallest number of cells by no more than the error below.
_MIXTURE_NODES = 20
_SMOOTH_ERROR, _SMOOTH_TRIALS, _SMOOTH_AMONG, _SMOOTH_CELLS = 0.003, 32, 256, 32

# What jumps is averaged over cells, over more while the CDF may be off by this much.
_CELLS = (384, 1024, 4096, 16384)
_JUMP_ERROR = 0.0045

# With 385 nodes networks of up to 30 units were off by less than 3e-3, 3e-4 on average,
# with 33 by up to 7e-2, where people are of two minds.
_CROSSING_NODES = 385

# Few trials at a time, so that what is predicted for them stays in the cache.
_BATCH_SIZE, _BATCH_POSITIONS = 256, 2**17


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
        return _levels_in_cells(counts, n_duplicates)
    positions = random_state.uniform(size=(len(counts), n_duplicates))
    positions = clip_positions(positions)
    return positions, level_at(counts, positions), np.ones_like(positions)


def _levels_in_cells(counts, n_duplicates):
    """Return the middles of cells, and the levels of the people in each cell.

    All trials have the same cells. If positions depended on a trial's ratings, what
    learns by heart would know its trials by them, and the levels between them would be
    left to chance: with nodes within each level, the mean of a forest's predictions was
    off by up to .16. Rows are filled up with observations of no weight.
    """
    share = shares(counts)
    unanimous = np.count_nonzero(share, axis=1).max() == 1  # positions tell nothing
    middle, width = population_cells(3 if unanimous else _TRAINING_CELLS)
    cells = np.broadcast_to(np.cumsum(width), (len(share), len(width)))
    ends = np.hstack((cells, np.cumsum(share, axis=1)))
    order = np.argsort(ends, axis=1, kind="stable")
    weight = np.diff(np.take_along_axis(ends, order, axis=1), axis=1, prepend=0)
    of_level = order >= len(width)
    level = np.cumsum(of_level, axis=1) - of_level  # how many ended before
    cell = np.cumsum(~of_level, axis=1) - ~of_level
    weight[weight <= _ROUNDING] = 0
    size = np.count_nonzero(weight, axis=1).max()
    first = np.argsort(weight == 0, axis=1, kind="stable")[:, :size]
    cell, level, weight = (
        np.take_along_axis(each, first, axis=1) for each in (cell, level, weight)
    )
    unused = weight == 0
    cell[unused] = level[unused] = 0
    return middle[cell], level, weight * n_duplicates


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


def _crowded(q):
    """Move points of [0, 1] towards its ends, where they crowd."""
    return q**2 * (3 - 2 * q)


@lru_cache
def population_quadrature(n_nodes):
    """Return nodes and weights for averages over the population.

    Gauss–Legendre quadrature in q with p = q² (3 - 2q). Its nodes crowd at both ends,
    where functions of the log-odds of p are hard to integrate.
    """
    q, weight = np.polynomial.legendre.leggauss(n_nodes)
    q, weight = (q + 1) / 2, weight / 2
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


def decide(proba, rule):
    """Index of the one level that a distribution stands for, over the last axis."""
    if rule == "argmax":
        return proba.argmax(axis=-1)
    return np.sum(np.cumsum(proba[..., :-1], axis=-1) < 0.5, axis=-1)


def is_smooth(predict, X, among=None):
    """Whether few nodes give about the same mixture of trials as many cells do.

    It asks about evenly spaced trials, or those `among` them, and halfway between them,
    because trees may know the trials by heart; in full, where few cells differ most
    from the nodes.
    """
    among = np.arange(len(X)) if among is None else among
    spaced = np.unique(np.linspace(0, len(among) - 1, _SMOOTH_AMONG).astype(np.intp))
    some = X[among[spaced]]
    some = np.concatenate((some, some / 2 + np.roll(some, 1, axis=0) / 2))
    few, _ = _average(predict, some, *population_quadrature(_MIXTURE_NODES))
    cells, _ = _average(predict, some, *population_cells(_SMOOTH_CELLS))
    unlike = np.abs(np.cumsum(few - cells, axis=-1)).reshape(len(few), -1).max(axis=1)
    asked = np.argsort(-unlike, kind="stable")[:_SMOOTH_TRIALS]
    many, _ = _average(predict, some[asked], *population_cells(_CELLS[0]))
    error = np.cumsum(few[asked] - many, axis=-1)
    return np.abs(error).max() <= _SMOOTH_ERROR


def mixture(predict, X, smooth):
    """Average the predicted probabilities over the population."""
    if not smooth:
        return average_over_cells(predict, X)
    return _average(predict, X, *population_quadrature(_MIXTURE_NODES))[0]


def share_of_modes(predict, X, n_quantiles):
    """Share of evenly spaced positions at which each level is the most probable."""
    weight = np.ones(n_quantiles)
    return _average(predict, X, quantile_grid(n_quantiles), weight, "argmax")[0]


def ratings_at(predict, X, positions, rule):
    """Index of the level that a rule decides on for each trial at each position.

    Returns
    -------
    level : ndarray of int of shape (n_trials, n_positions), or \
            (n_trials, n_adjectives, n_positions)
    """
    decided = [
        decide(predict(X[batch], positions), rule) for batch in _batches(X, positions)
    ]
    return np.moveaxis(np.concatenate(decided), 1, -1)


def _batches(X, positions):
    """Return slices of few trials."""
    size = max(1, min(_BATCH_SIZE, _BATCH_POSITIONS // len(positions)))
    return gen_batches(len(X), size)


def share_between_crossings(base, X, to_input, to_position):
    """Share of the population for which each level is the median, at every position.

    `base` has ``predict_latent_with_positions``; `to_input` and `to_position` lead from
    a position in the population to what it is given, and back. The shares have the
    shape (n_trials, n_levels).
    """
    positions = _crowded(np.linspace(0, 1, _CROSSING_NODES))
    inputs = to_input(np.clip(positions, 1e-6, 1 - 1e-6))
    shares = []
    for batch in gen_batches(len(X), _BATCH_SIZE):
        latent = base.predict_latent_with_positions(X[batch], inputs)
        several = latent.reshape(*latent.shape[:2], -1)
        cdf = [
            share_below(response, thresholds, inputs, to_position)
            for response, thresholds in zip(
                np.moveaxis(several, -1, 0), np.atleast_2d(base.thresholds_)
            )
        ]
        cdf = np.stack(cdf, axis=1).reshape(len(latent), *latent.shape[2:], -1)
        share = np.diff(cdf, axis=-1, prepend=0, append=1)
        shares.append(np.maximum(share, 0))
    return np.concatenate(shares)


def average_over_cells(predict, X, rule=None, n_cells=_CELLS):
    """Average the probabilities, or what a rule decides, where they may jump anywhere.

    More cells are taken for the trials that need them.
    """
    n_cells, *more = n_cells
    proba, error = _average(predict, X, *population_cells(n_cells), rule, True)
    rough = error > _JUMP_ERROR
    if more and rough.any():
        proba[rough] = average_over_cells(predict, X[rough], rule, more)
    return proba


def _average(predict, X, positions, weight, rule=None, with_error=False):
    """Average the probabilities, or what a rule decides, over positions.

    Returns
    -------
    average : ndarray of shape (n_trials, n_levels)
    error : ndarray of shape (n_trials,), or None
        The largest error by jumps between positions, if asked for.
    """
    averages, errors = [], []
    for batch in _batches(X, positions):
        proba = predict(X[batch], positions)
        if rule is not None:
            decided = decide(proba, rule)[..., None]
            proba = (decided == np.arange(proba.shape[-1])).astype(float)
        averages.append(np.einsum("tp...,p->t...", proba, weight))
        if with_error:
            errors.append(largest_jump_error(np.cumsum(proba, axis=-1), weight))
    return np.concatenate(averages), np.concatenate(errors) if with_error else None
