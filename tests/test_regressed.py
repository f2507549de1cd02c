"""Distributions by regressors, against the regressors themselves and plain algebra."""

import numpy as np
import pytest
from sklearn.base import BaseEstimator
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.kernel_ridge import KernelRidge
from sklearn.linear_model import Ridge
from sklearn.multioutput import MultiOutputRegressor, RegressorChain
from sklearn.neighbors import KNeighborsRegressor
from sklearn.svm import SVR
from sklearn.tree import DecisionTreeRegressor

from sklearn_haptic import DummyDistribution, RegressedDistribution
from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.models._regressed import proper_shares

RNG = np.random.default_rng(0)
X = RNG.normal(size=(40, 3))
COUNTS = RNG.multinomial(12, RNG.dirichlet(np.ones(5), 40)).astype(float)
SHARES = COUNTS / COUNTS.sum(axis=1, keepdims=True)


def test_ridge_is_that_of_the_normal_equations():
    model = RegressedDistribution(Ridge(2.0)).fit(X, COUNTS)
    below = np.cumsum(SHARES, axis=1)[:, :-1]
    A = X - X.mean(axis=0)
    coef = np.linalg.solve(A.T @ A + 2 * np.eye(3), A.T @ (below - below.mean(axis=0)))
    cdf = below.mean(axis=0) + A @ coef  # inside [0, 1] and rising, as it turns out
    assert np.all(np.diff(cdf, axis=1) > 0) and cdf.min() > 0 and cdf.max() < 1
    np.testing.assert_allclose(model.predict_cdf(X)[:, :-1], cdf, atol=1e-12)


def test_trees_and_neighbours_predict_means_of_shares():
    for regressor in (
        KNeighborsRegressor(4),
        ExtraTreesRegressor(20, min_samples_leaf=3, random_state=0),
    ):
        model = RegressedDistribution(regressor).fit(X, COUNTS)
        below = np.cumsum(SHARES, axis=1)[:, :-1]
        alone = regressor.fit(X, below - below.mean(axis=0)).predict(X)
        expected = np.diff(alone + below.mean(axis=0), prepend=0, append=1)
        np.testing.assert_allclose(model.predict_proba(X), expected, atol=1e-12)
        assert model.predict_proba(X).min() >= 0


def test_the_layout_of_counts_does_not_break_ties_of_trees():
    for seed in range(20):
        counts = np.random.default_rng(seed).multinomial(6, [0.2] * 5, size=len(X))
        model = RegressedDistribution(DecisionTreeRegressor(random_state=0))
        expected = model.fit(X, counts).predict_proba(X + 0.1)
        got = model.fit(X, np.asfortranarray(counts)).predict_proba(X + 0.1)
        np.testing.assert_array_equal(got, expected)


def test_any_prediction_becomes_a_distribution_closer_to_every_truth():
    rng = np.random.default_rng(1)
    wild = rng.normal(0.5, 1, size=(500, 4))
    share = proper_shares(wild)
    assert share.min() >= 0
    np.testing.assert_allclose(share.sum(axis=1), 1, atol=1e-12)
    for _ in range(20):
        true = np.sort(rng.uniform(size=(500, 4)), axis=1)
        mended = np.cumsum(share, axis=1)[:, :-1]
        distance, before = ((each - true) ** 2 for each in (mended, wild))
        assert np.all(distance.sum(axis=1) <= before.sum(axis=1) + 1e-12)


@pytest.mark.parametrize("regressor", [Ridge(1e12), KernelRidge(alpha=1e12)])
def test_a_large_penalty_leads_to_the_marginal(regressor):
    weight = np.arange(1.0, 41)
    model = RegressedDistribution(regressor).fit(X, COUNTS, weight)
    mean = DummyDistribution().fit(X, COUNTS, weight).predict_proba(X)
    np.testing.assert_allclose(model.predict_proba(X), mean, atol=1e-6)


@pytest.mark.parametrize("weight", [np.arange(40) % 3, np.full(40, 2)])
def test_weights_equal_repeated_trials(weight):
    rows = np.repeat(np.arange(40), weight)
    for regressor in (Ridge(), KernelRidge(alpha=0.5, kernel="rbf")):
        weighted = RegressedDistribution(regressor).fit(X, COUNTS, weight)
        repeated = RegressedDistribution(regressor).fit(X[rows], COUNTS[rows])
        np.testing.assert_allclose(
            weighted.predict_proba(X), repeated.predict_proba(X), atol=1e-10
        )


@pytest.mark.parametrize("strategy", ["marginal", "barycentre"])
def test_weights_of_the_baselines_equal_repeated_trials(strategy):
    weight = RNG.integers(0, 4, size=40)
    rows = np.repeat(np.arange(40), weight)
    weighted = DummyDistribution(strategy).fit(X, COUNTS, weight).proba_
    repeated = DummyDistribution(strategy).fit(X[rows], COUNTS[rows]).proba_
    np.testing.assert_allclose(weighted, repeated, atol=1e-12)


