"""Baselines that ignore the features, which a model must beat."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted, validate_data

from ..ratings._checks import check_rated, check_ratings
from ..ratings._distributions import shares
from ..utils._sklearn import StrOptions, Trials, _fit_context, _num_samples
from ..utils._validation import check_weights
from ._ordinal import OrdinalClassifierMixin


class DummyDistribution(OrdinalClassifierMixin, BaseEstimator):
    """Predict the same distribution for every trial, whatever its features.

    A model must beat both strategies; which one is harder to beat depends on the score.

    Parameters
    ----------
    strategy : {"marginal", "barycentre"}, default="marginal"
        "marginal": the mean of the training trials' distributions, which is hard to
        beat by RPS and log score. "barycentre": the distribution whose CDF at each
        level is the median of their CDFs, their Wasserstein-1 barycentre, which is hard
        to beat by absolute error.
    levels : array-like of shape (n_levels,), default=None
        All ordered levels, by default as for `DistributionalOrdinalRegressor`.

    Attributes
    ----------
    levels_, classes_ : ndarray of shape (n_levels,)
        The ordered levels.
    proba_ : ndarray of shape (n_levels,)
        The distribution.
    n_features_in_ : int
        Number of features, which are ignored.

    See Also
    --------
    DistributionalOrdinalRegressor : Predicts from the features.

    Examples
    --------
    >>> from sklearn_haptic import DummyDistribution
    >>> counts = [[4, 0, 0], [3, 1, 0], [0, 0, 4]]
    >>> DummyDistribution("marginal").fit([[0]] * 3, counts).proba_.round(2)
    array([0.58, 0.08, 0.33])
    >>> DummyDistribution("barycentre").fit([[0]] * 3, counts).proba_
    array([0.75, 0.25, 0.  ])
    """

    _parameter_constraints = {  # noqa: RUF012
        "strategy": [StrOptions({"marginal", "barycentre"})],
        "levels": ["array-like", None],
    }

    def __init__(
        self,
        strategy: Literal["marginal", "barycentre"] = "marginal",
        *,
        levels: ArrayLike | None = None,
    ) -> None:
        self.strategy = strategy
        self.levels = levels

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.sparse = True
        tags.no_validation = True  # of X, which may be trials
        return tags

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(
        self, X: Trials, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> Self:
        """Find the distribution.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, of which only the number counts.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            Counts of each rating, or one rating per trial.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial in the mean or the median.

        Returns
        -------
        self : DummyDistribution
        """
        check_rated(X)
        validate_data(self, X, skip_check_array=True)
        counts, self.levels_ = check_ratings(y, self.levels)
        check_rated(X, counts)
        self.classes_ = self.levels_
        weight = check_weights(sample_weight, X)
        share = shares(counts)
        if self.strategy == "marginal":
            self.proba_ = np.average(share, axis=0, weights=weight)
        else:
            cdf = _median(np.cumsum(share, axis=1), weight)
            self.proba_ = np.diff(cdf, prepend=0) / cdf[-1]
        return self

    def predict_proba(self, X: Trials) -> NDArray[np.float64]:
        """Return the distribution for each trial.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, of which only the number counts.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
        """
        check_is_fitted(self)
        return np.tile(self.proba_, (_num_samples(X), 1))


def _median(values, weight):
    """Return the weighted median of each column, the mean of the two if there are."""
    either = 0.5 - 1e-9, 0.5 + 1e-9  # so that rounding of weights hides no tie
    medians = np.quantile(values, either, axis=0, weights=weight, method="inverted_cdf")
    return medians.mean(axis=0)
