"""K-SVD: learn a dictionary over which signals have sparse codes.

Signals and atoms are rows.
"""

import numpy as np
from scipy.linalg import get_blas_funcs

from ._sparse_coding import (
    batch_omp,
    dense_codes,
    product,
    rounding_level,
    row_norms,
    unit_rows,
)

# An atom is replaced if it is more coherent with another, or has fewer users.
_MAX_COHERENCE = 0.99
_MIN_USERS = 4

# The power of two up to which squares of signals neither overflow nor underflow.
_MAX_EXPONENT = 32

# Signals whose codes are dense at a time.
_CHUNK_SIZE = 2**16

# Iterations over which the error must fall by the fraction `tol` to go on.
_PATIENCE = 5


def ksvd(
    signals,
    atoms,
    n_nonzero_coefs,
    *,
    update="approximate",
    max_iter=50,
    tol=1e-3,
    scale=None,
    rng,
    callback=None,
):
    """Fit a dictionary to signals by K-SVD.

    Each iteration codes all signals by :func:`batch_omp`. Then it fits each atom with
    its coefficients, in random order, to the residual that the other atoms leave of the
    signals that use it. An unused atom is replaced by the signal represented worst. So
    is, after each iteration, an atom that is nearly parallel to another or that fewer
    than four signals use.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_features)
    atoms : ndarray of shape (n_atoms, n_features)
        Initial dictionary of unit-norm atoms.
    n_nonzero_coefs : int
        Most atoms that one code may use.
    update : {"approximate", "exact"}, default="approximate"
        Fit an atom and its coefficients by one step of alternating least
        squares, or by the leading singular pair of the residual.
    max_iter : int, default=50
        Most iterations.
    tol : float, default=1e-3
        Stop when five iterations lower the error by less than this fraction.
    scale : ndarray of shape (n_signals,), default=None
        Magnitudes passed on to :func:`batch_omp`.
    rng : RandomState
        Its method `permutation` gives the order of the atoms.
    callback : callable, default=None
        Called after each iteration with the number of iterations so far and the latest
        error. Learning stops if it returns true.

    Returns
    -------
    atoms : ndarray of shape (n_atoms, n_features)
        Unit-norm atoms. After an iteration or more, the entry of largest magnitude of
        each is positive.
    errors : ndarray of shape (n_iter,)
        Root mean squared error of every iteration, before its last step replaces atoms.

    References
    ----------
    M. Aharon, M. Elad and A. Bruckstein, "K-SVD: an algorithm for designing
    overcomplete dictionaries for sparse representation", IEEE Trans. Signal
    Processing 54(11), 2006. :doi:`10.1109/TSP.2006.881199`. The approximate update
    is that of R. Rubinstein et al., Technion CS-2008-08, 2008.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._ksvd import ksvd
    >>> rng = np.random.RandomState(0)
    >>> signals = rng.normal(size=(200, 1)) * [0.6, 0.8]
    >>> atoms, errors = ksvd(signals, np.eye(2)[:1], 1, rng=rng)
    >>> atoms.round(3), errors[-1].round(3)
    (array([[0.6, 0.8]]), np.float64(0.0))
    """
    # Scaling by a power of two brings squares into range and changes no digit.
    largest = max(signals.max(initial=0), -signals.min(initial=0))
    exponent = int(np.frexp(largest)[1])
    if abs(exponent) > _MAX_EXPONENT:
        signals = np.ldexp(signals, -exponent)
        scale = None if scale is None else np.ldexp(scale, -exponent)
    else:
        exponent = 0
    atoms = atoms.astype(signals.dtype)
    informative = _informative(signals, scale)
    errors = []
    for _ in range(max_iter):
        support, coefs = batch_omp(signals, atoms, n_nonzero_coefs, scale=scale)
        residual = residual_of(signals, support, coefs, atoms)
        users = _users_of_atoms(support, coefs, len(atoms))
        available = informative.copy()
        replaced = set()
        for j in rng.permutation(len(atoms)):
            if len(users[j]):
                _update_atom(atoms, j, coefs, users[j], residual, update)
            elif _replace_atom(atoms, j, signals, residual, available):
                replaced.add(j)
        errors.append(np.sqrt(np.square(residual).mean(dtype=np.float64)))
        for j in range(len(atoms)):
            if j not in replaced and (
                len(users[j]) < _MIN_USERS or _coherence(atoms, j) > _MAX_COHERENCE
            ):
                _replace_atom(atoms, j, signals, residual, available)
        stopped = callback and callback(len(errors), np.ldexp(errors[-1], exponent))
        if stopped or _converged(errors, tol):
            break
    largest = np.take_along_axis(
        atoms, np.abs(atoms).argmax(axis=1, keepdims=True), axis=1
    )
    return np.where(largest < 0, -atoms, atoms), np.ldexp(errors, exponent)


