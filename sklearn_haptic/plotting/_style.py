"""What all figures share: their axes, and colours that everyone can tell apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Two colours that people of every colour vision tell apart (Okabe and Ito, 2008).
BLUE, ORANGE = "#0072B2", "#E69F00"


def axes_of(ax: Axes | None, display: str) -> Axes:
    """Return the axes given, or those of a new figure for a display."""
    try:
        from matplotlib import pyplot as plt
    except ImportError as error:
        raise ImportError(
            f"{display} needs matplotlib; install it with "
            "pip install 'sklearn_haptic[plot]'."
        ) from error
    if ax is None:
        _, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
    return ax
