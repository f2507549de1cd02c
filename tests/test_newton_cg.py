"""The linear model against statsmodels, a plain optimiser, and itself in company."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from scipy.special import expit
from sklearn.base import clone
from sklearn.exceptions import ConvergenceWarning

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, RegressedDistribution
from sklearn_haptic.models import _newton_cg
from sklearn_haptic.models._linear_models import fit_linear_models, is_linear

LEVELS = np.arange(5)


@pytest.fixture(autouse=True)
def small_tables_as_large_ones(monkeypatch):
    """Tables of the tests are not taken to double precision, as small ones are."""
    monkeypatch.setattr(_newton_cg, "_DOUBLED", 0)


def touches(n_trials, n_features, dtype=np.float64, seed=0):
    """Features whose spectrum falls slowly, and the counts of a dozen raters."""
    rng = np.random.default_rng(seed)
    n_factors = min(n_trials, n_features)
    factors = (
        rng.normal(size=(n_trials, n_factors)) / np.arange(1, n_factors + 1) ** 0.7
    )
    X = factors @ rng.normal(size=(n_factors, n_features))
    X += 0.3 * rng.normal(size=X.shape)
    latent = 1.5 * X[:, 0] / X[:, 0].std()
    ratings = latent[:, None] + rng.logistic(size=(n_trials, 12))
    level = np.digitize(ratings, [-2.0, -0.5, 0.5, 2.0])
    return X.astype(dtype), (level[:, :, None] == LEVELS).sum(axis=1)


def optimum(X, counts, alpha, weight):
    """Probabilities at the minimum of the cost by its definition."""
    X = X.astype(np.float64)
    total = weight.sum()
    X = X - weight @ X / total
    spread = np.sqrt(weight @ (X**2).sum(axis=1) / total)
    X = X / spread
    n_features = X.shape[1]

    def proba_of(params):
        cuts = np.cumsum(
            np.append(params[n_features], np.exp(params[n_features + 1 :]))
        )
        below = expit(cuts - (X @ params[:n_features])[:, None])
        return np.diff(below, axis=1, prepend=0, append=1), below

    def cost(params):
        proba, below = proba_of(params)
        ratio = weight[:, None] * counts / proba
        slope = -below * (1 - below) * (ratio[:, :-1] - ratio[:, 1:])
        later = np.cumsum(slope.sum(axis=0)[::-1])[::-1]
        later[1:] *= np.exp(params[n_features + 1 :])
        coef = params[:n_features]
        grad = np.append(alpha * coef - X.T @ slope.sum(axis=1), later)
        loss = -np.sum(weight[:, None] * counts * np.log(proba))
        return (loss + alpha / 2 * coef @ coef) / total, grad / total

    start = np.append(np.zeros(n_features), [-1.0, 0.0, 0.0, 0.0])
    found = minimize(
        cost, start, jac=True, method="BFGS", options={"gtol": 1e-9, "maxiter": 5000}
    )
    return proba_of(found.x)[0]


def test_maximum_likelihood_is_that_of_statsmodels_and_of_r(shared_data):
    """OrderedModel of statsmodels and clm of R's package ordinal print these digits."""
    wine = pd.read_csv(shared_data / "wine_ratings" / "ordinal_wine.csv")
    X = np.column_stack((wine["temp"] == "warm", wine["contact"] == "yes")) * 1.0
    model = NNPOM(0, alpha=0, tol=1e-9).fit(X, wine["rating"])
    assert_allclose(model.coefs_[0], [2.503102, 1.527798], atol=1e-6)
    thresholds = [-1.344383, 1.250809, 3.466887, 5.006404]
    assert_allclose(model.thresholds_, thresholds, atol=1e-6)
    assert -len(X) * model.loss_ == pytest.approx(-86.49192, abs=1e-5)


@pytest.mark.parametrize("alpha", [3.0, 1.0, 1e-2, 1e-4])
@pytest.mark.parametrize("shape", [(400, 20), (40, 60)])
def test_a_plain_optimiser_finds_the_same_optimum(shape, alpha):
    X, counts = touches(*shape)
    weight = np.random.default_rng(1).uniform(0.1, 2, len(X))
    proba = NNPOM(0, alpha, tol=1e-8).fit(X, counts, weight).predict_proba(X)
    assert_allclose(proba, optimum(X, counts, alpha, weight), atol=2e-5)


@pytest.mark.parametrize("alpha", [3.0, 1.0, 1e-1, 1e-4])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_products_alone_reach_the_optimum(monkeypatch, dtype, alpha):
    """With the exact Hessian as preconditioner, and with a few directions of it."""
    X, counts = touches(400, 300, dtype)
    default = NNPOM(0, alpha).fit(X, counts)
    monkeypatch.setattr(_newton_cg, "_FEW", 1000)
    exact = NNPOM(0, alpha, tol=1e-9).fit(X.astype(np.float64), counts)
    assert_allclose(
        default.predict_proba(X),
        exact.predict_proba(X),
        rtol=0,
        atol=1e-4 if alpha > 1e-3 else 3e-4,
    )


