"""Checks of ratings: labels or counts per level."""

from __future__ import annotations

from numbers import Real

import numpy as np
from sklearn.utils.validation import check_array, check_consistent_length, column_or_1d

from ._check_trials import check_numbers, check_regular, check_table
from ._levels import (
    in_order_of_levels,
    levels_of_columns,
    levels_of_ratings,
    lossless_array,
    names_levels,
)
from ._sklearn import is_pandas_na


def weighted(counts, sample_weight):
    """Multiply each trial's counts by its weight; refuse totals out of range."""
    with np.errstate(over="ignore", under="ignore"):
        weight = (counts.T * sample_weight).T
        total = weight.sum()
    if not np.isfinite(total):
        raise ValueError(
            "The total of y, times sample_weight, overflows; divide both by a constant."
        )
    if total < np.finfo(np.float64).tiny:
        raise ValueError(
            "The total of y, times sample_weight, underflows; multiply both by a "
            "constant."
        )
    return weight


def check_ratings(y, levels=None, *, name="y"):
    """Validate ratings in either form; return them as counts per level.

    Parameters
    ----------
    y : array-like of shape (n_trials,) or (n_trials, n_levels)
        One rating a trial, or how many people chose each level. Counts may be
        any non-negative weights.
    levels : array-like of shape (n_levels,), default=None
        The ordered levels; by default as `_levels` says.
    name : str, default="y"
        What error messages call ``y``.

    Returns
    -------
    counts : ndarray of shape (n_trials, n_levels)
        Counts as float64.
    levels : ndarray of shape (n_levels,)
        The ordered levels.

    Raises
    ------
    ValueError
        If a rating is not among the levels, a count is negative or not finite,
        the number of columns is not that of the levels, or a trial has no
        ratings at all; the message names the trial.
    """
    array = check_regular(y, name)
    if array.ndim == 0:
        raise ValueError(
            f"{name} is no array but of the type {type(y).__name__}; give one rating "
            "or one row of counts per trial."
        )
    if levels is not None:
        levels = check_levels(levels)
    if array.ndim == 1 or array.shape[1:] == (1,):
        known = levels is not None or names_levels(y)
        values = _check_values(y, array, known, name)
        return _count_values(values, levels_of_ratings(values, y, levels, name), name)
    levels, columns = levels_of_columns(y, levels, name)
    check_numbers(y, name)
    counts = check_array(y, dtype=np.float64, input_name=name)
    counts = in_order_of_levels(counts, columns)
    if levels is None:
        levels = np.arange(1, counts.shape[1] + 1)
    if counts.shape[1] != len(levels):
        raise ValueError(
            f"{name} has {counts.shape[1]} columns of counts, but there are "
            f"{len(levels)} levels: give one column a level."
        )
    if (counts < 0).any():
        trial = int(np.argmax((counts < 0).any(axis=1)))
        raise ValueError(
            f"{name} has a negative count in trial {trial}; counts of ratings are 0 "
            "or more."
        )
    if not (counts > 0).any(axis=1).all():
        trial = int(np.argmin((counts > 0).any(axis=1)))
        raise ValueError(
            f"{name} has no ratings in trial {trial}; remove trials whose object "
            "nobody rated."
        )
    with np.errstate(over="ignore"):
        finite = np.isfinite(counts.sum(axis=1))
    if not finite.all():
        raise ValueError(
            f"{name} has counts in trial {np.argmin(finite)} whose sum overflows; "
            f"divide {name} by a constant."
        )
    return counts, levels


def validate_rated_trials(estimator, X, y, levels=None):
    """Validate what is given to ``fit``: features and ratings of trials.

    Parameters
    ----------
    estimator : estimator object
        Gets ``n_features_in_`` and, of a DataFrame, ``feature_names_in_``.
    X : array-like of shape (n_trials, n_features)
    y : array-like of shape (n_trials,), (n_trials, n_levels) or \
            (n_trials, n_adjectives, n_levels)
        As `check_ratings` takes it, or such counts of each of several adjectives.
    levels : array-like of shape (n_levels,), default=None
        As in `check_ratings`.

    Returns
    -------
    X : ndarray of shape (n_trials, n_features)
        Features as float64.
    counts : ndarray of shape (n_trials, n_levels) or (n_trials, n_adjectives, n_levels)
        Counts as float64.
    levels : ndarray of shape (n_levels,)
        The ordered levels.

    Raises
    ------
    ValueError
        As scikit-learn's validation and `check_ratings` do.
    """
    # Not `y` itself: what it is turned into no longer says what its levels are.
    required = None if y is None else "no_validation"
    X = check_table(estimator, X, y=required, dtype=np.float64)
    counts, levels = check_adjectives(y, levels)
    check_consistent_length(X, counts)
    return X, counts, levels


