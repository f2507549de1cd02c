"""What a study of generated touches takes, and what its patience changes.

    OMP_NUM_THREADS=1 python benchmarks/study.py time --objects 15 30 60
    OMP_NUM_THREADS=1 python benchmarks/study.py patience --objects 60 --seeds 0

Processor time of one process; Hold, five sensors, ten trials an object, the paper's
split, its grid and ten starts.
"""

import argparse
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from threadpoolctl import threadpool_limits

from sklearn_haptic import NNPOM, PAPER_2020, DistributionalOrdinalRegressor
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_macro_mae_scorer
from sklearn_haptic.study._store import write_unit
from sklearn_haptic.study._units import COMPUTE, Study

SENSORS = ["pac", "pdc", "tac", "tdc", "electrodes"]
ADJECTIVES = ["hard", "rough"]


def stopping(patience, max_iter):
    """Return a regressor that stops early."""
    network = NNPOM(early_stopping=True, max_iter=max_iter, n_iter_no_change=patience)
    return DistributionalOrdinalRegressor(network)


def a_study(folder, n_objects, regressor, scoring=None, seed=0):
    """Return a study whose features are those of one seed, and all else of another."""
    return Study(
        corpus=partial(make_haptic_corpus, n_objects, 10, random_state=0),
        folder=Path(folder),
        sensors=SENSORS,
        split="paper",
        n_splits=5,
        n_repeats=2,
        n_hidden=[1, 5, 10, 20, 30],
        alpha=[0.001, 0.01, 0.1, 1.0, 10.0],
        n_starts=10,
        regressor=regressor,
        scoring=scoring,
        random_state=seed,
    )


def timed(study, *unit):
    """Compute a unit and keep it; return seconds, content and record."""
    started = process_time()
    content, record = COMPUTE[unit[0]](study, *unit[1:])
    seconds = process_time() - started
    write_unit(study.folder, unit, content, seconds=seconds, **record)
    return seconds, content, record


def compute_features(study):
    """Compute the features of all sensors; return the mean seconds of one."""
    timed(study, "trials", "hold")
    return np.mean([timed(study, "features", "hold", s)[0] for s in SENSORS])


def print_patience(sizes, seeds):
    """Compare the default stopping with the paper's patience, on the same features."""
    print(
        "| objects | seed | adjective | networks chosen otherwise "
        "| MAE^M, 30 of 200 | MAE^M, 150 of 500 | seconds | seconds |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for n_objects in sizes:
        with TemporaryDirectory() as folder:
            compute_features(a_study(folder, n_objects, None))
            for seed, adjective in product(seeds, ADJECTIVES):
                choices, errors, times = [], [], []
                for limits in ((30, 200), (150, 500)):
                    study = a_study(folder, n_objects, stopping(*limits), seed=seed)
                    unit = "models", "hold", adjective, 0
                    seconds, table, record = timed(study, *unit)
                    full = table[table["held_out"] == "none"]
                    chosen = [(c["n_hidden"], c["alpha"]) for c in record["choices"]]
                    choices.append(chosen)
                    errors.append(f"{full['macro_mae'].mean():.3f}")
                    times.append(f"{seconds:.0f}")
                others = sum(one != other for one, other in zip(*choices))
                row = n_objects, seed, adjective, f"{others} of 6", *errors, *times
                print("| " + " | ".join(map(str, row)) + " |", flush=True)


def print_seconds(sizes):
    """Time the units of several numbers of objects, means of two adjectives."""
    print(
        "| objects | a dictionary and its features | all models of a fold "
        "| the same, paper's settings |"
    )
    print("|---|---|---|---|")
    settings = [
        (stopping(30, 200), None),
        (DistributionalOrdinalRegressor(**PAPER_2020), neg_macro_mae_scorer),
    ]
    for n_objects in sizes:
        with TemporaryDirectory() as folder:
            seconds = [compute_features(a_study(folder, n_objects, None))]
            for regressor, scoring in settings:
                study = a_study(folder, n_objects, regressor, scoring)
                units = [("models", "hold", adjective, 0) for adjective in ADJECTIVES]
                seconds.append(np.mean([timed(study, *unit)[0] for unit in units]))
            print(
                f"| {n_objects} | " + " | ".join(f"{s:.1f}" for s in seconds) + " |",
                flush=True,
            )


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
