"""Recorded touches by sensor, checked, and how much of them has been felt.

Durations and the time felt are in seconds. A sensor has completed a duration when it
has as many samples as its rate gives in that time. A sensor that lags far behind the
others is missing: the touch goes on without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import NamedTuple
from warnings import warn

import numpy as np
import pandas as pd

from ..recordings._sequences import row_index
from ..recordings._trials import (
    ALONE,
    channel_names,
    check_columns,
    check_trials,
    is_table,
)
from ..utils._sklearn import FloatArray
from ..utils._validation import check_numbers, column_of

# Seconds, far below the time between two samples.
_ROUNDING = 1e-6
# Times as long as by another sensor, as by a wrong rate and hardly by a late stop.
_UNLIKE = 1.5


class Touches(NamedTuple):
    """Recordings of touches.

    Attributes
    ----------
    signals : dict of str to list of ndarray
        Of each sensor the recording of each touch, of shape (n_times, ...); of no
        samples where the touch lacks the sensor.
    names : pandas.Index or None
        Index of the touches.
    channels : dict of str to list or None
        The names of each sensor's channels, None if they have none.
    """

    signals: dict[str, list[FloatArray]]
    names: pd.Index | None = None
    channels: dict[str, list[str] | None] | None = None

    def __len__(self):
        return len(next(iter(self.signals.values())))

    def lengths(self):
        """Return the number of samples, of shape (n_touches, n_sensors)."""
        return np.array(
            [[len(each) for each in trials] for trials in self.signals.values()]
        ).T

    def prefixes(self, which, n_samples, columns):
        """Return the first samples of some touches, in the form of a step's input.

        Parameters
        ----------
        which : ndarray of int
            Indices of the touches.
        n_samples : dict of str to int
            How many samples of each sensor; None takes all. A recording with fewer is
            missing.
        columns : str, list of str or None
            A column, a table of columns, or None for trials that are in none.
        """

        def cut(sensor):
            trials, n = self.signals[sensor], n_samples[sensor]
            parts = [trials[i][:n] for i in which]
            return [each if n in (None, len(each)) else each[:0] for each in parts]

        if columns is None:
            return cut(ALONE)
        index = None if self.names is None else self.names[which]
        if isinstance(columns, str):
            return _series(cut(columns), index, columns)
        return pd.DataFrame({s: _series(cut(s), index, s) for s in columns})


def check_touches(X, rates, shapes=None, channels=None):
    """Check recordings of touches.

    Parameters
    ----------
    X : DataFrame with a column per sensor, or collection of trials
    rates : dict of str to float
        Samples per second, which time stamps must not contradict, of the columns to
        take; of `ALONE` alone for a collection of trials.
    shapes : dict of str to tuple of int, default=None
        Shape of one sample of each sensor in `fit`. By default this is `fit`, and no
        touch may lack a sensor.
    channels : dict of str to list or None, default=None
        Names of channels in `fit`, in whose order they are put.

    Returns
    -------
    touches : Touches

    Raises
    ------
    ValueError
        If X is in another form, or a recording is; the message names sensor and trial.
    """
    sensors, columns = list(rates), list(getattr(X, "columns", []))
    if sensors != [ALONE]:
        check_columns(X, sensors)
    if not columns and is_table(X):
        raise ValueError(
            "X is no collection of recordings; give a list with one array per touch, "
            "or a DataFrame with a column per sensor."
        )
    if sensors == [ALONE]:
        if len(columns) > 1:
            raise ValueError(
                f"X has the columns {columns}, but sampling_rates is one number; give "
                "a dict with the rate of each sensor."
            )
        by_sensor = {ALONE: column_of(X, 0) if columns else X}
    else:
        by_sensor = {s: column_of(X, columns.index(s)) for s in sensors}
    by_sensor = {sensor: list(trials) for sensor, trials in by_sensor.items()}
    if shapes is None:
        shapes = dict.fromkeys(by_sensor)
        channels = {sensor: channel_names(each) for sensor, each in by_sensor.items()}
    signals = {
        sensor: _check_sensor(
            trials, sensor, rates[sensor], shapes[sensor], channels[sensor]
        )
        for sensor, trials in by_sensor.items()
    }
    return Touches(signals, row_index(X), channels)


def check_alike(touches, rates):
    """Warn of sensors by which touches last far longer than by others."""
    lengths = np.median(touches.lengths(), axis=0)
    seconds = {s: n / rates[s] for s, n in zip(touches.signals, lengths)}
    longest, shortest = max(seconds, key=seconds.get), min(seconds, key=seconds.get)
    if seconds[longest] > _UNLIKE * seconds[shortest]:
        warn(
            f"By sampling_rates, {longest!r} lasts for {seconds[longest]:.3g} s and "
            f"{shortest!r} for {seconds[shortest]:.3g} s (medians of the touches); "
            "check the rates.",
            UserWarning,
            stacklevel=7,
        )


def check_durations(durations):
    """Return the durations; refuse what are no ascending seconds."""
    check_numbers(durations, "durations")
    values = np.asarray(durations, dtype=np.float64)
    if (
        values.ndim != 1
        or len(values) == 0
        or not np.isfinite(values).all()
        or (np.diff(values, prepend=0) <= 0).any()
    ):
        raise ValueError(
            f"durations={durations!r} must list seconds above 0 in ascending order."
        )
    return values


def check_rates(sampling_rates):
    """Return the sampling rate of each sensor."""
    by_name = isinstance(sampling_rates, Mapping)
    rates = dict(sampling_rates) if by_name else {ALONE: sampling_rates}
    for sensor, rate in rates.items():
        if not isinstance(sensor, str) or (by_name and sensor == ALONE):
            raise ValueError(
                f"sampling_rates names the sensor {sensor!r}; name sensors by the "
                "columns of X, which must be text."
            )
        if not isinstance(rate, Real) or not 0 < rate < np.inf:
            where = f" of {sensor!r}" if by_name else ""
            raise ValueError(
                f"The sampling rate{where} is {rate!r}; give samples per second."
            )
    if not rates:
        raise ValueError(
            "sampling_rates names no sensor; give the rate of each column of X."
        )
    return {sensor: float(rate) for sensor, rate in rates.items()}


def check_times(times):
    """Return the times; refuse what is no list of seconds."""
    check_numbers(times, "times")
    times = np.asarray(times, dtype=np.float64)
    if times.ndim != 1:
        raise ValueError(f"times has shape {times.shape}; give a list of seconds.")
    if not (times >= 0).all():
        bad = times[~(times >= 0)][0]
        raise ValueError(f"times holds {bad:g}; give seconds, 0 or more.")
    return times


def _check_sensor(trials, sensor, rate, shape, names):
    """Return the recordings of one sensor; those that are missing have no samples."""
    name = f"X[{sensor!r}]" if sensor else "X"
    checked = check_trials(
        trials,
        name=name,
        ndims=(2, 3),
        n_channels=shape,
        names=names,
        missing=shape is not None,
        rate=rate,
    )
    nothing = np.empty((0, *(shape or ())))
    return [nothing if trial is None else trial for trial in checked]


def _series(arrays, index, name):
    values = np.empty(len(arrays), dtype=object)
    values[:] = arrays
    return pd.Series(values, index=index, name=name)


def samples_in(seconds, rate):
    """Return how many whole samples of a sensor there are in so many seconds.

    Examples
    --------
    >>> from sklearn_haptic.streaming._recorded_touches import samples_in
    >>> samples_in([0.25, 0.3], 22)
    array([5, 6])
    """
    return np.floor((np.asarray(seconds) + _ROUNDING) * rate).astype(np.intp)


def seconds_felt(n_samples, rates, max_delay):
    """Return the seconds of a touch that all sensors have that are not left behind.

    Parameters
    ----------
    n_samples : ndarray of int of shape (..., n_sensors)
        What each sensor has recorded.
    rates : ndarray of shape (n_sensors,)
    max_delay : float
        As in :func:`left_behind`.

    Returns
    -------
    felt : ndarray of shape (...)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.streaming._recorded_touches import seconds_felt
    >>> seconds_felt(np.array([[200, 190], [200, 0]]), np.array([100, 100]), 0.5)
    array([1.9, 2. ])
    """
    behind = left_behind(n_samples, rates, max_delay)
    return np.where(behind, np.inf, n_samples / rates).min(axis=-1)


def durations_complete(n_samples, rates, needed, max_delay):
    """Return how many durations all sensors have completed that are not left behind.

    Parameters
    ----------
    n_samples, rates, max_delay
        As for :func:`seconds_felt`.
    needed : ndarray of int of shape (n_durations, n_sensors)
        Samples of each sensor in each duration, ascending.

    Returns
    -------
    n_complete : ndarray of int of shape (...)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.streaming._recorded_touches import durations_complete
    >>> needed = np.array([[5, 50], [11, 100]])
    >>> n_samples = np.array([[5, 50], [11, 99], [0, 100]])
    >>> durations_complete(n_samples, np.array([22, 200]), needed, 0.1)
    array([1, 1, 2])
    """
    complete = (n_samples[..., np.newaxis, :] >= needed).sum(axis=-2)
    behind = left_behind(n_samples, rates, max_delay)
    return np.where(behind, len(needed), complete).min(axis=-1)


def left_behind(n_samples, rates, max_delay):
    """Whether the next sample of each sensor is late by more than `max_delay` seconds.

    It is late by what the others have recorded. Samples may be taken at the begin of
    their steps or at the end, which a sensor of long steps must not be told by.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.streaming._recorded_touches import left_behind
    >>> n_samples = np.array([[4, 999], [5, 850], [4, 1150]])
    >>> left_behind(n_samples, np.array([5, 1000]), 0.1)
    array([[False, False],
           [False, False],
           [ True, False]])
    """
    seconds, steps = n_samples / rates, 1 / rates
    late = seconds[..., np.newaxis, :] - seconds[..., np.newaxis]
    late = (late - np.maximum(steps, steps[:, np.newaxis])).max(axis=-1)
    return late > max_delay + _ROUNDING
