"""Temporal pyramid: statistics of every column in every cell of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ..utils._sklearn import (
    FloatArray,
    HasMethods,
    Memory,
    StrOptions,
    Trials,
    _fit_context,
    fit_task,
    one_blas_thread,
)
from ..utils._validation import check_cache, check_names
from ._trial_rows import TrialRows

_STATISTICS = ["max", "mean", "share"]


def cell_bounds(n_items, n_cells, split="balanced"):
    """Divide a line of items into cells; return where each begins and ends.

    Parameters
    ----------
    n_items : int
        Number of items, at least one.
    n_cells : int
        Number of cells.
    split : {"balanced", "floor"}, default="balanced"
        "balanced" cells differ by one item at most. With "floor" each has
        ``n_items // n_cells`` items and the last one also takes the remainder. With
        fewer items than cells, the cells overlap for either value: each has the item
        at its middle and the neighbours of that item.

    Returns
    -------
    starts, stops : ndarray of shape (n_cells,)
        Index of the first item of each cell, and one past the index of its last.

    Examples
    --------
    >>> from sklearn_haptic.features._pooling import cell_bounds
    >>> cell_bounds(11, 4)
    (array([0, 2, 5, 8]), array([ 2,  5,  8, 11]))
    >>> cell_bounds(11, 4, "floor")
    (array([0, 2, 4, 6]), array([ 2,  4,  6, 11]))
    >>> cell_bounds(3, 4)
    (array([0, 0, 0, 1]), array([2, 3, 3, 3]))
    """
    edges = np.arange(n_cells + 1)
    if n_items < n_cells:
        middle = (2 * edges[:-1] + 1) * n_items // (2 * n_cells)
        return np.maximum(middle - 1, 0), np.minimum(middle + 2, n_items)
    if split == "floor":
        edges *= n_items // n_cells
        edges[-1] = n_items
    else:
        edges = edges * n_items // n_cells
    return edges[:-1], edges[1:]


def check_cells(cells, name="cells"):
    """Return the levels of a pyramid as a tuple of distinct positive integers."""
    levels = np.asarray(cells)
    if (
        levels.ndim != 1
        or levels.dtype.kind not in "iu"
        or levels.min(initial=1) < 1
        or not 0 < len(levels) == len(np.unique(levels))
    ):
        raise ValueError(
            f"{name}={cells!r} must list distinct positive integers, one per level."
        )
    return tuple(levels.tolist())


def signed_root(features):
    """Take the square root of each magnitude and keep the sign.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._pooling import signed_root
    >>> signed_root(np.array([4.0, 0.0, -9.0]))
    array([ 2.,  0., -3.])
    """
    return np.sign(features) * np.sqrt(np.abs(features))


def temporal_max_pool(
    sequences, cells=(16, 8, 4, 2, 1), split="balanced", statistics=("max",)
):
    """Pool each sequence over time: statistics of every column in every cell.

    Parameters
    ----------
    sequences : sequence of ndarray of shape (n_times_i, n_columns)
        Sequences of one data type, each with one row or more. Each is asked for once,
        in order.
    cells : sequence of int, default=(16, 8, 4, 2, 1)
        Number of cells of each level of the pyramid.
    split : {"balanced", "floor"}, default="balanced"
        How a level divides the rows, see :func:`cell_bounds`.
    statistics : sequence of {"max", "mean", "share"}, default=("max",)
        The statistics of each cell, see :class:`TemporalMaxPool`.

    Returns
    -------
    pooled : ndarray of shape (n_sequences, n_statistics * sum(cells) * n_columns)
        Statistics in the order given; in each, levels in the order given, the cells of
        each level in time order, and each cell with all its columns.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._pooling import temporal_max_pool
    >>> temporal_max_pool([np.array([[0, 5], [3, 1], [2, 2]])], cells=(2, 1))
    array([[0, 5, 3, 2, 3, 5]])
    """
    level_ends = np.cumsum(cells)
    for i, sequence in enumerate(sequences):
        n_times, n_columns = sequence.shape
        if i == 0:
            shape = (len(sequences), len(statistics), level_ends[-1], n_columns)
            pooled = np.empty(shape, sequence.dtype)
        starts = [cell_bounds(n_times, n, split)[0] for n in cells]
        # One pass over time suffices, since every cell of any level joins segments.
        edges, first = np.unique(np.concatenate(starts), return_inverse=True)
        for statistic, out in zip(statistics, pooled[i]):
            values, reduce, dtype = sequence, np.maximum, None
            if statistic != "max":  # the mean of a constant is that constant
                values = sequence if statistic == "mean" else sequence != 0
                reduce, dtype = np.add, np.float64
            with np.errstate(over="ignore"):
                segments = reduce.reduceat(values, edges, axis=0, dtype=dtype)
                for n, end in zip(cells, level_ends):
                    level = slice(end - n, end)
                    begin, stop = cell_bounds(n_times, n, split)
                    if n <= n_times:
                        rows = reduce.reduceat(segments, first[level], axis=0)
                    else:  # cells overlap, with at most three rows each
                        rows = np.stack(
                            [
                                reduce.reduce(values[a:b], axis=0, dtype=dtype)
                                for a, b in zip(begin, stop)
                            ]
                        )
                    if reduce is np.add:
                        rows /= (stop - begin)[:, np.newaxis]
                    out[level] = rows
    if not np.isfinite(pooled).all():
        raise ValueError(
            f"X holds values so large that their sums overflow {pooled.dtype}; divide "
            "X by a constant."
        )
    return pooled.reshape(len(sequences), -1)


class TemporalMaxPool(TrialRows, BaseEstimator):
    """Pool sequences of any length into one row of features per trial.

    Each level of a pyramid divides time into a number of cells, and the features are
    the maxima of every column in every cell, or other statistics. Fine levels tell when
    something was felt, coarse levels that it was felt at all.

    Parameters
    ----------
    cells : sequence of int, default=(16, 8, 4, 2, 1)
        Number of cells of each level. If all recordings are short, leave out the levels
        with more cells than the shortest sequence has time samples, as the 2020 paper
        does: cells that hold the same samples get too much weight in a penalised model.
    split : {"balanced", "floor"}, default="balanced"
        How a level divides `n_times` samples. "balanced" begins cell `i` of `n` at
        ``i * n_times // n``, so that cells differ by one sample at most. "floor", the
        rule of the authors of ST-HMP, gives every cell ``n_times // n`` samples and the
        last one the remainder too, up to `n - 1` samples more. If a sequence has fewer
        samples than a level has cells, the cells of that level overlap: each takes the
        sample at its middle and the neighbours of that sample.
    statistics : sequence of {"max", "mean", "share"}, default=("max",)
        What is computed of every column in every cell: the maximum, the mean, and the
        share of values that are not zero, which is how often an atom was used.
    root : bool, default=False
        Whether to take the square root of the magnitude of each feature, with its sign,
        so that few strong values dominate a linear model less.
    memory : str or object with the joblib.Memory interface, default=None
        Folder or :class:`joblib.Memory` in which to cache the pooled rows, so that a
        search over later steps codes and pools nothing twice. Results are the same, bit
        for bit. One entry holds the rows of one call of `transform`; it is found again
        by the trials, the dictionary, and the settings of coding and pooling. Clear the
        cache after an upgrade, and after you edit a function that encodes trials. By
        default nothing is cached.

    Attributes
    ----------
    cells_ : tuple of int
        Number of cells of each level.
    split_ : {"balanced", "floor"}
        How levels divide time.
    statistics_ : tuple of str
        Statistics of each cell.
    root_ : bool
        Whether features are square roots.
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
    cells; other statistics than the maximum are named, as in `t3of16_mean_ch0`. Columns
    without names are `ch0`, `ch1` and so on. Statistics come in the order given. In
    each, levels come in the order given, the cells of each level in time order, and
    each cell with all its columns.

    Maxima, sums and numbers of non-zero values can all be updated as a touch goes on,
    so one cell over the whole touch costs the same per sample however long it lasts.

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

    Square roots of means, of how often each column is used, and of maxima:

    >>> pool = TemporalMaxPool((1,), statistics=("mean", "share", "max"), root=True)
    >>> pool.fit_transform([np.array([0.0, 4.0, 8.0, 0.0])]).round(2)
    array([[1.73, 0.71, 2.83]])
    >>> pool.get_feature_names_out()
    array(['t1of1_mean_ch0', 't1of1_share_ch0', 't1of1_ch0'], dtype=object)
    """

    _parameter_constraints = {  # noqa: RUF012
        "cells": ["array-like"],
        "split": [StrOptions({"balanced", "floor"})],
        "statistics": ["array-like"],
        "root": ["boolean"],
        "memory": [str, HasMethods("cache"), None],
    }

    def __init__(
        self,
        cells: Sequence[int] = (16, 8, 4, 2, 1),
        *,
        split: Literal["balanced", "floor"] = "balanced",
        statistics: Sequence[Literal["max", "mean", "share"]] = ("max",),
        root: bool = False,
        memory: str | Memory | None = None,
    ) -> None:
        self.cells = cells
        self.split = split
        self.statistics = statistics
        self.root = root
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
            If `cells` are not distinct positive integers, or if a statistic is unknown
            or named twice.
        """
        with fit_task(self, X, y):
            self._record(X)
            self.cells_ = check_cells(self.cells)
            self.statistics_ = tuple(
                check_names(self.statistics, _STATISTICS, "statistic", "the pool")
            )
            self.root_ = self.root
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
        pooled : ndarray of shape (n_trials, n_statistics * n_cells * n_columns)
            Pooled features, float32 if the sequences are.

        Raises
        ------
        ValueError
            If a sequence is empty or has other columns than those seen in `fit`, or if
            a mean overflows.
        """
        check_is_fitted(self)
        sequences = self._check(X)
        # Sequences are hashed by their trials and dictionary, so a hit codes nothing.
        pool = check_cache(self.memory).cache(temporal_max_pool)
        pooled = pool(sequences, self.cells_, self.split_, self.statistics_)
        return self._with_index(signed_root(pooled) if self.root_ else pooled, X)

    def _names(self, columns):
        labels = ["" if name == "max" else f"{name}_" for name in self.statistics_]
        return [
            f"t{i}of{n}_{label}{column}"
            for label in labels
            for n in self.cells_
            for i in range(1, n + 1)
            for column in columns
        ]

    def __sklearn_is_fitted__(self):
        return hasattr(self, "split_")  # which is set last
