"""Speed of batch OMP and K-SVD, this package beside its peers, on one thread.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/sparse_coding.py

Peers are optional, best in an environment of their own that has this package too:
``pip install spams-bin dictlearn numba``. Coders take turns within each round, so
that what else the machine does meets all of them; times are processor times, figures
medians over rounds, and ratios medians of the rounds' ratios. scikit-learn codes a
hundredth of the signals. K-SVD has other data and another start with every seed, and
is also run with atoms updated in their order, as dictlearn does, not a random one.
"""

import os
import platform
import time
from datetime import date
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from sklearn.decomposition import SparseCoder
from sklearn.linear_model import orthogonal_mp_gram

# The transformers check, centre and write codes densely; what the peers do is private.
from sklearn_haptic.features._ksvd import ksvd
from sklearn_haptic.features._sparse_coding import batch_omp

PROBLEMS = [(22, 40, 4), (50, 25, 4), (9, 10, 3)]  # window, atoms, coefficients
N_SIGNALS, N_ROUNDS = 100_000, 9
N_TRAINING, N_ITERATIONS, N_SEEDS = 10_000, 20, 8
PEERS = {"spams": "spams-bin", "dictlearn": "dictlearn", "numba": "numba"}


def processor():
    """Name of the processor, as exactly as the system tells it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":")[1].strip() for line in lines if "model name" in line]
    return names[0] if names else platform.processor()


def heading():
    """Machine, versions and date."""
    packages = ["numpy", "scipy", "scikit-learn"]
    packages += [name for module, name in PEERS.items() if find_spec(module)]
    versions = [f"{name} {version(name)}" for name in packages]
    python = f"Python {platform.python_version()}"
    print(", ".join([processor(), "one thread", python, *versions]))
    print(f"{date.today()}\n")


def row(*cells):
    print("|", " | ".join(cells), "|", flush=True)


def unit_rows(rows):
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def timed(functions):
    """Run functions in turn; return their processor times and their results."""
    times, results = [], []
    for function in functions:
        start = time.process_time()
        results.append(function())
        times.append(time.process_time() - start)
    return times, results


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


def supports_by_least_squares(signals, atoms, n_coefs):
    """Supports of orthogonal matching pursuit by brute force, in double precision."""
    signals, atoms = signals.astype(float), atoms.astype(float)
    support = np.empty((n_coefs, len(signals)), dtype=int)
    residuals = signals
    for k in range(n_coefs):
        correlations = np.abs(residuals @ atoms.T)
        np.put_along_axis(correlations, support[:k].T, 0, axis=1)
        support[k] = correlations.argmax(axis=1)
        taken = atoms[support[: k + 1].T]
        normal_matrices = taken @ taken.transpose(0, 2, 1)
        coefs = np.linalg.solve(normal_matrices, taken @ signals[:, :, None])
        residuals = signals - (coefs.transpose(0, 2, 1) @ taken)[:, 0]
    return support


def coding_table():
    print("Thousand signals a second (in brackets: float32 here is so many times it);")
    print("signals whose support, in float32, is that of least squares\n")
    for i, (window, n_atoms, n_coefs) in enumerate(PROBLEMS):
        rng = np.random.default_rng(0)
        atoms = unit_rows(rng.normal(size=(n_atoms, window))).astype(np.float32)
        signals = rng.normal(size=(N_SIGNALS, window)).astype(np.float32)
        runs = coders(signals, atoms, n_coefs)
        if i == 0:
            row("window, atoms, T", *runs, "supports equal")
            row(*["---"] * (len(runs) + 2))
        installed = {name: run for name, run in runs.items() if run}
        n_signals, functions = zip(*installed.values())
        timed(functions)  # compiles what there is to compile
        times = np.array([timed(functions)[0] for _ in range(N_ROUNDS)])
        rates = np.array(n_signals) / times / 1e3
        cells = dict.fromkeys(runs, "not installed")
        for name, rate in zip(installed, rates.T):
            ratio = np.median(rates[:, 0] / rate)
            cells[name] = f"{np.median(rate):.0f} ({ratio:.1f})"
        support, _ = batch_omp(signals, atoms, n_coefs)
        expected = supports_by_least_squares(signals, atoms, n_coefs)
        equal = (support == expected).all(axis=0).sum()
        row(
            f"{window}, {n_atoms}, {n_coefs}",
            *cells.values(),
            f"{equal} of {N_SIGNALS}",
        )


class InOrder:
    """Updates atoms in their order, as dictlearn does, in place of a random one."""

    permutation = staticmethod(np.arange)


def training_signals(window, n_atoms, n_coefs, rng):
    """Noisy sparse combinations of planted atoms."""
    planted = unit_rows(rng.normal(size=(n_atoms, window)))
    codes = rng.normal(size=(N_TRAINING, n_atoms))
    ranks = rng.random(codes.shape).argsort(axis=1).argsort(axis=1)
    codes[ranks >= n_coefs] = 0
    return codes @ planted + 0.05 * rng.normal(size=(N_TRAINING, window))


def rmse(signals, atoms, n_coefs):
    """Error of the signals coded, in double precision, over a fitted dictionary."""
    codes = np.zeros((len(signals), len(atoms)))
    support, coefs = batch_omp(signals.astype(float), atoms.astype(float), n_coefs)
    np.add.at(codes, (np.arange(len(signals)), support), coefs)
    return np.sqrt(np.mean((signals - codes @ atoms) ** 2))


def learners(signals, start, n_coefs, seed):
    """Name -> function that returns a dictionary, or None where not installed."""

    def fit(dtype, rng):
        return ksvd(
            signals.astype(dtype),
            start.astype(dtype),
            n_coefs,
            max_iter=N_ITERATIONS,
            tol=0,
            rng=rng,
        )[0]

    runs = {
        "float32": partial(fit, "f4", np.random.RandomState(seed)),
        "float64": partial(fit, "f8", np.random.RandomState(seed)),
        "float32, atoms in order": partial(fit, "f4", InOrder),
        "dictlearn aksvd": None,
    }
    if find_spec("dictlearn") and find_spec("numba"):
        import dictlearn

        peer = dictlearn.DictionaryLearning(
            len(start),
            fit_algorithm="aksvd",
            n_nonzero_coefs=n_coefs,
            max_iter=N_ITERATIONS,
            dict_init=start,
            random_state=seed,
        )
        runs["dictlearn aksvd"] = lambda: peer.fit(signals).components_
    return runs


def ksvd_table():
    print(f"\nK-SVD, {N_TRAINING} signals, {N_ITERATIONS} iterations, same start:")
    print("seconds (in brackets: so many times those of float32 here), then RMSE and")
    print(
        f"its difference from dictlearn, means over {N_SEEDS} seeds ± standard error\n"
    )
    for i, (window, n_atoms, n_coefs) in enumerate(PROBLEMS):
        times, errors = [], []
        for seed in range(N_SEEDS):
            signals = training_signals(
                window, n_atoms, n_coefs, np.random.default_rng(seed)
            )
            runs = learners(signals, unit_rows(signals[:n_atoms]), n_coefs, seed)
            installed = {name: run for name, run in runs.items() if run}
            if seed == 0:
                timed(installed.values())  # compiles what there is to compile
            elapsed, fitted = timed(installed.values())
            times.append(elapsed)
            errors.append([rmse(signals, atoms, n_coefs) for atoms in fitted])
        if i == 0:
            row("window, atoms, T", *runs)
            row(*["---"] * (len(runs) + 1))
        times, errors = np.array(times), np.array(errors)
        cells = dict.fromkeys(runs, "not installed")
        for name, time_, error in zip(installed, times.T, errors.T):
            ratio = np.median(time_ / times[:, 0])
            cells[name] = f"{np.median(time_):.3f} ({ratio:.1f}), {error.mean():.4f}"
            if runs["dictlearn aksvd"] and name != "dictlearn aksvd":
                gaps = error - errors[:, -1]
                standard_error = gaps.std(ddof=1) / np.sqrt(N_SEEDS)
                cells[name] += f", {gaps.mean():+.4f} ± {standard_error:.4f}"
        row(f"{window}, {n_atoms}, {n_coefs}", *cells.values())


if __name__ == "__main__":
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        if os.environ.get(variable) != "1":
            raise SystemExit(f"Set {variable}=1: the tables are for one thread.")
    heading()
    coding_table()
    ksvd_table()
