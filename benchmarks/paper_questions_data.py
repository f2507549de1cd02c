"""Corpora, folds, features and tables for the scripts ``paper_questions*.py``."""

import time
from functools import cache
from typing import NamedTuple

import numpy as np
from joblib import Memory
from sklearn.compose import ColumnTransformer
from sklearn.decomposition import PCA
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import (
    earth_movers_distance,
    macro_mae,
    ranked_probability_score,
)

SENSORS = ("pac", "pdc", "tac", "tdc", "electrodes")
SEEDS = (0, 1)
CHOICE = 2  # settings are chosen on the corpus of this seed alone
PROCEDURE = "slow_slide"
FEW = ("hard", "rough", "cold", "springy")  # adjectives of the longer questions
SOLVER = {"max_iter": 200, "tol": 1e-3}
SCORES = {
    "RPS": ranked_probability_score,
    "EMD": earth_movers_distance,
    "MAE^M": macro_mae,
}


class Fold(NamedTuple):
    """Trials of a fold, and features learned from its training objects."""

    train: np.ndarray
    test: np.ndarray
    A: np.ndarray  # features of the training trials, sensor by sensor
    B: np.ndarray  # of the test trials
    sensors: dict  # columns of each sensor
    dead: np.ndarray  # what the features are if all signals are zero


@cache
def corpus_of(seed, n_raters=12):
    """Five slow slides of each of 60 objects; the touches are those of any crowd."""
    return make_haptic_corpus(
        60, 5, procedure=PROCEDURE, n_raters=n_raters, random_state=seed
    )


def split(n_splits, groups, seed):
    folds = GroupKFold(n_splits, shuffle=True, random_state=seed)
    return list(folds.split(groups, groups=groups))


def coders(sensors=SENSORS, factor=1.0):
    """Maxima of codes over dictionaries of some multiple of the presets' sizes.

    Such features the paper has. Here the dictionaries are learned in five iterations.
    """
    parts = []
    for sensor in sensors:
        features = make_haptic_pipeline([sensor], random_state=0)[0]
        coder = features.transformers[0][1]["codes"][0]
        coder.set_params(n_atoms=int(factor * coder.n_atoms), max_iter=5)
        parts.append((sensor, make_pipeline(coder, TemporalMaxPool((4, 2, 1))), sensor))
    return ColumnTransformer(parts)


def compute_folds(seed):
    """Five folds by object, with features learned from the training objects.

    The standardised features of each sensor are rotated to their principal axes, all
    of them, which changes no penalised fit but makes it faster.
    """
    corpus = corpus_of(seed)
    folds = []
    for train, test in split(5, corpus.objects, seed):
        steps = make_pipeline(coders(), StandardScaler())
        A = steps.fit_transform(corpus.trials.iloc[train]).astype(np.float64)
        B = steps.transform(corpus.trials.iloc[test]).astype(np.float64)
        dead = steps[-1].transform(np.zeros((1, A.shape[1]))).astype(np.float64)
        parts, sensors, n_columns = [], {}, 0
        for sensor, columns in steps[0].output_indices_.items():
            if sensor != "remainder":
                axes = PCA().fit(A[:, columns])
                parts.append([axes.transform(Z[:, columns]) for Z in (A, B, dead)])
                width = parts[-1][0].shape[1]
                sensors[sensor] = np.arange(n_columns, n_columns + width)
                n_columns += width
        A, B, dead = map(np.hstack, zip(*parts))
        folds.append(Fold(train, test, A, B, sensors, dead[0]))
    return folds


@cache
def folds_of(seed, folder):
    """What `compute_folds` returns, kept in a folder if one is given."""
    return Memory(folder, verbose=0).cache(compute_folds)(seed)


def together(A, B):
    """Features on the principal axes of all sensors, for linear models."""
    axes = PCA().fit(A)
    return axes.transform(A), axes.transform(B)


def linear(alpha=3.0, **options):
    """The default model: linear, one adjective at a time."""
    return DistributionalOrdinalRegressor(NNPOM(0, alpha, **SOLVER), **options)


def stacked(ratings, adjectives=None):
    """Counts, or true shares, of shape (n_trials, n_adjectives, n_levels)."""
    return np.stack([ratings[name] for name in adjectives or ratings], axis=1)


def each_adjective(model, A, y, B, **fit):
    """Fit one model per adjective; predictions of shape (n, n_adjectives, n_levels)."""
    each = [model.fit(A, y[:, i], **fit).predict_proba(B) for i in range(y.shape[1])]
    return np.stack(each, axis=1)


def of_objects(y, proba, objects, scores):
    """Scores of each object, means over its trials and adjectives.

    Returns
    -------
    scores : ndarray of shape (n_objects, n_scores)
    """
    shape = y.shape[:2]
    flat = y.reshape(-1, y.shape[-1]), proba.reshape(-1, y.shape[-1])
    values = [f(*flat, average=False).reshape(shape).mean(axis=1) for f in scores]
    values = np.transpose(values)
    return np.stack([values[objects == i].mean(axis=0) for i in np.unique(objects)])


def out_of_fold(predict, target, seed, folder, scores=SCORES, n_folds=None):
    """Scores of each object, as `of_objects` returns them, by test folds.

    Parameters
    ----------
    predict : callable
        Returns the predictions for the test trials of a fold.
    target : ndarray of shape (n_trials, n_adjectives, n_levels)
    seed, folder
        As `folds_of` takes them.
    scores : list of str
        Names of scores.
    n_folds : int, default=None
        Take no more than these folds.
    """
    folds = folds_of(seed, folder)[:n_folds]
    rows = np.concatenate([fold.test for fold in folds])
    proba = np.concatenate([predict(fold) for fold in folds])
    functions = [SCORES[name] for name in scores]
    return of_objects(target[rows], proba, corpus_of(seed).objects[rows], functions)


def difference(scores, base):
    """Mean difference of paired scores and its standard error, for each score."""
    delta = scores - base
    return delta.mean(axis=0), delta.std(axis=0, ddof=1) / np.sqrt(len(delta))


def report(results, base, names=SCORES):
    """Print a table: scores of each model, and differences to a base, for each seed.

    Parameters
    ----------
    results : dict of int to dict of str to ndarray of shape (n_objects, n_scores)
        By seed and model.
    base : str
    names : list of str
        What the scores are called.
    """
    seeds = list(results)
    head = [f"RPS, {seed}" for seed in seeds]
    head += [f"Δ {name}, {seed}" for name in names for seed in seeds]
    print("\n| | " + " | ".join(head) + " |")
    print("|---" * (len(head) + 1) + "|")
    for model in results[seeds[0]]:
        cells = [f"{results[seed][model][:, 0].mean():.4f}" for seed in seeds]
        for k in range(len(names)):
            for seed in seeds:
                of_seed = results[seed]
                mean, error = difference(of_seed[model], of_seed[base])
                same = model == base
                cells.append("" if same else f"{mean[k]:+.4f} ± {error[k]:.4f}")
        print(f"| {model} | " + " | ".join(cells) + " |", flush=True)


class Clock:
    """Processor seconds since it was started."""

    def __init__(self):
        self.start = time.process_time()

    def seconds(self):
        return time.process_time() - self.start

    def __str__(self):
        return f"{self.seconds():.0f} s of processor time"
