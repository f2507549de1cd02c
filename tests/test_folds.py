"""Folds, and predictions out of fold: one policy for all that learns by them."""

import warnings
from functools import partial

import numpy as np
import pandas as pd
import pytest
from sklearn import config_context
from sklearn.base import clone
from sklearn.compose import ColumnTransformer
from sklearn.ensemble import AdaBoostClassifier
from sklearn.exceptions import UnsetMetadataPassedError
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV, RidgeCV
from sklearn.model_selection import GridSearchCV, GroupKFold, KFold
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from told_groups import Told

from sklearn_haptic import (
    NNPOM,
    AnytimeRegressor,
    ConformalRatings,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    NoveltyGuard,
    SensorFusionNNPOM,
    TemporalMaxPool,
    TouchPool,
)
from sklearn_haptic.ensembles._out_of_fold import (
    Task,
    at_classes,
    check_folds,
    make_folds,
    run_tasks,
)
from sklearn_haptic.metrics import neg_rps_scorer
from sklearn_haptic.model_selection import (
    cross_val_predict_proba,
    model_report,
    sensor_contributions,
    sensor_subsets,
)
from sklearn_haptic.utils._folds import (
    NO_GROUPS,
    ObjectKFold,
    groups_for,
    number_objects,
)

RNG = np.random.default_rng(0)
OBJECTS = np.repeat(np.arange(20), 3)
X = RNG.normal(size=(60, 2)) + OBJECTS[:, np.newaxis] / 5
COUNTS = RNG.multinomial(9, [0.2, 0.5, 0.3], size=20)[OBJECTS]
TRIALS = [np.tile(row, (8, 1)) for row in X]

LINEAR = NNPOM(0)
# What learns from predictions out of fold, and what it learns from.
LEARNERS = {
    "blend": (DistributionBlend([("linear", LINEAR)]), X),
    "pool": (TouchPool([("linear", LINEAR, [0, 1])]), X),
    "guard": (NoveltyGuard(make_pipeline(StandardScaler(), LINEAR)), X),
    "sets": (ConformalRatings(LINEAR), X),
    "anytime": (
        AnytimeRegressor(
            make_pipeline(TemporalMaxPool(), LINEAR),
            durations=[0.5],
            sampling_rates=10,
        ),
        TRIALS,
    ),
}
STOPPING = NNPOM(1, max_iter=30, early_stopping=True, random_state=0)
STOPPED = {
    "network": STOPPING,
    "fusion": SensorFusionNNPOM({"a": [0], "b": [1]}, STOPPING, STOPPING),
    "regressor": DistributionalOrdinalRegressor(STOPPING),
}


def part(X, rows):
    return [X[i] for i in rows] if isinstance(X, list) else X[rows]


# Folds ---------------------------------------------------------------------------


def test_names_of_objects_change_no_fold():
    names = RNG.permutation([f"object {i}" for i in range(20)])
    folds = list(ObjectKFold(4).split(X, groups=OBJECTS))
    renamed = list(ObjectKFold(4).split(X, groups=names[OBJECTS]))
    for (train, test), (same_train, same_test) in zip(folds, renamed, strict=True):
        np.testing.assert_array_equal(train, same_train)
        np.testing.assert_array_equal(test, same_test)
        assert not {*OBJECTS[train]} & {*OBJECTS[test]}
        assert len(test) == 15
    np.testing.assert_array_equal(number_objects(["b", "a", "b", "c"], 4), [0, 1, 0, 2])


@pytest.mark.parametrize("in_rounds", [False, True])
@pytest.mark.parametrize("n_kinds, n_folds", [(5, 5), (10, 10), (20, 5), (2, 10)])
def test_rows_that_name_each_material_in_turn_leave_out_none(
    n_kinds, n_folds, in_rounds
):
    """No fold holds out all objects of a material, or most of them."""
    objects = np.arange(100 if n_kinds < 20 else 200)
    objects = np.tile(objects, 3) if in_rounds else np.repeat(objects, 3)
    kind = objects % n_kinds
    rows = np.zeros((len(objects), 1))
    for _, test in ObjectKFold(n_folds).split(rows, groups=objects):
        shares = np.bincount(kind[test], minlength=n_kinds) / np.bincount(kind)
        assert shares.max() <= 0.6
        assert len(test) == len(objects) / n_folds


@pytest.mark.parametrize("learner", LEARNERS)
def test_names_of_objects_change_no_prediction(learner):
    model, X = LEARNERS[learner]
    names = np.array(RNG.permutation([f"object {i}" for i in range(20)]))
    proba = [
        clone(model).fit(X, COUNTS, groups=groups).predict_proba(X)
        for groups in (OBJECTS, names[OBJECTS], (-OBJECTS).astype(">i4"))
    ]
    np.testing.assert_array_equal(proba[0], proba[1])
    np.testing.assert_array_equal(proba[0], proba[2])


