"""Figures of predicted distributions, what accuracy costs and what sensors add."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

from ._typing import Trials
from ._validation import check_ratings, check_regular
from .metrics import _check_distributions, macro_mae_per_trial
from .model_selection import (
    best_and_cheapest,
    contribution_summary,
    is_non_dominated,
    read_candidates,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from sklearn.model_selection._search import BaseSearchCV

# Levels by which neighbouring trials, and all together, are set apart, so that
# equal predictions both show.
_OFFSET, _MAX_OFFSET = 0.035, 0.4
# Two colours that people of every colour vision tell apart (Okabe and Ito, 2008).
_BLUE, _ORANGE = "#0072B2", "#E69F00"
# Name and unit of each score of `sensor_contributions`.
_SCORE_LABELS = {
    "macro_mae": "MAE$^M$, levels",
    "emd": "EMD, levels",
    "rps": "RPS, levels",
    "log_score": "log score, nats",
}


def _axes(ax: Axes | None, display: str) -> Axes:
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


class InverseCDFDisplay:
    """Inverse CDFs of ratings predicted from touches of one object, and the true one.

    Use :meth:`from_predictions` or :meth:`from_estimator` to create a display.

    Parameters
    ----------
    counts : ndarray of shape (n_levels,)
        How many people gave the object each rating.
    y_proba : ndarray of shape (n_trials, n_levels)
        Probability of each rating, predicted from each trial.
    levels : ndarray of shape (n_levels,)
        The ordered levels.
    scores : ndarray of shape (n_trials,)
        Macro-averaged mean absolute error of each trial, in levels.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the inverse CDFs.
    figure_ : matplotlib Figure
        Figure that holds the axes.
    true_line_ : matplotlib StepPatch
        The inverse CDF of the people's ratings.
    trial_lines_ : list of matplotlib StepPatch
        The inverse CDF predicted from each trial.

    References
    ----------
    B. A. Richardson and K. J. Kuchenbecker, "Learning to predict perceptual
    distributions of haptic adjectives", Frontiers in Neurorobotics 13, 2020,
    figure 11. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.plotting import InverseCDFDisplay
    >>> display = InverseCDFDisplay.from_predictions(
    ...     [0, 3, 6, 3, 0], [[0, 0.4, 0.4, 0.2, 0], [0.1, 0.2, 0.5, 0.1, 0.1]]
    ... )
    >>> display.ax_.get_ylabel()
    'rating'
    """

    def __init__(
        self,
        counts: NDArray[np.float64],
        y_proba: NDArray[np.float64],
        *,
        levels: np.ndarray,
        scores: NDArray[np.float64],
    ) -> None:
        self.counts = counts
        self.y_proba = y_proba
        self.levels = levels
        self.scores = scores

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: Trials,
        y: ArrayLike,
        *,
        ax: Axes | None = None,
    ) -> Self:
        """Predict the distribution of each trial of one object and plot it.

        Parameters
        ----------
        estimator : object
            Fitted, with ``predict_proba`` and ``classes_`` (the ordered levels).
        X : array-like of length n_trials
            The object's trials.
        y : array-like of shape (n_levels,) or (n_trials, n_levels)
            How many people gave the object each rating; one row a trial must be
            the same row each time.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : InverseCDFDisplay
            The display, plotted.

        Raises
        ------
        ValueError
            If the rows of ``y`` differ, or do not fit the estimator's levels.
        ImportError
            If matplotlib is not installed.
        """
        return cls.from_predictions(
            y, estimator.predict_proba(X), levels=estimator.classes_, ax=ax
        )

    @classmethod
    def from_predictions(
        cls,
        y_true: ArrayLike,
        y_proba: ArrayLike,
        *,
        levels: ArrayLike | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Plot the distributions predicted from the trials of one object.

        Parameters
        ----------
        y_true : array-like of shape (n_levels,) or (n_trials, n_levels)
            How many people gave the object each rating; one row a trial must be
            the same row each time.
        y_proba : array-like of shape (n_trials, n_levels)
            Probability of each rating, predicted from each trial.
        levels : array-like of shape (n_levels,), default=None
            The ordered levels; by default 1, 2, …, n_levels.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : InverseCDFDisplay
            The display, plotted.

        Raises
        ------
        ValueError
            If a row of ``y_proba`` is no distribution, the rows of ``y_true``
            differ, or the shapes do not fit.
        ImportError
            If matplotlib is not installed.
        """
        y_true = np.atleast_2d(y_true)
        counts, levels = check_ratings(y_true, levels, name="y_true")
        if (counts != counts[0]).any():
            raise ValueError(
                "y_true has different ratings for different trials; give the trials "
                "of one object only."
            )
        n_trials = len(np.atleast_1d(check_regular(y_proba, "y_proba")))
        counts = np.broadcast_to(counts[:1], (n_trials, counts.shape[1]))
        counts, y_proba = _check_distributions(counts, y_proba, levels)
        scores = macro_mae_per_trial(counts, y_proba, average=False)
        return cls(counts[0], y_proba, levels=levels, scores=scores).plot(ax)

    def plot(self, ax: Axes | None = None) -> Self:
        """Plot the inverse CDFs, each trial a little above the one before.

        Parameters
        ----------
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : InverseCDFDisplay
            This display, with ``ax_`` and the other attributes set.

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        ax = _axes(ax, type(self).__name__)
        from matplotlib import colormaps

        n_trials = len(self.y_proba)
        offset = min(_OFFSET, _MAX_OFFSET / n_trials)
        offsets = offset * (np.arange(n_trials) - (n_trials - 1) / 2)
        colours = colormaps["viridis"](np.linspace(0, 0.85, n_trials))
        self.ax_, self.figure_ = ax, ax.figure
        self.true_line_ = _draw(
            ax,
            self.counts,
            color="0.7",
            linewidth=5,
            label="true ratings",
        )
        self.trial_lines_ = [
            _draw(
                ax,
                proba,
                offset,
                color=colour,
                linewidth=1.4,
                label=f"trial {trial + 1}: {score:.2f}",
            )
            for trial, (proba, offset, colour, score) in enumerate(
                zip(self.y_proba, offsets, colours, self.scores, strict=True)
            )
        ]
        ax.set(
            xlabel="position p in the population",
            ylabel="rating",
            xlim=(0, 1),
            ylim=(-0.5, len(self.levels) - 0.5),
        )
        ax.set_yticks(range(len(self.levels)), labels=map(str, self.levels))
        ax.legend(
            title=f"mean MAE$^M$ {self.scores.mean():.2f}",
            alignment="left",
            ncols=1 + n_trials // 16,
            loc="center left",
            bbox_to_anchor=(1.01, 0.5),
            frameon=False,
        )
        return self


class SpeedAccuracyDisplay:
    """Time and score of every candidate of a search, and the frontier of the two.

    Use :meth:`from_search` to create a display. The frontier is the best score to
    be had in at most so much time. The dotted line is one standard error below the
    best score.

    Parameters
    ----------
    seconds : ndarray of shape (n_candidates,)
        Mean time to fit and score each candidate on one fold, in seconds.
    score : ndarray of shape (n_candidates,)
        Mean test score, higher is better.
    score_se : ndarray of shape (n_candidates,)
        Standard error of the mean test score.
    on_frontier : ndarray of shape (n_candidates,)
        Whether no other candidate beats this one in time and score.
    best : int
        Which candidate has the best score.
    cheapest : int
        Which is the fastest within one standard error of the best.
    metric : str, default="score"
        Name of the score.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the candidates.
    figure_ : matplotlib Figure
        Figure that holds the axes.
    errorbar_ : matplotlib ErrorbarContainer
        The candidates, with bars of one standard error.
    frontier_ : matplotlib Line2D
        The frontier.
    best_, cheapest_ : matplotlib Line2D
        The marks of the two chosen candidates.

    See Also
    --------
    sklearn_haptic.model_selection.speed_accuracy_frontier : The same as a table.
    sklearn_haptic.model_selection.cheapest_within_one_se : Refit the cheapest.

    Examples
    --------
    >>> from sklearn_haptic.plotting import SpeedAccuracyDisplay
    >>> cv_results = {
    ...     "mean_fit_time": [0.5, 2.5, 7.5],
    ...     "mean_score_time": [0.5, 0.5, 0.5],
    ...     "split0_test_rps": [-0.75, -0.25, -0.5],
    ...     "split1_test_rps": [-0.25, -0.25, -0.5],
    ...     "mean_test_rps": [-0.5, -0.25, -0.5],
    ... }
    >>> display = SpeedAccuracyDisplay.from_search(cv_results)
    >>> display.on_frontier
    array([ True,  True, False])
    """

    def __init__(
        self,
        seconds: NDArray[np.float64],
        score: NDArray[np.float64],
        score_se: NDArray[np.float64],
        *,
        on_frontier: NDArray[np.bool_],
        best: int,
        cheapest: int,
        metric: str = "score",
    ) -> None:
        self.seconds = seconds
        self.score = score
        self.score_se = score_se
        self.on_frontier = on_frontier
        self.best = best
        self.cheapest = cheapest
        self.metric = metric

    @classmethod
    def from_search(
        cls,
        search: BaseSearchCV | Mapping[str, Any],
        *,
        metric: str | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Plot the candidates of a search.

        Parameters
        ----------
        search : fitted search or dict
            A fitted search of scikit-learn, or its ``cv_results_``. Of successive
            halving only the last iteration counts.
        metric : str, default=None
            Name of the score in a search with several; by default that of its
            ``refit`` if this is a name.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : SpeedAccuracyDisplay
            The display, plotted.

        Raises
        ------
        ValueError
            If the metric is unknown or not given among several, there are fewer
            than two splits, or no score is finite.
        ImportError
            If matplotlib is not installed.
        """
        candidates = read_candidates(search, metric)
        best, cheapest = best_and_cheapest(candidates)
        return cls(
            candidates.seconds,
            candidates.score,
            candidates.score_se,
            on_frontier=is_non_dominated(candidates.seconds, candidates.score),
            best=best,
            cheapest=cheapest,
            metric=candidates.metric,
        ).plot(ax)

    def plot(self, ax: Axes | None = None) -> Self:
        """Plot the candidates, the frontier and the two choices.

        Parameters
        ----------
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : SpeedAccuracyDisplay
            This display, with ``ax_`` and the other attributes set.

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        ax = _axes(ax, type(self).__name__)
        from matplotlib.ticker import LogLocator

        seconds, score = self.seconds, self.score
        self.ax_, self.figure_ = ax, ax.figure
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
        frontier = np.flatnonzero(self.on_frontier)
        frontier = frontier[np.argsort(seconds[frontier], kind="stable")]
        (self.frontier_,) = ax.step(
            np.append(seconds[frontier], seconds.max()),
            np.append(score[frontier], score[frontier[-1]]),
            where="post",
            marker="o",
            markersize=5,
            markevery=list(range(len(frontier))),
            color=_BLUE,
            linewidth=1.8,
            zorder=3,
            label="frontier",
        )
        (self.best_,) = ax.plot(
            seconds[self.best],
            score[self.best],
            "*",
            color=_ORANGE,
            markersize=13,
            markeredgecolor="black",
            markeredgewidth=0.6,
            zorder=4,
            label="best",
        )
        (self.cheapest_,) = ax.plot(
            seconds[self.cheapest],
            score[self.cheapest],
            "o",
            color="black",
            fillstyle="none",
            markersize=15,
            markeredgewidth=1.6,
            zorder=4,
            label="cheapest within 1 SE",
        )
        ax.axhline(
            score[self.best] - self.score_se[self.best],
            color="black",
            linewidth=0.8,
            linestyle=":",
            label="best − 1 SE",
        )
        metric = "score" if self.metric == "score" else f"score ({self.metric})"
        ax.set(
            xscale="log",
            xlabel="time to fit and score, seconds a fold",
            ylabel=f"mean test {metric}, higher is better",
        )
        ticks = (1, 2, 5) if seconds.max() < 1000 * seconds.min() else (1,)
        ax.xaxis.set_major_locator(LogLocator(subs=ticks))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter("")
        ax.legend(
            loc="lower center", bbox_to_anchor=(0.5, 1.01), ncols=3, frameon=False
        )
        return self


class SensorContributionsDisplay:
    """Scores of a model and of the same without each sensor, as bars.

    Use :meth:`from_scores` to create a display. Bars are means over random starts, with
    error bars of one standard deviation; the dotted line is the full model. An asterisk
    marks p < .05 over starts, a dagger p < .05 over objects: only the latter tells of
    objects not seen yet.

    Parameters
    ----------
    summary : DataFrame
        What :func:`~sklearn_haptic.model_selection.contribution_summary` returned.
    metric : str, default="macro_mae"
        Name of the score.
    by : sequence of str, default=()
        Columns of ``summary`` whose values have a group of bars each.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the bars.
    figure_ : matplotlib Figure
        Figure that holds the axes.
    bars_ : matplotlib BarContainer
        The bars, group by group, the full model first.
    full_lines_ : matplotlib LineCollection
        The score of the full model, a line a group.
    marks_ : list of matplotlib Annotation
        The asterisks and daggers of each row of ``summary``.

    See Also
    --------
    sklearn_haptic.model_selection.contribution_summary : The same as a table.

    References
    ----------
    B. A. Richardson and K. J. Kuchenbecker, "Learning to predict perceptual
    distributions of haptic adjectives", Frontiers in Neurorobotics 13, 2020,
    figure 12. :doi:`10.3389/fnbot.2019.00116`

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
    ['−None', '−pac']
    """

    def __init__(
        self,
        summary: pd.DataFrame,
        *,
        metric: str = "macro_mae",
        by: Sequence[str] = (),
    ) -> None:
        self.summary = summary
        self.metric = metric
        self.by = by

    @classmethod
    def from_scores(
        cls,
        scores: pd.DataFrame,
        *,
        metric: str = "macro_mae",
        by: str | Sequence[str] | None = None,
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
            Columns whose values have a group of bars each, such as ``"procedure"``, or
            ``"threshold"`` for the terms of the ranked probability score, which then
            take the place of ``metric``.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : SensorContributionsDisplay
            The display, plotted.

        Raises
        ------
        ValueError
            If the scores have no summary; see
            :func:`~sklearn_haptic.model_selection.contribution_summary`.
        ImportError
            If matplotlib is not installed.
        """
        by = () if by is None else (by,) if isinstance(by, str) else tuple(by)
        metric = "rps" if "threshold" in by else metric
        summary = contribution_summary(scores, metric=metric, by=by)
        return cls(summary, metric=metric, by=by).plot(ax)

    def plot(self, ax: Axes | None = None) -> Self:
        """Plot the bars.

        Parameters
        ----------
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : SensorContributionsDisplay
            This display, with ``ax_`` and the other attributes set.

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        ax = _axes(ax, type(self).__name__)
        summary, sensors = self.summary, self.summary["held_out"].unique()
        groups = summary[:: len(sensors)]  # one of its rows stands for each group

        def side_by_side(full, holdout):
            of_holdouts = summary[holdout].to_numpy().reshape(len(groups), -1)
            return np.column_stack((groups[full], of_holdouts))

        height = side_by_side("full", "holdout")
        sd = side_by_side("full_sd", "holdout_sd")
        n_models = height.shape[1]
        x = np.add.outer((n_models + 1) * np.arange(len(groups)), np.arange(n_models))
        self.ax_, self.figure_ = ax, ax.figure
        self.bars_ = ax.bar(
            x.ravel(),
            height.ravel(),
            yerr=sd.ravel(),
            color=(["0.75"] + [_BLUE] * len(sensors)) * len(groups),
            error_kw={"elinewidth": 1, "capsize": 2.5},
        )
        self.full_lines_ = ax.hlines(
            height[:, 0],
            x[:, 0] - 0.5,
            x[:, -1] + 0.5,
            color="black",
            linewidth=0.8,
            linestyle=":",
        )
        top = (height + sd)[:, 1:].ravel()
        self.marks_ = [
            ax.annotate(
                mark, xy, (0, 2), textcoords="offset points", ha="center", va="bottom"
            )
            for mark, xy in zip(_marks(summary), zip(x[:, 1:].ravel(), top))
        ]
        ax.margins(x=0.02, y=0.1)
        over = {"p_starts": "∗ p < .05 over starts", "p_objects": "† over objects"}
        known = ", ".join(text for name, text in over.items() if name in summary)
        ax.set(
            xlabel=f"sensor held out   ({known})",
            ylabel=f"{_SCORE_LABELS.get(self.metric, self.metric)}, lower is better",
        )
        ax.set_xticks(
            x.ravel(),
            labels=["−None", *(f"−{sensor}" for sensor in sensors)] * len(groups),
            rotation=90 if x.size > 8 else 0,
        )
        if len(self.by):
            names = ax.secondary_xaxis("top")
            names.set_xticks(x.mean(axis=1), labels=_group_names(groups[[*self.by]]))
            names.tick_params(length=0)
        return self


def _marks(summary):
    """Asterisks and daggers of each row of a summary of contributions."""
    marks = np.where(summary["p_starts"] < 0.05, "∗", "")
    if "p_objects" in summary:
        marks = np.char.add(marks, np.where(summary["p_objects"] < 0.05, "†", ""))
    return marks.tolist()


def _group_names(values):
    """Names of groups; numbers are named by their column."""
    return [
        ", ".join(
            value.replace("_", " ") if isinstance(value, str) else f"{column} {value}"
            for column, value in zip(values.columns, row)
        )
        for row in values.itertuples(index=False)
    ]


def _draw(ax, weights, offset=0.0, **style):
    """Draw an inverse CDF with its steps exactly where the CDF jumps."""
    used = np.flatnonzero(weights)
    below = np.cumsum(weights[used])
    edges = np.append(0, below / below[-1])
    return ax.stairs(used + offset, edges, baseline=None, **style)
