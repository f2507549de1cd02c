"""Two corpora of other hands: sensors described, named, or left to be found out.

Which of seven fabrics does a finger of 16 taxels slide over, at forces and speeds in
combinations that were not trained on (five folds), or at a force that was not (five
folds)? Which of twenty materials does one BioTac, in five of fifteen runs (three
folds)? The rivals are statistics and spectral bands of each channel, and MiniRocket,
whose random kernels take trials of one length: cut to that of the shortest trial, or
stretched to the median. They are drawn from all trials, which favours MiniRocket. Every
row has the same ridge classifier on standardised features.

    python benchmarks/other_sensors.py FOLDER

FOLDER holds fabric_slides/fabric_slides.npz and biotac_slides/biotac_slides.npz. Needs
the extra `aeon`. A minute on one core.
"""

import sys
from pathlib import Path

import numba
import numpy as np
import pandas as pd
from aeon.transformations.collection.convolution_based import MiniRocket
from sklearn.base import clone
from sklearn.compose import make_column_transformer
from sklearn.linear_model import RidgeClassifierCV
from sklearn.model_selection import GroupKFold, LeaveOneGroupOut, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import Signal, SignalStatistics, TaxelGrid, make_haptic_pipeline

BIOTAC = {
    "pac": Signal(rate=2200, window=0.01),
    "pdc": Signal(rate=100),
    "tac": Signal(rate=100),
    "tdc": Signal(rate=100),
    "electrodes": TaxelGrid("biotac"),
}
# Columns of the frames of a BioTac.
COLUMNS = {"tdc": [0], "tac": [1], "pdc": [2], "pac": [*range(3, 25)]}
COLUMNS["electrodes"] = [*range(25, 44)]


def fabrics(folder):
    """Trials, frames of all channels, fabrics, and folds by name."""
    with np.load(folder / "fabric_slides" / "fabric_slides.npz") as arrays:
        trials = np.split(
            arrays["taxels"].astype(np.float32), np.cumsum(arrays["length"])[:-1]
        )
        force, speed = arrays["force"].astype(int), arrays["speed"].astype(int)
        y = arrays["fabric"]
    splits = {
        "fabric, force and speed": (1000 * force + speed, GroupKFold(5)),
        "fabric, force": (force, LeaveOneGroupOut()),
    }
    return trials, trials, y, splits


def materials(folder):
    """Trials, frames of all channels, materials, and folds by name."""
    with np.load(folder / "biotac_slides" / "biotac_slides.npz") as arrays:
        frames = np.split(
            arrays["frames"].astype(np.float32), np.cumsum(arrays["length"])[:-1]
        )
        y, blocks = arrays["material"], (arrays["run"] - 1) // 5
    trials = pd.DataFrame(
        {name: [f[:, columns] for f in frames] for name, columns in COLUMNS.items()}
    )
    trials["pac"] = [trial.reshape(-1, 1) for trial in trials["pac"]]
    return trials, frames, y, {"material, runs": (blocks, LeaveOneGroupOut())}


def kernels(frames, stretch):
    """Features of MiniRocket of trials that are cut or stretched to one length."""
    lengths = [len(trial) for trial in frames]
    n_times = int(np.median(lengths) if stretch else min(lengths))

    def fit(signal):
        at = np.linspace(0, len(signal) - 1, n_times)
        return np.interp(at, np.arange(len(signal)), signal)

    arrays = [
        [fit(channel) for channel in trial.T] if stretch else trial[:n_times].T
        for trial in frames
    ]
    X = np.array(arrays, dtype=np.float32)
    return MiniRocket(random_state=0).fit_transform(X)


def with_ridge(features):
    """A classifier of features, the same for all."""
    ridge = RidgeClassifierCV(np.logspace(-1, 5, 13))
    return make_pipeline(features, StandardScaler(), ridge)


def statistics(described, **settings):
    """Statistics and spectral bands of each sensor, over whole touches."""
    each = SignalStatistics(**settings)
    if isinstance(described, dict):
        return make_column_transformer(*((clone(each), name) for name in described))
    return each


def compare(described, undescribed, trials, frames, y, splits):
    """Print the accuracy of every row and its difference to the better rival."""
    rows = {
        "described": (make_haptic_pipeline(described, random_state=0)[0], trials),
        "not described": (make_haptic_pipeline(undescribed, random_state=0)[0], trials),
    }
    if isinstance(described, dict):
        rows["named"] = (make_haptic_pipeline(random_state=0)[0], trials)
    rows["statistics, 32 bands"] = (statistics(described, n_bands=32), trials)
    rows["statistics"] = (statistics(described), trials)
    for how in ("cut", "stretched"):
        rows[f"MiniRocket, {how}"] = ("passthrough", kernels(frames, how != "cut"))
    for name, (groups, folds) in splits.items():
        scores = {
            row: cross_val_score(with_ridge(features), X, y, groups=groups, cv=folds)
            for row, (features, X) in rows.items()
        }
        best = max(list(rows)[-3:], key=lambda row: scores[row].mean())
        for row, each in scores.items():
            difference = each - scores[best]
            print(
                f"| {name} | {row} | {plus_minus(each)} | {plus_minus(difference)} |",
                flush=True,
            )


def plus_minus(values):
    """Mean and standard error over folds."""
    error = np.std(values, ddof=1) / np.sqrt(len(values))
    return f"{np.mean(values):.3f} ± {error:.3f}"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("Name the folder of fabric_slides and biotac_slides.")
    numba.set_num_threads(1)
    print("| left out | features | accuracy | difference to the better rival |")
    print("|---|---|---|---|")
    folder = Path(sys.argv[1])
    compare(TaxelGrid((4, 4)), None, *fabrics(folder))
    compare(BIOTAC, dict.fromkeys(BIOTAC), *materials(folder))
