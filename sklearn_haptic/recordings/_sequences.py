"""Sequences: what steps return that turn each trial into an array of its own length."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NoReturn, overload

import numpy as np

from ..utils._sklearn import FloatArray, Names, one_blas_thread
from ..utils._validation import check_regular

if TYPE_CHECKING:
    import pandas as pd


class Sequences(Sequence[FloatArray]):
    """Arrays of different lengths, one per trial, with the same named columns.

    This is what :class:`KSVDTransformer` and :class:`STHMPTransformer` return for
    trials and what :class:`TemporalMaxPool` turns into a table. It is indexed, sliced
    and iterated over like a list.

    Each array is computed every time it is asked for, so the codes of a whole corpus
    never have to fit in memory. It follows later changes of the trials, which are not
    copied. Call `list` to compute every array once and keep it.

    Parameters
    ----------
    trials : sequence of array-like of shape (n_times_i, n_columns)
        The arrays or, with `encode`, objects from which it makes them.
    feature_names : sequence of str of shape (n_columns,)
        Names of the columns. :class:`TemporalMaxPool` adds the temporal cell to them.
    row_index : pandas.Index of shape (n_trials,), default=None
        Index of the pandas container from which the trials come.
    encode : callable, default=None
        Takes one entry of `trials` and returns its array. By default the entries are
        the arrays.
    lengths : sequence of int of shape (n_trials,), default=None
        Number of rows of each array; by default the length of each trial.
    unit : str, default="time samples"
        What one row of an array stands for, in the plural, as error messages say it.

    Attributes
    ----------
    feature_names : ndarray of str objects of shape (n_columns,)
    row_index : pandas.Index of shape (n_trials,) or None
    lengths : list of int of shape (n_trials,)
        Known without computing any array.
    unit : str
        Such as "windows" or "frames".

    Raises
    ------
    ValueError
        If arrays are not of finite real numbers or have not one column per name, or
        if `row_index` or `lengths` have not one entry per trial.

    See Also
    --------
    TemporalMaxPool : Pool sequences into one row of features per trial.

    Notes
    -----
    `set_output` applies to tables only and leaves sequences as they are.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import KSVDTransformer, Sequences, TemporalMaxPool
    >>> trials = [np.sin(np.arange(n_times)) for n_times in (100, 140)]
    >>> codes = KSVDTransformer(3, 2, window=20, random_state=0).fit_transform(trials)
    >>> codes
    <Sequences: 2 trials, 6 columns>
    >>> codes.lengths, codes.unit
    ([9, 13], 'windows')
    >>> codes[1].shape
    (13, 6)

    Features computed elsewhere can be pooled under their own names:

    >>> loudness = Sequences([[[1.0], [4.0], [2.0]], [[3.0], [0.0]]], ["loudness"])
    >>> pool = TemporalMaxPool(cells=(2, 1)).set_output(transform="pandas")
    >>> pool.fit_transform(loudness)
       t1of2_loudness  t2of2_loudness  t1of1_loudness
    0             1.0             4.0             4.0
    1             3.0             0.0             3.0
    """

    def __init__(
        self,
        trials: Sequence[Any],
        feature_names: Names,
        row_index: pd.Index | None = None,
        *,
        encode: Callable[[Any], FloatArray] | None = None,
        lengths: Sequence[int] | None = None,
        unit: str = "time samples",
    ) -> None:
        self.feature_names = np.asarray(feature_names, dtype=object)
        if self.feature_names.ndim != 1:
            raise ValueError(
                f"feature_names={feature_names!r} must list one name per column."
            )
        self._trials = list(trials)
        if encode is None:
            self._trials = _check_arrays(self._trials, len(self.feature_names))
        self._encode = encode
        self.lengths = [*map(len, self._trials)] if lengths is None else list(lengths)
        self.row_index = row_index
        self.unit = unit
        for name, entries in (("lengths", self.lengths), ("row_index", row_index)):
            if entries is not None and len(entries) != len(self):
                raise ValueError(
                    f"{name} has {len(entries)} entries for {len(self)} trials."
                )

    def __len__(self) -> int:
        return len(self._trials)

    @overload
    def __getitem__(self, key: int) -> FloatArray: ...
    @overload
    def __getitem__(self, key: slice) -> Sequences: ...
    def __getitem__(self, key: int | slice) -> FloatArray | Sequences:
        if not isinstance(key, slice):
            trial = self._trials[key]
            return trial if self._encode is None else self._code(trial)
        return Sequences(
            self._trials[key],
            self.feature_names,
            None if self.row_index is None else self.row_index[key],
            encode=self._encode,
            lengths=self.lengths[key],
            unit=self.unit,
        )

    @one_blas_thread
    def _code(self, trial: Any) -> FloatArray:
        array = np.asarray(self._encode(trial))  # type: ignore[misc]
        # Means of whole numbers are none.
        return array if array.dtype == np.float32 else array.astype(float, copy=False)

    def __array_function__(self, func: Any, *_: Any) -> NoReturn:
        # A FeatureUnion joins by NumPy, which would put rows of one behind the other's.
        raise TypeError(
            f"numpy.{func.__name__} takes no Sequences; if a FeatureUnion joins them, "
            "put a TemporalMaxPool behind each of its transformers."
        )

    def __repr__(self) -> str:
        return f"<Sequences: {len(self)} trials, {len(self.feature_names)} columns>"


def row_index(X):
    """Return the pandas index of a collection of trials, None if it has none."""
    if isinstance(X, Sequences):
        return X.row_index
    return X.index if hasattr(X, "iloc") else None


def _check_arrays(trials, n_columns):
    """Return trials as arrays of one floating-point data type."""
    arrays = [check_regular(trial, f"Trial {i}") for i, trial in enumerate(trials)]
    for i, array in enumerate(arrays):
        if array.ndim != 2 or array.shape[1] != n_columns:
            raise ValueError(
                f"Trial {i} has shape {array.shape}; it must be (n_times, "
                f"{n_columns}), with one column per name in feature_names."
            )
        if array.dtype.kind not in "fiu" or not np.isfinite(array).all():
            raise ValueError(
                f"Trial {i} holds values that are not finite real numbers; mend them."
            )
    single = all(array.dtype == np.float32 for array in arrays)
    dtype = np.float32 if single else np.float64
    return [array.astype(dtype, copy=False) for array in arrays]
