"""Heads: the part of a model that learns from features, one per duration.

One head of all durations fits none of them, and a head of short prefixes alone learns
too much by heart. So each duration has a head of its own, which also learns, with less
weight, from the prefixes of the neighbouring durations. Probabilities are calibrated by
one power per duration, learned from predictions out of fold.
"""

import numpy as np
from scipy.optimize import minimize_scalar
from sklearn import config_context
from sklearn.base import clone
from sklearn.exceptions import UnsetMetadataPassedError
from sklearn.pipeline import Pipeline

from ..ensembles._out_of_fold import Task, fit_clone
from ..ratings._distributions import raised
from ..utils._folds import groups_for
from ..utils._sklearn import _safe_indexing

# Least probability in the logarithms of a calibration.
_TINY = 1e-12


def head_tasks(head, rows, reached, y, objects, sharing, folds):
    """Return what to fit and to predict: one head per fold and duration.

    The weights of a head sum to its number of touches, so that a penalty means the same
    with and without neighbours.

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
    sharing : float
        Weight of the rows of the durations just before and behind, from 0 to 1.
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
    for train, test in folds:
        for k in range(n_durations):
            near = range(max(k - 1, 0), min(k + 2, n_durations)) if sharing else [k]
            of_near = [train[reached[train, j]] + j * n_touches for j in near]
            if sharing:
                weight = np.zeros(len(X))
                for j, which in zip(near, of_near):
                    weight[which] = sharing ** abs(j - k)
                weight *= reached[train, k].sum() / weight.sum()
                params = {**params, "sample_weight": weight}
            fold = np.concatenate(of_near), test[reached[test, k]] + k * n_touches
            tasks.append(Task(head.steps[-1][0], head, X, y, fold, params))
    return tasks


def fit_head(head, X, y, **params):
    """Return a fitted clone of a head, whose last step is given the arguments."""
    fitted = []
    for name, step in head.steps[:-1]:
        step = clone(step)
        X = step.fit_transform(X, y)
        fitted.append((name, step))
    name, last = head.steps[-1]
    try:
        model = fit_clone(last, X, y, **params)
    except UnsetMetadataPassedError:  # nobody said what to do with our own weights
        with config_context(enable_metadata_routing=False):
            model = fit_clone(last, X, y, **params)
    return Pipeline([*fitted, (name, model)])


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

    def loss(log_power):
        tempered = raised(proba, np.exp(log_power))
        return -np.mean((shares * np.log(np.maximum(tempered, _TINY))).sum(axis=-1))

    found = minimize_scalar(loss, bounds=(-1.5, 1.5), method="bounded")
    return float(np.exp(found.x))
