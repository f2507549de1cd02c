"""Absolute errors, which are not proper: macro-averaged, and the earth mover's."""

from __future__ import annotations

from numbers import Integral
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..ratings._checks import check_distributions, check_predicted_ratings
from ..ratings._distributions import cdf, level_at, macro_error, quantile_grid
from ..ratings._levels import level_values
from ..utils._sklearn import Interval
from ..utils._validation import check_positions
from ._score import as_score, summarise


@as_score(n_quantiles=[Interval(Integral, 1, None, closed="left")])
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
    return summarise(errors, sample_weight, average)


@as_score(y_pred=["array-like"])
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
    return summarise(errors, sample_weight, average)


@as_score()
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
    return summarise(scores, sample_weight, average)
