"""Ratings of objects from a MATLAB file whose variables' names are not known.

The variables are told apart by shape and content: one array of objects × adjectives ×
raters or levels, in any order of axes; perhaps the adjectives' names; perhaps the
objects' ids. Whatever could be read in two ways is an error.
"""

import warnings
from io import BytesIO
from itertools import permutations
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from sklearn_haptic.datasets._hdf5 import (
    check_stored,
    dtype_of,
    get_node,
    names_in,
    open_hdf5,
    read_attribute,
    read_references,
    read_rows,
)
from sklearn_haptic.datasets._mat5 import check_mat5

ADJECTIVES = (
    *("hard", "soft", "rough", "smooth", "slippery"),
    *("sticky", "cold", "warm", "moldable", "springy"),
)
LEVELS = np.arange(1, 6)


def read_ratings(path, known_objects, objects):
    """Read the ratings of objects: how many people gave each level, and who.

    Parameters
    ----------
    path : str or path-like
        MATLAB file; version 7.3 needs h5py.
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
        If it is not a MATLAB file, is cut short or is damaged.
    ValueError
        If the ratings are not found, could be read in two ways or lack an object.
    """
    variables = _read_variables(path)
    ids = _find_ids(path, variables, known_objects)
    names = _find_adjectives(path, variables)
    assumed = []
    if names is None:
        names = ADJECTIVES
        assumed.append(f"adjectives (assumed: {', '.join(names)})")
    if ids is None:
        ids = np.asarray(known_objects)
        assumed.append("objects (assumed: ids ascending)")
    array, kind = _find_array(path, variables, len(ids))
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

    Whoever rated an object on no adjective has no row for it.
    """
    import pandas as pd

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
    readings = [
        (name, array, axes, kind)
        for name, array in variables
        if isinstance(array, np.ndarray) and array.ndim == 3
        for axes in permutations(range(3))
        if np.take(array.shape, axes[:2]).tolist() == [n_objects, len(ADJECTIVES)]
        for kind in _kinds(array.transpose(axes))
    ]
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
            f"{name} {array.shape} as {kind} with axes {axes}"
            for name, array, axes, kind in readings
        )
        raise ValueError(
            f"{path} can be read in several ways: {listing}. Save {wanted} and nothing "
            "else that could be taken for it."
        )
    _, array, axes, kind = readings[0]
    return array.transpose(axes), kind


def _kinds(array):
    """Tell whether an array (objects, adjectives, ?) may be ratings or counts.

    Five raters and five levels look alike where nothing exceeds 5. Counts without a
    single 0 are not believed, and totals that are all equal are taken for counts.
    """
    missing = np.isnan(array)
    values = array[~missing]
    if values.size == 0 or np.isinf(values).any() or (values % 1 != 0).any():
        return []
    if values.min() < 0:
        return []
    may_be_ratings = values.max() <= LEVELS[-1]
    may_be_counts = (
        array.shape[2] == len(LEVELS)
        and not missing.any()
        and (values.min() == 0 or not may_be_ratings)
    )
    if may_be_counts and np.ptp(array.sum(axis=2)) == 0:
        return ["counts"]
    possible = {"ratings": may_be_ratings, "counts": may_be_counts}
    return [kind for kind, is_possible in possible.items() if is_possible]


def _count_levels(ratings):
    """Count the levels along the last axis; whatever is no level is missing."""
    return np.stack([(ratings == level).sum(axis=-1) for level in LEVELS], axis=-1)


def _find_ids(path, variables, known_objects):
    """Return the vector of distinct integers most of which are ids of the corpus."""
    vectors = {}
    for name, array in variables:
        if not isinstance(array, np.ndarray) or array.size != max(array.shape):
            continue
        vector = array.ravel()
        n_shared = np.isin(known_objects, vector).sum()
        if (
            vector.size > 1
            and 2 * n_shared >= min(vector.size, len(known_objects))
            and (vector == np.floor(vector)).all()
            and len(np.unique(vector)) == vector.size
        ):
            vectors[name] = vector.astype(np.int64)
    if len({tuple(vector) for vector in vectors.values()}) > 1:
        raise ValueError(
            f"{path} has several vectors that could be object ids: {list(vectors)}; "
            "keep one."
        )
    return next(iter(vectors.values()), None)


def _find_adjectives(path, variables):
    """Return the ten names of adjectives, in small letters."""
    lists = {
        name: tuple(text.lower() for text in texts)
        for name, texts in variables
        if isinstance(texts, list) and len(set(texts)) == len(texts) == len(ADJECTIVES)
    }
    exact = {n: texts for n, texts in lists.items() if set(texts) == set(ADJECTIVES)}
    lists = exact or lists
    if len(set(lists.values())) > 1:
        raise ValueError(
            f"{path} has several lists that could be the adjectives: {list(lists)}; "
            "keep one."
        )
    return next(iter(lists.values()), None)


def _listing(variables):
    def describe(value):
        if isinstance(value, np.ndarray):
            return f"{value.shape} {value.dtype}"
        return f"{len(value)} strings" if isinstance(value, list) else value

    return "; ".join(f"{name}: {describe(value)}" for name, value in variables) or (
        "no variables"
    )


def _read_variables(path):
    """Return (name, value) pairs: numbers as arrays, text as lists, else a remark."""
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"There is no file {path}; give the path of one.")
    with open(path, "rb") as file:
        start = file.read(10)
        data = start + (b"" if start == b"MATLAB 7.3" else file.read())
    if start == b"MATLAB 7.3":
        with open_hdf5(path) as file:
            return list(_walk_hdf5(file))
    try:
        check_mat5(data)
        with warnings.catch_warnings():  # SciPy 1.18, about what is passed over
            warnings.filterwarnings("ignore", ".*spmatrix", DeprecationWarning)
            contents = loadmat(BytesIO(data))
    except Exception as error:  # scipy raises a dozen types for damaged files
        raise OSError(
            f"{path} is not a MATLAB file, is cut short or is damaged ({error}); "
            "download it again."
        ) from error
    return [
        variable
        for name, value in contents.items()
        if not name.startswith("__")
        for variable in _walk_struct(name, value)
    ]


def _walk_struct(name, value):
    if type(value) is not np.ndarray:  # functions, objects and sparse matrices
        yield name, f"unreadable {type(value).__name__}"
    elif value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _walk_struct(f"{name}.{field}", value[field].item())
    elif value.dtype.kind in "iuf":
        yield name, value
    else:
        cells = [np.asarray(cell) for cell in value.ravel(order="F")]
        if all(cell.dtype.kind == "U" and cell.size == 1 for cell in cells):
            yield name, [cell.item().strip() for cell in cells]
        else:
            yield name, f"{value.shape} {value.dtype}"


def _walk_hdf5(group, prefix=""):
    """Walk a version 7.3 file, in which MATLAB's axes are reversed."""
    for name in names_in(group):
        if name.startswith("#"):  # MATLAB's own bookkeeping
            continue
        node = get_node(group, name)
        matlab_class = read_attribute(node, "MATLAB_class")
        if hasattr(node, "keys"):
            if prefix:
                yield prefix + name, "nested struct"
            else:
                yield from _walk_hdf5(node, f"{name}.")
        elif matlab_class == b"char":
            yield prefix + name, _texts(node)
        elif matlab_class == b"cell":
            cells = read_references(node)
            if all(read_attribute(cell, "MATLAB_class") == b"char" for cell in cells):
                yield prefix + name, [text for cell in cells for text in _texts(cell)]
            else:
                yield prefix + name, f"{node.shape} cell"
        elif dtype_of(node).kind in "iuf":
            check_stored(node, "iuf")
            yield prefix + name, read_rows(node).T
        else:
            yield prefix + name, f"{node.shape} {dtype_of(node)}"


def _texts(dataset):
    """Return the rows of a character matrix."""
    check_stored(dataset, "u")
    return ["".join(map(chr, row)).strip() for row in read_rows(dataset).T]
