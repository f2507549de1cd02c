"""What each knob costs and gains, one at a time around a base setting.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
        python benchmarks/speed_accuracy.py FOLDER [--csv FILE] [--figure FILE] \
        [--quick] [--sets synthetic bolt movie phac2] [--knobs atoms "hidden units" …]

FOLDER holds ``bolt_pilot/``, ``movie_ratings/`` and ``phac2_static/``; the synthetic
set needs none of them. mord comes with this package. About an hour on one core,
``--quick`` a few; progress goes to stderr, a Markdown table a knob to stdout.

Five folds, objects kept whole, repeated with other folds and seeds. Dictionaries and
scaling come from the training fold alone. The first value of every knob is its
reference: it has scores ± standard errors, the others have their score and, in
brackets, the paired difference to the reference on the same folds ± the standard
error of that difference, in bold where it exceeds twice that. The folds of a
cross-validation share training objects, so the standard errors are those of Nadeau
and Bengio [1]_, which are larger than the naive ones.

The base has the defaults of the transformers, but keeps the means of windows, and of
`DistributionalOrdinalRegressor`. Features are standardised and rotated to as many axes
as there are trials, which loses nothing and makes every later fit faster. ``alpha`` is
10 throughout, also with hidden units, unless a value says otherwise; presets have the
default, 3. Nothing is fitted to the folds that are reported.

Seconds are of processor time on one thread, medians over folds: "features" learns
dictionaries and codes, scales and rotates the training trials, "transform" does the
last three for the test trials, "fit" and "predict" are the head's, an adjective.
Memory is the peak that Python and NumPy report to tracemalloc, in runs of their own
on the first fold: of one sensor's features at a time, or of the head, whichever the
knob changes.

.. [1] Nadeau, C. & Bengio, Y. (2003). Inference for the generalization error.
   Machine Learning 52. https://doi.org/10.1023/A:1024068626366
"""

import argparse
import csv
import os
import sys
import time
import tracemalloc
import warnings
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple

import joblib
import matplotlib.pyplot as plt
import mord
import numpy as np
from matplotlib.ticker import LogLocator
from real_ratings import movie, phac2
from sklearn.base import BaseEstimator, clone
from sklearn.decomposition import PCA
from sklearn.exceptions import ConvergenceWarning
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
from sklearn_haptic._pipeline import _PRESETS
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import (
    earth_movers_distance,
    log_score,
    macro_mae,
    neg_rps_scorer,
    ranked_probability_score,
)

sys.path.append(str(Path(__file__).parents[1] / "examples"))
from run_real_recordings import FORCES, SIZES, read

SENSORS = (*SIZES, "electrodes")
ADJECTIVES = ["hard", "smooth", "springy"]  # whose extreme levels every fold has
REPEATS = {"synthetic": 2, "bolt": 1, "movie": 1, "phac2": 2}
SECONDS = ["features", "transform", "fit", "predict"]
SCORES = {
    "mae_m": macro_mae,
    "emd": earth_movers_distance,
    "rps": ranked_probability_score,
    "log": log_score,
}
TITLES = ["MAE^M", "EMD", "RPS", "log score"]
COLUMNS = [
    *("set", "knob", "value", "repeat", "fold"),
    *(f"seconds_{stage}" for stage in SECONDS),
    "memory_mb",
    *SCORES,
]
PRESET_COLOURS = {
    "base": "0.2",
    "fast": "#E69F00",
    "balanced": "#009E73",
    "accurate": "#0072B2",
}
started = time.perf_counter()


def say(text):
    minutes = (time.perf_counter() - started) / 60
    print(f"[{minutes:5.1f} min] {text}", file=sys.stderr, flush=True)


# ----------------------------------------------------------------------------------
# Settings: what a value of a knob changes in the features and in the head


class Setting(NamedTuple):
    """A model and its features, as far as they differ from the base."""

    features: dict = {}  # noqa: RUF012
    model: BaseEstimator = DistributionalOrdinalRegressor(NNPOM(n_hidden=0, alpha=10.0))
    alphas: tuple = ()  # to choose from within the training fold


