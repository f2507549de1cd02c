"""Sets, intervals and bands against loops, closed forms and worlds that are known."""

import pickle
from itertools import product
from math import ceil

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import expit
from sklearn.base import BaseEstimator, ClassifierMixin, clone, is_classifier
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LinearRegression, LogisticRegression, Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold, LeaveOneGroupOut
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from sklearn_haptic import (
    NNPOM,
    ConformalRatings,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    RegressedDistribution,
    make_haptic_pipeline,
)
from sklearn_haptic.model_selection import cross_val_predict_proba

ALPHAS = (0.05, 0.1, 0.2, 0.5, 0.9)


class LeastSquares(ClassifierMixin, BaseEstimator):
    """Mean levels by least squares without a penalty, and one spread for all."""

    def fit(self, X, y):
        self.classes_ = np.arange(1, y.shape[1] + 1)
        mean = y @ np.arange(y.shape[1]) / y.sum(axis=1)
        self.coef_ = np.linalg.lstsq(np.column_stack((X, np.ones(len(X)))), mean)[0]
        return self

    def predict_proba(self, X):
        mean = np.column_stack((X, np.ones(len(X)))) @ self.coef_
        below = expit(np.arange(len(self.classes_) - 1) + 0.5 - mean[:, np.newaxis])
        return np.diff(below, prepend=0, append=1)

    def predict(self, X):
        return self.classes_[self.predict_proba(X).argmax(axis=1)]


class Given(ClassifierMixin, BaseEstimator):
    """Predicts the distributions that it is given in place of features."""

    def fit(self, X, y):
        self.classes_ = np.arange(1, X.shape[1] + 1)
        return self

    def predict_proba(self, X):
        return X


def given(n_levels=5):
    return Given().fit(np.empty((0, n_levels)), None)


def prefit(X, y, groups, model=None):
    model = given(X.shape[1]) if model is None else model
    return ConformalRatings(model, method="prefit").fit(X, y, groups=groups)


def world(seed, n_objects, n_touches=1, n_raters=1, n_features=3, n_levels=5):
    """Objects, their touches, what their population and a crowd from it answer."""
    rng = np.random.default_rng(seed)
    Z = rng.normal(size=(n_objects, n_features))
    spread = np.exp(rng.normal(-0.5, 0.7, size=(n_objects, 1)))
    edges = np.linspace(-1.5, 1.5, n_levels - 1)
    below = 1 / (1 + np.exp(-(edges - 1.5 * Z[:, :1]) / spread))
    P = np.diff(np.pad(below, ((0, 0), (1, 1)), constant_values=(0, 1)), axis=1)
    objects = np.repeat(np.arange(n_objects), n_touches)
    X = Z[objects] + 0.5 * rng.normal(size=(len(objects), n_features))
    n_raters = np.broadcast_to(n_raters, n_objects)
    counts = np.array([rng.multinomial(n, p) for n, p in zip(n_raters, P)])
    return X, counts[objects], objects, P


def distance(proba, level):
    """The score of a level, by its definition."""
    used = np.flatnonzero(proba > 1e-9)
    beyond = max(used[0] - level, level - used[-1], 1) - 1
    return beyond + 2 * max(
        proba[:level].sum() - 0.5, 0.5 - proba[: level + 1].sum(), 0
    )


def uneven(seed=0, n_objects=25):
    """Unequal numbers of touches and raters."""
    rng = np.random.default_rng(seed)
    n_raters = rng.integers(1, 9, n_objects)
    X, counts, objects, _ = world(seed, n_objects, 4, n_raters)
    used = rng.permutation(len(X))[: 3 * n_objects]
    return X[used], counts[used], objects[used]


def coverage(model, X, P, alpha=0.2):
    """Share of people who rate within the sets, over objects."""
    return (model.predict_set(X, alpha) * P).sum(axis=1).mean()


