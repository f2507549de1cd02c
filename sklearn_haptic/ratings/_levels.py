"""Which levels ratings have, in which order, by what their container says.

One rule holds wherever ratings are taken. `levels` lists the levels if it is given;
else the container names them:

- ratings have the categories of an ordered pandas categorical or a polars Enum, in
  their order, including those that nobody gave;
- counts have the labels of their columns. Numbers are sorted, also those in text or
  behind a common prefix (``n1``, ``n2``); an ordered categorical index keeps its order;
  words are in the order of the columns.

Without any names, counts have the levels 1, 2, …, and ratings the sorted values that
occur. Words have no order of their own, so a warning says which order was assumed.
"""

import re
import warnings
from collections import Counter
from numbers import Real

import numpy as np
import pandas as pd

from ..utils._pipeline_steps import last_step
from ..utils._row_order import check_order
from ..utils._validation import check_regular, is_text, lossless_array
from ._distributions import as_distributions

_MINUS = str.maketrans("−–", "--")  # as publishers set it
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
# n1, q7_1, hard_-1, r_1e-05, and level-1, of which the hyphen is no sign; not 0,5.
_PREFIX = r".*?(?:[^\W_](?<!\de)-|[^\d,+-])"
_NUMBERED = re.compile(rf"({_PREFIX})([+-]?\d+(?:\.\d+)?(?:e[+-]\d+)?)")


def names_levels(y):
    """Whether the container of ratings or counts says what the levels are."""
    return _ordered_categories(only_column(y)) is not None or bool(_column_labels(y))


def are_counts(y, name="y"):
    """Whether ratings are a table of counts, not one rating per trial."""
    return check_regular(y, name).shape[1:] not in ((), (1,))


def levels_set_in(estimator):
    """Return the parameter ``levels`` of what predicts, or of a model inside, or None.

    Steps before it may have levels that are no ratings.

    Examples
    --------
    >>> from sklearn_haptic import NNPOM, DistributionBlend
    >>> from sklearn_haptic.ratings._levels import levels_set_in
    >>> levels_set_in(DistributionBlend([("one", NNPOM(levels=["soft", "hard"]))]))
    ['soft', 'hard']
    """
    model, _ = last_step(estimator)
    params = model.get_params(deep=False)
    found = params.pop("levels", None)
    for value in params.values():
        members = value if isinstance(value, list) else [("", value)]
        for each in (member[1] for member in members if isinstance(member, tuple)):
            if found is None and hasattr(each, "get_params"):
                found = levels_set_in(each)
    return found


def levels_of_ratings(values, container, levels, name):
    """Find the levels of ratings, an ndarray without missing values.

    Their `container` may name the levels unless these are given; `name` is what
    messages call the ratings. A rating may still not be among the levels. If the
    ratings are words and nothing tells their order, a UserWarning says so.
    """
    if levels is not None:
        return levels
    categories = _ordered_categories(only_column(container))
    if categories is not None:
        return categories
    if is_text(values):
        _warn(
            f"{name} has words, which have no order of their own",
            np.unique(values).tolist(),
            "an ordered categorical (pandas.Categorical(y, categories=[...], "
            "ordered=True) or a polars.Enum)",
        )
    return np.unique(values)


def levels_of_columns(table, levels, name):
    """Find the level of each column of counts.

    Parameters
    ----------
    table : array-like of shape (n_trials, n_levels)
        The counts, in their container.
    levels : ndarray of shape (n_levels,) or None
        The levels if they are given.
    name : str
        What messages call the counts.

    Returns
    -------
    levels : ndarray of shape (n_levels,) or None
        The levels; None if they are neither given nor named.
    columns : list of int or None
        The column of each level, or -1 for a category without one. None if the columns
        have no labels and are therefore in the order of the levels.

    Raises
    ------
    ValueError
        If labels occur twice, are neither all numbers nor all words, or are not the
        levels given.
    """
    labels = _column_labels(table)
    others = levels is not None and {*levels.tolist()} != {*labels}
    if not labels or (others and has_default_columns(table)):
        return levels, None
    read = _read_numbers(labels)
    if len({*read}) < len(read):
        twice = next(label for label in read if read.count(label) > 1)
        raise ValueError(
            f"{name} has two columns {twice!r}; give one column per level."
        )
    categories = _ordered_categories(table.columns)
    by_labels = categories is None or (levels is not None and not others)
    named = labels if by_labels else categories.tolist()
    if levels is None:
        levels = _in_order(labels, name) if categories is None else categories
    wanted, place = levels.tolist(), {label: i for i, label in enumerate(labels)}
    for reading in (named, _read_numbers(named)):  # as it is, or as a number
        label_of = dict(zip(reading, named))
        if len(label_of) == len(wanted) and label_of.keys() == {*wanted}:
            return levels, [place.get(label_of[level], -1) for level in wanted]
    raise ValueError(
        f"The columns of {name} are {labels}, but the levels are {wanted}; label one "
        "column with each level, or give an array without labels."
    )


