"""Counts of the ratings of people per object and level, also drawn together."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_consistent_length

from ..utils._row_order import check_orders
from ..utils._sklearn import Interval, validate_params
from ..utils._validation import check_objects, count, drop_missing, rows_of_objects
from ._checks import check_counts, check_people, match_levels, refuse_second_ratings
from ._distributions import cdf, shares
from ._levels import as_columns, labelled_as

# Candidates for the strength, in people.
_STRENGTHS = np.r_[0, 2.0 ** np.arange(-3, 11, 0.5), np.inf]


@dataclass(frozen=True, eq=False, repr=False)
class RatingTable:
    """How many people gave each object each rating; made by `rating_counts`.

    Parameters
    ----------
    counts : DataFrame of shape (n_objects, n_levels)
        Number of people who chose each level. Rows are labelled with the objects, and
        columns with the levels, by which what takes counts knows them.
    objects : ndarray of shape (n_objects,)
        The object of each row, sorted.
    levels : ndarray of shape (n_levels,)
        The level of each column.
    raters : ndarray of shape (n_raters,), default=None
        The people, sorted, if they are known.
    answers : ndarray of int of shape (n_ratings, 3), default=None
        One row per rating, as indices into ``objects``, ``raters`` and ``levels``;
        sorted.

    Examples
    --------
    >>> from sklearn_haptic.ratings import rating_counts
    >>> table = rating_counts([1, 2, 2], ["foam", "foam", "tile"])
    >>> table
    RatingTable(3 ratings of 2 objects, levels 1 to 2)
    >>> table.counts_for(["tile", "foam", "foam"])
       1  2
    0  0  1
    1  1  1
    2  1  1
    """

    counts: pd.DataFrame
    objects: np.ndarray
    levels: np.ndarray
    raters: np.ndarray | None = None
    answers: NDArray[np.intp] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.counts, pd.DataFrame):
            labels = self.objects, as_columns(self.levels)
            object.__setattr__(self, "counts", pd.DataFrame(self.counts, *labels))

    def __repr__(self) -> str:
        text = f"{count(self.counts.to_numpy().sum(), 'ratings')} of "
        text += count(len(self.objects), "objects")
        if self.raters is not None:
            text += f" by {count(len(self.raters), 'raters')}"
        levels = self.levels.tolist()
        return f"RatingTable({text}, levels {levels[0]} to {levels[-1]})"

    @staticmethod
    def from_long(
        frame: Any,
        *,
        object: str = "object",
        rater: str = "rater",
        rating: str = "rating",
        levels: ArrayLike | None = None,
    ) -> RatingTable:
        """Count the ratings of a table with one row per rating.

        Parameters
        ----------
        frame : DataFrame of pandas or polars
            For instance ``pandas.read_csv("ratings.csv")`` or
            ``polars.read_parquet("ratings.parquet")``.
        object, rater, rating : str
            Names of the columns that say what was rated (objects, or single trials),
            by whom, and how.
        levels : array-like of shape (n_levels,), default=None
            The ordered levels, by default as in :func:`rating_counts`.

        Returns
        -------
        table : RatingTable

        Raises
        ------
        ValueError
            If a column, an object or a rater is missing, somebody rated an object
            twice, or a rating is not among the levels.

        Examples
        --------
        >>> import pandas as pd
        >>> from sklearn_haptic.ratings import RatingTable
        >>> frame = pd.DataFrame(
        ...     {"object": ["foam", "foam", "tile"], "rater": ["Ann", "Bo", "Ann"],
        ...      "rating": [1, 3, 2]}
        ... )
        >>> RatingTable.from_long(frame).counts
              1  2  3
        foam  1  0  1
        tile  0  1  0
        """
        objects, raters, ratings = (
            column_named(frame, name) for name in (object, rater, rating)
        )
        return rating_counts(ratings, objects, raters, levels=levels)

    def counts_for(self, objects: ArrayLike) -> pd.DataFrame:
        """Return the counts of the object of each trial.

        Parameters
        ----------
        objects : array-like of shape (n_trials,)
            The object of each trial, by the ids of ``self.objects``.

        Returns
        -------
        counts : DataFrame of shape (n_trials, n_levels)
            Row by row the counts of ``objects``. The columns are the levels, by which a
            model knows them. The index is that of ``objects``, if it has one.

        Raises
        ------
        ValueError
            If an object is missing or has no ratings in this table, or there is one
            level.
        """
        if len(self.levels) == 1:
            raise ValueError(
                f"All ratings are {self.levels.tolist()[0]!r}, and a table of one "
                "column would be taken for ratings; list all levels in levels=."
            )
        return pd.DataFrame(
            self.counts.to_numpy()[rows_of_objects(objects, self.objects)],
            index=objects.index if isinstance(objects, pd.Series) else None,
            columns=self.counts.columns,
        )


def column_named(frame, name):
    """Return a column of a table of pandas or polars."""
    columns = [*getattr(frame, "columns", ())]
    if name not in columns:
        raise ValueError(
            f"The table has no column {name!r}, only {columns[:10]}; rename the one "
            "that is meant."
        )
    return frame[name]


def rating_counts(
    ratings: ArrayLike,
    objects: ArrayLike,
    raters: ArrayLike | None = None,
    *,
    levels: ArrayLike | None = None,
) -> RatingTable:
    """Count how many people gave each object each rating.

    Parameters
    ----------
    ratings : array-like of shape (n_ratings,)
        Each entry is one person's rating of one object. None, NaN and NA mean that no
        rating was given; they are left out. A column of a pandas or polars table will
        do.
    objects : array-like of shape (n_ratings,)
        The object that each rating is of.
    raters : array-like of shape (n_ratings,), default=None
        The person whose rating each is. The table then knows them, and nobody may rate
        an object twice.
    levels : array-like of shape (n_levels,), default=None
        The ordered levels; by default the categories of an ordered categorical
        column of pandas or of an Enum of polars, else the sorted ratings that occur.
        Give them if nobody may have chosen some level.

    Returns
    -------
    table : RatingTable
        The counts of each object, with the objects and levels that they are of.

    Warns
    -----
    UserWarning
        If the ratings are words, and nothing tells their order.

    Raises
    ------
    ValueError
        If the columns differ in length, one mixes text with something else, a rating
        is not among ``levels``, an object or a rater is missing, nobody rated an
        object, or somebody did so twice.

    Examples
    --------
    >>> from sklearn_haptic.ratings import rating_counts
    >>> table = rating_counts(
    ...     [1, 2, 2, None, 3, 3], ["foam", "foam", "foam", "foam", "tile", "tile"],
    ...     levels=[1, 2, 3, 4, 5],
    ... )
    >>> table.counts
          1  2  3  4  5
    foam  1  2  0  0  0
    tile  0  0  2  0  0

    To give a model the counts of each trial's object:

    >>> table.counts_for(["tile", "tile", "foam"])
       1  2  3  4  5
    0  0  0  2  0  0
    1  0  0  2  0  0
    2  1  2  0  0  0
    """
    check_consistent_length(ratings, objects)
    check_orders(ratings=ratings, objects=objects, raters=raters)
    values, given = drop_missing(ratings, "ratings")
    objects = check_objects(objects)
    matches, levels = match_levels(
        values, ratings, levels, "ratings", row="row", rows=np.flatnonzero(given)
    )
    objects, row = np.unique(objects, return_inverse=True)
    level = matches.argmax(axis=1)
    cell = row[given] * len(levels) + level
    counts = np.bincount(cell, minlength=len(objects) * len(levels))
    counts = counts.reshape(len(objects), len(levels))
    if not counts.any(axis=1).all():
        unrated = objects[np.argmin(counts.any(axis=1))].item()
        raise ValueError(
            f"Nobody rated the object {unrated!r}; remove its rows from ratings and "
            "objects."
        )
    if raters is None:
        return RatingTable(counts, objects, levels)
    check_consistent_length(ratings, raters)
    raters = _check_raters(raters)[given]
    raters, rater = np.unique(raters, return_inverse=True)
    answers = np.column_stack((row[given], rater, level))
    answers = answers[np.lexsort(answers.T[::-1])]
    refuse_second_ratings(answers[:, 0], answers[:, 1], objects, raters)
    return RatingTable(counts, objects, levels, raters, answers)


def _check_raters(raters):
    raters, named = drop_missing(raters, "raters")
    if not named.all():
        raise ValueError(
            f"raters names nobody in row {np.argmin(named)}; name the rater of every "
            "row, or remove the row."
        )
    return raters


@validate_params(
    {
        "counts": ["array-like"],
        "strength": [Interval(Real, 0, np.inf, closed="both"), None],
    },
    prefer_skip_nested_validation=True,
)
def shrink_counts(
    counts: ArrayLike, strength: float | None = None
) -> NDArray[np.float64] | pd.DataFrame:
    r"""Draw the counts of each object towards the population of objects.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people gave each object each level; one row per object.
    strength : float, default=None
        Number of people that the population counts for, from 0 (counts stay as they
        are) to infinity (all objects are alike). By default each rating is predicted
        from the other ratings of its object and from the other objects, and the
        strength is chosen that has the lowest ranked probability score, every object
        counting equally.

    Returns
    -------
    counts : ndarray or DataFrame of shape (n_objects, n_levels)
        Shrunken counts, as many as before in each row, labelled as those of
        :func:`rating_distribution`.

    Raises
    ------
    ValueError
        If there are fewer than two objects, or rows are shares of people; or if no
        strength is given, and counts are not whole numbers or no object has two
        ratings, so that none can be left out.

    Warns
    -----
    UserWarning
        If most rows sum to 100, as percentages do.

    Notes
    -----
    With the counts :math:`n_k` of N people and the mean distribution :math:`\pi` of the
    other objects, the share at level k is
    :math:`(n_k + m \pi_k) / (N + m)` for the strength m: the mean of the posterior if
    objects have a Dirichlet prior of this mean and concentration.

    Examples
    --------
    >>> from sklearn_haptic.ratings import shrink_counts
    >>> shrink_counts([[2, 0, 0], [0, 1, 1], [0, 2, 0]], strength=1)
    array([[1.33333333, 0.5       , 0.16666667],
           [0.33333333, 1.        , 0.66666667],
           [0.33333333, 1.5       , 0.16666667]])
    """
    table = counts
    counts, levels = check_counts(table)
    check_people(counts, "counts")
    if strength is None:
        strength = _leave_one_out_strength(counts)
    n = counts.sum(axis=1, keepdims=True)
    drawn = 1.0 if np.isinf(strength) else strength / (n + strength)
    shrunken = (1 - drawn) * counts + drawn * n * _mean_of_others(counts)
    return labelled_as(table, shrunken, levels)


def _mean_of_others(counts):
    """Return the mean distribution of all other objects, for each object."""
    if len(counts) < 2:
        raise ValueError("counts has one object; shrinkage needs others beside it.")
    share = shares(counts)
    return np.maximum(share.sum(axis=0) - share, 0) / (len(share) - 1)


def _leave_one_out_strength(counts):
    """Choose the strength, in people, by which the others best predict each rating."""
    if (counts % 1 != 0).any():
        raise ValueError(
            "counts must be whole numbers of people, of whom one is left out at a time."
        )
    population = cdf(_mean_of_others(counts))[:, :-1]
    several = counts.sum(axis=1) >= 2
    if not several.any():
        raise ValueError(
            "counts has no object with two ratings, so that no strength can be chosen "
            "by leaving one out; have some objects rated again, or give strength."
        )
    counts, population = counts[several], population[several]
    n = counts.sum(axis=1, keepdims=True)
    below, share = np.cumsum(counts, axis=1)[:, :-1], cdf(counts)[:, :-1]

    def score(strength):
        kept = 0 if np.isinf(strength) else 1 / (n - 1 + strength)
        drawn = 1 - (n - 1) * kept
        of_lower = (below - 1) * kept + drawn * population  # a rating here or below
        of_higher = below * kept + drawn * population
        return (share * (of_lower - 1) ** 2 + (1 - share) * of_higher**2).sum()

    return float(_STRENGTHS[np.argmin([score(each) for each in _STRENGTHS])])
