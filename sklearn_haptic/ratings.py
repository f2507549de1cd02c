"""Ratings given by people: counts per level, CDFs, agreement, correlation.

People rate an object on an ordered scale, so the ratings of objects are a table of
*counts*: how many people chose each level. Everything else follows from counts. The
columns of a labelled table are put in the order of the levels.
"""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import spearmanr
from sklearn.utils import Bunch
from sklearn.utils.validation import check_array, check_consistent_length

from ._check_ratings import check_counts, check_two_ratings, match_levels
from ._distributions import cdf, level_at, shares
from ._levels import level_values, levels_of_ratings, names_levels
from ._sklearn import Interval, validate_params
from ._validation import (
    check_numbers,
    check_objects,
    check_positions,
    drop_missing,
    missing_to_none,
    rows_of_objects,
)

__all__ = [
    "RatingTable",
    "adjective_correlation",
    "interrater_agreement",
    "inverse_cdf",
    "outlying_raters",
    "rating_cdf",
    "rating_counts",
    "rating_distribution",
    "rating_mean",
]


# A row of `adjective_correlation(ratings).pairs`.
_PAIR = [
    *((field, object) for field in ("first", "second")),
    *((field, np.float64) for field in ("rho", "pvalue", "pvalue_holm")),
    *(("relation", "U8"), ("n_ratings", np.int64)),
]


@dataclass(frozen=True, eq=False)
class RatingTable:
    """How many people gave each object each rating; made by `rating_counts`.

    Parameters
    ----------
    counts : ndarray of shape (n_objects, n_levels)
        Number of people who chose each level.
    objects : ndarray of shape (n_objects,)
        The object of each row, sorted.
    levels : ndarray of shape (n_levels,)
        The level of each column. Give them to a model as its ``levels``, unless they
        are 1, 2, …, n_levels.
    raters : ndarray of shape (n_raters,), default=None
        The people, sorted, if they are known.
    answers : ndarray of int of shape (n_ratings, 3), default=None
        One row per rating, as indices into ``objects``, ``raters`` and ``levels``;
        sorted.

    Examples
    --------
    >>> from sklearn_haptic.ratings import rating_counts
    >>> table = rating_counts([1, 2, 2], ["foam", "foam", "tile"])
    >>> table.counts_for(["tile", "foam", "foam"])
    array([[0, 1],
           [1, 1],
           [1, 1]])
    """

    counts: NDArray[np.int64]
    objects: np.ndarray
    levels: np.ndarray
    raters: np.ndarray | None = None
    answers: NDArray[np.intp] | None = None

    @classmethod
    def from_long(
        cls,
        frame: Any,
        *,
        object: str = "object",
        rater: str = "rater",
        rating: str = "rating",
        levels: ArrayLike | None = None,
    ) -> Self:
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
        array([[1, 0, 1],
               [0, 1, 0]])
        """
        objects, raters, ratings = (
            _column(frame, name) for name in (object, rater, rating)
        )
        return cls(**vars(rating_counts(ratings, objects, raters, levels=levels)))

    @classmethod
    def from_wide(
        cls,
        frame: Any,
        *,
        object: str = "object",
        levels: ArrayLike | None = None,
    ) -> Self:
        """Count the ratings of a table with one row per object, one column per rater.

        Parameters
        ----------
        frame : DataFrame of pandas or polars
            All columns but one hold the ratings of the person that they are named by,
            missing where this person did not rate the object.
        object : str, default="object"
            Name of the column that says what was rated: objects, or single trials.
        levels : array-like of shape (n_levels,), default=None
            The ordered levels; by default the categories of the first rater's column
            if they are ordered, else the sorted ratings that occur.

        Returns
        -------
        table : RatingTable

        Raises
        ------
        ValueError
            If the column of objects is missing, an object has two rows or no rating, or
            a rating is not among the levels.

        Examples
        --------
        >>> import pandas as pd
        >>> from sklearn_haptic.ratings import RatingTable
        >>> frame = pd.DataFrame(
        ...     {"object": ["foam", "tile"], "Ann": [1, 2], "Bo": [3, None]}
        ... )
        >>> RatingTable.from_wide(frame).counts
        array([[1, 0, 1],
               [0, 1, 0]])
        """
        objects = check_objects(_column(frame, object))
        raters = [name for name in frame.columns if name != object]
        if not raters:
            raise ValueError(
                f"The table has no column but {object!r}; give one per rater."
            )
        columns = [_column(frame, name) for name in raters]
        if levels is None and names_levels(columns[0]):
            levels = levels_of_ratings(np.array([]), columns[0], None, "ratings")
        table = rating_counts(
            np.concatenate([missing_to_none(column, "ratings") for column in columns]),
            np.tile(objects, len(raters)),
            np.repeat(raters, len(objects)),
            levels=levels,
        )
        return cls(**vars(table))

    def counts_for(self, objects: ArrayLike) -> NDArray[np.int64]:
        """Return the counts of the object of each trial.

        Parameters
        ----------
        objects : array-like of shape (n_trials,)
            The object of each trial, by the ids of ``self.objects``.

        Returns
        -------
        counts : ndarray of shape (n_trials, n_levels)
            Row by row the counts of ``objects``.

        Raises
        ------
        ValueError
            If an object is missing or has no ratings in this table.
        """
        return self.counts[rows_of_objects(objects, self.objects)]


def _column(frame, name):
    """Return a column of a table of pandas or polars, of which there must be one."""
    columns = [*getattr(frame, "columns", ())]
    if columns.count(name) != 1:
        raise ValueError(
            f"The table has {columns.count(name)} columns {name!r} among "
            f"{columns[:10]}; give a DataFrame that has one, or the column's own name."
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
    array([[1, 2, 0, 0, 0],
           [0, 0, 2, 0, 0]])
    >>> table.objects
    array(['foam', 'tile'], dtype='<U4')

    To give a model the counts of each trial's object:

    >>> table.counts_for(["tile", "tile", "foam"])
    array([[0, 0, 2, 0, 0],
           [0, 0, 2, 0, 0],
           [1, 2, 0, 0, 0]])
    """
    check_consistent_length(ratings, objects)
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
    twice = (np.diff(answers[:, :2], axis=0) == 0).all(axis=1)
    if twice.any():
        which, who = answers[np.argmax(twice), :2]
        raise ValueError(
            f"ratings has two of the object {objects.tolist()[which]!r} by the rater "
            f"{raters.tolist()[who]!r}; keep one, or tell the raters apart."
        )
    return RatingTable(counts, objects, levels, raters, answers)


