"""Predictions for objects never touched, and choosing models by what accuracy costs.

:func:`cross_val_predict_proba` predicts each trial by a model that was fitted without
it; scikit-learn's function of nearly this name must not be used with counts.

A *candidate* is one setting of the parameters that a search tried. Its cost is the
seconds that the fitted model takes to predict one trial, all steps included, without
caches; :func:`neg_seconds_scorer` measures it. Its score is the mean test score over
the folds, higher being better, and its standard error the standard deviation of the
folds' scores over the square root of their number. Candidates whose score or cost is
not finite, such as those whose fit failed, are left out.

The sensors of a model are such a choice too: :func:`sensor_subsets` tries them all.
:func:`sensor_contributions` holds out one after the other where a model combines them.
"""

from ._contribution_summary import contribution_summary
from ._contributions import sensor_contributions
from ._cost import neg_seconds_scorer
from ._frontier import cheapest_within_one_se, speed_accuracy_frontier
from ._out_of_fold import cross_val_predict_proba
from ._subsets import sensor_subsets

__all__ = [
    "cheapest_within_one_se",
    "contribution_summary",
    "cross_val_predict_proba",
    "neg_seconds_scorer",
    "sensor_contributions",
    "sensor_subsets",
    "speed_accuracy_frontier",
]
