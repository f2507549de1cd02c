"""Fits that take turns, beside the same fits one after the other."""

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


def test_an_error_in_one_function_stops_no_other():
    X, done = np.eye(3), []

    def work(i):
        matrix = Matrix(X)
        for _ in range(4):
            matrix.times(np.ones((3, 1)))
            if i == 1:
                raise RuntimeError("mine")
        done.append(i)

    with pytest.raises(RuntimeError, match="mine"):
        run_together([partial(work, i) for i in range(3)])
    assert sorted(done) == [0, 2]


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
