"""Predictions for objects never touched, and choosing models by what accuracy costs.

:func:`cross_val_predict_proba` predicts each trial by a model that was fitted without
it; scikit-learn's function of nearly this name must not be used with counts.

A *candidate* is one setting of the parameters that a search tried. Its cost is the
seconds that the fitted model takes to predict one trial, all steps included, without
caches; :func:`neg_seconds_scorer` measures it. Its score is the mean test score over
the folds, higher being better, and its standard error the standard deviation of the
folds' scores over the square root of their number. Candidates whose score or cost is
not finite, such as those whose fit failed, are left out.

The sensors of a model are such a choice too: :func:`sensor_subsets` tries them all.
:func:`sensor_contributions` holds out one after the other where a model combines them.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations, count, takewhile
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.stats import rankdata
from sklearn.base import clone
from sklearn.compose import ColumnTransformer
from sklearn.metrics import check_scoring
from sklearn.pipeline import Pipeline
from sklearn.utils import _safe_indexing, indexable
from sklearn.utils._set_output import _get_adapter_from_container
from sklearn.utils.parallel import Parallel, delayed
from sklearn.utils.validation import _check_method_params, check_is_fitted

from ._contributions import contribution_summary, sensor_contributions
from ._cost import (
    neg_seconds_scorer,
    predictor,
    seconds_per_trial,
    timed,
    without_caches,
)
from ._folds import make_splitter, route
from ._out_of_fold import cross_val_predict_proba
from ._typing import CrossValidator, Scorer, Trials
from ._validation import check_groups

if TYPE_CHECKING:
    from sklearn.model_selection._search import BaseSearchCV

__all__ = [
    "cheapest_within_one_se",
    "contribution_summary",
    "cross_val_predict_proba",
    "neg_seconds_scorer",
    "sensor_contributions",
    "sensor_subsets",
    "speed_accuracy_frontier",
]


# Name of what `neg_seconds_scorer` measures, in a search and in `sensor_subsets`.
_COST = "neg_seconds"
# Times that differ by a smaller factor are equal: those of one model do, too.
_SAME_TIME = 1.1


class Candidates(NamedTuple):
    """The candidates of a search that have a finite score and cost, for one metric."""

    index: np.ndarray  # type: ignore[assignment]  # position in cv_results_
    seconds: np.ndarray  # mean cost, lower is better
    score: np.ndarray  # mean test score, higher is better
    score_se: np.ndarray  # its standard error
    metric: str
    cost: str  # what the seconds are


def read_candidates(search, metric=None):
    """Read cost, score and standard error of each candidate of a search.

    Parameters
    ----------
    search : fitted search or dict
        The search, or its ``cv_results_``. Of a search by successive halving only
        the last iteration counts, the one with the most resources.
    metric : str, default=None
        Name of the score; by default that of ``refit``, or the only one.

    Returns
    -------
    candidates : Candidates
        Arrays of shape (n_candidates,), in the order of the search.

    Raises
    ------
    ValueError
        If the metric is unknown or not given among several, there are fewer than
        two splits, or no score is finite.

    Warns
    -----
    UserWarning
        If the search did not time the use of its candidates. Their cost is then the
        mean time to fit and score them on one fold.
    """
    if isinstance(search, Mapping):
        results = search
    else:
        check_is_fitted(search, "cv_results_")
        results = search.cv_results_
        if metric is None and search.multimetric_ and isinstance(search.refit, str):
            metric = search.refit
    metric = _check_metric(results, metric)
    score, score_se = _mean_and_se(results, metric)
    is_timed = f"mean_test_{_COST}" in results
    if is_timed:
        seconds = np.negative(results[f"mean_test_{_COST}"])
        cost = "time to predict, seconds a trial"
    else:
        seconds = _fit_and_score_time(results)
        cost = "time to fit and score, seconds a fold"
    usable = np.isfinite(score) & np.isfinite(score_se) & np.isfinite(seconds)
    if "iter" in results:
        usable &= results["iter"] == np.max(results["iter"])
    if not usable.any():
        raise ValueError(
            f"No candidate has a finite test score for metric={metric!r}; set "
            "error_score='raise' in the search to see why they failed."
        )
    if not is_timed:
        warnings.warn(
            f"The search has no score {_COST!r}, the time that a candidate takes to "
            "predict; its time to fit and score stands for it, which caches falsify. "
            f"Add {_COST!r}: neg_seconds_scorer to the scoring of the search.",
            UserWarning,
            stacklevel=3,
        )
    index = np.flatnonzero(usable)
    return Candidates(
        index, seconds[index], score[index], score_se[index], metric, cost
    )


def _mean_and_se(results, metric):
    """Mean of a score over the splits and its standard error, of each candidate."""
    columns = (f"split{split}_test_{metric}" for split in count())
    splits = [results[column] for column in takewhile(results.__contains__, columns)]
    if len(splits) < 2:
        raise ValueError(
            f"The search has the test scores of {len(splits)} split, but a standard "
            "error requires at least two; choose cv with more splits."
        )
    splits = np.column_stack(splits).astype(np.float64, copy=False)
    with np.errstate(invalid="ignore"):  # scores may be infinite
        se = splits.std(axis=1, ddof=1) / np.sqrt(splits.shape[1])
    return np.asarray(results[f"mean_test_{metric}"], dtype=np.float64), se


def _fit_and_score_time(results):
    """Mean seconds to fit and score each candidate on one fold."""
    for time in ("mean_fit_time", "mean_score_time"):
        if time not in results:
            raise ValueError(
                f"The search has no {time!r}; give a fitted search or its cv_results_."
            )
    return np.add(results["mean_fit_time"], results["mean_score_time"])


def is_non_dominated(cost, score):
    """Whether nothing is both as cheap and as good, and better in one of the two.

    Parameters
    ----------
    cost : ndarray of shape (n_candidates,)
        Lower is better.
    score : ndarray of shape (n_candidates,)
        Higher is better.

    Returns
    -------
    mask : ndarray of shape (n_candidates,)
        True on the frontier. Candidates equal in both do not dominate each other.
    """
    costs, group = np.unique(cost, return_inverse=True)
    best = np.full(len(costs), -np.inf)
    np.maximum.at(best, group, score)
    best_if_cheaper = np.append(-np.inf, np.maximum.accumulate(best)[:-1])
    return (score == best[group]) & (score > best_if_cheaper[group])


def best_and_cheapest(candidates):
    """Choose by score, and by cost within one standard error of the best score.

    Costs up to a tenth above the lowest are as low: of these, the best score.

    Parameters
    ----------
    candidates : Candidates
        As read by :func:`read_candidates`.

    Returns
    -------
    best, cheapest : int
        Positions in the arrays of ``candidates``.
    """
    _, seconds, score, score_se, *_ = candidates
    best = np.lexsort((seconds, -score))[0]
    near = np.flatnonzero(score >= score[best] - score_se[best])
    near = near[seconds[near] <= _SAME_TIME * seconds[near].min()]
    cheapest = near[np.lexsort((seconds[near], -score[near]))[0]]
    return int(best), int(cheapest)


def speed_accuracy_frontier(
    search: BaseSearchCV | Mapping[str, Any], *, metric: str | None = None
) -> pd.DataFrame:
    """Table of the candidates of a search that no other beats in time and score.

    A candidate is on the frontier if no other is as fast and scores as well, and
    is better in one of the two. Every other candidate can be replaced by one of
    these at no loss.

    Parameters
    ----------
    search : fitted search or dict
        A fitted ``GridSearchCV``, ``RandomizedSearchCV``,
        ``HalvingGridSearchCV`` or ``HalvingRandomSearchCV``, or its
        ``cv_results_``. Of successive halving only the last iteration counts:
        times and scores at fewer resources do not compare.
    metric : str, default=None
        Name of the score in a search with several; by default that of its
        ``refit`` if this is a name.

    Returns
    -------
    frontier : DataFrame of shape (n_non_dominated, n_parameters + 3)
        A row a candidate, from the fastest to the best, so that the score rises
        with the time. Its index is the candidate's position in ``cv_results_``.
        Columns: ``param_…``, each parameter; ``seconds``, what the fitted model takes
        to predict one trial, as :func:`neg_seconds_scorer` measures it, mean over the
        folds; ``score``, the mean test score, higher being better; ``score_se``, its
        standard error. Candidates equal in both time and score are all kept, in the
        order of the search.

    Raises
    ------
    ValueError
        If the metric is unknown or not given among several, there are fewer than
        two splits, or no score is finite.

    Warns
    -----
    UserWarning
        If the search has no score "neg_seconds". The seconds are then the mean time
        to fit and score on one fold. With ``memory=`` in a pipeline that is no cost
        of a candidate: whichever comes first pays for the steps that all share.

    See Also
    --------
    neg_seconds_scorer : Times the use of each candidate in a search.
    cheapest_within_one_se : Choose one of them.
    sklearn_haptic.plotting.SpeedAccuracyDisplay : Look at them.

    Notes
    -----
    Searches by successive halving take one score. Let ``scoring`` be a function of an
    estimator, X and y that returns a dict with a "score" and "neg_seconds", and
    ``refit`` any callable.

    Examples
    --------
    >>> from sklearn_haptic.model_selection import speed_accuracy_frontier
    >>> cv_results = {
    ...     "params": [{"n_hidden": 0}, {"n_hidden": 10}, {"n_hidden": 30}],
    ...     "split0_test_neg_seconds": [-0.01, -0.03, -0.08],
    ...     "split1_test_neg_seconds": [-0.01, -0.03, -0.08],
    ...     "mean_test_neg_seconds": [-0.01, -0.03, -0.08],
    ...     "split0_test_rps": [-0.75, -0.25, -0.5],
    ...     "split1_test_rps": [-0.25, -0.25, -0.5],
    ...     "mean_test_rps": [-0.5, -0.25, -0.5],
    ... }
    >>> speed_accuracy_frontier(cv_results)
       param_n_hidden  seconds  score  score_se
    0               0     0.01  -0.50      0.25
    1              10     0.03  -0.25      0.00
    """
    candidates = read_candidates(search, metric)
    params = getattr(search, "cv_results_", search)["params"]
    on_frontier = np.flatnonzero(is_non_dominated(candidates.seconds, candidates.score))
    rows = on_frontier[np.argsort(candidates.seconds[on_frontier], kind="stable")]
    index = candidates.index[rows]
    table = pd.DataFrame([params[i] for i in index], index=index).add_prefix("param_")
    return table.assign(
        seconds=candidates.seconds[rows],
        score=candidates.score[rows],
        score_se=candidates.score_se[rows],
    )


def cheapest_within_one_se(
    cv_results: BaseSearchCV | Mapping[str, Any], *, metric: str | None = None
) -> int:
    """Fastest candidate whose score is within one standard error of the best.

    For ``refit=`` of a search: it then refits the fastest candidate whose mean
    test score is no more than one standard error, that of the best candidate,
    below the best. The time is that to predict one trial: search with
    ``scoring={"rps": neg_rps_scorer, "neg_seconds": neg_seconds_scorer}``.

    Parameters
    ----------
    cv_results : dict or fitted search
        The ``cv_results_`` of a search, or the search.
    metric : str, default=None
        Name of the score in a search with several beside "neg_seconds": pass
        ``refit=functools.partial(cheapest_within_one_se, metric="rps")``.

    Returns
    -------
    index : int
        Position of the candidate in ``cv_results``. Candidates up to a tenth slower
        than the fastest are as fast, since the times of one and the same model differ
        by that much: of these, the one with the best score; among those equal in
        score, the faster, then the first. Of several best, the standard error of the
        fastest counts.

    Raises
    ------
    ValueError
        If the metric is unknown or not given among several, there are fewer than
        two splits, or no score is finite.

    Warns
    -----
    UserWarning
        If the search has no score "neg_seconds"; the mean time to fit and score on one
        fold then stands for it, which caches falsify.

    See Also
    --------
    neg_seconds_scorer : Times the use of each candidate in a search.
    speed_accuracy_frontier : All candidates that no other beats in both.

    Notes
    -----
    The folds of one cross-validation share training trials, and those of repeated
    grouped folds test trials too, so that their scores are not independent. Their
    standard error is then too small, the more so the more repeats, and the
    rule picks slower candidates than it would with the true one.

    With a callable ``refit`` a search has no ``best_score_``; see
    ``cv_results_["mean_test_rps"][best_index_]``. Searches by successive halving
    ignore what it returns: call this function on them once they are fitted. It
    then chooses from the last iteration.

    References
    ----------
    L. Breiman, J. H. Friedman, R. A. Olshen and C. J. Stone, "Classification and
    regression trees", Wadsworth, 1984, section 3.4.3.
    :doi:`10.1201/9781315139470`

    T. Hastie, R. Tibshirani and J. Friedman, "The elements of statistical
    learning", 2nd edition, Springer, 2009, section 7.10.
    :doi:`10.1007/978-0-387-84858-7`

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
    candidates = read_candidates(cv_results, metric)
    _, cheapest = best_and_cheapest(candidates)
    return int(candidates.index[cheapest])


