"""Ratings given by people: counts per level, inverse CDF, agreement, correlation.

People rate an object on an ordered scale, so an object's ratings are a table of
*counts*: how many people chose each level. Everything else follows from it.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import spearmanr
from sklearn.utils import Bunch
from sklearn.utils.validation import check_array, check_consistent_length, column_or_1d

from ._validation import _check_levels, check_numbers, check_ratings, check_regular


def rating_counts(
    ratings: ArrayLike, objects: ArrayLike, *, levels: ArrayLike | None = None
) -> Bunch:
    """Count how many people gave each object each rating.

    Parameters
    ----------
    ratings : array-like of shape (n_ratings,)
        One person's rating of one object each; None, NaN and NA are ratings that
        were not given and are left out. A column of a pandas or polars table will
        do.
    objects : array-like of shape (n_ratings,)
        The object that each rating is of.
    levels : array-like of shape (n_levels,), default=None
        The ordered levels; by default the sorted ratings that occur. Give them if
        a level may have been chosen by nobody.

    Returns
    -------
    result : :class:`~sklearn.utils.Bunch`
        With the attributes

        counts : ndarray of shape (n_objects, n_levels)
            Number of people who chose each level.
        objects : ndarray of shape (n_objects,)
            The object of each row, sorted.
        levels : ndarray of shape (n_levels,)
            The level of each column.

    Raises
    ------
    ValueError
        If ``ratings`` and ``objects`` differ in length, a rating is not among
        ``levels``, an object id is missing, or nobody rated an object.

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
    """
    check_consistent_length(ratings, objects)
    ratings, given = _drop_missing(ratings, "ratings")
    objects, named = _drop_missing(objects, "objects")
    if not named.all():
        raise ValueError(
            f"objects has no object for rating {np.argmin(named)}; name the object of "
            "every rating or remove the rating."
        )
    values, column = np.unique(ratings, return_inverse=True)
    levels = values if levels is None else _check_levels(levels)
    matches = values[:, None] == levels
    if not matches.any(axis=1).all():
        unknown = values[np.argmin(matches.any(axis=1))].item()
        raise ValueError(
            f"ratings has the rating {unknown!r}, which is not among "
            f"levels={levels.tolist()}; add it to levels or mend the rating."
        )
    objects, row = np.unique(objects, return_inverse=True)
    cell = row[given] * len(levels) + matches.argmax(axis=1)[column]
    counts = np.bincount(cell, minlength=len(objects) * len(levels))
    counts = counts.reshape(len(objects), len(levels))
    if not counts.any(axis=1).all():
        unrated = objects[np.argmin(counts.any(axis=1))].item()
        raise ValueError(
            f"Nobody rated the object {unrated!r}; remove its rows from ratings and "
            "objects."
        )
    return Bunch(counts=counts, objects=objects, levels=levels)


def inverse_cdf(
    counts: ArrayLike, p: ArrayLike, *, levels: ArrayLike | None = None
) -> np.ndarray:
    r"""Rating given by the person at position ``p`` of the population.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level; any non-negative weights or
        probabilities will do.
    p : float or array-like of shape (n_p,)
        Positions in the population, from 0 (lowest rating) to 1 (highest).
    levels : array-like of shape (n_levels,), default=None
        The ordered levels; by default 1, 2, …, n_levels.

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

    Cumulative counts are compared with :math:`pN`, never cumulative proportions
    with :math:`p`, and :math:`pN` is lowered by :math:`4 A` rounding errors
    (2.2e-16, for A levels), so that a double ``p = i / 100`` gives what the exact
    fraction would for up to 1e13 / A people. A level that nobody
    chose is never returned: ``p = 0`` gives the lowest level used, ``p = 1`` the
    highest.

    References
    ----------
    B. A. Richardson and K. J. Kuchenbecker, "Learning to predict perceptual
    distributions of haptic adjectives", Frontiers in Neurorobotics 13, 2020,
    section 2.3.1. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.ratings import inverse_cdf
    >>> inverse_cdf([[0, 3, 6, 3, 0]], [0, 0.25, 0.26, 0.75, 1])
    array([[2, 2, 3, 3, 4]])
    """
    counts, levels = _check_counts(counts, levels)
    check_numbers(p, "p")
    positions = column_or_1d(np.atleast_1d(p), dtype=np.float64, input_name="p")
    if not ((positions >= 0) & (positions <= 1)).all():
        raise ValueError("p must lie within [0, 1]; give positions in the population.")
    index = _level_index(counts, positions)
    return levels[index[:, 0] if np.ndim(p) == 0 else index]


def interrater_agreement(counts: ArrayLike) -> NDArray[np.float64]:
    r"""Agreement r_wg of the people who rated each object.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level, two or more people an object. Levels
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
    counts, levels = _check_counts(counts, None)
    n_ratings = counts.sum(axis=1)
    if (n_ratings < 2).any():
        raise ValueError(
            f"counts has fewer than two ratings in row {np.argmax(n_ratings < 2)}; "
            "agreement needs two people or more, so remove that object."
        )
    deviation = levels - (counts @ levels / n_ratings)[:, None]
    variance = (counts * deviation**2).sum(axis=1) / (n_ratings - 1)
    return 1 - variance / ((len(levels) ** 2 - 1) / 12)


