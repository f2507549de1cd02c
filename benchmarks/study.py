"""Seconds that the units of a study of generated touches take, by its records.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/study.py [--quick]

Hold, five sensors, ten trials per object, the paper's split, its grid and ten starts,
15 to 60 objects, means of two adjectives. They are seconds by the clock: run nothing
else beside. A quarter of an hour; ``--quick`` takes 15 objects and the defaults.
"""

import warnings
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from data import SENSORS
from measure import command, head, row
from threadpoolctl import threadpool_limits

from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.study import run_study

# The seconds of a unit stand in its record, which is not public.
from sklearn_haptic.study._store import read_record

ADJECTIVES = ["hard", "rough"]


def seconds_of(n_objects, protocol):
    """Mean seconds of the units of a study of Hold: of features, and of models."""
    with TemporaryDirectory() as folder:
        run_study(
            partial(make_haptic_corpus, n_objects, 10, random_state=0),
            folder,
            protocol=protocol,
            adjectives=ADJECTIVES,
            procedures=["hold"],
            split="paper",
            verbose=False,
        )
        features = [("features", "hold", sensor) for sensor in SENSORS]
        models = [("models", "hold", adjective, 0) for adjective in ADJECTIVES]
        return [
            np.mean([read_record(Path(folder), unit)["seconds"] for unit in units])
            for units in (features, models)
        ]


def main():
    parser = command(__doc__)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    warnings.simplefilter("ignore")  # of fits that end early
    units = "a dictionary and its features", "all models of a fold"
    protocols = ("default",) if quick else ("default", "paper")
    head("objects", *(f"{protocol}: {u}" for protocol in protocols for u in units))
    for n_objects in (15,) if quick else (15, 30, 60):
        with threadpool_limits(1, user_api="blas"):
            found = [s for name in protocols for s in seconds_of(n_objects, name)]
        row(n_objects, *(f"{seconds:.1f}" for seconds in found))


if __name__ == "__main__":
    main()
