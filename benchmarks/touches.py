"""Milliseconds and memory of one touch by a fitted model, whole or in progress.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/touches.py \
        [--parts whole stream] [--quick]

whole   Holds of 10 s and slow slides of 5 s by a BioTac of two fingers, 24 objects four
        times each, predicted one at a time: processor time of 200, size of the pickled
        model, and the peak of what Python allocates. One to two minutes.
stream  A minute of five sensors in updates of 10 ms. Half a minute.
"""

import gc
import pickle

import numpy as np
from data import RATES, SENSORS
from measure import command, head, in_turn, peak_mb, row, timed
from streams import DURATIONS, pipeline

from sklearn_haptic import AnytimeRegressor, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus

PARTS = {
    "pressure": ["pdc"],
    "vibration": ["pac"],
    "vibration, pressure": ["pac", "pdc"],
    "electrodes": ["electrodes"],
    "all five": SENSORS,
}


def whole(quick):
    """Print what predicting one recorded touch takes."""
    head(
        "touch, sensors", "learning, s", "median, ms", "largest, ms",
        "model, MB", "while predicting, MB",
    )  # fmt: skip
    n_objects, n_calls = (6, 5) if quick else (24, 200)
    for procedure in ("hold", "slow_slide"):
        corpus = make_haptic_corpus(n_objects, 4, procedure, random_state=0)
        for name, sensors in PARTS.items():
            trials, counts = corpus.trials[sensors], corpus.ratings["hard"]
            model = make_haptic_pipeline(sensors, random_state=0)
            learning, _ = timed(model.fit, trials, counts, model__groups=corpus.objects)
            model.predict_proba(trials.iloc[[0]])  # imports and allocates
            gc.collect()
            gc.freeze()
            touches = [trials.iloc[[i % len(trials)]] for i in range(n_calls)]
            calls = [lambda t=t, m=model: m.predict_proba(t) for t in touches]
            taken = 1000 * in_turn(calls)
            costs = [f"{ms:.1f}" for ms in (np.median(taken), taken.max())]
            costs.append(f"{len(pickle.dumps(model)) / 1e6:.2f}")
            costs.append(f"{peak_mb(calls[0]):.1f}")
            touch = f"{procedure.replace('_', ' ')}, {name}"
            row(touch, f"{learning:.1f}", *costs)


def stream(quick):
    """Print what updates and predictions of a touch in progress take."""
    corpus = make_haptic_corpus(14, 2, random_state=0)
    touches = corpus.trials.map(np.float64)
    model = AnytimeRegressor(
        pipeline(), durations=DURATIONS, sampling_rates=RATES, cv=2
    ).fit(touches, corpus.ratings["hard"], groups=corpus.objects)
    minute = {s: np.vstack([touches[s].iloc[0]] * 6) for s in RATES}
    touch, taken, n_seconds = model.start(), [], 10 if quick else 60
    for i in range(100 * n_seconds):
        new = {
            s: minute[s][i * r // 100 : (i + 1) * r // 100] for s, r in RATES.items()
        }
        taken.append((timed(touch.update, new)[0], timed(touch.predict_proba)[0]))
    taken = 1e3 * np.array(taken)
    head("ms of processor time", "median", "95 %", "99 %", "largest")
    for start, end in ((0, 1), (1, 8), (9, 10), (59, 60)):
        if end <= n_seconds:
            of_part = taken[100 * start : 100 * end]
            for name, each in zip(("update", "prediction"), of_part.T):
                cells = [f"{ms:.2f}" for ms in np.percentile(each, [50, 95, 99, 100])]
                row(f"{name}, {start} to {end} s", *cells)


def main():
    parts = {"whole": whole, "stream": stream}
    parser = command(__doc__)
    parser.add_argument("--parts", nargs="+", default=list(parts), choices=parts)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    for part in arguments.parts:
        parts[part](arguments.quick)


if __name__ == "__main__":
    main()
