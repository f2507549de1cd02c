"""The presets beside what a user could take instead.

    python benchmarks/rivals.py FOLDER [--sets bolt phac2 …] [--adjectives hard …]
        [--rows accurate MiniRocket …] [--csv FILE] [--figure FILE]

FOLDER holds biotac_slides, bolt_pilot, phac2_static and movie_ratings. MiniRocket and
Catch22 need aeon; rows whose packages are missing are left out. The figure is drawn
from the CSV file, to which further runs add.

Rows are other features with the linear model of "fast" and its penalty, then other
models of the features of the presets, which choose their penalty inside the training
trials, as in `frontier_heads.py`. "maxima" are those of codes over learned
dictionaries. MiniRocket has all sensors at 100 Hz, or each at its own rate. Features
that learn from no ratings but draw kernels are fitted once, to the first training
trials. Whole objects are left out. Scores are means over objects, lower is better;
differences are paired with "fast" and with "accurate", ± is the standard error over
objects. On the slides, "score" is the share of materials taken for another, three
blocks of five runs left out in turn, with a ridge classifier.

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
from rivals_features import (
    PRESETS,
    families,
    known,
    of_folds,
    rotated,
    roughness,
    slides,
)
from rivals_figure import draw
from sklearn import config_context
from sklearn.base import clone
from sklearn.model_selection import LeaveOneGroupOut
from speed_accuracy_data import bolt

from sklearn_haptic import make_haptic_pipeline
from sklearn_haptic.datasets import load_phac2, make_haptic_corpus
from sklearn_haptic.metrics import dispersion, log_score, ranked_probability_score

COLUMNS = ["set", "row", "score", "difference", "error"]
COLUMNS += ["to_accurate", "to_accurate_error"]
COLUMNS += ["log", "dispersion", "learning_s", "ms", "mb"]


def rows(n_features):
    """Name of the row: name of the features, model, whether it is given components."""
    found = heads.models(n_features)
    accurate = make_haptic_pipeline(preset="accurate", random_state=0)[-1]
    linear = make_haptic_pipeline(random_state=0)[-1]
    table = {"fast": (PRESETS, linear, True), "accurate": (PRESETS, accurate, False)}
    table |= {name: (name, linear, True) for name in families() if name != PRESETS}
    names = [n for n in found if not n.startswith(("default", "blend"))]
    return table | {n: (PRESETS, *found[n]) for n in names}


# Sets -----------------------------------------------------------------------


def grips(folder):
    data = bolt(folder)
    y = np.equal.outer(data.targets["force"], data.levels).astype(float)
    folds = list(LeaveOneGroupOut().split(y, groups=data.groups))
    return data.trials, {"force": y}, data.groups, folds


def all_grips(folder):
    """The four procedures of a trial, side by side."""
    path = folder / "bolt_pilot" / "bolt_pilot_phac2_layout.h5"
    procedures = ["hold", "squeeze", "slow_slide", "fast_slide"]
    corpora = [load_phac2(path, procedure=name) for name in procedures]
    parts = [c.trials.add_prefix(f"{n}_") for n, c in zip(procedures, corpora)]
    return pd.concat(parts, axis=1), *grips(folder)[1:]


def generated(procedure, seed):
    corpus = make_haptic_corpus(40, 5, procedure=procedure, random_state=seed)
    folds = heads.folds_of(corpus.trials, corpus.objects)
    return corpus.trials, dict(corpus.ratings), corpus.objects, folds


TOUCHED = {"bolt": grips, "bolt, all": all_grips} | {
    f"{name}{seed}": lambda folder, p=procedure, s=seed: generated(p, s)
    for name, procedure in (("slow", "slow_slide"), ("hold", "hold"))
    for seed in (0, 1)
}
BASES = "fast", "accurate"
SLID = *BASES, "marginal"  # models of the features of the presets, on slides
SETS = [*TOUCHED, "phac2", "films", "slides"]


class Tables:
    """Features of the folds of a set, computed once for each family."""

    def __init__(self, name, folder):
        self.found = {}
        self.trials = None
        if name in TOUCHED:
            self.trials, self.targets, self.groups, self.folds = TOUCHED[name](folder)
        else:
            self.targets, self.groups, given = heads.SETS[name](folder)
            self.found = {PRESETS: (list(given), (0.0, 0.0, 0))}
        self.groups = np.asarray(self.groups)

    def has(self, family):
        """Whether the set has touches that the family takes, or its features."""
        made = () if self.trials is None else families(list(self.trials))
        return family in self.found or family in made

    def of(self, family, components=False):
        """Features of each fold, and costs."""
        if family not in self.found:
            self.found[family] = of_folds(family, self.trials, self.folds)
        if components and (family, "components") not in self.found:
            found, costs = self.found[family]
            self.found[family, "components"] = rotated(found), costs
        return self.found[(family, "components") if components else family]


# Scores ---------------------------------------------------------------------


def evaluate(tables, family, model, components, adjectives):
    """Scores of objects, and costs."""
    found, (learning, making, size) = tables.of(family, components)
    targets = {a: tables.targets[a] for a in adjectives or tables.targets}
    rps, log, spread, fitting, predicting = [], [], [], 0.0, 0.0
    for y in targets.values():
        y = np.asarray(y, dtype=float)
        proba = np.zeros(y.shape)
        for train, test, A, B in found:
            takes = {"groups": tables.groups[train]} if hasattr(model, "cv") else {}
            started = time.process_time()
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
    return np.mean(rps, axis=0), np.mean(log), np.mean(spread), *costs


def compared(each, bases):
    """Mean over objects, and paired differences to the presets, NaN if missing."""
    found = [each.mean()]
    for preset in BASES:
        gain = each - bases.get(preset, np.nan)
        found += [gain.mean(), gain.std(ddof=1) / np.sqrt(len(gain))]
    return found


def described(differences):
    pairs = zip(differences[::2], differences[1::2])
    return " | ".join(f"{gain:+.4f} ± {error:.4f}" for gain, error in pairs)


def wanted(label, only):
    return not only or label in only or label in BASES


def table(name, folder, adjectives, only):
    """Print the table of a set; return its rows."""
    tables, bases, result = Tables(name, folder), {}, []
    adjectives = [a for a in adjectives or [] if a in tables.targets]
    n_features = tables.of(PRESETS)[0][0][2].shape[1]
    print(f"\n{name}: {len(tables.groups)} touches, {len(set(tables.groups))} objects")
    print("\n| row | RPS | to fast | to accurate | log | dispersion | s | ms | MB |")
    print("|---|---|---|---|---|---|---|---|---|")
    for label, (family, model, components) in rows(n_features).items():
        if not wanted(label, only):
            continue
        try:
            if not tables.has(family):
                continue
            rps, *others = evaluate(tables, family, model, components, adjectives)
        except ImportError as error:
            print(f"{label} left out: {error}")
            continue
        bases |= {label: rps} if label in BASES else {}
        score, *differences = compared(rps, bases)
        log, spread, learning, ms, size = others
        print(
            f"| {label} | {score:.4f} | {described(differences)} | {log:.3f} | "
            f"{spread:.2f} | {learning:.2f} | {ms:.2f} | {size:.1f} |",
            flush=True,
        )
        result.append((name, label, score, *differences, *others))
    return result


def of_slides(folder, only):
    """Print how features tell known materials apart, and the roughness of unknown."""
    trials, material, run = slides(folder)
    result, bases, rough_bases = [], {}, {}
    print("\nslides: accuracy over blocks of runs and from 1, 2, 5 runs; roughness")
    to_presets = "to fast | to accurate"
    print(
        f"\n| row | accuracy | errors {to_presets} | roughness {to_presets} | s | ms |"
    )
    print("|---|---|---|---|---|---|---|---|")
    chosen = heads.models(1)["linear, alpha chosen"][0]
    found = {}
    for label, (family, model, _) in rows(1).items():
        of_presets = family == PRESETS
        if not wanted(label, only) or (of_presets and label not in SLID):
            continue
        model = model if of_presets else chosen
        try:
            if family not in found:
                found[family] = known(family, trials, material, run)
            accuracy, errors, costs = found[family]
            rough = roughness(family, model, label != "accurate", trials, material)
        except ImportError as error:
            print(f"{label} left out: {error}")
            continue
        if label in BASES:
            bases[label], rough_bases[label] = errors, rough
        score, *differences = compared(errors, bases)
        rough, *others = compared(rough, rough_bases)
        rough = f"{rough:.4f} {described(others)}"
        if label == "marginal":
            print(f"| {label} | | | | {rough} | | |", flush=True)
            continue
        learning, ms, size = costs[0], 1000 * costs[1], costs[2] / 1e6
        cells = " ".join(f"{a:.3f}" for a in accuracy)
        print(
            f"| {label} | {cells} | {described(differences)} | {rough} | "
            f"{learning:.2f} | {ms:.1f} |",
            flush=True,
        )
        others = np.nan, np.nan, learning, ms, size
        result.append(("slides", label, score, *differences, *others))
    return result


def merged(results, path):
    """Add rows to those of a CSV file, in place of earlier ones of the same name."""
    results = pd.DataFrame(results, columns=COLUMNS)
    if path and path.exists():
        results = pd.concat([pd.read_csv(path), results]).infer_objects()
    results = results.drop_duplicates(["set", "row"], keep="last")
    return results.sort_values("set", kind="stable", key=lambda s: s.map(SETS.index))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", nargs="*", default=SETS, choices=SETS)
    parser.add_argument("--adjectives", nargs="+")
    parser.add_argument("--rows", nargs="+")
    parser.add_argument("--csv", type=Path)
    parser.add_argument("--figure", type=Path)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # of mord, statsmodels and few iterations
    results = []
    with config_context(enable_metadata_routing=True):
        for name in arguments.sets:
            if name == "slides":
                results += of_slides(arguments.folder, arguments.rows)
                continue
            results += table(
                name, arguments.folder, arguments.adjectives, arguments.rows
            )
    results = merged(results, arguments.csv)
    if arguments.csv:
        results.to_csv(arguments.csv, index=False, float_format="%.4g")
    if arguments.figure:
        draw(results, arguments.figure)


if __name__ == "__main__":
    main()
