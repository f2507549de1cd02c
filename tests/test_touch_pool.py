"""Pools of touches, against plain loops and direct minimisation."""

from itertools import permutations

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import minimize
from scipy.special import expit
from scipy.stats import norm
from sklearn import config_context
from sklearn.base import clone
from sklearn.ensemble import AdaBoostClassifier
from sklearn.exceptions import DataConversionWarning
from sklearn.linear_model import LogisticRegression, RidgeCV
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from told_groups import Told

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    NoveltyGuard,
    RegressedDistribution,
    TouchPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.ensembles._pool_moments import (
    Moments,
    error_moments,
    felt_touches,
    mean_products,
    means_of_touches,
    pairs_of,
    pool_breadth,
    pool_weights,
    possible,
    spread_moments,
)
from sklearn_haptic.metrics import (
    dispersion,
    neg_rps_scorer,
    ranked_probability_score,
)
from sklearn_haptic.model_selection import cross_val_predict_proba
from sklearn_haptic.utils._folds import ObjectKFold

pytestmark = pytest.mark.filterwarnings("ignore:.*fit was given no groups")

N_LEVELS = 4
MEMBERS = [("a", NNPOM(0), ["a0", "a1"]), ("b", NNPOM(0), ["b"])]


def made(n_objects=30, n_touches=3, seed=0, noise=(0.5, 0.5)):
    """Features of two procedures; touches of an object share a part of the noise."""
    rng = np.random.default_rng(seed)
    objects = np.repeat(np.arange(n_objects), n_touches)
    latent = rng.normal(size=n_objects)
    felt = {}
    for name, size in zip(("a0", "a1", "b"), (noise[0], 1.0, noise[1])):
        own = latent + size * rng.normal(size=n_objects)
        felt[name] = own[objects] + size * rng.normal(size=len(objects))
    cuts = latent[:, None] + rng.normal(size=(n_objects, 15))
    level = np.digitize(cuts, [-1, 0, 1])
    counts = np.stack([(level == k).sum(axis=1) for k in range(N_LEVELS)], axis=1)
    return pd.DataFrame(felt), counts[objects].astype(float), objects


def lacking(X, seed=0):
    """Rows of which many lack a column or two."""
    X = X.copy()
    gone = np.random.default_rng(seed).random(X.shape) < 0.25
    return X.mask(gone)


# How errors go together -----------------------------------------------------


def test_members_that_lack_rows_get_no_absurd_weights():
    """Four equal members of known errors, of which three in ten are missing."""
    truth = np.full((5, 5), 0.2) + 0.02 * np.eye(5)
    root = np.linalg.cholesky(truth)
    objects, pairs = np.arange(48) // 2, np.ones((5, 5))
    for seed in range(200):
        rng = np.random.default_rng(seed)
        departure = (rng.normal(size=(48, 3, 5)) @ root.T).swapaxes(1, 2)
        whole = error_moments(departure, objects)
        assert_allclose(possible(whole).same, whole.same, rtol=1e-12)
        departure[np.pad(rng.random((48, 4)) < 0.3, ((0, 0), (0, 1)))] = np.nan
        moments = possible(error_moments(departure, objects))
        share, told = pool_weights(moments, pairs)
        assert np.abs(share).max() < 3
        assert told > 0.3 * 3 * share @ truth @ share


def looped_moments(departure, objects):
    """Correlations times sizes, one pair of members and of rows at a time."""
    n = departure.shape[1]
    added = departure.copy()
    for i in range(n - 1):
        added[:, i] -= departure[:, -1]
    marginal = np.mean(
        [np.mean([x @ x for x in added[objects == o, -1]]) for o in np.unique(objects)]
    )

    def mean_of(i, j, within):
        """Sums over objects of mean products and of both mean squares."""
        sums = np.zeros(3)
        for each in np.unique(objects):
            rows = np.flatnonzero(objects == each)
            found = [
                (a @ b, a @ a, b @ b)
                for r in rows
                for s in rows
                if (r == s) == within
                for a, b in [(added[r, i], added[s, j])]
                if np.isfinite(a @ b)
            ]
            sums += np.mean(found, axis=0) if found else 0
        return sums

    def both_of(i, j):
        """By how much products of one row exceed those of two, in each object."""
        found = []
        for each in np.unique(objects):
            rows = np.flatnonzero(objects == each)
            table = added[rows, i] @ added[rows, j].T
            one = np.diag(table)
            two = table[~np.eye(len(rows), dtype=bool)]
            one, two = one[np.isfinite(one)], two[np.isfinite(two)]
            if len(one) and len(two):
                found.append(one.mean() - two.mean())
        return found

    size = np.empty(n)
    for i in range(n):
        _, own, of_marginal = mean_of(i, n - 1, True)
        size[i] = np.sqrt(marginal * own / of_marginal)
    both, of_row = [], np.empty((n, n))
    for within in (True, False):
        moments = np.empty((n, n))
        for i in range(n):
            for j in range(n):
                product, first, second = mean_of(i, j, within)
                moments[i, j] = product / np.sqrt(first * second) * size[i] * size[j]
                if not within and len(pairs := both_of(i, j)):
                    moments[i, j] = of_row[i, j] - np.mean(pairs)
        of_row = moments if within else of_row
        errors = moments.copy()
        for i in range(n):
            for j in range(n):
                errors[i, j] += (i < n - 1) * moments[n - 1, j]
                errors[i, j] += (j < n - 1) * moments[i, n - 1]
                errors[i, j] += (i < n - 1) * (j < n - 1) * moments[n - 1, n - 1]
        both.append(errors)
    return both


