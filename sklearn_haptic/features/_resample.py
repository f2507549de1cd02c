"""Resampling of trials whose samples have time stamps."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import resample_poly

from .._recordings import as_floats
from .._sklearn import FloatArray
from .._validation import check_numbers


def resample_trials(
    trials: Sequence[ArrayLike],
    times: Sequence[ArrayLike],
    rate: float,
    *,
    longest_gap: float | None = None,
) -> list[FloatArray]:
    """Resample trials to an even rate, from the time stamps of their samples.

    Between two stamps the signal is a straight line. If the stamps are closer than the
    new samples, the line is sampled at a whole multiple of the rate and decimated by
    the filter of :func:`scipy.signal.resample_poly`, so that no vibration comes out as
    a slower one. Where frames were dropped, the new samples are NaN, which
    :class:`RepairTrials` fills and reports.

    Parameters
    ----------
    trials : sequence of array-like of shape (n_times_i, n_channels)
        Trials of one sensor. Masked samples and NaN count as dropped.
    times : sequence of array-like of shape (n_times_i,)
        Seconds at which the samples of each trial were taken, increasing.
    rate : float
        Samples per second of the result.
    longest_gap : float, default=None
        Seconds between two stamps within which a straight line is trusted; new samples
        within a longer gap are NaN. By default 1.5 times the median of the steps of a
        trial, which a single dropped frame exceeds. `np.inf` trusts every line.

    Returns
    -------
    resampled : list of ndarray of shape (n_samples_i, n_channels)
        Samples at the first stamp and every ``1 / rate`` seconds, up to the last stamp.
        float32 if the trial is.

    Raises
    ------
    ValueError
        If `rate` or `longest_gap` is no positive number, there are not as many stamps
        as samples, or stamps are not finite or do not increase.

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
    if not (isinstance(rate, Real) and 0 < float(rate) < np.inf):
        raise ValueError(
            f"rate={rate!r} must be a positive number of samples a second."
        )
    if longest_gap is not None and not (
        isinstance(longest_gap, Real) and float(longest_gap) > 0
    ):
        raise ValueError(
            f"longest_gap={longest_gap!r} must be a number of seconds above 0."
        )
    if len(trials) != len(times):
        raise ValueError(
            f"times has {len(times)} entries, but there are {len(trials)} trials; give "
            "the time stamps of each trial."
        )
    checked = [_check(*each, i) for i, each in enumerate(zip(trials, times))]
    return [_resample(trial, at, rate, longest_gap) for trial, at in checked]


def _check(trial, stamps, i):
    """Return a trial of two dimensions, with NaN for masked samples, and its stamps."""
    trial = as_floats(trial, f"Trial {i}")
    check_numbers(stamps, f"times[{i}]")
    stamps = np.asarray(stamps, dtype=np.float64)
    if stamps.shape != (len(trial),) or not len(trial):
        raise ValueError(
            f"times[{i}] has shape {stamps.shape}, but trial {i} has {len(trial)} time "
            "samples; give one time stamp per sample."
        )
    if not np.isfinite(stamps).all() or (np.diff(stamps) <= 0).any():
        raise ValueError(
            f"times[{i}] must be finite and increase from sample to sample; sort the "
            "samples and remove those whose stamp is repeated."
        )
    return trial, stamps


def _resample(trial, stamps, rate, longest_gap):
    steps = np.diff(stamps)
    typical = np.median(steps) if len(steps) else 1 / rate
    if longest_gap is None:
        longest_gap = 1.5 * typical
    stamps = stamps - stamps[0]
    n_samples = int(stamps[-1] * rate + 1e-6) + 1  # rounding must not cost the last
    # Samples a tenth closer than the new ones need no filter.
    factor = max(1, int(np.ceil(1 / (typical * rate) - 0.1)))
    fine = np.arange((n_samples - 1) * factor + 1) / (rate * factor)
    flat = trial.reshape(len(trial), -1)
    out = np.full((n_samples, flat.shape[1]), np.nan, dtype=trial.dtype)
    for signal, column in zip(flat.T, out.T):
        known = np.isfinite(signal)
        if known.any():
            line = np.interp(fine, stamps[known], signal[known])
            if factor > 1:
                line = resample_poly(line, 1, factor, padtype="line")
            in_gap = _in_gap(fine[::factor], stamps[known], longest_gap, 1e-6 / rate)
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
