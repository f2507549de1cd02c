"""Sparse coding, K-SVD, ST-HMP and pooling where numbers or shapes are extreme.

Judges are exact rational arithmetic, mpmath, least squares by SVD, brute force, and
powers of two, which must change no digit.
"""

import math
import warnings
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import clone
from sklearn.pipeline import make_pipeline

from sklearn_haptic import (
    KSVDTransformer,
    RepairTrials,
    SignalStatistics,
    STHMPTransformer,
    TemporalMaxPool,
)
from sklearn_haptic.features._ksvd import initial_atoms, ksvd
from sklearn_haptic.features._ksvd_transformer import sliding_windows
from sklearn_haptic.features._sparse_coding import (
    batch_omp,
    dense_codes,
    row_norms,
    unit_rows,
)
from sklearn_haptic.features._sthmp import normalise_frames, spatial_max_pool

DTYPES = [np.float64, np.float32]
# Near 1e-150 and 1e150, or 1e-30 and 1e30, as powers of two.
EXTREMES = [(np.float64, -498), (np.float64, 498), (np.float32, -99), (np.float32, 99)]

repeatable = settings(derandomize=True, deadline=None, max_examples=60)


def whole_numbers(n_rows, n_columns):
    """Matrices of small integers, whose rows are often zero, equal or collinear."""
    return hnp.arrays(np.int64, (n_rows, n_columns), elements=st.integers(-3, 3))


def any_numbers(dtype, n_rows, n_columns):
    """Matrices of finite numbers of any magnitude, subnormal ones included."""
    elements = hnp.from_dtype(np.dtype(dtype), allow_nan=False, allow_infinity=False)
    return hnp.arrays(dtype, (n_rows, n_columns), elements=elements)


@st.composite
def coding_problems(draw):
    """Signals and atoms of small integers, and a sparsity that may exceed both."""
    n_features = draw(st.integers(1, 5))
    return (
        draw(whole_numbers(draw(st.integers(1, 4)), n_features)),
        draw(whole_numbers(draw(st.integers(1, 8)), n_features)),
        draw(st.integers(1, 10)),
    )


def recordings(n_channels, lengths=(40, 31), seed=0, high=256):
    """Whole-number recordings, which every data type of at least a byte holds."""
    rng = np.random.default_rng(seed)
    return [rng.integers(0, high, (n, n_channels)) for n in lengths]


def small_ksvd(**params):
    return KSVDTransformer(
        **{"n_atoms": 6, "n_nonzero_coefs": 3, "max_iter": 2, "random_state": 0}
        | {"window": 10}
        | params
    )


def small_sthmp(**params):
    return STHMPTransformer(
        **{"n_atoms": 6, "n_nonzero_coefs": 3, "max_iter": 2, "random_state": 0}
        | params
    )


# Norms


@pytest.mark.slow
@repeatable
@given(st.sampled_from(DTYPES).flatmap(lambda dtype: any_numbers(dtype, 3, 4)))
def test_norms_of_any_numbers(rows):
    eps = np.finfo(rows.dtype).eps
    norms, units, frames = row_norms(rows), unit_rows(rows), rows.copy()
    normalise_frames(frames)
    for row, norm, unit, frame in zip(rows.tolist(), norms, units, frames):
        exact = mpmath.sqrt(mpmath.fsum(mpmath.mpf(x) ** 2 for x in row))
        assert norm == pytest.approx(float(exact), rel=1e-15, abs=5e-324)
        expected = [float(x / exact) if exact else 0 for x in row]
        assert_allclose(unit, expected, rtol=0, atol=eps)
        assert_allclose(frame, expected, rtol=0, atol=4 * eps)


# Batch OMP


def as_fractions(integers):
    return np.vectorize(lambda i: Fraction(int(i)), otypes=[object])(integers)


def solve_exactly(matrix, right):
    """Solve a regular system of Fractions by Gauss–Jordan elimination."""
    rows = np.column_stack([matrix, right])
    for i in range(len(rows)):
        pivot = i + np.flatnonzero(rows[i:, i])[0]
        rows[[i, pivot]] = rows[[pivot, i]]
        rows[i] = rows[i] / rows[i, i]
        others = np.arange(len(rows)) != i
        rows[others] = rows[others] - np.outer(rows[others, i], rows[i])
    return rows[:, -1]


