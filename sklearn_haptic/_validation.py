"""Input checks that more than one module needs: trials, ratings, sparsity.

A *trial* is one touch of one object: an array of shape ``(n_times,
n_channels)``, or ``(n_times, height, width)`` for tactile images. Trials
differ in length, so a collection of them is a sequence of arrays. A *table* is
scikit-learn's ordinary two-dimensional input; every transformer takes both.
"""

from __future__ import annotations

import warnings
from difflib import get_close_matches

import numpy as np
from sklearn.utils.validation import check_consistent_length, column_or_1d

from ._check_trials import check_numbers, check_regular
from ._levels import lossless_array
from ._sklearn import _check_sample_weight, is_pandas_na


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


def check_names(asked, known, what, where):
    """Return the names asked for, or all that are known if ``asked`` is None.

    Parameters
    ----------
    asked : sequence of str, or None
    known : list of str
    what, where : str
        What error messages call a name, and what has these names.

    Raises
    ------
    ValueError
        If no name is asked for, one is unknown, or one is asked for twice.
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
