"""The whole system: raw recordings in, distributions for unseen objects out."""

import warnings

import joblib
import numpy as np
import pytest
from callback_recorder import Recorder
from sklearn import config_context
from sklearn.base import clone
from sklearn.callback import ProgressBar
from sklearn.compose import ColumnTransformer
from sklearn.exceptions import ConvergenceWarning
from sklearn.feature_selection import VarianceThreshold
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_validate
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    KSVDTransformer,
    STHMPTransformer,
    TemporalMaxPool,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_macro_mae_scorer, neg_rps_scorer

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def corpus():
    return make_haptic_corpus(
        12,
        3,
        procedure="fast_slide",
        sensors=["pdc", "tac", "electrodes"],
        random_state=0,
    )


def sensor_features(*, memory=None):
    """Small dictionaries for three sensors."""
    slow = make_pipeline(
        KSVDTransformer(8, 3, window=20, max_iter=3, random_state=0),
        TemporalMaxPool((4, 2, 1)),
        memory=memory,
    )
    images = make_pipeline(
        STHMPTransformer(6, 3, max_iter=3, random_state=0), TemporalMaxPool((4, 2, 1))
    )
    return ColumnTransformer(
        [
            ("pdc", slow, "pdc"),
            ("tac", clone(slow), "tac"),
            ("electrodes", images, "electrodes"),
        ]
    )


def whole_pipeline():
    return make_pipeline(
        sensor_features(),
        VarianceThreshold(),
        StandardScaler(),
        DistributionalOrdinalRegressor(
            NNPOM(0), levels=[1, 2, 3, 4, 5], random_state=0
        ),
    )


HEAD = "distributionalordinalregressor__estimator__"


def test_search_over_hidden_units_and_penalty_on_raw_trials(corpus):
    search = GridSearchCV(
        whole_pipeline(),
        {HEAD + "n_hidden": [0, 2], HEAD + "alpha": [10.0, 1000.0]},
        scoring={"rps": neg_rps_scorer, "mae": neg_macro_mae_scorer},
        refit="rps",
        cv=GroupKFold(3),
        error_score="raise",
    )
    counts = corpus.ratings["hard"]
    search.fit(corpus.trials, counts, groups=corpus.objects)
    assert np.isfinite(search.cv_results_["mean_test_rps"]).all()
    assert np.isfinite(search.cv_results_["mean_test_mae"]).all()
    proba = search.predict_proba(corpus.trials)
    assert proba.shape == (36, 5)
    np.testing.assert_allclose(proba.sum(axis=1), 1)
    marginal = DummyDistribution().fit(np.zeros((36, 1)), counts)
    assert search.score(corpus.trials, counts) > marginal.score(
        np.zeros((36, 1)), counts
    )


def test_nested_cross_validation_with_metadata_routing(corpus):
    with config_context(enable_metadata_routing=True):
        search = GridSearchCV(
            whole_pipeline(),
            {HEAD + "alpha": [10.0, 1000.0]},
            scoring=neg_rps_scorer,
            cv=GroupKFold(2),
            error_score="raise",
        )
        result = cross_validate(
            search,
            corpus.trials,
            corpus.ratings["rough"],
            cv=GroupKFold(3),
            params={"groups": corpus.objects},
            scoring=neg_rps_scorer,
            error_score="raise",
        )
    assert np.isfinite(result["test_score"]).all()


def test_feature_names_say_sensor_cell_and_atom(corpus):
    features = sensor_features().set_output(transform="pandas")
    table = features.fit_transform(corpus.trials)
    names = features.get_feature_names_out()
    assert table.columns.tolist() == names.tolist()
    assert table.index.equals(corpus.trials.index)
    assert len(set(names)) == len(names) == 7 * (2 * 2 * 16 + 14 * 12)
    assert "pdc__t3of4_ch1_atom7-" in names
    assert "electrodes__t1of1_s9of9_atom0+" in names


def test_rows_stay_with_their_trial_beside_other_columns(corpus):
    trials = corpus.trials.assign(number=np.arange(len(corpus.trials), dtype=float))
    permuted = trials.sample(frac=1, random_state=0)
    features = sensor_features()
    features.set_params(remainder="passthrough")
    expected = features.fit(trials).transform(permuted)
    table = features.set_output(transform="pandas").transform(permuted)
    assert table.index.equals(permuted.index)
    np.testing.assert_array_equal(table.to_numpy(), expected)
    np.testing.assert_array_equal(table["remainder__number"], permuted["number"])


