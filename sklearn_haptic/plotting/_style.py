"""Colours that everyone can tell apart, legends beside the axes, labels of images."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._display import Axes

# Two colours that people of every colour vision tell apart (Okabe and Ito, 2008).
BLUE, ORANGE = "#0072B2", "#E69F00"


def colours_of(n_lines: int) -> list[Any]:
    """Colours of lines that differ in lightness too: two, or shades of viridis."""
    from matplotlib import colormaps

    if n_lines <= 2:
        return [BLUE, ORANGE][:n_lines]
    return [*colormaps["viridis"](np.linspace(0, 0.85, n_lines))]


def legend_beside(ax: Axes, **options: Any) -> None:
    """Put a legend to the right of the axes, at their top by default."""
    place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1), "frameon": False}
    ax.legend(**place | options)


def label_blocks(ax: Axes, names: list[str]) -> None:
    """Label runs of equally named rows of an image, up to eight, and part the runs."""
    starts = [i for i, name in enumerate(names) if i == 0 or name != names[i - 1]]
    ends = [*starts[1:], len(names)]
    if len(starts) < len(names):
        for start in starts[1:]:
            ax.axhline(start - 0.5, color="white", linewidth=0.5)
    shown = slice(None, None, -(-len(starts) // 8))
    ax.set_yticks(
        [(start + end - 1) / 2 for start, end in zip(starts, ends)][shown],
        labels=[names[start] for start in starts][shown],
    )
