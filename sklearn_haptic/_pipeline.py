"""A whole model in one call, with presets from fast to accurate."""

from collections.abc import Sequence
from typing import Any, Literal

from sklearn.compose import ColumnTransformer
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from ._biotac import PROCEDURES, SENSORS, columns_of
from ._sklearn import Memory, RandomState
from .features import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from .models import NNPOM, DistributionalOrdinalRegressor

# Window in time samples and number of atoms of each sensor in the 2020 paper.
_WINDOWED = {"pac": (22, 40), "pdc": (50, 25), "tac": (50, 25), "tdc": (50, 10)}


_PRESETS: dict[str, dict[str, Any]] = {
    "fast": {
        "dictionary": {"n_nonzero_coefs": 2, "max_iter": 5},
        "max_train": 5000,
        "cells": (4, 2, 1),
    },
    "balanced": {
        "dictionary": {"max_iter": 20},
        "max_train": 5000,
        "cells": (4, 2, 1),
    },
    "accurate": {"dictionary": {}, "max_train": 20_000, "cells": (8, 4, 2, 1)},
}


def make_haptic_pipeline(
    sensors: Sequence[str] = tuple(SENSORS),
    *,
    preset: Literal["fast", "balanced", "accurate"] = "fast",
    memory: str | Memory | None = None,
    random_state: RandomState = None,
) -> Pipeline:
    """Build a model of raw recordings of BioTac fingers.

    Each sensor is coded over a dictionary of its own, and the codes are pooled over
    time. The features of all sensors are standardised and given to a linear
    `DistributionalOrdinalRegressor`. The result is an ordinary Pipeline, whose
    parameters can be set and searched, with the steps ``"features"`` (a
    ColumnTransformer with one transformer per sensor), ``"scale"`` and ``"model"``.

    Parameters
    ----------
    sensors : sequence of str
        The columns to use of the DataFrame of trials that `load_phac2` and
        `make_haptic_corpus` return: some of ``"pac"``, ``"pdc"``, ``"tac"``, ``"tdc"``
        and ``"electrodes"``, by default all five; or of a corpus of several
        procedures, such as ``"hold_pac"``.
    preset : {"fast", "balanced", "accurate"}, default="fast"
        How much time the features may take. "accurate" learns the dictionaries with
        the defaults of the transformers. "balanced" learns from fewer windows in fewer
        iterations and takes about half the time. "fast" also uses only two
        coefficients per code and takes about a third. On generated touches and on
        recorded grips the three were equally accurate; try the slower ones if you have
        more objects.
    memory : str or object with the joblib.Memory interface, default=None
        Where the transformers cache dictionaries and pooled features, so that a search
        over the model computes the features once per fold.
    random_state : int, RandomState instance or None, default=None
        Seeds the dictionaries and, if the model is given any, the hidden units.

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
    """
    if isinstance(sensors, str):
        sensors = [sensors]
    known = [*SENSORS, *columns_of(PROCEDURES, SENSORS)]
    unknown = [sensor for sensor in sensors if sensor not in known]
    if unknown or not len(sensors):
        raise ValueError(
            f"sensors={list(sensors)!r} must name some of {list(SENSORS)}; for other "
            "sensors build a Pipeline with KSVDTransformer or STHMPTransformer."
        )
    if preset not in _PRESETS:
        raise ValueError(f"preset={preset!r} must be one of {list(_PRESETS)}.")
    settings = _PRESETS[preset]
    max_train = settings["max_train"]
    options = {
        **settings["dictionary"],
        "remove_mean": False,
        "memory": memory,
        "random_state": random_state,
    }

    def transformer(column):
        sensor = column.rsplit("_", 1)[-1]
        if sensor == "electrodes":
            codes = STHMPTransformer(max_train_patches=max_train, **options)
        else:
            window, n_atoms = _WINDOWED[sensor]
            codes = KSVDTransformer(
                n_atoms, window=window, max_train_windows=max_train, **options
            )
        return make_pipeline(codes, TemporalMaxPool(settings["cells"], memory=memory))

    regressor = DistributionalOrdinalRegressor(
        NNPOM(n_hidden=0, alpha=3.0), random_state=random_state
    )
    return Pipeline(
        [
            (
                "features",
                ColumnTransformer([(s, transformer(s), s) for s in sensors]),
            ),
            ("scale", StandardScaler()),
            ("model", regressor),
        ]
    )
