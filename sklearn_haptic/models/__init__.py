"""Models that predict the distribution of ratings from features."""

from ._baselines import DummyDistribution
from ._blend import DistributionBlend
from ._continuous import ContinuousRatingsRegressor
from ._distributional import PAPER_2020, DistributionalOrdinalRegressor
from ._fusion import SensorFusionNNPOM
from ._nnpom import NNPOM
from ._novelty_guard import NoveltyGuard
from ._regressed import RegressedDistribution
from ._touch_pool import TouchPool

__all__ = [
    "NNPOM",
    "PAPER_2020",
    "ContinuousRatingsRegressor",
    "DistributionBlend",
    "DistributionalOrdinalRegressor",
    "DummyDistribution",
    "NoveltyGuard",
    "RegressedDistribution",
    "SensorFusionNNPOM",
    "TouchPool",
]
