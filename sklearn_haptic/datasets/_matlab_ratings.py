"""Ratings of objects from a MATLAB file whose variables have unknown names.

The variables are recognised by shape and content: one array of objects × adjectives ×
raters or levels, in any order of axes; the names of the adjectives and the ids of the
objects, unless they are given. What could be read in two ways is an error, and no order
is assumed.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass
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
from ._rated import ADJECTIVES, LEVELS, Rated, object_ids

# A longer vector does not hold the ids of objects.
_MOST_OBJECTS = 10**6
# So many bytes of values are read from a file of any size.
_SMALL = 2**26


@dataclass(frozen=True)
class MatlabRatings:
    """A MATLAB file of ratings, and what has to be known to read it.

    It is given to `load_phac2` as ``ratings``. A plain path will do for a file that
    tells all of this itself.

    Parameters
    ----------
    path : str or path-like
        File of version 5, 7 or 7.3; version 7.3 needs h5py. It has a numeric array with
        the axes objects, adjectives, and raters (ratings 1 to 5; 0 or NaN if missing)
        or 5 levels (counts), in any order.
    variable : str, default=None
        Name of that array, ``"struct.field"`` for a field; by default the only array
        of such a shape.
    objects : sequence of int or str, default=None
        Ids of the objects, in the order in which they lie along their axis; by default
        those in the file's vector of ids.
    adjectives : sequence of str, default=None
        Names of the adjectives, in the order in which they lie along their axis; by
        default the ten in the file's cell array or character matrix of names.

    Examples
    --------
    >>> from sklearn_haptic.datasets import MatlabRatings, load_phac2
    >>> ratings = MatlabRatings(
    ...     "ratings.mat", variable="counts", objects=[101, 102], adjectives=["hard"]
    ... )
    >>> corpus = load_phac2("corpus.h5", ratings=ratings)  # doctest: +SKIP
    """

    path: str | os.PathLike[str]
    _: KW_ONLY
    variable: str | None = None
    objects: Sequence[int | str] | None = None
    adjectives: Sequence[str] | None = None


def read_matlab(file, known_objects):
    """Read the ratings of objects: how many people gave each level, and who.

    A vector of ids is recognised by `known_objects`, those of the corpus. The result
    has no answers if the file holds counts.

    Raises
    ------
    FileNotFoundError
        If there is no file.
    OSError
        If it is not a MATLAB file, is cut short or damaged, or expands too far.
    ValueError
        If the ratings are not found, could be read in two ways, or have an order that
        is neither given nor told.
    """
    path, ids, names = os.fspath(file.path), _objects(file), _adjectives(file)
    with _open_variables(path) as variables:
        if ids is None:
            ids = _find_ids(path, variables, known_objects)
        if names is None:
            names = _find_adjectives(path, variables)
        shape = [len(known_objects) if ids is None else len(ids)]
        shape += [len(ADJECTIVES) if names is None else len(names)]
        array, kind = _find_array(path, variables, file.variable, shape)
        if kind == "counts" and array.max() >= 2**63:
            raise ValueError(
                f"{path} has a count of {array.max():.3g}, which no 64-bit integer "
                "holds; divide the counts by a constant."
            )
    untold = [
        what for what, o in (("objects", ids), ("adjectives", names)) if o is None
    ]
    if untold:
        options = ", ".join(f"{what}=[...]" for what in untold)
        raise ValueError(
            f"{path} does not tell the order of its {' and '.join(untold)}; give "
            f"ratings=MatlabRatings({path!r}, {options}) with their ids or names in "
            "the order of the file."
        )
    counts = (_count_levels(array) if kind == "ratings" else array).astype(np.int64)
    answers = _answers(array, ids, names) if kind == "ratings" else None
    return Rated(path, "object", ids, names, counts, LEVELS.copy(), answers)


def _objects(file):
    """Return the ids of the objects that are given, or None."""
    if file.objects is None:
        return None
    ids = object_ids(list(file.objects), "MatlabRatings(objects=...)")
    return _check_distinct(ids, "objects")


def _adjectives(file):
    """Return the names of the adjectives that are given, or None."""
    if file.adjectives is None:
        return None
    names = [file.adjectives] if isinstance(file.adjectives, str) else file.adjectives
    if not all(isinstance(name, str) for name in names):
        raise ValueError("MatlabRatings(adjectives=...) must list names as text.")
    return _check_distinct([str(name) for name in names], "adjectives")


def _check_distinct(given, what):
    if not given or len(set(given)) < len(given):
        raise ValueError(
            f"MatlabRatings({what}={given}) must be distinct and at least one; list "
            "each once, in the order of the file."
        )
    return given


def _answers(array, ids, names):
    """Return a table of the ratings (n_objects, n_adjectives, n_raters).

    People who rated an object on no adjective have no row for it.
    """
    answers = np.where(np.isin(array, LEVELS), array, np.nan)
    rows = [ids, range(1, array.shape[2] + 1)]
    return pd.DataFrame(
        answers.transpose(0, 2, 1).reshape(-1, len(names)),
        index=pd.MultiIndex.from_product(rows, names=["object", "rater"]),
        columns=list(names),
    ).dropna(how="all")


def _find_array(path, variables, name, shape):
    """Return the array (objects, adjectives, ?) and whether it is ratings or counts."""
    named = [v for v in variables if name in (None, v.name)]
    if name is not None and not named:
        raise ValueError(
            f"{path} has no variable {name!r}; it has {_listing(variables)}."
        )
    readings = []
    for variable in named:
        if len(variable.shape) != 3 or variable.matlab_class not in NUMERIC_CLASSES:
            continue
        for axes in permutations(range(3)):
            n = [variable.shape[axis] for axis in axes]
            if n[:2] == shape:
                array = variable.read().transpose(axes)
                readings += [(variable, axes, array, kind) for kind in _kinds(array)]
    wanted = (
        f"one numeric array of {shape[0]} objects × {shape[1]} adjectives × "
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
            f"{path} can be read in several ways: {listing}. Name the right one by "
            f"MatlabRatings(..., variable=...), or save {wanted} and nothing else that "
            "could be taken for it."
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
            vectors[name] = vector.astype(np.int64).tolist()
    if len({tuple(vector) for vector in vectors.values()}) > 1:
        raise ValueError(
            f"{path} has several vectors that could be object ids: {list(vectors)}; "
            "keep one, or give MatlabRatings(..., objects=[...])."
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
                lists[name] = [text.lower() for text in texts]
    exact = {n: texts for n, texts in lists.items() if set(texts) == set(ADJECTIVES)}
    lists = exact or lists
    if len({tuple(texts) for texts in lists.values()}) > 1:
        raise ValueError(
            f"{path} has several lists that could be the adjectives: {list(lists)}; "
            "keep one, or give MatlabRatings(..., adjectives=[...])."
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
