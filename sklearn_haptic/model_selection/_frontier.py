"""How accuracy trades with speed over the candidates of a search."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ..utils._sklearn import BaseSearchCV
from ._candidates import best_and_cheapest, is_non_dominated, read_candidates


def speed_accuracy_frontier(
    search: BaseSearchCV | Mapping[str, Any], *, metric: str | None = None
) -> pd.DataFrame:
    """Return the candidates of a search that no other beats in time and score.

    A candidate is on the frontier if no other is at least as fast, scores at least as
    well, and is better in one of the two. Every other candidate can be replaced by one
    of these at no loss.

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
        If the metric is unknown or not given among several, there are fewer than
        two splits, or no score is finite.

    Warns
    -----
    UserWarning
        If the search has no score "neg_seconds". The seconds are then the mean time
        to fit and score on one fold. With ``memory=`` in a pipeline this is not the
        cost of a candidate, because the first one pays for the steps that all share.

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
    """Return the fastest candidate within one standard error of the best score.

    Give it to ``refit=`` of a search. The search then refits the fastest candidate
    whose mean test score is at most one standard error, that of the best candidate,
    below the best. The time is that to predict one trial, so search with
    ``scoring={"rps": neg_rps_scorer, "neg_seconds": neg_seconds_scorer}``.

    Parameters
    ----------
    cv_results : dict or fitted search
        The ``cv_results_`` of a search, or the search.
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
        If the metric is unknown or not given among several, there are fewer than
        two splits, or no score is finite.

    Warns
    -----
    UserWarning
        If the search has no score "neg_seconds"; the mean time to fit and score on one
        fold then stands for it, which caches falsify.

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
    return int(candidates.index[cheapest])
