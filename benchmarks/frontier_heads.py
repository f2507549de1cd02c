"""Models of the same features: this package's default beside blends and rivals.

    python benchmarks/frontier_heads.py FOLDER [--sets phac2 films …]
        [--adjectives hard rough …] [--models trees blend …]

needs ``pip install statsmodels`` for one of the rivals, which is left out otherwise.
FOLDER holds the sets that `real_ratings.py` and `speed_accuracy.py`
read, and ``wine_ratings/ordinal_wine.csv``.

Five folds of whole objects (bolt and wine: one object left out), the same for all
models. A model that has a penalty chooses it inside each training fold, by folds of
whole objects and the ranked probability score (RPS). The table has the mean over
objects of the RPS, its difference to the default ± the paired standard error over
objects, the log score (probabilities below 1e-3 count as 1e-3), the dispersion, and
processor seconds of all folds.

The rule that learns the weights of a blend and the settings of the trees were chosen on
hold0, slow0 and bolt; all other sets only report.
"""

import argparse
import time
import warnings
from pathlib import Path

import mord
import numpy as np
import pandas as pd
from location_scale import LocationScale
from real_ratings import movie, phac2
from sklearn import set_config
from sklearn.base import BaseEstimator, clone
from sklearn.decomposition import PCA
from sklearn.ensemble import ExtraTreesRegressor, RandomForestRegressor
from sklearn.kernel_ridge import KernelRidge
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, GroupKFold, LeaveOneGroupOut
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from speed_accuracy_data import bolt

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    DummyDistribution,
    RegressedDistribution,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import (
    dispersion,
    log_score,
    neg_rps_scorer,
    ranked_probability_score,
)
from sklearn_haptic.models._ordinal import OrdinalClassifierMixin

try:
    from statsmodels.miscmodels.ordinal_model import OrderedModel
except ImportError:
    OrderedModel = None

# Rivals ---------------------------------------------------------------------


class OnRepeatedRows(OrdinalClassifierMixin, BaseEstimator):
    """A classifier of single ratings, given a row per level of a trial."""

    def __init__(self, estimator):
        self.estimator = estimator

    def fit(self, X, y):
        self.levels_ = self.classes_ = np.arange(1, y.shape[1] + 1)
        trial, level = np.nonzero(y)
        weight = (y / y.sum(axis=1, keepdims=True))[trial, level]
        self.estimator_ = clone(self.estimator).fit(X[trial], level, weight)
        return self

    def predict_proba(self, X):
        proba = np.zeros((len(X), len(self.levels_)))
        proba[:, self.estimator_.classes_] = self.estimator_.predict_proba(X)
        return proba


class QuantileForest(OrdinalClassifierMixin, BaseEstimator):
    """Meinshausen's forest: grown for the mean rating, its leaves keep distributions.

    This is what `quantile_forest.RandomForestQuantileRegressor` estimates, here from
    counts: a new trial gets the mean over trees of the mean shares of its leaf.
    """

    def fit(self, X, y):
        self.levels_ = self.classes_ = np.arange(1, y.shape[1] + 1)
        share = y / y.sum(axis=1, keepdims=True)
        self.forest_ = RandomForestRegressor(
            100, min_samples_leaf=3, max_features=1 / 3, random_state=0
        ).fit(X, share @ self.levels_)
        self.shares_ = []
        for leaf in self.forest_.apply(X).T:
            total = np.stack([np.bincount(leaf, s) for s in share.T], axis=1)
            n_trials = np.bincount(leaf)[:, None]
            self.shares_.append(total / np.maximum(n_trials, 1))
        return self

    def predict_proba(self, X):
        leaves = self.forest_.apply(X).T
        found = [share[leaf] for share, leaf in zip(self.shares_, leaves)]
        return np.mean(found, axis=0)


class Ordered(OrdinalClassifierMixin, BaseEstimator):
    """statsmodels' OrderedModel of the first principal components of the features."""

    def __init__(self, n_components=3):
        self.n_components = n_components

    def fit(self, X, y):
        self.levels_ = self.classes_ = np.arange(1, y.shape[1] + 1)
        self.pca_ = make_pipeline(PCA(self.n_components), StandardScaler()).fit(X)
        people = np.rint(12 * y / y.sum(axis=1, keepdims=True)).astype(int)
        trial, level = np.nonzero(people)
        rows = np.repeat(np.arange(len(trial)), people[trial, level])
        self.present_ = np.unique(level)
        rating = np.searchsorted(self.present_, level[rows])
        model = OrderedModel(rating, self.pca_.transform(X)[trial[rows]], distr="logit")
        self.result_ = model.fit(method="bfgs", disp=False)
        return self

    def predict_proba(self, X):
        proba = np.zeros((len(X), len(self.levels_)))
        predicted = self.result_.predict(self.pca_.transform(X))
        proba[:, self.present_] = predicted
        return proba