def sensor_subsets(
    model: Pipeline,
    X: Trials,
    y: ArrayLike,
    *,
    groups: ArrayLike | None = None,
    cv: CrossValidator = None,
    scoring: str | Scorer | Sequence[str] | Mapping[str, str | Scorer] | None = None,
    n_jobs: int | None = None,
) -> dict[str, Any]:
    """Cross-validate a model with every subset of its sensors.

    Which sensors earn their time? The features of a sensor do not depend on the
    other sensors, so that those of each are computed once a fold, and timed; only
    the rest of the model is fitted and scored again for each of the 2^n - 1 subsets.
    The scores are those of a ``GridSearchCV`` over a model whose other sensors are
    set to ``"drop"``.

    Parameters
    ----------
    model : Pipeline
        Its first step is a :class:`~sklearn.compose.ColumnTransformer` with one
        transformer a sensor, its last a predictor, such as
        :class:`~sklearn_haptic.DistributionalOrdinalRegressor`. Transformers set to
        ``"drop"`` are not tried.
    X : DataFrame or array-like of shape (n_trials, n_columns)
        The trials.
    y : array-like of shape (n_trials,) or (n_trials, n_levels)
        Labels, or how many people gave each level.
    groups : array-like of shape (n_trials,), default=None
        The object of each trial, for the splitter. With metadata routing enabled, also
        for ``fit`` of those steps behind the sensors that request it, such as a network
        that stops early.
    cv : int, splitter or iterable, default=None
        The folds. An int, or None for 5, is a number of folds: of whole objects if
        ``groups`` are given, else as in
        :class:`~sklearn.model_selection.GridSearchCV`.
    scoring : str, callable, list, tuple or dict, default=None
        As in :class:`~sklearn.model_selection.GridSearchCV`; None is the model's
        own ``score``.
    n_jobs : int, default=None
        Number of jobs; one fits and scores all subsets on one fold.

    Returns
    -------
    cv_results : dict
        In the form of ``GridSearchCV.cv_results_``, a candidate a subset, small
        subsets first: ``params``, each ``{"sensors": (name, ...)}``;
        ``param_sensors``; ``split0_test_score`` and so on; mean and standard
        deviation over folds of the test score, ``rank_test_score``; the same of the
        score "neg_seconds", minus the seconds to predict one trial, as
        :func:`neg_seconds_scorer` measures it; and mean and standard deviation of the
        time to fit and to score, in seconds. A time of a subset is the sum of those of
        its sensors and of the rest of the model.

    Raises
    ------
    TypeError
        If ``model`` is no Pipeline that begins with a ColumnTransformer, or the
        features of a sensor are neither an array nor a DataFrame of pandas or polars.
    ValueError
        If nothing follows the ColumnTransformer, its ``remainder`` is not
        ``"drop"``, its transformers are all dropped or share a name, or a trial has
        no group.

    See Also
    --------
    speed_accuracy_frontier : The subsets that no other beats in time and score.
    cheapest_within_one_se : The fastest within reach of the best.
    sklearn_haptic.plotting.SpeedAccuracyDisplay : Look at them.

    Notes
    -----
    A ``memory=`` in the model, or in one of its parts, falsifies the times to fit and
    to score, but not "neg_seconds", for which caches are off. Other jobs on the machine
    falsify all times: where small differences matter use ``n_jobs=1``.

    Random states that are integers give each subset the features and the model that
    it would have alone. A fit that fails raises its error.

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
    ...     make_haptic_pipeline(sensors, preset="fast", random_state=0),
    ...     corpus.trials,
    ...     corpus.ratings["hard"],
    ...     groups=corpus.objects,
    ...     cv=GroupKFold(3),
    ...     scoring=neg_rps_scorer,
    ... )
    >>> [params["sensors"] for params in results["params"]][2:5]
    [('tdc',), ('pdc', 'tac'), ('pdc', 'tdc')]
    """
    sensors = _split_sensors(model)
    subsets = [
        subset
        for size in range(1, len(sensors) + 1)
        for subset in combinations(sensors, size)
    ]
    X, y = indexable(X, y)
    groups = check_groups(groups, X)
    scorer = check_scoring(model, scoring)
    splitter = make_splitter(model, y, groups, cv)
    rest = model[1:]
    for_split, for_fit = route(rest, splitter, groups, {})
    folds = Parallel(n_jobs=n_jobs)(
        delayed(_score_subsets)(
            sensors, rest, subsets, scorer, X, y, train, test, for_fit
        )
        for train, test in splitter.split(X, y, **for_split)
    )
    return _as_cv_results(subsets, folds)