@pytest.mark.slow
@repeatable
@given(coding_problems(), st.sampled_from(DTYPES))
def test_every_step_is_one_of_exact_omp(problem, dtype):
    signals, atoms, n_nonzero_coefs = problem
    support, coefs = batch_omp(
        signals.astype(dtype), atoms.astype(dtype), n_nonzero_coefs
    )
    n_slots = min(n_nonzero_coefs, *atoms.shape)
    assert support.shape == coefs.shape == (n_slots, len(signals))
    rtol = float(1e4 * np.finfo(dtype).eps)
    atoms = as_fractions(atoms)
    squares = np.maximum((atoms**2).sum(axis=1), 1)
    for residual, taken, values in zip(as_fractions(signals), support.T, coefs.T):
        signal, expected = residual, np.empty(0)
        for k, j in enumerate(taken):
            scores = (atoms @ residual) ** 2 / squares  # of the cosine, as atoms rank
            if not values[k:].any():  # nothing is left to explain
                assert max(scores) == 0
                break
            assert scores[j] >= max(scores) * Fraction(1 - rtol)
            used = atoms[taken[: k + 1]]
            expected = solve_exactly(used @ used.T, used @ signal)
            residual = signal - expected @ used
        size = float(max(abs(expected), default=0))
        assert_allclose(
            values[: len(expected)], expected.astype(float), rtol=0, atol=rtol * size
        )


@pytest.mark.slow
@repeatable
@given(coding_problems(), st.sampled_from(DTYPES), st.data())
def test_powers_of_two_change_no_digit_of_codes(problem, dtype, data):
    signals, atoms, n_nonzero_coefs = problem
    largest = 400 if dtype is np.float64 else 40
    e, f = data.draw(st.tuples(*[st.integers(-largest, largest)] * 2))
    signals, atoms = signals.astype(dtype), atoms.astype(dtype)
    support, coefs = batch_omp(signals, atoms, n_nonzero_coefs)
    scaled_support, scaled_coefs = batch_omp(
        np.ldexp(signals, e), np.ldexp(atoms, f), n_nonzero_coefs
    )
    assert_array_equal(scaled_support, support)
    assert_array_equal(scaled_coefs, np.ldexp(coefs, e - f))


@pytest.mark.slow
@repeatable
@given(coding_problems(), st.sampled_from(DTYPES))
def test_subnormal_signals_lose_no_digit(problem, dtype):
    signals, _, n_nonzero_coefs = problem
    smallest = np.finfo(dtype).smallest_subnormal
    signals = signals.astype(dtype)
    axes = np.eye(signals.shape[1], dtype=dtype)
    codes = dense_codes(
        *batch_omp(signals * smallest, axes, n_nonzero_coefs), len(axes)
    )
    kept = np.argsort(-np.abs(signals), axis=1, kind="stable")[:, :n_nonzero_coefs]
    expected = np.zeros_like(signals)
    np.put_along_axis(expected, kept, np.take_along_axis(signals, kept, 1), 1)
    assert_array_equal(codes, expected * smallest)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("closeness", [1e-1, 1e-2, 1e-3])
def test_error_of_coefficients_over_nearly_dependent_atoms(dtype, closeness):
    rng = np.random.default_rng(0)
    atoms = rng.normal(size=(5, 12))
    atoms[4] = rng.normal(size=4) @ atoms[:4] + closeness * rng.normal(size=12)
    atoms = unit_rows(atoms).astype(dtype)
    signals = rng.normal(size=(300, 12)).astype(dtype)
    support, coefs = batch_omp(signals, atoms, 5)
    for signal, taken, values in zip(signals, support.T, coefs.T):
        used = atoms[taken[values != 0]].astype(np.float64)
        expected = np.linalg.lstsq(used.T, signal.astype(np.float64))[0]
        error = np.abs(values[values != 0] - expected).max() / np.abs(expected).max()
        assert error <= 8 * np.finfo(dtype).eps * np.linalg.cond(used @ used.T)


def test_atoms_identical_but_for_rounding_share_no_code():
    rng = np.random.default_rng(0)
    atom = unit_rows(rng.normal(size=(1, 9)))
    atoms = np.vstack([atom, np.nextafter(atom, 1), -np.nextafter(atom, -1), 0 * atom])
    signals = rng.normal(size=(50, 9))
    codes = dense_codes(*batch_omp(signals, atoms, 4), 4)
    assert ((codes != 0).sum(axis=1) == 1).all()
    assert_allclose(np.abs(codes.sum(axis=1)), np.abs(signals @ atom[0]), rtol=1e-12)