def searched(model, **grid):
    return GridSearchCV(model, grid, scoring=neg_rps_scorer, cv=GroupKFold(4))


def models(n_features):
    """Each model, and whether it is given principal components, which lose nothing."""
    linear = DistributionalOrdinalRegressor(NNPOM(0, alpha=3.0))
    trees = RegressedDistribution(
        ExtraTreesRegressor(
            100, min_samples_leaf=3, max_features="sqrt", random_state=0
        )
    )
    kernel = RegressedDistribution(KernelRidge(kernel="rbf", gamma=1 / n_features))
    pair = [("linear", linear), ("trees", trees)]
    multinomial = OnRepeatedRows(LogisticRegression(max_iter=300))
    threshold = DistributionalOrdinalRegressor(mord.LogisticAT())
    found = {
        "marginal": (DummyDistribution(), True),
        "default: linear, alpha=3": (linear, True),
        "linear, alpha chosen": (
            searched(linear, estimator__alpha=[1, 3, 10, 30, 100, 1000]),
            True,
        ),
        "location and scale": (searched(LocationScale(), alpha=[0.1, 0.3, 1, 5]), True),
        "multinomial on counts": (
            searched(multinomial, estimator__C=[1e-4, 1e-3, 1e-2, 0.1]),
            True,
        ),
        "kernel ridge": (
            searched(
                kernel,
                estimator__alpha=[0.1, 0.3, 1, 3, 10],
                estimator__gamma=np.array([0.3, 1]) / n_features,
            ),
            True,
        ),
        "mord LogisticAT": (
            searched(threshold, estimator__alpha=10.0 ** np.arange(1, 6)),
            True,
        ),
        "quantile forest": (QuantileForest(), False),
        "trees": (trees, False),
        "blend, equal": (DistributionBlend(pair, weights="equal"), False),
        "blend": (DistributionBlend(pair), False),
    }
    if OrderedModel is not None:
        found["statsmodels OrderedModel"] = searched(Ordered(), n_components=[1, 3]), 1
    return found


# Sets -----------------------------------------------------------------------


def folds_of(X, groups, n_splits=5):
    splitter = GroupKFold(n_splits, shuffle=True, random_state=0)
    return list(splitter.split(X, groups=groups))


def tables(X, groups, folds, features):
    """Training and test trials of each fold, and their features."""
    at = X.iloc if hasattr(X, "iloc") else X
    for train, test in folds:
        fitted = clone(features)
        A = fitted.fit_transform(at[train])
        yield train, test, A, fitted.transform(at[test])


def touches(procedure, seed, _):
    corpus = make_haptic_corpus(40, 5, procedure=procedure, random_state=seed)
    folds = folds_of(corpus.trials, corpus.objects)
    features = make_haptic_pipeline(preset="fast", random_state=0)[:2]
    found = list(tables(corpus.trials, corpus.objects, folds, features))
    return corpus.ratings, corpus.objects, found


def grips(folder):
    data = bolt(folder)
    y = np.equal.outer(data.targets["force"], data.levels).astype(float)
    folds = list(LeaveOneGroupOut().split(y, groups=data.groups))
    features = make_haptic_pipeline(preset="fast", random_state=0)[:2]
    found = list(tables(data.trials, data.groups, folds, features))
    return {"force": y}, data.groups, found


def films(part, folder, n_films=1500):
    """Films drawn at random, the first or the second part of them."""
    X, y, _, scale, _ = movie(folder)
    drawn = np.random.default_rng(0).permutation(len(X))
    drawn = drawn[part * n_films : (part + 1) * n_films]
    groups = np.arange(n_films)
    found = list(tables(X[drawn], groups, folds_of(drawn, groups), scale))
    return {"stars": y[drawn]}, groups, found


def properties(folder):
    X, y, groups, scale, levels = phac2(folder)
    y = np.equal.outer(y, levels).astype(float)
    return {"hardness": y}, groups, list(tables(X, groups, folds_of(X, groups), scale))


