"""What it costs to use a fitted model: the seconds it takes to predict one trial."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator

from .._sklearn import Trials, _num_samples, _safe_indexing

# Trials that are timed, and how often each: a few, for a search does it for every fit.
_N_TRIALS = 5


_N_RUNS = 2


def neg_seconds_scorer(
    estimator: BaseEstimator, X: Trials, y: ArrayLike | None = None
) -> float:
    """Minus the seconds that a fitted estimator takes to predict one trial.

    For ``scoring=`` of a search, under the name "neg_seconds" beside a score of the
    predictions: what :func:`speed_accuracy_frontier`, :func:`cheapest_within_one_se`
    and :class:`~sklearn_haptic.plotting.SpeedAccuracyDisplay` weigh the score against.

    Parameters
    ----------
    estimator : object
        Fitted, with ``predict_proba`` or ``predict``. It is copied, and caches
        (``memory=``) of the copy and its parts are turned off.
    X : DataFrame, array-like or collection of trials
        The trials. Up to five, evenly spaced, are predicted twice, each on its own.
    y : array-like, default=None
        Ignored.

    Returns
    -------
    score : float
        Minus the mean over these trials of the shorter of the two times, in seconds.

    Notes
    -----
    The time is that of all steps, such as coding, pooling and the model behind them,
    on this machine under its load: where small differences matter search with
    ``n_jobs=1``. The time to fit does not count: it is spent once, and in a search
    with a cache it says who came first.

    Examples
    --------
    >>> from sklearn.model_selection import GridSearchCV, GroupKFold
    >>> from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
    >>> from sklearn_haptic.metrics import neg_rps_scorer
    >>> from sklearn_haptic.model_selection import (
    ...     cheapest_within_one_se,
    ...     neg_seconds_scorer,
    ... )
    >>> search = GridSearchCV(
    ...     DistributionalOrdinalRegressor(NNPOM(random_state=0)),
    ...     {"estimator__n_hidden": [0, 5, 10]},
    ...     scoring={"rps": neg_rps_scorer, "neg_seconds": neg_seconds_scorer},
    ...     cv=GroupKFold(5),
    ...     refit=cheapest_within_one_se,
    ... )
    """
    return -seconds_per_trial(predictor(estimator), X)


def predictor(estimator):
    """Return the method of a copy without caches that predicts distributions, if any.

    Parameters
    ----------
    estimator : object
        Fitted, with ``predict_proba`` or ``predict``.

    Returns
    -------
    predict : callable
    """
    uncached = without_caches(estimator)
    return getattr(uncached, "predict_proba", None) or uncached.predict


def seconds_per_trial(use: Callable[[Any], Any], X: Trials) -> float:
    """Mean seconds to use a fitted model on one trial, of up to five.

    Parameters
    ----------
    use : callable
        Takes trials, such as the method of a fitted model.
    X : DataFrame, array-like or collection of trials
        The trials.

    Returns
    -------
    seconds : float

    Examples
    --------
    >>> from sklearn_haptic.model_selection._cost import seconds_per_trial
    >>> seconds_per_trial(len, [[0.5], [0.25]]) < 1
    True
    """
    n_trials = _num_samples(X)
    chosen = np.linspace(0, n_trials - 1, min(n_trials, _N_TRIALS)).astype(int)
    trials = [_safe_indexing(X, [trial]) for trial in chosen.tolist()]
    return float(
        np.mean([min(timed(use, t)[1] for _ in range(_N_RUNS)) for t in trials])
    )


def timed(function, *args):
    """Call a function; return its result and the seconds it took."""
    started = perf_counter()
    result = function(*args)
    return result, perf_counter() - started


def without_caches(value):
    """Return a value whose estimators, fitted ones too, remember no results.

    Estimators, and the lists, tuples and dicts that hold them, are copied; the arrays
    in them are shared.

    Parameters
    ----------
    value : object
        An estimator, or what an attribute of one holds.

    Returns
    -------
    copied : object

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_haptic import TemporalMaxPool
    >>> from sklearn_haptic.model_selection._cost import without_caches
    >>> cached = make_pipeline(TemporalMaxPool(memory="cache"))
    >>> without_caches(cached)[0].memory is None, cached[0].memory
    (True, 'cache')
    """
    if isinstance(value, BaseEstimator):
        value = copy(value)
        parts = vars(value)
        parts.update({name: without_caches(part) for name, part in parts.items()})
        if hasattr(value, "memory"):
            value.memory = None
    elif isinstance(value, dict):
        value = copy(value)
        value.update({key: without_caches(part) for key, part in value.items()})
    elif type(value) in (list, tuple):
        value = type(value)(map(without_caches, value))
    return value
