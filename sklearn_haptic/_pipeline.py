"""A whole model in one call, with presets from fast to accurate."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from sklearn.compose import ColumnTransformer
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from ._biotac import SENSORS
from ._sklearn import Memory, RandomState
from .features import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from .models import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    RegressedDistribution,
)

# Window in time samples and number of atoms of each sensor in the 2020 paper.
_WINDOWED = {"pac": (22, 40), "pdc": (50, 25), "tac": (50, 25), "tdc": (50, 10)}


_PRESETS: dict[str, dict[str, Any]] = {
    "fast": {"max_iter": 5, "statistics": ("max",)},
    # Training windows as atoms, which cost half as much to learn.
    "accurate": {"max_iter": 0, "statistics": ("mean", "share", "max")},
}
_MAX_TRAIN = 5000
_CELLS = (4, 2, 1)


def _pooled(codes, statistics, memory):
    """Return codes and their maxima in cells of time, or roots of their statistics."""
    pool = TemporalMaxPool(_CELLS, statistics=statistics, memory=memory)
    if len(statistics) == 1:
        return make_pipeline(codes, pool)
    root = FunctionTransformer(np.sqrt, feature_names_out="one-to-one")
    return make_pipeline(codes, pool, root)


def _head(preset, random_state):
    """Return a linear model, or its blend with trees, which errs differently."""
    linear = DistributionalOrdinalRegressor(
        NNPOM(n_hidden=0, alpha=3.0), random_state=random_state
    )
    if preset == "fast":
        return linear
    trees = RegressedDistribution(
        ExtraTreesRegressor(100, min_samples_leaf=3, max_features="sqrt"),
        random_state=random_state,
    )
    return DistributionBlend([("linear", linear), ("trees", trees)])


def make_haptic_pipeline(
    sensors: Sequence[str] = tuple(SENSORS),
    *,
    preset: Literal["fast", "accurate"] = "fast",
    memory: str | Memory | None = None,
    random_state: RandomState = None,
) -> Pipeline:
    """Build a model of raw recordings of BioTac fingers.

    Each sensor is coded over a dictionary of its own, and the codes are pooled over
    time. The features of all sensors are standardised and given to a model of
    distributions of ratings. The result is an ordinary Pipeline, whose parameters can
    be set and searched, with the steps ``"features"`` (a ColumnTransformer with one
    transformer per sensor), ``"scale"`` and ``"model"``.

    Parameters
    ----------
    sensors : sequence of {"pac", "pdc", "tac", "tdc", "electrodes"}
        The sensors to use, by default all five. They are columns of the DataFrame of
        trials that `load_phac2` and `make_haptic_corpus` return.
    preset : {"fast", "accurate"}, default="fast"
        "fast" pools the maxima of codes over learned dictionaries, for a linear
        `DistributionalOrdinalRegressor`. "accurate" takes training windows as atoms,
        which learns faster, and pools the roots of mean, share and maximum, for a
        `DistributionBlend` of the linear model, of trees and of the marginal, whose
        weights are learned; that takes ten times as long to fit. The blend has to know
        which touches are of one object: ``fit(X, y, model__groups=objects)``.
    memory : str or object with the joblib.Memory interface, default=None
        Where the transformers cache dictionaries and pooled features, so that a search
        over the model computes the features once per fold.
    random_state : int, RandomState instance or None, default=None
        Seeds the dictionaries, the trees and, if the model is given any, the hidden
        units.

    Returns
    -------
    pipeline : sklearn.pipeline.Pipeline
        Unfitted.

    Raises
    ------
    ValueError
        If a sensor or the preset is unknown, or if no sensor is named.

    Notes
    -----
    The settings were chosen by measurements on generated and on recorded touches. The
    means of windows and patches are kept, because the level of pressure and temperature
    carries information and the level of other signals did no harm.

    Examples
    --------
    >>> from sklearn_haptic import make_haptic_pipeline
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> corpus = make_haptic_corpus(n_objects=6, n_trials=2, random_state=0)
    >>> model = make_haptic_pipeline(["pdc", "tdc"], preset="fast", random_state=0)
    >>> model.fit(corpus.trials, corpus.ratings["hard"])
    Pipeline(...)
    >>> model.predict_proba(corpus.trials).shape
    (12, 5)

    In a search or cross-validation, metadata routing brings the objects to the blend:

    >>> from sklearn import config_context
    >>> from sklearn.model_selection import GroupKFold, cross_val_score
    >>> from sklearn_haptic.metrics import neg_rps_scorer
    >>> model = make_haptic_pipeline(["tdc"], preset="accurate", random_state=0)
    >>> with config_context(enable_metadata_routing=True):
    ...     scores = cross_val_score(
    ...         model, corpus.trials, corpus.ratings["hard"], cv=GroupKFold(3),
    ...         scoring=neg_rps_scorer, params={"groups": corpus.objects},
    ...     )
    """
    if isinstance(sensors, str):
        sensors = [sensors]
    unknown = [sensor for sensor in sensors if sensor not in SENSORS]
    if unknown or not len(sensors):
        raise ValueError(
            f"sensors={list(sensors)!r} must name some of {list(SENSORS)}; for other "
            "sensors build a Pipeline with KSVDTransformer or STHMPTransformer."
        )
    if preset not in _PRESETS:
        raise ValueError(f"preset={preset!r} must be one of {list(_PRESETS)}.")
    settings = _PRESETS[preset]
    options = {
        "n_nonzero_coefs": 2,
        "max_iter": settings["max_iter"],
        "remove_mean": False,
        "memory": memory,
        "random_state": random_state,
    }

    def transformer(sensor):
        if sensor == "electrodes":
            coder = STHMPTransformer(max_train_patches=_MAX_TRAIN, **options)
        else:
            window, n_atoms = _WINDOWED[sensor]
            coder = KSVDTransformer(
                n_atoms, window=window, max_train_windows=_MAX_TRAIN, **options
            )
        return _pooled(coder, settings["statistics"], memory)

    return Pipeline(
        [
            (
                "features",
                ColumnTransformer([(s, transformer(s), s) for s in sensors]),
            ),
            ("scale", StandardScaler()),
            ("model", _head(preset, random_state)),
        ]
    )
