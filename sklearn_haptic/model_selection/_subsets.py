"""Cross-validation of a model with every set of its sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.stats import rankdata
from sklearn.base import clone
from sklearn.compose import ColumnTransformer
from sklearn.metrics import check_scoring
from sklearn.pipeline import Pipeline
from sklearn.utils.parallel import Parallel, delayed

from ..ensembles._out_of_fold import check_folds, warn_of_divided
from ..ratings._checks import check_rated
from ..utils._folds import groups_for, make_splitter
from ..utils._sklearn import (
    CrossValidator,
    Scorer,
    Trials,
    _check_method_params,
    _get_adapter_from_container,
    _num_samples,
    _safe_indexing,
)
from ..utils._validation import check_groups
from ._cost import predictor, seconds_per_trial, timed, without_caches
from ._frontier import COST


def sensor_subsets(
    model: Pipeline,
    X: Trials,
    y: ArrayLike,
    *,
    groups: ArrayLike | None = None,
    cv: CrossValidator = None,
    scoring: str | Scorer | Sequence[str] | Mapping[str, str | Scorer] | None = None,
    n_jobs: int | None = None,
) -> pd.DataFrame:
    """Cross-validate a model with every subset of its sensors.

    The result shows which sensors are worth their time. The features of a sensor do not
    depend on the other sensors. They are therefore computed and timed once per fold,
    and only the rest of the model is fitted and scored again for each of the 2^n - 1
    subsets. The scores are those of a ``GridSearchCV`` over a model whose other sensors
    are set to ``"drop"``.

    Parameters
    ----------
    model : Pipeline
        Its first step is a :class:`~sklearn.compose.ColumnTransformer` with one
        transformer per sensor, its last step a predictor, such as
        :class:`~sklearn_haptic.DistributionalOrdinalRegressor`. Transformers set to
        ``"drop"`` are not tried.
    X : DataFrame or array-like of shape (n_trials, n_columns)
        The trials.
    y : array-like of shape (n_trials,) or (n_trials, n_levels)
        Labels, or how many people gave each level.
    groups : array-like of shape (n_trials,), default=None
        The object of each trial, for the splitter, and for ``fit`` of the last step if
        it requests them, such as a network that stops early.
    cv : int, splitter or iterable, default=None
        The folds. An int, or None for 5, is a number of folds: of whole objects if
        ``groups`` are given, else as in
        :class:`~sklearn.model_selection.GridSearchCV`.
    scoring : str, callable, list, tuple or dict, default=None
        As in :class:`~sklearn.model_selection.GridSearchCV`; None for the model's
        own ``score``.
    n_jobs : int, default=None
        Number of jobs, each of which fits and scores all subsets on one fold.

    Returns
    -------
    results : DataFrame
        In the form of ``GridSearchCV.cv_results_``, with one row per subset,
        small subsets first: ``params``, each ``{"sensors": (name, ...)}``;
        ``param_sensors``; ``split0_test_score`` and so on; mean and standard
        deviation over folds of the test score, and ``rank_test_score``; the same for
        the score "neg_seconds", minus the seconds to predict one trial, as
        :func:`neg_seconds_scorer` measures it; and mean and standard deviation of the
        times to fit and to score, in seconds. Times of a subset are sums over its
        sensors and the rest of the model.

    Raises
    ------
    TypeError
        If ``model`` is not a Pipeline that begins with a ColumnTransformer, or the
        features of a sensor are neither an array nor a DataFrame of pandas or polars.
    ValueError
        If nothing follows the ColumnTransformer, its ``remainder`` is not
        ``"drop"``, its transformers are all dropped or share a name, or a trial has
        no group; if a fold trains on a trial that it tests.

    Warns
    -----
    UserWarning
        If a fold trains on some trials of a group and tests others.

    See Also
    --------
    speed_accuracy_frontier : Choose the subsets that no other beats in time and score.
    cheapest_within_one_se : Choose the fastest within one standard error of the best.
    sklearn_haptic.plotting.SpeedAccuracyDisplay : Plot them.

    Notes
    -----
    A ``memory=`` in the model, or in one of its parts, falsifies the times to fit and
    to score, but not "neg_seconds", for which caches are off. Other jobs on the machine
    falsify all times: where small differences matter, use ``n_jobs=1``.

    If random states are integers, each subset has the same features and the same model
    as it would have alone. A fit that fails raises its error.

    Examples
    --------
    >>> from sklearn.model_selection import GroupKFold
    >>> from sklearn_haptic import make_haptic_pipeline
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> from sklearn_haptic.metrics import neg_rps_scorer
    >>> from sklearn_haptic.model_selection import sensor_subsets
    >>> sensors = ["pdc", "tac", "tdc"]
    >>> corpus = make_haptic_corpus(9, 2, sensors=sensors, random_state=0)
    >>> results = sensor_subsets(
    ...     make_haptic_pipeline(sensors, random_state=0),
    ...     corpus.trials,
    ...     corpus.ratings["hard"],
    ...     groups=corpus.objects,
    ...     cv=GroupKFold(3),
    ...     scoring=neg_rps_scorer,
    ... )
    >>> results["param_sensors"].tolist()[2:5]
    [('tdc',), ('pdc', 'tac'), ('pdc', 'tdc')]
    """
    sensors = _split_sensors(model)
    subsets = [
        subset
        for size in range(1, len(sensors) + 1)
        for subset in combinations(sensors, size)
    ]
    X, y = check_rated(X, y)
    groups = check_groups(groups, X, y)
    scorer = check_scoring(model, scoring)
    splitter = make_splitter(model, y, groups, cv)
    folds = check_folds(splitter.split(X, y, groups), _num_samples(X), least=None)
    warn_of_divided(folds, groups, stacklevel=3)
    rest = model[1:]
    for_fit = groups_for(rest, groups)
    outcomes = Parallel(n_jobs=n_jobs)(
        delayed(_score_subsets)(
            sensors, rest, subsets, scorer, X, y, train, test, for_fit
        )
        for train, test in folds
    )
    return _as_cv_results(subsets, outcomes)


def _split_sensors(model):
    """Return the ColumnTransformer of each sensor alone, by the sensor's name."""
    first = model[0] if isinstance(model, Pipeline) and len(model) > 1 else None
    if not isinstance(first, ColumnTransformer):
        raise TypeError(
            "model must be a Pipeline of a ColumnTransformer, with one transformer per "
            "sensor, and a predictor; apply what comes before, such as repairs, first."
        )
    used = [entry for entry in first.transformers if entry[1] != "drop"]
    sensors = {
        entry[0]: clone(first).set_params(transformers=[entry]) for entry in used
    }
    if first.remainder != "drop" or not 0 < len(sensors) == len(used):
        raise ValueError(
            "model must begin with a ColumnTransformer with remainder='drop' and one "
            "transformer for each sensor, with a name of its own."
        )
    return sensors