@pytest.mark.parametrize("learner", LEARNERS)
@pytest.mark.parametrize(
    ("cv", "message"),
    [
        ([(range(60), range(60))], "cv trains on 0 in the fold that tests it"),
        (list(KFold(7).split(X)), "in the fold that tests it; keep whole objects"),
        ([(range(30), range(30, 60))], "cv tests trial 0 0 times"),
        ([(range(30), range(30, 60))] * 2, r"cv tests trial \d+ [02] times"),
        ([], "cv has no folds"),
    ],
)
def test_folds_that_leak_or_are_incomplete_are_refused(learner, cv, message):
    model, X = LEARNERS[learner]
    with pytest.raises(ValueError, match=message):
        clone(model).set_params(cv=cv).fit(X, COUNTS, groups=OBJECTS)


def test_trials_that_a_fold_repeats_count_as_often():
    """As in a sample with replacement. Linear models are fitted together."""
    model, first, second = DistributionalOrdinalRegressor(), range(30), range(30, 60)
    folds = [([*first, *first[:9]], second), ([*second, *second[:15]], first)]
    pool = TouchPool([("linear", model, [0, 1])], cv=folds)
    found = pool.fit(X, COUNTS, groups=OBJECTS).oof_proba_[:, 0]
    for train, test in folds:
        expected = clone(model).fit(X[train], COUNTS[train]).predict_proba(X[test])
        np.testing.assert_allclose(found[test], expected, atol=1e-6)


@pytest.mark.parametrize("learner", LEARNERS)
def test_one_object_is_too_few(learner):
    model, X = LEARNERS[learner]
    with pytest.raises(ValueError, match="learns from held-out objects, but there is"):
        clone(model).fit(part(X, range(3)), COUNTS[:3], groups=[1, 1, 1])


def test_folds_of_labels_without_groups_have_all_labels():
    y = np.repeat(["cork", "foam", "tile"], 20)
    model = TouchPool([("a", LINEAR, [0])], cv=4)
    with pytest.warns(UserWarning, match="no groups"):
        folds, objects = make_folds(model, X, y, None, [LINEAR])
    np.testing.assert_array_equal(objects, np.arange(60))
    for _, test in check_folds(folds, 60):
        assert [(y[test] == name).sum() for name in np.unique(y)] == [5, 5, 5]


# Groups --------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*LEARNERS, *STOPPED])
@pytest.mark.filterwarnings("ignore:y does not name its levels")
def test_a_fit_that_needs_objects_says_so_in_one_sentence(name):
    model, trials = LEARNERS[name] if name in LEARNERS else (STOPPED[name], X)
    ratings = np.arange(60) % 5 + 1  # which tell no objects
    with pytest.warns(UserWarning, match="fit was given no groups") as caught:
        clone(model).fit(trials, ratings)
    sentence = f"{type(model).__name__}: {NO_GROUPS}"
    (warning,) = (each for each in caught if str(each.message) == sentence)
    assert warning.filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        clone(model).fit(trials, COUNTS, groups=OBJECTS)


@pytest.mark.parametrize(
    "model",
    [model for model, _ in LEARNERS.values()]
    + [*STOPPED.values(), ContinuousRatingsRegressor(), LINEAR],
    ids=lambda model: type(model).__name__,
)
def test_groups_are_requested_by_default(model):
    assert [*groups_for(model, OBJECTS)] == ["groups"]
    with config_context(enable_metadata_routing=True):
        assert [*groups_for(make_pipeline(model), OBJECTS)] == ["groups"]


@pytest.mark.parametrize("seed", range(3))
def test_objects_with_a_number_each_are_dealt_as_others(seed):
    """Materials in turn, as many as folds, are not held out whole."""
    objects = np.repeat(np.arange(20), 3)
    y = np.random.default_rng(seed).normal(size=20)[objects]
    rows = np.zeros((60, 1))
    for train, test in ObjectKFold(5).split(rows, y, objects):
        assert len({*objects[test]}) == 4
        assert {*objects[test] % 5} <= {*objects[train] % 5}
    of_numbers, others = (ObjectKFold(5).split(rows, t, objects) for t in (y, None))
    for (_, test), (_, other) in zip(of_numbers, others, strict=True):
        np.testing.assert_array_equal(test, other)


def test_models_that_cannot_be_asked_take_no_groups():
    """RidgeCV of scikit-learn 1.9 recurses without routing."""
    for model in (RidgeCV(), make_pipeline(RidgeClassifierCV()), AdaBoostClassifier()):
        assert groups_for(model, OBJECTS) == {}


def search(model, grid):
    return GridSearchCV(model, grid, cv=GroupKFold(2))