def refuse_two_orders(y_true, y_proba):
    """Refuse tables whose columns are the same words in different orders.

    The alphabet, and categories with an order of their own, are no such order.
    """
    given, predicted = (_read_numbers(_column_labels(y)) for y in (y_true, y_proba))
    words = all(isinstance(label, str) for label in given)
    known = _ordered_categories(getattr(y_true, "columns", None)) is not None
    if not words or known or given == predicted or {*given} != {*predicted}:
        return
    if sorted(given) not in (given, predicted):
        raise ValueError(
            f"The columns of y_true are {given}, and those of y_proba {predicted}; "
            "give levels=[...], lowest first, because one order is wrong."
        )


def in_order_of_levels(values, columns):
    """Put columns in the order found by `levels_of_columns`; missing ones are 0."""
    if columns is None:
        return values
    return np.take(np.pad(values, ((0, 0), (0, 1))), columns, axis=1)


def as_columns(levels):
    """Return levels as labels of columns, which keep their order."""
    columns = pd.Index(levels)
    if columns.dtype.kind in "iuf" and columns.is_monotonic_increasing:
        return columns
    return pd.CategoricalIndex(columns, columns, ordered=True)


def labelled_as(counts, values, levels):
    """Label what was computed from a table of counts, if its columns are labelled."""
    if not names_levels(counts):
        return values
    return pd.DataFrame(values, getattr(counts, "index", None), as_columns(levels))


def _in_order(labels, name):
    """Return column labels as levels: numbers sorted, words as they come."""
    read = _read_numbers(labels)
    if all(isinstance(label, Real) and label == label for label in read):
        return np.sort(lossless_array(read))
    if not all(isinstance(label, str) for label in read):
        raise ValueError(
            f"The columns of {name} are {labels}; label them with the levels, by "
            "numbers only or words only, and leave out columns that are no counts."
        )
    if labels == sorted(labels):
        _warn(
            f"The columns of {name} are words in alphabetical order",
            labels,
            "them an ordered pandas.CategoricalIndex",
        )
    return lossless_array(labels)


def knows_order(estimator):
    """Whether a fitted model, or that at the end of a pipeline, has ordered levels."""
    model, _ = last_step(estimator)
    return getattr(model, "_ordered", hasattr(model, "levels_"))


def predict_in_named_order(estimator, X, ratings):
    """Predict probabilities, and their levels, in the order that the ratings name.

    Ratings are those of `in_named_order`, or counts, whose columns name the order if
    the model knows none. A UserWarning says that nothing tells the order of words,
    neither the ratings nor a model of levels. Ratings with the row labels of `X` in
    another order are refused, and so are models without levels.
    """
    check_order(X, ratings)
    name, proba = type(estimator).__name__, None
    if hasattr(estimator, "predict_proba"):
        proba = estimator.predict_proba(X)
    if proba is None or not hasattr(estimator, "classes_"):
        raise ValueError(
            f"{name} predicts no levels (predict_proba, classes_); give a classifier, "
            "or score sliders by crps."
        )
    as_distributions(proba, name)
    levels = estimator.classes_
    if knows_order(estimator):
        return in_named_order(proba, levels, ratings, estimator)
    named = _ordered_categories(only_column(ratings))
    if named is None and np.ndim(ratings) == 2:
        named, _ = levels_of_columns(ratings, None, "y")
    if named is None:
        levels_of_ratings(levels, ratings, None, "y")  # warns
        return proba, levels
    refuse_unnamed(levels, named)
    return _at_levels(proba, levels, named)


def refuse_unnamed(levels, named):
    """Refuse ratings that name the order of some words only that a classifier knows."""
    if is_text(levels) and not {*levels.tolist()} <= {*named.tolist()}:
        raise ValueError(
            f"y names the levels {named.tolist()}, but the model predicts "
            f"{levels.tolist()}, whose order it does not know; let the categories, or "
            "columns, of y be all levels, lowest first."
        )