@pytest.mark.parametrize("seed", range(3))
def test_moments_equal_a_loop_over_pairs_of_rows(seed):
    rng = np.random.default_rng(seed)
    objects = rng.integers(0, 5, size=24)
    _, objects = np.unique(objects, return_inverse=True)
    departure = rng.normal(size=(24, 3, 2))
    departure[:, :2][rng.random((24, 2)) < 0.2] = np.nan
    moments = error_moments(departure, objects)
    for mine, looped in zip(moments, looped_moments(departure, objects)):
        assert_allclose(mine, looped, atol=1e-12)


def test_objects_touched_once_do_not_make_further_touches_seem_better():
    """Of 25 objects ten are touched three times; each touch tells what it feels."""
    objects = np.repeat(np.arange(25), [3] * 10 + [1] * 15)
    pairs = pairs_of(felt_touches(np.eye(3, dtype=bool)))
    # Members predict 0.6 times what they feel, 1 + noise, and the marginal 0.
    shared, own = np.outer([-0.4] * 3 + [-1], [-0.4] * 3 + [-1]), np.diag([0.36] * 3)
    own = np.pad(own, ((0, 1), (0, 1)))
    truth = mean_products(Moments(shared + own, shared, 25), pairs)
    for seed in range(200):
        rng = np.random.default_rng(seed)
        felt = rng.normal(size=25)[objects, np.newaxis]
        members = 0.6 * (felt + rng.normal(size=(45, 3))) - felt
        departure = np.concatenate((members, -felt), axis=1)[..., np.newaxis]
        moments = error_moments(departure, objects)
        assert_allclose(moments.other[3, 3], moments.same[3, 3])
        share, told = pool_weights(possible(moments), pairs)
        error = share @ truth @ share
        assert error < 0.4  # by the best weights 0.25, by one touch 0.52
        assert told > error / 3


def test_objects_touched_once_tell_that_two_touches_err_together():
    rng = np.random.default_rng(0)
    departure = rng.normal(size=(30, 3, 4))
    moments = error_moments(departure, np.arange(30))
    products = np.einsum("rik,rjk->ij", departure, departure) / 30
    assert_allclose(moments.same, products)
    assert_allclose(moments.other, products)


def test_what_never_occurred_together_is_taken_to_err_together():
    departure = np.array([[[3.0], [np.nan], [1.0]], [[np.nan], [2.0], [1.0]]])
    moments = error_moments(departure, np.array([0, 1]))
    assert_allclose(moments.same, [[9, 6, 3], [6, 4, 2], [3, 2, 1]])
    assert_allclose(moments.other, moments.same)


def test_what_occurs_in_two_rows_only_errs_together_as_there():
    """Each touch of an object has one of two sensors; the next touches have both."""
    rng = np.random.default_rng(0)
    objects = np.repeat(np.arange(500), 4)
    felt = rng.normal(size=(500, 2))[objects]
    departure = np.column_stack((felt - felt.sum(axis=1)[:, np.newaxis], felt))
    departure = departure[:, [1, 0, 2]]  # a sensor errs by what the other one feels
    departure[:, 2] = -felt.sum(axis=1)
    departure[0::2, 0] = departure[1::2, 1] = np.nan
    same, other, _ = error_moments(departure[..., np.newaxis], objects)
    assert abs(same[0, 1]) < 0.1  # not 1
    assert same[0, 1] == pytest.approx(other[0, 1])
    touches = felt_touches([[True, True]])
    share, score = pool_weights(possible(Moments(same, other, 500)), pairs_of(touches))
    assert_allclose(share, [1, 1, -1], atol=0.05)
    assert score < 0.02


@pytest.mark.parametrize("seed", range(4))
def test_weights_minimise_the_score_of_the_pool(seed):
    """Of one object's touches, the mean of each member's predictions, weighted."""
    rng = np.random.default_rng(seed)
    n_touches, n_members = 3, 3
    there = np.array([[1, 1], [1, 0], [1, 1]], dtype=bool)
    # Many objects, each touched so: the score of a pool is a plain mean.
    shared = rng.normal(size=(200, 1, n_members, 2)) * [[[[1], [1.5], [1.2]]]]
    own = rng.normal(size=(200, n_touches, n_members, 2))
    departure = 1.0 * shared + own + 0.3
    departure[:, :, 2] = departure[:, :1, 2]  # the marginal
    objects = np.repeat(np.arange(200), n_touches)
    moments = error_moments(departure.reshape(-1, n_members, 2), objects)
    share, score = pool_weights(moments, pairs_of(felt_touches(there)))

    def of_pool(w):
        """Expected by exchanging touches: mean over which touch is which."""
        total = []
        for order in permutations(range(n_touches)):
            d = departure[:, order]
            a = d[:, :, 0].mean(axis=1)
            b = d[:, [0, 2], 1].mean(axis=1)
            total.append(((w[0] * a + w[1] * b + w[2] * d[:, 0, 2]) ** 2).sum(axis=1))
        return np.mean(total)

    assert score == pytest.approx(of_pool(share), rel=1e-9)
    found = minimize(
        of_pool,
        np.full(3, 1 / 3),
        bounds=[(0, 9), (0, 9), (-9, 9)],
        constraints={"type": "eq", "fun": lambda w: w.sum() - 1},
        method="SLSQP",
    )
    assert score <= found.fun + 1e-7
    assert_allclose(share, found.x, atol=1e-3)


def test_touches_that_err_together_are_worth_one():
    d = np.random.default_rng(0).normal(size=(40, 2, 3))
    objects = np.repeat(np.arange(20), 2)
    d[1::2] = d[::2]
    moments = error_moments(d, objects)
    one, five = (
        pool_weights(moments, pairs_of(felt_touches(np.ones((n, 1), bool))))
        for n in (1, 5)
    )
    assert_allclose(one[0], five[0])
    assert one[1] == pytest.approx(five[1])


