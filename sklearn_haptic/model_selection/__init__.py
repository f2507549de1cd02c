"""Speed against accuracy, predictions out of fold, and what each sensor contributes."""

from ._contributions import contribution_summary, sensor_contributions
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
