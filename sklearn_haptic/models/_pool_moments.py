"""How the errors of several touches of one object go together, and the best weights.

Touches of an object share much of their error: its ratings hold what no finger feels.
The score of a mean of predictions is a quadratic function of its weights, so the mean
products of errors out of fold, of two predictions of the same touch and of two touches
of the same object, give the best weights for any set of touches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls


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
        a member that has none.
    score : float
        Expected squared distance from the truth.
    """
    count = pairs.diagonal()
    used = np.flatnonzero(count)
    every = np.outer(count, count)
    mean = _ratio(pairs * moments.same + (every - pairs) * moments.other, every)
    mean = mean[np.ix_(used, used)]
    values, vectors = np.linalg.eigh(mean)
    root = (vectors * np.sqrt(np.maximum(values, 0))).T  # root.T @ root is the mean
    share = np.zeros(len(count))
    if len(used) > 1:  # beside the marginal
        share[used[:-1]], _ = nnls(root[:, :-1] - root[:, -1:], -root[:, -1])
    share[-1] = 1 - share.sum()
    return share, float(share[used] @ mean @ share[used])


def _ratio(total, n):
    return np.divide(total, n, out=np.zeros_like(total), where=n > 0)
