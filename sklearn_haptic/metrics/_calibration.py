"""Whether predicted distributions are as wide as ratings scatter about them."""

from __future__ import annotations

from numbers import Integral
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..ratings._checks import check_distributions
from ..ratings._distributions import cdf, shares
from ..ratings._levels import level_values
from ..utils._sklearn import Interval
from ._score import as_score, weighted_mean

_ROUNDING = 1e-12  # of a CDF at the edge of two bins


@as_score(n_bins=[Interval(Integral, 1, None, closed="left")])
def pit_histogram(
    y_true: ArrayLike,
    y_proba: ArrayLike,
    n_bins: int = 10,
    *,
    sample_weight: ArrayLike | None = None,
    levels: ArrayLike | None = None,
) -> NDArray[np.float64]:
    r"""Histogram of the probability integral transform of the ratings.

    Parameters
    ----------
    y_true : array-like of shape (n_trials, n_levels) or (n_trials,)
        How many people chose each level, or one rating per trial.
    y_proba : array-like of shape (n_trials, n_levels)
        Predicted probability of each level.
    n_bins : int, default=10
        Number of equally wide bins of [0, 1].
    sample_weight : array-like of shape (n_trials,), default=None
        Weight of each trial.
    levels : array-like of shape (n_levels,), default=None
        As in :func:`macro_mae`.

    Returns
    -------
    heights : ndarray of shape (n_bins,)
        Density in each bin, with mean 1. All are 1 for calibrated predictions; high
        outer bins mean that predictions are too narrow, high middle bins that they
        are too wide.

    Raises
    ------
    ValueError
        If a row of ``y_proba`` is not a distribution, a trial has no ratings or
        unknown ones, or the shapes differ.

    Notes
    -----
    This is the histogram for discrete data, without randomisation. A rating at level k
    is spread evenly over the interval from :math:`\hat F_{k-1}` to :math:`\hat F_k`.
    If level k had probability 0 the interval is a point, which belongs to the upper of
    two bins. Each of the N people of a trial counts 1 / N.

    References
    ----------
    C. Czado, T. Gneiting and L. Held, "Predictive model assessment for count
    data", Biometrics 65, 1254–1261, 2009.
    :doi:`10.1111/j.1541-0420.2009.01191.x`

    Examples
    --------
    >>> from sklearn_haptic.metrics import pit_histogram
    >>> pit_histogram([[1, 2, 1]], [[0.25, 0.5, 0.25]], n_bins=4)
    array([1., 1., 1., 1.])
    >>> pit_histogram([[2, 0, 2]], [[0.25, 0.5, 0.25]], n_bins=4)
    array([2., 0., 0., 2.])
    """
    counts, proba, _ = check_distributions(y_true, y_proba, levels)
    proportions = shares(counts)
    edges = np.pad(cdf(proba), ((0, 0), (1, 0)))
    lower, width = edges[:, :-1], np.diff(edges, axis=1)
    point = width == 0
    below = np.empty((len(counts), n_bins + 1))  # CDF of the PIT at the bins' edges
    for j in range(1, n_bins):
        u = j / n_bins
        share = np.clip(u - lower, 0, width) / np.where(point, 1, width)
        passed = np.where(point, u - lower > _ROUNDING, share)
        below[:, j] = (proportions * passed).sum(axis=1)
    below[:, 0], below[:, -1] = 0, 1
    np.minimum(below, 1, out=below)  # sums may round up
    return n_bins * np.diff(weighted_mean(below, sample_weight))


@as_score()
def dispersion(
    y_true: ArrayLike,
    y_proba: ArrayLike,
    *,
    sample_weight: ArrayLike | None = None,
    levels: ArrayLike | None = None,
    units: Literal["levels", "scale"] = "levels",
) -> float:
    r"""Predicted variance relative to the ratings' scatter about the prediction.

    Parameters
    ----------
    y_true : array-like of shape (n_trials, n_levels) or (n_trials,)
        How many people chose each level, or one rating per trial.
    y_proba : array-like of shape (n_trials, n_levels)
        Predicted probability of each level.
    sample_weight : array-like of shape (n_trials,), default=None
        Weight of each trial.
    levels : array-like of shape (n_levels,), default=None
        As in :func:`macro_mae`.
    units : {"levels", "scale"}, default="levels"
        As in :func:`macro_mae`.

    Returns
    -------
    ratio : float
        1 if the predicted spread is right, below 1 if the predictions are
        overconfident, above 1 if they are too wide. If every rating equals its
        predicted mean, infinite, or 1 if no spread was predicted.

    Raises
    ------
    ValueError
        If a row of ``y_proba`` is not a distribution, a trial has no ratings or
        unknown ones, or the shapes differ.

    Notes
    -----
    With the predicted mean :math:`\hat\mu_t` and variance :math:`\hat\sigma_t^2` of
    trial t, and the proportion :math:`f_{tk}` of people at level k, the ratio is
    :math:`\sum_t \hat\sigma_t^2 / \sum_t \sum_k f_{tk} (k - \hat\mu_t)^2`. Both
    sums have the same expectation if the ratings are drawn from the predictions.

    References
    ----------
    C. Czado, T. Gneiting and L. Held, "Predictive model assessment for count
    data", Biometrics 65, 1254–1261, 2009 (the normalised squared error score, of
    which this is a pooled inverse). :doi:`10.1111/j.1541-0420.2009.01191.x`

    Examples
    --------
    >>> from sklearn_haptic.metrics import dispersion
    >>> dispersion([[2, 0, 2]], [[0.25, 0.5, 0.25]])
    0.5
    """
    counts, proba, levels = check_distributions(y_true, y_proba, levels)
    values = level_values(levels, units)
    values = np.ldexp(values, -np.frexp(np.abs(values).max())[1])  # squares stay finite
    squares = (values - (proba @ values)[:, None]) ** 2
    spread = weighted_mean((proba * squares).sum(axis=1), sample_weight)
    scatter = weighted_mean((shares(counts) * squares).sum(axis=1), sample_weight)
    if scatter == 0:
        return 1.0 if spread == 0 else np.inf
    return float(spread / scatter)
