"""Ratings from tables: one answer per row, or counts per object.

Text in a CSV file stays text until it is asked what it means, so nothing is guessed.
"""

import csv
import io
from collections.abc import Hashable

import numpy as np
import pandas as pd

from .._check_ratings import check_counts
from .._levels import in_alphabetical_order, levels_of_ratings, names_levels
from .._validation import drop_missing
from ..ratings import RatingTable
from ._hdf5 import read_start
from ._rated import ADJECTIVES, LEVELS, Rated, object_ids

_COLUMNS = ("rater", "adjective", "rating")
_MISSING = {"", "NA", "NaN"}  # as pandas or polars, R and MATLAB write them


def read_csv(path):
    """Read the columns of answers from a CSV file, as text; NA becomes None.

    A FileNotFoundError is raised if there is no file, a ValueError if it is not text in
    UTF-8 with as many cells in each row, or lacks a column.
    """
    data = read_start(path, -1)
    try:
        rows = csv.reader(
            io.StringIO(data.decode("utf-8-sig"), newline=""), strict=True
        )
        names, *rows = [row for row in rows if row] or [[]]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(
            f"{path} is not a CSV file in UTF-8 ({error}); save it as one."
        ) from error
    columns = [_what_was_rated(names, path), *_COLUMNS]
    for i, row in enumerate(rows):
        if len(row) != len(names):
            raise ValueError(
                f"{path} has {len(row)} cells in row {i}, but {len(names)} columns; "
                "separate cells by commas, and quote text that has commas."
            )
    places = [names.index(column) for column in columns]
    cells = [[None if row[i] in _MISSING else row[i] for i in places] for row in rows]
    return pd.DataFrame(cells, columns=columns, dtype=object)


def count_answers(table, source):
    """Count the answers of a table with one row per answer.

    A DataFrame of pandas or polars has the columns "object" or "trial", "rater",
    "adjective" and "rating"; `source` is what error messages call it. A ValueError says
    that a column, an id, a rater or an adjective is missing, that a rating is not among
    the levels, or that somebody answered twice.
    """
    by = _what_was_rated([*table.columns], source)
    ids = _without_gaps(table, by, source)
    if by == "object":
        ids = object_ids(ids, source)
    raters = _without_gaps(table, "rater", source)
    adjectives = _without_gaps(table, "adjective", source)
    values, given = _values(table, "rating", source)
    levels, places = _levels_and_places(values, table["rating"], source)
    answers = pd.DataFrame({by: ids, "rater": raters, "adjective": adjectives})[given]
    answers = answers.assign(rating=places).reset_index(drop=True)
    _refuse_second_answers(answers, source)

    ids, adjectives = sorted(set(ids)), _in_order(set(adjectives))
    counts = np.zeros((len(ids), len(adjectives), len(levels)), dtype=np.int64)
    cell = (
        pd.Index(ids).get_indexer(answers[by]),
        pd.Index(adjectives).get_indexer(answers["adjective"]),
        places,
    )
    np.add.at(counts, cell, 1)
    return Rated(
        source, by, ids, adjectives, counts, levels, _wide(answers, adjectives, levels)
    )


def _what_was_rated(names, source):
    """Return which of "object" and "trial" is a column; refuse any other number."""
    what = [name for name in names if name in ("object", "trial")]
    if len(what) != 1 or any(names.count(name) != 1 for name in _COLUMNS):
        raise ValueError(
            f"{source} has the columns {names[:10]}; give one row per answer, with the "
            "columns 'rater', 'adjective', 'rating', and either 'object' or 'trial'."
        )
    return what[0]


def _values(table, column, source):
    """Return the values of a column that are not missing, and a mask of them."""
    values, given = drop_missing(table[column], f"The column {column!r} of {source}")
    for value in values.tolist():
        if not isinstance(value, Hashable):
            raise ValueError(
                f"{source} has the {column} {value!r}; give numbers or text."
            )
    return values, given


def _without_gaps(table, column, source):
    """Return the values of a column, none of which may be missing."""
    values, given = _values(table, column, source)
    if not given.all():
        raise ValueError(
            f"{source} names no {column} in row {np.argmin(given)}; name it or remove "
            "the row."
        )
    if column in ("trial", "adjective") and not isinstance(values[0], str):
        raise ValueError(
            f"{source} has the {column} {values.tolist()[0]!r}; name it by text."
        )
    return values.tolist()


