"""Time and score of the candidates of a search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..model_selection._frontier import (
    best_and_cheapest,
    is_non_dominated,
    read_candidates,
)
from ..utils._sklearn import BaseSearchCV
from ._display import Axes, Display
from ._style import BLUE, ORANGE


@dataclass(eq=False, repr=False)
class SpeedAccuracyDisplay(Display):
    """Time and score of every candidate of a search, and the frontier of the two.

    Use :meth:`from_search` to create a display. The time is that of predicting one
    trial, as :func:`~sklearn_haptic.model_selection.neg_seconds_scorer` measures it.
    The frontier is the best score within each time. The dotted line is one standard
    error below the best score. The circle is what
    :func:`~sklearn_haptic.model_selection.cheapest_within_one_se` chooses: of the
    candidates above this line that are at most a tenth slower than the fastest of them,
    the one with the best score.

    Parameters
    ----------
    seconds : ndarray of shape (n_candidates,)
        Time of each candidate to predict a trial. If all are below 0.1, the axis has
        milliseconds.
    score : ndarray of shape (n_candidates,)
        Mean test score, higher is better.
    score_se : ndarray of shape (n_candidates,)
        Standard error of the mean test score.
    on_frontier : ndarray of shape (n_candidates,)
        Whether no other candidate beats this one in time and score.
    best : int
        Which candidate has the best score.
    cheapest : int
        Which candidate is the cheapest within one standard error of the best.
    metric : str, default="score"
        Name of the score.
    names : sequence of str, default=None
        Name of each candidate, which is written at those on the frontier.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the candidates.
    figure_ : matplotlib Figure
    errorbar_ : matplotlib ErrorbarContainer
        The candidates, with bars of one standard error.
    frontier_ : matplotlib Line2D
        The frontier.
    best_, cheapest_ : matplotlib Line2D
        The marks of the two chosen candidates.
    names_ : list of matplotlib Annotation
        The names of the candidates on the frontier, from the fastest on, without those
        that would cover the name of a better one.

    See Also
    --------
    sklearn_haptic.model_selection.speed_accuracy_frontier : The same as a table.
    sklearn_haptic.model_selection.cheapest_within_one_se : Refit the cheapest.

    Examples
    --------
    >>> from sklearn_haptic.plotting import SpeedAccuracyDisplay
    >>> cv_results = {
    ...     "split0_test_neg_seconds": [-0.01, -0.03, -0.08],
    ...     "split1_test_neg_seconds": [-0.01, -0.03, -0.08],
    ...     "mean_test_neg_seconds": [-0.01, -0.03, -0.08],
    ...     "split0_test_rps": [-0.75, -0.25, -0.5],
    ...     "split1_test_rps": [-0.25, -0.25, -0.5],
    ...     "mean_test_rps": [-0.5, -0.25, -0.5],
    ... }
    >>> display = SpeedAccuracyDisplay.from_search(cv_results)
    >>> display.on_frontier
    array([ True,  True, False])
    """

    seconds: NDArray[np.float64]
    score: NDArray[np.float64]
    score_se: NDArray[np.float64]
    _: KW_ONLY
    on_frontier: NDArray[np.bool_]
    best: int
    cheapest: int
    metric: str = "score"
    names: Sequence[str] | None = None

    @classmethod
    def from_search(
        cls,
        search: BaseSearchCV | Mapping[str, Any] | pd.DataFrame,
        *,
        metric: str | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Plot the candidates of a search.

        Of :func:`~sklearn_haptic.model_selection.sensor_subsets`, the figure names the
        sensors of the candidates on the frontier.

        Parameters
        ----------
        search : fitted search, dict or DataFrame
            A fitted search of scikit-learn, or its ``cv_results_``; or the table of
            ``sensor_subsets``. Of successive
            halving only the last iteration counts.
        metric : str, default=None
            Name of the score in a search with several; by default that of its
            ``refit`` if this is a name.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : SpeedAccuracyDisplay

        Raises
        ------
        ValueError
            If the metric is unknown or not given among several, the search has no score
            "neg_seconds", there are fewer than two splits, or no score is finite.
        """
        candidates = read_candidates(search, metric)
        best, cheapest = best_and_cheapest(candidates)
        params = list(getattr(search, "cv_results_", search).get("params", ()))
        names = None
        if params and all(isinstance(each.get("sensors"), tuple) for each in params):
            names = ["\n".join(params[i]["sensors"]) for i in candidates.position]
        return cls(
            candidates.seconds,
            candidates.score,
            candidates.score_se,
            on_frontier=is_non_dominated(candidates.seconds, candidates.score),
            best=best,
            cheapest=cheapest,
            metric=candidates.metric,
            names=names,
        ).plot(ax)

    def _draw(self, ax):
        from matplotlib.ticker import LogLocator

        seconds, score = self.seconds, self.score
        self.errorbar_ = ax.errorbar(
            seconds,
            score,
            self.score_se,
            fmt="o",
            color="0.6",
            markersize=4,
            elinewidth=0.8,
            label="candidates ± 1 SE",
        )
        frontier = self._draw_frontier(ax)
        self._mark_choices(ax)
        ax.axhline(
            score[self.best] - self.score_se[self.best],
            color="black",
            linewidth=0.8,
            linestyle=":",
            label="best − 1 SE",
        )
        short = seconds.max() < 0.1
        metric = "score" if self.metric == "score" else f"score ({self.metric})"
        ax.set(
            xscale="log",
            xlabel=f"time to predict, {'milli' if short else ''}seconds per trial",
            ylabel=f"mean test {metric}, higher is better",
        )
        ticks = (1, 2, 5) if seconds.max() < 1000 * seconds.min() else (1,)
        ax.xaxis.set_major_locator(LogLocator(subs=ticks))
        ax.xaxis.set_major_formatter(lambda x, _: f"{1000 * x if short else x:g}")
        ax.xaxis.set_minor_formatter("")
        self._write_names(ax, frontier if self.names is not None else [])
        ax.legend(
            loc="lower center", bbox_to_anchor=(0.5, 1.01), ncols=3, frameon=False
        )

    def _draw_frontier(self, ax):
        frontier = np.flatnonzero(self.on_frontier)
        frontier = frontier[np.argsort(self.seconds[frontier], kind="stable")]
        seconds, score = self.seconds[frontier], self.score[frontier]
        (self.frontier_,) = ax.step(
            np.append(seconds, self.seconds.max()),
            np.append(score, score[-1]),
            where="post",
            marker="o",
            markersize=5,
            markevery=list(range(len(frontier))),
            color=BLUE,
            linewidth=1.8,
            zorder=3,
            label="frontier",
        )
        return frontier

    def _write_names(self, ax, frontier):
        """Name candidates, but those whose names would cover that of a better one."""
        self.names_ = []
        for i in frontier[::-1]:
            name = ax.annotate(
                self.names[i],
                (self.seconds[i], self.score[i]),
                (9, -4),
                textcoords="offset points",
                fontsize="small",
                va="top",
                bbox={"color": "white", "alpha": 0.7, "pad": 0.5},
            )
            box = name.get_window_extent()
            if any(box.overlaps(each.get_window_extent()) for each in self.names_):
                name.remove()
            else:
                self.names_.insert(0, name)

    def _mark_choices(self, ax):
        (self.best_,) = ax.plot(
            self.seconds[self.best],
            self.score[self.best],
            "*",
            color=ORANGE,
            markersize=13,
            markeredgecolor="black",
            markeredgewidth=0.6,
            zorder=4,
            label="best",
        )
        (self.cheapest_,) = ax.plot(
            self.seconds[self.cheapest],
            self.score[self.cheapest],
            "o",
            color="black",
            fillstyle="none",
            markersize=15,
            markeredgewidth=1.6,
            zorder=4,
            label="cheapest (to a tenth) within 1 SE",
        )