def test_many_coefficients_of_signals_of_few_directions():
    """Pursuits end early, and nothing may overflow thereafter."""
    rng = np.random.default_rng(0)
    rise = np.minimum(np.arange(500)[:, np.newaxis] / 100, 1)
    touches = [
        100 + rng.uniform(1, 30) * rise + 0.01 * rng.normal(size=(500, 1))
        for _ in range(10)
    ]
    settings = {"window": 50, "max_iter": 0, "remove_mean": False, "random_state": 0}
    for dtype in DTYPES:
        arrays = [touch.astype(dtype) for touch in touches]
        errors = [
            KSVDTransformer(25, n, **settings).fit(arrays).reconstruction_error_
            for n in (2, 16, 20, 25)
        ]
        assert max(errors[1:]) <= errors[0]


# K-SVD


class FillsTheStack(np.random.RandomState):
    """Leave signalling NaNs where BLAS may read scratch, before atoms are updated."""

    def permutation(self, n):
        nans = np.full(800, 0x7F800001, dtype=np.uint32).view(np.float32)
        with np.errstate(invalid="ignore"):
            for k in (100, 200, 400):
                np.ones((4, k), dtype=np.float32) @ nans[: 2 * k : 2]
        return super().permutation(n)


def test_scratch_memory_of_blas_raises_no_warning():
    signals = np.random.RandomState(0).normal(size=(18, 5)).astype(np.float32)
    rng = FillsTheStack(0)
    atoms, _ = ksvd(signals, initial_atoms(signals, 2, rng), 2, max_iter=3, rng=rng)
    assert_allclose(row_norms(atoms), 1, rtol=1e-6)


@pytest.mark.slow
@repeatable
@given(
    problem=coding_problems(),
    n_atoms=st.integers(1, 9),
    update=st.sampled_from(["approximate", "exact"]),
    remove_mean=st.booleans(),
    extreme=st.sampled_from(EXTREMES),
)
def test_fit_of_any_table_of_whole_numbers(
    problem, n_atoms, update, remove_mean, extreme
):
    X, _, n_nonzero_coefs = problem
    dtype, exponent = extreme
    X = np.repeat(X, 3, axis=0).astype(dtype)  # an atom needs users to stay
    model = KSVDTransformer(
        n_atoms,
        n_nonzero_coefs,
        update=update,
        remove_mean=remove_mean,
        max_iter=3,
        sign="none",
        random_state=0,
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "n_nonzero_coefs=.* exceeds n_atoms")
        codes = model.fit_transform(X)
        scaled = clone(model)
        scaled_codes = scaled.fit_transform(np.ldexp(X, exponent))
    eps = float(np.finfo(dtype).eps)
    atoms = model.components_
    assert_allclose(row_norms(atoms), 1, rtol=8 * eps)
    n_slots = min(n_nonzero_coefs, *atoms.shape)
    assert ((codes != 0).sum(axis=1) <= n_slots).all()
    # Codes are least squares over their atoms, the error is what they leave.
    signals = X - X.mean(axis=1, keepdims=True) if remove_mean else X
    residual = signals - codes @ atoms
    for signal, code, rest in zip(signals, codes, residual):
        used = atoms[code != 0].T
        best = signal - used @ np.linalg.lstsq(used, signal)[0]
        assert_allclose(rest, best, rtol=0, atol=1e4 * eps)
    error = np.sqrt(np.mean(residual**2))
    assert model.reconstruction_error_ == pytest.approx(error, abs=1e2 * eps)

    assert_array_equal(scaled.components_, atoms)
    assert_array_equal(scaled_codes, np.ldexp(codes, exponent))
    assert scaled.reconstruction_error_ == pytest.approx(
        np.ldexp(error, exponent), rel=1e-6, abs=np.ldexp(1e2 * eps, exponent)
    )


@pytest.mark.parametrize("dtype, exponent", EXTREMES)
@pytest.mark.parametrize("remove_mean", [True, False])
def test_powers_of_two_change_no_digit_of_windows(dtype, exponent, remove_mean):
    trials = [trial.astype(dtype) for trial in recordings(2)]
    model = small_ksvd(remove_mean=remove_mean)
    codes = model.fit_transform(trials)
    scaled = clone(model)
    scaled_codes = scaled.fit_transform([np.ldexp(each, exponent) for each in trials])
    assert_array_equal(scaled.components_, model.components_)
    for each, expected in zip(scaled_codes, codes):
        assert_array_equal(each, np.ldexp(expected, exponent))


