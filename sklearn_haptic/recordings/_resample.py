"""Rates and resampling of trials whose samples have time stamps."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Real

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.signal import resample_poly

from ..utils._sklearn import FloatArray
from ..utils._validation import check_numbers, check_regular, has_no_samples
from ._trials import check_trials

_ALIKE = 1.1  # rates that differ by a smaller factor are taken for the same

# Numbers are no seconds if their steps are longer: few sample a touch once a second,
# and milliseconds of 1000 Hz, even with jitter, have such steps.
_LONGEST = 0.9

# Nor if a step holds more new samples. From 10 Hz to 3 kHz it holds 300, from 1 Hz to
# 20 Hz it holds 20; in milliseconds of the same rate that are taken for seconds, 1000.
_MOST, _MOST_BELOW_1_HZ = 300, 20


def infer_rate(
    trials: Sequence[ArrayLike], times: Sequence[ArrayLike] | str | None = None
) -> float:
    """Infer the sampling rate of a sensor from the time stamps of its samples.

    Parameters
    ----------
    trials : sequence of array-like of shape (n_times_i, n_channels)
        Trials of one sensor. Missing ones are passed over.
    times : sequence of array-like of shape (n_times_i,), str or None, default=None
        The stamps, as for :func:`resample_trials`.

    Returns
    -------
    rate : float
        Samples per second: the number of steps over their length in all trials, where
        a step over dropped frames counts as many as it holds. Neither dropped frames
        nor stamps rounded to milliseconds change the rate; both together may, if a step
        is shorter than 1.5 ms.

    Raises
    ------
    ValueError
        If trials have no such stamps, there are not as many as samples, they are
        hardly seconds, no trial has two samples, or the rates of two trials differ by
        a tenth or more.

    See Also
    --------
    resample_trials : Resample to an even rate.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from sklearn_haptic import infer_rate
    >>> force = pd.Series([1.0, 2.0, 3.0], pd.to_timedelta([0, 20, 40], unit="ms"))
    >>> infer_rate([force, force])
    50.0
    """
    return _rate([stamps for _, stamps in _with_stamps(trials, times)])


def _rate(stamps, even=None):
    """Return the rate of trials by their stamps, None in place of missing ones.

    `even` is as in `_step`.
    """
    stamps = [each for each in stamps if each is not None and len(each) > 1]
    if not stamps:
        raise ValueError(
            "No trial has two samples, whose time stamps would tell a rate; give the "
            "rate."
        )
    steps = [np.diff(each) for each in stamps]
    unit = _unit(stamps)
    step, _, even = _step(np.concatenate(steps), unit, even)
    each = np.array([_step(some, unit, even)[0] for some in steps])
    slack = unit / np.array([len(some) for some in steps])  # of rounded stamps
    if (each - slack).max() >= _ALIKE * (each + slack).min():
        raise ValueError(
            f"Trials are sampled at {1 / each.max():.4g} to {1 / each.min():.4g} "
            "Hz; bring them to one rate by resample_trials(trials, rate=...)."
        )
    return float(1 / step)


def _resolution(stamps):
    """Return the resolution of numbers as large as some stamps."""
    return np.spacing(max(np.abs(stamps[0]), np.abs(stamps[-1])))


def _unit(stamps):
    """Return the largest of 0.01, ... 1e-6 s of which all stamps are multiples; or 0.

    Stamps that were rounded to milliseconds have a unit of 0.001.
    """
    slack = 2 * max(map(_resolution, stamps))
    all_stamps = np.concatenate(stamps)
    for unit in 10.0 ** -np.arange(2, 7):
        if (np.abs(all_stamps - unit * np.rint(all_stamps / unit)) <= slack).all():
            return unit
    return 0.0


def _step(steps, unit, even=None):
    """Return the step of even sampling by those from stamp to stamp, some of them gaps.

    A step without a lost sample differs from the typical one by half of it, or by the
    `unit` of the stamps. If some are closer to two than to one, either samples were
    lost, or sampling is `even` and the unit coarse: then they are spread more evenly
    than by chance (by the statistic of Kolmogorov and Smirnov). Return the step, the
    longest without a lost sample, and `even`.
    """
    typical = np.sort(steps)[(len(steps) - 1) // 2]
    near = np.abs(steps - typical) <= max(0.5 * typical, 1.5 * unit)
    step = steps[near].mean()
    for _ in range(3):
        counts = np.rint(np.round(steps / step, 6))
        counts[near] = counts[near].clip(1)
        if even is None:
            longer = near & (counts > 1)
            n_longer = longer.sum()
            excess = np.cumsum(longer) - n_longer * np.linspace(0, 1, len(steps))
            even = np.abs(excess).max() <= 0.35 * np.sqrt(n_longer)
        if even:
            counts[near] = 1
        step = steps.sum() / counts.sum()
    return step, steps[counts == 1].max(initial=step), even


def rate_of(trials, even=None):
    """Return the rate of trials that have a time index, None if they have none."""
    indices = [getattr(trial, "index", None) for trial in trials]
    if not all(isinstance(each, pd.Index) and _is_of_time(each) for each in indices):
        return None
    if max(map(len, indices), default=0) < 2:
        return None
    try:
        stamps = [stamps for _, stamps in _with_stamps(trials, None)]
    except ValueError:
        if all(each.dtype.kind == "f" for each in indices):
            return None  # numbers in an index need not be times
        raise
    return _rate(stamps, even)


def _alike(one, other):
    return max(one / other, other / one) < _ALIKE


def check_rate(trials, rate):
    """Refuse trials whose time index has another rate than those of `fit` had."""
    found = None if rate is None else rate_of(trials)
    if found is None or _alike(found, rate):
        return
    # The rounded stamps of a few samples do not tell whether some were lost.
    if not _alike(rate_of(trials, even=True), rate):
        raise ValueError(
            f"X is sampled at {found:.4g} Hz, but {rate:.4g} Hz is expected, as in "
            f"fit; bring it to that by resample_trials(X, rate={rate:.4g})."
        )


def resample_trials(
    trials: Sequence[ArrayLike],
    times: Sequence[ArrayLike] | str | None = None,
    rate: float | None = None,
    *,
    longest_gap: float | None = None,
) -> list[FloatArray | None]:
    """Resample trials to an even rate, from the time stamps of their samples.

    Between two stamps the signal is a straight line. If the stamps are closer than the
    new samples, the line is sampled at a whole multiple of the rate and decimated by
    the filter of :func:`scipy.signal.resample_poly`, so that no vibration comes out as
    a slower one. Where frames were dropped, the new samples are NaN, which
    :class:`RepairTrials` fills and reports.

    Parameters
    ----------
    trials : sequence of array-like of shape (n_times_i, n_channels)
        Trials of one sensor. Masked samples and NaN count as dropped. The columns of
        data frames are put in the order of the first of them.
    times : sequence of array-like of shape (n_times_i,), str or None, default=None
        When the samples of each trial were taken, increasing: seconds, or dates or
        durations of NumPy, pandas or polars. A name is that of their column in trials
        that are data frames. By default they are the index of trials of pandas.
        Numbers that make no sense as seconds are refused, see Notes.
    rate : float, default=None
        Samples per second of the result, by default those of :func:`infer_rate`.
    longest_gap : float, default=None
        Seconds between two stamps within which a straight line is trusted; new samples
        within a longer gap are NaN. By default 1.5 times the step of a trial, as
        :func:`infer_rate` finds it, which a single dropped frame exceeds. `np.inf`
        trusts every line.

    Returns
    -------
    resampled : list of ndarray of shape (n_samples_i, n_channels)
        Samples at the first stamp and every ``1 / rate`` seconds, up to the last stamp.
        float32 if the trial is. None in place of a trial that is missing or has no
        samples.

    Raises
    ------
    ValueError
        If `rate` or `longest_gap` is no positive number, data frames differ in their
        columns, there are not as many stamps as samples, or stamps are not finite, do
        not increase or are hardly seconds.

    See Also
    --------
    infer_rate : The rate that the stamps have.
    RepairTrials : Fill and report what is missing.

    Notes
    -----
    Numbers are taken for milliseconds or finer, and refused, if the median step holds
    more than 300 new samples, or more than 20 and is a second or longer. Without `rate`
    they are if it is longer than 0.9 seconds. Durations and dates, whose unit is known,
    may be as slow as they are.

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
    if rate is not None and not (isinstance(rate, Real) and 0 < float(rate) < np.inf):
        raise ValueError(
            f"rate={rate!r} must be a positive number of samples a second, or None."
        )
    if longest_gap is not None and not (
        isinstance(longest_gap, Real) and float(longest_gap) > 0
    ):
        raise ValueError(
            f"longest_gap={longest_gap!r} must be a number of seconds above 0."
        )
    pairs = _with_stamps(trials, times, rate)
    if rate is None:
        rate = _rate([stamps for _, stamps in pairs])
    trials = check_trials(
        [trial for trial, _ in pairs],
        name="trials",
        ndims=(2, 3),
        missing=True,
        finite=False,
    )
    return [
        None if trial is None else _resample(trial, stamps, rate, longest_gap)
        for trial, (_, stamps) in zip(trials, pairs)
    ]


