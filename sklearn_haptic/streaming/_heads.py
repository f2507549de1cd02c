"""Heads: the part of a model that learns from features, one per duration.

One head of all durations fits none of them, because features grow during a touch, as a
pressing force does. So each duration has a head of its own. Learning from the prefixes
of neighbouring durations, too, gained .001 of RPS on average over generated holds,
squeezes and slow slides. Where force grew, it took longer pressing for a harder object:
.19 of recorded squeezes were named wrongly after 0.4 s instead of .03. Probabilities
are calibrated by one power per duration, learned from predictions out of fold.
"""

import numpy as np
from scipy.optimize import minimize_scalar
from sklearn.base import clone
from sklearn.pipeline import Pipeline

from ..ensembles._out_of_fold import Task, fit_clone
from ..ratings._distributions import raised
from ..utils._folds import groups_for
from ..utils._sklearn import _safe_indexing

# Least probability in a calibration. It is raised to the power, too, so that a head
# that was sure of the wrong class does not become still surer.
_TINY = 1e-12


def head_tasks(head, rows, reached, y, objects, folds):
    """Return what to fit and to predict: one head per fold and duration.

    Parameters
    ----------
    head : Pipeline
        Transformers of rows, and the estimator behind them.
    rows : ndarray of shape (n_durations, n_touches, n_features)
        Features of the prefixes of each duration.
    reached : ndarray of bool of shape (n_touches, n_durations)
        Whether a touch is so long.
    y : array-like of length n_touches
        Labels or counts.
    objects : ndarray of shape (n_touches,)
        The object of each touch, for an estimator whose ``fit`` requests groups.
    folds : iterable of (ndarray, ndarray)
        Training and test touches.

    Returns
    -------
    tasks : list of Task
        Of all durations of the first fold, then of the next; their rows are numbered
        duration by duration.
    """
    n_durations, n_touches, n_features = rows.shape
    X = rows.reshape(-1, n_features)
    y = _safe_indexing(y, np.tile(np.arange(n_touches), n_durations))
    params = groups_for(head[-1], np.tile(objects, n_durations))
    tasks = []
    for fold in folds:
        for k in range(n_durations):
            here = [each[reached[each, k]] + k * n_touches for each in fold]
            tasks.append(Task(head.steps[-1][0], head, X, y, tuple(here), params))
    return tasks


def fit_head(head, X, y, **params):
    """Return a fitted clone of a head, whose last step is given the arguments."""
    fitted = []
    for name, step in head.steps[:-1]:
        step = clone(step)
        X = step.fit_transform(X, y)
        fitted.append((name, step))
    name, last = head.steps[-1]
    return Pipeline([*fitted, (name, fit_clone(last, X, y, **params))])


def best_power(proba, shares):
    """Find the power of `raised` with the best mean log score.

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
    proba = np.maximum(proba, _TINY)

    def loss(log_power):
        log_proba = np.log(raised(proba, np.exp(log_power)))
        return -np.mean((shares * log_proba).sum(axis=-1))

    found = minimize_scalar(loss, bounds=(-1.5, 1.5), method="bounded")
    return float(np.exp(found.x))
