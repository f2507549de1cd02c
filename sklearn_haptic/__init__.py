"""Predict how a crowd will rate an object's feel, from one robotic touch."""

from ._distributional import (
    PAPER_2020,
    DistributionalOrdinalRegressor,
    DummyDistribution,
)
from ._nnpom import NNPOM

__all__ = [
    "NNPOM",
    "PAPER_2020",
    "DistributionalOrdinalRegressor",
    "DummyDistribution",
]
