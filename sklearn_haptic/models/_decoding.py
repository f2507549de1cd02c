"""Distributions of ratings from what is predicted along the population.

Here `predict` is a function of the features of some trials, of shape (n_trials,
n_features), and of quantile positions, of shape (n_positions,). It returns the
probability of each level, of shape (n_trials, n_positions, n_levels), with an axis of
adjectives before that of the levels if there are several.
"""

import numpy as np
from sklearn.utils import gen_batches

from ..ratings._distributions import quantile_grid
from ._quantile_positions import (
    crossing_positions,
    largest_jump_error,
    population_cells,
    population_quadrature,
    share_below,
)

# With 20 nodes the CDF is off by less than 1e-4 for weights of the log-odds up to 2, by
# less than 1e-3 up to 4. They are used if on some training trials they differ from the
# smallest number of cells by no more than the error below.
_MIXTURE_NODES = 20
_SMOOTH_ERROR, _SMOOTH_TRIALS = 0.003, 32

# What jumps is averaged over cells, over more while the CDF may be off by this much.
_CELLS = (384, 1024, 4096, 16384)
_JUMP_ERROR = 0.0045

# With 33 nodes networks of up to 30 units were off by less than 1e-2, 1e-4 on average,
# where a grid of 99 positions is off by 1e-2.
_CROSSING_NODES = 33

# Few trials at a time, so that what is predicted for them stays in the cache.
_BATCH_SIZE, _BATCH_POSITIONS = 256, 2**17


def decide(proba, rule):
    """Index of the one level that a distribution stands for, over the last axis."""
    if rule == "argmax":
        return proba.argmax(axis=-1)
    return np.sum(np.cumsum(proba[..., :-1], axis=-1) < 0.5, axis=-1)


def is_smooth(predict, X):
    """Whether few nodes give about the same mixture of some trials as many cells do."""
    some = X[:: max(1, len(X) // _SMOOTH_TRIALS)][:_SMOOTH_TRIALS]
    few, _ = _average(predict, some, *population_quadrature(_MIXTURE_NODES))
    many, _ = _average(predict, some, *population_cells(_CELLS[0]))
    return np.abs(np.cumsum(few - many, axis=-1)).max() <= _SMOOTH_ERROR


def mixture(predict, X, smooth):
    """Average the predicted probabilities over the population."""
    if not smooth:
        return _average_over_cells(predict, X)
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
    size = max(1, min(_BATCH_SIZE, _BATCH_POSITIONS // len(positions)))
    decided = [
        decide(predict(X[batch], positions), rule)
        for batch in gen_batches(len(X), size)
    ]
    return np.moveaxis(np.concatenate(decided), 1, -1)


def share_of_medians(predict, X):
    """Share of the population for which each level is the median."""
    return _average_over_cells(predict, X, "median")


def share_between_crossings(base, X, to_input, to_position):
    """Share of the population for which each level is the median, at every position.

    `base` is a `HasLatentResponse`; `to_input` and `to_position` lead from a position
    in the population to what it is given, and back. The shares have the shape
    (n_trials, n_levels).
    """
    inputs = to_input(crossing_positions(_CROSSING_NODES))
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


def _average_over_cells(predict, X, rule=None):
    """Average what may jump anywhere, over more cells for the trials that need them."""
    proba, error = _average(predict, X, *population_cells(_CELLS[0]), rule, True)
    rough = np.flatnonzero(error > _JUMP_ERROR)
    for n_cells in _CELLS[1:]:
        if len(rough) == 0:
            break
        proba[rough], error = _average(
            predict, X[rough], *population_cells(n_cells), rule, True
        )
        rough = rough[error > _JUMP_ERROR]
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
    size = max(1, min(_BATCH_SIZE, _BATCH_POSITIONS // len(positions)))
    for batch in gen_batches(len(X), size):
        proba = predict(X[batch], positions)
        if rule is not None:
            decided = decide(proba, rule)[..., None]
            proba = (decided == np.arange(proba.shape[-1])).astype(float)
        averages.append(np.einsum("tp...,p->t...", proba, weight))
        if with_error:
            errors.append(largest_jump_error(np.cumsum(proba, axis=-1), weight))
    return np.concatenate(averages), np.concatenate(errors) if with_error else None
