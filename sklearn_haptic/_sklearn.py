"""What is taken from scikit-learn's private names, and shared by all estimators."""

from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from threading import local
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn import base, callback
from sklearn.model_selection import BaseCrossValidator
from sklearn.utils import _param_validation, parallel
from sklearn.utils._optional_dependencies import (
    check_matplotlib_support as check_matplotlib_support,
)

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


DOCUMENTATION_URL = "https://sklearn-haptic.readthedocs.io/en/stable/"


class DocumentedEstimator:
    """Mixin, before `BaseEstimator`: the page of an estimator in this documentation.

    scikit-learn's HTML representation of an estimator links to this page. It reads
    both attributes and names the module up to its first private part, so that the
    page is that of the public name.
    """

    _doc_link_module = "sklearn_haptic"
    _doc_link_template = (
        DOCUMENTATION_URL + "generated/{estimator_module}.{estimator_name}.html"
    )


_thread = local()


def one_blas_thread(function: _Function) -> _Function:
    """Decorate a function so that BLAS has one thread while it runs.

    The products of codes and of networks are small: several threads gain little and,
    where another process keeps a core busy, wait for each other most of the time.
    Within a function that is limited, further limits cost nothing, so a step may be
    limited as a whole and each of its trials as well.

    Parameters
    ----------
    function : callable
        Function or method.

    Returns
    -------
    function : callable
        The same, limited.
    """
    limited = _threadpool_controller_decorator(limits=1, user_api="blas")(function)

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        if getattr(_thread, "is_limited", False):
            return function(*args, **kwargs)
        _thread.is_limited = True
        try:
            return limited(*args, **kwargs)
        finally:
            _thread.is_limited = False

    return call  # type: ignore[return-value]
