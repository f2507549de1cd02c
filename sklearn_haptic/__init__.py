"""Predict how a crowd will rate an object's feel, from one robotic touch."""

from ._nnpom import NNPOM

__all__ = ["NNPOM"]
