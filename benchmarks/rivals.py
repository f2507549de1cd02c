"""The presets beside what a user could take instead.

    python benchmarks/rivals.py FOLDER [--sets bolt phac2 …] [--adjectives hard …]
        [--rows fast accurate …] [--csv FILE] [--figure FILE]

FOLDER holds the recordings that `frontier_heads.py` and `frontier_features.py` read.
MiniRocket needs the extra `aeon`; rows whose packages are missing are left out. Folds,
inner searches and scores are those of `frontier_heads.py`: whole objects are left out,
differences are paired with the preset "fast", ± is the standard error over objects.

Costs are processor time of this run, of all folds: learning features and model for one
adjective, and of features and prediction per touch. MB is the size of the pickled
features and model of the last fold.
"""

import argparse
import pickle
import time
import warnings
from pathlib import Path

import frontier_heads as heads
import numpy as np
import pandas as pd
from frontier_features import (
    FAMILIES,
    SENSORS,
    Rocket,
    known,
    roughness,
    slides,
    statistics,
)
from sklearn import config_context
from sklearn.base import clone
from sklearn.compose import ColumnTransformer
from sklearn.decomposition import PCA
from sklearn.model_selection import LeaveOneGroupOut
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from speed_accuracy_data import bolt

from sklearn_haptic import make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import dispersion, log_score, ranked_probability_score


def of_sensors(make):
    """Features of each sensor, side by side and standardised."""
    columns = ColumnTransformer([(s, make(s), s) for s in SENSORS])
    return make_pipeline(columns, StandardScaler())


def features():
    return {
        "fast": make_haptic_pipeline(random_state=0)[:-1],
        "accurate": make_haptic_pipeline(preset="accurate", random_state=0)[:-1],
        "hand-made statistics": of_sensors(
            lambda s: statistics(s, "mean", "std", "max", "min", "slope", "change")
        ),
        "bands in cells": of_sensors(lambda s: statistics(s, "bands", cells=(4, 2, 1))),
        "MiniRocket": of_sensors(lambda s: Rocket()),
    }


def rows(n_features):
    """Name of the row: name of the features, model, whether it is given components."""
    found = heads.models(n_features)
    accurate = make_haptic_pipeline(preset="accurate", random_state=0)[-1]
    linear = make_haptic_pipeline(random_state=0)[-1]
    table = {"fast": ("fast", linear, False), "accurate": ("accurate", accurate, False)}
    table["accurate, linear"] = "accurate", linear, True
    table |= {name: (name, linear, True) for name in list(features())[2:]}
    names = [n for n in found if not n.startswith(("default", "blend"))]
    return table | {n: ("fast", *found[n]) for n in names}


def grips(folder):
    data = bolt(folder)
    y = np.equal.outer(data.targets["force"], data.levels).astype(float)
    folds = list(LeaveOneGroupOut().split(y, groups=data.groups))
    return data.trials, {"force": y}, data.groups, folds


def generated(procedure, seed):
    corpus = make_haptic_corpus(40, 5, procedure=procedure, random_state=seed)
    folds = heads.folds_of(corpus.trials, corpus.objects)
    return corpus.trials, dict(corpus.ratings), corpus.objects, folds


TOUCHED = {"bolt": grips} | {
    f"{name}{seed}": lambda folder, p=procedure, s=seed: generated(p, s)
    for seed in (0, 1)
    for name, procedure in (("slow", "slow_slide"), ("hold", "hold"))
}


class Tables:
    """Features of the folds of a set, computed once for each family."""

    def __init__(self, name, folder):
        self.cost = {}
        if name in TOUCHED:
            self.trials, self.targets, self.groups, self.folds = TOUCHED[name](folder)
            self.found = {}
        else:
            self.trials = None
            self.targets, self.groups, found = heads.SETS[name](folder)
            self.found = {"fast": list(found)}
            self.cost["fast"] = 0.0, 0.0, 0
        self.groups = np.asarray(self.groups)

    def of(self, family):
        if family not in self.found and self.trials is not None:
            model, found, learning, making = features()[family], [], 0.0, 0.0
            for train, test in self.folds:
                started = time.process_time()
                fitted = clone(model).fit(self.trials.iloc[train])
                learned = time.process_time()
                made = [
                    np.asarray(fitted.transform(self.trials.iloc[i]), dtype=float)
                    for i in (train, test)
                ]
                learning += learned - started
                making += time.process_time() - learned
                found.append((train, test, *made))
            n_made = len(self.trials) * len(self.folds)
            self.found[family] = found
            size = len(pickle.dumps(fitted))
            self.cost[family] = learning / len(self.folds), making / n_made, size
        return self.found.get(family)


def evaluate(tables, family, model, rotated, adjectives):
    """One row: scores of objects, and costs."""
    found = tables.of(family)
    learning, making, size = tables.cost[family]
    targets = {a: tables.targets[a] for a in adjectives or tables.targets}
    rps, log, spread, fitting, predicting = [], [], [], 0.0, 0.0
    for y in targets.values():
        y = np.asarray(y, dtype=float)
        proba = np.zeros(y.shape)
        for train, test, A, B in found:
            started = time.process_time()
            if rotated:
                rotation = PCA(random_state=0).fit(A)
                A, B = rotation.transform(A), rotation.transform(B)
            takes = {"groups": tables.groups[train]} if hasattr(model, "cv") else {}
            fitted = clone(model).fit(A, y[train], **takes)
            learned = time.process_time()
            proba[test] = fitted.predict_proba(B)
            fitting += learned - started
            predicting += time.process_time() - learned
        each = ranked_probability_score(y, proba, average=False)
        rps.append(heads.of_objects(each, tables.groups))
        floor = np.maximum(proba, 1e-3)
        floor /= floor.sum(axis=1, keepdims=True)
        log.append(log_score(y, floor))
        spread.append(dispersion(y, proba))
    n_fits = len(targets) * len(found)
    n_touches = len(targets) * len(tables.groups)
    costs = (
        learning + fitting / n_fits,
        1000 * (making + predicting / n_touches),
        (size + len(pickle.dumps(fitted))) / 1e6,
    )
    return np.array(rps), np.mean(log), np.mean(spread), *costs


