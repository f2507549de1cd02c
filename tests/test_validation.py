"""Which inputs are tables, which are trials, and what bad ones are told."""

import numpy as np
import pandas as pd
import polars as pl
import pytest
from scipy import sparse

from sklearn_haptic._validation import (
    Sequences,
    check_ratings,
    check_sparsity,
    check_trials,
    is_table,
    row_index,
)

TRIAL = np.arange(6.0).reshape(3, 2)
RAGGED = [TRIAL, TRIAL[:2]]


def object_array(cells):
    array = np.empty(len(cells), dtype=object)
    array[:] = cells
    return array


TABLES = {
    "array": np.eye(3),
    "vector": np.ones(3),
    "lists": [[1, 2], [3, 4]],
    "numbers": [1, 2, 3],
    "empty list": [],
    "string": "abc",
    "scalar": 3,
    "sparse": sparse.csr_array(np.eye(3)),
    "frame": pd.DataFrame({"a": [1.0, 2.0], "b": [3.0, 4.0]}),
    "one-column frame of numbers": pd.DataFrame({"a": [1.0, 2.0]}),
    "polars frame": pl.DataFrame({"a": [1.0, 2.0], "b": [3.0, 4.0]}),
    "objects in two dimensions": np.array([[1, "a"], [2, "b"]], dtype=object),
}
TRIALS = {
    "list": RAGGED,
    "tuple": tuple(RAGGED),
    "three dimensions": np.stack([TRIAL, TRIAL]),
    "object array": object_array(RAGGED),
    "series": pd.Series(RAGGED),
    "one-column frame": pd.DataFrame({"pac": RAGGED}),
    "sequences": Sequences(RAGGED, ["a", "b"]),
    "vectors of two lengths": [[1, 2, 3], [4, 5]],
    "object array of vectors": object_array([np.ones(3), np.ones(3)]),
    "polars lists": pl.DataFrame({"pac": [[1.0, 2.0], [3.0]]}),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables(name):
    assert is_table(TABLES[name])


@pytest.mark.parametrize("name", TRIALS)
def test_trials(name):
    assert not is_table(TRIALS[name])
    trials = check_trials(TRIALS[name])
    assert [trial.ndim for trial in trials] == [2, 2]
    assert all(trial.dtype == np.float64 for trial in trials)


def test_float32_is_kept_and_not_copied_but_mixtures_are_float64():
    single = TRIAL.astype(np.float32)
    assert check_trials([single])[0] is single
    assert {t.dtype.name for t in check_trials([single, TRIAL])} == {"float64"}
    assert check_trials([TRIAL.astype(int)])[0].dtype == np.float64


@pytest.mark.parametrize(
    ("X", "options", "message"),
    [
        ([], {}, "X holds no trials; at least one"),
        ([TRIAL, TRIAL[:, :1]], {}, "Trial 1 of X has 1 channel, but 2 channels are"),
        ([TRIAL], {"n_channels": 3}, "2 channels, but 3 channels are expected, as in"),
        ([np.ones((2, 3, 4))], {}, r"shape \(2, 3, 4\); it must be \(n_times, n_ch"),
        ([TRIAL], {"ndims": (3,)}, r"it must be \(n_times, height, width\)"),
        (
            [np.ones((2, 3, 4)), np.ones((2, 3, 5))],
            {"ndims": (3,)},
            "Trial 1 of X has frames of 3 × 5, but frames of 3 × 4 are expected",
        ),
        ([TRIAL], {"min_times": 4}, "Trial 0 of X has 3 time samples, but at least 4"),
        ([TRIAL, TRIAL * np.nan], {}, "Trial 1 of X contains NaN or infinity"),
        ([[["a", "b"]]], {}, "Trial 0 of X is not an array of numbers"),
        (
            pd.DataFrame({"pac": RAGGED, "pdc": RAGGED}),
            {},
            "several columns of trials; choose one with ColumnTransformer",
        ),
    ],
)
def test_bad_trials(X, options, message):
    with pytest.raises(ValueError, match=message):
        check_trials(X, **options)


def test_row_index():
    series = pd.Series(RAGGED, index=["a", "b"])
    assert row_index(series).tolist() == ["a", "b"]
    assert row_index(Sequences(RAGGED, ["x", "y"], series.index)) is series.index
    assert row_index(RAGGED) is None
    assert row_index(np.eye(2)) is None


def test_sparsity_is_clipped_with_a_warning():
    assert check_sparsity(4, 10) == 4
    with pytest.warns(UserWarning, match="n_nonzero_coefs=4 exceeds n_atoms=3"):
        assert check_sparsity(4, 3) == 3


def test_ratings_in_either_form():
    counts, levels = check_ratings(np.array(["b", "a", "b"]), levels=["a", "b"])
    assert counts.tolist() == [[0, 1], [1, 0], [0, 1]]
    assert levels.tolist() == ["a", "b"]
    counts, levels = check_ratings([[1, 0, 2]])
    assert counts.tolist() == [[1, 0, 2]] and levels.tolist() == [1, 2, 3]
    counts, _ = check_ratings([3, 1], levels=[1, 2, 3, 4, 5])
    assert counts.tolist() == [[0, 0, 1, 0, 0], [1, 0, 0, 0, 0]]
    frame = pd.DataFrame([[0.5, 0.5]], columns=["low", "high"])
    assert check_ratings(frame)[0].tolist() == [[0.5, 0.5]]


@pytest.mark.parametrize(
    ("y", "levels", "message"),
    [
        ([1, 7], [1, 2, 3], r"rating 7 in trial 1, which is not among levels=\[1, 2,"),
        ([[1, 2], [-1, 3]], None, "negative count in trial 1"),
        ([[1, 2], [0, 0]], None, "no ratings in trial 1; remove"),
        ([[1, 2]], [1, 2, 3], "2 columns of counts, but there are 3 levels"),
        ([1, 2], [1, 2, 2], "distinct"),
        ([1, 2], [], "at least one"),
        ([0.5, 1.7], None, "Unknown label type: y has continuous ratings, such as 0.5"),
        ([1.0, np.nan], None, "contains NaN"),
    ],
)
def test_bad_ratings(y, levels, message):
    with pytest.raises(ValueError, match=message):
        check_ratings(y, levels)
