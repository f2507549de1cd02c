"""Ratings of objects from a MATLAB file whose variables have unknown names.

The variables are recognised by shape and content: one array of objects × adjectives ×
raters or levels, in any order of axes; optionally the names of the adjectives and the
ids of the objects. What could be read in two ways is an error.
"""

import math
import warnings
from contextlib import contextmanager
from functools import partial
from itertools import permutations

import numpy as np
import pandas as pd

from ._hdf5 import (
    check_expansion,
    check_stored,
    dtype_of,
    get_node,
    largest_expansion,
    names_in,
    open_hdf5,
    place_of,
    read_attribute,
    read_references,
    read_rows,
    read_start,
)
from ._mat5 import (
    NUMERIC_CLASSES,
    Variable,
    join_cells,
    list_mat5,
    rows_of_text,
)

ADJECTIVES = (
    *("hard", "soft", "rough", "smooth", "slippery"),
    *("sticky", "cold", "warm", "moldable", "springy"),
)
LEVELS = np.arange(1, 6)
# A longer vector does not hold the ids of objects.
_MOST_OBJECTS = 10**6
# So many bytes of values are read from a file of any size.
_SMALL = 2**26


def read_ratings(path, known_objects, objects):
    """Read the ratings of objects: how many people gave each level, and who.

    Parameters
    ----------
    path : str or path-like
        MATLAB file of version 5 or later; version 7.3 needs h5py.
    known_objects : array-like of shape (n_objects,)
        Ids of all the objects of the corpus, ascending: the order of the ratings
        if the file holds no vector of ids.
    objects : array-like of shape (n_trials,)
        Id of each trial's object.

    Returns
    -------
    ratings : dict of str to ndarray of shape (n_trials, 5)
        Counts of the levels.
    rater_ratings : DataFrame of shape (n_rated, 10) or None
        Each person's ratings of each of the objects, NaN where missing; None if the
        file holds counts.

    Raises
    ------
    FileNotFoundError
        If there is no file.
    OSError
        If it is not a MATLAB file, is cut short or damaged, or expands too far.
    ValueError
        If the ratings are not found, could be read in two ways or lack an object.
    """
    assumed = []
    with _open_variables(path) as variables:
        ids = _find_ids(path, variables, known_objects)
        names = _find_adjectives(path, variables)
        if names is None:
            names = ADJECTIVES
            assumed.append(f"adjectives (assumed: {', '.join(names)})")
        if ids is None:
            ids = np.asarray(known_objects)
            assumed.append("objects (assumed: ids ascending)")
        array, kind = _find_array(path, variables, len(ids))
        if kind == "counts" and array.max() >= 2**63:
            raise ValueError(
                f"{path} has a count of {array.max():.3g}, which no 64-bit integer "
                "holds; divide the counts by a constant."
            )
    counts = (_count_levels(array) if kind == "ratings" else array).astype(np.int64)
    if assumed:
        warnings.warn(
            f"{path} does not tell the order of its {' and '.join(assumed)}; check "
            "that it holds.",
            UserWarning,
            stacklevel=4,
        )
    row_of = {object_id: row for row, object_id in enumerate(ids.tolist())}
    for object_id in np.unique(objects).tolist():
        if object_id not in row_of:
            raise ValueError(
                f"{path} has no ratings of object {object_id}; it has objects "
                f"{sorted(row_of)}. Leave the object's trials out through trials=."
            )
        for name, total in zip(names, counts[row_of[object_id]].sum(axis=1)):
            if total == 0:
                raise ValueError(
                    f"{path} has no {name!r} rating of object {object_id}; leave the "
                    "object's trials out through trials=."
                )
    rows = [row_of[object_id] for object_id in np.asarray(objects).tolist()]
    ratings = {name: counts[rows, i] for i, name in enumerate(names)}
    if kind == "counts":
        return ratings, None
    rated = np.unique(objects)
    array = array[[row_of[object_id] for object_id in rated.tolist()]]
    return ratings, _rater_ratings(array, rated, names)


