"""Distributions over levels: shares, CDF, inverse CDF and macro-averaged error.

The last axis of every array of counts is that of the levels. Counts may be any
non-negative weights or probabilities that are not all zero.
"""

import numpy as np


def shares(counts):
    """Return counts divided by their total, which sum to 1."""
    return counts / counts.sum(axis=-1, keepdims=True)


def as_distributions(proba, who):
    """Return what a model predicts; refuse what is not one distribution per trial.

    Classifiers of scikit-learn take each column of counts for labels of its own, and
    predict a list. A ValueError names the model.
    """
    many = isinstance(proba, list)
    if many or not np.allclose(np.sum(proba, axis=-1), 1, rtol=0, atol=1e-5):
        raise ValueError(
            f"{who} predicts no distribution, as if it took each column of y for "
            "labels of its own; give it to a DistributionalOrdinalRegressor as "
            "estimator, which takes counts."
        )
    return proba


def cdf(counts):
    """Return the share at or below each level, exactly 1 from the highest level used.

    Counts are summed before they are divided, so that for whole numbers each entry is
    the double nearest to the fraction.
    """
    below = np.cumsum(counts, axis=-1)
    return below / below[..., -1:]


def raised(proba, power):
    """Raise distributions to a power: one above 1 sharpens, one below 1 flattens.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.ratings._distributions import raised
    >>> raised(np.array([0.5, 0.25, 0.25]), 2.0).round(2)
    array([0.67, 0.17, 0.17])
    """
    if np.all(power == 1):
        return proba
    return shares((proba / proba.max(axis=-1, keepdims=True)) ** power)


def quantile_grid(n_quantiles):
    """Return evenly spaced positions strictly inside (0, 1): 0.01 … 0.99 for 99."""
    return np.arange(1, n_quantiles + 1) / (n_quantiles + 1)


def level_at(counts, p):
    """Return the inverse CDF, as indices of levels.

    Of counts of shape (..., n_levels) it is taken at quantile positions `p` within [0,
    1], broadcastable to (..., n_p); a vector is shared by all distributions.
    """
    below = np.cumsum(counts, axis=-1, dtype=np.float64)
    below = np.ldexp(below, -np.frexp(below[..., -1:])[1])  # totals in [1/2, 1)
    # Lower each rank by a few ulps so that rounding never skips a level; differences
    # between ranks are larger. Ranks stay above 0, so that levels below the lowest one
    # used are passed over.
    tolerance = 4 * below.shape[-1] * np.finfo(np.float64).eps
    rank = np.maximum(
        p * below[..., -1:] * (1 - tolerance), np.finfo(np.float64).smallest_subnormal
    )
    index = np.zeros(rank.shape, dtype=np.intp)
    for column in np.moveaxis(below, -1, 0)[:-1]:
        index += column[..., None] < rank
    return index


def macro_error(predicted, true, counted=True, *, values=None):
    """Return the absolute error per trial, averaged over the levels true in it.

    `predicted` and `true` are indices of levels, of shape (n_trials, n_observations),
    and `counted` says which observations count, at least one per trial. Errors are in
    levels, or in units of `values`, the number of each level.
    """
    if values is None:
        error = np.abs(predicted - true)
    else:
        error = np.abs(values[predicted] - values[true])
    total = np.zeros(len(error))
    n_levels = np.zeros(len(error))
    for level in np.unique(true):
        here = (true == level) & counted
        n_here = here.sum(axis=1)
        total += (error * here).sum(axis=1) / np.maximum(n_here, 1)
        n_levels += n_here > 0
    return total / n_levels