def broad_by_hand(proba, power, blur):
    """Sort what is a CDF but for rounding and negative weights; raise or blur it."""
    below = np.sort(np.clip(np.append(np.cumsum(proba)[:-1], 1), 0, 1))
    proba = np.diff(below, prepend=0) ** power
    out = (1 - blur) * proba / proba.sum()
    for k, p in enumerate(proba / proba.sum()):
        for neighbour in (k - 1, k + 1):
            out[min(max(neighbour, 0), len(proba) - 1)] += blur * p / 2
    return out


def too_sure(n_objects=60, n_touches=3, seed=0):
    """Of two members and the marginal, and the true distributions."""
    rng = np.random.default_rng(seed)
    X, counts, objects = made(n_objects, n_touches, seed)
    levels = np.arange(N_LEVELS)
    proba = np.empty((len(X), 3, N_LEVELS))
    for i, name in enumerate(("a0", "b")):
        place = 1.5 + X[name].to_numpy() + 0.2 * rng.normal(size=len(X))
        proba[:, i] = np.exp(-2 * (place[:, None] - levels) ** 2)
    proba[:, 2] = counts.mean(axis=0)
    return proba / proba.sum(axis=2, keepdims=True), counts, objects


@pytest.mark.parametrize("sure", [True, False])
@pytest.mark.parametrize("touches", [[[0]], [[1]], [[0, 1]], [[0], [1]], [[0, 1]] * 3])
def test_a_pool_is_as_broad_as_it_errs(touches, sure):
    """Of all ways to take such touches from the three of each object."""
    proba, counts, objects = too_sure()
    proba = proba if sure else 0.4 * proba + 0.15
    share = np.array([0.5, 0.4, 0.1]) * [
        *(any(i in t for t in touches) for i in (0, 1)),
        1,
    ]
    share /= share.sum()
    spread = spread_moments(proba, counts / 15, objects)
    there = np.array([[i in touch for i in (0, 1)] for touch in touches])
    pooled, true = [], []
    for each in np.unique(objects):
        rows = np.flatnonzero(objects == each)
        for order in permutations(rows, len(touches)):
            mean = share[2] * proba[rows[0], 2]
            for i in (0, 1):
                of = [row for row, touch in zip(order, touches) if i in touch]
                if of:
                    mean = mean + share[i] * proba[of, i].mean(axis=0)
            pooled.append(mean)
            true.append(counts[rows[0]])
    pooled = np.array(pooled)
    before = dispersion(true, pooled)
    assert before < 0.97 if sure else before > 1.1
    shares = np.array(true) / 15
    breadth = pool_breadth(pooled, shares, spread, share, pairs_of(felt_touches(there)))
    assert breadth.blur > 0 if sure else breadth.power > 1
    pooled = [broad_by_hand(each, *breadth) for each in pooled]
    assert dispersion(true, pooled) == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize(
    "useless, expected",
    [([0.25] * 4, (1, 0)), ([0.5, 0, 0, 0.5], (1, 0)), ([1, 0, 0, 0], (1, 1))],
)
def test_a_pool_that_nothing_makes_as_broad_as_it_errs(useless, expected):
    """It is changed as far as that helps."""
    proba, counts, objects = too_sure()
    proba[:] = useless
    spread = spread_moments(proba, counts / 15, objects)
    share, pairs = np.array([0.5, 0.5, 0]), pairs_of(felt_touches([[True, True]]))
    breadth = pool_breadth(proba[:, 0], counts / 15, spread, share, pairs)
    assert breadth == expected


@pytest.mark.slow
def test_a_power_costs_hardly_any_score_on_many_levels():
    """Ridge regression predicts 21 levels unevenly, and a power makes peaks of that."""

    def touched(n_objects, rng):
        place = np.repeat(rng.normal(size=n_objects), 3)
        below = norm.cdf(np.linspace(-2.2, 2.2, 20) - place[:, None])
        proba = np.diff(below, axis=1, prepend=0, append=1)
        counts = rng.multinomial(12, proba[::3]).repeat(3, axis=0)
        X = place[:, None] + 0.5 * rng.normal(size=(len(place), 2))
        return X, counts, np.arange(len(place)) // 3, proba

    ridge = RegressedDistribution(RidgeCV([1, 10, 100, 1000, 10000]))
    scores = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        X, counts, objects, _ = touched(30, rng)
        pool = TouchPool([("a", ridge, [0]), ("b", ridge, [1])])
        pool.fit(X, counts, groups=objects)
        X, _, objects, true = touched(300, rng)
        mean = sum(
            each.predict_proba(X[:, [i]]) / 2
            for i, each in enumerate(pool.estimators_.values())
        )
        mean = mean.reshape(-1, 3, 21).mean(axis=1).repeat(3, axis=0)
        pooled = pool.predict_proba(X, groups=objects)
        scores.append([ranked_probability_score(true, p) for p in (pooled, mean)])
    pooled, mean = np.mean(scores, axis=0)
    assert pooled < 1.02 * mean


@pytest.mark.parametrize("seed", range(6))
def test_useless_members_of_few_objects_do_not_outweigh_the_mean(seed):
    """Though by chance two touches of an object may seem to err against each other."""
    rng = np.random.default_rng(seed)

    def touched(n_objects, n_touches):
        place = 1.5 * rng.normal(size=n_objects)
        below = expit(np.linspace(-2, 2, 4) - place[:, None])
        proba = np.diff(below, axis=1, prepend=0, append=1)
        objects = np.repeat(range(n_objects), n_touches)
        X = rng.normal(size=(len(objects), 15))
        return X, rng.multinomial(12, proba)[objects], objects

    model = DistributionalOrdinalRegressor(NNPOM(0, alpha=3))
    members = [(f"m{i}", model, [*range(5 * i, 5 * i + 5)]) for i in range(3)]
    X, counts, objects = touched(15, 2)
    pool = TouchPool(members).fit(X, counts, groups=objects)
    X, counts, objects = touched(200, 3)
    pooled = ranked_probability_score(counts, pool.predict_proba(X, groups=objects))
    mean = ranked_probability_score(counts, np.tile(pool.shares_, (len(X), 1)))
    assert pooled < mean + 0.05