@pytest.mark.parametrize("offset", [3.0, 1e3])
@pytest.mark.parametrize("unit", [1.0, 1e-15, 1e15])
def test_single_precision_in_any_unit_with_any_offset(offset, unit):
    X, counts = touches(300, 280, np.float32)
    given = (unit * (X + offset)).astype(np.float32)
    expected = NNPOM(0).fit(given.astype(np.float64), counts)
    proba = NNPOM(0).fit(given, counts).predict_proba(given)
    assert_allclose(proba, expected.predict_proba(given), rtol=0, atol=1e-4)


def test_single_precision_stays_so():
    X, counts = touches(40, 30, np.float32)

    class Keeps(NNPOM):
        def fit_with_positions(self, X, *args, **kwargs):
            self.given_ = X.dtype
            return super().fit_with_positions(X, *args, **kwargs)

    model = DistributionalOrdinalRegressor(Keeps(0)).fit(X, counts)
    assert model.estimator_.given_ == np.float32
    double = clone(model).fit(X.astype(np.float64), counts)
    assert_allclose(model.predict_proba(X), double.predict_proba(X), rtol=0, atol=1e-5)
    for each in (model, RegressedDistribution().fit(X, counts)):
        assert each.predict_proba(X).dtype == np.float64


def test_few_strong_directions_in_single_precision(monkeypatch):
    monkeypatch.undo()
    rng = np.random.default_rng(0)
    X = rng.normal(size=(1000, 3)) @ rng.normal(size=(3, 600))
    X, counts = X.astype(np.float32), 1 + rng.poisson(3, (1000, 5))
    model = NNPOM(0, 1e-2).fit(X, counts)
    assert model.n_iter_ < 10
    double = NNPOM(0, 1e-2).fit(X.astype(np.float64), counts)
    assert_allclose(model.predict_proba(X), double.predict_proba(X), atol=1e-5)


def test_a_fit_cut_short_says_so():
    X, counts = touches(60, 5)
    with pytest.warns(ConvergenceWarning, match="did not converge .2 iterations"):
        NNPOM(0, max_iter=2).fit(X, counts)


@pytest.mark.parametrize("shape", [(80, 30), (300, 280)])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_many_fits_at_once_are_the_fits_one_by_one(shape, dtype):
    """Penalties, folds as weights, adjectives with levels of their own."""
    X, counts = touches(*shape, dtype)
    _, others = touches(*shape, seed=1)
    others[:, 0], others[:, 4] = 0, others[:, 4] + 1  # nobody chose the lowest
    certain = np.tile([0, 0, 12, 0, 0], (len(X), 1))
    fold = np.arange(len(X)) % 3
    weight = np.random.default_rng(2).uniform(0.5, 2, len(X))
    cases = [
        (DistributionalOrdinalRegressor(NNPOM(0, alpha, tol=1e-8)), rated, each)
        for alpha in (0.3, 30.0)
        for rated in (counts, others)
        for each in (weight, weight * (fold != 0), 1.0 * (fold != 1))
    ]
    cases.append((DistributionalOrdinalRegressor(), certain, weight))
    cases.append((DistributionalOrdinalRegressor(n_duplicates=5), counts, weight))
    assert all(is_linear(model) for model, *_ in cases)
    fits = fit_linear_models(
        [model for model, *_ in cases],
        X,
        np.array([rated for _, rated, _ in cases]),
        np.array([each for *_, each in cases]),
        LEVELS + 1,
    )
    for (model, rated, each), together in zip(cases, fits):
        alone = clone(model).set_params(levels=LEVELS + 1).fit(X, rated, each)
        assert_allclose(
            together.predict_proba(X),
            alone.predict_proba(X),
            rtol=0,
            atol=1e-6 if dtype == np.float64 else 1e-4,
        )
        assert together.estimator_.loss_ == pytest.approx(alone.estimator_.loss_)


def test_touches_of_a_fold_may_all_be_alike():
    """The spread of one fold alone is 0, but for rounding of the others' distance."""
    X = np.array([[0.0, -2.0, 1.0]] * 3 + [[1.0, 1.0, 1.0]])
    counts = np.array([[1, 1, 0, 0, 0]] * 3 + [[0, 0, 2, 4, 3]])
    weights = np.array([[0, 0, 0, 1.0], [1, 1, 1, 0], [1, 1, 1, 1]])
    model = DistributionalOrdinalRegressor()
    models = [clone(model) for _ in weights]
    fits = fit_linear_models(models, X, np.array([counts] * 3), weights, LEVELS)
    for fit, weight in zip(fits, weights):
        alone = clone(model).set_params(levels=LEVELS).fit(X, counts, weight)
        assert_allclose(fit.predict_proba(X), alone.predict_proba(X), atol=1e-6)


def test_what_is_linear():
    assert not is_linear(NNPOM(0))
    assert not is_linear(DistributionalOrdinalRegressor(NNPOM(3)))
    assert not is_linear(RegressedDistribution())
