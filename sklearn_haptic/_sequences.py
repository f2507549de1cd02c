"""The type that sequence steps return."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from ._sklearn import FloatArray, Names, one_blas_thread

if TYPE_CHECKING:
    import pandas as pd


class Sequences(Sequence[FloatArray]):
    """What a sequence step returns: arrays, one a trial, that know their columns.

    It indexes and iterates like a list. A trial is coded each time it is asked
    for, so that the codes of a whole corpus need not fit in memory; `list` codes
    every trial once and keeps the arrays.

    Parameters
    ----------
    trials : sequence of ndarray
        Arrays of shape (n_times_i, n_columns), or what `encode` turns into them.
    feature_names : sequence of str
        The name of each column, which pooling carries into its own names.
    row_index : pandas.Index, default=None
        The index of the trials, if they came in a pandas container.
    encode : callable, default=None
        Returns the array of a trial. None if `trials` are the arrays.
    lengths : sequence of int, default=None
        Length of each array; by default that of each trial.
    unit : str, default="time samples"
        What the rows of an array are.
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
        self.row_index = row_index
        self.lengths = [len(trial) for trial in trials] if lengths is None else lengths
        self.unit = unit
        self._trials = trials
        self._encode = encode

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
        return self._encode(trial)  # type: ignore[misc]

    def __repr__(self) -> str:
        return f"<Sequences: {len(self)} trials, {len(self.feature_names)} columns>"


def row_index(X):
    """Return the pandas index of a collection of trials, None if it has none."""
    if isinstance(X, Sequences):
        return X.row_index
    return X.index if hasattr(X, "iloc") else None
