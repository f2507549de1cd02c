"""What is wrong with single trials of a sensor, and how it is repaired."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ..utils._sklearn import FloatArray
from ._channel_regression import estimate_channels, estimate_moments

_USUAL = 0.9  # share of trials in which a channel that works varies
_ALL = "all"  # the channel of a fault of them all


class Usual(NamedTuple):
    """What the recordings of a sensor are like.

    Attributes
    ----------
    samples : tuple of (tuple of int, list or None)
        Shape of one time sample, and names of the channels if they have any.
    rests : ndarray of shape (n_channels,)
        Samples in a row beyond which a channel varies, as of :func:`usual_rests`.
    mean, scale : ndarray of shape (n_channels,)
    correlation : ndarray of shape (n_channels, n_channels)
        Of the samples of all trials, as of :func:`estimate_moments`.
    trial : ndarray of shape (n_times, n_channels)
        The most typical trial.
    """

    samples: tuple[tuple[int, ...], list[Any] | None]
    rests: FloatArray
    mean: FloatArray
    scale: FloatArray
    correlation: FloatArray
    trial: FloatArray


def fill_samples(trial, stamps=None):
    """Fill the NaN of each channel along straight lines in time.

    Samples are evenly spaced, or have ascending time stamps, an index of pandas. Before
    the first known sample and after the last, the nearest one is repeated. A channel
    without any known sample is 0. Return a copy.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.recordings._faults import fill_samples
    >>> fill_samples(np.array([[np.nan, 1, np.nan, 3, np.nan]]).T).ravel()
    array([1., 1., 2., 3., 3.])
    """
    if not np.isnan(trial).any():
        return trial.copy()
    # Numbers of dates, from 1970, would lose digits.
    table = pd.DataFrame(trial, None if stamps is None else stamps - stamps[0])
    filled = table.interpolate("index", limit_direction="both")
    return filled.fillna(0).to_numpy(copy=True)


def repair_trial(cell, usual, limits, rest, length=np.nan, stamps=None):
    """Repair a trial; return it and its faults.

    Parameters
    ----------
    cell : ndarray of shape (n_times, n_channels) or None
        A trial; None if the sensor is missing.
    usual : Usual
        What other trials are like.
    limits, rest
        See :class:`RepairTrials`.
    length : float, default=nan
        How many samples a missing sensor would have; NaN if that is not known.
    stamps : pandas.Index or None, default=None
        Time stamps of the samples.

    Returns
    -------
    repaired : ndarray of shape (n_times, n_channels)
        The trial without faults.
    faults : list of tuple (channel, fault, n_samples, answer, offset)
        What was wrong, and what was done about it.
    """
    if cell is None:
        length = len(usual.trial) if np.isnan(length) else np.ceil(round(length, 6))
        return _typical(usual, "missing sensor", 0, length)
    dead, varying = dead_channels(cell, usual.rests, limits, rest), usual.rests < np.inf
    if varying.any() and (dead | (~varying & ~moving(cell))).all():
        return _typical(usual, "dead sensor", len(cell), len(cell))
    repaired, faults = repair_channels(cell, limits, rest, stamps)
    if dead.any():
        repaired[:, dead] = estimate_channels(
            repaired, dead, usual.mean, usual.scale, usual.correlation
        )
        # Nothing else that is wrong with a dead channel has been repaired.
        faults = [fault for fault in faults if fault[0] == _ALL or not dead[fault[0]]]
        faults += [
            (int(i), "dead", len(cell), "estimated from the other channels", np.nan)
            for i in np.flatnonzero(dead)
        ]
    return repaired, faults


def longest_rests(cell):
    """Return how many samples in a row each channel rests.

    It is infinity if throughout, and NaN of a channel without any known sample.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.recordings._faults import longest_rests
    >>> longest_rests(np.array([[1, 1, np.nan, 1, 2, 2], [3, 3, 3, 3, 3, 3]]).T)
    array([ 4., inf])
    """
    moves = np.diff(fill_samples(cell), axis=0) != 0
    times = np.arange(1, len(cell))[:, np.newaxis]
    begins = np.maximum.accumulate(np.where(moves, times, 0), axis=0)
    longest = (times - begins + 1).max(axis=0, initial=1)
    longest = np.where(moves.any(axis=0), longest, np.inf)
    return np.where(np.isnan(cell).all(axis=0), np.nan, longest)


def usual_rests(rests):
    """Return the samples in a row that each channel rests in nine trials of ten.

    Parameters
    ----------
    rests : array-like of shape (n_trials, n_channels)
        Of :func:`longest_rests`. Trials without a channel do not count.
    """
    known = [each[~np.isnan(each)] for each in np.transpose(rests)]
    return np.array(
        [
            np.quantile(each, _USUAL, method="inverted_cdf") if each.size else np.inf
            for each in known
        ]
    )


def moving(cell):
    """Whether each channel has two samples that differ."""
    return np.fmax.reduce(cell) > np.fmin.reduce(cell)


def dead_channels(cell, rests, limits=None, rest=None):
    """Whether each channel rests longer than `rests`, or has no sample where it must.

    That is at its begin if `rest` is given. One at its limit throughout is not dead.
    """
    still = ~moving(cell) & (len(cell) > rests)
    if limits is not None:
        still &= ((cell > limits[0]) & (cell < limits[1])).any(axis=0)
    return still | np.isnan(cell[:rest]).all(axis=0)


def _typical(usual, fault, n_samples, length):
    """Return the most typical trial, cut or held, and what it stands for."""
    faults = [(_ALL, fault, n_samples, "typical trial", np.nan)]
    times = np.arange(int(length)).clip(max=len(usual.trial) - 1)
    return usual.trial[times], faults


def repair_channels(cell, limits, rest, stamps=None):
    """Do of :func:`repair_trial` what needs no other trials."""
    faults = []
    missing = np.isnan(cell)
    dropped = missing.all(axis=1)
    if cell.shape[1] > 1 and dropped.any():
        faults.append((_ALL, "dropped frames", int(dropped.sum()), "interpolated"))
        missing = missing & ~dropped[:, np.newaxis]
    faults += _each(missing.sum(axis=0), "missing samples", "interpolated")
    if limits is not None:
        beyond = (cell <= limits[0]) | (cell >= limits[1])
        faults += _each(beyond.sum(axis=0), "saturated", "kept at the limit")
    repaired = fill_samples(cell if limits is None else cell.clip(*limits), stamps)
    faults = [(*fault, np.nan) for fault in faults]
    if rest is not None:
        resting = pd.DataFrame(np.where(np.isnan(cell), np.nan, repaired)[:rest])
        offsets = resting.median().fillna(0).to_numpy(repaired.dtype)
        repaired -= offsets
        n_samples = min(rest, len(cell))
        faults += [
            (i, "rest level", n_samples, "subtracted", float(offset))
            for i, offset in enumerate(offsets)
        ]
    return repaired, faults


def usual_trials(cells, samples, limits, rest):
    """Learn what the trials of a sensor are like, from those that have it."""
    cells = [cell for cell in cells if cell is not None]
    rests = usual_rests([longest_rests(cell) for cell in cells])
    repaired = [repair_channels(cell, limits, rest)[0] for cell in cells]
    dead = np.array([dead_channels(cell, rests, limits, rest) for cell in cells])
    some = np.flatnonzero(~dead.all(axis=1))  # the others tell nothing
    repaired, dead = [repaired[i] for i in some], dead[some]
    moments = estimate_moments(repaired, dead)
    for trial, gone in zip(repaired, dead):
        if gone.any():
            trial[:, gone] = estimate_channels(trial, gone, *moments)
    # A recording is better than an estimate, but one of few whole trials may be odd.
    whole = ~(dead & ~dead.all(axis=0)).any(axis=1)
    if whole.mean() >= 0.5:
        repaired = [repaired[i] for i in np.flatnonzero(whole)]
    size = np.max([np.abs(t).max(axis=0) for t in repaired], axis=0)
    units = [t / np.where(size > 0, size, 1) for t in repaired]
    levels = np.array([np.r_[t.mean(axis=0), t.std(axis=0)] for t in units])
    spread = levels.std(axis=0)
    spread[spread == 0] = 1
    distances = np.abs((levels - np.median(levels, axis=0)) / spread).sum(axis=1)
    typical = repaired[distances.argmin()]
    return Usual(samples, rests, *moments, typical)


def _each(counts, fault, answer):
    return [(int(i), fault, int(counts[i]), answer) for i in np.flatnonzero(counts)]
