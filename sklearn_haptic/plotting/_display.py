"""What all displays share: axes, panels, and the order in which a figure is made."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..utils._sklearn import check_matplotlib_support

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
else:  # matplotlib may not be installed
    Axes = Any


class Display:
    """Base of the displays, which hold what is plotted and draw it by `_draw`."""

    def plot(self, ax: Axes | None = None) -> Self:
        """Plot the display.

        Parameters
        ----------
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure. A display of several
            panels divides the axes, which ``subplots`` must have made.

        Returns
        -------
        display : object
            This display, with ``ax_`` and the other attributes set.

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        check_matplotlib_support(type(self).__name__)
        if ax is None:
            from matplotlib import pyplot as plt

            _, ax = plt.subplots(figsize=self._figsize(), layout="constrained")
        self.ax_, self.figure_ = ax, ax.figure
        self._draw(ax)
        return self

    def _figsize(self) -> tuple[float, float]:
        """Return the width and height of a new figure, in inches."""
        return 6.4, 4

    def _draw(self, ax: Any) -> None:
        raise NotImplementedError

    def _divide(self, shape: tuple[int, int], **shared: Any) -> np.ndarray:
        """Divide the axes into rows and columns of panels; `shared` are sharex, sharey.

        If the axes are on no grid, a ValueError is raised.
        """
        cell = self.ax_.get_subplotspec()
        if cell is None:
            raise ValueError("ax is on no grid; make it by matplotlib.pyplot.subplots.")
        self.ax_.set_axis_off()
        return cell.subgridspec(*shape).subplots(squeeze=False, **shared)
