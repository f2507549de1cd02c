"""Does the combined network gain by learning all adjectives at once?"""

import numpy as np
import pandas as pd
from paper_questions_data import (
    CHOICE,
    SEEDS,
    SOLVER,
    Clock,
    corpus_of,
    each_adjective,
    folds_of,
    linear,
    out_of_fold,
    report,
    stacked,
)

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, SensorFusionNNPOM
from sklearn_haptic.model_selection import sensor_contributions

COLUMNS = "rps", "emd", "macro_mae"
APART, TOGETHER = "combined, each adjective apart", "combined, all adjectives at once"
LINEAR, JOINT = "linear, each apart", "one network, all at once"
ALPHAS = {
    APART: (3.0, 10.0),
    TOGETHER: (10.0, 30.0),
    LINEAR: (1.0, 3.0, 10.0),
    JOINT: (10.0, 30.0, 100.0),
}


def model_of(name, alpha, sensors):
    """Ten units for each sensor and ten that combine them, or for all features."""
    if name == LINEAR:
        return linear(alpha)
    network = NNPOM(10, alpha, **SOLVER)
    if name != JOINT:
        network = SensorFusionNNPOM(sensors, network, network)
    return DistributionalOrdinalRegressor(network, random_state=0)


def scores_of(name, alpha, seed, folder, n_folds=None):
    """Scores of each object."""
    y = stacked(corpus_of(seed).ratings)

    def predict(fold):
        model = model_of(name, alpha, fold.sensors)
        if name in (TOGETHER, JOINT):
            return model.fit(fold.A, y[fold.train]).predict_proba(fold.B)
        return each_adjective(model, fold.A, y[fold.train], fold.B)

    return out_of_fold(predict, y, seed, folder, n_folds=n_folds)


def contributions(name, alpha, seed, folder):
    """Scores of each object (row) by the full model and without each sensor."""
    corpus = corpus_of(seed)
    y = stacked(corpus.ratings)
    tables = []
    for fold in folds_of(seed, folder):
        rows = np.concatenate((fold.train, fold.test))
        ends = [np.arange(len(fold.train)), np.arange(len(fold.train), len(rows))]
        targets = [y[rows]] if name == TOGETHER else y[rows].swapaxes(0, 1)
        tables += [
            sensor_contributions(
                model_of(name, alpha, fold.sensors),
                np.vstack((fold.A, fold.B)),
                target,
                groups=corpus.objects[rows],
                cv=[ends],
                n_repeats=1,
                random_state=0,
            )
            for target in targets
        ]
    table = pd.concat(tables)
    of_objects = table.pivot_table(list(COLUMNS), "object", "held_out", sort=False)
    return of_objects.sort_index()  # as in `out_of_fold`


def adjectives(folder):
    """Print the scores of all models, then what each sensor contributes."""
    chosen = {}
    for name, alphas in ALPHAS.items():
        rps = [scores_of(name, a, CHOICE, folder, 2)[:, 0].mean() for a in alphas]
        chosen[name] = alphas[int(np.argmin(rps))]
    results, tables = {seed: {} for seed in SEEDS}, {}
    for name, alpha in chosen.items():
        clock = Clock()
        for seed in SEEDS:
            if name in (APART, TOGETHER):
                table = contributions(name, alpha, seed, folder)
                full = [table[score, "none"] for score in COLUMNS]
                results[seed][name] = np.transpose(full)
                tables[name, seed] = table["rps"]
            else:
                results[seed][name] = scores_of(name, alpha, seed, folder)
        print(f"{name}: alpha {alpha:g}, {clock}", flush=True)
    report(results, APART)

    heads = [f"{name}, {seed}" for seed in SEEDS for name in ("apart", "at once")]
    print("\n| RPS without | " + " | ".join(heads) + " |")
    print("|---" * (len(heads) + 1) + "|")
    for sensor in tables[APART, SEEDS[0]].columns.drop("none"):
        cells = []
        for seed in SEEDS:
            for name in (APART, TOGETHER):
                table = tables[name, seed]
                delta = table[sensor] - table["none"]
                cells.append(f"{delta.mean():+.4f} ± {delta.sem():.4f}")
        print(f"| {sensor} | " + " | ".join(cells) + " |")
