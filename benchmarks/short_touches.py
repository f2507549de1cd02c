"""What the cells of a level hold where a touch has fewer windows than cells.

Pressure and temperature, cut into stretches at random, coded over dictionaries of
windows of 50 samples and pooled into 16, 8, 4, 2 and 1 cells by one rule after
another:

begin       the window in which the cell begins
covered     the one or two windows that the cell covers in part
beside      the window at the middle of the cell and the two beside it (the package's)
all         every window
zeros       the window that begins in the cell, 0 if there is none
dropped     levels of more cells than the shortest training touch has windows are left
            out; in shorter test touches as "beside"

Accuracy of twenty materials from slides of one finger (three blocks of five runs), and
RPS of three adjectives of generated fast slides (forty objects, four folds).

    python benchmarks/short_touches.py biotac_slides.npz

About four minutes on one core.
"""

import sys

import numpy as np
from sklearn.linear_model import RidgeClassifierCV
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    KSVDTransformer,
    TemporalMaxPool,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import ranked_probability_score

CELLS = (16, 8, 4, 2, 1)
ATOMS = {"pdc": 25, "tac": 25, "tdc": 10}
RULES = ["begin", "covered", "beside", "all", "zeros", "dropped"]
# Seconds of training and of test touches.
STRETCHES = {
    "whole, test 1": ((99, 99), (1, 1)),
    "1": ((1, 1), (1, 1)),
    "2, test 0.6": ((2, 2), (0.6, 0.6)),
    "1.2 to 3.5": ((1.2, 3.5), (1.2, 3.5)),
    "whole": ((99, 99), (99, 99)),
}


def short_level(sequence, n_cells, rule):
    """The features of a level of more cells than windows."""
    n_times, cell = len(sequence), np.arange(n_cells)
    if rule == "begin":
        return sequence[cell * n_times // n_cells]
    if rule == "covered":
        last = -(-(cell + 1) * n_times // n_cells) - 1
        return np.maximum(sequence[cell * n_times // n_cells], sequence[last])
    if rule == "all":
        return np.tile(sequence.max(axis=0), (n_cells, 1))
    if rule == "zeros":
        out = np.zeros((n_cells, sequence.shape[1]))
        out[-(-np.arange(n_times) * n_cells // n_times)] = sequence
        return out
    return level(sequence, n_cells)


def level(sequence, n_cells):
    """The features of a level, as the package pools it."""
    return TemporalMaxPool((n_cells,)).fit_transform([sequence])


def pool(codes, rule, train):
    """Features of all touches."""
    shortest = min(len(codes[i]) for i in train)
    cells = [n for n in CELLS if rule != "dropped" or n <= shortest]
    return np.array(
        [
            np.concatenate(
                [
                    level(each, n).ravel()
                    if n <= len(each)
                    else short_level(each, n, rule).ravel()
                    for n in cells
                ]
            )
            for each in codes
        ]
    )


def stretches(trials, frames, places):
    """Cut touches to so many frames, from a place of the rest between 0 and 1."""
    cut = []
    for trial, n, place in zip(trials, frames, places):
        start = int(place * max(0, len(trial) - n))
        cut.append(trial[start : start + n])
    return cut


def scores(sensors, folds, score, seconds):
    """The score of every rule, one row per fold."""
    table = []
    for fold, (train, test) in enumerate(folds):
        rng = np.random.default_rng(fold)
        n_trials = len(sensors["pdc"])
        frames = rng.uniform(*seconds[1], n_trials)
        frames[train] = rng.uniform(*seconds[0], len(train))
        frames, places = (100 * frames).astype(int), rng.uniform(size=n_trials)
        codes = []
        for sensor, trials in sensors.items():
            cut = stretches(trials, frames, places)
            coder = KSVDTransformer(
                ATOMS[sensor], window=50, remove_mean=False, max_iter=20, random_state=0
            )
            coder.fit([cut[i] for i in train])
            codes.append(list(coder.transform(cut)))
        features = [
            np.hstack([pool(each, rule, train) for each in codes]) for rule in RULES
        ]
        table.append([score(X, train, test) for X in features])
    return np.array(table)


def slides(path):
    """Recorded slides, their folds, and the accuracy of a classifier of materials."""
    with np.load(path) as arrays:
        frames = arrays["frames"].astype(np.float64)
        each = np.split(frames, np.cumsum(arrays["length"])[:-1])
        materials, block = arrays["material"], (arrays["run"] - 1) // 5
    columns = {"tdc": [0], "tac": [1], "pdc": [2]}
    sensors = {s: [slide[:, columns[s]] for slide in each] for s in ATOMS}
    folds = [(np.flatnonzero(block != b), np.flatnonzero(block == b)) for b in range(3)]

    def score(X, train, test):
        model = make_pipeline(
            StandardScaler(), RidgeClassifierCV(np.logspace(-1, 5, 13))
        )
        return model.fit(X[train], materials[train]).score(X[test], materials[test])

    return sensors, folds, score


def generated():
    """Generated fast slides, their folds, and the RPS of ratings."""
    corpus = make_haptic_corpus(
        40, 4, procedure="fast_slide", sensors=list(ATOMS), random_state=0
    )
    sensors = {s: list(corpus.trials[s]) for s in ATOMS}
    folds = list(GroupKFold(4).split(corpus.objects, groups=corpus.objects))

    def score(X, train, test):
        model = make_pipeline(
            StandardScaler(), DistributionalOrdinalRegressor(NNPOM(0, alpha=3.0))
        )
        rps = []
        for adjective in ("hard", "rough", "cold"):
            y = corpus.ratings[adjective]
            proba = model.fit(X[train], y[train]).predict_proba(X[test])
            rps.append(ranked_probability_score(y[test], proba))
        return np.mean(rps)

    return sensors, folds, score


def main(path):
    """Print a row for each length of touches."""
    cases = {"slides, accuracy": (slides(path), list(STRETCHES)[:-1])}
    cases["generated, RPS"] = generated(), list(STRETCHES)[2:]
    print("| touches | seconds | " + " | ".join(RULES) + " |")
    print("|---" * (2 + len(RULES)) + "|")
    for name, (case, lengths) in cases.items():
        for length in lengths:
            means = scores(*case, STRETCHES[length]).mean(axis=0)
            row = " | ".join(f"{mean:.3f}" for mean in means)
            print(f"| {name} | {length} | {row} |", flush=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("Name the npz file of slides.")
    main(sys.argv[1])
