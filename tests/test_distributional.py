"""The distributional regressor: observations, decoding, any base, the paper."""

from fractions import Fraction

import mord
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from scipy.special import expit, logit
from sklearn.base import BaseEstimator, ClassifierMixin, RegressorMixin, clone
from sklearn.ensemble import (
    HistGradientBoostingClassifier,
    HistGradientBoostingRegressor,
    RandomForestClassifier,
)
from sklearn.linear_model import LogisticRegression, Ridge, RidgeClassifier
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor
from touches import ordinal_touches

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    SensorFusionNNPOM,
)
from sklearn_haptic.models._quantile_positions import (
    decide,
    population_quadrature,
    share_below,
    training_observations,
)
from sklearn_haptic.ratings._distributions import quantile_grid
from sklearn_haptic.utils._folds import validation_split


def ordinal_trials(n_objects=20):
    return ordinal_touches(n_objects, 5, [1, -0.5, 0.2, 0], spread=2, noise=0.3)


def test_random_labels_are_the_exact_inverse_cdf():
    rng = np.random.default_rng(0)
    counts = rng.integers(0, 6, size=(50, 5)).astype(float)
    counts[:, 3] += 1
    positions, level, weight = training_observations(
        counts, 15, "random", np.random.RandomState(0)
    )
    assert ((positions > 0) & (positions < 1)).all()
    assert_array_equal(weight, 1)
    for t, w in np.ndindex(level.shape):
        rank = Fraction(positions[t, w]) * int(counts[t].sum())
        below = np.cumsum(counts[t].astype(int))
        assert level[t, w] == np.argmax([b >= rank for b in below])


def test_each_cell_of_the_population_has_the_people_within_it():
    """Of 12,000 people in order of their rating, a loop counts those in each cell."""
    counts = np.array([[3.0, 0, 6, 2, 1], [0, 12, 0, 0, 0], [0.2, 0.3, 0.5, 0, 0]])
    positions, level, weight = training_observations(counts, 15, "level", None)
    assert_allclose(weight.sum(axis=1), 15)
    used = [w > 0 for w in weight]
    middles = np.unique(positions[0][used[0]])
    for t in (1, 2):  # trials share their positions, which then tell none of them
        assert_array_equal(np.unique(positions[t][used[t]]), middles)
    q = np.arange(len(middles) + 1) / len(middles)
    ends = q**2 * (3 - 2 * q)
    people = (np.arange(12_000) + 0.5) / 12_000
    cell = np.searchsorted(ends, people) - 1
    for share, *observed in zip(counts, positions, level, weight):
        rating = np.repeat(
            np.arange(5), np.rint(12_000 * share / share.sum()).astype(int)
        )
        expected = np.zeros((len(middles), 5))
        np.add.at(expected, (cell, rating), 15 / 12_000)
        found = np.zeros((len(middles), 5))
        for p, k, w in zip(*observed):
            if w > 0:
                found[np.searchsorted(middles, p), k] += w
        assert_allclose(found, expected, atol=2 * 15 / 12_000)


@pytest.mark.parametrize("n_people", [3, 12])
@pytest.mark.parametrize(
    "estimator",
    [
        RandomForestClassifier(min_samples_leaf=5, random_state=0),
        HistGradientBoostingClassifier(max_iter=50, early_stopping=False),
    ],
)
def test_trees_learn_the_shares_of_all_people(estimator, n_people):
    """Positions within the levels of each trial told trees the trial: off by .04 to .2.

    No feature tells anything.
    """
    rng = np.random.default_rng(0)
    counts = rng.multinomial(n_people, [0.7, 0.2, 0.06, 0.03, 0.01], size=300)
    X = rng.normal(size=(300, 2))
    below = DistributionalOrdinalRegressor(estimator).fit(X, counts).predict_cdf(X)
    true = np.cumsum(counts.mean(axis=0)) / n_people
    assert_allclose(below.mean(axis=0), true, rtol=0, atol=0.006)