def _rater_ratings(array, ids, names):
    """Return a table of the ratings (n_objects, n_adjectives, n_raters).

    People who rated an object on no adjective have no row for it.
    """
    n_raters = array.shape[2]
    answers = np.where(np.isin(array, LEVELS), array, np.nan)
    rows = [ids, range(1, n_raters + 1)]
    return pd.DataFrame(
        answers.transpose(0, 2, 1).reshape(-1, len(names)),
        index=pd.MultiIndex.from_product(rows, names=["object", "rater"]),
        columns=list(names),
    ).dropna(how="all")


def _find_array(path, variables, n_objects):
    """Return the array (objects, adjectives, ?) and whether it is ratings or counts."""
    readings = []
    for variable in variables:
        if len(variable.shape) != 3 or variable.matlab_class not in NUMERIC_CLASSES:
            continue
        for axes in permutations(range(3)):
            n = [variable.shape[axis] for axis in axes]
            if n[:2] == [n_objects, len(ADJECTIVES)]:
                array = variable.read().transpose(axes)
                readings += [(variable, axes, array, kind) for kind in _kinds(array)]
    wanted = (
        f"one numeric array of {n_objects} objects × {len(ADJECTIVES)} adjectives × "
        "raters (1 to 5; 0 or NaN if missing) or × 5 levels (counts), its axes in any "
        "order"
    )
    if not readings:
        raise ValueError(
            f"{path} has no ratings that can be told by shape: {wanted}. It has "
            f"{_listing(variables)}."
        )
    if len(readings) > 1:
        listing = "; ".join(
            f"{name} {shape} as {kind} with axes {axes}"
            for (name, _, shape, _), axes, _, kind in readings
        )
        raise ValueError(
            f"{path} can be read in several ways: {listing}. Save {wanted} and nothing "
            "else that could be taken for it."
        )
    [(_, _, array, kind)] = readings
    return array, kind


def _kinds(array):
    """List what an array (objects, adjectives, ?) may be: ratings, counts, both, none.

    Ratings by five people and counts of five levels look alike if no value exceeds 5.
    Without any 0, the array holds ratings, or possibly counts if all totals are equal.
    With a 0 it may hold counts, and holds them for certain if all totals are equal.
    """
    missing = np.isnan(array)
    values = array[~missing]
    if values.size == 0 or np.isinf(values).any() or (values % 1 != 0).any():
        return []
    if values.min() < 0:
        return []
    may_be_ratings = values.max() <= LEVELS[-1]
    may_be_counts = array.shape[2] == len(LEVELS) and not missing.any()
    if may_be_ratings and may_be_counts:
        totals_are_equal = np.ptp(array.sum(axis=2)) == 0
        if values.min() > 0:
            may_be_counts = totals_are_equal
        else:
            may_be_ratings = not totals_are_equal
    possible = {"ratings": may_be_ratings, "counts": may_be_counts}
    return [kind for kind, is_possible in possible.items() if is_possible]


def _count_levels(ratings):
    """Count the levels along the last axis; other values are missing."""
    return np.stack([(ratings == level).sum(axis=-1) for level in LEVELS], axis=-1)


def _find_ids(path, variables, known_objects):
    """Return the vector of distinct integers that are mostly ids of the corpus."""
    vectors = {}
    for name, matlab_class, shape, read in variables:
        size = math.prod(shape)
        if (
            matlab_class not in NUMERIC_CLASSES
            or not 1 < size <= _MOST_OBJECTS
            or size != max(shape)
        ):
            continue
        vector = read().ravel()
        n_shared = np.isin(known_objects, vector).sum()
        if (
            2 * n_shared >= min(size, len(known_objects))
            and (vector == np.floor(vector)).all()
            and np.abs(vector.astype(float)).max() < 2**53
            and len(np.unique(vector)) == size
        ):
            vectors[name] = vector.astype(np.int64)
    if len({tuple(vector) for vector in vectors.values()}) > 1:
        raise ValueError(
            f"{path} has several vectors that could be object ids: {list(vectors)}; "
            "keep one."
        )
    return next(iter(vectors.values()), None)