def check_adjectives(y, levels=None, *, name="y"):
    """Validate ratings as `check_ratings` does, or those of each of several adjectives.

    Counts of several adjectives are an array of shape (n_trials, n_adjectives,
    n_levels), and so are the counts returned.
    """
    check_regular(y, name)
    if getattr(y, "ndim", None) != 3:
        return check_ratings(y, levels, name=name)
    if y.shape[1] == 0:
        raise ValueError(
            f"{name} has shape {y.shape}, no adjective; give at least one."
        )
    each = [
        check_ratings(y[:, i], levels, name=f"{name}[:, {i}]")
        for i in range(y.shape[1])
    ]
    return np.stack([counts for counts, _ in each], axis=1), each[0][1]


def check_levels(levels):
    """Validate levels that are given: an array of distinct values, lowest first."""
    levels = check_regular(levels, "levels")
    if levels.ndim != 1:
        raise ValueError(
            f"levels has shape {levels.shape}; list each level once, lowest first."
        )
    if len(levels) == 0 or len(np.unique(levels)) != len(levels):
        raise ValueError(
            f"levels={levels.tolist()} must be distinct and at least one; list each "
            "level once, lowest first."
        )
    return levels


def _check_values(y, array, known, name):
    """Validate ratings, one a trial; return an array of numbers or of words.

    Unless their levels are known, they must be text or whole numbers.
    """
    if isinstance(y, (list, tuple)):  # of numbers beside text NumPy makes text
        array = np.array(y, dtype=object)
    if array.ndim == 2:
        array = column_or_1d(array, warn=True)
    if array.dtype.kind not in "biufSU":
        array = _plain_values(array.astype(object), name)
    array = check_array(array, ensure_2d=False, dtype=None, input_name=name)
    if not known:
        check_levels_occur(array, name, "trial")
    return array


def check_levels_occur(ratings, name, row):
    """Refuse ratings that are continuous, where their levels are not known."""
    if ratings.dtype.kind != "f" or not (ratings % 1 != 0).any():
        return
    first = int(np.argmax(ratings % 1 != 0))
    raise ValueError(
        f"Unknown label type: {name} has continuous ratings, such as "
        f"{ratings[first].item()} in {row} {first}, but levels are needed: bin the "
        "ratings, for instance by numpy.digitize, give counts of people per level, "
        "or, if these values are the levels, list all of them in levels=."
    )


def _plain_values(array, name):
    """Return ratings that are objects as an array of numbers or of text."""
    values = array.tolist()
    for trial, value in enumerate(values):
        if _is_missing(value):
            raise ValueError(
                f"{name} contains NaN or None: trial {trial} has no rating; remove it."
            )
        if not isinstance(value, (str, Real)) or (
            isinstance(value, str) != isinstance(values[0], str)
        ):
            raise ValueError(
                f"{name} has {value!r} in trial {trial}: give numbers only or words "
                "only, one rating a trial, or an array of counts with one row a trial."
            )
    return lossless_array(values)


def _is_missing(value):
    return (
        value is None
        or is_pandas_na(value)
        or (isinstance(value, Real) and value != value)
    )


def _count_values(values, levels, name):
    matches = values[:, None] == levels
    known = matches.any(axis=1)
    if not known.all():
        trial = int(np.argmin(known))
        raise ValueError(
            f"{name} has the rating {values.tolist()[trial]!r} in trial {trial}, which "
            f"is not among levels={levels.tolist()}; add it to levels or mend the "
            "rating."
        )
    return matches.astype(np.float64), levels
