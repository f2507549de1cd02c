"""The data sets of the benchmarks: generated touches, recordings, and ratings.

The folder that the functions take holds ``bolt_pilot/bolt_pilot_phac2_layout.h5``,
``biotac_slides/biotac_slides.npz``, ``fabric_slides/fabric_slides.npz``,
``movie_ratings/Movie.npz``, ``phac2_static/``, ``wine_ratings/ordinal_wine.csv``,
``tactile_ratings/`` and ``vibviz/vibviz.npz``. docs/real_data.md says where they come
from.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from sklearn.decomposition import TruncatedSVD
from sklearn.model_selection import GroupKFold, LeaveOneGroupOut
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import Signal, TaxelGrid
from sklearn_haptic.datasets import load_phac2, make_haptic_corpus
from sklearn_haptic.ratings import counts_from_moments

SENSORS = ["pac", "pdc", "tac", "tdc", "electrodes"]
PROCEDURES = ["squeeze", "hold", "slow_slide", "fast_slide"]
# Columns of the frames of a BioTac at 100 Hz.
COLUMNS = {
    "pac": slice(3, 25),
    "pdc": slice(2, 3),
    "tac": slice(1, 2),
    "tdc": slice(0, 1),
    "electrodes": slice(25, 44),
}
RATES = {"pac": 2200, "pdc": 100, "tac": 100, "tdc": 100, "electrodes": 100}
# A BioTac as one would describe it, if its sensors had no names of their own.
BIOTAC = {
    "pac": Signal(rate=2200, window=0.01),
    "pdc": Signal(rate=100),
    "tac": Signal(rate=100),
    "tdc": Signal(rate=100),
    "electrodes": TaxelGrid("biotac"),
}


class Data(NamedTuple):
    """Touches or features with ratings."""

    trials: object  # table with one column per sensor, or an array of given features
    targets: dict  # name -> counts of shape (n_trials, n_levels)
    groups: np.ndarray
    folds: list  # (train, test) by whole groups
    given: object = None  # what prepares given features, None for touches


def split(groups, n_splits=5, seed=0):
    """Return folds of whole groups."""
    folds = GroupKFold(n_splits, shuffle=True, random_state=seed)
    return list(folds.split(groups, groups=groups))


# Ratings ------------------------------------------------------------------------------


def generated(folder, procedure, seed, n_objects=40, n_trials=5):
    """Generated touches of objects, rated on ten adjectives."""
    corpus = make_haptic_corpus(n_objects, n_trials, procedure, random_state=seed)
    folds = split(corpus.objects)
    return Data(corpus.trials, dict(corpus.ratings), corpus.objects, folds)


def grips(folder, procedures=("hold",)):
    """74 grips of five materials at three forces, which are what is predicted.

    Several procedures stand side by side.
    """
    path = folder / "bolt_pilot" / "bolt_pilot_phac2_layout.h5"
    corpora = [load_phac2(path, procedure=name) for name in procedures]
    trials = [corpus.trials for corpus in corpora]
    if len(procedures) > 1:
        trials = [t.add_prefix(f"{name}_") for t, name in zip(trials, procedures)]
    materials = corpora[0].object_names
    run = np.array([int(name.rsplit("_", 1)[1]) for name in corpora[0].trials.index])
    # Five runs at each force, but one at 150 is missing for the glass bottle.
    run += (materials == "glass_bottle") & (run > 6)
    folds = list(LeaveOneGroupOut().split(run, groups=materials))
    force = np.eye(3)[(run - 1) // 5]
    return Data(pd.concat(trials, axis=1), {"force": force}, materials, folds)


def films(folder, n_films=1500):
    """Films drawn at random, with their features and the shares of their stars."""
    with np.load(folder / "movie_ratings" / "Movie.npz") as arrays:
        X, shares = arrays["X"], arrays["D"]
    drawn = np.random.default_rng(0).permutation(len(X))[:n_films]
    folds = split(np.arange(len(drawn)))
    given = make_pipeline(TruncatedSVD(100, random_state=0), StandardScaler())
    return Data(X[drawn], {"stars": 12 * shares[drawn]}, drawn, folds, given)


def votes(folder):
    """600 touches of 60 objects by 188 features, with 0 to 5 votes for "hard"."""
    with np.load(folder / "phac2_static" / "phac2_static.npz") as arrays:
        objects = arrays["object_id"]
        X = arrays["X_static"].reshape(len(objects), -1)
    table = pd.read_csv(folder / "phac2_static" / "objects.csv", index_col=0)
    hard = table["hardness_votes"].loc[objects].to_numpy()
    target = {"hardness": np.eye(6)[hard]}
    return Data(X, target, objects, split(objects), StandardScaler())


def wine(folder):
    """Eight bottles tasted by nine judges, known by temperature and contact."""
    table = pd.read_csv(folder / "wine_ratings" / "ordinal_wine.csv")
    keys = ["temp", "contact", "bottle"]
    counts = table.groupby(keys)["rating"].value_counts().unstack(fill_value=0)
    X = pd.get_dummies(counts.index.to_frame()[keys[:2]], drop_first=True)
    groups = counts.index.map("{0[0]} {0[1]} {0[2]}".format).to_numpy(str)
    folds = list(LeaveOneGroupOut().split(groups, groups=groups))
    target = {"bitterness": counts.to_numpy(float)}
    return Data(X.to_numpy(float), target, groups, folds, StandardScaler())


def tactile(folder):
    """Sixteen materials rated by hand, known by what the feet of others told."""
    path = folder / "tactile_ratings"
    long = pd.read_csv(path / "ratings_long.csv").query("Condition == 'walking'")
    X = long.pivot_table("log_ratio", "Texture", "Metric")
    counts = pd.read_csv(path / "counts.csv").query("Condition == 'hand'")
    counts = counts.set_index(["Metric", "Texture"])[[f"n{i}" for i in range(1, 6)]]
    names = counts.index.levels[0]
    targets = {name: counts.loc[name].loc[X.index].to_numpy(float) for name in names}
    groups = X.index.to_numpy()
    folds = list(LeaveOneGroupOut().split(groups, groups=groups))
    return Data(X.to_numpy(), targets, groups, folds, StandardScaler())


def vibrations(folder, std=1.2, n_people=12):
    """Eighty vibrations, and people's mean ratings from -3 to 3.

    Only means are published, so the deviation is borrowed: that of 1.2 on seven levels
    is an agreement r_wg of .64, as people reach on materials.
    """
    with np.load(folder / "vibviz" / "vibviz.npz") as arrays:
        ends = np.cumsum(arrays["length"])[:-1]
        signals = np.split(arrays["signal"], ends)
        means = pd.DataFrame(
            arrays["mean"], index=arrays["id"], columns=arrays["attribute"]
        )
    targets = {
        name: counts_from_moments(mean, std, levels=range(-3, 4), n=n_people)
        for name, mean in means.items()
    }
    groups = means.index.to_numpy()
    folds = split(groups, 10)
    return Data([signal[:, None] for signal in signals], targets, groups, folds)


RATED = {
    "bolt": grips,
    "bolt, all": partial(grips, procedures=["hold", *PROCEDURES[:1], *PROCEDURES[2:]]),
    **{
        f"{name}{seed}": partial(generated, procedure=procedure, seed=seed)
        for name, procedure in (("slow", "slow_slide"), ("hold", "hold"))
        for seed in (0, 1)
    },
    "phac2": votes,
    "films": films,
    "wine": wine,
}


# Classes ------------------------------------------------------------------------------


def slide_frames(folder, n_frames=None, dtype=np.float32):
    """Slides of one BioTac over twenty materials, fifteen runs each.

    Returns
    -------
    frames : list of ndarray of shape (n_frames_i, 44)
    material, run : ndarray of int
    """
    with np.load(folder / "biotac_slides" / "biotac_slides.npz") as arrays:
        ends = np.cumsum(arrays["length"])[:-1]
        frames = np.split(arrays["frames"].astype(dtype), ends)
        return [f[:n_frames] for f in frames], arrays["material"], arrays["run"]


def by_sensor(frames):
    """Return a table of the five sensors of a BioTac from its frames."""
    trials = {name: [f[:, c] for f in frames] for name, c in COLUMNS.items()}
    trials["pac"] = [trial.reshape(-1, 1) for trial in trials["pac"]]
    return pd.DataFrame(trials)


def fabric_slides(folder):
    """Slides of a finger of 16 taxels over seven fabrics.

    Returns
    -------
    frames : list of ndarray of shape (n_frames_i, 16)
    fabric, force, condition : ndarray of int
        A condition is a force and a speed.
    """
    with np.load(folder / "fabric_slides" / "fabric_slides.npz") as arrays:
        ends = np.cumsum(arrays["length"])[:-1]
        frames = np.split(arrays["taxels"].astype(np.float32), ends)
        force = arrays["force"].astype(int)
        condition = 1000 * force + arrays["speed"].astype(int)
        return frames, arrays["fabric"], force, condition
