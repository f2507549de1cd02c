"""Models made of models, weighed and judged by predictions out of fold."""

from ._blend import DistributionBlend
from ._conformal_ratings import ConformalRatings
from ._novelty_guard import NoveltyGuard
from ._touch_pool import TouchPool

__all__ = ["ConformalRatings", "DistributionBlend", "NoveltyGuard", "TouchPool"]
