"""Features of raw recordings: sparse codes over learned dictionaries, pooled."""

from ._pooling import TemporalMaxPool
from ._sthmp import STHMPTransformer
from ._windows import KSVDTransformer

__all__ = ["KSVDTransformer", "STHMPTransformer", "TemporalMaxPool"]
