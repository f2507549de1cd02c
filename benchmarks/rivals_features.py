"""What `rivals.py` compares: features of touches, and what slides of one finger tell.

Features of aeon take trials of one length, so trials are cut to the shortest of the
first training trials, or their last sample is repeated.
"""

import pickle
import time
from functools import partial

import numpy as np
import pandas as pd
from paper_questions_data import coders
from sklearn.base import BaseEstimator, clone
from sklearn.compose import ColumnTransformer
from sklearn.decomposition import PCA
from sklearn.linear_model import RidgeClassifierCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import SignalStatistics, make_haptic_pipeline
from sklearn_haptic.metrics import ranked_probability_score

COLUMNS = {
    "pac": slice(3, 25),
    "pdc": slice(2, 3),
    "tac": slice(1, 2),
    "tdc": slice(0, 1),
    "electrodes": slice(25, 44),
}
SENSORS = list(COLUMNS)
ROUGHNESS = [2, 0, 1, 0, 0, 0, 2, 0, 0, 0, 2, 1, 0, 0, 0, 2, 2, 2, 2, 0]
PRESETS = "presets"  # the features of both
LEVELS = "mean", "std", "max", "min", "slope", "change"


# Features -------------------------------------------------------------------


def statistics(sensor, *names, cells=(1,)):
    return SignalStatistics(names, n_bands=32 if sensor == "pac" else 16, cells=cells)


