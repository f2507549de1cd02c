"""Means of distributions, against plain loops and a search of the whole simplex."""

import warnings

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import minimize
from sklearn import config_context
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    DummyDistribution,
    RegressedDistribution,
)
from sklearn_haptic.ensembles._blend_weights import blend_exponent, blend_weights
from sklearn_haptic.ensembles._out_of_fold import infer_objects
from sklearn_haptic.metrics import neg_rps_scorer, ranked_probability_score
from sklearn_haptic.model_selection import cross_val_predict_proba
from sklearn_haptic.utils._folds import ObjectKFold

N_OBJECTS, N_TRIALS = 12, 3
OBJECTS = np.repeat(np.arange(N_OBJECTS), N_TRIALS)


def made(seed=0, n_objects=N_OBJECTS, signal=1.0):
    """Features and counts of objects touched three times each."""
    rng = np.random.default_rng(seed)
    objects = np.repeat(np.arange(n_objects), N_TRIALS)
    latent = rng.normal(size=n_objects)
    X = signal * latent[objects, None] + rng.normal(size=(len(objects), 4)) / 2
    people = np.clip(np.rint(2.5 + latent[:, None] + rng.normal(size=(1, 9))), 1, 4)
    counts = np.stack([(people == k).sum(axis=1) for k in range(1, 5)], axis=1)
    return X, counts[objects].astype(float), objects


def members(**ridge):
    return [
        ("linear", NNPOM(0, alpha=1.0)),
        ("ridge", RegressedDistribution(Ridge(**ridge))),
    ]


def fitted(X, counts, objects, **params):
    return DistributionBlend(members(), **params).fit(X, counts, groups=objects)


# Weights --------------------------------------------------------------------


@pytest.mark.parametrize("n_members", [1, 2, 5, 20])
@pytest.mark.parametrize("unit", [1e-9, 1.0])
def test_weights_without_a_prior_meet_the_conditions_of_a_minimum(n_members, unit):
    rng = np.random.default_rng(n_members)
    departure = rng.uniform(-unit, unit, size=(30, n_members, 4))
    weight = rng.uniform(size=30)
    share = blend_weights(departure, weight, n_prior=0)
    gram = np.einsum("t,tik,tjk->ij", weight, departure, departure) / weight.sum()
    slope, least = gram @ share, share @ gram @ share
    assert_allclose(slope[share > 0], least, rtol=1e-8)
    assert np.all(slope >= least * (1 - 1e-8))


def test_weights_of_a_perfect_member_and_of_none():
    departure = np.random.default_rng(0).normal(size=(9, 3, 2))
    departure[:, 1] = 0
    assert_array_equal(blend_weights(departure, np.ones(9), n_prior=0), [0, 1, 0])
    assert_allclose(blend_weights(0 * departure, np.ones(9)).sum(), 1)


def weights_by_descent(departure, weight, n_prior=2.0):
    """Objects, and two of which all but the last member are equally wrong."""
    n_members = departure.shape[1]
    moments = sum(w * trial @ trial.T for w, trial in zip(weight, departure))
    each = n_prior * np.trace(moments) / n_members / sum(weight)
    moments += each * np.diag([1.0] * (n_members - 1) + [0.0])
    return minimize(
        lambda share: share @ moments @ share,
        np.full(n_members, 1 / n_members),
        method="SLSQP",
        bounds=[(0, 1)] * n_members,
        constraints={"type": "eq", "fun": lambda share: share.sum() - 1},
        options={"ftol": 1e-14, "maxiter": 500},
    ).x


def exponent_by_search(proba, below, weight, n_prior=0.5):
    """The best of a fine grid, by plain loops."""

    def squares(exponent):
        total = 0.0
        for p, true, w in zip(proba, below, weight):
            powers = [x**exponent for x in p]
            ends = [sum(powers[: k + 1]) / sum(powers) for k in range(len(true))]
            total += w * sum((a - b) ** 2 for a, b in zip(ends, true))
        return total

    each = n_prior * squares(1) / sum(weight)
    grid = np.exp(np.linspace(-np.log(4), np.log(4), 401))
    return min(grid, key=lambda e: squares(e) + each * np.log(e) ** 2)


