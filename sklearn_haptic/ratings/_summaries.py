"""What counts say of each object: shares, CDF, inverse CDF, mean and agreement."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from ..utils._validation import check_positions
from ._checks import check_counts, check_two_ratings
from ._distributions import cdf, level_at, shares
from ._levels import labelled_as, level_values


def rating_distribution(
    counts: ArrayLike,
) -> NDArray[np.float64] | pd.DataFrame:
    """Share of the people who gave each object each rating.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level; any non-negative weights will do.

    Returns
    -------
    proba : ndarray or DataFrame of shape (n_objects, n_levels)
        Proportions, which sum to 1 in each row. If the columns of counts are labelled,
        those of the DataFrame are the levels, the lowest first.

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
    values, levels = check_counts(counts)
    return labelled_as(counts, shares(values), levels)


def rating_cdf(counts: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
    """Share of the people who rated each object at each level or below.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level; any non-negative weights will do.

    Returns
    -------
    cdf : ndarray or DataFrame of shape (n_objects, n_levels)
        Cumulative distribution function at each level, exactly 1 from the highest
        level used. For counts each entry is the double nearest to the fraction. Labels
        are those of :func:`rating_distribution`.

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
    values, levels = check_counts(counts)
    return labelled_as(counts, cdf(values), levels)


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

    Warns
    -----
    UserWarning
        If most rows sum to 100, as percentages do.

    Raises
    ------
    ValueError
        If an object has fewer than two ratings, rows are shares of people, or the
        counts are negative or not finite.

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
