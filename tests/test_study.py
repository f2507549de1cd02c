"""A study ends the same whatever interrupts it, and is what its tables say it is."""

import json
import os
import shutil
import signal
import subprocess
import sys
from functools import partial
from itertools import chain, product
from multiprocessing import get_context
from multiprocessing.pool import ThreadPool
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from scipy.spatial.distance import pdist
from sklearn import config_context
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.preprocessing import StandardScaler
from sklearn.utils import Bunch

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    SensorFusionNNPOM,
    metrics,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.recordings._biotac import PROCEDURES
from sklearn_haptic.recordings._biotac import SENSORS as SENSORS_OF_PHAC2
from sklearn_haptic.study import read_study, run_study
from sklearn_haptic.study._corpus import compute_trials, open_corpus
from sklearn_haptic.study._features import (
    cells_of,
    choose_trials,
    default_coder,
    learn_features,
    rotate_features,
)
from sklearn_haptic.study._models import compute_models, fit_best
from sklearn_haptic.study._run import Progress
from sklearn_haptic.study._split import Parts, split_objects
from sklearn_haptic.study._store import (
    open_study,
    read_record,
    read_table,
    read_unit,
    unit_path,
    write_unit,
)
from sklearn_haptic.study._study import Study, derive_seed

pytestmark = pytest.mark.slow

KINDS = ("trials", "features", "models")
CORPUS = partial(make_haptic_corpus, 8, 2, random_state=0)
SENSORS = ["pdc", "tdc"]
SETTINGS = {
    "procedures": ["fast_slide"],
    "adjectives": ["hard", "cold"],
    "sensors": SENSORS,
    "n_splits": 2,
    "n_repeats": 1,
    "n_hidden": [2],
    "alpha": [1.0, 10.0],
    "n_starts": 2,
    "verbose": False,
}
# Does the same study, but is killed before the n-th file gets its name.
SCRIPT = """
import os, signal, sys
from tests.test_study import CORPUS, SETTINGS
from sklearn_haptic.study import run_study

replace, n_left = os.replace, int(sys.argv[2])

def replace_or_die(*paths):
    global n_left
    n_left -= 1
    if n_left == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    replace(*paths)

os.replace = replace_or_die
run_study(CORPUS, sys.argv[1], **SETTINGS)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a finished study; not to be changed."""
    folder = tmp_path_factory.mktemp("study")
    run_study(CORPUS, folder, **SETTINGS)
    return folder


@pytest.fixture
def copied(folder, tmp_path):
    return shutil.copytree(folder, tmp_path / "copied")


def data_of(folder):
    """What every file holds, but the seconds that a unit took."""
    held = {"settings": (folder / "study.json").read_bytes()}
    for path in folder.glob("*/*.npz"):
        with np.load(path) as file:
            arrays = {name: array.tobytes() for name, array in file.items()}
        record = json.loads(np.frombuffer(arrays["record"], "U1").astype("O").sum())
        arrays["record"] = record | {"seconds": None}
        held[str(path.relative_to(folder))] = arrays
    return held


def assert_same_study(one, other):
    """Equal in every bit: inf and signs of zero too."""
    for name in ("scores", "networks", "choices", "baselines", "truth"):
        pd.testing.assert_frame_equal(one[name], other[name], check_exact=True)


def modified(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.*")}


# Interruptions --------------------------------------------------------------


@pytest.mark.parametrize(
    ("n_files", "n_finished"),
    [
        (1, (0, 0, 0)),  # before the table of trials
        (3, (1, 1, 0)),  # before the file of the second sensor
        (5, (1, 2, 1)),  # before that of the second fold
    ],
)
def test_killed_and_resumed(folder, tmp_path, n_files, n_finished):
    killed = tmp_path / "killed"
    command = [sys.executable, "-c", SCRIPT, killed, str(n_files)]
    process = subprocess.run(command, cwd=Path(__file__).parents[1])
    assert process.returncode == -signal.SIGKILL
    units = [list(killed.glob(f"{kind}/*.npz")) for kind in KINDS]
    assert tuple(map(len, units)) == n_finished
    before = modified(killed)

    resumed = run_study(CORPUS, killed, **SETTINGS)
    assert_same_study(resumed, read_study(folder))
    assert data_of(killed) == data_of(folder)
    for path in chain(*units):
        assert path.stat().st_mtime_ns == before[path]


def truncate(path):
    path.write_bytes(path.read_bytes()[:-9])


def flip(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))


def make_directory(path):
    path.unlink()
    path.mkdir()


UNITS = [
    "trials/fast_slide.npz",
    "features/fast_slide,tdc.npz",
    "models/fast_slide,hard,1.npz",
]


@pytest.mark.parametrize("name", UNITS)
def test_deleted_unit_is_done_again(folder, copied, name):
    before = modified(copied)
    (copied / name).unlink()
    assert_same_study(run_study(CORPUS, copied, **SETTINGS), read_study(folder))
    assert data_of(copied) == data_of(folder)
    after = modified(copied)
    assert {p for p in before if after[p] != before[p]} == {copied / name}


