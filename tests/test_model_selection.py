import pickle
import time
import warnings
from functools import partial

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import sem
from sklearn import config_context
from sklearn.base import clone
from sklearn.compose import ColumnTransformer
from sklearn.decomposition import PCA
from sklearn.exceptions import NotFittedError
from sklearn.experimental import enable_halving_search_cv  # noqa: F401
from sklearn.linear_model import LogisticRegression, Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold, HalvingGridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, OneHotEncoder, StandardScaler

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_macro_mae_scorer, neg_rps_scorer
from sklearn_haptic.model_selection import (
    cheapest_within_one_se,
    neg_seconds_scorer,
    sensor_subsets,
    speed_accuracy_frontier,
)
from sklearn_haptic.model_selection._frontier import is_non_dominated
from sklearn_haptic.utils._folds import ObjectKFold

pytestmark = pytest.mark.slow


def make_results(seconds, splits, metric="score", **more):
    """What a search stores, from the time and the split scores a candidate."""
    splits = np.asarray(splits, dtype=float)
    seconds = np.broadcast_to(np.transpose([seconds]), splits.shape)
    return {
        "params": [{"size": i} for i in range(len(splits))],
        **split_results(metric, splits),
        **split_results("neg_seconds", -seconds.astype(float)),
        **more,
    }


def split_results(metric, splits):
    return {
        **{f"split{k}_test_{metric}": column for k, column in enumerate(splits.T)},
        f"mean_test_{metric}": splits.mean(axis=1),
    }


RESULTS_SE = np.sqrt(4 / 4 / 5)  # of 4, 4, 6, 6, 5, the scores of the best

DATA = st.lists(st.tuples(st.integers(0, 6), st.integers(-3, 3)), min_size=1)


@given(DATA)
def test_non_dominated_equals_brute_force(pairs):
    cost, score = np.array(pairs, dtype=float).T
    brute = [
        not any(c <= a and s >= b and (c < a or s > b) for c, s in pairs)
        for a, b in pairs
    ]
    assert_array_equal(is_non_dominated(cost, score), brute)


@given(DATA)
def test_frontier_is_sorted_and_nothing_outside_beats_it(pairs):
    seconds, score = np.array(pairs, dtype=float).T + np.array([[1], [0]])
    table = speed_accuracy_frontier(make_results(seconds, np.tile(score, (2, 1)).T))
    assert (np.diff(table["seconds"]) >= 0).all()
    assert (np.diff(table["score"]) >= 0).all()
    for s, q in zip(seconds, score):
        assert ((table["seconds"] <= s) & (table["score"] >= q)).any()


def test_table_by_hand():
    results = make_results([3, 1, 2, 1.5], [[5, 7], [1, 2], [3, 4], [1, 1]], "rps")
    table = speed_accuracy_frontier(results)
    assert table.columns.tolist() == ["param_size", "seconds", "score", "score_se"]
    assert table.index.tolist() == table["param_size"].tolist() == [1, 2, 0]
    assert table["seconds"].tolist() == [1, 2, 3]
    assert table["score"].tolist() == [1.5, 3.5, 6]
    assert_allclose(table["score_se"], [0.5, 0.5, 1])


def test_a_table_that_was_sorted_or_filtered():
    """Rows are told by their position, whatever the index of the table."""
    results = make_results([3, 1, 2, 1.5], [[5, 7], [1, 2], [3, 4], [1, 1]])
    for rows in ([1, 2, 3, 0], [2, 0]):
        table = pd.DataFrame(results).iloc[rows]
        frontier = speed_accuracy_frontier(table)
        size = frontier["param_size"].tolist()
        assert size == ([1, 2, 0] if len(rows) == 4 else rows)
        assert [rows[i] for i in frontier.index] == size
        assert rows[cheapest_within_one_se(table)] == 0  # as of the table by hand


def test_candidates_equal_in_both_are_all_kept():
    results = make_results([2, 1, 2, 2], [[3, 3], [1, 1], [3, 3], [2, 2]])
    assert speed_accuracy_frontier(results).index.tolist() == [1, 0, 2]


