"""Figures of ratings, recordings, features and predictions.

All raise an ImportError if matplotlib is not installed.
"""

from ._atoms import AtomsDisplay
from ._calibration import PITHistogramDisplay, ReliabilityDisplay
from ._contributions import SensorContributionsDisplay
from ._predicted_distributions import DistributionDisplay, InverseCDFDisplay
from ._ratings import (
    AdjectiveCorrelationDisplay,
    InterraterAgreementDisplay,
    RatingsDisplay,
)
from ._signals import SignalsDisplay
from ._speed_accuracy import SpeedAccuracyDisplay
from ._touch_time import TouchTimeDisplay

__all__ = [
    "AdjectiveCorrelationDisplay",
    "AtomsDisplay",
    "DistributionDisplay",
    "InterraterAgreementDisplay",
    "InverseCDFDisplay",
    "PITHistogramDisplay",
    "RatingsDisplay",
    "ReliabilityDisplay",
    "SensorContributionsDisplay",
    "SignalsDisplay",
    "SpeedAccuracyDisplay",
    "TouchTimeDisplay",
]
