"""Heads: the part of a model that learns from features, one per duration.

One head of all durations fits none of them, and a head of short prefixes alone learns
too much by heart. So each duration has a head of its own, which also learns, with less
weight, from the prefixes of the neighbouring durations. Probabilities are calibrated by
one power per duration, learned from predictions out of fold.
"""

import numpy as np
from scipy.optimize import minimize_scalar
from sklearn.base import clone
from sklearn.pipeline import Pipeline
from sklearn.utils import _safe_indexing

from ..utils._folds import groups_for

# Least probability in the logarithms of a calibration.
_TINY = 1e-12


def fit_heads(steps, rows, reached, y, objects, sharing):
    """Fit one head per duration.

    The weights of a head sum to its number of touches, so that a penalty means the same
    with and without neighbours.

    Parameters
    ----------
    steps : list of (str, estimator)
        Transformers of rows, and the estimator behind them; cloned for each duration.
    rows : list of ndarray of shape (n_touches, n_features)
        Features of the prefixes of each duration.
    reached : ndarray of bool of shape (n_touches, n_durations)
        Whether a touch is so long.
    y : array-like of length n_touches
        Labels or counts.
    objects : ndarray of shape (n_touches,)
        The object of each touch, for an estimator whose ``fit`` requests groups.
    sharing : float
        Weight of the rows of the durations just before and behind, from 0 to 1.

    Returns
    -------
    heads : list of Pipeline
        The fitted heads.
    """
    heads = []
    for k in range(len(rows)):
        near = [j for j in (k - 1, k, k + 1) if 0 <= j < len(rows)]
        near = near if sharing else [k]
        which = [np.flatnonzero(reached[:, j]) for j in near]
        weight = np.repeat([sharing ** abs(j - k) for j in near], [*map(len, which)])
        X = np.concatenate([rows[j][each] for j, each in zip(near, which)])
        which = np.concatenate(which)
        options = groups_for(steps[-1][1], objects[which])
        if sharing:
            options["sample_weight"] = weight * reached[:, k].sum() / weight.sum()
        heads.append(_fit_head(steps, X, _safe_indexing(y, which), options))
    return heads


def _fit_head(steps, X, y, options):
    *transformers, (name, estimator) = steps
    fitted = []
    for each, step in transformers:
        step = clone(step)
        X = step.fit_transform(X, y)
        fitted.append((each, step))
    return Pipeline([*fitted, (name, clone(estimator).fit(X, y, **options))])


def predict_head(head, rows, classes):
    """Predict shares of `classes`; a class that a head has never seen gets none."""
    proba = head.predict_proba(rows)
    if len(head.classes_) == len(classes):
        return proba
    full = np.zeros((*proba.shape[:-1], len(classes)))
    full[..., np.isin(classes, head.classes_)] = proba
    return full


def predict_out_of_fold(steps, rows, reached, y, objects, sharing, classes, folds):
    """Predict each training touch at each duration by heads fitted without it.

    Parameters
    ----------
    steps, rows, reached, y, objects, sharing
        As in :func:`fit_heads`.
    classes : ndarray of shape (n_classes,)
    folds : iterable of (ndarray, ndarray)
        Training and test touches.

    Returns
    -------
    proba : ndarray of shape (n_touches, n_durations, ..., n_classes)
        NaN where a touch is not so long, or no fold tests it.
    """
    out = None  # whose shape the first prediction tells
    for train, test in folds:
        own = [each[train] for each in rows]
        y_train = _safe_indexing(y, train)
        heads = fit_heads(steps, own, reached[train], y_train, objects[train], sharing)
        for k, fitted in enumerate(heads):
            which = test[reached[test, k]]
            if len(which) == 0:
                continue
            proba = predict_head(fitted, rows[k][which], classes)
            if out is None:
                out = np.full((*reached.shape, *proba.shape[1:]), np.nan)
            out[which, k] = proba
    return out


def temper(proba, power):
    """Raise probabilities to a power and divide them by their sum.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.streaming._heads import temper
    >>> temper(np.array([0.8, 0.2]), 0.5).round(3)
    array([0.667, 0.333])
    """
    if power == 1:
        return proba
    logs = power * np.log(np.maximum(proba, _TINY))
    weights = np.exp(logs - logs.max(axis=-1, keepdims=True))
    return weights / weights.sum(axis=-1, keepdims=True)


def best_power(proba, shares):
    """Find the power of `temper` with the best mean log score.

    Parameters
    ----------
    proba, shares : ndarray of shape (n_touches, ..., n_levels)
        Predicted out of fold, and true.

    Returns
    -------
    power : float
        Above 1 sharpens, below 1 flattens; from 0.22 to 4.5. Without the limits a few
        predictions that are all right would become certain, and flat ones would give a
        share to classes that nobody has seen.
    """

    def loss(log_power):
        tempered = temper(proba, np.exp(log_power))
        return -np.mean((shares * np.log(np.maximum(tempered, _TINY))).sum(axis=-1))

    found = minimize_scalar(loss, bounds=(-1.5, 1.5), method="bounded")
    return float(np.exp(found.x))
