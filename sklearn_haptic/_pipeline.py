"""A whole model in one call, at a named point between fast and accurate."""

from collections.abc import Sequence
from typing import Any, Literal

from sklearn.compose import ColumnTransformer
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from ._biotac import SENSORS
from ._sklearn import Memory, RandomState
from .features import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from .models import NNPOM, DistributionalOrdinalRegressor

# Window in time samples and number of atoms, as in the 2020 paper.
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

    Every sensor gives sparse codes over a dictionary of its own, pooled over time;
    the features of all sensors are standardised and feed a linear
    `DistributionalOrdinalRegressor`. The result is an ordinary Pipeline with the
    steps ``"features"`` (a ColumnTransformer with a transformer a sensor),
    ``"scale"`` and ``"model"``, whose parameters can be set and searched.

    Parameters
    ----------
    sensors : sequence of {"pac", "pdc", "tac", "tdc", "electrodes"}
        The sensors to use: columns of a DataFrame of trials, as `load_phac2` and
        `make_haptic_corpus` return it. By default all five.
    preset : {"fast", "balanced", "accurate"}, default="fast"
        How much time the features may take. "accurate" learns the dictionaries by the
        defaults of the transformers. "balanced" takes about half its time, learning
        from fewer windows in fewer iterations, and "fast" a third, with two
        coefficients a code. On generated touches and recorded grips the three were
        equally accurate; try the slower ones where there are more objects.
    memory : str or object with the joblib.Memory interface, default=None
        Where the transformers cache dictionaries and pooled features, so that a
        search over the model computes the features once a fold.
    random_state : int, RandomState instance or None, default=None
        For the dictionaries, and for hidden units if the model is given any.

    Returns
    -------
    pipeline : sklearn.pipeline.Pipeline
        Unfitted.

    Raises
    ------
    ValueError
        If a sensor or the preset is unknown, or there is no sensor.

    Notes
    -----
    What each setting costs and gains was measured on generated and on recorded touches.
    Means of windows are kept: the level of a signal is information for pressure and
    temperature, and did no harm elsewhere.

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
    unknown = [sensor for sensor in sensors if sensor not in SENSORS]
    if unknown or not len(sensors):
        raise ValueError(
            f"sensors={list(sensors)!r} must name some of {list(SENSORS)}; for other "
            "sensors build a Pipeline of KSVDTransformer or STHMPTransformer."
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

    def transformer(sensor):
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
