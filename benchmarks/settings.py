"""What each setting costs and gains, one at a time around a base.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/settings.py FOLDER \
        [--sets bolt films …] [--knobs atoms "hidden units" …] [--csv FILE]

It takes about an hour on one core, with ``--quick`` (small sets, three folds) a few
minutes, with one knob besides seconds to a minute.

There are five folds of whole objects, repeated with other folds and seeds. The first
value of every knob is its reference, with scores ± standard errors; the others have in
brackets the paired difference to it ± its standard error [1]_, in bold beyond two. The
base has the defaults of the transformers and of `DistributionalOrdinalRegressor`, but
keeps the means of windows; ``alpha`` is 10 unless a value says otherwise. Features are
standardised and rotated to as many axes as there are trials, which loses nothing.
Seconds are processor time, medians over folds: to learn and make features of training
trials, to make those of test trials, and to fit and predict, per adjective.

.. [1] Nadeau, C. & Bengio, Y. (2003). Inference for the generalization error.
   Machine Learning 52. https://doi.org/10.1023/A:1024068626366
"""

import sys
import time
import warnings
from functools import cache
from pathlib import Path
from typing import NamedTuple

import data
import joblib
import mord
import numpy as np
import pandas as pd
from heads import linear
from measure import SCORES, command, head, row, timed
from sklearn.base import BaseEstimator, clone
from sklearn.decomposition import PCA
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.validation import has_fit_parameter

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    KSVDTransformer,
    STHMPTransformer,
    TemporalMaxPool,
)
from sklearn_haptic.metrics import neg_rps_scorer

# Window in time samples and number of atoms, as in the 2020 paper.
SIZES = {"pac": (22, 40), "pdc": (50, 25), "tac": (50, 25), "tdc": (50, 10)}
SENSORS = (*SIZES, "electrodes")
ADJECTIVES = ["hard", "smooth", "springy"]  # every fold has their extreme levels
REPEATS = {"synthetic": 2, "bolt": 1, "films": 1, "phac2": 2}
SECONDS = ["features", "transform", "fit", "predict"]
NAMES = {"MAE^M": "mae_m", "EMD": "emd", "RPS": "rps", "log score": "log_score"}

# Knobs --------------------------------------------------------------------------------


class Setting(NamedTuple):
    """A model and its features, as far as they differ from the base."""

    features: dict = {}  # noqa: RUF012
    model: BaseEstimator = linear(10.0)
    alphas: tuple = ()  # from which to choose by the training trials


BASE = Setting()


def features(**changes):
    return Setting(changes)


def model(**changes):
    return Setting(model=clone(BASE.model).set_params(**changes))


def network(**changes):
    """The base with ten hidden units."""
    defaults = {"n_hidden": 10, "alpha": 10.0, "random_state": 0}
    return model(estimator=NNPOM(**defaults | changes))


def searched(setting, alphas):
    """The same, but its penalty is chosen by grouped folds of the training trials."""
    return setting._replace(alphas=tuple(alphas))


def duplicates(n):
    """Another number of observations per trial, with the penalty in proportion."""
    return model(n_duplicates=n, estimator__alpha=10.0 * n / 15)


def vary(make, name, values):
    def said(value):
        return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)

    return {said(value): make(**{name: value}) for value in values}


def coded(n_nonzero_coefs, max_iter, max_train, cells):
    """A smaller penalty; dictionaries learned with more or less care."""
    changes = {"n_nonzero_coefs": n_nonzero_coefs, "max_iter": max_iter}
    changes |= {"cells": cells, "max_train": max_train}
    return model(estimator__alpha=3.0)._replace(features=changes)


