"""Conformal scores of ratings that are nested in objects, and bounds from them.

Each calibration rating has a score, how far it is from the median that was predicted
for it, and a weight: those of one object sum to 1, whatever its touches and raters.
CDFs are given without the 1 at the highest level, of shape (n_trials, n_thresholds), or
of sliders at the edges of a grid, of shape (n_trials, n_edges).
"""

import numpy as np
from sklearn.utils import gen_batches

# Bounds that are sorted at once.
_BLOCK = 2**20
# Equal scores that were computed in other batches, or p-values, differ by less.
TOLERANCE = 1e-9
# Keeps the scale of a band above 0 where all or nobody is predicted below.
_LEAST_VARIANCE = 0.02


def level_scores(below):
    """Return how far each level is from the predicted median.

    Scores are up to 1, and 1 more for each level without any probability in between.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.ensembles._conformal_scores import level_scores
    >>> level_scores(np.array([[0.25, 0.75, 1.0, 1.0]]))
    array([[0.5, 0. , 0.5, 1. , 2. ]])
    """
    lower = np.pad(below, ((0, 0), (1, 0)))
    upper = np.pad(below, ((0, 0), (0, 1)), constant_values=1)
    score = 2 * np.maximum(np.maximum(lower - 0.5, 0.5 - upper), 0)
    above = np.cumsum(lower > 1 - TOLERANCE, axis=1)
    beneath = np.cumsum(upper[:, ::-1] < TOLERANCE, axis=1)[:, ::-1]
    return score + np.maximum(np.maximum(above, beneath) - 1, 0)


def value_scores(values, below, grid):
    """Return the scores of values on a slider, which grow on beyond the grid.

    Many people may leave a slider at an end, which no CDF within a cell can tell. So an
    end is as far from the median as the nearest value of its cell.

    Parameters
    ----------
    values : ndarray of shape (n_trials, n_values)
    below : ndarray of shape (n_trials, n_edges)
    grid : ndarray of shape (n_edges,)

    Returns
    -------
    score : ndarray of shape (n_trials, n_values)
    """
    at = [np.interp(each, grid, row) for each, row in zip(values, below, strict=True)]
    at = np.reshape(at, values.shape)
    at = np.where(values == grid[0], np.minimum(below[:, 1:2], 0.5), at)
    at = np.where(values == grid[-1], np.maximum(below[:, -2:-1], 0.5), at)
    beyond = np.maximum(grid[0] - values, values - grid[-1]) / (grid[-1] - grid[0])
    return 2 * np.abs(at - 0.5) + np.maximum(beyond, 0)


def highest_values(score, below, grid):
    """Return the highest values whose `value_scores` are at most some scores.

    `score` has any shape, and `below` is the CDF of one trial.
    """
    p = (1 + np.minimum(score, 1)) / 2
    cell = np.clip(np.searchsorted(below, p, side="right"), 1, len(grid) - 1)
    start, width = below[cell - 1], below[cell] - below[cell - 1]
    share = np.divide(p - start, width, out=np.ones_like(p), where=width > 0)
    inside = grid[cell - 1] + np.clip(share, 0, 1) * (grid[cell] - grid[cell - 1])
    inside = np.where(p + TOLERANCE >= below[-2], grid[-1], inside)  # with its cell
    beyond = np.where(score > 1 + 2 * TOLERANCE, score - 1, 0)  # ends stay exact
    return inside + beyond * (grid[-1] - grid[0])


def weight_at_least(score, known, weight):
    """Return the weight of the known scores that are at least as large.

    Parameters
    ----------
    score : ndarray of any shape
    known, weight : ndarray of shape (n_known,)

    Returns
    -------
    reached : ndarray of the shape of `score`
    """
    order = np.argsort(known)
    beyond = np.append(np.cumsum(weight[order][::-1])[::-1], 0.0)
    return beyond[np.searchsorted(known[order], score, side="left")]


def upper_bounds(values, weight, needed):
    """Return the lowest values up to which there is the weight needed, else infinity.

    Parameters
    ----------
    values : ndarray of shape (..., n_known)
    weight : ndarray of shape (n_known,)
    needed : float

    Returns
    -------
    bound : ndarray of shape (...)
    """
    order = np.argsort(values, axis=-1)
    total = np.cumsum(weight[order], axis=-1)
    place = np.sum(total < needed, axis=-1, keepdims=True)
    last = values.shape[-1] - 1
    bound = np.take_along_axis(order, np.minimum(place, last), axis=-1)
    bound = np.take_along_axis(values, bound, axis=-1)
    return np.where(place > last, np.inf, bound)[..., 0]


def value_bounds(folds, needed, sign):
    """Return the highest values of sliders, or of a negative sign the lowest.

    Parameters
    ----------
    folds : list of (below, grid, score, weight)
        Of each fold what its model predicts, and the scores that are known of it.
    needed : float
    sign : {1, -1}

    Returns
    -------
    bound : ndarray of shape (n_trials,)
        Infinite where the weight is less than needed.
    """
    if sign < 0:  # the highest values of what is mirrored
        folds = [
            (1 - below[:, ::-1], -grid[::-1], *rest) for below, grid, *rest in folds
        ]
    weight = np.concatenate([weight for *_, weight in folds])
    bound = np.empty(len(folds[0][0]))
    for i in range(len(bound)):
        values = [
            highest_values(score, below[i], grid) for below, grid, score, _ in folds
        ]
        bound[i] = upper_bounds(np.concatenate(values), weight, needed)
    return sign * bound + 0.0  # no -0


def band_bounds(folds, needed, sign):
    """Return the upper bounds of a band at each threshold, or the lower ones.

    Parameters
    ----------
    folds : list of (below, residual, weight)
        Of each fold what its model predicts, and the residuals that are known of it.
    needed : float
    sign : {1, -1}

    Returns
    -------
    bound : ndarray of shape (n_trials, n_thresholds)
        Infinite where the weight is less than needed.
    """
    weight = np.concatenate([weight for *_, weight in folds])
    bound = np.empty(folds[0][0].shape)
    n_rows = 1 + _BLOCK // (1 + weight.size * bound.shape[1])
    for rows in gen_batches(len(bound), n_rows):
        values = [
            sign * below[rows, :, np.newaxis]
            + band_scale(below[rows, :, np.newaxis]) * residual
            for below, residual, _ in folds
        ]
        bound[rows] = upper_bounds(np.concatenate(values, axis=2), weight, needed)
    return sign * bound


def band_scale(below):
    """Return how much room a band leaves to each share, by its standard deviation."""
    return np.sqrt(below * (1 - below) + _LEAST_VARIANCE)


def band_residuals(true, below):
    """Return the largest departure of the true CDFs, in units of `band_scale`."""
    return np.max(np.abs(true - below) / band_scale(below), axis=1, initial=0)


def monotone_band(lower, upper):
    """Return bounds of CDFs, cut to [0, 1] and so that they never fall."""
    upper = np.minimum.accumulate(upper[:, ::-1], axis=1)[:, ::-1]
    return np.clip(np.maximum.accumulate(lower, axis=1), 0, 1), np.clip(upper, 0, 1)


def without_gaps(chosen):
    """Return sets of levels with all between their lowest and their highest.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.ensembles._conformal_scores import without_gaps
    >>> without_gaps(np.array([[True, False, True, False]]))
    array([[ True,  True,  True, False]])
    """
    from_below = np.logical_or.accumulate(chosen, axis=1)
    return from_below & np.logical_or.accumulate(chosen[:, ::-1], axis=1)[:, ::-1]