def features(**changes):
    """Other features, the base's head."""
    return Setting(changes)


def head(**changes):
    """The base's features, another head."""
    return Setting(model=clone(Setting().model).set_params(**changes))


def network(**changes):
    """The base with ten hidden units."""
    defaults = {"n_hidden": 10, "alpha": 10.0, "random_state": 0}
    return head(estimator=NNPOM(**defaults | changes))


def searched(setting, alphas):
    """The same, its penalty chosen by grouped cross-validation in the training fold."""
    return setting._replace(alphas=tuple(alphas))


def duplicates(n_duplicates):
    """Another number of observations a trial, with the penalty in proportion."""
    alpha = 10.0 * n_duplicates / 15
    return head(n_duplicates=n_duplicates, estimator__alpha=alpha)


def vary(make, name, values):
    return {str(value): make(**{name: value}) for value in values}


BASE = Setting()
FEATURE_KNOBS = {
    "temporal pooling": {
        " ".join(map(str, cells)): features(cells=cells)
        for cells in [
            (16, 8, 4, 2, 1),
            (1,),
            (4, 2, 1),
            (8, 4, 2, 1),
            (16,),
            (32, 16, 8, 4, 2, 1),
        ]
    },
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
    "spatial pooling": {
        " ".join(map(str, cells)): features(spatial_cells=cells)
        for cells in [(3, 2, 1), (1,), (2, 1), (3,)]
    },
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
}
FEATURE_KNOBS["presets"] = {
    "base": BASE,
    **{
        name: head(estimator__alpha=3.0)._replace(
            features={
                "cells": preset["cells"],
                "max_train": preset["max_train"],
                **preset["dictionary"],
            }
        )
        for name, preset in reversed(_PRESETS.items())
    },
}
HEAD_KNOBS = {
    "n_duplicates": {str(n): duplicates(n) for n in (15, 3, 5, 50)},
    "sampling": vary(head, "sampling", ["level", "lattice", "stratified", "random"]),
    "p_transform": vary(head, "p_transform", ["logit", None]),
    "balance": vary(head, "balance", [None, "macro"]),
    "monotone": vary(head, "monotone", [False, True]),
    "decoding": {
        "mixture": BASE,
        "quantile 99, median": head(decode="quantile"),
        "quantile 99, argmax": head(decode="quantile", rule="argmax"),
        "quantile 9, median": head(decode="quantile", n_quantiles=9),
    },
    "alpha": {
        "10": BASE,
        "searched": searched(BASE, np.logspace(-2, 2, 9)),
        **{
            f"{alpha:g}": head(estimator__alpha=alpha)
            for alpha in (0.01, 0.1, 1.0, 3.0, 30.0, 100.0, 1000.0)
        },
    },
    "scale_features": {
        "True": BASE,
        "False, alpha searched": searched(
            head(estimator__scale_features=False), np.logspace(0, 5, 11)
        ),
        "True, 10 hidden units": network(),
        "False, 10 hidden units, alpha searched": searched(
            network(scale_features=False, max_iter=100), np.logspace(0, 4, 5)
        ),
    },
    "max_iter": vary(head, "estimator__max_iter", [500, 10, 25, 75, 200]),
    "tol": vary(head, "estimator__tol", [1e-4, 1e-5, 1e-3, 1e-2]),
    "solver": vary(head, "estimator__solver", ["lbfgs", "irprop+"]),
    "hidden units": {
        "0": BASE,
        **vary(network, "n_hidden", [1, 5, 10, 20, 30]),
    },
    "max_iter, 10 hidden units": vary(network, "max_iter", [500, 25, 75, 200]),
    "early stopping, 10 hidden units": {
        "none": network(),
        **{
            f"patience {n}": network(early_stopping=True, n_iter_no_change=n)
            for n in (20, 150)
        },
    },
    "tol, 10 hidden units": vary(network, "tol", [1e-4, 1e-5, 1e-3]),
    "solver, 10 hidden units": vary(network, "solver", ["lbfgs", "irprop+"]),
    "model": {
        "base": BASE,
        "mord LogisticAT, lattice, alpha searched": searched(
            head(estimator=mord.LogisticAT(), sampling="lattice"), np.logspace(0, 5, 6)
        ),
        "counts, no p": Setting(model=NNPOM(n_hidden=0, alpha=10.0)),
        "paper's settings": Setting(
            model=DistributionalOrdinalRegressor(**PAPER_2020, random_state=0)
        ),
        "marginal": Setting(model=DummyDistribution("marginal")),
        "W1 barycentre": Setting(model=DummyDistribution("barycentre")),
    },
}
KNOBS = FEATURE_KNOBS | HEAD_KNOBS


