"""Checks of trials, of tables, and of the numbers that both hold.

A *trial* is one touch of one object: an array of shape ``(n_times, n_channels)``, or
``(n_times, height, width)`` for tactile images. Trials differ in length, so a
collection of them is a sequence of arrays. A *table* is scikit-learn's ordinary
two-dimensional input. Every transformer takes both.
"""

from __future__ import annotations

from collections.abc import Mapping, Set

import numpy as np
import pandas as pd
from scipy import sparse

from ..utils._validation import (
    check_numbers,
    check_regular,
    column_of,
    count,
    has_no_samples,
    is_numeric,
)
from ._sequences import Sequences

ALONE = ""  # the name of a sensor whose trials stand in no DataFrame

TABLE_FOR_TRIALS = (
    "X is a table, but fit was given trials; give a list of trials, of one touch "
    "[touch]."
)

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def is_table(X):
    """Whether ``X`` is a table rather than a collection of trials.

    Anything that is not clearly a collection of trials counts as a table, so that
    scikit-learn's own validation words the errors.
    """
    if isinstance(X, Sequences):
        return False
    if (
        sparse.issparse(X)
        or isinstance(X, (str, bytes, Mapping, Set))
        or not hasattr(X, "__len__")
    ):
        return True
    if _has_columns(X):  # a Series is no table, even if it lacks every trial
        return len(X.shape) == 2 and not _columns_of_trials(X)
    if isinstance(X, np.ndarray) and (X.dtype != object or X.ndim != 1):
        return X.ndim <= 2
    if len(X) == 0:
        return True
    ndims = {_ndim(trial) for trial in X}
    if ndims == {1}:  # lists of one length are rows of a table, arrays are trials
        return {*map(type, X)} <= {list, tuple} and len({*map(len, X)}) == 1
    return ndims == {0} and not any(trial is None for trial in X)


def channel_names(X):
    """Return the columns of the first trial that is a data frame, None if none is."""
    if isinstance(X, Sequences) or is_table(X):
        return None
    return next((list(t.columns) for t in cells_of(X) if hasattr(t, "columns")), None)


def transposed_hint(shape):
    """Return a hint for error messages if a trial has more channels than samples."""
    if len(shape) != 2 or shape[1] <= shape[0]:
        return ""
    return (
        f" Its shape {shape} is taken for {count(shape[0], 'time samples')} of "
        f"{_samples(shape[1:])}; transpose it if that is wrong."
    )


def check_trials(
    X,
    *,
    name=None,
    ndims=(2,),
    n_channels=None,
    names=None,
    missing=False,
    finite=True,
    rate=None,
):
    """Validate a collection of trials; return a list of floating-point arrays.

    Parameters
    ----------
    X : collection of array-like
        List, tuple, object array, Series or one-column DataFrame of arrays, or one
        array with the trials along its first axis. A one-dimensional trial has one
        channel. The columns of trials that are data frames are put in the order of
        `names`.
    name : str, default=None
        What messages call the collection; by default X, and its column if it is one.
    ndims : tuple of int, default=(2,)
        Numbers of dimensions that a trial may have.
    n_channels : int or tuple of int, default=None
        Required shape of one time sample; by default the shape in the first trial.
    names : list, default=None
        The :func:`channel_names` of the trials given to `fit`; by default those of `X`.
    missing : bool, default=False
        Whether trials may be None, NaN or NA, or have no samples.
    finite : bool, default=True
        Whether all samples have to be finite and none may be masked.
    rate : float, default=None
        Samples per second, which time stamps must not contradict.

    Returns
    -------
    trials : list of ndarray of shape (n_times_i, ...)
        All are float32 if every trial is float32, else all are float64. Trials that
        already have this data type are not copied. None stands for a missing trial;
        NaN, unless samples are `finite`, for one that is infinite or masked.

    Raises
    ------
    ValueError
        If there are no trials, or if a trial is empty, holds values that are not finite
        real numbers, or differs in shape from the others, or in rate from `rate`. The
        message names the trial.
    """
    name = name_of(X) if name is None else name
    cells = cells_of(X)
    _check_any(cells)
    if rate is not None:
        rate_of(cells, rate, name=name)
    where = "the first trial" if n_channels is None else "fit"
    named = "the first trial" if n_channels is None or names is None else "fit"
    names = channel_names(cells) if names is None else names
    trials = []
    for i, cell in enumerate(cells):
        label = f"Trial {i} of {name}"
        if missing and has_no_samples(cell):
            trials.append(None)
        else:
            cell = in_order(cell, label, names, named)
            trials.append(_check_trial(cell, label, ndims, finite))
    shape = n_channels
    for i, trial in enumerate(trials):
        if trial is not None:
            shape = trial.shape[1:] if shape is None else shape
            shape = (shape,) if np.ndim(shape) == 0 else tuple(shape)
            label, hint = f"Trial {i} of {name}", transposed_hint(trial.shape)
            _check_samples(label, trial.shape[1:], shape, where, hint)
    if len({trial.dtype for trial in trials if trial is not None}) > 1:
        trials = [
            None if trial is None else trial.astype(np.float64, copy=False)
            for trial in trials
        ]
    return trials