FEATURES = {
    "temporal pooling": vary(
        features,
        "cells",
        [(16, 8, 4, 2, 1), (1,), (4, 2, 1), (8, 4, 2, 1), (16,), (32, 16, 8, 4, 2, 1)],
    ),
    "atoms": {
        "40, 25, 25, 10, 10": BASE,
        "half": features(atoms=0.5),
        "double": features(atoms=2),
    },
    "sparsity": vary(features, "n_nonzero_coefs", [4, 1, 2, 8]),
    "K-SVD iterations": vary(features, "max_iter", [50, 0, 5, 20, 100]),
    "training windows": vary(features, "max_train", [20_000, 2000, 5000, 50_000]),
    "update": vary(features, "update", ["approximate", "exact"]),
    "precision": vary(features, "dtype", ["float32", "float64"]),
    "mean removed": {
        "none": BASE,
        "pac, electrodes": features(mean_removed=("pac", "electrodes")),
        "every sensor": features(mean_removed=SENSORS),
    },
    "sensors": {
        "all": BASE,
        **{f"{s} alone": features(sensors=(s,)) for s in SENSORS},
        **{
            f"without {s}": features(sensors=tuple(t for t in SENSORS if t != s))
            for s in SENSORS
        },
    },
    "dictionaries": {
        "base": BASE,
        "slow": coded(4, 50, 20_000, (8, 4, 2, 1)),
        "medium": coded(4, 20, 5000, (4, 2, 1)),
        "quick": coded(2, 5, 5000, (4, 2, 1)),
    },
}
MODELS = {
    "n_duplicates": {str(n): duplicates(n) for n in (15, 3, 5, 50)},
    "sampling": vary(model, "sampling", ["level", "random"]),
    "p_transform": vary(model, "p_transform", ["logit", None]),
    "decoding": {
        "mixture": BASE,
        "quantile 99, median": model(decode="quantile"),
        "quantile 99, argmax": model(decode="quantile", rule="argmax"),
        "quantile 9, median": model(decode="quantile", n_quantiles=9),
    },
    "alpha": {
        "10": BASE,
        "searched": searched(BASE, np.logspace(-2, 2, 9)),
        **vary(model, "estimator__alpha", [0.01, 0.1, 1.0, 3.0, 30.0, 100.0, 1000.0]),
    },
    "hidden units": {"0": BASE, **vary(network, "n_hidden", [1, 5, 10, 20, 30])},
    "max_iter": vary(model, "estimator__max_iter", [500, 10, 25, 75, 200]),
    "tol, 10 hidden units": vary(network, "tol", [1e-4, 1e-5, 1e-3]),
    "solver, 10 hidden units": vary(network, "solver", ["lbfgs", "irprop+"]),
    "early stopping, 10 hidden units": {
        "none": network(),
        "patience 20": network(early_stopping=True, n_iter_no_change=20),
        "patience 150": network(early_stopping=True, n_iter_no_change=150),
    },
    "model": {
        "base": BASE,
        "mord LogisticAT, alpha searched": searched(
            model(estimator=mord.LogisticAT()), np.logspace(0, 5, 6)
        ),
        "counts, no p": Setting(model=NNPOM(n_hidden=0, alpha=10.0)),
        "paper's settings": Setting(
            model=DistributionalOrdinalRegressor(**PAPER_2020, random_state=0)
        ),
        "marginal": Setting(model=DummyDistribution("marginal")),
        "barycentre": Setting(model=DummyDistribution("barycentre")),
    },
}
KNOBS = FEATURES | MODELS


# One fold -----------------------------------------------------------------------------


def load(name, folder, quick):
    if name == "synthetic":
        n_objects, n_trials = (15, 3) if quick else (30, 5)
        found = data.generated(folder, "slow_slide", 0, n_objects, n_trials)
        return found._replace(targets={a: found.targets[a] for a in ADJECTIVES})
    if name == "films":
        return data.films(folder, 500 if quick else 2000)
    return data.RATED[name](folder)


class Sensor(NamedTuple):
    """How the features of one sensor are made."""

    name: str
    remove_mean: bool
    atoms: float = 1  # times the paper's size
    n_nonzero_coefs: int = 4
    max_iter: int = 50
    max_train: int = 20_000  # windows or patches
    update: str = "approximate"
    dtype: str = "float32"
    cells: tuple = (16, 8, 4, 2, 1)

    def coder(self, random_state):
        names = "n_nonzero_coefs", "remove_mean", "max_iter", "update"
        parameters = {name: getattr(self, name) for name in names}
        parameters["random_state"] = random_state
        if self.name == "electrodes":
            parameters["max_train_patches"] = self.max_train
            return STHMPTransformer(round(10 * self.atoms), **parameters)
        window, n_atoms = SIZES[self.name]
        parameters |= {"window": window, "max_train_windows": self.max_train}
        return KSVDTransformer(round(n_atoms * self.atoms), **parameters)


