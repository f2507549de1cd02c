"""Weights of a mean of distributions: those that score best on held-out ratings.

The ranked probability score of a mean of distributions is, but for a term of the
ratings alone, the squared distance of its CDF from that of the ratings, so it is a
convex quadratic function of the weights.
"""

import numpy as np
from scipy.optimize import nnls

_STEPS = 101


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
    for which the best weights are found by luck, hardly move them.

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
    best = best_weights(departure, weight)
    near, far = (np.einsum("tmk,m->tk", departure, w) for w in (start, best))
    total, n_objects = np.bincount(objects, weight), weight.sum()
    least = np.einsum("tk,tk->t", far, far)
    for step in np.linspace(0, 1, _STEPS):
        between = near + step * (far - near)
        excess = weight * (np.einsum("tk,tk->t", between, between) - least)
        excess = np.bincount(objects, excess)  # of the object, times its total weight
        mean = excess.sum() / n_objects
        excess = excess[total > 0] / total[total > 0] - mean
        error = np.sqrt(total[total > 0] @ excess**2) / n_objects
        if mean <= error:
            break
    return start + step * (best - start)