def test_means_of_touches_by_hand():
    nan = [np.nan, np.nan]
    first = [[1, 0], [0.5, 0.5], nan, [0, 1], [0.2, 0.8]]
    second = [[0.9, 0.1], [0.7, 0.3], [0.3, 0.7], [0.1, 0.9], nan]
    proba = np.stack([first, second], axis=1)
    objects = np.array([0, 0, 0, 1, 2])
    both = np.array([[True, True]])
    one, of = means_of_touches(proba, objects, both)
    assert of.tolist() == [0, 1, 0]
    assert_allclose(one[:, 0, 0], [1, 0, 0.5])  # the last has no second member
    assert_allclose(one[:, 1, 0], [0.9, 0.1, 0.7])
    some = [[1, 0], nan, [0.5, 0.5]], [nan, [0.9, 0.1], [0.7, 0.3]]
    some, of = means_of_touches(np.stack(some, axis=1), objects[:3], both)
    assert_allclose(some[:, :, 0], [[0.5, 0.7]])  # not a pool of two other touches
    touches = np.array([[True, False], [True, True]])
    two, of = means_of_touches(proba, objects, touches)
    assert of.tolist() == [0, 1]
    assert_allclose(two[:, :, 0], [[0.75, 0.9], [0, 0.1]])
    apart, of = means_of_touches(proba, objects, np.eye(2, dtype=bool))
    assert of.tolist() == [0, 1]  # of which the second has but one row
    assert_allclose(apart[:, :, 0], [[1, 0.7], [0, 0.1]])
    lacking = np.where(np.arange(5)[:, None, None] % 2 == [[[0], [1]]], proba, np.nan)
    mixed, of = means_of_touches(lacking, objects, both)
    assert of.tolist() == [0]  # the only one with rows of either member
    assert_allclose(mixed[:, :, 0], [[1, 0.7]])


@pytest.mark.parametrize("n_touches", [1, 3])
@pytest.mark.parametrize("noise", [0.3, 0.7, 1.5])
def test_pools_of_touches_that_differ_are_calibrated(noise, n_touches):
    """New objects; the mean distribution has a negative weight."""
    rng, dispersions = np.random.default_rng(0), []

    def touched(n_objects, n_touches):
        felt = rng.normal(size=n_objects)
        objects = np.repeat(range(n_objects), n_touches)
        ratings = 3 + 1.2 * felt[:, None] + 0.5 * rng.normal(size=(n_objects, 12))
        ratings = np.clip(np.round(ratings), 1, 5)
        counts = (ratings[:, :, None] == range(1, 6)).sum(axis=1)
        X = felt[objects] + noise * rng.normal(size=len(objects))
        return X[:, None], counts[objects], objects

    for n_objects in (80, 80, 1200):  # of which some tell the breadth
        X, counts, objects = touched(n_objects, 3)
        member = "touch", DistributionalOrdinalRegressor(), [0]
        pool = TouchPool([member]).fit(X, counts, groups=objects)
        X, counts, objects = touched(300, n_touches)
        dispersions.append(dispersion(counts, pool.predict_proba(X, groups=objects)))
    assert np.mean(dispersions) == pytest.approx(1, abs=0.12)


# The estimator ---------------------------------------------------------------


def test_no_rows_have_no_predictions():
    X, y, objects = made()
    pool = TouchPool(MEMBERS).fit(X, y, groups=objects)
    assert pool.predict_proba(X[:0]).shape == (0, N_LEVELS)
    assert pool.predict(X[:0]).shape == (0,)


@pytest.mark.parametrize("seed", range(4))
def test_a_member_that_feels_nothing_has_no_weight(seed):
    """Its predictions differ from the mean distribution by rounding alone."""
    X, y, objects = made(seed=seed)
    X["a0"] = X["a1"] = 1.0
    pool = TouchPool(MEMBERS).fit(X, y, groups=objects)
    assert pool.weights([["a", "b"]])["a"] == 0
    assert pool.weights([["a"]]) == {"a": 0, "b": 0, "marginal": 1}
    alone = TouchPool(MEMBERS[1:]).fit(X, y, groups=objects)
    expected = alone.predict_proba(X)
    assert_allclose(pool.predict_proba(X), expected, atol=1e-12)


def test_predictions_equal_a_plain_loop():
    X, counts, objects = made()
    X = lacking(X)
    pool = TouchPool(MEMBERS, cv=4).fit(X, counts, groups=objects)
    new, _, new_objects = made(8, 3, seed=1)
    new = lacking(new, 1)
    proba = pool.predict_proba(new, groups=new_objects)
    truth = counts / counts.sum(axis=1, keepdims=True)
    members = {
        name: clone(model).fit(
            X[columns].dropna(), counts[X[columns].notna().all(axis=1)]
        )
        for name, model, columns in MEMBERS
    }
    for each in np.unique(new_objects):
        rows = new[new_objects == each]
        touches = [
            [name for name, _, columns in MEMBERS if row[columns].notna().all()]
            for _, row in rows.iterrows()
        ]
        weights = pool.weights(touches)
        expected = weights["marginal"] * truth.mean(axis=0)
        for name, _, columns in MEMBERS:
            felt = rows[columns].dropna()
            if len(felt):
                expected = expected + weights[name] * members[name].predict_proba(
                    felt
                ).mean(axis=0)
            else:
                assert weights[name] == 0
        expected = broad_by_hand(expected, **pool.breadth(touches))
        for row in proba[new_objects == each]:
            assert_allclose(row, expected, atol=1e-12)