# ----------------------------------------------------------------------------------
# Data


class Data(NamedTuple):
    trials: object  # DataFrame, a column a sensor, or a table of features
    targets: dict  # name -> counts or labels
    groups: np.ndarray
    levels: np.ndarray | None
    scale: BaseEstimator  # what comes before the head
    title: str


def load(name, folder, quick):
    rotate = make_pipeline(StandardScaler(), PCA())
    if name == "synthetic":
        n_objects, n_trials = (15, 3) if quick else (30, 5)
        corpus = make_haptic_corpus(
            n_objects, n_trials, procedure="slow_slide", random_state=0
        )
        targets = {a: corpus.ratings[a] for a in ADJECTIVES}
        title = f"{n_objects} objects × {n_trials} slow slides, {len(targets)} ratings"
        return Data(
            corpus.trials, targets, corpus.objects, corpus.levels, rotate, title
        )
    if name == "bolt":
        path = folder / "bolt_pilot" / "bolt_pilot_phac2_layout.h5"
        trials, materials, forces = read(path)
        title = f"{len(trials)} recorded holds of 5 materials, grip force in 3 levels"
        return Data(trials["hold"], {"force": forces}, materials, FORCES, rotate, title)
    X, y, groups, scale, levels = {"movie": movie, "phac2": phac2}[name](folder)
    if name == "movie":
        n_films = 500 if quick else 2000
        drawn = np.random.default_rng(0).choice(len(X), n_films, replace=False)
        X, y, groups = X[drawn], y[drawn], groups[drawn]
    title = f"{len(X)} rows, {len(np.unique(groups))} groups"
    return Data(X, {"rating": y}, groups, levels, scale, title)


# ----------------------------------------------------------------------------------
# Features of one fold


class Block(NamedTuple):
    """Features of the training and the test trials, and what they cost."""

    train: np.ndarray
    test: np.ndarray
    seconds: tuple  # for the training and the test trials


class Timer:
    """Processor seconds since the last call."""

    def __init__(self):
        self.last = time.process_time()

    def __call__(self):
        last, self.last = self.last, time.process_time()
        return self.last - last


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
    spatial_cells: tuple = (3, 2, 1)
    cells: tuple = (16, 8, 4, 2, 1)

    @property
    def before_pooling(self):
        """What the dictionary depends on."""
        base = make_sensor(self.name)
        return self._replace(cells=base.cells, spatial_cells=base.spatial_cells)

    def coder(self, random_state):
        names = "n_nonzero_coefs", "remove_mean", "max_iter"
        parameters = {name: getattr(self, name) for name in (*names, "update")}
        parameters["random_state"] = random_state
        if self.name == "electrodes":
            return STHMPTransformer(
                round(10 * self.atoms),
                spatial_cells=self.spatial_cells,
                max_train_patches=self.max_train,
                **parameters,
            )
        window, n_atoms = SIZES[self.name]
        return KSVDTransformer(
            round(n_atoms * self.atoms),
            window=window,
            max_train_windows=self.max_train,
            **parameters,
        )


def make_sensor(name, mean_removed=(), **changes):
    if name != "electrodes":
        changes.pop("spatial_cells", None)
    return Sensor(name, name in mean_removed, **changes)