def residual_of(signals, support, coefs, atoms):
    """Return what codes over atoms leave of signals, computed some at a time."""
    residual = np.empty_like(signals)
    for begin in range(0, len(signals), _CHUNK_SIZE):
        rows = slice(begin, begin + _CHUNK_SIZE)
        codes = dense_codes(support[:, rows], coefs[:, rows], len(atoms))
        residual[rows] = signals[rows] - product(codes, atoms)
    return residual


def initial_atoms(signals, n_atoms, rng, *, scale=None):
    """Draw unit-norm training signals, no two nearly parallel, as a dictionary.

    If there are not enough such signals, as on a level far larger than what varies, the
    rest is drawn from what the atoms so far leave of the signals, and random directions
    fill what is left then. Signals at rounding level relative to `scale`, of shape
    (n_signals,), are not drawn; by default only all-zero signals are not.
    """
    scale = row_norms(signals) if scale is None else scale
    rest = signals
    left = unit_rows(rest[_informative(rest, scale)])
    atoms = unit_rows(rng.normal(size=(n_atoms, signals.shape[1])))
    atoms = atoms.astype(signals.dtype)
    for j in range(n_atoms):
        if len(left) == 0:
            basis = np.linalg.qr(atoms[:j].T)[0]
            rest = rest - product(product(rest, basis), basis.T)
            left = unit_rows(rest[_informative(rest, scale)])
        if len(left) == 0:
            break
        atoms[j] = left[rng.randint(len(left))]
        left = left[np.abs(product(left, atoms[j])) <= _MAX_COHERENCE]
    return atoms


def _users_of_atoms(support, coefs, n_atoms):
    """Return, for every atom, the flat indices into `coefs` of its coefficients."""
    used = np.flatnonzero(coefs)
    atoms = support.reshape(-1)[used].astype(np.min_scalar_type(n_atoms))
    counts = np.bincount(atoms, minlength=n_atoms)
    return np.split(used[np.argsort(atoms, kind="stable")], np.cumsum(counts)[:-1])


def _update_atom(atoms, j, coefs, users, residual, update):
    """Fit atom `j` with its coefficients, in place, to what the other atoms leave."""
    (add_outer,) = get_blas_funcs(("ger",), (residual,))
    rows = users % len(residual)
    gains = coefs.reshape(-1)[users]
    rest = residual.take(rows, axis=0)
    add_outer(1, atoms[j], gains, a=rest.T, overwrite_a=True)
    direction = _leading_direction(rest) if update == "exact" else gains @ rest
    largest = np.abs(direction).max()
    if largest == 0:
        return
    atom = direction / largest
    atom /= np.linalg.norm(atom)
    gains = product(rest, atom)
    add_outer(-1, atom, gains, a=rest.T, overwrite_a=True)
    atoms[j] = atom
    residual[rows] = rest


def _leading_direction(rows):
    """Return a leading right singular vector by way of the smaller Gram matrix."""
    if len(rows) < rows.shape[1]:
        return np.linalg.eigh(rows @ rows.T)[1][:, -1] @ rows
    return np.linalg.eigh(rows.T @ rows)[1][:, -1]


def _replace_atom(atoms, j, signals, residual, available):
    """Replace atom `j` by the available signal represented worst, if there is one."""
    errors = np.where(available, np.einsum("ij,ij->i", residual, residual), 0)
    worst = errors.argmax()
    if errors[worst] == 0:
        return False
    atoms[j] = unit_rows(signals[worst : worst + 1])[0]
    available[worst] = False
    return True


def _coherence(atoms, j):
    """Return the largest |cosine| between atom `j` and another."""
    cosines = np.abs(product(atoms, atoms[j]))
    cosines[j] = 0
    return cosines.max()


def _converged(errors, tol):
    """Whether the latest iterations lowered the error by a fraction less than `tol`."""
    latest, before = errors[-_PATIENCE:], errors[:-_PATIENCE]
    return len(before) > 0 and min(latest) >= (1 - tol) * min(before)


def _informative(signals, scale):
    """Return which signals are more than rounding noise."""
    norms = row_norms(signals)
    scale = norms if scale is None else scale
    return norms > scale * rounding_level(signals.dtype)