def in_named_order(proba, levels, ratings, estimator=None):
    """Put columns of probabilities in the order that the ratings themselves name.

    Classifiers of scikit-learn sort words by the alphabet. Return the columns and their
    levels, unchanged if the estimator is given its levels, or the container of the
    ratings names no order.
    """
    column = only_column(ratings)
    given = estimator is not None and levels_set_in(estimator) is not None
    if given or not names_levels(ratings) or np.ndim(column) != 1:
        return proba, levels
    return _at_levels(proba, levels, levels_of_ratings(levels, column, None, "ratings"))


def _at_levels(proba, levels, named):
    """Put columns in the order of named levels, if these hold all; others get none."""
    columns = {level: proba[:, i] for i, level in enumerate(levels.tolist())}
    if not columns.keys() <= {*named.tolist()}:
        return proba, levels
    nothing = np.zeros(len(proba))
    each = [columns.get(level, nothing) for level in named.tolist()]
    return np.stack(each, axis=1), named


def level_values(levels, units="scale"):
    """Return the number of each level: its place, or on a scale what it says.

    The levels of a scale must be finite numbers that ascend.
    """
    if units == "levels":
        return np.arange(len(levels), dtype=np.float64)
    if not all(isinstance(level, Real) for level in levels.tolist()):
        raise ValueError(
            f"The levels {levels.tolist()} are not numbers, so their scale has no "
            "units; give numbers as levels=[...], lowest first."
        )
    values = levels.astype(np.float64)
    if not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
        raise ValueError(
            f"levels={levels.tolist()} do not ascend, but a scale with units does; "
            "list finite numbers, lowest first, with the columns in this order."
        )
    return values


def _warn(what, levels, mend):
    order = " < ".join(map(repr, levels[:10])) + " < …" * (len(levels) > 10)
    warnings.warn(
        f"{what}; they are taken as {order}. Give {mend} or levels=[...], lowest "
        "level first.",
        UserWarning,
        stacklevel=5,
    )


def only_column(y):
    """Return the column of a table of one column; return anything else unchanged."""
    columns = getattr(y, "columns", None)
    return y if columns is None or len(columns) != 1 else y[columns[0]]


def _ordered_categories(column):
    """Return the ordered categories of a column, or None if it has none."""
    dtype = getattr(column, "dtype", None)
    ordered = getattr(dtype, "ordered", type(dtype).__name__ == "Enum")
    if not ordered:
        return None
    categories = np.asarray(dtype.categories)
    if categories.dtype != object:
        return categories
    return lossless_array(categories.tolist())


def _column_labels(table):
    """Return the labels of two or more columns; none if they are mere positions."""
    labels = np.asarray(getattr(table, "columns", ()), dtype=object).tolist()
    default = labels == [f"column_{i}" for i in range(len(labels))]  # of polars
    return [] if default or len(labels) == 1 else labels


def has_default_columns(table):
    """Whether columns have the default labels of pandas, their places from 0."""
    columns = getattr(table, "columns", None)
    return (
        getattr(columns, "name", "") is None
        and getattr(columns, "start", None) == 0
        and columns.step == 1
    )


def _read_numbers(labels):
    """Return labels, read as numbers where possible, also behind a common prefix."""
    texts = {x: x.translate(_MINUS).strip() for x in labels if isinstance(x, str)}
    numbers = {x: text for x, text in texts.items() if _NUMBER.fullmatch(text)}
    matches = {x: _NUMBERED.fullmatch(text) for x, text in texts.items()}
    numbered = {x: match for x, match in matches.items() if match}
    prefixes = Counter(match[1] for match in numbered.values())
    common = [prefix for prefix, n in prefixes.items() if n > 1]
    shortest = min(prefixes, key=len, default="")
    if not numbers and {*prefixes} == {shortest, f"{shortest}-"}:  # n-1, n0, n1
        numbers = {x: texts[x].removeprefix(shortest) for x in numbered}
    elif not numbers and len(common) == 1:
        numbers = {x: m[2] for x, m in numbered.items() if m[1] == common[0]}
        parts = [each.partition(".") for each in numbers.values()]
        if len({whole for whole, _, _ in parts}) == 1 and all(p[2] for p in parts):
            label, number = next(iter(numbers.items()))
            raise ValueError(
                f"The columns {labels} do not tell their levels: {label!r} may be the "
                f"level {number} or {parts[0][2]}; label them with the levels alone."
            )
    return [_number(numbers[x]) if x in numbers else x for x in labels]


def _number(text):
    return int(text) if text.lstrip("+-").isdigit() else float(text)
