"""Recordings as they are: with missing sensors, missing samples and dead channels."""

from __future__ import annotations

import numpy as np

from ..utils._validation import check_numbers, column_of, is_missing

ALONE = ""  # the name of a sensor whose trials stand in no DataFrame
USUAL = 0.9  # share of trials in which a channel that works varies


def trial_columns(X, names=None):
    """Return the columns of trials by name; one collection of trials is named "".

    `names` are those to return; by default all columns that hold trials.
    """
    if not is_frame(X):
        if names not in (None, [ALONE]):
            raise ValueError(
                f"X is a {type(X).__name__}, but fit was given a DataFrame; give the "
                f"columns {names} again."
            )
        in_column = hasattr(X, "shape") and X.shape[1:] in ((), (1,))
        return {ALONE: column_of(X, 0) if in_column else X}
    columns = {name: column_of(X, i) for i, name in enumerate(X.columns)}
    if names is None:
        names = [
            name
            for name, cells in columns.items()
            if any(np.ndim(cell) >= 1 for cell in cells)
        ]
    absent = [name for name in names if name not in columns]
    if absent:
        raise ValueError(
            f"X has no column {absent[0]!r}, which fit was given; give the same "
            "sensors, with None where a trial has none."
        )
    return {name: columns[name] for name in names}


def is_frame(X):
    """Whether X is a DataFrame of pandas or polars."""
    return hasattr(X, "columns") and hasattr(X, "dtypes")


def iter_cells(column, name, shape=None, names=None):
    """Yield each trial of a sensor and what its time samples are like.

    A trial is an array of shape (n_times, n_channels), in which what is masked or
    infinite is NaN, or None if no sample is known. `shape` is that of a time sample, by
    default that of the first trial, and `names` are those of the channels, in whose
    order the columns of data frames are put. Both are yielded with each trial, as a
    tuple; the shape is None until there is a trial.
    """
    where = "fit" if shape is not None else "the first trial"
    for i, cell in enumerate(column):
        no_array = getattr(cell, "ndim", 0) == 0
        if (no_array and is_missing(cell)) or (
            hasattr(cell, "__len__") and getattr(cell, "ndim", 1) and len(cell) == 0
        ):
            yield None, (shape, names)
            continue
        label = f"Trial {i} of X" if name == ALONE else f"Trial {i} of X[{name!r}]"
        if hasattr(cell, "columns"):
            own = list(cell.columns)
            names = own if names is None else names
            if sorted(own, key=str) != sorted(names, key=str):
                raise ValueError(
                    f"{label} has the columns {own}, but {names} are expected, as in "
                    f"{where}."
                )
            cell = cell[names]
        trial = as_floats(cell, label)
        shape = trial.shape[1:] if shape is None else shape
        if trial.shape[1:] != shape:
            raise ValueError(
                f"{label} has time samples of shape {trial.shape[1:]}, but {shape} is "
                f"expected, as in {where}."
            )
        trial = trial.reshape(len(trial), -1)
        finite = np.isfinite(trial)
        if not finite.all():
            trial = np.where(finite, trial, np.nan)
        yield trial if finite.any() else None, (shape, names)


def as_floats(trial, name):
    """Return a trial as floating-point numbers with NaN for masked samples.

    float32 stays float32. One dimension becomes one channel.
    """
    if np.ma.isMaskedArray(trial):
        kind = trial.dtype if trial.dtype == np.float32 else np.float64
        trial = trial.astype(kind).filled(np.nan)
    check_numbers(trial, name)
    trial = np.asarray(trial)
    if trial.dtype != np.float32:
        try:
            trial = trial.astype(np.float64, copy=False)
        except (TypeError, ValueError) as error:  # of objects
            raise ValueError(
                f"{name} is not an array of numbers ({error}); convert it."
            ) from error
    if trial.ndim not in (1, 2, 3):
        raise ValueError(
            f"{name} has shape {trial.shape}; it must be (n_times, n_channels)."
        )
    return trial[:, np.newaxis] if trial.ndim == 1 else trial
