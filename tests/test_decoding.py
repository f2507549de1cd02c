"""Distributions of estimators that jump as the position grows: against 20,000 rows."""

import mord
import numpy as np
import pytest
from scipy.special import expit
from sklearn.base import BaseEstimator, is_regressor
from sklearn.ensemble import (
    HistGradientBoostingRegressor,
    RandomForestClassifier,
    RandomForestRegressor,
)
from sklearn.linear_model import LogisticRegression
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC
from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor
from touches import ordinal_touches

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
from sklearn_haptic.models._quantile_positions import (
    largest_jump_error,
    population_cells,
    population_quadrature,
)

pytestmark = pytest.mark.filterwarnings("ignore:scipy.optimize. The `disp`")

ESTIMATORS = [
    RandomForestRegressor(10, random_state=0),
    RandomForestClassifier(10, random_state=0),
    HistGradientBoostingRegressor(max_iter=20),
    DecisionTreeClassifier(random_state=0),
    SVC(),
    mord.LAD(),
    mord.OrdinalRidge(),
    mord.LogisticAT(),
    LogisticRegression(),
    NNPOM(3, random_state=0),
]


def touches():
    return ordinal_touches(30, 4, [1, -0.5, 0.2], spread=1.5, noise=0.5)[:2]


def cdf_of_many_rows(estimator, x, n_levels, decode, n_rows=20_000):
    """Mean over as many evenly spaced people, from rows written out one by one."""
    p = (np.arange(n_rows) + 0.5) / n_rows
    rows = np.column_stack((np.tile(x, (n_rows, 1)), np.log(p / (1 - p))))
    if is_regressor(estimator):
        place = np.clip(estimator.predict(rows), 0, n_levels - 1)
        level = np.concatenate((np.ceil(place - 0.5), np.floor(place + 0.5)))
    elif hasattr(estimator, "predict_proba"):
        cdf = np.cumsum(estimator.predict_proba(rows), axis=1)
        if decode == "mixture":
            return cdf.mean(axis=0)[:-1]
        level = np.argmax(cdf >= 0.5, axis=1)
    else:
        level = estimator.predict(rows)
    return np.array([np.mean(level <= k) for k in range(n_levels - 1)])


def test_crossings_of_a_network_where_people_are_of_two_minds():
    """The shares are those of the network's own ratings along the population."""
    rng, p = np.random.RandomState(0), (np.arange(20_000) + 0.5) / 20_000
    X, new = rng.normal(size=(60, 3)), rng.normal(size=(10, 3))
    shares = np.where(X[:, :1] > 0, [0.5, 0, 0, 0, 0.5], [0, 0.5, 0, 0.5, 0])
    counts = np.array([rng.multinomial(12, each) for each in shares])
    model = DistributionalOrdinalRegressor(
        NNPOM(10, alpha=0.01), decode="quantile", random_state=0
    ).fit(X, counts)
    ratings = model.predict_rating(new, p)
    swept = (ratings[:, :, None] <= model.classes_).mean(axis=1)
    np.testing.assert_allclose(model.predict_cdf(new), swept, atol=0.005)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("seed", range(5))
def test_a_network_where_people_are_of_two_minds_is_decoded_at_new_trials(seed):
    """It may jump at the trials, and be smooth halfway between two of them."""
    rng = np.random.default_rng(seed)
    X, new = rng.normal(size=(40, 3)), rng.normal(size=(30, 3))
    cuts = np.linspace(-2.5, 2.5, 10)[1:-1]
    below = 1 / (1 + np.exp(-3 * (cuts - (X @ [1, -0.7, 0.4])[:, np.newaxis])))
    shares = np.diff(below, prepend=0, append=1)
    shares = (shares + shares[:, ::-1]) / 2  # half of the people turn the scale round
    counts = np.array([rng.multinomial(12, each) for each in shares])
    network = NNPOM(5, alpha=0.01, random_state=seed)
    model = DistributionalOrdinalRegressor(network, levels=range(9)).fit(X, counts)
    found = model.predict_cdf(new)[:, :-1]
    for x, cdf in zip(new, found):
        exact = cdf_of_many_rows(model.estimator_, x, 9, "mixture")
        np.testing.assert_allclose(cdf, exact, atol=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: type(e).__name__)
