"""Every case of `bad_input_cases` is refused in words."""

import pickle
import re

import pytest

pytest.importorskip("h5py")
pytest.importorskip("matplotlib").use("agg")

from bad_input_cases import CASES, DAMAGED, write_corpus  # noqa: E402
from sklearn.base import BaseEstimator  # noqa: E402
from sklearn.utils.validation import _is_fitted  # noqa: E402

import sklearn_haptic  # noqa: E402
from sklearn_haptic import (  # noqa: E402
    datasets,
    metrics,
    model_selection,
    plotting,
    ratings,
    streaming,
    study,
)
from sklearn_haptic.datasets import load_phac2  # noqa: E402

MODULES = (
    *(sklearn_haptic, datasets, metrics, model_selection, plotting),
    *(ratings, streaming, study),
)


def public(module):
    """Names of the functions and classes that a module offers."""
    return {name for name in module.__all__ if callable(getattr(module, name))}


def name_of(case):
    return f"{case.called}-{case.given}".replace(" ", "_")


def pickled(made):
    """Bytes of what is given, but for functions, which nothing can change."""
    given = [arg for arg in (*made.args, *made.kwargs.values()) if not callable(arg)]
    return pickle.dumps(given)


@pytest.mark.parametrize("case", CASES, ids=name_of)
def test_bad_input_is_refused_in_words(case, tmp_path):
    made = case.make(tmp_path)
    estimator = getattr(made.function, "__self__", None)
    fitted = isinstance(estimator, BaseEstimator) and _is_fitted(estimator)
    given = pickled(made)
    state = pickle.dumps(estimator) if fitted else None
    files = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(case.error) as caught:
        made.function(*made.args, **made.kwargs)
    assert re.search(case.message, str(caught.value), re.DOTALL), caught.value
    assert pickled(made) == given
    if fitted and not case.called.endswith("fit"):
        assert pickle.dumps(estimator) == state
    assert {path: path.read_bytes() for path in files} == files


def test_cases_are_distinct_and_of_everything_public():
    assert len({(case.called, case.given) for case in CASES}) == len(CASES) >= 200
    called = {re.split(r"[.(]", case.called)[0] for case in CASES}
    assert set().union(*map(public, MODULES)) <= called


def test_hdf5_file_cut_anywhere(tmp_path):
    path = write_corpus(tmp_path)
    data = path.read_bytes()
    for size in range(0, len(data), 499):
        path.write_bytes(data[:size])
        with pytest.raises(OSError, match=DAMAGED):
            load_phac2(path)
