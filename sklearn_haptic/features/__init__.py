"""Features of raw recordings: pooled codes over learned dictionaries, statistics."""

from ._pooling import TemporalMaxPool
from ._statistics import SignalStatistics
from ._sthmp import STHMPTransformer
from ._windows import KSVDTransformer

__all__ = [
    "KSVDTransformer",
    "STHMPTransformer",
    "SignalStatistics",
    "TemporalMaxPool",
]
