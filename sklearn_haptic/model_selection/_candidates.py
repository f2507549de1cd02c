"""Cost and score of the candidates of a search, and choices among them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from itertools import count, takewhile
from typing import NamedTuple

import numpy as np
from sklearn.utils.validation import check_is_fitted

# Name of what `neg_seconds_scorer` measures, in a search and in `sensor_subsets`.
COST = "neg_seconds"

# Times that differ by less than this factor count as equal, as those of one model do.
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

    The search, its ``cv_results_`` and the metric are those of
    `speed_accuracy_frontier`, and so are the errors and the warning where the search
    did not time how its candidates predict: their cost is then the mean time to fit and
    score them on one fold. In a search by successive halving only the last iteration
    counts. The arrays are in the order of the search.
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
    is_timed = f"mean_test_{COST}" in results
    if is_timed:
        seconds = np.negative(results[f"mean_test_{COST}"])
        cost = "time to predict, seconds per trial"
    else:
        seconds = _fit_and_score_time(results)
        cost = "time to fit and score, seconds per fold"
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
            f"The search has no score {COST!r}, the time that a candidate takes to "
            "predict; its time to fit and score stands for it, which caches falsify. "
            f"Add {COST!r}: neg_seconds_scorer to the scoring of the search.",
            UserWarning,
            stacklevel=3,
        )
    index = np.flatnonzero(usable)
    return Candidates(
        index, seconds[index], score[index], score_se[index], metric, cost
    )


def _mean_and_se(results, metric):
    """Return each candidate's mean score over the splits, and its standard error."""
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
    """Return each candidate's mean seconds to fit and score on one fold."""
    for time in ("mean_fit_time", "mean_score_time"):
        if time not in results:
            raise ValueError(
                f"The search has no {time!r}; give a fitted search or its cv_results_."
            )
    return np.add(results["mean_fit_time"], results["mean_score_time"])


def _check_metric(results, metric):
    """Return the name of the score to use, if the results leave no doubt."""
    prefix = "mean_test_"
    known = [key.removeprefix(prefix) for key in results if key.startswith(prefix)]
    known = [name for name in known if name != COST]
    if metric is None and len(known) == 1:
        return known[0]
    if metric not in known:
        problem = "missing" if metric is None else f"{metric!r}, which is unknown"
        raise ValueError(
            f"metric is {problem}; choose one of the search's scores: {known}."
        )
    return metric


def is_non_dominated(cost, score):
    """Tell which candidates no other beats in cost and score, both of one shape.

    Lower cost and higher score are better. Candidates equal in both do not dominate
    each other.
    """
    costs, group = np.unique(cost, return_inverse=True)
    best = np.full(len(costs), -np.inf)
    np.maximum.at(best, group, score)
    best_if_cheaper = np.append(-np.inf, np.maximum.accumulate(best)[:-1])
    return (score == best[group]) & (score > best_if_cheaper[group])


def best_and_cheapest(candidates):
    """Choose by score, and by cost within one standard error of the best score.

    Costs up to a tenth above the lowest count as equally low; of these candidates, the
    one with the best score is chosen. Returned are the positions of the best and of the
    cheapest in the arrays of `candidates`.
    """
    _, seconds, score, score_se, *_ = candidates
    best = np.lexsort((seconds, -score))[0]
    near = np.flatnonzero(score >= score[best] - score_se[best])
    near = near[seconds[near] <= _SAME_TIME * seconds[near].min()]
    cheapest = near[np.lexsort((seconds[near], -score[near]))[0]]
    return int(best), int(cheapest)