def test_predictions_out_of_fold_are_of_models_without_the_object():
    X, counts, objects = made()
    X = lacking(X)
    pool = TouchPool(MEMBERS, cv=3).fit(X, counts, groups=objects)
    for i, (_, model, columns) in enumerate(MEMBERS):
        there = X[columns].notna().all(axis=1).to_numpy()
        assert np.isnan(pool.oof_proba_[~there, i]).all()
        for train, test in ObjectKFold(3).split(X, groups=objects):
            train, test = train[there[train]], test[there[test]]
            fitted = clone(model).fit(X[columns].iloc[train], counts[train])
            assert_array_equal(
                pool.oof_proba_[test, i], fitted.predict_proba(X[columns].iloc[test])
            )


def test_linear_members_learn_from_the_rows_that_they_have():
    """Fitted together, they are what they are behind a step that does nothing."""
    X, counts, objects = made()
    X = lacking(X)
    bare, behind = (
        TouchPool([("a", each, ["a0", "a1"]), ("b", each, ["b"])])
        .fit(X, counts, groups=objects)
        .predict_proba(X)
        for each in (
            DistributionalOrdinalRegressor(),
            make_pipeline("passthrough", DistributionalOrdinalRegressor()),
        )
    )
    assert_allclose(bare, behind, atol=1e-5)


@pytest.mark.parametrize("routing", [False, True])
def test_members_that_ask_are_told_the_objects(routing):
    X, counts, objects = made(10)
    X.loc[:4, "b"] = np.nan
    members = [
        ("plain", AdaBoostClassifier(n_estimators=2), ["a0", "a1"]),
        ("alone", Told(), ["b"]),
        ("last", make_pipeline("passthrough", Told()), ["b"]),
    ]
    with config_context(enable_metadata_routing=routing):
        pool = TouchPool(members).fit(X, counts.argmax(axis=1), groups=objects)
    told = pool.estimators_["alone"], pool.estimators_["last"][-1]
    for member in told:
        assert_array_equal(member.groups_, objects[5:])


def test_a_row_without_anything_gets_the_mean_distribution():
    X, counts, objects = made()
    pool = TouchPool(MEMBERS).fit(X, counts, groups=objects)
    nothing = X.iloc[:2].mask(np.ones((2, 3), bool))
    marginal = DummyDistribution().fit(X, counts).proba_
    assert_allclose(pool.predict_proba(nothing), [marginal] * 2)
    assert pool.weights([[]]) == {"a": 0, "b": 0, "marginal": 1}


def test_a_touch_without_anything_changes_nothing():
    X, counts, objects = made()
    rng = np.random.default_rng(0)
    some = rng.random(len(X)) < 0.6  # unequal numbers of touches
    X, counts, objects = X[some], counts[some], objects[some]
    X = X.mask(rng.random(X.shape) < 0.2)
    pool = TouchPool(MEMBERS).fit(X, counts, groups=objects)
    touch = X.dropna().iloc[:1]
    nothing = touch.mask(np.ones(touch.shape, bool))
    alone = pool.predict_proba(touch)[0]
    with_empty = pool.predict_proba(
        pd.concat([nothing, touch, nothing]), groups=[*"aaa"]
    )
    assert_allclose(with_empty, [alone] * 3, atol=1e-12)


def test_more_is_never_expected_to_be_worse():
    X, counts, objects = made()
    pool = TouchPool(MEMBERS).fit(X, counts, groups=objects)
    excess = pool.expected_excess
    assert excess([["a", "b"]]) <= min(excess([["a"]]), excess([["b"]])) <= excess([])
    one, ten = excess([["a"]]), excess([["a"]] * 10)
    assert 0.3 * one < ten < one


@pytest.mark.parametrize("n", [1, 10, 100, 10_000])
def test_a_mean_square_is_never_negative(n):
    """Also where products of errors, estimated one by one, cannot be those of any."""
    for seed in range(5):
        X, counts, objects = made(n_objects=6, seed=seed)
        pool = TouchPool(MEMBERS, cv=3).fit(X, counts, groups=objects)
        assert pool.expected_excess([["a", "b"]] * n) >= 0


def test_pools_score_better_and_are_calibrated():
    X, counts, objects = made(300)
    pool = TouchPool(MEMBERS).fit(X, counts, groups=objects)
    new, true, groups = made(300, seed=1)
    scores = [
        ranked_probability_score(true, proba)
        for proba in (
            pool.predict_proba(new, groups),
            pool.predict_proba(new),
            pool.predict_proba(new.assign(b=np.nan)),
            pool.predict_proba(new.assign(a0=np.nan, b=np.nan)),
        )
    ]
    assert (np.diff(scores) > 0.005).all()
    assert dispersion(true, pool.predict_proba(new, groups)) == pytest.approx(
        1, abs=0.1
    )


@pytest.mark.parametrize("touches", [1, 3])
def test_members_that_are_too_sure_make_calibrated_pools(touches):
    X, counts, objects = made(60)
    sharp = [(name, NNPOM(4, alpha=1e-3, random_state=0), c) for name, _, c in MEMBERS]
    pool = TouchPool(sharp).fit(X, counts, groups=objects)
    new, true, groups = made(300, seed=1)
    groups = None if touches == 1 else groups
    proba = pool.predict_proba(new, groups)
    assert 0.85 < dispersion(true, proba) < 1.1
    assert pool.breadth([[]]) == {"power": 1, "blur": 0}
    excess = np.cumsum(proba, axis=1) - np.cumsum(true, axis=1) / 15
    assert pool.expected_excess([["a", "b"]] * touches) == pytest.approx(
        (excess**2).sum(axis=1).mean(), rel=0.25
    )


