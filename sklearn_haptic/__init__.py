"""Predict how a crowd will rate an object's feel, from one robotic touch."""

from ._baselines import DummyDistribution
from ._distributional import PAPER_2020, DistributionalOrdinalRegressor
from ._fusion import SensorFusionNNPOM
from ._ksvd import KSVDTransformer
from ._nnpom import NNPOM
from ._pooling import TemporalMaxPool
from ._presets import make_haptic_pipeline
from ._sthmp import STHMPTransformer

__version__ = "0.1.0"

__all__ = [
    "NNPOM",
    "PAPER_2020",
    "DistributionalOrdinalRegressor",
    "DummyDistribution",
    "KSVDTransformer",
    "STHMPTransformer",
    "SensorFusionNNPOM",
    "TemporalMaxPool",
    "make_haptic_pipeline",
]
