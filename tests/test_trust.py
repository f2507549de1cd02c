"""Saved models predict the same, files run nothing, and no call leaves a trace."""

import doctest
import inspect
import io
import json
import os
import pickle
import random
import re
import subprocess
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import h5py
import joblib
import matplotlib
import numpy as np
import pandas as pd
import pytest
import sklearn
import skops.io
from fitted_models import CORPUS, COUNTS, MODELS, NAMED, fitted, methods_of
from load_and_predict import digests, outputs
from matplotlib import pyplot
from sklearn.base import BaseEstimator, clone
from sklearn.exceptions import InconsistentVersionWarning
from sklearn.model_selection import GroupKFold
from sklearn.utils import _safe_indexing
from test_phac2 import write_trial
from threadpoolctl import threadpool_info, threadpool_limits

import sklearn_haptic
from sklearn_haptic import (
    TemporalMaxPool,
    datasets,
    metrics,
    model_selection,
    plotting,
    ratings,
    streaming,
    study,
)
from sklearn_haptic.datasets import load_phac2
from sklearn_haptic.model_selection import sensor_contributions, sensor_subsets
from sklearn_haptic.models._quantile_positions import population_quadrature
from sklearn_haptic.study import read_study
from sklearn_haptic.study._store import open_study, write_unit

matplotlib.use("Agg")

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("one_thread")]

TESTS = Path(__file__).parent
GUIDE = (TESTS.parent / "docs" / "saving.md").read_text("utf-8")


# Saved models ---------------------------------------------------------------

DUMPERS = {
    "pickle": lambda model, path: path.write_bytes(pickle.dumps(model)),
    "joblib": joblib.dump,
    "compressed": partial(joblib.dump, compress=3),
    "mapped": joblib.dump,
    "skops": skops.io.dump,
}


def types_in(model):
    return set(skops.io.get_untrusted_types(data=skops.io.dumps(model)))


def types_in_the_guide():
    listed = re.search(r"^TRUSTED = \[(.*?)^\]", GUIDE, re.M | re.S)
    return set(re.findall(r'"(.*)"', listed[1]))


def test_models_of_every_public_estimator():
    public = [getattr(sklearn_haptic, name) for name in sklearn_haptic.__all__]
    estimators = {
        each
        for each in public
        if isinstance(each, type) and issubclass(each, BaseEstimator)
    }
    assert estimators <= {type(model) for model, _, _ in MODELS.values()}


