"""Corpora of robotic touches and people's ratings: PHAC-2 and a generated one."""

from sklearn_haptic.datasets._phac2 import load_phac2
from sklearn_haptic.datasets._synthetic import make_haptic_corpus

__all__ = ["load_phac2", "make_haptic_corpus"]
