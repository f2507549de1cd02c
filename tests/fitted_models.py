"""A small model of every public estimator, and of what is built of them, fitted."""

from functools import cache

import numpy as np
import pandas as pd
from mord import LogisticAT
from sklearn.base import clone, is_regressor
from sklearn.ensemble import ExtraTreesRegressor, HistGradientBoostingRegressor
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    AnytimeRegressor,
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
    SignalStatistics,
    STHMPTransformer,
    TemporalMaxPool,
    TouchPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_macro_mae_scorer, neg_rps_scorer
from sklearn_haptic.streaming import CertaintyThreshold, ExpectedGain

_rng = np.random.default_rng(0)
TABLE = _rng.normal(size=(40, 6))
NAMED = pd.DataFrame(TABLE, columns=[f"{s}__{i}" for s in "ab" for i in range(3)])
WORDS = ["dull", "even", "keen"]
LABELS = np.array(WORDS)[_rng.permutation(np.arange(40) % 3)]
COUNTS = _rng.multinomial(9, [0.1, 0.2, 0.4, 0.2, 0.1], size=40)
SEVERAL = np.stack([COUNTS, COUNTS[::-1]], axis=1)
TRIALS = [_rng.normal(size=(n, 3)) for n in (40, 50, 44)]
FRAMES = [_rng.normal(size=(n, 38)).astype(np.float32) for n in (5, 7, 6)]
CORPUS = make_haptic_corpus(
    4, 2, "fast_slide", sensors=["pdc", "electrodes"], random_state=0
)

_DICTIONARY = {"n_atoms": 4, "n_nonzero_coefs": 2, "max_iter": 2}
_NETWORK = NNPOM(2, tol=1e-2, random_state=0)
_TREES = RegressedDistribution(ExtraTreesRegressor(3, max_depth=2), random_state=0)
_FUSION = SensorFusionNNPOM(None, _NETWORK, NNPOM(1, tol=1e-2), random_state=0)

# Name: unfitted model, X and y.
MODELS = {
    "ksvd of rows": (KSVDTransformer(**_DICTIONARY, random_state=0), TABLE, None),
    "ksvd of trials": (
        KSVDTransformer(
            **_DICTIONARY, window=10, random_state=np.random.RandomState(0)
        ),
        TRIALS,
        None,
    ),
    "sthmp": (STHMPTransformer(**_DICTIONARY, random_state=0), FRAMES, None),
    "pooling": (TemporalMaxPool((2, 1)), TRIALS, None),
    "statistics": (SignalStatistics(), TRIALS, None),
    "sensor features": (make_haptic_pipeline(None)[0], TRIALS, None),
    "repair": (RepairTrials(rest=2), TRIALS, None),
    "network": (NNPOM(3, tol=1e-2, random_state=0), TABLE, COUNTS),
    "network of labels": (NNPOM(0, tol=1e-2, levels=WORDS), NAMED, LABELS),
    "network stopped early": (
        NNPOM(3, solver="irprop+", early_stopping=True, random_state=0),
        TABLE,
        COUNTS,
    ),
    "regressor": (DistributionalOrdinalRegressor(), NAMED, COUNTS),
    "regressor of labels": (
        DistributionalOrdinalRegressor(sampling="random", levels=WORDS, random_state=0),
        TABLE,
        LABELS,
    ),
    "regressor of a classifier": (
        DistributionalOrdinalRegressor(LogisticRegression(), decode="quantile"),
        TABLE,
        COUNTS,
    ),
    "regressor of mord": (
        DistributionalOrdinalRegressor(LogisticAT(), sampling="random", random_state=0),
        TABLE,
        COUNTS,
    ),
    "regressor of trees": (
        DistributionalOrdinalRegressor(
            HistGradientBoostingRegressor(max_iter=3, max_leaf_nodes=3), random_state=0
        ),
        TABLE,
        COUNTS,
    ),
    "several adjectives": (
        DistributionalOrdinalRegressor(_NETWORK, random_state=0),
        TABLE,
        SEVERAL,
    ),
    "fusion": (_FUSION, NAMED, COUNTS),
    "fusion with a sensor held out": (
        SensorFusionNNPOM(
            {"a": [0, 1], "b": slice(2, None)}, _NETWORK, held_out="a", random_state=0
        ),
        TABLE,
        COUNTS,
    ),
    "regressor of a fusion": (
        DistributionalOrdinalRegressor(_FUSION, random_state=0),
        NAMED,
        COUNTS,
    ),
    "dummy": (DummyDistribution("barycentre"), TABLE, COUNTS),
    "distributions by trees": (_TREES, NAMED, COUNTS),
    "blend": (
        DistributionBlend([("network", _NETWORK), ("trees", _TREES)]),
        NAMED,
        COUNTS,
    ),
    "pool of touches": (
        TouchPool([("a", _NETWORK, [*NAMED.columns[:3]]), ("all", _NETWORK, [*NAMED])]),
        NAMED,
        COUNTS,
    ),
    "guard": (NoveltyGuard(make_pipeline(StandardScaler(), _NETWORK)), TABLE, COUNTS),
    "sets": (ConformalRatings(_NETWORK, cv=2), NAMED, COUNTS),
    "intervals": (
        ConformalRatings(ContinuousRatingsRegressor(NNPOM(0, tol=1e-2), n_cells=4)),
        TABLE,
        TABLE[:, 0],
    ),
    "sliders": (
        ContinuousRatingsRegressor(NNPOM(0, tol=1e-2), n_cells=4),
        TABLE,
        TABLE[:, 0],
    ),
    "touches of any length": (
        AnytimeRegressor(
            make_haptic_pipeline(["pdc"], random_state=0),
            durations=[0.6, 1.2],
            sampling_rates={"pdc": 100},
            stopping=ExpectedGain(0.1),
            cv=2,
        ),
        CORPUS.trials,
        CORPUS.ratings["hard"],
    ),
    "touches that end when their ratings are certain": (
        AnytimeRegressor(
            make_pipeline(SignalStatistics(), NNPOM(0)),
            durations=[0.6, 1.2],
            sampling_rates=100,
            stopping=CertaintyThreshold(0.6),
            cv=2,
        ),
        list(CORPUS.trials["pdc"]),
        CORPUS.ratings["hard"],
    ),
    "pipeline": (
        make_haptic_pipeline(["pdc", "electrodes"], random_state=0),
        CORPUS.trials,
        CORPUS.ratings["hard"],
    ),
    "search": (
        GridSearchCV(
            DistributionalOrdinalRegressor(_NETWORK, random_state=0),
            {"estimator__alpha": [1.0, 10.0]},
            scoring={"rps": neg_rps_scorer, "mae": neg_macro_mae_scorer},
            refit="rps",
            cv=2,
        ),
        TABLE,
        COUNTS,
    ),
}


