"""Features of raw recordings: pooled codes over dictionaries, statistics."""

from ._pooling import TemporalMaxPool
from ._repair import RepairTrials
from ._resample import infer_rate, resample_trials
from ._sensor_features import SensorFeatures
from ._statistics import SignalStatistics
from ._sthmp import STHMPTransformer
from ._windows import KSVDTransformer

__all__ = [
    "KSVDTransformer",
    "RepairTrials",
    "STHMPTransformer",
    "SensorFeatures",
    "SignalStatistics",
    "TemporalMaxPool",
    "infer_rate",
    "resample_trials",
]