def _check_raters(raters):
    raters, named = drop_missing(raters, "raters")
    if not named.all():
        raise ValueError(
            f"raters names nobody in row {np.argmin(named)}; name the rater of every "
            "row, or remove the row."
        )
    return raters


def rating_distribution(counts: ArrayLike) -> NDArray[np.float64]:
    """Share of the people who gave each object each rating.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level; any non-negative weights will do.

    Returns
    -------
    proba : ndarray of shape (n_objects, n_levels)
        Proportions, which sum to 1 in each row.

    Raises
    ------
    ValueError
        If the counts are negative, not finite or all zero for an object.

    Examples
    --------
    >>> from sklearn_haptic.ratings import rating_distribution
    >>> rating_distribution([[0, 3, 6, 3, 0]])
    array([[0.  , 0.25, 0.5 , 0.25, 0.  ]])
    """
    counts, _ = check_counts(counts)
    return shares(counts)


def rating_cdf(counts: ArrayLike) -> NDArray[np.float64]:
    """Share of the people who rated each object at each level or below.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level; any non-negative weights will do.

    Returns
    -------
    cdf : ndarray of shape (n_objects, n_levels)
        Cumulative distribution function at each level, exactly 1 from the highest
        level used. For counts each entry is the double nearest to the fraction.

    Raises
    ------
    ValueError
        If the counts are negative, not finite or all zero for an object.

    See Also
    --------
    inverse_cdf : The level at each quantile position.

    Examples
    --------
    >>> from sklearn_haptic.ratings import rating_cdf
    >>> rating_cdf([[0, 3, 6, 3, 0]])
    array([[0.  , 0.25, 0.75, 1.  , 1.  ]])
    """
    counts, _ = check_counts(counts)
    return cdf(counts)