def test_parameters_that_only_some_candidates_have():
    results = make_results([1, 2], [[1, 1], [2, 2]])
    results["params"] = [{"cells": (4, 2)}, {"cells": (8,), "alpha": 1.0}]
    table = speed_accuracy_frontier(results)
    assert table["param_cells"].tolist() == [(4, 2), (8,)]
    assert table["param_alpha"].isna().tolist() == [True, False]


@pytest.mark.parametrize("gap, index", [(0.99 * RESULTS_SE, 1), (1.01 * RESULTS_SE, 0)])
def test_one_standard_error_by_hand(gap, index):
    splits = [[4, 4, 6, 6, 5], [5 - gap] * 5, [2.5] * 5, [1] * 5]
    assert cheapest_within_one_se(make_results([8, 4, 2, 1], splits)) == index


def test_the_standard_error_is_that_of_the_best():
    # The fast candidate varies a great deal, the best not at all.
    assert cheapest_within_one_se(make_results([1, 9], [[-9, 9], [1, 1]])) == 1


def test_ties_go_to_the_better_then_the_first():
    splits = [[0, 2], [0.5, 0.5], [0.75, 0.75], [0.75, 0.75]]
    assert cheapest_within_one_se(make_results([9, 1, 1, 1], splits)) == 2
    assert cheapest_within_one_se(make_results([2, 1, 1], [[1, 1]] * 3)) == 1
    # Of two best the fastest sets the threshold: exact here, loose in the other.
    splits = [[-9, 11], [1, 1], [0, 0]]
    assert cheapest_within_one_se(make_results([3, 2, 1], splits)) == 1


@given(
    st.lists(
        st.tuples(st.integers(1, 5), st.integers(-9, 9), st.integers(-9, 9))
    ).filter(len)
)
def test_cheapest_is_on_the_frontier_and_fastest_within_reach(rows):
    rows = np.array(rows, dtype=float)
    results = make_results(rows[:, 0], rows[:, 1:])
    index = cheapest_within_one_se(results)
    mean, se = rows[:, 1:].mean(axis=1), sem(rows[:, 1:], axis=1)
    best = min(range(len(rows)), key=lambda i: (-mean[i], rows[i, 0], i))
    near = [i for i in range(len(rows)) if mean[i] >= mean[best] - se[best]]
    assert index == min(near, key=lambda i: (rows[i, 0], -mean[i], i))
    assert index in speed_accuracy_frontier(results).index


@pytest.mark.parametrize("failed", [np.nan, -np.inf])
def test_failed_candidates_are_left_out(failed):
    splits = [[1, failed], [2, 2], [failed, failed], [3, 3]]
    results = make_results([1, 2, 3, 4], splits)
    assert speed_accuracy_frontier(results).index.tolist() == [1, 3]
    assert cheapest_within_one_se(results) == 3


def test_halving_compares_only_the_last_iteration():
    more = {"iter": np.array([0, 0, 1, 1])}
    results = make_results([1, 1, 5, 6], [[9, 9], [8, 8], [2, 2], [3, 3]], **more)
    assert speed_accuracy_frontier(results).index.tolist() == [2, 3]
    assert cheapest_within_one_se(results) == 3


def test_several_metrics():
    results = {
        **make_results([1, 2], [[1, 1], [2, 2]], "rps"),
        **make_results([1, 2], [[3, 3], [1, 1]], "mae"),
    }
    assert cheapest_within_one_se(results, metric="rps") == 1
    assert cheapest_within_one_se(results, metric="mae") == 0
    assert speed_accuracy_frontier(results, metric="mae").index.tolist() == [0]


@pytest.mark.parametrize("function", [speed_accuracy_frontier, cheapest_within_one_se])
def test_search_must_be_fitted(function):
    with pytest.raises(NotFittedError):
        function(GridSearchCV(LogisticRegression(), {}))


@pytest.fixture(scope="module")
def trials():
    """Thirty trials of ten objects, and counts that follow the first feature."""
    rng = np.random.default_rng(0)
    objects = np.repeat(np.arange(10), 3)
    feel = rng.normal(size=10)
    X = rng.normal(scale=0.3, size=(30, 3))
    X[:, 0] += feel[objects]
    shares = np.exp(-((np.arange(3) - 1 - feel[:, None]) ** 2))
    counts = np.stack([rng.multinomial(12, share / share.sum()) for share in shares])
    return X, counts[objects], objects


