"""The signals that a model is given, as rows of statistics.

A sensor that is dead, stuck, amplified or in the place of another one may have codes
like those of a quiet touch. Its level, its power and its spectrum are unlike any.
"""

import numpy as np
from sklearn.compose import ColumnTransformer
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from ..features import SignalStatistics
from ..recordings import RepairTrials
from ..recordings._sequences import Sequences
from ..recordings._trials import channel_names, check_trials, is_table
from ..utils._pipeline_steps import flat_steps
from ..utils._sklearn import _safe_indexing
from ..utils._validation import column_of


def behind_repairs(pipeline, X):
    """Return touches as repaired by the first steps, and the step behind these."""
    steps = [step for _, step in flat_steps(pipeline)]
    while len(steps) > 1 and isinstance(steps[0], RepairTrials):
        X = steps.pop(0).transform(X)
    return X, steps[0]


def columns_given(step):
    """Return the columns that a fitted step is given; None for all there is."""
    if not isinstance(step, ColumnTransformer):
        return None
    used = [columns for _, each, columns in step.transformers_ if each != "drop"]
    return [
        c for columns in used for c in (columns if _several(columns) else [columns])
    ]


def _several(columns):
    return not isinstance(columns, (str, int, slice)) and np.ndim(columns) > 0


def signals_of(X, columns, names=None):
    """Return the recordings in some columns, and the names of their channels.

    Parameters
    ----------
    X : collection of trials, or table with trials in its columns
    columns : list or None
        Columns to take; None takes X.
    names : list of (list or None), default=None
        The names of the channels in `fit`, in whose order they are put.

    Returns
    -------
    signals : list of (list of ndarray of shape (n_times_i, n_channels) or None)
        Images as channels. None in place of what are no recordings.
    names : list of (list or None)
    """
    parts = [X] if columns is None else [_part(X, each) for each in columns]
    names = [channel_names(part) for part in parts] if names is None else names
    signals = [
        None if isinstance(part, Sequences) or is_table(part) else _flat(part, each)
        for part, each in zip(parts, names)
    ]
    return signals, names


def _part(X, column):
    part = _safe_indexing(X, column, axis=1)
    return column_of(part, 0) if len(part.shape) > 1 else part


def _flat(part, names):
    trials = check_trials(part, ndims=(2, 3), names=names)
    return [each.reshape(len(each), -1) for each in trials]


def fit_statistics(signals):
    """Return what turns the recordings of each sensor into standardised statistics."""
    return [
        None
        if trials is None
        else make_pipeline(SignalStatistics(), StandardScaler()).fit(trials)
        for trials in signals
    ]


def rows_of(signals, statistics):
    """Return the statistics of all sensors, None if there are no recordings."""
    rows = [
        each.transform(trials)
        for trials, each in zip(signals, statistics)
        if each is not None
    ]
    return np.hstack(rows).astype(np.float64) if rows else None
