"""Speed of the ordinal network and of distributions from any estimator.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/networks.py \
        [--parts fit predict decoding] [--quick]

fit       `DistributionalOrdinalRegressor` against skordinal's network on a row for each
          of 480 trials × 15 positions, the same number of iterations. It needs
          ``pip install skordinal``.
predict   `predict_proba` against the same network on materialised rows, 1000 trials ×
          2400 features at 99 positions, and the largest error of the distribution
          function, against 4,000 positions.
decoding  The average over the population of raters that any estimator predicts, and
          that of 20 quadrature nodes: the largest error of the distribution function,
          against 20,000 evenly spaced positions, and the rows predicted per trial.

Five minutes, a part one or two; ``--quick`` one.
"""

import warnings

import mord
import numpy as np
from measure import command, head, machine, row, timed
from scipy.special import logit
from sklearn.base import BaseEstimator, is_regressor
from sklearn.ensemble import (
    HistGradientBoostingClassifier,
    HistGradientBoostingRegressor,
    RandomForestClassifier,
    RandomForestRegressor,
)
from sklearn.linear_model import LogisticRegression
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KNeighborsClassifier
from sklearn.neural_network import MLPClassifier
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC, SVR
from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
from sklearn_haptic.ratings import inverse_cdf


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


def at_positions(X, positions):
    """One row an observation, its position as the last feature."""
    repeated = X.repeat(len(positions), axis=0)
    return np.column_stack((repeated, np.tile(logit(positions), len(X))))


# Beside skordinal ---------------------------------------------------------------------


def fit(quick):
    from skordinal.classifiers import NNPOM as Peer

    n_iter, n_runs = (20, 1) if quick else (200, 3)
    title = f"480 trials × 15 positions, {n_iter} iterations"
    costs = "skordinal, s", "ours, s", "ratio", "ours, cells, s"
    head("features, units", *costs, title=title)
    positions = (np.arange(15) + 0.5) / 15
    for n_features, n_hidden in ((310, 10), (1240, 30), (4340, 30))[
        : 1 if quick else 3
    ]:
        X, counts = touches(48, 10, n_features)
        level = inverse_cdf(counts, positions).ravel() - 1
        rows = at_positions(X, positions)
        network = NNPOM(n_hidden, max_iter=n_iter, tol=0, random_state=0)
        peer = Peer(n_hidden=n_hidden, alpha=1.0, max_iter=n_iter, random_state=0)
        times = []
        for _ in range(n_runs):
            taken = [timed(peer.fit, rows, level)[0] / peer.n_iter_ * n_iter]
            for sampling in ("random", "level"):
                model = DistributionalOrdinalRegressor(network, sampling=sampling)
                seconds, _ = timed(model.fit, X, counts)
                taken.append(seconds / model.estimator_.n_iter_ * n_iter)
            times.append(taken)
        theirs, ours, nodes = np.median(times, axis=0)
        cells = f"{theirs:.2f}", f"{ours:.2f}", f"{theirs / ours:.1f}", f"{nodes:.2f}"
        row(f"{n_features}, {n_hidden}", *cells)


def predict(quick):
    head(
        "units", "99 rows per trial, ms", "ours, ms", "ratio", "CDF error",
        "of the 99 positions", title="predict_proba, 1000 trials × 2400 features",
    )  # fmt: skip
    X, counts = touches(100, 10, 240 if quick else 2400)
    grid, dense = np.arange(1, 100) / 100, (np.arange(4000) + 0.5) / 4000
    rows, few = at_positions(X, grid), X[::100]

    def mean_cdf(model, positions):
        proba = model.estimator_.predict_proba(at_positions(few, positions))
        return np.cumsum(proba, axis=1).reshape(len(few), len(positions), -1).mean(1)

    for n_hidden in (0, 10, 30):
        network = NNPOM(n_hidden, max_iter=50, random_state=0)
        model = DistributionalOrdinalRegressor(network).fit(X, counts)
        times = []
        for _ in range(1 if quick else 7):
            theirs, _ = timed(model.estimator_.predict_proba, rows)
            times.append((theirs, timed(model.predict_proba, X)[0]))
        theirs, ours = 1e3 * np.median(times, axis=0)
        exact = mean_cdf(model, dense)
        errors = [
            f"{np.abs(cdf - exact).max():.1e}"
            for cdf in (model.predict_cdf(few), mean_cdf(model, grid))
        ]
        costs = f"{theirs:.0f}", f"{ours:.1f}", f"{theirs / ours:.0f}"
        row(n_hidden, *costs, *errors)


# Any estimator ------------------------------------------------------------------------

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


def cdf_at(estimator, x, positions, n_levels):
    """Distribution function of one trial at each position, a row each."""
    rows = at_positions(x[None], positions)
    if hasattr(estimator, "predict_proba"):
        return np.cumsum(estimator.predict_proba(rows), axis=1)
    level = estimator.predict(rows)[:, None]
    if is_regressor(estimator):  # halfway between two levels, half of each
        level = np.clip(level, 0, n_levels - 1)
        level = np.hstack((np.ceil(level - 0.5), np.floor(level + 0.5)))
    return (level[:, :, None] <= np.arange(n_levels)).mean(axis=1)


def decoding(quick):
    head("estimator", "error of 20 nodes", "error here", "rows per trial", "ms")
    X, counts = touches(60, 10, 10)
    n_dense, n_levels = (2000 if quick else 20_000), counts.shape[1]
    dense = (np.arange(n_dense) + 0.5) / n_dense
    x, weight = np.polynomial.legendre.leggauss(20)
    q = (x + 1) / 2  # nodes in q, with p = q² (3 - 2q)
    nodes, weight = q**2 * (3 - 2 * q), 3 * q * (1 - q) * weight
    for estimator, n_trials in ESTIMATORS[:: 5 if quick else 1]:
        test = X[400::4][:n_trials]
        model = DistributionalOrdinalRegressor(
            estimator, sampling="random", random_state=0
        ).fit(X[:400], counts[:400])
        fitted = model.estimator_
        exact, few = [], []
        for x in test:
            exact.append(cdf_at(fitted, x, dense, n_levels).mean(axis=0))
            few.append(weight @ cdf_at(fitted, x, nodes, n_levels))
        if not isinstance(fitted, NNPOM):  # which shares features
            model.estimator_ = Counted(fitted)
        taken, cdf = timed(model.predict_cdf, test)
        n_rows = getattr(model.estimator_, "n_rows", np.nan) / len(test)
        errors = [f"{np.abs(each - np.array(exact)).max():.4f}" for each in (few, cdf)]
        cells = *errors, f"{n_rows:.0f}", f"{1e3 * taken / len(test):.2f}"
        name = str(estimator).replace("random_state=0", "").replace(", )", ")")
        row(name, *cells)


PARTS = {"fit": fit, "predict": predict, "decoding": decoding}


def main():
    parser = command(__doc__)
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # of few iterations and of mord
    machine("skordinal", "mord")
    for part in arguments.parts:
        PARTS[part](arguments.quick)


if __name__ == "__main__":
    main()
