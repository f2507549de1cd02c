"""Ratings given by people: counts per level, CDFs, agreement, correlation.

People rate an object on an ordered scale, so the ratings of objects are a table of
*counts*: how many people chose each level. Everything else follows from counts. The
columns of a labelled table are put in the order of the levels.
"""

from ._correlation import adjective_correlation
from ._counts import RatingTable, rating_counts, shrink_counts
from ._moments import counts_from_moments
from ._outlying_raters import outlying_raters
from ._summaries import (
    interrater_agreement,
    inverse_cdf,
    rating_cdf,
    rating_distribution,
    rating_mean,
)

__all__ = [
    "RatingTable",
    "adjective_correlation",
    "counts_from_moments",
    "interrater_agreement",
    "inverse_cdf",
    "outlying_raters",
    "rating_cdf",
    "rating_counts",
    "rating_distribution",
    "rating_mean",
    "shrink_counts",
]