@pytest.mark.parametrize("remove_mean", [True, False])
def test_saturated_runs_of_a_converter_of_12_bits(remove_mean):
    counts = np.random.default_rng(0).integers(0, 4096, (120, 1)).astype(np.int16)
    counts[20:60], counts[60:100] = 0, 4095
    model = small_ksvd(remove_mean=remove_mean, sign="none")
    codes = model.fit_transform([counts])[0]
    windows = sliding_windows(counts.astype(float), 10, 0.5)[:, 0]
    flat = np.ptp(windows, axis=1) == 0
    assert flat.sum() == 14
    if remove_mean:
        assert not codes[flat].any()
        windows = windows - windows.mean(axis=1, keepdims=True)
    assert not codes[~windows.any(axis=1)].any()
    for window, code in zip(windows, codes):
        used = model.components_[code != 0]
        expected = np.linalg.lstsq(used.T, window)[0]
        assert_allclose(code[code != 0], expected, rtol=1e-9)


def test_a_sensor_stuck_at_either_rail():
    stuck = [np.full((30, 38), rail, dtype=np.uint16) for rail in (0, 4095)]
    for model in (small_ksvd(), small_sthmp()):
        for codes in model.fit_transform(stuck):
            assert not codes.any()
        assert model.reconstruction_error_ == 0


# ST-HMP


@pytest.mark.parametrize("dtype, exponent", EXTREMES)
def test_powers_of_two_change_no_digit_of_frames(dtype, exponent):
    trials = [trial.astype(dtype) for trial in recordings(38)]
    model = small_sthmp()
    frames = model.fit_transform(trials)
    scaled = clone(model)
    scaled_frames = scaled.fit_transform([np.ldexp(each, exponent) for each in trials])
    assert_array_equal(scaled.components_, model.components_)
    for each, expected in zip(scaled_frames, frames):
        assert each.dtype == dtype
        assert_array_equal(each, expected)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("level", [0, 1234.7, -4095])
def test_one_pixel_above_a_constant_frame(dtype, level):
    images = np.full((1, 7, 6), level, dtype)
    images[0, 0, 0] += 1
    model = small_sthmp(layout=None).fit(
        np.random.default_rng(0).normal(size=(3, 5, 7, 6)).astype(dtype)
    )
    frame = model.transform(images[np.newaxis])[0][0].reshape(14, -1)
    touched = frame.any(axis=1)
    # The first cell of each grid of the pyramid holds the corner.
    assert_array_equal(np.flatnonzero(touched), [0, 9, 13])
    assert math.hypot(*frame.ravel()) == pytest.approx(1, rel=1e-6)


# Layouts and data types


def strided(trial):
    wide = np.zeros((2 * len(trial), 3 * trial.shape[1]), trial.dtype)
    wide[::2, ::3] = trial
    return wide[::2, ::3]


def read_only(trial):
    trial = trial.copy()
    trial.flags.writeable = False
    return trial


def unaligned(trial):
    memory = np.zeros(trial.nbytes + 1, np.uint8)[1:]
    memory[:] = trial.view(np.uint8).ravel()
    return memory.view(trial.dtype).reshape(trial.shape)


def memory_mapped(trial, folder):
    path = folder / f"{len(trial)}_{trial.dtype}.npy"
    np.save(path, trial)
    return np.load(path, mmap_mode="r")


LAYOUTS = {
    "Fortran": np.asfortranarray,
    "strided": strided,
    "reversed": lambda trial: trial[::-1, ::-1].copy()[::-1, ::-1],
    "read-only": read_only,
    "unaligned": unaligned,
    "big-endian": lambda trial: trial.astype(trial.dtype.newbyteorder(">")),
}
STEPS = {
    "ksvd": small_ksvd(),
    "sthmp": small_sthmp(),
    "pool": TemporalMaxPool((4, 2, 1)),
    "ksvd of a table": small_ksvd(window=None),
    "pool of a table": TemporalMaxPool((4, 2, 1)),
    "means and shares": TemporalMaxPool((4, 1), statistics=("mean", "share")),
    "statistics": SignalStatistics(),
    "statistics of a table": SignalStatistics(),
    "repair": RepairTrials(rest=2),
}


def table_or_trials(step, trials):
    return trials[0] if step.endswith("table") else trials


def assert_equal_results(X, expected_X, step):
    before = [np.array(each) for each in X]
    model, expected = clone(STEPS[step]), clone(STEPS[step])
    results = model.fit_transform(X)
    for each, wanted in zip(results, expected.fit_transform(expected_X)):
        assert_array_equal(each, wanted)
        assert each.dtype == wanted.dtype
    for each, untouched in zip(X, before):
        assert_array_equal(each, untouched)


@pytest.mark.slow
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("layout", [*LAYOUTS, "memory-mapped"])
def test_layout_in_memory_changes_nothing(step, dtype, layout, tmp_path):
    plain = [trial.astype(dtype) for trial in recordings(38)]
    if layout == "memory-mapped":
        trials = [memory_mapped(trial, tmp_path) for trial in plain]
    else:
        trials = [LAYOUTS[layout](trial) for trial in plain]
    if layout == "big-endian":  # converted, to float64
        plain = [trial.astype(np.float64) for trial in plain]
    assert_equal_results(
        table_or_trials(step, trials), table_or_trials(step, plain), step
    )


