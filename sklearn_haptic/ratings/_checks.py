"""Checks of ratings, counts per level and predicted distributions."""

from __future__ import annotations

import warnings
from numbers import Real

import numpy as np
from sklearn.utils import indexable
from sklearn.utils.validation import check_array, column_or_1d, validate_data

from ..utils._row_order import check_order
from ..utils._sklearn import _num_samples
from ..utils._validation import (
    FLOATS,
    check_numbers,
    check_regular,
    check_table,
    is_missing,
    lossless_array,
    missing_to_none,
)
from ._distributions import shares
from ._levels import (
    has_default_columns,
    in_order_of_levels,
    levels_of_columns,
    levels_of_ratings,
    names_levels,
    only_column,
    refuse_two_orders,
)

_MISSING = ("contains NaN or None", "remove trials without a rating")


def check_ratings(y, levels=None, *, name="y"):
    """Validate ratings in either form; return them as counts per level.

    Parameters
    ----------
    y : array-like of shape (n_trials,) or (n_trials, n_levels)
        One rating per trial, or how many people chose each level. Counts may be
        any non-negative weights.
    levels : array-like of shape (n_levels,), default=None
        The ordered levels; by default as the module `_levels` describes.
    name : str, default="y"
        What error messages call ``y``.

    Returns
    -------
    counts : ndarray of float64 of shape (n_trials, n_levels)
    levels : ndarray of shape (n_levels,)

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
            "or one row of counts per trial, as RatingTable.counts_for(objects) does."
        )
    if array.ndim > 1 and array.shape[1:] != (1,):
        return check_counts(y, levels, name=name)
    matches, levels = match_levels(_one_per_trial(y, array, name), y, levels, name)
    return matches.astype(np.float64), levels


def check_counts(counts, levels=None, *, name="counts", unrated=False):
    """Validate counts as `check_ratings` does; there must be at least two levels.

    With `unrated`, trials may have no ratings.
    """
    if levels is not None:
        levels = check_levels(levels)
    levels, columns = levels_of_columns(counts, levels, name)
    check_numbers(counts, name)
    counts = check_array(
        counts,
        dtype=np.float64,
        order="C",  # Sums do not depend on the layout.
        ensure_all_finite="allow-nan",
        ensure_min_features=2,
        input_name=name,
    )
    mend = "give 0 where nobody chose a level, and leave out trials without ratings"
    refuse(np.isnan(counts).any(axis=1), _MISSING[0], mend, name)
    counts = in_order_of_levels(counts, columns)
    if levels is None:
        levels = np.arange(1, counts.shape[1] + 1)
    if counts.shape[1] != len(levels):
        raise ValueError(
            f"{name} has {counts.shape[1]} columns of counts, but there are "
            f"{len(levels)} levels: give one column per level."
        )
    negative, unrated_trials = (counts < 0).any(axis=1), ~(counts > 0).any(axis=1)
    refuse(negative, "has a negative count", "counts of ratings are 0 or more", name)
    if not unrated:
        mend = "remove trials whose object nobody rated"
        refuse(unrated_trials, "has no ratings", mend, name)
    with np.errstate(over="ignore"):
        overflows = ~np.isfinite(counts.sum(axis=1))
    mend = "divide all counts by a constant"
    refuse(overflows, "has counts whose sum overflows", mend, name)
    if columns is not None:
        _refuse_totals(counts, levels, name)
    return counts, levels


def _refuse_totals(counts, levels, name):
    """Refuse a column that is the sum of all others, unless that may be chance."""
    is_total = np.isclose(2 * counts, counts.sum(axis=1, keepdims=True)).all(axis=0)
    n_levels = len(levels)
    if len(np.unique(counts, axis=0)) <= n_levels:
        is_total &= levels.astype(object) == "All"  # pandas' name of margins
    if n_levels > 2 and is_total.any():
        raise ValueError(
            f"The column {levels.tolist()[np.argmax(is_total)]!r} of {name} is the sum "
            "of all others; leave out columns that are no counts."
        )


def refuse(bad, what, mend, name):
    """Raise a ValueError that names the first trial that is bad, if any is."""
    if bad.any():
        raise ValueError(f"{name} {what} in trial {np.argmax(bad)}; {mend}.")


def check_people(counts, name):
    """Refuse shares, and warn of percentages, where the number of people matters."""
    people = counts.sum(axis=1)  # of rounded shares and percentages about 1 or 100
    if np.allclose(people, 1, atol=0.03) and (counts % 1 != 0).any():
        raise ValueError(
            f"{name} has rows that sum to 1, which look like shares of people; "
            "multiply each row by the number of people who rated."
        )
    if np.mean(abs(people - 100) <= 3) > 0.5:  # some may lack who had no answer
        warnings.warn(
            f"{name} has rows that sum to 100, which are taken for the ratings of 100 "
            "people each; if they are percentages, multiply each row by the number of "
            "people who rated, and divide it by 100.",
            UserWarning,
            stacklevel=3,
        )


def check_two_ratings(counts, name):
    """Refuse rows with fewer than two ratings, which do not tell how people differ."""
    check_people(counts, name)
    mend = "leave out what fewer than two people rated"
    refuse(counts.sum(axis=1) < 2, "has fewer than two ratings", mend, name)


def check_distributions(y_true, y_proba, levels):
    """Validate ratings and the distributions predicted for them.

    Return the counts, the probabilities (rows sum to 1), both of shape (n_trials,
    n_levels) and float64, and the levels: by default those of ``y_true``, or else of
    ``y_proba``. Errors are those of `check_ratings`, and a ValueError if a row of
    ``y_proba`` is no distribution, the shapes differ, or both have words as columns, in
    different orders.
    """
    check_order(y_true, y_proba, "y_proba", "y_true")
    if levels is None:
        refuse_two_orders(y_true, y_proba)
    if levels is None and not (names_levels(y_true) or has_default_columns(y_proba)):
        # The predictions may name them.
        levels, _ = levels_of_columns(y_proba, None, "y_proba")
    counts, levels = check_ratings(y_true, levels, name="y_true")
    _, columns = levels_of_columns(y_proba, levels, "y_proba")
    check_numbers(y_proba, "y_proba")
    proba = check_array(y_proba, dtype=np.float64, input_name="y_proba")
    proba = in_order_of_levels(proba, columns)
    bad = (proba < 0).any(axis=1) | (np.abs(proba.sum(axis=1) - 1) > 1e-6)
    if bad.any():
        trial = np.argmax(bad)
        raise ValueError(
            f"y_proba is no distribution in trial {trial} ({proba[trial].tolist()}): "
            "give probabilities of 0 or more that sum to 1."
        )
    if counts.shape != proba.shape:
        raise ValueError(
            f"y_proba has shape {proba.shape}, but y_true has {len(counts)} trials and "
            f"{counts.shape[1]} levels; give one row per trial in both, one column per "
            "level, and levels if nobody chose some of them."
        )
    return counts, shares(proba), levels


def check_predicted_ratings(y_true, y_pred, levels, n_positions):
    """Validate ratings and those predicted at quantile positions.

    ``y_pred``, numbers or words, has the shape (n_trials, n_positions). Return the
    counts, of shape (n_trials, n_levels), the predicted ratings as indices of levels,
    and the levels, by default those of ``y_true``. Errors are those of `check_ratings`,
    and a ValueError if a predicted rating is not among the levels or the shapes differ.
    """
    counts, levels = check_ratings(y_true, levels, name="y_true")
    ratings = check_regular(y_pred, "y_pred")
    if ratings.shape != (len(counts), n_positions):
        raise ValueError(
            f"y_pred has shape {ratings.shape}, but y_true has {len(counts)} trials "
            f"and p has {n_positions} positions; give one row per trial in both, and "
            "one column per position."
        )
    rows = np.repeat(np.arange(len(counts)), n_positions)
    matches, _ = match_levels(ratings.ravel(), None, levels, "y_pred", rows=rows)
    return counts, matches.argmax(axis=1).reshape(ratings.shape), levels


def weighted(counts, sample_weight):
    """Multiply the counts of each trial by its weight; refuse totals out of range."""
    with np.errstate(over="ignore", under="ignore"):
        weight = (counts.T * sample_weight).T
        total = weight.sum()
    if not np.finfo(np.float64).tiny <= total < np.inf:
        verb, mend = (
            ("underflows", "multiply") if total < 1 else ("overflows", "divide")
        )
        raise ValueError(
            f"The total of y, times sample_weight, {verb}; {mend} both by a constant."
        )
    return weight


def check_rated(X, *ratings):
    """Return trials and ratings that can be indexed; each trial has a row of ratings.

    A ValueError says that there are more or fewer rows, that rows of the same labels
    have another order, or that there are no trials.
    """
    for rows in ratings:
        check_order(X, rows)
    X, *ratings = (indexable(each)[0] for each in (X, *map(only_column, ratings)))
    n_trials = _num_samples(X)
    if n_trials == 0:
        raise ValueError("X has no trials; give at least one.")
    for n_rows in map(_num_samples, ratings):
        if n_rows != n_trials:
            raise ValueError(
                "Found input variables with inconsistent numbers of samples: "
                f"[{n_trials}, {n_rows}]; give y one row per trial, which "
                "RatingTable.counts_for(objects) makes of one row per object."
            )
    return X, *ratings


def record_features(estimator, X, y):
    """Give an estimator the number and names of features that others will validate.

    A ValueError says that there are no trials, or no `y`, which may be any.
    """
    check_rated(X)
    required = None if y is None else "no_validation"
    validate_data(estimator, X, y=required, skip_check_array=True)


def validate_rated_trials(estimator, X, y, levels=None):
    """Validate what is given to ``fit``: features and ratings of trials.

    ``y`` is what `check_ratings` takes, or such counts of several adjectives, of shape
    (n_trials, n_adjectives, n_levels). The estimator gets ``n_features_in_`` and, of a
    DataFrame, ``feature_names_in_``. Return the features, in single precision if they
    were, the counts as float64, and the ordered levels. Errors are those of
    scikit-learn's validation and of `check_ratings`.
    """
    # Not `y` itself: what it is turned into no longer says what its levels are.
    required = None if y is None else "no_validation"
    check_order(X, y)
    X = check_table(estimator, X, y=required, dtype=FLOATS)
    counts, levels = check_adjectives(y, levels)
    check_rated(X, counts)
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
    if y.shape[2] == 1:
        raise ValueError(
            f"{name} has shape {y.shape}, counts of one level; give those of all "
            "levels, as (n_trials, n_adjectives, n_levels)."
        )
    each = [
        check_ratings(y[:, i], levels, name=f"{name}[:, {i}]")
        for i in range(y.shape[1])
    ]
    return np.stack([counts for counts, _ in each], axis=1), each[0][1]


def check_levels(levels):
    """Validate given levels, which must be distinct; return them as an array."""
    levels = check_regular(levels, "levels")
    if levels.ndim != 1 or not 0 < len(np.unique(levels)) == len(levels):
        raise ValueError(
            f"levels={levels.tolist()} must be distinct and at least one; list each "
            "level once, lowest first."
        )
    return levels


def match_levels(ratings, container, levels, name, *, row="trial", rows=None):
    """Find the level of each rating.

    Parameters
    ----------
    ratings : ndarray of shape (n_ratings,)
        Numbers or words, none of them missing.
    container : array-like
        What the ratings were taken from, which may say what the levels are.
    levels : array-like of shape (n_levels,) or None
        The levels if they are given.
    name, row : str
        What messages call the ratings, and the place of each.
    rows : ndarray of shape (n_ratings,), default=None
        The number of each rating's place; by default 0, 1, ….

    Returns
    -------
    matches : ndarray of bool of shape (n_ratings, n_levels)
    levels : ndarray of shape (n_levels,)

    Raises
    ------
    ValueError
        If a rating is not among the levels, or the ratings are continuous and nothing
        says what their levels are.
    """

    def place(i):
        return i if rows is None else rows[i]

    if levels is not None:
        levels = check_levels(levels)
    elif not names_levels(container) and ratings.dtype.kind == "f":
        first = int(np.argmax(ratings % 1 != 0))
        if ratings[first] % 1 != 0:
            raise ValueError(
                f"Unknown label type: {name} has continuous ratings, such as "
                f"{ratings[first].item()} in {row} {place(first)}, but levels are "
                "needed: bin the ratings, for instance by numpy.digitize, give counts "
                "of people per level, or, if these values are the levels, list all of "
                "them in levels=."
            )
    levels = levels_of_ratings(ratings, container, levels, name)
    matches = ratings[:, None] == levels
    known = matches.any(axis=1)
    if not known.all():
        first = int(np.argmin(known))
        raise ValueError(
            f"{name} has the rating {ratings.tolist()[first]!r} in {row} "
            f"{place(first)}, which is not among levels={levels.tolist()}; add it to "
            "levels or mend the rating."
        )
    return matches, levels


def _one_per_trial(y, array, name):
    """Validate ratings, one per trial; return an array of numbers or of words."""
    if isinstance(y, (list, tuple)):  # of numbers beside text NumPy makes text
        array = np.array(y, dtype=object)
    if array.ndim == 2:
        array = column_or_1d(array, warn=True)
    if array.dtype.kind not in "biufSU":
        array = _plain_values(array.astype(object), name)
    if array.dtype.kind == "f":
        refuse(np.isnan(array), *_MISSING, name)
    return check_array(array, ensure_2d=False, dtype=None, input_name=name)


def _plain_values(array, name):
    """Return ratings that are objects as an array of numbers or of text."""
    values = array.tolist()
    refuse(np.array([is_missing(value) for value in values], bool), *_MISSING, name)
    kind = str if values and isinstance(values[0], str) else Real
    for trial, value in enumerate(values):
        if not isinstance(value, kind):
            raise ValueError(
                f"{name} has {value!r} in trial {trial}; give one number or one word "
                "per trial, or an array of counts with one row per trial."
            )
    return lossless_array(values)


def check_single_ratings(ratings, **least):
    """Validate a table of single ratings; return it as float64, NaN where missing."""
    with np.errstate(invalid="ignore"):  # of missing categories, cast by pandas
        check_numbers(ratings, "ratings")
    shape = np.shape(ratings)
    if len(shape) != 2:
        raise ValueError(
            f"ratings has shape {shape}; give a table with one row per person and "
            "object and one column per adjective, also if there is only one."
        )
    return check_array(
        missing_to_none(ratings, "ratings"),
        dtype=np.float64,
        ensure_all_finite="allow-nan",
        input_name="ratings",
        **least,
    )


def refuse_second_ratings(of_object, of_rater, objects, raters):
    """Refuse two ratings of one object by one person; both are given by their index."""
    pair, times = np.unique(of_object * len(raters) + of_rater, return_counts=True)
    if (times > 1).any():
        which, who = divmod(pair[np.argmax(times > 1)], len(raters))
        raise ValueError(
            f"ratings has two of the object {objects.tolist()[which]!r} by the rater "
            f"{raters.tolist()[who]!r}; keep one, or tell the raters apart."
        )
