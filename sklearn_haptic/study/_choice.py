"""Networks chosen by their score on the validation trials."""

from itertools import product

import numpy as np
from sklearn.base import clone
from sklearn.metrics import check_scoring


def choose_network(study, name, regressor, network, X, counts, parts):
    """Choose the number of hidden units and the penalty of a network of a regressor.

    Parameters
    ----------
    study : Study
    name : tuple
        Procedure, adjective, fold and the name of the network.
    regressor : DistributionalOrdinalRegressor
    network : str
        Name of the network among the parameters of `regressor`.
    X, counts, parts
        As in `fit_best`.

    Returns
    -------
    model : DistributionalOrdinalRegressor
        The best candidate, fitted.
    choice : dict
        The name of the network, what was chosen, and the score of the candidate.
    """
    grid = list(product(study.n_hidden, study.alpha))
    candidates = [
        clone(regressor).set_params(
            **{f"{network}__n_hidden": n_hidden, f"{network}__alpha": alpha},
            random_state=study.seed(*name, n_hidden, alpha),
        )
        for n_hidden, alpha in grid
    ]
    best, score, model = fit_best(candidates, X, counts, parts, study.scoring)
    n_hidden, alpha = grid[best]
    return model, {
        "network": name[-1],
        "n_hidden": n_hidden,
        "alpha": alpha,
        "score": score,
    }


def for_early_stopping(regressor, X, counts, parts):
    """Return what ``fit`` takes beside training trials if the regressor stops early."""
    if regressor.estimator.validation_share() == 0:
        return {}
    return {"X_val": X[parts.validation], "y_val": counts[parts.validation]}


def fit_best(candidates, X, counts, parts, scoring):
    """Fit regressors to training trials and keep the best on validation trials.

    Parameters
    ----------
    candidates : list of DistributionalOrdinalRegressor
        Unfitted regressors. Early stopping, if any, is on the validation trials.
    X : ndarray of shape (n_trials, n_features)
    counts : ndarray of shape (n_trials, n_levels)
    parts : Parts
    scoring : str, callable or None
        Score by which to choose, higher being better; None for the regressor's own.

    Returns
    -------
    best : int
        Index of the best candidate, or of the first of several. NaN is worse than
        any score.
    score : float
        Its score.
    model : DistributionalOrdinalRegressor
        The candidate, fitted.

    Raises
    ------
    ValueError
        If every score is NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
    >>> from sklearn_haptic.study._choice import fit_best
    >>> from sklearn_haptic.study._split import Parts
    >>> X = np.array([[0.0], [1.0], [2.0]])
    >>> counts = np.array([[9, 1], [1, 9], [0, 10]])
    >>> candidates = [
    ...     DistributionalOrdinalRegressor(NNPOM(n_hidden=0, alpha=alpha))
    ...     for alpha in (1e6, 1.0)
    ... ]
    >>> parts = Parts(np.array([0, 1]), np.array([2]), np.array([]))
    >>> fit_best(candidates, X, counts, parts, None)[0]
    1
    """
    train = X[parts.train], counts[parts.train]
    validation = for_early_stopping(candidates[0], X, counts, parts)
    best = None
    for i, candidate in enumerate(candidates):
        candidate.fit(*train, **validation)
        scorer = check_scoring(candidate, scoring)
        score = float(scorer(candidate, X[parts.validation], counts[parts.validation]))
        if not np.isnan(score) and (best is None or score > best[1]):
            best = i, score, candidate
    if best is None:
        raise ValueError(
            f"scoring={scoring!r} gives NaN for every network on the validation "
            "trials; give one that is defined for them."
        )
    return best
