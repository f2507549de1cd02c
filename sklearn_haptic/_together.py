"""Fits that take turns, so that their products with one matrix are computed at once.

Most of the time that a product of a large matrix with few columns takes goes to reading
the matrix. Networks that are fitted to the same features therefore wait for each other
wherever they multiply them, and each gets its columns of one wide product.
"""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from sklearn import config_context, get_config

_Result = TypeVar("_Result")

_this_thread = threading.local()


def run_together(functions: Sequence[Callable[[], _Result]]) -> list[_Result]:
    """Call functions in threads of their own, one of which runs at a time.

    A function runs until it needs a product of a `Matrix` that it shares with others.
    Products are computed once all of these wait for theirs, in the order of the
    functions, so what they return depends on nothing else.

    Parameters
    ----------
    functions : sequence of callable
        Called without arguments.

    Returns
    -------
    results : list
        What each of them returns.
    """
    turns, config = _Turns(len(functions)), get_config()

    def call(i):
        with config_context(**config), turns.running:
            _this_thread.turns = turns, i
            try:
                return functions[i]()
            finally:
                turns.leave(i)

    with ThreadPoolExecutor(len(functions)) as threads:
        return list(threads.map(call, range(len(functions))))


class _Turns:
    """The functions that share a matrix, and the products that they wait for."""

    def __init__(self, n_functions):
        self.running = threading.Condition()  # held by the function that runs
        self.members = set(range(n_functions))
        self.X, self.product = None, None
        self.factors, self.products = {}, {}

    def join(self, i, X):
        """Return whether the function takes part: not if its matrix is another."""
        if self.X is None:
            self.X, self.used = X, np.flatnonzero(X.any(axis=0))
            self.X_used = X[:, self.used]
        shared = X is self.X or np.array_equal(X, self.X)
        if not shared:
            self.leave(i)
        return shared

    def leave(self, i):
        """Let the others wait for this function no longer."""
        self.members.discard(i)
        self.factors.pop(i, None)
        self._multiply_if_all_wait()

    def multiply(self, i, product, factor):
        """Return the columns of ``product(factors)`` that belong to this factor."""
        self.factors[i] = factor
        self._multiply_if_all_wait(product)
        self.running.wait_for(lambda: i in self.products)
        return self.products.pop(i)

    def _multiply_if_all_wait(self, product=None):
        if product is not None:
            self.product = product
        if not self.factors or self.factors.keys() != self.members:
            return
        factors = [self.factors[i] for i in sorted(self.factors)]
        ends = np.cumsum([factor.shape[1] for factor in factors])
        columns = np.split(self.product(np.hstack(factors)), ends[:-1], axis=1)
        self.products = dict(zip(sorted(self.factors), columns))
        self.factors = {}
        self.running.notify_all()


class Matrix:
    """A matrix whose products are computed together, within `run_together`.

    Columns of zeros are left out of the work then.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
    """

    def __init__(self, X):
        self._X, self._turns = X, None
        turns, i = getattr(_this_thread, "turns", (None, None))
        _this_thread.turns = None, None  # of each function the first matrix is shared
        if turns is not None and turns.join(i, X):
            self._turns, self._i = turns, i

    def times(self, coef):
        """Return ``X @ coef``."""
        if self._turns is None:
            return self._X @ coef
        coef = coef[self._turns.used]
        return self._turns.multiply(self._i, self._times, coef)

    def add_transposed_times(self, rows, out):
        """Add ``X.T @ rows`` to an array of n_columns rows."""
        if self._turns is None:
            out += self._X.T @ rows
        else:
            product = self._turns.multiply(self._i, self._transposed_times, rows)
            out[self._turns.used] += product

    def _times(self, coef):
        return self._turns.X_used @ coef

    def _transposed_times(self, rows):
        return (rows.T @ self._turns.X_used).T  # takes 0.7 of the time of X.T @ rows
