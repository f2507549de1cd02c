"""What it costs to use a fitted model: the seconds it takes to predict one trial."""

from __future__ import annotations

import time
from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator

from ..utils._sklearn import Trials, _num_samples, _safe_indexing

# Trials that are timed, and how often each is: few, because a search times every fit.
_N_TRIALS = 5
_N_RUNS = 2


def neg_seconds_scorer(
    estimator: BaseEstimator, X: Trials, y: ArrayLike | None = None
) -> float:
    """Minus the seconds that a fitted estimator takes to predict one trial.

    Give it to ``scoring=`` of a search under the name "neg_seconds", beside a score of
    the predictions. :func:`speed_accuracy_frontier`, :func:`cheapest_within_one_se` and
    :class:`~sklearn_haptic.plotting.SpeedAccuracyDisplay` then weigh one against the
    other.

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
        Minus the mean over these trials of the shorter of their two times, in seconds.

    See Also
    --------
    cheapest_within_one_se : Has an example of a search with this score.

    Notes
    -----
    The time is that of all steps, such as coding, pooling and the model after them. It
    depends on the load of the machine: where small differences matter, search with
    ``n_jobs=1``. The time to fit does not count, because it is spent once, and in a
    search with a cache it only tells which candidate came first.

    Examples
    --------
    >>> from sklearn_haptic import NNPOM
    >>> from sklearn_haptic.model_selection import neg_seconds_scorer
    >>> X = [[0.0], [1.0], [2.0]]
    >>> neg_seconds_scorer(NNPOM(random_state=0).fit(X, [1, 2, 3]), X) < 0
    True
    """
    return -seconds_per_trial(predictor(estimator), X)


def predictor(estimator):
    """Return ``predict_proba``, else ``predict``, of a copy without caches."""
    uncached = without_caches(estimator)
    return getattr(uncached, "predict_proba", None) or uncached.predict


def seconds_per_trial(use: Callable[[Any], Any], X: Trials) -> float:
    """Return the mean seconds to use a fitted model on one trial, of up to five.

    `use` takes trials, as a method of the model does.

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
    started = time.perf_counter()
    result = function(*args)
    return result, time.perf_counter() - started


def without_caches(value):
    """Return a value whose estimators, fitted ones too, remember no results.

    Estimators, and the lists, tuples and dicts that hold them, are copied; the arrays
    in them are shared. Any other value is returned as it is.

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
    elif isinstance(value, tuple) and hasattr(value, "_fields"):
        value = type(value)(*map(without_caches, value))
    elif type(value) in (list, tuple):
        value = type(value)(map(without_caches, value))
    return value
