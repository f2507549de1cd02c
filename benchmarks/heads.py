"""What the benchmarks compare: features of touches, and models of ratings."""

from functools import partial

import mord
import numpy as np
import pandas as pd
from data import SENSORS
from scipy.optimize import minimize
from scipy.special import expit, log_expit
from sklearn.base import BaseEstimator, ClassifierMixin, TransformerMixin, clone
from sklearn.compose import ColumnTransformer
from sklearn.decomposition import PCA
from sklearn.ensemble import ExtraTreesRegressor, RandomForestRegressor
from sklearn.kernel_ridge import KernelRidge
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    DummyDistribution,
    RegressedDistribution,
    SignalStatistics,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.metrics import neg_macro_mae_scorer, neg_rps_scorer

# Features -----------------------------------------------------------------------------

PRESETS = "presets"  # the features of both presets
LEVELS = "mean", "std", "max", "min", "slope", "change"
RIDGE = RidgeClassifierCV(np.logspace(-1, 5, 13))


def maxima(sensors=SENSORS):
    """Maxima of codes, as in the paper, over dictionaries of five iterations."""
    parts = []
    for sensor in sensors:
        features = make_haptic_pipeline([sensor], random_state=0)[0]
        coder = features.transformers[0][1]["codes"][0]
        coder.set_params(max_iter=5)
        parts.append((sensor, make_pipeline(coder, TemporalMaxPool((4, 2, 1))), sensor))
    return ColumnTransformer(parts)


