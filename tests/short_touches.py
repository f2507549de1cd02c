"""Touches of two sensors at two rates, and models of their prefixes."""

import numpy as np
import pandas as pd
from sklearn.compose import ColumnTransformer
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    AnytimeRegressor,
    DistributionalOrdinalRegressor,
    KSVDTransformer,
    TemporalMaxPool,
)

RATES = {"fast": 40.0, "slow": 10.0}
DURATIONS = [0.5, 1.0, 2.0]
N_OBJECTS, N_TRIALS = 8, 3
OBJECTS = np.repeat(np.arange(N_OBJECTS), N_TRIALS)


def make_touches(seed=0, seconds=(2, 3)):
    """Two sensors at two rates; objects differ in loudness, which grows in time."""
    rng = np.random.default_rng(seed)
    touches = {sensor: [] for sensor in RATES}
    for loudness in np.repeat(np.linspace(0.5, 2, N_OBJECTS), N_TRIALS):
        length = rng.uniform(*seconds)
        for sensor, rate in RATES.items():
            n_times = int(length * rate)
            growth = 1 + np.arange(n_times)[:, None] / n_times
            touches[sensor].append(
                loudness * growth * rng.normal(size=(n_times, 2)) + loudness
            )
    return pd.DataFrame(
        {s: pd.Series(each, dtype=object) for s, each in touches.items()}
    )


def make_counts(seed=0):
    rng = np.random.default_rng(seed)
    chance = np.column_stack([np.linspace(0.8, 0.1, N_OBJECTS)] * 1)
    counts = rng.multinomial(
        10, np.hstack([chance, (1 - chance) / 2, (1 - chance) / 2])
    )
    return counts[OBJECTS]


TOUCHES, COUNTS = make_touches(), make_counts()


def statistics(trials):
    trials = trials.iloc[:, 0] if hasattr(trials, "columns") else trials
    return np.array([[each.mean(), each.std(), np.ptp(each)] for each in trials])


def coded(sensor):
    window = {"fast": 16, "slow": 8}[sensor]
    coder = KSVDTransformer(
        3, 2, window=window, max_iter=2, remove_mean=False, random_state=0
    )
    return make_pipeline(coder, TemporalMaxPool((2, 1)))


def features(make=coded):
    return ColumnTransformer([(sensor, make(sensor), sensor) for sensor in RATES])


HEAD = DistributionalOrdinalRegressor(NNPOM(0))


def make_model(estimator=None, **params):
    if estimator is None:
        estimator = make_pipeline(features(), StandardScaler(), HEAD)
    settings = {"durations": DURATIONS, "sampling_rates": RATES, "cv": 4, **params}
    return AnytimeRegressor(estimator, **settings)


def cut(touches, seconds):
    return pd.DataFrame(
        {
            s: touches[s].map(lambda x, n=int(seconds * r): x[:n])
            for s, r in RATES.items()
        }
    )
