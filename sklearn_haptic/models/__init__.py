"""Models that predict the distribution of ratings from features."""

from ._baselines import DummyDistribution
from ._continuous import ContinuousRatingsRegressor
from ._distributional import PAPER_2020, DistributionalOrdinalRegressor
from ._fusion import SensorFusionNNPOM
from ._nnpom import NNPOM
from ._regressed import RegressedDistribution

__all__ = [
    "NNPOM",
    "PAPER_2020",
    "ContinuousRatingsRegressor",
    "DistributionalOrdinalRegressor",
    "DummyDistribution",
    "RegressedDistribution",
    "SensorFusionNNPOM",
]
