"""Logarithmic score of distributions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import xlogy

from ..ratings._checks import check_distributions
from ..ratings._distributions import shares
from ._score import as_score, summarise


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
