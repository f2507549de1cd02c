import math

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import clone

from sklearn_haptic import Sequences, TemporalMaxPool
from sklearn_haptic.features._pooling import cell_bounds, temporal_max_pool


def sequences(lengths=(40, 23, 16), n_columns=3, dtype=np.float64, seed=0):
    rng = np.random.default_rng(seed)
    return [rng.normal(size=(n, n_columns)).astype(dtype) for n in lengths]


@pytest.mark.parametrize("n_items", range(1, 40))
def test_balanced_cells_are_those_of_exact_rounding_up(n_items):
    item = np.arange(1, n_items + 1)
    for n_cells in range(1, n_items + 1):
        cell = np.array([-(-x * n_cells // n_items) for x in item.tolist()])
        members = [np.flatnonzero(cell == c) for c in range(1, n_cells + 1)]
        starts, stops = cell_bounds(n_items, n_cells)
        assert_array_equal(starts, [each[0] for each in members])
        assert_array_equal(stops, [each[-1] + 1 for each in members])


def test_floor_cells_leave_the_remainder_to_the_last():
    starts, stops = cell_bounds(39, 4, "floor")
    assert_array_equal(starts, [0, 9, 18, 27])
    assert_array_equal(stops, [9, 18, 27, 39])


@pytest.mark.parametrize("split", ["balanced", "floor"])
@pytest.mark.parametrize("n_cells", [2, 3, 7, 16, 64])
def test_cells_of_a_short_line_are_an_item_and_its_neighbours(n_cells, split):
    for n_items in range(1, n_cells):
        # On a ruler with 2 * n_items * n_cells marks every middle is at a mark.
        item = np.repeat(np.arange(n_items), 2 * n_cells)
        middle = item.reshape(n_cells, 2 * n_items)[:, n_items]
        starts, stops = cell_bounds(n_items, n_cells, split)
        for cell, start, stop in zip(middle, starts, stops):
            near = [t for t in range(n_items) if abs(t - cell) <= 1]
            assert near == list(range(start, stop))


def cell_of(n_times, i, n, split):
    """The samples of cell i of n, by the rules in words."""
    if n_times < n:
        middle = (2 * i + 1) * n_times // (2 * n)
        return [t for t in range(n_times) if abs(t - middle) <= 1]
    if split == "floor":
        length = n_times // n
        return range(i * length, n_times if i == n - 1 else (i + 1) * length)
    return range(i * n_times // n, (i + 1) * n_times // n)


@pytest.mark.parametrize("split", ["balanced", "floor"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_statistics_equal_a_plain_loop(split, dtype):
    cells, statistics = (16, 5, 1), ("share", "max", "mean")
    X = sequences((40, 23, 16, 9, 2, 1), dtype=dtype)
    for x in X:
        x[np.abs(x) < 0.8] = 0
    X[0] = np.asfortranarray(X[0])  # as frames are
    summary = {
        "max": lambda values: max(values),
        "mean": lambda values: math.fsum(values) / len(values),
        "share": lambda values: sum(v != 0 for v in values) / len(values),
    }
    expected = [
        [
            summary[statistic]([float(x[t, c]) for t in cell_of(len(x), i, n, split)])
            for statistic in statistics
            for n in cells
            for i in range(n)
            for c in range(3)
        ]
        for x in X
    ]
    pool = TemporalMaxPool(cells, split=split, statistics=statistics)
    pooled = pool.fit_transform(X)
    assert pooled.dtype == dtype
    assert_allclose(pooled, expected, rtol=1e-14, atol=8 * np.finfo(dtype).eps)
    names = pool.get_feature_names_out()
    assert pooled.shape[1] == len(names) == len(set(names))
    maxima = ["mean" not in name and "share" not in name for name in names]
    assert_array_equal(
        pooled[:, maxima], TemporalMaxPool(cells, split=split).fit_transform(X)
    )


@pytest.mark.parametrize("n_times", [1, 100_000])
def test_means_and_shares_of_any_length(n_times):
    rng = np.random.default_rng(n_times)
    x = rng.gamma(0.5, size=(n_times, 2)).astype(np.float32)
    x[rng.random(x.shape) < 0.7] = 0
    pool = TemporalMaxPool((1,), statistics=("mean", "share"))
    mean, share = pool.fit_transform([x]).reshape(2, 2)
    assert_allclose(mean, x.astype(float).mean(axis=0), rtol=1e-4)
    assert_allclose(share, (x != 0).mean(axis=0), rtol=1e-6)


@pytest.mark.parametrize("seq", ["seq0", "seq4"])
@pytest.mark.parametrize("variant", ["omp", "omp_sign"])
def test_floor_pooling_equals_the_authors(shared_data, seq, variant):
    with np.load(shared_data / "sthmp_reference" / "sthmp_reference.npz") as reference:
        frames = reference[f"{variant}_{seq}_frame_vectors"]
        final = reference[f"{variant}_{seq}_final"]
        pool = TemporalMaxPool(reference["temporal_levels"], split="floor")
    assert_array_equal(pool.fit_transform([frames])[0], final)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_short_sequences_keep_every_level(dtype):
    (x,) = sequences((3,), dtype=dtype)
    pool = TemporalMaxPool((4, 5, 2, 1)).fit([x, *sequences(dtype=dtype)])
    a, b, c = x
    ab, bc, abc = np.maximum(a, b), np.maximum(b, c), x.max(axis=0)
    # Middles at 1/8, 3/8, 5/8, 7/8; then at 1/10, 3/10, 5/10, 7/10, 9/10.
    expected = [ab, abc, abc, bc, ab, ab, abc, bc, bc, a, bc, abc]
    assert_array_equal(pool.transform([x]), [np.concatenate(expected)])


def test_parameters_set_after_fit_wait_for_the_next_fit():
    X = sequences((40, 23, 7))
    pool = TemporalMaxPool((8, 1)).fit(X)
    expected, names = pool.transform(X), pool.get_feature_names_out()
    pool.set_params(cells=(2,), split="floor")
    assert_array_equal(pool.transform(X), expected)
    assert_array_equal(pool.get_feature_names_out(), names)
    assert_array_equal(
        pool.fit_transform(X), TemporalMaxPool((2,), split="floor").fit_transform(X)
    )


@pytest.mark.parametrize(
    "container",
    [
        tuple,
        pd.Series,
        lambda X: pd.DataFrame({"sensor": X}),
        lambda X: Sequences(X, ["a", "b", "c"]),
        lambda X: np.array([*X, None], dtype=object)[:-1],
        np.stack,
    ],
)
def test_containers_of_trials(container):
    X = sequences((20, 20))
    expected = temporal_max_pool(X)
    assert_array_equal(TemporalMaxPool().fit_transform(container(X)), expected)


def test_trials_of_one_channel_may_be_of_equal_length_later():
    pool = TemporalMaxPool((2, 1)).fit([[1, 2, 3], [4, 5]])
    assert_array_equal(pool.transform([[1, 2], [4, 3]]), [[1, 2, 2], [4, 3, 4]])
    with pytest.raises(ValueError, match=r"^X is a table, .* of one touch \[touch\]"):
        pool.transform(np.ones((60, 1)))


def test_table_is_one_channel_a_row():
    X = np.random.default_rng(0).normal(size=(5, 20))
    pool = TemporalMaxPool().fit(X)
    assert_array_equal(pool.transform(X), temporal_max_pool(X[:, :, None]))
    assert pool.n_features_in_ == 20
    assert pool.get_feature_names_out()[2] == "t3of16_ch0"


def test_names_follow_the_order_of_features():
    pool = TemporalMaxPool((2, 1)).fit(Sequences(sequences((4,), 2), ["a", "b"]))
    assert pool.get_feature_names_out().tolist() == [
        "t1of2_a",
        "t1of2_b",
        "t2of2_a",
        "t2of2_b",
        "t1of1_a",
        "t1of1_b",
    ]
    assert pool.feature_names_in_.dtype == object
    assert TemporalMaxPool((1,)).fit(
        sequences((4,), 2)
    ).get_feature_names_out().tolist() == ["t1of1_ch0", "t1of1_ch1"]


def test_refit_forgets_names():
    pool = TemporalMaxPool((1,)).fit(Sequences(sequences((4,), 2), ["a", "b"]))
    pool.fit(sequences((4,), 2))
    assert not hasattr(pool, "feature_names_in_")


def test_names_given_must_be_those_of_fit():
    pool = TemporalMaxPool((1,)).fit(Sequences(sequences((4,), 2), ["a", "b"]))
    with pytest.raises(ValueError, match="not equal to feature_names_in_"):
        pool.get_feature_names_out(["a", "c"])


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_set_output_names_columns(library):
    X = sequences()
    pool = TemporalMaxPool().set_output(transform=library)
    frame = pool.fit_transform(X)
    assert list(frame.columns) == pool.get_feature_names_out().tolist()
    assert_array_equal(frame.to_numpy(), temporal_max_pool(X))


def test_each_sequence_is_asked_for_once():
    asked = []

    def encode(trial):
        asked.append(len(trial))
        return trial

    X = sequences()
    lazy = Sequences(X, ["a", "b", "c"], encode=encode)
    pooled = TemporalMaxPool().fit_transform(lazy)
    assert asked == [len(x) for x in X]
    assert_array_equal(pooled, temporal_max_pool(X))


def twice(trial):
    return 2 * trial


@pytest.mark.slow
@pytest.mark.parametrize("library", ["default", "pandas"])
def test_cached_rows_are_found_by_content_and_parameters(tmp_path, library):
    variants = [
        (X, params)
        for X in (
            sequences(),
            sequences(seed=1),
            sequences(dtype=np.float32),
            Sequences(sequences(), ["a", "b", "c"]),
            Sequences(sequences(), ["a", "b", "c"], encode=twice),
            pd.Series(sequences(), index=["first", "second", "third"]),
        )
        for params in ({}, {"cells": (2, 1)}, {"cells": (3,), "split": "floor"})
    ]
    for X, params in variants:
        plain = TemporalMaxPool(**params).set_output(transform=library)
        cached = clone(plain).set_params(memory=str(tmp_path))
        expected = plain.fit_transform(X)
        for _ in range(2):  # made, then found
            pooled = cached.fit_transform(X)
            assert_array_equal(pooled, expected)
            if library == "pandas":
                pd.testing.assert_frame_equal(pooled, expected)
    # The series holds the arrays of the first list.
    assert len(list(tmp_path.rglob("output.pkl"))) == 5 * 3


@pytest.mark.parametrize(
    ("X", "message"),
    [
        (sequences((16, 0)), "Trial 1 of X has 0 time samples, but at least 1"),
        (sequences(n_columns=2), "Trial 0 of X has 2 channels, but 3 channels are"),
        ([], "X holds no trials"),
    ],
)
def test_bad_sequences_fail_before_they_are_coded(X, message):
    pool = TemporalMaxPool().fit(sequences())
    names = ["a", "b", "c"][: X[0].shape[1] if X else 3]
    with pytest.raises(ValueError, match=message):
        pool.transform(Sequences(X, names, encode=pytest.fail))


def test_roots_keep_the_sign():
    rng = np.random.default_rng(0)
    trials = [rng.normal(size=(n, 3)) for n in (1, 5, 40)]
    options = {"cells": (4, 1), "statistics": ("mean", "max")}
    pooled = TemporalMaxPool(**options).fit_transform(trials)
    roots = TemporalMaxPool(**options, root=True).fit_transform(trials)
    assert pooled.min() < 0 < pooled.max()
    expected = [[math.copysign(abs(x) ** 0.5, x) for x in row] for row in pooled]
    assert_allclose(roots, expected, rtol=1e-14)