def test_another_process_only_loads_and_predicts(tmp_path):
    inputs, expected, trusted = {}, {}, set()
    for i, name in enumerate(MODELS):
        model, X = fitted(name), MODELS[name][1]
        trusted |= types_in(model)
        for kind, dump in DUMPERS.items():
            dump(model, tmp_path / f"{i}.{kind}")
            inputs[f"{i}.{kind}"], expected[f"{i}.{kind}"] = X, digests(model, X)
    joblib.dump(inputs, tmp_path / "inputs")
    script = TESTS / "load_and_predict.py"
    process = subprocess.run(
        [sys.executable, "-I", "-B", script, "inputs", json.dumps(sorted(trusted))],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert not process.stderr
    assert json.loads(process.stdout) == expected
    assert len(list(tmp_path.iterdir())) == len(expected) + 1


def test_types_that_skops_has_to_trust():
    types = set().union(*(types_in(fitted(name)) for name in MODELS))
    own = {each for each in types if each.startswith("sklearn_haptic.")}
    assert own | {"sklearn.tree._tree.Tree"} == types_in_the_guide()


@pytest.mark.parametrize(
    ("name", "of_sklearn"),
    [
        ("pipeline", {"Pipeline", "FeatureUnion"}),
        ("regressor of a classifier", {"LogisticRegression"}),
    ],
)
def test_another_version_of_sklearn_warns_as_ever(monkeypatch, name, of_sklearn):
    with monkeypatch.context() as patch:
        patch.setattr("sklearn.base.__version__", "1.0")
        saved = pickle.dumps(fitted(name))
    with pytest.warns(InconsistentVersionWarning) as caught:
        pickle.loads(saved)
    assert {each.message.estimator_name for each in caught} == of_sklearn


# Files that would run code --------------------------------------------------


class Payload:
    """Makes a folder when it is unpickled."""

    def __init__(self, trace):
        self.trace = trace

    def __reduce__(self):
        return os.mkdir, (str(self.trace),)


@pytest.fixture
def payload(tmp_path):
    """A payload; what it would leave behind must not be there after the test."""
    trace = tmp_path / "trace"
    pickle.loads(pickle.dumps(Payload(trace)))
    trace.rmdir()
    yield Payload(trace)
    assert not trace.exists()


def write_corpus(path):
    with h5py.File(path, "w") as file:
        for seed, name in enumerate(["sponge_114_02", "cup_602_01"]):
            write_trial(file, name, seed=seed)


def test_pickles_in_attributes_stay_unread(tmp_path, payload):
    """PyTables, which wrote the published file, unpickles attributes."""
    path = tmp_path / "corpus.h5"
    write_corpus(path)
    before = load_phac2(path).trials
    code = np.bytes_(pickle.dumps(payload, protocol=0))
    with h5py.File(path, "r+") as file:
        nodes = [file]
        file.visititems(lambda _, node: nodes.append(node))
        for node in nodes:
            for name in ("CLASS", "TITLE", "FILTERS", "PSEUDOATOM", "MATLAB_class"):
                node.attrs[name] = code
    after = load_phac2(path).trials
    for sensor in before:
        assert [each.tobytes() for each in before[sensor]] == [
            each.tobytes() for each in after[sensor]
        ]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("biotacs/finger_0/pac", "has dtype .*; it must hold numbers"),
        ("state/controller_detail_state", "has dtype .*; it must hold byte strings"),
    ],
)
@pytest.mark.parametrize("kind", ["opaque", "variable bytes"])
def test_pickles_in_datasets_are_refused(tmp_path, payload, name, message, kind):
    path = tmp_path / "corpus.h5"
    write_corpus(path)
    code = pickle.dumps(payload, protocol=0)
    with h5py.File(path, "r+") as file:
        group = file["sponge_114_02"]
        del group[name]
        if kind == "opaque":
            group[name] = np.array([code] * 13, dtype=f"V{len(code)}")
        else:
            values = np.array([np.frombuffer(code, "u1")] * 13, dtype=object)
            dtype = h5py.vlen_dtype(np.uint8)
            group.create_dataset(name, (13,), dtype)[:] = list(values)
        group[name].attrs["PSEUDOATOM"] = "object"
    with pytest.raises(ValueError, match=message):
        load_phac2(path)


SCORES = pd.DataFrame({"trial": ["cup_602_01"], "held_out": "none", "rps": [0.1]})
NOTHING = {"choices": [], "baselines": [], "truth": []}
UNIT = "models", "hold", "hard", 0
FILE = "models/hold,hard,0.npz"


@pytest.fixture
def folder(tmp_path):
    """A study of one unit."""
    folder = tmp_path / "study"
    settings = {"procedures": ["hold"], "split": "paper"}
    open_study(folder, settings)
    write_unit(folder, ("trials", "hold"), {"trial": ["cup_602_01"], "hard_1": [3]})
    write_unit(folder, UNIT, SCORES.assign(network="combined", start=0), **NOTHING)
    return folder


def test_folder_as_it_was(folder):
    expected = SCORES.assign(start=0)
    pd.testing.assert_frame_equal(read_study(folder).scores, expected)


