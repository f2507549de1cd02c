"""BLAS has one thread while anything is learned, coded or predicted, and then as many
as before; a step is limited once, however many trials it has."""

import sys
from dis import get_instructions
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from threadpoolctl import ThreadpoolController, threadpool_limits

import sklearn_haptic
from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    KSVDTransformer,
    SensorFusionNNPOM,
    STHMPTransformer,
    TemporalMaxPool,
)
from sklearn_haptic.utils._sklearn import one_blas_thread

TRIALS = [np.random.default_rng(i).normal(size=(30, 19)) for i in range(6)]
TABLE = np.random.default_rng(0).normal(size=(30, 4))
COUNTS = np.random.default_rng(1).integers(1, 9, size=(30, 3))
MODELS = {
    "K-SVD": (KSVDTransformer(4, 2, window=9, max_iter=2), TRIALS),
    "K-SVD of a table": (KSVDTransformer(3, 2, max_iter=2), TABLE),
    "K-SVD, pooled": (
        make_pipeline(KSVDTransformer(4, 2, window=9), TemporalMaxPool((2, 1))),
        TRIALS,
    ),
    "ST-HMP, pooled": (
        make_pipeline(
            STHMPTransformer(3, 2, spatial_cells=(1,), max_iter=2),
            TemporalMaxPool((2, 1)),
        ),
        TRIALS,
    ),
    "NNPOM": (NNPOM(n_hidden=2, max_iter=900), TABLE),
    "regressor": (DistributionalOrdinalRegressor(), TABLE),
    "fusion": (
        DistributionalOrdinalRegressor(
            SensorFusionNNPOM({"a": [0, 1], "b": [2, 3]}, NNPOM(n_hidden=2))
        ),
        TABLE,
    ),
}
METHODS = ["transform", "predict_proba", "predict_latent", "hidden_activations"]


PACKAGE = str(Path(sklearn_haptic.__file__).parent)
PRODUCTS = {"dot", "matmul", "tensordot", "solve_triangular", "svd"}
BLAS = ThreadpoolController().select(user_api="blas")


def blas_threads():
    return {library["num_threads"] for library in BLAS.info()}


@cache
def makes_products(code):
    """Whether a function of the package multiplies matrices by BLAS itself."""
    return code.co_filename.startswith(PACKAGE) and (
        not PRODUCTS.isdisjoint(code.co_names)
        or any(each.argrepr == "@" for each in get_instructions(code))
    )


@pytest.fixture(autouse=True)
def two_threads():
    with threadpool_limits(2, user_api="blas"):
        if blas_threads() != {2}:
            pytest.skip("BLAS has one thread at most")
        yield


def assert_limited(call):
    """Whenever products are made, BLAS has one thread, and then as many as before."""
    seen = {}

    def watch(frame, event, _):
        if event == "call" and makes_products(frame.f_code):
            seen.setdefault(frame.f_code.co_name, set()).update(blas_threads())

    sys.setprofile(watch)
    try:
        call()
    finally:
        sys.setprofile(None)
    assert seen
    assert {name for name, threads in seen.items() if threads != {1}} == set()
    assert blas_threads() == {2}


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_one_thread_wherever_products_are_made(name):
    model, X = MODELS[name]
    y = COUNTS if X is TABLE else None
    assert_limited(lambda: model.fit(X, y))
    for method in METHODS:
        if hasattr(model, method):
            call = getattr(model, method)
            assert_limited(lambda call=call: list(call(X)))
    if name == "K-SVD":
        assert_limited(lambda: model.transform(X)[3])


def test_a_step_is_limited_once(monkeypatch):
    entered = []
    limit = ThreadpoolController.limit

    def counted(self, **options):
        entered.append(options)
        return limit(self, **options)

    codes = KSVDTransformer(4, 2, window=9, max_iter=2).fit_transform(TRIALS)
    pool = TemporalMaxPool((2, 1)).fit(codes)
    monkeypatch.setattr(ThreadpoolController, "limit", counted)
    pool.transform(codes)
    assert entered == [{"limits": 1, "user_api": "blas"}]
    KSVDTransformer(4, 2, window=9, max_iter=2).fit(TRIALS)
    assert len(entered) == 2


def test_the_limit_ends_with_an_error_and_is_that_of_a_thread():
    @one_blas_thread
    def fail(depth):
        assert blas_threads() == {1}
        if depth:
            fail(depth - 1)
        raise ZeroDivisionError

    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            fail(2)
        assert blas_threads() == {2}