@pytest.mark.parametrize("damage", [truncate, flip, make_directory])
@pytest.mark.parametrize("name", UNITS)
def test_damaged_unit_is_named(copied, name, damage):
    damage(copied / name)
    if "features" in name:  # read by models alone
        (copied / "models" / "fast_slide,hard,1.npz").unlink()
    with pytest.raises(ValueError, match=rf"{name} is missing or damaged .*; delete"):
        run_study(CORPUS, copied, **SETTINGS)


def test_leftovers_of_a_kill_do_no_harm(folder, copied):
    path = copied / "models" / "fast_slide,cold,0.npz"
    path.with_name("123.tmp").write_bytes(path.read_bytes()[:100])
    path.unlink()
    assert len(read_study(copied).choices) == len(read_study(folder).choices) - 3
    assert_same_study(run_study(CORPUS, copied, **SETTINGS), read_study(folder))


STRAYS = [
    "._fast_slide,hard,0.npz",
    "fast_slide,hard,0 (1).npz",
    "Copy of fast_slide,hard,0.npz",
    "fast_slide,hard,0.sync-conflict-20260101.npz",
    ".DS_Store",
]


@pytest.mark.parametrize("content", ["a copy", b"\0\5\x16\7", "a folder"])
def test_files_that_are_no_units(folder, copied, content):
    unit = (copied / "models" / "fast_slide,hard,0.npz").read_bytes()
    for stray in [copied / kind / name for kind in KINDS for name in STRAYS]:
        if content == "a folder":
            stray.mkdir()
        else:
            stray.write_bytes(unit if content == "a copy" else content)
    assert_same_study(read_study(copied), read_study(folder))
    assert_same_study(run_study(CORPUS, copied, **SETTINGS), read_study(folder))


def test_full_disk(tmp_path):
    """The file and the cause are named, and what was written of it is gone."""
    code = """
import resource, sys
from pathlib import Path
import numpy as np
from sklearn_haptic.study._store import write_unit
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
write_unit(Path(sys.argv[1]), ("features", "hold", "pac"), {"features": np.ones(1000)})
"""
    process = subprocess.run(
        [sys.executable, "-c", code, tmp_path],
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
    )
    path = tmp_path / "features" / "hold,pac.npz"
    assert f"OSError: [Errno 27] File too large: '{path}'" in process.stderr
    assert not list(path.parent.iterdir())


def test_nothing_is_done_twice(copied):
    before, called = modified(copied), set()
    sys.setprofile(lambda frame, event, _: called.add(frame.f_code.co_name))
    try:
        run_study(CORPUS, copied, **SETTINGS)
    finally:
        sys.setprofile(None)
    assert modified(copied) == before
    assert "run_study" in called
    assert CORPUS.func.__name__ not in called


@pytest.mark.parametrize("backend", ["loky", "threading"])
def test_two_jobs(folder, tmp_path, backend):
    with joblib.parallel_config(backend, n_jobs=2):
        study = run_study(CORPUS, tmp_path, **SETTINGS)
    assert_same_study(study, read_study(folder))
    assert data_of(tmp_path) == data_of(folder)


def test_extended(folder, tmp_path):
    """Adjectives one after the other, in another order, give the same."""
    for adjective in ("cold", "hard"):
        study = run_study(CORPUS, tmp_path, **SETTINGS | {"adjectives": [adjective]})
    assert_same_study(study, read_study(folder))


# Settings -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("n_starts", 3),
        ("alpha", [1.0]),
        ("sensors", ["tdc", "pdc"]),
        ("split", "paper"),
        ("update", "exact"),
        ("dictionaries", "training objects"),
        ("standardise", False),
        ("random_state", 1),
        ("scoring", metrics.neg_macro_mae_scorer),
        ("regressor", DistributionalOrdinalRegressor(NNPOM(tol=1e-3))),
        ("corpus", partial(make_haptic_corpus, 8, 2, random_state=1)),
    ],
)
def test_other_settings(folder, setting, value):
    before = modified(folder)
    with pytest.raises(
        ValueError, match=rf"holds a study with {setting}=.*; give the same {setting}, "
    ):
        run_study(**{"corpus": CORPUS, "folder": folder, **SETTINGS, setting: value})
    assert modified(folder) == before


SIZE = [8, 2]


def corpus_of_size(**asked):
    return make_haptic_corpus(*SIZE, random_state=0, **asked)


@pytest.mark.parametrize("size", [[8, 3], [9, 2]])
def test_corpus_that_changed(tmp_path, monkeypatch, size):
    run_study(corpus_of_size, tmp_path, **SETTINGS | {"adjectives": ["hard"]})
    shutil.rmtree(tmp_path / "features")
    monkeypatch.setattr(sys.modules[__name__], "SIZE", size)
    with pytest.raises(
        ValueError, match="gives other trials of 'fast_slide'"
    ) as raised:
        run_study(corpus_of_size, tmp_path, **SETTINGS)
    assert "('features', 'fast_slide', 'pdc')" in raised.value.__notes__[0]