def inverse_cdf(
    counts: ArrayLike, p: ArrayLike, *, levels: ArrayLike | None = None
) -> np.ndarray:
    r"""Rating at quantile position ``p`` of the population of raters.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level; any non-negative weights or
        probabilities will do.
    p : float or array-like of shape (n_p,)
        Quantile positions, from 0 (lowest rating) to 1 (highest).
    levels : array-like of shape (n_levels,), default=None
        The ordered levels; by default the labels of the columns, else 1, 2, ….

    Returns
    -------
    ratings : ndarray of shape (n_objects, n_p), or (n_objects,) for a scalar p
        The levels at ``p``.

    Raises
    ------
    ValueError
        If ``p`` lies outside [0, 1], or the counts are negative, not finite or
        all zero for an object.

    Notes
    -----
    With :math:`n_k` people at level k of :math:`N` people in all,

    .. math:: F^{-1}(p) = \min\{k : n_k > 0,\; n_1 + \dots + n_k \ge p N\}.

    Cumulative counts are compared with :math:`pN`, not cumulative proportions with
    :math:`p`, and :math:`pN` is lowered by :math:`4 A` rounding errors (2.2e-16 each,
    for A levels). A double ``p = i / 100`` therefore gives what the exact fraction
    would, for up to 1e13 / A people. A level that nobody chose is never returned:
    ``p = 0`` gives the lowest level used, ``p = 1`` the highest.

    References
    ----------
    Richardson and Kuchenbecker (2020), section 2.3.1. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.ratings import inverse_cdf
    >>> inverse_cdf([[0, 3, 6, 3, 0]], [0, 0.25, 0.26, 0.75, 1])
    array([[2, 2, 3, 3, 4]])
    """
    counts, levels = check_counts(counts, levels)
    p = check_positions(p)
    index = level_at(counts, np.atleast_1d(p))
    return levels[index if p.ndim else index[:, 0]]


