"""Batch orthogonal matching pursuit: many signals coded over one dictionary.

Signals and atoms are rows. Inside, signals lie on the last axis, so that every
operation runs over contiguous memory, and the pursuit works on the correlations
of atoms with signals and with each other, never on the signals themselves.
"""

import numpy as np

# Signals coded at a time: the working arrays of one chunk stay in the cache.
_CHUNK_SIZE = 8192
# Dictionaries with a larger |cosine| between atoms are worked in double precision:
# the pursuit loses as many digits as the Gram matrix is ill-conditioned.
_COHERENT = 0.99


def batch_omp(signals, atoms, n_nonzero_coefs, *, scale=None):
    """Code signals over a dictionary by orthogonal matching pursuit.

    Each step takes the atom with the largest absolute correlation with the
    residual and fits the signal to all atoms taken so far by least squares.
    A signal's pursuit ends early when that correlation is at rounding level
    relative to `scale`, or when the atom is a linear combination of those
    already taken. Thresholds are relative, so multiplying signals by a power of
    two multiplies their coefficients by it, exactly.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_features)
        Signals, float32 or float64, which is also the precision of the pursuit
        unless atoms are so coherent that it takes float64.
    atoms : ndarray of shape (n_atoms, n_features)
        Dictionary. Atoms of any norm compete as directions; all-zero atoms are
        never taken.
    n_nonzero_coefs : int
        Most atoms that one code may use.
    scale : ndarray of shape (n_signals,), default=None
        Magnitude below whose rounding level a correlation is noise. By default
        the norm of each signal. Pass the norm before mean removal for signals
        whose mean was removed, so that what rounding leaves of a constant
        signal codes to zero.

    Returns
    -------
    support : ndarray of shape (n_slots, n_signals)
        Indices of the atoms in the order they were taken, with
        `n_slots = min(n_nonzero_coefs, n_atoms, n_features)`. Slots that a
        signal does not need come last and hold atom 0 with coefficient 0.
    coefs : ndarray of shape (n_slots, n_signals)
        The coefficients of those atoms, of the dtype of `signals`.

    References
    ----------
    R. Rubinstein, M. Zibulevsky and M. Elad, "Efficient implementation of the
    K-SVD algorithm using batch orthogonal matching pursuit", Technion CS-2008-08,
    2008.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic._sparse_coding import batch_omp
    >>> support, coefs = batch_omp(np.array([[0.0, 3.0, -5.0]]), np.eye(3), 2)
    >>> support.ravel(), coefs.ravel()
    (array([2, 1]), array([-5.,  3.]))
    """
    n_slots = min(n_nonzero_coefs, *atoms.shape)
    norms = row_norms(atoms)
    norms[norms == 0] = 1  # all-zero atoms, whose coefficients are 0
    directions = unit_rows(atoms.astype(np.float64, copy=False))
    gram = directions @ directions.T
    coherence = np.abs(np.triu(gram, 1)).max()
    work_dtype = np.float64 if coherence > _COHERENT else signals.dtype
    gram = gram.astype(work_dtype)
    directions = directions.astype(work_dtype)

    support = np.zeros((n_slots, len(signals)), dtype=np.intp)
    coefs = np.zeros((n_slots, len(signals)), dtype=signals.dtype)
    chunk_size = min(_CHUNK_SIZE, len(signals))
    buffers = np.empty((n_slots + 1, len(atoms), chunk_size), dtype=work_dtype)
    for start in range(0, len(signals), _CHUNK_SIZE):
        chunk = slice(start, start + _CHUNK_SIZE)
        columns, units = _normalise(signals[chunk].astype(work_dtype, copy=False))
        work = buffers[..., : columns.shape[1]]
        np.matmul(directions, columns, out=work[0])
        if scale is None:
            magnitude = np.sqrt(np.einsum("ij,ij->j", columns, columns))
        else:
            with np.errstate(over="ignore"):
                magnitude = scale[chunk] / units
        support[:, chunk], pursued = _pursue(
            work, gram, magnitude * rounding_level(signals.dtype)
        )
        coefs[:, chunk] = pursued / norms[support[:, chunk]] * units
    return support, coefs


def dense_codes(support, coefs, n_atoms, *, sign="none"):
    """Write sparse codes as a dense array, with one or two columns an atom.

    Parameters
    ----------
    support, coefs : ndarray of shape (n_slots, n_signals)
        Codes as :func:`batch_omp` returns them.
    n_atoms : int
        Number of atoms in the dictionary.
    sign : {"none", "absolute", "split"}, default="none"
        Keep coefficients, take their absolute values, or give the positive
        parts of all atoms followed by the negative parts of all atoms.

    Returns
    -------
    codes : ndarray of shape (n_signals, n_atoms) or (n_signals, 2 * n_atoms)
        Dense codes, of the dtype of `coefs`.
    """
    n_columns = 2 * n_atoms if sign == "split" else n_atoms
    codes = np.zeros((coefs.shape[1], n_columns), dtype=coefs.dtype)
    if sign == "split":
        support = support + n_atoms * (coefs < 0)
    if sign != "none":
        coefs = np.abs(coefs)
    first = np.arange(len(codes)) * n_columns
    # Last slots first: an unneeded slot never overwrites a coefficient of atom 0.
    for columns, values in zip(support[::-1], coefs[::-1]):
        codes.reshape(-1)[first + columns] = values
    return codes