def test_forms_of_input_agree():
    X, counts, objects = made()
    by_index = [("a", NNPOM(0), [0, 1]), ("b", NNPOM(0), [2])]
    one = TouchPool(MEMBERS).fit(X, counts, groups=objects).predict_proba(X)
    two = TouchPool(by_index).fit(X.to_numpy(), counts, groups=objects)
    assert_array_equal(one, two.predict_proba(X.to_numpy()))
    assert_array_equal(one, two.predict_proba(X.to_numpy().tolist()))
    pool = TouchPool(MEMBERS).fit(X, counts, groups=objects)
    assert_array_equal(one, pool.predict_proba(X[["b", "a1", "a0"]]))


@pytest.mark.parametrize("columns", [0, [0, 1], slice(0, 2), [True, True, False]])
def test_positions_in_a_data_frame_are_refused(columns):
    """Another may have its columns in another order."""
    X, counts, objects = made()
    with pytest.raises(ValueError, match="A member takes columns of X by position"):
        TouchPool([("a", NNPOM(0), columns)]).fit(X, counts, groups=objects)
    pool = TouchPool([("a", NNPOM(0), [0, 1])])
    numbered = X.set_axis(range(3), axis=1)
    pool.fit(numbered, counts, groups=objects)
    with pytest.raises(ValueError, match="by position"):
        pool.predict_proba(numbered[[2, 0, 1]])
    with pytest.raises(ValueError, match="by position"):
        pool.fit(numbered[[2, 0, 1]], counts, groups=objects)


@pytest.mark.parametrize("ordered", [False, True])
def test_labels_with_an_order_and_without(ordered):
    X, counts, objects = made()
    names = np.array([1, 2, 3, 4] if ordered else ["felt", "cork", "wood", "steel"])
    labels = names[counts.argmax(axis=1)]
    member = NNPOM(0) if ordered else LogisticRegression()
    members = [(n, member, columns) for n, _, columns in MEMBERS]
    folds = list(GroupKFold(5).split(X, groups=objects))
    pool = TouchPool(members, cv=folds).fit(X, labels, groups=objects)
    assert pool.classes_.tolist() == sorted(names)
    share_right = np.mean(pool.predict(X) == labels)
    assert share_right > 0.4 and (pool.score(X, labels) == share_right) != ordered
    truth = labels[:, None] == pool.classes_
    marginal = np.full(truth.shape, np.nan)
    for train, test in folds:
        marginal[test] = truth[train].mean(axis=0)
    departure = marginal - truth
    if ordered:
        departure = departure.cumsum(axis=1)
    score = (departure**2).sum(axis=1).mean()
    assert pool.expected_excess([]) == pytest.approx(score)
    column = pd.DataFrame({"material": labels})
    with pytest.warns(DataConversionWarning, match="column-vector"):
        same = clone(pool).fit(X, column, groups=objects)
    assert_allclose(same.predict_proba(X), pool.predict_proba(X), atol=1e-12)


@pytest.mark.parametrize("n_touches", [2, 5])
def test_pools_of_touches_with_a_rating_each_are_calibrated(n_touches):
    """Touches of an object are rated by other people each, once."""
    rng, dispersions = np.random.default_rng(0), []

    def touched(n_objects):
        objects = np.repeat(range(n_objects), n_touches)
        felt = rng.normal(size=n_objects)[objects]
        ratings = np.rint(3 + felt + 0.8 * rng.normal(size=len(felt))).clip(1, 5)
        X = felt[:, None] + 0.7 * rng.normal(size=(len(felt), 1))
        return X, ratings.astype(int), objects

    for _ in range(3):
        X, ratings, objects = touched(80)
        member = "touch", DistributionalOrdinalRegressor(), [0]
        pool = TouchPool([member]).fit(X, ratings, groups=objects)
        X, ratings, objects = touched(300)
        proba = pool.predict_proba(X, groups=objects)
        dispersions.append(dispersion(ratings, proba))
    assert np.mean(dispersions) == pytest.approx(1, abs=0.12)


def test_runs_that_hold_all_objects_are_told():
    """Their ratings are alike, also if touches were rated one by one by few people."""
    X, counts, objects = made()
    runs = np.arange(len(X)) % 3
    with pytest.warns(UserWarning, match="give the objects: TouchPool averages"):
        TouchPool(MEMBERS).fit(X, counts, groups=runs)
    rng = np.random.default_rng(0)
    anew = np.array([rng.multinomial(3, each / each.sum()) for each in counts])
    with pytest.warns(UserWarning, match="give the objects: TouchPool averages"):
        TouchPool(MEMBERS).fit(X, anew, groups=runs)
    TouchPool(MEMBERS).fit(X, anew, groups=objects)


