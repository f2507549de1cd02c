"""Predictions from touches of any length, against loops written out."""

import warnings

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal
from short_touches import (
    COUNTS,
    DURATIONS,
    HEAD,
    OBJECTS,
    RATES,
    TOUCHES,
    coded,
    cut,
    features,
    make_model,
    make_touches,
    statistics,
)
from sklearn import config_context
from sklearn.base import clone
from sklearn.compose import ColumnTransformer, make_column_transformer
from sklearn.feature_selection import SelectKBest
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import FeatureUnion, make_pipeline, make_union
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from told_groups import Told

from sklearn_haptic import (
    NNPOM,
    AnytimeRegressor,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    KSVDTransformer,
    RepairTrials,
    Signal,
    SignalStatistics,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.metrics import log_score, ranked_probability_score
from sklearn_haptic.streaming import ExpectedGain
from sklearn_haptic.streaming._heads import best_power
from sklearn_haptic.utils._folds import ObjectKFold

pytestmark = pytest.mark.filterwarnings("ignore:.*fit was given no groups")


@pytest.fixture(scope="module")
def model():
    return make_model().fit(TOUCHES, COUNTS, groups=OBJECTS)


def flattened(proba, power):
    return proba**power / (proba**power).sum(axis=-1, keepdims=True)


def test_a_search_as_head_knows_the_order_of_its_levels(model):
    search = GridSearchCV(HEAD, {}, cv=GroupKFold(3))
    estimator = make_pipeline(features(), StandardScaler(), search)
    same = make_model(estimator, stopping=ExpectedGain())
    with config_context(enable_metadata_routing=True):
        same.fit(TOUCHES, COUNTS, groups=OBJECTS)
    own = make_model(stopping=ExpectedGain())
    own.fit(TOUCHES, COUNTS, groups=OBJECTS)
    for found, expected in zip(
        same.predict_when_done(TOUCHES), own.predict_when_done(TOUCHES)
    ):
        assert_array_equal(found, expected)
    assert same.score(TOUCHES, COUNTS) == own.score(TOUCHES, COUNTS)


def test_a_blend_learns_the_same_with_metadata_routing():
    head = DistributionBlend([("linear", HEAD)])
    model, proba = make_model(make_pipeline(features(), StandardScaler(), head)), []
    for routing in (False, True):
        with config_context(enable_metadata_routing=routing):
            model.fit(TOUCHES, COUNTS, groups=OBJECTS)
        proba.append(model.predict_proba(TOUCHES))
    np.testing.assert_array_equal(*proba)


def test_heads_are_those_of_prefixes(model):
    """Dictionaries of whole touches, rows of one duration.

    Windows that are too long have no features there.
    """
    coder = clone(features()).fit(TOUCHES)
    rows = [coder.transform(cut(TOUCHES, d)) for d in DURATIONS[1:]]
    fast = coder.named_transformers_["fast"].transform(cut(TOUCHES, 0.5)["fast"])
    rows.insert(0, fast)
    for k, X in enumerate(rows):
        scale = StandardScaler().fit(X)
        head = clone(HEAD).fit(scale.transform(X), COUNTS)
        expected = head.predict_proba(scale.transform(X))
        np.testing.assert_allclose(
            model.predict_proba(cut(TOUCHES, DURATIONS[k])),
            flattened(expected, model.powers_[k]),
            rtol=1e-9,
        )


def test_a_growing_force_is_not_taken_for_a_harder_object():
    """Half a second of a press at constant speed tells as much as all of it."""
    rng = np.random.default_rng(0)
    stiffness, objects = rng.uniform(0, 4, 60), np.repeat(range(60), 3)
    answers = np.clip(np.round(stiffness + rng.normal(0, 0.6, (12, 60))), 0, 4)
    counts = np.stack([(answers == k).sum(axis=0) for k in range(5)], axis=1)[objects]
    slope = 2 * np.exp(0.3 * stiffness[objects] + rng.normal(0, 0.1, 180))
    force = slope[:, None, None] * np.arange(200)[:, None] / 100
    touches = [*(force + rng.normal(0, 0.2, (180, 200, 1)))]
    pipeline = make_pipeline(SignalStatistics(("mean", "max")), StandardScaler(), HEAD)
    model = AnytimeRegressor(
        pipeline, durations=[0.25, 0.5, 1, 2], sampling_rates=100, cv=3
    )
    model.fit(touches[:120], counts[:120], groups=objects[:120])
    proba = model.predict_proba_over_time(touches[120:], [0.5, 2])
    rps = [ranked_probability_score(counts[120:], proba[:, i]) for i in (0, 1)]
    assert rps[0] < 1.05 * rps[1]


def test_a_sensor_whose_window_is_too_long_waits(model):
    """Slow windows take 0.8 s, so half a second knows the fast sensor only."""
    other = cut(TOUCHES, 0.5)
    other["slow"] = other["slow"].map(lambda x: x + 100)
    np.testing.assert_array_equal(
        model.predict_proba(other), model.predict_proba(cut(TOUCHES, 0.5))
    )
    assert (
        model.predict_proba(cut(other, 1)) == model.predict_proba(cut(TOUCHES, 0.5))
    ).all()


@pytest.mark.parametrize("seconds", [0.5, 0.7, 0.99, 1.0, 1.5, 2.0, 2.4])
def test_the_longest_complete_duration_predicts(model, seconds):
    longest = max(d for d in DURATIONS if d <= seconds)
    np.testing.assert_array_equal(
        model.predict_proba(cut(TOUCHES, seconds)),
        model.predict_proba(cut(TOUCHES, longest)),
    )


def test_before_the_first_duration_all_touches_look_alike(model):
    proba = model.predict_proba(cut(TOUCHES, 0.4))
    np.testing.assert_allclose(proba, np.tile(COUNTS.sum(0) / COUNTS.sum(), (24, 1)))


def test_over_time_is_a_loop_of_prefixes(model):
    times = [0, 0.3, 0.5, 0.9, 1.2, 2, 50]
    proba = model.predict_proba_over_time(TOUCHES, times)
    for i, seconds in enumerate(times[1:], 1):
        np.testing.assert_allclose(
            proba[:, i], model.predict_proba(cut(TOUCHES, seconds)), atol=1e-12
        )
    np.testing.assert_allclose(proba[:, 0], np.tile(model.shares_, (24, 1)))


def test_out_of_fold_predictions_are_of_objects_never_touched():
    model = make_model().fit(TOUCHES, COUNTS, groups=OBJECTS)
    coder = clone(features()).fit(TOUCHES)
    rows = coder.transform(cut(TOUCHES, 2))
    for train, test in ObjectKFold(4).split(rows, groups=OBJECTS):
        head = make_pipeline(StandardScaler(), clone(HEAD)).fit(
            rows[train], COUNTS[train]
        )
        np.testing.assert_allclose(
            model.oof_proba_[test, 2],
            flattened(head.predict_proba(rows[test]), model.powers_[2]),
            rtol=1e-9,
        )


def test_features_are_never_given_ratings_because_folds_share_them():
    inside = make_column_transformer(
        (make_pipeline(SignalStatistics(), SelectKBest(k=2)), "fast")
    )
    with pytest.raises(ValueError, match="requires y") as caught:
        make_model(make_pipeline(inside, HEAD)).fit(TOUCHES, COUNTS, groups=OBJECTS)
    assert caught.value.__notes__ == [
        "AnytimeRegressor fits the steps that turn touches into rows of features once "
        "for all folds, so they are not given y; put a step that learns from y behind "
        "them."
    ]


@pytest.mark.parametrize("groups", [OBJECTS, None])
def test_a_head_is_told_the_objects_of_prefixes(groups):
    """Prefixes of one touch are of one object, also if objects are not given."""
    model = make_model(make_pipeline(features(), Told()))
    model.fit(TOUCHES, np.arange(len(TOUCHES)) % 2, groups=groups)
    expected = np.arange(len(TOUCHES)) if groups is None else groups
    for head in model.heads_:
        np.testing.assert_array_equal(head[-1].groups_, expected)


def test_powers_have_the_best_log_score(model):
    """The tempered predictions out of fold gain nothing from another power."""
    for k in range(3):
        proba = model.oof_proba_[:, k]
        scores = [
            log_score(COUNTS, flattened(proba, power)) for power in (0.95, 1, 1.05)
        ]
        inside = 0.23 < model.powers_[k] < 4.4
        assert np.argmin(scores) == 1 or not inside


@pytest.mark.parametrize(
    ("right", "sure", "power"),
    [
        (0.6, 0.8, np.log(0.6 / 0.4) / np.log(0.8 / 0.2)),
        (0.7, 0.6, np.log(0.7 / 0.3) / np.log(0.6 / 0.4)),
        (1, 0.6, np.exp(1.5)),  # the limits
        (0.6, 0.999, np.exp(-1.5)),
        (0.6, 1, np.exp(-1.5)),
    ],
)
def test_the_best_power_of_two_levels_by_hand(right, sure, power):
    proba, shares = np.array([[sure, 1 - sure]] * 5), np.array([[right, 1 - right]] * 5)
    assert best_power(proba, shares) == pytest.approx(power, rel=1e-4)


def test_touches_shorter_than_a_duration_do_not_teach_it():
    touches = pd.concat([make_touches(), make_touches(1, (0.85, 0.95))])
    counts, objects = np.vstack([COUNTS] * 2), np.tile(OBJECTS, 2)
    mixed = make_model().fit(touches, counts, groups=objects)
    assert np.isnan(mixed.oof_proba_[24:, 1:]).all()
    assert np.isfinite(mixed.oof_proba_[:, 0]).all()
    assert np.isfinite(mixed.oof_proba_[:24]).all()


def test_trials_of_one_sensor_in_any_container():
    slow = list(TOUCHES["slow"])
    model = make_model(
        make_pipeline(coded("slow"), HEAD), durations=[1, 2], sampling_rates=10
    )
    proba = model.fit(slow, COUNTS).predict_proba(slow)
    assert (clone(model).fit(tuple(slow), COUNTS).predict_proba(slow) == proba).all()
    named = TOUCHES[["slow"]]
    assert (
        clone(model).fit(TOUCHES["slow"], COUNTS).predict_proba(named) == proba
    ).all()
    by_name = clone(model).set_params(sampling_rates={"slow": 10.0})
    assert (by_name.fit(named, COUNTS).predict_proba(named) == proba).all()


def test_rates_that_contradict_a_description_are_refused():
    described = make_column_transformer((SignalStatistics(rate=99), "slow"))
    model = make_model(make_pipeline(described, HEAD), sampling_rates={"slow": 10})
    with pytest.raises(ValueError, match=r"10 Hz for 'slow', which .* by 99 Hz"):
        model.fit(TOUCHES, COUNTS, groups=OBJECTS)


def test_columns_that_the_pipeline_does_not_take_are_ignored(model):
    more = TOUCHES.assign(other=[None] * len(TOUCHES))
    wide = make_model(sampling_rates={**RATES, "other": 1.0})
    proba = wide.fit(more, COUNTS, groups=OBJECTS).predict_proba(more)
    assert wide.sensors_ == ["fast", "slow"]
    np.testing.assert_array_equal(proba, model.predict_proba(TOUCHES))


def test_columns_keep_the_order_of_the_data_frame():
    """Also for a function that counts them."""

    def means_of_the_first(X):
        return np.array([trial.mean(axis=0) for trial in X.iloc[:, 0]])

    steps = FunctionTransformer(means_of_the_first), HEAD
    for first in RATES:
        order = sorted(RATES, key=lambda sensor: sensor != first)
        found = [
            make_model(make_pipeline(*steps), sampling_rates=rates)
            .fit(TOUCHES[order], COUNTS, groups=OBJECTS)
            .predict_proba(TOUCHES[order])
            for rates in (RATES, dict(reversed(RATES.items())))
        ]
        np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("nothing", [None, np.nan, [], np.empty(0), np.empty((0, 3))])
def test_a_missing_sensor_has_the_mean_features(model, nothing):
    lost = TOUCHES.copy()
    lost["slow"] = pd.Series([nothing] * len(lost), lost.index, dtype=object)
    rows = features().fit(TOUCHES).transform(cut(TOUCHES, 2))
    rows[:, 36:] = rows[:, 36:].mean(axis=0)
    head = model.heads_[2].predict_proba(rows)
    np.testing.assert_allclose(
        model.predict_proba(lost), flattened(head, model.powers_[2]), rtol=1e-9
    )


def test_a_late_sensor_is_waited_for_and_a_dead_one_is_not(model):
    late, dead = cut(TOUCHES, 1.06), cut(TOUCHES, 2)
    late["slow"] = cut(TOUCHES, 0.97)["slow"]  # 0.9 s, whole samples
    late["fast"] = cut(TOUCHES, 1.0)["fast"]
    np.testing.assert_array_equal(
        model.predict_proba(late), model.predict_proba(cut(TOUCHES, 0.9))
    )
    dead["slow"] = cut(TOUCHES, 1)["slow"]
    lost = cut(TOUCHES, 2)
    lost["slow"] = None
    with pytest.warns(UserWarning, match=r"goes on without 'slow', which is late by m"):
        found = model.predict_proba(dead)
    np.testing.assert_array_equal(found, model.predict_proba(lost))
    touch = model.start().update({"fast": lost.at[0, "fast"]})
    with pytest.warns(UserWarning, match=r"goes on without 'slow', which is late by m"):
        np.testing.assert_allclose(touch.predict_proba(), found[0], atol=1e-15)


@pytest.mark.parametrize("repairs", [[], [RepairTrials()]])
def test_what_a_pipeline_does_not_use_is_ignored(repairs):
    """A sensor that it drops, or that no transformer takes, also behind repairs."""
    _, slow = features().transformers
    for parts in ([slow], [("fast", "drop", "fast"), slow]):
        steps = [*repairs, ColumnTransformer(parts), StandardScaler(), HEAD]
        model = make_model(make_pipeline(*steps), durations=[1, 2])
        model.fit(TOUCHES, COUNTS, groups=OBJECTS)
        assert model.sensors_ == ["slow"]
        short = TOUCHES.assign(fast=TOUCHES["fast"].map(lambda x: x[:3]))
        assert_array_equal(model.predict_proba(short), model.predict_proba(TOUCHES))
        assert_array_equal(
            model.predict_proba(TOUCHES[["slow"]]), model.predict_proba(TOUCHES)
        )


@pytest.mark.parametrize(
    "first",
    [
        [FunctionTransformer(), features()],
        [features().set_params(transformer_weights={"fast": 1.0, "slow": 1.0})],
    ],
    ids=["a step before", "weights"],
)
def test_a_lost_sensor_of_features_that_are_not_divided_is_warned_of(first):
    """Without it nothing is known of the others."""
    model = make_model(make_pipeline(*first, StandardScaler(), HEAD), durations=[1, 2])
    model.fit(TOUCHES, COUNTS, groups=OBJECTS)
    lost = TOUCHES.assign(slow=None)
    with pytest.warns(UserWarning, match="lacks a sensor, and with it features of oth"):
        assert np.ptp(model.predict_proba(lost), axis=0).max() < 1e-9
    whole = make_model().fit(TOUCHES, COUNTS, groups=OBJECTS)
    assert np.ptp(whole.predict_proba(lost), axis=0).max() > 0.01


def test_windows_longer_than_a_duration_are_left_out_also_behind_repairs():
    def repaired(sensor):
        return make_pipeline(RepairTrials(), *(each for _, each in coded(sensor).steps))

    found, expected = (
        make_model(make_pipeline(features(make), StandardScaler(), HEAD))
        .fit(TOUCHES, COUNTS, groups=OBJECTS)
        .predict_proba_over_time(TOUCHES, DURATIONS)
        for make in (repaired, coded)
    )
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.filterwarnings("ignore:A touch goes on without 'slow'")
def test_a_sensor_that_no_training_touch_has_at_a_duration_tells_nothing_there():
    """Also if a later touch has it for longer."""
    stopped = TOUCHES.assign(slow=TOUCHES["slow"].map(lambda x: x[:15] + 300))
    model = make_model(durations=[0.5, 1, 2], max_delay=0.1)
    with pytest.warns(UserWarning, match="'fast' lasts for 2.5 s and 'slow' for 1.5"):
        model.fit(stopped, COUNTS, groups=OBJECTS)
    longer = TOUCHES.assign(slow=TOUCHES["slow"].map(lambda x: x + 900))
    assert_array_equal(model.predict_proba(longer), model.predict_proba(stopped))
    touch = model.start()
    touch.update({s: longer[s].iloc[0] for s in RATES})
    np.testing.assert_allclose(
        touch.predict_proba(), model.predict_proba(longer[:1])[0], atol=1e-9
    )


@pytest.mark.parametrize("kind", [int, bool])
def test_means_of_whole_numbers_stand_for_a_missing_sensor(kind):
    def peaks(trials):
        return np.array([(np.abs(x) > 0.5).sum(axis=0) % 3 for x in trials])

    found = []
    for cast in (lambda f: f.astype(kind), lambda f: f.astype(kind).astype(float)):
        transform = FunctionTransformer(lambda trials, cast=cast: cast(peaks(trials)))
        parts = [(s, transform, s) for s in RATES]
        steps = make_pipeline(ColumnTransformer(parts), StandardScaler(), HEAD)
        model = make_model(steps, durations=[1, 2])
        model.fit(TOUCHES, COUNTS, groups=OBJECTS)
        found.append(model.predict_proba(TOUCHES.assign(slow=None)))
    np.testing.assert_allclose(*found, atol=1e-12)


def test_a_duration_of_one_object_is_refused():
    many = np.repeat([0, 1], 12)
    long = TOUCHES.copy()
    for sensor, rate in RATES.items():
        for i in np.flatnonzero(many):
            long.at[i, sensor] = long.at[i, sensor][: int(1.5 * rate)]
    with pytest.raises(ValueError, match=r"12 of 24 training touches .*, of 1 object;"):
        make_model().fit(long, COUNTS, groups=many)


@pytest.mark.parametrize(
    "table", [np.asarray, pd.DataFrame, lambda y: y[:, np.newaxis]]
)
@pytest.mark.parametrize("head", [LogisticRegression(max_iter=1000), HEAD])
def test_labels(head, table):
    labels = np.array([1, 2, 3])[COUNTS.argmax(axis=1)]
    pipeline = make_pipeline(features(lambda _: FunctionTransformer(statistics)), head)
    model = make_model(pipeline).fit(TOUCHES, table(labels), groups=OBJECTS)
    assert model.predict_proba(TOUCHES).shape == (24, len(np.unique(labels)))
    assert set(model.predict(TOUCHES)) <= {1, 2, 3}
    proba = model.predict_proba(TOUCHES)
    if head is HEAD:
        levels = model.classes_
        rps = ranked_probability_score(labels, proba, levels=levels)
        assert model.score(TOUCHES, labels) == pytest.approx(-rps)
    else:
        accuracy = np.mean(model.predict(TOUCHES) == labels)
        assert model.score(TOUCHES, labels) == accuracy


def test_a_class_of_touches_too_short_for_any_duration_is_refused():
    touches = make_touches(seconds=(1.1, 1.5))
    touches.iloc[-3:] = cut(touches[-3:], 0.9)
    labels = np.repeat(["foam", "wood"], 12).astype(object)
    labels[-3:] = "tap"
    head = make_pipeline(features(), StandardScaler(), LogisticRegression())
    model = make_model(head, cv=2, durations=[0.5, 1.0])
    runs = np.tile(np.arange(3), 8)
    with pytest.warns(UserWarning, match="class 'tap' is as long as 1 s"):
        model.fit(touches, labels, groups=runs)
    proba = model.predict_proba(touches[-3:])
    assert model.classes_.tolist() == ["foam", "tap", "wood"]
    assert (proba[:, 1] > 0.05).all()
    model.set_params(durations=[1.0])
    with pytest.raises(ValueError, match="y has the class 'tap' only where touches"):
        model.fit(touches, labels, groups=runs)


def test_classes_that_a_fold_has_not_seen_get_no_share():
    """The last objects are classes of their own, which their folds lack."""
    names = np.array([f"object {max(i, 4)}" for i in OBJECTS])
    pipeline = make_pipeline(
        features(lambda _: FunctionTransformer(statistics)),
        LogisticRegression(max_iter=1000),
    )
    model = make_model(pipeline).fit(TOUCHES, names, groups=OBJECTS)
    _, classes = np.unique(names, return_inverse=True)
    own = model.oof_proba_[np.arange(24), :, classes]
    assert (own[OBJECTS > 4] < 1e-2).all()
    np.testing.assert_allclose(model.oof_proba_.sum(axis=-1), 1)
    assert model.predict(TOUCHES).dtype == names.dtype


def test_features_that_were_learned_before_are_kept():
    frozen = FrozenEstimator(features().fit(TOUCHES[:12]))
    model = make_model(make_pipeline(frozen, clone(HEAD)), durations=[1])
    proba = model.fit(TOUCHES, COUNTS, groups=OBJECTS).predict_proba(TOUCHES)
    rows = frozen.transform(cut(TOUCHES, 1))
    head = clone(HEAD).fit(rows, COUNTS).predict_proba(rows)
    np.testing.assert_allclose(proba, flattened(head, model.powers_[0]), rtol=1e-6)


def test_inner_pipelines_are_steps_in_their_place():
    head = DistributionalOrdinalRegressor(NNPOM(0), random_state=0)
    flat = make_pipeline(RepairTrials(), features(), StandardScaler(), head)
    nested = make_pipeline(flat[0], make_pipeline(*flat[1:]))
    expected, got = (
        make_model(each, durations=[1, 2]).fit(TOUCHES, COUNTS).predict_proba(TOUCHES)
        for each in (flat, nested)
    )
    np.testing.assert_array_equal(got, expected)


@pytest.mark.filterwarnings("ignore:A touch goes on without 'slow'")
@pytest.mark.parametrize("rest", [None, 3])
@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.filterwarnings("ignore:A touch goes on without 'fast'")
def test_a_repair_before_the_features_is_one_of_every_prefix(alone, rest):
    """As of touches repaired beforehand, also where a sensor is missing or lags."""
    sensors = {name: Signal(rate) for name, rate in RATES.items()}
    X, rates = (TOUCHES["fast"], RATES["fast"]) if alone else (TOUCHES, RATES)
    pipeline = make_haptic_pipeline(
        sensors["fast"] if alone else sensors, random_state=0
    ).set_params(model=HEAD)
    settings = {"durations": [0.3, 1, 2], "sampling_rates": rates, "cv": 2}
    repair = RepairTrials(rest=rest)
    if not alone:  # a sensor that is repaired, but has no features
        X = X.assign(unused=X["slow"])
        settings["sampling_rates"] = {**rates, "unused": rates["slow"]}
    model = AnytimeRegressor(make_pipeline(repair, pipeline), **settings)
    model.fit(X, COUNTS, groups=OBJECTS)
    repaired = clone(repair).fit_transform(X)
    apart = AnytimeRegressor(pipeline, **settings)
    apart.fit(repaired, COUNTS, groups=OBJECTS)
    np.testing.assert_allclose(model.oof_proba_, apart.oof_proba_, rtol=1e-6)
    new, mended = X.copy(), repaired.copy()
    if not alone:
        for table in (new, mended):
            table.at[0, "slow"] = None
            table.at[1, "fast"] = table.at[1, "fast"][:25]
    expected = apart.predict_proba(mended)
    np.testing.assert_allclose(model.predict_proba(new), expected, rtol=1e-6)
    for i in range(3):
        touch = model.start()
        if alone:
            touch.update(new[i])
        else:
            touch.update({s: new.at[i, s] for s in RATES if new.at[i, s] is not None})
        np.testing.assert_allclose(touch.predict_proba(), expected[i], rtol=1e-6)


@pytest.mark.parametrize("alone", [False, True])
def test_blocks_weigh_the_same_at_every_duration(alone):
    """Cut to a duration, the model is the pipeline fitted to touches of that length."""
    sensors = {name: Signal(rate) for name, rate in RATES.items()}
    X, rates = (TOUCHES["fast"], RATES["fast"]) if alone else (TOUCHES, RATES)
    pipeline = make_haptic_pipeline(
        sensors["fast"] if alone else sensors, random_state=0
    )
    durations = {"durations": [1, 2], "sampling_rates": rates, "cv": 2}
    model = AnytimeRegressor(pipeline, **durations).fit(X, COUNTS, groups=OBJECTS)
    whole = clone(pipeline).fit(X, COUNTS)
    for k, seconds in enumerate([1, 2]):
        each = cut(TOUCHES, seconds)
        each = each["fast"] if alone else each
        whole[0].scaler_.limits_ = -np.inf, np.inf  # so that nothing is lost
        rows = whole[0].scaler_.inverse_transform(whole[0].transform(each))
        scale = clone(whole[0].scaler_).fit(rows)
        head = clone(whole[1]).fit(scale.transform(rows), COUNTS, groups=OBJECTS)
        expected = head.predict_proba(scale.transform(rows))
        got = model.predict_proba(each)
        np.testing.assert_allclose(got, flattened(expected, model.powers_[k]), 1e-4)
        touch = model.start()
        touch.update(each.iloc[0] if alone else each.iloc[0].to_dict())
        np.testing.assert_allclose(touch.predict_proba(), got[0], rtol=1e-6)


def test_a_step_before_the_features_of_a_sensor_changes_nothing_else():
    """One that returns what it is given; codes do not fit into the first duration."""
    sensors = {name: Signal(rate) for name, rate in RATES.items()}
    plain = make_haptic_pipeline(sensors, random_state=0).set_params(model=HEAD)
    steps = FunctionTransformer(), plain.get_params()["features__fast"]
    own = clone(plain).set_params(features__fast=make_pipeline(*steps))
    settings = {"durations": [0.1, 1, 2], "sampling_rates": RATES, "cv": 2}
    model, expected = (
        AnytimeRegressor(each, **settings).fit(TOUCHES, COUNTS, groups=OBJECTS)
        for each in (own, plain)
    )
    np.testing.assert_allclose(model.oof_proba_, expected.oof_proba_, rtol=1e-6)
    touch = model.start()
    touch.update(TOUCHES.iloc[0].to_dict())
    proba = expected.predict_proba(TOUCHES.iloc[:1])[0]
    np.testing.assert_allclose(touch.predict_proba(), proba, rtol=1e-6)


@pytest.mark.parametrize("join", [ColumnTransformer, FeatureUnion])
def test_models_of_one_sensor_that_are_joined_keep_their_scale(join):
    """Of touches as long as the duration, the model is the pipeline fitted to them."""
    X = cut(TOUCHES, 1)
    parts = {
        name: make_haptic_pipeline(Signal(rate), random_state=0)[:-1]
        for name, rate in RATES.items()
    }
    if join is FeatureUnion:
        X, rates = X["fast"], RATES["fast"]
        features = FeatureUnion([("a", parts["fast"]), ("b", clone(parts["fast"]))])
    else:
        rates = RATES
        features = ColumnTransformer([(s, part, s) for s, part in parts.items()])
    pipeline = make_pipeline(features, NNPOM(0, alpha=3))
    model = AnytimeRegressor(pipeline, durations=[1], sampling_rates=rates, cv=2)
    proba = model.fit(X, COUNTS, groups=OBJECTS).predict_proba(X)
    expected = clone(pipeline).fit(X, COUNTS).predict_proba(X)
    np.testing.assert_allclose(proba, flattened(expected, model.powers_[0]), 1e-4)


@pytest.mark.parametrize("output", ["pandas", "polars"])
def test_what_transformers_return_everywhere_is_no_matter(output):
    sensors = {name: Signal(rate) for name, rate in RATES.items()}
    pipeline = make_haptic_pipeline(sensors, random_state=0).set_params(model=HEAD)
    model = AnytimeRegressor(pipeline, durations=[1], sampling_rates=RATES, cv=2)
    proba = clone(model).fit(TOUCHES, COUNTS, groups=OBJECTS).predict_proba(TOUCHES)
    with config_context(transform_output=output):
        again = model.fit(TOUCHES, COUNTS, groups=OBJECTS).predict_proba(TOUCHES)
    assert_array_equal(again, proba)


@pytest.mark.parametrize("rate, longest", [(5, "'slow'"), (10, None), (20, "'fast'")])
def test_a_rate_by_which_a_sensor_lasts_longer_is_warned_of(rate, longest):
    pipeline = make_pipeline(
        features(lambda _: FunctionTransformer(statistics)), StandardScaler(), HEAD
    )
    rates = {**RATES, "slow": rate}
    model = make_model(pipeline, sampling_rates=rates, durations=[0.5, 1])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model.fit(TOUCHES, COUNTS, groups=OBJECTS)
    assert len(caught) == (longest is not None)
    for each in caught:
        assert f"By sampling_rates, {longest} lasts for" in str(each.message)
        assert each.filename == __file__


def test_channels_are_found_by_name():
    """In any order, recorded or arriving; other names are refused."""
    framed = [
        pd.DataFrame({"a": t[:, 0], "b": 10 + t[:, 0] ** 2}) for t in TOUCHES["fast"]
    ]
    swapped = [frame[["b", "a"]] for frame in framed]
    steps = SignalStatistics(), StandardScaler(), DistributionalOrdinalRegressor()
    model = AnytimeRegressor(
        make_pipeline(*steps), durations=[1, 2], sampling_rates=RATES["fast"], cv=2
    ).fit(framed, COUNTS)
    expected = model.predict_proba(framed)
    np.testing.assert_array_equal(model.predict_proba(swapped), expected)
    arrived = model.start().update(swapped[3]).predict_proba()
    np.testing.assert_allclose(arrived, expected[3], rtol=1e-12)
    touch = model.start()
    for _, sample in swapped[3].iterrows():
        touch.update(sample)
    np.testing.assert_allclose(touch.predict_proba(), expected[3], rtol=1e-12)
    renamed = [frame.rename(columns={"a": "c"}) for frame in framed]
    for refused in (model.predict_proba, lambda X: model.start().update(X[0])):
        with pytest.raises(ValueError, match="differ in the column"):
            refused(renamed)


def test_several_adjectives():
    both = np.stack([COUNTS, COUNTS[:, ::-1]], axis=1)
    head = DistributionalOrdinalRegressor(NNPOM(2, max_iter=50), random_state=0)
    pipeline = make_pipeline(features(), StandardScaler(), head)
    model = make_model(pipeline, durations=[1, 2], cv=2)
    model.fit(TOUCHES, both, groups=OBJECTS)
    assert model.predict_proba(TOUCHES).shape == (24, 2, 3)
    assert model.predict_proba_over_time(TOUCHES, [0, 1, 2]).shape == (24, 3, 2, 3)
    assert model.predict(TOUCHES).shape == (24, 2)
    each = [
        ranked_probability_score(both[:, i], model.predict_proba(TOUCHES)[:, i])
        for i in range(2)
    ]
    assert model.score(TOUCHES, both) == pytest.approx(-np.mean(each))


def test_very_short_and_very_long_touches(model):
    extreme = TOUCHES.iloc[:2].copy()
    extreme["fast"] = [
        np.ones((1, 2)),
        np.vstack([TOUCHES["fast"][1]] * 1200)[:100_000],
    ]
    extreme["slow"] = [np.ones((1, 2)), np.vstack([TOUCHES["slow"][1]] * 1200)[:25_000]]
    proba = model.predict_proba(extreme)
    np.testing.assert_allclose(proba[0], model.shares_)
    np.testing.assert_allclose(proba[1], model.predict_proba(TOUCHES.iloc[[1]])[0])


def test_settings_after_fit_wait_for_the_next():
    pipeline = make_pipeline(coded("slow"), HEAD)
    model = make_model(pipeline, durations=[1, 2], sampling_rates=10, cv=2)
    slow = list(TOUCHES["slow"])
    before = model.fit(slow, COUNTS).predict_proba(slow)
    model.set_params(durations=[5], sampling_rates=1, max_delay=7)
    assert (model.predict_proba(slow) == before).all()


@pytest.mark.parametrize("seconds", [0.7, 0.71, 1.3])
def test_a_duration_is_complete_with_the_whole_samples_in_it(seconds):
    """0.7 s at 44.1 samples per second are 30.87, which no recording has."""
    rates = {"fast": 44.1, "slow": 12.5}
    model = make_model(cv=2, sampling_rates=rates, durations=[0.7, 1.3]).fit(
        TOUCHES, COUNTS, groups=OBJECTS
    )
    short = pd.DataFrame(
        {
            s: TOUCHES[s].map(lambda x, n=int(seconds * r): x[:n])
            for s, r in rates.items()
        }
    )
    expected = model.predict_proba(short)
    over_time = model.predict_proba_over_time(TOUCHES, [seconds])[:, 0]
    np.testing.assert_array_equal(over_time, expected)
    assert (model.predict_when_done(short)[1] == (0.7 if seconds < 1 else 1.3)).all()
    touch = model.start().update({s: short[s][0] for s in rates})
    np.testing.assert_allclose(touch.predict_proba(), expected[0], atol=1e-12)
    assert touch.done == (seconds == 1.3)


@pytest.mark.parametrize("of_sensor", ["fast", None])
def test_a_union_has_what_fits_the_duration(of_sensor):
    """Half a second is too short for a window of 0.75 s: it knows the levels alone."""
    levels = SignalStatistics(("mean",))
    codes = make_pipeline(
        KSVDTransformer(3, 2, window=30, random_state=0), TemporalMaxPool()
    )

    def fitted(transformer):
        trials, rates = list(TOUCHES["fast"]), RATES["fast"]
        if of_sensor is not None:
            transformer = make_column_transformer((transformer, "fast"))
            trials, rates = TOUCHES[["fast"]], {"fast": rates}
        return AnytimeRegressor(
            make_pipeline(transformer, clone(HEAD)),
            durations=[0.5, 2],
            sampling_rates=rates,
            cv=3,
        ).fit(trials, COUNTS, groups=OBJECTS), trials

    united, trials = fitted(make_union(codes, levels))
    short = [x[: int(0.5 * RATES["fast"])] for x in TOUCHES["fast"]]
    whole = united.predict_proba(trials)
    if of_sensor is not None:
        short = pd.DataFrame({"fast": short})
    alone = fitted(levels)[0].predict_proba(short)
    np.testing.assert_allclose(united.predict_proba(short), alone, atol=1e-6)
    touch = united.start()
    for part in np.array_split(TOUCHES["fast"][0], 7):
        touch.update({of_sensor: part} if of_sensor else part)
    np.testing.assert_allclose(touch.predict_proba(), whole[0], atol=1e-12)


def test_codes_that_begin_to_fit_do_not_stand_out_from_the_duration_before():
    """Their level, 20 here, is far from the 0 of a duration that has no codes."""
    rng = np.random.default_rng(0)
    felt = rng.normal(size=60)
    trials = pd.DataFrame(
        {
            "force": [20 + z + 0.3 * rng.normal(size=(60, 1)) for z in felt],
            "skin": [rng.normal(size=(60, 1)) for _ in felt],
        }
    )
    share = np.exp(-1.25 * (np.arange(5) - 2 - felt[:, None]) ** 2)
    counts = 12 * share / share.sum(axis=1, keepdims=True)
    coder = KSVDTransformer(10, window=30, max_iter=0, remove_mean=False)
    coder = make_pipeline(coder.set_params(random_state=0), TemporalMaxPool((1,)))
    both = make_column_transformer(
        (coder, "force"), (SignalStatistics(("std",)), "skin")
    )
    head = DistributionalOrdinalRegressor()
    steps = make_pipeline(both, StandardScaler(), head)
    train, test = np.arange(40), np.arange(40, 60)
    rps = []
    for durations in ([0.2, 0.5], [0.5]):
        rates = {"force": 100, "skin": 100}
        model = AnytimeRegressor(steps, durations=durations, sampling_rates=rates, cv=4)
        model.fit(trials.loc[train], counts[train], groups=train)
        proba = model.predict_proba_over_time(trials.loc[test], [0.5])[:, 0]
        rps.append(ranked_probability_score(counts[test], proba))
    assert rps[0] < 1.1 * rps[1]
