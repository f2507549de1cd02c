"""Speed of the ordinal network, this package beside skordinal, on one thread.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/ordinal.py [FOLDER]

needs ``pip install skordinal``. FOLDER holds the data sets toy, tae and melanoma of
ORCA as ``*_sin.npz`` with `X_train`, `y_train` and `hidden`; without it only the data
sets that skordinal ships are used. Every figure of a table comes from the same run,
ours and the peer's in turn, in processor time.

1. The network on single ratings: time from the same start to the final cost of
   skordinal 0.2 (its defaults: 500 iterations, alpha 0.01). The cost has many
   minima, and from the same start either may end in the lower: medians over the starts
   from which that cost is reached; "of all" counts others with their whole time.
2. `DistributionalOrdinalRegressor` against skordinal's network on materialised rows,
   480 trials × 15 positions, the same number of iterations.
3. `predict_proba` against the same network on materialised rows, 1000 trials × 2400
   features at 99 positions, and the largest error of the distribution function.
"""

import argparse
import platform
import time
import warnings
from datetime import date
from importlib.metadata import version
from pathlib import Path

import numpy as np
from scipy.special import logit
from sklearn.exceptions import ConvergenceWarning
from sklearn.preprocessing import StandardScaler
from skordinal.classifiers import NNPOM as Peer
from skordinal.datasets import load_era, load_esl, load_lev, load_swd

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor

# A descent from given parameters to a given cost; `NNPOM.fit` chooses both itself.
from sklearn_haptic.models._conditioning import Conditioning
from sklearn_haptic.models._network import Layout
from sklearn_haptic.models._network_loss import NetworkLoss
from sklearn_haptic.models._solvers import lbfgs
from sklearn_haptic.ratings import inverse_cdf


def seconds(function, *arguments):
    """Processor time of a call, and what it returns."""
    start = time.process_time()
    result = function(*arguments)
    return time.process_time() - start, result


# 1. Single ratings ----------------------------------------------------------


def data_sets(folder):
    """Name -> (features, index of the level, hidden units)."""
    sets = {}
    for path in sorted(folder.glob("*_sin.npz")) if folder else []:
        case = np.load(path)
        levels = case["y_train"].ravel()
        sets[path.name.split("_")[0]] = case["X_train"], levels, int(case["hidden"])
    for load in (load_esl, load_lev, load_swd, load_era):
        bunch = load()
        X = StandardScaler().fit_transform(bunch.data)
        sets[load.__name__.removeprefix("load_")] = X, bunch.target, 10
    return {
        name: (X, np.unique(y, return_inverse=True)[1], n_hidden)
        for name, (X, y, n_hidden) in sets.items()
    }


def start_of_peer(seed, n_features, n_hidden, n_levels):
    """skordinal's random start, in this package's layout."""
    rng = np.random.RandomState(seed)
    layer = rng.rand(n_hidden, n_features + 1) - 0.5
    output = rng.rand(1, n_hidden).ravel() - 0.5
    t = rng.rand(n_levels - 1, 1).ravel() - 0.5
    gap_logits = np.log(np.expm1(t[1:] ** 2))  # its gaps are squares
    return np.concatenate(
        (layer[:, 1:].T.ravel(), layer[:, 0], output, t[:1], gap_logits)
    )


def descend(X, level, n_hidden, alpha, params, target):
    """What `NNPOM.fit` does, from given parameters down to a cost."""
    level = level[:, None]
    weight = np.ones(level.shape)
    layout = Layout(X.shape[1], n_hidden, (level.max() + 1,))
    features = Conditioning(X, layout, alpha, weight[:, 0], scale=False, rotate=True)
    observed = None, level, weight
    cost = NetworkLoss(features.layout, features.inputs, [observed], features.alpha)
    params, _, _ = lbfgs(
        cost,
        features.apply(params),
        max_iter=500,
        tol=1e-5,
        callback=lambda _, value: value <= target,
    )
    return cost(params)[0]


def to_the_peers_cost(folder, n_seeds=10, alpha=0.01):
    print("\n**Time to skordinal's own final cost**, same start, alpha 0.01\n")
    print("| data | rows × features, units | reached | skordinal, s | ours, s", end=" ")
    print("| ratio | ratio of all |")
    print("|---|---|---|---|---|---|---|")
    for name, (X, level, n_hidden) in data_sets(folder).items():
        rows = []
        for seed in range(n_seeds):
            peer = Peer(n_hidden=n_hidden, alpha=alpha, random_state=seed)
            theirs, _ = seconds(peer.fit, X, level)
            params = start_of_peer(seed, X.shape[1], n_hidden, level.max() + 1)
            ours, cost = seconds(descend, X, level, n_hidden, alpha, params, peer.loss_)
            rows.append((theirs, ours, ours / theirs, cost <= peer.loss_))
        rows = np.array(rows)
        reached = rows[:, 3] == 1
        theirs, ours, ratio, _ = np.median(rows[reached], axis=0)
        print(
            f"| {name} | {X.shape[0]} × {X.shape[1]}, {n_hidden} | "
            f"{reached.sum()} of {n_seeds} | {theirs:.3f} | {ours:.3f} | {ratio:.2f} | "
            f"{np.median(rows[:, 2]):.2f} |",
            flush=True,
        )


