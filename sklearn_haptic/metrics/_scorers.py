"""Scorers of fitted estimators, for searches."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator
from sklearn.utils.metadata_routing import MetadataRequest

from ..ratings._levels import predict_in_named_order
from ..utils._pipeline_steps import last_step
from ..utils._row_order import check_orders
from ..utils._sklearn import Trials
from ._absolute_errors import macro_mae, macro_mae_at_positions
from ._proper_scores import ranked_probability_score
from ._trial_scores import ratings_decided_on

_Scorer = TypeVar("_Scorer", bound=Callable[..., float])


def _takes_weights(scorer: _Scorer) -> _Scorer:
    """Let metadata routing give a scorer the weights, as a search does without it."""
    request = MetadataRequest(owner=scorer.__name__)
    request.score.add_request(param="sample_weight", alias=True)
    vars(scorer).update(get_metadata_routing=lambda: request)
    return scorer


@_takes_weights
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
        Weight of each trial in the average. A search gives the weights of its fit, and
        `cross_validate` those of its ``params`` with metadata routing, else none.

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
    check_orders(X=X, y=y, sample_weight=sample_weight)
    proba, levels = predict_in_named_order(estimator, X, y)
    return -_score_predicted(ranked_probability_score, proba, levels, y, sample_weight)


@_takes_weights
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
    check_orders(X=X, y=y, sample_weight=sample_weight)
    model, X = last_step(estimator, X)
    decided = ratings_decided_on(model, X)
    if decided is None:
        score = macro_mae
        predicted, levels = predict_in_named_order(model, X, y)
    else:
        (predicted, p), levels = decided, model.classes_
        score = partial(macro_mae_at_positions, p=p)
    return -_score_predicted(score, predicted, levels, y, sample_weight)


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
