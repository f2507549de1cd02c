"""People's ratings of the objects of PHAC-2, from any source to counts per trial."""

import os
from collections.abc import Mapping

import numpy as np
import pandas as pd
from sklearn.utils import _safe_indexing

from ..ratings import RatingTable
from ..ratings._checks import check_counts
from ..ratings._counts import column_named
from ..ratings._levels import names_levels
from ..utils._validation import drop_missing, rows_of_objects
from ._hdf5 import check_file
from ._matlab_ratings import LEVELS, MatlabRatings, read_matlab

_FORMS = (
    "{} is of the type {}; give a DataFrame with one row per answer, the path of such "
    "a CSV file, a dict of adjectives with a RatingTable or DataFrame of counts each, "
    "or MatlabRatings."
)


def rate_trials(ratings, objects, known):
    """Return the ratings of each trial.

    Parameters
    ----------
    ratings : path, DataFrame, dict or MatlabRatings
        As `load_phac2` takes them.
    objects : ndarray of int of shape (n_trials,)
        The object of each trial.
    known : set of int
        All objects of the corpus.

    Returns
    -------
    counts : dict of str to ndarray of shape (n_trials, n_levels)
    levels : ndarray of shape (n_levels,)
    answers : DataFrame or None
        One row per object and person, one column per adjective.
    """
    tables = _tables_of(ratings)
    levels = next(iter(tables.values())).levels.copy()
    counts = {}
    for adjective, table in tables.items():
        unknown = [each for each in table.objects.tolist() if each not in known]
        if unknown:
            raise ValueError(
                f"ratings has objects that the corpus does not have, {unknown[:5]}; "
                f"leave them out, or give ids of the corpus such as {min(known)}."
            )
        if table.levels.tolist() != levels.tolist():
            raise ValueError(
                f"ratings[{adjective!r}] has the levels {table.levels.tolist()}, but "
                f"others have {levels.tolist()}; give all adjectives the same, for "
                "instance by rating_counts(..., levels=[1, 2, 3, 4, 5])."
            )
        lacks = f"ratings[{adjective!r}] has no ratings"
        counts[adjective] = table.counts.to_numpy()[
            rows_of_objects(objects, table.objects, lacks=lacks)
        ]
    if any(table.answers is None for table in tables.values()):
        return counts, levels, None
    answers = pd.concat(
        map(_answers_of, tables.values()), axis=1, keys=tables, sort=True
    )
    return counts, levels, answers[answers.index.isin(objects, level="object")]


def _tables_of(ratings):
    """Return a RatingTable of each adjective."""
    if isinstance(ratings, (str, os.PathLike)):
        ratings = _read_csv(ratings)
    elif isinstance(ratings, MatlabRatings):
        ratings = read_matlab(ratings)
    if hasattr(ratings, "columns"):
        return _count_answers(ratings)
    if isinstance(ratings, Mapping) and ratings:
        return {name: _as_table(table, name) for name, table in ratings.items()}
    raise TypeError(_FORMS.format("ratings", type(ratings).__name__))


def _read_csv(path):
    """Read a table with one row per answer."""
    check_file(path)
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            return pd.read_csv(file, dtype={"rater": str, "adjective": str})
    except ValueError as error:
        raise ValueError(
            f"{path} is not a CSV file in UTF-8 ({error}); save it as one, or describe "
            "a MATLAB file by MatlabRatings."
        ) from error


def _count_answers(frame):
    """Count the answers of a table with one row per answer."""
    adjectives, named = drop_missing(column_named(frame, "adjective"), "adjective")
    if not named.all():
        raise ValueError(
            f"ratings names no adjective in row {np.argmin(named)}; name it or remove "
            "the row."
        )
    levels = None if names_levels(column_named(frame, "rating")) else LEVELS
    tables = {}
    for adjective in dict.fromkeys(adjectives.tolist()):
        answers = _safe_indexing(frame, adjectives == adjective)
        try:
            tables[adjective] = RatingTable.from_long(answers, levels=levels)
        except ValueError as error:
            raise ValueError(f"The answers on {adjective!r}: {error}") from error
    return tables


def _as_table(table, adjective):
    """Return counts as a RatingTable, without objects that nobody rated."""
    if isinstance(table, RatingTable):
        return table
    name = f"ratings[{adjective!r}]"
    if not isinstance(table, pd.DataFrame):
        raise TypeError(_FORMS.format(name, type(table).__name__))
    if not table.index.is_unique:
        raise ValueError(f"{name} has two rows of an object; give one row per object.")
    counts, levels = check_counts(table, name=name, unrated=True)
    rated = counts.any(axis=1)
    if counts.max() < 2**63 and (counts % 1 == 0).all():
        counts = counts.astype(np.int64)
    return RatingTable(counts[rated], np.asarray(table.index)[rated], levels)


def _answers_of(table):
    """Return the answers of a table as a column, indexed by object and person."""
    which, who, level = table.answers.T
    index = pd.MultiIndex.from_arrays(
        [table.objects.astype(np.int64)[which], table.raters[who]],
        names=["object", "rater"],
    )
    if table.levels.dtype.kind in "biuf":
        return pd.Series(table.levels[level].astype(float), index)
    words = pd.Categorical.from_codes(level, table.levels, ordered=True)
    return pd.Series(words, index)