def mean_coverage(fit, n_worlds, alpha=0.2, **options):
    """Mean coverage of new objects over worlds, and its standard error."""
    every = []
    for seed in range(n_worlds):
        n = options["n_objects"]
        X, y, objects, P = world(seed, **(options | {"n_objects": n + 40}))
        old = objects < n
        model = fit(X[old], y[old], objects[old])
        every.append(coverage(model, X[~old], P[objects[~old]], alpha))
    return np.mean(every), np.std(every) / np.sqrt(n_worlds)


# By hand -----------------------------------------------------------------------------


@pytest.mark.parametrize("n", [4, 9, 10, 19, 40])
@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.filterwarnings("ignore:alpha=")
def test_one_touch_and_one_rater_give_a_quantile_of_the_scores(n, alpha):
    _, counts, objects, P = world(n, n)
    X = np.random.default_rng(1).dirichlet(np.ones(5), n)
    score = sorted(distance(x, y.argmax()) for x, y in zip(X, counts))
    rank = ceil(round((1 - alpha) * (n + 1), 9))
    q = score[rank - 1] if rank <= n else np.inf
    expected = [[distance(p, level) <= q + 1e-9 for level in range(5)] for p in P]
    assert_array_equal(prefit(X, counts, objects).predict_set(P, alpha), expected)


@pytest.mark.parametrize("splitter", [GroupKFold(3), LeaveOneGroupOut()])
def test_p_values_are_those_of_a_double_loop(splitter):
    X, counts, objects = uneven()
    folds = list(splitter.split(X, groups=objects))
    base = RegressedDistribution(LinearRegression())
    model = ConformalRatings(base, cv=folds).fit(X, counts, groups=objects)
    new = world(7, 6)[0]
    weight = np.ones((6, 5))
    for fold, (train, test) in zip(model.estimators_, folds):
        proba, predicted = fold.predict_proba(X), fold.predict_proba(new)
        alone = clone(base).fit(X[train], counts[train])
        assert_allclose(predicted, alone.predict_proba(new))
        for (i, level), t, y in product(np.ndindex(6, 5), test, range(5)):
            share = counts[t, y] / counts[t].sum() / (objects == objects[t]).sum()
            as_far = distance(proba[t], y) >= distance(predicted[i], level) - 1e-9
            weight[i, level] += share * as_far
    assert_allclose(model.p_values(new), weight / 26)
    assert model.n_objects_ == 25 and model.alpha_min_ == 1 / 26


def test_a_band_of_one_model_is_a_quantile_of_the_largest_departures():
    X, counts, objects = uneven()
    X = np.random.default_rng(1).dirichlet(np.ones(5), len(X))
    model, new = prefit(X, counts, objects), world(3, 8)[3]
    true, below = (np.cumsum(each, axis=1)[:, :4] for each in (counts, X))
    true = true / counts.sum(axis=1, keepdims=True)
    scale = np.sqrt(below * (1 - below) + 0.02)
    departure = (np.abs(true - below) / scale).max(axis=1)
    weight = 1 / np.bincount(objects)[objects]
    for alpha in ALPHAS:
        q = min(
            d for d in departure if weight[departure <= d].sum() >= (1 - alpha) * 26
        )
        middle = np.cumsum(new, axis=1)[:, :4]
        room = q * np.sqrt(middle * (1 - middle) + 0.02)
        lower = np.maximum.accumulate(np.maximum(middle - room, 0), axis=1)
        upper = np.minimum(middle + room, 1)[:, ::-1]
        upper = np.minimum.accumulate(upper, axis=1)[:, ::-1]
        band = model.predict_band(new, alpha)
        for found, expected in zip(band, (lower, upper)):
            assert_allclose(
                found, np.pad(expected, ((0, 0), (0, 1)), constant_values=1)
            )


# What must hold -----------------------------------------------------------------------


@pytest.fixture(scope="module", params=["cv+", "prefit"])
def fitted(request):
    X, counts, objects = uneven()
    base = DistributionalOrdinalRegressor()
    if request.param == "prefit":
        base.fit(*world(9, 20)[:2])
    return ConformalRatings(base, method=request.param).fit(X, counts, groups=objects)


