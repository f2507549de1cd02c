"""Faults of the trials of one sensor: what is usual, what is not, and its repair."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..utils._sklearn import FloatArray

USUAL = 0.9  # share of trials in which a channel that works varies
_ALL = "all"  # the channel of a fault of them all

# Estimates of dead channels and of moments, in turn.
_MAX_ITER, _CONVERGED = 100, 1e-7
_RIDGE = 1e-8  # makes correlations of collinear channels invertible
_ROUNDING = 1e-12  # channels that vary less, relative to their level, are constant


class Usual(NamedTuple):
    """What the recordings of a sensor are like.

    Attributes
    ----------
    samples : tuple of (tuple of int, list or None)
        Shape of one time sample, and names of the channels if they have any.
    varies : ndarray of bool of shape (n_channels,)
        Whether a channel varies within nine trials of ten or more.
    mean : ndarray of shape (n_channels,)
    covariance : ndarray of shape (n_channels, n_channels)
        Of the samples of all trials, as of :func:`estimate_moments`.
    trial : ndarray of shape (n_times, n_channels)
        The most typical trial.
    """

    samples: tuple[tuple[int, ...], list[Any] | None]
    varies: NDArray[np.bool_]
    mean: FloatArray
    covariance: FloatArray
    trial: FloatArray


def fill_samples(trial):
    """Fill the NaN of each channel along straight lines in time.

    Before the first known sample and after the last, the nearest one is repeated. A
    channel without any known sample is 0. Return a copy.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.recordings._faults import fill_samples
    >>> fill_samples(np.array([[np.nan, 1, np.nan, 3, np.nan]]).T).ravel()
    array([1., 1., 2., 3., 3.])
    """
    filled = trial.copy()
    times = np.arange(len(trial))
    for column in filled.T:
        known = ~np.isnan(column)
        if not known.all():
            column[~known] = (
                np.interp(times[~known], times[known], column[known])
                if known.any()
                else 0
            )
    return filled


def estimate_channels(trial, dead, mean, covariance):
    """Estimate dead channels from the others, by linear regression.

    Parameters
    ----------
    trial : ndarray of shape (n_times, n_channels)
        A trial.
    dead : ndarray of bool of shape (n_channels,)
        The channels to estimate.
    mean, covariance : ndarray of shape (n_channels,) and (n_channels, n_channels)
        Of the samples of working channels.

    Returns
    -------
    estimated : ndarray of shape (n_times, n_dead)
        The regression of each dead channel on all others.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.recordings._faults import estimate_channels
    >>> covariance = np.array([[4.0, 2.0], [2.0, 1.0]])
    >>> trial = np.array([[0.0, 3.0], [0.0, 5.0]])
    >>> estimate_channels(trial, np.array([True, False]), np.ones(2), covariance)
    array([[5.],
           [9.]])
    """
    live = ~dead
    scale = np.sqrt(covariance.diagonal())
    scale[scale == 0] = 1
    correlation = covariance / np.outer(scale, scale)
    among_live = correlation[np.ix_(live, live)]
    weights = np.linalg.pinv(among_live, rcond=1e-12, hermitian=True)
    weights = weights @ correlation[np.ix_(live, dead)]
    departure = (trial[:, live] - mean[live]) / scale[live]
    return departure @ weights * scale[dead] + mean[dead]


def estimate_moments(trials, dead):
    """Estimate the mean and covariance of channels that are dead in some trials.

    They are those of maximum likelihood for normal samples, found by the EM algorithm:
    dead channels are estimated from the others, and with them the moments, in turn.
    (Covariances of each pair of channels, over the trials in which both live, do not
    fit together if trials differ: their regression can be worse than none.)

    Parameters
    ----------
    trials : list of ndarray of shape (n_times_i, n_channels)
        Trials without NaN.
    dead : ndarray of bool of shape (n_trials, n_channels)
        The channels of each trial to leave out. One that is left out of all trials has
        the mean and variance 0.

    Returns
    -------
    mean, covariance : ndarray of shape (n_channels,) and (n_channels, n_channels)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.recordings._faults import estimate_moments
    >>> trials = [np.array([[0.0, 1.0], [2.0, 5.0]]), np.array([[4.0, 0.0]])]
    >>> mean, _ = estimate_moments(trials, np.array([[False, False], [False, True]]))
    >>> mean.round(5)  # the second is twice the first, plus one
    array([2., 5.])
    """
    n_times = np.array([len(trial) for trial in trials])
    n_alive = np.maximum(n_times @ ~dead, 1)
    pairs = list(zip(trials, dead))
    mean = sum(t.sum(axis=0, dtype=float) * ~gone for t, gone in pairs) / n_alive
    variance = sum(np.square(t - mean).sum(axis=0) * ~gone for t, gone in pairs)
    scale = np.sqrt(variance / n_alive)
    varies = scale > _ROUNDING * np.abs(mean)
    scale[~varies] = 1
    units = [(t - mean) / scale * (varies & ~gone) for t, gone in pairs]
    partial = [(units[i], dead[i]) for i in np.flatnonzero(dead.any(axis=1))]
    whole = np.vstack([units[0][:0], *(units[i] for i in np.flatnonzero(~dead.any(1)))])
    of_whole, known = whole.sum(axis=0), whole.T @ whole
    shift, correlation = np.zeros(len(mean)), np.eye(len(mean))
    if len(whole) > len(mean):  # a start from which a single dead channel is exact
        shift = of_whole / len(whole)
        correlation = known / len(whole) - np.outer(shift, shift)
    for _ in range(_MAX_ITER):
        precision = np.linalg.inv(correlation + _RIDGE * np.eye(len(mean)))
        total, products = of_whole.copy(), known.copy()
        for unit, gone in partial:
            unsure = np.linalg.inv(precision[np.ix_(gone, gone)])
            weights = -precision[np.ix_(~gone, gone)] @ unsure
            filled = unit.copy()
            filled[:, gone] = (unit - shift)[:, ~gone] @ weights + shift[gone]
            total += filled.sum(axis=0)
            products += filled.T @ filled
            products[np.ix_(gone, gone)] += len(unit) * unsure
        previous, shift = correlation, total / n_times.sum()
        correlation = products / n_times.sum() - np.outer(shift, shift)
        if np.abs(correlation - previous).max() <= _CONVERGED:
            break
    scale = scale * varies
    return mean + scale * shift, correlation * np.outer(scale, scale)


def repair_trial(cell, usual, limits, rest):
    """Repair a trial; return it and its faults.

    Parameters
    ----------
    cell : ndarray of shape (n_times, n_channels) or None
        A trial; None if the sensor is missing.
    usual : Usual
        What other trials are like.
    limits, rest
        See :class:`RepairTrials`.

    Returns
    -------
    repaired : ndarray of shape (n_times, n_channels)
        The trial without faults.
    faults : list of tuple (channel, fault, n_samples, answer, offset)
        What was wrong, and what was done about it.
    """
    if cell is None:
        return _typical(usual, "missing sensor", 0)
    dead = dead_channels(cell, usual.varies)
    if (dead & usual.varies).any() and dead[usual.varies].all():
        return _typical(usual, "dead sensor", len(cell))
    repaired, faults = repair_channels(cell, limits, rest)
    if dead.any():
        repaired[:, dead] = estimate_channels(
            repaired, dead, usual.mean, usual.covariance
        )
        # Nothing else that is wrong with a dead channel has been repaired.
        faults = [fault for fault in faults if fault[0] == _ALL or not dead[fault[0]]]
        faults += [
            (int(i), "dead", len(cell), "estimated from the other channels", np.nan)
            for i in np.flatnonzero(dead)
        ]
    return repaired, faults


def dead_channels(cell, usually):
    """Whether each channel has no sample, or is constant and `usually` varies."""
    rests = usually & ~_varies(cell) & (len(cell) > 1)
    return rests | np.isnan(cell).all(axis=0)


def _typical(usual, fault, n_samples):
    """Return the most typical trial, and what it stands for."""
    faults = [(_ALL, fault, n_samples, "typical trial", np.nan)]
    return usual.trial.copy(), faults


def repair_channels(cell, limits, rest):
    """Do of :func:`repair_trial` what needs no other trials."""
    faults = []
    missing = np.isnan(cell)
    dropped = missing.all(axis=1)
    if cell.shape[1] > 1 and dropped.any():
        faults.append((_ALL, "dropped frames", int(dropped.sum()), "interpolated"))
        missing = missing & ~dropped[:, np.newaxis]
    faults += _each(missing.sum(axis=0), "missing samples", "interpolated")
    repaired = fill_samples(cell)
    if limits is not None:
        beyond = (cell <= limits[0]) | (cell >= limits[1])
        faults += _each(beyond.sum(axis=0), "saturated", "kept at the limit")
        repaired = repaired.clip(*limits)
    faults = [(*fault, np.nan) for fault in faults]
    if rest is not None:
        offsets = np.median(repaired[:rest], axis=0)
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
    usually = np.mean([_varies(cell) for cell in cells], axis=0) >= USUAL
    repaired = [repair_channels(cell, limits, rest)[0] for cell in cells]
    dead = np.array([dead_channels(cell, usually) for cell in cells])
    some = np.flatnonzero(~dead.all(axis=1))  # the others tell nothing
    repaired, dead = [repaired[i] for i in some], dead[some]
    mean, covariance = estimate_moments(repaired, dead)
    for trial, gone in zip(repaired, dead):
        if gone.any():
            trial[:, gone] = estimate_channels(trial, gone, mean, covariance)
    # A recording is better than an estimate, but one of few whole trials may be odd.
    whole = ~(dead & ~dead.all(axis=0)).any(axis=1)
    if whole.mean() >= 0.5:
        repaired = [repaired[i] for i in np.flatnonzero(whole)]
    levels = np.array([np.r_[t.mean(axis=0), t.std(axis=0)] for t in repaired])
    spread = levels.std(axis=0)
    spread[spread == 0] = 1
    distances = np.abs((levels - np.median(levels, axis=0)) / spread).sum(axis=1)
    typical = repaired[distances.argmin()]
    return Usual(samples, usually, mean, covariance, typical)


def _varies(cell):
    """Whether each channel has two different known samples."""
    high = np.where(np.isnan(cell), -np.inf, cell).max(axis=0)
    low = np.where(np.isnan(cell), np.inf, cell).min(axis=0)
    return high > low


def _each(counts, fault, answer):
    return [(int(i), fault, int(counts[i]), answer) for i in np.flatnonzero(counts)]