def zipped(array):
    """An .npz file; objects in it are pickled."""
    buffer = io.BytesIO()
    np.savez(buffer, features=array)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        lambda payload: zipped(np.array([payload], dtype=object)),
        lambda payload: zipped(
            np.array([(payload, 1.0)], dtype=[("a", "O"), ("b", "f8")])
        ),
        pickle.dumps,
        lambda _: zipped(np.arange(9))[:-30],
        lambda _: b"",
    ],
    ids=["objects", "fields", "pickle", "cut short", "empty"],
)
def test_arrays_of_a_study_are_plain(folder, payload, content):
    (folder / FILE).write_bytes(content(payload))
    with pytest.raises(ValueError, match=rf"{FILE} is missing or damaged"):
        read_study(folder)


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, "[]", '{"py/object": "os.mkdir"', "\ud800"],
    ids=lambda text: text[:9],
)
def test_json_of_a_study(folder, text):
    (folder / "study.json").write_text(text, errors="surrogatepass")
    with pytest.raises(ValueError, match=r"study\.json is damaged"):
        read_study(folder)


def test_units_are_written_nowhere_else(folder):
    write_unit(folder, ("models", "hold", "../../secret", 0), SCORES)
    assert len(list((folder / "models").iterdir())) == 2


# Threads --------------------------------------------------------------------

N_THREADS = 8


@pytest.fixture
def hasty_threads(monkeypatch):
    """Threads that take turns as often as they can."""
    # scikit-learn's Parallel resets the warning filters of all threads, and warns when
    # it finds none.
    names = ("warn", "resetwarnings", "simplefilter", "filterwarnings")
    harmless = dict.fromkeys(names, lambda *args, **kwargs: None)
    harmless |= {"filters": [], "catch_warnings": nullcontext}
    monkeypatch.setattr("sklearn.utils.parallel.warnings", SimpleNamespace(**harmless))
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


def in_threads(call):
    """What a call of 0 to 7 returns, all begun together in threads of their own."""
    barrier = threading.Barrier(N_THREADS)

    def begin_together(i):
        barrier.wait()
        return call(i)

    with ThreadPoolExecutor(N_THREADS) as pool:
        return list(pool.map(begin_together, range(N_THREADS)))


@pytest.mark.usefixtures("hasty_threads")
@pytest.mark.parametrize("name", MODELS)
def test_threads_share_a_model(name):
    model, X = fitted(name), MODELS[name][1]
    n = len(X)
    inputs = [_safe_indexing(X, np.roll(range(n), i)) for i in range(N_THREADS)]
    expected = [outputs(model, each) for each in inputs]
    population_quadrature.cache_clear()
    for _ in range(3):
        assert in_threads(lambda i: outputs(model, inputs[i])) == expected


@pytest.mark.usefixtures("hasty_threads")
@pytest.mark.parametrize("name", ["ksvd of trials", "sthmp"])
def test_threads_share_codes_and_a_cache(name, tmp_path):
    codes = fitted(name).transform(MODELS[name][1])
    expected = [each.tobytes() for each in codes]

    def take(i):
        order = np.roll(range(len(codes)), i)
        taken = {j: codes[j].tobytes() for j in order}
        return [taken[j] for j in range(len(codes))]

    assert in_threads(take) == [expected] * N_THREADS
    pool = TemporalMaxPool((2, 1)).fit(codes)
    pooled = pool.transform(codes).tobytes()
    pool.set_params(memory=str(tmp_path))
    assert in_threads(lambda _: pool.transform(codes).tobytes()) == [pooled] * N_THREADS


# Backends -------------------------------------------------------------------


def contributions_of_sensors():
    return sensor_contributions(
        MODELS["regressor of a fusion"][0],
        NAMED,
        COUNTS,
        cv=2,
        n_repeats=2,
        random_state=0,
    )


def scores_of_subsets():
    model, X, y = MODELS["pipeline"]
    results = sensor_subsets(model, X, y, groups=CORPUS.objects, cv=GroupKFold(2))
    return pd.DataFrame({k: v for k, v in results.items() if "test_score" in k})


