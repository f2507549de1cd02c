"""People whose ratings lie further from other people's than is usual."""

from __future__ import annotations

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike
from sklearn.utils import Bunch
from sklearn.utils.validation import check_consistent_length

from ..utils._sklearn import Interval, validate_params
from ..utils._validation import check_objects
from ._checks import check_single_ratings, known_answers
from ._counts import RatingTable

# Differences smaller than this share of the largest one are of rounding.
_ROUNDING = 1e-9


@validate_params(
    {"limit": [Interval(Real, 0, None, closed="neither")]},
    prefer_skip_nested_validation=True,
)
def outlying_raters(
    ratings: ArrayLike | RatingTable,
    objects: ArrayLike | None = None,
    raters: ArrayLike | None = None,
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
    ratings : array-like of shape (n_ratings, n_adjectives), or RatingTable
        One row per person and object, one column per adjective: numbers. Missing
        ratings are None, NaN or NA. Or the ratings of one adjective, as a table that
        knows its raters; its levels that are words count by their place.
    objects : array-like of shape (n_ratings,), default=None
        The object that each row is about. Only a table goes without.
    raters : array-like of shape (n_ratings,), default=None
        The person who gave each row. Only a table goes without.
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
        If the arguments differ in length, an object or a rater is missing or, in a
        table, not known, a rating is not a number, or no object has ratings of two
        people.

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
    if isinstance(ratings, RatingTable):
        if objects is not None or raters is not None:
            raise ValueError(
                "ratings is a RatingTable, which has objects and raters; leave both "
                "out."
            )
        answers, people = known_answers(ratings)
        row, rater, level = answers.T
        numeric = np.issubdtype(ratings.levels.dtype, np.number)
        values = ratings.levels if numeric else np.arange(len(ratings.levels))
        objects, raters = ratings.objects[row], people[rater]
        ratings = values[level][:, np.newaxis]
    if objects is None or raters is None:
        raise ValueError(
            "ratings do not say who gave them on which object; give objects and raters."
        )
    answers = check_single_ratings(ratings)
    check_consistent_length(answers, objects, raters)
    _, of_object = np.unique(check_objects(objects), return_inverse=True)
    people, of_rater = np.unique(
        check_objects(raters, name="raters"), return_inverse=True
    )
    (total, number), furthest = np.zeros((2, len(people))), 0.0
    for answer in answers.T:
        row, beyond, apart = _beyond_others(answer, of_object)
        furthest = max(furthest, apart)
        total += np.bincount(of_rater[row], beyond, minlength=len(people))
        number += np.bincount(of_rater[row], minlength=len(people))
    if not number.any():
        raise ValueError(
            "ratings has no object that two people rated on the same adjective, so "
            "nobody can be compared; give the ratings of all people."
        )
    distance = np.divide(total, number, np.full(len(people), np.nan), where=number > 0)
    centred = distance - np.nanmedian(distance)
    centred[np.abs(centred) <= _ROUNDING * furthest] = 0
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
    furthest : float
        The largest of these differences.
    """
    row = np.lexsort((answer, of_object))
    row = row[~np.isnan(answer[row])]
    _, first, which, number = np.unique(
        of_object[row], return_index=True, return_inverse=True, return_counts=True
    )
    value, n = answer[row], number[which]
    value = value - value[first][which]  # from the lowest: equal answers become 0
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
    return row[several], apart - mean[which], apart.max(initial=0)
