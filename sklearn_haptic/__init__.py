"""Predict how a crowd will rate an object's feel, from one robotic touch."""

from importlib import import_module
from typing import Any

from ._pipeline import make_haptic_pipeline
from .ensembles import ConformalRatings, DistributionBlend, NoveltyGuard, TouchPool
from .features import (
    KSVDTransformer,
    SignalStatistics,
    STHMPTransformer,
    TemporalMaxPool,
)
from .models import (
    NNPOM,
    PAPER_2020,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    RegressedDistribution,
    SensorFusionNNPOM,
)
from .recordings import (
    RepairTrials,
    Sequences,
    Signal,
    TaxelGrid,
    resample_trials,
)
from .streaming import AnytimeRegressor

__version__ = "0.1.0"

__all__ = [
    "NNPOM",
    "PAPER_2020",
    "AnytimeRegressor",
    "ConformalRatings",
    "ContinuousRatingsRegressor",
    "DistributionBlend",
    "DistributionalOrdinalRegressor",
    "DummyDistribution",
    "KSVDTransformer",
    "NoveltyGuard",
    "RegressedDistribution",
    "RepairTrials",
    "STHMPTransformer",
    "SensorFusionNNPOM",
    "Sequences",
    "Signal",
    "SignalStatistics",
    "TaxelGrid",
    "TemporalMaxPool",
    "TouchPool",
    "make_haptic_pipeline",
    "resample_trials",
]

_SUBMODULES = (
    "datasets",
    "metrics",
    "model_selection",
    "plotting",
    "ratings",
    "study",
)


def __dir__() -> list[str]:
    return sorted({*globals(), *_SUBMODULES})


def __getattr__(name: str) -> Any:
    """Import a public module when it is first asked for."""
    if name in _SUBMODULES:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
