"""Mixin of the package's classifiers, whose classes are ordered and scored as such."""

from __future__ import annotations

from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import ClassifierMixin
from sklearn.utils import check_random_state

from ..metrics import neg_rps_scorer
from ..ratings._distributions import cdf, level_at
from ..utils._sklearn import RandomState, Trials
from ..utils._validation import check_positions


class OrdinalClassifierMixin(ClassifierMixin):
    """Use in place of `ClassifierMixin`: all that follows from `predict_proba`.

    The estimator has `levels_`. If several adjectives were learned together, every
    prediction has an axis of adjectives behind that of the trials.
    """

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.classifier_tags.poor_score = True  # on classes that have no order
        return tags

    def predict(self, X: Trials) -> np.ndarray:
        """Predict the most common rating; ``predict_quantile(X, 0.5)`` is the median.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever `predict_proba` takes.

        Returns
        -------
        rating : ndarray of shape (n_trials,) or (n_trials, n_adjectives)
        """
        proba = self.predict_proba(X)
        return self.levels_[proba.argmax(axis=-1)]

    def predict_cdf(self, X: Trials) -> NDArray[np.float64]:
        """Predict the share of the population at each level or below.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever `predict_proba` takes.

        Returns
        -------
        cdf : ndarray of shape (n_trials, n_levels)
            Rows never fall and end in exactly 1.
        """
        return cdf(self.predict_proba(X))

    def predict_quantile(self, X: Trials, p: ArrayLike) -> np.ndarray:
        """Predict the rating at given quantile positions.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever `predict_proba` takes.
        p : float or array-like of shape (n_positions,)
            Positions in the population, from 0 (lowest rating) to 1.

        Returns
        -------
        rating : ndarray of shape (n_trials,) or (n_trials, n_positions)
            The inverse of `predict_cdf`; never falls as p grows.
        """
        p = check_positions(p)
        rating = self.levels_[level_at(self.predict_proba(X), np.atleast_1d(p))]
        return rating if p.ndim else rating[..., 0]

    def sample(
        self, X: Trials, n_samples: int = 1, *, random_state: RandomState = None
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

        Returns
        -------
        rating : ndarray of shape (n_trials, n_samples)
        """
        if not isinstance(n_samples, Integral) or n_samples < 1:
            raise ValueError(f"n_samples={n_samples!r} must be a positive integer.")
        proba = self.predict_proba(X)
        rng = check_random_state(random_state)
        p = rng.uniform(size=(*proba.shape[:-1], n_samples))
        return self.levels_[level_at(proba, p)]

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
