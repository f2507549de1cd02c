"""Predictions out of fold, compared with a loop over the folds written by hand."""

import numpy as np
import pandas as pd
import polars as pl
import pytest
from callback_recorder import Recorder
from sklearn import config_context
from sklearn.base import BaseEstimator, ClassifierMixin, clone
from sklearn.compose import ColumnTransformer
from sklearn.ensemble import RandomForestClassifier, VotingClassifier
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import (
    GridSearchCV,
    GroupKFold,
    KFold,
    LeaveOneGroupOut,
    RepeatedKFold,
    ShuffleSplit,
    StratifiedKFold,
    TimeSeriesSplit,
)
from sklearn.multiclass import OneVsRestClassifier
from sklearn.pipeline import Pipeline, make_pipeline

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    SensorFusionNNPOM,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_rps_scorer
from sklearn_haptic.model_selection import (
    cross_val_predict_proba,
    sensor_contributions,
    sensor_subsets,
)

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("one_thread")]


def rated(n_objects=12, n_trials=3, n_people=12, noise=0.3):
    """Features, counts of how people feel about the first, and shuffled objects."""
    rng = np.random.default_rng(0)
    feel = rng.normal(size=n_objects)
    objects = rng.permutation(np.repeat(np.arange(n_objects), n_trials))
    X = rng.normal(scale=noise, size=(len(objects), 3))
    X[:, 0] += feel[objects]
    share = np.exp(-((np.arange(5) - 2 - 1.5 * feel[:, None]) ** 2))
    counts = rng.multinomial(n_people, share / share.sum(axis=1, keepdims=True))
    return X, counts[objects], objects


X, COUNTS, OBJECTS = rated()
TARGETS = {
    "labels": np.array([3, 5, 9])[np.arange(36) % 3],  # levels with gaps
    "words": pd.Series(
        np.where(COUNTS.argmax(axis=1) > 2, "even", "rough"),
        dtype=pd.CategoricalDtype(["rough", "even"], ordered=True),
    ),
    "counts": COUNTS,
    "shares": COUNTS / 12,
    "adjectives": np.stack([COUNTS, COUNTS[:, ::-1]], axis=1),
}
REGRESSOR = DistributionalOrdinalRegressor(NNPOM(2, alpha=3.0, random_state=0))


def take(values, rows):
    """Rows of any container."""
    if hasattr(values, "iloc"):
        return values.iloc[rows]
    if isinstance(values, (np.ndarray, pl.DataFrame)):
        return values[rows]
    return [values[row] for row in rows]


def whole_objects(objects, n_folds, y=()):
    """Folds of whole objects, dealt out in one random order.

    Those of each label come one after the other, if each object has a single one, and
    labels as they first occur in that order.
    """
    numbers, y = pd.factorize(np.asarray(objects))[0], list(y)
    order = np.random.RandomState(0).permutation(max(numbers) + 1).tolist()
    if len({*zip(numbers, y)}) == len({*numbers}):
        label = dict(zip(numbers, y))
        first = [label[number] for number in order]
        order.sort(key=lambda number: first.index(label[number]))
    numbers = np.array([order.index(number) for number in numbers])
    for train, test in GroupKFold(n_folds).split(objects, groups=numbers):
        assert set(np.take(objects, train)).isdisjoint(np.take(objects, test))
        yield train, test


def by_hand(estimator, X, y, folds, method="predict_proba", **fit):
    """Fit and predict fold by fold, row by row in the order given."""
    rows = {}
    for train, test in folds:
        params = {name: np.asarray(value)[train] for name, value in fit.items()}
        model = clone(estimator).fit(take(X, train), take(y, train), **params)
        rows.update(zip(test, getattr(model, method)(take(X, test))))
    return np.array([rows[i] for i in range(len(rows))])


@pytest.mark.parametrize("method", ["predict_proba", "predict_cdf", "predict"])
@pytest.mark.parametrize("target", TARGETS)
def test_equals_a_loop(target, method):
    y = TARGETS[target]
    predicted = cross_val_predict_proba(
        REGRESSOR, X, y, groups=OBJECTS, cv=3, method=method
    )
    labels = y if np.ndim(y) == 1 else ()
    expected = by_hand(REGRESSOR, X, y, whole_objects(OBJECTS, 3, labels), method)
    np.testing.assert_array_equal(predicted, expected)