@pytest.mark.parametrize("form", [np.asarray, list, pd.Series])
def test_one_rating_per_trial_is_a_count_of_one(form):
    corpus = CORPUS(procedure="fast_slide", sensors=["tdc"])
    labels = [1, 1, 2, 2, 2, 2, 4, 4, 4, 4, 5, 5, 5, 5, 1, 1]
    ratings = {"hard": form(labels)}
    load, *_ = open_corpus({"slide": Bunch(**{**corpus, "ratings": ratings})})
    columns, _ = compute_trials(study_of(None, corpus=load, sensors=["tdc"]), "slide")
    counts = np.stack([columns[f"hard_{k}"] for k in range(1, 5)], axis=1)
    assert_array_equal(counts, np.equal.outer(labels, [1, 2, 4, 5]))
    assert "hard_5" not in columns


def test_labelled_truth_is_put_in_the_order_of_levels():
    corpus = CORPUS(procedure="fast_slide", sensors=["tdc"])
    asked = study_of(None, corpus=lambda **_: corpus)
    expected, _ = compute_trials(asked, "fast_slide")
    for kind in ("ratings", "true_proba"):
        corpus[kind] = {
            name: pd.DataFrame(np.asarray(table)[:, ::-1], columns=[5, 4, 3, 2, 1])
            for name, table in corpus[kind].items()
        }
    columns, _ = compute_trials(asked, "fast_slide")
    pd.testing.assert_frame_equal(columns, expected, check_dtype=False)


def test_levels_of_the_regressor_are_found_by_their_labels():
    words = ["soft", "middle", "hard"]
    corpus = CORPUS(procedure="fast_slide", sensors=["tdc"])
    counts = pd.DataFrame(np.arange(48).reshape(16, 3), columns=words)
    regressor, tables = DistributionalOrdinalRegressor(levels=words), []
    for columns in (words, ["soft", "hard", "middle"]):  # as of a polars pivot
        corpus["ratings"], corpus["true_proba"] = {"hard": counts[columns]}, {}
        asked = study_of(None, corpus=lambda **_: corpus, regressor=regressor)
        tables.append(compute_trials(asked, "fast_slide")[0])
    pd.testing.assert_frame_equal(*tables)


def test_levels_that_differ_between_procedures():
    tap, slide = (
        Bunch(
            trials=pd.DataFrame({"mic": [np.zeros((9, 1))] * 4}),
            objects=[*"abcd"],
            ratings={"itchy": labels},
        )
        for labels in ([1, 2, 3, 4], [2, 3, 4, 5])
    )
    with pytest.raises(ValueError, match=r"\['slide'\] has the levels \[2, 3, 4, 5\]"):
        open_corpus({"tap": tap, "slide": slide})


# Checks at the start ------------------------------------------------------------


def sized(n_objects, n_trials=1):
    return partial(make_haptic_corpus, n_objects, n_trials, random_state=0)


@pytest.mark.parametrize(
    ("n_objects", "changes", "message"),
    [
        (1, {"n_splits": 5}, "has 1 object, but split='group_kfold' .*=5 requires 5"),
        (
            1,
            {"split": "paper"},
            "has 1 object, but split='paper' .* requires 3 or more",
        ),
        (2, {}, "has 2 objects, but split='group_kfold' with n_splits=2 requires 4"),
        (2, {"split": "paper"}, "has 2 objects, but split='paper' .* requires 3 or mo"),
        (3, {}, "has 3 objects, but split='group_kfold' with n_splits=2 requires 4"),
        (9, {"n_splits": 10}, "has 9 objects, but .* n_splits=10 requires 10 or more"),
    ],
)
def test_too_few_objects(tmp_path, n_objects, changes, message):
    with pytest.raises(ValueError, match=message):
        run_study(sized(n_objects), tmp_path, **SETTINGS | changes)
    assert not (tmp_path / "features").exists()


