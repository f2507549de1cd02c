"""How good a prediction of finitely many people's ratings can be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.utils import Bunch, check_random_state

from ..ratings._checks import check_ratings, refuse_shares
from ..ratings._continuous import check_answers, half_mean_difference
from ..ratings._counts import leave_one_out_strength, mean_of_others
from ..ratings._distributions import shares
from ..utils._sklearn import Interval, RandomState, validate_params
from ._calibration import dispersion, pit_histogram
from ._proper_scores import crps, ranked_probability_score
from ._score import summarise


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
        If a trial has fewer than two ratings, rows are shares of people, or there are
        no whole counts to draw.

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
    if function in (dispersion, pit_histogram):
        raise ValueError(
            f"score={function.__name__} has no value of a single trial; give a score "
            "that has average=False."
        )
    if function is crps:
        answers = check_answers(y_true, "y_true")
        n = np.sum(~np.isnan(answers), axis=1)
        _refuse_single_ratings(n)
        truth = half_mean_difference(answers)
        raters = truth * (1 + 1 / n)
    else:
        levels = getattr(score, "keywords", {}).get("levels")
        counts, levels = check_ratings(y_true, levels, name="y_true")
        refuse_shares(counts, "y_true")
        score = partial(score, levels=levels)
        n = counts.sum(axis=1)
        _refuse_single_ratings(n)
        if function is ranked_probability_score:
            truth = score(counts, shares(counts), average=False) * n / (n - 1)
            raters = truth * (1 + 1 / n)
        else:
            truth, raters = _drawn_scores(counts, score, n_draws, random_state)
    return Bunch(
        truth=summarise(truth, sample_weight, average),
        raters=summarise(raters, sample_weight, average),
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