def test_sets_and_bands_are_nested_and_hold_the_median(fitted):
    X = np.concatenate((uneven()[0], 3 * world(5, 30)[0]))
    median = fitted.predict_quantile(X, 0.5)[:, np.newaxis] == fitted.classes_
    below, p = fitted.predict_cdf(X), fitted.p_values(X)
    larger, wider = np.ones((len(X), 5), bool), (np.zeros((len(X), 5)), 1)
    for alpha in ALPHAS:
        chosen, (lower, upper) = (
            fitted.predict_set(X, alpha),
            fitted.predict_band(X, alpha),
        )
        assert (chosen[median]).all() and (chosen >= (p > alpha)).all()
        assert (
            np.abs(np.diff(chosen, axis=1, prepend=0, append=0)).sum(axis=1) == 2
        ).all()
        assert (chosen <= larger).all()
        assert (lower >= wider[0]).all() and (upper <= wider[1]).all()
        assert (lower <= below + 1e-12).all() and (below <= upper + 1e-12).all()
        assert (np.diff(lower) >= 0).all() and (np.diff(upper) >= 0).all()
        assert (lower[:, -1] == 1).all() and (upper[:, -1] == 1).all()
        larger, wider = chosen, (lower, upper)
        first, last = fitted.predict_interval(X, alpha)
        within = (first[:, np.newaxis] <= fitted.classes_) & (
            fitted.classes_ <= last[:, np.newaxis]
        )
        assert_array_equal(within, chosen)
    assert not larger.all()


def everything(model, X):
    """All that is promised, in one array."""
    parts = [model.p_values(X), *model.predict_band(X, 0.2), model.predict_proba(X)]
    return np.hstack([*parts, model.predict_set(X, 0.2)])


def test_copies_of_touches_and_of_counts_change_nothing():
    X, counts, objects = uneven()
    new, X = world(3, 8)[3], np.random.default_rng(1).dirichlet(np.ones(5), len(X))
    before = everything(prefit(X, counts, objects), new)
    rows = np.concatenate((np.arange(len(X)), np.flatnonzero(objects % 3 == 0)))
    times = np.array([1, 7, 0.25])[objects % 3, np.newaxis]
    again = prefit(X[rows], (counts * times)[rows], objects[rows])
    assert_allclose(everything(again, new), before)


@pytest.mark.parametrize("cv", [LeaveOneGroupOut(), None])
def test_order_and_names_of_objects_do_not_matter(cv):
    X, counts, objects = uneven()
    rng = np.random.default_rng(2)
    names = rng.permutation([f"object {i}" for i in range(25)])[objects]
    order = rng.permutation(len(X))
    if cv is None:  # folds depend on the order of the objects' first trials
        order = np.argsort(pd.factorize(objects)[0])
    model = ConformalRatings(RegressedDistribution(LinearRegression()), cv=cv)
    new = world(3, 8)[0]
    before = everything(model.fit(X, counts, groups=objects), new)
    model.fit(X[order], counts[order], groups=names[order])
    assert_allclose(everything(model, new), before, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("alpha", "n"), [(0.2, 4), (0.1, 9), (0.05, 19), (0.9, 1)])
def test_with_fewer_objects_nothing_is_left_out(alpha, n):
    X, counts, objects, P = world(0, max(n, 2), 2, 4)
    P = np.vstack((P, np.eye(5)))
    enough = objects < n
    crowd = np.zeros_like(counts)
    crowd[:, 2] = 1
    X = np.tile(np.eye(5)[2], (len(X), 1))
    model = prefit(X[enough], crowd[enough], objects[enough])
    for same in (alpha, 1 - (1 - alpha)):
        assert not model.predict_set(P, same).all()
    few = objects < n - 1
    if few.any():
        model = prefit(X[few], crowd[few], objects[few])
        message = f"alpha={alpha} needs {n} objects or more, but there are {n - 1}, so"
        with pytest.warns(UserWarning, match=message) as caught:
            assert model.predict_set(P, alpha).all()
            first, last = model.predict_interval(P, alpha)
            lower, upper = model.predict_band(P, alpha)
        assert [each.filename for each in caught] == [__file__] * 3
        assert (first == 1).all() and (last == 5).all()
        assert (lower[:, :4] == 0).all() and (upper == 1).all()