class Fold:
    """One split of a set; everything that its settings share is computed once."""

    def __init__(self, found, seed, train, test):
        self.data, self.seed, self.train, self.test = found, seed, train, test
        self.dictionary, self.block = cache(self.dictionary), cache(self.block)
        self.results, self.tables = {}, {}

    def cells(self, sensor, rows):
        cells = self.data.trials[sensor.name].iloc[rows]
        return cells.map(lambda trial: trial.astype(sensor.dtype))

    def dictionary(self, sensor):
        """Seconds, and the fitted coder of a sensor."""
        return timed(sensor.coder(self.seed).fit, self.cells(sensor, self.train))

    def block(self, sensor):
        """Features of training and test trials of a sensor, and their seconds."""
        same = sensor._replace(cells=Sensor._field_defaults["cells"])
        learning, coder = self.dictionary(same)
        train, test = (self.cells(sensor, rows) for rows in (self.train, self.test))
        steps = make_pipeline(TemporalMaxPool(sensor.cells), StandardScaler(), PCA())
        coding, A = timed(lambda: steps.fit_transform(coder.transform(train)))
        other, B = timed(lambda: steps.transform(coder.transform(test)))
        return A, B, (learning + coding, other)

    def table(self, sensors=SENSORS, mean_removed=(), **changes):
        """Features of some sensors side by side, or those that the set has."""
        if self.data.given is not None:
            scale, X = clone(self.data.given), self.data.trials
            fitting, A = timed(scale.fit_transform, X[self.train])
            other, B = timed(scale.transform, X[self.test])
            return A, B, (fitting, other)
        blocks = [self.block(Sensor(s, s in mean_removed, **changes)) for s in sensors]
        if len(blocks) == 1:
            return blocks[0]
        A, B, seconds = zip(*blocks)
        rotation, seconds = PCA(), np.sum(seconds, axis=0)
        fitting, A = timed(rotation.fit_transform, np.hstack(A))
        other, B = timed(rotation.transform, np.hstack(B))
        return A, B, (seconds[0] + fitting, seconds[1] + other)

    def search(self, estimator, alphas, A, y):
        """Choose alpha by the RPS on grouped folds of the training trials."""
        name = "estimator__alpha" if hasattr(estimator, "estimator") else "alpha"
        groups = self.data.groups[self.train]
        cv = GroupKFold(min(4, len(np.unique(groups))))
        grid = {name: list(alphas)}
        search = GridSearchCV(
            estimator, grid, scoring=neg_rps_scorer, cv=cv, refit=False
        )
        best = search.fit(A, y, groups=groups).best_params_
        return clone(estimator).set_params(**best)

    def run(self, setting, A, B, y):
        """Seconds to fit and predict, and the scores."""
        estimator = clone(setting.model)
        if setting.alphas:
            estimator = self.search(estimator, setting.alphas, A, y[self.train])
        takes = {}
        if has_fit_parameter(estimator, "groups"):
            takes["groups"] = self.data.groups[self.train]
        fitting, _ = timed(estimator.fit, A, y[self.train], **takes)
        other, proba = timed(estimator.predict_proba, B)
        return fitting, other, *(SCORES[name](y[self.test], proba) for name in NAMES)

    def evaluate(self, setting):
        """Seconds of the four stages and the scores, means over the targets."""
        key = joblib.hash(setting)
        if key not in self.results:
            made = joblib.hash(setting.features)
            if made not in self.tables:
                self.tables[made] = self.table(**setting.features)
            A, B, seconds = self.tables[made]
            runs = [self.run(setting, A, B, y) for y in self.data.targets.values()]
            self.results[key] = *seconds, *np.mean(runs, axis=0)
        return self.results[key]


# Tables -------------------------------------------------------------------------------


