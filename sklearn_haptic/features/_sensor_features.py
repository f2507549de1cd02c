"""Features of sensors side by side, in blocks that are standardised and weigh the same.

A penalty, a distance and a kernel weigh features by their variance. Of a sensor with
thousands of codes and a few dozen statistics, all standardised, the statistics would
hardly count.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from typing import Any, Self

import numpy as np
import sklearn
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.compose import ColumnTransformer
from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.validation import check_is_fitted

from ..recordings._trials import check_columns, check_trials, is_table
from ..utils._sklearn import (
    FloatArray,
    Names,
    Trials,
    _get_adapter_from_container,
    _num_samples,
    _safe_indexing,
    all_or_nothing,
)

# A sensor counts as at least so many features, about the codes of 25 atoms. Where one
# feature beside the 3474 of another sensor told the rating, the RPS was .54 without
# this, .30 with it, and .27 of the feature alone. A share of the sensor with most
# features would make those of one depend on others. Equal sensors cost 51 % of RPS
# on grips.
_LEAST_FEATURES = 500


def block_weights(varies, blocks):
    """Return the weight of each feature, for blocks of equal total variance.

    The blocks of a sensor share the total variance that its features have when they are
    standardised, or that of 500 features, if this is more.

    Parameters
    ----------
    varies : ndarray of bool of shape (n_features,)
        Features that are not constant. The weight of the others is 1.
    blocks : list of list of int
        Number of features of each block of each sensor, in the order of the features.

    Returns
    -------
    weights : ndarray of shape (n_features,)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._sensor_features import block_weights
    >>> block_weights(np.array([True] * 6 + [False]), [[4, 1], [2]]).round(2)
    array([ 7.91,  7.91,  7.91,  7.91, 15.81, 22.36,  1.  ])
    """
    weights = np.ones(len(varies))
    end = 0
    for widths in blocks:
        edges = end + np.cumsum([0, *widths])
        end = edges[-1]
        parts = [np.arange(a, b)[varies[a:b]] for a, b in pairwise(edges)]
        parts = [part for part in parts if len(part)]
        size = max(sum(map(len, parts)), _LEAST_FEATURES)
        for part in parts:
            weights[part] = np.sqrt(size / len(parts) / len(part))
    return weights


class BlockScaler(StandardScaler):
    """Standardise features, and give the blocks of each sensor equal total variance.

    Each feature of a later touch is limited to the range of the training touches,
    widened by its width at both ends. Otherwise one that hardly varies in training
    would outweigh all others where it does vary. Features that are constant in training
    stay at 0.

    Parameters
    ----------
    blocks : list of list of int, default=None
        See :func:`block_weights`. By default all features are one block.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._sensor_features import BlockScaler
    >>> X = np.random.default_rng(0).normal(size=(50, 5))
    >>> BlockScaler([[4, 1]]).fit_transform(X).var(axis=0).round(3)
    array([ 62.5,  62.5,  62.5,  62.5, 250. ])
    >>> scaler = BlockScaler().fit(np.array([[1.0], [3.0]]))
    >>> scaler.transform([[4.0], [5.0], [600.0]]).ravel()
    array([2., 3., 3.])
    """

    scale_: FloatArray

    def __init__(self, blocks: list[list[int]] | None = None) -> None:
        super().__init__()
        self.blocks = blocks

    def partial_fit(self, X: Any, y: Any = None, sample_weight: Any = None) -> Self:
        """Learn means and variances, as `fit` does by this method."""
        super().partial_fit(X, y, sample_weight)
        # One that varies by no more than rounding is constant, and tells no scale.
        level = 4 * np.finfo(np.result_type(X, np.float32)).eps
        deviation = np.sqrt(self.var_)
        varies = (self.scale_ == deviation) & (deviation > level * np.abs(self.mean_))
        self.scale_ = np.where(varies, deviation, np.finfo(np.float32).max)
        if self.blocks is not None:
            self.scale_ /= block_weights(varies, self.blocks)
        scaled = np.asarray(super().transform(X))
        low, high = np.fmin.reduce(scaled), np.fmax.reduce(scaled)  # skip NaN
        self.limits_ = 2 * low - high, 2 * high - low
        return self

    def transform(self, X: Any, copy: bool | None = None) -> FloatArray:
        """Standardise features, within limits."""
        return np.clip(np.asarray(super().transform(X, copy)), *self.limits_)


class SensorFeatures(TransformerMixin, BaseEstimator):
    """Features of a sensor whose trials tell whether they are signals or images.

    The window and where channels lie cannot be told from numbers alone, so signals get
    features that need neither.

    Parameters
    ----------
    signals, images : transformer
        What turns trials of shape (n_times, n_rows, n_columns), which are images, and
        all others into rows of features.

    Attributes
    ----------
    kind_ : {"signals", "images"}
    transformer_ : transformer
        The fitted one.
    """

    def __init__(self, signals: Any, images: Any) -> None:
        self.signals = signals
        self.images = images

    def fit(self, X: Trials, y: Any = None) -> Self:
        """Fit the transformer of the kind of the trials."""
        self.fit_transform(X, y)
        return self

    def fit_transform(self, X: Trials, y: Any = None) -> FloatArray:
        """Fit the transformer of the kind of the trials and return their features."""
        images = not is_table(X) and check_trials(X, ndims=(2, 3))[0].ndim == 3
        transformer = clone(self.images if images else self.signals)
        features: FloatArray = transformer.fit_transform(X, y)
        self.kind_ = "images" if images else "signals"
        self.transformer_ = transformer
        return features

    def transform(self, X: Trials) -> FloatArray:
        """Compute the features of trials."""
        check_is_fitted(self)
        features: FloatArray = self.transformer_.transform(X)
        return features

    def get_feature_names_out(
        self, input_features: Names | None = None
    ) -> NDArray[Any]:
        """Return the names of the features."""
        check_is_fitted(self)
        return self.transformer_.get_feature_names_out(input_features)


class _Blocks:
    """Mixin of sensors side by side whose blocks are standardised and weighed.

    A block is what one transformer of a `FeatureUnion` makes of a sensor, also behind
    steps of its own, or all features of a sensor that has none.
    """

    @all_or_nothing
    def fit(self, X, y=None, **params):
        """Fit the transformers and the scale of their features."""
        self.fit_transform(X, y, **params)
        return self

    def fit_transform(self, X, y=None, **params):
        """Fit the transformers and return their features, standardised."""
        self._refuse_weights()
        table = super().fit_transform(X, y, **params)
        self.scaler_ = BlockScaler(self._block_widths(_safe_indexing(X, slice(1))))
        self.scaler_.set_output(transform="default").fit(np.asarray(table))
        return self._scaled(table)

    def _refuse_weights(self):
        for name, value in self.get_params().items():
            if name.split("__")[-1] == "transformer_weights" and value:
                raise ValueError(
                    f"{name}={value!r} would have no effect, because features are "
                    "standardised afterwards; weigh them in a step of their own."
                )

    def transform(self, X, **params):
        """Compute the features of trials, standardised as those of `fit`."""
        return self._scaled(super().transform(X, **params))

    def _scaled(self, table):
        if isinstance(table, np.ndarray):
            return self.scaler_.transform(table)
        rows = self.scaler_.transform(np.asarray(table))
        adapter = _get_adapter_from_container(table)
        return adapter.create_container(rows, table, columns=table.columns)


class SensorColumns(_Blocks, ColumnTransformer):
    """Features of sensors in columns, whose blocks are standardised and weighed.

    It keeps what it was fitted on.

    Attributes
    ----------
    scaler_ : BlockScaler
        Fitted to the features.
    fitted_on_ : ndarray of str
        Number of touches; channels, median samples and, if it is known, rate of each
        sensor.
    versions_ : ndarray of str
        Packages that fitted it.
    """

    @all_or_nothing
    def fit_transform(self, X: Trials, y: Any = None, **params: Any) -> Any:
        """Fit the transformers to a table of touches and return their features."""
        self._check_columns(X, self.transformers)
        features = super().fit_transform(X, y, **params)
        self.fitted_on_ = np.array([f"{_num_samples(X)} touches", *self._sensors_of(X)])
        packages = [sys.modules[__name__.partition(".")[0]], sklearn, np]
        self.versions_ = np.array([f"{p.__name__} {p.__version__}" for p in packages])
        return features

    def transform(self, X: Trials, **params: Any) -> Any:
        """Compute the features of a table of touches."""
        check_is_fitted(self)
        self._check_columns(X, self.transformers_)
        return super().transform(X, **params)

    def _check_columns(self, X, transformers):
        named = [column for *_, column in transformers if isinstance(column, str)]
        check_columns(X, named)

    def _block_widths(self, touch):
        places = self.output_indices_
        return [
            _widths(transformer, _safe_indexing(touch, column, axis=1))
            for name, transformer, column in self.transformers_
            if places[name].stop > places[name].start
        ]

    def _sensors_of(self, X):
        for name, transformer, column in self.transformers:
            if not (hasattr(transformer, "get_params") and isinstance(column, str)):
                continue
            shapes = [(*np.shape(trial), 1) for trial in X[column]]
            channels = " × ".join(map(str, shapes[0][1:-1])) or "1"
            options = transformer.get_params().items()
            rates = [r for key, r in options if key.split("__")[-1] == "rate" and r]
            rate = f" at {rates[0]:g} Hz" if rates else ""
            samples = f"{np.median([n for n, *_ in shapes]):g} samples{rate} (median)"
            yield f"{name}: {channels} channels, {samples}"


class SensorUnion(_Blocks, FeatureUnion):
    """The blocks of one sensor, whose trials are in no column.

    Attributes
    ----------
    scaler_ : BlockScaler
        Fitted to the features.
    """

    @all_or_nothing
    def fit_transform(self, X: Trials, y: Any = None, **params: Any) -> Any:
        """Fit clones of the transformers and return their features, standardised."""
        self.transformer_list: list[Any] = clone(self.transformer_list, safe=False)
        return super().fit_transform(X, y, **params)

    def _block_widths(self, touch):
        return [_widths(self, touch)]


def blocks_of(transformer, whole=()):
    """Return the fitted transformers of a union, and of unions in it, one by one.

    Of a pipeline that ends in a union, each is behind the steps before it. Unions of
    the class `whole` are not divided.
    """
    if isinstance(transformer, FrozenEstimator):
        transformer = transformer.estimator
    if isinstance(transformer, SensorFeatures):
        transformer = transformer.transformer_
    if isinstance(transformer, Pipeline):
        *before, (name, last) = transformer.steps
        ends = blocks_of(last, whole)
        if len(ends) == 1:
            return [transformer]
        return [Pipeline([*before, (name, end)]) for end in ends]
    if (
        not isinstance(transformer, FeatureUnion)
        or transformer.transformer_weights
        or isinstance(transformer, whole)
    ):
        return [transformer]
    parts = [part for _, part in transformer.transformer_list if part != "drop"]
    return [block for part in parts for block in blocks_of(part, whole)]


def _widths(transformer, touch):
    """Return the number of features that each block makes of a touch."""
    return [np.shape(each.transform(touch))[1] for each in blocks_of(transformer)]