def test_an_end_of_a_slider_beyond_the_grid_of_a_model_is_in_the_interval():
    """Nobody left the slider there in its training, and one in four does now."""
    x = np.linspace(0, 1, 12)[:, None]
    model = ContinuousRatingsRegressor().fit(x, np.linspace(20, 90, 12))
    new = np.linspace(0, 1, 40)[:, None]
    for end, other in ((100.0, 55.0), (3.3, 55.0)):
        answers = np.where(np.arange(40) % 4 == 0, end, other)
        judge = prefit(new, answers, np.arange(40), model)
        lower, upper = judge.predict_interval(new, 0.1)
        assert ((lower <= answers) & (answers <= upper)).all()
        assert judge.p_values(new, [end]).min() > 0.1


def test_a_refit_to_another_kind_of_ratings_leaves_nothing_behind():
    X, counts, objects, _ = world(1, 20, 2)
    model = ConformalRatings(NNPOM(0)).fit(X, counts, groups=objects)
    assert hasattr(model, "levels_") and not hasattr(model, "grid_")
    model.set_params(estimator=ContinuousRatingsRegressor(NNPOM(0)))
    model.fit(X, counts[:, 0] + 10 * X[:, 0], groups=objects)
    assert hasattr(model, "grid_") and not hasattr(model, "levels_")


def test_a_level_that_nobody_gave_is_in_sets_if_it_is_named():
    """With plain numbers the promise would be about the levels that occur."""
    covered = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        x = rng.normal(size=100)
        y = np.clip(np.round(5.5 + 2 * x + rng.normal(size=100)), 1, 10).astype(int)
        named = pd.Series(pd.Categorical(y, categories=range(1, 11), ordered=True))
        model = ConformalRatings(NNPOM(0))
        model.fit(x[:10, None], named[:10], groups=range(10))
        chosen = model.predict_set(x[10:, None], 0.1)
        covered.append(chosen[np.arange(90), y[10:] - 1].mean())
    assert np.mean(covered) > 0.88
    with pytest.warns(UserWarning, match="no set holds a level that nobody gave"):
        model.fit(x[:10, None], y[:10], groups=range(10))


@pytest.mark.filterwarnings("ignore:y does not name its levels")
def test_labels_counts_words_and_any_classifier():
    X, counts, objects, _ = world(1, 40, 2)
    label = counts.argmax(axis=1)
    words = np.array(["smooth", "a bit", "so so", "quite", "rough"])
    ordered = pd.Categorical.from_codes(label, words, ordered=True)
    new = world(2, 9)[0]
    for base in (NNPOM(0), LogisticRegression()):
        models = [
            ConformalRatings(base).fit(X, y, groups=objects)
            for y in (label + 1, pd.Series(ordered), label + 1.0)
        ]
        assert_array_equal(models[1].classes_, words)
        for model in models[1:]:
            assert_allclose(everything(model, new), everything(models[0], new))
        first, _ = models[1].predict_interval(new, 0.2)
        assert_array_equal(first, words[models[0].predict_set(new, 0.2).argmax(axis=1)])
    of_counts = ConformalRatings(NNPOM(0)).fit(X, np.eye(5)[label], groups=objects)
    with pytest.warns(UserWarning, match="y has words, which have no order of their"):
        model = ConformalRatings(LogisticRegression()).fit(
            X, words[label], groups=objects
        )
    assert_array_equal(model.classes_, np.sort(words))
    assert_allclose(of_counts.predict_set(new), models[0].predict_set(new), atol=1)
    # Objects that judge need not have all labels of the model.
    known = LogisticRegression().fit(X, label + 1)
    some = label > 0
    model = prefit(X[some], label[some] + 1, objects[some], known)
    assert_array_equal(model.classes_, np.arange(1, 6))