@pytest.mark.parametrize("told", ["objects", "runs"])
def test_pools_of_classes_are_as_sure_as_they_are_right(told):
    """Touches of a run are of several materials, of which each is an object."""
    rng, found = np.random.default_rng(0), []
    names = np.array(["cork", "felt", "foam", "wood"])
    for _ in range(4):
        centre = 1.5 * rng.normal(size=(4, 3))

        def touched(n_objects, own, centre=centre):
            kind, objects = np.arange(n_objects) % 4, np.repeat(range(n_objects), 3)
            place = centre[kind] + own * rng.normal(size=(n_objects, 3))
            X = place[objects] + 1.5 * rng.normal(size=(len(objects), 3))
            return X, names[kind][objects], objects

        own = 0.5 if told == "objects" else 0
        X, y, objects = touched(80, own)
        groups = objects if told == "objects" else objects // 4
        pool = TouchPool([("a", LogisticRegression(), [0, 1, 2])])
        pool.fit(X, y, groups=groups)
        X, y, objects = touched(400, own)
        proba = pool.predict_proba(X, groups=objects)
        right = y[:, None] == pool.classes_
        brier = ((proba - right) ** 2).sum(axis=1).mean()
        sure, share = proba.max(axis=1).mean(), right[range(1200), proba.argmax(1)]
        found.append([sure - share.mean(), pool.expected_excess([["a"]] * 3) - brier])
    too_sure, excess = np.mean(found, axis=0)
    assert abs(too_sure) < 0.05 and abs(excess) < 0.08


def test_a_pool_of_many_objects_is_judged_by_all_classes():
    """Rows that name each class in turn, every second of which is easily told."""
    n_runs, rng = 60, np.random.default_rng(0)
    centre = np.zeros((10, 6))
    centre[::2, :5], centre[1::2, 5] = 6 * np.eye(5), np.arange(5) / 2

    def touched():
        y, run = np.tile(np.repeat(range(10), 2), n_runs), np.repeat(range(n_runs), 20)
        own = 0.7 * rng.normal(size=(n_runs, 10, 6))
        return centre[y] + own[run, y] + rng.normal(size=(len(y), 6)), y, run

    X, y, run = touched()
    pool = TouchPool([("a", LogisticRegression(C=0.05), list(range(6)))])
    pool.fit(X, y, groups=run)
    X, y, run = touched()
    proba = pool.predict_proba(X, groups=10 * run + y)
    assert proba.max(axis=1).mean() == pytest.approx(
        np.mean(proba.argmax(1) == y), abs=0.05
    )


@pytest.mark.parametrize("n_objects", [12, 40])
def test_the_expected_excess_is_that_of_new_objects(n_objects):
    """Also of few objects and many members, whose weights were chosen by it."""
    rng, found = np.random.default_rng(0), []
    names = [f"m{i}" for i in range(6)]
    members = [(m, DistributionalOrdinalRegressor(), [i]) for i, m in enumerate(names)]

    def touched(n_objects):
        felt = rng.normal(size=n_objects)
        place = 1.5 * felt + 0.75 * rng.normal(size=n_objects)
        below = expit(1.7 * (np.array([-2.2, -0.7, 0.7, 2.2]) - place[:, None]))
        proba = np.diff(below, axis=1, prepend=0, append=1)
        objects = np.repeat(range(n_objects), 2)
        X = felt[objects, None] + 1.5 * rng.normal(size=(len(objects), 6))
        return X, rng.multinomial(12, proba)[objects], objects

    for _ in range(24):
        X, counts, objects = touched(n_objects)
        pool = TouchPool(members).fit(X, counts, groups=objects)
        X, counts, objects = touched(200)
        off = pool.predict_cdf(X, groups=objects) - np.cumsum(counts, axis=1) / 12
        excess = pool.expected_excess([names] * 2)
        found.append([excess, (off**2).sum(axis=1).mean()])
    expected, measured = np.mean(found, axis=0)
    assert expected == pytest.approx(measured, rel=0.2)


def test_a_fold_may_lack_a_class():
    X, _, objects = made()
    labels = np.where(objects == 3, 9, objects % 2)
    members = [(n, LogisticRegression(), columns) for n, _, columns in MEMBERS]
    pool = TouchPool(members).fit(X, labels, groups=objects)
    assert (pool.oof_proba_[objects == 3][..., 2] == 0).all()


def test_parameters_of_members():
    pool = TouchPool(MEMBERS).set_params(a__alpha=7.0, b=NNPOM(0, alpha=2.0))
    assert pool.get_params()["a__alpha"] == 7
    assert [(n, m.alpha, c) for n, m, c in pool.estimators] == [
        ("a", 7, ["a0", "a1"]),
        ("b", 2, ["b"]),
    ]
    pool.set_params(estimators=[("c", NNPOM(0), ["b"])], c__alpha=5.0)
    assert [(n, m.alpha, c) for n, m, c in pool.estimators] == [("c", 5, ["b"])]


def test_columns_by_position_are_as_many_as_in_fit():
    X, counts, objects = made()
    members = [("a", NNPOM(0), [0, 1]), ("b", NNPOM(0), [2])]
    pool = TouchPool(members).fit(X.to_numpy(), counts, groups=objects)
    stamped = np.c_[np.arange(len(X)), X]
    for other in (stamped, stamped[:, :2], stamped.tolist()):
        with pytest.raises(ValueError, match=r"^X has \d columns, but had 3 in fit"):
            pool.predict_proba(other)
    with pytest.raises(ValueError, match=r"^X has shape \(90,\); give a table"):
        pool.predict_proba(stamped[:, 0])


# Recordings --------------------------------------------------------------------


def test_recordings_of_which_some_are_missing():
    corpus = make_haptic_corpus(
        8, 2, ["squeeze", "fast_slide"], sensors=["pdc", "tdc"], random_state=0
    )
    both = list(corpus.trials.columns)
    members = [
        (name, make_haptic_pipeline(columns, random_state=0), columns)
        for name, columns in {
            "squeeze": both[:2],
            "fast_slide": both[2:],
            "all": both,
        }.items()
    ]
    y = corpus.ratings["hard"]
    trials = corpus.trials.copy()
    trials.loc[trials.index[:5], "squeeze_tdc"] = None
    trials.at[trials.index[0], "squeeze_tdc"] = np.empty((0, 1))  # says as much
    trials.at[trials.index[1], "squeeze_tdc"] = np.full((9, 1), np.nan)  # and that too
    pool = TouchPool(members, cv=2).fit(trials, y, groups=corpus.objects)
    assert np.isnan(pool.oof_proba_[:5, [0, 2]]).all()
    proba = pool.predict_proba(trials)
    alone = pool.estimators_["fast_slide"].predict_proba(trials[both[2:]][:5])
    weight = pool.weights([["fast_slide"]])
    pooled = weight["fast_slide"] * alone + weight["marginal"] * pool.shares_
    breadth = pool.breadth([["fast_slide"]])
    pooled = np.array([broad_by_hand(each, **breadth) for each in pooled])
    assert_allclose(proba[:5], pooled, atol=1e-12)


