"""How unlike others a touch is, against plain loops and searches."""

import tracemalloc
import warnings
from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree
from sklearn.base import clone
from sklearn.compose import make_column_transformer
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from told_groups import Told

from sklearn_haptic import (
    NNPOM,
    DummyDistribution,
    NoveltyGuard,
    RepairTrials,
    Signal,
    SignalStatistics,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.ensembles._novelty_guard import (
    belief_at,
    conformal_p_values,
    fit_belief,
    nearest_distances,
)
from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.utils._folds import ObjectKFold

pytestmark = pytest.mark.filterwarnings("ignore:No p-value is below 1/")


def made(n_objects=40, n_touches=3, seed=0, shift=0.0):
    rng = np.random.default_rng(seed)
    objects = np.repeat(np.arange(n_objects), n_touches)
    latent = rng.normal(size=(n_objects, 4))
    X = latent[objects] + 0.3 * rng.normal(size=(len(objects), 4)) + shift
    people = latent[:, :1] + rng.normal(size=(n_objects, 12))
    level = np.digitize(people, [-1, 0, 1])
    counts = np.stack([(level == k).sum(axis=1) for k in range(4)], axis=1)
    return X, counts[objects].astype(float), objects


def guard(**params):
    return NoveltyGuard(make_pipeline(StandardScaler(), NNPOM(0)), **params)


def test_distances_equal_a_loop():
    X, _, objects = made(7)
    looped = [
        min(np.sqrt(np.mean((x - z) ** 2)) for z, b in zip(X, objects) if a != b)
        for x, a in zip(X, objects)
    ]
    assert_allclose(nearest_distances(X, X, objects, objects), looped, rtol=1e-6)
    new = made(2, seed=1)[0]
    looped = [min(np.sqrt(np.mean((x - z) ** 2)) for z in X) for x in new]
    assert_allclose(nearest_distances(new, X), looped, rtol=1e-6)


def test_p_values_equal_a_loop():
    rng = np.random.default_rng(0)
    known, objects = rng.integers(0, 9, 20) / 3, np.arange(20) % 6
    new = np.r_[rng.integers(0, 9, 8) / 3, 99, -1]
    looped = [
        (1 + sum(np.mean(known[objects == o] >= d) for o in range(6))) / 7 for d in new
    ]
    assert_allclose(conformal_p_values(new, known, objects), looped)


@pytest.mark.parametrize("n_touches", [3, 7, 10])
def test_p_values_equal_fractions(n_touches):
    """So that p > 0.05 is false where p is one twentieth."""
    objects = np.repeat(np.arange(59), n_touches)
    known = np.arange(len(objects)) // n_touches % 59 + 0.0
    new = np.array([-1, 0, 20, 57, 99])
    exact = [float(Fraction(1 + int((np.arange(59) >= d).sum()), 60)) for d in new]
    assert conformal_p_values(new, known, objects).tolist() == pytest.approx(
        exact, abs=1e-12
    )
    assert not (conformal_p_values(np.array([57.0]), known, objects) > 0.05).any()
    assert conformal_p_values(np.array([-1.0]), known, objects).max() <= 1


def test_equal_distances_of_whole_numbers_are_equal():
    """Fractions tell which are; their square roots differ in the last digits."""
    rng = np.random.default_rng(0)
    X, new = rng.integers(0, 3, (48, 7)), rng.integers(0, 3, (60, 7))
    n = len(X)
    squares = [int(n * column @ column - column.sum() ** 2) for column in X.T]

    def nearest(row, rows):
        steps = (row - rows).tolist()
        return min(sum(Fraction(d * d, s) for d, s in zip(r, squares)) for r in steps)

    known = [nearest(row, np.delete(X, i, axis=0)) for i, row in enumerate(X)]
    distances = [nearest(row, X) for row in new]
    exact = [(1 + sum(k >= d for k in known)) / (n + 1) for d in distances]
    counts = rng.multinomial(12, np.ones(5) / 5, size=n)
    found = guard().fit(X, counts, groups=np.arange(n)).p_values(new)
    assert_allclose(found, exact, atol=1e-9)


def test_p_values_of_objects_of_the_same_kind_are_valid():
    """Over many draws, p is at most a with a probability of about a, or below."""
    p = []
    for seed in range(60):
        X, counts, objects = made(20, 2, seed=2 * seed)
        model = guard(cv=2).fit(X, counts, groups=objects)
        p.append(model.p_values(made(20, 1, seed=2 * seed + 1)[0]))
    for a in (0.05, 0.1, 0.25, 0.5):
        assert np.mean(np.concatenate(p) <= a) == pytest.approx(a, abs=0.04)


def test_belief_is_the_best_falling_function():
    rng = np.random.default_rng(0)
    n = 6
    distance, weight = np.sort(rng.uniform(size=n)), rng.uniform(0.5, 1, size=n)
    move = rng.normal(size=(n, 3))
    departure = -np.linspace(1.2, -0.3, n)[:, None] * move
    departure += 0.7 * rng.normal(size=(n, 3))
    belief = fit_belief(departure, move, distance, weight).predict(distance)

    def score(w):
        return weight @ ((departure + w[:, None] * move) ** 2).sum(axis=1)

    assert (np.diff(belief) <= 0).all() and 0 <= belief.min() <= belief.max() <= 1
    found = score(belief)
    for _ in range(3000):
        other = np.sort(np.clip(belief + 0.2 * rng.normal(size=n), 0, 1))[::-1]
        assert score(other) >= found - 1e-12


def test_beyond_the_furthest_belief_falls_in_proportion():
    move = np.ones((3, 1))
    belief = fit_belief(-0.8 * move, move, np.array([1.0, 2.0, 4.0]), np.ones(3))
    assert_allclose(
        belief_at(belief, np.array([0.0, 4.0, 8.0, 40.0])), [0.8, 0.8, 0.4, 0.08]
    )


def test_predictions_equal_the_steps():
    X, counts, objects = (each[1:] for each in made())  # one object has a touch less
    model = guard(cv=4).fit(X, counts, groups=objects)
    new = made(10, seed=1)[0]
    plain = clone(model.estimator).fit(X, counts)
    share = belief_at(model.belief_, model.distances(new))[:, None]
    marginal = (counts / counts.sum(axis=1, keepdims=True)).mean(axis=0)
    expected = share * plain.predict_proba(new) + (1 - share) * marginal
    assert_allclose(model.predict_proba(new), expected, rtol=1e-9)
    rows = StandardScaler().fit_transform(X)
    shares = counts / counts.sum(axis=1, keepdims=True)
    proba, mean = np.empty(counts.shape), np.empty(counts.shape)
    for train, test in ObjectKFold(4).split(X, groups=objects):
        fitted = NNPOM(0).fit(rows[train], counts[train])
        proba[test] = fitted.predict_proba(rows[test])
        mean[test] = shares[train].mean(axis=0)
    below, of_mean, true = (
        each.cumsum(axis=1)[:, :-1] for each in (proba, mean, shares)
    )
    alike = 1 / np.array([np.sum(objects == each) for each in objects])
    belief = fit_belief(of_mean - true, below - of_mean, model.distances_, alike)
    kept = belief.predict(model.distances_)
    assert_allclose(model.belief_.predict(model.distances_), kept, rtol=1e-9)


def test_a_model_that_asks_is_told_the_objects():
    X, counts, objects = made(10)
    model = NoveltyGuard(make_pipeline(StandardScaler(), Told()))
    model.fit(X, counts.argmax(axis=1), groups=objects)
    assert_array_equal(model.estimator_[-1].groups_, objects)


def test_far_touches_are_found_and_hardly_believed():
    X, counts, objects = made(60)
    model = guard().fit(X, counts, groups=objects)
    near, far = made(40, seed=1), made(40, seed=1, shift=[0, 60, 0, 0])
    assert (model.p_values(far[0]) <= 1 / 61 + 1e-9).all()
    assert np.mean(model.p_values(near[0]) < 0.05) < 0.2
    away = np.abs(model.predict_proba(far[0]) - model.shares_).max()
    assert away < 0.1
    plain = clone(model.estimator).fit(X, counts)
    for X_new, true, limit in ((near[0], near[1], 0.01), (far[0], far[1], 0.01)):
        mine, other = (
            ranked_probability_score(true, each.predict_proba(X_new))
            for each in (model, plain)
        )
        assert mine < other + limit


def test_labels_without_an_order():
    X, counts, objects = made()
    labels = np.array(["cork", "felt", "wood", "zinc"])[counts.argmax(axis=1)]
    model = NoveltyGuard(make_pipeline(StandardScaler(), LogisticRegression()))
    model.fit(X, labels, groups=objects)
    assert model.score(X, labels) == np.mean(model.predict(X) == labels) > 0.5


# Signals


def felt(n_objects=24, n_touches=2, seed=0):
    """Two sensors of two channels; their level and their power depend on the object."""
    rng = np.random.default_rng(seed)
    objects = np.repeat(np.arange(n_objects), n_touches)
    latent = rng.normal(size=n_objects)[objects]
    level = np.round(latent).astype(int)
    touches = {
        "skin": [
            10 + x + 0.1 * rng.normal(size=(rng.integers(60, 80), 2)) for x in latent
        ],
        "acc": [
            np.exp(0.3 * x) * rng.normal(size=(rng.integers(60, 80), 2)) for x in latent
        ],
    }
    return pd.DataFrame(touches), level, objects


FAULTS = {
    "dead": lambda trials: trials.map(lambda x: 0 * x),
    "stuck": lambda trials: trials.map(lambda x: x[:1] + 0 * x),
    "noise": lambda trials: trials.map(
        lambda x: x + np.random.default_rng(0).normal(scale=5, size=x.shape)
    ),
    "amplified": lambda trials: trials.map(lambda x: 10 * x),
}


warned_of = pytest.mark.filterwarnings("ignore:Trial 0 .* has a peak of 0 times")


@pytest.fixture(scope="module")
def guards():
    """Guards of both sensors together and of each alone, and one of a list."""
    X, y, objects = felt()
    guards = {
        name: NoveltyGuard(
            make_haptic_pipeline(dict.fromkeys(name, Signal(100)), random_state=0)
        ).fit(X, y, groups=objects)
        for name in [("skin", "acc"), ("skin",), ("acc",)]
    }
    alone = NoveltyGuard(make_haptic_pipeline(Signal(100), random_state=0))
    guards["list"] = alone.fit(list(X["skin"]), y, groups=objects)
    return guards


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("sensor", ["skin", "acc"])
@warned_of
def test_a_broken_sensor_is_found(guards, sensor, fault):
    X = felt(seed=1)[0]
    broken = X.assign(**{sensor: FAULTS[fault](X[sensor])})
    other = "acc" if sensor == "skin" else "skin"
    for name in [("skin", "acc"), (sensor,)]:
        assert np.mean(guards[name].p_values(X) <= 0.05) <= 0.15
        assert (guards[name].p_values(broken) <= 0.05).all()
    whole = guards[(other,)]  # sees another sensor alone
    assert_array_equal(whole.p_values(broken), whole.p_values(X))
    both = guards[("skin", "acc")]
    believed = [belief_at(both.belief_, both.distances(each)) for each in (X, broken)]
    assert believed[1].max() < believed[0].mean()


def test_exchanged_sensors_are_found(guards):
    X = felt(seed=1)[0]
    exchanged = X.rename(columns={"skin": "acc", "acc": "skin"})
    for name in [("skin", "acc"), ("skin",), ("acc",)]:
        assert (guards[name].p_values(exchanged) <= 0.05).all()


@warned_of
def test_the_recordings_of_one_sensor_need_no_name(guards):
    X = felt(seed=1)[0]
    assert np.mean(guards["list"].p_values(list(X["skin"])) <= 0.05) <= 0.15
    broken = [0 * trial for trial in X["skin"]]
    assert (guards["list"].p_values(broken) <= 0.05).all()


def test_distances_are_the_largest_of_features_and_signals(guards):
    X, _, objects = felt()
    guard = guards[("skin", "acc")]
    rows = guard.estimator_[:-1].transform(X)
    statistics = [
        StandardScaler().fit_transform(SignalStatistics().fit_transform(list(X[s])))
        for s in ("skin", "acc")
    ]
    of_each = []
    for table in (rows, *statistics):
        others = objects[:, None] != objects
        gaps = np.sqrt(((table[:, None] - table) ** 2).mean(axis=2))
        of_each.append(np.where(others, gaps, np.inf).min(axis=1))
    units = [np.median(of_each[0]) / np.median(distances) for distances in of_each]
    assert_allclose(
        guard.distances_,
        np.max([u * d for u, d in zip(units, of_each)], axis=0),
        rtol=1e-6,
    )


@pytest.mark.parametrize("all_agree", [False, True])
def test_a_model_that_predicts_the_mean_is_guarded_too(all_agree):
    X, y, objects = made()
    last = DummyDistribution()
    if all_agree:
        y, last = np.tile([0, 0, 12.0, 0], (len(y), 1)), NNPOM(0)
    fitted = NoveltyGuard(make_pipeline(StandardScaler(), last))
    fitted.fit(X, y, groups=objects)
    expected = np.tile(y.sum(axis=0) / y.sum(), (2, 1))
    assert_allclose(fitted.predict_proba([X[0], X[0] + 99]), expected)


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize("sensors", [["pdc"], ["pdc", "tdc"]])
def test_a_guard_takes_touches_that_its_model_repairs(sensors, nested):
    corpus = make_haptic_corpus(6, 2, sensors=sensors, random_state=0)
    trials = corpus.trials[sensors].copy()
    trials.at[trials.index[0], "pdc"] = None
    broken = trials["pdc"].iloc[1].astype(float)
    broken[3:9] = np.nan
    trials.at[trials.index[1], "pdc"] = broken
    repair, model = RepairTrials(), make_haptic_pipeline(sensors, random_state=0)
    if nested:
        together = make_pipeline(repair, model)
    else:
        together = make_pipeline(repair, "passthrough", *(s for _, s in model.steps))
    together = NoveltyGuard(together)
    together.fit(trials, corpus.ratings["hard"], groups=corpus.objects)
    repaired = clone(repair).fit_transform(trials)
    apart = NoveltyGuard(model).fit(
        repaired, corpus.ratings["hard"], groups=corpus.objects
    )
    assert_allclose(together.distances_, apart.distances_)
    assert_allclose(together.p_values(trials), apart.p_values(repaired))
    assert_allclose(together.predict_proba(trials), apart.predict_proba(repaired))


def test_touches_of_one_channel_may_be_of_one_length():
    """A list of arrays is one of touches, whatever their lengths."""
    rng = np.random.default_rng(0)
    touches = [rng.normal(size=n) for n in [60] * 11 + [61]]
    counts = rng.multinomial(12, [0.2] * 5, size=12)
    columns = [touch[:, np.newaxis] for touch in touches]
    pipeline = make_haptic_pipeline(Signal(), random_state=0)
    for n in (11, 12):
        flat, deep = (
            NoveltyGuard(pipeline).fit(X[:n], counts[:n], groups=range(n))
            for X in (touches, columns)
        )
        for which in (slice(1), slice(11, 12), slice(12)):
            assert_array_equal(
                flat.p_values(touches[which]), deep.p_values(columns[which])
            )


def test_the_unit_of_recordings_changes_no_p_value():
    """Codes that no training touch has tell no scale."""
    corpus = make_haptic_corpus(40, 2, "fast_slide", sensors=["pdc"], random_state=0)
    new = np.isin(corpus.objects, np.unique(corpus.objects)[1::2])
    model = make_haptic_pipeline(["pdc"], random_state=0)
    model.set_params(model=DummyDistribution())
    p_values = []
    for unit in 1.0, 0.0365, 36500.0:
        trials = corpus.trials.map(lambda trial, unit=unit: unit * trial)
        guard = NoveltyGuard(model).fit(
            trials[~new], corpus.ratings["hard"][~new], groups=corpus.objects[~new]
        )
        p_values.append(guard.p_values(trials[new]))
        assert guard.distances(trials[~new]).max() == pytest.approx(0, abs=1e-9)
    assert_allclose(p_values[1:], [p_values[0]] * 2, atol=1e-9)


def test_groups_that_are_the_classes_are_refused():
    X, _, objects = made(6)
    model = NoveltyGuard(make_pipeline(StandardScaler(), LogisticRegression()))
    names = objects.astype(str)
    with pytest.raises(ValueError, match="Most touches held out are of classes that"):
        model.fit(X, names, groups=objects)
    model.fit(X, names, groups=np.tile([0, 1, 2], 6))  # runs
    assert (model.predict(X) == names).mean() > 0.9


# Extremes ----------------------------------------------------------------------


@pytest.mark.parametrize("unit", [1e-200, 1.0, 1e200])
@pytest.mark.parametrize("offset", [0.0, 1e8])
def test_distances_do_not_cancel_or_overflow(unit, offset):
    X, _, objects = made(7)
    X = np.round(X * 2**10) / 2**10  # so that the offset costs no digit
    looped = [
        min(np.sqrt(np.mean((x - z) ** 2)) for z, b in zip(X, objects) if a != b)
        for x, a in zip(X, objects)
    ]
    moved = unit * (X + offset)
    found = nearest_distances(moved, moved, objects, objects)
    assert_allclose(found / unit, looped, rtol=1e-6)
    assert_array_equal(nearest_distances(moved, moved), 0)


def test_a_touch_may_be_any_distance_away():
    X, _, _ = made(7)
    for far in (1e150, 1e250, 1e300):
        (found,) = nearest_distances(np.full((1, 4), far), X)
        assert found == pytest.approx(far)


@pytest.mark.parametrize("far", [1e10, -1e200])
def test_one_training_row_far_out_moves_no_other_distance(far):
    X, _, _ = made(7)
    new = X + 0.1
    looped = [min(np.sqrt(np.mean((x - z) ** 2)) for z in X) for x in new]
    assert_allclose(nearest_distances(new, np.vstack((X, X[:1] * far))), looped)


def test_distances_take_little_memory():
    """20 000 touches would need 3.2 GB for all distances at once."""
    rows = np.random.default_rng(0).normal(size=(20_000, 3))
    tracemalloc.start()
    found = nearest_distances(rows, rows, np.arange(20_000), np.arange(20_000))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2e8
    tree = cKDTree(rows).query(rows, k=2)[0][:, 1]
    assert_allclose(found, tree / np.sqrt(3), rtol=1e-9)


def test_few_objects_are_told_that_no_p_value_is_small():
    X, counts, objects = made(18)
    with pytest.warns(UserWarning, match="below 1/19, since there are 18 objects; giv"):
        few = guard().fit(X, counts, groups=objects)
    assert few.p_values(np.full((1, 4), 1e6)) == pytest.approx(1 / 19)
    X, counts, objects = made(19)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        enough = guard().fit(X, counts, groups=objects)
    assert enough.p_values(np.full((1, 4), 1e6)) == pytest.approx(0.05)


def test_numbers_beside_recordings_are_no_signals():
    """Nor are those of a table without any recording."""
    X, counts, objects = made(20)
    table = pd.DataFrame(X, columns=[*"abcd"])
    columns = make_column_transformer((StandardScaler(), [*table.columns]))
    model = NoveltyGuard(make_pipeline(columns, NNPOM(0)))
    plain = NoveltyGuard(make_pipeline(StandardScaler(), NNPOM(0)))
    model.fit(table, counts, groups=objects)
    assert_allclose(model.distances_, plain.fit(X, counts, groups=objects).distances_)
    rng = np.random.default_rng(0)
    table["pdc"] = [*rng.normal(size=(len(X), 30, 1))]
    both = make_column_transformer(
        (StandardScaler(), [*table.columns[:-1]]), (SignalStatistics(), "pdc")
    )
    guard = NoveltyGuard(make_pipeline(both, StandardScaler(), NNPOM(0)))
    dead = table.assign(pdc=[np.zeros((30, 1))] * len(table))
    with pytest.warns(UserWarning, match="has a peak of 0 times"):
        p = guard.fit(table, counts, groups=objects).p_values(dead)
    assert (p <= 0.05).all()


@warned_of
def test_sensors_in_a_pipeline_without_a_column_transformer():
    """A first step that takes the whole table of trials is as good as any."""
    corpus = make_haptic_corpus(20, 2, sensors=["pdc", "tdc"], random_state=0)

    def means(trials):
        return np.hstack(
            [np.stack([t.mean(axis=0) for t in trials[s]]) for s in trials]
        )

    steps = FunctionTransformer(means), StandardScaler(), NNPOM(0)
    model = NoveltyGuard(make_pipeline(*steps), cv=2)
    model.fit(corpus.trials, corpus.ratings["hard"], groups=corpus.objects)
    dead = corpus.trials.assign(pdc=corpus.trials["pdc"].map(lambda t: 0 * t))
    assert (model.p_values(dead) < 0.06).all()


@pytest.mark.parametrize(
    "columns", [["pdc", "tdc"], [0, 1], slice(0, 2), slice("pdc", "tdc"), None]
)
def test_all_columns_are_guarded_in_any_order(columns):
    """However they are given, and also if a later table has them in another order."""
    corpus = make_haptic_corpus(20, 2, sensors=["pdc", "tdc"], random_state=0)

    def means(trials):
        return np.array([np.mean(touch, axis=0) for touch in trials["pdc"]])

    first = FunctionTransformer(means)
    if columns is not None:
        first = make_column_transformer((first, columns))
    model = NoveltyGuard(make_pipeline(first, StandardScaler(), NNPOM(0)), cv=2)
    model.fit(corpus.trials, corpus.ratings["hard"], groups=corpus.objects)
    amplified = corpus.trials.assign(tdc=corpus.trials["tdc"].map(lambda t: 9 * t))
    distances = model.distances(amplified)
    assert_array_equal(model.distances(amplified[["tdc", "pdc"]]), distances)
    scaler = make_pipeline(SignalStatistics(), StandardScaler())
    kinds = [[model.estimator_[:-1].transform(t) for t in (corpus.trials, amplified)]]
    for s in ("pdc", "tdc"):
        fitted = clone(scaler).fit(corpus.trials[s])
        kinds.append([fitted.transform(t[s]) for t in (corpus.trials, amplified)])
    middles = [
        np.median(nearest_distances(known, known, corpus.objects, corpus.objects))
        for known, _ in kinds
    ]
    expected = [
        nearest_distances(felt, known) * middles[0] / middle
        for (known, felt), middle in zip(kinds, middles)
    ]
    assert_allclose(distances, np.max(expected, axis=0))