def test_groups_reach_what_asks_wherever_it_is():
    """Blends, pipelines and searches, with nothing but `groups`."""
    told = Told(strategy="prior")
    labels = np.arange(60) % 3
    blend = DistributionBlend([("linear", search(LINEAR, {"alpha": [1.0, 9.0]}))])
    inner = search(make_pipeline(StandardScaler(), told), {"told__strategy": ["prior"]})
    assert {*groups_for(inner, OBJECTS)} == {"groups", "told__groups"}
    assert {*groups_for(search(told, {}), OBJECTS)} == {"groups"}  # for the folds alone
    with pytest.warns(UserWarning, match="splits by trial"):
        assert groups_for(GridSearchCV(told, {}, cv=KFold(2)), OBJECTS) == {}
    for model, y in [
        (make_pipeline(StandardScaler(), told), labels),
        (inner, labels),
        (make_pipeline(StandardScaler(), blend), COUNTS),
        (make_pipeline(StandardScaler(), STOPPING), COUNTS),
        (TouchPool([("stops", make_pipeline(STOPPING), [0])]), COUNTS),
    ]:
        proba = cross_val_predict_proba(model, X, y, groups=OBJECTS, cv=2)
        assert proba.shape == (60, 3)
        with config_context(enable_metadata_routing=True):
            routed = cross_val_predict_proba(model, X, y, groups=OBJECTS, cv=2)
        np.testing.assert_array_equal(proba, routed)
    report = model_report(
        make_pipeline(StandardScaler(), blend), X, COUNTS, groups=OBJECTS, cv=2
    )
    assert len(report.tested) == 60


class Unset(LogisticRegression):
    """An own model, of which nobody said whether it requests groups."""

    def fit(self, X, y, groups=None):
        return super().fit(X, y)


