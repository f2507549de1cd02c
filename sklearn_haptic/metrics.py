r"""Scores of predicted distributions of ratings, and scorers for searches.

Throughout, trial t has the *true* distribution :math:`F_k`, the proportion of
people who rated its object at level k or below, and the *predicted* one
:math:`\hat F_k`. Levels are ordinal, so distances between ratings are counted in
levels: neighbours are 1 apart whatever their labels. Where the levels are numbers that
mean something, as -3 … 3 or 0 … 100 do, ``units="scale"`` counts in these numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from numbers import Integral
from typing import Any, Literal, Protocol, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import xlogy
from sklearn.base import BaseEstimator
from sklearn.pipeline import Pipeline
from sklearn.utils import Bunch, check_random_state

from ._answers import check_answers, check_cdf, crps_per_trial, half_mean_difference
from ._check_ratings import (
    check_distributions,
    check_predicted_ratings,
    check_ratings,
)
from ._distributions import cdf, level_at, macro_error, quantile_grid, shares
from ._levels import level_values
from ._shrinkage import leave_one_out_strength, mean_of_others
from ._sklearn import Interval, RandomState, StrOptions, Trials, validate_params
from ._validation import check_positions, check_weights

__all__ = [
    "crps",
    "dispersion",
    "earth_movers_distance",
    "log_score",
    "macro_mae",
    "macro_mae_at_positions",
    "neg_macro_mae_scorer",
    "neg_rps_scorer",
    "noise_ceiling",
    "pit_histogram",
    "ranked_probability_score",
]


_CONSTRAINTS = {
    "y_true": ["array-like"],
    "y_proba": ["array-like"],
    "sample_weight": ["array-like", None],
    "levels": ["array-like", None],
}
_UNITS = [StrOptions({"levels", "scale"})]


class _Score(Protocol):
    """Type of a score: a float, or an array with ``average=False``."""

    @overload
    def __call__(
        self,
        y_true: ArrayLike,
        y_proba: ArrayLike,
        *,
        sample_weight: ArrayLike | None = ...,
        average: Literal[True] = ...,
        levels: ArrayLike | None = ...,
        **options: Any,
    ) -> float: ...

    @overload
    def __call__(
        self,
        y_true: ArrayLike,
        y_proba: ArrayLike,
        *,
        sample_weight: ArrayLike | None = ...,
        average: Literal[False],
        levels: ArrayLike | None = ...,
        **options: Any,
    ) -> NDArray[np.float64]: ...


def _score(**constraints: list[Any]) -> Callable[[Callable[..., Any]], _Score]:
    """Decorate a score: validate its parameters, and state its type once for all."""
    decorate: Any = validate_params(
        {**_CONSTRAINTS, "average": ["boolean"], **constraints},
        prefer_skip_nested_validation=True,
    )
    return decorate


@_score(units=_UNITS, n_quantiles=[Interval(Integral, 1, None, closed="left")])
def macro_mae(
    y_true: ArrayLike,
    y_proba: ArrayLike,
    *,
    sample_weight: ArrayLike | None = None,
    average: bool = True,
    levels: ArrayLike | None = None,
    units: Literal["levels", "scale"] = "levels",
    n_quantiles: int = 99,
) -> float | NDArray[np.float64]:
    r"""Macro-averaged mean absolute error of the predicted ratings, per trial.

    Parameters
    ----------
    y_true : array-like of shape (n_trials, n_levels) or (n_trials,)
        How many people chose each level, or one rating per trial.
    y_proba : array-like of shape (n_trials, n_levels)
        Predicted probability of each level.
    sample_weight : array-like of shape (n_trials,), default=None
        Weight of each trial in the average.
    average : bool, default=True
        Whether to return the weighted mean rather than one score per trial.
    levels : array-like of shape (n_levels,), default=None
        The ordered levels, to which ratings and labelled columns are matched. By
        default the ordered categories or column labels of ``y_true``, or else of
        ``y_proba``; without labels, the columns of counts or the sorted ratings.
    units : {"levels", "scale"}, default="levels"
        Whether neighbouring levels are 1 apart, or as far as their numbers are.
    n_quantiles : int, default=99
        Number of quantile positions p at which ratings are compared.

    Returns
    -------
    score : float or ndarray of shape (n_trials,)
        Error in levels, from 0 (best) to n_levels - 1; or in units of the scale.

    Raises
    ------
    ValueError
        If a row of ``y_proba`` is not a distribution, a trial has no ratings or
        unknown ones, or the shapes differ.

    See Also
    --------
    macro_mae_at_positions : The same error of ratings predicted one by one.

    Notes
    -----
    At :math:`p_i = i / (n + 1)`, i = 1, …, n, the true rating is
    :math:`y_i = F^{-1}(p_i)` and the predicted one :math:`\hat F^{-1}(p_i)`. With
    the levels X that occur among the :math:`y_i`,

    .. math:: \mathrm{MAE}^M = \frac{1}{|X|} \sum_{x \in X}
        \frac{1}{|\{i : y_i = x\}|} \sum_{i : y_i = x} |\hat F^{-1}(p_i) - y_i|.

    A level that one person in twelve chose weighs as much as one that eleven
    chose. The score is therefore not proper: a prediction with more weight away from
    the commonest level can score better than the truth. Report it beside a proper
    score.

    References
    ----------
    Richardson and Kuchenbecker (2020), equation 3. :doi:`10.3389/fnbot.2019.00116`

    S. Baccianella, A. Esuli and F. Sebastiani, "Evaluation measures for ordinal
    regression", ISDA 2009. :doi:`10.1109/ISDA.2009.230`

    Examples
    --------
    >>> from sklearn_haptic.metrics import macro_mae
    >>> macro_mae([[3, 0, 1]], [[0.75, 0.25, 0]])
    0.5
    """
    counts, proba, levels = check_distributions(y_true, y_proba, levels)
    p, values = quantile_grid(n_quantiles), level_values(levels, units)
    errors = macro_error(level_at(proba, p), level_at(counts, p), values=values)
    return _summarise(errors, sample_weight, average)


@validate_params(
    {
        "y_true": ["array-like"],
        "y_pred": ["array-like"],
        "p": "no_validation",  # but by check_positions
        "sample_weight": ["array-like", None],
        "average": ["boolean"],
        "levels": ["array-like", None],
        "units": _UNITS,
    },
    prefer_skip_nested_validation=True,
)
def macro_mae_at_positions(
    y_true: ArrayLike,
    y_pred: ArrayLike,
    p: ArrayLike,
    *,
    sample_weight: ArrayLike | None = None,
    average: bool = True,
    levels: ArrayLike | None = None,
    units: Literal["levels", "scale"] = "levels",
) -> float | NDArray[np.float64]:
    r"""Macro-averaged mean absolute error of ratings predicted one by one, per trial.

    This is the error of Richardson and Kuchenbecker (2020): each predicted rating is
    compared with the true rating at its own quantile position. :func:`macro_mae` scores
    a distribution, and collecting the ratings into one sorts them. The two agree where
    no predicted rating falls as p grows. Where one does, sorting may lower this error
    or raise it, so that models are compared as in the paper only by this score.

    Parameters
    ----------
    y_true : array-like of shape (n_trials, n_levels) or (n_trials,)
        How many people chose each level, or one rating per trial.
    y_pred : array-like of shape (n_trials, n_positions)
        Predicted rating at each position, as ``predict_rating(X, p)`` of
        :class:`~sklearn_haptic.DistributionalOrdinalRegressor` returns them.
    p : array-like of shape (n_positions,)
        The quantile positions, from 0 (lowest rating) to 1; 0.01, …, 0.99 in the
        paper.
    sample_weight : array-like of shape (n_trials,), default=None
        Weight of each trial in the average.
    average : bool, default=True
        Whether to return the weighted mean rather than one score per trial.
    levels : array-like of shape (n_levels,), default=None
        The ordered levels, to which ratings and labelled columns are matched. By
        default the ordered categories or column labels of ``y_true``; without labels,
        1, 2, … for the columns of counts, or the sorted ratings.
    units : {"levels", "scale"}, default="levels"
        Whether neighbouring levels are 1 apart, or as far as their numbers are.

    Returns
    -------
    score : float or ndarray of shape (n_trials,)
        Error in levels, from 0 (best) to n_levels - 1; or in units of the scale.

    Raises
    ------
    ValueError
        If a trial has no ratings, a rating is not among the levels, or the shapes
        differ.

    See Also
    --------
    macro_mae : The same error of a predicted distribution.

    References
    ----------
    Richardson and Kuchenbecker (2020), equation 3. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    Two of four people chose 1, two chose 3. Both rows hold the same ratings:

    >>> from sklearn_haptic.metrics import macro_mae_at_positions
    >>> p = [0.2, 0.4, 0.6, 0.8]
    >>> counts, ratings = [[2, 0, 2], [2, 0, 2]], [[1, 1, 3, 3], [1, 3, 1, 3]]
    >>> macro_mae_at_positions(counts, ratings, p, average=False)
    array([0., 1.])
    """
    positions = np.atleast_1d(check_positions(p))
    counts, predicted, levels = check_predicted_ratings(
        y_true, y_pred, levels, len(positions)
    )
    values = level_values(levels, units)
    errors = macro_error(predicted, level_at(counts, positions), values=values)
    return _summarise(errors, sample_weight, average)


@_score(units=_UNITS)
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
    return _summarise(scores, sample_weight, average)


@validate_params(
    {
        "y_true": ["array-like"],
        "y_cdf": ["array-like"],
        "values": ["array-like"],
        "sample_weight": ["array-like", None],
        "average": ["boolean"],
    },
    prefer_skip_nested_validation=True,
)
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
    return _summarise(scores, sample_weight, average)


@_score(units=_UNITS)
def earth_movers_distance(
    y_true: ArrayLike,
    y_proba: ArrayLike,
    *,
    sample_weight: ArrayLike | None = None,
    average: bool = True,
    levels: ArrayLike | None = None,
    units: Literal["levels", "scale"] = "levels",
) -> float | NDArray[np.float64]:
    r"""Earth mover's distance between predicted and true distribution.

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
        Distance in levels, from 0 (best) to n_levels - 1; or in units of the scale.

    Raises
    ------
    ValueError
        If a row of ``y_proba`` is not a distribution, a trial has no ratings or
        unknown ones, or the shapes differ.

    Notes
    -----
    The distance is the probability to be moved, times the levels by which it moves.
    On a line this is the area between the CDFs,
    :math:`\sum_{k=1}^{K-1} |\hat F_k - F_k|`, and that between the inverse CDFs (the
    Wasserstein-1 distance).

    References
    ----------
    Y. Rubner, C. Tomasi and L. J. Guibas, "The earth mover's distance as a metric
    for image retrieval", International Journal of Computer Vision 40, 99–121,
    2000. :doi:`10.1023/A:1026543900054`

    Examples
    --------
    >>> from sklearn_haptic.metrics import earth_movers_distance
    >>> earth_movers_distance([[0, 0, 4]], [[0.25, 0.25, 0.5]])
    0.75
    """
    counts, proba, levels = check_distributions(y_true, y_proba, levels)
    gaps = np.diff(level_values(levels, units))
    scores = (np.abs(cdf(proba) - cdf(counts))[:, :-1] * gaps).sum(axis=1)
    return _summarise(scores, sample_weight, average)


@_score()
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
    return _summarise(scores + 0.0, sample_weight, average)  # -0.0 becomes 0.0


@validate_params(
    {**_CONSTRAINTS, "n_bins": [Interval(Integral, 1, None, closed="left")]},
    prefer_skip_nested_validation=True,
)
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
        below[:, j] = (proportions * np.where(point, u > lower, share)).sum(axis=1)
    below[:, 0], below[:, -1] = 0, 1
    np.minimum(below, 1, out=below)  # sums may round up
    return n_bins * np.diff(_mean(below, sample_weight))


@validate_params({**_CONSTRAINTS, "units": _UNITS}, prefer_skip_nested_validation=True)
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
    spread = _mean((proba * squares).sum(axis=1), sample_weight)
    scatter = _mean((shares(counts) * squares).sum(axis=1), sample_weight)
    if scatter == 0:
        return 1.0 if spread == 0 else np.inf
    return float(spread / scatter)


@validate_params(
    {
        "y_true": ["array-like"],
        "score": [callable],
        "sample_weight": ["array-like", None],
        "average": ["boolean"],
        "n_draws": [Interval(Integral, 1, None, closed="left")],
        "random_state": ["random_state"],
    },
    prefer_skip_nested_validation=True,
)
def noise_ceiling(
    y_true: ArrayLike | Sequence[ArrayLike],
    score: Callable[..., Any] = ranked_probability_score,
    *,
    sample_weight: ArrayLike | None = None,
    average: bool = True,
    n_draws: int = 100,
    random_state: RandomState = None,
) -> Bunch:
    r"""How good a prediction of finitely many people's ratings can be.

    Whatever predicts, the people who happened to rate an object scatter about the
    population that they come from. No score can be expected below that of the
    population itself, and few below that of as many other people.

    Parameters
    ----------
    y_true : array-like of shape (n_trials, n_levels)
        How many people chose each level, two people or more per trial; the labels of
        columns are levels. For :func:`crps` their ratings, as it takes them.
    score : callable, default=ranked_probability_score
        A score of this module, or ``functools.partial(score, units="scale")``.
    sample_weight : array-like of shape (n_trials,), default=None
        Weight of each trial in the average.
    average : bool, default=True
        Whether to return weighted means rather than one value per trial.
    n_draws : int, default=100
        How often to draw people, for scores other than `ranked_probability_score` and
        `crps`.
    random_state : int, RandomState instance or None, default=None
        Draws the people.

    Returns
    -------
    ceiling : :class:`~sklearn.utils.Bunch`
        With the attributes

        truth : float or ndarray of shape (n_trials,)
            Expected score of the distribution in the population.
        raters : float or ndarray of shape (n_trials,)
            Expected score of the counts of as many other people as rated the trial.

    Raises
    ------
    ValueError
        If a trial has fewer than two ratings, or there are no whole counts to draw.

    Notes
    -----
    The population scores :math:`\sum_k F_k (1 - F_k)` by RPS, however many people are
    predicted, and the counts of N other people :math:`1 + 1/N` times as much. From the
    shares :math:`F_{N,k}` of N people, :math:`\frac{N}{N-1} \sum_k F_{N,k} (1 -
    F_{N,k})` estimates the first without bias, as half the mean absolute difference
    of two people's ratings does for the CRPS. For other scores populations are drawn
    from what is likely after the ratings, if before objects differ as
    :func:`~sklearn_haptic.raters.shrink_counts` supposes, and people from these. Give
    one row per object then, and several objects.

    Examples
    --------
    >>> from sklearn_haptic.metrics import noise_ceiling
    >>> ceiling = noise_ceiling([[3, 6, 3], [0, 6, 6]])
    >>> round(ceiling.truth, 3), round(ceiling.raters, 3)
    (0.341, 0.369)
    """
    function = getattr(score, "func", score)  # of a partial
    if function is crps:
        answers = check_answers(y_true, "y_true")
        n = np.sum(~np.isnan(answers), axis=1)
        _refuse_single_ratings(n)
        truth = half_mean_difference(answers)
        raters = truth * (1 + 1 / n)
    else:
        levels = getattr(score, "keywords", {}).get("levels")
        counts, levels = check_ratings(y_true, levels, name="y_true")
        score = partial(score, levels=levels)
        n = counts.sum(axis=1)
        _refuse_single_ratings(n)
        if function is ranked_probability_score:
            truth = score(counts, shares(counts), average=False) * n / (n - 1)
            raters = truth * (1 + 1 / n)
        else:
            truth, raters = _drawn_scores(counts, score, n_draws, random_state)
    return Bunch(
        truth=_summarise(truth, sample_weight, average),
        raters=_summarise(raters, sample_weight, average),
    )


def _refuse_single_ratings(n_ratings):
    if (n_ratings < 2).any():
        raise ValueError(
            f"y_true has fewer than two ratings in trial {np.argmax(n_ratings < 2)}, "
            "which tell nothing of how people differ; leave such trials out."
        )


def _drawn_scores(counts, score, n_draws, random_state):
    """Mean scores of people drawn from counts, as predicted by these and by others."""
    # The legacy generator draws one row of people at a time.
    seed = check_random_state(random_state).randint(np.iinfo(np.int32).max)
    rng = np.random.default_rng(seed)
    n, strength = counts.sum(axis=1).astype(np.int64), leave_one_out_strength(counts)
    prior = mean_of_others(counts)
    alike, total = np.isinf(strength), np.zeros((2, len(counts)))
    for _ in range(n_draws):
        population = prior if alike else rng.gamma(counts + strength * prior)
        population = shares(population)
        drawn, others = rng.multinomial(n, population, size=(2, len(n)))
        total += [
            score(drawn, predicted, average=False)
            for predicted in (population, shares(others))
        ]
    return total / n_draws


def neg_rps_scorer(
    estimator: BaseEstimator,
    X: Trials,
    y: ArrayLike,
    sample_weight: ArrayLike | None = None,
) -> float:
    """Minus the ranked probability score of an estimator, for ``scoring=``.

    Parameters
    ----------
    estimator : object
        Fitted, with ``predict_proba`` and ``classes_`` (the ordered levels).
    X : array-like
        The trials that ``estimator`` takes.
    y : array-like of shape (n_trials, n_levels) or (n_trials,)
        How many people chose each level, or one rating per trial; of shape (n_trials,
        n_adjectives, n_levels) where ``estimator`` predicts several adjectives.
    sample_weight : array-like of shape (n_trials,), default=None
        Weight of each trial in the average.

    Returns
    -------
    score : float
        Higher is better; see :func:`ranked_probability_score`.

    Raises
    ------
    ValueError
        If a rating is not among the estimator's levels.

    Examples
    --------
    >>> from sklearn.dummy import DummyClassifier
    >>> from sklearn_haptic.metrics import neg_rps_scorer
    >>> X, y = [[0], [0], [0], [0]], [1, 1, 2, 2]
    >>> neg_rps_scorer(DummyClassifier(strategy="prior").fit(X, y), X, y)
    -0.25
    """
    proba, levels = estimator.predict_proba(X), estimator.classes_
    return -_score_predicted(ranked_probability_score, proba, levels, y, sample_weight)


def neg_macro_mae_scorer(
    estimator: BaseEstimator,
    X: Trials,
    y: ArrayLike,
    sample_weight: ArrayLike | None = None,
) -> float:
    """Minus the macro-averaged error of an estimator, for ``scoring=``.

    It is that of the predicted distribution, :func:`macro_mae`. Only a
    :class:`~sklearn_haptic.DistributionalOrdinalRegressor` with ``decode="quantile"``
    and ``rule="argmax"`` (the paper) is scored by the ratings that it decides on,
    :func:`macro_mae_at_positions`: these are its predictions, and its distribution has
    no more than what is left when they are sorted.

    Parameters
    ----------
    estimator : object
        Fitted, with ``predict_proba`` and ``classes_`` (the ordered levels); also a
        pipeline or a search that ends in such an estimator.
    X : array-like
    y : array-like of shape (n_trials, n_levels) or (n_trials,)
    sample_weight : array-like of shape (n_trials,), default=None
        All three are those of :func:`neg_rps_scorer`.

    Returns
    -------
    score : float
        Higher is better; see :func:`macro_mae` and :func:`macro_mae_at_positions`.

    Raises
    ------
    ValueError
        If a rating is not among the estimator's levels.

    Examples
    --------
    >>> from sklearn.dummy import DummyClassifier
    >>> from sklearn_haptic.metrics import neg_macro_mae_scorer
    >>> X, y = [[0], [0], [0]], [1, 1, 2]
    >>> model = DummyClassifier(strategy="most_frequent").fit(X, y)
    >>> round(neg_macro_mae_scorer(model, X, y), 4)
    -0.3333
    """
    model, X = _last_step(estimator, X)
    decided = ratings_decided_on(model, X)
    if decided is None:
        score, predicted = macro_mae, model.predict_proba(X)
    else:
        predicted, p = decided
        score = partial(macro_mae_at_positions, p=p)
    return -_score_predicted(score, predicted, model.classes_, y, sample_weight)


def ratings_decided_on(model, X):
    """Return the ratings that a model predicts one by one, and their positions.

    None for all but a `DistributionalOrdinalRegressor` that decodes as the paper does.
    """
    if getattr(model, "decode", None) != "quantile" or model.rule != "argmax":
        return None
    p = quantile_grid(model.n_quantiles)
    return model.predict_rating(X, p), p


def _last_step(estimator, X):
    """Return the model at the end of searches and pipelines, and what it is given."""
    while True:
        if hasattr(estimator, "best_estimator_"):
            estimator = estimator.best_estimator_
        elif isinstance(estimator, Pipeline):
            X = estimator[:-1].transform(X) if len(estimator) > 1 else X
            estimator = estimator[-1]
        else:
            return estimator, X


def _score_predicted(score, predicted, levels, y, sample_weight):
    """Mean score of what was predicted, over adjectives if there are several."""
    if predicted.ndim == 3:
        expected = (*predicted.shape[:2], len(levels))
        if np.shape(y) != expected:
            raise ValueError(
                f"y has shape {np.shape(y)}, but {expected} is predicted; give "
                "counts of the same trials, adjectives and levels."
            )
        if sample_weight is not None:
            sample_weight = np.repeat(sample_weight, predicted.shape[1])
        y = np.asarray(y).reshape(-1, len(levels))
        predicted = predicted.reshape(len(y), -1)
    return score(y, predicted, sample_weight=sample_weight, levels=levels)


def _summarise(scores, sample_weight, average):
    """Return one score per trial, or their weighted mean."""
    return float(_mean(scores, sample_weight)) if average else scores


def _mean(values, sample_weight):
    """Return the weighted mean over trials, leaving out those of weight 0."""
    weight = check_weights(sample_weight, values)
    used = weight > 0
    return np.average(values[used], axis=0, weights=weight[used])