def _levels_and_places(values, column, source):
    """Return the levels, and the place among them of each rating.

    The levels are the ordered categories of the column, or else 1 to 5.
    """
    values = values.tolist()
    if names_levels(column):
        levels = levels_of_ratings(np.array(values), column, None, source)
    else:
        levels, values = LEVELS.copy(), [_number(value) for value in values]
    place = {level: i for i, level in enumerate(levels.tolist())}
    for value in values:
        if value not in place:
            raise ValueError(
                f"{source} has the rating {value!r}, which is not among the levels "
                f"{levels.tolist()}; mend it, or make the column an ordered "
                "categorical of all levels, lowest first."
            )
    return levels, np.array([place[value] for value in values])


def _number(value):
    try:
        return str(value) if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        return value


def _refuse_second_answers(answers, source):
    *key, _ = answers.columns
    repeated = answers.duplicated(key)
    if repeated.any():
        first = answers.loc[repeated.idxmax(), key].to_dict()
        listing = ", ".join(f"{name} {value!r}" for name, value in first.items())
        raise ValueError(
            f"{source} has two ratings of {listing}; keep one, or tell the raters "
            "apart."
        )


def _in_order(adjectives):
    """Return those of PHAC-2 in its order, then others by the alphabet."""
    known = [name for name in ADJECTIVES if name in adjectives]
    return known + sorted(adjectives.difference(ADJECTIVES))


def _wide(answers, adjectives, levels):
    """Return one row per id and rater, one column per adjective."""
    by, rater, *_ = answers.columns
    wide = answers.pivot(index=[by, rater], columns="adjective", values="rating")
    wide = wide.reindex(columns=adjectives)
    if levels.dtype.kind in "biuf":
        table = {a: np.append(levels, np.nan)[_places(wide[a])] for a in wide}
    else:
        table = {
            a: pd.Categorical.from_codes(_places(wide[a]), levels, ordered=True)
            for a in wide
        }
    return pd.DataFrame(table, index=wide.index)


def _places(column):
    """Return whole numbers, -1 where one is missing."""
    return column.fillna(-1).to_numpy(dtype=np.int64)


def collect_counts(tables):
    """Collect counts given for each adjective.

    They are in a RatingTable, or in a DataFrame of pandas indexed by the ids of objects
    with one column per level. A ValueError says that a table does not say which objects
    or levels its counts are of, has an object twice, or has other levels than the
    others.
    """
    each = {name: _read_counts(table, name) for name, table in tables.items()}
    if not each:
        raise ValueError("ratings is an empty dict; give counts by adjective.")
    first, (_, levels, _) = next(iter(each.items()))
    for name, (_, others, _) in each.items():
        if others.tolist() != levels.tolist():
            raise ValueError(
                f"ratings[{name!r}] has the levels {others.tolist()}, but "
                f"ratings[{first!r}] has {levels.tolist()}; give all adjectives the "
                "same, for instance by rating_counts(..., levels=[1, 2, 3, 4, 5])."
            )
    ids = sorted(
        {each_id for table_ids, _, _ in each.values() for each_id in table_ids}
    )
    counts = np.zeros((len(ids), len(each), len(levels)))
    for i, (table_ids, _, values) in enumerate(each.values()):
        counts[pd.Index(ids).get_indexer(table_ids), i] = values
    if counts.max() < 2**63 and (counts % 1 == 0).all():
        counts = counts.astype(np.int64)
    return Rated("ratings", "object", ids, [*each], counts, levels, None)


def _read_counts(table, adjective):
    """Return the ids of objects, the levels, and counts (n_objects, n_levels)."""
    name = f"ratings[{adjective!r}]"
    if not isinstance(adjective, str):
        raise ValueError(f"{name} has no text for a key; name the adjective.")
    if isinstance(table, RatingTable):
        ids, levels, values = table.objects, table.levels, table.counts
    elif isinstance(table, pd.DataFrame) and not _is_default(table.index):
        ids, levels, values = table.index, None, table
        if in_alphabetical_order(table):
            raise ValueError(
                f"The columns of {name} are words in alphabetical order, which may "
                "not be that of the levels; make them an ordered "
                "pandas.CategoricalIndex."
            )
    else:
        raise ValueError(
            f"{name} does not say which objects its counts are of; give a RatingTable, "
            "or a pandas.DataFrame indexed by their ids with one column per level."
        )
    counts, levels = check_counts(values, levels, name=name)
    ids = object_ids(np.asarray(ids).tolist(), name)
    if len(ids) != len(counts) or len(set(ids)) < len(ids):
        raise ValueError(
            f"{name} has {len(counts)} rows for {len(set(ids))} objects; give one row "
            "per object."
        )
    return ids, levels, counts


def _is_default(index):
    return isinstance(index, pd.RangeIndex) and index.name is None and index.start == 0
