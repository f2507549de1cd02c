"""Does learning all adjectives together help? One shared hidden layer or none.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
        SKLEARN_HAPTIC_SHARED=FOLDER python benchmarks/shared_hidden_layer.py \
        [--seed SEED] [--quick]

FOLDER holds ``data/phac2_static/``; without it only the synthetic corpus is used. The
seed is that of the corpus and of all folds; --quick leaves out separate networks.
The joint network has one hidden layer, whose inputs are the features of a touch and
the position p of a rater in the population; each adjective has output weights and
thresholds of its own. It is fitted to the observations of all adjectives at once.

Five folds, objects kept whole, features learned from the training objects. In each,
hidden units and alpha are chosen by the RPS in an inner cross-validation of three folds
of training objects: for each adjective apart, or one setting for all. Scores are means
over adjectives and objects, each object in one test fold; the standard errors of
differences are those over objects, which is a little too small as the folds share
training objects. Units and alpha say how often each was chosen. Seconds are of
processor time, medians over folds: of search and fit, and of the fit alone.
"""

import argparse
import os
import time
import warnings
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from data import votes as votes_of
from paper_questions_data import coders
from sklearn.base import clone
from sklearn.decomposition import PCA
from sklearn.exceptions import ConvergenceWarning
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import (
    earth_movers_distance,
    log_score,
    macro_mae,
    ranked_probability_score,
)

HIDDEN = (5, 10, 20, 30)
ALPHAS = (3.0, 10.0, 30.0, 100.0)
OPTIONS = {"max_iter": 200, "tol": 1e-3}
SCORES = {
    "RPS": ranked_probability_score,
    "MAE^M": macro_mae,
    "EMD": earth_movers_distance,
    "log score": log_score,
}


# ----------------------------------------------------------------------------------
# The joint network


class Joint:
    """One network fitted to a list of counts, an array for each adjective."""

    def __init__(self, n_hidden, alpha):
        self.n_hidden = n_hidden
        self.alpha = alpha

    def fit(self, X, counts):
        network = NNPOM(self.n_hidden, self.alpha, **OPTIONS, random_state=0)
        self.model_ = DistributionalOrdinalRegressor(network)
        self.model_.fit(X, np.stack(counts, axis=1))
        return self

    def predict_proba(self, X):
        return list(self.model_.predict_proba(X).swapaxes(0, 1))


# ----------------------------------------------------------------------------------
# Its rivals, and the choice of settings


class Separate:
    """One `DistributionalOrdinalRegressor` an adjective; a setting each, or for all."""

    def __init__(self, n_hidden, alpha):
        self.n_hidden = n_hidden
        self.alpha = alpha

    def fit(self, X, counts):
        n_hidden = np.broadcast_to(self.n_hidden, len(counts)).tolist()
        alpha = np.broadcast_to(self.alpha, len(counts)).tolist()
        self.models_ = [
            DistributionalOrdinalRegressor(
                NNPOM(*setting, **OPTIONS, random_state=0)
            ).fit(X, y)
            for *setting, y in zip(n_hidden, alpha, counts)
        ]
        return self

    def predict_proba(self, X):
        return [model.predict_proba(X) for model in self.models_]


LINEAR = [(0, alpha) for alpha in (1.0, *ALPHAS)]
NETWORKS = [(n_hidden, alpha) for n_hidden in HIDDEN for alpha in ALPHAS]
JOINT = "joint network"
RIVALS = [  # class, settings, whether each adjective chooses its own
    (Separate, LINEAR, {"linear": True, "linear, one alpha": False}),
    (Separate, NETWORKS, {"networks": True, "networks, one setting": False}),
    (Joint, NETWORKS, {JOINT: False}),
]


def timed(function, *arguments):
    """Result of a call, and its seconds."""
    start = time.process_time()
    result = function(*arguments)
    return result, time.process_time() - start


def split(n_splits, groups, seed):
    folds = GroupKFold(n_splits, shuffle=True, random_state=seed)
    return folds.split(groups, groups=groups)


def of_rows(counts, rows):
    return [y[rows] for y in counts]


def inner_rps(model, settings, X, counts, groups, seed):
    """RPS of each setting and adjective on validation groups."""
    rps = np.zeros((len(settings), len(counts)))
    for train, validation in split(3, groups, seed):
        known, unknown = of_rows(counts, train), of_rows(counts, validation)
        for i, setting in enumerate(settings):
            proba = model(*setting).fit(X[train], known).predict_proba(X[validation])
            rps[i] += [*map(ranked_probability_score, unknown, proba)]
    return rps


def best_setting(settings, rps, own):
    """Hidden units and alpha, each a tuple if every adjective has its own."""
    if own:
        return tuple(zip(*[settings[i] for i in rps.argmin(axis=0)]))
    return settings[rps.mean(axis=1).argmin()]


# ----------------------------------------------------------------------------------
# Data