@pytest.mark.parametrize(
    ("n_objects", "changes"),
    [(3, {"split": "paper"}), (3, {"n_splits": 3}), (4, {}), (300, {"split": "paper"})],
)
def test_enough_objects(tmp_path, n_objects, changes):
    tiny = {"adjectives": ["hard"], "sensors": ["tdc"], "alpha": [1.0], "n_starts": 1}
    study = run_study(sized(n_objects), tmp_path, **SETTINGS | tiny | changes)
    objects = study.scores.query("held_out == 'none'")["object"]
    n_tested = -(-n_objects // 10) if "split" in changes else n_objects
    assert objects.nunique() == len(objects) == n_tested


class Changed:
    """A corpus that is loaded once: then its features are not computed any more."""

    def __init__(self, **changes):
        self.changes = changes
        self.loaded = False

    def __call__(self, **asked):
        assert not self.loaded, "features are computed before names are checked"
        self.loaded = True
        return Bunch(**CORPUS(**asked) | self.changes)

    def __reduce__(self):
        return type(self), ()


def put(value, place=3):
    objects = list(CORPUS(procedure="fast_slide", sensors=["tdc"]).objects)
    return [*objects[:place], value, *objects[place + 1 :]]


HARD = CORPUS(procedure="fast_slide", sensors=["tdc"]).ratings["hard"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ratings": {"hard": -HARD}}, "'hard'.* has a negative count"),
        ({"ratings": {}}, "no ratings; give load_phac2"),
        ({"objects": put(np.nan)}, "The objects .* are named by .* values; name all"),
        ({"objects": put(2**64)}, "The objects .* whole numbers of at most 64 bits"),
        ({"objects": []}, "The objects of the corpus are named by empty values"),
    ],
)
def test_names_and_ratings_are_checked_first(tmp_path, changes, message):
    with pytest.raises(ValueError, match=message):
        run_study(Changed(**changes), tmp_path, **SETTINGS | {"adjectives": None})
    assert not (tmp_path / "features").exists()


def test_labels_of_counts_are_the_levels(tmp_path):
    corpus, labelled = CORPUS(procedure="hold"), pd.DataFrame(HARD, columns=range(1, 6))
    tables = []
    for ratings in (labelled, labelled.loc[:, ::-1]):
        corpus["ratings"] = {"hard": ratings}
        study = study_of(tmp_path, corpus=lambda **_: corpus)
        tables.append(compute_trials(study, "hold")[0])
    pd.testing.assert_frame_equal(*tables)


# Names --------------------------------------------------------------------------


NAMES = st.lists(st.text(st.characters(exclude_categories=["Cs"])), min_size=2)


@given(names=NAMES, others=NAMES)
def test_no_two_units_share_a_file(names, others):
    one, other = (unit_path(Path("a"), ("models", *each)) for each in (names, others))
    assert (one == other) == (names == others)
    assert one.parent == Path("a/models")


OBJECTS = np.unique(CORPUS(procedure="fast_slide", sensors=["tdc"]).objects)
RENAMED = dict(zip(OBJECTS, ["007", "1", "11", "1_1", "1e1", "7", "8", "８"]))


def renamed(**asked):
    corpus = CORPUS(**asked)
    corpus.objects = [RENAMED[each] for each in corpus.objects]  # in the same order
    return corpus


def test_objects_with_names_like_numbers(folder, tmp_path):
    """The study is the same whatever its objects are called, if in the same order."""
    study, expected = run_study(renamed, tmp_path, **SETTINGS), read_study(folder)
    for table in (expected.scores, expected.networks):
        table["object"] = table["object"].map(RENAMED)
    assert_same_study(study, expected)


# Configuration of scikit-learn ----------------------------------------------------


@pytest.mark.parametrize("container", ["pandas", "polars"])
def test_output_of_transformers(folder, tmp_path, container):
    pytest.importorskip(container)
    with config_context(transform_output=container):
        study = run_study(CORPUS, tmp_path, **SETTINGS)
    assert_same_study(study, read_study(folder))
    assert data_of(tmp_path) == data_of(folder)


# Starts -----------------------------------------------------------------------


def start_studies(folder, random_state, barrier, results):
    """Start a study in each of many folders, at the same time as another process."""
    for i in range(N_STARTS):
        barrier.wait()
        try:
            open_study(folder / f"{i}", {"random_state": random_state})
            results.put((i, random_state, None))
        except ValueError as error:
            results.put((i, random_state, str(error)))


N_STARTS = 50


def test_of_two_studies_that_start_together_one_goes_on(tmp_path):
    context = get_context("forkserver")
    barrier, results = context.Barrier(2), context.Queue()
    processes = [
        context.Process(target=start_studies, args=(tmp_path, seed, barrier, results))
        for seed in (0, 1)
    ]
    for process in processes:
        process.start()
    outcomes = [results.get(timeout=60) for _ in range(2 * N_STARTS)]
    for process in processes:
        process.join()
    for i in range(N_STARTS):
        (one, other) = sorted(
            (outcome[1:] for outcome in outcomes if outcome[0] == i),
            key=lambda outcome: outcome[1] is not None,
        )
        assert one[1] is None
        settings = json.loads((tmp_path / f"{i}" / "study.json").read_bytes())
        assert settings == {"random_state": one[0]}
        assert f"holds a study with random_state={one[0]}, not {other[0]}; " in other[1]
        assert [path.name for path in (tmp_path / f"{i}").iterdir()] == ["study.json"]


