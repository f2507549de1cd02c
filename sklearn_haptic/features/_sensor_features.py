"""Features of a sensor that nobody has described."""

from __future__ import annotations

from typing import Any, Self

from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.pipeline import make_pipeline
from sklearn.utils.validation import check_is_fitted

from ..recordings._resample import check_rate, rate_of
from ..recordings._trials import cells_of, check_trials, is_table
from ..utils._sklearn import (
    DocumentedEstimator,
    FloatArray,
    HasMethods,
    Names,
    Trials,
    _fit_context,
)
from ._pooling import TemporalMaxPool
from ._statistics import SignalStatistics
from ._sthmp import STHMPTransformer


class SensorFeatures(DocumentedEstimator, TransformerMixin, BaseEstimator):
    """Features of a sensor whose kind is found out from its trials.

    This is what :func:`make_haptic_pipeline` takes where a sensor has no description.
    Trials of shape (n_times, n_rows, n_columns) are images, and all others are signals.
    The window and where channels lie cannot be told from numbers alone, nor can the
    rate, so signals get features that need none of these. To use what you know,
    describe the sensor by :class:`Signal` or :class:`TaxelGrid`.

    Parameters
    ----------
    signals : transformer, default=None
        Turns signals into rows of features; by default
        ``SignalStatistics(cells=(2, 1))``.
    images : transformer, default=None
        Turns images into rows of features; by default
        ``make_pipeline(STHMPTransformer(layout=None), TemporalMaxPool())``.

    Attributes
    ----------
    kind_ : {"signals", "images"}
        What the trials were found to be.
    rate_ : float or None
        Samples per second, if trials are Series or data frames of pandas whose index
        has the times of the samples. `transform` refuses trials of another rate.
    transformer_ : transformer
        The fitted one.
    n_features_in_ : int
        Number of columns of a table, or of values per time sample of the trials.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the columns of a table. Defined if it has any.

    See Also
    --------
    SignalStatistics : Statistics of each channel.
    STHMPTransformer : Codes of images.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import SensorFeatures
    >>> trials = [np.cos(np.arange(n)) for n in (20, 30)]
    >>> features = SensorFeatures()
    >>> features.fit_transform(trials).shape
    (2, 66)
    >>> features.kind_
    'signals'
    """

    _parameter_constraints = {  # noqa: RUF012
        "signals": [HasMethods(["fit", "transform"]), None],
        "images": [HasMethods(["fit", "transform"]), None],
    }

    def __init__(self, signals: Any | None = None, images: Any | None = None) -> None:
        self.signals = signals
        self.images = images

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: Trials, y: Any = None) -> Self:
        """Find out what the trials are, and fit the transformer of that kind.

        Parameters
        ----------
        X : collection of trials, or array-like of shape (n_trials, n_times)
            Trials.
        y : array-like, default=None
            Passed on.

        Returns
        -------
        self : SensorFeatures
        """
        self._fit_transform(X, y, "fit")
        return self

    @_fit_context(prefer_skip_nested_validation=False)
    def fit_transform(self, X: Trials, y: Any = None) -> FloatArray:
        """Fit the transformer of the kind of the trials and return their features.

        Parameters
        ----------
        X, y
            As for `fit`.

        Returns
        -------
        features : ndarray of shape (n_trials, n_features)
            As of `transform`.
        """
        return self._fit_transform(X, y, "fit_transform")

    def _fit_transform(self, X, y, method):
        images = not is_table(X) and check_trials(X, ndims=(2, 3))[0].ndim == 3
        given = self.images if images else self.signals
        if given is not None:
            transformer = clone(given)
        elif images:
            transformer = make_pipeline(
                STHMPTransformer(layout=None), TemporalMaxPool()
            )
        else:
            transformer = SignalStatistics(cells=(2, 1))
        result = getattr(transformer, method)(X, y)
        self.kind_ = "images" if images else "signals"
        self.rate_ = None if is_table(X) else rate_of(cells_of(X))
        self.transformer_ = transformer
        return result

    def transform(self, X: Trials) -> FloatArray:
        """Compute the features of trials.

        Parameters
        ----------
        X : collection of trials, or array-like of shape (n_trials, n_times)
            Trials of the kind and with the channels seen in `fit`.

        Returns
        -------
        features : ndarray of shape (n_trials, n_features)
            Those of `transformer_`.
        """
        check_is_fitted(self)
        if self.rate_ is not None and not is_table(X):
            check_rate(cells_of(X), self.rate_)
        return self.transformer_.transform(X)

    def get_feature_names_out(
        self, input_features: Names | None = None
    ) -> NDArray[Any]:
        """Return the names of the features.

        Parameters
        ----------
        input_features : array-like of str, default=None
            As for `transformer_`.

        Returns
        -------
        names : ndarray of str objects
            Those of `transformer_`.
        """
        check_is_fitted(self)
        return self.transformer_.get_feature_names_out(input_features)

    @property
    def n_features_in_(self) -> int:
        """Number of columns of a table, or of values per time sample."""
        check_is_fitted(self)
        return self.transformer_.n_features_in_

    @property
    def feature_names_in_(self) -> NDArray[Any]:
        """Names of the columns of a table."""
        check_is_fitted(self)
        return self.transformer_.feature_names_in_

    def __sklearn_is_fitted__(self):
        return hasattr(self, "transformer_")

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags
