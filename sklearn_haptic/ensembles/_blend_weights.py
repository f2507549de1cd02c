"""Weights and exponent of a mean of distributions, by scores on held-out ratings.

The ranked probability score of a mean of distributions is, but for a term of the
ratings alone, the squared distance of its CDF from that of the ratings, so it is a
convex quadratic function of the weights.
"""

import numpy as np
from scipy.optimize import nnls

from ..ratings._distributions import cdf, raised

_STEPS = 101
_EXPONENTS = 2 ** np.linspace(-2, 2, 13)  # the one in the middle is 1
_FEWEST_OBJECTS = 4
_LEAST = 1e-12  # smaller weights are rounding errors


def best_weights(departure, weight):
    r"""Return non-negative weights of sum 1 that minimise a mean squared distance.

    They are the point nearest to zero in the convex hull of the members' departures:
    if u minimises :math:`\|Au\|^2 + s^2 (1 - \sum u)^2` over non-negative u, then
    :math:`u / \sum u` minimises :math:`\|Aw\|^2` over the simplex, because for
    :math:`u = cw` the minimum over c, :math:`s^2 \|Aw\|^2 / (s^2 + \|Aw\|^2)`, grows
    with :math:`\|Aw\|^2`. So non-negative least squares solve it exactly.

    Parameters
    ----------
    departure : ndarray of shape (n_trials, n_members, n_thresholds)
        Predicted minus true CDF.
    weight : ndarray of shape (n_trials,)
        Weight of each trial; their sum is not 0.

    Returns
    -------
    share : ndarray of shape (n_members,)
    """
    rows = np.sqrt(weight / weight.sum())[:, None, None] * departure
    rows = np.moveaxis(rows, 1, 2).reshape(-1, departure.shape[1])
    if len(rows) > rows.shape[1]:
        rows = np.linalg.qr(rows, mode="r")  # of the same products
    scale = np.linalg.norm(rows) or 1.0
    rows = np.vstack((rows / scale, np.ones(rows.shape[1])))
    solution, _ = nnls(rows, np.append(np.zeros(len(rows) - 1), 1.0))
    solution[solution < _LEAST * solution.max()] = 0
    return solution / solution.sum()


def cautious_weights(departure, weight, objects, start):
    """Return the weights nearest to `start` within one standard error of the best.

    They lie between `start` and what `best_weights` returns. The standard error is
    that of the paired difference of their scores over objects, so that few objects,
    for which the best weights are found by luck, hardly move them; fewer than four, too
    few to know that error, do not.

    Parameters
    ----------
    departure : ndarray of shape (n_trials, n_members, n_thresholds)
        Predicted minus true CDF.
    weight : ndarray of shape (n_trials,)
        Weight of each trial in numbers of objects: 1/5 for one of an object's five.
    objects : ndarray of int of shape (n_trials,)
        Number of the object of each trial.
    start : ndarray of shape (n_members,)
        Weights to begin with.

    Returns
    -------
    share : ndarray of shape (n_members,)
    """
    if _are_few(objects, weight):
        return start
    best = best_weights(departure, weight)
    near, far = (np.einsum("tmk,m->tk", departure, w) for w in (start, best))
    least = np.einsum("tk,tk->t", far, far)
    for step in np.linspace(0, 1, _STEPS):
        between = near + step * (far - near)
        excess = np.einsum("tk,tk->t", between, between) - least
        if _is_within_error(excess, weight, objects):
            break
    return start + step * (best - start)


def _are_few(objects, weight):
    """Whether objects are too few for a standard error over them to say something."""
    return len(np.unique(objects[weight > 0])) < _FEWEST_OBJECTS


def _is_within_error(excess, weight, objects):
    """Whether a mean over objects is at most one standard error of it above zero."""
    total, n_objects = np.bincount(objects, weight), weight.sum()
    excess = np.bincount(objects, weight * excess)  # of the object, times its weight
    mean = excess.sum() / n_objects
    deviation = excess[total > 0] / total[total > 0] - mean
    return mean <= np.sqrt(total[total > 0] @ deviation**2) / n_objects


def cautious_exponent(proba, below, weight, objects):
    """Return the exponent nearest to 1 within one standard error of the best.

    It is 1 if there are fewer than four objects, too few to know that error.

    Parameters
    ----------
    proba : ndarray of shape (n_trials, n_levels)
        Predicted distributions.
    below : ndarray of shape (n_trials, n_levels - 1)
        True CDF, without its end.
    weight, objects
        As for :func:`cautious_weights`.

    Returns
    -------
    exponent : float
        Of a grid from 1/4 to 4.
    """
    if _are_few(objects, weight):
        return 1.0
    scores = [
        ((cdf(raised(proba, exponent))[:, :-1] - below) ** 2).sum(axis=1)
        for exponent in _EXPONENTS
    ]
    best = np.argmin([weight @ score for score in scores])
    at = len(scores) // 2
    while not _is_within_error(scores[at] - scores[best], weight, objects):
        at += np.sign(best - at)
    return float(_EXPONENTS[at])
