"""Every score of the distribution predicted for each trial."""

import numpy as np

from ..ratings._distributions import quantile_grid
from ._absolute_errors import (
    earth_movers_distance,
    macro_mae,
    macro_mae_at_positions,
)
from ._proper_scores import log_score, ranked_probability_score

SCORES = {
    "macro_mae": macro_mae,
    "emd": earth_movers_distance,
    "rps": ranked_probability_score,
    "log_score": log_score,
}


def predict_and_score(model, X, counts):
    """Predict the distribution of each trial's ratings, and score it.

    Parameters
    ----------
    model : DistributionalOrdinalRegressor
        Fitted.
    X : array-like of shape (n_trials, n_features)
    counts : ndarray of shape (n_trials, n_levels) or (n_trials, n_adjectives, n_levels)
        How many people gave each trial's object each rating.

    Returns
    -------
    proba : ndarray of the same shape
    scores : list of dict of str to ndarray of shape (n_trials,)
        Those of `score_trials` for each adjective. Of a model that decides on one
        rating per position, as in the paper, "macro_mae" is the error of these ratings
        as they are, while the distribution has them sorted.
    """
    proba = model.predict_proba(X)
    decided = ratings_decided_on(model, X)
    several = counts.ndim == 3
    scores = []
    for i in range(counts.shape[1]) if several else [...]:
        of_adjective = (slice(None), i)
        true = counts[of_adjective]
        scores.append(score_trials(true, proba[of_adjective]))
        if decided is not None:
            ratings, positions = decided
            scores[-1]["macro_mae"] = macro_mae_at_positions(
                true,
                ratings[of_adjective],
                positions,
                levels=model.classes_,
                average=False,
            )
    return proba, scores


def score_trials(counts, proba):
    """Compute every score of each predicted distribution; lower is better in all.

    Of counts and probabilities of shape (n_trials, n_levels), return a dict of scores
    of shape (n_trials,): "macro_mae", "emd" and "rps" in levels, "log_score" in nats,
    and "rps_1", …, one per threshold between levels k and k + 1: the ranked probability
    score (RPS) of ratings that only tell whether the level is above k. These terms sum
    to "rps". Errors are those of `check_distributions`.

    Examples
    --------
    >>> from sklearn_haptic.metrics._trial_scores import score_trials
    >>> scores = score_trials([[1, 1, 2]], [[0.25, 0.5, 0.25]])
    >>> for name, score in scores.items():
    ...     print(name, score.round(4))
    macro_mae [0.1701]
    emd [0.25]
    rps [0.5]
    log_score [1.213]
    rps_1 [0.1875]
    rps_2 [0.3125]
    """
    counts, proba = np.asarray(counts), np.asarray(proba)
    scores = {
        name: score(counts, proba, average=False) for name, score in SCORES.items()
    }
    for k in range(1, counts.shape[1]):
        scores[f"rps_{k}"] = ranked_probability_score(
            _at_most(k, counts), _at_most(k, proba), average=False
        )
    return scores


def _at_most(k, weights):
    """Weights of two levels: the first k levels, and those above."""
    return np.column_stack((weights[:, :k].sum(axis=1), weights[:, k:].sum(axis=1)))


def ratings_decided_on(model, X):
    """Return the ratings that a model predicts one by one, and their positions.

    None for all but a `DistributionalOrdinalRegressor` that decodes as the paper does.
    """
    if getattr(model, "decode", None) != "quantile" or model.rule != "argmax":
        return None
    p = quantile_grid(model.n_quantiles)
    return model.predict_rating(X, p), p
