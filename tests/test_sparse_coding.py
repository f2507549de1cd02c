"""Batch OMP against brute-force least squares and the ST-HMP authors' own codes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.linear_model import orthogonal_mp_gram

from sklearn_haptic.features._sparse_coding import batch_omp, dense_codes, row_norms

DTYPES = [np.float64, np.float32]


def random_dictionary(n_atoms, n_features, rng, common=0.0):
    """Unit-norm Gaussian atoms; `common` mixes in a direction that all share."""
    atoms = (1 - common) * rng.normal(size=(n_atoms, n_features))
    atoms += common * np.linspace(-2, 4, n_features)
    return atoms / np.linalg.norm(atoms, axis=1, keepdims=True)


def codes_of(signals, atoms, n_nonzero_coefs, **kwargs):
    return dense_codes(
        *batch_omp(signals, atoms, n_nonzero_coefs, **kwargs), len(atoms)
    )


def brute_force_omp(signal, atoms, n_nonzero_coefs):
    """Orthogonal matching pursuit with a full least-squares solve at every step."""
    signal, atoms = signal.astype(np.float64), atoms.astype(np.float64)
    support, coefs, residual = [], np.empty(0), signal
    for _ in range(n_nonzero_coefs):
        correlations = np.abs(atoms @ residual)
        correlations[support] = 0
        support.append(int(correlations.argmax()))
        coefs = np.linalg.lstsq(atoms[support].T, signal)[0]
        residual = signal - coefs @ atoms[support]
    return support, coefs


@pytest.mark.slow
@pytest.mark.parametrize("common", [0, 0.5, 0.9])
@pytest.mark.parametrize("n_features, n_atoms, n_coefs", [(22, 40, 4), (9, 10, 3)])
@pytest.mark.parametrize("dtype, rtol", [(np.float64, 1e-12), (np.float32, 1e-4)])
def test_equals_brute_force(n_features, n_atoms, n_coefs, common, dtype, rtol):
    rng = np.random.default_rng(0)
    atoms = random_dictionary(n_atoms, n_features, rng, common).astype(dtype)
    signals = rng.normal(size=(300, n_features)).astype(dtype)
    support, coefs = batch_omp(signals, atoms, n_coefs)
    assert coefs.dtype == dtype
    for i, signal in enumerate(signals):
        expected_support, expected = brute_force_omp(signal, atoms, n_coefs)
        assert support[:, i].tolist() == expected_support
        assert_allclose(
            coefs[:, i], expected, rtol=0, atol=rtol * np.abs(expected).max()
        )


def test_rounding_of_single_precision_atoms_is_no_signal():
    """Multiples of atoms take one atom each, whatever the signals are stored in."""
    rng = np.random.default_rng(0)
    atoms = random_dictionary(6, 4, rng).astype(np.float32)
    wanted = random_dictionary(6, 4, np.random.default_rng(0))
    for signals in (2 * atoms, 2.0 * atoms.astype(np.float64), 2 * wanted):
        codes = codes_of(signals, atoms, 2)
        assert_array_equal(codes != 0, np.eye(6, dtype=bool))


@pytest.mark.parametrize("n_signals", [99, 100])  # below and at all pairs of atoms
@pytest.mark.parametrize("dtype", DTYPES)
def test_equal_correlations_go_to_the_first_atom(n_signals, dtype):
    atoms = np.vstack([np.eye(4), -np.eye(4), np.eye(4)[:2]]).astype(dtype)
    signals = np.random.default_rng(11).normal(size=(n_signals, 4)).astype(dtype)
    support, coefs = batch_omp(signals, atoms, 2)
    order = np.abs(signals).argsort(axis=1)[:, :-3:-1]
    assert_array_equal(support.T, order)
    assert_array_equal(coefs.T, np.take_along_axis(signals, order, axis=1))


def test_equals_scikit_learn():
    rng = np.random.default_rng(1)
    atoms = random_dictionary(25, 50, rng)
    signals = rng.normal(size=(50, 50))
    expected = orthogonal_mp_gram(
        atoms @ atoms.T, atoms @ signals.T, n_nonzero_coefs=4
    ).T
    assert_allclose(codes_of(signals, atoms, 4), expected, atol=1e-12)


@pytest.mark.parametrize("problem", ["pac", "pdc", "e19"])
@pytest.mark.parametrize("dtype, rtol", [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_equals_authors_code(shared_data, problem, dtype, rtol):
    with np.load(shared_data / "sthmp_reference" / "omp_reference.npz") as reference:
        # Kind 9 shows the absolute stopping threshold of the authors' code.
        comparable = reference[f"{problem}_kind"] != 9
        signals = reference[f"{problem}_Y"].T[comparable]
        expected = reference[f"{problem}_codes"].T[comparable]
        atoms = reference[f"{problem}_D"].T
        n_coefs = int(reference[f"{problem}_T"])
    codes = codes_of(signals.astype(dtype), atoms.astype(dtype), n_coefs)
    assert_array_equal(codes != 0, expected != 0)
    largest = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(codes - expected) <= rtol * largest).all()


@pytest.mark.parametrize("dtype", DTYPES)
def test_signals_without_information(dtype):
    atoms = random_dictionary(12, 22, np.random.default_rng(4)).astype(dtype)
    assert not codes_of(np.zeros((3, 22), dtype), atoms, 4).any()
    constant = np.repeat(np.array([[0.1], [1e6 + 0.1], [-3e-9]], dtype), 22, axis=1)
    centred = constant - constant.mean(axis=1, keepdims=True)
    assert not codes_of(centred, atoms, 4, scale=row_norms(constant)).any()


@pytest.mark.parametrize("dtype", DTYPES)
def test_dependent_atoms_are_not_combined(dtype):
    rng = np.random.default_rng(5)
    basis = random_dictionary(3, 10, rng)
    atoms = np.vstack([basis, basis, -basis[:1], np.zeros((1, 10))]).astype(dtype)
    signals = rng.normal(size=(200, 10)).astype(dtype)
    codes = codes_of(signals, atoms, 6)
    assert ((codes != 0).sum(axis=1) == 3).all()
    expected = signals @ np.linalg.pinv(atoms[:3]) @ atoms[:3]
    assert_allclose(codes @ atoms, expected, atol=1e3 * np.finfo(dtype).eps)


def test_exact_representation_stops_early():
    atoms = random_dictionary(40, 22, np.random.default_rng(6))
    codes = codes_of(-7.5 * atoms, atoms, 4)
    assert_allclose(codes, -7.5 * np.eye(40), rtol=1e-14)


def test_more_coefficients_than_features_reconstructs():
    rng = np.random.default_rng(7)
    atoms = random_dictionary(12, 4, rng)
    signals = rng.normal(size=(30, 4))
    support, coefs = batch_omp(signals, atoms, 9)
    assert support.shape == coefs.shape == (4, 30)
    assert_allclose(dense_codes(support, coefs, 12) @ atoms, signals, atol=1e-12)


def test_many_signals_are_coded_as_few_are():
    rng = np.random.default_rng(8)
    atoms = random_dictionary(25, 50, rng)
    signals = rng.normal(size=(20_011, 50))
    few = [codes_of(some, atoms, 4) for some in np.array_split(signals, 200)]
    assert_allclose(codes_of(signals, atoms, 4), np.concatenate(few), rtol=1e-12)


def test_more_atoms_than_a_byte_counts():
    rng = np.random.default_rng(9)
    atoms = random_dictionary(300, 30, rng)
    signals = rng.normal(size=(40, 30))
    support, _ = batch_omp(signals, atoms, 1)
    assert_array_equal(support[0], np.abs(signals @ atoms.T).argmax(axis=1))


def test_dense_codes_by_hand():
    support = np.array([[2, 0], [1, 0]])
    coefs = np.array([[3.0, -4.0], [-5.0, 0.0]])
    assert_array_equal(dense_codes(support, coefs, 3), [[0, -5, 3], [-4, 0, 0]])
    assert_array_equal(
        dense_codes(support, coefs, 3, sign="absolute"), [[0, 5, 3], [4, 0, 0]]
    )
    assert_array_equal(
        dense_codes(support, coefs, 3, sign="split"),
        [[0, 0, 3, 0, 5, 0], [0, 0, 0, 4, 0, 0]],
    )


def test_row_norms_at_the_extremes():
    rows = np.array([[3e200, 4e200], [3e-200, 4e-200], [0, 0], [5e-324, 0]])
    assert_allclose(row_norms(rows), [5e200, 5e-200, 0, 5e-324])


def test_float32_codes_over_nearly_parallel_atoms_lose_nothing():
    """To a rounding error of float32, though the Gram matrix is ill-conditioned."""
    rng = np.random.default_rng(0)
    atoms, signals = random_dictionary(5, 12, rng), rng.normal(size=(100, 12))
    atoms[4] = atoms[0] + 0.01 * rng.normal(size=12)
    atoms, signals = atoms.astype(np.float32), signals.astype(np.float32)
    expected = np.linalg.lstsq(atoms.T.astype(np.float64), signals.T.astype(float))[0].T
    error = np.abs(codes_of(signals, atoms, 5) - expected)
    assert (error.max(axis=1) <= 1e-7 * np.abs(expected).max(axis=1)).all()


@pytest.mark.parametrize("distance, n_taken", [(1e-7, 2), (3e-8, 1)])
def test_atoms_within_the_root_of_rounding_count_as_one(distance, n_taken):
    rng = np.random.default_rng(0)
    atoms = np.eye(2, 6)
    atoms[1] = atoms[0] + distance * atoms[1]
    codes = codes_of(rng.normal(size=(50, 6)), atoms, 2)
    assert ((codes != 0).sum(axis=1) == n_taken).all()
