"""What the benchmarks compare: features of touches, and models of ratings."""

import mord
import numpy as np
import pandas as pd
from data import SENSORS
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.compose import ColumnTransformer
from sklearn.decomposition import PCA
from sklearn.ensemble import HistGradientBoostingRegressor, RandomForestRegressor
from sklearn.kernel_ridge import KernelRidge
from sklearn.linear_model import RidgeClassifierCV
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    RegressedDistribution,
    SignalStatistics,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.metrics import neg_rps_scorer

# Features -----------------------------------------------------------------------------

DEFAULT = "default"  # features, and model
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


def minirocket():
    import numba
    from aeon.transformations.collection.convolution_based import MiniRocket

    numba.set_num_threads(1)
    return MiniRocket(random_state=0)


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
        found["MiniRocket"] = OfAeon(minirocket)
    found = {name: make_pipeline(f, StandardScaler()) for name, f in found.items()}
    return {DEFAULT: make_haptic_pipeline(columns, random_state=0)[:-1]} | found


def with_ridge(features):
    """A classifier of features, the same for all."""
    return make_pipeline(features, RIDGE)


# Models of ratings --------------------------------------------------------------------


def linear(alpha=3.0, **options):
    """The linear model of the ratings."""
    return DistributionalOrdinalRegressor(NNPOM(0, alpha), **options)


def searched(model, **grid):
    """Choose settings by folds of whole objects of the training trials."""
    return GridSearchCV(model, grid, scoring=neg_rps_scorer, cv=GroupKFold(4))


def models(n_features):
    """Name -> a model of ratings, of so many features, and its rivals."""
    alphas = [1, 3, 10, 30, 100, 1000]
    mords = DistributionalOrdinalRegressor(mord.LogisticAT())
    boosting = MultiOutputRegressor(HistGradientBoostingRegressor(random_state=0))
    forest = RandomForestRegressor(
        100, min_samples_leaf=3, max_features=1 / 3, random_state=0
    )
    kernels = {
        "estimator__alpha": [0.1, 0.3, 1, 3, 10],
        "estimator__gamma": np.array([0.3, 1]) / n_features,
    }
    return {
        "marginal": DummyDistribution(),
        "linear": linear(),
        "linear, alpha chosen": searched(linear(), estimator__alpha=alphas),
        "trees": RegressedDistribution(random_state=0),
        "random forest": RegressedDistribution(forest),
        "boosting": RegressedDistribution(boosting),
        "kernel ridge": searched(
            RegressedDistribution(KernelRidge(kernel="rbf")), **kernels
        ),
        "mord LogisticAT": make_pipeline(
            PCA(random_state=0),  # all components, which changes no prediction
            searched(mords, estimator__alpha=10.0 ** np.arange(1, 6)),
        ),
    }
