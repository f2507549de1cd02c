"""Ratings of objects in an array of a MATLAB file, whose axes are told in words."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass

import numpy as np
import pandas as pd
from scipy.io import loadmat, whosmat

from ._hdf5 import (
    check_file,
    check_stored,
    get_node,
    open_hdf5,
    read_rows,
)

LEVELS = np.arange(1, 6)
_AXES = [{"objects", "adjectives", each} for each in ("raters", "levels")]


@dataclass(frozen=True)
class MatlabRatings:
    """Where a MATLAB file has people's ratings, for `load_phac2`.

    Nothing is guessed: list the variables by ``scipy.io.whosmat(path)``, or those of
    version 7.3 by ``h5py.File(path).visititems(print)``, which reverses the axes.

    Parameters
    ----------
    path : str or path-like
        File of version 5 to 7.3; the last needs h5py.
    variable : str
        Name of the array of ratings; ``"struct.field"`` is a field of a struct.
    axes : sequence of str
        What its axes are, in MATLAB's order: ``"objects"``, ``"adjectives"``, and
        either ``"raters"``, if it holds each person's rating from 1 to 5 (0 or NaN
        where one is missing), or ``"levels"``, if it holds how many people gave each of
        the five ratings.
    objects : sequence of int, or str
        Ids of the objects in the order of the array, or the name of the variable that
        lists them.
    adjectives : sequence of str
        Adjectives in the order of the array.

    Examples
    --------
    >>> from sklearn_haptic.datasets import MatlabRatings, load_phac2
    >>> ratings = MatlabRatings(
    ...     "ratings.mat",
    ...     variable="study.answers",
    ...     axes=["raters", "objects", "adjectives"],
    ...     objects="study.ids",
    ...     adjectives=["hard", "soft"],
    ... )
    >>> corpus = load_phac2("corpus.h5", ratings=ratings)  # doctest: +SKIP
    """

    path: str | os.PathLike[str]
    _: KW_ONLY
    variable: str
    axes: Sequence[str]
    objects: Sequence[int] | str
    adjectives: Sequence[str]


def read_matlab(told):
    """Read the ratings of a MATLAB file, of which a `MatlabRatings` tells.

    Returns
    -------
    ratings : DataFrame, or dict of str to DataFrame
        One row per rating of an object by a person on an adjective; or, for each
        adjective, counts of shape (n_objects, n_levels).
    """
    axes = [*told.axes]
    if {*axes} not in _AXES or len(axes) != 3:
        raise ValueError(
            f"MatlabRatings(axes={axes}) must be 'objects', 'adjectives' and either "
            "'raters' or 'levels', in the order of the array."
        )
    check_file(told.path)
    with open(told.path, "rb") as file:
        is_hdf5 = file.read(10) == b"MATLAB 7.3"
    read = _read_version_7_3 if is_hdf5 else _read_version_5
    listed = [told.objects] if isinstance(told.objects, str) else []
    found = read(told.path, [told.variable, *listed])
    objects = np.ravel(found[listed[0]] if listed else told.objects).tolist()
    adjectives = [*told.adjectives]
    if len({*objects}) < len(objects) or len({*adjectives}) < len(adjectives):
        raise ValueError(
            f"MatlabRatings of {told.path} has objects={objects} and "
            f"adjectives={adjectives}; list each once, in the order of the array."
        )
    array = _in_order(told, np.asarray(found[told.variable]), objects, adjectives)
    if "levels" in axes:
        return {
            adjective: pd.DataFrame(counts, objects, LEVELS)
            for adjective, counts in zip(adjectives, array)
        }
    names = ["adjective", "object", "rater"]
    lists = [adjectives, objects, range(1, array.shape[2] + 1)]
    index = pd.MultiIndex.from_product(lists, names=names)
    ratings = pd.Series(np.where(array == 0, np.nan, array).ravel(), index)
    return ratings.dropna().rename("rating").reset_index()


def _in_order(told, array, objects, adjectives):
    """Return the array as (n_adjectives, n_objects, n_raters or n_levels)."""
    sizes = {"objects": len(objects), "adjectives": len(adjectives)}
    n_cells = max(len(objects) * len(adjectives), 1)
    sizes |= {"levels": len(LEVELS), "raters": array.size // n_cells}
    shape = [sizes[axis] for axis in told.axes]
    # MATLAB drops axes of length 1 from the end, and SciPy all of them.
    fits = [n for n in array.shape if n != 1] == [n for n in shape if n != 1]
    if array.dtype.kind not in "iuf" or not fits:
        raise ValueError(
            f"{told.variable!r} of {told.path} has shape {array.shape} and dtype "
            f"{array.dtype}, but axes={[*told.axes]} tells of numbers of shape "
            f"{tuple(shape)}; mend the axes, the objects or the adjectives."
        )
    place = {axis: i for i, axis in enumerate(told.axes)}
    order = [place.pop("adjectives"), place.pop("objects"), *place.values()]
    return array.reshape(shape).transpose(order)


def _read_version_5(path, names):
    """Return variables of versions 5 to 7, by SciPy, which drops axes of length 1."""
    path = os.fspath(path)
    try:
        tops = [name.partition(".")[0] for name in names]
        variables = loadmat(
            path, appendmat=False, simplify_cells=True, variable_names=tops
        )
        listing = whosmat(path, appendmat=False)
    except Exception as error:  # damage shows in a dozen types
        raise OSError(
            f"{path} cannot be read as a MATLAB file ({error}); give one, or download "
            "it again."
        ) from error
    found = {}
    for name in names:
        value = variables
        for part in name.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        if value is None:
            raise ValueError(f"{path} has no variable {name!r}; it has {listing}.")
        found[name] = value
    return found


def _read_version_7_3(path, names):
    """Return variables of version 7.3, whose axes HDF5 holds in reverse."""
    with open_hdf5(path) as file:
        nodes = {name: get_node(file, name.replace(".", "/")) for name in names}
        for node in nodes.values():
            check_stored(node, "iuf")
        return {name: read_rows(node).T for name, node in nodes.items()}