@pytest.mark.parametrize("seed", range(6))
def test_weights_are_those_of_a_search_of_the_simplex(seed):
    rng = np.random.default_rng(seed)
    bias = rng.normal(scale=0.5, size=(1, 3, 1))
    departure, weight = rng.normal(bias, size=(9, 3, 2)), rng.uniform(size=9)
    share = blend_weights(departure, weight)
    assert_allclose(share, weights_by_descent(departure, weight), atol=1e-5)


def test_weights_move_from_the_marginal_to_the_best_as_objects_grow_in_number():
    departure = np.array([[[1.0, 0.2], [0.3, -0.1], [0.5, 0.7]]])
    shares = [blend_weights(departure, np.array([n])) for n in (1e-6, 1, 4, 40, 4000)]
    assert_allclose(shares[0], [0, 0, 1], atol=1e-5)
    assert_allclose(shares[-1], [0, 1, 0], atol=0.05)
    assert np.all(np.diff(shares, axis=0)[:, 1] > 0)


@pytest.mark.parametrize("seed", range(6))
def test_the_exponent_is_that_of_a_fine_grid(seed):
    rng = np.random.default_rng(seed)
    proba, weight = rng.dirichlet(np.full(4, 2.0), size=15), rng.uniform(size=15)
    true = proba ** [0.1, 0.4, 1, 1.5, 2.5, 8][seed] * rng.uniform(0.5, 2, proba.shape)
    below = np.cumsum(true / true.sum(axis=1, keepdims=True), axis=1)[:, :-1]
    found = blend_exponent(proba, below, weight)
    assert found == pytest.approx(exponent_by_search(proba, below, weight), rel=0.01)
    if seed not in (2, 3):
        assert (found < 1, found > 1) == (seed < 2, seed > 3)


# The blend ------------------------------------------------------------------


def test_a_blend_is_that_of_plain_loops():
    X, counts, objects = made()
    blend = fitted(X, counts, objects, cv=3)
    named = [*members(), ("marginal", DummyDistribution())]
    below = np.cumsum(counts / counts.sum(axis=1, keepdims=True), axis=1)[:, :-1]
    departure, third = np.empty((len(X), 3, 3)), np.full(len(X), 1 / 3)

    def fit(member, rows):
        return clone(member).fit(X[rows], counts[rows], sample_weight=third[rows])

    for train, test in ObjectKFold(3).split(X, groups=objects):
        for m, (_, member) in enumerate(named):
            proba = fit(member, train).predict_proba(X[test])
            departure[test, m] = np.cumsum(proba, axis=1)[:, :-1] - below[test]
    share = weights_by_descent(departure, third)
    assert_allclose([*blend.weights_.values()], share, atol=1e-4)
    for m, (name, _) in enumerate(named):
        rps = (departure[:, m] ** 2 + below * (1 - below)).sum(axis=1).mean()
        assert blend.rps_[name] == pytest.approx(rps, rel=1e-4)
    mean = np.einsum("tmk,m->tk", departure, [*blend.weights_.values()]) + below
    held_out = np.diff(mean, axis=1, prepend=0, append=1)
    exponent = exponent_by_search(held_out, below, third)
    assert blend.exponent_ == pytest.approx(exponent, rel=0.01)
    new = np.random.default_rng(1).normal(size=(5, 4))
    expected = sum(
        blend.weights_[name] * fit(member, slice(None)).predict_proba(new)
        for name, member in named
    )
    expected = expected**blend.exponent_
    expected /= expected.sum(axis=1, keepdims=True)
    assert_allclose(blend.predict_proba(new), expected, atol=1e-12)
    assert_array_equal(blend.predict(new), expected.argmax(axis=1) + 1)


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        ("decode", "mixed"),
        ("sampling", "Level"),
        ("n_duplicates", 2.5),
        ("estimator__alpha", -1.0),
        ("estimator__max_iter", 0),
    ],
)
def test_parameters_of_linear_members_are_checked(parameter, value):
    """Also where several are fitted at once."""
    X, counts, *_ = made()
    member = DistributionalOrdinalRegressor(NNPOM(n_hidden=0))
    blend = DistributionBlend([("one", member), ("two", clone(member))])
    blend.set_params(**{f"two__{parameter}": value})
    name = parameter.split("__")[-1]
    with pytest.raises(ValueError, match=f"The '{name}' parameter of"):
        blend.fit(X, counts, groups=OBJECTS)


