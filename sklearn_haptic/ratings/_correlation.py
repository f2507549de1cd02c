"""Correlation of the ratings of adjectives: synonyms and antonyms."""

from __future__ import annotations

from numbers import Real

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.special import factorial
from scipy.stats import spearmanr
from sklearn.utils import Bunch

from ..utils._sklearn import Interval, validate_params
from ._checks import check_single_ratings

_RELATIONS = np.array(["neither", "synonyms", "antonyms"])  # the last has index -1


@validate_params(
    {
        "significance": [Interval(Real, 0, 1, closed="neither")],
        "threshold": [Interval(Real, 0, 1, closed="both")],
    },
    prefer_skip_nested_validation=True,
)
def adjective_correlation(
    ratings: ArrayLike, *, significance: float = 0.05, threshold: float = 0.5
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
    significance : float, default=0.05
        Probability of calling any pair of uncorrelated adjectives significant.
    threshold : float, default=0.5
        Least :math:`|\rho|` of synonyms and antonyms. From .5 a correlation is
        called large, from .3 medium [2]_.

    Returns
    -------
    result : :class:`~sklearn.utils.Bunch`
        With the attributes

        rho : DataFrame of shape (n_adjectives, n_adjectives)
            Spearman's rank correlation, labelled by the adjectives: ``x0``, ``x1``, …
            for an array.
        pvalue : DataFrame of shape (n_adjectives, n_adjectives)
            Two-sided p-values of the hypothesis of no correlation, as
            :func:`scipy.stats.spearmanr` gives them, but at least 2 / n! for n rows.
        pvalue_holm : DataFrame of shape (n_adjectives, n_adjectives)
            The same, corrected for the number of pairs by Holm's method [3]_.
        relation : DataFrame of shape (n_adjectives, n_adjectives)
            1 for synonyms, -1 for antonyms, else 0: the sign of ``rho`` where
            ``pvalue_holm <= significance`` and ``abs(rho) >= threshold``.
        n_ratings : DataFrame of shape (n_adjectives, n_adjectives)
            How many rows have both ratings.
        pairs : DataFrame of shape (n_pairs, 7)
            The pairs, strongest first, with the columns ``first``, ``second``,
            ``rho``, ``pvalue``, ``pvalue_holm``, ``relation`` and ``n_ratings``.

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
    of ten unrelated adjectives, a pair was significant in a tenth of the simulated
    studies with 7 to 20 rows, and in a twentieth with 30. A correlation depends on
    which objects were rated: two adjectives are synonyms for these objects, not in the
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
    >>> ratings = [[1, 7], [2, 6], [4, 4], [5, 3], [6, 2], [3, None]]
    >>> result = adjective_correlation(ratings)
    >>> result.rho
         x0   x1
    x0  1.0 -1.0
    x1 -1.0  1.0
    >>> result.pairs[["first", "second", "relation", "n_ratings"]]
      first second  relation  n_ratings
    0    x0     x1  antonyms          5
    """
    names = getattr(ratings, "columns", None)
    ratings = check_single_ratings(ratings, ensure_min_samples=3, ensure_min_features=2)
    n_adjectives = ratings.shape[1]
    if names is None:
        names = [f"x{i}" for i in range(n_adjectives)]
    names = pd.Index(names, dtype=object)

    first, second = np.triu_indices(n_adjectives, k=1)
    rho, pvalue = np.transpose(
        [_spearman(ratings[:, pair], names[pair]) for pair in np.c_[first, second]]
    )
    pvalue_holm = _holm(pvalue)
    relation = np.where(
        (pvalue_holm <= significance) & (np.abs(rho) >= threshold), np.sign(rho), 0
    ).astype(np.int64)
    given = ~np.isnan(ratings)
    n_ratings = given.T.astype(np.int64) @ given

    def matrix(values, diagonal):
        square = np.diag(np.full(n_adjectives, diagonal, dtype=values.dtype))
        square[first, second] = square[second, first] = values
        return pd.DataFrame(square, names, names)

    pairs = pd.DataFrame(
        {
            "first": names[first],
            "second": names[second],
            "rho": rho,
            "pvalue": pvalue,
            "pvalue_holm": pvalue_holm,
            "relation": _RELATIONS[relation],
            "n_ratings": n_ratings[first, second],
        }
    )
    order = np.argsort(-np.abs(rho), kind="stable")
    return Bunch(
        rho=matrix(rho, 1),
        pvalue=matrix(pvalue, 0),
        pvalue_holm=matrix(pvalue_holm, 0),
        relation=matrix(relation, 0),
        n_ratings=pd.DataFrame(n_ratings, names, names),
        pairs=pairs.iloc[order].reset_index(drop=True),
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
    rho, pvalue = spearmanr(*both.T)  # of few rows in one order 0, which it cannot be
    return rho, max(pvalue, 2 / factorial(len(both)))


def _holm(pvalue):
    """Return p-values corrected for their number by Holm's method."""
    order = np.argsort(pvalue)
    corrected = np.empty_like(pvalue)
    corrected[order] = np.maximum.accumulate(
        pvalue[order] * np.arange(len(pvalue), 0, -1)
    )
    return np.minimum(corrected, 1)
