"""Ratings of one object, true and predicted: inverse CDFs and distributions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

from ..metrics import macro_mae, macro_mae_at_positions
from ..ratings._checks import (
    check_distributions,
    check_predicted_ratings,
    check_ratings,
)
from ..ratings._distributions import cdf, shares
from ..ratings._levels import predict_in_named_order
from ..utils._pipeline_steps import last_step
from ..utils._sklearn import Trials, _safe_indexing
from ..utils._validation import check_regular
from ._display import Axes, Display
from ._style import BLUE, colours_of, legend_beside

# Trials are drawn apart, so that equal predictions show: by this many levels between
# neighbours, and at most so many in all.
_OFFSET, _MAX_OFFSET = 0.035, 0.4
_MOST_COLOURS = 5  # of trials that can be told apart; more have one colour
_BAR_WIDTH = 0.38  # levels are 1 apart


class _OneObjectDisplay(Display):
    """Base of the displays of what is predicted from the trials of one object."""

    @classmethod
    def _of(cls, counts, y_proba, levels):
        """Return a display of validated counts, one row per trial, and predictions."""
        return cls(counts[0], y_proba, levels=levels)

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
            How many people gave the object each rating; if there is one row per
            trial, all rows must be equal.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : object

        Raises
        ------
        ValueError
            If the rows of ``y`` differ, or do not fit the estimator's levels.
        """
        y = _rows_of_counts(y, "y")
        proba, levels = predict_in_named_order(estimator, X, y)
        return cls.from_predictions(y, proba, levels=levels, ax=ax)

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
            How many people gave the object each rating; if there is one row per
            trial, all rows must be equal.
        y_proba : array-like of shape (n_trials, n_levels)
            Probability of each rating, predicted from each trial.
        levels : array-like of shape (n_levels,), default=None
            The ordered levels; by default the labels of the columns, else 1, 2, ….
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : object

        Raises
        ------
        ValueError
            If a row of ``y_proba`` is not a distribution, the rows of ``y_true``
            differ, or the shapes do not fit.
        """
        counts, y_proba, levels = _check_trials_of_one(y_true, y_proba, levels)
        return cls._of(counts, y_proba, levels).plot(ax)


@dataclass(eq=False, repr=False)
class InverseCDFDisplay(_OneObjectDisplay):
    """Inverse CDF of the ratings of one object, and those predicted from touches.

    Use :meth:`from_counts`, :meth:`from_predictions`, :meth:`from_ratings` or
    :meth:`from_estimator` to create a display.

    Parameters
    ----------
    counts : ndarray of shape (n_levels,)
        How many people gave the object each rating.
    steps : list of (values, edges)
        For each trial, the index of the level on each interval of positions, and the
        edges of these intervals; there may be no trial.
    levels : ndarray of shape (n_levels,)
        The ordered levels.
    scores : ndarray of shape (n_trials,)
        Macro-averaged mean absolute error of each trial, in levels.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the inverse CDFs.
    figure_ : matplotlib Figure
    true_line_ : matplotlib StepPatch
        The inverse CDF of the ratings.
    trial_lines_ : list of matplotlib StepPatch
        The inverse CDF predicted from each trial.

    References
    ----------
    Richardson and Kuchenbecker (2020), figures 7 and 11.
    :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.plotting import InverseCDFDisplay
    >>> display = InverseCDFDisplay.from_predictions(
    ...     [0, 3, 6, 3, 0], [[0, 0.4, 0.4, 0.2, 0], [0.1, 0.2, 0.5, 0.1, 0.1]]
    ... )
    >>> display.ax_.get_ylabel()
    'rating'
    """

    counts: NDArray[np.float64]
    steps: Sequence[tuple[NDArray[Any], NDArray[np.float64]]]
    _: KW_ONLY
    levels: np.ndarray
    scores: ArrayLike

    @classmethod
    def _of(cls, counts, y_proba, levels):
        scores = macro_mae(counts, y_proba, average=False)
        return cls(counts[0], [*map(_steps, y_proba)], levels=levels, scores=scores)

    @classmethod
    def from_ratings(
        cls,
        y_true: ArrayLike,
        ratings: ArrayLike,
        positions: ArrayLike,
        *,
        levels: ArrayLike | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Plot ratings as they were predicted at positions, even where they fall.

        Parameters
        ----------
        y_true : array-like of shape (n_levels,) or (n_trials, n_levels)
            How many people gave the object each rating; if there is one row per
            trial, all rows must be equal.
        ratings : array-like of shape (n_trials, n_positions)
            What :meth:`~sklearn_haptic.DistributionalOrdinalRegressor.predict_rating`
            returned.
        positions : array-like of shape (n_positions,)
            Positions in the population, from 0 to 1.
        levels : array-like of shape (n_levels,), default=None
            The ordered levels; by default the labels of the columns, else 1, 2, ….
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : InverseCDFDisplay

        Raises
        ------
        ValueError
            If a rating is no level, the rows of ``y_true`` differ, or the shapes do
            not fit.
        """
        counts, levels = _counts_of_one(y_true, levels, "y_true")
        ratings, p = np.atleast_2d(ratings), np.asarray(positions, dtype=np.float64)
        of_trials = np.tile(counts, (len(ratings), 1))
        scores = macro_mae_at_positions(
            of_trials, ratings, p, levels=levels, average=False
        )
        _, places, _ = check_predicted_ratings(of_trials, ratings, levels, len(p))
        order = np.argsort(p, kind="stable")
        p, places = p[order], places[:, order]
        edges = np.concatenate(([0], (p[1:] + p[:-1]) / 2, [1]))
        steps = [(row, edges) for row in places]
        return cls(counts, steps, levels=levels, scores=scores).plot(ax)

    @classmethod
    def from_counts(
        cls,
        counts: ArrayLike,
        *,
        levels: ArrayLike | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Plot the ratings of one object alone.

        Parameters
        ----------
        counts : array-like of shape (n_levels,) or (n_trials, n_levels)
            How many people gave the object each rating; if there is one row per
            trial, all rows must be equal.
        levels : array-like of shape (n_levels,), default=None
            The ordered levels; by default the labels of the columns, else 1, 2, ….
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : InverseCDFDisplay

        Raises
        ------
        ValueError
            If the rows of ``counts`` differ, or counts are negative, not finite or all
            zero.
        """
        counts, levels = _counts_of_one(counts, levels, "counts")
        return cls(counts, [], levels=levels, scores=np.empty(0)).plot(ax)

    def _draw(self, ax):
        n_trials = len(self.steps)
        offset = min(_OFFSET, _MAX_OFFSET / max(n_trials, 1))
        offsets = offset * (np.arange(n_trials) - (n_trials - 1) / 2)
        scores = np.asarray(self.scores)
        colours = colours_of(n_trials)
        labels = [f"trial {i + 1}: {score:.2f}" for i, score in enumerate(scores)]
        if n_trials > _MOST_COLOURS:
            colours = [BLUE] * n_trials
            labels = [""] * n_trials
            labels[0] = f"{n_trials} trials: {scores.min():.2f} to {scores.max():.2f}"
        self.true_line_ = ax.stairs(
            *_steps(self.counts),
            baseline=None,
            color="0.7" if n_trials else BLUE,
            linewidth=5 if n_trials else 2,
            label="true ratings",
        )
        self.trial_lines_ = [
            ax.stairs(
                values + offset,
                edges,
                baseline=None,
                color=colour,
                linewidth=1.4 if n_trials <= _MOST_COLOURS else 0.8,
                label=label or None,
            )
            for (values, edges), offset, colour, label in zip(
                self.steps, offsets, colours, labels, strict=True
            )
        ]
        ax.set(
            xlabel="position p in the population",
            ylabel="rating",
            xlim=(0, 1),
            ylim=(-0.5, len(self.levels) - 0.5),
        )
        ax.set_yticks(range(len(self.levels)), labels=map(str, self.levels))
        if n_trials:
            legend_beside(
                ax,
                title=f"mean MAE$^M$ {np.mean(self.scores):.2f}",
                alignment="left",
                loc="center left",
                bbox_to_anchor=(1.01, 0.5),
            )


@dataclass(eq=False, repr=False)
class DistributionDisplay(_OneObjectDisplay):
    """Distribution of ratings predicted from touches of one object, beside the true.

    Use :meth:`from_predictions` or :meth:`from_estimator` to create a display. Bars are
    proportions, predicted ones the mean over trials; dots are the trials in order.

    Parameters
    ----------
    counts : ndarray of shape (n_levels,)
        How many people gave the object each rating.
    y_proba : ndarray of shape (n_trials, n_levels)
        Probability of each rating, predicted from each trial.
    levels : ndarray of shape (n_levels,)
        The ordered levels.
    chosen : ndarray of shape (n_trials, n_levels), default=None
        Whether a level is in the set of each trial; levels are shaded by the share of
        the sets that hold them.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the bars.
    figure_ : matplotlib Figure
    true_bars_ : matplotlib BarContainer
        Proportion of people who gave each rating.
    predicted_bars_ : matplotlib BarContainer
        Predicted probability of each rating, the mean over trials.
    trial_points_ : matplotlib Line2D or None
        What each trial predicts; None for a single trial.

    See Also
    --------
    InverseCDFDisplay : The same as inverse CDFs, with one line per trial.

    Examples
    --------
    >>> from sklearn_haptic.plotting import DistributionDisplay
    >>> display = DistributionDisplay.from_predictions(
    ...     [0, 3, 6, 3, 0], [[0, 0.4, 0.4, 0.2, 0], [0.2, 0.2, 0.4, 0.1, 0.1]]
    ... )
    >>> [round(float(bar.get_height()), 2) for bar in display.predicted_bars_]
    [0.1, 0.3, 0.4, 0.15, 0.05]
    """

    counts: NDArray[np.float64]
    y_proba: NDArray[np.float64]
    _: KW_ONLY
    levels: np.ndarray
    chosen: NDArray[Any] | None = None

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: Trials,
        y: ArrayLike,
        *,
        alpha: float | None = None,
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
            How many people gave the object each rating; if there is one row per
            trial, all rows must be equal.
        alpha : float, default=None
            Shade the sets of this alpha, of a
            :class:`~sklearn_haptic.ConformalRatings`, also at the end of a pipeline.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : DistributionDisplay

        Raises
        ------
        ValueError
            If the rows of ``y`` differ, or do not fit the estimator's levels.
        """
        y = _rows_of_counts(y, "y")
        proba, levels = predict_in_named_order(estimator, X, y)
        counts, proba, levels = _check_trials_of_one(y, proba, levels)
        chosen = None
        if alpha is not None:
            model, X = last_step(estimator, X)
            chosen = model.predict_set(X, alpha)
        return cls(counts[0], proba, levels=levels, chosen=chosen).plot(ax)

    def _draw(self, ax):
        n_trials, n_levels = self.y_proba.shape
        x = np.arange(n_levels)
        style = {"width": _BAR_WIDTH, "edgecolor": "black", "linewidth": 0.8}
        self.true_bars_ = ax.bar(
            x - _BAR_WIDTH / 2,
            shares(self.counts),
            color="0.8",
            label="true ratings",
            **style,
        )
        self.predicted_bars_ = ax.bar(
            x + _BAR_WIDTH / 2,
            self.y_proba.mean(axis=0),
            color=BLUE,
            label="predicted",
            **style,
        )
        handles = [self.true_bars_, self.predicted_bars_]
        if self.chosen is not None:
            shade = {"transform": ax.get_xaxis_transform(), "zorder": 0, "color": BLUE}
            for place, share in zip(x, np.mean(self.chosen, axis=0)):
                ax.bar(place, 1, 1, alpha=0.25 * share, **shade)
            handles.append(ax.bar(0, 0, alpha=0.25, label="in the sets", **shade))
        self.trial_points_ = None
        if n_trials > 1:
            self.predicted_bars_.set_label(f"predicted, mean of {n_trials} trials")
            within = np.linspace(0.1, 0.9, n_trials)[:, None] * _BAR_WIDTH
            (self.trial_points_,) = ax.plot(
                (x + within).ravel(),
                self.y_proba.ravel(),
                linestyle="",
                marker="o",
                markersize=3,
                markerfacecolor="white",
                markeredgecolor="black",
                markeredgewidth=0.6,
                label="each trial",
            )
            handles.append(self.trial_points_)
        ax.set(xlabel="rating", ylabel="proportion of people", ylim=(0, None))
        ax.set_xticks(x, labels=map(str, self.levels))
        legend_beside(ax, handles=handles)


def _check_trials_of_one(y_true, y_proba, levels):
    """Validate the counts of one object and what is predicted from its trials.

    Returns the counts, one row per trial, the distributions and the levels.
    """
    y_true = _rows_of_counts(y_true, "y_true")
    if len(y_true) == 1:
        n_trials = len(np.atleast_1d(check_regular(y_proba, "y_proba")))
        y_true = _safe_indexing(y_true, np.zeros(n_trials, dtype=np.intp))
    counts, y_proba, levels = check_distributions(y_true, y_proba, levels)
    _check_equal_rows(counts, "y_true")
    return counts, y_proba, levels


def _counts_of_one(y, levels, name):
    """Validate the counts of one object, given once or as one row per trial."""
    counts, levels = check_ratings(_rows_of_counts(y, name), levels, name=name)
    _check_equal_rows(counts, name)
    return counts[0], levels


def _rows_of_counts(y, name):
    """Return counts in two dimensions; the index of a Series names the levels."""
    if check_regular(y, name).ndim != 1:
        return y
    return y.to_frame().T if hasattr(y, "iloc") else np.atleast_2d(y)


def _check_equal_rows(counts, name):
    if (counts != counts[0]).any():
        raise ValueError(
            f"{name} has different ratings for different trials; give the trials of "
            "one object only."
        )


def _steps(weights):
    """Return the levels of an inverse CDF, and exactly where the CDF jumps."""
    used = np.flatnonzero(weights)
    return used, np.append(0, cdf(weights[used]))