class Fold:
    """One split of a set; everything that its settings share is computed once."""

    def __init__(self, data, repeat, fold, train, test):
        self.data, self.repeat, self.fold = data, repeat, fold
        self.train, self.test = train, test
        self._dictionary = cache(self._dictionary)
        self._block = cache(self._block)
        self._memory = cache(self._memory)
        self._learning_memory = cache(self._learning_memory)
        self._results = {}

    def _cells(self, sensor, rows):
        cells = self.data.trials[sensor.name].iloc[rows]
        return cells.map(lambda trial: trial.astype(sensor.dtype))

    def _dictionary(self, sensor):
        """The fitted coder of a sensor, and seconds."""
        trials = self._cells(sensor, self.train)
        timer = Timer()
        return sensor.coder(self.repeat).fit(trials), timer()

    def _block(self, sensor):
        """Pooled, scaled and rotated features of a sensor."""
        coder, learning = self._dictionary(sensor.before_pooling)
        train, test = (self._cells(sensor, rows) for rows in (self.train, self.test))
        pool = TemporalMaxPool(sensor.cells)
        if sensor.name == "electrodes":  # other cells, the same dictionary
            coder = clone(coder).set_params(
                spatial_cells=sensor.spatial_cells,
                dict_init=coder.components_,
                max_iter=0,
            )
            coder.fit(train)
        timer = Timer()
        pooled = pool.fit_transform(coder.transform(train))
        scale = clone(self.data.scale).fit(pooled)
        A = scale.transform(pooled)
        coding = timer()
        B = scale.transform(pool.transform(coder.transform(test)))
        return Block(A, B, (learning + coding, timer()))

    def table(self, sensors=SENSORS, **changes):
        """Features of some sensors side by side, or of the tabular set."""
        if not isinstance(self.data.trials, np.ndarray):
            blocks = [self._block(make_sensor(s, **changes)) for s in sensors]
            if len(blocks) == 1:
                return blocks[0]
            A = np.hstack([block.train for block in blocks])
            B = np.hstack([block.test for block in blocks])
            seconds = np.sum([block.seconds for block in blocks], axis=0)
            timer = Timer()
            rotation = PCA().fit(A)
            A = rotation.transform(A)
            seconds[0] += timer()
            B = rotation.transform(B)
            seconds[1] += timer()
            return Block(A, B, tuple(seconds))
        X = self.data.trials
        timer = Timer()
        scale = clone(self.data.scale)
        A = scale.fit_transform(X[self.train])
        seconds = timer()
        return Block(A, scale.transform(X[self.test]), (seconds, timer()))

    @cached_property
    def base_table(self):
        return self.table()

    def block(self, setting):
        """The features of a setting."""
        return self.table(**setting.features) if setting.features else self.base_table

    def features_memory(self, setting):
        """Largest peak of a sensor's features in MB."""
        changes = dict(setting.features)
        sensors = changes.pop("sensors", SENSORS)
        return max(self._memory(make_sensor(s, **changes)) for s in sensors)

    def _memory(self, sensor):
        """Peak of learning the dictionary, or of coding and pooling."""
        learning = self._learning_memory(sensor.before_pooling)
        return max(learning, peak_mb(lambda: self._block.__wrapped__(sensor)))

    def _learning_memory(self, sensor):
        return peak_mb(lambda: self._dictionary.__wrapped__(sensor))

    def search(self, model, alphas, target, block):
        """Choose alpha by RPS on held-out groups of the training fold."""
        model = clone(model).set_params(levels=self.data.levels)
        groups = self.data.groups[self.train]
        cv = GroupKFold(min(4, len(np.unique(groups))))
        search = GridSearchCV(
            model,
            {alpha_name(model): list(alphas)},
            scoring=neg_rps_scorer,
            cv=cv,
            refit=False,
            error_score="raise",
        )
        y = self.data.targets[target][self.train]
        return search.fit(block.train, y, groups=groups).best_params_[alpha_name(model)]

    def model(self, setting, target, block):
        model = clone(setting.model).set_params(levels=self.data.levels)
        if setting.alphas:
            alpha = self.search(model, setting.alphas, target, block)
            model.set_params(**{alpha_name(model): alpha})
        return model

    def run(self, setting, block, target, train=None, test=None):
        """Seconds to fit and predict, and the scores."""
        train = self.train if train is None else self.train[train]
        test = self.test if test is None else self.train[test]
        model = self.model(setting, target, block)
        y, levels = self.data.targets[target], self.data.levels
        keywords = {}
        if has_fit_parameter(model, "groups"):
            keywords["groups"] = self.data.groups[train]
        timer = Timer()
        model.fit(block.train, y[train], **keywords)
        seconds = timer()
        proba = model.predict_proba(block.test)
        seconds = (seconds, timer())
        if levels is None:
            levels = model.levels_
        return seconds, [
            score(y[test], proba, levels=levels) for score in SCORES.values()
        ]

    def evaluate(self, setting):
        """Seconds of the four stages and the scores, means over the targets."""
        key = joblib.hash(setting)
        if key not in self._results:
            block = self.block(setting)
            runs = [self.run(setting, block, target) for target in self.data.targets]
            seconds, scores = (np.mean(values, axis=0) for values in zip(*runs))
            self._results[key] = [*block.seconds, *seconds], list(scores)
        return self._results[key]

    def head_memory(self, setting):
        """Peak of the head's fit and prediction in MB."""
        target, y = next(iter(self.data.targets.items()))
        block = self.block(setting)
        model = self.model(setting, target, block)
        return peak_mb(
            lambda: model.fit(block.train, y[self.train]).predict_proba(block.test)
        )