@pytest.mark.slow
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("dtype", [bool, ">i2", "u8", "f2"])
def test_whole_numbers_are_taken_for_float64(step, dtype):
    trials = [trial.astype(dtype) for trial in recordings(38, high=250)]
    floats = [trial.astype(np.float64) for trial in trials]
    assert_equal_results(
        table_or_trials(step, trials), table_or_trials(step, floats), step
    )


def test_given_atoms_are_copied():
    atoms = unit_rows(np.random.default_rng(0).normal(size=(6, 10)))
    model = small_ksvd(dict_init=atoms, max_iter=0).fit(recordings(2))
    assert not np.shares_memory(model.components_, atoms)


# Pooling


@pytest.mark.slow
@repeatable
@given(
    sequences=st.sampled_from(DTYPES).flatmap(
        lambda dtype: st.lists(
            st.integers(1, 20).flatmap(lambda n: any_numbers(dtype, n, 2)),
            min_size=1,
            max_size=3,
        )
    ),
    cells=st.lists(st.integers(1, 20), min_size=1, max_size=4, unique=True),
    split=st.sampled_from(["balanced", "floor"]),
)
def test_pooling_of_any_numbers(sequences, cells, split):
    def covers(cell, n_cells, t, n_times):
        if n_times < n_cells:  # the middle is in the sample or one beside it
            middle = Fraction(2 * cell + 1, 2 * n_cells) * n_times
            return t - 1 <= middle < t + 2
        if split == "floor":
            return min(t // (n_times // n_cells), n_cells - 1) == cell
        return math.ceil(Fraction((t + 1) * n_cells, n_times)) - 1 == cell

    pooled = TemporalMaxPool(cells, split=split).fit_transform(sequences)
    assert pooled.dtype == sequences[0].dtype
    for row, sequence in zip(pooled, sequences):
        expected = [
            max(
                value
                for t, value in enumerate(sequence[:, column].tolist())
                if covers(c, n, t, len(sequence))
            )
            for n in cells
            for c in range(n)
            for column in range(2)
        ]
        assert_array_equal(row, expected)


def test_one_frame():
    frame = np.array([[-3.0, 0.0, 5e-324]])
    pooled = TemporalMaxPool().fit_transform([frame])
    assert_array_equal(pooled.reshape(31, 3), np.repeat(frame, 31, axis=0))
    touch = [trial[:1] for trial in recordings(19)]
    features = make_pipeline(small_sthmp(), TemporalMaxPool()).fit_transform(touch)
    assert_allclose(row_norms(features.reshape(len(touch) * 31, -1)), 1)


def test_cells_without_a_positive_code_keep_the_largest_negative_one():
    codes = -np.random.default_rng(0).uniform(1, 2, size=(5, 4, 3, 6))
    assert_array_equal(spatial_max_pool(codes, [(1, 1)])[0], codes.max(axis=(0, 1)))
    pooled = TemporalMaxPool((2, 1)).fit_transform([codes[0, 0].T])
    assert (pooled < -1).all()


# What cannot be computed is refused


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("model", [small_ksvd(), small_sthmp()])
def test_sums_that_overflow(model, dtype):
    trials = recordings(38, high=2)
    model.fit([trial.astype(dtype) for trial in trials])
    huge = [(trial * np.finfo(dtype).max).astype(dtype) for trial in trials]
    message = f"sums overflow {np.dtype(dtype)}; divide X by a constant"
    with pytest.raises(ValueError, match=message):
        list(model.transform(huge))
    with pytest.raises(ValueError, match=message):
        model.fit(huge)


@pytest.mark.parametrize(
    "dtype, size, message",
    [
        (np.float64, 1e-310, "norm of atom 0 is outside the normal range of float64"),
        (np.float64, 1.7e308, "norm of atom 0 is outside the normal range of float64"),
        (np.float64, 1e-300, "The codes overflow float64: .* multiply dict_init"),
        (np.float32, 1e-30, "The codes overflow float32: .* multiply dict_init"),
    ],
)
def test_atoms_of_a_size_that_codes_cannot_have(dtype, size, message):
    X = np.full((3, 4), 1e20, dtype)
    atoms = np.full((1, 4), size, dtype)
    model = KSVDTransformer(1, 1, dict_init=atoms, max_iter=0, remove_mean=False)
    with pytest.raises(ValueError, match=message):
        model.fit(X)
