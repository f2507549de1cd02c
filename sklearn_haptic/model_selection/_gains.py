"""What a model gains over guessing, with its uncertainty, in numbers and in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import t as student

from ..metrics import dispersion
from ..metrics._trial_scores import score_trials
from ..models import DummyDistribution
from ._out_of_fold import in_order

MODEL = "model"
GUESSES = ("marginal", "barycentre")
ERRORS = ("rps", "emd", "macro_mae", "log_score")


def guess_out_of_fold(strategy, counts, folds):
    """Predict each fold's test trials by a baseline, in ascending order of trials."""
    proba = [
        DummyDistribution(strategy)
        .fit(np.empty((len(train), 0)), counts[train])
        .predict_proba(test)
        for train, test in folds
    ]
    return in_order(proba, folds)


def compare_with_guesses(counts, predicted, guesses):
    """Score a model and its baselines on the same test trials.

    Parameters
    ----------
    counts, predicted : ndarray of shape (n_tested, n_levels)
        How many people gave each level, and the probabilities that the model predicts.
    guesses : dict of str to ndarray of shape (n_tested, n_levels)
        What each baseline predicts.

    Returns
    -------
    scores : dict of str to dict of str to float
        The mean of each score, of the model and of each baseline.
    gains : ndarray of shape (n_tested,)
        By how much the RPS of the model is lower than that of the better baseline.
    rps_guess : float
        The mean RPS of that baseline.
    """
    scores, rps = {}, {}
    for name, proba in {MODEL: predicted, **guesses}.items():
        of_trials = score_trials(counts, proba)
        rps[name] = of_trials["rps"]
        scores[name] = {each: float(of_trials[each].mean()) for each in ERRORS}
        scores[name]["dispersion"] = dispersion(counts, proba)
    best = min(guesses, key=lambda name: scores[name]["rps"])
    return scores, rps[best] - rps[MODEL], scores[best]["rps"]


def summarise_gains(gains, objects):
    """Return the mean gain, its standard error over objects, and the verdict.

    Trials count equally, so that objects count by their trials; the error is that of
    such a mean.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.model_selection._gains import summarise_gains
    >>> summarise_gains(np.array([1.0, 3.0, 2.0, 2.0]), ["a", "a", "b", "b"])
    {'gain': 2.0, 'standard_error': 0.0, 'verdict': 'better'}
    """
    ids, which = np.unique(objects, return_inverse=True)
    gain, error = gains.mean(), np.nan
    if len(ids) > 1:
        sums = np.bincount(which, gains - gain)
        error = np.sqrt(len(ids) / (len(ids) - 1) * (sums**2).sum()) / len(gains)
    margin = error * student.ppf(0.975, max(len(ids) - 1, 1))
    verdict = "not shown"
    if abs(gain) > margin:
        verdict = "better" if gain > 0 else "worse"
    return {
        "gain": float(gain),
        "standard_error": float(error),
        "verdict": verdict,
    }


def conclude(table: pd.DataFrame, overall: dict[str, Any], n: int, known: bool) -> str:
    """Say in words how much better than guessing a model is, or that it is not.

    `table` has a row per adjective, and `overall` the same of their mean. The standard
    error is over `n` objects, or touches if their objects are not `known`.
    """
    said = {
        "better": "The model is better than guessing",
        "worse": "The model is worse than guessing",
        "not shown": "The model is not shown to be better than guessing",
    }[overall["verdict"]]
    rps, guess, gain = overall["rps"], overall["rps_guess"], overall["gain"]
    on_average = f"on average over {len(table)} adjectives " * (len(table) > 1)
    change = "lower" if gain >= 0 else "higher"
    text = (
        f"{said}: {on_average}its RPS is {rps:.3f} where guessing has {guess:.3f}. "
        f"This is {change} by {abs(gain):.3f}"
    )
    if n > 1:
        text += f" ± {overall['standard_error']:.3f} (standard error)"
    one, several = ("object", "objects") if known else ("touch", "touches")
    text += f" over {n} {one if n == 1 else several}"
    notable = guess > 0 and abs(gain) > 0.005 * guess
    text += f", or {abs(gain) / guess:.0%}." if notable else "."
    if len(table) > 1:
        text += _by_verdict(table)
    if not known:
        text += (
            " Which touches are of one object is not known (groups=); if any are, the "
            "model is worse on new objects than it looks, and the standard error is "
            "too small."
        )
    return text


def _by_verdict(table):
    named = {
        verdict: ", ".join(map(str, table.index[table["verdict"] == verdict]))
        for verdict in ("better", "not shown", "worse")
    }
    text = ""
    if named["better"]:
        text += f" It is better on: {named['better']}."
    if named["not shown"]:
        text += f" It is not shown to be better on: {named['not shown']}."
    if named["worse"]:
        text += f" It is worse on: {named['worse']}."
    return text
