"""The cost of a candidate is that of its use: caches and fits have no part in it."""

import time
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from joblib import Memory
from sklearn.base import BaseEstimator, ClassifierMixin, TransformerMixin
from sklearn.callback import ProgressBar
from sklearn.compose import ColumnTransformer
from sklearn.ensemble import RandomForestClassifier
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.utils.validation import check_memory

from sklearn_haptic import TemporalMaxPool, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_rps_scorer
from sklearn_haptic.model_selection import (
    cheapest_within_one_se,
    neg_seconds_scorer,
    sensor_subsets,
    speed_accuracy_frontier,
)
from sklearn_haptic.model_selection._cost import without_caches
from sklearn_haptic.streaming._branches import Branch

CLOCK = SimpleNamespace(now=0.0)


def code(X, seconds):
    """Code a row in so many seconds of a clock that nothing else moves."""
    CLOCK.now += seconds * len(X)
    return np.asarray(X)


class Features(TransformerMixin, BaseEstimator):
    """Features that take a while, but for those in a cache."""

    def __init__(self, seconds=1.0, memory=None):
        self.seconds = seconds
        self.memory = memory

    def fit(self, X, y=None):
        self.fitted_ = True
        return self

    def transform(self, X):
        return check_memory(self.memory).cache(code)(X, self.seconds)


class Head(ClassifierMixin, BaseEstimator):
    """Predicts the same for all; `loss` is how much it is worse in one fold."""

    def __init__(self, seconds=0.0, loss=0.0):
        self.seconds = seconds
        self.loss = loss

    def fit(self, X, y):
        self.classes_ = np.array([1, 2])
        return self

    def predict_proba(self, X):
        CLOCK.now += self.seconds * len(X)
        return np.tile([0.5 + self.loss, 0.5 - self.loss], (len(X), 1))

    def predict(self, X):
        return self.predict_proba(X).argmax(axis=1)


X, COUNTS = np.arange(40.0).reshape(20, 2), np.tile([[1, 3]], (20, 1))


@pytest.fixture
def clock(monkeypatch):
    """A clock that only the work of the steps moves, for scikit-learn too."""
    monkeypatch.setattr(time, "perf_counter", lambda: CLOCK.now)
    monkeypatch.setattr(time, "time", lambda: CLOCK.now)


def search_heads(cache, grid, **options):
    model = make_pipeline(Features(memory=cache), Head())
    scoring = {"rps": neg_rps_scorer, "neg_seconds": neg_seconds_scorer}
    options = {"scoring": scoring, "refit": cheapest_within_one_se} | options
    return GridSearchCV(
        model, {f"head__{k}": v for k, v in grid.items()}, cv=4, **options
    )


@pytest.mark.slow
@pytest.mark.parametrize("cached", [False, True])
@pytest.mark.parametrize("seconds", [[0.25, 0.5], [0.5, 0.25]])
def test_the_first_candidate_does_not_pay_for_all(clock, tmp_path, cached, seconds):
    cache = Memory(tmp_path, verbose=0) if cached else None
    search = search_heads(cache, {"seconds": seconds}).fit(X, COUNTS)
    assert search.best_params_ == {"head__seconds": 0.25}
    expected = -1 - np.array(seconds)  # a second for the features of each trial
    np.testing.assert_allclose(search.cv_results_["mean_test_neg_seconds"], expected)
    frontier = speed_accuracy_frontier(search)
    assert frontier["param_head__seconds"].tolist() == [0.25]
    np.testing.assert_allclose(frontier["seconds"], [1.25])


def test_candidates_up_to_a_tenth_slower_go_by_score():
    def results(seconds):
        columns = {"rps": [-0.5, -0.4], "neg_seconds": np.negative(seconds)}
        spread = {"rps": 0.5, "neg_seconds": 0.0}  # of the two splits
        return {
            f"{prefix}_test_{name}": np.add(column, sign * spread[name])
            for name, column in columns.items()
            for prefix, sign in [("split0", -1), ("split1", 1), ("mean", 0)]
        }

    assert cheapest_within_one_se(results([10, 10.9])) == 1
    assert cheapest_within_one_se(results([10, 11.1])) == 0


