"""Mixin of models around others, which may know an order of the levels or not."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import ClassifierMixin
from sklearn.utils.validation import check_is_fitted

from ..metrics import neg_rps_scorer
from ..utils._sklearn import Trials


class PerhapsOrderedMixin(ClassifierMixin):
    """Use in place of `ClassifierMixin`: classes and scores, as their order allows.

    `fit` sets `classes_` and `_ordered`, whether the model inside knows an order.
    """

    def predict(self, X: Trials) -> np.ndarray:
        """Predict the most probable level or class.

        Parameters
        ----------
        X : array-like of length n_trials
            Touches, as `predict_proba` takes them.

        Returns
        -------
        predicted : ndarray of shape (n_trials,)
            With several adjectives of shape (n_trials, n_adjectives).
        """
        check_is_fitted(self)
        return self.classes_[self.predict_proba(X).argmax(axis=-1)]

    def score(self, X: Trials, y: ArrayLike) -> float:
        """Score the prediction of each row of `X`; higher is better.

        Parameters
        ----------
        X, y
            As for `fit`.

        Returns
        -------
        score : float
            The negative ranked probability score if the model knows an order of levels,
            else the accuracy.
        """
        check_is_fitted(self)
        if self._ordered:
            return neg_rps_scorer(self, X, y)
        return float(np.mean(self.predict(X) == np.asarray(y)))