def test_objects_among_the_arguments_of_fit_stay_whole():
    """Whether they are the model's or those of a step."""
    expected = cross_val_predict_proba(REGRESSOR, X, COUNTS, groups=OBJECTS, cv=3)
    for model, name in (
        (REGRESSOR, "groups"),
        (Pipeline([("model", REGRESSOR)]), "model__groups"),
    ):
        given = cross_val_predict_proba(model, X, COUNTS, cv=3, params={name: OBJECTS})
        np.testing.assert_array_equal(given, expected)


@pytest.mark.parametrize("of", ["counts", "labels"])
def test_levels_that_fall_are_told_of(of):
    """As grades from 6, the worst, to 1: scores read labels and columns as rising."""
    grades = pd.Series(np.r_[1:7, 1:7, 1:7])
    y = pd.get_dummies(grades, dtype=int) if of == "counts" else grades
    X, objects = grades.to_numpy()[:, None], np.repeat([0, 1, 2], 6)
    model = DistributionalOrdinalRegressor(levels=[6, 5, 4, 3, 2, 1])
    with pytest.warns(UserWarning, match=r"\[6, 5, 4, 3, 2, 1\], which y does not"):
        proba = cross_val_predict_proba(model, X, y, groups=objects, cv=3)
    assert (proba.argmax(axis=1) == 6 - grades).all()


CONTAINERS = {
    "list": lambda a: a.tolist(),
    "DataFrame": lambda a: pd.DataFrame(a, columns=list("abc"), index=OBJECTS),
    "polars": lambda a: pl.DataFrame(a, schema=list("abc")),
    "objects": lambda a: a.astype(object),
    "float32": lambda a: a.astype(np.float32),
}


@pytest.mark.parametrize("container", CONTAINERS)
def test_containers_of_features(container):
    rows = CONTAINERS[container](X)
    predicted = cross_val_predict_proba(REGRESSOR, rows, COUNTS, groups=OBJECTS)
    expected = by_hand(REGRESSOR, rows, COUNTS, whole_objects(OBJECTS, 5))
    np.testing.assert_array_equal(predicted, expected)


@pytest.mark.parametrize("container", [np.ndarray.tolist, pd.DataFrame])
def test_containers_of_counts_and_groups(container):
    groups = [f"object {name}" for name in OBJECTS]
    y = container(COUNTS)
    predicted = cross_val_predict_proba(REGRESSOR, X, y, groups=pd.Series(groups))
    expected = by_hand(REGRESSOR, X, y, whole_objects(np.array(groups), 5))
    np.testing.assert_array_equal(predicted, expected)


@pytest.mark.parametrize("output", ["default", "pandas", "polars"])
def test_recordings_of_several_sensors_in_processes(output):
    sensors = ["pdc", "tdc"]
    corpus = make_haptic_corpus(6, 2, sensors=sensors, random_state=0)
    counts, order = corpus.ratings["hard"], np.random.default_rng(0).permutation(12)
    trials, y, objects = corpus.trials.iloc[order], counts[order], corpus.objects[order]
    model = make_haptic_pipeline(sensors, random_state=0)
    with config_context(transform_output=output):
        expected = by_hand(model, trials, y, whole_objects(objects, 3))
        for n_jobs in (1, 2):
            predicted = cross_val_predict_proba(
                model, trials, y, groups=objects, cv=3, n_jobs=n_jobs
            )
            np.testing.assert_array_equal(predicted, expected)
    with pytest.raises(NotFittedError):
        model.predict(trials)  # the model itself stays as it was


@pytest.mark.parametrize("n_objects, n_trials", [(2, 1), (500, 10)])
def test_few_and_many_trials(n_objects, n_trials):
    rows, counts, objects = rated(n_objects, n_trials)
    model = DistributionalOrdinalRegressor()
    predicted = cross_val_predict_proba(model, rows, counts, groups=objects, cv=2)
    expected = by_hand(model, rows, counts, whole_objects(objects, 2))
    np.testing.assert_array_equal(predicted, expected)


