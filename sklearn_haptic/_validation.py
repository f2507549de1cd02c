"""Input checks that more than one module needs: trials, ratings, sparsity.

A *trial* is one touch of one object: an array of shape ``(n_times,
n_channels)``, or ``(n_times, height, width)`` for tactile images. Trials
differ in length, so a collection of them is a sequence of arrays. A *table* is
scikit-learn's ordinary two-dimensional input; every transformer takes both.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from datetime import date, timedelta
from numbers import Real
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from scipy import sparse
from sklearn.utils._missing import is_pandas_na
from sklearn.utils.validation import (
    _check_sample_weight,
    check_array,
    check_consistent_length,
    column_or_1d,
    validate_data,
)

from ._levels import (
    in_order_of_levels,
    levels_of_columns,
    levels_of_ratings,
    lossless_array,
    names_levels,
)
from ._threads import one_blas_thread
from ._typing import FloatArray, Names

if TYPE_CHECKING:
    import pandas as pd

_NO_NUMBERS = (str, bytes, date, timedelta, np.datetime64, np.timedelta64)


class Sequences(Sequence[FloatArray]):
    """What a sequence step returns: arrays, one a trial, that know their columns.

    It indexes and iterates like a list. A trial is coded each time it is asked
    for, so that the codes of a whole corpus need not fit in memory; `list` codes
    every trial once and keeps the arrays.

    Parameters
    ----------
    trials : sequence of ndarray
        Arrays of shape (n_times_i, n_columns), or what `encode` turns into them.
    feature_names : sequence of str
        The name of each column, which pooling carries into its own names.
    row_index : pandas.Index, default=None
        The index of the trials, if they came in a pandas container.
    encode : callable, default=None
        Returns the array of a trial. None if `trials` are the arrays.
    lengths : sequence of int, default=None
        Length of each array; by default that of each trial.
    unit : str, default="time samples"
        What the rows of an array are.
    """

    def __init__(
        self,
        trials: Sequence[Any],
        feature_names: Names,
        row_index: pd.Index | None = None,
        *,
        encode: Callable[[Any], FloatArray] | None = None,
        lengths: Sequence[int] | None = None,
        unit: str = "time samples",
    ) -> None:
        self.feature_names = np.asarray(feature_names, dtype=object)
        self.row_index = row_index
        self.lengths = [len(trial) for trial in trials] if lengths is None else lengths
        self.unit = unit
        self._trials = trials
        self._encode = encode

    def __len__(self) -> int:
        return len(self._trials)

    @overload
    def __getitem__(self, key: int) -> FloatArray: ...
    @overload
    def __getitem__(self, key: slice) -> Sequences: ...
    def __getitem__(self, key: int | slice) -> FloatArray | Sequences:
        if not isinstance(key, slice):
            trial = self._trials[key]
            return trial if self._encode is None else self._code(trial)
        return Sequences(
            self._trials[key],
            self.feature_names,
            None if self.row_index is None else self.row_index[key],
            encode=self._encode,
            lengths=self.lengths[key],
            unit=self.unit,
        )

    @one_blas_thread
    def _code(self, trial: Any) -> FloatArray:
        return self._encode(trial)  # type: ignore[misc]

    def __repr__(self) -> str:
        return f"<Sequences: {len(self)} trials, {len(self.feature_names)} columns>"


def row_index(X):
    """Return the pandas index of a collection of trials, None if it has none."""
    if isinstance(X, Sequences):
        return X.row_index
    return X.index if hasattr(X, "iloc") else None


def is_table(X):
    """Whether ``X`` is ordinary 2-D input rather than a collection of trials.

    Anything that is not clearly a collection of trials counts as a table, so
    that scikit-learn's own validation words the errors.
    """
    if isinstance(X, Sequences):
        return False
    if (
        sparse.issparse(X)
        or isinstance(X, (str, bytes, Mapping, Set))
        or not hasattr(X, "__len__")
    ):
        return True
    if _has_columns(X):
        return not _columns_of_trials(X)
    if isinstance(X, np.ndarray) and (X.dtype != object or X.ndim != 1):
        return X.ndim <= 2
    if len(X) == 0:
        return True
    ndims = {_ndim(trial) for trial in X}
    if ndims == {1}:  # rows of a table, unless their lengths differ
        return len({len(row) for row in X}) == 1 and not isinstance(X, np.ndarray)
    return ndims == {0}


def channel_names(X):
    """Return the column names of trials that are data frames, None if none has any."""
    if isinstance(X, Sequences) or is_table(X):
        return None
    return next(filter(None, map(_names, _cells(X))), None)


def transposed_hint(shape):
    """Return a sentence for errors: a trial has more channels than samples."""
    if len(shape) != 2 or shape[1] <= shape[0]:
        return ""
    return (
        f" Its shape {shape} is taken for {_count(shape[0], 'time samples')} of "
        f"{_samples(shape[1:])}; transpose it if that is wrong."
    )


def check_trials(X, *, ndims=(2,), n_channels=None, names=None):
    """Validate a collection of trials; return a list of floating-point arrays.

    Parameters
    ----------
    X : collection of array-like
        List, tuple, object array, Series or one-column DataFrame of arrays, or
        one array with the trials along its first axis. A one-dimensional trial
        is one channel. Columns of trials that are data frames are put in the
        order of `names`.
    ndims : tuple of int, default=(2,)
        Numbers of dimensions that a trial may have.
    n_channels : int or tuple of int, default=None
        Required shape of one time sample; by default that of the first trial.
    names : list, default=None
        :func:`channel_names` of the trials given to `fit`; by default of these.

    Returns
    -------
    trials : list of ndarray of shape (n_times_i, ...)
        All float32 if every trial is float32, else all float64. Inputs that
        are already so are not copied.

    Raises
    ------
    ValueError
        If there is no trial, or one is too short, without channels, not finite,
        not of real numbers or of another shape than the rest; the message names
        the trial.
    """
    cells = _cells(X)
    _check_any(cells)
    where = "the first trial" if n_channels is None else "fit"
    named = "the first trial" if n_channels is None or names is None else "fit"
    names = channel_names(cells) if names is None else names
    trials = [
        _check_trial(_in_order(cell, i, names, named), i, ndims)
        for i, cell in enumerate(cells)
    ]
    shape = trials[0].shape[1:] if n_channels is None else n_channels
    shape = (shape,) if np.ndim(shape) == 0 else tuple(shape)
    for i, trial in enumerate(trials):
        hint = transposed_hint(trial.shape)
        _check_samples(i, trial.shape[1:], shape, where, hint)
    if len({trial.dtype for trial in trials}) > 1:
        trials = [trial.astype(np.float64, copy=False) for trial in trials]
    return trials


def check_sequences(sequences, *, n_columns=None):
    """Check what a sequence step returned, without coding any trial.

    Parameters
    ----------
    sequences : Sequences
        The codes, which are finite and alike.
    n_columns : int, default=None
        Required number of columns; by default any.

    Raises
    ------
    ValueError
        If there is no trial, or one is empty or has another number of columns;
        the message names the trial.
    """
    _check_any(sequences)
    for i, length in enumerate(sequences.lengths):
        _check_length(i, length, sequences.unit)
    if n_columns is not None:
        _check_samples(0, (len(sequences.feature_names),), (n_columns,), "fit")


def check_numbers(values, name):
    """Refuse what is no real number, though NumPy might quietly make it one.

    Parameters
    ----------
    values : array-like
        Numbers in any container; what scikit-learn refuses is left to it.
    name : str
        What error messages call ``values``.

    Raises
    ------
    ValueError
        If a value is text, a date, complex or masked, or rows differ in length.
    """
    array = check_regular(values, name)
    if not (hasattr(values, "columns") and hasattr(values, "dtypes")):
        if _holds_no_numbers(array):
            raise ValueError(
                f"{name} is not an array of numbers (it holds text or dates); convert "
                "it."
            )
        return
    # Column by column: an array of them all may make numbers of dates.
    for i, dtype in enumerate(values.dtypes):
        if _is_numeric(dtype):
            continue
        if _holds_no_numbers(np.asarray(_column(values, i))):
            column = values.columns[i]
            raise ValueError(
                f"{name} is not an array of numbers (column {column!r} holds text or "
                "dates); convert it or leave it out."
            )


def check_regular(values, name):
    """Refuse masked and complex values, rows of unequal length and what is no array."""
    if isinstance(values, (Mapping, Set, Iterator)) and not sparse.issparse(values):
        raise ValueError(
            f"{name} is a {type(values).__name__}, which is no array; give a list, an "
            "array or a DataFrame."
        )
    if np.ma.is_masked(values):
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


def check_table(estimator, X, **options):
    """Validate a table of features: `validate_data` after `check_numbers`.

    Its rows are contiguous, so that the same table gives the same sums in any layout.
    """
    check_numbers(X, "X")
    with np.errstate(over="ignore", invalid="ignore"):  # of the sum it looks at first
        return validate_data(estimator, X, order="C", **options)


def check_weights(sample_weight, X):
    """Validate the weights of trials; return them as float64, 1 each by default.

    Raises
    ------
    ValueError
        If they are not one finite number of 0 or more a trial, their sum overflows,
        or all are 0.
    """
    if sample_weight is not None:
        check_numbers(sample_weight, "sample_weight")
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


def check_objects(objects, *, name="objects", row="row"):
    """Validate the object of each row; return an array in which none is missing.

    Raises
    ------
    ValueError
        If an object is missing, or text is mixed with something else; the message
        names the row.
    """
    objects, named = drop_missing(objects, name)
    if not named.all():
        raise ValueError(
            f"{name} has no object in {row} {np.argmin(named)}; name the object of "
            f"every {row} or remove the {row}."
        )
    return objects


def check_groups(groups, X):
    """Validate the object of each trial, None if there are none."""
    if groups is None:
        return None
    shape = np.shape(groups)
    if len(shape) != 1 and shape[1:] != (1,):
        raise ValueError(
            f"groups has shape {shape}; give the object of each trial, one per trial."
        )
    check_consistent_length(X, groups)
    return check_objects(groups, name="groups", row="trial")


def drop_missing(values, name):
    """Return the values of a column that are there, and where they are."""
    if isinstance(values, np.ndarray) and values.dtype.kind in "biuU" and values.size:
        check_regular(values, name)
        return column_or_1d(values), np.ones(values.size, dtype=bool)
    values = column_or_1d(missing_to_none(values, name), dtype=None)
    given = np.array([value is not None for value in values], dtype=bool)
    if not given.any():
        raise ValueError(f"{name} holds no values at all; at least one is required.")
    values = values[given].tolist()
    if len({isinstance(value, str) for value in values}) > 1:
        raise ValueError(f"{name} mixes text with something else; convert it.")
    return lossless_array(values), given


def missing_to_none(values, name):
    """Return an array of objects in which None stands for each missing value."""
    if hasattr(values, "isna"):  # of pandas, whose own arrays look masked to NumPy
        values = values.to_numpy(dtype=object, na_value=None)
    check_regular(values, name)
    values = np.array(values, dtype=object)
    for i, value in enumerate(values.flat):
        if is_pandas_na(value) or value != value:
            values.flat[i] = None
    return values


def check_sparsity(n_nonzero_coefs, n_atoms):
    """Clip the number of atoms a code may use to the number there are."""
    if n_nonzero_coefs > n_atoms:
        warnings.warn(
            f"n_nonzero_coefs={n_nonzero_coefs} exceeds n_atoms={n_atoms}; codes use "
            f"at most {n_atoms} atoms.",
            UserWarning,
            stacklevel=3,
        )
    return min(n_nonzero_coefs, n_atoms)


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
            (n_trials, n_attributes, n_levels)
        As `check_ratings` takes it, or such counts of each of several attributes.
    levels : array-like of shape (n_levels,), default=None
        As in `check_ratings`.

    Returns
    -------
    X : ndarray of shape (n_trials, n_features)
        Features as float64.
    counts : ndarray of shape (n_trials, n_levels) or (n_trials, n_attributes, n_levels)
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
    counts, levels = check_attributes(y, levels)
    check_consistent_length(X, counts)
    return X, counts, levels


def check_attributes(y, levels=None, *, name="y"):
    """Validate ratings as `check_ratings` does, or those of each of several attributes.

    Counts of several attributes are an array of shape (n_trials, n_attributes,
    n_levels), and so are the counts returned.
    """
    check_regular(y, name)
    if getattr(y, "ndim", None) != 3:
        return check_ratings(y, levels, name=name)
    if y.shape[1] == 0:
        raise ValueError(
            f"{name} has shape {y.shape}, no attribute; give at least one."
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


def _has_columns(X):
    """Whether X is a DataFrame, a Series or an object array of two dimensions."""
    if hasattr(X, "to_numpy") and hasattr(X, "shape"):
        return True
    return isinstance(X, np.ndarray) and X.dtype == object and X.ndim == 2


def _column(X, i):
    """Return column i of a DataFrame or an array; a Series is its only column."""
    if len(X.shape) == 1:
        return X
    if hasattr(X, "to_series"):  # polars
        return X.to_series(i)
    return X.iloc[:, i] if hasattr(X, "iloc") else X[:, i]


def _columns_of_trials(X):
    """Return the numbers of the columns that hold arrays."""
    n_columns = 1 if len(X.shape) == 1 else X.shape[1]
    dtypes = X.dtypes if hasattr(X, "columns") else [X.dtype] * n_columns
    return [
        i
        for i, dtype in enumerate(dtypes)
        if not _is_numeric(dtype) and any(_ndim(cell) >= 1 for cell in _column(X, i))
    ]


def _is_numeric(dtype):
    """Whether a data type of NumPy, pandas or polars is one of real numbers."""
    if hasattr(dtype, "is_numeric"):
        return dtype.is_numeric()
    return dtype.kind in "biuf"


def _holds_no_numbers(array):
    if array.dtype.kind != "O":
        return array.dtype.kind in "SUTMm"
    return any(isinstance(value, _NO_NUMBERS) for value in array.flat)


def _cells(X):
    """Return the trials of a collection as a sequence; refuse several columns."""
    if not _has_columns(X):
        return X
    if len(X.shape) == 2 and X.shape[1] != 1:
        labels = getattr(X, "columns", range(X.shape[1]))
        of_trials = [labels[i] for i in _columns_of_trials(X)]
        raise ValueError(
            f"X has {X.shape[1]} columns, of which {of_trials} hold trials; choose one "
            "with ColumnTransformer, a transformer for each sensor."
        )
    return list(_column(X, 0))


def _names(trial):
    """Return the column names of a data frame that has any, else None."""
    if not hasattr(trial, "columns"):
        return None
    names = list(trial.columns)
    return None if names == list(range(len(names))) else names


def _in_order(trial, i, names, where):
    """Return a trial with its columns, if they have names, in the order of `names`."""
    own = None if names is None else _names(trial)
    if own is None or own == names:
        return trial
    odd = [name for name in [*names, *own] if own.count(name) != names.count(name)]
    if odd:
        raise ValueError(
            f"Trial {i} of X and {where} differ in the column {odd[0]!r}; give all "
            "trials the same columns."
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


def _count(n, units):
    """Return a number with its unit, given in the plural."""
    return f"{n} {units.removesuffix('s') if n == 1 else units}"


def _samples(shape):
    if len(shape) == 1:
        return _count(shape[0], "channels")
    return "frames of " + " × ".join(map(str, shape))


def _check_trial(trial, i, ndims):
    if _ndim(trial) == 0 and not isinstance(trial, (Mapping, Set)):
        raise ValueError(
            f"Trial {i} of X is {trial!r}, not an array of shape (n_times, "
            "n_channels); give its recording or leave the trial out."
        )
    check_numbers(trial, f"Trial {i} of X")
    try:
        trial = np.asarray(trial)
        if trial.dtype not in (np.float32, np.float64):
            trial = trial.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"Trial {i} of X is not an array of numbers ({error}); give each trial as "
            "an array of shape (n_times, n_channels)."
        ) from error
    if trial.ndim == 1 and 2 in ndims:
        trial = trial[:, None]
    if trial.ndim not in ndims:
        wanted = " or ".join(
            {2: "(n_times, n_channels)", 3: "(n_times, height, width)"}[n]
            for n in ndims
        )
        raise ValueError(
            f"Trial {i} of X has shape {trial.shape}; it must be {wanted}."
        )
    _check_length(i, len(trial))
    if trial.size == 0:
        raise ValueError(
            f"Trial {i} of X has shape {trial.shape}, which holds no values; give each "
            "trial one channel or more."
        )
    if not np.isfinite(trial).all():
        raise ValueError(
            f"Trial {i} of X contains NaN or infinity; impute or remove those samples."
        )
    return trial


def _check_any(trials):
    if len(trials) == 0:
        raise ValueError("X holds no trials; at least one is required.")


def _check_length(i, length, unit="time samples"):
    if length == 0:
        raise ValueError(
            f"Trial {i} of X has 0 {unit}, but at least 1 is required; remove it."
        )


def _check_samples(i, shape, expected, where, hint=""):
    if shape != expected:
        raise ValueError(
            f"Trial {i} of X has {_samples(shape)}, but {_samples(expected)} "
            f"{'is' if expected == (1,) else 'are'} expected, as in {where}.{hint}"
        )
