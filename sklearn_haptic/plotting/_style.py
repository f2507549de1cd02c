"""What all figures share: their axes, and colours that everyone can tell apart."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Two colours that people of every colour vision tell apart (Okabe and Ito, 2008).
BLUE, ORANGE = "#0072B2", "#E69F00"


def axes_of(
    ax: Axes | None, display: str, figsize: tuple[float, float] = (6.4, 4)
) -> Axes:
    """Return the axes given, or those of a new figure for a display."""
    try:
        from matplotlib import pyplot as plt
    except ImportError as error:
        raise ImportError(
            f"{display} needs matplotlib; install it with `pip install matplotlib`."
        ) from error
    if ax is None:
        _, ax = plt.subplots(figsize=figsize, layout="constrained")
    return ax


def panels_of(
    ax: Axes | None,
    display: str,
    n_rows: int,
    n_columns: int,
    *,
    figsize: tuple[float, float] = (6.4, 4),
    sharex: Any = False,
    sharey: Any = False,
    **options: Any,
) -> tuple[Axes, np.ndarray]:
    """Divide the axes given, or those of a new figure, into a grid of panels.

    Parameters
    ----------
    ax : matplotlib Axes or None
        Axes on a grid, such as ``subplots`` makes; they are switched off.
    display : str
        Name of the display, for the error without matplotlib.
    n_rows, n_columns : int
        Shape of the grid.
    figsize : tuple of float, default=(6.4, 4)
        Width and height of a new figure, in inches.
    sharex, sharey : bool or {"row", "col"}, default=False
        Which panels share an axis.
    **options
        Passed on to ``SubplotSpec.subgridspec``.

    Returns
    -------
    ax : matplotlib Axes
        The axes divided.
    panels : ndarray of matplotlib Axes of shape (n_rows, n_columns)

    Raises
    ------
    ValueError
        If the axes are on no grid.
    """
    ax = axes_of(ax, display, figsize)
    cell = ax.get_subplotspec()
    if cell is None:
        raise ValueError(
            f"ax is on no grid, so {display} cannot divide it into panels; make it "
            "with matplotlib.pyplot.subplots."
        )
    ax.set_axis_off()
    grid = cell.subgridspec(n_rows, n_columns, **options)
    return ax, grid.subplots(sharex=sharex, sharey=sharey, squeeze=False)


def colours_of(n_lines: int) -> list[Any]:
    """Colours of lines that differ in lightness too: two, or shades of viridis."""
    from matplotlib import colormaps

    if n_lines <= 2:
        return [BLUE, ORANGE][:n_lines]
    return [*colormaps["viridis"](np.linspace(0, 0.85, n_lines))]


def label_blocks(ax: Axes, names: list[str], max_labels: int, colour: str) -> None:
    """Label each run of equally named rows of an image once, and part the runs."""
    starts = [i for i, name in enumerate(names) if i == 0 or name != names[i - 1]]
    ends = [*starts[1:], len(names)]
    if len(starts) < len(names):
        for start in starts[1:]:
            ax.axhline(start - 0.5, color=colour, linewidth=0.5)
    shown = slice(None, None, -(-len(starts) // max_labels))
    ax.set_yticks(
        [(start + end - 1) / 2 for start, end in zip(starts, ends)][shown],
        labels=[names[start] for start in starts][shown],
    )