def rating_mean(
    counts: ArrayLike, *, levels: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Mean rating of each object, in units of the scale.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level; any non-negative weights or probabilities
        will do, so also what a model predicts.
    levels : array-like of shape (n_levels,), default=None
        The ordered levels, which must be numbers; by default the labels of the
        columns, else 1, 2, ….

    Returns
    -------
    mean : ndarray of shape (n_objects,)

    Raises
    ------
    ValueError
        If the levels are no ascending numbers, or the counts are negative, not finite
        or all zero for an object.

    See Also
    --------
    inverse_cdf : The median, ``p=0.5``, and all other quantiles.

    Examples
    --------
    >>> from sklearn_haptic.ratings import rating_mean
    >>> rating_mean([[0, 1, 3], [2, 0, 2]], levels=[-3, 0, 3])
    array([2.25, 0.  ])
    """
    counts, levels = check_counts(counts, levels)
    return shares(counts) @ level_values(levels)


def interrater_agreement(counts: ArrayLike) -> NDArray[np.float64]:
    r"""Agreement r_wg of the people who rated each object.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level, two or more people per object. Levels
        count as equally far apart.

    Returns
    -------
    r_wg : ndarray of shape (n_objects,)
        1 where all chose the same level, 0 where the ratings scatter as if drawn
        uniformly from the levels, negative where they scatter more. Negative
        values are kept.

    Raises
    ------
    ValueError
        If an object has fewer than two ratings, or the counts are negative or not
        finite.

    Notes
    -----
    With the sample variance :math:`S_X^2` of an object's ratings (divisor
    :math:`N - 1`, so that uniformly random ratings average to zero) and
    :math:`A` levels,

    .. math:: r_{wg} = 1 - \frac{S_X^2}{(A^2 - 1) / 12}.

    References
    ----------
    L. R. James, R. G. Demaree and G. Wolf, "Estimating within-group interrater
    reliability with and without response bias", Journal of Applied Psychology
    69(1), 85–98, 1984. :doi:`10.1037/0021-9010.69.1.85`

    T. A. O'Neill, "An overview of interrater agreement on Likert scales for
    researchers and practitioners", Frontiers in Psychology 8, 2017.
    :doi:`10.3389/fpsyg.2017.00777`

    Examples
    --------
    >>> from sklearn_haptic.ratings import interrater_agreement
    >>> interrater_agreement([[0, 0, 12, 0, 0], [6, 0, 0, 0, 6]]).round(3)
    array([ 1.   , -1.182])
    """
    counts, _ = check_counts(counts)
    check_two_ratings(counts, "counts")
    levels = np.arange(1, counts.shape[1] + 1)
    n_ratings = counts.sum(axis=1)
    deviation = levels - (counts @ levels / n_ratings)[:, None]
    variance = (counts * deviation**2).sum(axis=1) / (n_ratings - 1)
    return 1 - variance / ((len(levels) ** 2 - 1) / 12)


@validate_params(
    {
        "alpha": [Interval(Real, 0, 1, closed="neither")],
        "threshold": [Interval(Real, 0, 1, closed="both")],
    },
    prefer_skip_nested_validation=True,
)
def adjective_correlation(
    ratings: ArrayLike, *, alpha: float = 0.05, threshold: float = 0.5
) -> Bunch:
    r"""Rank correlation of the ratings of every pair of adjectives.

    Two adjectives are called synonyms or antonyms if their correlation is both
    significant and strong.

    Parameters
    ----------
    ratings : array-like of shape (n_ratings, n_adjectives)
        One row per person and object, one column per adjective; the columns of a
        pandas or polars table name the adjectives. Missing ratings are None, NaN or
        NA; a pair is correlated over the rows that have both.
    alpha : float, default=0.05
        Probability of calling any pair of uncorrelated adjectives significant.
    threshold : float, default=0.5
        Least :math:`|\rho|` of synonyms and antonyms. From .5 a correlation is
        called large, from .3 medium [2]_.

    Returns
    -------
    result : :class:`~sklearn.utils.Bunch`
        With the attributes

        rho : ndarray of shape (n_adjectives, n_adjectives)
            Spearman's rank correlation.
        pvalue : ndarray of shape (n_adjectives, n_adjectives)
            Two-sided p-values of the hypothesis of no correlation, as
            :func:`scipy.stats.spearmanr` gives them.
        pvalue_holm : ndarray of shape (n_adjectives, n_adjectives)
            The same, corrected for the number of pairs by Holm's method [3]_.
        relation : ndarray of shape (n_adjectives, n_adjectives)
            1 for synonyms, -1 for antonyms, else 0: the sign of ``rho`` where
            ``pvalue_holm <= alpha`` and ``abs(rho) >= threshold``.
        n_ratings : ndarray of shape (n_adjectives, n_adjectives)
            How many rows have both ratings.
        names : ndarray of shape (n_adjectives,)
            The adjectives, ``x0``, ``x1``, … for an array.
        pairs : structured ndarray of shape (n_pairs,)
            The pairs, strongest first, with the fields ``first``, ``second``,
            ``rho``, ``pvalue``, ``pvalue_holm``, ``relation`` and ``n_ratings``;
            ``pandas.DataFrame(result.pairs)`` is a table of them.

    Raises
    ------
    ValueError
        If there are fewer than two adjectives or three rows, fewer than three rows
        have both ratings of a pair, or all of these rate an adjective the same.

    Notes
    -----
    The p-values hold for independent rows. Ratings by one person, or of one object,
    are not independent: what they share counts many times. The p-values are then too
    small, and the strength says more than the significance. They are also approximate:
    a few rows in perfect order have a p-value of 0. A correlation depends on which
    objects were rated: two adjectives are synonyms for these objects, not in the
    language.

    In the paper [4]_ hard–soft (−.71) and rough–smooth (−.64) are antonyms and
    moldable–springy (.70) are synonyms, as by the default threshold; cold–warm
    (−.30), there weak antonyms, would need a lower one.

    References
    ----------
    .. [1] C. Spearman, "The proof and measurement of association between two things",
       American Journal of Psychology 15(1), 72–101, 1904. :doi:`10.2307/1412159`
    .. [2] J. Cohen, "A power primer", Psychological Bulletin 112(1), 155–159, 1992.
       :doi:`10.1037/0033-2909.112.1.155`
    .. [3] S. Holm, "A simple sequentially rejective multiple test procedure",
       Scandinavian Journal of Statistics 6(2), 65–70, 1979.
    .. [4] Richardson and Kuchenbecker (2020), section 3.1.
       :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.ratings import adjective_correlation
    >>> result = adjective_correlation([[1, 5], [2, 4], [4, 3], [5, 1], [3, None]])
    >>> result.rho
    array([[ 1., -1.],
           [-1.,  1.]])
    >>> result.n_ratings
    array([[5, 4],
           [4, 4]])
    >>> result.pairs[["first", "second", "relation"]].tolist()
    [('x0', 'x1', 'antonyms')]
    """
    names = getattr(ratings, "columns", None)
    ratings = _check_answers(ratings, ensure_min_samples=3, ensure_min_features=2)
    n_adjectives = ratings.shape[1]
    if names is None:
        names = [f"x{i}" for i in range(n_adjectives)]
    names = np.asarray(names, dtype=object)

    first, second = np.triu_indices(n_adjectives, k=1)
    rho, pvalue = np.transpose(
        [_spearman(ratings[:, pair], names[pair]) for pair in np.c_[first, second]]
    )
    pvalue_holm = _holm(pvalue)
    relation = np.where(
        (pvalue_holm <= alpha) & (np.abs(rho) >= threshold), np.sign(rho), 0
    ).astype(np.int64)
    given = ~np.isnan(ratings)
    n_ratings = given.T.astype(np.int64) @ given

    def matrix(values, diagonal):
        square = np.diag(np.full(n_adjectives, diagonal, dtype=values.dtype))
        square[first, second] = square[second, first] = values
        return square

    words = np.array(["neither", "synonyms", "antonyms"])  # the last has index -1
    columns = [
        *(names[first], names[second], rho, pvalue, pvalue_holm, words[relation]),
        n_ratings[first, second],
    ]
    pairs = np.array([*zip(*columns, strict=True)], dtype=_PAIR)
    return Bunch(
        rho=matrix(rho, 1),
        pvalue=matrix(pvalue, 0),
        pvalue_holm=matrix(pvalue_holm, 0),
        relation=matrix(relation, 0),
        n_ratings=n_ratings,
        names=names,
        pairs=pairs[np.argsort(-np.abs(rho), kind="stable")],
    )


def _check_answers(ratings, **least):
    """Validate a table of single ratings; return it as float64, NaN where missing."""
    with np.errstate(invalid="ignore"):  # of missing categories, cast by pandas
        check_numbers(ratings, "ratings")
    return check_array(
        missing_to_none(ratings, "ratings"),
        dtype=np.float64,
        ensure_all_finite="allow-nan",
        input_name="ratings",
        **least,
    )


def _spearman(ratings, names):
    """Return the rank correlation and p-value of two columns, NaN where missing."""
    both = ratings[~np.isnan(ratings).any(axis=1)]
    if len(both) < 3:
        raise ValueError(
            f"ratings has {len(both)} rows with both {names[0]!r} and {names[1]!r}; a "
            "rank correlation needs three or more, so leave one of the two out."
        )
    constant = (both == both[0]).all(axis=0)
    if constant.any():
        one, other = names if constant[0] else names[::-1]
        raise ValueError(
            f"All ratings of {one!r} in the rows that have {other!r} too are equal, so "
            "there is no rank correlation; leave one of the two out."
        )
    return spearmanr(*both.T)


def _holm(pvalue):
    """Return p-values corrected for their number by Holm's method."""
    order = np.argsort(pvalue)
    corrected = np.empty_like(pvalue)
    corrected[order] = np.maximum.accumulate(
        pvalue[order] * np.arange(len(pvalue), 0, -1)
    )
    return np.minimum(corrected, 1)


