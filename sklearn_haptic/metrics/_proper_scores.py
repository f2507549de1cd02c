"""Proper scores: ranked probability scores and the logarithmic score."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import xlogy

from ..ratings._checks import check_distributions
from ..ratings._continuous import check_answers, check_cdf, crps_per_trial
from ..ratings._distributions import cdf, shares
from ..ratings._levels import level_values
from ._score import as_score, summarise


@as_score()
def ranked_probability_score(
    y_true: ArrayLike,
    y_proba: ArrayLike,
    *,
    sample_weight: ArrayLike | None = None,
    average: bool = True,
    levels: ArrayLike | None = None,
    units: Literal["levels", "scale"] = "levels",
) -> float | NDArray[np.float64]:
    r"""Ranked probability score, averaged over the people who rated a trial.

    Parameters
    ----------
    y_true : array-like of shape (n_trials, n_levels) or (n_trials,)
    y_proba : array-like of shape (n_trials, n_levels)
    sample_weight : array-like of shape (n_trials,), default=None
    average : bool, default=True
    levels : array-like of shape (n_levels,), default=None
    units : {"levels", "scale"}, default="levels"
        All six are those of :func:`macro_mae`.

    Returns
    -------
    score : float or ndarray of shape (n_trials,)
        Score in levels, at most n_levels - 1 and not divided by it, or in units of
        the scale; lower is better.

    Raises
    ------
    ValueError
        If a row of ``y_proba`` is not a distribution, a trial has no ratings or
        unknown ones, or the shapes differ.

    Notes
    -----
    The mean over the N people r of a trial is

    .. math:: \frac1N \sum_r \sum_{k=1}^{K-1} (\hat F_k - 1\{y_r \le k\})^2
        = \sum_{k=1}^{K-1} \left[(\hat F_k - F_k)^2 + F_k (1 - F_k)\right].

    The score is strictly proper: the true distribution scores best, and its score
    is the second term, which is 0 only where people agree. With ``units="scale"`` each
    term is multiplied by the distance of its two levels, and the score is the
    continuous ranked probability score of the levels' numbers.

    References
    ----------
    E. S. Epstein, "A scoring system for probability forecasts of ranked
    categories", Journal of Applied Meteorology 8, 985–987, 1969.
    :doi:`10.1175/1520-0450(1969)008<0985:ASSFPF>2.0.CO;2`

    T. Gneiting and A. E. Raftery, "Strictly proper scoring rules, prediction, and
    estimation", JASA 102, 359–378, 2007. :doi:`10.1198/016214506000001437`

    Examples
    --------
    >>> from sklearn_haptic.metrics import ranked_probability_score
    >>> ranked_probability_score([[1, 1, 2]], [[0.25, 0.25, 0.5]])
    0.4375

    On a scale with the levels -3, 0 and 3 neighbours are 3 apart:

    >>> ranked_probability_score(
    ...     [[1, 1, 2]], [[0.25, 0.25, 0.5]], levels=[-3, 0, 3], units="scale"
    ... )
    1.3125
    """
    counts, proba, levels = check_distributions(y_true, y_proba, levels)
    true, predicted = cdf(counts)[:, :-1], cdf(proba)[:, :-1]
    gaps = np.diff(level_values(levels, units))
    scores = (((predicted - true) ** 2 + true * (1 - true)) * gaps).sum(axis=1)
    return summarise(scores, sample_weight, average)


@as_score(y_cdf=["array-like"], values=["array-like"])
def crps(
    y_true: ArrayLike | Sequence[ArrayLike],
    y_cdf: ArrayLike,
    values: ArrayLike,
    *,
    sample_weight: ArrayLike | None = None,
    average: bool = True,
) -> float | NDArray[np.float64]:
    r"""Continuous ranked probability score, averaged over the people who rated a trial.

    It is the ranked probability score of ratings that are numbers, such as those of a
    slider, in units of the scale. It is exact for the CDF that is linear between the
    points given.

    Parameters
    ----------
    y_true : array-like of shape (n_trials,) or (n_trials, n_answers), or list
        One rating per trial; or several, NaN where somebody gave none; or one list of
        ratings, of any length, per trial.
    y_cdf : array-like of shape (n_trials, n_points) or (n_points,)
        Predicted CDF at the points, as ``predict_cdf(X, values)`` of a
        `ContinuousRatingsRegressor` returns it; for predicted quantiles their
        positions. It is 0 below the first point and 1 above the last, and jumps there
        if it does not reach from 0 to 1.
    values : array-like of shape (n_trials, n_points) or (n_points,)
        The points, ascending; for predicted quantiles these. Equal points make a jump.
    sample_weight : array-like of shape (n_trials,), default=None
        Weight of each trial in the average.
    average : bool, default=True
        Whether to return the weighted mean rather than one score per trial.

    Returns
    -------
    score : float or ndarray of shape (n_trials,)
        Score in units of the scale; lower is better.

    Raises
    ------
    ValueError
        If a trial has no rating, a CDF or its points fall, or the shapes differ.

    See Also
    --------
    ranked_probability_score : The same, with ``units="scale"``, of levels.

    Notes
    -----
    The mean over the people r of a trial is
    :math:`\frac1N \sum_r \int (\hat F(x) - 1\{y_r \le x\})^2 \, dx`. It is strictly
    proper. A prediction that is sure of one value scores its absolute error.

    References
    ----------
    J. E. Matheson and R. L. Winkler, "Scoring rules for continuous probability
    distributions", Management Science 22, 1087–1096, 1976.
    :doi:`10.1287/mnsc.22.10.1087`

    Examples
    --------
    An even distribution over 0 … 100, and two people who moved the slider to 50 and 80:

    >>> from sklearn_haptic.metrics import crps
    >>> round(crps([[50, 80]], [0, 1], [0, 100]), 3)
    12.833
    """
    answers = check_answers(y_true, "y_true")
    scores = crps_per_trial(answers, *check_cdf(y_cdf, values, len(answers)))
    return summarise(scores, sample_weight, average)


@as_score()
def log_score(
    y_true: ArrayLike,
    y_proba: ArrayLike,
    *,
    sample_weight: ArrayLike | None = None,
    average: bool = True,
    levels: ArrayLike | None = None,
) -> float | NDArray[np.float64]:
    r"""Logarithmic score, averaged over the people who rated a trial.

    Parameters
    ----------
    y_true : array-like of shape (n_trials, n_levels) or (n_trials,)
    y_proba : array-like of shape (n_trials, n_levels)
    sample_weight : array-like of shape (n_trials,), default=None
    average : bool, default=True
    levels : array-like of shape (n_levels,), default=None
        All five are those of :func:`macro_mae`.

    Returns
    -------
    score : float or ndarray of shape (n_trials,)
        Score in nats, at least 0; lower is better. The score of a trial is infinite
        if somebody chose a level of probability 0, and so is an average over it.

    Raises
    ------
    ValueError
        If a row of ``y_proba`` is not a distribution, a trial has no ratings or
        unknown ones, or the shapes differ.

    Notes
    -----
    With :math:`n_k` of N people at level k, the score is
    :math:`-\sum_k (n_k / N) \log \hat p_k`, where :math:`0 \log 0 = 0`. It is
    strictly proper, and ignores the order of the levels.

    References
    ----------
    T. Gneiting and A. E. Raftery, "Strictly proper scoring rules, prediction, and
    estimation", JASA 102, 359–378, 2007. :doi:`10.1198/016214506000001437`

    Examples
    --------
    >>> from sklearn_haptic.metrics import log_score
    >>> round(log_score([[1, 1, 0]], [[0.5, 0.5, 0]]), 4)
    0.6931
    """
    counts, proba, _ = check_distributions(y_true, y_proba, levels)
    scores = -xlogy(shares(counts), proba).sum(axis=1)
    return summarise(scores + 0.0, sample_weight, average)  # -0.0 becomes 0.0


PROPER_SCORES = (ranked_probability_score, crps, log_score)
