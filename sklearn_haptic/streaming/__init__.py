"""Touches in progress: predictions while a touch goes on, and when to stop it.

:class:`sklearn_haptic.AnytimeRegressor` predicts from touches of any length; its method
`start` begins a touch of which the samples arrive bit by bit. A rule of stopping says
when a touch is long enough.
"""

from ._anytime import AnytimeRegressor
from ._stopping import CertaintyThreshold, ExpectedGain
from ._touch_in_progress import TouchInProgress

__all__ = [
    "AnytimeRegressor",
    "CertaintyThreshold",
    "ExpectedGain",
    "TouchInProgress",
]
