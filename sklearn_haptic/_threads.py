"""One thread for linear algebra, whichever threads of the process ask for it."""

from contextlib import ContextDecorator
from threading import Lock

from sklearn.utils.parallel import _get_threadpool_controller


class OneBlasThread(ContextDecorator):
    """Limit BLAS to one thread until the last of those inside has left.

    The number of threads is one setting of the whole process. If each of several
    threads kept what it found and restored it at its end, one that began during
    another would restore the limit of that other, for good.

    Examples
    --------
    >>> from threadpoolctl import threadpool_info, threadpool_limits
    >>> from sklearn_haptic._threads import OneBlasThread
    >>> def n_threads():
    ...     return {each["num_threads"] for each in threadpool_info()
    ...             if each["user_api"] == "blas"}
    >>> with threadpool_limits(2, user_api="blas"):
    ...     with OneBlasThread():
    ...         inside = n_threads()
    ...     inside, n_threads()
    ({1}, {2})
    """

    def __init__(self):
        self._lock = Lock()
        self._n_inside = 0

    def __enter__(self):
        with self._lock:
            if self._n_inside == 0:
                controller = _get_threadpool_controller()
                self._limits = controller.limit(limits=1, user_api="blas")
            self._n_inside += 1

    def __exit__(self, *_):
        with self._lock:
            self._n_inside -= 1
            if self._n_inside == 0:
                self._limits.restore_original_limits()


one_blas_thread = OneBlasThread()  # one for all callers, which it counts