def score_and_time(estimator, X, y):
    """What searches by successive halving take in place of several scorers."""
    return {
        "score": neg_rps_scorer(estimator, X, y),
        "neg_seconds": neg_seconds_scorer(estimator, X),
    }


TIMED = {"rps": neg_rps_scorer, "neg_seconds": neg_seconds_scorer}


def make_search(kind=GridSearchCV, scoring=TIMED, refit="rps", **options):
    model = DistributionalOrdinalRegressor(NNPOM(max_iter=20, tol=1e-2, random_state=0))
    grid = {"estimator__n_hidden": [0, 4], "estimator__alpha": [0.1, 10.0]}
    return kind(model, grid, scoring=scoring, cv=GroupKFold(3), refit=refit, **options)


def fit(search, trials):
    X, y, groups = trials
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # few iterations
        return search.fit(X, y, groups=groups)


def test_refit_in_a_grid_search(trials):
    search = fit(clone(make_search(refit=cheapest_within_one_se)), trials)
    results = search.cv_results_
    splits = np.array([results[f"split{k}_test_rps"] for k in range(3)])
    score, seconds = splits.mean(axis=0), -results["mean_test_neg_seconds"]
    near = score >= score.max() - sem(splits)[score.argmax()]
    near &= seconds <= 1.1 * seconds[near].min()
    assert search.best_index_ == np.where(near, score, -np.inf).argmax()
    assert search.best_index_ in speed_accuracy_frontier(search).index
    assert search.predict_proba(trials[0]).shape == (30, 3)
    loaded = pickle.loads(pickle.dumps(search))
    assert loaded.refit is cheapest_within_one_se
    assert loaded.best_index_ == cheapest_within_one_se(loaded) == search.best_index_


def test_refit_with_several_metrics(trials):
    scoring = TIMED | {"mae": neg_macro_mae_scorer}
    refit = partial(cheapest_within_one_se, metric="rps")
    search = pickle.loads(
        pickle.dumps(clone(make_search(scoring=scoring, refit=refit)))
    )
    fit(search, trials)
    assert search.best_index_ == cheapest_within_one_se(search, metric="rps")
    assert search.best_index_ in speed_accuracy_frontier(search, metric="rps").index


def test_metric_is_that_of_refit(trials):
    scoring = TIMED | {"mae": neg_macro_mae_scorer}
    search = fit(make_search(scoring=scoring, refit="mae"), trials)
    table = speed_accuracy_frontier(search)
    expected = search.cv_results_["mean_test_mae"][table.index]
    assert_array_equal(table["score"], expected)
    assert table["score"].iloc[-1] == search.best_score_


def test_halving_search(trials):
    search = make_search(
        HalvingGridSearchCV,
        scoring=score_and_time,
        refit=cheapest_within_one_se,
        factor=2,
        min_resources=15,
    )
    fit(search, trials)
    last = np.flatnonzero(search.cv_results_["iter"] == search.n_iterations_ - 1)
    table = speed_accuracy_frontier(search)
    assert set(table.index) <= set(last)
    assert table["score"].iloc[-1] == search.best_score_
    assert cheapest_within_one_se(search) in table.index


def test_a_search_with_failing_candidates(trials):
    search = make_search(refit=cheapest_within_one_se)
    search.param_grid = {"estimator__n_hidden": [0, -1]}
    fit(search, trials)
    assert search.best_index_ == 0
    assert speed_accuracy_frontier(search).index.tolist() == [0]


SENSORS = ("pac", "pdc", "tac")
SUBSETS = [
    ("pac",),
    ("pdc",),
    ("tac",),
    ("pac", "pdc"),
    ("pac", "tac"),
    ("pdc", "tac"),
    ("pac", "pdc", "tac"),
]