def _with_stamps(trials, times, rate=None):
    """Return pairs of a trial, without its column of stamps, and stamps in seconds.

    A trial that is missing or has no samples has None in place of its stamps.
    """
    given = times is not None and not isinstance(times, str)
    times = list(times) if given else times
    if given and len(trials) != len(times):
        raise ValueError(
            f"times has {len(times)} entries, but there are {len(trials)} trials; give "
            "the time stamps of each trial."
        )
    pairs, numbers = [], {}
    for i, trial in enumerate(trials):
        if has_no_samples(trial):
            pairs.append((None, None))
            continue
        name = f"times[{i}]"
        if given:
            stamps = times[i]
        elif times is not None:
            trial, stamps = _without_column(trial, times, i)
            name = f"The column {times!r} of trial {i}"
        else:
            name = f"The index of trial {i}"
            stamps = getattr(trial, "index", None)
            if not isinstance(stamps, pd.Index) or not _is_of_time(stamps):
                raise ValueError(
                    f"Trial {i} has no index of time stamps; give times, or a Series "
                    "or DataFrame of pandas whose index is of dates, durations or "
                    "seconds."
                )
        stamps, are_numbers = _seconds(stamps, name)
        if hasattr(trial, "__len__") and stamps.shape != (len(trial),):
            raise ValueError(
                f"{name} has shape {stamps.shape}, but trial {i} has {len(trial)} "
                "time samples; give one time stamp per sample."
            )
        pairs.append((trial, stamps))
        if are_numbers:
            numbers[name] = stamps
    _check_unit(numbers, rate)
    return pairs


