"""Figures of ratings, recordings, features and predictions."""

from ._contributions import SensorContributionsDisplay
from ._features import AtomsDisplay, FeatureMapDisplay
from ._inverse_cdf import InverseCDFDisplay
from ._predictions import (
    DistributionDisplay,
    PITHistogramDisplay,
    ReliabilityDisplay,
)
from ._signals import SignalsDisplay
from ._speed_accuracy import SpeedAccuracyDisplay

__all__ = [
    "AtomsDisplay",
    "DistributionDisplay",
    "FeatureMapDisplay",
    "InverseCDFDisplay",
    "PITHistogramDisplay",
    "ReliabilityDisplay",
    "SensorContributionsDisplay",
    "SignalsDisplay",
    "SpeedAccuracyDisplay",
]