def test_start_where_there_are_no_hard_links(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    open_study(tmp_path, {"n_starts": 1})
    with pytest.raises(ValueError, match="holds a study with n_starts=1, not 2"):
        open_study(tmp_path, {"n_starts": 2})
    assert [path.name for path in tmp_path.iterdir()] == ["study.json"]


def test_threads_that_write_one_unit(tmp_path):
    unit, table = ("models", "hold", "hard", 0), pd.DataFrame({"rps": np.arange(1e4)})
    with ThreadPool(8) as pool:
        pool.map(lambda _: write_unit(tmp_path, unit, table), range(100))
    pd.testing.assert_frame_equal(read_table(tmp_path, unit)[0], table)
    assert not list(tmp_path.rglob("*.tmp"))


# Results --------------------------------------------------------------------


def test_tables(folder):
    study = read_study(folder)
    corpus = CORPUS(procedure="fast_slide", sensors=["tdc"])
    scores = study.scores
    names = pd.Index(corpus.trials.index, name="trial")
    object_of = pd.Series(corpus.objects, names)
    keys = ["adjective", "held_out", "start", "trial"]
    # Every trial once for each model.
    expected = pd.MultiIndex.from_product(
        [["cold", "hard"], ["none", *SENSORS], [0, 1], names], names=keys
    )
    assert set(scores.set_index(keys).index) == set(expected)
    assert len(scores) == len(expected)
    assert (scores["object"] == scores["trial"].map(object_of)).all()
    for adjective, table in scores.groupby("adjective"):
        rows = names.get_indexer(table["trial"])
        np.testing.assert_array_equal(
            table.filter(like="count_"), corpus.ratings[adjective][rows]
        )
    assert study.choices["network"].tolist() == [*SENSORS, "combined"] * 4
    assert (study.choices["n_hidden"] == 2).all()
    assert study.choices["alpha"].isin([1, 10]).all()


def test_scores_are_those_of_probabilities_and_counts(folder):
    scores = read_study(folder).scores
    counts, proba = scores.filter(like="count_"), scores.filter(like="proba_")
    for name, score in {
        "macro_mae": metrics.macro_mae,
        "emd": metrics.earth_movers_distance,
        "rps": metrics.ranked_probability_score,
        "log_score": metrics.log_score,
    }.items():
        np.testing.assert_array_equal(scores[name], score(counts, proba, average=False))
    terms = scores[[f"rps_{k}" for k in (1, 2, 3, 4)]].sum(axis=1)
    np.testing.assert_allclose(terms, scores["rps"], rtol=1e-12)


def test_baselines(folder):
    """Those of all objects that are not tested, fitted here by hand."""
    study = read_study(folder)
    corpus = CORPUS(procedure="fast_slide", sensors=["tdc"])
    keys = ["procedure", "adjective", "fold", "strategy"]
    table = study.baselines.set_index(keys)
    assert set(table.index) == set(
        product(["fast_slide"], ["cold", "hard"], [0, 1], ["marginal", "barycentre"])
    )
    assert len(table) == 8
    for (_, adjective, fold, strategy), row in table.iterrows():
        y = corpus.ratings[adjective]
        of_fold = study.scores[["adjective", "fold"]].eq([adjective, fold]).all(axis=1)
        test = np.isin(corpus.objects, study.scores.loc[of_fold, "object"])
        shares = y[~test] / y[~test].sum(axis=1, keepdims=True)
        if strategy == "marginal":
            proba = shares.mean(axis=0)
        else:
            cdf = np.median(np.cumsum(shares, axis=1), axis=0)
            proba = np.diff(cdf, prepend=0)
        np.testing.assert_allclose(
            row.filter(like="proba_").to_numpy(float), proba, rtol=1e-12, atol=1e-15
        )
        predicted = np.tile(proba, (test.sum(), 1))
        assert row["rps"] == pytest.approx(
            metrics.ranked_probability_score(y[test], predicted)
        )
        model = DummyDistribution(strategy).fit(y[~test], y[~test])
        assert row["macro_mae"] == pytest.approx(
            metrics.macro_mae(y[test], model.predict_proba(y[test]))
        )


def study_of(folder, **changes):
    defaults = {
        "corpus": CORPUS,
        "folder": folder,
        "procedures": list(PROCEDURES),
        "sensors": SENSORS,
        "coders": {},
        "update": "approximate",
        "dictionaries": "all objects",
        "standardise": True,
        "split": "group_kfold",
        "n_splits": 2,
        "n_repeats": 1,
        "n_hidden": [1, 2],
        "alpha": [1.0, 10.0],
        "n_starts": 1,
        "regressor": DistributionalOrdinalRegressor(NNPOM(early_stopping=True)),
        "scoring": None,
        "random_state": 0,
    }
    return Study(**defaults | changes)


def test_ratings_of_test_objects_are_not_seen(copied):
    """Predictions stay the same when the tested objects have other ratings."""
    study = study_of(copied)
    name = "fast_slide", "hard", 0
    before, record = compute_models(study, *name)
    trials, _ = read_table(copied, ("trials", "fast_slide"))
    tested = trials["object"].isin(before["object"])
    columns = [f"hard_{k}" for k in range(1, 6)]
    trials.loc[tested, columns] = trials.loc[tested, columns[::-1]].to_numpy()
    write_unit(copied, ("trials", "fast_slide"), trials)
    after, record_after = compute_models(study, *name)
    assert record_after["choices"] == record["choices"]
    for one, other in zip(record["baselines"], record_after["baselines"]):
        assert [one[f"proba_{k}"] for k in range(1, 6)] == [
            other[f"proba_{k}"] for k in range(1, 6)
        ]
        assert one != other
    assert not before.filter(like="count_").equals(after.filter(like="count_"))
    pd.testing.assert_frame_equal(
        before.filter(like="proba_"), after.filter(like="proba_"), check_exact=True
    )
    trials.loc[~tested, columns] = trials.loc[~tested, columns[::-1]].to_numpy()
    write_unit(copied, ("trials", "fast_slide"), trials)
    last, _ = compute_models(study, *name)
    assert not last.filter(like="proba_").equals(after.filter(like="proba_"))


@pytest.mark.parametrize("early_stopping", [False, True])
def test_network_of_a_sensor(folder, early_stopping):
    """The best of the grid, fitted here by hand."""
    network = NNPOM(early_stopping=early_stopping, max_iter=30, tol=0.1)
    study = study_of(folder, regressor=DistributionalOrdinalRegressor(network))
    _, record = compute_models(study, "fast_slide", "hard", 1)
    arrays, _ = read_unit(folder, ("features", "fast_slide", "tdc"))
    corpus = CORPUS(procedure="fast_slide", sensors=["tdc"])
    train, validation, _ = study.split_objects(corpus.objects, "hard")[1]
    X, y = rotate_features(arrays["features"], train), corpus.ratings["hard"]
    kwargs = {"X_val": X[validation], "y_val": y[validation]} if early_stopping else {}
    results = {}
    for n_hidden in (1, 2):
        for alpha in (1.0, 10.0):
            seed = study.seed("fast_slide", "hard", 1, "tdc", n_hidden, alpha)
            model = DistributionalOrdinalRegressor(
                NNPOM(
                    n_hidden, alpha, early_stopping=early_stopping, max_iter=30, tol=0.1
                ),
                random_state=seed,
            ).fit(X[train], y[train], **kwargs)
            proba = model.predict_proba(X[validation])
            rps = metrics.ranked_probability_score(y[validation], proba)
            results[-rps] = {"n_hidden": n_hidden, "alpha": alpha}
    best = max(results)
    assert record["choices"][1] == {"network": "tdc", **results[best], "score": best}


def test_models_of_a_fold(folder):
    """Networks of the sensors, combined and without a sensor, fitted here by hand."""
    network = NNPOM(early_stopping=True, max_iter=30)
    study = study_of(folder, regressor=DistributionalOrdinalRegressor(network))
    table, record = compute_models(study, "fast_slide", "cold", 0)
    corpus = CORPUS(procedure="fast_slide", sensors=["tdc"])
    y = corpus.ratings["cold"]
    train, validation, test = study.split_objects(corpus.objects, "cold")[0]
    chosen = {choice["network"]: choice for choice in record["choices"]}

    def sized(name):
        params = {key: chosen[name][key] for key in ("n_hidden", "alpha")}
        return clone(network).set_params(**params), params.values()

    def fitted(estimator, X, *seed):
        seed = study.seed("fast_slide", "cold", 0, *seed)
        return DistributionalOrdinalRegressor(estimator, random_state=seed).fit(
            X[train], y[train], X_val=X[validation], y_val=y[validation]
        )

    parts, frozen = {}, {}
    for sensor in SENSORS:
        arrays, _ = read_unit(folder, ("features", "fast_slide", sensor))
        parts[sensor] = rotate_features(arrays["features"], train)
        of_sensor, seed = sized(sensor)
        model = fitted(of_sensor, parts[sensor], sensor, *seed)
        frozen[sensor] = FrozenEstimator(model.estimator_)
    n_pdc = parts["pdc"].shape[1]
    columns = {"pdc": slice(n_pdc), "tdc": slice(n_pdc, None)}
    X, (final, seed) = np.hstack(list(parts.values())), sized("combined")
    fusion = SensorFusionNNPOM(columns, frozen, final)
    searched = fitted(fusion, X, "combined", *seed)
    assert searched.score(X[validation], y[validation]) == chosen["combined"]["score"]
    for held_out in (None, *SENSORS):
        fusion = SensorFusionNNPOM(columns, frozen, final, held_out=held_out)
        proba = fitted(fusion, X, "start", 0).predict_proba(X[test])
        rows = table[table["held_out"] == (held_out or "none")]
        rows = rows[rows["start"] == 0]
        np.testing.assert_array_equal(rows.filter(like="proba_"), proba)
        np.testing.assert_array_equal(rows["object"], corpus.objects[test])


@pytest.mark.parametrize("first", [np.nan, -np.inf])
def test_candidate_without_a_score(first):
    X, counts = np.zeros((4, 1)), np.array([[1, 2], [2, 1], [1, 1], [0, 3]])
    candidates = [DistributionalOrdinalRegressor(NNPOM(0)) for _ in range(4)]
    parts = Parts(np.arange(2), np.array([2]), np.array([3]))
    scores = dict(zip(map(id, candidates), [first, -2.0, np.nan, -1.0]))

    def scoring(model, X, y):
        return scores[id(model)]

    best, score, model = fit_best(candidates, X, counts, parts, scoring)
    assert (best, score, model) == (3, -1.0, candidates[3])
    with pytest.raises(ValueError, match="gives NaN for every network on the valid"):
        fit_best(candidates[2:3], X, counts, parts, scoring)


def test_first_of_equal_candidates():
    X, counts = np.zeros((4, 1)), np.array([[1, 2], [2, 1], [1, 1], [0, 3]])
    candidates = [DistributionalOrdinalRegressor(NNPOM(0)) for _ in range(3)]
    parts = Parts(np.arange(2), np.array([2]), np.array([3]))
    best, score, model = fit_best(candidates, X, counts, parts, None)
    assert best == 0 and model is candidates[0]
    assert score == model.score(X[[2]], counts[[2]])


# Steps ----------------------------------------------------------------------

NO_FOLDS = {"n_splits": 5, "n_repeats": 2, "seed": 0}


@pytest.mark.parametrize("split", ["paper", "group_kfold"])
def test_splits(split):
    objects = np.repeat(np.arange(60), 10)
    folds = split_objects(objects, split, **NO_FOLDS)
    n_tests = np.zeros(60, dtype=int)
    for parts in folds:
        np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.arange(600))
        train, validation, test = (set(objects[part]) for part in parts)
        assert not (train & validation or train & test or validation & test)
        n_tests[list(test)] += 1
        sizes = len(train), len(validation), len(test)
        assert sizes == ((48, 6, 6) if split == "paper" else (42, 6, 12))
    if split == "group_kfold":
        assert len(folds) == 10
        assert (n_tests == 2).all()
        assert not np.array_equal(folds[0].test, folds[5].test)


