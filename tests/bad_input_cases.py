"""Bad input as data: what is called, what is wrong, and what has to be said about it.

`CASES` is the whole table. Each case makes its call when it is asked to, in a folder
of its own.
"""

import re
from collections.abc import Callable
from datetime import date
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import pandas as pd
from scipy import sparse
from scipy.io import savemat
from sklearn.compose import make_column_transformer
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import RepeatedKFold
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    KSVDTransformer,
    SensorFusionNNPOM,
    STHMPTransformer,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import load_phac2, make_haptic_corpus
from sklearn_haptic.metrics import (
    dispersion,
    earth_movers_distance,
    log_score,
    macro_mae,
    neg_macro_mae_scorer,
    neg_rps_scorer,
    pit_histogram,
    ranked_probability_score,
)
from sklearn_haptic.model_selection import (
    cheapest_within_one_se,
    contribution_summary,
    cross_val_predict_proba,
    neg_seconds_scorer,
    sensor_contributions,
    sensor_subsets,
    speed_accuracy_frontier,
)
from sklearn_haptic.plotting import (
    AdjectiveCorrelationDisplay,
    AtomsDisplay,
    DistributionDisplay,
    FeatureMapDisplay,
    InterraterAgreementDisplay,
    InverseCDFDisplay,
    PITHistogramDisplay,
    RatingsDisplay,
    ReliabilityDisplay,
    SensorContributionsDisplay,
    SignalsDisplay,
    SpeedAccuracyDisplay,
)
from sklearn_haptic.ratings import (
    adjective_correlation,
    interrater_agreement,
    inverse_cdf,
    rating_cdf,
    rating_counts,
    rating_distribution,
)
from sklearn_haptic.study import read_study, run_study


class Call(NamedTuple):
    """A function and what it is given."""

    function: Callable
    args: tuple
    kwargs: dict


class Case(NamedTuple):
    """A row of the table."""

    called: str
    given: str
    error: type
    message: str
    make: Callable[[Path], Call]


def call(function, *args, **kwargs):
    return Call(function, args, kwargs)


def cases(called, *rows):
    """Cases of one function: rows of given, error, message and, last, the call."""
    return [
        Case(called, given, error, message, make)
        for given, error, message, make in rows
    ]


# Good input, from which the bad is made

