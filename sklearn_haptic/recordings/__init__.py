"""Recordings of sensors: what they are, whether they are whole, and their repair."""

from ._repair import RepairTrials
from ._resample import resample_trials
from ._sensors import Signal, TaxelGrid
from ._sequences import Sequences

__all__ = [
    "RepairTrials",
    "Sequences",
    "Signal",
    "TaxelGrid",
    "resample_trials",
]
