"""What accuracy costs: choosing among the candidates of a search by time and score.

A *candidate* is one setting of the parameters that a search tried. Its cost is
the mean time in seconds to fit and score it on one fold, its score the mean test
score over the folds, higher being better, and its standard error the standard
deviation of the folds' scores over the square root of their number. Candidates
whose score is not finite, such as those whose fit failed, are left out.
"""

from collections.abc import Mapping
from itertools import count, takewhile
from typing import NamedTuple

import numpy as np
from sklearn.utils.validation import check_is_fitted


class Candidates(NamedTuple):
    """The candidates of a search that have a finite score, for one metric."""

    index: np.ndarray  # position in cv_results_
    seconds: np.ndarray  # mean time to fit and score, a fold
    score: np.ndarray  # mean test score, higher is better
    score_se: np.ndarray  # its standard error
    metric: str


def read_candidates(search, metric=None):
    """Read time, score and standard error of each candidate of a search.

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
    """
    if isinstance(search, Mapping):
        results = search
    else:
        check_is_fitted(search, "cv_results_")
        results = search.cv_results_
        if metric is None and search.multimetric_ and isinstance(search.refit, str):
            metric = search.refit
    metric = _check_metric(results, metric)
    columns = (f"split{split}_test_{metric}" for split in count())
    scores = [results[column] for column in takewhile(results.__contains__, columns)]
    if len(scores) < 2:
        raise ValueError(
            f"The search has the test scores of {len(scores)} split, but a standard "
            "error requires at least two; choose cv with more splits."
        )
    scores = np.column_stack(scores).astype(np.float64, copy=False)
    usable = np.isfinite(scores).all(axis=1)
    if "iter" in results:
        usable &= results["iter"] == np.max(results["iter"])
    if not usable.any():
        raise ValueError(
            f"No candidate has a finite test score for metric={metric!r}; set "
            "error_score='raise' in the search to see why they failed."
        )
    index = np.flatnonzero(usable)
    seconds = np.add(results["mean_fit_time"], results["mean_score_time"])
    return Candidates(
        index=index,
        seconds=seconds[index],
        score=np.asarray(results[f"mean_test_{metric}"], dtype=np.float64)[index],
        score_se=scores[index].std(axis=1, ddof=1) / np.sqrt(scores.shape[1]),
        metric=metric,
    )


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
    """Choose by score, and by time within one standard error of the best score.

    Parameters
    ----------
    candidates : Candidates
        As read by :func:`read_candidates`.

    Returns
    -------
    best, cheapest : int
        Positions in the arrays of ``candidates``.
    """
    _, seconds, score, score_se, _ = candidates
    best = np.lexsort((seconds, -score))[0]
    near = np.flatnonzero(score >= score[best] - score_se[best])
    cheapest = near[np.lexsort((-score[near], seconds[near]))[0]]
    return int(best), int(cheapest)


def speed_accuracy_frontier(search, *, metric=None):
    """Table of the candidates of a search that no other beats in time and score.

    A candidate is on the frontier if no other is as fast and scores as well, and
    is better in one of the two. Every other candidate can be replaced by one of
    these at no loss. Requires pandas: ``pip install sklearn_haptic[plot]``.

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
        Columns: ``param_…``, each parameter; ``seconds``, the mean time to fit and
        score on one fold, in seconds; ``score``, the mean test score, higher being
        better; ``score_se``, its standard error. Candidates equal in both time and
        score are all kept, in the order of the search.

    Raises
    ------
    ValueError
        If the metric is unknown or not given among several, there are fewer than
        two splits, or no score is finite.
    ImportError
        If pandas is not installed.

    See Also
    --------
    cheapest_within_one_se : Choose one of them.
    sklearn_haptic.plotting.SpeedAccuracyDisplay : Look at them.

    Notes
    -----
    Measured times depend on the machine and its load: search with ``n_jobs=1``
    where small differences matter. With ``memory=`` in a pipeline, whichever
    candidate comes first pays for the steps that the others share.

    Examples
    --------
    >>> from sklearn_haptic.model_selection import speed_accuracy_frontier
    >>> cv_results = {
    ...     "params": [{"n_hidden": 0}, {"n_hidden": 10}, {"n_hidden": 30}],
    ...     "mean_fit_time": [0.5, 2.5, 7.5],
    ...     "mean_score_time": [0.5, 0.5, 0.5],
    ...     "split0_test_score": [-0.75, -0.25, -0.5],
    ...     "split1_test_score": [-0.25, -0.25, -0.5],
    ...     "mean_test_score": [-0.5, -0.25, -0.5],
    ... }
    >>> speed_accuracy_frontier(cv_results)
       param_n_hidden  seconds  score  score_se
    0               0      1.0  -0.50      0.25
    1              10      3.0  -0.25      0.00
    """
    try:
        import pandas as pd
    except ImportError as error:
        raise ImportError(
            "speed_accuracy_frontier requires pandas; install it with "
            "`pip install sklearn_haptic[plot]`."
        ) from error
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


def cheapest_within_one_se(cv_results, *, metric=None):
    """Fastest candidate whose score is within one standard error of the best.

    For ``refit=`` of a search: it then refits the fastest candidate whose mean
    test score is no more than one standard error, that of the best candidate,
    below the best.

    Parameters
    ----------
    cv_results : dict or fitted search
        The ``cv_results_`` of a search, or the search.
    metric : str, default=None
        Name of the score in a search with several: pass
        ``refit=functools.partial(cheapest_within_one_se, metric="rps")``.

    Returns
    -------
    index : int
        Position of the candidate in ``cv_results``. Among candidates equally
        fast, the better; among those equal in both, the first. Of several best,
        the standard error of the fastest counts.

    Raises
    ------
    ValueError
        If the metric is unknown or not given among several, there are fewer than
        two splits, or no score is finite.

    See Also
    --------
    speed_accuracy_frontier : All candidates that no other beats in both.

    Notes
    -----
    The folds of one cross-validation share training trials, and those of repeated
    grouped folds test trials too, so that their scores are not independent. Their
    standard error is then too small, the more so the more repeats, and the
    rule picks slower candidates than it would with the true one.

    With a callable ``refit`` a search has no ``best_score_``; see
    ``cv_results_["mean_test_score"][best_index_]``. Searches by successive halving
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
    >>> from sklearn_haptic.model_selection import cheapest_within_one_se
    >>> search = GridSearchCV(
    ...     DistributionalOrdinalRegressor(NNPOM(random_state=0)),
    ...     {"estimator__n_hidden": [0, 5, 10]},
    ...     scoring=neg_rps_scorer,
    ...     cv=GroupKFold(5),
    ...     refit=cheapest_within_one_se,
    ... )
    """
    candidates = read_candidates(cv_results, metric)
    _, cheapest = best_and_cheapest(candidates)
    return int(candidates.index[cheapest])


def _check_metric(results, metric):
    """Return the name of the score to use, if the results leave no doubt."""
    prefix = "mean_test_"
    known = [key.removeprefix(prefix) for key in results if key.startswith(prefix)]
    if metric is None and len(known) == 1:
        return known[0]
    if metric not in known:
        problem = "missing" if metric is None else f"{metric!r}, which is unknown"
        raise ValueError(
            f"metric is {problem}; choose one of the search's scores: {known}."
        )
    return metric