def _score_subsets(sensors, rest, subsets, scorer, X, y, train, test, params):
    """Return the seconds and the scores of each subset on one fold."""
    X_train, X_test = _safe_indexing(X, train), _safe_indexing(X, test)
    y_train, y_test = _safe_indexing(y, train), _safe_indexing(y, test)
    params = _check_method_params(X, params, indices=train)
    features = {}
    for name in sensors:
        sensor = clone(sensors[name])
        Z_train, fit_time = timed(sensor.fit_transform, X_train, y_train)
        Z_test, score_time = timed(sensor.transform, X_test)
        if not isinstance(Z_train, np.ndarray) and not hasattr(Z_train, "columns"):
            raise TypeError(
                f"The features of sensor {name!r} are a {type(Z_train).__name__}, "
                "which is not supported; let its transformer return a dense array."
            )
        use = seconds_per_trial(without_caches(sensor).transform, X_test)
        features[name] = Z_train, Z_test, (fit_time, score_time, use)
    outcomes = []
    for subset in subsets:
        Z_train, Z_test, seconds = zip(*map(features.get, subset))
        Z_train, Z_test = _side_by_side(Z_train), _side_by_side(Z_test)
        fit = partial(clone(rest).fit, **params)
        fitted, fit_time = timed(fit, Z_train, y_train)
        scores, score_time = timed(scorer, fitted, Z_test, y_test)
        use = seconds_per_trial(predictor(fitted), Z_test)
        *seconds, use = np.sum([*seconds, (fit_time, score_time, use)], axis=0)
        scores = scores if isinstance(scores, Mapping) else {"score": scores}
        outcomes.append((seconds, {**scores, COST: -use}))
    return outcomes


def _side_by_side(parts):
    """Join the features of several sensors as a ColumnTransformer does."""
    if isinstance(parts[0], np.ndarray):
        return np.hstack(parts)
    return _get_adapter_from_container(parts[0]).hstack(parts)


def _as_cv_results(subsets, folds):
    """Put what the folds returned into the form of ``cv_results_``."""
    results = {
        "params": [{"sensors": subset} for subset in subsets],
        "param_sensors": subsets,
    }
    seconds = np.array([[seconds for seconds, _ in fold] for fold in folds])
    for key, times in zip(["fit_time", "score_time"], seconds.T):
        results |= {f"mean_{key}": times.mean(axis=1), f"std_{key}": times.std(axis=1)}
    for metric in folds[0][0][1]:
        scores = np.array([[scores[metric] for _, scores in fold] for fold in folds]).T
        mean = scores.mean(axis=1)
        with np.errstate(invalid="ignore"):  # scores may be infinite
            std = scores.std(axis=1)
        ranks = rankdata(-np.nan_to_num(mean, nan=-np.inf), method="min")
        results |= {
            **{f"split{k}_test_{metric}": split for k, split in enumerate(scores.T)},
            f"mean_test_{metric}": mean,
            f"std_test_{metric}": std,
            f"rank_test_{metric}": ranks.astype(np.int32),
        }
    return pd.DataFrame(results)