N = 12
X = np.random.default_rng(0).normal(size=(N, 4))
NAMES = ["pac__0", "pac__1", "tdc__0", "tdc__1"]
TABLE = pd.DataFrame(X, columns=NAMES)
COUNTS = np.random.default_rng(1).integers(1, 9, size=(N, 3))
LABELS = np.tile([1, 2, 3], N // 3)
PROBA = np.full((N, 3), 1 / 3)
OBJECTS = np.repeat(np.arange(N // 2), 2)
TRIALS = [np.random.default_rng(i).normal(size=(8 + i, 19)) for i in range(4)]
SENSORS = {"pac": [0, 1], "tdc": [2, 3]}


def replaced(values, value, index=(1, 0), dtype=None):
    """Copy of an array or a list of arrays with one entry replaced."""
    if isinstance(values, list):
        return [values[0], replaced(values[1], value, index, dtype), *values[2:]]
    values = np.array(values, dtype=dtype or np.result_type(values, type(value)))
    values[index] = value
    return values


def masked(values):
    mask = np.zeros(np.shape(values), dtype=bool)
    mask.flat[-1] = True
    return np.ma.MaskedArray(values, mask)


def text(values):
    return np.asarray(values).astype(str)


def dates(values):
    return np.asarray(values).astype("M8[D]")


# Tables of features, for every estimator that takes them

LABELLED = {
    "NNPOM": partial(NNPOM, n_hidden=0),
    "DistributionalOrdinalRegressor": DistributionalOrdinalRegressor,
    "SensorFusionNNPOM": partial(SensorFusionNNPOM, SENSORS),
}
CODERS = {
    "KSVDTransformer": partial(KSVDTransformer, 3, max_iter=1, n_nonzero_coefs=1),
    "STHMPTransformer": partial(STHMPTransformer, 3, max_iter=1, n_nonzero_coefs=1),
    "TemporalMaxPool": partial(TemporalMaxPool, (2, 1)),
}


@cache
def fitted(name):
    if name in CODERS:
        return CODERS[name]().fit(X)
    return LABELLED[name]().fit(X, COUNTS)


@cache
def fitted_to_names(name):
    if name in CODERS:
        return CODERS[name]().fit(TABLE)
    return LABELLED[name]().fit(TABLE, COUNTS)


NOT_NUMBERS = {
    "NaN": (ValueError, "X contains NaN", lambda: replaced(X, np.nan)),
    "infinity": (ValueError, "X contains infinity", lambda: replaced(X, -np.inf)),
    "text among objects": (
        ValueError,
        "^X is not an array of numbers .*text.*; convert it",
        lambda: replaced(X, "soft", dtype=object),
    ),
    "numbers as text": (
        ValueError,
        "^X is not an array of numbers .*text.*; convert it",
        lambda: text(X),
    ),
    "numbers as text in a DataFrame": (
        ValueError,
        "^X is not an array of numbers .*text.*; convert it",
        lambda: TABLE.astype(str),
    ),
    "dates": (
        ValueError,
        "^X is not an array of numbers .*dates.*; convert it",
        lambda: dates(X),
    ),
    "a column of dates": (
        ValueError,
        "^X is not an array of numbers .column 'when' holds text or dates.; convert it",
        lambda: TABLE.assign(when=[date(2020, 1, 1)] * N),
    ),
    "a dict": (
        ValueError,
        "^X is a dict, which is no array; give a list, an array or a DataFrame",
        lambda: dict(enumerate(X)),
    ),
    "complex numbers": (
        ValueError,
        "Complex data not supported: .* is not an array of .*; give real",
        lambda: X.astype(complex),
    ),
    "a sparse matrix": (
        TypeError,
        r"Sparse data was passed for X, .* Use '\.toarray\(\)'",
        lambda: sparse.csr_array(X),
    ),
    "masked values": (
        ValueError,
        "^X has masked values.*fill or remove them",
        lambda: masked(X),
    ),
    "a number": (ValueError, "Expected 2D array, got scalar .*Reshape", lambda: 3.0),
    "None": (ValueError, "Expected 2D array, got scalar .*Reshape", lambda: None),
    "a word": (ValueError, "^X is not an array of numbers .*text", lambda: "touches"),
    "one dimension": (
        ValueError,
        "Expected 2D array, got 1D .*Reshape",
        lambda: X[:, 0],
    ),
    "no row": (ValueError, "0 sample.* minimum of 1 is required", lambda: X[:0]),
}
NOT_FEATURES = {
    "no column": (
        ValueError,
        "0 feature.* minimum of 1 is required",
        lambda: np.empty((N, 0)),
    ),
    "three dimensions": (
        ValueError,
        "Found array with dim 3, .* <= 2",
        lambda: X.reshape(N, 2, 2),
    ),
    "rows of unequal length": (
        ValueError,
        "^X is no array of one shape; give rows of equal length",
        lambda: [[1.0, 2.0], *X[1:].tolist()],
    ),
}
OTHER_THAN_FITTED = {
    "a column less": (
        ValueError,
        "3 features, but .* expecting 4",
        lambda: X[:, :3],
    ),
    "a column more": (
        ValueError,
        "5 features, but .* expecting 4",
        lambda: np.column_stack((X, X[:, 0])),
    ),
}
OTHER_NAMES = {
    "names swapped": (
        ValueError,
        "Feature names must be in the same order as they were in fit",
        lambda: TABLE[NAMES[::-1]],
    ),
    "an unknown name": (
        ValueError,
        "Feature names unseen at fit time:\n- force",
        lambda: TABLE.rename(columns={"pac__0": "force"}),
    ),
}

TABLE_CASES = [
    *(
        Case(f"{name}.fit", f"X: {given}", error, message, make)
        for name, estimator in LABELLED.items()
        for given, (error, message, bad) in (NOT_NUMBERS | NOT_FEATURES).items()
        for make in [lambda _, e=estimator, bad=bad: call(e().fit, bad(), COUNTS)]
    ),
    *(
        Case(f"{name}.fit", f"X: {given}", error, message, make)
        for name, estimator in CODERS.items()
        for given, (error, message, bad) in NOT_NUMBERS.items()
        for make in [lambda _, e=estimator, bad=bad: call(e().fit, bad())]
    ),
    *(
        Case(f"{name}.{method}", f"X: {given}", error, message, make)
        for names, method, bad_tables, fit in [
            (LABELLED, "predict_proba", NOT_NUMBERS | NOT_FEATURES, fitted),
            (CODERS, "transform", NOT_NUMBERS, fitted),
            (LABELLED, "predict_proba", OTHER_NAMES, fitted_to_names),
            (CODERS, "transform", OTHER_NAMES, fitted_to_names),
            (LABELLED, "predict_proba", OTHER_THAN_FITTED, fitted),
            (CODERS, "transform", OTHER_THAN_FITTED, fitted),
        ]
        for name in names
        for given, (error, message, bad) in bad_tables.items()
        for make in [
            lambda _, fit=fit, n=name, m=method, bad=bad: call(
                getattr(fit(n), m), bad()
            )
        ]
    ),
]

# Collections of trials

TRIAL_CODERS = {
    "KSVDTransformer(window)": partial(
        KSVDTransformer, 3, window=4, max_iter=1, n_nonzero_coefs=1
    ),
    "STHMPTransformer(trials)": partial(
        STHMPTransformer, 3, spatial_cells=(1,), max_iter=1, n_nonzero_coefs=1
    ),
    "TemporalMaxPool(trials)": partial(TemporalMaxPool, (2, 1)),
}


@cache
def fitted_to_trials(name):
    return TRIAL_CODERS[name]().fit(TRIALS)


def named(trial):
    return pd.DataFrame(trial).add_prefix("x")


def with_trial(trial):
    return [TRIALS[0], trial, *TRIALS[2:]]


NOT_TRIALS = {
    "NaN in a trial": (
        "Trial 1 of X contains NaN or infinity; impute or remove",
        lambda: replaced(TRIALS, np.nan),
    ),
    "infinity in a trial": (
        "Trial 1 of X contains NaN or infinity; impute or remove",
        lambda: replaced(TRIALS, np.inf),
    ),
    "text in a trial": (
        "^Trial 1 of X is not an array of numbers .*text.*; convert it",
        lambda: replaced(TRIALS, "soft", dtype=object),
    ),
    "numbers as text in a trial": (
        "^Trial 1 of X is not an array of numbers .*text.*; convert it",
        lambda: with_trial(text(TRIALS[1])),
    ),
    "dates in a trial": (
        "^Trial 1 of X is not an array of numbers .*dates.*; convert it",
        lambda: with_trial(dates(TRIALS[1])),
    ),
    "masked values in a trial": (
        "^Trial 1 of X has masked values.*fill or remove",
        lambda: with_trial(masked(TRIALS[1])),
    ),
    "a complex trial": (
        "Complex data not supported: Trial 1 of X is not .*; give real ones",
        lambda: with_trial(TRIALS[1] * 1j),
    ),
    "a ragged trial": (
        "^Trial 1 of X is no array of one shape; give rows of equal length",
        lambda: with_trial([[1.0] * 19, [2.0] * 18]),
    ),
    "a trial of objects": (
        "^Trial 1 of X is not an array of numbers .*; give each trial as",
        lambda: with_trial(np.full((9, 19), {"a": 1}, dtype=object)),
    ),
    "a trial of no samples": (
        "Trial 1 of X has 0 time samples, but at least .* required; remove it",
        lambda: with_trial(np.empty((0, 19))),
    ),
    "a trial of no channels": (
        "Trial 1 of X has shape .9, 0., which holds no values; give each trial one",
        lambda: with_trial(np.empty((9, 0))),
    ),
    "a trial of other channels": (
        "Trial 1 of X has 18 channels, but 19 channels are expected, as in",
        lambda: with_trial(TRIALS[1][:, :18]),
    ),
    "a trial of four dimensions": (
        "Trial 1 of X has shape .2, 2, 2, 2.; it must be .n_times, n_channels",
        lambda: with_trial(np.zeros((2, 2, 2, 2))),
    ),
    "a missing trial": (
        "^Trial 1 of X is None, not an array of shape .*; give its recording or leave",
        lambda: with_trial(None),
    ),
    "NaN for a trial": (
        "^Trial 1 of X is nan, not an array of shape .*; give its recording or leave",
        lambda: with_trial(np.nan),
    ),
    "a trial with a column of dates": (
        "^Trial 1 of X is not an array of numbers .column 'when' holds .*; convert it",
        lambda: with_trial(named(TRIALS[1]).assign(when=date(2020, 1, 1))),
    ),
    "trials of other column names": (
        "^Trial 1 of X and the first trial differ in the column 'x3'; give all trials",
        lambda: [
            named(TRIALS[0]),
            named(TRIALS[1]).rename(columns={"x3": "force"}),
        ],
    ),
    "a transposed trial": (
        r"^Trial 2 of X has .* shape \(10, 19\)|^Trial 1 of X has 9 channels, but 19",
        lambda: with_trial(TRIALS[1].T),
    ),
    "several sensors": (
        "^X has 2 columns, of which .'a', 'b'. hold trials; choose one with Column",
        lambda: pd.DataFrame({"a": TRIALS, "b": TRIALS}),
    ),
    "a column of ids beside a sensor": (
        "^X has 2 columns, of which .'pac'. hold trials; choose one with ColumnTran",
        lambda: pd.DataFrame({"id": range(4), "pac": TRIALS}),
    ),
    "objects of two columns": (
        "^X has 2 columns, of which .0, 1. hold trials; choose one with ColumnTransf",
        lambda: pd.DataFrame({"a": TRIALS, "b": TRIALS}).to_numpy(),
    ),
}
TRIAL_CASES = [
    Case(f"{name}.{method}", f"X: {given}", ValueError, message, make)
    for name, estimator in TRIAL_CODERS.items()
    for method in ["fit", "transform"]
    for given, (message, bad) in NOT_TRIALS.items()
    for make in [
        lambda _, n=name, e=estimator, bad=bad, fit=method == "fit": call(
            e().fit if fit else fitted_to_trials(n).transform, bad()
        )
    ]
]

# Ratings, for every estimator and score that takes them

NOT_RATINGS = {
    "NaN among counts": ("contains NaN", lambda: replaced(COUNTS, np.nan)),
    "infinity among counts": ("contains infinity", lambda: replaced(COUNTS, np.inf)),
    "a negative count": (
        "has a negative count in trial 1; counts of ratings are 0 or more",
        lambda: replaced(COUNTS, -1),
    ),
    "a trial that nobody rated": (
        "has no ratings in trial 1; remove trials",
        lambda: replaced(COUNTS, 0, 1),
    ),
    "counts whose sum overflows": (
        "has counts in trial 1 whose sum overflows; divide .* by a constant",
        lambda: replaced(COUNTS, 1e308, 1),
    ),
    "counts as text": (
        "is not an array of numbers .*text.*; convert it",
        lambda: text(COUNTS),
    ),
    "masked counts": (
        "has masked values, .*; fill or remove them",
        lambda: masked(COUNTS),
    ),
    "complex counts": (
        "Complex data not supported: .* is not an array of .*; give real",
        lambda: COUNTS + 1j,
    ),
    "rows of counts of unequal length": (
        "^y(_true)? is no array of one shape; give rows of equal length",
        lambda: [[1, 2], *COUNTS[1:].tolist()],
    ),
    "masked labels": (
        "has masked values, .*; fill or remove them",
        lambda: masked(LABELS),
    ),
    "labels of which one is NaN": (
        "contains NaN",
        lambda: replaced(LABELS, np.nan, 1),
    ),
    "continuous labels": (
        "^Unknown label type: .* has continuous ratings, .*: bin .*, give counts .*or",
        lambda: X[:, 0],
    ),
    "ratings as words and numbers": (
        "has 1 in trial 1: give numbers only or words only, one rating per trial",
        lambda: ["soft", *LABELS.tolist()[:-2], 1],
    ),
    "ratings of which one is None": (
        "contains NaN or None: trial 1 has no rating; remove it",
        lambda: replaced(LABELS, None, 1, dtype=object),
    ),
    "a list in each trial": (
        r"has \[1, 2\] in trial 0: give .* or an array of counts with one row per",
        lambda: pd.Series([[1, 2]] * N),
    ),
    "dates as ratings": (
        r"has datetime.* in trial 0: give numbers only or words only",
        lambda: dates(LABELS),
    ),
    "a dict of ratings": (
        "is a dict, which is no array; give a list, an array|array-like",
        lambda: {"rough": COUNTS},
    ),
    "an iterator": (
        "is a list_iterator, which is no array; give a list|array-like",
        lambda: iter(LABELS.tolist()),
    ),
    "a column of objects beside columns of counts": (
        r"columns of y(_true)? are \['object', 1, 2, 3\]; label .* leave out columns",
        lambda: pd.DataFrame(COUNTS, columns=[1, 2, 3]).reset_index(names="object"),
    ),
    "a column of text beside columns of counts": (
        r"is not an array of numbers \(column 'object' holds text or dates\)",
        lambda: pd.DataFrame(COUNTS, columns=["lo", "mid", "hi"]).assign(object="foam"),
    ),
    "a column of dates beside columns of counts": (
        r"is not an array of numbers \(column 'day' holds text or dates\)",
        lambda: pd.DataFrame(COUNTS, columns=["lo", "mid", "hi"]).assign(
            day=pd.Series([pd.Timestamp("2020-01-01")] * N, dtype=object)
        ),
    ),
    "two columns of one level": (
        "has two columns 2; give one column per level",
        lambda: pd.DataFrame(COUNTS, columns=[1, 2, "2"]),
    ),
    "columns with labels in two rows": (
        r"columns of y(_true)? are \[\('soft', 1\), .*label them with the levels",
        lambda: pd.DataFrame(
            COUNTS, columns=pd.MultiIndex.from_product([["soft"], [1, 2, 3]])
        ),
    ),
    "a trial less": (
        r"inconsistent numbers of samples: \[12, 11\]|give one row per trial in both",
        lambda: COUNTS[:-1],
    ),
    "no trial": ("0 sample|inconsistent numbers of samples", lambda: COUNTS[:0]),
    "four dimensions": (
        "array with dim 4, .* <= 2",
        lambda: np.ones((N, 1, 1, 3)),
    ),
    "nothing": (
        "is no array but .*; give one rating or|target y is None|array-like. Got None",
        lambda: None,
    ),
}
SCORES = {
    score.__name__: score
    for score in (
        ranked_probability_score,
        earth_movers_distance,
        log_score,
        macro_mae,
        pit_histogram,
        dispersion,
    )
}
RATINGS_CASES = [
    *(
        Case(f"{name}.fit", f"y: {given}", ValueError, message, make)
        for name, estimator in (
            LABELLED | {"DummyDistribution": DummyDistribution}
        ).items()
        for given, (message, bad) in NOT_RATINGS.items()
        for make in [lambda _, e=estimator, bad=bad: call(e().fit, X, bad())]
    ),
    *(
        Case(name, f"y_true: {given}", ValueError, message, make)
        for name, score in SCORES.items()
        for given, (message, bad) in NOT_RATINGS.items()
        for make in [lambda _, s=score, bad=bad: call(s, bad(), PROBA)]
    ),
]

# Weights, groups, levels and several adjectives


def weighing(*weights):
    return lambda estimator, _: call(
        estimator().fit, X, COUNTS, sample_weight=np.resize(weights, N)
    )


def fitting(y=COUNTS, X=X, fit=None, **params):
    return lambda estimator, _: call(
        estimator().set_params(**params).fit, X, y, **(fit or {})
    )


FIT_ROWS = {
    "a negative weight": (
        ValueError,
        "Negative values in data passed to `sample_weight`",
        weighing(-1, 1),
    ),
    "a weight of NaN": (
        ValueError,
        "sample_weight contains NaN",
        weighing(np.nan, 1),
    ),
    "an infinite weight": (
        ValueError,
        "sample_weight contains infinity",
        weighing(np.inf, 1),
    ),
    "weights of 0 only": (ValueError, "[Ss]ample.weight.*non-zero", weighing(0)),
    "weights whose sum overflows": (
        ValueError,
        "The sum of sample_weight overflows; divide sample_weight by a constant",
        weighing(1e308),
    ),
    "weights as text": (
        ValueError,
        "^sample_weight is not an array of numbers .*; convert it",
        weighing("1"),
    ),
    "a weight less": (
        ValueError,
        r"sample_weight.shape == \(11,\), expected \(12,\)",
        fitting(fit={"sample_weight": np.ones(N - 1)}),
    ),
    "weights in two dimensions": (
        ValueError,
        "Sample weights must be 1D",
        fitting(fit={"sample_weight": np.ones((N, 2))}),
    ),
    "masked weights": (
        ValueError,
        "^sample_weight has masked values, .*; fill or remove",
        fitting(fit={"sample_weight": masked(np.ones(N))}),
    ),
    "groups of another length": (
        ValueError,
        r"inconsistent numbers of samples: \[12, 11\]",
        fitting(fit={"groups": OBJECTS[1:]}),
    ),
    "groups of which one is None": (
        ValueError,
        "^groups has no object in trial 1; name the object of every",
        fitting(fit={"groups": ["a", None, *"bcdefghijk"]}),
    ),
    "no groups": (
        ValueError,
        r"inconsistent numbers of samples: \[12, 0\]",
        fitting(fit={"groups": []}),
    ),
}
LEVEL_ROWS = {
    "a rating outside levels": (
        ValueError,
        r"^y has the rating 3 in trial 2, .* levels=\[1, 2\]; add it to levels or mend",
        fitting(LABELS, levels=[1, 2]),
    ),
    "counts of more levels than there are": (
        ValueError,
        "^y has 3 columns of counts, but there are 2 levels: give one column per level",
        fitting(levels=[1, 2]),
    ),
    "counts with columns of other levels": (
        ValueError,
        r"^The columns of y are \[1, 2, 4\], but the levels are \[1, 2, 3\]; label one",
        fitting(pd.DataFrame(COUNTS, columns=[1, 2, 4]), levels=[1, 2, 3]),
    ),
    "levels twice the same": (
        ValueError,
        r"^levels=\[1, 1, 2\] must be distinct .*; list each level once",
        fitting(levels=[1, 1, 2]),
    ),
    "no levels": (
        ValueError,
        r"^levels=\[\] must be distinct and at least one; list each level",
        fitting(levels=[]),
    ),
    "levels in two dimensions": (
        ValueError,
        r"^levels has shape \(2, 2\); list each level once, lowest first",
        fitting(levels=[[1, 2], [3, 4]]),
    ),
    "a number of levels": (
        ValueError,
        "'levels' parameter .* must be an array-like or None",
        fitting(levels=3),
    ),
}
ADJECTIVE_ROWS = {
    "no adjective": (
        ValueError,
        r"^y has shape \(12, 0, 3\), no adjective; give at least one",
        fitting(np.empty((N, 0, 3))),
    ),
    "a negative count of an adjective": (
        ValueError,
        r"^y\[:, 1\] has a negative count in trial 2",
        fitting(replaced(np.stack([COUNTS, COUNTS], 1), -1, (2, 1, 0))),
    ),
    "an adjective that nobody rated": (
        ValueError,
        r"^y\[:, 1\] has no ratings in trial 2; remove trials",
        fitting(replaced(np.stack([COUNTS, COUNTS], 1), 0, (2, 1))),
    ),
    "NaN in an adjective": (
        ValueError,
        r"y\[:, 1\] contains NaN",
        fitting(replaced(np.stack([COUNTS, COUNTS], 1), np.nan, (2, 1, 0))),
    ),
    "adjectives of other trials": (
        ValueError,
        r"inconsistent numbers of samples: \[12, 11\]",
        fitting(np.stack([COUNTS, COUNTS], 1)[1:]),
    ),
    "masked counts of adjectives": (
        ValueError,
        "^y has masked values",
        fitting(masked(np.stack([COUNTS, COUNTS], 1))),
    ),
}
FIT_CASES = [
    *(
        Case(f"{name}.fit", given, error, message, make)
        for name, estimator in LABELLED.items()
        for given, (error, message, making) in (
            FIT_ROWS
            if name == "SensorFusionNNPOM"
            else FIT_ROWS | LEVEL_ROWS | ADJECTIVE_ROWS
        ).items()
        for make in [partial(making, estimator)]
    ),
    *(
        Case("DummyDistribution.fit", given, error, message, make)
        for given, (error, message, making) in LEVEL_ROWS.items()
        for make in [partial(making, DummyDistribution)]
    ),
]

# Parameters


def wrong_type(name):
    return f"'{name}' parameter of .* must be"


PARAMETERS = {
    KSVDTransformer: {
        "n_atoms": (0, 2.5, "many"),
        "n_nonzero_coefs": (0, None),
        "window": (0, 2.5),
        "overlap": (1.0, -0.1, "half"),
        "update": ("fast",),
        "max_iter": (-1,),
        "tol": (-1.0, 1.0, np.nan),
        "max_train_windows": (0,),
        "sign": ("both", None),
        "remove_mean": ("yes",),
        "random_state": ("zero", -1),
        "memory": (3,),
    },
    STHMPTransformer: {
        "layout": ("palm", 3),
        "step": (0, 1.5),
        "n_atoms": (-1,),
        "max_train_patches": (0,),
    },
    TemporalMaxPool: {"split": ("half",), "memory": (3,)},
    NNPOM: {
        "n_hidden": (-1, 1.5, None),
        "alpha": (-1.0, np.nan, "auto"),
        "solver": ("adam",),
        "max_iter": (0,),
        "tol": (-1.0,),
        "early_stopping": ("yes",),
        "n_iter_no_change": (0,),
        "validation_fraction": (0.0, 1.0),
    },
    DistributionalOrdinalRegressor: {
        "estimator": ("nnpom", 3),
        "n_duplicates": (0, 1.5),
        "sampling": ("grid",),
        "p_transform": ("probit",),
        "balance": ("micro",),
        "monotone": ("yes",),
        "decode": ("mean",),
        "rule": ("mean",),
        "n_quantiles": (0,),
    },
    SensorFusionNNPOM: {
        "sensors": (["pac"],),
        "estimator": (LogisticRegression(),),
        "final_estimator": (LogisticRegression(),),
        "held_out": (0,),
    },
    DummyDistribution: {"strategy": ("mean",)},
}
PARAMETER_CASES = [
    Case(
        f"{estimator.__name__}.fit",
        f"{name}={value!r}",
        ValueError,
        wrong_type(name) if value != -1 or name != "random_state" else "",
        make,
    )
    for estimator, params in PARAMETERS.items()
    for name, values in params.items()
    for value in values
    for make in [
        lambda _, e=estimator, p={name: value}: call(e(**p).fit, X, COUNTS),
    ]
]


@cache
def codes(sign, n_atoms=3):
    coder = KSVDTransformer(n_atoms, 1, window=4, sign=sign, max_iter=1, random_state=0)
    return coder.fit_transform([trial[:, :1] for trial in TRIALS])


@cache
def stopping():
    return DistributionalOrdinalRegressor(NNPOM(early_stopping=True))


def by_ratings(**params):
    return lambda _: call(DistributionalOrdinalRegressor(**params).fit, X, COUNTS)


def sthmp(**params):
    params = {"spatial_cells": (1,), "max_iter": 1} | params
    return lambda _: call(STHMPTransformer(3, 1, **params).fit, TRIALS)


SETTING_CASES = [
    *cases(
        "KSVDTransformer.fit",
        (
            "trials, and window=None",
            ValueError,
            "X is a collection of trials, but window=None .*; set window",
            lambda _: call(KSVDTransformer(3).fit, TRIALS),
        ),
        (
            "a window longer than a trial",
            ValueError,
            "^Trial 0 of X has 8 time samples, but one window takes 9; remove it or",
            lambda _: call(KSVDTransformer(3, window=9).fit, TRIALS),
        ),
        (
            "transposed trials",
            ValueError,
            r"time samples, but one .* \(3, 99\) is taken for 3 .* channels; transpose",
            lambda _: call(KSVDTransformer(3, window=9).fit, [np.ones((3, 99))] * 2),
        ),
        (
            "a table narrower than a window",
            ValueError,
            "^X is a table whose rows of 4 values are taken for trials, .*; give a",
            lambda _: call(KSVDTransformer(3, window=9).fit, X),
        ),
        (
            "a dict of trials",
            ValueError,
            "^X is a dict, which is no array; give a list, an array or a DataFrame",
            lambda _: call(KSVDTransformer(3, window=9).fit, dict(enumerate(TRIALS))),
        ),
        (
            "an iterator over trials",
            ValueError,
            "^X is a list_iterator, which is no array; give a list, an array or a Data",
            lambda _: call(KSVDTransformer(3, window=9).fit, iter(TRIALS)),
        ),
        (
            "dict_init of another shape",
            ValueError,
            r"^dict_init has shape \(2, 4\), but \(3, 4\) is expected: one row per",
            lambda _: call(KSVDTransformer(3, 1, dict_init=X[:2]).fit, X),
        ),
        (
            "dict_init with NaN",
            ValueError,
            "dict_init contains NaN",
            lambda _: call(KSVDTransformer(3, 1, dict_init=X[:3] * np.nan).fit, X),
        ),
        (
            "dict_init as text",
            ValueError,
            "^dict_init is not an array of numbers .*; convert it",
            lambda _: call(KSVDTransformer(3, 1, dict_init=text(X[:3])).fit, X),
        ),
        (
            "dict_init with masked values",
            ValueError,
            "^dict_init has masked values, .*; fill or remove",
            lambda _: call(KSVDTransformer(3, 1, dict_init=masked(X[:3])).fit, X),
        ),
        (
            "signals whose sums overflow",
            ValueError,
            "X holds values so large that their sums overflow float64; divide X by",
            lambda _: call(KSVDTransformer(3, 1).fit, np.full((N, 4), 1.7e308)),
        ),
    ),
    *cases(
        "STHMPTransformer.fit",
        (
            "channels that are no multiple of the electrodes",
            ValueError,
            "X has 18 channels, which is no multiple of the 19 electrodes .*; select",
            lambda _: call(STHMPTransformer(3, 1).fit, [t[:, :18] for t in TRIALS]),
        ),
        (
            "a layout of two dimensions",
            ValueError,
            r"^layout has shape \(3, 3\); it must be \(height, width, n_electrodes\)",
            sthmp(layout=np.eye(3)),
        ),
        (
            "a layout with NaN",
            ValueError,
            "layout contains NaN",
            sthmp(layout=np.full((3, 3, 19), np.nan)),
        ),
        (
            "a layout with masked values",
            ValueError,
            "^layout has masked values, .*; fill or remove",
            sthmp(layout=masked(np.ones((3, 3, 19)))),
        ),
        (
            "images, and a layout of electrodes",
            ValueError,
            r"Trial 0 of X has shape \(8, 5, 5\); it must be \(n_times, n_channels\)",
            lambda _: call(STHMPTransformer(3, 1).fit, [np.ones((8, 5, 5))] * 2),
        ),
        (
            "electrodes, and layout=None",
            ValueError,
            r"Trial 0 of X has shape \(8, 19\); it must be \(n_times, height, width\)",
            sthmp(layout=None),
        ),
        (
            "patches larger than the images",
            ValueError,
            r"^patch_size=\(9, 9\) does not fit images of .*; use smaller patches",
            sthmp(patch_size=(9, 9)),
        ),
        (
            "a patch_size of one number",
            ValueError,
            r"^patch_size=\(3,\) must be two positive integers",
            sthmp(patch_size=(3,)),
        ),
        (
            "a patch_size of 0",
            ValueError,
            r"^patch_size=\(0, 3\) must be two positive integers",
            sthmp(patch_size=(0, 3)),
        ),
        (
            "spatial cells of 0",
            ValueError,
            r"^spatial_cells=\(0,\) must list distinct positive integers",
            sthmp(spatial_cells=(0,)),
        ),
    ),
    *cases(
        "STHMPTransformer.transform",
        (
            "a table after trials",
            ValueError,
            "X is a table, but fit was given trials; give a collection of trials",
            lambda _: call(fitted_to_trials("STHMPTransformer(trials)").transform, X),
        ),
        (
            "trials before fit",
            ValueError,
            "This STHMPTransformer instance is not fitted yet",
            lambda _: call(STHMPTransformer().transform, TRIALS),
        ),
    ),
    *cases(
        "TemporalMaxPool.fit",
        *(
            (
                f"cells={cells!r}",
                ValueError,
                r"^cells=.* must list distinct positive integers, one per level",
                lambda _, cells=cells: call(TemporalMaxPool(cells).fit, X),
            )
            for cells in [(), (0,), (2, 2), (1.5,), ((1, 2),), ("a",)]
        ),
        (
            "trials shorter than every level",
            ValueError,
            r"No level of cells=\(16,\) fits trial 0 of X, .* 8 time samples; add a",
            lambda _: call(TemporalMaxPool((16,), drop_fine_levels=True).fit, TRIALS),
        ),
    ),
    *cases(
        "TemporalMaxPool.transform",
        (
            "trials after a table",
            ValueError,
            "X is a collection of trials, but fit was given a table; give both",
            lambda _: call(fitted("TemporalMaxPool").transform, TRIALS),
        ),
        (
            "codes of another transformer",
            ValueError,
            "Column 0 of X is named 'ch0_atom0', but 'ch0_atom0[+]' in fit; give",
            lambda _: call(
                TemporalMaxPool((1,)).fit(codes("split")).transform,
                codes("absolute", n_atoms=6),
            ),
        ),
    ),
    *cases(
        "NNPOM.fit",
        (
            "one group, and early stopping",
            ValueError,
            "^Early stopping holds out 0.1 of the objects, .* there is 1, .*; give",
            lambda _: call(
                NNPOM(early_stopping=True).fit, X, COUNTS, groups=np.zeros(N)
            ),
        ),
        (
            "one trial, and early stopping",
            ValueError,
            "^Early stopping holds out 0.1 of the trials, .* there is 1, .*; give",
            lambda _: call(NNPOM(early_stopping=True).fit, X[:1], COUNTS[:1]),
        ),
        (
            "two objects of which most are held out",
            ValueError,
            "^Early stopping holds out 0.6 of the objects, .* a smaller validation_fr",
            lambda _: call(
                NNPOM(early_stopping=True, validation_fraction=0.6).fit,
                X,
                COUNTS,
                groups=np.arange(N) % 2,
            ),
        ),
        *(
            (
                f"groups: {given}",
                ValueError,
                message,
                lambda _, groups=groups: call(NNPOM(1).fit, X, COUNTS, groups=groups),
            )
            for given, message, groups in [
                (
                    "None in trial 3",
                    "^groups has no object in trial 3; name the object of every trial",
                    [*range(3), None, *range(4, N)],
                ),
                (
                    "NaN in trial 1",
                    "^groups has no object in trial 1; name the object of every trial",
                    np.where(np.arange(N) == 1, np.nan, 1.0),
                ),
                ("text and numbers", "^groups mixes text with", ["a", *range(1, N)]),
                ("two columns", "^groups has shape .*, one per trial", np.ones((N, 2))),
                ("one number", r"^groups has shape \(\); give the object of each", 3),
                ("of other trials", "inconsistent numbers of samples", range(N - 1)),
            ]
        ),
        (
            "weights and counts whose product underflows",
            ValueError,
            "^The total of y, times sample_weight, underflows; multiply",
            lambda _: call(
                NNPOM(n_hidden=0).fit, X, COUNTS * 1e-200, np.full(N, 1e-200)
            ),
        ),
        (
            "several adjectives, and n_hidden=0",
            ValueError,
            "^n_hidden=0 leaves nothing that several adjectives could share; set it",
            lambda _: call(NNPOM(n_hidden=0).fit, X, np.stack([COUNTS] * 2, 1)),
        ),
        (
            "features whose variation is subnormal",
            ValueError,
            "X varies by no more than .*; give its features in a smaller unit",
            lambda _: call(NNPOM(n_hidden=0).fit, X * 1e-310, COUNTS),
        ),
        (
            "weights and counts whose product overflows",
            ValueError,
            "^The total of y, times sample_weight, overflows; divide",
            lambda _: call(NNPOM(n_hidden=0).fit, X, COUNTS * 1e200, np.full(N, 1e200)),
        ),
        (
            "counts whose total overflows",
            ValueError,
            "^The total of y, times sample_weight, overflows; divide",
            lambda _: call(NNPOM(n_hidden=0).fit, X, np.full((N, 3), 3e307)),
        ),
    ),
    *cases(
        "NNPOM.predict",
        (
            "features before fit",
            ValueError,
            "This NNPOM instance is not fitted yet",
            lambda _: call(NNPOM().predict, X),
        ),
    ),
    *cases(
        "DistributionalOrdinalRegressor.fit",
        (
            "X_val without y_val",
            ValueError,
            "X_val and y_val belong together; give both or neither",
            lambda _: call(DistributionalOrdinalRegressor().fit, X, COUNTS, X_val=X),
        ),
        (
            "X_val, and no early stopping",
            ValueError,
            "X_val requires an estimator that stops early; use an NNPOM",
            lambda _: call(
                DistributionalOrdinalRegressor().fit, X, COUNTS, X_val=X, y_val=COUNTS
            ),
        ),
        (
            "X_val of other columns",
            ValueError,
            "3 features, but .* expecting 4",
            lambda _: call(stopping().fit, X, COUNTS, X_val=X[:, :3], y_val=COUNTS),
        ),
        (
            "X_val of masked values",
            ValueError,
            "^X has masked values",
            lambda _: call(stopping().fit, X, COUNTS, X_val=masked(X), y_val=COUNTS),
        ),
        (
            "y_val of other levels",
            ValueError,
            "^y_val has 2 columns of counts, but there are 3 levels",
            lambda _: call(stopping().fit, X, COUNTS, X_val=X, y_val=COUNTS[:, :2]),
        ),
        (
            "y_val of other trials",
            ValueError,
            r"inconsistent numbers of samples: \[12, 11\]",
            lambda _: call(stopping().fit, X, COUNTS, X_val=X, y_val=COUNTS[1:]),
        ),
        (
            "monotone=True, and an estimator that cannot",
            ValueError,
            "monotone=True requires an NNPOM, but estimator is a LogisticRegression",
            by_ratings(estimator=LogisticRegression(), monotone=True),
        ),
        (
            "several adjectives, and an estimator that cannot",
            ValueError,
            "^y has the ratings of several adjectives, which .* cannot share; use an",
            lambda _: call(
                DistributionalOrdinalRegressor(LogisticRegression()).fit,
                X,
                np.stack([COUNTS] * 2, 1),
            ),
        ),
    ),
    *cases(
        "DistributionalOrdinalRegressor.predict_quantile",
        *(
            (
                f"p={p!r}",
                ValueError,
                message,
                lambda _, p=p: call(
                    fitted("DistributionalOrdinalRegressor").predict_quantile, X, p
                ),
            )
            for p, message in [
                (1.5, "^p must be a number or a list of numbers from 0 to 1; got 1.5"),
                (-0.1, "^p must be a number .* from 0 to 1; got -0.1"),
                (np.nan, "^p must be a number .* from 0 to 1; got nan"),
                ([[0.5]], r"^p must be a number or a list .*; got \[\[0.5\]\]"),
                ("0.5", "^p is not an array of numbers .*text.*; convert it"),
            ]
        ),
    ),
    *cases(
        "DistributionalOrdinalRegressor.sample",
        *(
            (
                f"n_samples={n!r}",
                ValueError,
                "^n_samples=.* must be a positive integer",
                lambda _, n=n: call(
                    fitted("DistributionalOrdinalRegressor").sample, X, n
                ),
            )
            for n in [-1, 0, 1.5, "many"]
        ),
    ),
    *cases(
        "DistributionalOrdinalRegressor.score",
        (
            "y with columns of other levels",
            ValueError,
            r"^The columns of y_true are \[1, 2, 4\], but the levels are \[1, 2, 3\]",
            lambda _: call(
                fitted("DistributionalOrdinalRegressor").score,
                X,
                pd.DataFrame(COUNTS, columns=[1, 2, 4]),
            ),
        ),
        (
            "y of other levels",
            ValueError,
            "^y_true has 2 columns of counts, but there are 3 levels",
            lambda _: call(
                fitted("DistributionalOrdinalRegressor").score, X, COUNTS[:, :2]
            ),
        ),
        (
            "a negative weight",
            ValueError,
            "Negative values in data passed to `sample_weight`",
            lambda _: call(
                fitted("DistributionalOrdinalRegressor").score, X, COUNTS, -np.ones(N)
            ),
        ),
    ),
    *cases(
        "SensorFusionNNPOM.fit",
        *(
            (
                given,
                ValueError,
                message,
                lambda _, params=params: call(
                    SensorFusionNNPOM(**params).fit, X, COUNTS
                ),
            )
            for given, message, params in [
                ("no sensor", "names no sensor; give the columns", {"sensors": {}}),
                (
                    "a sensor of no columns",
                    "sensors has no columns for 'pac'; name at least one column",
                    {"sensors": {"pac": []}},
                ),
                (
                    "a column that is not there",
                    "sensors has columns for 'pac' that are not in X .*; name some",
                    {"sensors": {"pac": [9]}},
                ),
                (
                    "a name of a column that is not there",
                    "sensors has columns for 'pac' that are not in X .*; name some",
                    {"sensors": {"pac": ["force"]}},
                ),
                (
                    "held_out of an unknown sensor",
                    r"^held_out='tac' is not among the sensors .*; name one of them",
                    {"sensors": SENSORS, "held_out": "tac"},
                ),
                (
                    "networks of some sensors only",
                    r"^estimator has networks for \['pac'\], but .*; give one network",
                    {"sensors": SENSORS, "estimator": {"pac": NNPOM()}},
                ),
                (
                    "a network without hidden units",
                    "'pac' has n_hidden=0, so no activations .*; set it to at least 1",
                    {"sensors": SENSORS, "estimator": NNPOM(n_hidden=0)},
                ),
            ]
        ),
        (
            "a column without a prefix",
            ValueError,
            "Column 'force' of X has no prefix .*; rename it or set sensors",
            lambda _: call(
                SensorFusionNNPOM().fit,
                TABLE.rename(columns={"pac__0": "force"}),
                COUNTS,
            ),
        ),
    ),
    *cases(
        "DummyDistribution.fit",
        (
            "trials of another number than ratings",
            ValueError,
            r"inconsistent numbers of samples: \[4, 12\]",
            lambda _: call(DummyDistribution().fit, TRIALS, COUNTS),
        ),
    ),
    *cases(
        "DummyDistribution.predict_proba",
        (
            "trials before fit",
            ValueError,
            "This DummyDistribution instance is not fitted yet",
            lambda _: call(DummyDistribution().predict_proba, TRIALS),
        ),
    ),
    *cases(
        "make_haptic_pipeline",
        (
            "an unknown sensor",
            ValueError,
            r"sensors=\['force'\] must name some of .*; for other sensors build",
            lambda _: call(make_haptic_pipeline, ["force"]),
        ),
        (
            "no sensor",
            ValueError,
            r"sensors=\[\] must name some of",
            lambda _: call(make_haptic_pipeline, []),
        ),
        (
            "an unknown preset",
            ValueError,
            "preset='best' must be one of",
            lambda _: call(make_haptic_pipeline, preset="best"),
        ),
    ),
    *cases(
        "make_haptic_pipeline.fit",
        (
            "a sensor that the trials lack",
            ValueError,
            "Some column names are not columns of the dataframe: {'tdc'}",
            lambda _: call(
                make_haptic_pipeline(["tdc"]).fit,
                pd.DataFrame({"pdc": TRIALS}),
                LABELS[:4],
            ),
        ),
        (
            "an array in place of a DataFrame",
            ValueError,
            "columns using strings is only supported for dataframes",
            lambda _: call(make_haptic_pipeline(["tdc"]).fit, X, COUNTS),
        ),
    ),
]


# Functions


def table_of_scores(**columns):
    """What `sensor_contributions` returns, in small."""
    table = pd.DataFrame(
        [
            {"held_out": h, "start": s, "fold": 0, "object": o, "trial": o, "rps": 0.1}
            for h in ("none", "pac")
            for s in (0, 1)
            for o in (0, 1)
        ]
    )
    return table.assign(**columns)


RESULTS = {
    "mean_fit_time": np.ones(2),
    "mean_score_time": np.ones(2),
    "mean_test_neg_seconds": -np.ones(2),
    "split0_test_neg_seconds": -np.ones(2),
    "split1_test_neg_seconds": -np.ones(2),
    "mean_test_score": np.ones(2),
    "split0_test_score": np.ones(2),
    "split1_test_score": np.ones(2),
}


def of_search(function):
    """Cases of every function that takes the results of a search."""
    return cases(
        getattr(function, "__qualname__", function.__name__),
        (
            "an unknown metric",
            ValueError,
            r"^metric is 'rps', which is unknown; choose one .*: \['score'\]",
            lambda _: call(function, RESULTS, metric="rps"),
        ),
        (
            "several scores, and no metric",
            ValueError,
            "^metric is missing; choose one of the search's scores",
            lambda _: call(function, RESULTS | {"mean_test_rps": np.ones(2)}),
        ),
        (
            "one split",
            ValueError,
            "test scores of 1 split, but .* requires at least two; choose cv with more",
            lambda _: call(
                function, {k: v for k, v in RESULTS.items() if "split1" not in k}
            ),
        ),
        (
            "no finite score",
            ValueError,
            "No candidate has a finite test score .*; set error_score='raise'",
            lambda _: call(function, RESULTS | {"split0_test_score": [np.nan] * 2}),
        ),
        (
            "results without times",
            ValueError,
            "^The search has no 'mean_fit_time'; give a fitted search or its",
            lambda _: call(
                function,
                {k: v for k, v in RESULTS.items() if not re.search("time|seconds", k)},
            ),
        ),
        (
            "a list",
            TypeError,
            "must be a fitted search or its cv_results_|not an estimator instance",
            lambda _: call(function, [1, 2]),
        ),
    )


def of_summary(function):
    """Cases of both functions that take a table of scores."""
    summarise = partial(function, metric="rps")
    return cases(
        function.__qualname__,
        *(
            (
                given,
                ValueError,
                message,
                lambda _, a=args, k=kwargs: call(summarise, *a, **k),
            )
            for given, message, args, kwargs in [
                (
                    "scores without a column",
                    r"^scores has no column \['held_out'\]; choose metric and by among",
                    [table_of_scores().drop(columns="held_out")],
                    {},
                ),
                (
                    "a column that is not there",
                    r"^scores has no column \['hand'\]; choose metric and by among",
                    [table_of_scores()],
                    {"by": "hand"},
                ),
                (
                    "a summary by start",
                    r"^by has \['start'\], which each summary compares; leave it out",
                    [table_of_scores()],
                    {"by": "start"},
                ),
                (
                    "a missing object",
                    "^scores has no value in some rows of 'object'; fill them in",
                    [table_of_scores(object=[None, *[1] * 7])],
                    {},
                ),
                (
                    "an infinite score",
                    "^rps is not finite in the row with .*; choose another metric",
                    [table_of_scores(rps=[np.inf] + [0.1] * 7)],
                    {},
                ),
                (
                    "no full model",
                    r"^held_out is \['pac'\] in scores; give the full model, 'none'",
                    [table_of_scores()[4:]],
                    {},
                ),
                (
                    "a row twice",
                    "^scores has several rows with .*; summarise one run at a time",
                    [pd.concat([table_of_scores()] * 2)],
                    {},
                ),
                (
                    "a row less",
                    "^scores has no row with held_out=pac, .*; score every model",
                    [table_of_scores()[:-1]],
                    {},
                ),
                (
                    "one start",
                    "^scores has one start, but .* at least two; raise n_repeats",
                    [table_of_scores().query("start == 0")],
                    {},
                ),
                (
                    "no threshold",
                    "^scores has no column rps_1, .*; make scores with",
                    [table_of_scores()],
                    {"by": "threshold"},
                ),
                (
                    "no row",
                    r"^held_out is \[\] in scores; give the full model, 'none'",
                    [table_of_scores()[:0]],
                    {},
                ),
                (
                    "scores as text",
                    "^rps is not an array of numbers .*; convert it",
                    [table_of_scores(rps="high")],
                    {},
                ),
            ]
        ),
        (
            "an array",
            TypeError,
            "^scores is a ndarray; give a DataFrame, as sensor_contributions returns",
            lambda _: call(summarise, X),
        ),
    )


@cache
def shared():
    return NNPOM(n_hidden=1, alpha=10).fit(X, np.stack([COUNTS] * 2, 1))


FUSION = DistributionalOrdinalRegressor(SensorFusionNNPOM(SENSORS))
BY_SENSOR = make_pipeline(
    make_column_transformer(
        (StandardScaler(), NAMES[:2]), (StandardScaler(), NAMES[2:])
    ),
    NNPOM(n_hidden=0),
)

FUNCTION_CASES = [
    *(
        Case(name, f"y_proba: {given}", ValueError, message, make)
        for name, score in SCORES.items()
        for given, message, bad in [
            ("NaN", "y_proba contains NaN", replaced(PROBA, np.nan)),
            (
                "a row that does not sum to 1",
                "^y_proba is no distribution in trial 1 .*: give probabilities",
                replaced(PROBA, 0.9),
            ),
            (
                "a negative probability",
                "^y_proba is no distribution in trial 1 .*: give probabilities",
                replaced(PROBA, [-0.5, 0.5, 1.0], 1, float),
            ),
            (
                "a column less",
                "^y_proba has 2 columns, but y_true has 3 levels; give one column",
                np.full((N, 2), 0.5),
            ),
            (
                "a trial less",
                "^y_true has 12 trials, but y_proba has 11; give one row per trial",
                PROBA[1:],
            ),
            ("one dimension", "Expected 2D array, got 1D .*Reshape", PROBA[0]),
            ("text", "^y_proba is not an array of numbers .*; convert", text(PROBA)),
            ("masked values", "^y_proba has masked values, .*; fill", masked(PROBA)),
            (
                "complex",
                "Complex data not supported: .* is not an array of .*; give real",
                PROBA + 0j,
            ),
        ]
        for make in [lambda _, s=score, bad=bad: call(s, COUNTS, bad)]
    ),
    *(
        Case(name, given, ValueError, message, make)
        for name, score in SCORES.items()
        for given, message, kwargs in [
            (
                "levels of another number",
                "^y_true has 3 columns of counts, but there are 2 levels",
                {"levels": [1, 2]},
            ),
            (
                "a negative weight",
                "Negative values in data passed to `sample_weight`",
                {"sample_weight": -np.ones(N)},
            ),
            (
                "a weight of NaN",
                "sample_weight contains NaN",
                {"sample_weight": np.full(N, np.nan)},
            ),
            (
                "weights of another length",
                r"sample_weight.shape == \(11,\), expected \(12,\)",
                {"sample_weight": np.ones(N - 1)},
            ),
            (
                "weights of 0 only",
                "[Ss]ample.weight.*non-zero",
                {"sample_weight": np.zeros(N)},
            ),
            (
                "weights whose sum overflows",
                "The sum of sample_weight overflows; divide sample_weight",
                {"sample_weight": np.full(N, 1e308)},
            ),
        ]
        for make in [lambda _, s=score, k=kwargs: call(s, COUNTS, PROBA, **k)]
    ),
    *cases(
        "macro_mae",
        (
            "n_quantiles=0",
            ValueError,
            wrong_type("n_quantiles"),
            lambda _: call(macro_mae, COUNTS, PROBA, n_quantiles=0),
        ),
    ),
    *cases(
        "pit_histogram",
        (
            "n_bins=0",
            ValueError,
            wrong_type("n_bins"),
            lambda _: call(pit_histogram, COUNTS, PROBA, n_bins=0),
        ),
    ),
    *(
        case
        for scorer in (neg_rps_scorer, neg_macro_mae_scorer)
        for case in cases(
            scorer.__name__,
            (
                "a rating that the estimator does not know",
                ValueError,
                r"^y_true has the rating 9 in trial 0, .* levels=\[1, 2, 3\]; add it",
                lambda _, s=scorer: call(s, fitted("NNPOM"), X, replaced(LABELS, 9, 0)),
            ),
            (
                "features of another number",
                ValueError,
                "3 features, but NNPOM is expecting 4",
                lambda _, s=scorer: call(s, fitted("NNPOM"), X[:, :3], COUNTS),
            ),
            (
                "counts of other adjectives",
                ValueError,
                r"^y has shape \(12, 3\), but \(12, 2, 3\) is predicted; give counts",
                lambda _, s=scorer: call(s, shared(), X, COUNTS),
            ),
        )
    ),
    *cases(
        "rating_counts",
        *(
            (given, ValueError, message, lambda _, a=args: call(rating_counts, *a))
            for given, message, args in [
                (
                    "objects of another number",
                    r"inconsistent numbers of samples: \[2, 3\]",
                    ([1, 2], ["a", "b", "c"]),
                ),
                (
                    "no rating",
                    "^ratings holds no values at all; at least one is required",
                    ([], []),
                ),
                (
                    "missing ratings only",
                    "^ratings holds no values at all; at least one is required",
                    ([None, np.nan], ["a", "b"]),
                ),
                (
                    "an object without a name",
                    "^objects has no object in row 1; name the object of every row",
                    ([1, 2], ["a", None]),
                ),
                (
                    "an object that nobody rated",
                    "Nobody rated the object 'b'; remove its rows",
                    ([1, None], ["a", "b"]),
                ),
                (
                    "masked ratings",
                    "^ratings has masked values, .*; fill or remove",
                    (masked([1, 2]), ["a", "b"]),
                ),
                ("ratings in two dimensions", "1d array", ([[1, 2]], ["a"])),
                (
                    "text among numbers",
                    "^ratings mixes text with something else; convert it",
                    ([1, "2"], ["a", "a"]),
                ),
            ]
        ),
        (
            "a rating outside levels",
            ValueError,
            r"^ratings has the rating 3 in row 1, .* levels=\[1, 2\]; add it to",
            lambda _: call(rating_counts, [1, 3], ["a", "b"], levels=[1, 2]),
        ),
    ),
    *cases(
        "RatingTable.counts_for",
        *(
            (
                given,
                ValueError,
                message,
                lambda _, o=objects, ids=ids: call(
                    rating_counts([1, 2, 2], ids or [3, 3, 5]).counts_for, o
                ),
            )
            for given, message, objects, ids in [
                (
                    "an object that nobody rated",
                    r"^The table has no ratings of objects \[4\]; leave their",
                    [3, 4, 5],
                    None,
                ),
                (
                    "objects as text",
                    r"no ratings of objects \['3'\]; .* such as 3: convert .*int\)",
                    ["3"],
                    None,
                ),
                (
                    "objects as numbers",
                    r"no ratings of objects \[3\]; .* such as '3': convert .*str\)",
                    [3],
                    ["3", "3", "5"],
                ),
                (
                    "an object without a name",
                    "^objects has no object in row 1; name the object of every row",
                    [3, None],
                    None,
                ),
            ]
        ),
    ),
    *(
        case
        for function in (
            *(interrater_agreement, inverse_cdf),
            *(rating_distribution, rating_cdf),
        )
        for case in cases(
            function.__name__,
            *(
                (
                    f"counts: {given}",
                    ValueError,
                    message.replace("y(_true)?", "counts"),
                    lambda _, f=function, bad=bad: call(
                        f, bad(), *([0.5] if f is inverse_cdf else [])
                    ),
                )
                for given, (message, bad) in NOT_RATINGS.items()
                if "count" in given or "nobody" in given
            ),
            (
                "counts: one dimension",
                ValueError,
                "Expected 2D array, got 1D .*Reshape",
                lambda _, f=function: call(
                    f, COUNTS[0], *([0.5] if f is inverse_cdf else [])
                ),
            ),
            (
                "counts: one level",
                ValueError,
                "1 feature.* minimum of 2 is required",
                lambda _, f=function: call(
                    f, COUNTS[:, :1], *([0.5] if f is inverse_cdf else [])
                ),
            ),
        )
    ),
    *cases(
        "interrater_agreement",
        (
            "one rating of an object",
            ValueError,
            "^counts has fewer than two ratings in row 0; .* remove that object",
            lambda _: call(interrater_agreement, [[0, 1, 0]]),
        ),
    ),
    *cases(
        "inverse_cdf",
        *(
            (
                f"p={p!r}",
                ValueError,
                message,
                lambda _, p=p: call(inverse_cdf, COUNTS, p),
            )
            for p, message in [
                (1.5, r"^p must lie within \[0, 1\]; give positions"),
                (np.nan, r"p contains NaN|^p must lie within \[0, 1\]"),
                ("0.5", "^p is not an array of numbers .*; convert it"),
                ([[0.5, 0.6]], "1d array"),
                ([0.5, 0.6j], "[Cc]omplex"),
            ]
        ),
        (
            "levels of another number",
            ValueError,
            "^counts has 3 columns of counts, but there are 2 levels",
            lambda _: call(inverse_cdf, COUNTS, 0.5, levels=[1, 2]),
        ),
    ),
    *cases(
        "adjective_correlation",
        *(
            (
                given,
                ValueError,
                message,
                lambda _, bad=bad: call(adjective_correlation, bad),
            )
            for given, message, bad in [
                (
                    "too few ratings of a pair",
                    "^ratings has 2 rows with both 'x0' and 'x1'; .* leave one of",
                    replaced(X, np.nan, (slice(2, None), 0)),
                ),
                ("infinity", "ratings contains infinity", replaced(X, np.inf)),
                ("one adjective", "1 feature.* minimum of 2", X[:, :1]),
                ("two rows", "2 sample.* minimum of 3", X[:2]),
                (
                    "an adjective always rated the same",
                    "^All ratings of 'x0' in the rows that have 'x1' too are equal, .*;"
                    " leave one of the two out",
                    replaced(X, 1.0, (slice(None), 0)),
                ),
                ("text", "^ratings is not an array of numbers .*; convert", text(X)),
                ("masked ratings", "^ratings has masked values, .*; fill", masked(X)),
            ]
        ),
        *(
            (
                f"{name}={value!r}",
                ValueError,
                f"The '{name}' parameter of adjective_correlation must be a float in",
                lambda _, o={name: value}: call(adjective_correlation, X, **o),
            )
            for name, value in [("alpha", 0), ("alpha", "5%"), ("threshold", -0.3)]
        ),
    ),
    *of_search(speed_accuracy_frontier),
    *of_search(cheapest_within_one_se),
    *of_summary(contribution_summary),
    *cases(
        "cross_val_predict_proba",
        *(
            (
                given,
                ValueError,
                message,
                lambda _, a=arguments, o=options: call(
                    cross_val_predict_proba, *a, **o
                ),
            )
            for given, message, arguments, options in [
                (
                    "a trial without an object",
                    "^groups has no object in trial 1; name the object of every trial",
                    (DummyDistribution(), X, COUNTS),
                    {"groups": [0, None, *OBJECTS[2:]]},
                ),
                (
                    "a splitter that tests a trial twice",
                    "^cv tests trial 0 2 times; choose a splitter that tests each",
                    (DummyDistribution(), X, COUNTS),
                    {"cv": RepeatedKFold(n_splits=2, n_repeats=2)},
                ),
                (
                    "test trials among the training trials",
                    "^cv trains on trial 0 in the fold that tests it; leave the test",
                    (DummyDistribution(), X, COUNTS),
                    {"cv": [(np.arange(N), np.arange(N))]},
                ),
                (
                    "a classifier that takes each level for a label of its own",
                    "^KNeighborsClassifier took each column of y for labels of its own",
                    (KNeighborsClassifier(2), X, (COUNTS > 2).astype(int)),
                    {"cv": 2},
                ),
                (
                    "a method without columns of levels",
                    wrong_type("method"),
                    (DummyDistribution(), X, COUNTS),
                    {"method": "decision_function"},
                ),
            ]
        ),
    ),
    *cases(
        "neg_seconds_scorer",
        (
            "a model that is not fitted",
            NotFittedError,
            "is not fitted yet",
            lambda _: call(neg_seconds_scorer, DummyDistribution(), X),
        ),
    ),
    *cases(
        "sensor_contributions",
        (
            "a trial without an object",
            ValueError,
            "^groups has no object in trial 1; name the object of every trial",
            lambda _: call(
                sensor_contributions,
                FUSION,
                X,
                COUNTS,
                groups=[0, np.nan, *OBJECTS[2:]],
            ),
        ),
        (
            "a model that is no fusion",
            TypeError,
            "^model must end in a DistributionalOrdinalRegressor .*; use",
            lambda _: call(sensor_contributions, NNPOM(), X, COUNTS),
        ),
        (
            "a model with a sensor held out",
            ValueError,
            "^model has held_out='pac' already; set it to None",
            lambda _: call(
                sensor_contributions,
                DistributionalOrdinalRegressor(
                    SensorFusionNNPOM(SENSORS, held_out="pac")
                ),
                X,
                COUNTS,
            ),
        ),
        (
            "groups of another length",
            ValueError,
            r"inconsistent numbers of samples: \[12, 11\]",
            lambda _: call(sensor_contributions, FUSION, X, COUNTS, groups=OBJECTS[1:]),
        ),
        (
            "one group",
            ValueError,
            "number of splits .* greater than the number of groups: 1|groups",
            lambda _: call(sensor_contributions, FUSION, X, COUNTS, groups=np.zeros(N)),
        ),
        (
            "n_repeats=0",
            ValueError,
            wrong_type("n_repeats"),
            lambda _: call(sensor_contributions, FUSION, X, COUNTS, n_repeats=0),
        ),
        (
            "a negative count",
            ValueError,
            "^y has a negative count in trial 1",
            lambda _: call(sensor_contributions, FUSION, X, replaced(COUNTS, -1)),
        ),
        (
            "a sensor called none",
            ValueError,
            "A sensor is called 'none', .*; rename it",
            lambda _: call(
                sensor_contributions,
                DistributionalOrdinalRegressor(
                    SensorFusionNNPOM({"none": [0, 1], "tdc": [2, 3]})
                ),
                X,
                COUNTS,
                n_repeats=1,
                cv=2,
            ),
        ),
    ),
    *cases(
        "sensor_subsets",
        *(
            (given, error, message, lambda _, a=args: call(sensor_subsets, *a))
            for given, error, message, args in [
                (
                    "a model without a ColumnTransformer",
                    TypeError,
                    "^model must be a Pipeline that begins with a ColumnTransformer",
                    (NNPOM(), TABLE, COUNTS),
                ),
                (
                    "a model without a predictor",
                    ValueError,
                    "^model ends with its ColumnTransformer; add a predictor",
                    (BY_SENSOR[:1], TABLE, COUNTS),
                ),
                (
                    "a remainder",
                    ValueError,
                    "remainder='passthrough', which is no sensor; set it to 'drop'",
                    (
                        make_pipeline(
                            make_column_transformer(
                                (StandardScaler(), NAMES[:2]), remainder="passthrough"
                            ),
                            NNPOM(),
                        ),
                        TABLE,
                        COUNTS,
                    ),
                ),
                (
                    "no sensor",
                    ValueError,
                    "all dropped or share a name: .*; give each sensor one",
                    (
                        make_pipeline(
                            make_column_transformer(("drop", NAMES[:2])), NNPOM()
                        ),
                        TABLE,
                        COUNTS,
                    ),
                ),
                (
                    "ratings of another number",
                    ValueError,
                    r"inconsistent numbers of samples: \[12, 11\]",
                    (BY_SENSOR, TABLE, COUNTS[1:]),
                ),
            ]
        ),
    ),
    *cases(
        "make_haptic_corpus",
        *(
            (
                f"{name}={value!r}",
                ValueError,
                message or wrong_type(name),
                lambda _, k={name: value}: call(make_haptic_corpus, **k),
            )
            for name, value, message in [
                ("n_objects", 0, None),
                ("n_trials", 1.5, None),
                ("procedure", "tap", None),
                ("n_raters", -1, None),
                ("random_state", "zero", None),
                ("sensors", ["force"], "^Unknown sensor 'force'; the corpus has 5"),
                ("sensors", [], "^No sensor is asked for; name at least one"),
                ("sensors", ["pdc", "pdc"], "'pdc' is asked for twice; name it once"),
                ("sensors", "pdc", "Unknown sensor|must be"),
            ]
        ),
    ),
]


# Figures


def of_one_object(display):
    return [
        *cases(
            f"{display.__name__}.from_predictions",
            *(
                (
                    given,
                    ValueError,
                    message,
                    lambda _, a=args: call(display.from_predictions, *a),
                )
                for given, message, args in [
                    (
                        "trials of several objects",
                        "^y_true has different ratings for different trials; give the",
                        (COUNTS, PROBA),
                    ),
                    (
                        "a column less",
                        "^y_proba has 2 columns, but y_true has 3 levels; give one",
                        (COUNTS[0], PROBA[:, :2] * 1.5),
                    ),
                    (
                        "a negative count",
                        "^y_true has a negative count in trial 0",
                        ([-1, 2, 3], PROBA),
                    ),
                    (
                        "no distribution",
                        "^y_proba is no distribution in trial 1",
                        (COUNTS[0], replaced(PROBA, 0.9)),
                    ),
                    (
                        "masked counts",
                        "^y_true has masked values, .*; fill or remove",
                        (masked(COUNTS[0]), PROBA),
                    ),
                    (
                        "a probability in place of an array",
                        "Expected 2D array, got scalar",
                        (COUNTS[0], 0.5),
                    ),
                ]
            ),
        ),
        *of_estimator(display, COUNTS[0]),
    ]


def of_calibration(display):
    return [
        *cases(
            f"{display.__name__}.from_predictions",
            *(
                (
                    given,
                    (TypeError, ValueError),
                    message,
                    lambda _, a=args, k=kwargs: call(display.from_predictions, *a, **k),
                )
                for given, message, args, kwargs in [
                    (
                        "no distribution",
                        "^y_proba is no distribution in trial 1",
                        (COUNTS, replaced(PROBA, 0.9)),
                        {},
                    ),
                    (
                        "a trial without ratings",
                        "^y_true has no ratings in trial 0",
                        (COUNTS * 0, PROBA),
                        {},
                    ),
                    (
                        "no bin",
                        "n_bins.*(== 0, must be >= 1|range .1, inf)",
                        (COUNTS, PROBA),
                        {"n_bins": 0},
                    ),
                    (
                        "half a bin",
                        "n_bins.* must be an (int|instance of int)",
                        (COUNTS, PROBA),
                        {"n_bins": 2.5},
                    ),
                    (
                        "an object less",
                        "inconsistent numbers of samples",
                        (COUNTS, PROBA),
                        {"groups": np.arange(len(COUNTS) - 1)},
                    ),
                    (
                        "a missing object",
                        "^groups has no object in trial 0; name the object of every",
                        (COUNTS, PROBA),
                        {"groups": [np.nan, *range(len(COUNTS) - 1)]},
                    ),
                    (
                        "one object",
                        "^groups has one object, .*; leave groups out, or give trials",
                        (COUNTS, PROBA),
                        {"groups": ["cup"] * len(COUNTS)},
                    ),
                ]
            ),
        ),
        *of_estimator(display, COUNTS),
    ]


def of_estimator(display, counts):
    return cases(
        f"{display.__name__}.from_estimator",
        (
            "ratings of other levels",
            ValueError,
            "^y_true has 2 columns of counts, but there are 3 levels",
            lambda _: call(display.from_estimator, fitted("NNPOM"), X, counts[..., :2]),
        ),
        (
            "an estimator that is not fitted",
            ValueError,
            "This NNPOM instance is not fitted yet",
            lambda _: call(display.from_estimator, NNPOM(), X, counts),
        ),
    )


PLOT_CASES = [
    *of_search(SpeedAccuracyDisplay.from_search),
    *of_summary(SensorContributionsDisplay.from_scores),
    *(
        case
        for display in (RatingsDisplay, InterraterAgreementDisplay)
        for case in cases(
            f"{display.__name__}.from_counts",
            *(
                (
                    given,
                    ValueError,
                    message,
                    lambda _, d=display, r=ratings, o=objects: call(
                        d.from_counts, r, objects=o
                    ),
                )
                for given, message, ratings, objects in [
                    (
                        "no adjective",
                        "^counts is of no adjective; give the counts of one or more",
                        {},
                        None,
                    ),
                    (
                        "an object that nobody rated",
                        r"^counts\['hard'\] has no ratings in trial 1; remove",
                        {"hard": replaced(COUNTS, 0, 1)},
                        None,
                    ),
                    (
                        "adjectives with other levels",
                        r"^counts\['soft'\] has shape \(12, 2\), but counts\['hard'\]"
                        r" has \(12, 3\); give the same rows and levels",
                        {"hard": COUNTS, "soft": COUNTS[:, :2]},
                        None,
                    ),
                    (
                        "trials of an object that differ",
                        "^counts has other counts in row 1 than in row 0, both of the "
                        "object 0; give all rows of an object the same",
                        COUNTS,
                        OBJECTS,
                    ),
                    (
                        "a trial without an object",
                        "^objects has no object in row 2; name the object of every row",
                        COUNTS[:3],
                        ["foam", "tile", None],
                    ),
                    (
                        "objects of another number",
                        r"inconsistent numbers of samples: \[12, 6\]",
                        COUNTS,
                        OBJECTS[:6],
                    ),
                    (
                        "counts as text",
                        "^counts is not an array of numbers .*text.*; convert it",
                        text(COUNTS),
                        None,
                    ),
                ]
            ),
        )
    ),
    *cases(
        "RatingsDisplay.from_counts",
        (
            "levels of another number",
            ValueError,
            "^counts has 3 columns of counts, but there are 2 levels",
            lambda _: call(RatingsDisplay.from_counts, COUNTS, levels=[1, 2]),
        ),
    ),
    *cases(
        "InterraterAgreementDisplay.from_counts",
        (
            "one rating of an object",
            ValueError,
            r"^counts\['hard'\] has fewer than two ratings in row 0; .* remove that",
            lambda _: call(
                InterraterAgreementDisplay.from_counts, {"hard": [[0, 1, 0]]}
            ),
        ),
    ),
    *cases(
        "AdjectiveCorrelationDisplay.from_ratings",
        *(
            (
                given,
                ValueError,
                message,
                lambda _, r=ratings, o=options: call(
                    AdjectiveCorrelationDisplay.from_ratings, r, **o
                ),
            )
            for given, message, ratings, options in [
                ("one adjective", "1 feature.* minimum of 2", X[:, :1], {}),
                (
                    "an adjective always rated the same",
                    "^All ratings of 'x0' in the rows that have 'x1' too are equal, ",
                    replaced(X, 1.0, (slice(None), 0)),
                    {},
                ),
                (
                    "a threshold above 1",
                    "^The 'threshold' parameter of adjective_correlation must be",
                    X,
                    {"threshold": 1.5},
                ),
            ]
        ),
    ),
    *cases(
        "InverseCDFDisplay.from_counts",
        (
            "ratings of several objects",
            ValueError,
            "^counts has different ratings for different trials; give the trials",
            lambda _: call(InverseCDFDisplay.from_counts, COUNTS),
        ),
        (
            "an object that nobody rated",
            ValueError,
            "^counts has no ratings in trial 0; remove",
            lambda _: call(InverseCDFDisplay.from_counts, [0, 0, 0]),
        ),
        (
            "levels of another number",
            ValueError,
            "^counts has 3 columns of counts, but there are 2 levels",
            lambda _: call(InverseCDFDisplay.from_counts, COUNTS[0], levels=[1, 2]),
        ),
    ),
    *of_one_object(InverseCDFDisplay),
    *of_one_object(DistributionDisplay),
    *of_calibration(PITHistogramDisplay),
    *of_calibration(ReliabilityDisplay),
    *cases(
        "SignalsDisplay.from_trials",
        *(
            (
                given,
                ValueError,
                message,
                lambda _, a=args: call(SignalsDisplay.from_trials, *a),
            )
            for given, message, args in [
                (
                    "an unknown sensor and no sampling rate",
                    "^sampling_rate of the sensor 'taxels' is unknown; give it",
                    ({"taxels": TRIALS[0]},),
                ),
                (
                    "trials of other sensors",
                    r"^Trial 1 of X has the sensors \['tdc'\], but \['pac'\] are",
                    ({"hold": {"pac": TRIALS[0]}, "slide": {"tdc": TRIALS[0]}},),
                ),
                (
                    "a trial beside a signal",
                    "^X holds trials of several sensors beside signals of one; name",
                    ({"hold": {"pac": TRIALS[0]}, "pac": TRIALS[0]},),
                ),
                (
                    "NaN in a signal",
                    "^Sensor 'pac': Trial 0 of X contains NaN or infinity; impute",
                    ({"pac": replaced(TRIALS[0], np.nan)},),
                ),
                (
                    "a number in place of a signal",
                    "^Sensor 'pac': Trial 0 of X is 3.0, not an array of shape",
                    ({"pac": 3.0},),
                ),
                ("no trial", "^X holds no signals; give it one trial", ({},)),
            ]
        ),
        (
            "a negative sampling rate",
            ValueError,
            "^sampling_rate=-100 must be a positive number of samples per second",
            lambda _: call(
                SignalsDisplay.from_trials, {"pac": TRIALS[0]}, sampling_rate=-100
            ),
        ),
    ),
    *(
        case
        for display in (AtomsDisplay, FeatureMapDisplay)
        for case in cases(
            f"{display.__name__}.from_estimator",
            (
                "an estimator without atoms",
                ValueError,
                "^estimator is a NNPOM, which has no atoms; give a fitted",
                lambda _, d=display: call(d.from_estimator, fitted("NNPOM"), TRIALS[0]),
            ),
            (
                "an estimator that is not fitted",
                ValueError,
                "This KSVDTransformer instance is not fitted yet",
                lambda _, d=display: call(
                    d.from_estimator, KSVDTransformer(), TRIALS[0]
                ),
            ),
            (
                "trials of other channels",
                ValueError,
                "^Trial 0 of X has .*, but 19 channels are expected, as in fit",
                lambda _, d=display: call(
                    d.from_estimator,
                    fitted_to_trials("KSVDTransformer(window)"),
                    TRIALS[0][:, :18],
                ),
            ),
            (
                "a sampling rate of 0",
                ValueError,
                "^sampling_rate=0 must be a positive number of samples per second",
                lambda _, d=display: call(
                    d.from_estimator,
                    fitted_to_trials("KSVDTransformer(window)"),
                    TRIALS[0],
                    sampling_rate=0,
                ),
            ),
        )
    ),
    *cases(
        "FeatureMapDisplay.from_estimator",
        (
            "a transformer fitted to a table",
            ValueError,
            "^estimator codes the rows of a table, .*; fit it to trials",
            lambda _: call(
                FeatureMapDisplay.from_estimator, fitted("KSVDTransformer"), X
            ),
        ),
    ),
]


# Files

HOLD = b"HOLD_FOR_10_SECONDS"
STATES = np.array([b"MOVE_ARM_START_POSITION"] * 5 + [HOLD] * 4, dtype="S30")
WIDTHS = {"pac": (22,), "electrodes": (19,), "pdc": (), "tac": (), "tdc": ()}
TRIAL = "sponge_114_01"
STATE = f"{TRIAL}/state/controller_detail_state"
TAC = f"{TRIAL}/biotacs/finger_1/tac"


def write_corpus(folder, edit=None):
    """Write a file of two trials, as PHAC-2 is laid out, and damage it."""
    path = folder / "corpus.h5"
    with h5py.File(path, "w") as file:
        for name in (TRIAL, "cup_602_01"):
            file[f"{name}/state/controller_detail_state"] = STATES
            for finger in (0, 1):
                for sensor, width in WIDTHS.items():
                    place = f"{name}/biotacs/finger_{finger}/{sensor}"
                    file[place] = np.arange(9)[:, *[None] * len(width)] + np.ones(width)
        if edit is not None:
            edit(file)
    return path


def loading(edit, **kwargs):
    """Call of `load_phac2` on a file after something was done to it."""
    return lambda folder: call(load_phac2, write_corpus(folder, edit), **kwargs)


def exchanged(name, value):
    def edit(file):
        del file[name]
        file[name] = value

    return edit


def linked(name, link):
    return exchanged(name, link)


def without(name):
    return lambda file: file.__delitem__(name)


def of_bytes(change, load=load_phac2, write=write_corpus):
    """Call of a loader on a file whose bytes were changed."""

    def make(folder):
        path = write(folder)
        path.write_bytes(change(path.read_bytes()))
        return call(load, path)

    return make


def cut(share):
    return lambda data: data[: int(share * len(data))]


def external_values(file):
    del file[TAC]
    file.create_dataset(TAC, (9,), "f8", external=[("elsewhere.raw", 0, 72)])


DAMAGED = "cut short or damaged|is not an HDF5 file; give one, or download it again"

HDF5_CASES = cases(
    "load_phac2",
    (
        "no file",
        FileNotFoundError,
        "There is no file .*missing.h5; give the path of one",
        lambda folder: call(load_phac2, folder / "missing.h5"),
    ),
    (
        "a folder",
        OSError,
        "Is a directory|Permission",
        lambda folder: call(load_phac2, folder),
    ),
    (
        "a number as path",
        ValueError,
        wrong_type("path"),
        lambda _: call(load_phac2, 3),
    ),
    ("an empty file", OSError, "is not an HDF5 file; give", of_bytes(cut(0))),
    (
        "a text file",
        OSError,
        "is not an HDF5 file; give one, or download it again",
        of_bytes(lambda _: b"trial,rating\n" * 99),
    ),
    *(
        (f"a file cut at {share:.0%}", OSError, DAMAGED, of_bytes(cut(share)))
        for share in (0.001, 0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99)
    ),
    (
        "no trials",
        ValueError,
        "has no trials; give a file with groups named <object>_<id>_<run>",
        loading(lambda file: file.clear()),
    ),
    (
        "a group that is no trial",
        ValueError,
        "'notes' at the root .* is no trial; trials are named",
        loading(lambda file: file.create_group("notes")),
    ),
    (
        "a trial without states",
        ValueError,
        "/sponge_114_01 of .* has no 'state'; it has",
        loading(without(f"{TRIAL}/state")),
    ),
    (
        "a trial without a sensor",
        ValueError,
        "finger_1 of .* has no 'tac'; it has",
        loading(without(TAC)),
    ),
    (
        "a trial without a finger",
        ValueError,
        "has finger_0 and finger_1, but trial .* has finger_0; load the ones apart",
        loading(without(f"{TRIAL}/biotacs/finger_1")),
    ),
    (
        "a dataset in place of a trial",
        ValueError,
        "/sponge_114_01 of .* is not a group, so it has no 'biotacs'",
        loading(exchanged(TRIAL, 3)),
    ),
    (
        "a group in place of a sensor",
        ValueError,
        "finger_1/tac of .* is not a dataset",
        loading(lambda file: (without(TAC)(file), file.create_group(TAC))),
    ),
    *(
        (given, ValueError, f"tac of .* {message}", loading(exchanged(TAC, value)))
        for given, message, value in [
            (
                "a sensor of other rows",
                r"has shape \(8,\); it must be \(9,\), one row per state",
                np.ones(8),
            ),
            ("a sensor of two columns", r"has shape \(9, 2\)", np.ones((9, 2))),
            ("a sensor that is a number", r"has shape \(\); it must be", 3.0),
            (
                "a sensor of text",
                "has dtype .*; it must hold numbers",
                np.array([b"1"] * 9),
            ),
            (
                "a sensor of complex numbers",
                "has dtype .*; it must hold numbers",
                np.ones(9, complex),
            ),
            (
                "a sensor of booleans",
                "has dtype .*; it must hold numbers",
                np.ones(9, bool),
            ),
            (
                "a sensor of NaN",
                "has NaN or infinity in sample 0 .*; leave the trial out",
                np.full(9, np.nan),
            ),
            (
                "a sensor of infinity",
                "has NaN or infinity in sample 0 .*; leave the trial out",
                np.array([1.0] * 5 + [np.inf] * 4),
            ),
        ]
    ),
    *(
        (f"states of {given}", ValueError, message, loading(exchanged(STATE, value)))
        for given, message, value in [
            ("numbers", "has dtype .*; it must hold byte strings", np.ones(9)),
            (
                "two columns",
                r"has shape \(9, 2\); it must be \(n_frames,\)",
                np.stack([STATES] * 2, 1),
            ),
            (
                "another procedure only",
                "has no procedure 'hold': .* Leave the trial out through trials=",
                np.array([b"SLIDE_5CM"] * 9),
            ),
            (
                "no rest",
                "and only 9 rows, so no rest level; use remove_baseline=False",
                np.array([HOLD] * 9),
            ),
        ]
    ),
    *(
        (f"{given} link", ValueError, message, loading(linked(name, link)))
        for message in ["is a soft or external link, .*; copy what it points at"]
        for given, name, link in [
            ("a soft", TAC, h5py.SoftLink("/cup_602_01/biotacs/finger_1/tac")),
            ("a dangling soft", TAC, h5py.SoftLink("/nowhere")),
            ("a cyclic soft", TAC, h5py.SoftLink(f"/{TAC}")),
            ("an external", TAC, h5py.ExternalLink("other.h5", "/tac")),
            ("a trial that is an external", TRIAL, h5py.ExternalLink("o.h5", "/")),
            ("a trial that is a dangling", TRIAL, h5py.SoftLink("/nowhere")),
        ]
    ),
    (
        "values in another file",
        ValueError,
        "keeps its values in another file, which is not read; copy them",
        loading(external_values),
    ),
    *(
        (given, ValueError, message, loading(None, **kwargs))
        for given, message, kwargs in [
            ("procedure='tap'", wrong_type("procedure"), {"procedure": "tap"}),
            ("an unknown sensor", "^Unknown sensor 'force'", {"sensors": ["force"]}),
            ("no sensor", "^No sensor is asked for; name at least", {"sensors": []}),
            ("an unknown trial", "^Unknown trial 'x_1_1'", {"trials": ["x_1_1"]}),
            ("no trial", "^No trial is asked for; name at least", {"trials": []}),
            ("a trial twice", "is asked for twice; name it", {"trials": [TRIAL] * 2}),
        ]
    ),
)

WORDS = np.array([f"word {i}" for i in range(10)], dtype=object)
RATINGS = np.random.default_rng(0).integers(1, 6, (2, 10, 12))


def write_ratings(folder, **variables):
    path = folder / "ratings.mat"
    savemat(path, variables or {"ratings": RATINGS})
    return path


def load_ratings(path):
    """Load the corpus beside a file of ratings, and these."""
    return load_phac2(path.with_name("corpus.h5"), ratings_path=path)


def rating(**variables):
    def make(folder):
        write_corpus(folder)
        return call(load_ratings, write_ratings(folder, **variables))

    return make


def of_ratings_bytes(change):
    def write(folder):
        write_corpus(folder)
        return write_ratings(folder)

    return of_bytes(change, load_ratings, write)


def flipped(byte, bit):
    def change(data):
        data = bytearray(data)
        data[byte] ^= 1 << bit
        return bytes(data)

    return change


NOT_MATLAB = "is not a MATLAB file, is cut short or is damaged .*; download it again"
MATLAB_CASES = cases(
    "load_phac2(ratings_path)",
    (
        "no file",
        FileNotFoundError,
        "There is no file .*missing.mat; give the path of one",
        lambda folder: call(
            load_phac2, write_corpus(folder), ratings_path=folder / "missing.mat"
        ),
    ),
    ("an empty file", OSError, NOT_MATLAB, of_ratings_bytes(cut(0))),
    ("a text file", OSError, NOT_MATLAB, of_ratings_bytes(lambda _: b"a,b\n" * 99)),
    ("zeros", OSError, NOT_MATLAB, of_ratings_bytes(lambda _: bytes(500))),
    *(
        (
            f"a file cut at {share:.0%}",
            OSError,
            NOT_MATLAB,
            of_ratings_bytes(cut(share)),
        )
        for share in (0.05, 0.07, 0.08, 0.1, 0.5, 0.99)
    ),
    (
        "HDF5 that is cut short",
        OSError,
        DAMAGED,
        of_ratings_bytes(lambda _: b"MATLAB 7.3 MAT-file" + bytes(493) + b"\x89HDF"),
    ),
    *(
        (given, OSError, NOT_MATLAB, of_ratings_bytes(flipped(*place)))
        for given, place in [
            ("a variable of unknown type", (128, 6)),
            ("a variable larger than the file", (134, 3)),
            ("values of unknown type", (192, 6)),
            ("values that are said to be a variable", (192, 1)),
            ("values larger than the variable", (199, 3)),
            ("a class that is none", (144, 7)),
            ("dimensions that are not those of the values", (160, 6)),
        ]
    ),
    *(
        (given, ValueError, message, rating(**variables))
        for given, message, variables in [
            (
                "no array of ratings",
                "has no ratings that can be told by shape: .* It has",
                {"a": np.ones(3)},
            ),
            (
                "ratings above 5",
                "has no ratings that can be told by shape",
                {"a": RATINGS + 3},
            ),
            (
                "negative ratings",
                "has no ratings that can be told by shape",
                {"a": RATINGS - 3},
            ),
            (
                "ratings in fractions",
                "has no ratings that can be told by shape",
                {"a": RATINGS / 2},
            ),
            (
                "counts that 64 bits do not hold",
                "has a count of 1e\\+19, which no 64-bit .*; divide the counts by",
                {"a": np.eye(5)[None, [0, 1] * 5].repeat(2, axis=0) * 1e19},
            ),
            (
                "infinite ratings",
                "has no ratings that can be told by shape",
                {"a": replaced(RATINGS, np.inf, (0, 0, 0))},
            ),
            (
                "complex ratings",
                "has no ratings that can be told by shape",
                {"a": RATINGS * 1j},
            ),
            (
                "two arrays of ratings",
                "can be read in several ways: .* Save one numeric array",
                {"a": RATINGS, "b": RATINGS[::-1]},
            ),
            (
                "two vectors of ids",
                r"several vectors that could be object ids: .*; keep one",
                {"a": RATINGS, "b": [114, 602], "c": [602, 114]},
            ),
            (
                "ids that lack an object",
                "has no ratings of object 602; .* Leave the object's trials out",
                {"a": RATINGS, "ids": [114, 603], "names": WORDS},
            ),
            (
                "an object that nobody rated",
                "has no .* rating of object 114; leave the object's trials out",
                {"a": RATINGS * [[[0]], [[1]]], "ids": [114, 602], "names": WORDS},
            ),
        ]
    ),
)


# Studies


def no_corpus(**_):
    raise AssertionError("The corpus is loaded before the settings are checked.")


STUDY = {"procedures": ["hold"], "sensors": ["pdc"], "verbose": False}


def studying(corpus=no_corpus, **settings):
    return lambda folder: call(run_study, corpus, folder / "study", **STUDY | settings)


def study_with(files, function):
    """Call on a folder with the files of a study, given by name."""

    def make(folder):
        for name, data in files.items():
            path = folder / "study" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return function(folder)

    return make


def reading(files):
    return study_with(files, lambda folder: call(read_study, folder / "study"))


def unit(record, **files):
    """Files of a study with one unit of models."""
    return {"study.json": b"{}", "models/hold_hard_0.json": record} | files


def bare_corpus(**_):
    corpus = make_haptic_corpus(2, 1, sensors=["pdc"], random_state=0)
    corpus.ratings = {}
    return corpus


def a_file(folder):
    path = folder / "study"
    path.write_bytes(b"")
    return path


DAMAGED_UNIT = "^The unit of .* is missing or damaged; run_study with its settings"
STUDY_CASES = [
    *cases(
        "run_study",
        *(
            (f"{name}={value!r}", ValueError, message, studying(**{name: value}))
            for name, value, message in [
                ("n_splits", 0, wrong_type("n_splits")),
                ("n_repeats", 1.5, wrong_type("n_repeats")),
                ("n_starts", 0, wrong_type("n_starts")),
                ("split", "random", wrong_type("split")),
                (
                    "n_hidden",
                    [0],
                    r"^n_hidden=\[0\] must list whole numbers of at least",
                ),
                (
                    "n_hidden",
                    [],
                    r"^n_hidden=\[\] must list whole numbers of at least 1",
                ),
                ("alpha", [-1.0], r"^alpha=\[-1.0\] must list numbers of at least 0"),
                ("alpha", ["low"], r"^alpha=\['low'\] must list numbers of at least 0"),
                ("alpha", [np.nan], r"^alpha=\[nan\] must list numbers of at least 0"),
                ("sensors", ["force"], "^Unknown sensor 'force'; PHAC-2 has 5"),
                ("procedures", ["tap"], "^Unknown procedure 'tap'; PHAC-2 has 4"),
                ("random_state", "zero", wrong_type("random_state")),
            ]
        ),
        (
            "a regressor without an NNPOM",
            ValueError,
            "^regressor has the estimator LogisticRegression.*; give it an NNPOM",
            studying(regressor=DistributionalOrdinalRegressor(LogisticRegression())),
        ),
        (
            "a corpus that is no function",
            ValueError,
            wrong_type("corpus"),
            studying(corpus=[1, 2]),
        ),
        (
            "a corpus without ratings",
            ValueError,
            "^The corpus has no ratings; give load_phac2 the file as ratings_path",
            studying(corpus=bare_corpus),
        ),
        (
            "a file in place of the folder",
            OSError,
            "study is no folder that can be written; give another",
            lambda folder: call(run_study, no_corpus, a_file(folder), **STUDY),
        ),
        (
            "a folder of other settings",
            ValueError,
            "holds a study with .*, not .*; give the same .*, or another folder",
            study_with({"study.json": b'{"sensors": ["pac"]}'}, studying()),
        ),
        (
            "settings that are cut short",
            ValueError,
            "study.json is damaged .*; restore it, or run the study in another",
            study_with({"study.json": b'{"sensors": ["pa'}, studying()),
        ),
        (
            "settings that are a list",
            ValueError,
            "study.json is damaged .*; restore it, or run the study in another",
            study_with({"study.json": b"[1, 2]"}, studying()),
        ),
        (
            "units without settings",
            ValueError,
            "holds units of a study, but no study.json .*; restore that file",
            study_with({"trials/hold.csv": b"trial\n"}, studying()),
        ),
    ),
    *cases(
        "read_study",
        *(
            (given, ValueError, message, reading(files))
            for given, message, files in [
                ("no study", "holds no study: study.json is missing; run_study", {}),
                (
                    "settings of random bytes",
                    "study.json is damaged .*; restore it",
                    {"study.json": b"\xff\xfe\x00"},
                ),
                (
                    "settings that are a number",
                    "study.json is damaged .*; restore it",
                    {"study.json": b"3"},
                ),
                (
                    "no finished models",
                    "has no finished models yet; run_study makes them",
                    {"study.json": b"{}"},
                ),
                ("an empty record", DAMAGED_UNIT, unit(b"")),
                ("a record that is a list", DAMAGED_UNIT, unit(b"[1]")),
                ("a record of another form", DAMAGED_UNIT, unit(b'{"a": 1}')),
                (
                    "a record without its table",
                    DAMAGED_UNIT,
                    unit(b'{"file": "hold_hard_0.csv", "sha256": "0"}'),
                ),
                (
                    "a record of a file elsewhere",
                    DAMAGED_UNIT,
                    unit(b'{"file": "../study.json", "sha256": "0"}'),
                ),
                (
                    "a table of another checksum",
                    DAMAGED_UNIT,
                    unit(
                        b'{"file": "hold_hard_0.csv", "sha256": "0"}',
                        **{"models/hold_hard_0.csv": b"rps\n0.1\n"},
                    ),
                ),
                (
                    "a record whose file is a folder",
                    DAMAGED_UNIT,
                    unit(
                        b'{"file": "hold", "sha256": "0"}',
                        **{"models/hold/table.csv": b"rps\n"},
                    ),
                ),
            ]
        ),
    ),
]


# Input large enough to see how much memory its refusal takes

LARGE = np.random.default_rng(0).normal(size=(200_000, 8))
LARGE_COUNTS = np.ones((200_000, 8))
LARGE_CASES = [
    *cases(
        "NNPOM.fit",
        (
            "NaN in the last row",
            ValueError,
            "X contains NaN",
            lambda _: call(NNPOM().fit, replaced(LARGE, np.nan, -1), LARGE_COUNTS),
        ),
        (
            "a negative count in the last row",
            ValueError,
            "^y has a negative count",
            lambda _: call(NNPOM().fit, LARGE, replaced(LARGE_COUNTS, -1, -1)),
        ),
        (
            "masked values",
            ValueError,
            "^X has masked values",
            lambda _: call(NNPOM().fit, masked(LARGE), LARGE_COUNTS),
        ),
        (
            "numbers as text",
            ValueError,
            "^X is not an array of numbers",
            lambda _: call(NNPOM().fit, text(LARGE[:20_000]), LARGE_COUNTS[:20_000]),
        ),
    ),
    *cases(
        "KSVDTransformer.fit",
        (
            "infinity in the last sample",
            ValueError,
            "Trial 0 of X contains NaN or infinity",
            lambda _: call(
                KSVDTransformer(window=9).fit, [replaced(LARGE, np.inf, -1)]
            ),
        ),
    ),
    *cases(
        "TemporalMaxPool.fit",
        (
            "a trial of other channels",
            ValueError,
            "Trial 1 of X has 7 channels",
            lambda _: call(TemporalMaxPool().fit, [LARGE, LARGE[:, :7]]),
        ),
    ),
    *cases(
        "ranked_probability_score",
        (
            "a row that does not sum to 1",
            ValueError,
            "^y_proba is no distribution",
            lambda _: call(ranked_probability_score, LARGE_COUNTS, LARGE_COUNTS),
        ),
    ),
    *cases(
        "inverse_cdf",
        (
            "a trial that nobody rated",
            ValueError,
            "^counts has no ratings in trial 199999",
            lambda _: call(inverse_cdf, replaced(LARGE_COUNTS, 0, -1), 0.5),
        ),
    ),
]

CASES = [
    *TABLE_CASES,
    *TRIAL_CASES,
    *RATINGS_CASES,
    *FIT_CASES,
    *PARAMETER_CASES,
    *SETTING_CASES,
    *FUNCTION_CASES,
    *PLOT_CASES,
    *HDF5_CASES,
    *MATLAB_CASES,
    *STUDY_CASES,
]
