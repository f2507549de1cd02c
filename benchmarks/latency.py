"""Milliseconds and memory that a fitted model takes to predict one touch.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/latency.py

Generated holds of 10 s and slow slides of 5 s by a BioTac of two fingers; 24 objects
touched four times each. Touches are predicted one at a time: processor time, median
and largest of 200. "model" is the size of the pickled model, "while predicting" the
peak of what Python allocates for one touch, by tracemalloc. Two minutes on one core.
"""

import gc
import pickle
import time
import tracemalloc

import numpy as np
from sklearn import config_context

from sklearn_haptic import make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus

SENSORS = {
    "pressure": ["pdc"],
    "vibration": ["pac"],
    "electrodes": ["electrodes"],
    "all five": ["pac", "pdc", "tac", "tdc", "electrodes"],
}


def milliseconds(model, trials, n_calls=200):
    """Median and largest processor time of predicting one touch after another."""
    model.predict_proba(trials.iloc[[0]])  # a first call imports and allocates
    gc.collect()
    gc.freeze()
    taken = []
    for call in range(n_calls):
        touch = trials.iloc[[call % len(trials)]]
        started = time.process_time()
        model.predict_proba(touch)
        taken.append(1000 * (time.process_time() - started))
    return np.median(taken), max(taken)


def peak(model, touch):
    """Most megabytes allocated while one touch is predicted."""
    tracemalloc.start()
    model.predict_proba(touch)
    size = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return size / 1e6


def main():
    print(
        "| touch, sensors | preset | learning, s | median, ms | largest, ms |", end=""
    )
    print(" model, MB | while predicting, MB |")
    print("|---" * 7 + "|")
    for procedure in ("hold", "slow_slide"):
        corpus = make_haptic_corpus(24, 4, procedure, random_state=0)
        for name, sensors in SENSORS.items():
            for preset in ("fast", "accurate"):
                trials, counts = corpus.trials[sensors], corpus.ratings["hard"]
                model = make_haptic_pipeline(sensors, preset=preset, random_state=0)
                keywords = {"groups": corpus.objects} if preset == "accurate" else {}
                started = time.process_time()
                with config_context(enable_metadata_routing=True):
                    model.fit(trials, counts, **keywords)
                learning = time.process_time() - started
                median, largest = milliseconds(model, trials)
                size = len(pickle.dumps(model)) / 1e6
                print(
                    f"| {procedure.replace('_', ' ')}, {name} | {preset} | "
                    f"{learning:.1f} | {median:.1f} | {largest:.1f} | {size:.2f} | "
                    f"{peak(model, trials.iloc[[0]]):.1f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
