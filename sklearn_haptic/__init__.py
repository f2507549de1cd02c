"""Predict how a crowd will rate an object's feel, from one robotic touch."""

from ._pipeline import make_haptic_pipeline
from ._sequences import Sequences
from .features import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from .models import (
    NNPOM,
    PAPER_2020,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    SensorFusionNNPOM,
)

__version__ = "0.1.0"

__all__ = [
    "NNPOM",
    "PAPER_2020",
    "ContinuousRatingsRegressor",
    "DistributionalOrdinalRegressor",
    "DummyDistribution",
    "KSVDTransformer",
    "STHMPTransformer",
    "SensorFusionNNPOM",
    "Sequences",
    "TemporalMaxPool",
    "make_haptic_pipeline",
]