def check_sequences(sequences, *, n_columns=None):
    """Check the lengths and columns of `Sequences` without computing any array.

    A ValueError says that there are none, or names the trial that is empty or has not
    `n_columns` columns, if these are given.
    """
    _check_any(sequences)
    for i, length in enumerate(sequences.lengths):
        _check_length(f"Trial {i} of X", length, sequences.unit)
    if n_columns is not None:
        shape = (len(sequences.feature_names),)
        _check_samples("Trial 0 of X", shape, (n_columns,), "fit")


def _has_columns(X):
    """Whether X is a DataFrame, a Series or a two-dimensional array of objects."""
    if hasattr(X, "to_numpy") and hasattr(X, "shape"):
        return len(X.shape) <= 2  # others, as of xarray, are arrays of trials
    return isinstance(X, np.ndarray) and X.dtype == object and X.ndim == 2


def _columns_of_trials(X):
    """Return the indices of the columns that hold arrays."""
    n_columns = 1 if len(X.shape) == 1 else X.shape[1]
    dtypes = X.dtypes if hasattr(X, "columns") else [X.dtype] * n_columns
    return [
        i
        for i, dtype in enumerate(dtypes)
        if not is_numeric(dtype) and any(_ndim(cell) >= 1 for cell in column_of(X, i))
    ]


def check_columns(X, names):
    """Refuse what is no DataFrame of touches, or one without a column or with two.

    Where no `names` are asked for, an array will do.
    """
    columns = list(getattr(X, "columns", []))
    if isinstance(X, (Mapping, pd.Series)) or (names and not hasattr(X, "columns")):
        raise ValueError(
            f"X is a {type(X).__name__}; give a DataFrame of touches, for one "
            "touch trials.iloc[[0]] or pandas.DataFrame([touch])."
        )
    absent = [name for name in names if name not in columns]
    if absent:
        raise ValueError(
            f"X has no column {absent[0]!r}, only {columns[:10]}; rename the one that "
            "is meant."
        )
    twice = [name for name in names if columns.count(name) > 1]
    if twice:
        raise ValueError(f"X has the column {twice[0]!r} twice; name each column once.")


def cells_of(X):
    """Return the trials of a collection as a sequence; refuse more than one column."""
    if not _has_columns(X):
        return X
    if len(X.shape) == 2 and X.shape[1] != 1:
        labels = getattr(X, "columns", range(X.shape[1]))
        of_trials = [labels[i] for i in _columns_of_trials(X)]
        raise ValueError(
            f"X has {X.shape[1]} columns, of which {of_trials} hold trials; choose one "
            "with ColumnTransformer, a transformer for each sensor."
        )
    return list(column_of(X, 0))