@pytest.mark.parametrize("n_hidden", [0, 10])
@pytest.mark.parametrize(
    "n_people, share",
    [(3, [0.7, 0.2, 0.06, 0.03, 0.01]), (12, [0.0025, 0.045, 0.905, 0.045, 0.0025])],
)
def test_networks_learn_the_shares_of_all_people(n_people, share, n_hidden):
    """With positions within the levels of each trial they were off by .04 to .09."""
    rng = np.random.default_rng(0)
    counts = rng.multinomial(n_people, share, size=1500)
    X = rng.normal(size=(1500, 2))
    network = NNPOM(n_hidden, alpha=3, random_state=0)
    below = DistributionalOrdinalRegressor(network).fit(X, counts).predict_cdf(X)
    true = np.cumsum(counts.mean(axis=0)) / n_people
    assert_allclose(below.mean(axis=0), true, rtol=0, atol=0.01)


def test_paper_settings_never_change():
    """What is made of them may be changed, as any estimator."""
    model = DistributionalOrdinalRegressor(**PAPER_2020)
    model.set_params(estimator__max_iter=3, n_duplicates=4)
    joint = PAPER_2020 | {"n_duplicates": 5}
    joint["estimator"].set_params(max_iter=3)
    dict(PAPER_2020)["estimator"].set_params(max_iter=3)
    for settings in (PAPER_2020, joint):
        assert settings["estimator"].max_iter == 500
    assert PAPER_2020["n_duplicates"] == 15 and joint["n_duplicates"] == 5


@pytest.mark.parametrize("n_people", [12, 100])
@pytest.mark.parametrize("n_levels", [5, 7, 11, 21])
def test_scales_of_any_length_have_the_shares_of_all_people(n_levels, n_people):
    """Most people choose the lowest level, and no feature tells anything."""
    rng = np.random.default_rng(0)
    share = np.r_[0.6, np.full(n_levels - 1, 0.4 / (n_levels - 1))]
    counts = rng.multinomial(n_people, share, size=200)
    X = rng.normal(size=(200, 1))
    below = DistributionalOrdinalRegressor().fit(X, counts).predict_cdf(X)
    true = np.cumsum(counts.mean(axis=0)) / n_people
    assert_allclose(below.mean(axis=0), true, rtol=0, atol=0.008)


@pytest.mark.parametrize(
    "n_people", [np.full(300, 2), np.full(300, 3), 2 + 10 * (np.arange(300) % 20 == 0)]
)
def test_hidden_units_learn_the_ratings_of_two_or_three_people(n_people):
    """They jump where the levels of all objects begin: the population must not."""
    excess, spread = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        X, new = rng.normal(size=(2, 300, 2))
        latent = [X @ [1, 0] + 0.5 * np.sin(2 * X[:, 1]) for X in (X, new)]
        below, true = (expit([0.4, 1.2, 2, 2.8] - each[:, None]) for each in latent)
        shares = np.diff(below, prepend=0, append=1)
        counts = np.array([rng.multinomial(n, s) for n, s in zip(n_people, shares)])
        model = DistributionalOrdinalRegressor(NNPOM(random_state=0))
        found = model.fit(X, counts).predict_cdf(new)[:, :-1]
        excess.append(np.sum((found - true) ** 2))
        spread.append(np.sum(true * (1 - true)))
    assert sum(excess) < 0.03 * sum(spread)  # .04 to .06 with three positions per level


