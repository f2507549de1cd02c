"""Fixtures that several test modules use."""

import os
import sys
from pathlib import Path

# Before anything loads BLAS or OpenMP: tests run in as many processes as there are
# cores, whose threads would only wait for each other. `test_threads` asks for more.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "agg")  # draw to no screen

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="session")
def shared_data():
    """Folder of real recordings and ratings; tests that need it skip without."""
    default = Path(__file__).resolve().parents[2] / "shared"
    folder = Path(os.environ.get("SKLEARN_HAPTIC_SHARED", default)) / "data"
    if not folder.is_dir():
        pytest.skip(
            "no shared data: set SKLEARN_HAPTIC_SHARED to the folder that holds it"
        )
    return folder


@pytest.fixture(scope="module")
def one_thread():
    """Here and in workers: sums in another order would differ in the last digit."""
    with pytest.MonkeyPatch.context() as environment, threadpool_limits(1):
        environment.setenv("OMP_NUM_THREADS", "1")
        environment.setenv("OPENBLAS_NUM_THREADS", "1")
        yield


@pytest.fixture(autouse=True)
def close_figures():
    """Leave no figure to the next test."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
