"""Models made of models, weighed and judged by predictions out of fold."""

from ._blend import DistributionBlend
from ._novelty_guard import NoveltyGuard
from ._touch_pool import TouchPool

__all__ = ["DistributionBlend", "NoveltyGuard", "TouchPool"]
