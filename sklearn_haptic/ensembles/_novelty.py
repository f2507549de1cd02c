"""Touches unlike those learned from: how unlike, and how far to believe a model then.

A touch is as unlike others as its features are distant from the nearest touch of
another object. The distances of the training touches, each from the other objects, say
how unusual a distance is, and predictions out of fold how much to believe at each.
"""

import numpy as np
from sklearn.isotonic import IsotonicRegression
from sklearn.metrics import pairwise_distances_chunked


def nearest_distances(rows, train, objects=None, train_objects=None):
    """Return the distance of each row from the nearest training row.

    Parameters
    ----------
    rows : ndarray of shape (n_rows, n_features)
    train : ndarray of shape (n_train, n_features)
    objects : ndarray of shape (n_rows,), default=None
        Objects of the rows, of which training rows are passed over.
    train_objects : ndarray of shape (n_train,), default=None
        Objects of the training rows.

    Returns
    -------
    distance : ndarray of shape (n_rows,)
        Root mean square difference over features.
    """

    def nearest(distance, start):
        if objects is not None:
            own = objects[start : start + len(distance), np.newaxis] == train_objects
            distance = np.where(own, np.inf, distance)
        return distance.min(axis=1)

    found = pairwise_distances_chunked(rows, train, reduce_func=nearest)
    return np.concatenate(list(found)) / np.sqrt(rows.shape[1])


def conformal_p_values(distance, known, objects):
    """Return the share of objects at least as far away, the new one among them.

    Each object counts by the share of its touches that are. Were an object drawn like
    the training objects, its p-value would be at most p with a probability of about p.

    Parameters
    ----------
    distance : ndarray of shape (n_rows,)
    known : ndarray of shape (n_train,)
        Distance of each training touch from the other objects.
    objects : ndarray of int of shape (n_train,)
        Number of the object of each training touch, from 0.

    Returns
    -------
    p : ndarray of shape (n_rows,)
        From 1 / (number of objects + 1) to 1.
    """
    weight = 1 / np.bincount(objects)[objects]
    order = np.argsort(known)
    beyond = np.append(np.cumsum(weight[order][::-1])[::-1], 0.0)
    n_objects = objects.max() + 1
    place = np.searchsorted(known[order], distance, side="left")
    return (1 + beyond[place]) / (n_objects + 1)


def fit_belief(departure, from_marginal, distance, weight):
    r"""Learn how much to believe predictions, as a falling function of the distance.

    If m is the marginal's CDF minus the true one, and d the predicted minus the
    marginal's, belief w has the score :math:`\|m + wd\|^2`. It is least at
    :math:`-m^T d / \|d\|^2`, and by :math:`\|d\|^2` times the squared difference worse
    elsewhere, so that a weighted isotonic regression is the best falling function.

    Parameters
    ----------
    departure : ndarray of shape (n_trials, n_thresholds)
        The marginal minus the truth, out of fold.
    from_marginal : ndarray of shape (n_trials, n_thresholds)
        The prediction minus the marginal, out of fold.
    distance, weight : ndarray of shape (n_trials,)

    Returns
    -------
    belief : IsotonicRegression
        From distances to weights from 0 to 1.
    """
    square = np.einsum("tk,tk->t", from_marginal, from_marginal)
    product = np.einsum("tk,tk->t", from_marginal, departure)
    best = np.divide(-product, square, out=np.ones_like(square), where=square > 0)
    belief = IsotonicRegression(
        y_min=0, y_max=1, increasing=False, out_of_bounds="clip"
    )
    weight = weight * square if square.any() else weight  # a model of the mean alone
    return belief.fit(distance, best, sample_weight=weight)


def belief_at(belief, distance):
    """Return the belief at distances; beyond the furthest it falls in proportion."""
    furthest = belief.X_max_
    beyond = np.divide(
        furthest, distance, out=np.ones_like(distance), where=distance > furthest
    )
    return belief.predict(distance) * beyond