def _find_adjectives(path, variables):
    """Return the ten names of adjectives, in lower case."""
    n = len(ADJECTIVES)
    lists = {}
    for name, matlab_class, shape, read in variables:
        if (matlab_class == "char" and len(shape) == 2 and shape[0] == n) or (
            matlab_class == "cell" and math.prod(shape) == n
        ):
            texts = read()
            if texts is not None and len(set(texts)) == n:
                lists[name] = tuple(text.lower() for text in texts)
    exact = {n: texts for n, texts in lists.items() if set(texts) == set(ADJECTIVES)}
    lists = exact or lists
    if len(set(lists.values())) > 1:
        raise ValueError(
            f"{path} has several lists that could be the adjectives: {list(lists)}; "
            "keep one."
        )
    return next(iter(lists.values()), None)


def _listing(variables):
    shown = [f"{name}: {shape} {kind}" for name, kind, shape, _ in variables[:50]]
    if len(variables) > len(shown):
        shown.append(f"{len(variables) - len(shown)} more")
    return "; ".join(shown) or "no variables"


@contextmanager
def _open_variables(path):
    """Yield the variables of a file, which stays open while they may be read."""
    if read_start(path, 10) == b"MATLAB 7.3":
        with open_hdf5(path) as file:
            yield list(_list_hdf5(file))
    else:
        data, limit = read_start(path, -1), largest_expansion(path, _SMALL)
        with _reading(path):
            variables = list(list_mat5(data, limit))
        yield [v._replace(read=_reading(path)(v.read)) for v in variables]


@contextmanager
def _reading(path):
    try:
        yield
    except MemoryError as error:
        raise OSError(
            f"{path} takes too much memory ({error}); save its ratings alone, without "
            "compression."
        ) from error
    except Exception as error:  # damage shows in a dozen types
        raise OSError(
            f"{path} is not a MATLAB file, is cut short or is damaged ({error}); "
            "download it again."
        ) from error


def _list_hdf5(group, prefix=""):
    """Yield the variables of version 7.3, in which MATLAB's axes are reversed."""
    for name in names_in(group):
        if name.startswith("#"):  # MATLAB's own bookkeeping
            continue
        node = get_node(group, name)
        if not hasattr(node, "keys"):
            yield _as_variable(prefix + name, node)
        elif prefix or read_attribute(node, "MATLAB_sparse") is not None:
            yield Variable(prefix + name, "group", (), lambda: None)
        else:
            yield from _list_hdf5(node, f"{name}.")


def _as_variable(name, dataset):
    """Return a dataset as a variable, which is read when it is asked for."""
    dtype = dtype_of(dataset)
    matlab_class = read_attribute(dataset, "MATLAB_class")
    if isinstance(matlab_class, bytes):
        matlab_class = matlab_class.decode("ascii", "replace")
    if matlab_class in (None, "logical"):
        matlab_class = {"float64": "double", "float32": "single"}.get(dtype.name)
        matlab_class = matlab_class or dtype.name
    if read_attribute(dataset, "MATLAB_empty"):  # holds its shape
        shape = tuple(_read_numbers(dataset).tolist())
        return Variable(name, matlab_class, shape, lambda: [])
    read = {"char": _read_text, "cell": _read_cells}.get(matlab_class, _read_numbers)
    shape = (dataset.shape or ())[::-1]
    return Variable(name, matlab_class, shape, partial(read, dataset))


def _read_numbers(dataset, dtype_kinds="iuf"):
    check_stored(dataset, dtype_kinds)
    check_expansion(dataset, dataset.nbytes, _SMALL)
    return read_rows(dataset).T


def _read_text(dataset):
    try:
        return rows_of_text(_read_numbers(dataset, "iu"))
    except UnicodeError as error:
        raise ValueError(f"{place_of(dataset)} is not UTF-16 ({error}).") from error


def _read_cells(dataset):
    """Return the texts of an array of references to text, None of anything else."""
    cells = [_as_variable("", cell) for cell in read_references(dataset)]
    if all(cell.matlab_class == "char" for cell in cells):
        return join_cells(cell.read() for cell in cells)
    return None