def alpha_name(model):
    return "estimator__alpha" if hasattr(model, "estimator") else "alpha"


def peak_mb(function):
    tracemalloc.start()
    function()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


# ----------------------------------------------------------------------------------
# Tables


def folds(data, n_folds, n_repeats):
    for repeat in range(n_repeats):
        splits = GroupKFold(n_folds, shuffle=True, random_state=repeat)
        splits = splits.split(data.groups, groups=data.groups)
        for fold, (train, test) in enumerate(splits):
            yield Fold(data, repeat, fold, train, test)


def measure(name, data, knobs, n_folds, n_repeats, write):
    """Rows of every knob, its values and the folds; ``write`` gets each as it comes."""
    rows = []
    for fold in folds(data, n_folds, n_repeats):
        for knob in knobs:
            for value, setting in KNOBS[knob].items():
                seconds, scores = fold.evaluate(setting)
                memory = ""
                if fold.repeat == fold.fold == 0:
                    of_features = knob in FEATURE_KNOBS
                    memory = (
                        fold.features_memory if of_features else fold.head_memory
                    )(setting)
                row = [name, knob, value, fold.repeat, fold.fold]
                rows.append(dict(zip(COLUMNS, [*row, *seconds, memory, *scores])))
                write(rows[-1])
            say(f"{name}, repeat {fold.repeat}, fold {fold.fold}: {knob}")
    return rows


def standard_error(scores, n_folds):
    """Nadeau and Bengio's, of a mean over folds that share training objects."""
    test_to_train = 1 / (n_folds - 1)
    return scores.std(ddof=1) * np.sqrt(1 / len(scores) + test_to_train)


def describe(scores, reference, n_folds):
    """The reference with its standard error, others with the paired difference."""
    if not np.isfinite(scores).all():
        return "inf"
    if scores is reference:
        return f"{scores.mean():.3f} ± {standard_error(scores, n_folds):.3f}"
    if not np.isfinite(reference).all():
        return f"{scores.mean():.3f}"
    difference = scores - reference
    error = standard_error(difference, n_folds)
    text = f"{difference.mean():+.3f} ± {error:.3f}".replace("-", "−")
    if abs(difference.mean()) > max(2 * error, 0.0005):
        text = f"**{text}**"
    return f"{scores.mean():.3f} ({text})"


