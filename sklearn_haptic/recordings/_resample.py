"""Resampling of trials whose samples have time stamps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.signal import resample_poly

from ..utils._row_order import check_order
from ..utils._sklearn import FloatArray, Interval, StrOptions, validate_params
from ..utils._validation import has_no_samples
from ._trials import UNITS, check_trials, has_time_index, seconds_of, typical_step

# Factor of rates beyond which stamps are in another unit: 10 Hz may become 3 kHz.
_MOST_IN_STEP = 300

# Share of a new step by which stamps may be rounded, also those of single precision.
_ROUNDING = 0.01

# Times the steps of a trial beyond which a stamp is wrong.
_LONGEST = 1000


@validate_params(
    {
        "rate": [Interval(Real, 0, np.inf, closed="neither"), None],
        "unit": [StrOptions({*UNITS})],
        "longest_gap": [Interval(Real, 0, np.inf, closed="right"), None],
    },
    prefer_skip_nested_validation=True,
)
def resample_trials(
    trials: Sequence[ArrayLike],
    times: Sequence[ArrayLike] | str | None = None,
    rate: float | None = None,
    *,
    unit: Literal["s", "ms", "us", "ns"] = "s",
    longest_gap: float | None = None,
) -> list[FloatArray | None]:
    """Resample trials to an even rate, from the time stamps of their samples.

    Between two stamps the signal is a cubic spline, or a straight line where it rests
    or the stamps are more than 1.5 typical steps apart. Where new samples lie between
    stamps, this weakens vibrations: those at .2 of the rate by 1 %, at .3 by 4 % and at
    .4 by 16 %, and by 1, 7 and 34 % where all lie halfway. If the stamps are closer
    than the new samples by more than a tenth, the curve is sampled at a whole multiple
    of the rate and decimated by the filter of :func:`scipy.signal.resample_poly`, so
    that vibrations faster than half the new rate do not come out as slower ones. Those
    that are faster by less than a tenth, and samples at the ends and beside gaps, keep
    some of them. Where frames were dropped, the new samples are NaN, which
    :class:`RepairTrials` fills and reports. At a lower rate, a gap that lies between
    two new samples is not told, and these are interpolated over it.

    Parameters
    ----------
    trials : sequence of array-like of shape (n_times_i, n_channels)
        Trials of one sensor. Masked samples and NaN count as dropped. The columns of
        data frames are put in the order of the first of them, and lose their names: let
        this be the same order for touches to learn from and for those to predict.
    times : sequence of array-like of shape (n_times_i,), str or None, default=None
        When the samples of each trial were taken, increasing: numbers, or dates or
        durations of NumPy, pandas or polars. A name is that of their column in trials
        that are data frames. By default they are the index of trials of pandas.
    rate : float, default=None
        Samples per second of the result. Give the same for training touches and new
        ones, none higher than that of the slowest: what was not recorded stays missing,
        and a model takes it for another surface. By default that of the typical step,
        which is too low where about a tenth or more of the samples is lost here and
        there, or a twentieth if stamps jitter or a few trials have fewer than 200
        samples; too high where a tenth is far later than others but none is lost, or
        where steps vary by a fifth or more (by up to 5 %, at a third by 12 %, at a half
        by 21 %); and up to 5 % off for more than 700 Hz with stamps in milliseconds.
    unit : {"s", "ms", "us", "ns"}, default="s"
        Unit of stamps that are numbers.
    longest_gap : float, default=None
        Seconds between two stamps within which the curve is trusted; new samples
        within a longer gap are NaN. By default 1.5 times the typical step of a trial,
        which a single dropped frame exceeds, and so does a step of a sensor faster than
        500 Hz whose stamps were rounded to milliseconds. `np.inf` trusts it
        everywhere.

    Returns
    -------
    resampled : list of ndarray of shape (n_samples_i, n_channels)
        Samples at the first stamp and every ``1 / rate`` seconds, up to the last stamp.
        float32 if the trials are. None in place of a trial that is missing or has no
        samples.

    Raises
    ------
    ValueError
        If `rate` or `longest_gap` is no positive number, data frames differ in their
        columns, there are not as many stamps as samples, stamps are not finite or do
        not increase, they cannot be in this unit, or no `rate` is given and they are
        too uneven to tell one, as those of packets are.

    See Also
    --------
    RepairTrials : Fill and report what is missing.

    Examples
    --------
    >>> from sklearn_haptic import resample_trials
    >>> resample_trials([[0.0, 1.0, 2.0, 6.0, 7.0]], [[0, 0.1, 0.2, 0.6, 0.7]], 10)
    [array([[ 0.],
           [ 1.],
           [ 2.],
           [nan],
           [nan],
           [nan],
           [ 6.],
           [ 7.]])]
    """
    pairs = _with_stamps(trials, times, unit)
    if rate is None:
        rate = _usual_rate([stamps for _, stamps in pairs])
    trials = check_trials(
        [trial for trial, _ in pairs],
        name="trials",
        ndims=(2, 3),
        missing=True,
        finite=False,
    )
    return [
        None if trial is None else _resample(trial, stamps, rate, longest_gap, i)
        for i, (trial, (_, stamps)) in enumerate(zip(trials, pairs))
    ]


def _with_stamps(trials, times, unit):
    """Return pairs of a trial, without its column of stamps, and stamps in seconds.

    Both are None for a trial that is missing or has no samples.
    """
    if isinstance(trials, (Mapping, pd.DataFrame)):
        raise ValueError(
            f"trials is a {type(trials).__name__}; give the list of one sensor's "
            "trials, and call this for each sensor."
        )
    given = times is not None and not isinstance(times, str)
    check_order(trials, times, "times", "trials")
    times = list(times) if given else times
    if given and len(trials) != len(times):
        raise ValueError(
            f"times has {len(times)} entries, but there are {len(trials)} trials; give "
            "the time stamps of each trial."
        )
    pairs = []
    for i, trial in enumerate(trials):
        if has_no_samples(trial):
            pairs.append((None, None))
            continue
        name = f"times[{i}]"
        if given:
            stamps = times[i]
        elif times is not None:
            name = f"The column {times!r} of trial {i}"
            if times not in getattr(trial, "columns", ()):
                raise ValueError(f"Trial {i} has no column {times!r} of time stamps.")
            stamps = trial[times]
            trial = trial[[column for column in trial.columns if column != times]]
        elif has_time_index(trial):
            name, stamps = f"The index of trial {i}", trial.index
        else:
            raise ValueError(
                f"Trial {i} has no index of time stamps; give times, or a Series or "
                "DataFrame of pandas whose index is of dates, durations or seconds."
            )
        stamps = seconds_of(stamps, name, unit)
        if hasattr(trial, "__len__") and stamps.shape != (len(trial),):
            raise ValueError(
                f"{name} has shape {stamps.shape}, but trial {i} has {len(trial)} "
                "time samples; give one time stamp per sample."
            )
        pairs.append((trial, stamps))
    return pairs


def _usual_rate(stamps):
    steps = [
        typical_step(each, f"The time of trial {i}")
        for i, each in enumerate(stamps)
        if each is not None and len(each) > 1
    ]
    if not steps:
        raise ValueError("No trial has two samples, to tell a rate; give the rate.")
    return 1 / np.median(steps)


def _resample(trial, stamps, rate, longest_gap, i):
    step = typical_step(stamps) if len(stamps) > 1 else 1 / rate
    stamps = stamps - stamps[0]
    ratio = 1 / (step * rate)
    unlike = max(ratio, 1 / ratio) > _MOST_IN_STEP
    if unlike or stamps[-1] > _LONGEST * step * len(stamps):
        raise ValueError(
            f"The stamps of trial {i} have steps of {step:.4g} s and last for "
            f"{stamps[-1]:.4g} s, which cannot be sampled at {rate:.4g} Hz; mend the "
            "stamps, or give their unit."
        )
    if longest_gap is None:
        longest_gap = 1.5 * step
    slack = _ROUNDING / rate
    n_samples = int((stamps[-1] + slack) * rate) + 1
    # At a whole multiple of the rate, images of the curve fall beside their signal. At
    # others they may come out slower, unless it is sampled far more closely.
    factor = max(1, round(ratio))
    if ratio > factor + 0.1 or 1 < ratio < factor - 0.1:
        factor = int(np.ceil(8 * ratio))
    fine = np.arange((n_samples - 1) * factor + 1) / (rate * factor)
    flat = trial.reshape(len(trial), -1)
    out = np.full((n_samples, flat.shape[1]), np.nan, dtype=trial.dtype)
    for signal, column in zip(flat.T, out.T):
        known = np.isfinite(signal)
        if known.any():
            curve = _between(stamps[known], signal[known], fine, step)
            if factor > 1 and len(curve) > 1:
                curve = resample_poly(curve, 1, factor, padtype="line")
            in_gap = _in_gap(fine[::factor], stamps[known], longest_gap, slack)
            column[:] = np.where(in_gap, np.nan, curve)
    return out.reshape(n_samples, *trial.shape[1:])


def _between(stamps, signal, new, step):
    """Return a signal at new times: a cubic spline, and lines at rest and in gaps.

    Samples closer than half a step count as half a step apart, for else the spline
    overshoots between samples whose stamps are almost equal.
    """
    line = np.interp(new, stamps, signal)
    if len(stamps) < 2:
        return line
    steps = np.diff(stamps)
    knots = np.append(0.0, np.cumsum(np.maximum(steps, step / 2)))
    spline = CubicSpline(knots, signal)(np.interp(new, stamps, knots))
    straight = (np.diff(signal) == 0) | (steps > 1.5 * step)
    preceding = np.searchsorted(stamps[1:-1], new, side="right")
    return np.where(straight[preceding], line, spline)


def _in_gap(new, stamps, longest_gap, slack):
    """Whether each new sample is within a gap, or before the first or after the last.

    A sample is at a stamp if it is no further from it than `slack`.
    """
    following = np.searchsorted(stamps, new - slack)
    preceding = np.searchsorted(stamps, new + slack, side="right") - 1
    padded = np.concatenate([stamps, [np.inf], [-np.inf]])
    gap = padded[following] - padded[preceding]
    return (gap > longest_gap + slack) | np.isinf(gap)
