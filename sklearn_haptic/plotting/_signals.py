"""Recordings: the signals of each sensor in each trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from numbers import Real
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ..recordings._biotac import SAMPLING_RATES, SENSORS
from ..recordings._trials import check_trials
from ..utils._sklearn import FloatArray
from ._display import Axes, Display
from ._style import colours_of, label_blocks, legend_beside

# Sensors with more channels are shown as an image, since lines would hide each other.
_MAX_LINES = 8


@dataclass(eq=False, repr=False)
class SignalsDisplay(Display):
    """Signals of trials: one row of panels per sensor, one column per trial.

    Use :meth:`from_trials` to create a display. Up to eight channels are drawn as
    lines, more (such as electrodes) as rows of an image. The panels of a sensor share
    the axis of values, those of a trial the time axis.

    Parameters
    ----------
    signals : dict of str to list of ndarray of shape (n_times_i, n_channels)
        For each sensor, its signals in each trial.
    titles : sequence of str
        The name of each trial.
    sampling_rates : dict of str to float
        Samples per second of each sensor.
    units : dict of str to str
        Unit of each sensor's values.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes that hold the panels.
    axes_ : ndarray of matplotlib Axes of shape (n_sensors, n_trials)
        The panels.
    figure_ : matplotlib Figure
    lines_ : dict of str to list of list of matplotlib Line2D
        For each sensor shown as lines, those of each trial, channel by channel.
    images_ : dict of str to list of matplotlib AxesImage
        For each sensor shown as an image, that of each trial.

    References
    ----------
    Richardson and Kuchenbecker (2020), figure 6. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> from sklearn_haptic.plotting import SignalsDisplay
    >>> trials = {
    ...     name: make_haptic_corpus(1, 1, name, random_state=0).trials.iloc[0]
    ...     for name in ("squeeze", "hold")
    ... }
    >>> display = SignalsDisplay.from_trials(trials)
    >>> display.axes_.shape
    (5, 2)
    """

    signals: dict[str, list[FloatArray]]
    _: KW_ONLY
    titles: Sequence[str]
    sampling_rates: dict[str, float]
    units: dict[str, str]

    @classmethod
    def from_trials(
        cls,
        X: pd.DataFrame | pd.Series | Mapping[str, Any] | ArrayLike,
        *,
        sampling_rate: float | Mapping[str, float] | None = None,
        unit: str | Mapping[str, str] | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Plot the signals of trials.

        Parameters
        ----------
        X : DataFrame, Series, dict or array-like
            Several trials: a DataFrame with one row per trial and one column per
            sensor, or a dict from the name of each, such as its exploratory procedure,
            to the trial.
            One trial: a row of such a DataFrame, or a dict from the name of each sensor
            to its signals, of shape (n_times, n_channels). One sensor: such an array.
        sampling_rate : float or dict of str to float, default=None
            Samples per second, of all sensors or of each. By default those of a BioTac:
            2200 of pac, 100 of pdc, tac, tdc and electrodes.
        unit : str or dict of str to str, default=None
            Unit of the values, of all sensors or of each. By default those of a BioTac
            have "counts", and others are called "reading".
        ax : matplotlib Axes, default=None
            Axes, made by ``subplots``, in which to lay out the panels; by default
            those of a new figure.

        Returns
        -------
        display : SignalsDisplay

        Raises
        ------
        ValueError
            If trials differ in their sensors or channels, a signal is no finite array
            of time samples, or a sampling rate is unknown or not positive.
        """
        titles, trials = _named_trials(X)
        sensors = list(trials[0])
        if any(set(trial) != set(sensors) for trial in trials):
            raise ValueError("X has trials of different sensors; give all the same.")
        rates = {s: _rate_of(s, sampling_rate) for s in sensors}
        signals = {}
        for s, rate in rates.items():
            name = f"X[{s!r}]" if s else "X"
            signals[s] = check_trials([t[s] for t in trials], name=name, rate=rate)
        return cls(
            signals,
            titles=titles,
            sampling_rates=rates,
            units={s: _unit_of(s, unit) for s in sensors},
        ).plot(ax)

    def _figsize(self):
        n_rows, n_columns = len(self.signals), len(self.titles)
        return max(6.4, 1.9 * n_columns), max(2.6, 1.0 + 1.3 * n_rows)

    def _draw(self, ax):
        shape = len(self.signals), len(self.titles)
        self.axes_ = self._divide(shape, sharex="col", sharey="row")
        self.lines_, self.images_, legend = {}, {}, None
        for row, (sensor, signals) in zip(self.axes_, self.signals.items()):
            n_channels = signals[0].shape[1]
            channels = _channel_names(sensor, n_channels)
            if n_channels > _MAX_LINES:
                self.images_[sensor] = self._plot_images(row, sensor)
                row[0].set_ylabel(sensor)
                for panel in row:
                    label_blocks(panel, channels)
                continue
            self.lines_[sensor] = [
                self._plot_lines(panel, sensor, values, channels)
                for panel, values in zip(row, signals)
            ]
            row[0].set_ylabel("\n".join(filter(None, (sensor, self.units[sensor]))))
            if n_channels > 1 and channels != legend:
                legend_beside(
                    row[-1], loc="center left", bbox_to_anchor=(1, 0.5), handlelength=1
                )
                legend = channels
        self.figure_.align_ylabels(self.axes_[:, 0])
        for title, top, bottom in zip(self.titles, self.axes_[0], self.axes_[-1]):
            top.set_title(title.replace("_", " "), fontsize="medium")
            bottom.set_xlabel("time, s")

    def _plot_lines(self, panel, sensor, values, channels):
        """Plot the channels over time."""
        time = np.arange(len(values)) / self.sampling_rates[sensor]
        alpha = 1.0 if values.shape[1] == 1 else 0.7  # so that none hides another
        style = {"linewidth": 0.8, "alpha": alpha}
        lines = [
            panel.plot(time, channel, color=colour, label=name, **style)[0]
            for channel, colour, name in zip(
                values.T, colours_of(values.shape[1]), channels
            )
        ]
        panel.margins(x=0)
        return lines

    def _plot_images(self, row, sensor):
        """Show channels as rows of images of one colour scale."""
        signals = self.signals[sensor]
        low, high = min(map(np.min, signals)), max(map(np.max, signals))
        if low < 0 < high:  # the middle colour is that of 0
            low, high = min(low, -high), max(high, -low)
        images = [
            panel.imshow(
                values.T,
                aspect="auto",
                extent=(
                    0,
                    len(values) / self.sampling_rates[sensor],
                    values.shape[1] - 0.5,
                    -0.5,
                ),
                cmap="viridis",
                vmin=low,
                vmax=high,
            )
            for panel, values in zip(row, signals)
        ]
        bar_axes = row[-1].inset_axes((1.04, 0, 0.02 * len(row), 1))
        self.figure_.colorbar(images[0], cax=bar_axes, label=self.units[sensor])
        return images