def trial_columns(X, names=None):
    """Return the columns of trials by name; one collection of trials is named "".

    `names` are those to return; by default all columns that hold trials.
    """
    if hasattr(X, "to_series") and hasattr(X, "columns"):
        raise ValueError("X is a frame of polars; give a DataFrame of pandas.")
    if not hasattr(X, "columns"):
        if names not in (None, [ALONE]):
            check_columns(X, names)
        in_column = hasattr(X, "shape") and X.shape[1:] in ((), (1,))
        return {ALONE: column_of(X, 0) if in_column else X}
    columns = list(X.columns)
    if names is None:
        names = [columns[i] for i in _columns_of_trials(X)]
    if names == [ALONE]:
        raise ValueError(
            "X is a DataFrame, but fit was given the trials of one sensor; give the "
            "column that holds them, as X['name']."
        )
    check_columns(X, names)
    return {name: X.iloc[:, columns.index(name)] for name in names}


def name_of(X):
    """Return what messages call a collection of trials, by its column if it is one."""
    name = getattr(X, "name", None)
    return f"X[{name!r}]" if isinstance(name, str) and name else "X"


def has_time_index(trial):
    """Whether trials of pandas have an index of dates, durations or decimal numbers."""
    index = getattr(trial, "index", None)
    return isinstance(index, pd.Index) and index.dtype.kind in "mMf"


def seconds_of(stamps, name, unit="s"):
    """Return time stamps as increasing seconds.

    Dates and integers, such as nanoseconds since 1970, count from the first of them.
    """
    index = stamps if isinstance(stamps, pd.Index) else check_regular(stamps, name)
    if index.dtype.kind == "O" and index.ndim == 1:  # as dates of a time zone are
        index = pd.Index(index).infer_objects()
    if isinstance(index, pd.DatetimeIndex) or index.dtype.kind == "M":
        index = pd.DatetimeIndex(index)
    if index.dtype.kind in "iu":
        index = index.astype(f"{index.dtype.kind}8")  # differences of int16 overflow
    if index.dtype.kind in "Miu" and index.size:
        index = index - index.min()
    if index.dtype.kind == "m":
        index, unit = pd.TimedeltaIndex(index).total_seconds(), "s"
    check_numbers(index, name)
    seconds = np.asarray(index, dtype=np.float64) * UNITS[unit]
    if seconds.ndim == 1 and not (
        np.isfinite(seconds).all() and (np.diff(seconds) > 0).all()
    ):
        raise ValueError(
            f"{name} must be finite and increase from sample to sample; sort the "
            "samples, spread those of a packet evenly, or leave the stamps out."
        )
    return seconds


