"""Folds and scores of people's ratings, for any method in any language.

    python benchmarks/folds.py FOLDER [--sets films phac2 wine tactile vibviz]
    python benchmarks/folds.py FOLDER --sets films --name mine --proba mine.csv

The first command writes ``folds/SET.csv`` with the object of each trial and the fold
that tests it, predicts all trials out of fold by the default model and both baselines,
and writes ``scores/SET.csv`` with the RPS of each object, a column per method. The
second scores a table of probabilities, with the columns ``target``, ``trial`` and one
per level, adds a column, and prints the RPS of every method, its paired difference to
the one named, ± the standard error over objects, and the score of the populations.
"""

import sys
from itertools import product
from pathlib import Path

import data
import numpy as np
import pandas as pd
from measure import command, head, of_groups, plus_minus, row
from sklearn.pipeline import make_pipeline

from sklearn_haptic import DummyDistribution, Signal, make_haptic_pipeline
from sklearn_haptic.metrics import noise_ceiling, ranked_probability_score
from sklearn_haptic.model_selection import cross_val_predict_proba

HERE = Path(__file__).parent
SETS = {
    "films": data.films,
    "phac2": data.votes,
    "wine": data.wine,
    "tactile": data.tactile,
    "vibviz": data.vibrations,
}


def load(name, folder):
    """Return the trials of a set, counts of each target, objects, and folds."""
    found = SETS[name](Path(folder))
    n_people = 1e6 if name == "films" else 1  # whose shares are of multitudes
    targets = {t: n_people * pd.DataFrame(y) for t, y in found.targets.items()}
    return found._replace(targets=targets, groups=np.asarray(found.groups))


def table_of_folds(found):
    """One row per trial: its object, and the number of the fold that tests it."""
    fold = np.empty(len(found.groups), int)
    for i, (_, test) in enumerate(found.folds):
        fold[test] = i
    return pd.DataFrame({"object": found.groups, "fold": fold}).rename_axis("trial")


def predict(model, found):
    """Predict every target of trials whose objects were left out."""
    given = {"groups": found.groups, "cv": found.folds}
    return {
        target: cross_val_predict_proba(model, found.trials, y.to_numpy(), **given)
        for target, y in found.targets.items()
    }


def read(path, found):
    """Read probabilities of every target, one row per target and trial."""
    table = pd.read_csv(path).set_index(["target", "trial"])
    levels = pd.to_numeric(table.columns, errors="coerce")
    if not (np.diff(levels) > 0).all():
        sys.exit(f"{path} has columns {[*table]}; name levels 1, 2, …, lowest first.")
    trials = range(len(found.groups))
    for target, trial in product(found.targets, trials):
        if (target, trial) not in table.index:
            sys.exit(f"{path} has no row of target {target} and trial {trial}; add it.")
    return {t: table.loc[t].loc[trials].to_numpy(float) for t in found.targets}


def score(found, proba):
    """Return the mean RPS over targets of each object."""
    each = [
        ranked_probability_score(y.to_numpy(), proba[target], average=False)
        for target, y in found.targets.items()
    ]
    objects = np.unique(found.groups)
    rps = of_groups(np.mean(each, axis=0), found.groups)
    return pd.Series(rps, pd.Index(objects, name="object"))


def ceiling(found):
    """Return the mean RPS of the distributions in the populations.

    It is not known if each object was rated once.
    """
    each = [y.to_numpy() for y in found.targets.values()]
    if min(y.sum(axis=1).min() for y in each) < 2:
        return np.nan
    return np.mean([noise_ceiling(y).truth for y in each])


def methods(found):
    """Return the default model and both baselines."""
    default = make_haptic_pipeline(Signal(rate=2000), random_state=0)
    if found.given is not None:
        default = make_pipeline(found.given, default[-1])
    guesses = "marginal", "barycentre"
    return {"default": default} | {name: DummyDistribution(name) for name in guesses}


def report(name, found, scores, method):
    title = f"{name}: {len(scores)} objects, ceiling {ceiling(found):.4f}"
    head("method", "RPS", f"more than {method}", title=title)
    for column, rps in scores.items():
        row(column, f"{rps.mean():.4f}", plus_minus(rps - scores[method]))


def main():
    parser = command(__doc__, folder=True)
    parser.add_argument("--sets", nargs="+", default=[*SETS], choices=SETS)
    parser.add_argument("--proba", type=Path)
    parser.add_argument("--name", default="mine")
    options = parser.parse_args()
    for folder in (HERE / "folds", HERE / "scores"):
        folder.mkdir(exist_ok=True)
    for name in options.sets:
        found, path = load(name, options.folder), HERE / "scores" / f"{name}.csv"
        if options.proba:
            scores, method = pd.read_csv(path, index_col="object"), options.name
            scores[method] = score(found, read(options.proba, found))
        else:
            table_of_folds(found).to_csv(HERE / "folds" / f"{name}.csv")
            proba = {k: predict(model, found) for k, model in methods(found).items()}
            scores = pd.DataFrame({k: score(found, p) for k, p in proba.items()})
            method = "default"
        scores.round(5).to_csv(path)
        report(name, found, scores, method)


if __name__ == "__main__":
    main()
