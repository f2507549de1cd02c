"""People whose ratings agree less with other people's than is usual."""

from __future__ import annotations

from math import ceil
from numbers import Real

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils.validation import check_consistent_length

from ..utils._row_order import check_orders
from ..utils._sklearn import Interval, validate_params
from ..utils._validation import check_objects
from ._checks import check_single_ratings, refuse_second_ratings
from ._counts import RatingTable

# Differences smaller than this are of rounding.
_ROUNDING = 1e-9
_N_DRAWS = 2000  # of the reference distribution
_BLOCK = 10**6  # numbers drawn at once
_MOST_USUAL = 0.9  # correlation of people who differ by chance


@validate_params(
    {"significance": [Interval(Real, 0, 1, closed="neither")]},
    prefer_skip_nested_validation=True,
)
def outlying_raters(
    ratings: ArrayLike | RatingTable,
    objects: ArrayLike | None = None,
    raters: ArrayLike | None = None,
    *,
    significance: float = 0.05,
) -> pd.DataFrame:
    """Find people whose ratings agree less with other people's than is usual.

    A person's ratings of each adjective are standardised over the objects that others
    rated too, and so are those of everybody else, averaged object by object. Their
    correlation does not depend on whether somebody rates high or low, or uses much or
    little of the scale, unless answers are cut off at an end of it. A person who
    answers at random, or turns the scale round, has a lower one than people who merely
    disagree.

    Parameters
    ----------
    ratings : array-like of shape (n_ratings, n_adjectives), or RatingTable
        One row per person and object, one column per adjective: numbers. Missing
        ratings are None, NaN or NA. Or the ratings of one adjective, as a table that
        knows its raters; its levels that are words count by their place.
    objects : array-like of shape (n_ratings,), default=None
        The object that each row is about. Only a table goes without.
    raters : array-like of shape (n_ratings,), default=None
        The person who gave each row. Only a table goes without.
    significance : float, default=0.05
        Probability that anybody is called outlying if nobody is.

    Returns
    -------
    result : DataFrame
        One row per person, sorted, with the columns

        - ``agreement``, the correlation, over all objects and adjectives; NaN for
          people who share fewer than two objects with others, 0 for those who always
          answer alike;
        - ``score``, how far Fisher's transform of 0.9 times the agreement lies below
          the median of all people, in median absolute deviations, or half standard
          errors if these are larger; people who rated fewer objects may lie further
          below;
        - ``pvalue``, the probability that the lowest of as many people who all differ
          by chance lies as far below;
        - ``outlying``, whether this is at most the level of significance.

    Raises
    ------
    ValueError
        If the arguments differ in length, an object or a rater is missing or, in a
        table, not known, a rating is not a number, somebody rated an object twice, or
        nobody rated two objects that others rated too.

    Notes
    -----
    The p-values are those of scores of correlations that differ by chance, drawn with a
    fixed seed. In simulations at most one study in twenty has a false alarm, up to one
    in ten where ten adjectives go together or people slip, one in seven where people
    differ much in how surely they feel, two in five where they agree above 0.9 but for
    rare slips, and up to one in three where most answers are at one end of the scale,
    or three in five if people also put it more than a level apart. Who rated few
    objects can hardly be found: of people who answer at random about three adjectives,
    nearly all are found with twenty objects each, and one in three with five. They are
    compared with the others, so of three people nobody is found, and of four to six a
    third to two thirds.

    A rating counts by how far it is above or below the person's others, so people are
    compared fairly if their objects are alike: all of them, or dealt at random. Where
    panels rate different kinds of objects, look at each panel alone: in a simulation of
    two, of smooth and of rough objects, an honest person who rated both was called
    outlying in nine of ten studies.

    Leave out people, not single ratings: the ratings that lie furthest from others are
    mostly honest, and without them predicted distributions are too narrow.

    References
    ----------
    B. Iglewicz and D. C. Hoaglin, "How to detect and handle outliers", ASQC Quality
    Press, 1993.

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
    >>> result.index[result["outlying"]].tolist()
    [2]
    """
    if isinstance(ratings, RatingTable):
        ratings, objects, raters = _answers_of(ratings, objects, raters)
    if objects is None or raters is None:
        raise ValueError(
            "ratings do not say who gave them on which object; give objects and raters."
        )
    answers = check_single_ratings(ratings)
    check_consistent_length(answers, objects, raters)
    check_orders(ratings=ratings, objects=objects, raters=raters)
    objects, of_object = np.unique(check_objects(objects), return_inverse=True)
    people, of_rater = np.unique(
        check_objects(raters, name="raters"), return_inverse=True
    )
    for given in ~np.isnan(answers.T):
        refuse_second_ratings(of_object[given], of_rater[given], objects, people)
    together = [_products(column, of_object, of_rater) for column in answers.T]
    covariance, own, others, number, freedom = np.sum(together, axis=0)
    known = freedom > 0
    if not known.any():
        raise ValueError(
            "ratings has nobody who rated two objects that others rated too on the "
            "same adjective, so nobody can be compared; give the ratings of all people."
        )
    norm = np.sqrt(own * others)
    agreement = np.divide(covariance, norm, out=np.zeros(len(people)), where=norm > 0)
    agreement[~known] = np.nan
    score, pvalue = np.full((2, len(people)), np.nan)
    score[known] = _scores(agreement[known], number[known])
    usual = np.median(agreement[known])
    largest = _largest_of(usual, freedom[known], number[known])
    pvalue[known] = 1 - np.searchsorted(largest, score[known]) / _N_DRAWS
    return pd.DataFrame(
        {
            "agreement": agreement,
            "score": score,
            "pvalue": pvalue,
            "outlying": pvalue <= significance,
        },
        index=pd.Index(people, name="rater"),
    )


