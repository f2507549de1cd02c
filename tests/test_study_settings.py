"""What tells the settings of one study from those of another."""

import json
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.metrics import make_scorer

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, metrics
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.study import run_study
from sklearn_haptic.study._settings import describe


def test_description_of_settings(tmp_path):
    assert describe(partial(sorted, tmp_path, key=[np.int64(3)], reverse=None)) == {
        "function": "builtins.sorted",
        "args": [str(tmp_path)],
        "keywords": {"key": [3], "reverse": None},
    }
    described = describe(DistributionalOrdinalRegressor(NNPOM(7)))
    assert described["estimator"]["n_hidden"] == 7
    assert json.loads(json.dumps(described)) == described


class Touches:
    """A corpus of a few recordings, as an object that is called."""

    def __init__(self, *values):
        self.values = np.array(values)

    def __call__(self, **_):
        return self.values

    def load(self, **_):
        return self.values


def adder(n):
    return lambda x: x + n


def table_of(value, library=pd):
    """A long table, of which `repr` shows the ends."""
    column = np.arange(1000.0)
    column[500] = value
    return library.DataFrame({"touch": column})


SEED = 0
# Each makes a value, the same in another process; no two values are equal.
VALUES = {
    "number": lambda: 1,
    "text": lambda: "1",
    "text of two": lambda: "1, 2",
    "list": lambda: [1, 2],
    "nested": lambda: [[1], 2],
    "NaN": lambda: np.nan,
    "float": lambda: 0.1,
    "float32": lambda: np.float32(0.1),
    "bytes": lambda: b"1",
    "date": lambda: np.datetime64("2020-01-01"),
    "keys": lambda: {"1": 2},
    "numbers as keys": lambda: {1: 2},
    "set": lambda: {"b", "a", "c"},
    "array": lambda: np.arange(2000),
    "array in the middle": lambda: np.where(
        np.arange(2000) == 1000, 0, np.arange(2000)
    ),
    "array of another type": lambda: np.arange(2000, dtype=np.int32),
    "array of another shape": lambda: np.arange(2000).reshape(2, -1),
    "touches": lambda: [np.zeros((5, 2)), np.zeros((4, 2))],
    "other touches": lambda: [np.zeros((4, 2)), np.zeros((5, 2))],
    "objects": lambda: np.array([np.zeros(3), "a", None], dtype=object),
    "masked": lambda: np.ma.masked_array([1, 2], [False, True]),
    "table": lambda: table_of(0),
    "table in the middle": lambda: table_of(1),
    "table with names": lambda: table_of(0).rename(columns={"touch": "grip"}),
    "table with rows": lambda: table_of(0).rename(index={500: -1}),
    "table of text": lambda: table_of(0).astype(str),
    "column": lambda: table_of(0)["touch"],
    "touches in a table": lambda: pd.DataFrame({"pac": [np.zeros(3), np.ones(2)]}),
    "levels": lambda: pd.Series(pd.Categorical(["a"], ["a", "b"], ordered=True)),
    "other levels": lambda: pd.Series(pd.Categorical(["a"], ["b", "a"], ordered=True)),
    "polars": lambda: table_of(0, pytest.importorskip("polars")),
    "polars in the middle": lambda: table_of(1, pytest.importorskip("polars")),
    "function": lambda: make_haptic_corpus,
    "other function": lambda: run_study,
    "class": lambda: Touches,
    "lambda": lambda: lambda x: x + 1,
    "other lambda": lambda: lambda x: x + 2,
    "default": lambda: lambda x, n=3: x + n,
    "closure": lambda: adder(1),
    "other closure": lambda: adder(2),
    "global variable": lambda: lambda x: x + SEED,
    "object": lambda: Touches(1, 2),
    "other object": lambda: Touches(1, 3),
    "method": lambda: Touches(1, 2).load,
    "other method": lambda: Touches(1, 3).load,
    "partial": lambda: partial(make_haptic_corpus, 1),
    "scorer": lambda: make_scorer(metrics.ranked_probability_score),
    "other scorer": lambda: make_scorer(metrics.earth_movers_distance),
    "estimator": lambda: NNPOM(3),
    "generator": lambda: np.random.default_rng(0),
    "other generator": lambda: np.random.default_rng(1),
}


def descriptions():
    return {
        name: json.dumps(describe(make()), sort_keys=True)
        for name, make in VALUES.items()
    }


def test_descriptions_tell_values_apart():
    described = descriptions()
    assert len(set(described.values())) == len(described)
    assert descriptions() == described


@pytest.mark.slow
def test_descriptions_are_the_same_in_every_session():
    code = "import json, test_study_settings as t; print(json.dumps(t.descriptions()))"
    process = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parent,
        env=os.environ | {"PYTHONHASHSEED": "7"},
        capture_output=True,
        check=True,
    )
    assert json.loads(process.stdout) == descriptions()


def test_global_variable_of_a_function(monkeypatch):
    before = describe(VALUES["global variable"]())
    monkeypatch.setattr(sys.modules[__name__], "SEED", 1)
    assert describe(VALUES["global variable"]()) != before


def test_settings_that_cannot_be_recognised(tmp_path):
    with (
        open(os.devnull) as file,
        pytest.raises(
            ValueError,
            match=r"^corpus could not be recognised .*TextIOWrapper.*; give a",
        ),
    ):
        run_study(partial(make_haptic_corpus, file), tmp_path / "study")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 5_000, 100_000])
def test_descriptions_of_many_trials(n):
    """A mebibyte at least takes less than a second; of `repr` all look the same."""
    trials = pd.DataFrame({"pdc": [np.full((50, 2), i, np.float32) for i in range(n)]})
    before = describe(trials)
    trials["pdc"].iloc[n // 2][25, 1] += 1
    assert describe(trials) != before