def _check_metric(results, metric):
    """Return the name of the score to use, if the results leave no doubt."""
    prefix = "mean_test_"
    known = [key.removeprefix(prefix) for key in results if key.startswith(prefix)]
    known = [name for name in known if name != _COST]
    if metric is None and len(known) == 1:
        return known[0]
    if metric not in known:
        problem = "missing" if metric is None else f"{metric!r}, which is unknown"
        raise ValueError(
            f"metric is {problem}; choose one of the search's scores: {known}."
        )
    return metric


def _split_sensors(model):
    """Return the ColumnTransformer of each sensor alone, by the sensor's name."""
    first = model[0] if isinstance(model, Pipeline) else model
    if first is model or not isinstance(first, ColumnTransformer):
        raise TypeError(
            "model must be a Pipeline that begins with a ColumnTransformer with one "
            f"transformer a sensor, but it begins with a {type(first).__name__}."
        )
    if len(model) == 1:
        raise ValueError("model ends with its ColumnTransformer; add a predictor.")
    if not isinstance(first.remainder, str) or first.remainder != "drop":
        raise ValueError(
            f"model has a ColumnTransformer with remainder={first.remainder!r}, which "
            "is no sensor; set it to 'drop' and name a transformer for each sensor."
        )
    entries = [
        (name, transformer, columns)
        for name, transformer, columns in first.transformers
        if not isinstance(transformer, str) or transformer != "drop"
    ]
    sensors = {
        entry[0]: clone(first).set_params(transformers=[entry]) for entry in entries
    }
    if not 0 < len(sensors) == len(entries):
        raise ValueError(
            "model has a ColumnTransformer whose transformers are all dropped or share "
            f"a name: {[name for name, *_ in first.transformers]}; give each sensor "
            "one of its own."
        )
    return sensors


def _score_subsets(sensors, rest, subsets, scorer, X, y, train, test, params):
    """Seconds to fit and to score, and the scores, of each subset on one fold."""
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
        outcomes.append((seconds, {**scores, _COST: -use}))
    return outcomes


def _side_by_side(parts):
    """Features of several sensors as a ColumnTransformer puts them together."""
    if isinstance(parts[0], np.ndarray):
        return np.hstack(parts)
    return _get_adapter_from_container(parts[0]).hstack(parts)


def _as_cv_results(subsets, folds):
    """Put what the folds returned into the form of ``cv_results_``."""
    results = {
        "params": [{"sensors": subset} for subset in subsets],
        "param_sensors": np.fromiter(subsets, dtype=object, count=len(subsets)),
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
    return results
