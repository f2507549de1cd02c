"""Temporal pyramid: the maximum of every column in every cell of time."""

from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.callback import CallbackSupportMixin
from sklearn.utils.validation import check_is_fitted, check_memory

from .._cells import cell_bounds, check_cells
from .._check_trials import (
    channel_names,
    check_sequences,
    check_trials,
    count,
    is_table,
)
from .._sequences import Sequences, row_index
from .._sklearn import (
    DocumentedEstimator,
    FloatArray,
    HasMethods,
    Memory,
    Names,
    StrOptions,
    Trials,
    _check_feature_names_in,
    _fit_context,
    _get_output_config,
    fit_task,
    one_blas_thread,
)
from .._validation import check_table


def temporal_max_pool(sequences, cells=(16, 8, 4, 2, 1), split="balanced"):
    """Pool each sequence over time: the maximum of every column in every cell.

    Parameters
    ----------
    sequences : sequence of ndarray of shape (n_times_i, n_columns)
        Sequences of one data type, each with one row or more. Each is asked for once,
        in order.
    cells : sequence of int, default=(16, 8, 4, 2, 1)
        Number of cells of each level of the pyramid.
    split : {"balanced", "floor"}, default="balanced"
        How a level divides the rows, see :func:`cell_bounds`.

    Returns
    -------
    pooled : ndarray of shape (n_sequences, sum(cells) * n_columns)
        Maxima: levels in the order given, the cells of each level in time order, and
        each cell with all its columns.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._pooling import temporal_max_pool
    >>> temporal_max_pool([np.array([[0, 5], [3, 1], [2, 2]])], cells=(2, 1))
    array([[0, 5, 3, 2, 3, 5]])
    """
    level_ends = np.cumsum(cells)
    for i, sequence in enumerate(sequences):
        if i == 0:
            shape = (len(sequences), level_ends[-1], sequence.shape[1])
            pooled = np.empty(shape, sequence.dtype)
        starts = [cell_bounds(len(sequence), n, split)[0] for n in cells]
        # One pass over time suffices, since every cell of any level joins segments.
        edges, first = np.unique(np.concatenate(starts), return_inverse=True)
        segments = np.maximum.reduceat(sequence, edges, axis=0)
        for n, end in zip(cells, level_ends):
            level = slice(end - n, end)
            out = pooled[i, level]
            if n <= len(sequence):
                np.maximum.reduceat(segments, first[level], axis=0, out=out)
            else:  # at most three rows per cell
                begin, stop = cell_bounds(len(sequence), n)
                rows = [begin, (begin + stop) // 2, stop - 1]
                np.maximum.reduce(sequence[rows], axis=0, out=out)
    return pooled.reshape(len(sequences), -1)


def coarse_levels(cells, sequences):
    """Keep the levels of a pyramid that have no more cells than any sequence has rows.

    Parameters
    ----------
    cells : sequence of int
        Number of cells of each level.
    sequences : Sequences or list of ndarray
        Sequences to pool.

    Returns
    -------
    cells : tuple of int
        The levels kept.

    Raises
    ------
    ValueError
        If no level is left.
    """
    if isinstance(sequences, Sequences):  # whose arrays are not coded for this
        lengths, unit = sequences.lengths, sequences.unit
    else:
        lengths, unit = [len(sequence) for sequence in sequences], "time samples"
    kept = tuple(n for n in cells if n <= min(lengths))
    if not kept:
        raise ValueError(
            f"No level of cells={cells} fits trial {np.argmin(lengths)} of X, which "
            f"has {count(min(lengths), unit)}; add a level with fewer cells or set "
            "drop_fine_levels=False."
        )
    return kept


class TemporalMaxPool(
    DocumentedEstimator, CallbackSupportMixin, TransformerMixin, BaseEstimator
):
    """Pool sequences of any length into one row of features per trial.

    Each level of a pyramid divides time into a number of cells, and the features are
    the maxima of every column in every cell. Fine levels tell when something was felt,
    coarse levels that it was felt at all.

    Parameters
    ----------
    cells : sequence of int, default=(16, 8, 4, 2, 1)
        Number of cells of each level.
    split : {"balanced", "floor"}, default="balanced"
        How a level divides `n_times` samples. "balanced" begins cell `i` of `n` at
        ``i * n_times // n``, so that cells differ by one sample at most. "floor", the
        rule of the authors of ST-HMP, gives every cell ``n_times // n`` samples and the
        last one the remainder too, up to `n - 1` samples more. If a sequence has fewer
        samples than a level has cells, the cells of that level overlap: each takes the
        sample at its middle and the neighbours of that sample.
    drop_fine_levels : bool, default=False
        Whether `fit` drops the levels with more cells than the shortest sequence has
        time samples, as the 2020 paper does. Set it if all recordings are short,
        because cells that hold the same samples get too much weight in a penalised
        model. By default all levels are kept, so that features do not depend on the
        shortest recording.
    memory : str or object with the joblib.Memory interface, default=None
        Folder or :class:`joblib.Memory` in which to cache the pooled rows, so that a
        search over later steps codes and pools nothing twice. Results are the same, bit
        for bit. One entry holds the rows of one call of `transform`; it is found again
        by the trials, the dictionary, and the settings of coding and pooling. Clear the
        cache after an upgrade. By default nothing is cached.

    Attributes
    ----------
    cells_ : tuple of int
        Number of cells of each level that was not dropped.
    split_ : {"balanced", "floor"}
        How levels divide time.
    takes_trials_ : bool
        Whether trials or sequences were fitted; else a table.
    n_features_in_ : int
        Number of columns of the sequences or of the table.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the columns. Defined for :class:`Sequences` and data frames, which
        have names.

    See Also
    --------
    KSVDTransformer : Sequences of codes of sliding windows.
    STHMPTransformer : Sequences of spatially pooled codes of tactile images.

    Notes
    -----
    `X` may be :class:`Sequences` or any collection of trials of shape
    `(n_times_i, n_columns)`. Each row of a table is a trial with one column, `ch0`,
    and one time sample per feature.

    Features have names like `t3of16_ch0`, which is column `ch0` in the third of sixteen
    cells. Columns without names are `ch0`, `ch1` and so on. Levels come in the order
    given, the cells of each level in time order, and each cell with all its columns.

    References
    ----------
    M. Madry, L. Bo, D. Kragic and D. Fox, "ST-HMP: unsupervised spatio-temporal
    feature learning for tactile data", ICRA 2014,
    doi:10.1109/ICRA.2014.6907172.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import TemporalMaxPool
    >>> pool = TemporalMaxPool(cells=(2, 1))
    >>> pool.fit_transform([np.array([0.0, 3.0, 2.0]), np.array([4.0, 1.0])])
    array([[0., 3., 3.],
           [4., 1., 4.]])
    >>> pool.get_feature_names_out()
    array(['t1of2_ch0', 't2of2_ch0', 't1of1_ch0'], dtype=object)
    """

    _parameter_constraints = {  # noqa: RUF012
        "cells": ["array-like"],
        "split": [StrOptions({"balanced", "floor"})],
        "drop_fine_levels": ["boolean"],
        "memory": [str, HasMethods("cache"), None],
    }

    def __init__(
        self,
        cells: Sequence[int] = (16, 8, 4, 2, 1),
        *,
        split: Literal["balanced", "floor"] = "balanced",
        drop_fine_levels: bool = False,
        memory: str | Memory | None = None,
    ) -> None:
        self.cells = cells
        self.split = split
        self.drop_fine_levels = drop_fine_levels
        self.memory = memory

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: Trials, y: None = None) -> Self:
        """Record the columns and the levels.

        Parameters
        ----------
        X : Sequences, collection of trials, or array-like of shape \
                (n_trials, n_times)
            Sequences to pool.
        y : None
            Ignored.

        Returns
        -------
        self : TemporalMaxPool
            The fitted transformer.

        Raises
        ------
        ValueError
            If `cells` are not distinct positive integers, or all of them are dropped.
        """
        with fit_task(self, X, y):
            self.takes_trials_ = not is_table(X)
            self._channel_names = channel_names(X)
            if self.takes_trials_:
                sequences = self._check_trials(X)
                self._record_columns(sequences)
            else:
                sequences = self._check_rows(X, reset=True)
            self.cells_ = check_cells(self.cells)
            if self.drop_fine_levels:
                self.cells_ = coarse_levels(self.cells_, sequences)
            self.split_ = self.split
        return self

    @one_blas_thread  # because sequences are coded as they are pooled
    def transform(self, X: Trials) -> FloatArray:
        """Pool sequences.

        Parameters
        ----------
        X : Sequences, collection of trials, or array-like of shape \
                (n_trials, n_times)
            Sequences with the columns seen in `fit`.

        Returns
        -------
        pooled : ndarray of shape (n_trials, n_cells * n_columns)
            Pooled features, float32 if the sequences are.

        Raises
        ------
        ValueError
            If a sequence is empty or has other columns than those seen in `fit`.
        """
        check_is_fitted(self)
        if self.takes_trials_:
            sequences = self._check_trials(X, self.n_features_in_)
            self._check_column_names(sequences)
        else:
            sequences = self._check_rows(X)
        # Sequences are hashed by their trials and dictionary, so a hit codes nothing.
        pool = check_memory(self.memory).cache(temporal_max_pool)
        pooled = pool(sequences, self.cells_, self.split_)
        index = row_index(X)
        if index is None or _get_output_config("transform", self)["dense"] != "pandas":
            return pooled
        # scikit-learn adds the names, but not the index of trials.
        return pd.DataFrame(pooled, index=index)

    def get_feature_names_out(
        self, input_features: Names | None = None
    ) -> NDArray[np.object_]:
        """Return the names of the pooled features.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Checked against the columns seen in `fit`; ignored if these have no names.

        Returns
        -------
        names : ndarray of str objects
            Names like `t3of16_ch0`.
        """
        check_is_fitted(self)
        named = hasattr(self, "feature_names_in_")
        if named or not self.takes_trials_:
            columns = _check_feature_names_in(self, input_features)
        if not self.takes_trials_:
            columns = ["ch0"]
        elif not named:
            columns = [f"ch{i}" for i in range(self.n_features_in_)]
        return np.asarray(
            [
                f"t{i}of{n}_{column}"
                for n in self.cells_
                for i in range(1, n + 1)
                for column in columns
            ],
            dtype=object,
        )

    def __sklearn_is_fitted__(self):
        return hasattr(self, "split_")  # which is set last

    def _check_rows(self, X, *, reset=False):
        """Return each row of a table as a sequence with one column."""
        if not is_table(X):
            raise ValueError(
                "X is a collection of trials, but fit was given a table; give both in "
                "the same form."
            )
        X = check_table(self, X, dtype=[np.float64, np.float32], reset=reset)
        return list(X[:, :, np.newaxis])

    def _check_trials(self, X, n_columns=None):
        if isinstance(X, Sequences):
            check_sequences(X, n_columns=n_columns)
            return X
        return check_trials(X, n_channels=n_columns, names=self._channel_names)

    def _record_columns(self, sequences):
        vars(self).pop("feature_names_in_", None)  # of an earlier fit
        if isinstance(sequences, Sequences):
            self.feature_names_in_ = sequences.feature_names
            self.n_features_in_ = len(sequences.feature_names)
        else:
            self.n_features_in_ = sequences[0].shape[1]

    def _check_column_names(self, sequences):
        names = getattr(sequences, "feature_names", None)
        known = getattr(self, "feature_names_in_", names)
        if names is None or np.array_equal(known, names):
            return
        i = np.argmax(known != names)
        raise ValueError(
            f"Column {i} of X is named {names[i]!r}, but {known[i]!r} in fit; give "
            "sequences from the step that fit was given."
        )

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags
