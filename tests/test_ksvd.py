"""K-SVD against the runs of the ST-HMP authors, planted atoms and the SVD."""

import numpy as np
import pytest
from sklearn.datasets import make_sparse_coded_signal

from sklearn_haptic.features._ksvd import initial_atoms, ksvd

DTYPES = [np.float64, np.float32]


class StoredOrders:
    """Replays stored permutations in place of a random generator."""

    def __init__(self, orders):
        self._orders = iter(orders)

    def permutation(self, n):
        return next(self._orders)


@pytest.fixture(scope="module")
def reference(shared_data):
    with np.load(shared_data / "sthmp_reference" / "ksvd_reference.npz") as arrays:
        return dict(arrays)


@pytest.mark.parametrize("problem", ["tactile", "planted"])
@pytest.mark.parametrize("update, key", [("approximate", "approx"), ("exact", "exact")])
class TestAuthorsCode:
    def run(self, reference, problem, update, rng):
        return ksvd(
            reference[f"{problem}_Y"].T,
            reference[f"{problem}_D0"].T,
            3,
            update=update,
            max_iter=10,
            tol=0,
            rng=rng,
        )

    @pytest.mark.slow
    def test_replay(self, reference, problem, update, key):
        prefix = f"{problem}_{key}"
        for seed, orders in enumerate(reference[f"{prefix}_order"]):
            atoms, errors = self.run(reference, problem, update, StoredOrders(orders))
            np.testing.assert_allclose(
                errors, reference[f"{prefix}_rmse"][seed], rtol=1e-10
            )
            expected = reference[f"{prefix}_D"][seed].T
            cosines = np.einsum("ij,ij->i", atoms, expected)
            np.testing.assert_allclose(np.abs(cosines), 1, atol=1e-10)

    @pytest.mark.slow
    def test_own_orders_do_as_well(self, reference, problem, update, key):
        theirs = reference[f"{problem}_{key}_rmse"][:, -1]
        ours = [
            self.run(reference, problem, update, np.random.RandomState(seed))[1][-1]
            for seed in range(10)
        ]
        assert np.mean(ours) <= theirs.mean() + theirs.std(ddof=1)


@pytest.mark.slow
@pytest.mark.parametrize("update", ["approximate", "exact"])
@pytest.mark.parametrize("dtype", DTYPES)
def test_recovers_planted_atoms(update, dtype):
    signals, planted, _ = make_sparse_coded_signal(
        n_samples=600, n_components=8, n_features=12, n_nonzero_coefs=2, random_state=0
    )
    signals = signals.astype(dtype)
    best = None
    for seed in range(5):
        rng = np.random.RandomState(seed)
        atoms, errors = ksvd(
            signals, initial_atoms(signals, 8, rng), 2, update=update, rng=rng
        )
        assert atoms.dtype == dtype
        if best is None or errors[-1] < best[0]:
            best = errors[-1], atoms
    assert (np.abs(best[1] @ planted.T).max(axis=0) > 0.99).all()


def test_exact_update_of_one_atom_is_the_leading_singular_vector():
    signals = np.random.default_rng(0).normal(size=(50, 6)) * np.arange(1, 7)
    atoms, errors = ksvd(
        signals,
        signals[:1] / np.linalg.norm(signals[0]),
        1,
        update="exact",
        max_iter=1,
        rng=np.random.RandomState(0),
    )
    _, singular, directions = np.linalg.svd(signals)
    assert abs(atoms[0] @ directions[0]) == pytest.approx(1, abs=1e-12)
    assert errors[0] == pytest.approx(np.sqrt((singular[1:] ** 2).sum() / signals.size))


@pytest.mark.parametrize("update", ["approximate", "exact"])
@pytest.mark.parametrize("dtype, faint", [(np.float64, 1e-120), (np.float32, 1e-15)])
def test_atoms_of_faint_signals_are_fitted(update, dtype, faint):
    rng = np.random.RandomState(0)
    planted = np.linalg.qr(rng.normal(size=(6, 2)))[0].T
    strengths = np.kron(np.diag([1, faint]), rng.uniform(1, 2, size=(20, 1)))
    start = planted + 0.1 * rng.normal(size=planted.shape)
    atoms, _ = ksvd(
        (strengths @ planted).astype(dtype),
        (start / np.linalg.norm(start, axis=1, keepdims=True)).astype(dtype),
        1,
        update=update,
        rng=rng,
    )
    cosines = np.abs(np.einsum("ij,ij->i", atoms, planted))
    np.testing.assert_allclose(cosines, 1, atol=1e-6)


def test_stops_once_five_iterations_lower_the_error_too_little():
    rng = np.random.default_rng(0)
    signals = rng.normal(size=(300, 10))
    start = signals[:6] / np.linalg.norm(signals[:6], axis=1, keepdims=True)
    _, all_errors = ksvd(
        signals, start, 2, max_iter=40, tol=0, rng=np.random.RandomState(0)
    )
    _, errors = ksvd(
        signals, start, 2, max_iter=40, tol=1e-2, rng=np.random.RandomState(0)
    )
    gains = [
        1 - all_errors[n - 5 : n].min() / all_errors[: n - 5].min()
        for n in range(6, len(all_errors) + 1)
    ]
    assert len(errors) == 6 + np.argmax(np.array(gains) <= 1e-2) < len(all_errors)
    np.testing.assert_array_equal(errors, all_errors[: len(errors)])


@pytest.mark.parametrize("n_users, expected", [(3, [0, 2]), (4, [0, 1])])
def test_an_atom_with_fewer_than_four_users_is_replaced(n_users, expected):
    """By the only signal that no atom represents."""
    axes = np.repeat(np.arange(3), [10, n_users, 1])
    atoms, _ = ksvd(
        np.eye(3)[axes], np.eye(3)[:2], 1, max_iter=1, rng=np.random.RandomState(0)
    )
    np.testing.assert_allclose(atoms, np.eye(3)[expected])


@pytest.mark.parametrize("level", [0, 10, 1e5])
def test_a_constant_level_leaves_no_atom_to_chance(level):
    """All windows are nearly parallel then, and all atoms but one were random."""
    rng = np.random.RandomState(0)
    time = np.arange(12)[:, None]
    varying = np.hstack((np.cos(time), np.sin(time), time % 2))
    signals = rng.normal(size=(60, 3)) @ varying.T + level
    atoms = initial_atoms(signals, 4 if level else 3, rng)
    basis = np.linalg.qr(np.hstack((np.ones_like(time), varying)))[0]
    np.testing.assert_allclose(atoms @ basis @ basis.T, atoms, atol=1e-9)
    assert np.linalg.matrix_rank(atoms) == len(atoms)


def test_initial_atoms_are_distinct_training_signals():
    rng = np.random.RandomState(0)
    directions = rng.normal(size=(5, 8))
    signals = np.repeat(directions, 10, axis=0) * rng.normal(size=(50, 1))
    signals[::7] = 0
    atoms = initial_atoms(signals, 7, rng)
    np.testing.assert_allclose(np.linalg.norm(atoms, axis=1), 1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    from_signals = np.abs(atoms @ directions.T) > 1 - 1e-12
    # Each direction once, then random ones.
    assert from_signals.sum(axis=0).tolist() == [1] * 5
    assert from_signals.any(axis=1).tolist() == [True] * 5 + [False] * 2
