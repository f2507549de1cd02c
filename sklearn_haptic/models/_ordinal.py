"""Mixin of the package's classifiers, whose classes are ordered and scored as such."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import ClassifierMixin

from .._sklearn import Trials
from ..metrics import neg_rps_scorer


class OrdinalClassifierMixin(ClassifierMixin):
    """Use in place of `ClassifierMixin`: labels and counts have the same score."""

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.classifier_tags.poor_score = True  # on classes that have no order
        return tags

    def predict(self: Any, X: Trials) -> np.ndarray:
        """Predict the most probable level.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever `predict_proba` takes.

        Returns
        -------
        rating : ndarray of shape (n_trials,) or (n_trials, n_adjectives)
        """
        proba = self.predict_proba(X)  # first, for its message before `fit`
        rating: np.ndarray = self.levels_[proba.argmax(axis=-1)]
        return rating

    def score(
        self, X: Trials, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> float:
        """Return the negative mean ranked probability score; higher is better.

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
        return neg_rps_scorer(self, X, y, sample_weight)