def table(rows, knob, n_folds):
    """Markdown table of one knob; seconds that do not depend on it are left out."""
    rows = [row for row in rows if row["knob"] == knob]
    by_value = {}
    for row in rows:
        by_value.setdefault(row["value"], []).append(row)

    def column(value, name):
        return np.array([row[name] for row in by_value[value]])

    stages = [
        stage
        for stage in SECONDS
        if len({row[f"seconds_{stage}"] for row in rows if row["memory_mb"] != ""}) > 1
    ]
    header = [knob, *(f"{stage}, s" for stage in stages), "memory, MB", *TITLES]
    lines = [header, ["---"] * len(header)]
    first = next(iter(by_value))
    reference = {score: column(first, score) for score in SCORES}
    for value, of_value in by_value.items():
        seconds = [np.median(column(value, f"seconds_{stage}")) for stage in stages]
        cells = [
            value,
            *(f"{s:.3g}" for s in seconds),
            f"{of_value[0]['memory_mb']:.3g}",
        ]
        for score, of_reference in reference.items():
            scores = of_reference if value == first else column(value, score)
            cells.append(describe(scores, of_reference, n_folds))
        lines.append(cells)
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def draw(rows, path, n_folds):
    """What settings of the features cost and gain, the presets among them."""
    rows = [row for row in rows if row["knob"] in FEATURE_KNOBS]
    sets = list(dict.fromkeys(row["set"] for row in rows))
    scores = {"rps": "RPS", "mae_m": "MAE^M"}
    figure, axes = plt.subplots(
        len(scores),
        len(sets),
        figsize=(4.5 * len(sets) + 0.5, 3 * len(scores)),
        sharex="col",
        squeeze=False,
        layout="constrained",
    )
    for column, name in zip(axes.T, sets):
        of_set = [row for row in rows if row["set"] == name]
        of_value = {}
        for row in of_set:
            of_value.setdefault((row["knob"], row["value"]), []).append(row)
        for ax, score in zip(column, scores):
            reference = np.array([r[score] for r in of_value["presets", "base"]])
            for (knob, value), of_folds in of_value.items():
                difference = np.array([row[score] for row in of_folds]) - reference
                seconds = [sum(r[f"seconds_{s}"] for s in SECONDS) for r in of_folds]
                preset = knob == "presets"
                ax.errorbar(
                    np.median(seconds),
                    difference.mean(),
                    standard_error(difference, n_folds),
                    color=PRESET_COLOURS[value] if preset else "0.75",
                    marker="D" if preset else ".",
                    markersize=8 if preset else 5,
                    linewidth=2 if preset else 0.7,
                    zorder=3 if preset else 2,
                    linestyle="",
                    label=value if preset else "others" * (value == "all"),
                )
            ax.axhline(0, color="0.4", linewidth=0.7, zorder=1)
            ax.set(xscale="log", ylabel=f"{scores[score]} minus that of the base")
            ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            ax.xaxis.set_major_formatter("{x:g}")
            ax.xaxis.set_minor_formatter("")
        column[0].set_title(name)
        column[-1].set_xlabel("processor time a fold, s")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, frameon=False)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", nargs="+", default=list(REPEATS), choices=REPEATS)
    parser.add_argument("--knobs", nargs="+", default=list(KNOBS), choices=KNOBS)
    parser.add_argument("--repeats", type=int, help="of the five folds")
    parser.add_argument("--quick", action="store_true", help="small sets, three folds")
    parser.add_argument("--figure", type=Path, help="file for a figure of presets")
    parser.add_argument("--csv", type=Path, help="file for a row a value and fold")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)
    warnings.simplefilter("ignore", DeprecationWarning)  # mord 0.7 on SciPy 1.17
    n_folds = 3 if arguments.quick else 5
    with open(arguments.csv or os.devnull, "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()

        def write(row):
            writer.writerow(row)
            file.flush()

        of_trials = []
        for name in arguments.sets:
            data = load(name, arguments.folder, arguments.quick)
            knobs = [
                knob
                for knob in arguments.knobs
                if knob not in FEATURE_KNOBS or not isinstance(data.trials, np.ndarray)
            ]
            n_repeats = arguments.repeats or (1 if arguments.quick else REPEATS[name])
            rows = measure(name, data, knobs, n_folds, n_repeats, write)
            print(f"\n## {name}: {data.title}, {n_repeats} × {n_folds} folds")
            for knob in knobs:
                print(f"\n{table(rows, knob, n_folds)}", flush=True)
            if "presets" in knobs:
                of_trials += rows
    if arguments.figure and of_trials:
        draw(of_trials, arguments.figure, n_folds)


if __name__ == "__main__":
    main()
