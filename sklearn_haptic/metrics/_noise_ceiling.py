"""How good a prediction of finitely many people's ratings can be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import xlogy
from sklearn.metrics import mean_absolute_error, r2_score
from sklearn.utils import Bunch

from ..ratings._checks import check_people, check_ratings, refuse
from ..ratings._continuous import check_answers, half_mean_difference
from ..ratings._distributions import shares
from ..ratings._levels import level_values
from ._proper_scores import (
    PROPER_SCORES,
    crps,
    log_score,
    ranked_probability_score,
)
from ._score import as_score, check_scale, summarise, weighted_mean

_OF_MEANS = mean_absolute_error, r2_score


@as_score(score=[callable])
def noise_ceiling(
    y_true: ArrayLike | Sequence[ArrayLike],
    score: Callable[..., Any] = ranked_probability_score,
    *,
    sample_weight: ArrayLike | None = None,
    average: bool = True,
) -> Bunch:
    r"""How good a prediction of finitely many people's ratings can be.

    Whatever predicts, the people who happened to rate an object scatter about the
    population that they come from. No proper score can be expected below that of the
    population itself, and few below that of as many other people.

    People count as drawn anew for each object. If the same few rate all objects and
    differ in where they put the scale, a model learns their habits from other objects
    and may be better than this. In simulations with habits as large as all other
    scatter, panels of 4, 8, 12 and 40 were predicted with an RPS lower by .023, .016,
    .011 and .002 than the ceiling, and an R² of their means higher by .09, .05, .04 and
    .004.

    Parameters
    ----------
    y_true : array-like of shape (n_trials, n_levels)
        How many people chose each level, two people or more per trial; the labels of
        columns are levels. For :func:`crps` their ratings, as it takes them.
    score : callable, default=ranked_probability_score
        This or another proper score, :func:`crps` or :func:`log_score`; or
        ``functools.partial(score, units="scale")``. Or a score of the mean rating, in
        units of the scale: :func:`~sklearn.metrics.r2_score` or
        :func:`~sklearn.metrics.mean_absolute_error`.
    sample_weight : array-like of shape (n_trials,), default=None
        Weight of each trial in the average.
    average : bool, default=True
        Whether to return weighted means rather than one value per trial, which R² has
        not.

    Returns
    -------
    ceiling : :class:`~sklearn.utils.Bunch`
        With the attributes

        truth : float or ndarray of shape (n_trials,)
            Expected score of the distribution in the population.
        raters : float or ndarray of shape (n_trials,)
            Expected score of the counts of as many other people as rated the trial;
            infinite by the log score, unless people agree.

    Warns
    -----
    UserWarning
        If most rows sum to 100, as percentages do.

    Raises
    ------
    ValueError
        If the score is not proper, so that a prediction can score better than the
        population; a trial has fewer than two ratings; rows are shares of people; or,
        for the log score, counts are not whole numbers.

    Notes
    -----
    The population scores :math:`\sum_k F_k (1 - F_k)` by RPS, however many people are
    predicted, and the counts of N other people :math:`1 + 1/N` times as much. From the
    shares :math:`F_{N,k}` of N people, :math:`\frac{N}{N-1} \sum_k F_{N,k} (1 -
    F_{N,k})` estimates the first without bias, as half the mean absolute difference
    of two people's ratings does for the CRPS. The log score of the population is its
    entropy. The estimate, by coverage [1]_, is rough where people are few: for objects
    on which people differ it was within 19% from three people on and within 7% from
    eight on, but up to 46% too low with two people, and up to 40% with up to eight
    where nearly all of the population choose one level. Of 21 levels it was up to 26%
    too low with three people, of 101 up to 48%, and 11% with eight. The mean of N
    ratings scatters about that of the population with 1/N of the variance, and that of
    others about it with twice as much. From few objects that differ little, R² comes
    out too low: in simulations by 0.03 to 0.07 with fifteen or twenty objects and a
    ceiling below 0.5, by 0.09 to 0.22 with ten, by 0.01 at most with a ceiling above
    0.7. The absolute error is that of a normal distribution, within 10% for bell-shaped
    ratings of six people or more, and up to half too low where nearly all agree.

    References
    ----------
    .. [1] A. Chao and T.-J. Shen, "Nonparametric estimation of Shannon's index of
       diversity when there are unseen species in sample", Environmental and Ecological
       Statistics 10, 429–443, 2003. :doi:`10.1023/A:1026096204727`

    Examples
    --------
    >>> from sklearn_haptic.metrics import noise_ceiling
    >>> ceiling = noise_ceiling([[3, 6, 3], [0, 6, 6]])
    >>> round(ceiling.truth, 3), round(ceiling.raters, 3)
    (0.341, 0.369)
    """
    function, given = getattr(score, "func", score), getattr(score, "keywords", {})
    if not given.keys() <= {"levels", "units"}:
        raise ValueError(
            f"score is given {sorted(given)}; give noise_ceiling sample_weight and "
            "average itself, and the score nothing but levels and units."
        )
    if function not in (*PROPER_SCORES, *_OF_MEANS):
        raise ValueError(
            f"score={getattr(function, '__name__', function)} is not proper, so that a "
            "prediction can score better than the population; give "
            "ranked_probability_score, crps or log_score, or r2_score or "
            "mean_absolute_error of the mean."
        )
    if function is crps:
        answers = check_answers(y_true, "y_true")
        n = np.sum(~np.isnan(answers), axis=1)
    else:
        check_scale(y_true, **given)
        counts, levels = check_ratings(y_true, given.get("levels"), name="y_true")
        check_people(counts, "y_true")
        n = counts.sum(axis=1)
    mend = "leave out what fewer than two people rated"
    refuse(n < 2, "has fewer than two ratings", mend, "y_true")
    if function is r2_score:
        truth, raters = _of_r2(counts, levels, sample_weight, average)
        return Bunch(truth=truth, raters=raters)
    if function is mean_absolute_error:
        _, squared_error = _means(counts, levels)
        unbiased = (4 * n - 3) / (4 * n - 4)  # nearly, of a normal deviation
        truth = np.sqrt(2 / np.pi * squared_error) * unbiased
        raters = np.sqrt(2) * truth
    elif function is log_score:
        truth = _entropy(counts)
        raters = np.where(truth > 0, np.inf, 0)
    else:
        if function is crps:
            truth = half_mean_difference(answers)
        else:
            own = score(counts, shares(counts), levels=levels, average=False)
            truth = own * n / (n - 1)
        raters = truth * (1 + 1 / n)
    return Bunch(
        truth=summarise(truth, sample_weight, average),
        raters=summarise(raters, sample_weight, average),
    )


def _means(counts, levels):
    """Return mean ratings, and estimates of their variance about the population's."""
    values, n = level_values(levels), counts.sum(axis=1)
    mean = shares(counts) @ values
    squares = (counts * (values - mean[:, None]) ** 2).sum(axis=1)
    return mean, squares / (n * (n - 1))


def _of_r2(counts, levels, sample_weight, average):
    """Return the R² of the population's means, and of as many other people's."""
    if not average:
        raise ValueError("average=False, but no trial alone has an R²; leave it out.")
    mean, squared_error = _means(counts, levels)
    spread = (mean - weighted_mean(mean, sample_weight)) ** 2
    spread = weighted_mean(spread, sample_weight)
    if spread == 0:
        raise ValueError("y_true has equal means, of which there is no R²; leave it.")
    unexplained = weighted_mean(squared_error, sample_weight) / spread
    return float(1 - unexplained), float(1 - 2 * unexplained)


def _entropy(counts):
    """Estimate the entropy of populations, in nats, by Chao and Shen's method."""
    if (counts % 1 != 0).any():
        raise ValueError(
            "y_true must be whole numbers of people for the log score; give counts as "
            "they are."
        )
    n = counts.sum(axis=1, keepdims=True)
    alone = (counts == 1).sum(axis=1, keepdims=True)
    coverage = np.maximum(1 - alone / n, 1 / n)  # share of the population that is seen
    proba = coverage * counts / n
    seen = 1 - (1 - proba) ** n
    return -(xlogy(proba, proba) / np.where(proba > 0, seen, 1)).sum(axis=1) + 0.0
