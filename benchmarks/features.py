"""Features: time by stage, and memory of a whole corpus.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/features.py

One Hold trial of the synthetic corpus, medians of interleaved runs: coding alone is
the pursuit over signals that are ready. Then pipelines over whole corpora of Hold
trials, each in a process of its own; the peak is the operating system's and includes
the interpreter and the trials. Last, where BLAS may use every core, the clock time
alone and beside a process that keeps one core busy, in turns: the argument "busy"
prints this table only.
"""

import os
import platform
import resource
import subprocess
import sys
import time
from contextlib import contextmanager, nullcontext
from datetime import date
from functools import partial

import joblib
import numpy as np
import scipy
import sklearn
from sklearn.pipeline import make_pipeline
from threadpoolctl import threadpool_limits

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    KSVDTransformer,
    STHMPTransformer,
    TemporalMaxPool,
)
from sklearn_haptic.datasets import make_haptic_corpus

# The stages of a transformer, of which only the whole is public.
from sklearn_haptic.features._dictionary_coder import centre, learn_dictionary
from sklearn_haptic.features._sparse_coding import batch_omp
from sklearn_haptic.features._sthmp import electrode_images, image_patches

N_RUNS = 41
CORPUS_SIZES = [150, 300, 600]
N_BUSY_RUNS = 5


def milliseconds(functions):
    """Median time of each function, run in turns."""
    times = np.empty((N_RUNS, len(functions)))
    for run in times:
        for i, function in enumerate(functions):
            start = time.perf_counter()
            function()
            run[i] = time.perf_counter() - start
    return 1e3 * np.median(times, axis=0)


def sliding_windows(trial):
    """A view of windows of 22 samples, half of which the next one shares."""
    return np.lib.stride_tricks.sliding_window_view(trial, 22, axis=0)[::11]


def stage_row(name, transformer, trial, prepare, observations):
    """Print the times of a fitted transformer's stages on one trial."""
    codes = transformer.transform([trial])
    signals, scale = centre(observations, transformer.remove_mean)
    atoms, n_coefs = transformer.components_, transformer.n_nonzero_coefs
    array = codes[0]
    pool = TemporalMaxPool().fit([array])
    prepared, coding, encoding, pooling = milliseconds(
        [
            lambda: prepare(trial),
            lambda: batch_omp(signals, atoms, n_coefs, scale=scale),
            lambda: codes[0],
            lambda: pool.transform([array]),
        ]
    )
    rest = encoding - prepared - coding
    cells = [prepared, coding, rest, pooling, encoding + pooling]
    print(
        f"| {name}, {trial.dtype} |",
        " | ".join(f"{cell:.2f}" for cell in cells),
        f"| {(encoding + pooling) / coding:.2f} |",
        flush=True,
    )


def stage_table():
    print("One Hold trial, milliseconds\n")
    print(
        "| | images or windows | coding alone | patches, norms, dense codes, spatial "
        "pooling | temporal pooling | total | total / coding |"
    )
    print("|---" * 7 + "|")
    trials = make_haptic_corpus(5, 2, sensors=["electrodes", "pac"], random_state=0)
    for dtype in (np.float32, np.float64):
        frames = [trial.astype(dtype) for trial in trials.trials["electrodes"]]
        waves = [trial.astype(dtype) for trial in trials.trials["pac"]]
        sthmp = STHMPTransformer(random_state=0).fit(frames)
        patches = image_patches(electrode_images(frames[0], sthmp.layout_), (3, 3))
        stage_row(
            f"ST-HMP, {len(frames[0])} × {frames[0].shape[1]}",
            sthmp,
            frames[0],
            partial(electrode_images, layout=sthmp.layout_),
            patches.transpose(3, 4, 1, 2, 0).reshape(9, -1).T,
        )
        stage_row(
            f"K-SVD, 40 atoms, {len(waves[0])} × {waves[0].shape[1]}",
            KSVDTransformer(40, window=22, random_state=0).fit(waves),
            waves[0],
            sliding_windows,
            sliding_windows(waves[0]).reshape(-1, 22),
        )