def test_a_sleeping_predictor_costs_what_it_sleeps():
    class Sleeper(Head):
        def predict_proba(self, X):
            time.sleep(self.seconds * len(X))
            return super().predict_proba(X)

    for seconds in (0.001, 0.01):
        model = Sleeper(seconds).fit(X, COUNTS)
        assert seconds <= -neg_seconds_scorer(model, X) < seconds + 0.1


@pytest.mark.parametrize("n_trials", [1, 3, 5, 5_000])
@pytest.mark.parametrize("container", [np.array, list, tuple, pd.DataFrame])
def test_up_to_five_single_trials_are_timed(clock, n_trials, container):
    asked = []

    class Asked(Head):
        def predict_proba(self, X):
            asked.append(np.asarray(X))
            CLOCK.now += [4.0, 2.0][len(asked) % 2]
            return super().predict_proba(X)

    rows = np.arange(2.0 * n_trials).reshape(n_trials, 2)
    assert neg_seconds_scorer(Asked(), container(rows)) == pytest.approx(-2)
    seen = np.concatenate(asked)[::2]
    assert len(asked) == 2 * len(seen) == 2 * min(n_trials, 5)
    assert seen[0, 0] == 0
    assert seen[-1, 0] == rows[-1, 0]


def test_without_predict_proba_predict_is_timed(clock):
    class Labels(BaseEstimator):
        def predict(self, X):
            CLOCK.now += 3
            return np.ones(len(X))

    assert neg_seconds_scorer(Labels(), X) == -3


def test_caches_of_fitted_parts_are_off_in_the_copy_alone(tmp_path):
    corpus = make_haptic_corpus(4, 2, sensors=["pdc"], random_state=0)
    model = make_haptic_pipeline(["pdc"], memory=str(tmp_path), random_state=0)
    model.set_params(memory=str(tmp_path)).fit(corpus.trials, corpus.ratings["hard"])

    def caches(model):
        coder, pool = model[0].transformers_[0][1]["codes"]
        return [model.memory, coder.memory, pool.memory]

    def entries():
        return sorted(tmp_path.rglob("*"))

    before = caches(model), entries()
    assert caches(without_caches(model)) == [None, None, None]
    expected = model.predict_proba(corpus.trials)
    before = caches(model), entries()
    assert neg_seconds_scorer(model, corpus.trials) < 0
    assert (caches(model), entries()) == before
    np.testing.assert_array_equal(
        without_caches(model).predict_proba(corpus.trials), expected
    )


def test_copies_of_estimators_without_caches_predict_the_same():
    labels = np.tile([1, 2], 10)
    forest = RandomForestClassifier(5, random_state=0)
    model = make_pipeline(ColumnTransformer([("a", Features(), [0, 1])]), forest)
    search = GridSearchCV(model, {"randomforestclassifier__max_depth": [1, 2]}, cv=2)
    search.set_callbacks(ProgressBar()).fit(X, labels)
    copied = without_caches(search)
    np.testing.assert_array_equal(copied.predict_proba(X), search.predict_proba(X))
    assert copied.best_estimator_ is not search.best_estimator_


@pytest.mark.slow
def test_sensor_subsets_have_the_same_cost_with_a_cache(clock, tmp_path):
    table = pd.DataFrame(X, columns=["pac", "pdc"])
    costs = []
    for memory in (None, Memory(tmp_path, verbose=0)):
        steps = [
            ("pac", Features(4.0, memory), ["pac"]),
            ("pdc", Features(1.0, memory), ["pdc"]),
        ]
        model = make_pipeline(ColumnTransformer(steps), Head(0.5))
        for _ in range(2):  # the second time all features are in the cache
            results = sensor_subsets(model, table, COUNTS, scoring=neg_rps_scorer)
            costs.append(results["mean_test_neg_seconds"])
    np.testing.assert_allclose(costs, [[-4.5, -1.5, -5.5]] * 4)
    assert cheapest_within_one_se(results) == 1


def test_caches_are_off_inside_named_tuples(tmp_path):
    """As in the branches of an `AnytimeRegressor`."""
    held = Branch(TemporalMaxPool(memory=str(tmp_path)), "pdc")
    copied = without_caches([held])[0]
    assert copied.transformer.memory is None and copied.columns == "pdc"
    assert held.transformer.memory == str(tmp_path)