def table(name, folder, adjectives, only):
    """Print the table of a set; return its rows."""
    tables, base, result = Tables(name, folder), None, []
    adjectives = [a for a in adjectives or [] if a in tables.targets]
    n_features = tables.of("fast")[0][2].shape[1]
    print(f"\n{name}: {len(tables.groups)} touches, {len(set(tables.groups))} objects")
    print("\n| row | RPS | to fast | log | dispersion | learning, s | ms | MB |")
    print("|---|---|---|---|---|---|---|---|")
    for label, (family, model, rotated) in rows(n_features).items():
        if only and label not in [*only, "fast"]:
            continue
        if tables.trials is None and family != "fast":
            if label != "accurate":
                continue
            family = "fast"  # of sets that are features already
        try:
            found = evaluate(tables, family, model, rotated, adjectives)
        except ImportError as error:
            print(f"{label} left out: {error}")
            continue
        rps, log, spread, learning, ms, size = found
        base = rps if base is None else base
        gain = (rps - base).mean(axis=0)
        error = gain.std(ddof=1) / np.sqrt(len(gain))
        print(
            f"| {label} | {rps.mean():.4f} | {gain.mean():+.4f} ± {error:.4f} | "
            f"{log:.3f} | {spread:.2f} | {learning:.2f} | {ms:.2f} | {size:.1f} |",
            flush=True,
        )
        numbers = rps.mean(), gain.mean(), error, log, spread, learning, ms, size
        result.append((name, label, *numbers))
    return result


def of_slides(folder):
    """Print how features tell known materials apart, and the roughness of unknown."""
    trials, material, run = slides(folder)
    print("\nslides: accuracy over blocks of runs and from 1, 2, 5 runs; roughness\n")
    print("| features | ridge | logistic | roughness, RPS | learning, s | ms |")
    print("|---|---|---|---|---|---|")
    for name in ("maxima", "of accurate", "bands in cells 4, 2, 1", "MiniRocket"):
        try:
            accuracy, make = known(FAMILIES[name], trials, material, run)
            rough = roughness(FAMILIES[name], trials, material)
        except ImportError as error:
            print(f"{name} left out: {error}")
            continue
        cells = [" ".join(f"{a:.3f}" for a in row) for row in accuracy]
        cost = make.learning / make.n_fits, 1000 * make.making / make.n_made
        print(
            f"| {name} | {cells[0]} | {cells[1]} | {rough:.3f} | "
            f"{cost[0]:.2f} | {cost[1]:.1f} |",
            flush=True,
        )


COLUMNS = ["set", "row", "rps", "difference", "error", "log", "dispersion"]
COLUMNS += ["learning_s", "ms", "mb"]


def draw(results, path):
    """Cost of one touch against what the score differs from that of "fast"."""
    import matplotlib.pyplot as plt

    results = results[results["row"] != "marginal"]
    sets = [s for s in TOUCHED if s in set(results["set"])]
    figure, axes = plt.subplots(
        1, len(sets), figsize=(4.2 * len(sets), 4), squeeze=False, layout="constrained"
    )
    for ax, name in zip(axes[0], sets):
        part = results[results["set"] == name]
        ours = part["row"].isin(["fast", "accurate"])
        for rows_, colour, label in (
            (part[ours], "C0", "presets"),
            (part[~ours], "C7", "instead"),
        ):
            ax.errorbar(
                rows_["ms"], rows_["difference"], rows_["error"], fmt="o",
                color=colour, label=label, capsize=2,
            )  # fmt: skip
        for at, (_, row) in enumerate(part.sort_values("difference").iterrows()):
            y = (at + 0.5) / len(part)
            ax.annotate(
                row["row"], (row["ms"], row["difference"]), (1.02, y), fontsize=7,
                xycoords="data", textcoords="axes fraction", va="center",
                arrowprops={"arrowstyle": "-", "lw": 0.4, "color": "0.6"},
            )  # fmt: skip
        ax.axhline(0, color="0.8", lw=0.8, zorder=0)
        ax.set(xlim=(0, None), xlabel="processor ms per touch", title=name)
    axes[0, 0].set_ylabel("RPS less that of fast (lower is better)")
    axes[0, 0].legend(loc="lower left", fontsize=8)
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    sets = [*TOUCHED, "phac2", "films", "slides"]
    parser.add_argument("--sets", nargs="+", default=sets, choices=sets)
    parser.add_argument("--adjectives", nargs="+")
    parser.add_argument("--rows", nargs="+")
    parser.add_argument("--csv", type=Path)
    parser.add_argument("--figure", type=Path)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # of mord, statsmodels and few iterations
    results = []
    with config_context(enable_metadata_routing=True):
        if "slides" in arguments.sets:
            of_slides(arguments.folder)
        for name in arguments.sets:
            if name == "slides":
                continue
            results += table(
                name, arguments.folder, arguments.adjectives, arguments.rows
            )
    results = pd.DataFrame(results, columns=COLUMNS)
    if arguments.csv:
        results.to_csv(arguments.csv, index=False, float_format="%.5g")
    if arguments.figure:
        draw(results, arguments.figure)


if __name__ == "__main__":
    main()