@cache
def fitted(name):
    """The model of a name; not to be changed."""
    model, X, y = MODELS[name]
    return clone(model).fit(X, y, **groups_of(name))


def groups_of(name):
    """Arguments of the fit of the model of a name: objects, if it needs them."""
    model, _, y = MODELS[name]
    early = getattr(model, "early_stopping", False)
    needs = isinstance(
        model,
        (
            *(DistributionBlend, TouchPool, NoveltyGuard, ConformalRatings),
            AnytimeRegressor,
        ),
    )
    return {"groups": np.arange(len(y))} if early or needs else {}


def methods_of(model, X, y):
    """Calls of every public method of a fitted model of this package."""
    calls = {
        name: lambda name=name: list(getattr(model, name)(X))
        for name in (
            *("transform", "fit_transform", "predict", "predict_proba"),
            *("predict_cdf", "predict_latent", "hidden_activations"),
            *("predict_when_done", "distances", "p_values"),
            *("predict_set", "predict_interval", "predict_band"),
        )
    }
    calls |= {
        "predict_quantile": lambda: model.predict_quantile(X, [0.1, 0.5]),
        "predict_rating": lambda: model.predict_rating(X, [0.1, 0.5]),
        "predict_proba_over_time": lambda: model.predict_proba_over_time(X, [0.5, 2]),
        "start": lambda: model.start(),
        "sample": lambda: model.sample(X, 2, random_state=0),
        "weights": lambda: model.weights([["a"]]),
        "breadth": lambda: list(model.breadth([["a"]]).values()),
        "expected_excess": lambda: model.expected_excess([["a"]]),
        "score": lambda: model.score(X, y),
        "get_params": lambda: model.get_params(),
        "set_params": lambda: model.set_params(),
        "get_metadata_routing": lambda: model.get_metadata_routing(),
        "validation_share": lambda: model.validation_share(),
        "fit": lambda: clone(model).fit(X, y),
    }
    if hasattr(model, "faults"):
        calls["faults"] = lambda: model.faults(X)
    if hasattr(model, "transform"):
        calls["get_feature_names_out"] = lambda: model.get_feature_names_out()
    if is_regressor(model):  # sliders have no levels
        calls.pop("predict_set", None)
    return {name: call for name, call in calls.items() if hasattr(model, name)}