class TestFolds:
    def test_groups_are_kept_together_by_default(self):
        expected = by_hand(REGRESSOR, X, COUNTS, whole_objects(OBJECTS, 5))
        for options in ({"groups": OBJECTS}, {"groups": OBJECTS, "cv": np.int64(5)}):
            predicted = cross_val_predict_proba(REGRESSOR, X, COUNTS, **options)
            np.testing.assert_array_equal(predicted, expected)

    @pytest.mark.parametrize(
        "target, splitter", [("labels", StratifiedKFold(5)), ("counts", KFold(5))]
    )
    def test_without_groups_folds_are_those_of_a_search(self, target, splitter):
        y = TARGETS[target]
        folds = splitter.split(X, y)
        expected = by_hand(REGRESSOR, X, y, folds)
        predicted = cross_val_predict_proba(REGRESSOR, X, y)
        np.testing.assert_array_equal(predicted, expected)

    @pytest.mark.parametrize("form", [list, iter, "masks"])
    def test_given_folds(self, form):
        folds = list(whole_objects(OBJECTS, 3))
        expected = by_hand(REGRESSOR, X, COUNTS, folds)
        if form == "masks":
            rows = np.arange(len(X))
            given = [tuple(np.isin(rows, part) for part in fold) for fold in folds]
        else:
            given = form([(train.tolist(), test[::-1]) for train, test in folds])
        predicted = cross_val_predict_proba(REGRESSOR, X, COUNTS, cv=given)
        np.testing.assert_array_equal(predicted, expected)

    def test_each_object_alone(self):
        folds = [(name != OBJECTS, name == OBJECTS) for name in np.unique(OBJECTS)]
        folds = [tuple(map(np.flatnonzero, fold)) for fold in folds]
        expected = by_hand(DummyDistribution(), X, COUNTS, folds)
        predicted = cross_val_predict_proba(
            DummyDistribution(), X, COUNTS, groups=OBJECTS, cv=LeaveOneGroupOut()
        )
        np.testing.assert_array_equal(predicted, expected)

    @pytest.mark.parametrize(
        "cv, message",
        [
            (TimeSeriesSplit(3), "tests trial 0 0 times; choose a splitter"),
            (RepeatedKFold(n_splits=3, n_repeats=2), "tests trial 0 2 times"),
            (ShuffleSplit(1, random_state=0), "tests trial 0 0 times"),
            ([(np.arange(36), np.arange(36))], "trains on trial 0 in the fold that"),
            ([(np.arange(1, 36), [0, 0])], "tests trial 0 2 times"),
        ],
    )
    def test_folds_that_are_no_partition_are_refused(self, cv, message):
        with pytest.raises(ValueError, match=f"^cv {message}"):
            cross_val_predict_proba(REGRESSOR, X, COUNTS, cv=cv)

    def test_folds_that_divide_objects_are_warned_of(self):
        folds = list(KFold(3).split(X))
        divided = "^cv trains on some trials and tests others of "
        with pytest.warns(UserWarning, match=divided) as warned:
            proba = cross_val_predict_proba(
                REGRESSOR, X, COUNTS, groups=OBJECTS, cv=folds
            )
        assert warned[0].filename == __file__
        np.testing.assert_array_equal(proba, by_hand(REGRESSOR, X, COUNTS, folds))
        fusion = DistributionalOrdinalRegressor(
            SensorFusionNNPOM({"a": [0], "b": [1, 2]})
        )
        with pytest.warns(UserWarning, match=divided) as warned:
            sensor_contributions(
                fusion, X, COUNTS, groups=OBJECTS, cv=folds[:1], n_repeats=1
            )
        assert warned[0].filename == __file__
        columns = [("a", "passthrough", [0]), ("b", "passthrough", [1, 2])]
        model = make_pipeline(ColumnTransformer(columns), REGRESSOR)
        with pytest.warns(UserWarning, match=divided) as warned:
            sensor_subsets(model, X, COUNTS, groups=OBJECTS, cv=folds)
        assert warned[0].filename == __file__


