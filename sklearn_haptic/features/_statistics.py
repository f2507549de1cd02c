"""Statistics and spectral bands of the channels of trials."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from numbers import Integral, Real
from typing import Literal, Self
from warnings import warn

import numpy as np
from scipy.fft import dct, next_fast_len
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ..recordings._sequences import Sequences
from ..recordings._trials import (
    cells_of,
    check_trials,
    name_of,
    rate_of,
    transposed_hint,
)
from ..utils._sklearn import (
    FloatArray,
    Interval,
    Trials,
    _fit_context,
    fit_task,
    one_blas_thread,
)
from ..utils._validation import check_names
from ._pooling import cell_bounds, check_cells
from ._sparse_coding import product, rounding_level, row_norms
from ._trial_rows import TrialRows

_STATISTICS = ["mean", "std", "max", "min", "slope", "change", "bands"]
_N_OCTAVES = 8  # from the lower edge of the second band to half the sampling rate
_FLOOR = 1e-8  # of a band's power, relative to the typical power of its channel
_CHUNK_SIZE = 2**17  # samples computed at a time, which stay in the cache

# Far more than the factor by which real touches lie outside the peaks of others.
_FAR = 100


# Channels per time sample that no touch has, and most transposed ones have.
_MOST_CHANNELS = 10


def _warn_of_transposed(X, trials):
    """Warn of signals with far more channels than samples; images have many pixels."""
    n_times, n_channels = longest = max(trial.shape for trial in trials)
    images = np.ndim(next(iter(cells_of(X)))) > 2
    if n_channels > _MOST_CHANNELS * n_times and not images:
        warn(
            "Trials have far more channels than time samples."
            f"{transposed_hint(longest)}",
            stacklevel=4,
        )


def band_edges(n_bands):
    """Divide frequencies up to half the sampling rate into geometric bands.

    Parameters
    ----------
    n_bands : int
        Number of bands.

    Returns
    -------
    edges : ndarray of shape (n_bands + 1,)
        Edges in cycles per sample. The lowest band begins at 0.

    Examples
    --------
    >>> from sklearn_haptic.features._statistics import band_edges
    >>> band_edges(4)
    array([0.       , 0.0078125, 0.03125  , 0.125    , 0.5      ])
    """
    octaves = _N_OCTAVES * (np.arange(n_bands + 1) / n_bands - 1)
    return np.append(0, 0.5 * 2 ** octaves[1:])


def band_powers(signals, edges):
    """Return the mean power of signals in bands of frequency.

    Signals are mirrored at their ends by the cosine transform, so that a drift from
    begin to end is no jump, whose power would cover what is in the higher bands. The
    power of a line of the spectrum counts as spread evenly as far as halfway to its
    neighbours, that of the lowest from 0 on, so that every band has its share however
    short the signal is. The mirror begins up to a few per cent early, for a length
    whose transform is fast.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_times)
        Signals whose mean is zero.
    edges : ndarray of shape (n_bands + 1,)
        Edges of the bands in cycles per sample.

    Returns
    -------
    powers : ndarray of shape (n_signals, n_bands)
        Powers. If the bands reach from 0 to 1/2, their sum is the variance, of signals
        whose length is fast.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._statistics import band_edges, band_powers
    >>> wave = np.cos(2 * np.pi * 0.06 * np.arange(500))
    >>> band_powers(wave[np.newaxis], band_edges(4)).round(2)
    array([[0. , 0. , 0.5, 0. ]])
    """
    n_times = signals.shape[1]
    n_lines = next_fast_len(n_times, real=True)
    if n_lines > n_times:  # The mirror begins within the signal.
        mirror = signals[:, : n_times - n_lines - 1 : -1]
        signals = np.concatenate([signals, mirror], axis=1)
    spectra = dct(signals, norm="ortho", axis=1)
    np.square(spectra, out=spectra)
    # Line k of the spectrum has frequency k / (2 n_lines). Line 0, the mean, is left
    # out, and line 1 is half as wide again, from 0 to 1.5.
    places = 2 * n_lines * edges + 0.5
    places = np.minimum(np.maximum(places, (places + 1) / 1.5), n_lines)
    lines = np.minimum(places.astype(int), n_lines - 1)
    whole = np.add.reduceat(spectra, lines, axis=1)[:, :-1]
    whole[:, lines[1:] == lines[:-1]] = 0
    parts = spectra.take(lines, axis=1) * (places - lines)
    return (whole + np.diff(parts, axis=1)) / n_lines


@np.errstate(over="ignore")  # which the caller sees by the result
def signal_statistics(signals, statistics, edges, scale):
    """Compute statistics of signals.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_times)
        Signals.
    statistics : sequence of str
        See :class:`SignalStatistics`.
    edges : ndarray of shape (n_bands + 1,)
        Edges of the bands in cycles per sample.
    scale : ndarray of shape (n_signals,)
        The magnitude to which the powers of the bands are relative.

    Returns
    -------
    features : ndarray of shape (n_signals, n_features)
        Features of each signal, of the dtype of `signals`.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._statistics import signal_statistics
    >>> names = ("mean", "std", "max", "min", "slope", "change")
    >>> signal_statistics(np.array([[1.0, 2.0, 3.0]]), names, None, None).round(2)
    array([[2.  , 0.82, 3.  , 1.  , 1.  , 1.  ]])
    """
    n_times = signals.shape[1]
    # Dividing by a power of two brings squares into range and changes no digit.
    limits = np.finfo(signals.dtype)
    highest, lowest = signals.max(axis=1), signals.min(axis=1)
    exponents = np.frexp(np.maximum(highest, -lowest))[1]
    units = np.ldexp(
        signals.dtype.type(1), np.clip(exponents, limits.minexp, limits.maxexp - 1)
    )
    # Sums are rounded alike, however the recording lies in memory.
    signals = np.multiply(signals, (1 / units)[:, np.newaxis], order="C")
    # Of a constant it is that constant, whatever rounding does.
    mean = signals.mean(axis=1).clip(lowest / units, highest / units)
    centred = signals - mean[:, np.newaxis]

    def slope():
        times = np.arange(n_times) - (n_times - 1) / 2
        return product(centred, times.astype(signals.dtype)) / (times @ times or 1)

    def change():
        steps = np.diff(signals, axis=1)
        return np.abs(steps, out=steps).sum(axis=1) / max(1, n_times - 1)

    levels = {
        "mean": lambda: mean,
        "std": lambda: np.sqrt(np.vecdot(centred, centred) / n_times),
        "max": lambda: highest / units,
        "min": lambda: lowest / units,
        "slope": slope,
        "change": change,
    }
    columns = []
    for statistic in statistics:
        if statistic != "bands":
            columns.append((levels[statistic]() * units)[:, np.newaxis])
            continue
        with np.errstate(divide="ignore"):  # silence, which the floor turns finite
            logs = np.log(band_powers(centred, edges))
        relative = 2 * (np.log(units) - np.log(scale))
        columns.append(np.logaddexp(logs + relative[:, np.newaxis], np.log(_FLOOR)))
    return np.hstack(columns).astype(signals.dtype, copy=False)


def trial_statistics(trials, statistics, edges, scale, cells=(1,)):
    """Compute statistics of the channels of trials, several trials at a time.

    Parameters
    ----------
    trials : sequence of ndarray of shape (n_times_i, n_channels)
        Trials of one data type. Each is asked for once.
    statistics, edges
        See :func:`signal_statistics`.
    scale : ndarray of shape (n_channels,)
        The magnitude of each channel to which the powers of its bands are relative.
    cells : sequence of int, default=(1,)
        Number of cells of time of each level of the pyramid.

    Returns
    -------
    features : ndarray of shape (n_trials, sum(cells) * n_channels * n_features)
        Levels in the order given, the cells of each level in time order, and in each
        cell all features of the first channel, then those of the next.
    """
    lengths = trials.lengths if isinstance(trials, Sequences) else map(len, trials)
    lengths = list(lengths)
    features = None
    order = np.argsort(lengths, kind="stable").tolist()
    for n_times, alike in groupby(order, key=lengths.__getitem__):
        alike = list(alike)
        at_once = max(1, _CHUNK_SIZE // (n_times * len(scale)))
        for begin in range(0, len(alike), at_once):
            chunk = alike[begin : begin + at_once]
            # Each channel of each trial is one row, contiguous in memory.
            signals = np.stack([trials[i].T for i in chunk])
            signals = np.ascontiguousarray(signals).reshape(-1, n_times)
            scales = np.tile(scale, len(chunk))
            rows = [
                signal_statistics(signals[:, a:b], statistics, edges, scales)
                for n in cells
                for a, b in zip(*cell_bounds(n_times, n))
            ]
            rows = np.stack(rows).reshape(len(rows), len(chunk), -1)
            if features is None:
                shape = (len(lengths), len(rows), rows.shape[2])
                features = np.empty(shape, rows.dtype)
            features[chunk] = rows.swapaxes(0, 1)
    if not np.isfinite(features).all():
        raise ValueError(
            f"X holds values so large that their sums overflow {features.dtype}; "
            "divide X by a constant."
        )
    return features.reshape(len(features), -1)


def typical_deviations(trials, n_channels):
    """Return the root mean square over trials of each channel's standard deviation.

    A channel that is constant but for rounding has its largest magnitude, or 1.
    """
    rows = trial_statistics(trials, ["std", "max", "min"], None, np.ones(n_channels))
    deviations, *peaks = np.moveaxis(rows.reshape(len(rows), n_channels, 3), -1, 0)
    typical = row_norms(deviations.T) / np.sqrt(len(rows))
    magnitudes = np.abs(peaks).max(axis=(0, 1)).astype(np.float64)
    constant = typical <= rounding_level(rows.dtype) * magnitudes
    typical[constant] = magnitudes[constant]
    typical[typical == 0] = 1
    return typical


def peak_of(trial):
    """Return the largest magnitude in a trial."""
    return max(abs(float(trial.max())), abs(float(trial.min())))


def check_peaks(trials, known, shortest, name):
    """Warn of a trial whose peak is a hundred times beyond the `known` range.

    That of a trial with fewer samples than the `shortest` may be lower.
    """
    lowest, highest = known
    for i, trial in enumerate(trials):
        peak = peak_of(trial)
        high = peak > _FAR * highest > 0
        if high or (_FAR * peak < lowest and len(trial) >= shortest):
            factor = peak / (highest if high else lowest)
            warn(
                f"Trial {i} of {name} has a peak of {factor:.2g} times the "
                f"{'highest' if high else 'lowest'} in fit; check the unit, the gain "
                "and the wiring of the sensor.",
                UserWarning,
                stacklevel=3,
            )
            return


class SignalStatistics(TrialRows, BaseEstimator):
    """Statistics and spectral bands of every channel, one row of features per trial.

    These features are cheap and learn next to nothing: the level of a channel, how far
    it varies, its drift, and the powers of bands of its spectrum. They stand beside the
    codes of :class:`KSVDTransformer` and :class:`STHMPTransformer`, which tell what
    shapes a signal has and when.

    Parameters
    ----------
    statistics : sequence of str, default=("mean", "std", "max", "min", "slope", \
            "change", "bands")
        What is computed of each channel in each cell of time: its mean, standard
        deviation, maximum and minimum; "slope", the mean change per sample of a line
        fitted to it; "change", the mean absolute difference between one sample and the
        next; and "bands", the logarithms of its power in bands of frequency.
    n_bands : int, default=16
        Number of bands. Their edges are geometric over the eight octaves below half the
        sampling rate; the lowest band also has all lower frequencies. 32 suit signals
        of thousands of samples, such as vibrations.
    cells : sequence of int, default=(1,)
        Number of cells of time of each level of a pyramid, as in
        :class:`TemporalMaxPool`. Each level costs as much time as the first.
    rate : float, default=None
        Samples per second. Trials of pandas whose index has time stamps are refused if
        these contradict it. By default the rate of such trials in `fit`.

    Attributes
    ----------
    statistics_ : tuple of str
        The statistics of each channel in each cell.
    cells_ : tuple of int
        Number of cells of each level.
    band_edges_ : ndarray of shape (n_bands + 1,)
        Edges of the bands in cycles per sample: times the sampling rate they are in Hz.
    scale_ : ndarray of shape (n_channels,)
        Root mean square of the standard deviations of each channel or, if it is
        constant, its magnitude. Powers of bands are relative to the square of this, and
        a floor of 1e-8 is added to them, so that silence has a finite logarithm.
    rate_ : float or None
        Samples per second, if they are known.
    peaks_ : tuple of float (lowest, highest)
        Of the largest magnitude in each trial. `transform` warns of a trial that lies
        a hundred times beyond, such as one in another unit or of a sensor that is off.
    takes_trials_ : bool
        Whether trials or sequences were fitted; else a table.
    n_features_in_ : int
        Number of channels of the trials, or of columns of the table.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the columns. Defined for :class:`Sequences` and data frames, which
        have names.

    See Also
    --------
    TemporalMaxPool : Pool codes of windows into one row per trial.

    Notes
    -----
    `X` may be any collection of trials of shape (n_times_i, n_channels) with one time
    sample or more, or of images, whose pixels are channels row by row, or
    :class:`Sequences`. Each row of a table is a trial with one
    channel, `ch0`, and one time sample per feature.

    Features have names like `t1of1_ch0_std` and `t2of4_ch0_band3of16`, which is the
    third band, counted from the lowest, in the second of four cells. All features of a
    channel in a cell stand together. Multiplying the trials of `fit`
    and `transform` by a positive constant multiplies all features but the bands, which
    stay as they are.

    The spectrum is that of the discrete cosine transform. The power of a drift reaches
    far less into its higher bands than into those of the Fourier transform, for which a
    trial that does not end as it began has a jump. Up to a length whose transform is
    fast, mostly a few per cent longer, the end is mirrored: what is there counts twice.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import SignalStatistics
    >>> times = np.arange(300)[:, np.newaxis]
    >>> trials = [np.sin(0.3 * times), np.sin(1.2 * times[:200])]
    >>> statistics = SignalStatistics(("std", "bands"), n_bands=4)
    >>> statistics.fit_transform(trials).round(1)
    array([[ 0.7, -6.1, -4.4, -0. , -8.1],
           [ 0.7, -8. , -7. , -5.1, -0. ]])
    >>> statistics.get_feature_names_out()[:3]
    array(['t1of1_ch0_std', 't1of1_ch0_band1of4', 't1of1_ch0_band2of4'], dtype=object)

    Each sensor has its own statistics, at its own rate:

    >>> from sklearn.compose import make_column_transformer
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> corpus = make_haptic_corpus(n_objects=4, n_trials=2, random_state=0)
    >>> features = make_column_transformer(
    ...     (SignalStatistics(n_bands=32), "pac"), (SignalStatistics(), "electrodes")
    ... )
    >>> features.fit_transform(corpus.trials).shape
    (8, 912)
    """

    _parameter_constraints = {  # noqa: RUF012
        "statistics": ["array-like"],
        "n_bands": [Interval(Integral, 1, None, closed="left")],
        "cells": ["array-like"],
        "rate": [Interval(Real, 0, None, closed="neither"), None],
    }

    def __init__(
        self,
        statistics: Sequence[
            Literal["mean", "std", "max", "min", "slope", "change", "bands"]
        ] = ("mean", "std", "max", "min", "slope", "change", "bands"),
        *,
        n_bands: int = 16,
        cells: Sequence[int] = (1,),
        rate: float | None = None,
    ) -> None:
        self.statistics = statistics
        self.n_bands = n_bands
        self.cells = cells
        self.rate = rate

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: Trials, y: None = None) -> Self:
        """Record the channels and their scale.

        Parameters
        ----------
        X : collection of trials, Sequences, or array-like of shape \
                (n_trials, n_times)
            Trials.
        y : None
            Ignored.

        Returns
        -------
        self : SignalStatistics
            The fitted transformer.

        Raises
        ------
        ValueError
            If a statistic is unknown or named twice, `cells` are not distinct
            positive integers, or time stamps contradict the rate.
        """
        with fit_task(self, X, y):
            self.rate_ = rate_of(X, self.rate, name=name_of(X))
            trials = self._record(X)
            if self.takes_trials_ and not isinstance(X, Sequences):
                _warn_of_transposed(X, trials)
            statistics = check_names(
                self.statistics, _STATISTICS, "statistic", "SignalStatistics"
            )
            self.cells_ = check_cells(self.cells)
            n_channels = self.n_features_in_ if self.takes_trials_ else 1
            self.scale_ = typical_deviations(trials, n_channels)
            peaks = [peak_of(trial) for trial in trials]
            self.peaks_ = min(peaks), max(peaks)
            self._shortest = min(map(len, trials))
            self.band_edges_ = band_edges(self.n_bands)
            self.statistics_ = tuple(statistics)
        return self

    @one_blas_thread
    def transform(self, X: Trials) -> FloatArray:
        """Compute the statistics of trials.

        Parameters
        ----------
        X : collection of trials, Sequences, or array-like of shape \
                (n_trials, n_times)
            Trials with the channels seen in `fit`.

        Returns
        -------
        features : ndarray of shape (n_trials, n_cells * n_channels * n_features)
            All features of the first channel in the first cell, then those of the next
            channel; float32 if the trials are.

        Raises
        ------
        ValueError
            If a trial is empty, has other channels or another rate than those seen in
            `fit`, or holds values so large that their sums overflow.
        """
        check_is_fitted(self)
        rate_of(X, self.rate_, name=name_of(X))
        trials = self._check(X)
        check_peaks(trials, self.peaks_, self._shortest, name_of(X))
        features = trial_statistics(
            trials,
            self.statistics_,
            self.band_edges_,
            self.scale_,
            self.cells_,
        )
        return self._with_index(features, X)

    def _check_trials(self, X, n_columns=None):
        if n_columns is None:
            self._frame = None  # the shape of an image
        if not isinstance(X, Sequences) and np.ndim(next(iter(cells_of(X)), None)) == 3:
            frame = None if n_columns is None else self._frame
            images = check_trials(X, ndims=(3,), n_channels=frame)
            self._frame = images[0].shape[1:]
            X = [trial.reshape(len(trial), -1) for trial in images]
        return super()._check_trials(X, n_columns)

    def _names(self, columns):
        n_bands = len(self.band_edges_) - 1
        bands = [f"band{i}of{n_bands}" for i in range(1, n_bands + 1)]
        labels = [
            label
            for statistic in self.statistics_
            for label in (bands if statistic == "bands" else [statistic])
        ]
        return [
            f"t{i}of{n}_{column}_{label}"
            for n in self.cells_
            for i in range(1, n + 1)
            for column in columns
            for label in labels
        ]

    def __sklearn_is_fitted__(self):
        return hasattr(self, "statistics_")  # which is set last
