"""Continuous answers, and distributions of them whose CDF is linear between points.

Answers are an array of shape (n_trials, n_answers), NaN where somebody gave none. A
distribution has a CDF at ascending points, linear between them; it is 0 below the first
point and 1 above the last, so that equal points, or a CDF that does not reach from 0 to
1, make jumps.
"""

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_array, column_or_1d

from ..utils._validation import check_numbers, missing_to_none
from ._levels import only_column


def check_answers(y, name="y"):
    """Validate continuous answers; return them as (n_trials, n_answers) of float64.

    They are one number per trial; or several, NaN where somebody gave none; or one list
    of any length per trial. Each trial has at least one.
    """
    y = only_column(y)
    if isinstance(y, (list, tuple)):  # of Series, as groupby yields; labels say nothing
        y = [np.asarray(each) if isinstance(each, pd.Series) else each for each in y]
    try:
        array = np.asarray(y)
    except ValueError:  # lists of different lengths
        y = _padded(y, name)
    else:
        if array.dtype.kind == "O" and any(np.ndim(each) for each in array.flat):
            y = _padded(y, name)
        elif array.dtype.kind == "O":
            y = missing_to_none(y, name)
            y[np.equal(y, None)] = np.nan
    check_numbers(y, name)
    answers = check_array(
        y,
        dtype=np.float64,
        ensure_2d=False,
        ensure_all_finite="allow-nan",
        input_name=name,
    )
    if answers.ndim == 2 and answers.shape[1] == 1:
        answers = column_or_1d(answers, warn=not isinstance(y, list))
    if answers.ndim == 1:
        answers = answers[:, None]
    given = ~np.isnan(answers)
    if not given.any(axis=1).all():
        raise ValueError(
            f"{name} contains NaN: trial {np.argmin(given.any(axis=1))} has no answer; "
            "remove trials whose object nobody rated."
        )
    return answers


def check_values(values):
    """Validate values on a scale, one or a list; return them in one dimension."""
    check_numbers(values, "values")
    values = np.asarray(values, dtype=np.float64)
    if values.ndim > 1 or np.isnan(values).any():
        raise ValueError("values must be a number or a list of numbers.")
    return np.atleast_1d(values)


def _padded(y, name):
    rows = [np.atleast_1d(each) for each in y]
    for i, row in enumerate(rows):
        check_numbers(row, f"{name}[{i}]")
        if row.ndim != 1:
            raise ValueError(
                f"{name}[{i}] has shape {row.shape}; give one list of answers per "
                "trial."
            )
    answers = np.full((len(rows), max(map(len, rows))), np.nan)
    for row, values in zip(answers, rows):
        row[: len(values)] = values
    return answers


def check_cdf(y_cdf, values, n_trials):
    """Validate CDFs and their points; return both with one row per trial."""
    checked = []
    for array, name in [(y_cdf, "y_cdf"), (values, "values")]:
        check_numbers(array, name)
        array = check_array(array, dtype=np.float64, ensure_2d=False, input_name=name)
        if array.ndim > 2 or (array.ndim == 2 and len(array) not in (1, n_trials)):
            raise ValueError(
                f"{name} has shape {array.shape}, but y_true has {n_trials} trials; "
                "give one row per trial, or one for all."
            )
        rounding = 1e-12 * np.abs(array).max()
        with np.errstate(over="ignore"):
            falls = (np.diff(array, axis=-1) < -rounding).any(axis=-1)
        if falls.any():
            raise ValueError(
                f"{name} falls in row {np.argmax(falls)}; sort it, so that the CDF "
                "ascends with the values."
            )
        checked.append(np.maximum.accumulate(np.atleast_2d(array), axis=1))
    cdf, values = checked
    if cdf.shape[1] != values.shape[1]:
        raise ValueError(
            f"y_cdf has {cdf.shape[1]} columns, but there are {values.shape[1]} "
            "values; give the CDF at each value."
        )
    within = np.clip(cdf, 0, 1)
    if (np.abs(cdf - within) > 1e-6).any():  # sums of probabilities are rounded
        raise ValueError("y_cdf must lie within [0, 1]; give a share of people.")
    shape = (n_trials, cdf.shape[1])
    return np.broadcast_to(within, shape), np.broadcast_to(values, shape)