def test_tables_floats_clones_jobs_and_files():
    X, counts, objects = uneven()
    new = world(3, 8)[0]
    table, named = (pd.DataFrame(each, columns=list("abc")) for each in (X, new))
    model = ConformalRatings(NNPOM(0), cv=3)
    before = everything(model.fit(X, counts, groups=objects), new)
    with parallel_config("threading"):
        again = clone(model).set_params(n_jobs=2).fit(X, counts, groups=objects)
    assert_array_equal(everything(again, new), before)
    assert_array_equal(everything(pickle.loads(pickle.dumps(model)), new), before)
    of_table = clone(model).fit(table, pd.DataFrame(counts), groups=pd.Series(objects))
    assert_allclose(everything(of_table, named), before)
    assert_array_equal(of_table.feature_names_in_, ["a", "b", "c"])
    single = clone(model).fit(X.astype(np.float32), counts, groups=objects)
    assert_allclose(everything(single, new.astype(np.float32)), before, atol=0.1)
    frozen = FrozenEstimator(NNPOM(0).fit(X, counts))
    same = [
        everything(prefit(X, counts, objects, each), new)
        for each in (frozen, frozen.estimator)
    ]
    assert_array_equal(*same)
    assert prefit(X, counts, objects, frozen).estimator_ is frozen


def test_equal_predictions_in_other_batches_are_ties():
    """Rows that are predicted alone and together differ in the last digits."""
    X, counts, objects, _ = world(0, 60, n_features=40)
    X = np.repeat(X[:6], 10, axis=0)
    model = ConformalRatings(NNPOM(0).fit(X, counts), method="prefit")
    model.fit(X, counts, groups=objects)
    alone = np.vstack([model.p_values(X[[i]]) for i in range(60)])
    assert_allclose(alone, model.p_values(X))


# Sliders ------------------------------------------------------------------------------


def slid(seed=0, n_objects=30):
    """Answers on a slider: lists of unequal length for unequal numbers of touches."""
    rng = np.random.default_rng(seed)
    X, _, objects = uneven(seed, n_objects)
    middle = world(seed, n_objects)[0][:, 0]
    crowds = [50 + 20 * m + 9 * rng.normal(size=rng.integers(1, 6)) for m in middle]
    return X, [crowds[i].tolist() for i in objects], objects


@pytest.mark.parametrize("share", [0.15, 0.4])
def test_intervals_of_sliders_that_people_leave_at_an_end(share):
    """As narrow as where the cells of the same grid are levels, and no surer."""
    rng, grid = np.random.default_rng(0), np.linspace(0, 100, 21)
    feel = rng.normal(size=260)
    answers = 40 + 15 * feel[:, np.newaxis] + 8 * rng.normal(size=(260, 8))
    answers = answers.clip(1, 99)
    answers[rng.random(answers.shape) < share] = 0
    X = feel[:, np.newaxis] + 0.3 * rng.normal(size=(260, 1))
    ordinal = DistributionalOrdinalRegressor(NNPOM(0, alpha=0.1))
    sliders = ConformalRatings(ContinuousRatingsRegressor(ordinal, grid=grid))
    sliders.fit(X[:60], answers[:60], groups=range(60))
    lower, upper = sliders.predict_interval(X[60:], 0.2)
    held = (answers[60:] >= lower[:, None]) & (answers[60:] <= upper[:, None])
    assert 0.75 < held.mean() < 0.9
    cell = np.clip(np.searchsorted(grid[1:-1], answers), 0, 19)
    counts = (cell[:, :, np.newaxis] == np.arange(20)).sum(axis=1)
    levels = ConformalRatings(ordinal).fit(X[:60], counts[:60], groups=range(60))
    low, high = levels.predict_interval(X[60:], 0.2)
    assert (upper - lower).mean() < 1.1 * (grid[high] - grid[low - 1]).mean()