def row_norms(signals):
    """Euclidean norms of rows in float64, without overflow or underflow.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_features)
        Rows of any magnitude.

    Returns
    -------
    norms : ndarray of shape (n_signals,)
        Their norms.
    """
    columns, units = _normalise(signals.astype(np.float64, copy=False))
    return np.sqrt(np.einsum("ij,ij->j", columns, columns)) * units


def rounding_level(dtype):
    """Return the size, relative to a signal, below which a correlation is noise."""
    return 16 * np.finfo(dtype).eps


def unit_rows(rows):
    """Divide rows by their norms; all-zero rows stay."""
    norms = row_norms(rows)[:, None]
    return (rows / np.where(norms > 0, norms, 1)).astype(rows.dtype, copy=False)


def _normalise(signals):
    """Transpose signals and divide each by a power of two that brings it near 1."""
    columns = signals.T.copy()
    limits = np.finfo(signals.dtype)
    _, exponents = np.frexp(np.maximum(columns.max(axis=0), -columns.min(axis=0)))
    # Both the power and its reciprocal are finite.
    exponents = np.clip(exponents, limits.minexp, limits.maxexp - 1)
    units = np.ldexp(signals.dtype.type(1), exponents)
    columns *= 1 / units
    return columns, units


def _pursue(buffers, gram, thresholds):
    """Run the pursuit in Gram space, all signals in step.

    Gram–Schmidt orthogonalises each atom taken against those before it, so the
    correlations with the residual are updated without solving anything.

    Parameters
    ----------
    buffers : ndarray of shape (n_slots + 1, n_atoms, n_signals)
        The first holds the products of unit-norm atoms and signals. All are
        overwritten.
    gram : ndarray of shape (n_atoms, n_atoms)
        Products of the atoms with each other.
    thresholds : ndarray of shape (n_signals,)
        Correlations up to these are noise.

    Returns
    -------
    support, coefs : ndarray of shape (n_slots, n_signals)
    """
    correlations, work, *directions = buffers
    n_slots, n_signals = len(buffers) - 1, len(thresholds)
    dtype = correlations.dtype
    smallest_pivot = rounding_level(dtype)
    each = np.arange(n_signals)
    active = np.ones(n_signals, dtype=bool)
    support = np.zeros((n_slots, n_signals), dtype=np.intp)
    coefs = np.zeros((n_slots, n_signals), dtype=dtype)
    # factor[k, i]: multiple of orthogonal direction i contained in atom k.
    factor = np.zeros((n_slots, n_slots, n_signals), dtype=dtype)
    pivots = np.ones((n_slots, n_signals), dtype=dtype)

    for k in range(n_slots):
        atom, peak = _argmax(np.abs(correlations, out=work))
        here = atom * n_signals + each  # positions of the atoms taken, flattened
        pivot = gram.diagonal()[atom]
        for i in range(k):
            along = directions[i].take(here)
            factor[k, i] = along / pivots[i]
            pivot -= along * factor[k, i]
        active &= (peak > thresholds) & (pivot > smallest_pivot)
        if not active.any():
            break
        pivots[k] = np.where(active, pivot, 1)
        support[k] = np.where(active, atom, 0)
        coefs[k] = np.where(active, correlations.take(here) / pivots[k], 0)
        if k < n_slots - 1:
            np.take(gram, atom, axis=1, out=directions[k], mode="clip")
            for i in range(k):
                directions[k] -= np.multiply(directions[i], factor[k, i], out=work)
            correlations -= np.multiply(directions[k], coefs[k], out=work)

    for k in reversed(range(n_slots)):  # coefficients of directions, then of atoms
        for i in range(k):
            coefs[i] -= factor[k, i] * coefs[k]
    return support, coefs


def _argmax(values):
    """Return the row index and the value of each column's first maximum.

    Equal to argmax over axis 0, but in reductions that run along rows.
    """
    n_rows = len(values)
    peak = values.max(axis=0)
    countdown = np.arange(n_rows, 0, -1, dtype=np.min_scalar_type(n_rows))
    highest = (countdown[:, None] * (values == peak)).max(axis=0)
    return n_rows - highest.astype(np.intp), peak
