r"""Scores of predicted distributions of ratings, and scorers for searches.

Throughout, trial t has the *true* distribution :math:`F_k`, the proportion of
people who rated its object at level k or below, and the *predicted* one
:math:`\hat F_k`. Levels are ordinal, so distances between ratings are counted in
levels: neighbours are 1 apart whatever their labels. Where the levels are numbers that
mean something, as -3 … 3 or 0 … 100 do, ``units="scale"`` counts in these numbers.
"""

from ._absolute_errors import earth_movers_distance, macro_mae, macro_mae_at_positions
from ._calibration import dispersion, pit_histogram
from ._noise_ceiling import noise_ceiling
from ._proper_scores import crps, log_score, ranked_probability_score
from ._scorers import neg_macro_mae_scorer, neg_rps_scorer

__all__ = [
    "crps",
    "dispersion",
    "earth_movers_distance",
    "log_score",
    "macro_mae",
    "macro_mae_at_positions",
    "neg_macro_mae_scorer",
    "neg_rps_scorer",
    "noise_ceiling",
    "pit_histogram",
    "ranked_probability_score",
]

# Saved models and the records of a study name scores by this module.
for _name in __all__:
    globals()[_name].__module__ = __name__