def electrodes_head(*, memory=None, max_iter=3):
    return make_pipeline(
        STHMPTransformer(6, 3, max_iter=max_iter, memory=memory, random_state=0),
        TemporalMaxPool((4, 2, 1), memory=memory),
        StandardScaler(),
        DistributionalOrdinalRegressor(NNPOM(0), levels=[1, 2, 3, 4, 5]),
    )


def test_search_with_a_cache_codes_a_trial_once_a_dictionary(corpus, tmp_path):
    results = []
    for memory in (None, str(tmp_path)):
        search = GridSearchCV(
            electrodes_head(memory=memory),
            {HEAD + "alpha": [10.0, 100.0, 1000.0]},
            scoring=neg_rps_scorer,
            cv=GroupKFold(3),
            error_score="raise",
        ).fit(
            corpus.trials["electrodes"], corpus.ratings["hard"], groups=corpus.objects
        )
        results.append(search.cv_results_["mean_test_score"])
    np.testing.assert_array_equal(*results)
    # In each of three folds a dictionary, and rows to train on and to test on; then
    # those of all trials.
    assert len(list(tmp_path.rglob("output.pkl"))) == 3 * 3 + 2


def test_workers_find_what_their_parent_cached(corpus, one_thread, tmp_path):
    results, n_entries = [], []
    for n_jobs, memory in [(1, None), (1, str(tmp_path)), (2, str(tmp_path))]:
        # Trials reach the workers as files in memory.
        with joblib.parallel_config("loky", n_jobs=n_jobs, max_nbytes=1000):
            scores = cross_validate(
                electrodes_head(memory=memory),
                corpus.trials["electrodes"],
                corpus.ratings["hard"],
                groups=corpus.objects,
                cv=GroupKFold(2),
                scoring=neg_rps_scorer,
                error_score="raise",
            )["test_score"]
        results.append(scores)
        n_entries.append(len(list(tmp_path.rglob("output.pkl"))))
    np.testing.assert_array_equal(results[1], results[0])
    np.testing.assert_allclose(results[2], results[0], rtol=1e-12)
    # In each of two folds a dictionary, and rows to train on and to test on.
    assert n_entries == [0, 6, 6]


def test_callbacks_reach_the_iterations_from_a_search(corpus):
    recorder = Recorder()
    search = GridSearchCV(
        make_pipeline(
            KSVDTransformer(8, 3, window=20, max_iter=4, tol=0, random_state=0),
            TemporalMaxPool((4, 2, 1)),
            StandardScaler(),
        ),
        {"temporalmaxpool__split": ["balanced", "floor"]},
        scoring=lambda estimator, X, y: 0.0,
        cv=GroupKFold(3),
    ).set_callbacks(recorder)
    search.fit(corpus.trials["pdc"], corpus.ratings["hard"], groups=corpus.objects)
    finished = list(zip(recorder.owners, recorder.tasks))
    iterations = [owner for owner, task in finished if task.startswith("iteration ")]
    n_fits = 2 * 3 + 1
    assert iterations == ["KSVDTransformer"] * (4 * n_fits)
    assert finished.count(("TemporalMaxPool", "fit")) == n_fits


def test_progress_bar(corpus, capsys):
    pytest.importorskip("rich")
    steps = make_pipeline(
        STHMPTransformer(6, 3, max_iter=3, random_state=0), TemporalMaxPool((4, 2, 1))
    )
    expected = clone(steps).fit_transform(corpus.trials["electrodes"])
    pooled = steps.set_callbacks(ProgressBar()).fit_transform(
        corpus.trials["electrodes"]
    )
    np.testing.assert_array_equal(pooled, expected)
    assert "STHMPTransformer" in capsys.readouterr().out


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_progress_of_a_search(corpus, capfd, n_jobs):
    """Its bars are named, and warnings of other processes can be kept out of them."""
    pytest.importorskip("rich")
    X = np.random.default_rng(0).normal(size=(36, 3))
    model = make_pipeline(StandardScaler(), NNPOM(max_iter=1))
    search = GridSearchCV(model, {"nnpom__alpha": [1, 2]}, cv=3, n_jobs=n_jobs)
    search.set_callbacks(ProgressBar(max_propagation_depth=0))
    with warnings.catch_warnings(action="ignore", category=ConvergenceWarning):
        search.fit(X, corpus.ratings["hard"])
    bars, errors = capfd.readouterr()
    lines = [line.split(" ━")[0].strip() for line in bars.splitlines()]
    assert lines[-2:] == ["GridSearchCV - fit", "GridSearchCV - search #0"]
    assert not errors and "Warning" not in bars