# 2. and 3. Distributions ----------------------------------------------------


def touches(n_objects, n_trials, n_features):
    """Standardised features and rating counts of touches of objects."""
    rng = np.random.default_rng(0)
    objects = np.repeat(np.arange(n_objects), n_trials)
    latent = rng.normal(size=(n_objects, 6))
    X = latent[objects] @ rng.normal(size=(6, n_features)) / 2
    X = StandardScaler().fit_transform(X + rng.normal(size=X.shape))
    raters = 3 + 1.5 * latent[:, :1] + rng.normal(size=(n_objects, 12))
    ratings = np.clip(np.rint(raters), 1, 5)
    counts = np.stack([(ratings == k).sum(axis=1) for k in range(1, 6)], axis=1)
    return X, counts[objects].astype(float)


def materialised(X, inputs):
    """One row an observation, its position as the last feature."""
    rows = np.column_stack((X, np.zeros(len(X)))).repeat(inputs.shape[1], axis=0)
    rows[:, -1] = inputs.ravel()
    return rows


def fitting(n_iter=200, n_runs=3):
    print(f"\n**Fit**, 480 trials × 15 positions, {n_iter} iterations each\n")
    print("| features, units | skordinal, s | ours, s | ratio | ours, level nodes, s |")
    print("|---|---|---|---|---|")
    for n_features, n_hidden in ((310, 10), (1240, 30), (4340, 30)):
        X, counts = touches(48, 10, n_features)
        positions = (np.arange(15) + 0.5) / 15
        level = inverse_cdf(counts, positions) - 1
        rows = materialised(X, np.tile(logit(positions), (len(X), 1)))
        network = NNPOM(n_hidden, max_iter=n_iter, tol=0, random_state=0)
        peer = Peer(n_hidden=n_hidden, alpha=1.0, max_iter=n_iter, random_state=0)
        times = {"peer": [], "random": [], "level": []}
        for _ in range(n_runs):
            for sampling in ("random", "level"):
                model = DistributionalOrdinalRegressor(network, sampling=sampling)
                taken, _ = seconds(model.fit, X, counts)
                times[sampling].append(taken / model.estimator_.n_iter_ * n_iter)
            taken, _ = seconds(peer.fit, rows, level.ravel())
            times["peer"].append(taken / peer.n_iter_ * n_iter)
        theirs, ours, nodes = (np.median(times[k]) for k in times)
        ratio = np.median(np.divide(times["peer"], times["random"]))
        print(
            f"| {n_features}, {n_hidden} | {theirs:.2f} | {ours:.2f} | {ratio:.1f} | "
            f"{nodes:.2f} |",
            flush=True,
        )


def share_at_or_below(model, X, inputs, weight=None):
    """Distribution function on a dense grid of positions, of either decoding."""
    proba = model.estimator_.predict_proba_with_positions(X, inputs)
    cdf = np.cumsum(proba, axis=2)
    return np.mean(cdf if model.decode == "mixture" else cdf >= 0.5, axis=1)


def predicting(n_runs=7):
    print("\n**predict_proba**, 1000 trials × 2400 features\n")
    print(
        "| units | decoding | 99 rows per trial, ms | ours, ms | ratio | CDF error | "
        "of the 99 positions |"
    )
    print("|---|---|---|---|---|---|---|")
    X, counts = touches(100, 10, 2400)
    grid = logit(np.arange(1, 100) / 100)
    dense = logit((np.arange(4000) + 0.5) / 4000)
    rows = materialised(X, np.tile(grid, (len(X), 1)))
    for n_hidden in (0, 10, 30):
        for decode in ("mixture", "quantile"):
            model = DistributionalOrdinalRegressor(
                NNPOM(n_hidden, max_iter=50, random_state=0), decode=decode
            ).fit(X, counts)
            times = []
            for _ in range(n_runs):
                theirs, _ = seconds(model.estimator_.predict_proba, rows)
                ours, _ = seconds(model.predict_proba, X)
                times.append((theirs, ours, theirs / ours))
            theirs, ours, ratio = np.median(times, axis=0)
            few = X[::10]
            exact = share_at_or_below(model, few, dense)
            errors = [
                np.abs(cdf - exact).max()
                for cdf in (model.predict_cdf(few), share_at_or_below(model, few, grid))
            ]
            print(
                f"| {n_hidden} | {decode} | {1e3 * theirs:.0f} | {1e3 * ours:.1f} | "
                f"{ratio:.0f} | {errors[0]:.1e} | {errors[1]:.1e} |",
                flush=True,
            )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)
    packages = ("sklearn_haptic", "skordinal", "scikit-learn", "numpy", "scipy")
    print(f"{platform.processor() or platform.machine()}, {date.today()}, ", end="")
    print(", ".join(f"{name} {version(name)}" for name in packages))
    to_the_peers_cost(arguments.folder)
    fitting()
    predicting()


if __name__ == "__main__":
    main()
