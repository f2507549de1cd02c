"""Mixins of what predicts distributions: cumulated, inverted, drawn from, scored."""

from __future__ import annotations

from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import ClassifierMixin
from sklearn.metrics import accuracy_score
from sklearn.utils import check_random_state

from ..metrics import neg_rps_scorer
from ..ratings._distributions import cdf, level_at
from ..utils._row_order import check_orders
from ..utils._sklearn import RandomState, Trials
from ..utils._validation import check_positions


class DistributionMixin:
    """All that follows from `predict_proba`, the shares of ordered `classes_`.

    If several adjectives were learned together, every prediction has an axis of
    adjectives behind that of the trials.
    """

    _ordered = True

    def predict_cdf(self, X: Trials, **params: Any) -> NDArray[np.float64]:
        """Predict the share of the population at each level or below.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever `predict_proba` takes.
        **params : dict
            Further arguments of `predict_proba`, where it has any.

        Returns
        -------
        cdf : ndarray of shape (n_trials, n_levels)
            Rows never fall and end in exactly 1.
        """
        return cdf(self._predict_ordered(X, params))

    def predict_quantile(self, X: Trials, p: ArrayLike, **params: Any) -> np.ndarray:
        """Predict the rating at given quantile positions.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever `predict_proba` takes.
        p : float or array-like of shape (n_positions,)
            Positions in the population, from 0 (lowest rating) to 1.
        **params : dict
            Further arguments of `predict_proba`, where it has any.

        Returns
        -------
        rating : ndarray of shape (n_trials,) or (n_trials, n_positions)
            The inverse of `predict_cdf`; never falls as p grows.
        """
        p = check_positions(p)
        rating = self._ratings_at(self._predict_ordered(X, params), np.atleast_1d(p))
        return rating if p.ndim else rating[..., 0]

    def sample(
        self,
        X: Trials,
        n_samples: int = 1,
        *,
        random_state: RandomState = None,
        **params: Any,
    ) -> np.ndarray:
        """Draw ratings of random people from the predicted distributions.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever `predict_proba` takes.
        n_samples : int, default=1
            Number of people.
        random_state : int, RandomState instance or None, default=None
            Draws the people.
        **params : dict
            Further arguments of `predict_proba`, where it has any.

        Returns
        -------
        rating : ndarray of shape (n_trials, n_samples)
        """
        if not isinstance(n_samples, Integral) or n_samples < 1:
            raise ValueError(f"n_samples={n_samples!r} must be a positive integer.")
        proba = self._predict_ordered(X, params)
        rng = check_random_state(random_state)
        p = rng.uniform(size=(*proba.shape[:-1], n_samples))
        return self._ratings_at(proba, p)

    def _predict_ordered(self, X, params):
        proba = self.predict_proba(X, **params)
        if not self._ordered:
            raise ValueError(
                f"The classes of this {type(self).__name__} have no order, so that no "
                "share is at or below one; use predict_proba."
            )
        return proba

    def _ratings_at(self, proba, p):
        """Return the inverse CDF at positions, which trials may share."""
        return self.classes_[level_at(proba, p)]


class OrdinalClassifierMixin(DistributionMixin, ClassifierMixin):
    """Use in place of `ClassifierMixin`, for classes that have an order, or may have.

    Models around others set `_ordered` in ``fit``, whether the model inside knows one.
    """

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.classifier_tags.poor_score = True  # on classes that have no order
        return tags

    def predict(self, X: Trials, **params: Any) -> np.ndarray:
        """Predict the most common rating; ``predict_quantile(X, 0.5)`` is the median.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever `predict_proba` takes.
        **params : dict
            Further arguments of `predict_proba`, where it has any.

        Returns
        -------
        rating : ndarray of shape (n_trials,) or (n_trials, n_adjectives)
        """
        proba = self.predict_proba(X, **params)
        return self.classes_[proba.argmax(axis=-1)]

    def score(
        self, X: Trials, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> float:
        """Return the negative mean ranked probability score; higher is better.

        Of classes that have no order, the accuracy is returned.

        It scores labels and counts. The accuracy, the score of scikit-learn's own
        classifiers, ignores the order of the levels and the predicted probabilities;
        for labels, ``scoring="accuracy"`` still gives it.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever `predict_proba` takes.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            Counts of each rating, or one rating per trial. If several adjectives were
            learned together, counts of shape (n_trials, n_adjectives, n_levels); their
            scores are averaged.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial.

        Returns
        -------
        score : float
        """
        if self._ordered:
            return neg_rps_scorer(self, X, y, sample_weight)
        check_orders(X=X, y=y, sample_weight=sample_weight)
        return float(accuracy_score(y, self.predict(X), sample_weight=sample_weight))