def test_the_barycentre_is_the_median_of_cdfs():
    for n in (39, 40):
        median = np.median(np.cumsum(SHARES[:n], axis=1), axis=0)
        proba = DummyDistribution("barycentre").fit(X[:n], COUNTS[:n]).proba_
        np.testing.assert_allclose(np.cumsum(proba), median / median[-1], atol=1e-12)


def test_the_barycentre_of_objects_touched_unequally_often():
    """Weights 1 / touches make each object count once, also where two are middle."""
    for seed in range(50):
        rng = np.random.default_rng(seed)
        touches = rng.integers(1, 7, size=40)
        objects = np.repeat(np.arange(40), touches)
        model = DummyDistribution("barycentre")
        proba = model.fit(X, COUNTS).proba_
        rows = X[objects], COUNTS[objects], 1 / touches[objects]
        np.testing.assert_allclose(model.fit(*rows).proba_, proba, atol=1e-12)


def test_a_regressor_without_weights_is_refused_only_if_they_differ():
    model = RegressedDistribution(KNeighborsRegressor())
    model.fit(X, COUNTS, np.full(40, 3.0))
    with pytest.raises(ValueError, match="KNeighborsRegressor takes no sample_weight"):
        model.fit(X, COUNTS, np.arange(40))


@pytest.mark.parametrize("each", [MultiOutputRegressor, RegressorChain])
def test_regressors_that_take_nothing_but_tables_learn_two_levels(each):
    counts = COUNTS[:, 1:3] + 1
    model, plain = (
        RegressedDistribution(r).fit(X, counts) for r in (each(SVR()), SVR())
    )
    np.testing.assert_array_equal(model.predict_proba(X), plain.predict_proba(X))


def test_the_default_learns_and_repeats_itself():
    latent = X[:, 0] > 0
    counts = np.where(latent[:, None], [0, 2, 10], [10, 2, 0])
    one, two = (
        RegressedDistribution(random_state=3).fit(X, counts).predict_proba(X)
        for _ in range(2)
    )
    np.testing.assert_array_equal(one, two)
    mean = DummyDistribution().fit(X, counts).predict_proba(X)
    score = ranked_probability_score(counts, one)
    assert score < 0.75 * ranked_probability_score(counts, mean)


@pytest.mark.parametrize("n_levels", [2, 3])
def test_labels_and_words(n_levels):
    words = ["low", "mid", "high"][:n_levels]
    y = np.arange(40) % n_levels
    model = RegressedDistribution(Ridge(), levels=words).fit(X, np.array(words)[y])
    plain = RegressedDistribution(Ridge()).fit(X, np.eye(n_levels)[y])
    np.testing.assert_array_equal(model.predict_proba(X), plain.predict_proba(X))
    assert set(model.predict(X)) <= set(words)
    assert set(model.predict_quantile(X, [0, 1]).ravel()) <= set(words)
    assert model.sample(X, 3, random_state=0).shape == (40, 3)


class Odd(BaseEstimator):
    """Predicts what a function makes of the right shape."""

    def __init__(self, make):
        self.make = make

    def fit(self, X, y):
        self.n_outputs_ = y.shape[1]
        return self

    def predict(self, X):
        return self.make(len(X), self.n_outputs_)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda n, k: np.zeros((k, n)),
            r"an array of shape \(2, 4\), .*; give .*\(4, 2\)",
        ),
        (lambda n, k: np.zeros(n), r"an array of shape \(4,\), .*; give an estimator"),
        (lambda n, k: np.full((n, k), np.nan), "estimator predicts .* NaN or infinity"),
    ],
)
def test_odd_predictions_are_refused(make, message):
    X, counts = np.arange(4.0)[:, None], np.array([[2, 1, 0], [0, 2, 2]] * 2)
    model = RegressedDistribution(Odd(make)).fit(X, counts)
    with pytest.raises(ValueError, match=message):
        model.predict_proba(X)


class Cautious(ExtraTreesRegressor):
    """Predicts half of what its trees do."""

    def predict(self, X):
        return super().predict(X) / 2


def test_a_forest_of_ones_own_predicts_as_it_says():
    X, counts = np.arange(30.0)[:, None], np.eye(3)[np.arange(30) % 3]
    model = RegressedDistribution(Cautious(5, random_state=0)).fit(X, counts)
    below = model.mean_cdf_ + model.estimator_.predict(X)
    np.testing.assert_allclose(model.predict_cdf(X)[:, :-1], np.sort(below, axis=1))


def test_features_beyond_what_trees_compare_are_refused():
    X, counts = np.arange(30.0)[:, None], np.eye(3)[np.arange(30) % 3]
    model = RegressedDistribution(random_state=0).fit(X, counts)
    with pytest.raises(ValueError, match="X holds values beyond single precision"):
        model.predict_proba([[1e300]])


def test_a_regressor_of_one_output_is_told_how_to_predict_several():
    X, counts = np.arange(4.0)[:, None], np.array([[2, 1, 0], [0, 2, 2]] * 2)
    with pytest.raises(ValueError, match="a SVR, which predicts one output; wrap it"):
        RegressedDistribution(SVR()).fit(X, counts)
    RegressedDistribution(MultiOutputRegressor(SVR())).fit(X, counts)