def of_frames(touch):
    """All sensors at the 100 Hz of the slow ones; vibration has 22 channels then."""
    n_frames = min([len(touch["pac"]) // 22, *(len(touch[s]) for s in SENSORS[1:])])
    vibration = touch["pac"][: 22 * n_frames].reshape(n_frames, -1)
    return np.hstack([vibration] + [touch[s][:n_frames] for s in SENSORS[1:]])


def of_equal_length(trials, n_times):
    each = [trial[:n_times] for trial in arrays(trials)]
    padded = [np.pad(t, ((0, n_times - len(t)), (0, 0)), mode="edge") for t in each]
    return np.stack(padded).swapaxes(1, 2).astype(np.float64)


def arrays(trials):
    """Trials of one sensor at its own rate, or of all sensors at 100 Hz."""
    if isinstance(trials, pd.DataFrame):
        return [of_frames(touch) for _, touch in trials[SENSORS].iterrows()]
    return list(trials)


class Kept(BaseEstimator):
    """A transformer of aeon, of trials cut to the shortest that was fitted."""

    def __init__(self, make):
        self.make = make

    def fit(self, trials, y=None):
        self.n_times_ = min(map(len, arrays(trials)))
        self.transformer_ = self.make()
        self.transformer_.fit(of_equal_length(trials, self.n_times_))
        return self

    def fit_transform(self, trials, y=None):
        return self.fit(trials).transform(trials)

    def transform(self, trials):
        X = self.transformer_.transform(of_equal_length(trials, self.n_times_))
        return np.nan_to_num(np.asarray(X, dtype=np.float64))


def minirocket(n_kernels=10_000):
    from aeon.transformations.collection.convolution_based import MiniRocket

    return MiniRocket(n_kernels, random_state=0)


def catch22():
    from aeon.transformations.collection.feature_based import Catch22

    return Catch22(replace_nans=True)


def of_sensors(columns, make):
    """Features of each sensor, side by side and standardised."""
    parts = [(c, make(c.rsplit("_", 1)[-1]), c) for c in columns]
    return make_pipeline(ColumnTransformer(parts), StandardScaler())


def families(columns=SENSORS):
    """Features by name; only some of several procedures side by side."""
    found = {
        PRESETS: make_haptic_pipeline(columns, random_state=0)[:-1],
        "maxima": make_pipeline(coders(columns), StandardScaler()),
        "statistics": of_sensors(columns, lambda s: statistics(s, *LEVELS)),
        "bands": of_sensors(columns, lambda s: statistics(s, "bands", cells=(4, 2, 1))),
    }
    if set(columns) == set(SENSORS):
        found["MiniRocket"] = make_pipeline(Kept(minirocket), StandardScaler())
        found["MiniRocket, own rates"] = of_sensors(
            columns, lambda s: Kept(partial(minirocket, 2_000))
        )
        found["Catch22"] = make_pipeline(Kept(catch22), StandardScaler())
    return found


ONCE = {
    "MiniRocket",
    "MiniRocket, own rates",
    "Catch22",
}  # what they learn needs no ratings


def of_folds(family, trials, folds):
    """Features of the trials of each fold; seconds to learn, per touch, and bytes."""
    found, learning, making, n_fits = [], 0.0, 0.0, 0
    for train, test in folds:
        if not n_fits or family not in ONCE:
            started = time.process_time()
            model = families(list(trials))[family].fit(trials.iloc[train])
            learned = time.process_time()
            X = np.asarray(model.transform(trials), dtype=np.float32)
            learning += learned - started
            making += time.process_time() - learned
            n_fits += 1
        found.append((train, test, X[train], X[test]))
    size = len(pickle.dumps(model))
    return found, (learning / n_fits, making / n_fits / len(trials), size)


def rotated(found):
    """The same on principal components, which changes no linear or kernel model."""
    turned = []
    for train, test, A, B in found:
        rotation = PCA(random_state=0).fit(A)
        turned.append((train, test, rotation.transform(A), rotation.transform(B)))
    return turned


# Slides ---------------------------------------------------------------------


def slides(folder):
    with np.load(folder / "biotac_slides" / "biotac_slides.npz") as arrays:
        frames = arrays["frames"].astype(np.float32)
        each = np.split(frames, np.cumsum(arrays["length"])[:-1])
        material, run = arrays["material"], arrays["run"]
    trials = {
        sensor: [slide[:599, columns] for slide in each]
        for sensor, columns in COLUMNS.items()
    }
    trials["pac"] = [trial.reshape(-1, 1) for trial in trials["pac"]]
    return pd.DataFrame(trials), material, run


def known(family, trials, material, run):
    """Which material? Accuracy over blocks of runs and from 1, 2 and 5; costs.

    The errors are those of each material over blocks.
    """
    block, folds = (run - 1) // 5, []
    for n_runs in (None, 1, 2, 5):
        for b in range(3):
            train, test = np.flatnonzero(block != b), np.flatnonzero(block == b)
            if n_runs:
                train, test = test[(run[test] - 1) % 5 < n_runs], train
            folds.append((train, test))
    found, cost = of_folds(family, trials, folds)
    right, accuracy = np.zeros(len(material)), []
    for at, (train, test, A, B) in enumerate(rotated(found)):
        model = RidgeClassifierCV(np.logspace(-1, 5, 13)).fit(A, material[train])
        hit = model.predict(B) == material[test]
        accuracy.append(hit.mean())
        if at < 3:
            right[test] = hit
    errors = 1 - np.bincount(material, right)[1:] / np.bincount(material)[1:]
    return np.reshape(accuracy, (4, 3)).mean(axis=1), errors, cost


def roughness(family, model, components, trials, material):
    """RPS of three levels of roughness of each material, never touched before."""
    y = np.eye(3)[np.array(ROUGHNESS)[material - 1]]
    folds = []
    for out in (np.random.default_rng(0).permutation(20) + 1).reshape(10, 2):
        test = np.isin(material, out)
        folds.append((np.flatnonzero(~test), np.flatnonzero(test)))
    each = np.zeros(len(y))
    found, _ = of_folds(family, trials, folds)
    for train, test, A, B in rotated(found) if components else found:
        takes = {"groups": material[train]} if hasattr(model, "cv") else {}
        proba = clone(model).fit(A, y[train], **takes).predict_proba(B)
        each[test] = ranked_probability_score(y[test], proba, average=False)
    return np.bincount(material, each)[1:] / np.bincount(material)[1:]