@pytest.mark.parametrize("split", ["paper", "group_kfold"])
def test_splits_do_not_depend_on_the_order_of_trials(split):
    objects = np.repeat(np.arange(20), 2)
    shuffled = np.random.default_rng(0).permutation(objects)
    for one, other in zip(
        split_objects(objects, split, **NO_FOLDS),
        split_objects(shuffled, split, **NO_FOLDS),
    ):
        for part, other_part in zip(one, other):
            assert set(objects[part]) == set(shuffled[other_part])


def test_paper_splits_each_adjective_and_kfold_all_alike(tmp_path):
    objects = np.repeat(np.arange(60), 2)

    def tested(split, adjective):
        folds = study_of(tmp_path, split=split).split_objects(objects, adjective)
        return [tuple(fold.test) for fold in folds]

    assert tested("paper", "hard") == tested("paper", "hard")
    assert tested("paper", "hard") != tested("paper", "cold")
    assert tested("group_kfold", "hard") == tested("group_kfold", "cold")


def test_every_part_of_a_name_makes_another_seed():
    names = list(product([0, 1], ["features", "split"], ["hold", "squeeze"]))
    assert len({derive_seed(*name) for name in names}) == len(names)


def features_of(trials, objects, procedure):
    """Features and dictionary of temperature."""
    coder = default_coder("tdc", "approximate", trials).set_params(random_state=0)
    cells = cells_of(procedure, "tdc")
    return learn_features(trials, choose_trials(objects, 0), coder, cells)