class TestLevels:
    """Level 5 was given to one object alone, which no model of its fold has seen."""

    labels = np.where(OBJECTS == 3, 5, 1 + OBJECTS % 4)

    @pytest.mark.parametrize("method", ["predict_proba", "predict_cdf", "predict"])
    def test_labels_are_the_same_as_counts_of_one_rating(self, method):
        counts = (self.labels[:, None] == np.arange(1, 6)).astype(int)
        options = {"groups": OBJECTS, "cv": LeaveOneGroupOut(), "method": method}
        from_labels = cross_val_predict_proba(REGRESSOR, X, self.labels, **options)
        from_counts = cross_val_predict_proba(REGRESSOR, X, counts, **options)
        np.testing.assert_allclose(from_labels, from_counts, atol=1e-12)

    @pytest.mark.parametrize("names", [[1, 2, 3, 4, 5], [2, 3, 5, 8, 9], list("abcde")])
    @pytest.mark.parametrize("levels_in_order", [[1, 2, 3, 4, 5], [5, 2, 3, 4, 1]])
    def test_an_unseen_level_has_probability_zero(self, names, levels_in_order):
        labels = np.take(names, np.take(levels_in_order, self.labels - 1) - 1)
        proba = cross_val_predict_proba(
            LogisticRegression(), X, labels, groups=OBJECTS, cv=LeaveOneGroupOut()
        )
        assert proba.shape == (36, 5)
        np.testing.assert_allclose(proba.sum(axis=1), 1)
        unseen = levels_in_order[4] - 1
        here = OBJECTS == 3
        assert (proba[here, unseen] == 0).all()
        assert (proba[~here] > 0).all()
        train, test = np.flatnonzero(~here), np.flatnonzero(here)
        expected = LogisticRegression().fit(X[train], labels[train])
        np.testing.assert_array_equal(
            np.delete(proba[test], unseen, axis=1), expected.predict_proba(X[test])
        )

    def test_a_level_that_no_fold_trains_on_has_a_column(self):
        train, test = np.flatnonzero(OBJECTS != 3), np.arange(36)
        folds = [(np.setdiff1d(train, part), part) for part in np.array_split(test, 4)]
        proba = cross_val_predict_proba(LogisticRegression(), X, self.labels, cv=folds)
        assert proba.shape == (36, 5)
        assert (proba[:, 4] == 0).all()

    def test_levels_of_the_estimator_have_columns(self):
        model = clone(REGRESSOR).set_params(levels=np.arange(8))
        proba = cross_val_predict_proba(model, X, self.labels, groups=OBJECTS)
        assert proba.shape == (36, 8)
        folds = whole_objects(OBJECTS, 5, self.labels)
        np.testing.assert_array_equal(proba, by_hand(model, X, self.labels, folds))

    def test_what_an_estimator_says_of_counts_is_passed_on(self):
        model = NNPOM(1, early_stopping=True)
        with pytest.raises(ValueError, match=r"^Early stopping holds out"):
            cross_val_predict_proba(model, X, COUNTS, groups=OBJECTS > 3, cv=2)

    def test_estimators_that_take_counts_for_labels_are_refused(self):
        forest = RandomForestClassifier(2, random_state=0)
        network = OneVsRestClassifier(LogisticRegression())
        for model in (forest, network):
            with pytest.raises(ValueError, match="as if it took each column of y"):
                cross_val_predict_proba(model, X, (COUNTS > 2).astype(int), cv=2)

    def test_folds_may_lack_different_words(self):
        """scikit-learn sorts words by the alphabet, the categories do not."""
        words = ["soft", "medium", "hard", "rock"]
        kind = np.repeat([0, 1, 1, 2, 2, 3], 4)
        y = pd.Series(pd.Categorical.from_codes(kind, words, ordered=True))
        first = np.repeat([True, True, False, True, False, False], 4)
        folds = [(np.flatnonzero(~first), np.flatnonzero(first))]
        folds.append(folds[0][::-1])
        proba = cross_val_predict_proba(
            LogisticRegression(), kind[:, np.newaxis], y, cv=folds
        )
        assert proba.shape == (24, 4)
        assert (proba[first, 0] == 0).all() and (proba[~first, 3] == 0).all()
        known = np.isin(kind, [1, 2])
        assert (proba[known].argmax(axis=1) == kind[known]).all()


class Noted(ClassifierMixin, BaseEstimator):
    """Keeps what `fit` is given, and predicts the sum of the weights."""

    def fit(self, X, y, sample_weight=None, *, groups=None):
        self.classes_ = np.array([1])
        self.total_ = np.sum(sample_weight) if sample_weight is not None else -1.0
        self.n_groups_ = -1.0 if groups is None else len(np.unique(groups))
        return self

    def predict(self, X):
        return np.tile([self.total_, self.n_groups_], (len(X), 1))

    predict_proba = predict