def test_linear_models_fitted_at_once_are_those_fitted_alone():
    X, counts, objects = made()
    pair = [(f"alpha{a}", DistributionalOrdinalRegressor(NNPOM(0, a))) for a in (1, 9)]

    class Alone(DistributionalOrdinalRegressor):
        pass

    alone = [(name, Alone(model.estimator)) for name, model in pair]
    one, each = (
        DistributionBlend(of).fit(X, counts, groups=objects) for of in (pair, alone)
    )
    assert_allclose([*one.weights_.values()], [*each.weights_.values()], atol=1e-5)
    assert_allclose(one.predict_proba(X), each.predict_proba(X), atol=1e-5)


def test_copies_of_touches_change_nothing():
    X, counts, objects = made()
    rows = np.repeat(np.arange(len(X)), 4)
    strict = [("linear", NNPOM(0, tol=1e-10)), members()[1]]
    strict.append(("piped", make_pipeline("passthrough", NNPOM(0, tol=1e-10))))
    one, many = (
        DistributionBlend(strict, cv=3).fit(X[i], counts[i], groups=objects[i])
        for i in (slice(None), rows)
    )
    assert_allclose(many.predict_proba(X), one.predict_proba(X), atol=1e-6)


def test_how_many_people_rated_a_touch_changes_nothing():
    X, counts, objects = made()
    people = np.tile([1, 2, 4], N_OBJECTS)[:, None]
    one, many = (
        DistributionBlend([("linear", DistributionalOrdinalRegressor())]).fit(
            X, each, groups=objects
        )
        for each in (counts, counts * people)
    )
    assert_allclose(many.predict_proba(X), one.predict_proba(X), atol=1e-9)


def test_touches_that_people_rated_apart_tell_no_objects():
    X, _, _ = made()
    people = np.random.default_rng(0)
    counts = people.multinomial(6, np.full(5, 0.2), size=len(X))
    with pytest.warns(UserWarning, match="takes each trial for another object"):
        DistributionBlend(members()).fit(X, counts)


