"""Batch orthogonal matching pursuit: code many signals over one dictionary.

Signals and atoms are rows. Inside, signals lie on the last axis, so that every
operation runs over contiguous memory. The pursuit works on the correlations of atoms
with signals and with each other, never on the signals themselves.
"""

import numpy as np

# Least number of signals coded at a time if there are as many. NumPy broadcasts rows
# without copying them if they are at least as long as its buffer.
_CHUNK_SIZE = 8192

# With a larger |cosine| between atoms the pursuit works in double precision, because
# it loses more digits the worse the Gram matrix is conditioned.
_COHERENT = 0.99


def batch_omp(signals, atoms, n_nonzero_coefs, *, scale=None):
    """Code signals over a dictionary by orthogonal matching pursuit.

    Each step takes the atom with the largest absolute correlation with the
    residual and fits the signal to all atoms taken so far by least squares.
    The pursuit of a signal ends early when that correlation is at rounding level
    relative to `scale`, or when the atom is a linear combination of those already
    taken. Thresholds are relative, so multiplying signals by a power of two multiplies
    their coefficients by exactly that power.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_features)
        Signals, float32 or float64. The pursuit works in this precision unless atoms
        are so coherent that it needs float64.
    atoms : ndarray of shape (n_atoms, n_features)
        Dictionary. Atoms compete as directions, whatever their norms; all-zero atoms
        are never taken.
    n_nonzero_coefs : int
        Most atoms that one code may use.
    scale : ndarray of shape (n_signals,), default=None
        A correlation at the rounding level of this magnitude is noise. By default the
        norm of each signal. If means were removed, pass the norms before that, so that
        the code of a constant signal is zero whatever rounding leaves of it.

    Returns
    -------
    support : ndarray of shape (n_slots, n_signals)
        Indices of the atoms in the order they were taken, with
        `n_slots = min(n_nonzero_coefs, n_atoms, n_features)`. Slots that a
        signal does not need come last and hold atom 0 with coefficient 0.
    coefs : ndarray of shape (n_slots, n_signals)
        The coefficients of those atoms, of the dtype of `signals`.

    Raises
    ------
    ValueError
        If the norm of an atom is subnormal or overflows, or a coefficient is too
        large for the dtype of `signals`.

    Notes
    -----
    In tests the error of a coefficient, relative to the largest of its code, stayed
    below 8 eps times the condition number of the Gram matrix of the atoms taken, where
    eps is that of the precision of the pursuit. An atom within 4 √eps of the span of
    those before it is not taken.

    References
    ----------
    R. Rubinstein, M. Zibulevsky and M. Elad, "Efficient implementation of the
    K-SVD algorithm using batch orthogonal matching pursuit", Technion CS-2008-08,
    2008.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._sparse_coding import batch_omp
    >>> support, coefs = batch_omp(np.array([[0.0, 3.0, -5.0]]), np.eye(3), 2)
    >>> support.ravel(), coefs.ravel()
    (array([2, 1]), array([-5.,  3.]))
    """
    n_slots = min(n_nonzero_coefs, *atoms.shape)
    norms = row_norms(atoms)
    limits = np.finfo(np.float64)
    usable = (norms == 0) | (norms >= limits.tiny) & (norms <= limits.max)
    if not usable.all():
        raise ValueError(
            f"The norm of atom {usable.argmin()} is outside the normal range of "
            "float64; multiply dict_init by a constant."
        )
    norms[norms == 0] = 1  # all-zero atoms, whose coefficients are 0
    directions = unit_rows(atoms.astype(np.float64, copy=False))
    gram = directions @ directions.T
    coherence = np.abs(np.triu(gram, 1)).max()
    work_dtype = np.float64 if coherence > _COHERENT else signals.dtype
    gram = gram.astype(work_dtype)
    directions = directions.astype(work_dtype)
    level = max(rounding_level(signals.dtype), rounding_level(atoms.dtype))

    support = np.zeros((n_slots, len(signals)), dtype=np.intp)
    coefs = np.zeros((n_slots, len(signals)), dtype=work_dtype)
    n_chunks = max(1, len(signals) // _CHUNK_SIZE)
    chunk_size = -(-len(signals) // n_chunks)
    buffers = np.empty((n_slots + 1, len(atoms), chunk_size), dtype=work_dtype)
    pairs = _pairs_of_columns(gram) if gram.size <= chunk_size else None
    for i in range(n_chunks):
        chunk = slice(i * chunk_size, (i + 1) * chunk_size)
        rows, magnitudes, units = _scaled(signals[chunk].astype(work_dtype, copy=False))
        work = buffers[..., : len(rows)]
        product(directions, rows.T, out=work[0])
        with np.errstate(over="ignore"):
            if scale is not None:
                magnitudes = scale[chunk] / units
            thresholds = magnitudes * level
            thresholds = thresholds.astype(work_dtype, copy=False)
        _pursue(work, gram, pairs, thresholds, support[:, chunk], coefs[:, chunk])
        with np.errstate(over="ignore", invalid="ignore"):
            coefs[:, chunk] *= units / norms.take(support[:, chunk])
    with np.errstate(over="ignore"):
        coefs = coefs.astype(signals.dtype, copy=False)
    if not np.isfinite(coefs).all():
        raise ValueError(
            f"The codes overflow {coefs.dtype}: the signals in X are too large for "
            "atoms this small; divide X by a constant or multiply dict_init by one."
        )
    return support, coefs


def dense_codes(support, coefs, n_atoms, *, sign="none"):
    """Write sparse codes as a dense array, with one or two columns per atom.

    `support` and `coefs` are codes as :func:`batch_omp` returns them. The `sign` "none"
    keeps coefficients, "absolute" takes their absolute values, and "split" gives the
    positive parts of all atoms followed by the negative parts of all: n_atoms columns,
    or twice as many.
    """
    n_columns = 2 * n_atoms if sign == "split" else n_atoms
    codes = np.zeros((coefs.shape[1], n_columns), dtype=coefs.dtype)
    if sign == "split":
        support = support + n_atoms * (coefs < 0)
    if sign != "none":
        coefs = np.abs(coefs)
    first = np.arange(len(codes)) * n_columns
    # Last slots come first, so that no unneeded slot overwrites the coefficient of
    # atom 0.
    for columns, values in zip(support[::-1], coefs[::-1]):
        codes.reshape(-1)[first + columns] = values
    return codes


def product(a, b, out=None):
    """Return ``a @ b`` without warnings of invalid values.

    With AVX-512, OpenBLAS 0.3.31 multiplies float32 rows of five numbers by a vector
    in registers that it fills up with whatever lies on the stack. It drops those
    results, but NumPy warns of them if the stack held a signalling NaN.
    """
    with np.errstate(invalid="ignore"):
        return np.matmul(a, b, out=out)


def row_norms(signals):
    """Return the norms of rows in float64; no square overflows or underflows.

    A norm larger than any number is infinite.
    """
    _, norms, units = _scaled(signals.astype(np.float64, copy=False))
    with np.errstate(over="ignore"):
        return norms * units


def rounding_level(dtype):
    """Return the size, relative to a signal, at which a correlation is noise."""
    return 16 * np.finfo(dtype).eps


def unit_rows(rows):
    """Divide rows by their norms, computed in float64; all-zero rows stay."""
    scaled, norms, _ = _scaled(rows.astype(np.float64, copy=False))
    norms[norms == 0] = 1
    return (scaled / norms[:, None]).astype(rows.dtype, copy=False)


def _scaled(signals):
    """Divide signals by powers of two if their squares might overflow or underflow.

    Return the signals, their norms and the powers, which are 1 in the usual range.
    """
    limits = np.finfo(signals.dtype)
    squares = np.einsum("ij,ij->i", signals, signals)
    smallest = 2.0 ** (limits.minexp // 2)
    units = signals.dtype.type(1)
    if not ((squares > smallest) & (squares < 1 / smallest)).all():
        _, exponents = np.frexp(np.abs(signals).max(axis=1))
        # Both the power and its reciprocal are finite.
        units = np.ldexp(units, np.clip(exponents, limits.minexp, limits.maxexp - 1))
        signals = signals * (1 / units)[:, None]
        squares = np.einsum("ij,ij->i", signals, signals)
    return signals, np.sqrt(squares), units


def _pursue(buffers, gram, pairs, thresholds, support, coefs):
    """Run the pursuit of all signals in step, on correlations alone.

    Gram–Schmidt orthogonalises each atom taken against those before it, so that the
    correlations with the residual are updated without solving a system of equations.

    Parameters
    ----------
    buffers : ndarray of shape (n_slots + 1, n_atoms, n_signals)
        The first holds the products of unit-norm atoms and signals. All are
        overwritten.
    gram : ndarray of shape (n_atoms, n_atoms)
        Products of the atoms with each other.
    pairs : ndarray of shape (n_atoms, n_atoms ** 2, 2) or None
        :func:`_pairs_of_columns` of `gram`, or None to take columns one by one.
    thresholds : ndarray of shape (n_signals,)
        Correlations up to these are noise.
    support, coefs : ndarray of shape (n_slots, n_signals)
        Overwritten by the codes.
    """
    correlations, work, *directions = buffers
    n_slots, n_signals = coefs.shape
    smallest_pivot = rounding_level(gram.dtype)
    each = np.arange(n_signals)
    active = np.ones(n_signals, dtype=bool)
    # factor[k, i]: multiple of orthogonal direction i contained in atom k.
    factor = np.empty((n_slots, n_slots, n_signals), dtype=gram.dtype)
    pivots = np.ones((n_slots, n_signals), dtype=gram.dtype)

    for k, (atom, coef, pivot) in enumerate(zip(support, coefs, pivots)):
        atom[:], peak = _argmax(np.abs(correlations, out=work))
        along = []  # products of the atoms with the orthogonal directions
        for i in range(k):
            along.append(gram.take(support[i] * len(gram) + atom))
            for j in range(i):
                along[i] -= along[j] * factor[i, j]
            np.divide(along[i], pivots[i], out=factor[k, i])
            pivot -= along[i] * factor[k, i]
        coef[:] = correlations.take(atom * n_signals + each)
        active &= (peak > thresholds) & (pivot > smallest_pivot)
        if not active.all():
            atom[~active], coef[~active], pivot[~active] = 0, 0, 1
            factor[k, :k, ~active] = 0  # else products of many could overflow
        coef /= pivot
        if k < n_slots - 1:
            _take_columns(gram, pairs, atom, out=directions[k])
            for i in range(k):
                directions[k] -= np.multiply(directions[i], factor[k, i], out=work)
            correlations -= np.multiply(directions[k], coef, out=work)

    for k in reversed(range(n_slots)):  # coefficients of directions, then of atoms
        for i in range(k):
            coefs[i] -= factor[k, i] * coefs[k]


def _argmax(values):
    """Return the row index and the value of the first maximum of each column.

    This is argmax over axis 0, but faster because it reduces along rows, and values
    that are equal but for rounding count as equal, so that the choice of an atom does
    not depend on the signals that are coded together.
    """
    n_rows = len(values)
    peak = values.max(axis=0)
    least = peak * (1 - rounding_level(values.dtype))
    countdown = np.arange(n_rows, 0, -1, dtype=np.min_scalar_type(n_rows))
    at_peak = (values >= least).view(np.uint8)
    highest = (at_peak * countdown[:, None]).max(axis=0)
    return n_rows - highest.astype(np.intp), peak


def _pairs_of_columns(gram):
    """Return all pairs of columns a and b, at index a * n_atoms + b."""
    n_atoms = len(gram)
    pairs = np.empty((n_atoms, n_atoms, n_atoms, 2), dtype=gram.dtype)
    pairs[..., 0] = gram[:, :, None]
    pairs[..., 1] = gram[:, None, :]
    return pairs.reshape(n_atoms, n_atoms**2, 2)


def _take_columns(gram, pairs, atoms, out):
    """Take a column of the Gram matrix per signal; in pairs it takes half the time."""
    if pairs is None:
        np.take(gram, atoms, axis=1, out=out, mode="clip")
        return
    n_atoms, n_pairs = len(gram), len(atoms) // 2
    here = atoms[: 2 * n_pairs : 2] * n_atoms + atoms[1::2]
    paired = out[:, : 2 * n_pairs].reshape(n_atoms, n_pairs, 2)
    np.take(pairs, here, axis=1, out=paired, mode="clip")
    out[:, -1] = gram[:, atoms[-1]]  # the last of an odd number