@pytest.mark.parametrize("grid", [None, np.linspace(-99, 199, 50)])
def test_intervals_of_sliders(grid):
    X, answers, objects = slid()
    folds = list(GroupKFold(3).split(X, groups=objects))
    base = ContinuousRatingsRegressor(n_cells=8, grid=grid)
    model = ConformalRatings(base, cv=folds).fit(X, answers, groups=objects)
    assert not is_classifier(model)
    new = world(7, 6)[0]
    ends = [each.grid_[[0, -1]] for each in model.estimators_]
    at = np.unique(np.r_[np.linspace(-40, 140, 91), np.ravel(ends)])

    def score(fold, x, values):
        grid = fold.grid_
        beyond = np.maximum(grid[0] - values, values - grid[-1]) / np.ptp(grid)
        share, (low, high) = (
            np.interp(each, grid, fold.predict_cdf(x[np.newaxis])[0])
            for each in (values, grid[[1, -2]])
        )
        share = np.where(values == grid[0], min(low, 0.5), share)  # as all its cell
        share = np.where(values == grid[-1], max(high, 0.5), share)
        return abs(2 * share - 1) + np.maximum(beyond, 0)

    weight = np.ones((6, len(at)))
    for fold, (_, test) in zip(model.estimators_, folds):
        for t, i in product(test, range(6)):
            known = score(fold, X[t], np.array(answers[t]))
            far = known[:, np.newaxis] >= score(fold, new[i], at) - 1e-9
            weight[i] += far.mean(axis=0) / (objects == objects[t]).sum()
    p = model.p_values(new, at)
    assert_allclose(p, weight / (len(set(objects)) + 1))
    before = [np.full(6, -np.inf), np.full(6, np.inf)]
    gap = 2 + (np.diff(model.grid_).max() if grid is None else 0)  # an end of one fold
    for alpha in (0.05, 0.1, 0.2, 0.4):
        lower, upper = model.predict_interval(new, alpha)
        for i in range(6):
            inside = at[p[i] > alpha]
            assert lower[i] - 1e-6 <= inside[0] < max(lower[i] + gap, -39)
            assert min(upper[i] - gap, 139) < inside[-1] <= upper[i] + 1e-6
        assert (before[0] <= lower).all() and (upper <= before[1]).all()
        before = lower, upper
        low, high = model.predict_band(new, alpha)
        assert low.shape == high.shape == (6, len(model.grid_))
        assert (low <= model.predict_cdf(new)).all()
        assert (model.predict_cdf(new) <= high).all()
    with pytest.warns(UserWarning, match="needs 99 objects"):
        lower, upper = model.predict_interval(new, 0.01)
    assert np.isneginf(lower).all() and np.isposinf(upper).all()
    alone = clone(base).fit(X, answers)
    assert_array_equal(model.predict(new), alone.predict(new))
    assert_array_equal(
        model.predict_quantile(new, 0.3), alone.predict_quantile(new, 0.3)
    )
    assert model.score(X, answers) == alone.score(X, answers)
    drawn = [each.sample(new, 3, random_state=0) for each in (model, alone)]
    assert_array_equal(*drawn)
    with pytest.raises(ValueError, match="Sliders have no levels; use predict_inte"):
        model.predict_set(new)


def test_messages_number_the_trials_of_all():
    trials = [np.ones((5, 1)) for _ in range(12)]
    trials[7] = np.array([[1.0], [np.nan]])
    model = make_haptic_pipeline(None, random_state=0)
    with pytest.raises(ValueError, match="Trial 7 of X"):
        ConformalRatings(model).fit(trials, np.ones((12, 2)), groups=range(12))


@pytest.mark.filterwarnings("ignore:GridSearchCV has cv=2, which splits by trial")
def test_models_of_sliders_in_pipelines_searches_and_frozen():
    X, answers, objects = slid()
    new, base = world(7, 6)[0], ContinuousRatingsRegressor(NNPOM(0), n_cells=8)

    def predicted(model, method="cv+"):
        model = ConformalRatings(model, method=method).fit(X, answers, groups=objects)
        first = model.predict_interval(new, 0.2), model.predict_band(new, 0.2)
        scored = [[model.score(X, answers)] * 6, model.predict_quantile(new, 0.3)]
        rest = model.predict_proba(new), model.p_values(new), model.predict_cdf(new)
        assert model.sample(new, 2).shape == (6, 2) and not is_classifier(model)
        return np.column_stack([*first[0], *first[1], *scored, *rest])

    twice = make_pipeline(FunctionTransformer(), base)
    around = {
        "a pipeline": twice,
        "a search": GridSearchCV(base, {"n_cells": [8]}, cv=2),
        "both": GridSearchCV(twice, {}, cv=2),
    }
    expected = predicted(base)
    for model in around.values():
        assert_array_equal(predicted(model), expected)
    expected = predicted(clone(base).fit(X, answers), "prefit")
    for model in around.values():
        frozen = FrozenEstimator(clone(model).fit(X, answers))
        assert_array_equal(predicted(frozen, "prefit"), expected)
    with pytest.raises(ValueError, match=r"Ridge\(\) predicts no distribution; give a"):
        ConformalRatings(Ridge()).fit(X, answers, groups=objects)


