"""When to stop a touch: rules of this package beside early classifiers of aeon.

    python benchmarks/early_classification.py biotac_slides.npz [--parts package aeon]

Which of twenty materials does one BioTac slide over? Models learn from runs 1 to 10 and
are tested on runs 11 to 15, in the first six seconds of every slide. The classifiers of
aeon, TEASER and a threshold on probability, stop at the same durations as those of
`AnytimeRegressor`. They classify by MiniRocket features of all 44 channels at 100 Hz,
and the rules of this package are shown on the same predictions too. Ours are the
features of the presets, or statistics of all channels in 32 bands. The rows are means
over the 100 test slides; the error is that of a share of errors. Needs the extra
`aeon`. Five minutes on one core.
"""

import argparse
import time
import warnings
from tempfile import TemporaryDirectory

import numba
import numpy as np
import pandas as pd
from aeon.classification.early_classification import (
    TEASER,
    ProbabilityThresholdEarlyClassifier,
)
from aeon.transformations.collection.convolution_based import MiniRocket
from sklearn.compose import make_column_transformer
from sklearn.decomposition import PCA
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from streaming import RATES, pipeline

from sklearn_haptic import AnytimeRegressor, SignalStatistics
from sklearn_haptic.streaming import CertaintyThreshold, ExpectedGain

FRAMES = [10, 25, 50, 100, 200, 400, 599]  # of 10 ms
THRESHOLDS = [0.3, 0.5, 0.7, 0.8, 0.9, 0.97]
PRICES = [0.1, 0.03, 0.01, 0.003, 0.001]
LATER = 10  # runs behind this are for the test


def read(path):
    """Frames of shape (n_slides, n_frames, n_channels), materials, later runs."""
    with np.load(path) as arrays:
        frames = np.split(
            arrays["frames"].astype(np.float64), np.cumsum(arrays["length"])[:-1]
        )
        frames = np.stack([each[: FRAMES[-1]] for each in frames])
        return frames, arrays["material"], arrays["run"]


def rockets(memory):
    """A classifier by MiniRocket features; equal fits are remembered."""
    return Pipeline(
        [
            ("rocket", MiniRocket(random_state=0)),
            ("scale", StandardScaler()),
            ("rotate", PCA(random_state=0)),
            ("model", LogisticRegression(C=0.1, max_iter=500)),
        ],
        memory=memory,
    )


def show(name, right, seconds):
    error = 1 - np.mean(right)
    spread = np.sqrt(error * (1 - error) / len(right))
    print(
        f"| {name} | {np.mean(seconds):.2f} | {error:.2f} ± {spread:.2f} |", flush=True
    )


def of_aeon(frames, y, train, run):
    """A threshold of aeon, and rules of this package on the same predictions."""
    X = frames.swapaxes(1, 2).astype(np.float32)
    with TemporaryDirectory() as memory:
        fitted = ProbabilityThresholdEarlyClassifier(
            rockets(memory), classification_points=FRAMES, random_state=0
        ).fit(X[train], y[train])
        for threshold in THRESHOLDS:
            fitted.probability_threshold = threshold
            rule(f"aeon, probability {threshold:g}", fitted, X[~train], y[~train])
        prefixes = [X[..., :n] for n in FRAMES]
        path = [
            each.predict_proba(prefix[~train])
            for each, prefix in zip(fitted.estimators_, prefixes)
        ]
        out_of_fold = [
            cross_val_predict(
                rockets(memory),
                prefix[train],
                y[train],
                groups=run[train],
                cv=GroupKFold(5),
                method="predict_proba",
            )
            for prefix in prefixes
        ]
    path, out_of_fold = (np.stack(each, axis=1) for each in (path, out_of_fold))
    stop("MiniRocket", path, out_of_fold, y[~train], y[train], np.unique(y))


def of_teaser(frames, y, train, run):
    X = frames.swapaxes(1, 2).astype(np.float32)
    with TemporaryDirectory() as memory:
        teaser = TEASER(rockets(memory), classification_points=FRAMES, random_state=0)
        rule("aeon, TEASER", teaser.fit(X[train], y[train]), X[~train], y[~train])


def stop(name, path, out_of_fold, y, y_train, classes):
    """Show fixed durations, and where rules of this package stop."""
    durations = [n / 100 for n in FRAMES]
    right = classes[path.argmax(axis=2)] == y[:, None]
    for k, seconds in enumerate(durations):
        show(f"{name}, fixed {seconds:g} s", right[:, k], seconds)
    one_hot = y_train[:, None] == classes
    rules = {f"probability {t:g}": CertaintyThreshold(t) for t in THRESHOLDS}
    rules |= {f"expected gain, price {p:g}": ExpectedGain(p) for p in PRICES}
    for label, each in rules.items():
        each.fit(out_of_fold, one_hot, durations=durations, ordered=False)
        at = each.stop_at(path)
        stopped = right[np.arange(len(at)), at]
        show(f"{name}, {label}", stopped, np.take(durations, at))


def rule(name, fitted, X, y):
    predicted, _ = fitted.predict(X)
    show(name, predicted == y, np.take(FRAMES, fitted.state_info[:, 0]) / 100)


def of_this_package(frames, y, train, run):
    columns = {"tdc": [0], "tac": [1], "pdc": [2], "electrodes": [*range(25, 44)]}
    touches = {s: [x[:, c] for x in frames] for s, c in columns.items()}
    touches["pac"] = [x[:, 3:25].reshape(-1, 1) for x in frames]
    touches = pd.DataFrame(touches)
    head = LogisticRegression(C=0.1, max_iter=500)
    statistics = make_column_transformer(
        *((SignalStatistics(n_bands=32), sensor) for sensor in touches)
    )
    models = {
        "codes": pipeline(head),
        "statistics": make_pipeline(statistics, StandardScaler(), head),
    }
    durations = [n / 100 for n in FRAMES]
    for name, model in models.items():
        model = AnytimeRegressor(model, durations=durations, sampling_rates=RATES)
        model.fit(touches[train], y[train], groups=run[train])
        path = model.predict_proba_over_time(touches[~train], durations)
        oof = model.oof_proba_
        right = model.classes_[oof.argmax(axis=2)] == y[train, None]
        print(f"{name}, out of fold: errors {(1 - right.mean(axis=0)).round(2)}")
        stop(name, path, oof, y[~train], y[train], model.classes_)


PARTS = {"package": of_this_package, "aeon": of_aeon, "teaser": of_teaser}


def main(path, parts):
    frames, y, run = read(path)
    train = run <= LATER
    print("| rule | seconds, mean | share of errors |\n|---|---|---|")
    for part in parts:
        PARTS[part](frames, y, train, run)
        print(f"({time.process_time():.0f} s)", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file")
    parser.add_argument("--parts", nargs="+", default=[*PARTS], choices=[*PARTS])
    arguments = parser.parse_args()
    numba.set_num_threads(1)
    warnings.filterwarnings("ignore")  # of aeon
    main(arguments.file, arguments.parts)
