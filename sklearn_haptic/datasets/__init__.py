"""Corpora of robotic touches and people's ratings: PHAC-2 and a generated one."""

from ._description import describe_corpus
from ._matlab_ratings import MatlabRatings
from ._phac2 import load_phac2
from ._synthetic import make_haptic_corpus

__all__ = ["MatlabRatings", "describe_corpus", "load_phac2", "make_haptic_corpus"]