def test_dictionary_of_three_fifths_of_the_trials_of_each_object():
    """Only trials that it was learnt from change the dictionary."""
    corpus = make_haptic_corpus(2, 5, "fast_slide", sensors=["tdc"], random_state=0)
    trials = list(corpus.trials["tdc"])
    features, dictionary = features_of(trials, corpus.objects, "fast_slide")
    assert features.dtype == np.float32
    assert features.shape == (10, 15 * 2 * 2 * 10)  # cells, fingers, signs, atoms
    learnt_from = np.zeros(10, dtype=bool)
    for i in range(10):
        changed = [*trials[:i], 1 + trials[i] ** 2, *trials[i + 1 :]]
        other, other_dictionary = features_of(changed, corpus.objects, "fast_slide")
        learnt_from[i] = not np.array_equal(other_dictionary, dictionary)
        assert not np.array_equal(other[i], features[i])
    assert learnt_from.reshape(2, 5).sum(axis=1).tolist() == [3, 3]


def test_pyramid_of_each_sensor_is_that_of_the_paper():
    short = {(p, s): cells_of(p, s) for p in PROCEDURES for s in SENSORS_OF_PHAC2}
    fast = {("fast_slide", sensor) for sensor in ("pdc", "tac", "tdc")}
    assert {key for key, cells in short.items() if cells == (8, 4, 2, 1)} == fast
    assert set(short.values()) == {(8, 4, 2, 1), (16, 8, 4, 2, 1)}


