"""How the errors of several touches of one object go together, and the best weights.

Touches of an object share much of their error: its ratings hold what no finger feels.
The score of a mean of predictions is a quadratic function of its weights, so the mean
products of errors out of fold, of two predictions of the same touch and of two touches
of the same object, give the best weights for any set of touches.

The weights with the best score do not make a pool as broad as it errs, because it errs
in where it puts an object, little for most objects and much for a few. So it is
blurred, a share of each level going to its neighbours, until it is as broad.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

# A member no further from the marginal, as a share of the marginal's mean square error,
# says no more than rounding and unfinished solving do. Its weight could be anything.
_LEAST = 1e-6


class Moments(NamedTuple):
    """Mean products of the departures of pairs of members.

    Attributes
    ----------
    same : ndarray of shape (n_members, n_members)
        Of two members' predictions from one row.
    other : ndarray of shape (n_members, n_members)
        Of predictions from two rows of one object.
    """

    same: np.ndarray
    other: np.ndarray


def error_moments(departure, objects):
    """Return the mean products of departures within objects, which count equally.

    What never occurred together is taken to err together, so that it is not thought
    to be worth more than it is.

    Parameters
    ----------
    departure : ndarray of shape (n_rows, n_members, n_thresholds)
        Predicted minus true; NaN where a member has nothing to predict from.
    objects : ndarray of int of shape (n_rows,)
        Number of the object of each row, from 0.

    Returns
    -------
    moments : Moments
    """
    there = np.isfinite(departure).all(axis=2)
    departure = np.where(there[..., np.newaxis], departure, 0.0)
    n_members = there.shape[1]
    same, other, n_same, n_other = np.zeros((4, n_members, n_members))
    order = np.argsort(objects, kind="stable")
    for rows in np.split(order, np.cumsum(np.bincount(objects))[:-1]):
        total = departure[rows].sum(axis=0)
        count = there[rows].sum(axis=0)
        product = np.einsum("rik,rjk->ij", departure[rows], departure[rows])
        pairs = there[rows].T.astype(np.float64) @ there[rows]
        others = np.outer(count, count) - pairs
        same += _ratio(product, pairs)
        n_same += pairs > 0
        other += _ratio(total @ total.T - product, others)
        n_other += others > 0
    size = np.sqrt(_ratio(same, n_same).diagonal())
    same = np.where(n_same > 0, _ratio(same, n_same), np.outer(size, size))
    other = np.where(n_other > 0, _ratio(other, n_other), same)
    return Moments(same, other)


def pairs_of(there):
    """Return how many touches have both members of each pair, the marginal the last.

    Parameters
    ----------
    there : ndarray of bool of shape (n_touches, n_members)

    Returns
    -------
    pairs : ndarray of shape (n_members + 1, n_members + 1)
        The numbers of touches of the members are on the diagonal.
    """
    there = np.column_stack((there, np.ones(len(there))))
    return there.T @ there


def pool_weights(moments, pairs):
    """Return the best weights of the members for some touches of one object.

    The members' weights are not negative; that of the marginal is what is left to 1,
    and negative where a mean of the members would be too flat.

    Parameters
    ----------
    moments : Moments
        The marginal is the last member.
    pairs : ndarray of shape (n_members, n_members)
        How many touches have both.

    Returns
    -------
    share : ndarray of shape (n_members,)
        Weights of the members, each shared equally by the touches that have it; 0 for
        a member that has none, or that predicts the marginal.
    score : float
        Expected squared distance from the truth.
    """
    count = pairs.diagonal()
    mean = mean_products(moments, pairs)
    own = mean.diagonal()
    differs = own - 2 * mean[-1] + own[-1] > _LEAST * own[-1]
    differs[-1] = True
    used = np.flatnonzero((count > 0) & differs)
    mean = mean[np.ix_(used, used)]
    root = root_of(mean)
    share = np.zeros(len(count))
    if len(used) > 1:  # beside the marginal
        share[used[:-1]], _ = nnls(root[:, :-1] - root[:, -1:], -root[:, -1])
    share[-1] = 1 - share.sum()
    return share, float(share[used] @ mean @ share[used])


def root_of(products):
    """Return A of which A.T @ A are mean products, as far as these can be."""
    values, vectors = np.linalg.eigh(products)
    return (vectors * np.sqrt(np.maximum(values, 0))).T


class Spread(NamedTuple):
    """What tells how broad a pool is and how far it errs, in levels.

    Attributes
    ----------
    means : Moments
        Of the departures of the means of the members, and of the members blurred.
    square : ndarray of shape (2 * n_members,)
        Their mean squared distances from the true means.
    within : float
        Mean variance of the true distributions.
    """

    means: Moments
    square: np.ndarray
    within: float


def blurred(proba):
    """Return distributions of which each level goes to its neighbours, half to each.

    At the ends one half stays.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.ensembles._pool_moments import blurred
    >>> blurred(np.array([0.5, 0.5, 0.0, 0.0]))
    array([0.5 , 0.25, 0.25, 0.  ])
    """
    ends = np.concatenate((proba[..., :1], proba, proba[..., -1:]), axis=-1)
    return (ends[..., :-2] + ends[..., 2:]) / 2


def with_blurred(proba):
    """Return the members of shape (n_rows, n_members, n_levels), and them blurred."""
    return np.concatenate((proba, blurred(proba)), axis=1)


def spread_moments(proba, true, objects):
    """Return the spread of members within objects, which count equally.

    Parameters
    ----------
    proba : ndarray of shape (n_rows, n_members, n_levels)
        NaN where a member has nothing to predict from.
    true : ndarray of shape (n_rows, n_levels)
    objects : ndarray of int of shape (n_rows,)

    Returns
    -------
    spread : Spread
    """
    level = np.arange(proba.shape[2])
    mean = true @ level
    squares = (level - mean[:, np.newaxis]) ** 2
    proba = with_blurred(proba)
    departure = proba @ level - mean[:, np.newaxis]
    total = np.einsum("rmk,rk->rm", proba, squares)
    within = np.einsum("rk,rk->r", true, squares)
    return Spread(
        error_moments(departure[..., np.newaxis], objects),
        _mean_of_objects(total, objects),
        float(_mean_of_objects(within[:, np.newaxis], objects)[0]),
    )


def _mean_of_objects(values, objects):
    """Return the mean over objects of their mean values that are not NaN."""
    there = np.isfinite(values)
    total, n = np.zeros((2, objects.max() + 1, values.shape[1]))
    np.add.at(total, objects, np.where(there, values, 0))
    np.add.at(n, objects, there)
    return _ratio(_ratio(total, n).sum(axis=0), (n > 0).sum(axis=0).astype(np.float64))


def blur_share(spread, share, pairs):
    """Return the share of a pool to blur so that it is as broad as it errs.

    A pool's variance is its squared distance from the true mean less its squared error,
    and what it is to equal is the variance of the true ratings and that error. Both are
    quadratic in the share.

    Parameters
    ----------
    spread : Spread
    share : ndarray of shape (n_members,)
        As of `pool_weights`.
    pairs : ndarray of shape (n_members, n_members)
        As for `pool_weights`.

    Returns
    -------
    blur : float
        From 0, also where the pool is broad enough, to 1.
    """
    error = mean_products(spread.means, np.tile(pairs, (2, 2)))
    start = np.concatenate((share, np.zeros(len(share))))
    step = np.concatenate((-share, share))
    missing = start @ spread.square - 2 * start @ error @ start - spread.within
    slope = step @ spread.square - 4 * start @ error @ step
    bend = -2 * step @ error @ step
    if missing >= 0 or slope <= 0:
        return 0.0
    root = slope**2 - 4 * bend * missing
    if root < 0:  # never as broad as it errs; here it is nearest to that
        return float(min(1.0, -slope / (2 * bend)))
    # In this form nothing cancels where ends are rare and bend is next to 0.
    return float(min(1.0, -2 * missing / (slope + np.sqrt(root))))


def mean_products(moments, pairs):
    """Return the mean products of departures in the means of touches."""
    count = pairs.diagonal()
    every = np.outer(count, count)
    return _ratio(pairs * moments.same + (every - pairs) * moments.other, every)


def _ratio(total, n):
    return np.divide(total, n, out=np.zeros_like(total), where=n > 0)