def test_values_are_of_sliders(fitted):
    with pytest.raises(ValueError, match="values are of sliders; leave them out"):
        fitted.p_values(world(0, 2)[0], [1, 2])


def test_coverage_of_intervals_and_bands_of_sliders():
    inside, within = [], []
    for seed in range(40):
        X, answers, objects = slid(seed, 60)
        old = objects < 30
        model = ConformalRatings(ContinuousRatingsRegressor(NNPOM(0), n_cells=6))
        model.fit(X[old], [a for a, o in zip(answers, old) if o], groups=objects[old])
        lower, upper = model.predict_interval(X[~old], 0.2)
        low, high = model.predict_band(X[~old], 0.2)
        weight = 1 / np.bincount(objects)[objects[~old]] / 30
        for i, crowd in enumerate(a for a, o in zip(answers, old) if not o):
            crowd = np.array(crowd)
            share = (crowd[:, np.newaxis] <= model.grid_).mean(axis=0)
            ok = (low[i] <= share + 1e-12) & (share <= high[i] + 1e-12)
            inside.append(
                30 * weight[i] * ((lower[i] <= crowd) & (crowd <= upper[i])).mean()
            )
            within.append(30 * weight[i] * ok.all())
    for covered in (inside, within):
        mean = np.sum(covered) / 40 / 30
        assert 0.78 <= mean <= 0.86


# Coverage, and what spoils it --------------------------------------------------------


@pytest.mark.parametrize("alpha", [0.1, 0.2])
@pytest.mark.parametrize("n_objects", [9, 20, 50])
@pytest.mark.parametrize("n_raters", [1, 12])
def test_one_model_keeps_its_word(alpha, n_objects, n_raters):
    """Also one that predicts nothing, or the opposite."""
    backwards = LeastSquares().fit(-world(99, 30)[0], world(99, 30)[1])
    nothing = DummyDistribution().fit(*world(99, 30)[:2])
    options = {"n_objects": n_objects, "n_raters": n_raters, "n_touches": 2}
    for known in (backwards, nothing):
        mean, error = mean_coverage(
            lambda *args, known=known: prefit(*args, known), 60, alpha, **options
        )
        most = (1 - alpha) * (n_objects + 1) / n_objects + 0.015
        assert 1 - alpha - 3 * error <= mean
        assert mean <= most + 3 * error or known is nothing  # whose scores are tied


def models_of_folds(base):
    return lambda X, y, groups: ConformalRatings(base).fit(X, y, groups=groups)


def test_folds_of_trials_break_the_word():
    """They are refused; whoever calls each touch an object gets what he asked for."""
    memory = RegressedDistribution(KNeighborsRegressor(1))
    options = {"n_objects": 30, "n_touches": 4, "n_features": 8}
    good, error = mean_coverage(models_of_folds(memory), 25, **options)
    bad, _ = mean_coverage(
        lambda X, y, _: models_of_folds(memory)(X, y, np.arange(len(X))), 25, **options
    )
    assert good >= 0.8 - 3 * error and bad < 0.76
    X, y, objects, _ = world(0, 30, 4)
    split = [
        (
            np.flatnonzero(np.arange(120) % 2 == i),
            np.flatnonzero(np.arange(120) % 2 != i),
        )
        for i in (0, 1)
    ]
    with pytest.raises(ValueError, match="cv trains on 0 in the fold that tests it"):
        ConformalRatings(memory, cv=split).fit(X, y, groups=objects)


