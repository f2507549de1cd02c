"""What each sensor adds: scores of a model, and of the same without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Self

import numpy as np
import pandas as pd

from ..model_selection import contribution_summary
from ._display import Axes, Display
from ._style import BLUE

# Name and unit of each score of `sensor_contributions`.
_SCORE_LABELS = {
    "macro_mae": ("MAE$^M$", "levels"),
    "emd": ("EMD", "levels"),
    "rps": ("RPS", "levels"),
    "log_score": ("log score", "nats"),
}


@dataclass(eq=False, repr=False)
class SensorContributionsDisplay(Display):
    """How much a model's score changes without each sensor.

    Use :meth:`from_scores` to create a display. Points are mean differences to the full
    model over random starts, with error bars of one standard deviation; above zero, the
    sensor helps. A dagger marks a sensor that helps with p < .05 over objects. With
    ``absolute=True`` bars are the scores themselves, as in the paper, of the full model
    ("none") too.

    Parameters
    ----------
    summary : DataFrame
        What :func:`~sklearn_haptic.model_selection.contribution_summary` returned.
    metric : str, default="macro_mae"
        Name of the score.
    by : sequence of str, default=()
        Columns of ``summary`` that have one group of points per value.
    absolute : bool, default=False
        Whether to draw the scores themselves, as bars.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the points.
    figure_ : matplotlib Figure
    points_ : matplotlib ErrorbarContainer
        The points and their error bars, group by group.
    bars_ : matplotlib BarContainer
        The scores of each group, "none" first, if ``absolute``.
    marks_ : list of matplotlib Annotation
        The daggers of each row of ``summary``.

    See Also
    --------
    sklearn_haptic.model_selection.contribution_summary : The same as a table.

    References
    ----------
    Richardson and Kuchenbecker (2020), figure 12. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_haptic.plotting import SensorContributionsDisplay
    >>> scores = pd.DataFrame(
    ...     {
    ...         "held_out": ["none"] * 4 + ["pac"] * 4,
    ...         "start": [0, 0, 1, 1] * 2,
    ...         "object": ["foam", "cork"] * 4,
    ...         "emd": [0.5, 0.3, 0.5, 0.5, 0.75, 0.75, 0.75, 0.75],
    ...     }
    ... )
    >>> display = SensorContributionsDisplay.from_scores(scores, metric="emd")
    >>> [label.get_text() for label in display.ax_.get_xticklabels()]
    ['pac']
    """

    summary: pd.DataFrame
    _: KW_ONLY
    metric: str = "macro_mae"
    by: Sequence[str] = ()
    absolute: bool = False

    @classmethod
    def from_scores(
        cls,
        scores: pd.DataFrame,
        *,
        metric: str = "macro_mae",
        by: str | Sequence[str] | None = None,
        absolute: bool = False,
        ax: Axes | None = None,
    ) -> Self:
        """Summarise the scores of a model and its holdouts, and plot them.

        Parameters
        ----------
        scores : DataFrame
            What :func:`~sklearn_haptic.model_selection.sensor_contributions` returned,
            or one with the further columns ``adjective`` and ``procedure``.
        metric : str, default="macro_mae"
            Name of the score.
        by : str or list of str, default=None
            Columns that have one group of points per value, such as ``"procedure"``.
            ``"threshold"`` gives the terms of the ranked probability score, in place of
            ``metric``.
        absolute : bool, default=False
            Whether to draw the scores themselves, as bars.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : SensorContributionsDisplay

        Raises
        ------
        ValueError
            If the scores have no summary; see
            :func:`~sklearn_haptic.model_selection.contribution_summary`.
        """
        by = () if by is None else (by,) if isinstance(by, str) else tuple(by)
        metric = "rps" if "threshold" in by else metric
        summary = contribution_summary(scores, metric=metric, by=by)
        return cls(summary, metric=metric, by=by, absolute=absolute).plot(ax)

    def _draw(self, ax):
        summary, sensors = self.summary, [*self.summary["held_out"].unique()]
        groups = summary[:: len(sensors)]  # one of its rows stands for each group
        of = "holdout" if self.absolute else "difference"
        values, sd, marks = (
            np.reshape(column, (len(groups), len(sensors)))
            for column in (summary[of], summary[f"{of}_sd"], _marks(summary))
        )
        score, *unit = _SCORE_LABELS.get(self.metric, (self.metric,))
        label = f"{score} without the sensor\nless {score} with all"
        if self.absolute:
            sensors, label = ["none", *sensors], score
            values = np.column_stack((groups["full"], values))
            sd = np.column_stack((groups["full_sd"], sd))
            marks = np.column_stack(([""] * len(groups), marks))
        x = np.add.outer(
            (len(sensors) + 1) * np.arange(len(groups)), np.arange(len(sensors))
        )
        style = {"fmt": "o", "color": BLUE, "markersize": 4}
        if self.absolute:
            colours = ["0.35"] + [BLUE] * (len(sensors) - 1)
            self.bars_ = ax.bar(x.ravel(), values.ravel(), color=colours * len(groups))
            style = {"fmt": "none", "color": "black"}
        ax.axhline(0, color="black", linewidth=0.8)
        self.points_ = ax.errorbar(
            x.ravel(), values.ravel(), sd.ravel(), elinewidth=1, capsize=2.5, **style
        )
        self.marks_ = [
            ax.annotate(
                mark, xy, (0, 2), textcoords="offset points", ha="center", va="bottom"
            )
            for mark, *xy in zip(marks.ravel(), x.ravel(), (values + sd).ravel())
        ]
        ax.margins(y=0.15)
        if self.absolute:
            ax.set_ylim(bottom=0)
        ax.set_xlim(-0.6, x.max() + 0.6)
        known = "   († helps: p < .05 over objects)" * ("p_objects" in summary)
        ax.set(
            xlabel=f"sensor left out{known}",
            ylabel=", ".join([label, *unit]),
        )
        ax.set_xticks(
            x.ravel(), sensors * len(groups), rotation=90 if x.size > 8 else 0
        )
        full = [f"{score} {value:.2f}" for value in groups["full"]]
        if len(self.by):
            names = _group_names(groups[[*self.by]])
            full = [f"{name}\n{value}" for name, value in zip(names, full)]
        above = ax.secondary_xaxis("top")
        above.set_xticks(x.mean(axis=1), full)
        above.tick_params(length=0)


def _marks(summary):
    """Daggers of each row of a summary of contributions."""
    if "p_objects" not in summary:
        return [""] * len(summary)
    return np.where(summary["p_objects"] < 0.05, "†", "").tolist()


def _group_names(values):
    """Names of groups; numbers are named by their column."""
    return [
        ", ".join(
            value.replace("_", " ") if isinstance(value, str) else f"{column} {value}"
            for column, value in zip(values.columns, row)
        )
        for row in values.itertuples(index=False)
    ]
