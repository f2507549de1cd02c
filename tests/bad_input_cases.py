"""Bad input as data: each check once, asked of everything that takes the argument.

A check is what is given in words, the bad value and, last, a pattern of the message.
`ask` puts checks to callers, functions that turn a bad value into a call, and so
fills `CASES`, the whole table.
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
from sklearn.base import clone
from sklearn.compose import ColumnTransformer, make_column_transformer
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression, Ridge
from sklearn.model_selection import RepeatedKFold
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.utils import Bunch

from sklearn_haptic import (
    NNPOM,
    ConformalRatings,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    DummyDistribution,
    KSVDTransformer,
    NoveltyGuard,
    RegressedDistribution,
    RepairTrials,
    SensorFusionNNPOM,
    Sequences,
    Signal,
    SignalStatistics,
    STHMPTransformer,
    TaxelGrid,
    TemporalMaxPool,
    TouchPool,
    make_haptic_pipeline,
    metrics,
    model_selection,
    plotting,
    ratings,
    resample_trials,
    streaming,
)
from sklearn_haptic.datasets import (
    MatlabRatings,
    describe_corpus,
    load_phac2,
    make_haptic_corpus,
)
from sklearn_haptic.ratings import RatingTable
from sklearn_haptic.study import (
    compare_networks,
    read_study,
    run_study,
    score_table,
)


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


class Check(NamedTuple):
    """A bad value and the pattern of its message, in which ARG is the argument."""

    given: str
    message: str
    args: tuple
    kwargs: dict
    error: type


def call(function, *args, **kwargs):
    return Call(function, args, kwargs)


def check(given, *args, says=None, error=ValueError, **kwargs):
    """Check whose message comes last: as `says` after what is given by name."""
    if says is None:
        *args, says = args
    return Check(given, says, tuple(args), kwargs, error)


def wrong_type(name):
    return f"'{name}' parameter of .* must be"


def settings(name, *values, says=None):
    """Checks of a parameter that is not of its type or in its range."""
    says = says or wrong_type(name)
    return [check(f"{name}={value!r}", says=says, **{name: value}) for value in values]


def wrong(**params):
    """Checks of parameters of which each is not of its type or in its range."""
    return [each for name, value in params.items() for each in settings(name, value)]


CASES = []


def ask(callers, *checks, arg="", in_folder=False):
    """Put every check to every caller, as the argument `arg` if it has several."""
    for called, caller in callers.items():
        for given, says, args, kwargs, error in checks:

            def make(folder, caller=caller, args=args, kwargs=kwargs):
                return caller(*([folder] if in_folder else []), *args, **kwargs)

            label = f"{arg}: {given}" if arg else given
            CASES.append(Case(called, label, error, says.replace("ARG", arg), make))


def name_of(function):
    """Name of a function, or of a method with that of the class it is called on."""
    owner = getattr(function, "__self__", None)
    if owner is None:
        return function.__name__
    owner = owner if isinstance(owner, type) else type(owner)
    return f"{owner.__name__}.{function.__name__}"


def direct(*functions, **kwargs):
    """Callers that pass the bad value on, beside what is given here."""
    return {name_of(each): partial(call, each, **kwargs) for each in functions}


def by_name(name, callers):
    """Callers that pass the bad value on by its name."""

    def give(caller, bad):
        return caller(**{name: bad})

    return {called: partial(give, each) for called, each in callers.items()}


# Good input, from which the bad is made

N = 12
X = np.random.default_rng(0).normal(size=(N, 4))
NAMES = ["pac__0", "pac__1", "tdc__0", "tdc__1"]
TABLE = pd.DataFrame(X, columns=NAMES)
COUNTS = np.random.default_rng(1).integers(1, 9, size=(N, 3))
TWO = np.stack([COUNTS, COUNTS], axis=1)
LABELS = np.tile([1, 2, 3], N // 3)
PROBA = np.full((N, 3), 1 / 3)
OBJECTS = np.repeat(np.arange(N // 2), 2)
TRIALS = [np.random.default_rng(i).normal(size=(8 + i, 19)) for i in range(4)]
SENSORS = {"pac": [0, 1], "tdc": [2, 3]}


def replaced(values, value, index=None, dtype=None):
    """Copy of an array with one entry replaced, by default the first of row 1."""
    values = np.array(values, dtype=dtype or np.result_type(values, type(value)))
    values[(1, *[0] * (values.ndim - 1)) if index is None else index] = value
    return values


def masked(values):
    mask = np.zeros(np.shape(values), dtype=bool)
    mask.flat[-1] = True
    return np.ma.MaskedArray(values, mask)


def named(trial):
    return pd.DataFrame(trial).add_prefix("x")


# Estimators

CODERS = {
    "KSVDTransformer": partial(KSVDTransformer, 3, max_iter=1, n_nonzero_coefs=1),
    "STHMPTransformer": partial(STHMPTransformer, 3, max_iter=1, n_nonzero_coefs=1),
    "TemporalMaxPool": partial(TemporalMaxPool, (2, 1)),
    "SignalStatistics": partial(SignalStatistics, n_bands=2),
}
TRIAL_CODERS = {
    "KSVDTransformer(window)": partial(CODERS["KSVDTransformer"], window=4),
    "STHMPTransformer(trials)": partial(CODERS["STHMPTransformer"], spatial_cells=[1]),
    "TemporalMaxPool(trials)": CODERS["TemporalMaxPool"],
    "SignalStatistics(trials)": CODERS["SignalStatistics"],
}
ORDINAL = {
    "NNPOM": partial(NNPOM, n_hidden=0),
    "DistributionalOrdinalRegressor": DistributionalOrdinalRegressor,
}
LABELLED = ORDINAL | {"SensorFusionNNPOM": partial(SensorFusionNNPOM, SENSORS)}
DUMMY = {"DummyDistribution": DummyDistribution}
REGRESSED = {"RegressedDistribution": partial(RegressedDistribution, Ridge())}
BLEND = {"DistributionBlend": partial(DistributionBlend, [("linear", NNPOM(0))])}
TOUCH_POOL = {"TouchPool": partial(TouchPool, [("linear", NNPOM(0), [0, 1])])}
GUARD = {
    "NoveltyGuard": partial(NoveltyGuard, make_pipeline(StandardScaler(), NNPOM(0)))
}
CONFORMAL = {"ConformalRatings": partial(ConformalRatings, NNPOM(0))}
GOOD = {"X": X, "y": COUNTS}


@cache
def fitted(name, names=False):
    """An estimator fitted to an array, to named columns or, a coder, to trials."""
    if name in TRIAL_CODERS:
        return TRIAL_CODERS[name]().fit(TRIALS)
    return (CODERS | LABELLED | REGRESSED)[name]().fit(TABLE if names else X, COUNTS)


def fitting(estimators, arg="X", **given):
    """Callers of `fit`, which give the bad value as `arg` and set parameters."""

    def fit(estimator, /, *bad, **params):
        arguments = GOOD | given | dict(zip([arg], bad))
        return call(estimator().set_params(**params).fit, **arguments)

    return {f"{name}.fit": partial(fit, each) for name, each in estimators.items()}


def using(estimators, method, *given, names=False):
    """Callers of a method of fitted estimators."""

    def use(name, *bad):
        return call(getattr(fitted(name, names), method), *given, *bad)

    return {f"{name}.{method}": partial(use, name) for name in estimators}


# fmt: off
# From here tables, of which a formatter would put each check on five lines.

# Arrays of numbers, and tables of features

def not_numbers(good, *without):
    """Checks of an argument that is an array of numbers, made of a good one."""
    good = np.asarray(good)
    checks = [
        check("NaN", replaced(good, np.nan), "ARG contains NaN"),
        check("infinity", replaced(good, -np.inf), "ARG contains (NaN or )?infinity"),
        check("text", good.astype(str), "^ARG is not an array of numbers .*text"),
        check("dates", good.astype("M8[D]"), "^ARG is not an array of numbers"),
        check("masked values", masked(good), "^ARG has masked values, .*; fill or"),
        check("complex numbers", good + 0j, "^Complex data not supported: ARG is not"),
    ]
    return [each for each in checks if each.given not in without]


NO_TRIALS = check("no trials", [],
    "^X (is empty; give at least|has no trials; give at least|is a list; give a Data)")
NOT_A_TABLE = [
    *not_numbers(X),
    NO_TRIALS,
    check("a column of dates", TABLE.assign(when=[date(2020, 1, 1)] * N),
        "^X is not an array of numbers .column 'when' holds .*; convert it"),
    check("a sparse matrix", sparse.csr_array(X), error=TypeError,
        says=r"Sparse data was passed for X, .* Use '\.toarray\(\)'"),
    check("one dimension", X[:, 0], "Expected 2D array, got 1D .*Reshape"),
]
NOT_FEATURES = [
]
OTHER_COLUMNS = [
    check("a column less", X[:, :3], "3 features, but .* expecting 4"),
]
OTHER_NAMES = [
    check("names swapped", TABLE[NAMES[::-1]], "Feature names must be in the same"),
]
ask(fitting(LABELLED | REGRESSED), *NOT_A_TABLE, *NOT_FEATURES, arg="X")
ask(fitting(CODERS, y=None), *NOT_A_TABLE, arg="X")
ask(using(LABELLED | REGRESSED, "predict_proba") | using(CODERS, "transform"),
    *NOT_A_TABLE[:1], *OTHER_COLUMNS, arg="X")
ask(using(LABELLED | REGRESSED, "predict_proba", names=True), *OTHER_NAMES, arg="X")
ask(using(CODERS, "transform", names=True), *OTHER_NAMES, arg="X")

# Collections of trials

NO_TRIAL = "^Trial 1 of X is .*, not an array of shape .*; give its recording or leave"
SEVERAL = "^X has 2 columns, of which .* hold trials; choose one with ColumnTransformer"
def in_a_trial(callers):
    """Callers that give the bad value as the second of several trials."""
    return {
        called: lambda bad, caller=caller: caller([TRIALS[0], bad, *TRIALS[2:]])
        for called, caller in callers.items()
    }


IN_A_TRIAL = [
    *not_numbers(TRIALS[1]),
    check("dicts", np.full((9, 19), {"a": 1}, dtype=object), "^ARG is not an array"),
    check("rows of unequal length", [[1.0] * 19, [2.0] * 18],
        "^ARG is no array of one shape; give rows of equal length"),
    check("no samples", np.empty((0, 19)), "^ARG has 0 time samples, but at least"),
    check("no channels", np.empty((9, 0)), "^ARG has shape .9, 0., which holds no"),
    check("other channels", TRIALS[1][:, :18], "^ARG has 18 channels, but 19"),
    check("None in its place", None, NO_TRIAL),
    check("times and channels exchanged", TRIALS[1].T,
        r"^Trial 2 of X has .* shape \(10, 19\)|^ARG has 9 channels, but 19"),
]
NOT_TRIALS = [
    check("trials of other column names",
        [named(TRIALS[0]), named(TRIALS[1]).rename(columns={"x3": "force"})],
        "^Trial 1 of X and the first trial differ in the column 'x3'; give all trials"),
    check("several sensors", pd.DataFrame({"a": TRIALS, "b": TRIALS}), SEVERAL),
    check("objects of two columns", pd.DataFrame({"a": TRIALS, "b": TRIALS}).to_numpy(),
        SEVERAL),
]
ask(fitting(TRIAL_CODERS, y=None), *NOT_TRIALS, NO_TRIALS, arg="X")
ask(in_a_trial(fitting(TRIAL_CODERS, y=None)), *IN_A_TRIAL, arg="Trial 1 of X")
ask(in_a_trial(using(TRIAL_CODERS, "transform")),
    *(each for each in IN_A_TRIAL if each.given in ("NaN", "other channels")),
    arg="Trial 1 of X")

# Ratings, for every estimator, score and display that takes them

NOT_COUNTS = [
    *not_numbers(COUNTS, "dates"),
    check("a negative count", replaced(COUNTS, -1), "^ARG has a negative count in"),
    check("a trial that nobody rated", replaced(COUNTS, 0, 1),
        "^ARG has no ratings in trial 1; remove trials"),
    check("counts whose sum overflows", replaced(COUNTS, 1e308, 1),
        "^ARG has counts whose sum overflows in trial 1; divide .* by a constant"),
    check("a column of objects beside columns of counts",
        pd.DataFrame(COUNTS, columns=[1, 2, 3]).reset_index(names="object"),
        r"columns of ARG are \['object', 1, 2, 3\]; label .* leave out columns"),
    check("a column of dates beside columns of counts",
        pd.DataFrame(COUNTS, columns=["lo", "mid", "hi"]).assign(day=date(2020, 1, 1)),
        r"^ARG is not an array of numbers \(column 'day' holds text or dates\)"),
    check("digits of a question", pd.DataFrame(
        COUNTS, columns=["Q1.1", "Q1.2", "Q1.3"]),
        r"'Q1.1' may be the level 1.1 or 1; label them with the levels alone"),
    check("two columns of one level", pd.DataFrame(COUNTS, columns=[1, 2, "2"]),
        "^ARG has two columns 2; give one column per level"),
]
NOT_RATINGS = [
    *NOT_COUNTS,
    check("labels of which one is NaN", replaced(LABELS, np.nan), "contains NaN"),
    check("continuous labels", [1.0, 2.5, *range(10)],
        "^Unknown label type: .* has continuous ratings, such as 2.5 in"),
    check("ratings as words and numbers", ["soft", *LABELS.tolist()[:-2], 1],
        "^ARG has 1 in trial 1; give one number or one word per trial"),
    check("ratings of which one is None", replaced(LABELS, None, dtype=object),
        "contains NaN or None in trial 1; remove trials without a rating"),
    check("dates as ratings", LABELS.astype("M8[D]"), r"^ARG has datetime.* in trial"),
    check("a dict of ratings", {"rough": COUNTS},
        "^ARG is a dict, which is no array; give a list, an array|array-like"),
    check("a trial less", COUNTS[:-1],
        r"inconsistent numbers of samples: \[12, 11\]|give one row per trial in both"),
    check("nothing", None,
        "is no array but .*; give one rating or|target y is None|array-like. Got None"),
]
RATED = LABELLED | DUMMY | REGRESSED
SCORES = direct(
    metrics.ranked_probability_score, metrics.earth_movers_distance,
    metrics.log_score, metrics.macro_mae, metrics.pit_histogram,
    metrics.dispersion, y_true=COUNTS, y_proba=PROBA)
FUNCTIONS_OF_COUNTS = direct(
    ratings.interrater_agreement, ratings.rating_distribution, ratings.rating_cdf,
    ratings.rating_mean, ratings.shrink_counts
) | direct(ratings.inverse_cdf, p=0.5)
ask(fitting(RATED, "y") | fitting(BLEND, "y", groups=OBJECTS), *NOT_RATINGS, arg="y")
ask(by_name("y_true", SCORES), *NOT_RATINGS, arg="y_true")
ask(FUNCTIONS_OF_COUNTS, *NOT_COUNTS,
    arg="counts")

# Predicted distributions, weights and objects

NOT_PROBA = [
    *not_numbers(PROBA, "dates", "infinity"),
    check("a row that does not sum to 1", replaced(PROBA, 0.9),
        "^ARG is no distribution in trial 1 .*: give probabilities"),
    check("a column less", PROBA[:, :2] * 1.5, r"^ARG has shape \(12, 2\), but"),
]
NOT_WEIGHTS = [
    *not_numbers(np.ones(N), "dates", "complex numbers"),
    check("a negative weight", -np.ones(N), "Negative values in data passed to `ARG`"),
    check("a sum that overflows", np.full(N, 1e308), "The sum of ARG overflows"),
    check("a weight less", np.ones(N - 1), r"ARG.shape == \(11,\), expected \(12,\)"),
]
NO_OBJECT = "^ARG has no object in (trial|row) 1; name the object of every (trial|row)"
NOT_OBJECTS = [
    check("None", ["a", None, *"bcdefghijk"], NO_OBJECT),
    check("masked objects", masked(OBJECTS), "^ARG has masked values"),
    check("a trial less", OBJECTS[1:], r"inconsistent numbers of samples: \[12, 11\]"),
]
OTHER_LEVELS = check("levels of another number", levels=[1, 2],
    says="^ARG has 3 columns of counts, but there are 2 levels: give one column")


def fusion(sensors=SENSORS, held_out=None):
    return DistributionalOrdinalRegressor(SensorFusionNNPOM(sensors, held_out=held_out))


CROSS_VALIDATION = direct(model_selection.cross_val_predict_proba,
    estimator=DummyDistribution(), X=X, y=COUNTS)
ask(CROSS_VALIDATION,
    check("a model of sliders", estimator=ContinuousRatingsRegressor(), y=X[:, 0],
        says="^ContinuousRatingsRegressor has no predict_proba, from which"),
    check("a method of another model", estimator=Ridge(), method="predict_quantile",
        says="^Ridge has no predict_quantile; set another method, or give a model of"))
MODEL_REPORT = direct(model_selection.model_report,
    model=DummyDistribution(), X=X, y=COUNTS)
ask(MODEL_REPORT,
    check("a regressor", model=Ridge(), says="^Ridge has no predict_proba, give it to "
        "a DistributionalOrdinalRegressor as estimator, or give a classifier"),
    check("no adjectives", y={}, says="^y has no adjectives; give the ratings of"),
    check("ratings of fewer trials", y={"hard": COUNTS[1:]},
        says=r"inconsistent numbers of samples: \[12, 11\]"),
    check("a trial tested twice", cv=RepeatedKFold(n_splits=3, n_repeats=2),
        says="^cv tests trial 0 2 times; choose a splitter"),
    *wrong(model=3, cv="five"))
CONTRIBUTIONS = direct(model_selection.sensor_contributions,
    model=fusion(), X=X, y=COUNTS)
CALIBRATION = direct(plotting.PITHistogramDisplay.from_predictions,
    plotting.ReliabilityDisplay.from_predictions, y_true=COUNTS, y_proba=PROBA)
ask(by_name("y_proba", SCORES), *NOT_PROBA, arg="y_proba")
ask(by_name("sample_weight", SCORES), *NOT_WEIGHTS, arg="sample_weight")
ask(fitting(RATED, "sample_weight")
    | fitting(BLEND, "sample_weight", groups=OBJECTS),
    *NOT_WEIGHTS, arg="sample_weight")
ask(fitting(LABELLED | BLEND, "groups")
    | by_name("groups", CROSS_VALIDATION | MODEL_REPORT | CONTRIBUTIONS | CALIBRATION),
    *NOT_OBJECTS, arg="groups")
ask(fitting(LABELLED | BLEND, "groups"),
    check("text and numbers", ["a", *range(1, N)], "^groups mixes text with"),
    check("two columns", np.ones((N, 2)), "^groups has shape .*, one per trial"),
    check("one number", 3, r"^groups has shape \(\); give the object of each"),
    arg="groups")

# Levels and several adjectives

ask(fitting(ORDINAL | DUMMY, "y"),
    check("a rating outside levels", LABELS, levels=[1, 2],
        says=r"^y has the rating 3 in trial 2, .* levels=\[1, 2\]; add it to"),
    check("counts with columns of other levels",
        pd.DataFrame(COUNTS, columns=[1, 2, 4]), levels=[1, 2, 3],
        says=r"^The columns of y are \[1, 2, 4\], but the levels are \[1, 2, 3\]"),
    *settings("levels", [1, 1, 2], [], says=r"^levels=\[.*\] must be distinct and at"),
    *settings("levels", [[1, 2], [3, 4]], says=r"^levels=\[\[1, 2\], \[3, 4\]\] must"))
ask(fitting(ORDINAL, "y"),
    check("no adjective", np.empty((N, 0, 3)), r"^y has shape \(12, 0, 3\), no"),
    check("ratings of adjectives", np.ones((N, 2, 1)), r"^y .*\(12, 2, 1\), counts of"),
    check("an adjective that nobody rated", replaced(TWO, 0, (2, 1)),
        r"^y\[:, 1\] has no ratings in trial 2; remove trials"),
    check("NaN in an adjective", replaced(TWO, np.nan, (2, 1, 0)),
        r"y\[:, 1\] contains NaN"))

# Parameters

PARAMETERS = {
    KSVDTransformer: {
        "n_atoms": (0, 2.5, "many"), "n_nonzero_coefs": (0, None), "window": (0, 2.5),
        "overlap": (1.0, -0.1, "half"), "update": ("fast",), "max_iter": (-1,),
        "tol": (-1.0, 1.0, np.nan), "max_train_windows": (0,), "sign": ("both", None),
        "remove_mean": ("yes",), "random_state": ("zero",), "memory": (3,),
    },
    STHMPTransformer: {"layout": ("palm", 3), "n_atoms": (-1,),
        "max_train_patches": (0,), "normalise": ("l2",)},
    TemporalMaxPool: {"split": ("half",), "memory": (3,), "statistics": (3,)},
    SignalStatistics: {"statistics": (3,), "n_bands": (0, 1.5), "rate": (0, "fast")},
    RepairTrials: {"rest": (0, 2.5, "two"), "limits": (3, "all")},
    NNPOM: {
        "n_hidden": (-1, 1.5, None), "alpha": (-1.0, np.nan, "auto"),
        "gaps": ("exp",), "solver": ("adam",), "max_iter": (0,), "tol": (-1.0,),
        "early_stopping": ("yes",), "n_iter_no_change": (0,),
        "validation_fraction": (0.0, 1.0),
    },
    DistributionalOrdinalRegressor: {
        "estimator": ("nnpom", 3), "n_duplicates": (0, 1.5), "sampling": ("grid",),
        "p_transform": ("probit",),
        "decode": ("mean",), "rule": ("mean",), "n_quantiles": (0,),
    },
    SensorFusionNNPOM: {
        "sensors": (["pac"],), "estimator": (LogisticRegression(),),
        "final_estimator": (LogisticRegression(),), "held_out": (0,),
    },
    DummyDistribution: {"strategy": ("mean",)},
    RegressedDistribution: {"estimator": ("trees", 3)},
}
for estimator, parameters in PARAMETERS.items():
    for name, values in parameters.items():
        ask(fitting({estimator.__name__: estimator}), *settings(name, *values))

# Settings of transformers


@cache
def codes(sign, n_atoms=3):
    coder = KSVDTransformer(n_atoms, 1, window=4, sign=sign, max_iter=1, random_state=0)
    return coder.fit_transform([trial[:, :1] for trial in TRIALS])


KSVD = {"KSVDTransformer": partial(KSVDTransformer, 3, 1, max_iter=1)}
STHMP = {"STHMPTransformer": partial(STHMPTransformer, 3, 1, spatial_cells=(1,))}
POOL = {"TemporalMaxPool": TemporalMaxPool}
NO_IMAGES = r"^Trial 0 of X has shape \(8, .*\); it must be \(n_times, "
def remember_in_a_file(folder, *trials, name):
    path = folder / "recording"
    path.touch()
    coder = TRIAL_CODERS[name]().set_params(memory=str(path))
    return call(coder.fit_transform, *trials)


ask({name: partial(remember_in_a_file, name=name) for name in [*TRIAL_CODERS][:3]},
    check("a file to remember in", TRIALS, "^memory='.*recording' is no folder that"),
    in_folder=True)
ask(fitting(KSVD, y=None),
    check("trials, and window=None", TRIALS, "X is a collection of trials, but"),
    check("transposed trials", [np.ones((3, 99))] * 2, window=9,
        says=r"time samples, but one .* \(3, 99\) is taken for 3 .* channels; trans"),
    check("a table narrower than a window", window=9, says="^Trial 0 of X has 4 time"),
    check("an iterator over trials", iter(TRIALS), window=9,
        says="^X is a list_iterator, which is no array; give a list, an array"),
    check("dict_init of another shape", dict_init=X[:2], says=r"^dict_init has shape"),
    check("signals whose sums overflow", np.full((N, 4), 1.7e308),
        "X holds values so large that their sums overflow float64; divide X by"))
ask(by_name("dict_init", fitting(KSVD, y=None)), *not_numbers(X[:3]), arg="dict_init")
ask(by_name("layout", fitting(STHMP, X=TRIALS, y=None)),
    *not_numbers(np.ones((3, 3, 19))),
    check("two dimensions", np.eye(3), r"^layout has shape \(3, 3\); it must be"),
    arg="layout")
ask(fitting(STHMP, X=TRIALS, y=None),
    check("channels that are no multiple of the electrodes",
        [trial[:, :18] for trial in TRIALS],
        "X has 18 channels, which is no multiple of the 19 electrodes .*; select"),
    check("images, and a layout of electrodes", [np.ones((8, 5, 5))] * 2,
        NO_IMAGES + r"n_channels\)\. .* reshape\(len\(trial\), -1\)"),
    check("electrodes, and layout=None", layout=None, says=NO_IMAGES + "height"),
    check("patches larger than the images", patch_size=(9, 9),
        says=r"^patch_size=\(9, 9\) does not fit images of .*; use smaller patches"),
    *settings("patch_size", (3,), (0, 3), says=r"^patch_size=\(.*\) must be two"),
    *settings("spatial_cells", (0,), says=r"^spatial_cells=\(0,\) must list distinct"))
ask(using(["STHMPTransformer(trials)"], "transform"),
    check("a table after trials", X, "X is a table, but fit was given trials; give a"))
ask(fitting(POOL | {"SignalStatistics": SignalStatistics}, X=TRIALS, y=None),
    *settings("cells", (), (0,), (2, 2), (1.5,), ((1, 2),), ("a",),
        says=r"^cells=.* must list distinct positive integers, one per level"))
HUGE = [np.tile([[1.7e308, 1.7e308], [-1.7e308, 1.7e308]], (4, 1))] * 2
SUMS_OVERFLOW = "^X holds values so large that their sums overflow float64; divide X"
ask(fitting(POOL | {"SignalStatistics": SignalStatistics}, X=TRIALS, y=None),
    *settings("statistics", ["max", "sum"], says="^Unknown statistic 'sum'; .* has"),
    *settings("statistics", [], says="^No statistic is asked for; name at least one"))
ask({"TemporalMaxPool.transform": partial(call,
        TemporalMaxPool((1,), statistics=["mean"]).fit(HUGE).transform),
     "SignalStatistics.transform": partial(call,
        SignalStatistics().fit(HUGE).transform)},
    check("values whose sums overflow", HUGE, SUMS_OVERFLOW))
ask(using(["TemporalMaxPool", "SignalStatistics"], "transform"),
    check("trials after a table", TRIALS, "X is a collection of trials, but fit was"))
ask({"TemporalMaxPool.transform": lambda codes_of: call(
        TemporalMaxPool((1,)).fit(codes("split")).transform, codes_of())},
    check("codes of another transformer", partial(codes, "absolute", n_atoms=6),
        "Column 0 of X is named 'ch0_atom0', but 'ch0_atom0[+]' in fit; give"))
UNFITTED = DummyDistribution()
ask({"STHMPTransformer.transform": partial(call, STHMPTransformer().transform),
     "DummyDistribution.predict_proba": partial(call, UNFITTED.predict_proba)},
    check("trials before fit", TRIALS, "This .* instance is not fitted yet"))
ask(direct(NNPOM().predict),
    check("features before fit", X, "This NNPOM instance is not fitted yet"))

# Models

EARLY = "^Early stopping holds out 0.[16] of the "
ask(fitting({"NNPOM": partial(NNPOM, early_stopping=True)}, "groups"),
    check("one group", np.zeros(N), EARLY + "objects, .* there is 1, .*; give"))
ask(fitting({"NNPOM": partial(NNPOM, early_stopping=True)}, y=COUNTS[:1]),
    check("one trial", X[:1], EARLY + "trials, .* there is 1, .*; give"))
ask(direct(NNPOM(n_hidden=0).fit, X=X, y=COUNTS),
    check("weights and counts whose product underflows", y=COUNTS * 1e-200,
        sample_weight=np.full(N, 1e-200),
        says="^The total of y, times sample_weight, underflows; multiply"),
    check("weights and counts whose product overflows", y=COUNTS * 1e200,
        sample_weight=np.full(N, 1e200),
        says="^The total of y, times sample_weight, overflows; divide"),
    check("several adjectives, and n_hidden=0", y=TWO,
        says="^y has the ratings of several adjectives, which a NNPOM with n_hidden=0"),
    check("features whose variation is subnormal", X=X * 1e-310,
        says="X varies by no more than .*; give its features in a smaller unit"))
ask(direct(DistributionalOrdinalRegressor().fit, X=X, y=COUNTS),
    check("X_val, and no early stopping", X_val=X, y_val=COUNTS,
        says="X_val requires an estimator that stops early; use an NNPOM"),
    check("rows of masked counts", y=[*masked(COUNTS)], says="^y has masked values"),
    check("counts by value_counts", y=[pd.Series(each, [3, 1, 2]) for each in COUNTS],
        says=r"^y is a list of pandas Series, .*; give pandas.DataFrame\(y\), or arr"),
    check("rows of a table", X=[row for _, row in pd.DataFrame(X).iterrows()],
        says="^X is a list of pandas Series, whose labels a list does not keep; give "))
OWN_LEVELS = DistributionalOrdinalRegressor(NNPOM(0, levels=[1, 2, 3]))
ask(direct(OWN_LEVELS.fit, X=X, y=COUNTS),
    check("levels of the estimator inside",
        says=r"^estimator has levels=\[1, 2, 3\], which would be ignored; give them"))
STOPPING = DistributionalOrdinalRegressor(NNPOM(early_stopping=True))
ask(direct(STOPPING.fit, X=X, y=COUNTS),
    check("X_val without y_val", X_val=X, says="X_val and y_val belong together"),
    check("X_val of masked values", X_val=masked(X), y_val=COUNTS,
        says="^X has masked values"),
    check("y_val of other levels", X_val=X, y_val=COUNTS[:, :2],
        says="^y_val has 2 columns of counts, but there are 3 levels"),
    check("y_val of other trials", X_val=X, y_val=COUNTS[1:],
        says=r"inconsistent numbers of samples: \[12, 11\]"))
ask(direct(DistributionalOrdinalRegressor(NNPOM(n_hidden=-1)).fit, X=X, y=COUNTS),
    check("an estimator that cannot be", says="^The 'n_hidden' parameter of NNPOM"))
ask(direct(DistributionalOrdinalRegressor(LogisticRegression()).fit),
    check("several adjectives, and an estimator that cannot", X, TWO,
        "^y has the ratings of several adjectives, which .* cannot share; use an"))
PREDICT_AT = (using(["DistributionalOrdinalRegressor"], "predict_quantile", X)
              | using(["DistributionalOrdinalRegressor"], "predict_rating", X))
AT_POSITIONS = direct(metrics.macro_mae_at_positions, y_true=COUNTS, y_pred=COUNTS)
ask(PREDICT_AT | {name: lambda p, each=each: each(p=p)
                  for name, each in AT_POSITIONS.items()},
    *(check(f"p={p}", p, f"^p must be a number .* from 0 to 1; got {p}")
      for p in (1.5, -0.1, np.nan)),
    check("p=[[0.5]]", [[0.5]], r"^p must be a number or a list .*; got \[\[0"))
ask(using(["DistributionalOrdinalRegressor"], "sample", X),
    *(check(f"n_samples={n!r}", n, "^n_samples=.* must be a positive integer")
      for n in (-1, 0, 1.5, "many")))
ask(using(["DistributionalOrdinalRegressor"], "score", X),
    check("y with columns of other levels", pd.DataFrame(COUNTS, columns=[1, 2, 4]),
        r"^The columns of y_true are \[1, 2, 4\], but the levels are \[1, 2, 3\]"))
ask(fitting({"SensorFusionNNPOM": partial(SensorFusionNNPOM, SENSORS)}),
    check("no sensor", sensors={}, says="names no sensor; give the columns"),
    check("a sensor of no columns", sensors={"pac": []},
        says="sensors has columns for 'pac' that are not in X .*, or none; name"),
    *(check(f"a {what} that is not there", sensors={"pac": [column]},
          says="sensors has columns for 'pac' that are not in X .*; name some")
      for what, column in [("column", 9), ("name of a column", "force")]),
    check("held_out of an unknown sensor", held_out="tac",
        says=r"^held_out='tac' is not among the sensors .*; name one of them"),
    check("networks of some sensors only", estimator={"pac": NNPOM()},
        says=r"^estimator has networks for \['pac'\], but .*; give one network"),
    check("a network without hidden units", estimator=NNPOM(n_hidden=0),
        says="'pac' has n_hidden=0, so no activations .*; set it to at least 1"),
    check("a column without a prefix", TABLE.rename(columns={"pac__0": "force"}),
        sensors=None,
        says="Column 'force' of X has no prefix .*; rename it or set sensors"))
ask(fitting(REGRESSED, "y"),
    check("several adjectives", TWO, "^y has the ratings of several adjectives"))
NEAR = RegressedDistribution(KNeighborsRegressor(2))
ask(direct(NEAR.fit, X=X, y=COUNTS),
    check("weights that differ, and a regressor that takes none",
        sample_weight=np.arange(N),
        says="^KNeighborsRegressor takes no sample_weight, .*; give equal weights"))
ask(fitting(BLEND, groups=OBJECTS),
    check("no members", estimators=[], says=r"^estimators must be a list of one"),
    check("members without names", estimators=[NNPOM(0)],
        says=r"^estimators must be a list of one or more \(name, estimator"),
    check("a member called marginal", estimators=[("marginal", NNPOM(0))],
        says="^Names provided are not unique"),
    check("a regressor", estimators=[("ridge", Ridge())],
        says="^The member 'ridge', a Ridge, has no predict_proba, give it to a Distr"),
    check("a classifier of single labels", estimators=[("one", LogisticRegression())],
        says="^The member 'one', a LogisticRegression, or a step of it takes"),
    check("a member of other levels", estimators=[("a", NNPOM(0, levels=[3, 2, 1]))],
        says=r"^The member 'a' has the levels \[3, 2, 1\], but \[1, 2, 3\] are req"),
    check("folds that part objects", cv=[(np.arange(6, N), np.arange(7))],
        says="^cv trains on 3 in the fold that tests it; keep whole objects"),
    *wrong(estimators="models", cv="five", n_jobs=1.5))
ask(fitting(BLEND, "y", groups=OBJECTS),
    check("several adjectives", TWO, "^y has the ratings of several adjectives"))
ask(fitting(BLEND, "groups"),
    check("one object", np.zeros(N), "^DistributionBlend learns from held-out"))
ask(fitting({"DistributionBlend": partial(DistributionBlend, [("near", NEAR)])},
        "sample_weight", groups=OBJECTS),
    check("weights, and a member that takes none", np.ones(N),
        "^The member 'near' takes no sample_weight; give none, or enable metadata"))
ask(fitting(TOUCH_POOL, groups=OBJECTS),
    check("members without columns", estimators=[("a", NNPOM(0))],
        says=r"^estimators must be a list of one or more \(name, estimator, col"),
    check("two members of one name",
        estimators=[("a", NNPOM(0), [0]), ("a", NNPOM(1), [1])],
        says="^Names provided are not unique"),
    check("members of different levels",
        estimators=[("a", NNPOM(0, levels=[3, 2, 0]), [0]),
            ("b", NNPOM(0, levels=[3, 0, 2]), [0])],
        says=r"^The member 'b' has the levels \[3, 0, 2\], but \[3, 2, 0\] are req"),
    *wrong(estimators="models", cv="five", n_jobs=1.5))
ask(fitting(TOUCH_POOL, groups=OBJECTS),
    check("a column that is missing everywhere", np.full_like(X, np.nan),
        "^No training row has all columns of the member 'linear'; give rows that"))
ask(fitting(TOUCH_POOL, X=TABLE, groups=OBJECTS),
    check("a column that is not there", estimators=[("a", NNPOM(0), ["skin"])],
        says="^X has no column 'skin', only .'pac__0', .*; rename the one that is"))
ask(fitting(GUARD, groups=OBJECTS),
    check("no pipeline", estimator=NNPOM(0), says="^estimator is a NNPOM; give a"),
    *wrong(estimator="model", cv="five"))
ask(fitting(TOUCH_POOL | GUARD | CONFORMAL | BLEND | DUMMY), NO_TRIALS)
OF_OBJECTS = "samples: .12, 4.; give y one row per trial, which RatingTable.counts_for"
ask(fitting(TOUCH_POOL | GUARD | CONFORMAL | BLEND | LABELLED, "y"),
    check("ratings of objects", COUNTS[:4], OF_OBJECTS))
ask(fitting(TOUCH_POOL | GUARD | CONFORMAL, "y", groups=OBJECTS), *NOT_RATINGS,
    check("several adjectives", TWO, "^y has the ratings of several adjectives"),
    arg="y")
ask(fitting(TOUCH_POOL | GUARD | CONFORMAL, "groups"),
    check("one object", np.zeros(N), "there is 1 sample or"))
ask(fitting(CONFORMAL, groups=OBJECTS),
    check("a regressor without a distribution", estimator=Ridge(),
        says=r"^estimator=Ridge\(\) predicts no distribution; give a classifier with"),
    *wrong(estimator="model", method="jackknife", cv="five", n_jobs=1.5),
    check("no model that was fitted before", method="prefit", error=NotFittedError,
        says="^This NNPOM instance is not fitted yet"))
ask({f"ConformalRatings.{name}": lambda *bad, name=name: call(
        getattr(CONFORMAL["ConformalRatings"]().fit(X, COUNTS, groups=OBJECTS), name),
        X, *bad) for name in ("predict_set", "predict_interval", "predict_band")},
    *(check(f"alpha={alpha!r}", alpha, "^alpha=.* must be a number between 0 and 1, s")
      for alpha in (0, 1.0, float("nan"), "0.1", True)))
ask({"TouchPool.weights": lambda touches: call(
        TOUCH_POOL["TouchPool"]().fit(X, COUNTS, groups=np.arange(len(X))).weights,
        touches)},
    check("a member twice", [["linear", "linear"]], "^The member 'linear' is asked"))
ask(direct(describe_corpus),
    *(check(given, corpus, "^corpus has no trials; give what load_phac2 returns")
      for given, corpus in [
          *(("no trials", []), ("a dict of sensors", {"pac": TRIALS})),
          ("a table of numbers", pd.DataFrame(X)),
      ]),
    check("trials of other channels", [np.ones((3, 1)), np.ones((3, 2))],
        "^Trial 1 of X has .* expected, as in the first trial"),
    check("a trial without an object", TRIALS, objects=["a", "b", "c", None],
        says="^objects has no object in trial 3"),
    check("no ratings at all", TRIALS, ratings={"hard": np.zeros((4, 3))},
        says=r"^ratings\['hard'\] has no ratings at all; leave it out"),
    check("limits of an unknown sensor", TRIALS, limits={"acc": (0, 1)},
        says="^limits names the sensor 'acc', which is none of"),
    check("limits the wrong way round", TRIALS, limits=(1, 0),
        says=r"^limits=\(1, 0\) must be the lowest and the highest"))
ask(direct(make_haptic_corpus),
    check("an unknown procedure of a list", procedure=["hold", "tap"],
        says="^Unknown procedure 'tap'; the corpus has 4"))
ask(direct(Sequences),
    check("a number in place of trials", 3, ["x0"], error=(TypeError, ValueError),
        says="^trials|is not iterable"))
ask(direct(make_haptic_pipeline),
    check("a description that is none", {"skin": (4, 4)}, r"sensors\['skin'\]=\(4"),
    check("no sensor", [], "^sensors is empty; name a sensor or more"),
    check("numbers of sensors", {0: Signal(), 1: None}, "^sensors names 0; name sen"),
    check("no name", {"": Signal(), "acc": None}, "^sensors names ''; name sensors"))
ask(direct(Signal),
    *settings("rate", 0, -1.0, np.inf, "fast", says="^rate=.* must be a positive"),
    *settings("window", 0.01, says="^window=0.01 s must hold two samples or more at"))
ask(direct(TaxelGrid),
    *settings("layout", 4, "palm", (0, 4), (2.5, 2), np.eye(4), {},
        says=r"^layout=.* must be \(n_rows, n_columns\), an array of weights of"))
REPAIR = {"RepairTrials": RepairTrials}
ask(fitting(REPAIR, X=TRIALS, y=None),
    *settings("limits", (1, 0), (1,), (np.nan, 1), says="^limits=.* must be the"))
SKINS = pd.DataFrame({"skin": TRIALS})
ask(direct(make_haptic_pipeline(["skin"], random_state=0).fit, y=np.arange(4)),
    check("another column", SKINS.rename(columns={"skin": "palm"}),
        r"^X has no column 'skin', only \['palm'\]; rename the one that is meant"),
    NO_TRIALS)
ask({"pipeline of one sensor": partial(call, make_haptic_pipeline(None).fit, y=COUNTS)},
    NO_TRIALS)
ask(direct(SignalStatistics().fit),
    check("no recordings in a column", SKINS["skin"].iloc[:0], "^X holds no trials"))
ask(fitting(REPAIR, X=SKINS, y=None),
    *settings("rest", {"skin": 2.5}, {"skin": 0}, says="^rest=.* must be a number of"),
    *settings("limits", {"skn": (0, 1)}, says="^limits names the sensor 'skn'"))
ask(fitting(REPAIR, y=None),
    check("a sensor without any samples", [None, None], "^X holds no|Expected 2D|NaN"),
    check("text", [["a", "b"], ["c"]], "^Trial 0 of X is not an array of numbers"),
    check("arrays of rows, as of Parquet", [pd.Series([np.ones(2)] * 4).to_numpy()] * 3,
        "^Trial 0 of X is not an array of numbers"))
ask({"RepairTrials.transform": partial(call, RepairTrials().fit(SKINS).transform)},
    check("a sensor fewer", SKINS.rename(columns={"skin": "palm"}),
        r"^X has no column 'skin', only \['palm'\]; rename the one that is meant"),
    check("a list in place of a DataFrame", TRIALS, "^X is a list; give a DataFrame"))
ask({"resample_trials": lambda **bad: call(resample_trials,
        **({"trials": [[0.0, 1.0]], "times": [[0.0, 0.1]], "rate": 10} | bad))},
    *wrong(rate=[0, -1, np.nan, np.inf, "fast"], longest_gap=[0, -1.0, "long"]),
    check("several sensors", trials={"pac": [[0.0]]}, says="^trials is a dict"),
    check("stamps of fewer trials", times=[], says="^times has 0 entries, but there"),
    check("fewer stamps than samples", times=[[0.0]], says=r"^times\[0\] has shape"),
    *settings("times", [[0.1, 0.1]], [[0.1, 0.0]], [[0.0, np.nan]],
        says=r"^times\[0\] must be finite and increase from sample to sample; sort"),
    *wrong(unit=["h", None, 3]),
    check("one sample and no rate", trials=[[0.0]], times=[[0.0]], rate=None,
        says="^No trial has two samples, to tell a rate; give"),
    *settings("times", [[0.0]], [[[0.0], [0.1]]], [None], [0.1],
        says=r"^times\[0\] has shape .*, but trial 0 has 2 time samples; give one"),
    check("masked stamps", times=[np.ma.masked_array([0.0, 0.1], [0, 1])],
        says=r"^times\[0\] has masked values, which are no data; fill or remove"),
    check("periods", times=[pd.period_range("2026", periods=2).to_series()],
        says=r"^times\[0\] is not an array of numbers \(it holds text or dates\)"),
    check("no index of time", times=None, says="^Trial 0 has no index of time"),
    check("no such column", times="when", says="^Trial 0 has no column 'when' of"))

# Scores and ratings

OBJECT_WITHOUT_NAME = "^objects has no object in row 1; name the object of every row"
ALWAYS_THE_SAME = check(
    "an adjective always rated the same", replaced(X, 1.0, (slice(None), 0)),
    "^All ratings of 'x0' in the rows that have 'x1' too are equal, .*; leave one of")
ask(SCORES, OTHER_LEVELS,
    check("labels of fewer levels", y_true=np.minimum(LABELS, 2),
        says="and levels if nobody chose"), arg="y_true")
RATED_AT = direct(metrics.macro_mae_at_positions,
    y_true=COUNTS, y_pred=np.tile([1, 2, 3], (N, 1)), p=[0.2, 0.5, 0.8])
ask(by_name("y_true", RATED_AT), *NOT_RATINGS, arg="y_true")
ask(RATED_AT, OTHER_LEVELS, arg="y_true")
ask(by_name("sample_weight", RATED_AT), *NOT_WEIGHTS, arg="sample_weight")
ask(by_name("y_pred", RATED_AT),
    check("NaN", replaced(np.ones((N, 3)), np.nan), "^ARG has the rating nan in"),
    arg="y_pred")
ask(direct(metrics.neg_rps_scorer, metrics.neg_macro_mae_scorer, X=X, y=COUNTS),
    check("a rating that the estimator does not know", estimator=fitted("NNPOM"),
        y=replaced(LABELS, 9, 0),
        says=r"^y_true has the rating 9 in trial 0, .* levels=\[1, 2, 3\]; add it"),
    check("features of another number", estimator=fitted("NNPOM"), X=X[:, :3],
        says="3 features, but NNPOM is expecting 4"),
    check("a model of sliders",
        estimator=ContinuousRatingsRegressor(DummyDistribution()).fit(X, X[:, 0]),
        says="^ContinuousRatingsRegressor predicts no levels .* or score sliders by c"),
    check("counts of other adjectives", estimator=NNPOM(1, 10).fit(X, TWO),
        says=r"^y has shape \(12, 3\), but \(12, 2, 3\) is predicted; give counts"))
ask(direct(ratings.rating_counts),
    check("objects of another number", [1, 2], ["a", "b", "c"],
        r"inconsistent numbers of samples: \[2, 3\]"),
    check("an object that nobody rated", [1, None], ["a", "b"],
        "Nobody rated the object 'b'; remove its rows"),
    check("masked ratings", masked([1, 2]), ["a", "b"], "^ratings has masked values"),
    check("ratings in two dimensions", [[1, 2]], ["a"], "1d array"))
TABLE_OF_RATINGS = ratings.rating_counts([1, 2, 2], [3, 3, 5])
ask(direct(TABLE_OF_RATINGS.counts_for),
    check("an object that nobody rated", [3, 4, 5], r"^The table has no ratings of"),
    check("objects as text", ["3"], r"no ratings of objects \['3'\]; .* such as 3"),
    check("an object without a name", [3, None], OBJECT_WITHOUT_NAME))
ask(direct(ratings.rating_counts([1, 2], ["3", "5"]).counts_for),
    check("objects as numbers", [3], r"no ratings of objects \[3\]; .* such as '3'"))
ask(direct(ratings.interrater_agreement),
    check("shares of people", [[0.25, 0.75], [1, 0]], "^counts has rows that sum to"))
ask(direct(ratings.inverse_cdf, counts=COUNTS),
    check("p=1.5", p=1.5, says="^p must be a number or a list of numbers"),
    check("p=[0.5, 0.6j]", p=[0.5, 0.6j], says="[Cc]omplex"))
ask(direct(ratings.inverse_cdf, counts=COUNTS, p=0.5), OTHER_LEVELS, arg="counts")
ask(direct(ratings.adjective_correlation),
    check("too few ratings of a pair", replaced(X, np.nan, (slice(2, None), 0)),
        "^ratings has 2 rows with both 'x0' and 'x1'; .* leave one of"),
    *not_numbers(X, "NaN", "dates"),
    ALWAYS_THE_SAME, arg="ratings")
ask(direct(ratings.outlying_raters),
    check("objects of another number", X[:2], [1, 2, 3], [1, 2],
        r"inconsistent numbers of samples: \[2, 3, 2\]"),
    check("an object without a name", X[:2], [1, None], [1, 2], OBJECT_WITHOUT_NAME),
    check("a rater without a name", X[:2], [1, 1], [1, None], "^raters has no object"),
    check("ratings in one dimension", [1.0, 2.0], [1, 1], [1, 2],
        r"^ratings has shape \(2,\); give a table with .* one column per adjective"),
    check("nobody who gave the ratings", X[:2], [1, 1],
        says="^ratings do not say who gave them on which object; give objects and rat"),
    check("a table without raters", TABLE_OF_RATINGS, says="^table does not know its"),
    check("a table with objects", TABLE_OF_RATINGS, [3, 5],
        says="^ratings is a RatingTable, which has objects and raters; leave both out"),
    check("one person per object", X[:2], [1, 2], [1, 2], "^ratings has nobody who"))
ask(direct(ratings.outlying_raters, ratings=X, objects=np.arange(N) // 2,
        raters=np.arange(N)),
    *settings("significance", 0, "5%"))
ask(direct(ratings.outlying_raters, objects=np.zeros(N), raters=np.arange(N)),
    *not_numbers(X, "NaN", "dates"), arg="ratings")
ask(direct(ratings.adjective_correlation, ratings=X),
    *settings("significance", 0, "5%"), *settings("threshold", -0.3))

# Scales with units, continuous ratings, few raters

IN_UNITS = direct(
    metrics.ranked_probability_score, metrics.earth_movers_distance, metrics.macro_mae,
    metrics.dispersion, y_true=COUNTS, y_proba=PROBA)
ask(IN_UNITS, *settings("units", "mm"),
    check("units of words", units="scale", levels=["no", "a bit", "very"],
        says=r"^The levels \['no', .*\] are not numbers, .*; give numbers as levels="),
    check("units of levels that fall", units="scale", levels=[3, 2, 1],
        says=r"^levels=\[3, 2, 1\] do not ascend, .*; list finite numbers, lowest"),
    check("units of an array", units="scale",
        says=r"^The columns of y_true do not say .*; give levels=\[\.\.\.\], lowest"),
    check("units of default columns", y_proba=pd.DataFrame(PROBA), units="scale",
        says=r"^The columns of y_true do not say .*; give levels=\[\.\.\.\], lowest"))
ask(direct(ratings.rating_mean, counts=COUNTS),
    check("words as levels", levels=["no", "a bit", "very"],
        says="are not numbers, so their scale has no units; give numbers"))
ANSWERS = np.random.default_rng(2).normal(size=(N, 4))
NOT_ANSWERS = [
    *not_numbers(ANSWERS, "NaN", "dates"),
    check("a list without ratings", [[], *ANSWERS[1:].tolist()],
        "ARG contains NaN: trial 0 has no answer"),
    check("lists in a list", [[[1, 2]], *ANSWERS[1:].tolist()],
        "ARG|setting an array|inhomogeneous"),
]
CRPS = direct(metrics.crps, y_true=ANSWERS, y_cdf=[0, 1], values=[-3, 3])
SLIDERS = {"ContinuousRatingsRegressor": ContinuousRatingsRegressor}
ask(fitting(SLIDERS), NO_TRIALS)
ask(by_name("y_true", CRPS), *NOT_ANSWERS, arg="y_true")
ask(fitting(SLIDERS, "y"), *NOT_ANSWERS,
    check("a trial less", ANSWERS[1:], r"inconsistent numbers of samples: \[12, 11\]"),
    check("equal ratings only", np.ones(N), r"^All ratings in ARG are 1.0 .*; a grid"),
    check("ratings outside the grid", ANSWERS, grid=[0, 1, 2],
        says="^ARG has ratings from .*, but grid reaches from 0.0 to 2.0; widen it"),
    arg="y")
ask(fitting(SLIDERS, y=ANSWERS), *NOT_A_TABLE[:2],
    *wrong(n_cells=1, grid="log", estimator="nnpom"),
    *settings("grid", [0, 5, 1], [0, 1], says="must be three edges or more that asc"))
ask(CRPS,
    check("a CDF that falls", y_cdf=[1, 0], says="^y_cdf falls in row 0; sort it, so"),
    check("points that fall", values=[3, -3], says="^values falls in row 0; sort it"),
    check("a CDF above 1", y_cdf=[0, 1.1], says=r"^y_cdf must lie within \[0, 1\]"),
    check("a point less", values=[3], says="^y_cdf has 2 columns, .* 1 values; give"),
    check("CDFs of other trials", y_cdf=np.zeros((3, 2)),
        says=r"^y_cdf has shape \(3, 2\), but y_true has 12 trials; give one row"),
    check("NaN in a CDF", y_cdf=[0, np.nan], says="y_cdf contains NaN"))
ask(direct(metrics.noise_ceiling),
    check("shares of people", [[0.25, 0.75], [0.3, 0.7]], "^y_true has rows that sum"),
    check("one continuous rating", [[1, np.nan], [1, 2]], metrics.crps,
        "^y_true has fewer than two ratings in trial 0; leave out what"),
    check("weights instead of people", [[1.5, 1], [1, 2]], metrics.log_score,
        "^y_true must be whole numbers of people for the log score"),
    check("a score that is not proper", COUNTS, metrics.macro_mae,
        "^score=macro_mae is not proper, so that"),
    check("a score by name", COUNTS, "rps", wrong_type("score")),
    *NOT_COUNTS[:1], arg="y_true")
ask(direct(ratings.shrink_counts),
    check("one object", COUNTS[:1], "^counts has one object; shrinkage needs others"),
    check("weights instead of people", COUNTS / 2, "^counts must be whole numbers of"),
    check("one rating of each object", np.eye(3), "^counts has no object with two"))
ask(direct(ratings.shrink_counts, counts=COUNTS), *settings("strength", -1, "cv"))
MEANS = pd.Series([2, 3], ["a", "b"])
ask(direct(ratings.counts_from_moments, levels=range(1, 6)),
    check("a mean above the levels", [2, 5.01],
        "^mean lies outside the levels in trial 1; give means from 1 to 5, or"),
    check("NaN", [np.nan], "^Input mean contains NaN"),
    check("text", ["2"], "^mean is not an array of numbers"),
    check("two adjectives", [[2, 3]], "^mean has shape .*; give one number per object"),
    check("too little spread", [3, 2.5], [1, 0.4],
        "^std is too small for the mean in trial 1; give at least 0.5, or mend mean"),
    check("too much spread", [3, 1.1], [1, 0.7],
        "^std is too large for the mean in trial 1; give at most 0.6245, or mend mean"),
    check("spread at an end", [5], [0.1], "^std is too large .* give at most 0, or"),
    check("a negative deviation", [3], [-1], "^std has a negative number in trial 0"),
    check("one deviation in a list", [3, 3], [1], "^std has shape .*; give one number"),
    check("too much to borrow", [3], 2.5, "^std=2.5 is no deviation .*; give 0.12"),
    check("nothing to borrow", [3], 0, "^std=0 is no deviation of people who chose"),
    check("another index", MEANS, MEANS[::-1], "^std has another index than mean"),
    check("nobody", [3, 3], n=[4, 0], says="^n is not above 0 in trial 1; give"),
    check("too many people", [3], n=[4, 5], says="^n has shape .*; give one number"),
    *(check(f"levels={levels}", [3], levels=levels, says=says) for levels, says in (
        ([1], "is one level; give two or more"), (["a", "b"], "are not numbers"),
        ([5, 1], "do not ascend"))))
ask(direct(ratings.counts_from_moments, mean=[3], levels=range(1, 6)),
    *settings("std", -1.0), *settings("n", 0), *settings("decimals", -1, 0.5))
ask(direct(ratings.counts_from_moments, levels=[0.0002, 0.01, 0.1, 1, 50, 2000]),
    check("levels far apart", [0.0563], [0.045], "^levels are so unequally far apart"))
LONG = pd.DataFrame({"object": list("aab"), "rater": list("xyx"), "rating": [1, 2, 2]})
ask(direct(RatingTable.from_long),
    check("no column of raters", LONG[["object", "rating"]],
        "^The table has no column 'rater', only .*; rename the one that is meant"),
    check("an object in two rows", LONG.assign(rater="x"),
        "^ratings has two of the object 'a' by the rater 'x'; keep one, or tell"))
ask(direct(make_haptic_corpus),
    *wrong(n_objects=0, n_trials=1.5, procedure="tap", n_raters=-1, random_state="a"),
    *settings("sensors", ["force"], says="^Unknown sensor 'force'; the corpus has 5"))

# Searches, contributions and subsets of sensors

SPLITS = ["mean_test", "split0_test", "split1_test"]
RESULTS = dict.fromkeys([f"{name}_score" for name in SPLITS], np.ones(2))
RESULTS |= dict.fromkeys([f"{name}_neg_seconds" for name in SPLITS], -np.ones(2))


def results(without):
    return {name: v for name, v in RESULTS.items() if not re.search(without, name)}


def table_of_scores(**columns):
    """What `sensor_contributions` returns, in small."""
    table = pd.MultiIndex.from_product(
        [["none", "pac"], [0, 1], [0, 1]], names=["held_out", "start", "object"]
    ).to_frame(index=False)
    table = table.assign(fold=0, trial=table["object"], rps=0.1)
    return table.assign(**columns)


SCORED = table_of_scores()
REST = make_column_transformer((StandardScaler(), NAMES[:2]), remainder="passthrough")
BY_SENSOR = make_pipeline(make_column_transformer((StandardScaler(), NAMES)), NNPOM(0))
ask(direct(
        model_selection.speed_accuracy_frontier,
        model_selection.cheapest_within_one_se,
        plotting.SpeedAccuracyDisplay.from_search,
    ),
    check("several scores, and no metric", RESULTS | {"mean_test_rps": np.ones(2)},
        "^metric is missing; choose one of the search's scores"),
    check("one split", results(without="split1"), "test scores of 1 split, but"),
    check("no times", results(without="seconds"), "no score 'neg_seconds', .*; add"),
    check("no finite score", RESULTS | {"split0_test_score": [np.nan] * 2},
        "No candidate has a finite test score .*; set error_score='raise'"),
    check("a list", [1, 2], error=TypeError,
        says="must be a fitted search or its cv_results_|not an estimator instance"))
ask(direct(
        model_selection.contribution_summary,
        plotting.SensorContributionsDisplay.from_scores,
        metric="rps",
    ),
    check("a column that is not there", SCORED, by="hand",
        says=r"^scores has no column \['hand'\]; choose metric and by among"),
    check("a summary by start", SCORED, by="start",
        says=r"^by=\['start'\] has what each summary compares; leave it out"),
    check("a missing object", table_of_scores(object=[None, *[1] * 7]),
        "^scores has no value in some rows of .*'object'.*; fill them in"),
    check("an infinite score", table_of_scores(rps=[np.inf] + [0.1] * 7),
        "^rps is not finite in some rows, as where .* choose another metric"),
    check("no full model", SCORED[4:], r"^held_out is \['pac'\] in scores; give the"),
    check("a row twice", pd.concat([SCORED] * 2), "^scores must have one row"),
    check("a row less", SCORED[:-1], "^scores must have one row per model"),
    check("one start", SCORED.query("start == 0"), "^scores has one start, but .* at"),
    check("no threshold", SCORED, by="threshold", says="^scores has no column rps_1"),
    check("no row", SCORED[:0], r"^held_out is \[\] in scores; give the full model"),
    check("scores as text", table_of_scores(rps="high"), "^rps is not an array of"),
    check("an array", X, error=TypeError, says="^scores is a ndarray; give a"))
ask(CROSS_VALIDATION,
    check("a splitter that tests a trial twice",
        cv=RepeatedKFold(n_splits=2, n_repeats=2),
        says="^cv tests trial 0 2 times; choose a splitter that tests each"),
    check("a classifier that takes each level for a label of its own",
        estimator=KNeighborsClassifier(2), y=(COUNTS > 2).astype(int), cv=2,
        says="^KNeighborsClassifier predicts no distribution, as if it took each"),
    *settings("method", "decision_function"))
ask(direct(model_selection.neg_seconds_scorer),
    check("a model that is not fitted", DummyDistribution(), X, error=NotFittedError,
        says="is not fitted yet"))
ask(CONTRIBUTIONS,
    check("a model that is no fusion", model=NNPOM(), error=TypeError,
        says="^model must end in a DistributionalOrdinalRegressor .*; use"),
    check("a model with a sensor held out", model=fusion(held_out="pac"),
        says="^model has held_out='pac' already; set it to None"),
    check("a sensor called none", n_repeats=1, cv=2,
        model=fusion({"none": [0, 1], "tdc": [2, 3]}),
        says="A sensor is called 'none', .*; rename it"),
    check("one group", groups=np.zeros(N),
        says="number of splits .* greater than the number of groups: 1|groups"),
    *settings("n_repeats", 0),
    check("a negative count", y=replaced(COUNTS, -1), says="^y has a negative count"))
ask(CROSS_VALIDATION | MODEL_REPORT | CONTRIBUTIONS
    | direct(model_selection.sensor_subsets, model=BY_SENSOR, X=TABLE, y=COUNTS),
    check("test trials among the training trials", cv=[(np.arange(N), np.arange(N))],
        says="^cv trains on trial 0 in the fold that tests it; keep whole"))
ask(direct(model_selection.sensor_subsets, X=TABLE, y=COUNTS),
    check("a model without a ColumnTransformer", model=NNPOM(), error=TypeError,
        says="^model must be a Pipeline of a ColumnTransformer"),
    check("a model without a predictor", model=BY_SENSOR[:1], error=TypeError,
        says="^model must be a Pipeline of a ColumnTransformer"),
    check("a remainder", model=make_pipeline(REST, NNPOM()),
        says="^model must begin with a ColumnTransformer with remainder='drop'"),
    check("no sensor",
        model=make_pipeline(make_column_transformer(("drop", NAMES[:2])), NNPOM()),
        says="transformer for each sensor, with a name of its own"),
    check("ratings of another number", model=BY_SENSOR, y=COUNTS[1:],
        says=r"inconsistent numbers of samples: \[12, 11\]"))

# Figures


def methods(name, *displays, **given):
    return direct(*(getattr(display, name) for display in displays), **given)


ONE_OBJECT = plotting.InverseCDFDisplay, plotting.DistributionDisplay
DIAGRAMS = plotting.PITHistogramDisplay, plotting.ReliabilityDisplay
OF_COUNTS = plotting.RatingsDisplay, plotting.InterraterAgreementDisplay
ask(methods("from_predictions", *ONE_OBJECT),
    check("trials of several objects", COUNTS, PROBA, "^y_true has different ratings"),
    check("masked counts", masked(COUNTS[0]), PROBA, "^y_true has masked values,"))
ask(CALIBRATION,
    check("no bin", n_bins=0, error=(TypeError, ValueError),
        says="n_bins.*(== 0, must be >= 1|range .1, inf)"),
    check("half a bin", n_bins=2.5, error=(TypeError, ValueError),
        says="n_bins.* must be an (int|instance of int)"),
    check("one object", groups=["cup"] * N, says="^groups has one object; leave"))
for displays, counts in [(ONE_OBJECT, COUNTS[0]), (DIAGRAMS, COUNTS)]:
    ask(methods("from_estimator", *displays, X=X),
        check("ratings of other levels", estimator=fitted("NNPOM"), y=counts[..., :2],
            says="^y_true has 2 columns of counts, but there are 3 levels"),
        check("an estimator that is not fitted", estimator=NNPOM(), y=counts,
            says="This NNPOM instance is not fitted yet"))
ask(methods("from_counts", *OF_COUNTS),
    check("no adjective", {}, "^counts is of no adjective; give the counts of one or"),
    check("adjectives with other levels", {"hard": COUNTS, "soft": COUNTS[:, :2]},
        r"^counts\['soft'\] has other rows or levels than counts\['hard'\]; give"),
    check("trials of an object that differ", COUNTS, objects=OBJECTS,
        says="^counts has other counts in row 1 than in another of the object 0"),
    check("a trial without an object", COUNTS[:3], objects=["foam", "tile", None],
        says="^objects has no object in row 2; name the object of every row"),
    check("objects of another number", COUNTS, objects=OBJECTS[:6],
        says=r"inconsistent numbers of samples: \[12, 6\]"))
ask(methods("from_counts", plotting.RatingsDisplay),
    OTHER_LEVELS._replace(args=(COUNTS,)), arg="counts")
ask(methods("from_counts", plotting.InterraterAgreementDisplay),
    check("one rating of an object", {"hard": [[0, 1, 0]]}, r"^counts\['hard'\] has"))
ask(methods("from_ratings", plotting.AdjectiveCorrelationDisplay),
    ALWAYS_THE_SAME)
ask(methods("from_counts", plotting.InverseCDFDisplay),
    check("ratings of several objects", COUNTS, "^counts has different ratings for"),
    OTHER_LEVELS._replace(args=(COUNTS[0],)), arg="counts")
ask(methods("from_trials", plotting.SignalsDisplay),
    check("an unknown sensor and no sampling rate", {"taxels": TRIALS[0]},
        "^sampling_rate of the sensor 'taxels' is unknown; give it"),
    check("trials of other sensors",
        {"hold": {"pac": TRIALS[0]}, "slide": {"tdc": TRIALS[0]}},
        "^X has trials of different sensors; give all the same"),
    check("a trial beside a signal", {"hold": {"pac": TRIALS[0]}, "pac": TRIALS[0]},
        "^X has trials beside signals; name the sensors"),
    check("a number in place of a signal", {"pac": 3.0}, r"^Trial 0 of X\['pac'\] is"),
    check("no trial", {}, "^X holds no signals; give one trial"),
    check("a negative sampling rate", {"pac": TRIALS[0]}, sampling_rate=-100,
        says="^sampling_rate=-100 must be a positive number of samples per second"))
ask(methods("from_estimator", plotting.AtomsDisplay),
    check("an estimator without atoms", fitted("NNPOM"), TRIALS[0],
        "^estimator is a NNPOM, which has no atoms; give a fitted"),
    check("an estimator that is not fitted", KSVDTransformer(), TRIALS[0],
        "This KSVDTransformer instance is not fitted yet"),
    check("trials of other channels", fitted("KSVDTransformer(window)"),
        [TRIALS[0][:, :18]],
        "^Trial 0 of X has .*, but 19 channels are expected, as in fit"),
    check("a sampling rate of 0", fitted("KSVDTransformer(window)"), TRIALS[0],
        sampling_rate=0,
        says="^sampling_rate=0 must be a positive number of samples per second"))

# Files of recordings and of ratings

HOLD = b"HOLD_FOR_10_SECONDS"
STATES = np.array([b"MOVE_ARM_START_POSITION"] * 5 + [HOLD] * 4, dtype="S30")
WIDTHS = {"pac": (22,), "electrodes": (19,), "pdc": (), "tac": (), "tdc": ()}
TRIAL = "sponge_114_01"
STATE = f"{TRIAL}/state/controller_detail_state"
FINGER = f"{TRIAL}/biotacs/finger_1"
TAC = f"{FINGER}/tac"


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


def loading(folder, edit=None, change=None, path="corpus.h5", **kwargs):
    """Call of `load_phac2` on a file that was edited, or whose bytes were changed."""
    written = write_corpus(folder, edit)
    if change is not None:
        written.write_bytes(change(written.read_bytes()))
    return call(load_phac2, path if path == 3 else folder / path, **kwargs)


def exchanged(name, value):
    def edit(file):
        del file[name]
        file[name] = value

    return edit


def without(name):
    return lambda file: file.__delitem__(name)


def an_empty_group(file):
    del file[TAC]
    file.create_group(TAC)


def external_values(file):
    del file[TAC]
    file.create_dataset(TAC, (9,), "f8", external=[("elsewhere.raw", 0, 72)])


def cut(share):
    return lambda data: data[: int(share * len(data))]


DAMAGED = "cannot be read .*; close the file .* if it is no HDF5, cut short or damag"
LINK = "is a soft or external link, .*; copy what it points at"
NO_DTYPE = "tac of .* has dtype .*; it must hold numbers"
NOT_FINITE = "tac of .* has NaN or infinity in sample 0 .*; leave the trial out"
ask({"load_phac2": loading},
    check("a folder", path="", error=FileNotFoundError, says="There is no file .*; gi"),
    *(check(f"a file cut at {share:.0%}", change=cut(share), error=OSError,
          says=DAMAGED)
      for share in (0.01, 0.99)),
    check("no trials", lambda file: file.clear(), "has no trials; give a file with"),
    check("a group that is no trial", lambda file: file.create_group("notes"),
        "'notes' at the root .* is no trial; trials are named"),
    check("a trial without states", without(f"{TRIAL}/state"),
        "/sponge_114_01 of .* has no 'state'; it has"),
    check("a trial without a sensor", without(TAC), "finger_1 of .* has no 'tac'; it"),
    check("a trial without a finger", without(FINGER), "has finger_0 and finger_1"),
    check("a dataset in place of a trial", exchanged(TRIAL, 3),
        "/sponge_114_01 of .* is not a group, so it has no 'biotacs'"),
    check("a group in place of a sensor", an_empty_group, "finger_1/tac of .* is not"),
    check("a sensor that is a number", exchanged(TAC, 3.0),
        r"tac of .* has shape \(\); it must be"),
    *(check(f"a sensor of {given}", exchanged(TAC, np.array(values)), message)
      for given, message, values in [
          ("text", NO_DTYPE, [b"1"] * 9),
          ("complex numbers", NO_DTYPE, [1j] * 9),
          ("booleans", NO_DTYPE, [True] * 9),
          ("NaN", NOT_FINITE, [np.nan] * 9),
          ("infinity", NOT_FINITE, [1.0] * 5 + [np.inf] * 4),
      ]),
    *(check(f"states of {given}", exchanged(STATE, np.array(values)), message)
      for given, message, values in [
          ("numbers", "has dtype .*; it must hold byte strings", [1.0] * 9),
          (
              "two columns",
              r"has shape \(9, 2\); it must be \(n_frames,\)",
              np.stack([STATES] * 2, 1),
          ),
          (
              "another procedure only",
              "has no procedure 'hold': .* Leave the trial out through trials=",
              [b"SLIDE_5CM"] * 9,
          ),
          (
              "no rest",
              "and only 9 rows, so no rest level; use remove_baseline=False",
              [HOLD] * 9,
          ),
      ]),
    *(check(f"{given} link", exchanged(name, link), LINK)
      for given, name, link in [
          ("a soft", TAC, h5py.SoftLink("/cup_602_01/biotacs/finger_1/tac")),
          ("a dangling soft", TAC, h5py.SoftLink("/nowhere")),
          ("a cyclic soft", TAC, h5py.SoftLink(f"/{TAC}")),
          ("an external", TAC, h5py.ExternalLink("other.h5", "/tac")),
          ("a trial that is an external", TRIAL, h5py.ExternalLink("o.h5", "/")),
          ("a trial that is a dangling", TRIAL, h5py.SoftLink("/nowhere")),
      ]),
    check("values in another file", external_values, "keeps its values in another"),
    *settings("procedure", "tap"),
    *settings("sensors", ["force"], says="^Unknown sensor 'force'"),
    *settings("trials", ["x_1_1"], says="^Unknown trial 'x_1_1'"),
    in_folder=True)

RATINGS = np.random.default_rng(0).integers(1, 6, (2, 10, 12))
AXES = ["objects", "adjectives", "raters"]


def loading_matlab(folder, change=None, array=RATINGS, name="ratings.mat", **told):
    """Call of `load_phac2` with a MATLAB file , changed or misdescribed."""
    path = folder / "ratings.mat"
    savemat(path, {"ratings": array})
    if change is not None:
        path.write_bytes(change(path.read_bytes()))
    usual = {"objects": [114, 602], "adjectives": [*"abcdefghij"]}
    told = usual | {"variable": "ratings", "axes": AXES} | told
    ratings = MatlabRatings(folder / name, **told)
    return call(load_phac2, write_corpus(folder), ratings=ratings)


ANSWERS = pd.DataFrame(
    [(o, r, a, 1 + r) for a in ("hard", "soft") for o in (114, 602) for r in (0, 1)],
    columns=["object", "rater", "adjective", "rating"],
)


def loading_answers(folder, table=None, **columns):
    """Call of `load_phac2` with a table of answers, its last row changed."""
    if table is None:
        table = ANSWERS.astype(object)
        for column, value in columns.items():
            table.loc[table.index[-1], column] = value
    return call(load_phac2, write_corpus(folder), ratings=table)


def loading_csv(folder, text):
    (folder / "ratings.csv").write_bytes(text)
    return loading_answers(folder, folder / "ratings.csv")


COUNTED = pd.DataFrame(np.ones((2, 5)), index=[114, 602], columns=range(1, 6))
OTHER_IDS = RatingTable(np.ones((2, 5), int), np.array([114, 603]), np.arange(1, 6))


def loading_counts(folder, table=COUNTED, **others):
    """Call of `load_phac2` with the counts of an adjective, and of others."""
    return loading_answers(folder, {"hard": table} | others)


NO_FILE = "There is no file .*; give the path of one"
NOT_MATLAB = "cannot be read as a MATLAB file .*; give one, or download it again"
OTHER_OBJECT = r"objects that the corpus does not have, \[603\]; leave them out, or"
ask({"MatlabRatings": loading_matlab},
    check("a folder", name="", error=FileNotFoundError, says=NO_FILE),
    check("a file cut in half", cut(0.5), error=OSError, says=NOT_MATLAB),
    check("HDF5 that is cut short",
        lambda _: b"MATLAB 7.3 MAT-file" + bytes(493) + b"\x89HDF", error=OSError,
        says=DAMAGED),
    check("a variable that is not there", variable="counts",
        says=r"has no variable 'counts'; it has \[\('ratings', \(2, 10, 12\), 'int64'"),
    check("axes that are none", axes=["objects", "people"],
        says="must be 'objects', 'adjectives' and either 'raters' or 'levels', in"),
    check("objects of another number", objects=[114], says="mend the axes, the obj"),
    check("an adjective twice", adjectives=["hard"] * 10, says="list each once, in"),
    check("objects by name", objects=["sponge", "cup"],
        says="objects that the corpus does not have, .*, or give ids .* such as 114"),
    check("an object that nobody rated", array=RATINGS * [[[0]], [[1]]],
        says=r"^ratings\['a'\] has no ratings of objects \[114\]; leave their trials"),
    in_folder=True)
ask({"load_phac2(ratings)": loading_answers},
    *(check(given, table, error=TypeError, says=f"^ratings is of the type {kind}; ")
      for given, table, kind in [
          *(("a number", 3, "int"), ("a list", [[1]], "list")),
          *(("an array", np.ones((2, 5)), "ndarray"), ("an empty dict", {}, "dict")),
      ]),
    *(check(f"a table without {column}", ANSWERS.drop(columns=column),
          f"The table has no column '{column}', only .*; rename the one")
      for column in ANSWERS.columns),
    *(check(f"no {column} in a row", says=f"no {column} in row", **{column: None})
      for column in ("object", "adjective")),
    check("no rater in a row", rater=None, says="'soft': raters names nobody in row 3"),
    *(check(f"a rating of {rating!r}", rating=rating, says="on 'soft': ratings has")
      for rating in (0, 6, 2.5, np.inf)),
    in_folder=True)
NOT_CSV = "is not a CSV file in UTF-8 .*; save it as one, or describe a MATLAB file"
LINE = b"object,rater,adjective,rating\n"
ask({"load_phac2(ratings)": loading_csv},
    check("CSV by semicolons", LINE.replace(b",", b";"), "no column 'adjective', only"),
    check("CSV with a row too long", LINE + b"114,1,a,2\n114,1,a,2,3\n", NOT_CSV),
    check("CSV without answers", LINE, "holds no values at all"),
    in_folder=True)
ask({"load_phac2(ratings)": loading_counts},
    check("counts in an array", COUNTED.to_numpy(), error=TypeError,
        says=r"^ratings\['hard'\] is of the type ndarray; give"),
    check("counts of an object twice", COUNTED.set_axis([114, 114]),
        "has two rows of an object; give one row per object"),
    check("counts of an object that the corpus does not have", OTHER_IDS, OTHER_OBJECT),
    check("counts of other levels", soft=COUNTED.set_axis(range(5), axis=1),
        says="has the levels .*, but .*; give all adjectives the same, for instance"),
    check("negative counts", -COUNTED, "has a negative count in"),
    in_folder=True)

# Studies


def no_corpus(**_):
    raise AssertionError("The corpus is loaded before the settings are checked.")


def bare_corpus(**_):
    corpus = make_haptic_corpus(2, 1, sensors=["pdc"], random_state=0)
    corpus.ratings = {}
    return corpus


def write_files(folder, files):
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


TAPS = {
    "trials": pd.DataFrame({"mic": [np.zeros((60, 1)), np.ones((60, 1))]}),
    "objects": [1, 2],
    "ratings": {"hard": np.ones((2, 5))},
}


def studying(folder, corpus=no_corpus, files=None, **settings):
    """Call of `run_study` beside files, given by name."""
    write_files(folder, files or {})
    settings = {"procedures": ["hold"], "sensors": ["pdc"], "verbose": False} | settings
    return call(run_study, corpus, folder / "study", **settings)


def reading(folder, **files):
    """Call of `read_study` on files, given by name."""
    write_files(folder / "study", files)
    return call(read_study, folder / "study")


ALPHA = r"^alpha=\[.*\] must list numbers of at least 0"
HIDDEN = r"^n_hidden=\[.*\] must list whole numbers of at least 1"
CUT_SETTINGS = "study.json is damaged .*; restore it, or run the study in another"
DAMAGED_UNIT = r"hold\.npz is missing or damaged .*; delete it, and run_study does"
ask({"run_study": studying},
    *wrong(n_splits=0, n_repeats=1.5, n_starts=0, split="random", corpus=[1, 2]),
    *settings("random_state", "zero"),
    *settings("n_hidden", [0], [], says=HIDDEN),
    *settings("alpha", [-1.0], ["low"], [np.nan], says=ALPHA),
    *settings("sensors", ["force"], says="^Unknown sensor 'force'; the corpus has 5"),
    *settings("sensors", {"pdc": LogisticRegression()}, says=r"^sensors\['pdc'\] is"),
    *settings("procedures", ["tap"], says="^Unknown procedure 'tap'; the corpus has 4"),
    *wrong(protocol="fast", update="fast", dictionaries="none", standardise=2),
    *settings("corpus", {}, says="^corpus has no procedures; give one at least"),
    *settings("corpus", {"tap": 3}, {3: TAPS}, {"tap": {"objects": [1]}},
        {"tap": TAPS | {"trials": [1]}}, {"tap": TAPS | {"objects": [1]}},
        {"tap": TAPS | {"ratings": np.ones((2, 5))}},
        says=r"^corpus\[.*\] is no procedure; give, under a name that is text, a dict"),
    check("procedures without a common sensor",
        corpus={"tap": TAPS, "rub": TAPS | {"trials": TAPS["trials"][[]]}},
        says="have no sensor in common; give them the same columns of trials"),
    check("a sensor called as the network of all", sensors=None,
        corpus={"a": {**TAPS, "trials": TAPS["trials"].set_axis(["combined"], axis=1)}},
        says="^A sensor is called 'combined', as is another column"),
    check("a regressor without an NNPOM",
        regressor=DistributionalOrdinalRegressor(LogisticRegression()),
        says="^regressor has the estimator LogisticRegression.*; give it an NNPOM"),
    check("a corpus without ratings", corpus=bare_corpus,
        says="^The corpus has no ratings; give load_phac2 the ratings as ratings="),
    check("a file in place of the folder", files={"study": b""}, error=OSError,
        says="study is no folder that can be written; give another"),
    check("a folder of other settings",
        files={"study/study.json": b'{"sensors": ["pac"]}'},
        says="holds a study with .*, not .*; give the same .*, or another folder"),
    check("settings that are a number", files={"study/study.json": b"3"},
        says=CUT_SETTINGS),
    check("units without settings", files={"study/trials/hold.npz": b""},
        says="holds units of a study, but no study.json .*; restore that file"),
    in_folder=True)
def finished(function):
    """Caller of a function of a finished study of one procedure."""
    cell = {"adjective": ["hard"], "procedure": ["hold"], "fold": [0]}
    score = {"object": [1], "trial": [1], "emd": [0.5], "proba_1": [1.0]}
    study = Bunch(
        scores=pd.DataFrame({**cell, "held_out": ["none"], **score}),
        networks=pd.DataFrame({**cell, **score, "network": ["pac"]}),
        baselines=pd.DataFrame({**cell, **score, "strategy": ["marginal"]}),
        truth=pd.DataFrame(),
    )
    return partial(call, function, study)


METRIC = r"^metric='rsp' must be one of \['emd'\]"
ask({"score_table": finished(score_table),
     "compare_networks": finished(compare_networks)},
    *settings("metric", "rsp", says=METRIC))
ask({"compare_networks": finished(compare_networks)},
    check("by='object'", by="object", metric="emd", says="^by has 'object', but"),
    check("no such comparison", between="objects", metric="emd",
        says="^between='objects' must be one of"),
    check("a study of one procedure", between="procedures", metric="emd",
        says="^The study has no object that is tested with two procedures or more"))
ask({"read_study": reading},
    check("no study", "holds no study: study.json is missing; run_study"),
    check("no finished models", **{"study.json": b'{"procedures": ["hold"]}'},
        says="has no finished models yet; run_study makes them"),
    check("an empty unit", **{"study.json": b'{"procedures": ["hold"]}',
        "trials/hold.npz": b""}, says=DAMAGED_UNIT),
    in_folder=True)

# Touches in progress

TOUCHES = pd.DataFrame({s: pd.Series(TRIALS * 3) for s in ("pac", "tdc")})


def spreads(touches):
    return np.array([[each.std()] for each in touches["pac"]])


STATISTICS = FunctionTransformer(spreads)
ANYTIME = streaming.AnytimeRegressor(
    make_pipeline(STATISTICS, DistributionalOrdinalRegressor()),
    durations=[0.5, 0.8], sampling_rates={"pac": 10, "tdc": 10}, cv=2)
PATH = np.full((N, 2, 3), 1 / 3)


@cache
def anytime():
    return clone(ANYTIME).fit(TOUCHES, COUNTS, groups=range(N))


def fit_anytime(*bad, **params):
    X, y = [*bad, *(TOUCHES, COUNTS)[len(bad):]]
    return call(clone(ANYTIME).set_params(**params).fit, X, y, groups=range(N))


def of_touches(name):
    def ask_model(*bad):
        return call(getattr(anytime(), name), *bad)

    return {f"AnytimeRegressor.{name}": ask_model}


def of_a_touch(name):
    def ask_touch(*bad):
        return call(getattr(anytime().start(), name), *bad)

    return {f"TouchInProgress.{name}": ask_touch}


def lacking(sensor, value=None):
    touches = TOUCHES.copy()
    touches[sensor] = [value, *TOUCHES[sensor][1:]]
    return touches


NO_PROBA = make_pipeline(STATISTICS, Ridge())
ask({"AnytimeRegressor.fit": fit_anytime},
    check("a table of numbers", X, "^X is a ndarray; give a DataFrame of touches"),
    check("a column less", TOUCHES[["pac"]], r"^X has no column 'tdc', only \['pac'\]"),
    check("a column twice", TOUCHES[["pac", "tdc", "pac"]], "^X has the column 'pac'"),
    check("ratings of objects", TOUCHES, COUNTS[:4], OF_OBJECTS),
    check("no pipeline", estimator=LogisticRegression(),
        says="^estimator is a LogisticRegression; give a Pipeline whose first"),
    check("no probabilities", estimator=NO_PROBA, says="^The last step of estimator"),
    check("no row of features", estimator=make_pipeline(
        ColumnTransformer([("pac", "passthrough", ["pac"])]), LogisticRegression()),
        says="^estimator has no step before its last that turns each touch into a row"),
    check("columns by position", estimator=make_pipeline(
        make_column_transformer((SignalStatistics(), [0])), LogisticRegression()),
        says="takes columns by position; name them, because only those of sampling"),
    *settings("durations", [], [0, 1], [2, 1], [[1, 2]], [np.inf],
        says="^durations=.* must list seconds above 0 in ascending order"),
    *settings("durations", ["1", "2"], says="^durations is not an array of numbers"),
    check("a duration that no touch reaches", durations=[0.5, 60],
        says="^durations holds 60 s, but only 0 of 12 training touches are so long"),
    check("a rate of 0", sampling_rates={"pac": 0, "tdc": 10},
        says="^The sampling rate of 'pac' is 0; give samples per second"),
    check("no rates", sampling_rates={}, says="^sampling_rates names no sensor"),
    check("one rate for two columns", sampling_rates=10, says="but sampling_rates is"),
    check("a rate of a numbered column", sampling_rates={0: 10},
        says="^sampling_rates names the sensor 0; name sensors by the columns"),
    *wrong(max_delay=[-1], stopping=[0.5], estimator=[None],
        sampling_rates=["fast"]))
ask(of_touches("predict_proba") | of_touches("predict") |
    of_touches("predict_when_done"),
    check("other channels than in fit", lacking("pac", TRIALS[0][:, :7]),
        r"^Trial 0 of X\['pac'\] has 7 channels"))
ask(of_touches("predict_proba_over_time"),
    check("a time before the touch", TOUCHES, [-1], "^times holds -1; give sec"),
    check("a time that is NaN", TOUCHES, [1, np.nan], "^times holds nan; give sec"))
ask(of_touches("start"),
    check("limits of an unknown sensor", {"mic": (0, 1)}, "^limits names the sensor"),
    check("limits in the wrong order", {"pac": (1, 0)}, "^limits=\\(1, 0\\) must be"))
ask(of_a_touch("update"),
    check("an array for two sensors", TRIALS[0], "^samples is a ndarray; give a dict"),
    check("an unknown sensor", {"mic": TRIALS[0]}, "^samples names the sensor 'mic'"),
    check("other channels than in fit", {"pac": np.ones((3, 4))},
        r"^samples\['pac'\] has shape \(3, 4\), but one sample had the shape \(19,\)"),
    check("text", {"pac": ["a"] * 19}, r"^samples\['pac'\] is not an array of numbers"))
RULES = {
    "ExpectedGain": (streaming.ExpectedGain, settings("price", -1, "high")),
    "CertaintyThreshold": (streaming.CertaintyThreshold, settings("threshold", 2)),
}
for name, (rule, checks) in RULES.items():
    ask({f"{name}.fit": lambda *bad, rule=rule, **params: call(
            rule(**params).fit, *[*bad, *(PATH, COUNTS)[len(bad):]], durations=[1, 2])},
        *checks,
        check("one duration less", PATH[:, :1], says="^proba has shape \\(12, 1"),
        check("ratings of other trials", PATH, COUNTS[:3],
            says="^proba has shape .*, but y has shape \\(3, 3\\)"))
BY_TIME = {"TouchTimeDisplay.from_predictions": lambda *bad, **given: call(
    plotting.TouchTimeDisplay.from_predictions,
    *[*bad, *(COUNTS, PATH, [1, 2])[len(bad):]], **given)}
ask(BY_TIME,
    check("one duration less", COUNTS, PATH, [1], "^y_proba has shape .* and seconds"),
    check("durations in no order", COUNTS, PATH, [2, 1], "must be above 0 and in asc"),
    check("another metric", metric="mae", says="^metric='mae' must be 'rps' or"),
    check("no distribution", COUNTS, PATH * 2, "^y_proba is no distribution"),
    check("stops in seconds", stopped={"rule": [0.5] * N}, says="index of a duration"),
    check("a stop behind the last", stopped={"rule": [2] * N}, says="from 0 to 1, as"))
