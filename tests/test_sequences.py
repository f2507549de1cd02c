"""Sequences that a user makes."""

import re

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline, make_union

from sklearn_haptic import (
    KSVDTransformer,
    Sequences,
    SignalStatistics,
    TemporalMaxPool,
)

ARRAYS = [[[1.0, 2.0]], [[3.0, 4.0], [5.0, 6.0]]]
NAMES = ["a", "b"]


@pytest.mark.parametrize(
    ("trials", "names", "options", "message"),
    [
        ("ab", NAMES, {}, "Trial 0 has shape ()"),
        ([[1.0, 2.0]], NAMES, {}, "Trial 0 has shape (2,); it must be (n_times, 2)"),
        (ARRAYS, ["a"], {}, "Trial 0 has shape (1, 2); it must be (n_times, 1)"),
        ([[[1.0], [1.0, 2.0]]], NAMES, {}, "Trial 0 is no array of one shape"),
        ([[["x", "y"]]], NAMES, {}, "Trial 0 holds values that are not finite real"),
        ([[[1j, 2.0]]], NAMES, {}, "Complex data not supported"),
        ([*ARRAYS, [[0, np.nan]]], NAMES, {}, "Trial 2 holds values that are not"),
        (ARRAYS, "ab", {}, "feature_names='ab' must list one name per column"),
        (ARRAYS, NAMES, {"lengths": [1]}, "lengths has 1 entries for 2 trials"),
        (ARRAYS, NAMES, {"row_index": pd.Index([*"xyz"])}, "row_index has 3 entries"),
    ],
)
def test_bad_input(trials, names, options, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        Sequences(trials, names, **options)


@pytest.mark.parametrize(
    ("dtypes", "expected"),
    [
        (["float32", "float32"], "float32"),
        (["float32", "float64"], "float64"),
        (["int64", "float32"], "float64"),
    ],
)
def test_arrays_share_a_data_type(dtypes, expected):
    arrays = [np.array(array, dtype) for array, dtype in zip(ARRAYS, dtypes)]
    sequences = Sequences(arrays, NAMES)
    assert {array.dtype.name for array in sequences} == {expected}
    pooled = TemporalMaxPool(cells=(1,)).fit_transform(sequences)
    assert pooled.dtype == expected
    np.testing.assert_array_equal(pooled, [[1, 2], [5, 6]])


def test_rows_of_a_table_may_come_as_a_list():
    table = np.random.default_rng(0).normal(size=(6, 20))
    features = SignalStatistics().fit(table)
    expected = features.transform(table)
    np.testing.assert_array_equal(features.transform(list(table)), expected)
    np.testing.assert_allclose(features.transform([table[2]]), expected[2:3])
    with pytest.raises(ValueError, match="fit was given a table"):
        features.transform([table[0], table[1][:5]])


def test_channels_with_numbers_for_names_are_put_in_the_order_of_the_first():
    rng = np.random.default_rng(0)
    trials = [pd.DataFrame(rng.normal([0, 5, 9], size=(n, 3))) for n in (20, 30)]
    wiring = [2, 0, 1]
    mixed = [trials[0][wiring], trials[1]]
    features = SignalStatistics()
    expected = features.fit_transform([trial[wiring].to_numpy() for trial in trials])
    np.testing.assert_array_equal(features.fit_transform(mixed), expected)
    np.testing.assert_array_equal(features.transform(mixed[:1]), expected[:1])


@pytest.mark.parametrize("kind", [bool, int, np.int8, np.float16])
def test_encoded_arrays_of_any_numbers_are_pooled_as_floats(kind):
    trials = [np.array([[0, 1], [1, 1], [1, 0], [0, 1.0]])] * 2
    lazy = Sequences(trials, ["a", "b"], encode=lambda trial: trial.astype(kind))
    pool = TemporalMaxPool((1,), statistics=("mean", "share"))
    np.testing.assert_array_equal(pool.fit_transform(lazy), [[0.5, 0.75] * 2] * 2)


def test_a_union_does_not_join_coders_in_time():
    """Of touches of one length, NumPy would put one's windows behind the other's."""
    trials = list(np.random.default_rng(0).normal(size=(12, 300, 1)))
    coders = [KSVDTransformer(4, 2, window=w, random_state=0) for w in (20, 60)]
    with pytest.raises(TypeError, match="put a TemporalMaxPool behind each"):
        make_pipeline(make_union(*coders), TemporalMaxPool()).fit(trials)
    pooled = [make_pipeline(coder, TemporalMaxPool((1,))) for coder in coders]
    codes = [coder.fit_transform(trials) for coder in coders]
    expected = [np.max(list(each), axis=1) for each in codes]
    joined = make_union(*pooled).fit_transform(trials)
    np.testing.assert_array_equal(joined, np.hstack(expected))
    assert np.vstack(codes[0]).shape == (sum(codes[0].lengths), 8)