def _answers_of(table, objects, raters):
    """Return the ratings of a table as numbers, with their objects and raters."""
    if objects is not None or raters is not None:
        raise ValueError(
            "ratings is a RatingTable, which has objects and raters; leave both out."
        )
    if table.answers is None or table.raters is None:
        raise ValueError(
            "table does not know its raters; make it by rating_counts(ratings, "
            "objects, raters) or RatingTable.from_long."
        )
    row, rater, level = table.answers.T
    numeric = np.issubdtype(table.levels.dtype, np.number)
    values = table.levels if numeric else np.arange(len(table.levels))
    return values[level][:, None], table.objects[row], table.raters[rater]


def _products(answers, of_object, of_rater):
    """Add up products of each person's standardised ratings with the others' mean.

    Return their sum, the sums of squares of both factors, the number of objects that
    others rated too, and the degrees of freedom, each of shape (n_raters,).
    """
    given = ~np.isnan(answers)
    shared = np.bincount(of_object, given)[of_object] > 1
    row = np.flatnonzero(given & shared)
    rater, n_raters = of_rater[row], of_rater.max() + 1
    own = _standardised(answers[row], rater, n_raters)
    total = np.bincount(of_object[row], own)[of_object[row]]
    n_others = np.bincount(of_object[row])[of_object[row]] - 1
    others = _centred((total - own) / n_others, rater, n_raters)
    products = [own * others, own**2, others**2, np.ones(len(own))]
    *sums, number = [np.bincount(rater, each, minlength=n_raters) for each in products]
    return *sums, number, np.maximum(number - 1, 0)


def _centred(values, rater, n_raters):
    """Subtract the mean of each person's values."""
    n = np.bincount(rater, minlength=n_raters)
    total = np.bincount(rater, values, minlength=n_raters)
    return values - (total / np.maximum(n, 1))[rater]


def _standardised(values, rater, n_raters):
    """Give each person's values mean 0 and variance 1; values all alike become 0."""
    largest = np.full(n_raters, 1e-300)
    np.maximum.at(largest, rater, np.abs(values))
    values = _centred(values / largest[rater], rater, n_raters)
    n = np.bincount(rater, minlength=n_raters)
    variance = np.bincount(rater, values**2, minlength=n_raters) / np.maximum(n, 1)
    spread = np.sqrt(variance)[rater]
    return np.divide(
        values, spread, out=np.zeros(len(values)), where=spread > _ROUNDING
    )


def _scores(agreement, number):
    """Return how far people lie below the median, who are along the last axis.

    Where people nearly agree, a single answer would change Fisher's transform of the
    agreement much; that of nine tenths of it changes little.
    """
    transform = np.arctanh(0.9 * agreement)
    below = np.median(transform, axis=-1, keepdims=True) - transform
    below *= np.sqrt(number / number.max())
    below[np.abs(below) <= _ROUNDING] = 0
    unit = np.median(np.abs(below), axis=-1, keepdims=True)
    # Half a standard error at least: few objects or levels make equal agreements.
    return below / np.maximum(unit, 0.5 / np.sqrt(number.max()))


def _largest_of(usual, freedom, number):
    """Draw the largest score of people who differ by chance; return sorted draws.

    The agreements are drawn as correlations of normal deviates, with the usual
    correlation and each person's degrees of freedom. The scores are at least those of
    normal deviates as such, since people may differ by more than chance.
    """
    rng = np.random.default_rng(0)
    usual = np.clip(usual, 0, _MOST_USUAL)
    slope = usual / np.sqrt(1 - usual**2)
    largest = np.empty((_N_DRAWS, 2))
    for block in np.array_split(largest, ceil(_N_DRAWS * len(number) / _BLOCK)):
        size = len(block), len(number)
        along = slope * np.sqrt(2 * rng.standard_gamma(freedom / 2, size))
        along += rng.normal(size=size)
        across = np.sqrt(2 * rng.standard_gamma(np.maximum(freedom - 1, 0) / 2, size))
        block[:, 0] = _scores(along / np.hypot(along, across), number).max(axis=1)
        below = rng.normal(size=size)
        below -= np.median(below, axis=1, keepdims=True)
        unit = np.median(np.abs(below), axis=1)
        block[:, 1] = np.divide(
            below.max(axis=1), unit, out=np.zeros(len(block)), where=unit > 0
        )
    return np.sort(largest, axis=0).max(axis=1)