def test_objects_of_two_people_share_their_counts():
    """Of products touched once each, fifteen different counts tell no objects."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(120, 2))
    level = np.rint(2 + X[:, :1] + rng.normal(size=(120, 2)) / 2).clip(0, 4)
    counts = (level[..., None] == np.arange(5)).sum(axis=1)
    with pytest.warns(UserWarning, match="takes each trial for another object"):
        blend = DistributionBlend(members()).fit(X, counts)
    told = fitted(X, counts, np.arange(120))
    assert_array_equal(blend.predict_proba(X), told.predict_proba(X))


def test_counts_tell_the_objects_where_these_are_not_told():
    X, counts, objects = made()
    counts[:, 0] += objects / 100  # so that no two share their counts
    told, untold = (
        DistributionBlend(members()).fit(X, counts, groups=groups)
        for groups in (objects, None)
    )
    assert_allclose(untold.predict_proba(X), told.predict_proba(X), atol=1e-9)
    with pytest.warns(UserWarning, match="fit was given no groups"):
        untold.fit(X, counts.argmax(axis=1))


def test_frequent_counts_keep_their_share_where_the_objects_are_not_told():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(120, 3))  # tells nothing
    some = rng.multinomial(12, [0.2, 0.3, 0.3, 0.2], size=20)
    counts = np.repeat(np.vstack((some, np.tile([12, 0, 0, 0], (40, 1)))), 2, axis=0)
    blend = DistributionBlend(members()).fit(X, counts)
    mean = counts.mean(axis=0) / 12
    assert_allclose(blend.predict_proba(X).mean(axis=0), mean, atol=0.05)


def test_an_object_that_was_touched_most_often_stays_whole():
    """Unless so many people agree that other objects may have its counts."""
    some = [[a, b, 12 - a - b, 0] for a in range(1, 5) for b in range(1, 6)]
    others = np.repeat(some, 2, axis=0)
    for n in (20, 21):
        counts = np.vstack((others, np.tile([2, 5, 4, 1], (n, 1))))
        expected = np.append(np.arange(20).repeat(2), np.full(n, 20))
        assert_array_equal(infer_objects(counts), expected)
    assert infer_objects(np.vstack((others, np.tile([12, 0, 0, 0], (21, 1))))) is None


def test_counts_that_objects_share_tell_none_unless_rows_are_ordered_by_object():
    """As they are not where all objects are touched once, and then all again."""
    some = [[a, b, 12 - a - b, 0] for a in range(1, 5) for b in range(1, 5)]
    counts = np.vstack((some, np.tile([12, 0, 0, 0], (8, 1))))
    by_object = np.arange(24).repeat(3)
    assert_array_equal(infer_objects(counts[by_object]), by_object)
    assert infer_objects(np.tile(counts, (3, 1))) is None
    assert_array_equal(infer_objects(np.tile(counts[:16], (3, 1))), np.arange(48) % 16)


def test_shares_that_differ_by_rounding_are_of_one_object():
    rng = np.random.default_rng(0)
    objects = np.arange(25).repeat(4)
    shares = rng.multinomial(12, np.full(5, 0.2), size=25)[objects] / 12
    odd = np.arange(100)[:, np.newaxis] % 2 == 1
    assert_array_equal(infer_objects(shares), objects)
    for other in (np.float32(shares), 12 * shares * (1 / 12), shares * (1 + 1e-15)):
        assert_array_equal(infer_objects(np.where(odd, shares, other)), objects)
    assert_array_equal(
        infer_objects(np.where(odd & (shares == 0), -0.0, shares)), objects
    )


def test_objects_whose_shares_differ_by_rounding_weigh_alike():
    X, counts, objects = made()
    X, counts, objects = (
        X[1:],
        counts[1:] / counts[1:].sum(1, keepdims=True),
        objects[1:],
    )
    odd = np.arange(len(X))[:, np.newaxis] % 2 == 1
    mixed = np.where(odd, counts, np.float32(counts))
    assert_allclose(
        fitted(X, mixed, objects).predict_proba(X),
        fitted(X, counts, objects).predict_proba(X),
        atol=1e-5,
    )


@pytest.mark.parametrize("n_people", [2, 3, 4, 7, 12, 50, 300])
def test_shares_of_few_people_tell_no_more_than_counts(n_people):
    """Three people can give four different counts, 300 many more."""
    rng = np.random.default_rng(0)
    counts = rng.binomial(n_people, rng.uniform(size=60)).repeat(3)
    counts = np.column_stack((counts, n_people - counts))
    for each in (counts, counts / n_people, np.round(counts / n_people, 3)):
        assert (infer_objects(each) is None) == (n_people < 100)
    if n_people <= 12:
        assert infer_objects(np.round(100 * counts / n_people)) is None


def test_ratings_of_each_touch_are_observations_of_their_own():
    X, _, objects = made()
    of_touches = np.eye(4)[np.random.default_rng(0).integers(4, size=len(X))]
    blend = DistributionBlend([("linear", NNPOM(0))])
    blend.fit(X, of_touches, groups=objects)
    alone = NNPOM(0).fit(X, of_touches)
    assert_array_equal(blend.estimators_["linear"].coefs_[0], alone.coefs_[0])


def test_where_there_is_nothing_to_learn_it_is_near_the_marginal():
    X, counts, objects = made(0, n_objects=60, signal=0)
    pair = [
        ("neighbour", RegressedDistribution(KNeighborsRegressor(1))),
        ("ridge", RegressedDistribution(Ridge(1e-3))),
    ]

    def score(model, **params):
        proba = cross_val_predict_proba(model, X, counts, groups=objects, params=params)
        return ranked_probability_score(counts, proba)

    marginal = score(DummyDistribution())
    assert score(pair[0][1]) > 1.3 * marginal
    blend = DistributionBlend(pair)
    assert score(blend, groups=objects) < 1.03 * marginal
    assert blend.fit(X, counts, groups=objects).weights_["marginal"] > 0.6


def test_where_a_mean_is_too_broad_it_is_sharpened():
    """People agree on one level of four, which a linear regression blurs."""
    X = np.random.default_rng(0).uniform(size=(80, 1))
    agreed = np.eye(4)[(4 * X[:, 0]).astype(int)]
    blurred = [("ridge", RegressedDistribution(Ridge()))]
    blend = DistributionBlend(blurred).fit(X[:40], agreed[:40], groups=range(40))
    plain = blurred[0][1].fit(X[:40], agreed[:40])
    score, before = (
        ranked_probability_score(agreed[40:], each.predict_proba(X[40:]))
        for each in (blend, plain)
    )
    assert blend.exponent_ > 1.5
    assert score < 0.9 * before


def test_members_may_have_features_of_their_own():
    X, counts, objects = made()
    trials = pd.DataFrame(X, columns=["pac", "pdc", "tac", "tdc"])

    def on(columns, model):
        return make_pipeline(FunctionTransformer(lambda table: table[columns]), model)

    blend = DistributionBlend(
        [
            ("shaking", on(["pac"], RegressedDistribution(Ridge()))),
            ("heat", on(["tac", "tdc"], DistributionalOrdinalRegressor())),
        ]
    ).fit(trials, counts, groups=objects)
    parts = [blend.estimators_[name] for name in ("shaking", "heat")]
    assert [part[-1].n_features_in_ for part in parts] == [1, 2]
    assert_allclose(blend.predict_proba(trials).sum(axis=1), 1)


@pytest.mark.parametrize("levels", [[1, 2, 3, 4], ["soft", "firm", "hard", "stone"]])
def test_ratings_are_the_same_as_counts_of_one_person(levels):
    X, counts, objects = made()
    index = counts.argmax(axis=1)
    ratings = np.array(levels)[index]
    one = DistributionBlend(members(), levels=levels).fit(X, ratings, groups=objects)
    plain = fitted(X, np.eye(4)[index], objects)
    assert_array_equal(one.predict_proba(X), plain.predict_proba(X))
    assert_array_equal(one.classes_, levels)
    assert set(one.predict(X)) <= set(levels)


def test_a_weight_of_two_equals_the_trial_given_twice():
    X, counts, objects = made()
    weight = np.where(np.arange(len(X)) % N_TRIALS == 0, 2, 1)
    strict = [("linear", NNPOM(0, tol=1e-10)), members()[1]]
    folds = list(GroupKFold(3).split(X, groups=objects))
    weighted = DistributionBlend(strict, cv=folds).fit(
        X, counts, weight, groups=objects
    )
    rows = np.repeat(np.arange(len(X)), weight)
    same = [tuple(np.flatnonzero(np.isin(rows, i)) for i in fold) for fold in folds]
    twice = DistributionBlend(strict, cv=same).fit(
        X[rows], counts[rows], groups=objects[rows]
    )
    assert twice.weights_ == pytest.approx(weighted.weights_, abs=1e-6)
    assert_allclose(twice.predict_proba(X), weighted.predict_proba(X), atol=1e-6)


def test_jobs_change_no_bit():
    X, counts, objects = made()
    one, two = (fitted(X, counts, objects, n_jobs=n) for n in (1, 2))
    assert_array_equal(one.predict_proba(X), two.predict_proba(X))


def test_parameters_of_members_are_set_by_name():
    X, counts, objects = made()
    blend = DistributionBlend(members())
    blend.set_params(ridge__estimator__alpha=1e9)
    assert blend.get_params()["ridge__estimator__alpha"] == 1e9
    blend.fit(X, counts, groups=objects)
    assert blend.rps_["ridge"] == pytest.approx(blend.rps_["marginal"], abs=1e-6)


def test_objects_of_weight_zero_are_as_if_left_out():
    X, counts, objects = made()
    used = np.isin(objects, [0, 5, 7])  # of which two would be tested in one fold
    blend = fitted(X[used], counts[used], objects[used])
    weighted = DistributionBlend(members()).fit(X, counts, used, groups=objects)
    assert weighted.weights_ == pytest.approx(blend.weights_, abs=1e-6)
    assert weighted.rps_ == pytest.approx(blend.rps_, abs=1e-6)
    assert_allclose(weighted.predict_proba(X), blend.predict_proba(X), atol=1e-6)
    with pytest.raises(ValueError, match="there is 1 sample or object"):
        blend.fit(X, counts, objects == 3, groups=objects)


def test_objects_of_hardly_any_weight_are_nearly_left_out():
    X, counts, objects = made()
    wrong = objects % 4 == 0
    counts[wrong] = counts[wrong, ::-1]
    folds = list(GroupKFold(3).split(X, groups=objects))
    blend = DistributionBlend(members(), cv=folds)
    blend.fit(X, counts, np.where(wrong, 1e-7, 1), groups=objects)
    place = np.cumsum(~wrong) - 1
    kept = [tuple(place[rows[~wrong[rows]]] for rows in fold) for fold in folds]
    expected = fitted(X[~wrong], counts[~wrong], objects[~wrong], cv=kept)
    assert_allclose(blend.predict_proba(X), expected.predict_proba(X), atol=1e-5)


@pytest.mark.parametrize("told", [True, False])
def test_the_unit_of_weights_does_not_matter(told):
    X, counts, objects = made()
    groups = objects if told else None
    weight = np.random.default_rng(0).uniform(size=len(X))
    blend = DistributionBlend(members()).fit(X, counts, weight, groups=groups)
    expected = blend.predict_proba(X)
    blend.fit(X, counts, 1e3 * weight, groups=groups)
    assert_allclose(blend.predict_proba(X), expected, atol=1e-9)


def test_levels_that_a_member_sets_are_those_of_the_blend():
    X, counts, objects = made()
    labels = counts.argmax(axis=1)
    pair = [("a", NNPOM(0, levels=[1, 2, 3, 4])), ("b", NNPOM(0))]
    with pytest.raises(
        ValueError, match=r"rating 0 .* not among levels=\[1, 2, 3, 4\]"
    ):
        DistributionBlend(pair).fit(X, labels, groups=objects)
    blend = DistributionBlend(pair).fit(X, np.maximum(labels, 2), groups=objects)
    assert blend.classes_.tolist() == [1, 2, 3, 4]


def test_a_blend_in_a_blend_gets_the_weights_that_are_given():
    X, counts, objects = made()
    copies = np.repeat(np.arange(len(X)), 1 + objects // 2)
    X, counts, objects = X[copies], counts[copies], objects[copies]
    weight = np.random.default_rng(0).uniform(size=N_OBJECTS)[objects]
    inner = DistributionBlend(members()).fit(X, counts, weight, groups=objects)
    outer = DistributionBlend([("inner", clone(inner))])
    outer.fit(X, counts, weight, groups=objects)
    expected = inner.predict_proba(X)
    assert_allclose(outer.estimators_["inner"].predict_proba(X), expected, atol=1e-9)


@pytest.mark.parametrize("told", [True, False])
def test_a_touch_of_weight_zero_is_as_if_left_out(told):
    """Also one of other ratings than its object, and many that tell other objects."""
    X, counts, objects = made()
    extra = np.arange(12)
    X_more, weight = np.r_[X, X[extra]], np.r_[np.ones(len(X)), np.zeros(12)]
    y_more = np.r_[counts, counts[extra] + 1 + extra[:, None]]
    blend = DistributionBlend(members())
    blend.fit(X, counts, np.ones(len(X)), groups=objects if told else None)
    expected = blend.predict_proba(X)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        groups = np.r_[objects, objects[extra]] if told else None
        blend.fit(X_more, y_more, weight, groups=groups)
    assert_allclose(blend.predict_proba(X), expected, atol=1e-6)


# Objects --------------------------------------------------------------------


class WithObjects(TransformerMixin, BaseEstimator):
    """A step that is told the objects."""

    __metadata_request__fit = {"groups": True}  # noqa: RUF012

    def fit(self, X, y=None, groups=None):
        assert groups is not None
        return self

    def transform(self, X):
        return X


def test_touches_of_an_object_weigh_one_in_pipelines_and_blends():
    X, counts, objects = made()
    copies = np.repeat(np.arange(len(X)), 1 + objects // 2)
    X, counts, objects = X[copies], counts[copies], objects[copies]
    weight = 1 / np.bincount(objects)[objects]
    scaled = StandardScaler(), NNPOM(0)
    alone = make_pipeline(*scaled).fit(X, counts, nnpom__sample_weight=weight)
    inner = DistributionBlend([("piped", make_pipeline(*scaled)), *members()])
    pair = [("piped", make_pipeline(*scaled)), ("blend", make_pipeline(inner))]
    blend = DistributionBlend(pair)
    expected = clone(blend).fit(X, counts, groups=objects)
    with config_context(enable_metadata_routing=True):
        routed = clone(blend).fit(X, counts, groups=objects)
        told = make_pipeline(WithObjects(), *scaled)
        told = DistributionBlend([("told", told)]).fit(X, counts, groups=objects)
    own = clone(inner).fit(X, counts, groups=objects).predict_proba(X)
    for each in expected, routed:
        assert_allclose(each.estimators_["blend"].predict_proba(X), own, atol=1e-9)
        learned = each.estimators_["piped"][-1].coefs_[0]
        assert_allclose(learned, alone[-1].coefs_[0], atol=1e-9)
    assert routed.weights_ == pytest.approx(expected.weights_, abs=1e-9)
    assert_allclose(routed.predict_proba(X), expected.predict_proba(X), atol=1e-9)
    learned = told.estimators_["told"][-1].coefs_[0]
    assert_allclose(learned, alone[-1].coefs_[0], atol=1e-9)


def test_groups_reach_it_and_the_searches_in_it_by_metadata_routing():
    X, counts, objects = made()

    class Recorded(GroupKFold):
        seen = []  # noqa: RUF012

        def split(self, X, y=None, groups=None):
            self.seen.append(groups)
            return super().split(X, y, groups)

    with config_context(enable_metadata_routing=True), warnings.catch_warnings():
        warnings.simplefilter("error")
        search = GridSearchCV(
            RegressedDistribution(Ridge()),
            {"estimator__alpha": [0.1, 10.0]},
            scoring=neg_rps_scorer,
            cv=Recorded(2),
        )
        pair = [("linear", DistributionalOrdinalRegressor()), ("ridge", search)]
        model = make_pipeline(StandardScaler(), DistributionBlend(pair, cv=3))
        model.fit(X, counts, groups=objects)
        assert len(Recorded.seen) >= 3  # once per fold
        for groups, (train, _) in zip(
            Recorded.seen, ObjectKFold(3).split(X, groups=objects)
        ):
            assert_array_equal(groups, objects[train])
        predicted = cross_val_predict_proba(model, X, counts, groups=objects, cv=2)
    assert predicted.shape == counts.shape


def test_sample_weight_goes_to_members_that_request_it():
    X, counts, objects = made()
    weight = np.random.default_rng(0).uniform(0.5, 2, size=len(X))
    neighbours = RegressedDistribution(KNeighborsRegressor(2))
    linear = NNPOM(0)
    with config_context(enable_metadata_routing=True):
        linear.set_fit_request(sample_weight=True)
        pair = [
            ("linear", linear),
            ("piped", make_pipeline(FunctionTransformer(), linear)),
            ("near", neighbours.set_fit_request(sample_weight=False)),
        ]
        blend = DistributionBlend(pair)
        blend.fit(X, counts, sample_weight=weight, groups=objects)
    means = [weight[objects == each].mean() for each in objects]
    alone = NNPOM(0).fit(X, counts, weight / max(means) / N_TRIALS)
    for learned in blend.estimators_["linear"], blend.estimators_["piped"][-1]:
        assert_allclose(learned.coefs_[0], alone.coefs_[0], atol=1e-9)
    in_pipeline = [("near", make_pipeline(StandardScaler(), neighbours))]
    with pytest.raises(ValueError, match="The member 'near' takes no sample_weight"):
        DistributionBlend(in_pipeline).fit(X, counts, weight, groups=objects)


@pytest.mark.parametrize(
    "n_objects, n_folds", [(3, 3), (20, 10), (50, 10), (60, 8), (84, 5), (1000, 5)]
)
def test_few_objects_are_left_out_of_few(n_objects, n_folds):
    n_learned = []

    class Counted(DummyDistribution):
        def fit(self, X, y, sample_weight=None):
            n_learned.append(len(X))
            return super().fit(X, y, sample_weight)

    objects = np.repeat(range(n_objects), 2)
    counts = np.column_stack([objects % 5 + 1, objects + 1])
    DistributionBlend([("a", Counted())]).fit(objects[:, None], counts, groups=objects)
    assert sum(n < len(objects) for n in n_learned) == n_folds
    left_out = [(len(objects) - n) / 2 for n in n_learned if n < len(objects)]
    assert sum(left_out) == n_objects  # each object once
