"""Fits that take turns, so that their products with one matrix are computed at once.

Most of the time that a product of a large matrix with few columns takes goes to reading
the matrix. Networks that are fitted to the same features therefore wait for each other
wherever they multiply them, and each gets its columns of one wide product.
"""

import threading
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
from sklearn import config_context, get_config

_Result = TypeVar("_Result")

_this_thread = threading.local()


def run_together(functions: Sequence[Callable[[], _Result]]) -> list[_Result]:
    """Call functions in threads of their own, one of which runs at a time.

    A function runs until it needs a product of a `Matrix` that it shares with others;
    then the next one does. Products are computed once all wait for theirs: those of the
    kind that the first function waits for, in the order of the functions. So what they
    return depends on nothing else.

    Parameters
    ----------
    functions : sequence of callable
        Called without arguments.

    Returns
    -------
    results : list
        What each of them returns.

    Raises
    ------
    Exception
        The first function's, in their order, that raised one, once all have ended.
    """
    turns, config = _Turns(len(functions)), get_config()

    def call(i):
        with config_context(**config), turns.turn(i):
            _this_thread.turns = turns, i
            return functions[i]()

    with ThreadPoolExecutor(max(1, len(functions))) as threads:
        # Not by `map`: an error would cancel what has not begun, for which others wait.
        results = [threads.submit(call, i) for i in range(len(functions))]
    return [each.result() for each in results]


class _Turns:
    """Whose turn it is, the matrix that functions share, and its products."""

    def __init__(self, n_functions):
        self.X = None
        self.ready = deque(range(n_functions))  # those that need no product to go on
        self.asked, self.products = {}, {}  # by function: asked for, and computed
        # Each waits for a lock of its own: passing the turn on wakes one thread.
        self.gates = [threading.Lock() for _ in range(n_functions)]
        for gate in self.gates:
            gate.acquire()
        self._pass_on()

    @contextmanager
    def turn(self, i):
        """Wait for the first turn of a function; at its end, pass the turn on."""
        self.gates[i].acquire()
        try:
            yield
        finally:
            self._pass_on()

    def shares(self, X):
        """Return whether a matrix is the shared one, which the first becomes."""
        if self.X is None:
            self.X = X
        return X is self.X or (X.dtype == self.X.dtype and np.array_equal(X, self.X))

    def multiply(self, i, product, factor):
        """Return the columns of ``product(X, factors)`` that belong to this factor."""
        self.asked[i] = product, np.atleast_2d(factor.T).T  # one dimension is a column
        self._pass_on()
        self.gates[i].acquire()
        columns = self.products.pop(i)
        if isinstance(columns, Exception):
            raise columns
        return columns.reshape(len(columns), *factor.shape[1:])

    def _pass_on(self):
        if not self.ready and self.asked:
            product, _ = self.asked[min(self.asked)]
            self.ready.extend(
                i for i in sorted(self.asked) if self.asked[i][0] == product
            )
            factors = [self.asked.pop(i)[1] for i in self.ready]
            ends = np.cumsum([factor.shape[1] for factor in factors])
            try:
                columns = product(self.X, np.hstack(factors))
                columns = np.split(columns, ends[:-1], axis=1)
            except Exception as error:  # for each of those who wait to raise
                columns = [error] * len(factors)
            self.products = dict(zip(self.ready, columns))
        if self.ready:
            self.gates[self.ready.popleft()].release()


def _times(X, coef):
    return X @ coef


def _transposed_times(X, rows):
    return (rows.T @ X).T  # takes 0.7 of the time of X.T @ rows


class Matrix:
    """A matrix whose products are computed together, within `run_together`.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
    """

    def __init__(self, X):
        self._X, self._turns = X, None
        turns, i = getattr(_this_thread, "turns", (None, None))
        _this_thread.turns = None, None  # of each function the first matrix is shared
        if turns is not None and turns.shares(X):
            self._turns, self._i = turns, i

    def times(self, coef):
        """Return ``X @ coef``."""
        if self._turns is None:
            return self._X @ coef
        return self._turns.multiply(self._i, _times, coef)

    def add_transposed_times(self, rows, out):
        """Add ``X.T @ rows`` to an array of n_columns rows."""
        if self._turns is None:
            out += self._X.T @ rows
        else:
            out += self._turns.multiply(self._i, _transposed_times, rows)
