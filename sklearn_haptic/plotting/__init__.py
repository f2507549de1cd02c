"""Figures of ratings, recordings, features and predictions."""

from ._contributions import SensorContributionsDisplay
from ._inverse_cdf import InverseCDFDisplay
from ._predictions import (
    DistributionDisplay,
    PITHistogramDisplay,
    ReliabilityDisplay,
)
from ._speed_accuracy import SpeedAccuracyDisplay

__all__ = [
    "DistributionDisplay",
    "InverseCDFDisplay",
    "PITHistogramDisplay",
    "ReliabilityDisplay",
    "SensorContributionsDisplay",
    "SpeedAccuracyDisplay",
]
