"""Speed of sparse codes, dictionaries and features, beside peers.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/codes.py \
        [--parts omp ksvd trial] [--quick]

About five minutes; ``--quick`` (fewer signals, rounds and trials) a quarter of one.
Peers are optional, best in an environment of their own that has this package too:
``pip install spams-bin dictlearn numba``.

omp, ksvd  Batch OMP and K-SVD; figures are medians over rounds. scikit-learn codes a
           hundredth of the signals. K-SVD is also run with atoms updated in order, as
           dictlearn does, not a random one.
trial      One generated Hold trial: codes, and codes pooled over time.
"""

from functools import partial
from importlib.util import find_spec

import numpy as np
from measure import command, head, in_turn, machine, plus_minus, row, timed, unit_rows
from sklearn.decomposition import SparseCoder

from sklearn_haptic import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from sklearn_haptic.datasets import make_haptic_corpus

# The transformers check, centre and write codes densely; what the peers do is private.
from sklearn_haptic.features._ksvd import ksvd
from sklearn_haptic.features._sparse_coding import batch_omp

PROBLEMS = [(22, 40, 4), (50, 25, 4), (9, 10, 3)]  # window, atoms, coefficients
HAS_SPAMS = find_spec("spams") is not None
HAS_DICTLEARN = find_spec("dictlearn") is not None


# Pursuit ------------------------------------------------------------------------------


