"""Features of raw recordings: pooled codes over dictionaries, statistics."""

from ._ksvd_transformer import KSVDTransformer
from ._pooling import TemporalMaxPool
from ._statistics import SignalStatistics
from ._sthmp import STHMPTransformer

__all__ = [
    "KSVDTransformer",
    "STHMPTransformer",
    "SignalStatistics",
    "TemporalMaxPool",
]
