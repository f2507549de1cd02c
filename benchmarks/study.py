"""What a study of generated touches takes, and what its patience changes.

    OMP_NUM_THREADS=1 python benchmarks/study.py time --objects 15 30 60
    OMP_NUM_THREADS=1 python benchmarks/study.py patience --objects 60 --seeds 0

Seconds by the clock of one process, as the records of the study have them: run nothing
else beside. The study is of Hold, with five sensors, ten trials per object, the paper's
split, its grid and ten starts.
"""

import argparse
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from threadpoolctl import threadpool_limits

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.recordings._biotac import SENSORS
from sklearn_haptic.study import run_study
from sklearn_haptic.study._store import read_record

ADJECTIVES = ["hard", "rough"]


def stopping(patience, max_iter):
    """Return a regressor that stops early."""
    network = NNPOM(early_stopping=True, max_iter=max_iter, n_iter_no_change=patience)
    return DistributionalOrdinalRegressor(network)


def timed_study(n_objects, seed=0, **settings):
    """Return the results of a study, and the seconds of each unit by its name."""
    with TemporaryDirectory() as folder:
        study = run_study(
            partial(make_haptic_corpus, n_objects, 10, random_state=0),
            folder,
            adjectives=ADJECTIVES,
            procedures=["hold"],
            split="paper",
            random_state=seed,
            verbose=False,
            **settings,
        )
        units = [("features", "hold", sensor) for sensor in SENSORS]
        units += [("models", "hold", adjective, 0) for adjective in ADJECTIVES]
        seconds = {unit: read_record(Path(folder), unit)["seconds"] for unit in units}
    return study, seconds


def mean_seconds(seconds, kind):
    return np.mean([each for unit, each in seconds.items() if unit[0] == kind])


def print_patience(sizes, seeds):
    """Compare the default stopping with the paper's patience, on the same features."""
    print(
        "| objects | seed | adjective | networks chosen otherwise "
        "| MAE^M, 30 of 200 | MAE^M, 150 of 500 | seconds | seconds |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for n_objects, seed in product(sizes, seeds):
        studies = [
            timed_study(n_objects, seed, regressor=stopping(*limits))
            for limits in ((30, 200), (150, 500))
        ]
        for adjective in ADJECTIVES:
            chosen, errors, times = [], [], []
            for study, seconds in studies:
                choices = study.choices.query("adjective == @adjective")
                chosen.append(choices[["n_hidden", "alpha"]].to_numpy())
                full = study.scores.query(
                    "adjective == @adjective and held_out == 'none'"
                )
                errors.append(f"{full['macro_mae'].mean():.3f}")
                times.append(f"{seconds['models', 'hold', adjective, 0]:.0f}")
            others = (chosen[0] != chosen[1]).any(axis=1).sum()
            row = n_objects, seed, adjective, f"{others} of 6", *errors, *times
            print("| " + " | ".join(map(str, row)) + " |", flush=True)


def print_seconds(sizes):
    """Time the units of several numbers of objects, means of two adjectives."""
    print(
        "| objects | a dictionary and its features | all models of a fold "
        "| the paper's dictionary and features | its models |"
    )
    print("|---|---|---|---|---|")
    for n_objects in sizes:
        studies = [
            timed_study(n_objects, protocol=protocol)[1]
            for protocol in ("default", "paper")
        ]
        seconds = [
            mean_seconds(of_study, kind)
            for of_study in studies
            for kind in ("features", "models")
        ]
        row = " | ".join(f"{each:.1f}" for each in seconds)
        print(f"| {n_objects} | {row} |", flush=True)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=["time", "patience"])
    parser.add_argument("--objects", type=int, nargs="+", default=[15, 30, 60])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    arguments = parser.parse_args()
    with threadpool_limits(1, user_api="blas"):
        if arguments.table == "time":
            print_seconds(arguments.objects)
        else:
            print_patience(arguments.objects, arguments.seeds)


if __name__ == "__main__":
    main()
