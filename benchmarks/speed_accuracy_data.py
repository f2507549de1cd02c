"""The sets of `speed_accuracy.py`: generated touches, recorded grips, ratings."""

from typing import NamedTuple

import numpy as np
from real_ratings import movie, phac2
from sklearn.base import BaseEstimator
from sklearn.decomposition import PCA
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic.datasets import load_phac2, make_haptic_corpus

ADJECTIVES = ["hard", "smooth", "springy"]  # every fold has their extreme levels
FORCES = np.array([100, 150, 200])
REPEATS = {"synthetic": 2, "bolt": 1, "movie": 1, "phac2": 2}


class Data(NamedTuple):
    trials: object  # DataFrame with one column per sensor, or a table of features
    targets: dict  # name -> counts or labels
    groups: np.ndarray
    levels: np.ndarray | None
    scale: BaseEstimator  # what comes before the head
    title: str

    @property
    def is_table(self):
        """Whether the set has features, of which none are to be made."""
        return isinstance(self.trials, np.ndarray)


def load(name, folder, quick):
    if name == "synthetic":
        return synthetic(quick)
    if name == "bolt":
        return bolt(folder)
    X, y, groups, scale, levels = {"movie": movie, "phac2": phac2}[name](folder)
    if name == "movie":
        n_films = 500 if quick else 2000
        drawn = np.random.default_rng(0).choice(len(X), n_films, replace=False)
        X, y, groups = X[drawn], y[drawn], groups[drawn]
    title = f"{len(X)} rows, {len(np.unique(groups))} groups"
    return Data(X, {"rating": y}, groups, levels, scale, title)


def rotation():
    return make_pipeline(StandardScaler(), PCA())


def synthetic(quick):
    n_objects, n_trials = (15, 3) if quick else (30, 5)
    corpus = make_haptic_corpus(
        n_objects, n_trials, procedure="slow_slide", random_state=0
    )
    targets = {a: corpus.ratings[a] for a in ADJECTIVES}
    title = f"{n_objects} objects × {n_trials} slow slides, {len(targets)} ratings"
    return Data(
        corpus.trials, targets, corpus.objects, corpus.levels, rotation(), title
    )


def bolt(folder):
    """Grips of five materials; the force is what is predicted."""
    path = folder / "bolt_pilot" / "bolt_pilot_phac2_layout.h5"
    corpus = load_phac2(path, procedure="hold")
    materials = corpus.object_names
    run = np.array([int(name.rsplit("_", 1)[1]) for name in corpus.trials.index])
    # Five runs at each force, but one at 150 is missing for the glass bottle.
    run += (materials == "glass_bottle") & (run > 6)
    forces = FORCES[(run - 1) // 5]
    title = f"{len(run)} recorded holds of 5 materials, grip force in 3 levels"
    return Data(corpus.trials, {"force": forces}, materials, FORCES, rotation(), title)
