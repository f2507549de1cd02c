"""Every score of the distribution predicted for each trial."""

import numpy as np

from .metrics import (
    earth_movers_distance,
    log_score,
    macro_mae,
    macro_mae_at_positions,
    ranked_probability_score,
    ratings_decided_on,
)


def predict_and_score(model, X, counts):
    """Predict the distribution of each trial's ratings, and score it.

    Parameters
    ----------
    model : DistributionalOrdinalRegressor
        Fitted.
    X : array-like of shape (n_trials, n_features)
    counts : array-like of shape (n_trials, n_levels) or (n_trials,)
        How many people gave each trial's object each rating, or one rating.

    Returns
    -------
    proba : ndarray of shape (n_trials, n_levels)
    scores : dict of str to ndarray of shape (n_trials,)
        Those of `score_trials`. Of a model that decides on one rating per position, as
        in the paper, "macro_mae" is the error of these ratings as they are, while the
        distribution has them sorted.
    """
    proba = model.predict_proba(X)
    scores = score_trials(counts, proba)
    decided = ratings_decided_on(model, X)
    if decided is not None:
        scores["macro_mae"] = macro_mae_at_positions(
            counts, *decided, levels=model.classes_, average=False
        )
    return proba, scores


def score_trials(counts, proba):
    """Compute every score of each predicted distribution; lower is better in all.

    Parameters
    ----------
    counts : array-like of shape (n_trials, n_levels)
        How many people gave each trial's object each rating.
    proba : array-like of shape (n_trials, n_levels)
        Predicted probability of each rating.

    Returns
    -------
    scores : dict of str to ndarray of shape (n_trials,)
        "macro_mae", "emd" and "rps" in levels, "log_score" in nats, and "rps_1", …,
        one per threshold between levels k and k + 1: the ranked probability score
        (RPS) of ratings that only tell whether the level is above k. These terms sum
        to "rps".

    Raises
    ------
    ValueError
        If a row of ``proba`` is not a distribution, a trial has no ratings, or the
        shapes differ.

    Examples
    --------
    >>> from sklearn_haptic._trial_scores import score_trials
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
        "macro_mae": macro_mae(counts, proba, average=False),
        "emd": earth_movers_distance(counts, proba, average=False),
        "rps": ranked_probability_score(counts, proba, average=False),
        "log_score": log_score(counts, proba, average=False),
    }
    for k in range(1, counts.shape[1]):
        scores[f"rps_{k}"] = ranked_probability_score(
            _at_most(k, counts), _at_most(k, proba), average=False
        )
    return scores


def _at_most(k, weights):
    """Weights of two levels: the first k levels, and those above."""
    return np.column_stack((weights[:, :k].sum(axis=1), weights[:, k:].sum(axis=1)))