def test_classes_in_the_order_of_their_categories():
    """Members of scikit-learn sort words by the alphabet, categories need not."""
    rng = np.random.default_rng(0)
    kind = rng.integers(0, 3, 60)
    words = np.array(["low", "mid", "high"])
    X = pd.DataFrame({"a": kind + 0.1 * rng.normal(size=60)})
    y = pd.Series(pd.Categorical(words[kind], categories=words, ordered=True))
    member = LogisticRegression(C=100)
    pool = TouchPool([("a", member, ["a"])]).fit(X, y)
    assert pool.classes_.tolist() == words.tolist()
    assert (pool.predict(X) == words[kind]).mean() > 0.95
    proba = cross_val_predict_proba(member, X, y)
    assert (proba.argmax(axis=1) == kind).mean() > 0.95


def one_rating_each(n_objects=30):
    """Touches in a column of features, of which each has a rating of its own."""
    X, _, objects = made(n_objects)
    rng = np.random.default_rng(0)
    y = 1 + np.clip(objects % 3 + rng.integers(-1, 2, len(X)), 0, 2)
    return X, y, objects


@pytest.mark.parametrize(
    "around",
    [
        lambda model: NoveltyGuard(make_pipeline(StandardScaler(), model), cv=3),
        lambda model: GridSearchCV(model, {}, cv=GroupKFold(3)),
        lambda model: TouchPool([("a", model, ["a0", "a1"])], cv=3),
    ],
    ids=["guard", "search", "pool"],
)
def test_models_around_models_know_the_order_of_their_levels(around):
    X, y, objects = one_rating_each()
    member = around(DistributionalOrdinalRegressor())
    with config_context(enable_metadata_routing=True):
        pool = TouchPool([("a", member, ["a0", "a1"])], cv=3).fit(X, y, groups=objects)
    assert pool.predict_cdf(X).shape == (len(X), 3)
    assert pool.score(X, y) == neg_rps_scorer(pool, X, y)


@pytest.mark.parametrize("around", [NoveltyGuard, TouchPool])
def test_levels_are_in_the_order_that_a_member_has_set(around):
    """As with the same levels numbered, whatever the alphabet says of words."""
    X, number, objects = one_rating_each()
    X, words = X[["a0", "a1"]], ["soft", "medium", "hard", "very hard"]

    def fitted(y, levels):
        model = DistributionalOrdinalRegressor(levels=levels)
        model = make_pipeline(StandardScaler(), model)
        member = model if around is NoveltyGuard else [("a", model, ["a0", "a1"])]
        return around(member, cv=3).fit(X, y, groups=objects)

    named = fitted(np.array(words)[number - 1], words)
    assert named.classes_.tolist() == words
    expected = fitted(number, [1, 2, 3, 4]).predict_cdf(X)
    assert_allclose(named.predict_cdf(X), expected, atol=1e-9)


class Pyramid(FunctionTransformer):
    """A transformer whose levels are no ratings."""

    def __init__(self, levels=(1, 2, 4)):
        super().__init__()
        self.levels = levels


@pytest.mark.parametrize("around", [NoveltyGuard, TouchPool])
def test_levels_of_transformers_are_no_ratings(around):
    X, counts, objects = made(20)
    X = X[["a0", "a1"]]
    model = make_pipeline(Pyramid(), DistributionalOrdinalRegressor())
    member = model if around is NoveltyGuard else [("a", model, ["a0", "a1"])]
    model = around(member, cv=3).fit(X, counts, groups=objects)
    assert model.classes_.tolist() == [1, 2, 3, 4]


def test_members_that_order_words_in_two_ways_are_refused():
    X, y, objects = one_rating_each()
    words = ["soft", "medium", "hard"]
    members = [
        (name, DistributionalOrdinalRegressor(levels=levels), ["a0", "a1"])
        for name, levels in (("a", words), ("b", words[::-1]))
    ]
    with pytest.raises(
        ValueError, match=r"The member 'b' has the levels .*same levels"
    ):
        TouchPool(members, cv=3).fit(X, np.array(words)[y - 1], groups=objects)


def test_the_order_of_touches_without_groups_is_as_good_as_any():
    """Also materials touched in turn, of which every fifth is the same."""
    kind = np.arange(100) % 5
    X = 4 * np.eye(5)[kind] + np.random.default_rng(0).normal(size=(100, 5))
    member = [("a", LogisticRegression(), slice(0, 5))]
    for order in (np.arange(100), np.argsort(kind, kind="stable")):
        pool = TouchPool(member).fit(X[order], kind[order].astype(str))
        known = pool.oof_proba_[:, 0].argmax(axis=1) == kind[order]
        assert known.mean() > 0.95 and pool.predict_proba(X).max(axis=1).mean() > 0.9


def test_groups_that_are_the_classes_are_refused():
    X, _, objects = made(6)
    pool = TouchPool([("a", LogisticRegression(), ["a0", "a1"])])
    with pytest.raises(ValueError, match="Most touches held out are of classes that"):
        pool.fit(X, objects.astype(str), groups=objects)