def corpus_run(n_trials, dtype):
    """Print, in a process of its own, one row of the table of corpora."""
    corpus = make_haptic_corpus(
        n_trials // 10, 10, sensors=["electrodes"], random_state=0
    )
    trials = [trial.astype(dtype) for trial in corpus.trials["electrodes"]]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    steps = make_pipeline(STHMPTransformer(random_state=0), TemporalMaxPool())
    steps.fit(trials)
    fitted = time.perf_counter()
    features = steps.transform(trials)
    ended = time.perf_counter()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    megabytes = [
        sum(trial.nbytes for trial in trials) / 1e6,
        features.nbytes / 1e6,
        before / 1e3,
        peak / 1e3,
    ]
    print(
        f"| {n_trials} | {dtype} | {fitted - start:.1f} | {ended - fitted:.1f} | "
        f"{1e3 * (ended - fitted) / n_trials:.1f} |",
        " | ".join(f"{each:.0f}" for each in megabytes),
        "|",
        flush=True,
    )


def corpus_table():
    print("\nPipeline of ST-HMP and temporal pooling over Hold trials of electrodes\n")
    print(
        "| trials | data type | fit, s | transform, s | transform, ms a trial | "
        "trials, MB | features, MB | peak before, MB | peak, MB |"
    )
    print("|---" * 9 + "|", flush=True)
    for dtype in ("float32", "float64"):
        for n_trials in CORPUS_SIZES:
            subprocess.run([sys.executable, __file__, str(n_trials), dtype], check=True)


@contextmanager
def busy_core():
    """Keep a core busy by another process."""
    process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        time.sleep(0.2)
        yield
    finally:
        process.kill()
        process.wait()


def busy_table():
    print(f"\nBLAS may use {os.cpu_count()} threads; seconds by the clock\n")
    print("| | alone | beside a busy core | ratio |")
    print("|---|---|---|---|", flush=True)
    rng = np.random.default_rng(0)
    trials = list(rng.normal(size=(20, 4510, 2)))
    learning = {"update": "approximate", "max_iter": 3, "tol": 0}
    ksvd = KSVDTransformer(40, window=22, random_state=0, **learning)
    steps = make_pipeline(ksvd, TemporalMaxPool()).fit(trials)
    windows = [sliding_windows(trial).reshape(-1, 22) for trial in trials]
    windows = np.concatenate(windows)
    learning |= {"dict_init": None, "remove_mean": True, "seed": 0}
    X, y = rng.normal(size=(600, 2000)), rng.integers(1, 9, size=(600, 5))
    model = DistributionalOrdinalRegressor(NNPOM(n_hidden=10, alpha=100.0))
    model.fit(X[:100], y[:100])
    rows = {
        "K-SVD, 3 iterations": lambda: ksvd.fit(trials),
        "the same, threads not limited": lambda: learn_dictionary(
            windows, 40, 4, **learning
        ),
        "coding and pooling, 20 trials": lambda: steps.transform(trials),
        "prediction, 600 trials": lambda: model.predict_proba(X),
    }
    for name, function in rows.items():
        times = np.empty((N_BUSY_RUNS, 2))
        for run in times:
            for i, state in enumerate((nullcontext, busy_core)):
                with state():
                    start = time.perf_counter()
                    function()
                    run[i] = time.perf_counter() - start
        alone, busy = np.median(times, axis=0)
        print(f"| {name} | {alone:.3f} | {busy:.3f} | {busy / alone:.1f} |", flush=True)


if __name__ == "__main__":
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        if os.environ.get(variable) != "1":
            raise SystemExit(f"Set {variable}=1: the tables are for one thread.")
    if sys.argv[1:] == ["busy"]:
        with threadpool_limits(os.cpu_count(), user_api="blas"):
            busy_table()
    elif len(sys.argv) > 1:
        corpus_run(int(sys.argv[1]), sys.argv[2])
    else:
        versions = [
            f"{m.__name__} {m.__version__}" for m in (np, scipy, sklearn, joblib)
        ]
        print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores")
        print(f"Python {platform.python_version()}, {', '.join(versions)}")
        print(f"{date.today()}\n")
        stage_table()
        corpus_table()
        with threadpool_limits(os.cpu_count(), user_api="blas"):
            busy_table()
