"""How accuracy trades with speed over the candidates of a search."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count, takewhile
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_is_fitted

from ..utils._sklearn import BaseSearchCV

# Name of what `neg_seconds_scorer` measures, in a search and in `sensor_subsets`.
COST = "neg_seconds"

# Times that differ by less than this factor count as equal, as those of one model do.
_SAME_TIME = 1.1


def speed_accuracy_frontier(
    search: BaseSearchCV | Mapping[str, Any] | pd.DataFrame,
    *,
    metric: str | None = None,
) -> pd.DataFrame:
    """Return the candidates of a search that no other beats in time and score.

    A candidate is on the frontier if no other is at least as fast, scores at least as
    well, and is better in one of the two. Every other candidate can be replaced by one
    of these at no loss.

    Parameters
    ----------
    search : fitted search, dict or DataFrame
        A fitted ``GridSearchCV``, ``RandomizedSearchCV``,
        ``HalvingGridSearchCV`` or ``HalvingRandomSearchCV``, or its
        ``cv_results_``; or the table of :func:`sensor_subsets`. Of successive halving
        only the last iteration counts: times and scores at fewer resources do not
        compare.
    metric : str, default=None
        Name of the score in a search with several; by default that of its
        ``refit`` if this is a name.

    Returns
    -------
    frontier : DataFrame of shape (n_non_dominated, n_parameters + 3)
        One row per candidate, from the fastest to the best, so that the score rises
        with the time. Its index is the candidate's position in ``cv_results_``.
        Columns: ``param_…``, each parameter; ``seconds``, the time that the fitted
        model takes to predict one trial, as :func:`neg_seconds_scorer` measures it,
        mean over the folds; ``score``, the mean test score, higher being better;
        ``score_se``, its standard error. Candidates equal in both time and score are
        all kept, in the order of the search.

    Raises
    ------
    ValueError
        If the metric is unknown or not given among several, the search has no score
        "neg_seconds", there are fewer than two splits, or no score is finite.

    See Also
    --------
    neg_seconds_scorer : Time how each candidate of a search predicts.
    cheapest_within_one_se : Choose one of them.
    sklearn_haptic.plotting.SpeedAccuracyDisplay : Plot them.

    Notes
    -----
    Searches by successive halving take a single score. To time their candidates, let
    ``scoring`` be a function of an estimator, X and y that returns a dict with "score"
    and "neg_seconds", and ``refit`` any callable.

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
    params = list(getattr(search, "cv_results_", search)["params"])
    on_frontier = np.flatnonzero(is_non_dominated(candidates.seconds, candidates.score))
    rows = on_frontier[np.argsort(candidates.seconds[on_frontier], kind="stable")]
    index = candidates.position[rows]
    table = pd.DataFrame([params[i] for i in index], index=index).add_prefix("param_")
    return table.assign(
        seconds=candidates.seconds[rows],
        score=candidates.score[rows],
        score_se=candidates.score_se[rows],
    )


def cheapest_within_one_se(
    cv_results: BaseSearchCV | Mapping[str, Any] | pd.DataFrame,
    *,
    metric: str | None = None,
) -> int:
    """Return the fastest candidate within one standard error of the best score.

    Give it to ``refit=`` of a search. The search then refits the fastest candidate
    whose mean test score is at most one standard error, that of the best candidate,
    below the best. The time is that to predict one trial, so search with
    ``scoring={"rps": neg_rps_scorer, "neg_seconds": neg_seconds_scorer}``.

    Parameters
    ----------
    cv_results : dict, DataFrame or fitted search
        The ``cv_results_`` of a search, the table of :func:`sensor_subsets`, or the
        search.
    metric : str, default=None
        Name of the score in a search with several beside "neg_seconds"; pass
        ``refit=functools.partial(cheapest_within_one_se, metric="rps")``.

    Returns
    -------
    index : int
        Position of the candidate in ``cv_results``. Candidates up to a tenth slower
        than the fastest count as equally fast, because times of one and the same model
        differ by that much. Of these, the one with the best score is chosen; among
        those of equal score the faster, then the first. If several are best, the
        standard error is that of the fastest of them.

    Raises
    ------
    ValueError
        If the metric is unknown or not given among several, the search has no score
        "neg_seconds", there are fewer than two splits, or no score is finite.

    See Also
    --------
    neg_seconds_scorer : Time how each candidate of a search predicts.
    speed_accuracy_frontier : Return all candidates that no other beats in both.

    Notes
    -----
    The folds of one cross-validation share training trials, and repeated folds share
    test trials too, so their scores are not independent. Their standard error is then
    too small, the more so the more repeats there are, and the rule picks slower
    candidates than it would with the true standard error.

    With a callable ``refit`` a search has no ``best_score_``; see
    ``cv_results_["mean_test_rps"][best_index_]``. Searches by successive halving
    ignore what the callable returns. Call this function on them once they are fitted;
    it then chooses from the last iteration.

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
    return int(candidates.position[cheapest])


class Candidates(NamedTuple):
    """The candidates of a search that have a finite score and cost, for one metric."""

    position: np.ndarray  # in cv_results_
    seconds: np.ndarray  # mean cost, lower is better
    score: np.ndarray  # mean test score, higher is better
    score_se: np.ndarray  # its standard error
    metric: str


def read_candidates(search, metric):
    """Read cost, score and standard error of each candidate of a search.

    The search, its ``cv_results_`` and the metric are those of
    `speed_accuracy_frontier`, and so are the errors. In a search by successive halving
    only the last iteration counts. The arrays are in the order of the search.
    """
    if isinstance(search, (Mapping, pd.DataFrame)):
        results = {name: np.asarray(column) for name, column in search.items()}
    else:
        check_is_fitted(search, "cv_results_")
        results = search.cv_results_
        if metric is None and search.multimetric_ and isinstance(search.refit, str):
            metric = search.refit
    metric = _check_metric(results, metric)
    score, score_se = _mean_and_se(results, metric)
    if f"mean_test_{COST}" not in results:
        raise ValueError(
            f"The search has no score {COST!r}, the time that a candidate takes to "
            f"predict; add {COST!r}: neg_seconds_scorer to its scoring."
        )
    seconds = np.negative(results[f"mean_test_{COST}"])
    usable = np.isfinite(score) & np.isfinite(score_se) & np.isfinite(seconds)
    if "iter" in results:
        usable &= results["iter"] == np.max(results["iter"])
    if not usable.any():
        raise ValueError(
            f"No candidate has a finite test score for metric={metric!r}; set "
            "error_score='raise' in the search to see why they failed."
        )
    kept = np.flatnonzero(usable)
    return Candidates(kept, seconds[kept], score[kept], score_se[kept], metric)


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