def _named_trials(X):
    """Return names of trials, and of each trial a dict of each sensor's signals."""
    if hasattr(X, "iterrows"):
        pairs = list(X.iterrows())
    else:
        pairs = list(X.items()) if hasattr(X, "items") else [("", X)]
        nested = {_has_sensors(trial) for _, trial in pairs}
        if True not in nested:
            pairs = [("", dict(pairs))]
        elif False in nested:
            raise ValueError("X has trials beside signals; name the sensors of all.")
    if not pairs or not all(len(trial) for _, trial in pairs):
        raise ValueError("X holds no signals; give one trial and sensor or more.")
    return [str(name) for name, _ in pairs], [dict(trial) for _, trial in pairs]


def _has_sensors(trial):
    """Whether a trial is a dict of signals, or a row of a table of them."""
    row = isinstance(trial, pd.Series) and trial.dtype == object
    return row or isinstance(trial, Mapping)


def _rate_of(sensor, sampling_rate):
    """Return the sampling rate of a sensor, as given or, of a BioTac, as known."""
    rate = sampling_rate
    if rate is None or isinstance(rate, Mapping):
        rate = (SAMPLING_RATES | dict(rate or {})).get(sensor)
        if rate is None:
            raise ValueError(
                f"sampling_rate of the sensor {sensor!r} is unknown; give it in Hz."
            )
    return check_rate(rate)


def _unit_of(sensor, unit):
    """Return the unit of a sensor, as given or, of a BioTac, as known."""
    if isinstance(unit, str):
        return unit
    return dict(unit or {}).get(sensor, "counts" if sensor in SENSORS else "reading")


def check_rate(rate):
    """Return a sampling rate; refuse what is no positive finite number."""
    if not isinstance(rate, Real) or not 0 < rate < np.inf:
        raise ValueError(
            f"sampling_rate={rate!r} must be a positive number of samples per second."
        )
    return float(rate)


def _channel_names(sensor, n_channels):
    """Name channels by the finger they belong to, where that is known."""
    _, n_of_finger = SENSORS.get(sensor, (1, n_channels))
    if n_of_finger == n_channels:
        return [f"channel {i}" for i in range(n_channels)]
    return [f"finger {i // n_of_finger}" for i in range(n_channels)]
