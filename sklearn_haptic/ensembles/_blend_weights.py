"""Weights and exponent of a mean of distributions, by scores on held-out ratings.

The ranked probability score of a mean of distributions is, but for a term of the
ratings alone, the squared distance of its CDF from that of the ratings, so it is a
convex quadratic function of the weights. What few objects say of it is luck, so some
objects are added that draw the weights towards the marginal and the exponent towards 1,
by less the more objects there are.
"""

import numpy as np
from scipy.optimize import minimize_scalar, nnls

from ..ratings._distributions import cdf, raised

# Objects that are added for weights and for the exponent, see docs/method.md.
_OF_WEIGHTS, _OF_EXPONENT = 2.0, 0.5
_LARGEST_EXPONENT = 4
_LEAST = 1e-12  # smaller weights are rounding errors


def blend_weights(departure, weight, n_prior=_OF_WEIGHTS):
    r"""Return non-negative weights of sum 1 that minimise a sum of squared distances.

    They are the point nearest to zero in the convex hull of the members' departures:
    if u minimises :math:`\|Au\|^2 + s^2 (1 - \sum u)^2` over non-negative u, then
    :math:`u / \sum u` minimises :math:`\|Aw\|^2` over the simplex, because for
    :math:`u = cw` the minimum over c, :math:`s^2 \|Aw\|^2 / (s^2 + \|Aw\|^2)`, grows
    with :math:`\|Aw\|^2`. So non-negative least squares solve it exactly.

    Parameters
    ----------
    departure : ndarray of shape (n_trials, n_members, n_thresholds)
        Predicted minus true CDF; the last member is the marginal.
    weight : ndarray of shape (n_trials,)
        Weight of each trial in numbers of objects: 1/5 for one of an object's five.
    n_prior : float
        Number of objects that are added, of which all members but the marginal are
        wrong, equally and each in its own way.

    Returns
    -------
    share : ndarray of shape (n_members,)
    """
    n_members = departure.shape[1]
    rows = np.sqrt(weight)[:, None, None] * departure
    rows = np.moveaxis(rows, 1, 2).reshape(-1, n_members)
    if len(rows) > n_members:
        rows = np.linalg.qr(rows, mode="r")  # of the same products
    of_an_object = np.linalg.norm(rows) / np.sqrt(n_members * weight.sum())
    added = np.sqrt(n_prior) * of_an_object * np.eye(n_members)[:-1]
    rows = np.vstack((rows, added))
    rows = np.vstack((rows / (np.linalg.norm(rows) or 1.0), np.ones(n_members)))
    solution, _ = nnls(rows, np.append(np.zeros(len(rows) - 1), 1.0))
    solution[solution < _LEAST * solution.max()] = 0
    return solution / solution.sum()


def blend_exponent(proba, below, weight, n_prior=_OF_EXPONENT):
    """Return the power of a mean of distributions with the least score.

    Parameters
    ----------
    proba : ndarray of shape (n_trials, n_levels)
        Predicted distributions.
    below : ndarray of shape (n_trials, n_levels - 1)
        True CDF, without its end.
    weight : ndarray of shape (n_trials,)
        As for :func:`blend_weights`.
    n_prior : float
        Number of objects that are added; of each, the score grows from 1 by the mean
        score, times the square of the exponent's logarithm.

    Returns
    -------
    exponent : float
        From 1/4 to 4.
    """

    def squares(exponent):
        departure = cdf(raised(proba, exponent))[:, :-1] - below
        return weight @ (departure**2).sum(axis=1)

    of_an_object = squares(1.0) / weight.sum()

    def cost(log_exponent):
        return squares(np.exp(log_exponent)) + n_prior * of_an_object * log_exponent**2

    largest = np.log(_LARGEST_EXPONENT)
    found = minimize_scalar(cost, bounds=(-largest, largest), method="bounded")
    return float(np.exp(found.x))