@pytest.mark.parametrize("predict", [cross_val_predict_proba, model_report])
def test_routing_loses_no_groups_that_a_model_may_want(predict):
    X, y = np.arange(24.0)[:, None] % 5, np.arange(24) % 3
    model = make_pipeline(StandardScaler(), Unset())
    with config_context(enable_metadata_routing=True):
        with pytest.raises(UnsetMetadataPassedError, match="set_fit_request"):
            predict(model, X, y, groups=np.arange(24) // 2, cv=3)
        model[-1].set_fit_request(groups=False)
        predict(model, X, y, groups=np.arange(24) // 2, cv=3)


@pytest.mark.parametrize("routing", [False, True])
def test_a_search_that_divides_objects_is_named(routing):
    """Its scores tell how well it knows objects that it learned from."""
    report = partial(model_report, X=X, y=COUNTS, cv=2)
    by_trial = GridSearchCV(LINEAR, {"alpha": [1.0]}, cv=2)
    with config_context(enable_metadata_routing=routing):
        with pytest.warns(UserWarning, match="^GridSearchCV has cv=2, which"):
            report(by_trial, groups=OBJECTS)
        report(by_trial, groups=np.arange(60))
        report(search(LINEAR, {"alpha": [1.0]}), groups=OBJECTS)


def test_groups_reach_the_last_step_behind_sensors():
    table = pd.DataFrame(X, columns=["a", "b"])
    sensors = ColumnTransformer([(s, StandardScaler(), [s]) for s in "ab"])
    results = sensor_subsets(
        make_pipeline(sensors, STOPPING), table, COUNTS, groups=OBJECTS, cv=2
    )
    assert len(results["params"]) == 3


# Models --------------------------------------------------------------------------


@pytest.mark.parametrize("learner", ["blend", "pool", "guard", "anytime"])
def test_models_that_learned_before_are_named(learner):
    model, trials = LEARNERS[learner]
    frozen = FrozenEstimator(clone(LINEAR).fit(X, COUNTS))
    params = {
        "blend": {"linear": frozen},
        "pool": {"linear": frozen},
        "guard": {"estimator__nnpom": frozen},
        "anytime": {"estimator__nnpom": frozen},
    }
    if learner == "anytime":
        rows = TemporalMaxPool().fit_transform(TRIALS)
        frozen.estimator.fit(rows, COUNTS)
    model = clone(model).set_params(**params[learner])
    with pytest.warns(UserWarning, match="^What is frozen had learned before"):
        model.fit(trials, COUNTS, groups=OBJECTS)


def test_a_frozen_model_out_of_fold_is_named():
    frozen = FrozenEstimator(clone(LINEAR).fit(X, COUNTS))
    with pytest.warns(UserWarning, match="^What is frozen had learned before"):
        cross_val_predict_proba(frozen, X, COUNTS, groups=OBJECTS, cv=2)


def test_frozen_networks_of_sensors_and_candidates_are_named():
    fusion = SensorFusionNNPOM({"a": [0], "b": [1]}, NNPOM(2, random_state=0))
    model = DistributionalOrdinalRegressor(fusion, random_state=0)
    networks = clone(model).fit(X, COUNTS).estimator_.sensor_networks_
    networks = {name: FrozenEstimator(network) for name, network in networks.items()}
    model.set_params(estimator__estimator=networks)
    candidates = [FrozenEstimator(clone(LINEAR).fit(X, COUNTS)), LINEAR]
    search = GridSearchCV(
        make_pipeline(LINEAR),
        {"nnpom": candidates},
        scoring=neg_rps_scorer,
        cv=GroupKFold(2),
    )
    for each in (model, search):
        with pytest.warns(UserWarning, match="^What is frozen had learned before"):
            cross_val_predict_proba(each, X, COUNTS, groups=OBJECTS, cv=2)
    report = model_report(model, X, COUNTS, groups=OBJECTS, cv=2)
    assert "What is frozen had learned before" in " ".join(str(report).split())
    with pytest.warns(UserWarning, match="^What is frozen had learned before"):
        sensor_contributions(model, X, COUNTS, groups=OBJECTS, cv=2, n_repeats=1)


@pytest.mark.parametrize("odd", ["drop", None, 3])
@pytest.mark.parametrize("learner", ["blend", "pool"])
def test_members_that_are_none_are_refused(learner, odd):
    model, trials = LEARNERS[learner]
    columns = [[0]] if learner == "pool" else []
    model = clone(model).set_params(
        estimators=[("a", LINEAR, *columns), ("b", odd, *columns)]
    )
    with pytest.raises(ValueError, match=f"The member 'b' is {odd!r}; give an estim"):
        model.fit(trials, COUNTS, groups=OBJECTS)


@pytest.mark.parametrize("member", [LogisticRegression(), KNeighborsClassifier()])
@pytest.mark.parametrize("learner", ["blend", "pool"])
def test_members_that_take_no_counts_are_refused(learner, member):
    model, trials = LEARNERS[learner]
    columns = [[0]] if learner == "pool" else []
    model = clone(model).set_params(estimators=[("b", member, *columns)])
    with pytest.raises(ValueError, match=r"^The member 'b', a .* takes? .*counts|own"):
        model.fit(trials, COUNTS, groups=OBJECTS)


def test_members_of_reversed_levels_are_refused():
    """Columns without labels ascend, so that these would be exchanged."""
    model, trials = LEARNERS["blend"]
    model = clone(model).set_params(linear__levels=[3, 2, 1])
    with pytest.raises(ValueError, match=r"'linear' has the levels \[3, 2, 1\], but"):
        model.fit(trials, COUNTS, groups=OBJECTS)


def test_models_of_folds_are_kept():
    y = np.arange(60) % 3
    folds = list(GroupKFold(3).split(X, groups=OBJECTS))
    tasks = [Task("a", LogisticRegression(), X, y, fold, {}) for fold in folds]
    kept = run_tasks(tasks, None)
    lost = run_tasks(tasks, np.arange(3))
    for (model, nothing), (none, proba), (train, test) in zip(kept, lost, folds):
        alone = LogisticRegression().fit(X[train], y[train])
        np.testing.assert_array_equal(model.coef_, alone.coef_)
        np.testing.assert_array_equal(proba, alone.predict_proba(X[test]))
        assert none is None and nothing is None


def test_classes_are_put_in_place():
    proba = np.array([[[0.25, 0.75]]])
    known, classes = np.array(["foam", "cork"]), np.array(["cork", "tile", "foam"])
    placed = at_classes(proba, known, classes)
    np.testing.assert_array_equal(placed, [[[0.75, 0, 0.25]]])


@pytest.mark.parametrize("n_classes, n_folds", [(5, 5), (10, 5), (3, 3)])
def test_objects_of_classes_in_turn(n_classes, n_folds):
    """Every fold trains on every class, whatever the classes are called."""
    objects = np.repeat(np.arange(3 * n_classes), 2)
    y = objects % n_classes
    rows = np.zeros((len(y), 1))
    folds = list(ObjectKFold(n_folds).split(rows, y, objects))
    for train, test in folds:
        assert {*y[train]} == {*y} and {*objects[train]}.isdisjoint(objects[test])
    words = np.array([*"jihgfedcba"])[y]
    for named in words, words[:, None], words.tolist(), pd.Series(words):
        for one, other in zip(folds, ObjectKFold(n_folds).split(rows, named, objects)):
            np.testing.assert_array_equal(one[1], other[1])
    answers = [[1.0], [2.0, 3.0], [4.0]] * (2 * n_classes)  # on sliders, of no label
    several = ObjectKFold(n_folds).split(rows, answers, objects)
    for one, other in zip(several, ObjectKFold(n_folds).split(rows, None, objects)):
        np.testing.assert_array_equal(one[1], other[1])
