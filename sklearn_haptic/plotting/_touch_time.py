"""Score against seconds of touch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..metrics import ranked_probability_score
from ..metrics._score import mean_over_objects
from ..ratings._checks import check_distributions
from ..ratings._levels import in_named_order
from ..utils._row_order import check_order
from ..utils._validation import check_groups, check_numbers
from ._display import Axes, Display
from ._style import colours_of, legend_beside


@dataclass(eq=False, repr=False)
class TouchTimeDisplay(Display):
    """Mean score of predictions against the seconds of touch that they had.

    Use :meth:`from_predictions` to create a display. The line is that of fixed
    durations. Each rule of stopping is a point at its mean seconds and mean score,
    and a rule of several prices or thresholds a line of them. The bars at the bottom
    are the shares of touches that the last setting of the last rule stopped there, with
    their percentages; the axis of scores does not hold for them.

    Parameters
    ----------
    seconds : ndarray of shape (n_durations,)
        Durations.
    score, score_se : ndarray of shape (n_durations,)
        Mean score of each, and its standard error over objects.
    rules : dict of str to ndarray of shape (n_settings, 3)
        Of each setting of each rule: mean seconds, mean score, its standard error.
    stops : ndarray of shape (n_trials,) or None
        Seconds at which touches stopped.
    metric : str, default="RPS"
        Name of the score.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes of the curve.
    figure_ : matplotlib Figure
        Figure that holds the axes.
    errorbar_ : matplotlib ErrorbarContainer
        The fixed durations, with bars of one standard error.
    rules_ : dict of str to matplotlib ErrorbarContainer
        The settings of each rule.
    stops_ : matplotlib LineCollection or None
        Where touches stopped.

    See Also
    --------
    sklearn_haptic.AnytimeRegressor : Predictions over time.
    sklearn_haptic.streaming.ExpectedGain : When to stop.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.plotting import TouchTimeDisplay
    >>> y = [[4, 0], [0, 4]]
    >>> proba = np.array([[[0.5, 0.5], [0.75, 0.25]], [[0.5, 0.5], [0.25, 0.75]]])
    >>> display = TouchTimeDisplay.from_predictions(y, proba, [0.5, 1])
    >>> display.score
    array([0.25  , 0.0625])
    """

    seconds: NDArray[np.float64]
    score: NDArray[np.float64]
    score_se: NDArray[np.float64]
    _: KW_ONLY
    rules: Mapping[str, NDArray[np.float64]]
    stops: NDArray[np.float64] | None = None
    metric: str = "RPS"

    @classmethod
    def from_predictions(
        cls,
        y_true: ArrayLike,
        y_proba: ArrayLike,
        seconds: ArrayLike,
        *,
        stopped: Mapping[str, ArrayLike] | None = None,
        groups: ArrayLike | None = None,
        levels: ArrayLike | None = None,
        metric: str = "rps",
        ax: Axes | None = None,
    ) -> Self:
        """Plot the score of predictions at several durations.

        Parameters
        ----------
        y_true : array-like of shape (n_trials, n_levels) or (n_trials,)
            Counts of ratings, or labels.
        y_proba : array-like of shape (n_trials, n_durations, n_levels)
            What `predict_proba_over_time` of `AnytimeRegressor` returns.
        seconds : array-like of shape (n_durations,)
            Seconds of touch, ascending and above 0.
        stopped : dict of str to array-like of int of shape (n_trials,) or \
                (n_settings, n_trials), default=None
            Of each rule the index of the duration at which it stopped each touch, as
            its `stop_at` returns it, or such rows for several settings.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial, over which standard errors are taken; by default
            trials.
        levels : array-like of shape (n_levels,), default=None
            What the columns of ``y_proba`` are, such as the model's ``classes_``;
            labels that are an ordered categorical put them in its order. By default
            they are the levels that ``y_true`` names, else those that occur in it.
        metric : {"rps", "error"}, default="rps"
            The ranked probability score, or the share of trials whose most probable
            class is wrong.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : TouchTimeDisplay
            The display, plotted.

        Raises
        ------
        ValueError
            If shapes do not fit, or the metric is unknown.
        ImportError
            If matplotlib is not installed.
        """
        check_numbers(y_proba, "y_proba")
        proba = np.asarray(y_proba, dtype=np.float64)
        seconds = _check_seconds(seconds, proba)
        if metric not in ("rps", "error"):
            raise ValueError(f"metric={metric!r} must be 'rps' or 'error'.")
        scores = np.stack(
            [_scores(y_true, proba[:, k], levels, metric) for k in range(len(seconds))],
            axis=1,
        )
        check_order(y_true, groups, "groups", "y_true")
        objects = np.arange(len(scores)) if groups is None else groups
        objects = check_groups(objects, scores)
        rules, last = {}, None
        for name, index in ({} if stopped is None else stopped).items():
            index = np.atleast_2d(_check_index(index, name, scores.shape))
            each = np.take_along_axis(scores.T, index, axis=0)
            rules[name] = np.array(
                [
                    (seconds[at].mean(), *mean_over_objects(own, objects)[:2])
                    for at, own in zip(index, each)
                ]
            )
            last = seconds[index[-1]]
        score, score_se, _ = np.transpose(
            [mean_over_objects(each, objects) for each in scores.T]
        )
        name = {"rps": "RPS", "error": "share of errors"}[metric]
        return cls(seconds, score, score_se, rules=rules, stops=last, metric=name).plot(
            ax
        )

    def _draw(self, ax):
        self.errorbar_ = ax.errorbar(
            self.seconds,
            self.score,
            self.score_se,
            fmt="o-",
            color="black",
            markersize=4,
            elinewidth=0.8,
            label="fixed duration ± 1 SE",
        )
        colours = colours_of(len(self.rules))
        self.rules_ = {}
        for colour, (name, points) in zip(colours, self.rules.items()):
            seconds, score, se = points[np.argsort(points[:, 0], kind="stable")].T
            self.rules_[name] = ax.errorbar(
                seconds,
                score,
                se,
                fmt="s--",
                color=colour,
                markersize=5,
                linewidth=1,
                elinewidth=0.8,
                label=name,
            )
        self.stops_ = None
        if self.stops is not None:
            share = np.mean(self.stops[:, np.newaxis] == self.seconds, axis=0)
            place = ax.get_xaxis_transform()
            self.stops_ = ax.vlines(
                self.seconds,
                0,
                0.2 * share,
                transform=place,
                color=colours[-1],
                linewidth=6,
                alpha=0.5,
                label="touches stopped there",
            )
            for second, each in zip(self.seconds, share):
                text = f"{each:.0%}"
                ax.text(
                    second, 0.2 * each, text, transform=place, ha="center", va="bottom"
                )
            low, high = ax.get_ylim()  # points stay above the bars
            ax.set_ylim(low - 0.35 * (high - low), high)
            ticks = ax.yaxis.get_major_locator().tick_values(low, high)
            ax.set_yticks([y for y in ticks if low <= y <= high])
        ax.set(
            xscale="log",
            xlabel="seconds of touch",
            ylabel=f"mean {self.metric}, lower is better",
        )
        ax.set_xticks(self.seconds, labels=[f"{s:g}" for s in self.seconds])
        ax.minorticks_off()
        legend_beside(ax)


def _scores(y_true, proba, levels, metric):
    counts, proba, levels = check_distributions(y_true, proba, levels)
    if metric == "error":
        right = counts[np.arange(len(counts)), proba.argmax(axis=1)]
        return 1 - right / counts.sum(axis=1)
    proba, levels = in_named_order(proba, levels, y_true)
    return ranked_probability_score(y_true, proba, average=False, levels=levels)


def _check_seconds(seconds, proba):
    check_numbers(seconds, "seconds")
    seconds = np.asarray(seconds, dtype=np.float64)
    if proba.ndim != 3 or seconds.shape != proba.shape[1:2]:
        raise ValueError(
            f"y_proba has shape {proba.shape} and seconds has shape {seconds.shape}; "
            "give y_proba of shape (n_trials, n_durations, n_levels) and one number of "
            "seconds per duration."
        )
    if (np.diff(seconds, prepend=0) <= 0).any():
        raise ValueError(
            f"seconds={seconds.tolist()} must be above 0 and in ascending order."
        )
    return seconds


def _check_index(index, name, shape):
    index = np.asarray(index)
    whole = index.dtype.kind in "iu" and index.shape[-1:] == shape[:1]
    if not whole or index.ndim > 2 or not np.isin(index, range(shape[1])).all():
        raise ValueError(
            f"stopped[{name!r}] must have the index of a duration per trial, from 0 to "
            f"{shape[1] - 1}, as stop_at returns it."
        )
    return index