def test_any_estimator_is_decoded_within_half_a_percent(estimator):
    X, counts = touches()
    model = DistributionalOrdinalRegressor(estimator, sampling="random", random_state=0)
    model.fit(X[20:], counts[20:])
    decodings = ["mixture"]
    if hasattr(estimator, "predict_proba") and not isinstance(estimator, NNPOM):
        decodings.append("quantile")  # of others the same, or where f crosses cuts
    n_trials = 3 if isinstance(estimator, SVC) else 10  # it is slow
    for decode in decodings:
        model.set_params(decode=decode)
        found = model.predict_cdf(X[:n_trials])[:, :-1]
        for x, cdf in zip(X, found):
            exact = cdf_of_many_rows(model.estimator_, x, 5, decode)
            np.testing.assert_allclose(cdf, exact, atol=0.005)


@pytest.mark.slow
@pytest.mark.parametrize(
    "estimator",
    [
        DecisionTreeClassifier(random_state=0),
        DecisionTreeRegressor(random_state=0),
        KNeighborsClassifier(1),
    ],
    ids=lambda e: type(e).__name__,
)
def test_hundreds_of_jumps(estimator):
    rng = np.random.default_rng(0)
    X = np.round(rng.normal(size=(600, 1)))
    share = np.exp(-((np.arange(5) - 2 - 0.8 * X) ** 2) / 2.5)
    share /= share.sum(axis=1, keepdims=True)
    counts = np.array([rng.multinomial(12, each) for each in share])
    if isinstance(estimator, KNeighborsClassifier):
        X *= 0.01  # little beside the position
    model = DistributionalOrdinalRegressor(estimator, sampling="random", random_state=0)
    model.fit(X, counts)
    some = np.unique(X)[:, None]
    for x, cdf in zip(some, model.predict_cdf(some)[:, :-1]):
        exact = cdf_of_many_rows(model.estimator_, x, 5, "mixture", 200_000)
        np.testing.assert_allclose(cdf, exact, atol=0.005)


@pytest.mark.parametrize("order", [1, -1])
def test_trees_of_touches_that_most_people_rate_alike(order):
    """Whatever the order of the rows, of which the first are not disputed."""
    rng = np.random.default_rng(0)
    alike = [[12, 0, 0]] * 4 + [[0, 0, 12]] * 3
    disputed = [[5, 3, 4], [2, 6, 4], [3, 3, 6], [4, 4, 4], [6, 3, 3]]
    counts = np.repeat(alike + disputed, 5, axis=0)
    X = np.c_[counts @ [0, 2, 4] / 12 + rng.normal(scale=0.1, size=60)]
    tree = DecisionTreeClassifier(min_samples_leaf=3, random_state=0)
    model = DistributionalOrdinalRegressor(tree).fit(X[::order], counts[::order])
    for x, cdf in zip(X[35:], model.predict_cdf(X[35:])[:, :-1]):
        exact = cdf_of_many_rows(model.estimator_, x, 3, "mixture")
        np.testing.assert_allclose(cdf, exact, atol=0.005)


class Staircase(BaseEstimator):
    """The level jumps at given positions, up and down, whatever the features."""

    def __init__(self, jumps=()):
        self.jumps = jumps

    def fit(self, X, y, sample_weight=None):
        self.classes_ = np.unique(y)
        return self

    def predict(self, X):
        n_jumps = np.searchsorted(self.jumps, 1 / (1 + np.exp(-X[:, -1])))
        return np.array([0, 1, 0, 1, 2, 1, 2, 1])[n_jumps]


@pytest.mark.parametrize("seed", range(20))
def test_jumps_anywhere_in_closed_form(seed):
    """The exact share of a level is the length of the stretches at it."""
    rng = np.random.default_rng(seed)
    jumps = np.sort(rng.uniform(size=7 if seed % 2 else 1))
    X, counts = np.zeros((4, 1)), np.ones((4, 3))
    model = DistributionalOrdinalRegressor(Staircase(jumps)).fit(X, counts)
    length = np.diff(np.concatenate(([0], jumps, [1])))
    level = np.array([0, 1, 0, 1, 2, 1, 2, 1])[: len(length)]
    exact = [length[level == k].sum() for k in range(3)]
    np.testing.assert_allclose(model.predict_proba(X), [exact] * 4, atol=0.005)