def typical_step(seconds, name=None):
    """Return the typical step from sample to sample, of two stamps or more.

    It is the lower quartile of spans of ten steps, if there are as many, so that lost
    samples do not change it and rounding, such as to milliseconds, hardly does; and
    then the mean of the spans like it, because jitter makes most of them longer. Stamps
    with a `name` are refused if most of their time is in steps unlike it, as where
    samples come in packets, each stamped when it arrives.
    """
    n = 10 if len(seconds) > 10 else 1
    spans = np.sort(seconds[n:] - seconds[:-n])
    typical = spans[(len(spans) - 1) // 4]
    for _ in range(10):
        typical = spans[np.abs(spans - typical) < 0.75 * typical / n].mean()
    step = typical / n
    steps = np.diff(seconds)
    alike = steps[np.abs(steps - step) < 0.75 * step].sum()
    if name is not None and n == 10 and alike < steps.sum() / 2:
        raise ValueError(
            f"{name} tells no rate, because less than half of it is in steps near the "
            f"typical {step:.4g} s, as where samples come in packets or many in a row "
            "are lost; spread those of a packet evenly, give NaN for lost ones, or "
            "leave the stamps out."
        )
    return step


def rate_of(X, rate=None, *, name="X"):
    """Return the rate of trials by their time index, or `rate` if they have none.

    A ValueError names the trial that contradicts `rate`, by default the median of all.
    Rates are the same that differ by less than a tenth or, because ten steps or fewer
    tell less, by less than a factor of two.
    """
    if isinstance(X, Sequences) or is_table(X):
        return rate
    trials, steps = cells_of(X), {}
    for i, trial in enumerate(trials):
        if has_time_index(trial) and len(trial) > 1:
            label = f"The index of trial {i} of {name}"
            steps[i] = typical_step(seconds_of(trial.index, label), label)
    if not steps:
        return rate
    given = rate is not None
    rate = rate if given else 1 / np.median([*steps.values()])
    for i, step in steps.items():
        if max(rate * step, 1 / (rate * step)) > (1.1 if len(trials[i]) > 10 else 2):
            mend = "it to that"
            if 1 / step < rate:  # and lacks frequencies that the rate has
                mend = "all, also for training, to the lower rate"
            raise ValueError(
                f"Trial {i} of {name} is sampled at {1 / step:.4g} Hz by its index, "
                f"but {rate:.4g} Hz {'is expected' if given else 'is usual'}; bring "
                f"{mend} by resample_trials, or remove an index that is no time."
            )
    return float(rate)


def in_order(trial, what, names, where):
    """Return a trial with its columns, if it has any, in the order of `names`.

    The error says that `what` and `where` differ.
    """
    own = list(getattr(trial, "columns", names or []))
    if names is None or own == names:
        return trial
    odd = [name for name in [*names, *own] if own.count(name) != names.count(name)]
    if odd:
        raise ValueError(
            f"{what} and {where} differ in the column {odd[0]!r}; give all trials the "
            "same columns."
        )
    return trial[names]


def _ndim(trial):
    if hasattr(trial, "ndim"):
        return trial.ndim
    if hasattr(trial, "columns"):  # a frame of polars
        return 2
    try:
        return np.ndim(trial)
    except ValueError:  # rows of unequal length
        return 2


def _samples(shape):
    if len(shape) == 1:
        return count(shape[0], "channels")
    return "frames of " + " × ".join(map(str, shape))


def _check_trial(trial, name, ndims, finite):
    if _ndim(trial) == 0 and not isinstance(trial, (Mapping, Set)):
        raise ValueError(
            f"{name} is {trial!r}, not an array of shape (n_times, n_channels); give "
            "its recording or leave the trial out."
        )
    if not finite and np.ma.isMaskedArray(trial):
        kind = trial.dtype if trial.dtype == np.float32 else np.float64
        trial = trial.astype(kind).filled(np.nan)
    trial = without_na(trial)
    check_numbers(trial, name)
    try:
        trial = np.asarray(trial)
        if trial.dtype not in (np.float32, np.float64):
            trial = trial.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{name} is not an array of numbers ({error}); convert it."
        ) from error
    if trial.ndim == 1 and 2 in ndims:
        trial = trial[:, None]
    if trial.ndim not in ndims:
        wanted = " or ".join(
            {2: "(n_times, n_channels)", 3: "(n_times, height, width)"}[n]
            for n in ndims
        )
        raise ValueError(
            f"{name} has shape {trial.shape}; it must be {wanted}. For images take "
            "STHMPTransformer(layout=None), or TaxelGrid() in make_haptic_pipeline, or "
            "use reshape(len(trial), -1)."
        )
    _check_length(name, len(trial))
    if trial.size == 0:
        raise ValueError(f"{name} has shape {trial.shape}, which holds no values.")
    known = np.isfinite(trial)
    if known.all():
        return trial
    if finite:
        raise ValueError(
            f"{name} contains NaN or infinity; repair the trials by RepairTrials."
        )
    return np.where(known, trial, np.nan)


def without_na(samples):
    """Return samples of pandas' nullable types as floats, others as they are."""
    if (
        isinstance(samples, (pd.DataFrame, pd.Series))
        and np.asarray(samples).dtype == object
        and all(map(is_numeric, pd.DataFrame(samples).dtypes))
    ):
        return samples.to_numpy(np.float64, na_value=np.nan)
    return samples


def _check_any(trials):
    if len(trials) == 0:
        raise ValueError("X holds no trials; at least one is required.")


def _check_length(name, length, unit="time samples"):
    if length == 0:
        raise ValueError(f"{name} has 0 {unit}, but at least 1 is required; remove it.")


def _check_samples(name, shape, expected, where, hint=""):
    if shape != expected:
        raise ValueError(
            f"{name} has {_samples(shape)}, but {_samples(expected)} "
            f"{'is' if expected == (1,) else 'are'} expected, as in {where}.{hint}"
        )