def coders(signals, atoms, n_coefs):
    """Name -> number of signals, and a function that codes them."""
    doubles, few = signals.astype(float), signals[: len(signals) // 100].astype(float)
    peer = SparseCoder(atoms.astype(float), transform_n_nonzero_coefs=n_coefs)
    runs = {
        "float32": (len(signals), partial(batch_omp, signals, atoms, n_coefs)),
        "float64": (
            len(signals),
            partial(batch_omp, doubles, atoms.astype(float), n_coefs),
        ),
        "SparseCoder": (len(few), partial(peer.transform, few)),
    }
    if HAS_SPAMS:
        import spams

        columns, dictionary = np.asfortranarray(signals.T), np.asfortranarray(atoms.T)
        code = partial(spams.omp, columns, dictionary, L=n_coefs, eps=0.0, numThreads=1)
        runs["spams-bin, float32"] = len(signals), code
    if HAS_DICTLEARN:
        import dictlearn

        coder = dictlearn.SparseCoder(atoms.astype(float), n_nonzero_coefs=n_coefs)
        runs["dictlearn + numba"] = len(signals), partial(coder.fit_transform, doubles)
    return runs


def omp(quick):
    print("Thousand signals a second (in brackets: float32 here is so many times it)")
    n_signals, n_rounds = (10_000, 3) if quick else (100_000, 9)
    for i, (window, n_atoms, n_coefs) in enumerate(PROBLEMS):
        rng = np.random.default_rng(0)
        atoms = unit_rows(rng.normal(size=(n_atoms, window))).astype(np.float32)
        signals = rng.normal(size=(n_signals, window)).astype(np.float32)
        runs = coders(signals, atoms, n_coefs)
        if i == 0:
            head("window, atoms, T", *runs)
        n_coded, functions = zip(*runs.values())
        in_turn(functions)  # compiles what there is to compile
        rates = np.array(n_coded) / in_turn(functions, n_rounds) / 1e3
        ratios = np.median(rates[:, :1] / rates, axis=0)
        cells = [f"{r:.0f} ({x:.1f})" for r, x in zip(np.median(rates, axis=0), ratios)]
        row(f"{window}, {n_atoms}, {n_coefs}", *cells)


# Dictionaries -------------------------------------------------------------------------


class InOrder:
    """Updates atoms in their order, as dictlearn does, in place of a random one."""

    permutation = staticmethod(np.arange)


def training_signals(n_signals, window, n_atoms, n_coefs, rng):
    """Noisy sparse combinations of planted atoms."""
    planted = unit_rows(rng.normal(size=(n_atoms, window)))
    codes = rng.normal(size=(n_signals, n_atoms))
    ranks = rng.random(codes.shape).argsort(axis=1).argsort(axis=1)
    codes[ranks >= n_coefs] = 0
    return codes @ planted + 0.05 * rng.normal(size=(n_signals, window))


def rmse(signals, atoms, n_coefs):
    """Error of the signals coded, in double precision, over a learned dictionary."""
    codes = np.zeros((len(signals), len(atoms)))
    support, coefs = batch_omp(signals.astype(float), atoms.astype(float), n_coefs)
    np.add.at(codes, (np.arange(len(signals)), support), coefs)
    return np.sqrt(np.mean((signals - codes @ atoms) ** 2))


def learners(signals, start, n_coefs, seed):
    """Name -> function that returns a dictionary."""

    def fit(dtype, rng):
        given = signals.astype(dtype), start.astype(dtype), n_coefs
        return ksvd(*given, max_iter=20, tol=0, rng=rng)[0]

    runs = {
        "float32": partial(fit, "f4", np.random.RandomState(seed)),
        "float64": partial(fit, "f8", np.random.RandomState(seed)),
        "float32, atoms in order": partial(fit, "f4", InOrder),
    }
    if HAS_DICTLEARN:
        import dictlearn

        peer = dictlearn.DictionaryLearning(
            len(start),
            fit_algorithm="aksvd",
            n_nonzero_coefs=n_coefs,
            max_iter=20,
            dict_init=start,
            random_state=seed,
        )
        runs["dictlearn aksvd"] = lambda: peer.fit(signals).components_
    return runs


def learning(quick):
    n_signals, n_seeds = (1000, 2) if quick else (10_000, 8)
    print(
        f"\nK-SVD, {n_signals} signals, 20 iterations from the same start: seconds (in"
    )
    print("brackets: so many times those of float32 here), RMSE, and its difference")
    print(f"from that of the last column ± standard error over {n_seeds} seeds")
    for i, (window, n_atoms, n_coefs) in enumerate(PROBLEMS):
        times, errors = [], []
        for seed in range(n_seeds):
            rng = np.random.default_rng(seed)
            signals = training_signals(n_signals, window, n_atoms, n_coefs, rng)
            runs = learners(signals, unit_rows(signals[:n_atoms]), n_coefs, seed)
            if seed == 0:
                in_turn(list(runs.values()))  # compiles what there is to compile
            taken, atoms = zip(*map(timed, runs.values()))
            times.append(taken)
            errors.append([rmse(signals, each, n_coefs) for each in atoms])
        if i == 0:
            head("window, atoms, T", *runs)
        times, errors = np.array(times), np.array(errors)
        ratios = np.median(times / times[:, :1], axis=0)
        cells = [
            f"{seconds:.3f} ({ratio:.1f}), {error.mean():.4f}, "
            + plus_minus(error - errors[:, -1])
            for seconds, ratio, error in zip(np.median(times, axis=0), ratios, errors.T)
        ]
        row(f"{window}, {n_atoms}, {n_coefs}", *cells)


# Features -----------------------------------------------------------------------------


def trial(quick):
    corpus = make_haptic_corpus(5, 2, sensors=["electrodes", "pac"], random_state=0)
    head("", "codes, ms", "pooling, ms", "total, ms", title="One Hold trial")
    for dtype in (np.float32, np.float64):
        for sensor, coder in {
            "electrodes": STHMPTransformer(random_state=0),
            "pac": KSVDTransformer(40, window=22, random_state=0),
        }.items():
            trials = [each.astype(dtype) for each in corpus.trials[sensor]]
            codes = coder.fit(trials).transform(trials[:1])
            array = codes[0]
            pool = TemporalMaxPool().fit([array])
            functions = [lambda c=codes: c[0], lambda p=pool, a=array: p.transform([a])]
            times = in_turn(functions, 5 if quick else 41)
            coding, pooling = 1e3 * np.median(times, axis=0)
            shape = " × ".join(map(str, trials[0].shape))
            cells = [f"{ms:.2f}" for ms in (coding, pooling, coding + pooling)]
            row(f"{type(coder).__name__}, {shape}, {np.dtype(dtype)}", *cells)


PARTS = {"omp": omp, "ksvd": learning, "trial": trial}


def main():
    parser = command(__doc__)
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    machine("spams-bin", "dictlearn", "numba")
    for part in arguments.parts:
        PARTS[part](arguments.quick)


if __name__ == "__main__":
    main()