def adjective_correlation(ratings: ArrayLike) -> Bunch:
    """Rank correlation of the ratings of every pair of adjectives.

    Parameters
    ----------
    ratings : array-like of shape (n_ratings, n_adjectives)
        One person's ratings of one object a row, an adjective a column; the
        columns of a DataFrame name the adjectives.

    Returns
    -------
    result : :class:`~sklearn.utils.Bunch`
        With the attributes

        rho : ndarray of shape (n_adjectives, n_adjectives)
            Spearman's rank correlation: positive for synonyms, negative for
            antonyms.
        pvalue : ndarray of shape (n_adjectives, n_adjectives)
            Two-sided p-values of the hypothesis of no correlation, not corrected
            for the number of pairs.
        names : ndarray of shape (n_adjectives,)
            The adjectives, ``x0``, ``x1``, … for an array.

    Raises
    ------
    ValueError
        If a rating is missing, there are fewer than two adjectives or three rows,
        or an adjective always has the same rating.

    References
    ----------
    C. Spearman, "The proof and measurement of association between two things",
    American Journal of Psychology 15(1), 72–101, 1904. :doi:`10.2307/1412159`

    Examples
    --------
    >>> from sklearn_haptic.ratings import adjective_correlation
    >>> result = adjective_correlation([[1, 5], [2, 4], [4, 3], [5, 1]])
    >>> result.rho
    array([[ 1., -1.],
           [-1.,  1.]])
    """
    names = getattr(ratings, "columns", None)
    check_numbers(ratings, "ratings")
    ratings = check_array(
        ratings,
        dtype=np.float64,
        ensure_min_samples=3,
        ensure_min_features=2,
        input_name="ratings",
    )
    if names is None:
        names = [f"x{i}" for i in range(ratings.shape[1])]
    constant = (ratings == ratings[0]).all(axis=0)
    if constant.any():
        raise ValueError(
            f"All ratings of {names[np.argmax(constant)]!r} are equal, so they have no "
            "rank correlation; leave that adjective out."
        )
    rho, pvalue = spearmanr(ratings)
    if np.ndim(rho) == 0:  # two columns give one number
        rho = np.array([[1.0, rho], [rho, 1.0]])
        pvalue = np.array([[0.0, pvalue], [pvalue, 0.0]])
    return Bunch(rho=rho, pvalue=pvalue, names=np.asarray(names, dtype=object))


def _level_index(counts, p):
    """Return the index of the level at each position of the population.

    Parameters
    ----------
    counts : ndarray of shape (n_objects, n_levels)
        Non-negative counts, weights or probabilities, not all zero in a row.
    p : float or ndarray broadcastable to (n_objects, n_p)
        Positions within [0, 1]: shared (n_p,) or a row an object (n_objects, n_p).

    Returns
    -------
    index : ndarray of shape (n_objects, n_p)
        Index of the level, from 0.
    """
    below = np.cumsum(counts, axis=1, dtype=np.float64)
    below = np.ldexp(below, -np.frexp(below[:, -1:])[1])  # totals in [1/2, 1)
    # A rank lowered by less than any real difference between ranks, yet by more
    # than the rounding of p, of p * N and of the sum; above 0, so that levels
    # below the lowest one used are passed over.
    tolerance = 4 * below.shape[1] * np.finfo(np.float64).eps
    rank = np.maximum(
        p * below[:, -1:] * (1 - tolerance), np.finfo(np.float64).smallest_subnormal
    )
    index = np.zeros(rank.shape, dtype=np.intp)
    for column in below.T[:-1]:
        index += column[:, None] < rank
    return index


def _check_counts(counts, levels):
    """Validate a table of counts, which unlike ratings is always two-dimensional."""
    check_numbers(counts, "counts")
    counts = check_array(
        counts, dtype=np.float64, ensure_min_features=2, input_name="counts"
    )
    return check_ratings(counts, levels, name="counts")


def _drop_missing(values, name):
    """Return the values of a column that are there, and where they are."""
    check_regular(values, name)
    if hasattr(values, "isna"):  # pandas, whose NA compares with nothing
        values = values.to_numpy(dtype=object, na_value=None)
    values = column_or_1d(np.asarray(values), dtype=None)
    given = np.array([value is not None and value == value for value in values])
    if not given.any():
        raise ValueError(f"{name} holds no values at all; at least one is required.")
    return np.array(values[given].tolist()), given