def _check_unit(numbers, rate):
    """Refuse numbers, by their names, that are milliseconds, or finer, not seconds."""
    steps = [np.diff(stamps) for stamps in numbers.values()]
    step = np.median(np.concatenate(steps)) if any(map(len, steps)) else 0
    longest = (_MOST_BELOW_1_HZ if step >= 1 else _MOST) / rate if rate else _LONGEST
    if step > longest:
        raise ValueError(
            f"{next(iter(numbers))} has steps of {step:.4g}, which are taken for "
            "seconds; give durations of the right unit, such as "
            "pd.to_timedelta(stamps, unit='ms')."
        )


def _without_column(trial, name, i):
    """Return a data frame without a column, and the column."""
    if name not in getattr(trial, "columns", ()):
        raise ValueError(
            f"Trial {i} has no column {name!r}; name the column of time stamps."
        )
    others = [column for column in trial.columns if column != name]
    return trial[others], trial[name]


def _is_of_time(index):
    """Whether an index has time stamps; counted samples are none."""
    return isinstance(index, (pd.DatetimeIndex, pd.TimedeltaIndex)) or (
        index.dtype.kind == "f"
    )


def _seconds(stamps, name):
    """Return time stamps as increasing seconds, and whether they are numbers.

    Dates count from the first of them.
    """
    index = stamps
    if not isinstance(stamps, pd.Index):
        index = check_regular(stamps, name)
        if index.dtype.kind == "O" and index.ndim == 1:  # as dates of a time zone are
            index = pd.Index(index)
    if isinstance(index, pd.DatetimeIndex) or index.dtype.kind == "M":
        index = pd.DatetimeIndex(index)
        index = index - index.min()
    are_numbers = index.dtype.kind != "m"
    if not are_numbers:
        index = pd.TimedeltaIndex(index).total_seconds()
    check_numbers(index, name)
    stamps = np.asarray(index, dtype=np.float64)
    if stamps.ndim == 1 and not (
        np.isfinite(stamps).all() and (np.diff(stamps) > 0).all()
    ):
        raise ValueError(
            f"{name} must be finite and increase from sample to sample; sort the "
            "samples and remove those whose stamp is repeated."
        )
    return stamps, are_numbers


def _resample(trial, stamps, rate, longest_gap):
    step, longest = 1 / rate, 0
    if len(stamps) > 1:
        step, longest, _ = _step(np.diff(stamps), _unit([stamps]))
    if longest_gap is None:
        longest_gap = max(1.5 * step, longest)
    slack = 1e-6 / rate + _resolution(stamps)  # rounding must not cost the last
    stamps = stamps - stamps[0]
    n_samples = int((stamps[-1] + slack) * rate) + 1
    # Samples a tenth closer than the new ones need no filter.
    factor = max(1, int(np.ceil(1 / (step * rate) - 0.1)))
    fine = np.arange((n_samples - 1) * factor + 1) / (rate * factor)
    flat = trial.reshape(len(trial), -1)
    out = np.full((n_samples, flat.shape[1]), np.nan, dtype=trial.dtype)
    for signal, column in zip(flat.T, out.T):
        known = np.isfinite(signal)
        if known.any():
            line = np.interp(fine, stamps[known], signal[known])
            if factor > 1:
                line = resample_poly(line, 1, factor, padtype="line")
            in_gap = _in_gap(fine[::factor], stamps[known], longest_gap, slack)
            column[:] = np.where(in_gap, np.nan, line)
    return out.reshape(n_samples, *trial.shape[1:])


def _in_gap(new, stamps, longest_gap, slack):
    """Whether each new sample is within a gap, or before the first or after the last.

    A sample is at a stamp if it is no further from it than `slack`.
    """
    following = np.searchsorted(stamps, new - slack)
    preceding = np.searchsorted(stamps, new + slack, side="right") - 1
    padded = np.concatenate([stamps, [np.inf], [-np.inf]])
    gap = padded[following] - padded[preceding]
    return (gap > longest_gap + slack) | np.isinf(gap)