@pytest.mark.parametrize("shape", [(12, 40), (30, 5)])
def test_rotation_keeps_distances_of_training_trials(shape):
    rng = np.random.default_rng(0)
    features = (rng.normal(size=shape) * 10 ** rng.uniform(-3, 3, shape[1])).astype(
        "f4"
    )
    features[:, 0] = 2
    features[:, 2] = features[:, 1]
    train = np.arange(0, shape[0], 2)
    rotated = rotate_features(features, train)
    scaled = StandardScaler().fit_transform(features[train].astype(float))
    assert rotated.shape == (shape[0], min(len(train) - 1, shape[1] - 2))
    np.testing.assert_allclose(pdist(rotated[train]), pdist(scaled), rtol=1e-9)
    covariance = np.cov(rotated[train].T)
    np.testing.assert_allclose(
        covariance, np.diag(np.diag(covariance)), atol=1e-9 * covariance.max()
    )


def test_features_that_say_nothing():
    rotated = rotate_features(np.ones((5, 3), dtype=np.float32), np.arange(4))
    np.testing.assert_array_equal(rotated, np.zeros((5, 3)))


# Store ----------------------------------------------------------------------


def test_every_bit_of_a_unit_comes_back(tmp_path):
    rng = np.random.default_rng(0)
    special = [np.inf, -np.inf, 0.0, -0.0, 5e-324, 1.7976931348623157e308, 0.1, 1 / 3]
    floats = rng.integers(0, 2**62, 3000).view(np.float64)
    table = pd.DataFrame(
        {
            "trial": [f"{i:03d}" for i in range(1500)]
            + ["NA", "none"] * 750
            + ["1", "1_1", "", " 1", "٣", "a\rb", "\ud800", "1e3"],
            "object": np.arange(3008),
            "rps": [*floats, *special],
            "start": 7,
        }
    )
    arrays = {"features": rng.normal(size=(3, 4)).astype(np.float32)}
    write_unit(tmp_path, ("models", "hold", "hard", 0), table, seconds=0.1 + 0.2)
    write_unit(tmp_path, ("features", "hold", "pac"), arrays)
    read, record = read_table(tmp_path, ("models", "hold", "hard", 0))
    assert record["seconds"] == 0.1 + 0.2
    assert read["trial"].tolist() == table["trial"].tolist()
    for name in ("object", "rps", "start"):
        assert read[name].dtype == table[name].dtype
        assert read[name].to_numpy().tobytes() == table[name].to_numpy().tobytes()
    (features,) = read_unit(tmp_path, ("features", "hold", "pac"))[0].values()
    assert features.dtype == np.float32
    np.testing.assert_array_equal(features, arrays["features"])
    assert not list(tmp_path.rglob("*.tmp"))


def test_arrays_of_objects_are_neither_written_nor_read(tmp_path):
    """A pickle could run code."""
    unit = "features", "hold", "pac"
    with pytest.raises(ValueError, match="allow_pickle=False"):
        write_unit(tmp_path, unit, {"a": np.array([{}], dtype=object)})
    assert read_record(tmp_path, unit) is None


def test_progress(folder, copied, capsys):
    models = [("models", "fast_slide", "hard", fold) for fold in range(4)]
    features = [("features", "fast_slide", "pac"), ("features", "fast_slide", "tac")]
    units = [*features, *models]
    for fold, seconds in ((0, 100.0), (1, 140.0)):
        write_unit(copied, models[fold], pd.DataFrame({"a": [1]}), seconds=seconds)
    progress = Progress(copied, units, n_workers=2)
    progress(features[0], 60.0)
    progress(features[1], 20.0)
    progress(models[2], 60.0)
    lines = capsys.readouterr().err.splitlines()
    # 60 s of features and 2 × 120 s of models, then the models alone, by two workers
    assert lines[0] == "[3/6] features fast_slide pac: 60.0 s, about 2.5 min left"
    assert lines[1].endswith("tac: 20.0 s, about 2.0 min left")
    assert lines[2] == "[5/6] models fast_slide hard 2: 60.0 s, about 0.8 min left"

    unknown = Progress(folder, [*features, models[2]], n_workers=1)
    unknown(features[0], 1.0)
    assert "1.0 s, time left not known" in capsys.readouterr().err


def test_a_line_for_each_unit(copied, capsys):
    shutil.rmtree(copied / "models")
    run_study(CORPUS, copied, **SETTINGS | {"adjectives": ["hard"], "verbose": True})
    lines = capsys.readouterr().err.splitlines()
    assert [line.split("]")[0] for line in lines] == ["[3/4", "[4/4"]
    assert lines[-1].endswith("about 0.0 min left")


def test_an_adjective_that_the_corpus_does_not_have(tmp_path):
    with pytest.raises(ValueError, match=r"Unknown adjective 'hardness'; .*'hard'"):
        run_study(CORPUS, tmp_path, **SETTINGS | {"adjectives": ["hardness"]})