class Data(NamedTuple):
    title: str
    trials: pd.DataFrame  # recordings or features
    counts: dict  # per adjective
    objects: np.ndarray
    features: object  # transformer, to be fitted to training trials


def synthetic(seed):
    corpus = make_haptic_corpus(60, 10, procedure="slow_slide", random_state=seed)
    features = make_pipeline(coders(), StandardScaler(), PCA())
    title = "Synthetic corpus, 600 slow slides of 60 objects, ten adjectives"
    return Data(title, corpus.trials, corpus.ratings, corpus.objects, features)


def real(folder):
    """Adjectives that enough objects have, yes or no, and votes from 0 to 5."""
    X, target, objects, _, standardise = votes_of(folder)
    hardness = target["hardness"].argmax(axis=1)
    stored = np.load(folder / "phac2_static" / "phac2_static.npz")
    has = dict(zip(stored["adjectives"].tolist(), stored["Y_binary"].T.astype(int)))
    binary = {
        name: np.eye(2)[column]
        for name, column in has.items()
        if len(np.unique(objects[column == 1])) >= 5
    }
    roughness = sum(has[name] for name in ("rough", "scratchy", "textured", "bumpy"))
    roughness += 1 - has["smooth"]
    votes = {"hardness": np.eye(6)[hardness], "roughness": np.eye(6)[roughness]}
    features = make_pipeline(standardise, PCA())
    for title, counts in [
        (f"PHAC-2, {len(binary)} adjectives, yes or no", binary),
        ("PHAC-2, hardness and roughness votes from 0 to 5", votes),
    ]:
        yield Data(title, pd.DataFrame(X), counts, objects, features)


# ----------------------------------------------------------------------------------
# Cross-validation and tables


def score(counts, proba):
    """Scores of shape (n_trials, n_adjectives, n_scores)."""
    scores = [
        [function(y, p, average=False) for function in SCORES.values()]
        for y, p in zip(counts, proba)
    ]
    return np.transpose(scores, (2, 0, 1))


def evaluate(data, rivals, seed):
    """Scores of each model, settings chosen, and seconds of search and fit."""
    counts = list(data.counts.values())
    shape = len(data.trials), len(counts), len(SCORES)
    scores, chosen, seconds = {}, defaultdict(list), defaultdict(list)
    for train, test in split(5, data.objects, seed):
        features = clone(data.features).fit(data.trials.iloc[train])
        A, B = (
            features.transform(data.trials.iloc[rows]).astype(np.float64)
            for rows in (train, test)
        )
        known, unknown = of_rows(counts, train), of_rows(counts, test)
        for model, settings, names in rivals:
            rps, search = timed(
                inner_rps, model, settings, A, known, data.objects[train], seed
            )
            for name, own in names.items():
                setting = best_setting(settings, rps, own)
                fitted, fit = timed(model(*setting).fit, A, known)
                predicted = score(unknown, fitted.predict_proba(B))
                scores.setdefault(name, np.empty(shape))[test] = predicted
                chosen[name].append(setting)
                seconds[name].append((search + fit, fit))
    return scores, chosen, seconds


def report(data, scores, chosen, seconds):
    objects = np.unique(data.objects)

    def of_objects(scores):
        """Mean over adjectives and the trials of each object."""
        scores = scores.mean(axis=1)
        return np.stack([scores[data.objects == i].mean(axis=0) for i in objects])

    scores = {name: of_objects(values) for name, values in scores.items()}
    print(f"\n**{data.title}**\n")
    print("| | " + " | ".join(SCORES) + " | units | alpha | search, s | fit, s |")
    print("|---" * (len(SCORES) + 5) + "|")
    for name, values in scores.items():
        cells = [f"{value:.4f}" for value in values.mean(axis=0)]
        cells += [describe(values) for values in zip(*chosen[name])]
        cells += [f"{value:.1f}" for value in np.median(seconds[name], axis=0)]
        print(f"| {name} | " + " | ".join(cells) + " |")
    for other in [name for name in scores if name != JOINT]:
        difference = scores[JOINT] - scores[other]
        error = difference.std(axis=0, ddof=1) / np.sqrt(len(objects))
        cells = [
            f"{mean:+.4f} ± {se:.4f}"
            for mean, se in zip(difference.mean(axis=0), error)
        ]
        print(f"| {JOINT} − {other} | " + " | ".join(cells) + " | | | | |", flush=True)


def describe(values):
    """How often each value was chosen."""
    values, counts = np.unique(np.ravel(values), return_counts=True)
    return ", ".join(f"{value:g} ({n})" for value, n in zip(values, counts))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)
    rivals = [RIVALS[0], RIVALS[-1]] if arguments.quick else RIVALS
    data = [synthetic(arguments.seed)]
    if "SKLEARN_HAPTIC_SHARED" in os.environ:
        data += real(Path(os.environ["SKLEARN_HAPTIC_SHARED"]) / "data")
    for item in data:
        report(item, *evaluate(item, rivals, arguments.seed))


if __name__ == "__main__":
    main()
