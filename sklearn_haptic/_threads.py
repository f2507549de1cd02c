"""Keep BLAS to one thread where products are small."""

from functools import wraps
from threading import local
from typing import Any

from ._typing import _Function, _threadpool_controller_decorator

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