@pytest.mark.parametrize("n_levels", [2, 5])
def test_a_prediction_halfway_between_levels_is_half_of_each(n_levels):
    """So that levels may be turned round; of two neighbours, means are often .5."""
    rng = np.random.default_rng(0)
    X, new = rng.normal(size=(2, 60, 2))
    counts = rng.multinomial(12, np.ones(n_levels) / n_levels, size=60)
    params = {"sampling": "random", "random_state": 0, "p_transform": None}
    model = DistributionalOrdinalRegressor(KNeighborsRegressor(2), **params)
    model.fit(X, counts)
    proba = model.predict_proba(new)
    p = (np.arange(1000) + 0.5) / 1000
    rows = np.column_stack((np.repeat(new, len(p), axis=0), np.tile(p, len(new))))
    twice = np.rint(2 * model.estimator_.predict(rows)).astype(int)
    nearest = np.eye(n_levels)[twice // 2] / 2 + np.eye(n_levels)[-(-twice // 2)] / 2
    expected = nearest.reshape(len(new), len(p), n_levels).mean(axis=1)
    assert_allclose(np.cumsum(proba - expected, axis=1), 0, atol=0.006)


@pytest.mark.slow
@pytest.mark.parametrize("decode", ["mixture", "quantile"])
@pytest.mark.parametrize(
    "estimator",
    [
        None,
        NNPOM(3, random_state=0),
        mord.LogisticAT(),
        LogisticRegression(),
        HistGradientBoostingRegressor(max_iter=20),
        RandomForestClassifier(20, random_state=0),
        RidgeClassifier(),
        Ridge(),
    ],
    ids=lambda e: type(e).__name__,
)
def test_any_base_beats_the_marginal_and_agrees_with_itself(estimator, decode):
    X, counts, objects = ordinal_trials(n_objects=40)
    train = objects < 30
    model = DistributionalOrdinalRegressor(estimator, decode=decode, random_state=0)
    model.fit(X[train], counts[train])
    proba = model.predict_proba(X[~train])
    assert_allclose(proba.sum(axis=1), 1, rtol=1e-14)
    assert proba.shape == (50, 5) and (proba >= 0).all()
    marginal = DummyDistribution().fit(X[train], counts[train])
    assert model.score(X[~train], counts[~train]) > marginal.score(
        X[~train], counts[~train]
    )
    cdf = model.predict_cdf(X[~train])
    assert (cdf[:, -1] == 1).all() and (np.diff(cdf) >= 0).all()
    grid = np.arange(1, 100) / 100
    quantiles = model.predict_quantile(X[~train], grid)
    assert (np.diff(quantiles, axis=1) >= 0).all()
    share = np.stack([(quantiles == k).mean(axis=1) for k in range(1, 6)], axis=1)
    assert_allclose(share, proba, atol=0.02)
    assert_array_equal(model.predict_quantile(X[~train], 0.5), quantiles[:, 49])
    assert_array_equal(model.predict(X[~train]), proba.argmax(axis=1) + 1)
    sample = model.sample(X[~train], 4000, random_state=0)
    share = np.stack([(sample == k).mean(axis=1) for k in range(1, 6)], axis=1)
    assert_allclose(share, proba, atol=0.04)


def test_both_decodings_come_from_one_fit():
    X, counts, _ = ordinal_trials()
    model = DistributionalOrdinalRegressor(NNPOM(0)).fit(X, counts)
    w, v = model.estimator_.coefs_[0][:-1], model.estimator_.coefs_[0][-1]
    cuts = model.estimator_.thresholds_

    def mixture_cdf(x, k):
        return quad(lambda p: 1 / (1 + np.exp(x @ w + v * logit(p) - cuts[k])), 0, 1)[0]

    exact = [[mixture_cdf(x, k) for k in range(4)] for x in X[:5]]
    assert_allclose(model.predict_cdf(X[:5])[:, :4], exact, atol=1e-4)
    model.set_params(decode="quantile")
    closed_form = 1 / (1 + np.exp((X[:5] @ w[:, None] - cuts) / v))
    assert_allclose(model.predict_cdf(X[:5])[:, :4], closed_form, atol=1e-5)


@pytest.mark.parametrize(("decode", "error"), [("mixture", 1e-6), ("quantile", 5e-3)])
def test_shared_features_equal_repeated_rows(decode, error):
    """The same network on rows that are repeated; its crossings are not looked for."""

    class PlainNNPOM(NNPOM):
        fit_with_positions = property()

    X, counts, _ = ordinal_trials()
    params = {"scale_features": False, "tol": 1e-8, "random_state": 0}
    shared, repeated = (
        DistributionalOrdinalRegressor(base(2, **params), decode=decode)
        .fit(X, counts)
        .predict_cdf(X)
        for base in (NNPOM, PlainNNPOM)
    )
    assert_allclose(shared, repeated, atol=error)


class CountingBase(BaseEstimator):
    """Shares features: counts the training ratings near each position."""

    def __init__(self, share=0.0):
        self.share = share

    def fit(self, X, y):
        raise AssertionError("the rows were repeated")

    def fit_with_positions(self, *observed, levels, validation, **_):
        self.seen_, self.validation_ = observed, validation
        self.n_levels_ = len(levels)

    def validation_share(self):
        return self.share

    def predict_proba_with_positions(self, X, positions):
        _, seen, level, weight = self.seen_
        proba = np.zeros((len(X), len(positions), self.n_levels_))
        for p, position in enumerate(positions):
            near = weight * np.exp(-5 * (seen - position) ** 2)
            proba[:, p] = np.bincount(level.ravel(), near.ravel(), self.n_levels_)
        return proba / proba.sum(axis=2, keepdims=True)

    def predict(self, X):
        raise AssertionError("the rows were repeated")


@pytest.mark.parametrize("decode", ["mixture", "quantile"])
def test_another_base_may_share_features(decode):
    """Without features its mixture is about the marginal distribution."""
    X, counts, _ = ordinal_trials()
    model = DistributionalOrdinalRegressor(CountingBase(), decode=decode)
    proba = model.fit(X, counts).predict_proba(X)
    assert model.estimator_.seen_[0].shape == X.shape
    marginal = DummyDistribution().fit(X, counts).predict_proba(X)
    assert_allclose(proba, marginal, atol=0.01 if decode == "mixture" else 0.15)
    assert_allclose(proba, [proba[0]] * len(proba), rtol=1e-12)


def test_decide_by_hand():
    proba = np.array([[0.4, 0.15, 0.45], [0.5, 0.5, 0.0], [0.1, 0.2, 0.7]])
    assert decide(proba, "median").tolist() == [1, 0, 2]
    assert decide(proba, "argmax").tolist() == [2, 0, 2]


@pytest.mark.parametrize(
    ("slope", "error"), [(0.3, 1e-5), (1, 2e-5), (2, 1e-4), (4, 1e-3)]
)
def test_quadrature_over_the_population(slope, error):
    """Against adaptive quadrature, and far below the error of the 99-point grid."""
    nodes, weight = population_quadrature(20)

    def share(p, cut):
        return expit(cut - slope * logit(p))

    for cut in (-6, -1, 0.3, 2, 8):
        exact = quad(share, 0, 1, args=(cut,), epsabs=1e-9)[0]
        assert abs(weight @ share(nodes, cut) - exact) < error


@pytest.mark.slow
@pytest.mark.parametrize("p_transform", ["logit", None])
def test_quantile_decoding_beats_the_grid(p_transform):
    """Against 20,001 positions: a smaller error than that of the paper's 99."""
    X, counts, _ = ordinal_trials()
    model = DistributionalOrdinalRegressor(
        NNPOM(5, random_state=0), decode="quantile", p_transform=p_transform
    ).fit(X, counts)

    def on_grid(n_quantiles):
        inputs = model._to_input(quantile_grid(n_quantiles))
        proba = model.estimator_.predict_proba_with_positions(X, inputs)
        decided = decide(proba, "median")
        return np.stack([(decided <= k).mean(axis=1) for k in range(5)], axis=1)

    exact = on_grid(20_001)
    ours = np.abs(model.predict_cdf(X) - exact).max()
    assert ours < np.abs(on_grid(99) - exact).max()


def test_share_below_of_a_response_that_falls_and_rises():
    """Against counting a million positions."""
    inputs = np.linspace(0, 1, 33)
    rng = np.random.default_rng(0)
    latent = np.cumsum(rng.normal(size=(5, 33)), axis=1)
    thresholds = np.array([-np.inf, -1.0, 0.5, 0.5, 2.0])
    dense = (np.arange(1_000_000) + 0.5) / 1_000_000
    for row, share in zip(latent, share_below(latent, thresholds, inputs, np.positive)):
        response = np.interp(dense, inputs, row)
        expected = [np.mean(response <= cut) for cut in thresholds]
        assert_allclose(share, expected, atol=1e-5)


def test_levels_absent_from_a_fold_keep_their_column():
    X, counts, _ = ordinal_trials()
    counts[:, 2] = 0
    counts[:, 4] = 0
    counts[:, 0] += 1
    for base in (None, mord.LogisticAT(), Ridge(), RidgeClassifier()):
        model = DistributionalOrdinalRegressor(base).fit(X, counts)
        proba = model.predict_proba(X)
        assert proba.shape == (100, 5)
        if not isinstance(base, Ridge):  # a regressor predicts between and beyond
            assert (proba[:, [2, 4]] == 0).all()
    labels = np.array([1, 2, 4] * 33 + [1])
    model = DistributionalOrdinalRegressor(levels=[1, 2, 3, 4, 5]).fit(X, labels)
    assert model.predict_proba(X).shape == (100, 5)


def test_random_state_reaches_the_estimator_only_if_given():
    X, counts, _ = ordinal_trials()
    base = NNPOM(3, random_state=3)
    assert (
        DistributionalOrdinalRegressor(base).fit(X, counts).estimator_.random_state == 3
    )
    seeded = [
        DistributionalOrdinalRegressor(NNPOM(3), random_state=s).fit(X, counts)
        for s in (0, 0, 1)
    ]
    proba = [model.predict_proba(X) for model in seeded]
    assert_array_equal(proba[0], proba[1])
    assert not np.array_equal(proba[0], proba[2])


@pytest.mark.slow
def test_equal_weights_count_beside_the_penalty_of_a_base():
    X = np.random.default_rng(0).normal(size=(30, 2))
    counts = np.tile([2, 1, 3], (30, 1))
    once, twice = (
        DistributionalOrdinalRegressor(
            LogisticRegression(C=C, tol=1e-10, max_iter=1000),
            sampling="random",
            random_state=0,
        )
        .fit(X, counts, sample_weight=np.full(30, weight))
        .predict_proba(X)
        for C, weight in [(2.0, 1.0), (1.0, 2.0)]
    )
    assert_allclose(once, twice, atol=1e-7)


class Predicts(RegressorMixin, BaseEstimator):
    """Predicts one number, in an array of some shape."""

    def __init__(self, number, shape=(-1,)):
        self.number = number
        self.shape = shape

    def fit(self, X, y, sample_weight=None):
        return self

    def predict(self, X):
        return np.full(len(X), self.number).reshape(self.shape)


@pytest.mark.parametrize("base", [Predicts(1.0, (-1, 1)), Predicts(np.nan)])
def test_a_base_that_predicts_a_column_or_nan_is_refused(base):
    """A column would be matched with every row, and NaN be the lowest level."""
    with pytest.raises(ValueError, match="estimator predicts an array of shape"):
        DistributionalOrdinalRegressor(base).fit([[0.0], [1.0]], [[1, 2], [2, 1]])


@pytest.mark.parametrize("number", [1.6, 7, 1e19, 1e300])
def test_what_a_base_predicts_beyond_the_levels_is_the_last(number):
    model = DistributionalOrdinalRegressor(Predicts(number))
    model.fit([[0.0], [1.0]], [[1, 2, 2], [2, 1, 2]])
    assert model.predict_proba([[0.5]]).tolist() == [[0, 0, 1]]


class InOrderOfAppearance(ClassifierMixin, BaseEstimator):
    """A logistic regression whose classes are not sorted."""

    def fit(self, X, y):
        self.model_ = LogisticRegression().fit(X, y)
        self.order_ = np.random.default_rng(0).permutation(len(self.model_.classes_))
        self.classes_ = self.model_.classes_[self.order_]
        return self

    def predict_proba(self, X):
        return self.model_.predict_proba(X)[:, self.order_]

    def predict(self, X):
        return self.model_.predict(X)


def test_classes_of_a_base_may_have_any_order():
    X, counts, _ = ordinal_trials()
    found, expected = (
        DistributionalOrdinalRegressor(base, sampling="random", random_state=0)
        .fit(X, counts)
        .predict_proba(X)
        for base in (InOrderOfAppearance(), LogisticRegression())
    )
    assert_allclose(found, expected)


def test_how_to_decode_is_checked_also_after_fit():
    X, counts, _ = ordinal_trials()
    model = DistributionalOrdinalRegressor().fit(X, counts)
    with pytest.raises(ValueError, match="The 'decode' parameter"):
        model.set_params(decode="Mixture").predict_proba(X)
    with pytest.raises(ValueError, match="The 'rule' parameter"):
        model.set_params(decode="mixture", rule="mean").predict_rating(X, 0.5)


def test_levels_of_networks_inside_are_not_ignored():
    inside = SensorFusionNNPOM({"a": [0]}, final_estimator=NNPOM(1, levels=[1, 2, 3]))
    with pytest.raises(ValueError, match=r"^estimator has levels=\[1, 2, 3\], which"):
        DistributionalOrdinalRegressor(inside).fit([[0.0], [1.0]], [[1, 2], [2, 1]])


def test_base_without_weights_says_what_to_do():
    X, counts, _ = ordinal_trials()
    model = DistributionalOrdinalRegressor(KNeighborsClassifier())
    with pytest.raises(ValueError, match=r"takes no sample_weight.*'random'"):
        model.fit(X, counts)
    proba = (
        model.set_params(sampling="random", random_state=0)
        .fit(X, counts)
        .predict_proba(X)
    )
    assert_allclose(proba.sum(axis=1), 1)


def test_barycentre_minimises_the_mean_distance():
    """No other distribution lies closer to the training distributions in W1."""
    rng = np.random.default_rng(0)
    counts = rng.multinomial(12, [0.3, 0.2, 0.2, 0.2, 0.1], size=31)
    cdf = np.cumsum(counts / 12, axis=1)
    best = np.cumsum(
        DummyDistribution("barycentre").fit(np.zeros((31, 1)), counts).proba_
    )
    own = np.abs(cdf - best).sum(axis=1).mean()
    for other in np.cumsum(rng.dirichlet(np.ones(5), size=2000), axis=1):
        assert own <= np.abs(cdf - other).sum(axis=1).mean() + 1e-12


def test_validation_trials_may_be_given():
    """As many iterations as when the same trials are held out by the estimator."""
    X, counts, objects = ordinal_trials()
    base = NNPOM(5, 0.01, random_state=0, early_stopping=True, n_iter_no_change=30)
    model = DistributionalOrdinalRegressor(base, random_state=0)
    drawn = clone(model).fit(X, counts, groups=objects)
    rng = np.random.RandomState(0)
    rng.randint(2**31 - 1)  # the seed of the network comes first
    train, held_out = validation_split(len(X), objects, 0.1, rng)
    data = {"X_val": X[held_out], "y_val": counts[held_out]}
    given = clone(model).fit(X[train], counts[train], **data)
    assert drawn.estimator_.n_iter_ == given.estimator_.n_iter_ < 500
    assert_array_equal(drawn.predict_proba(X), given.predict_proba(X))


@pytest.mark.parametrize("p_transform, input_of", [("logit", logit), (None, float)])
def test_validation_trials_are_predicted_on_the_grid(p_transform, input_of):
    """At the positions of quantile decoding, as the estimator sees positions."""
    model = DistributionalOrdinalRegressor(
        CountingBase(share=0.5), p_transform=p_transform, n_quantiles=3
    )
    X, counts = np.zeros((2, 1)), np.array([[1, 2, 1], [0, 1, 3]])
    model.fit(X, counts, X_val=X, y_val=counts)
    _, inputs, level, weight = model.estimator_.validation_
    expected = [input_of(p) for p in (0.25, 0.5, 0.75)]
    assert_allclose(inputs, [expected, expected])
    assert_array_equal(level, [[0, 1, 1], [1, 2, 2]])
    assert (weight == 1).all()


def test_validation_trials_for_an_estimator_that_stops_early_by_other_means():
    X, counts, _ = ordinal_trials()
    peer = HistGradientBoostingRegressor(early_stopping=True)
    with pytest.raises(ValueError, match="X_val requires an estimator that stops earl"):
        DistributionalOrdinalRegressor(peer).fit(X, counts, X_val=X, y_val=counts)


def test_feature_names_reach_the_network():
    X, counts, _ = ordinal_trials()
    names = ["a", "b", "c", "d"]
    model = DistributionalOrdinalRegressor().fit(pd.DataFrame(X, columns=names), counts)
    assert model.estimator_.feature_names_in_.tolist() == [*names, "position"]