def test_a_trial_is_decoded_the_same_in_any_company():
    X, counts = touches()
    forest = RandomForestRegressor(5, random_state=0)
    model = DistributionalOrdinalRegressor(forest).fit(X, counts)
    together = model.predict_proba(X)
    alone = [model.predict_proba(x[None])[0] for x in X[:10]]
    np.testing.assert_array_equal(together[:10], alone)


class RowCounter(BaseEstimator):
    """A logistic response of the position alone, or a step; counts its rows."""

    n_rows = most = 0

    def __init__(self, slope=1.0):
        self.slope = slope

    def fit(self, X, y, sample_weight=None):
        self.classes_ = np.unique(y)
        return self

    def predict_proba(self, X):
        RowCounter.n_rows += len(X)
        RowCounter.most = max(RowCounter.most, len(X))
        high = expit(self.slope * (X[:, -1] - 0.3))
        return np.stack([1 - high, high], axis=1)

    def predict(self, X):
        raise AssertionError("it has probabilities")


@pytest.mark.parametrize(("slope", "rows_a_trial"), [(2.0, 20), (300.0, 384)])
def test_rows_a_trial(slope, rows_a_trial):
    """A smooth response is swept on few nodes, and never in too many rows at once."""
    X, counts = np.zeros((5000, 3)), np.ones((5000, 2))
    model = DistributionalOrdinalRegressor(RowCounter(slope)).fit(X[:20], counts[:20])
    RowCounter.n_rows = RowCounter.most = 0
    p = (np.arange(100_000) + 0.5) / 100_000
    high = expit(slope * (np.log(p / (1 - p)) - 0.3)).mean()
    np.testing.assert_allclose(model.predict_proba(X)[:, 1], high, atol=0.005)
    assert RowCounter.n_rows == rows_a_trial * len(X)
    assert RowCounter.most <= 2**14


@pytest.mark.parametrize("n_hidden", [0, 5])
def test_steep_networks_are_decoded_as_well(n_hidden):
    """Where everyone rates alike, p alone decides and the response is a step."""
    X = np.random.default_rng(0).normal(size=(200, 2))
    counts = np.tile([2, 3, 4, 2, 1], (200, 1))
    network = NNPOM(n_hidden, 0.01, random_state=0)
    model = DistributionalOrdinalRegressor(network).fit(X, counts)
    p = (np.arange(20_000) + 0.5) / 20_000
    at = model.estimator_.predict_proba_with_positions(X[:5], np.log(p / (1 - p)))
    exact = np.cumsum(at.mean(axis=1), axis=1)
    few, weight = population_quadrature(20)
    at = model.estimator_.predict_proba_with_positions(X[:5], np.log(few / (1 - few)))
    off = np.abs(np.cumsum(np.einsum("tpk,p->tk", at, weight), axis=1) - exact).max()
    assert off > 0.005
    np.testing.assert_allclose(model.predict_cdf(X[:5]), exact, atol=0.005)


def test_cells_of_the_population():
    p, weight = population_cells(100)
    assert weight.sum() == pytest.approx(1, rel=1e-14)
    edges = np.append(0, np.cumsum(weight))
    assert (edges[:-1] < p).all() and (p < edges[1:]).all()
    assert weight @ p**2 == pytest.approx(1 / 3, abs=1e-4)


def test_error_of_jumps_is_a_bound():
    rng = np.random.default_rng(0)
    p, weight = population_cells(64)
    jumps = rng.uniform(size=500)
    cdf = (p < jumps[:, None]).astype(float)[:, :, None]
    error = np.abs(np.einsum("tpk,p->tk", cdf, weight)[:, 0] - jumps)
    inside = (jumps > p[0]) & (jumps < p[-1])
    assert (error <= largest_jump_error(cdf, weight) + 1e-15)[inside].all()
    assert largest_jump_error(cdf, weight).max() < 1.5 / 64