def search_subsets(model, X, y, groups=None, **options):
    """The same by a grid search in which the other sensors are dropped."""
    name, columns = model.steps[0]
    grid = [
        {
            f"{name}__transformers": [
                [
                    (sensor, part if sensor in subset else "drop", names)
                    for sensor, part, names in columns.transformers
                ]
            ]
        }
        for subset in SUBSETS
    ]
    search = GridSearchCV(model, grid, refit=False, error_score="raise", **options)
    return search.fit(X, y, groups=groups).cv_results_


def assert_same_scores(results, expected):
    keys = [key for key in expected if "_test_" in key and "seconds" not in key]
    assert len(keys) >= 5
    for key in keys:
        assert_allclose(results[key], expected[key], 1e-6, err_msg=key)


def columns_model(rest, **options):
    """Two to four features of each of three sensors, and what uses them."""
    steps = [
        ("pac", PCA(2, random_state=0), ["a", "b", "c"]),
        ("pdc", "passthrough", ["d"]),
        ("tac", StandardScaler(), ["c", "e"]),
    ]
    return make_pipeline(ColumnTransformer(steps, **options), *rest)


@pytest.fixture(scope="module")
def table():
    rng = np.random.default_rng(0)
    X = pd.DataFrame(rng.normal(size=(36, 6)), columns=list("abcdef"))
    return X, X["a"] + X["d"] + rng.normal(size=36), np.repeat(np.arange(12), 3)


def test_sensor_subsets_equal_a_grid_search_on_recordings():
    corpus = make_haptic_corpus(8, 2, sensors=SENSORS, random_state=0)
    model = make_haptic_pipeline(SENSORS, random_state=0)
    data = corpus.trials, corpus.ratings["hard"]
    options = {
        "groups": corpus.objects,
        "cv": GroupKFold(2),
        "scoring": {"rps": neg_rps_scorer, "mae": neg_macro_mae_scorer},
    }
    results = sensor_subsets(model, *data, **options)
    assert_same_scores(results, search_subsets(model, *data, **options))
    with pytest.raises(NotFittedError):
        model.predict(corpus.trials)  # the model itself stays as it was


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"transformer_weights": {"pac": 10.0, "tac": 0.1}},
        {"verbose_feature_names_out": False},
    ],
)
@pytest.mark.parametrize("output", ["default", "pandas", "polars"])
def test_sensor_subsets_equal_a_grid_search(table, options, output):
    X, y, _ = table
    names = []
    note = FunctionTransformer(lambda Z: names.append(getattr(Z, "columns", None)) or Z)
    model = columns_model([note, StandardScaler(), Ridge()], **options)
    model.set_output(transform=output)
    results = sensor_subsets(model, X, y, cv=3)
    seen, names[:] = names[:], []
    assert_same_scores(results, search_subsets(model, X, y, cv=3))
    assert {str(columns) for columns in seen} == {str(columns) for columns in names}


@pytest.mark.parametrize("n_folds, cv", [(5, None), (3, 3), (4, np.int64(4))])
def test_sensor_subsets_keep_groups_together(table, n_folds, cv):
    X, y, groups = table
    shuffled = pd.factorize(np.random.default_rng(0).permutation(groups))[0]
    model = columns_model([Ridge()])
    results = sensor_subsets(model, X, y, groups=shuffled, cv=cv)
    by_group = ObjectKFold(n_folds)
    expected = sensor_subsets(model, X, y, groups=shuffled, cv=by_group)
    assert_same_scores(results, expected)
    scores = []
    for train, test in by_group.split(X, y, shuffled):
        assert set(shuffled[train]).isdisjoint(shuffled[test])
        scores.append(
            clone(model).fit(X.iloc[train], y[train]).score(X.iloc[test], y[test])
        )
    assert_allclose(results["mean_test_score"].iloc[-1], np.mean(scores))


