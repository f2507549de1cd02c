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
    then the next one does. Once all wait, the products of one kind, that which the
    first of them needs, are computed in the order of the functions, so what they return
    depends on nothing else.

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

    with ThreadPoolExecutor(len(functions)) as threads:
        # Not by `map`: an error would cancel what has not begun, for which others wait.
        results = [threads.submit(call, i) for i in range(len(functions))]
    return [each.result() for each in results]


class _Turns:
    """Whose turn it is, the matrix that functions share, and its products."""

    def __init__(self, n_functions):
        self.X = None
        self.ready = deque(range(n_functions))  # those that need no product to go on
        # By function: the kind of product, the product and its factor; and the result.
        self.asked, self.products = {}, {}
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
        return X is self.X or np.array_equal(X, self.X)

    def multiply(self, i, product, factor):
        """Return the columns of ``product(factors)`` that belong to this factor."""
        self.asked[i] = product.__name__, product, factor
        self._pass_on()
        self.gates[i].acquire()
        columns = self.products.pop(i)
        if isinstance(columns, Exception):
            raise columns
        return columns

    def _pass_on(self):
        if not self.ready and self.asked:
            kind, product, _ = self.asked[min(self.asked)]
            self.ready.extend(i for i in sorted(self.asked) if self.asked[i][0] == kind)
            factors = [self.asked.pop(i)[2] for i in self.ready]
            ends = np.cumsum([factor.shape[1] for factor in factors])
            try:
                columns = np.split(product(np.hstack(factors)), ends[:-1], axis=1)
            except Exception as error:  # for each of those who wait to raise
                columns = [error] * len(factors)
            self.products = dict(zip(self.ready, columns))
        if self.ready:
            self.gates[self.ready.popleft()].release()


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
        return self._turns.multiply(self._i, self._times, coef)

    def add_transposed_times(self, rows, out):
        """Add ``X.T @ rows`` to an array of n_columns rows."""
        if self._turns is None:
            out += self._X.T @ rows
        else:
            out += self._turns.multiply(self._i, self._transposed_times, rows)

    def _times(self, coef):
        return self._X @ coef

    def _transposed_times(self, rows):
        return (rows.T @ self._X).T  # takes 0.7 of the time of X.T @ rows
