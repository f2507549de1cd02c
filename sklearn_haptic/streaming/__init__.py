"""Touches in progress: predictions from the first seconds of a touch."""

from ._anytime import AnytimeRegressor

__all__ = ["AnytimeRegressor"]
