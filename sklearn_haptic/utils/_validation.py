"""Checks of input of any kind: numbers, tables, weights, objects, missing values.

`recordings._trials` has the checks of recordings, `ratings._checks` those of ratings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from datetime import date, timedelta
from difflib import get_close_matches

import numpy as np
import pandas as pd
from scipy import sparse
from sklearn.utils.validation import (
    check_consistent_length,
    check_is_fitted,
    check_memory,
    column_or_1d,
    validate_data,
)

from ._row_order import check_order, check_orders
from ._sklearn import _check_sample_weight, is_pandas_na

_NO_NUMBERS = (str, bytes, date, timedelta, np.datetime64, np.timedelta64, pd.Period)


FLOATS = (np.float64, np.float32)
"""Types of features that are kept as they are; all else becomes the first."""


def check_numbers(values, name):
    """Refuse values that NumPy might quietly convert, but that are not real numbers.

    Text, dates, complex or masked values, and rows that differ in length raise a
    ValueError that calls the values `name`. Other faults are left to scikit-learn.
    """
    array = check_regular(values, name)
    if not (hasattr(values, "columns") and hasattr(values, "dtypes")):
        if _holds_no_numbers(array):
            raise ValueError(
                f"{name} is not an array of numbers (it holds text or dates); convert "
                "it."
            )
        return
    nameless = [each for each in values.columns if str(each).startswith("Unnamed: ")]
    if nameless:
        raise ValueError(
            f"{name} has a column {nameless[0]!r}, as pandas calls one without a name "
            "in a file, mostly numbers of rows; read the file with index_col=0, or "
            "leave the column out."
        )
    # Column by column: an array of them all may make numbers of dates.
    for i, dtype in enumerate(values.dtypes):
        if is_numeric(dtype):
            continue
        if _holds_no_numbers(np.asarray(column_of(values, i))):
            column = values.columns[i]
            raise ValueError(
                f"{name} is not an array of numbers (column {column!r} holds text or "
                "dates); convert it or leave it out."
            )


def check_regular(values, name):
    """Refuse masked and complex values, uneven or labelled rows, and no arrays."""
    if isinstance(values, (Mapping, Set, Iterator)) and not sparse.issparse(values):
        raise ValueError(
            f"{name} is a {type(values).__name__}, which is no array; give a list, an "
            "array or a DataFrame."
        )
    rows = values if isinstance(values, (list, tuple)) else []
    if any(isinstance(row, pd.Series) for row in rows):
        raise ValueError(
            f"{name} is a list of pandas Series, whose labels a list does not keep; "
            f"give pandas.DataFrame({name}), or arrays."
        )
    if any(np.ma.isMaskedArray(each) and each.mask.any() for each in (values, *rows)):
        raise ValueError(
            f"{name} has masked values, which are no data; fill or remove them."
        )
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(
            f"{name} is no array of one shape; give rows of equal length ({error})."
        ) from error
    if array.dtype.kind == "c":
        raise ValueError(
            f"Complex data not supported: {name} is not an array of numbers (complex "
            "values have no order); give real ones."
        )
    return array


def refuse_empty(X):
    """Refuse a list of nothing, which scikit-learn takes for one dimension."""
    if isinstance(X, (list, tuple)) and not X:
        raise ValueError("X is empty; give at least one row or trial.")


def check_table(estimator, X, **options):
    """Validate a table of features: `validate_data` after `check_numbers`.

    The result is C-contiguous, so that sums do not depend on the layout of the input.
    """
    refuse_empty(X)
    check_numbers(X, "X")
    with np.errstate(over="ignore", invalid="ignore"):  # of the sum it looks at first
        return validate_data(estimator, X, order="C", **options)


def check_cache(memory):
    """Return `memory` as a `joblib.Memory`; refuse a path where none can be."""
    try:
        return check_memory(memory)
    except OSError as error:
        raise ValueError(
            f"memory={memory!r} is no folder that can be written; give another."
        ) from error


def check_features(estimator, X):
    """Validate the features that a fitted estimator is to predict from."""
    check_is_fitted(estimator)
    return check_table(estimator, X, dtype=FLOATS, reset=False)


def check_weights(sample_weight, X):
    """Validate the weights of trials; return them as float64, by default all 1.

    A ValueError says that they are not one finite, non-negative number per trial, that
    they have the trials' row labels in another order, that their sum overflows, or that
    all are 0.
    """
    if sample_weight is not None:
        check_numbers(sample_weight, "sample_weight")
        check_order(X, sample_weight, "sample_weight")
    weight = _check_sample_weight(
        sample_weight, X, dtype=np.float64, ensure_non_negative=True
    )
    with np.errstate(over="ignore"):
        total = weight.sum()
    if not np.isfinite(total):
        raise ValueError(
            "The sum of sample_weight overflows; divide sample_weight by a constant."
        )
    return weight


def check_positions(p):
    """Validate quantile positions, a number or a list; return them as an array.

    A ValueError says that they are not numbers from 0 to 1 in at most one dimension.
    """
    check_numbers(p, "p")
    p = np.asarray(p, dtype=np.float64)
    if p.ndim > 1 or not np.all((p >= 0) & (p <= 1)):
        raise ValueError(
            "p must be a number or a list of numbers from 0 to 1; got "
            f"{p.tolist() if p.size < 10 else p.shape}."
        )
    return p


def check_objects(objects, *, name="objects", row="row"):
    """Validate the object of each row; none may be missing.

    A ValueError names the row whose object is missing, or that mixes text with
    something else.
    """
    objects, named = drop_missing(objects, name)
    if not named.all():
        raise ValueError(
            f"{name} has no object in {row} {np.argmin(named)}; name the object of "
            f"every {row} or remove the {row}."
        )
    return objects


def rows_of_objects(
    objects, known, *, lacks="The table has no ratings", more="ratings"
):
    """Find the row of each trial's object in a table of the `known` ones.

    A ValueError names objects that are missing or not known: what the table `lacks`,
    and what there would have to be `more` of.
    """
    objects = check_objects(objects).tolist()
    row = {each: i for i, each in enumerate(known.tolist())}
    unknown = [each for each in dict.fromkeys(objects) if each not in row]
    if unknown:
        first = next(iter(row))
        hint = f"leave their trials out, or add their {more}"
        if isinstance(first, str) != isinstance(unknown[0], str):
            hint = (
                f"its objects are of another type, such as {first!r}: convert with "
                f"numpy.asarray(objects).astype({type(first).__name__})"
            )
        raise ValueError(
            f"{lacks} of objects {unknown[:5]}"
            f"{' and more' * (len(unknown) > 5)}; {hint}."
        )
    return np.array([row[each] for each in objects], dtype=np.intp)


def check_groups(groups, X, y=None):
    """Validate the object of each trial, which has ratings `y`; None stays None."""
    if groups is None:
        return None
    check_orders(X=X, y=y, groups=groups)
    shape = np.shape(groups)
    if len(shape) != 1 and shape[1:] != (1,):
        raise ValueError(
            f"groups has shape {shape}; give the object of each trial, one per trial."
        )
    check_consistent_length(X, groups)
    return check_objects(groups, name="groups", row="trial")


def drop_missing(values, name):
    """Return the values of a column that are not missing, and a mask of them."""
    if isinstance(values, np.ndarray) and values.dtype.kind in "biuU" and values.size:
        check_regular(values, name)
        native = values.astype(values.dtype.newbyteorder("="), copy=False)
        return column_or_1d(native), np.ones(values.size, dtype=bool)
    values = column_or_1d(missing_to_none(values, name), dtype=None)
    given = np.array([value is not None for value in values], dtype=bool)
    if not given.any():
        raise ValueError(f"{name} holds no values at all; at least one is required.")
    values = values[given].tolist()
    if len({isinstance(value, str) for value in values}) > 1:
        raise ValueError(f"{name} mixes text with something else; convert it.")
    return lossless_array(values), given


def missing_to_none(values, name):
    """Convert to an array of objects, in which None stands for missing values."""
    if hasattr(values, "isna"):  # of pandas, whose own arrays look masked to NumPy
        values = values.to_numpy(dtype=object, na_value=None)
    check_regular(values, name)
    values = np.array(values, dtype=object)
    for i, value in enumerate(values.flat):
        if is_missing(value):
            values.flat[i] = None
    return values


def is_missing(value):
    """Whether a value is None, NaN or NA, which differ from themselves."""
    if isinstance(value, (str, int, float)):  # most values, quickly
        return bool(value != value)
    if value is None or is_pandas_na(value):
        return True
    if getattr(value, "ndim", 0) > 0:
        return False
    differs = value != value
    return isinstance(differs, (bool, np.bool_)) and bool(differs)


def has_no_samples(recording):
    """Whether a recording is missing or an array of no samples, which says as much."""
    if isinstance(recording, (list, tuple)):
        return not recording
    return getattr(recording, "shape", ())[:1] == (0,) or is_missing(recording)


def check_names(asked, known, what, where):
    """Return the names asked for, or all that are known if ``asked`` is None.

    A ValueError says that no name is asked for, that one is unknown, or that one is
    asked for twice; `what` and `where` are its words for a name and for what has these
    names.
    """
    if asked is None:
        return known
    asked = [str(name) for name in asked]
    if not asked:
        raise ValueError(f"No {what} is asked for; name at least one or give None.")
    left = set(known)
    for name in asked:
        if name in left:
            left.remove(name)
        elif name in known:
            raise ValueError(f"The {what} {name!r} is asked for twice; name it once.")
        else:
            closest = get_close_matches(name, known, n=10, cutoff=0)
            raise ValueError(
                f"Unknown {what} {name!r}; {where} has {len(known)}, of which the "
                f"closest are {closest}."
            )
    return asked


def column_of(X, i):
    """Return column i of a DataFrame or an array; a Series is its only column."""
    if len(X.shape) == 1:
        return X
    if hasattr(X, "to_series"):  # polars
        return X.to_series(i)
    return X.iloc[:, i] if hasattr(X, "iloc") else X[:, i]


def is_numeric(dtype):
    """Whether a data type of NumPy, pandas or polars is one of real numbers."""
    if hasattr(dtype, "is_numeric"):
        return dtype.is_numeric()
    return dtype.kind in "biuf"


def is_text(values):
    """Whether values are words, in an array of text or of objects."""
    return values.dtype.kind in "SUT" or (
        values.dtype.kind == "O" and all(isinstance(value, str) for value in values)
    )


def lossless_array(values):
    """Convert a list to an array in which all values stay distinct.

    NumPy turns integers into floats if some exceed 2**63, and cuts trailing null
    characters off text. In these cases the array holds objects instead.
    """
    array = np.array(values)
    if array.tolist() == values:
        return array
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


def count(n, units):
    """Return a number with its unit, which is given in the plural."""
    return f"{n} {units.removesuffix('s') if n == 1 else units}"


def _holds_no_numbers(array):
    if array.dtype.kind != "O":
        return array.dtype.kind in "SUTMm"
    return any(isinstance(value, _NO_NUMBERS) for value in array.flat)
