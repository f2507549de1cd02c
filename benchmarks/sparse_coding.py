"""Speed of batch OMP and K-SVD, this package beside its peers, on one thread.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/sparse_coding.py

Peers are optional, best in an environment of their own that has this package too:
``pip install spams-bin dictlearn numba``. Every figure of a table comes from the
same run: random atoms and signals, medians of five runs. scikit-learn codes a
hundredth of the signals.
"""

import os
import time
from functools import partial
from importlib.util import find_spec

import numpy as np
from sklearn.decomposition import SparseCoder
from sklearn.linear_model import orthogonal_mp_gram

from sklearn_haptic._dictionary_learning import ksvd
from sklearn_haptic._sparse_coding import batch_omp

PROBLEMS = [(22, 40, 4), (50, 25, 4), (9, 10, 3)]  # window, atoms, coefficients
N_SIGNALS = 100_000
N_TRAINING, N_ITERATIONS = 10_000, 20


def unit_rows(rows):
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def seconds(function):
    """Median time of five runs, after one that compiles what there is to compile."""
    function()
    times = []
    for _ in range(5):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return np.median(times)


def coders(signals, atoms, n_coefs):
    """Name -> (number of signals, function), or None where not installed."""
    doubles, few = signals.astype(float), signals[: N_SIGNALS // 100].astype(float)
    double_atoms = atoms.astype(float)
    sklearn_coder = SparseCoder(double_atoms, transform_n_nonzero_coefs=n_coefs)
    gram = double_atoms @ double_atoms.T
    runs = {
        "float32": (N_SIGNALS, lambda: batch_omp(signals, atoms, n_coefs)),
        "float64": (N_SIGNALS, lambda: batch_omp(doubles, double_atoms, n_coefs)),
        "spams-bin, float32": None,
        "dictlearn + numba": None,
        "SparseCoder": (len(few), lambda: sklearn_coder.transform(few)),
        "orthogonal_mp_gram": (
            len(few),
            lambda: orthogonal_mp_gram(
                gram, double_atoms @ few.T, n_nonzero_coefs=n_coefs
            ),
        ),
    }
    if find_spec("spams"):
        import spams

        columns, dictionary = np.asfortranarray(signals.T), np.asfortranarray(atoms.T)
        runs["spams-bin, float32"] = (
            N_SIGNALS,
            lambda: spams.omp(columns, dictionary, L=n_coefs, eps=0.0, numThreads=1),
        )
    if find_spec("dictlearn") and find_spec("numba"):
        import dictlearn

        coder = dictlearn.SparseCoder(double_atoms, n_nonzero_coefs=n_coefs)
        runs["dictlearn + numba"] = (N_SIGNALS, lambda: coder.fit_transform(doubles))
    return runs


def coding_table():
    print("Thousand signals a second (in brackets: float32 here is so many times it)\n")
    for i, (window, n_atoms, n_coefs) in enumerate(PROBLEMS):
        rng = np.random.default_rng(0)
        atoms = unit_rows(rng.normal(size=(n_atoms, window))).astype(np.float32)
        signals = rng.normal(size=(N_SIGNALS, window)).astype(np.float32)
        runs = coders(signals, atoms, n_coefs)
        if i == 0:
            print("| window, atoms, T |", " | ".join(runs), "|")
            print("|---" * (len(runs) + 1) + "|")
        rates = [run and run[0] / 1e3 / seconds(run[1]) for run in runs.values()]
        cells = [
            f"{rate:.0f} ({rates[0] / rate:.1f})" if rate else "not installed"
            for rate in rates
        ]
        print(f"| {window}, {n_atoms}, {n_coefs} |", " | ".join(cells), "|", flush=True)


def rmse(signals, atoms, n_coefs):
    """Error of the signals coded, in double precision, over a fitted dictionary."""
    codes = np.zeros((len(signals), len(atoms)))
    support, coefs = batch_omp(signals.astype(float), atoms.astype(float), n_coefs)
    np.add.at(codes, (np.arange(len(signals)), support), coefs)
    return np.sqrt(np.mean((signals - codes @ atoms) ** 2))


def ksvd_row(window, n_atoms, n_coefs):
    rng = np.random.default_rng(0)
    planted = unit_rows(rng.normal(size=(n_atoms, window)))
    codes = np.zeros((N_TRAINING, n_atoms))
    for code in codes:
        code[rng.choice(n_atoms, n_coefs, replace=False)] = rng.normal(size=n_coefs)
    signals = codes @ planted + 0.05 * rng.normal(size=(N_TRAINING, window))
    start = unit_rows(signals[:n_atoms])
    fitted = {}

    def fit(dtype):
        fitted[dtype], _ = ksvd(
            signals.astype(dtype),
            start.astype(dtype),
            n_coefs,
            max_iter=N_ITERATIONS,
            tol=0,
            rng=np.random.RandomState(0),
        )

    times = {dtype: seconds(partial(fit, dtype)) for dtype in ("f4", "f8")}
    if find_spec("dictlearn") and find_spec("numba"):
        import dictlearn

        peer = dictlearn.DictionaryLearning(
            n_atoms,
            fit_algorithm="aksvd",
            n_nonzero_coefs=n_coefs,
            max_iter=N_ITERATIONS,
            dict_init=start,
            random_state=0,
        )
        times["peer"] = seconds(lambda: peer.fit(signals))
        fitted["peer"] = peer.components_
    cells = [
        f"{times[name]:.3f} / {rmse(signals, fitted[name], n_coefs):.4f}"
        if name in times
        else "not installed"
        for name in ("f4", "f8", "peer")
    ]
    cells.append(f"{times['peer'] / times['f4']:.1f}" if "peer" in times else "")
    print(f"| {window}, {n_atoms}, {n_coefs} |", " | ".join(cells), "|", flush=True)


def ksvd_table():
    print(f"\nK-SVD, {N_TRAINING} signals, {N_ITERATIONS} iterations: seconds / RMSE\n")
    print("| window, atoms, T | float32 | float64 | dictlearn aksvd | ratio |")
    print("|---|---|---|---|---|")
    for problem in PROBLEMS:
        ksvd_row(*problem)


if __name__ == "__main__":
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        if os.environ.get(variable) != "1":
            raise SystemExit(f"Set {variable}=1: the tables are for one thread.")
    coding_table()
    ksvd_table()
