"""Fits that take turns, beside the same fits one after the other."""

import subprocess
import sys
from functools import partial

import numpy as np
import pytest

from sklearn_haptic import PAPER_2020, DistributionalOrdinalRegressor
from sklearn_haptic._together import Matrix, run_together


def test_products_are_those_of_each_alone():
    """Whatever else a function does, and whether it shares the matrix or not."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(20, 9))
    X[:, [2, 5]] = 0
    other = rng.normal(size=X.shape)
    factors = [rng.normal(size=(9, h)) for h in (1, 4, 2, 3, 2)]
    n_rounds = [3, 1, 7, 5, 0]
    matrices = [X, X.copy(), X, other, X]

    def work(i):
        matrix, results = Matrix(matrices[i]), []
        for k in range(n_rounds[i]):
            rows = matrix.times(factors[i] + k)
            out = np.ones((9, rows.shape[1]))
            matrix.add_transposed_times(rows, out)
            results.append((rows, out))
        return results

    for i, results in enumerate(run_together([partial(work, i) for i in range(5)])):
        assert len(results) == n_rounds[i]
        for k, (rows, out) in enumerate(results):
            expected = matrices[i] @ (factors[i] + k)
            np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-12)
            np.testing.assert_allclose(
                out, 1 + matrices[i].T @ expected, rtol=0, atol=1e-11
            )


def test_functions_may_need_products_of_two_kinds_at_once():
    X, ones = np.arange(9.0).reshape(3, 3), np.ones((3, 1))

    def work(n_before):
        matrix, out = Matrix(X), np.zeros((3, 1))
        results = [matrix.times(ones) for _ in range(n_before)]
        matrix.add_transposed_times(ones, out)
        return [*results, out]

    for n_before, results in enumerate(
        run_together([partial(work, n) for n in range(4)])
    ):
        *rows, columns = results
        np.testing.assert_array_equal(rows, [X @ ones] * n_before)
        np.testing.assert_array_equal(columns, X.T @ ones)


@pytest.mark.parametrize("which", [(0,), (1,), (2,), (0, 2), (0, 1, 2)])
@pytest.mark.parametrize("when", ["no matrix", 0, 1, 3, 7])
def test_an_error_in_one_function_stops_no_other(which, when):
    """Before the matrix, before a product of either kind, or behind the last one."""
    rng = np.random.default_rng(0)
    X, done = rng.normal(size=(4, 3)), {}

    def fail_at(i, place):
        if i in which and place == when:
            raise RuntimeError(f"of {i}")

    def work(i):
        fail_at(i, "no matrix")
        matrix, coef = Matrix(X), np.full((3, i + 1), 1.0)
        for k in range(4):
            fail_at(i, 2 * k)
            rows = matrix.times(coef)
            fail_at(i, 2 * k + 1)
            out = np.zeros(coef.shape)
            matrix.add_transposed_times(rows, out)
            coef = out / np.abs(out).max()
        done[i] = coef

    with pytest.raises(RuntimeError, match=f"of {which[0]}"):
        run_together([partial(work, i) for i in range(3)])
    assert done.keys() == {0, 1, 2} - {*which}
    for i, result in done.items():
        coef = np.full((3, i + 1), 1.0)
        for _ in range(4):
            coef = X.T @ (X @ coef)
            coef /= np.abs(coef).max()
        np.testing.assert_allclose(result, coef, rtol=1e-9)


NONE_WAITS_FOR_EVER = """
from functools import partial
from itertools import product
import numpy as np
from sklearn_haptic._together import Matrix, run_together

def work(i, failing, last_rounds):
    matrix = Matrix(np.eye(3))
    for k in range(last_rounds if i == 2 else 4):
        rows = 2 if (i, k) == (failing, 1) else 3
        try:
            matrix.times(np.ones((rows, 1)))
        except ValueError:
            ended.append(i)
            raise
    ended.append(i)

def end(functions):
    try:
        run_together(functions)
    except ValueError as error:
        print(sorted(ended))

for failing, last_rounds in product([0, 1], [0, 1, 4]):
    ended = []
    end([partial(work, i, failing, last_rounds) for i in range(3)])
for _ in range(300):  # others may not have begun when the first fails
    ended = []
    end([partial(int, "no number"), *(partial(work, i, None, 4) for i in range(2))])
"""


def test_an_error_leaves_none_waiting_for_ever():
    """Neither for a product that fails nor for the turn of others; see how all end."""
    arguments = [sys.executable, "-c", NONE_WAITS_FOR_EVER]
    ended = subprocess.run(arguments, capture_output=True, text=True, timeout=100)
    expected = [[0, 1, 2]] * 6 + [[0, 1]] * 300
    assert ended.stdout.splitlines() == [*map(str, expected)], ended.stderr


def test_calls_follow_one_another_after_an_error():
    def fail():
        Matrix(np.eye(2)).times(np.ones((2, 1)))
        raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        run_together([fail, fail])
    products = run_together([lambda: Matrix(np.eye(2)).times(np.eye(2))] * 2)
    np.testing.assert_array_equal(products, [np.eye(2)] * 2)
    np.testing.assert_array_equal(Matrix(np.eye(2)).times(np.eye(2)), np.eye(2))


def test_networks_fitted_together_are_those_fitted_apart():
    """Same iterations, and the same parameters within 1e-10, with dead features."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(40, 30)).clip(0)
    X[:30, ::4] = 0  # in training trials
    counts = rng.poisson(1 + 3 * X[:, [1, 2, 3, 5, 6]])
    counts[:, 0] += 1

    def models():
        return [
            DistributionalOrdinalRegressor(**PAPER_2020, random_state=i).set_params(
                estimator__n_hidden=h, estimator__alpha=alpha
            )
            for i, (h, alpha) in enumerate([(1, 1.0), (5, 0.1), (3, 10.0), (2, 0.01)])
        ]

    def fits(models):
        train, validation = (X[:30], counts[:30]), (X[30:], counts[30:])
        return [
            partial(each.fit, *train, X_val=validation[0], y_val=validation[1])
            for each in models
        ]

    apart = [fit().estimator_ for fit in fits(models())]
    together = [model.estimator_ for model in run_together(fits(models()))]
    for one, other in zip(apart, together):
        assert one.n_iter_ == other.n_iter_
        for ours, theirs in zip(one.coefs_, other.coefs_):
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10)
        np.testing.assert_allclose(one.thresholds_, other.thresholds_, atol=1e-10)