@validate_params(
    {"limit": [Interval(Real, 0, None, closed="neither")]},
    prefer_skip_nested_validation=True,
)
def outlying_raters(
    ratings: ArrayLike,
    objects: ArrayLike,
    raters: ArrayLike,
    *,
    limit: float = 3.5,
) -> Bunch:
    """Find people whose ratings lie further from other people's than is usual.

    A rating is as far from the others of its object as the earth mover's distance says,
    which is its mean absolute difference to them. A person who answers at random, or
    turns the scale round, is further from the others on average, over all objects and
    adjectives, than people are who merely disagree.

    Parameters
    ----------
    ratings : array-like of shape (n_ratings, n_adjectives)
        One row per person and object, one column per adjective: numbers. Missing
        ratings are None, NaN or NA.
    objects : array-like of shape (n_ratings,)
        The object that each row is about.
    raters : array-like of shape (n_ratings,)
        The person who gave each row.
    limit : float, default=3.5
        Robust standard score beyond which a person is called outlying [1]_.

    Returns
    -------
    result : :class:`~sklearn.utils.Bunch`
        With the attributes

        raters : ndarray of shape (n_raters,)
            The people, sorted.
        distance : ndarray of shape (n_raters,)
            Mean distance of a person's ratings to those of others, in levels, beyond
            the mean distance of all ratings of the same object and adjective; NaN for
            people whose objects nobody else rated.
        score : ndarray of shape (n_raters,)
            The same as a robust standard score: less the median, in units of 1.4826
            times the median absolute deviation.
        outlying : ndarray of bool of shape (n_raters,)
            Whether the score is above the limit.

    Raises
    ------
    ValueError
        If the arguments differ in length, an object or a rater is missing, a rating
        is not a number, or no object has ratings of two people.

    Notes
    -----
    Leave out people, not single ratings: the ratings that lie furthest from others are
    mostly honest, and without them predicted distributions are too narrow. The scores
    compare people who rated about equally many objects; a few ratings are far from the
    others by chance more often than many.

    References
    ----------
    .. [1] B. Iglewicz and D. C. Hoaglin, "How to detect and handle outliers", ASQC
       Quality Press, 1993.

    Examples
    --------
    The second of twelve people turns the scale round.

    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> from sklearn_haptic.ratings import outlying_raters
    >>> corpus = make_haptic_corpus(20, 1, sensors=["tdc"], random_state=0)
    >>> long = corpus.rater_ratings.reset_index()
    >>> answers = long[list(corpus.ratings)]
    >>> answers = answers.where(long["rater"] != 2, 6 - answers)
    >>> result = outlying_raters(answers, long["object"], long["rater"])
    >>> result.raters[result.outlying]
    array([2])
    """
    answers = _check_answers(ratings)
    check_consistent_length(answers, objects, raters)
    _, of_object = np.unique(check_objects(objects), return_inverse=True)
    people, of_rater = np.unique(
        check_objects(raters, name="raters"), return_inverse=True
    )
    total, number = np.zeros((2, len(people)))
    for answer in answers.T:
        row, beyond = _beyond_others(answer, of_object)
        total += np.bincount(of_rater[row], beyond, minlength=len(people))
        number += np.bincount(of_rater[row], minlength=len(people))
    if not number.any():
        raise ValueError(
            "ratings has no object that two people rated on the same adjective, so "
            "nobody can be compared; give the ratings of all people."
        )
    distance = np.divide(total, number, np.full(len(people), np.nan), where=number > 0)
    centred = distance - np.nanmedian(distance)
    unit = 1.4826 * np.nanmedian(np.abs(centred))
    with np.errstate(divide="ignore"):  # people who differ from many who are all equal
        score = np.divide(centred, unit, np.zeros(len(people)), where=centred != 0)
    return Bunch(raters=people, distance=distance, score=score, outlying=score > limit)


def _beyond_others(answer, of_object):
    """Return how much further each answer is from the others of its object than all.

    Parameters
    ----------
    answer : ndarray of shape (n_ratings,)
        NaN where missing.
    of_object : ndarray of int of shape (n_ratings,)

    Returns
    -------
    row : ndarray of int
        The rows of answers that have others of their object.
    beyond : ndarray of the same shape
        Their mean absolute difference to the others, less its mean over the object.
    """
    row = np.lexsort((answer, of_object))
    row = row[~np.isnan(answer[row])]
    _, first, which, number = np.unique(
        of_object[row], return_index=True, return_inverse=True, return_counts=True
    )
    value, n = answer[row], number[which]
    rank = np.arange(len(row)) - first[which]
    below = np.cumsum(value) - value  # sum of all answers before this one
    below -= below[first][which]
    of_all = np.bincount(which, value)[which]
    # To those below: value * rank - below; to those above, likewise.
    apart = value * (2 * rank - n) + of_all - 2 * below
    several = n > 1
    apart = apart[several] / (n[several] - 1)
    which = which[several]
    mean = np.bincount(which, apart) / np.maximum(np.bincount(which), 1)
    return row[several], apart - mean[which]