def test_most_common_labels_break_the_word_and_counts_keep_it():
    base = RegressedDistribution(LinearRegression())
    options = {"n_objects": 40, "n_raters": 30}
    good, error = mean_coverage(models_of_folds(base), 25, **options)
    bad, _ = mean_coverage(
        lambda X, y, groups: models_of_folds(base)(
            X, y.argmax(axis=1)[:, np.newaxis] == np.arange(5), groups
        ),
        25,
        **options,
    )
    assert 0.8 - 3 * error <= good <= 0.84 and bad < 0.77


def test_scores_out_of_fold_need_the_models_of_the_folds():
    """With one model fitted to all, least squares with many features fall short."""
    base = LeastSquares()

    class Refitted(ConformalRatings):
        def fit(self, X, y, groups=None):
            proba = cross_val_predict_proba(base, X, y, groups=groups)
            model = prefit(proba, y, groups)
            model.estimator_ = base.fit(X, y)
            model.estimators_ = [model.estimator_]
            return model

    options = {"n_objects": 40, "n_features": 39, "n_raters": 5}
    bad, _ = mean_coverage(
        lambda X, y, groups: Refitted().fit(X, y, groups), 25, **options
    )
    good, error = mean_coverage(models_of_folds(base), 25, **options)
    assert good >= 0.8 - 3 * error and bad < 0.76


def test_contested_objects_with_few_raters_weigh_as_much_as_others():
    good, pooled = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        contested = rng.random(130) < 0.5
        P = np.where(contested[:, np.newaxis], 0.2, np.eye(5)[2])
        X = np.full((130, 5), 0.1) + 0.5 * np.eye(5)[2]
        counts = np.array(
            [rng.multinomial(2 if c else 20, p) for c, p in zip(contested, P)]
        )
        model = prefit(X[:30], counts[:30], range(30))
        good.append(coverage(model, X[30:], P[30:]))
        rows = np.repeat(np.arange(30), counts[:30].sum(axis=1))
        each = np.concatenate([np.repeat(np.arange(5), c) for c in counts[:30]])
        model = prefit(X[rows], np.eye(5)[each], np.arange(len(rows)))
        pooled.append(coverage(model, X[30:], P[30:]))
    assert np.mean(good) >= 0.8 > 0.75 > np.mean(pooled)


def test_one_panel_tells_of_its_members_and_not_of_others():
    """Each person is lenient or strict throughout; one rates all objects."""
    member, other = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        bias = rng.choice([-1, 1], size=41)
        level = np.clip(2 + bias[:1] + rng.integers(-1, 2, (70, 1)), 0, 4)[:, 0]
        new = np.clip(2 + bias[1:] + rng.integers(-1, 2, (30, 40)), 0, 4)
        X = np.full((40, 5), 0.05)
        X[:, 1 + bias[0] : 4 + bias[0]] = 0.3
        model = prefit(X, np.eye(5)[level[:40]], range(40))
        chosen = model.predict_set(X[:30], 0.2)
        member.append(np.take_along_axis(chosen, level[40:, np.newaxis], axis=1).mean())
        other.append(np.take_along_axis(chosen, new, axis=1).mean())
    assert np.mean(member) >= 0.8 > 0.75 > np.mean(other)


def test_coverage_is_an_average_over_objects():
    """It need not be that of each kind of object, here of contested ones."""
    easy, hard = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        contested = rng.random(150) < 0.3
        P = np.where(contested[:, np.newaxis], 0.2, [0, 0.1, 0.8, 0.1, 0])
        X = np.tile([0.05, 0.1, 0.7, 0.1, 0.05], (150, 1))
        counts = np.array([rng.multinomial(5, p) for p in P])
        chosen = prefit(X[:50], counts[:50], range(50)).predict_set(X[50:], 0.2)
        inside = (chosen * P[50:]).sum(axis=1)
        easy.append(inside[~contested[50:]].mean())
        hard.append(inside[contested[50:]].mean())
    assert 0.7 * np.mean(easy) + 0.3 * np.mean(hard) >= 0.8 > 0.7 > np.mean(hard)
