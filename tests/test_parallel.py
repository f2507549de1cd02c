"""Searches give the same numbers with any backend, and with a cache or without."""

import joblib
import pandas
import pytest
from numpy.testing import assert_array_equal
from sklearn.compose import ColumnTransformer
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    KSVDTransformer,
    STHMPTransformer,
    TemporalMaxPool,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_rps_scorer

# joblib prints the arguments of what it caches, and warns if that takes long.
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:Persisting input arguments took:UserWarning"),
    pytest.mark.usefixtures("one_thread"),
]


@pytest.fixture(scope="module")
def corpus():
    return make_haptic_corpus(
        6, 2, procedure="fast_slide", sensors=["pdc", "electrodes"], random_state=0
    )


def fitted_search(corpus, *, n_jobs=None, step_memory=None, pipeline_memory=None):
    learning = {"max_iter": 1, "memory": step_memory, "random_state": 0}
    pressure = KSVDTransformer(5, 3, window=20, max_train_windows=200, **learning)
    images = STHMPTransformer(
        4, 3, spatial_cells=(1,), max_train_patches=200, **learning
    )
    pool = TemporalMaxPool((2, 1), memory=step_memory)
    features = ColumnTransformer(
        [
            ("pdc", make_pipeline(pressure, pool), "pdc"),
            ("images", make_pipeline(images, pool), "electrodes"),
        ]
    )
    head = DistributionalOrdinalRegressor(
        NNPOM(n_hidden=2), levels=[1, 2, 3, 4, 5], random_state=0
    )
    search = GridSearchCV(
        Pipeline(
            [("features", features), ("scale", StandardScaler()), ("head", head)],
            memory=pipeline_memory,
        ),
        {"head__estimator__alpha": [100.0, 1000.0]},
        scoring=neg_rps_scorer,
        cv=GroupKFold(2),
        n_jobs=n_jobs,
        error_score="raise",
    )
    return search.fit(corpus.trials, corpus.ratings["hard"], groups=corpus.objects)


@pytest.fixture(scope="module", autouse=True)
def short_tables():
    with pandas.option_context("display.max_seq_items", 3):
        yield


@pytest.fixture(scope="module")
def reference(corpus):
    return fitted_search(corpus, n_jobs=1)


def assert_same(search, reference, corpus):
    for scores in ("split0_test_score", "split1_test_score"):
        assert_array_equal(search.cv_results_[scores], reference.cv_results_[scores])
    assert search.best_params_ == reference.best_params_
    assert_array_equal(
        search.predict_proba(corpus.trials), reference.predict_proba(corpus.trials)
    )


@pytest.mark.parametrize("backend", ["loky", "threading"])
@pytest.mark.parametrize("n_jobs", [1, 2])
def test_joblib_backends(corpus, reference, backend, n_jobs):
    with joblib.parallel_config(backend, n_jobs=n_jobs):
        assert_same(fitted_search(corpus), reference, corpus)


@pytest.mark.parametrize(("n_workers", "processes"), [(2, False), (1, True)])
def test_dask(corpus, reference, n_workers, processes):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.Client(
            n_workers=n_workers,
            threads_per_worker=1,
            processes=processes,
            dashboard_address=None,
        ),
        joblib.parallel_config("dask"),
    ):
        assert_same(fitted_search(corpus), reference, corpus)


@pytest.mark.parametrize(
    ("caches", "n_jobs"),
    [
        (["step_memory"], 1),
        (["pipeline_memory"], 1),
        (["step_memory", "pipeline_memory"], 2),
    ],
)
def test_caches(corpus, reference, tmp_path, caches, n_jobs):
    memory = {cache: str(tmp_path / cache) for cache in caches}
    for _ in range(2):  # an empty cache, then a full one
        assert_same(fitted_search(corpus, n_jobs=n_jobs, **memory), reference, corpus)