def test_sensor_subsets_hand_groups_to_fits_that_request_them(table):
    X, _, groups = table
    counts = np.random.default_rng(0).multinomial(12, [0.2] * 5, size=12)[groups]
    network = NNPOM(2, early_stopping=True, max_iter=20, random_state=0)
    head = DistributionalOrdinalRegressor(network, random_state=0)
    with config_context(enable_metadata_routing=True):
        model = columns_model([head.set_fit_request(groups=True)])
        results = sensor_subsets(model, X, counts, groups=groups, cv=3)
    for k, (train, test) in enumerate(ObjectKFold(3).split(X, groups=groups)):
        features = clone(model[0])
        Z = features.fit_transform(X.iloc[train])
        fitted = clone(head).fit(Z, counts[train], groups=groups[train])
        score = fitted.score(features.transform(X.iloc[test]), counts[test])
        assert results[f"split{k}_test_score"].iloc[-1] == score


def test_sensor_subsets_of_a_classifier_in_stratified_folds(table):
    X, y, _ = table
    labels = np.where(np.argsort(np.argsort(y)) < 8, "soft", "hard")
    model = columns_model([LogisticRegression()])
    assert_same_scores(
        sensor_subsets(model, X, labels), search_subsets(model, X, labels)
    )


def test_each_sensor_is_fitted_once_a_fold(table, monkeypatch):
    X, y, _ = table
    ticks, calls = [], []  # every use of a step takes one tick of the clock
    monkeypatch.setattr(time, "perf_counter", lambda: len(ticks))

    class Ticking(Ridge):
        def fit(self, X, y):
            ticks.append("fit")
            return super().fit(X, y)

        def predict(self, X):
            ticks.append("predict")
            return super().predict(X)

    def note(Z):
        ticks.append("transform")
        calls.append(len(Z))
        return Z

    note = FunctionTransformer(note)
    model = columns_model([Ticking()])
    model[0].set_params(pac=note, pdc=note, tac=note)
    results = sensor_subsets(model, X, y, cv=3)
    # Three sensors, three folds: fitted, transformed, five trials timed twice.
    assert calls == [24, 12, *[1] * 10] * 9
    n_steps = np.array([1 + len(subset) for subset in SUBSETS])
    for step in ("fit", "score"):
        assert_array_equal(results[f"mean_{step}_time"], n_steps)
        assert_array_equal(results[f"std_{step}_time"], 0)
    assert_array_equal(results["mean_test_neg_seconds"], -n_steps)


def test_choosing_among_sensor_subsets(table):
    X, y, groups = table
    results = sensor_subsets(
        columns_model([Ridge()]), X, y, groups=groups, cv=GroupKFold(4), scoring="r2"
    )
    assert results["params"].tolist() == [{"sensors": subset} for subset in SUBSETS]
    assert results["param_sensors"].tolist() == SUBSETS
    best = results["rank_test_score"].argmin()
    assert {"pac", "pdc"} <= set(SUBSETS[best])  # the two that y depends on
    frontier = speed_accuracy_frontier(results)
    assert best in frontier.index
    assert cheapest_within_one_se(results) in frontier.index
    assert frontier["param_sensors"].tolist() == [SUBSETS[i] for i in frontier.index]


def test_dropped_sensors_are_not_tried(table):
    X, y, _ = table
    model = columns_model([Ridge()]).set_params(columntransformer__pac="drop")
    results = sensor_subsets(model, X, y)
    assert results["param_sensors"].tolist() == [("pdc",), ("tac",), ("pdc", "tac")]
    model.set_params(columntransformer__tac="drop")
    assert sensor_subsets(model, X, y)["param_sensors"].tolist() == [("pdc",)]


def test_scores_that_are_not_finite_rank_last(table):
    X, y, _ = table
    model = columns_model([Ridge()]).set_params(columntransformer__pac="drop")
    scores = iter([2.0, -np.inf, np.nan] * 2)
    results = sensor_subsets(model, X, y, cv=2, scoring=lambda *_: next(scores))
    assert results["rank_test_score"].tolist() == [1, 2, 3]
    assert cheapest_within_one_se(results) == 0


def test_sparse_features_of_a_sensor_are_refused(table):
    X, y, _ = table
    encoder = OneHotEncoder(handle_unknown="ignore")
    model = make_pipeline(ColumnTransformer([("pac", encoder, ["a"])]), Ridge())
    with pytest.raises(TypeError, match=r"sensor 'pac' are a csr_.*dense array"):
        sensor_subsets(model, X, y)
