"""What annotations share: types of arguments, and decorators that keep a signature.

scikit-learn has no annotations. Its decorators, used as they are, would hide those of
the functions they decorate from a type checker, so they are declared here to return
what they are given.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn import base, callback
from sklearn.model_selection import BaseCrossValidator
from sklearn.utils import _param_validation, parallel

FloatArray: TypeAlias = NDArray[np.floating]
"""float64, or float32 where the input is."""

Trials: TypeAlias = ArrayLike | Sequence[ArrayLike]
"""A table, or a collection of trials that may differ in length."""

Names: TypeAlias = Sequence[str] | NDArray[np.str_ | np.object_]

RandomState: TypeAlias = int | np.random.RandomState | None

CrossValidator: TypeAlias = int | BaseCrossValidator | Iterable[tuple[Any, Any]] | None
"""A number of folds, a splitter, or indices of training and test trials."""

Scorer: TypeAlias = Callable[..., float]
"""Called with an estimator, X and y."""

Observations: TypeAlias = tuple[
    FloatArray, FloatArray | None, NDArray[np.integer], FloatArray
]
"""Features, positions, levels and weights."""


class Memory(Protocol):
    """The part of `joblib.Memory` that is used."""

    def cache(self, func: Callable[..., Any], /) -> Callable[..., Any]:
        """Return a function that remembers its results."""


_Function = TypeVar("_Function", bound=Callable[..., Any])


class _Decorator(Protocol):
    def __call__(self, function: _Function, /) -> _Function: ...


_fit_context: Callable[..., _Decorator] = base._fit_context
_threadpool_controller_decorator: Callable[..., _Decorator] = (
    parallel._threadpool_controller_decorator
)
validate_params: Callable[..., _Decorator] = _param_validation.validate_params
with_callbacks: _Decorator = callback.with_callbacks
