"""Recorded touches by sensor, checked: what `AnytimeRegressor` is given."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from ..recordings._sequences import row_index
from ..recordings._trials import channel_names, check_trials, is_table
from ..utils._sklearn import FloatArray
from ..utils._validation import column_of

# Stands for the sensor of trials that are not in columns.
ONLY_SENSOR = ""


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
            How many samples of each sensor; None takes all.
        columns : str, list of str or None
            A column, a table of columns, or None for trials that are in none.
        """

        def cut(sensor):
            trials, n = self.signals[sensor], n_samples[sensor]
            return [trials[i][:n] for i in which]

        if columns is None:
            return cut(ONLY_SENSOR)
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
        take; of `ONLY_SENSOR` alone for a collection of trials.
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
    if not columns and is_table(X):
        raise ValueError(
            "X is no collection of recordings; give a list with one array per touch, "
            "or a DataFrame with a column per sensor."
        )
    if sensors == [ONLY_SENSOR]:
        if len(columns) > 1:
            raise ValueError(
                f"X has the columns {columns}, but sampling_rates is one number; give "
                "a dict with the rate of each sensor."
            )
        by_sensor = {ONLY_SENSOR: column_of(X, 0) if columns else X}
    else:
        missing = [sensor for sensor in sensors if sensor not in columns]
        if missing:
            raise ValueError(
                f"X has no column {missing[0]!r}, which sampling_rates names; give a "
                "DataFrame with a column per sensor."
            )
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