@pytest.mark.parametrize("compute", [contributions_of_sensors, scores_of_subsets])
def test_tables_are_the_same_for_each_backend(compute):
    expected = compute()
    for backend in ("loky", "threading"):
        with joblib.parallel_config(backend, n_jobs=2):
            pd.testing.assert_frame_equal(compute(), expected, check_exact=True)


# Global state ---------------------------------------------------------------


def global_state():
    filters = [  # scikit-learn's Parallel replaces "__main__" by its regular expression
        tuple(getattr(part, "pattern", part) for part in each)
        for each in warnings.filters
    ]
    return {
        "random": random.getstate(),
        "numpy.random": repr(np.random.get_state()),  # noqa: NPY002
        "errors of NumPy": (np.geterr(), np.geterrcall()),
        "printing of NumPy": np.get_printoptions(),
        "warnings": (filters, warnings.showwarning),
        "sklearn": sklearn.get_config(),
        "threads": threadpool_info(),
        "environment": dict(os.environ),
        "directory": os.getcwd(),
        "matplotlib": matplotlib.rcParams.copy(),
    }


@contextmanager
def nothing_changes(what):
    before = global_state()
    yield
    after = global_state()
    changed = [name for name in before if after[name] != before[name]]
    assert not changed, f"{what} changes {changed}"


@pytest.fixture
def unusual_state():
    """Settings that are not the defaults, so that a reset is seen too."""
    with (
        np.errstate(divide="ignore", over="ignore", invalid="ignore"),
        np.printoptions(precision=5),
        sklearn.config_context(working_memory=500),
        matplotlib.rc_context({"lines.linewidth": 3}),
        threadpool_limits(2),
        warnings.catch_warnings(),
    ):
        warnings.filterwarnings("ignore", "nothing in particular")
        yield
    pyplot.close("all")


def test_every_public_method_is_called():
    public = set()
    for model, _, _ in MODELS.values():
        for parent in type(model).__mro__:
            if parent.__module__.startswith("sklearn_haptic."):
                public |= {
                    name
                    for name, value in vars(parent).items()
                    if callable(value) and not name.startswith("_")
                }
    called = set()
    for name, (_, X, y) in MODELS.items():
        called |= methods_of(fitted(name), X, y).keys()
    # Those for other estimators take what has been validated.
    assert {name for name in public if "_with_positions" not in name} <= called


@pytest.mark.filterwarnings("ignore:.*fit was given no groups")
@pytest.mark.filterwarnings("ignore:.*fit was given no groups")
@pytest.mark.usefixtures("unusual_state")
@pytest.mark.parametrize("name", MODELS)
def test_methods_change_no_global_state(name):
    unfitted, X, y = MODELS[name]
    for method, call in methods_of(clone(unfitted).fit(X, y), X, y).items():
        with nothing_changes(method):
            call()
    with nothing_changes("an error"), pytest.raises((TypeError, ValueError)):
        clone(unfitted).fit(X[:0], y)


def public_functions():
    """Every public function and display, once each, by name."""
    modules = datasets, metrics, model_selection, plotting, ratings, streaming, study
    for module in (sklearn_haptic, *modules):
        for name in module.__all__:
            each = getattr(module, name)
            if inspect.isfunction(each) or name.endswith("Display"):
                yield pytest.param(each, id=name)


class Runner(doctest.DocTestRunner):
    """Whatever an example prints; numbers are shown with other digits here."""

    def report_failure(self, *_):
        pass

    def report_unexpected_exception(self, out, test, example, error):
        raise error[1]


@pytest.mark.usefixtures("unusual_state")
@pytest.mark.parametrize("function", [*public_functions()])
def test_functions_change_no_global_state(function, tmp_path, monkeypatch):
    """Called as in the example of each."""
    monkeypatch.chdir(tmp_path)
    (example,) = doctest.DocTestFinder(recurse=False).find(function, function.__name__)
    assert example.examples
    with nothing_changes(function.__name__):
        Runner(verbose=False).run(example, out=lambda _: None)
