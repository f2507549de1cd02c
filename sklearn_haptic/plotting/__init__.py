"""Figures of ratings, recordings, features and predictions."""

from ._contributions import SensorContributionsDisplay
from ._features import AtomsDisplay, FeatureMapDisplay
from ._inverse_cdf import InverseCDFDisplay
from ._predictions import (
    DistributionDisplay,
    PITHistogramDisplay,
    ReliabilityDisplay,
)
from ._ratings import (
    AdjectiveCorrelationDisplay,
    InterraterAgreementDisplay,
    RatingsDisplay,
)
from ._signals import SignalsDisplay
from ._speed_accuracy import SpeedAccuracyDisplay

__all__ = [
    "AdjectiveCorrelationDisplay",
    "AtomsDisplay",
    "DistributionDisplay",
    "FeatureMapDisplay",
    "InterraterAgreementDisplay",
    "InverseCDFDisplay",
    "PITHistogramDisplay",
    "RatingsDisplay",
    "ReliabilityDisplay",
    "SensorContributionsDisplay",
    "SignalsDisplay",
    "SpeedAccuracyDisplay",
]