class TestParams:
    weight = np.random.default_rng(3).uniform(size=36)

    @pytest.mark.parametrize("routing", [False, True])
    def test_what_goes_to_fit_is_that_of_the_training_trials(self, routing):
        params = {"sample_weight": self.weight, "groups": OBJECTS}
        with config_context(enable_metadata_routing=routing):
            model = Noted()
            if routing:
                model.set_fit_request(sample_weight=True, groups=True)
            predicted = cross_val_predict_proba(
                model, X, COUNTS, groups=OBJECTS, cv=3, params=params, method="predict"
            )
        for train, test in whole_objects(OBJECTS, 3):
            np.testing.assert_allclose(predicted[test, 0], self.weight[train].sum())
            np.testing.assert_array_equal(predicted[test, 1], 8)

    def test_groups_go_to_fit_unless_refused(self):
        options = {"groups": OBJECTS, "cv": 3, "method": "predict"}
        predicted = cross_val_predict_proba(Noted(), X, COUNTS, **options)
        np.testing.assert_array_equal(predicted[:, 1], 8)
        with config_context(enable_metadata_routing=True):
            model = Noted().set_fit_request(groups=False)
            predicted = cross_val_predict_proba(model, X, COUNTS, **options)
            np.testing.assert_array_equal(predicted[:, 1], -1)

    @pytest.mark.parametrize("routing", [False, True])
    def test_groups_in_params_split_too(self, routing):
        with config_context(enable_metadata_routing=routing):
            model = Noted()
            if routing:
                model.set_fit_request(groups=True)
            predicted = cross_val_predict_proba(
                model, X, COUNTS, cv=3, params={"groups": OBJECTS}, method="predict"
            )
        np.testing.assert_array_equal(predicted[:, 1], 8)

    @pytest.mark.parametrize("routing", [False, True])
    def test_early_stopping_on_whole_objects(self, routing):
        model = DistributionalOrdinalRegressor(**PAPER_2020, random_state=0)
        model.set_params(estimator__max_iter=20, estimator__n_hidden=2)
        folds = whole_objects(OBJECTS, 3)
        expected = by_hand(model, X, COUNTS, folds, groups=OBJECTS)
        with config_context(enable_metadata_routing=routing):
            predicted = cross_val_predict_proba(model, X, COUNTS, groups=OBJECTS, cv=3)
        np.testing.assert_array_equal(predicted, expected)


def test_groups_stay_with_the_folds_of_ensembles_that_cannot_hand_them_on():
    y = np.arange(len(X)) % 3
    member = DistributionalOrdinalRegressor()
    voting = VotingClassifier([("one", member)], voting="soft")
    proba = cross_val_predict_proba(voting, X, y, groups=OBJECTS, cv=3)
    np.testing.assert_allclose(
        proba, cross_val_predict_proba(member, X, y, groups=OBJECTS, cv=3)
    )


def test_a_search_predicts_the_objects_held_out_of_it():
    def search(n_folds):
        grid = {"estimator__alpha": [0.1, 10.0]}
        cv = GroupKFold(n_folds)
        return GridSearchCV(REGRESSOR, grid, scoring=neg_rps_scorer, cv=cv)

    predicted = cross_val_predict_proba(search(2), X, COUNTS, groups=OBJECTS, cv=3)
    folds = whole_objects(OBJECTS, 3)
    expected = by_hand(search(2), X, COUNTS, folds, groups=OBJECTS)
    np.testing.assert_array_equal(predicted, expected)


def test_progress_is_that_of_the_callbacks_of_the_estimator():
    recorder = Recorder()
    model = NNPOM(2, max_iter=3, tol=10.0).set_callbacks(recorder)
    cross_val_predict_proba(model, X, COUNTS, groups=OBJECTS, cv=3)
    assert recorder.tasks.count("teardown") == 3  # a fit each fold
    with pytest.raises(NotFittedError):
        model.predict(X)


def test_a_table_of_one_column_is_that_column():
    words = ["soft", "medium", "hard"]
    kind = np.arange(len(X)) % 3
    y = pd.Series(pd.Categorical.from_codes(kind, words, ordered=True), name="feel")
    model = LogisticRegression()
    expected = cross_val_predict_proba(model, X, y, groups=OBJECTS, cv=3)
    found = cross_val_predict_proba(model, X, y.to_frame(), groups=OBJECTS, cv=3)
    np.testing.assert_array_equal(found, expected)