def summarise(name, knob, results, n_folds):
    """Medians of seconds, means of scores and paired differences to the first value.

    ``results`` has an array of shape (n_folds, 8) for each value. The first value has
    no difference, and the error of its mean. Seconds that do not depend on the knob
    are missing.
    """
    first, *_ = results.values()
    lines = []
    for value, each in results.items():
        line = {"set": name, "knob": knob, "value": value}
        for k, stage in enumerate(SECONDS):
            depends = len({of_value[0, k] for of_value in results.values()}) > 1
            line[f"{stage}_s"] = np.median(each[:, k]) if depends else np.nan
        for k, score in enumerate(NAMES.values(), start=len(SECONDS)):
            compared = each[:, k] if each is first else each[:, k] - first[:, k]
            line[score] = each[:, k].mean()
            line[f"{score}_difference"] = np.nan if each is first else compared.mean()
            spread = np.std(compared, ddof=1) if np.isfinite(compared).all() else np.nan
            shared = np.sqrt(1 / len(compared) + 1 / (n_folds - 1))
            line[f"{score}_error"] = spread * shared
        lines.append(line)
    return pd.DataFrame(lines)


def describe(line, score):
    """The reference with its standard error, others with the paired difference."""
    mean, difference, error = line[[score, f"{score}_difference", f"{score}_error"]]
    if not np.isfinite(mean):
        return "infinite"
    if not np.isfinite(error):
        return f"{mean:.3f}"
    if not np.isfinite(difference):
        return f"{mean:.3f} ± {error:.3f}"
    text = f"{difference:+.3f} ± {error:.3f}".replace("-", "−")
    bold = "**" * (abs(difference) > max(2 * error, 0.0005))
    return f"{mean:.3f} ({bold}{text}{bold})"


def print_table(lines):
    """Print a knob, without the seconds that do not depend on it."""
    stages = [stage for stage in SECONDS if lines[f"{stage}_s"].notna().all()]
    head(lines["knob"].iloc[0], *(f"{stage}, s" for stage in stages), *NAMES)
    for _, line in lines.iterrows():
        seconds = [f"{line[f'{stage}_s']:.3g}" for stage in stages]
        row(line["value"], *seconds, *(describe(line, s) for s in NAMES.values()))


def measure(name, found, knobs, n_folds, n_repeats):
    """Tables of the knobs, printed when all folds are done."""
    results = {knob: {value: [] for value in KNOBS[knob]} for knob in knobs}
    for seed in range(n_repeats):
        for train, test in data.split(found.groups, n_folds, seed):
            fold = Fold(found, seed, train, test)
            for knob in knobs:
                for value, setting in KNOBS[knob].items():
                    results[knob][value].append(fold.evaluate(setting))
                seconds = time.process_time()
                print(f"{seconds:.0f} s: {name}, {knob}", file=sys.stderr, flush=True)
    print(f"\n## {name}: {len(found.groups)} trials, {n_repeats} × {n_folds} folds")
    for knob, of_values in results.items():
        of_values = {value: np.array(each) for value, each in of_values.items()}
        lines = summarise(name, knob, of_values, n_folds)
        print_table(lines)
        yield lines


def main():
    parser = command(__doc__, folder=True)
    parser.add_argument("--sets", nargs="+", default=list(REPEATS), choices=REPEATS)
    parser.add_argument("--knobs", nargs="+", default=list(KNOBS), choices=KNOBS)
    parser.add_argument("--quick", action="store_true", help="small sets, three folds")
    parser.add_argument("--csv", type=Path, help="file for one row per value")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # of mord, and of fits that are to end early
    tables = []
    for name in arguments.sets:
        found = load(name, arguments.folder, arguments.quick)
        knobs = [k for k in arguments.knobs if found.given is None or k in MODELS]
        n_folds = 3 if arguments.quick else 5
        n_repeats = 1 if arguments.quick else REPEATS[name]
        tables += measure(name, found, knobs, n_folds, n_repeats)
    if arguments.csv:
        pd.concat(tables).to_csv(arguments.csv, index=False, float_format="%.4g")


if __name__ == "__main__":
    main()