def of_frames(touch):
    """All sensors at the 100 Hz of the slow ones; vibration has 22 channels then."""
    n_frames = min([len(touch["pac"]) // 22, *(len(touch[s]) for s in SENSORS[1:])])
    vibration = touch["pac"][: 22 * n_frames].reshape(n_frames, -1)
    return np.hstack([vibration] + [touch[s][:n_frames] for s in SENSORS[1:]])


class OfAeon(TransformerMixin, BaseEstimator):
    """A transformer of aeon, which takes trials of one length.

    Trials of one sensor, or a table of five, are cut to the shortest that was fitted,
    or all of them are stretched to the median length.
    """

    def __init__(self, make, stretch=False):
        self.make = make
        self.stretch = stretch

    def fit(self, trials, y=None):
        trials = self._arrays(trials)
        lengths = [len(trial) for trial in trials]
        self.n_times_ = int(np.median(lengths)) if self.stretch else min(lengths)
        self.transformer_ = self.make()
        self.transformer_.fit(self._of_equal_length(trials))
        return self

    def transform(self, trials):
        X = self._of_equal_length(self._arrays(trials))
        return np.nan_to_num(np.asarray(self.transformer_.transform(X), dtype=float))

    def _arrays(self, trials):
        if isinstance(trials, pd.DataFrame):
            return [of_frames(touch) for _, touch in trials[SENSORS].iterrows()]
        return list(trials)

    def _of_equal_length(self, trials):
        return np.stack([self._cut(trial) for trial in trials]).astype(float)

    def _cut(self, trial):
        if self.stretch:
            at = np.linspace(0, len(trial) - 1, self.n_times_)
            places = np.arange(len(trial))
            return np.array([np.interp(at, places, channel) for channel in trial.T])
        missing = max(0, self.n_times_ - len(trial))
        return np.pad(trial[: self.n_times_], ((0, missing), (0, 0)), mode="edge").T


def minirocket(n_kernels=10_000):
    import numba
    from aeon.transformations.collection.convolution_based import MiniRocket

    numba.set_num_threads(1)
    return MiniRocket(n_kernels, random_state=0)


def catch22():
    from aeon.transformations.collection.feature_based import Catch22

    return Catch22(replace_nans=True)


def of_sensors(columns, make):
    """Features of each sensor, side by side."""
    return ColumnTransformer([(c, make(c.rsplit("_", 1)[-1]), c) for c in columns])


def statistics(sensor, *names, cells=(1,)):
    return SignalStatistics(names, n_bands=32 if sensor == "pac" else 16, cells=cells)


def families(columns=SENSORS):
    """Features by name, standardised; only some of several procedures side by side."""
    found = {
        "maxima": maxima(columns),
        "statistics": of_sensors(columns, lambda s: statistics(s, *LEVELS)),
        "bands": of_sensors(columns, lambda s: statistics(s, "bands", cells=(4, 2, 1))),
    }
    if set(columns) == set(SENSORS):
        own_rates = partial(minirocket, 2_000)
        found["MiniRocket"] = OfAeon(minirocket)
        found["MiniRocket, own rates"] = of_sensors(
            columns, lambda s: OfAeon(own_rates)
        )
        found["Catch22"] = OfAeon(catch22)
    found = {name: make_pipeline(f, StandardScaler()) for name, f in found.items()}
    return {PRESETS: make_haptic_pipeline(columns, random_state=0)[:-1]} | found


def with_ridge(features):
    """A classifier of features, the same for all."""
    return make_pipeline(features, StandardScaler(), RIDGE)


# Rivals among models ------------------------------------------------------------------


class OfShares(ClassifierMixin, BaseEstimator):
    """A model of the shares of each level; the levels are 1, 2, …"""

    def fit(self, X, y):
        self.levels_ = self.classes_ = np.arange(1, y.shape[1] + 1)
        return self.fit_shares(X, y / y.sum(axis=1, keepdims=True))


class OnRepeatedRows(OfShares):
    """A classifier of single ratings, given a row per level of a trial."""

    def __init__(self, estimator):
        self.estimator = estimator

    def fit_shares(self, X, shares):
        trial, level = np.nonzero(shares)
        weight = shares[trial, level]
        self.estimator_ = clone(self.estimator).fit(X[trial], level, weight)
        return self

    def predict_proba(self, X):
        proba = np.zeros((len(X), len(self.levels_)))
        proba[:, self.estimator_.classes_] = self.estimator_.predict_proba(X)
        return proba


class QuantileForest(OfShares):
    """Meinshausen's forest: grown for the mean rating, its leaves keep distributions.

    This is what `quantile_forest.RandomForestQuantileRegressor` estimates, here from
    counts: a new trial gets the mean over trees of the mean shares of its leaf.
    """

    def fit_shares(self, X, shares):
        self.forest_ = RandomForestRegressor(
            100, min_samples_leaf=3, max_features=1 / 3, random_state=0
        ).fit(X, shares @ self.levels_)
        self.shares_ = []
        for leaf in self.forest_.apply(X).T:
            total = np.stack([np.bincount(leaf, s) for s in shares.T], axis=1)
            self.shares_.append(total / np.maximum(np.bincount(leaf)[:, None], 1))
        return self

    def predict_proba(self, X):
        leaves = self.forest_.apply(X).T
        return np.mean([s[leaf] for s, leaf in zip(self.shares_, leaves)], axis=0)


class Ordered(OfShares):
    """statsmodels' OrderedModel of the first principal components of the features."""

    def __init__(self, n_components=3):
        self.n_components = n_components

    def fit_shares(self, X, shares):
        from statsmodels.miscmodels.ordinal_model import OrderedModel

        self.pca_ = make_pipeline(PCA(self.n_components), StandardScaler()).fit(X)
        people = np.rint(12 * shares).astype(int)
        trial, level = np.nonzero(people)
        rows = np.repeat(np.arange(len(trial)), people[trial, level])
        self.present_ = np.unique(level)
        rating = np.searchsorted(self.present_, level[rows])
        model = OrderedModel(rating, self.pca_.transform(X)[trial[rows]], distr="logit")
        self.result_ = model.fit(method="bfgs", disp=False)
        return self

    def predict_proba(self, X):
        proba = np.zeros((len(X), len(self.levels_)))
        proba[:, self.present_] = self.result_.predict(self.pca_.transform(X))
        return proba


class LocationScale(OfShares):
    """P(y <= k) = sigma((b_k - f(x)) exp(-s(x))) with linear f and s.

    Penalties are of features divided by the root of their total variance, as those of
    `NNPOM` are.
    """

    def __init__(self, alpha=0.2, scale_alpha=2.0):
        self.alpha = alpha
        self.scale_alpha = scale_alpha

    def fit_shares(self, X, shares):
        self.mean_, self.unit_ = X.mean(axis=0), np.sqrt(X.var(axis=0).sum())
        below = np.clip(np.cumsum(shares.mean(axis=0))[:-1], 1e-3, 1 - 1e-3)
        start = np.log(below / (1 - below))
        gaps = np.log(np.maximum(np.diff(start), 1e-2))
        self.params_ = minimize(
            self._loss,
            np.concatenate((start[:1], gaps, np.zeros(2 * X.shape[1]))),
            ((X - self.mean_) / self.unit_, shares),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": 300, "maxcor": 30, "gtol": 1e-4 * len(X)},
        ).x
        return self

    def _parts(self, params, X):
        first, log_gaps, f, s = np.split(
            params, [1, len(self.levels_) - 1, len(self.levels_) - 1 + X.shape[1]]
        )
        gaps, shrink = np.exp(log_gaps), np.exp(-(X @ s))[:, None]
        thresholds = np.cumsum(np.concatenate((first, gaps)))
        return gaps, f, s, shrink, (thresholds - (X @ f)[:, None]) * shrink

    def _loss(self, params, X, shares):
        gaps, f, s, shrink, z = self._parts(params, X)
        # log(sigma(b) - sigma(a)) = log sigma(b) + log sigma(-a) + log(1 - exp(a - b))
        width = np.diff(z, axis=1)
        log_p = np.zeros_like(shares)
        log_p[:, :-1] += log_expit(z)
        log_p[:, 1:] += log_expit(-z)
        log_p[:, 1:-1] += np.log(-np.expm1(-width))
        loss = -np.sum(shares * log_p)
        g_z = -shares[:, :-1] * expit(-z) + shares[:, 1:] * expit(z)
        g_width = -shares[:, 1:-1] / np.expm1(width)
        g_z[:, 1:] += g_width
        g_z[:, :-1] -= g_width
        later = np.cumsum((g_z * shrink).sum(axis=0)[::-1])[::-1]
        g_f = -X.T @ (g_z * shrink).sum(axis=1) + self.alpha * f
        g_s = -X.T @ (g_z * z).sum(axis=1) + self.scale_alpha * s
        loss += 0.5 * self.alpha * (f @ f) + 0.5 * self.scale_alpha * (s @ s)
        return loss, np.concatenate((later[:1], later[1:] * gaps, g_f, g_s))

    def predict_proba(self, X):
        *_, z = self._parts(self.params_, (X - self.mean_) / self.unit_)
        return np.diff(expit(z), axis=1, prepend=0, append=1)


# Models of ratings --------------------------------------------------------------------


def linear(alpha=3.0, **options):
    """The linear model of the ratings."""
    return DistributionalOrdinalRegressor(NNPOM(0, alpha), **options)


def searched(model, scoring=neg_rps_scorer, **grid):
    """Choose settings by folds of whole objects of the training trials."""
    return GridSearchCV(model, grid, scoring=scoring, cv=GroupKFold(4))


def models(n_features):
    """Name -> a model, and whether it is given principal components, all of them."""
    trees = ExtraTreesRegressor(
        100, min_samples_leaf=3, max_features="sqrt", random_state=0
    )
    trees = RegressedDistribution(trees)
    kernel = RegressedDistribution(KernelRidge(kernel="rbf", gamma=1 / n_features))
    multinomial = OnRepeatedRows(LogisticRegression(max_iter=300))
    mords = DistributionalOrdinalRegressor(mord.LogisticAT())
    hidden = DistributionalOrdinalRegressor(NNPOM(10), random_state=0)
    paper = DistributionalOrdinalRegressor(**PAPER_2020, random_state=0)
    paper.set_fit_request(groups=True)  # it stops early on whole objects
    alphas = [1, 3, 10, 30, 100, 1000]
    sharp = linear(decode="quantile")
    pair = [("linear", linear()), ("trees", trees)]
    gammas = np.array([0.3, 1]) / n_features
    return {
        "marginal": (DummyDistribution(), True),
        "barycentre": (DummyDistribution("barycentre"), True),
        "linear, alpha chosen": (searched(linear(), estimator__alpha=alphas), True),
        "the same, quantile decoding": (searched(sharp, estimator__alpha=alphas), True),
        "counts, no p": (searched(NNPOM(0), alpha=[0.1, 0.3, *alphas[:-1]]), True),
        "ten hidden units": (searched(hidden, estimator__alpha=alphas[:-1]), True),
        "paper's settings": (
            searched(
                paper,
                neg_macro_mae_scorer,
                estimator__n_hidden=[1, 10, 30],
                estimator__alpha=[0.01, 0.1, 1, 10],
            ),
            True,
        ),
        "location and scale": (searched(LocationScale(), alpha=[0.1, 0.3, 1, 5]), True),
        "multinomial on counts": (
            searched(multinomial, estimator__C=[1e-4, 1e-3, 1e-2, 0.1]),
            True,
        ),
        "kernel ridge": (
            searched(
                kernel, estimator__alpha=[0.1, 0.3, 1, 3, 10], estimator__gamma=gammas
            ),
            True,
        ),
        "mord LogisticAT": (
            searched(mords, estimator__alpha=10.0 ** np.arange(1, 6)),
            True,
        ),
        "statsmodels OrderedModel": (searched(Ordered(), n_components=[1, 3]), True),
        "quantile forest": (QuantileForest(), False),
        "trees": (trees, False),
        "blend, equal": (DistributionBlend(pair, weights="equal"), False),
        "blend": (DistributionBlend(pair), False),
    }


def needs_groups(model):
    """Whether a model's fit has to know which trials share an object."""
    return hasattr(model, "cv")
