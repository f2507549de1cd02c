"""Accuracy and cost of decoding a distribution from any estimator.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/decoding.py

`DistributionalOrdinalRegressor` averages what an estimator predicts over positions in
the population of raters. There is one row per estimator: the largest error of the
distribution function, over test trials and levels, against 20,000 evenly spaced
positions; the rows predicted per trial; and processor time. Beside it is the error of
20 quadrature nodes alone, which suffice where the prediction is smooth in the position.
"""

import platform
import time
import warnings
from datetime import date
from importlib.metadata import version

import mord
import numpy as np
from scipy.special import logit
from sklearn.base import BaseEstimator, is_regressor
from sklearn.ensemble import (
    HistGradientBoostingClassifier,
    HistGradientBoostingRegressor,
    RandomForestClassifier,
    RandomForestRegressor,
)
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LogisticRegression
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KNeighborsClassifier
from sklearn.neural_network import MLPClassifier
from sklearn.svm import SVC, SVR
from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor

N_ROWS = 20_000
ESTIMATORS = [
    (NNPOM(0), 50),
    (NNPOM(10, random_state=0), 50),
    (mord.LogisticAT(), 50),
    (LogisticRegression(), 50),
    (MLPClassifier(random_state=0), 50),
    (GaussianNB(), 50),
    (mord.LAD(), 50),
    (mord.OrdinalRidge(), 50),
    (SVR(), 5),
    (SVC(), 5),
    (KNeighborsClassifier(), 10),
    (DecisionTreeClassifier(random_state=0), 50),
    (DecisionTreeRegressor(random_state=0), 50),
    (RandomForestClassifier(random_state=0), 20),
    (RandomForestRegressor(random_state=0), 20),
    (HistGradientBoostingClassifier(max_iter=30), 20),
    (HistGradientBoostingRegressor(), 20),
]


class Counted(BaseEstimator):
    """A fitted estimator of rows, which counts them."""

    def __init__(self, estimator):
        self.estimator = estimator
        self.n_rows = 0

    def __getattr__(self, name):
        if name.startswith("__") or name == "estimator":
            raise AttributeError(name)
        found = getattr(self.estimator, name)
        if name not in ("predict", "predict_proba"):
            return found

        def counting(rows):
            self.n_rows += len(rows)
            return found(rows)

        return counting

    def __sklearn_tags__(self):
        return self.estimator.__sklearn_tags__()


def touches(n_objects=60, n_trials=10, n_features=10):
    """Features of touches, and how many of twelve people gave each rating 1 to 5."""
    rng = np.random.default_rng(0)
    objects = np.repeat(np.arange(n_objects), n_trials)
    latent = rng.normal(size=(n_objects, 6))
    X = latent[objects] @ rng.normal(size=(6, n_features)) / 2
    X += rng.normal(size=X.shape)
    people = np.rint(3 + 1.5 * latent[:, :1] + rng.normal(size=(n_objects, 12)))
    people = np.clip(people, 1, 5)
    counts = np.stack([(people == k).sum(axis=1) for k in range(1, 6)], axis=1)
    return X / X.std(axis=0), counts[objects]


def cdf_at(estimator, x, positions, n_levels):
    """Distribution function of one trial at each position, a row each."""
    rows = np.column_stack((np.tile(x, (len(positions), 1)), logit(positions)))
    if hasattr(estimator, "predict_proba"):
        return np.cumsum(estimator.predict_proba(rows), axis=1)
    level = estimator.predict(rows)
    if is_regressor(estimator):
        level = np.clip(np.rint(level), 0, n_levels - 1)
    return (level[:, None] <= np.arange(n_levels)).astype(float)


def population_quadrature(n_nodes):
    """Nodes p and weights of Gauss–Legendre quadrature in q, with p = q² (3 - 2q)."""
    x, weight = np.polynomial.legendre.leggauss(n_nodes)
    q = (x + 1) / 2
    return q**2 * (3 - 2 * q), 3 * q * (1 - q) * weight


def seconds(function, *arguments):
    start = time.process_time()
    result = function(*arguments)
    return time.process_time() - start, result


def decoding():
    print("| estimator | of 20 nodes | mixture | rows | ms | quantile | rows | ms |")
    print("|---|---|---|---|---|---|---|---|")
    X, counts = touches()
    train, n_levels = slice(400), counts.shape[1]
    dense = (np.arange(N_ROWS) + 0.5) / N_ROWS
    nodes, weight = population_quadrature(20)
    for estimator, n_trials in ESTIMATORS:
        test = X[400::4][:n_trials]
        model = DistributionalOrdinalRegressor(
            estimator, sampling="random", random_state=0
        ).fit(X[train], counts[train])
        fitted = model.estimator_
        if not isinstance(fitted, NNPOM):
            model.estimator_ = Counted(fitted)
        exact, few = {"mixture": [], "quantile": []}, []
        for x in test:
            cdf = cdf_at(fitted, x, dense, n_levels)
            exact["mixture"].append(cdf.mean(axis=0))
            exact["quantile"].append((cdf >= 0.5).mean(axis=0))
            few.append(weight @ cdf_at(fitted, x, nodes, n_levels))
        cells = [f"{np.abs(np.array(few) - exact['mixture']).max():.4f}"]
        for decode, expected in exact.items():
            model.set_params(decode=decode)
            if isinstance(model.estimator_, Counted):
                model.estimator_.n_rows = 0
            taken, cdf = seconds(model.predict_cdf, test)
            rows = "–"  # features are shared
            if isinstance(model.estimator_, Counted):
                rows = f"{model.estimator_.n_rows / len(test):.0f}"
            cells.append(f"{np.abs(cdf - expected).max():.4f}")
            cells += [rows, f"{1e3 * taken / len(test):.2f}"]
        name = str(estimator).replace("random_state=0", "").replace(", )", ")")
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


def many_trials():
    print("\n| estimator | 1 trial, ms | 5,000 trials, s | 100,000 trials, s |")
    print("|---|---|---|---|")
    X, counts = touches()
    for estimator in (NNPOM(0), mord.LogisticAT(), mord.LAD(), DecisionTreeRegressor()):
        model = DistributionalOrdinalRegressor(estimator, sampling="random")
        model.fit(X[:400], counts[:400])
        rows = X[np.arange(100_000) % len(X)]
        taken = [seconds(model.predict_proba, rows[:n])[0] for n in (1, 5000, 100_000)]
        print(
            f"| {type(estimator).__name__} | {1e3 * taken[0]:.1f} | {taken[1]:.2f} | "
            f"{taken[2]:.1f} |",
            flush=True,
        )


def main():
    warnings.simplefilter("ignore", ConvergenceWarning)
    warnings.filterwarnings("ignore", "scipy.optimize. The `disp`")
    packages = ("sklearn_haptic", "mord", "scikit-learn", "numpy", "scipy")
    print(f"{platform.processor() or platform.machine()}, {date.today()}, ", end="")
    print(", ".join(f"{name} {version(name)}" for name in packages), end="\n\n")
    decoding()
    many_trials()


if __name__ == "__main__":
    main()
