"""Predictions for objects never touched, and choices of models by accuracy and speed.

:func:`cross_val_predict_proba` predicts each trial by a model that was fitted without
it, and :func:`model_report` scores such predictions beside guessing. Do not use
scikit-learn's :func:`~sklearn.model_selection.cross_val_predict` with counts.

A *candidate* is one setting of the parameters that a search tried. Its cost is the
seconds that the fitted model takes to predict one trial, with all steps and without
caches; :func:`neg_seconds_scorer` measures it. Its score is the mean test score over
the folds, higher being better, and its standard error is the standard deviation of the
folds' scores divided by the square root of their number. Candidates whose score or cost
is not finite, such as those whose fit failed, are left out.

Sensors are chosen in the same way: :func:`sensor_subsets` tries all sets of them.
:func:`sensor_contributions` leaves out one sensor after the other from a model that
combines them.
"""

from ._contribution_summary import contribution_summary
from ._contributions import sensor_contributions
from ._cost import neg_seconds_scorer
from ._cross_val_predict_proba import cross_val_predict_proba
from ._frontier import cheapest_within_one_se, speed_accuracy_frontier
from ._model_report import model_report
from ._subsets import sensor_subsets

__all__ = [
    "cheapest_within_one_se",
    "contribution_summary",
    "cross_val_predict_proba",
    "model_report",
    "neg_seconds_scorer",
    "sensor_contributions",
    "sensor_subsets",
    "speed_accuracy_frontier",
]