def crps_per_trial(answers, cdf, values):
    """Return the continuous ranked probability score, averaged over a trial's answers.

    The integral of the squared distance to the step at an answer is that of F² to its
    left and that of (1 - F)² to its right. Both are added up from point to point once
    per trial, exactly, since F is linear between points; an answer between two points
    adds its part of the segment.
    """
    largest = max(np.abs(values).max(), np.nanmax(np.abs(answers)))
    unit = 2.0**64 if largest > 1e280 else 1.0  # so that no difference overflows
    answers, values = answers / unit, values / unit
    width = np.diff(values, axis=1)
    left = np.zeros(values.shape)  # integral of F² up to each point
    right = np.zeros(values.shape)  # integral of (1 - F)² from each point on
    squares = width * _mean_square(cdf[:, :-1], cdf[:, 1:])
    np.cumsum(squares, axis=1, out=left[:, 1:])
    squares = width * _mean_square(1 - cdf[:, :-1], 1 - cdf[:, 1:])
    right[:, :-1] = np.cumsum(squares[:, ::-1], axis=1)[:, ::-1]

    n_points = values.shape[1]
    place = np.zeros(answers.shape, dtype=np.intp)  # points at or below each answer
    for j in range(n_points):
        place += values[:, j, None] <= answers
    lower, upper = np.maximum(place - 1, 0), np.minimum(place, n_points - 1)
    (a, b), (u, v) = (
        [np.take_along_axis(array, index, axis=1) for index in (lower, upper)]
        for array in (values, cdf)
    )
    inside = (place > 0) & (place < n_points)
    with np.errstate(invalid="ignore", over="ignore"):
        share = np.where(inside, (answers - a) / np.where(inside, b - a, 1), 0)
        w = u + share * (v - u)
        score = np.take_along_axis(left, lower, axis=1) + np.take_along_axis(
            right, upper, axis=1
        )
        score += np.where(inside, (answers - a) * _mean_square(u, w), 0)
        score += np.where(inside, (b - answers) * _mean_square(1 - w, 1 - v), 0)
        score += np.maximum(values[:, :1] - answers, 0)
        score += np.maximum(answers - values[:, -1:], 0)
        return unit * np.nanmean(score, axis=1)


def half_mean_difference(answers):
    """Return half the mean absolute difference of two answers of each trial.

    This is the expected score of the distribution that they come from, without bias.
    """
    ordered = np.sort(answers, axis=1)  # NaN last
    n = np.sum(~np.isnan(answers), axis=1, keepdims=True)
    rank = np.arange(1, ordered.shape[1] + 1)
    return np.nansum((2 * rank - n - 1) * ordered, axis=1) / (n * (n - 1))[:, 0]


def _mean_square(u, v):
    """Mean of the square of what goes linearly from u to v."""
    return (u * u + u * v + v * v) / 3


def cdf_at(values, cdf, grid):
    """Return CDFs, given at the points of one grid, at other values."""
    cell = np.clip(np.searchsorted(grid, values, side="right"), 1, len(grid) - 1)
    share = np.clip((values - grid[cell - 1]) / (grid[cell] - grid[cell - 1]), 0, 1)
    return cdf[:, cell - 1] + share * (cdf[:, cell] - cdf[:, cell - 1])


def quantile_at(p, cdf, grid):
    """Return the lowest values at which CDFs, given on one grid, reach positions.

    The positions, of shape (n_p,) or (n_trials, n_p), may be shared by all trials.
    """
    values = np.empty((len(cdf), p.shape[-1]))
    tolerance = 4 * cdf.shape[1] * np.finfo(np.float64).eps  # of a CDF's sums
    for column, position in zip(values.T, np.broadcast_to(p, values.shape).T):
        # At 0 the lowest value that anybody may give, else the first that reaches p.
        inner, at = cdf[:, 1:-1], position[:, None] * (1 - tolerance)
        cell = np.where(at > 0, inner < at, inner <= 0).sum(axis=1)[:, None]
        u, v = (np.take_along_axis(cdf, cell + i, axis=1)[:, 0] for i in (0, 1))
        share = np.divide(position - u, v - u, out=np.zeros(len(cdf)), where=v > u)
        a, b = grid[cell[:, 0]], grid[cell[:, 0] + 1]
        column[:] = a + np.clip(share, 0, 1) * (b - a)
    return values