def wine(folder):
    """Eight bottles tasted by nine judges, known by temperature and contact."""
    table = pd.read_csv(folder / "wine_ratings" / "ordinal_wine.csv")
    keys = ["temp", "contact", "bottle"]
    rating = "rating"
    bottles = table.groupby(keys)[rating].value_counts().unstack(fill_value=0)
    X = pd.get_dummies(bottles.index.to_frame()[keys[:2]], drop_first=True)
    groups = np.arange(len(bottles))
    folds = list(LeaveOneGroupOut().split(X, groups=groups))
    found = tables(X.to_numpy(float), groups, folds, StandardScaler())
    return {"bitterness": bottles.to_numpy(float)}, groups, list(found)


SETS = {
    "phac2": properties,
    "films": lambda folder: films(0, folder),
    "films2": lambda folder: films(1, folder),
    "wine": wine,
    "bolt": grips,
} | {
    f"{name}{seed}": lambda folder, p=procedure, s=seed: touches(p, s, folder)
    for seed in (0, 1)
    for name, procedure in (("hold", "hold"), ("slow", "slow_slide"))
}


# Table ----------------------------------------------------------------------


def of_objects(scores, groups):
    _, which = np.unique(groups, return_inverse=True)
    return np.bincount(which, scores) / np.bincount(which)


def predict(model, rotated, y, groups, tables):
    proba = np.zeros(y.shape)
    for train, test, A, B in tables:
        if rotated:
            rotation = PCA(random_state=0).fit(A)
            A, B = rotation.transform(A), rotation.transform(B)
        fit_params = {"groups": groups[train]} if hasattr(model, "cv") else {}
        proba[test] = clone(model).fit(A, y[train], **fit_params).predict_proba(B)
    return proba


def evaluate(model, rotated, targets, groups, tables):
    """RPS and log score of each object, averaged over targets, and the dispersion."""
    rps, log, spread = [], [], []
    for target in targets.values():
        y = np.asarray(target, dtype=float)
        proba = predict(model, rotated, y, groups, tables)
        rps.append(
            of_objects(ranked_probability_score(y, proba, average=False), groups)
        )
        floor = np.maximum(proba, 1e-3)
        floor /= floor.sum(axis=1, keepdims=True)
        log.append(of_objects(log_score(y, floor, average=False), groups))
        spread.append(dispersion(y, proba))
    return np.array(rps), np.mean(log), np.mean(spread)


def table(name, targets, groups, tables, only):
    print(f"\n{name}: {len(groups)} trials, {len(np.unique(groups))} objects", end=", ")
    print(f"{tables[0][2].shape[1]} features; {', '.join(targets)}\n")
    print("| model | RPS | to the default | log score | dispersion | s |")
    print("|---|---|---|---|---|---|")
    found = models(tables[0][2].shape[1])
    base = None
    found = {(k := "default: linear, alpha=3"): found.pop(k)} | found
    for label, (model, rotated) in found.items():
        if only and base is not None and label not in only:
            continue
        start = time.process_time()
        try:
            rps, log, spread = evaluate(model, rotated, targets, groups, tables)
        except Exception as error:  # a rival that cannot do this set
            print(
                f"| {label} | {type(error).__name__}: {str(error)[:60]} |", flush=True
            )
            continue
        base = rps if base is None else base
        gain = np.mean(rps - base, axis=0)
        error = gain.std(ddof=1) / np.sqrt(len(gain))
        seconds = time.process_time() - start
        print(
            f"| {label} | {rps.mean():.4f} | {gain.mean():+.4f} ± {error:.4f} | "
            f"{log:.3f} | {spread:.2f} | {seconds:.0f} |",
            flush=True,
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", nargs="+", default=list(SETS), choices=SETS)
    parser.add_argument("--adjectives", nargs="+")
    parser.add_argument("--models", nargs="+", help="beside the default")
    arguments = parser.parse_args()
    set_config(enable_metadata_routing=True)
    warnings.simplefilter("ignore")  # of mord, statsmodels and few iterations
    for name in arguments.sets:
        targets, groups, tables = SETS[name](arguments.folder)
        if arguments.adjectives:
            targets = {a: y for a, y in targets.items() if a in arguments.adjectives}
        table(name, targets, np.asarray(groups), tables, arguments.models)


if __name__ == "__main__":
    main()
