"""All that the package takes from scikit-learn's private names, in one place.

Beside them stand the types of common arguments, and what every estimator shares: the
hooks of callbacks and the limit of BLAS threads. The private names are imported from
here and keep the names that scikit-learn gave them.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import wraps
from inspect import signature
from threading import local
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn import base, callback
from sklearn.callback._callback_context import get_context_path
from sklearn.callback._transport import close_listener, open_listener, send
from sklearn.model_selection import BaseCrossValidator
from sklearn.model_selection._search import BaseSearchCV
from sklearn.utils import _param_validation, _safe_indexing, parallel
from sklearn.utils._indexing import _determine_key_type, _get_column_indices
from sklearn.utils._missing import is_pandas_na
from sklearn.utils._optional_dependencies import check_matplotlib_support
from sklearn.utils._param_validation import (
    HasMethods,
    Interval,
    StrOptions,
    validate_parameter_constraints,
)
from sklearn.utils._set_output import (
    _get_adapter_from_container,
    _get_output_config,
    _wrap_data_with_container,
)
from sklearn.utils.metaestimators import _BaseComposition
from sklearn.utils.validation import (
    _check_feature_names_in,
    _check_method_params,
    _check_sample_weight,
    _num_samples,
)

from ._row_order import check_orders

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


_OF_TRIALS = ("X", "y", "sample_weight", "groups"), ("X_val", "y_val")

_Function = TypeVar("_Function", bound=Callable[..., Any])


class _Decorator(Protocol):
    def __call__(self, function: _Function, /) -> _Function: ...


def all_or_nothing(fit: _Function) -> _Function:
    """Decorate ``fit``: an estimator is fitted wholly or not.

    If ``fit`` raises an error or is interrupted, the estimator is as it was before. So
    ``fit`` sets new attributes, and never changes the value of an old one in place.
    What is given of the trials has to have them in one order.
    """
    names = [*signature(fit).parameters][1:]

    @wraps(fit)
    def call(estimator: Any, *args: Any, **kwargs: Any) -> Any:
        given = dict(zip(names, args)) | kwargs
        for trials in _OF_TRIALS:
            check_orders(**{name: given[name] for name in trials if name in given})
        before = vars(estimator).copy()
        try:
            return fit(estimator, *args, **kwargs)
        except BaseException:
            vars(estimator).clear()
            vars(estimator).update(before)
            raise

    return call  # type: ignore[return-value]


def _fit_context(*, prefer_skip_nested_validation: bool) -> _Decorator:
    """Decorate ``fit`` by that of scikit-learn, and by `all_or_nothing`."""
    decorate = base._fit_context(
        prefer_skip_nested_validation=prefer_skip_nested_validation
    )
    return lambda fit: all_or_nothing(decorate(fit))


_threadpool_controller_decorator: Callable[..., _Decorator] = (
    parallel._threadpool_controller_decorator
)


validate_params: Callable[..., _Decorator] = _param_validation.validate_params


with_callbacks: _Decorator = callback.with_callbacks


class FitTask:
    """A fit in progress, as callbacks see it; made by `fit_task`.

    Attributes
    ----------
    on_iteration : callable or None
        Called at the end of each iteration, it tells the callbacks and returns whether
        one of them asks to stop; it ignores its arguments. None if there are no
        callbacks.
    """

    def __init__(self, estimator: Any, context: Any, X: Any, y: Any) -> None:
        self._context = context
        self._data = {"estimator": estimator, "X": X, "y": y}
        self._n_iterations = 0
        watched = hasattr(estimator, "_skl_callbacks")
        self.on_iteration = self._end_iteration if watched else None

    def _end_iteration(self, *_: Any) -> bool:
        self._n_iterations += 1
        task = self._context.subcontext(task_name=f"iteration {self._n_iterations}")
        task.call_on_fit_task_begin(**self._data)
        return bool(task.call_on_fit_task_end(**self._data))

    def fit_of(self, name: str, estimator: Any) -> AbstractContextManager[Any]:
        """Pass the callbacks on to an estimator that is fitted within the context.

        The subtask has the given name.
        """
        context = self._context.subcontext(task_name=name)
        passed_on: AbstractContextManager[Any] = context.propagate_callback_context(
            estimator
        )
        return passed_on


@contextmanager
def fit_task(
    estimator: Any, X: Any, y: Any = None, *, max_subtasks: int = 0
) -> Iterator[FitTask]:
    """Tell callbacks that a fit begins and, unless it raises an error, that it ended.

    They are given the data X and y. `max_subtasks` is the largest number of iterations,
    or the number of estimators that are fitted. A `FitTask` is yielded.
    """
    context = estimator._init_callback_context(max_subtasks=max_subtasks)
    context.call_on_fit_task_begin(estimator=estimator, X=X, y=y)
    yield FitTask(estimator, context, X, y)
    context.call_on_fit_task_end(
        estimator=estimator, X=X, y=y, reconstruction_attributes={}
    )


_thread = local()


def one_blas_thread(function: _Function) -> _Function:
    """Decorate a function so that BLAS has one thread while it runs.

    The products of codes and of networks are small: several threads gain little and,
    where another process keeps a core busy, wait for each other most of the time.
    Within a function that is limited, further limits cost nothing, so a step may be
    limited as a whole and each of its trials as well.
    """
    limited = _threadpool_controller_decorator(limits=1, user_api="blas")(function)

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        if getattr(_thread, "is_limited", False):
            return function(*args, **kwargs)
        try:
            _thread.is_limited = True
            return limited(*args, **kwargs)
        finally:
            _thread.is_limited = False

    return call  # type: ignore[return-value]
