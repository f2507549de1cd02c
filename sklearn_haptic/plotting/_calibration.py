"""Whether predicted distributions are calibrated: PIT histogram and reliability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from numbers import Integral
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import betaincinv
from sklearn.base import BaseEstimator
from sklearn.utils import check_scalar

from ..metrics import pit_histogram
from ..ratings._checks import check_distributions
from ..ratings._distributions import cdf, shares
from ..ratings._levels import predict_in_named_order
from ..utils._row_order import check_orders
from ..utils._sklearn import Trials
from ..utils._validation import check_groups
from ._display import Axes, Display
from ._style import BLUE, colours_of, legend_beside

_CONFIDENCE = 0.95
_MARKERS = "os^DvPX<>*"
_MARKER_AREA = 60  # of the fullest bin, in square points


class _CalibrationDisplay(Display):
    """Base of the displays of binned predictions; `_of` bins them."""

    _n_bins: int

    @classmethod
    def _of(cls, counts, proba, levels, n_bins, objects):
        """Make a display, with chance by the numbers of objects unless it is None."""
        raise NotImplementedError

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: Trials,
        y: ArrayLike,
        *,
        n_bins: int | None = None,
        groups: ArrayLike | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Predict the distribution of each trial and plot the display.

        Parameters
        ----------
        estimator : object
            Fitted, with ``predict_proba`` and ``classes_`` (the ordered levels).
        X : array-like of length n_trials
            The trials.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            How many people chose each level, or one rating per trial.
        n_bins : int, default=None
        groups : array-like of shape (n_trials,), default=None
        ax : matplotlib Axes, default=None
            All three are those of :meth:`from_predictions`.

        Returns
        -------
        display : object

        Raises
        ------
        ValueError
            If ``y`` does not fit the estimator's levels, or ``groups`` the trials.
        """
        check_orders(X=X, groups=groups)
        proba, levels = predict_in_named_order(estimator, X, y)
        return cls.from_predictions(
            y, proba, n_bins=n_bins, groups=groups, levels=levels, ax=ax
        )

    @classmethod
    def from_predictions(
        cls,
        y_true: ArrayLike,
        y_proba: ArrayLike,
        *,
        n_bins: int | None = None,
        groups: ArrayLike | None = None,
        levels: ArrayLike | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Plot the display of predicted distributions.

        Parameters
        ----------
        y_true : array-like of shape (n_trials, n_levels) or (n_trials,)
            How many people chose each level, or one rating per trial.
        y_proba : array-like of shape (n_trials, n_levels)
            Predicted probability of each level.
        n_bins : int, default=None
            Number of bins. By default 10 of a histogram and 5 of reliability, of which
            fewer are drawn if many trials have the same prediction.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial, from which the range of chance is computed. By
            default none is drawn.
        levels : array-like of shape (n_levels,), default=None
            The ordered levels; by default ordered categories or labels of columns,
            else 1, 2, …, n_levels for counts, and the sorted ratings that occur.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : object

        Raises
        ------
        ValueError
            If a row of ``y_proba`` is not a distribution, a trial has no ratings or
            unknown ones, the shapes differ, ``n_bins`` is below 1, or ``groups`` has
            missing values or a single object.
        TypeError
            If ``n_bins`` is no integer.
        """
        n_bins = cls._n_bins if n_bins is None else n_bins
        check_scalar(n_bins, "n_bins", Integral, min_val=1)
        counts, proba, levels = check_distributions(y_true, y_proba, levels)
        check_orders(y_true=y_true, y_proba=y_proba, groups=groups)
        objects = None if groups is None else _check_groups(groups, counts)
        return cls._of(counts, proba, levels, n_bins, objects).plot(ax)


@dataclass(eq=False, repr=False)
class PITHistogramDisplay(_CalibrationDisplay):
    r"""PIT histogram, which shows whether predicted distributions are calibrated.

    Use :meth:`from_predictions` or :meth:`from_estimator` to create a display. The
    probability integral transform (PIT) of a rating is its place in the predicted
    distribution. Bars at the line mean that predictions are calibrated, high outer bars
    that they are too narrow, high middle bars that they are too wide, and a slope that
    they are too low or too high.

    Parameters
    ----------
    heights : ndarray of shape (n_bins,)
        Density in each of equally wide bins of [0, 1], with mean 1.
    half_widths : ndarray of shape (n_bins,), default=None
        How far a bar may lie from 1 by chance. By default no band is drawn.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the histogram.
    figure_ : matplotlib Figure
    bars_ : matplotlib BarContainer
        The histogram.
    uniform_line_ : matplotlib Line2D
        The density of calibrated predictions.
    band_ : matplotlib StepPatch or None
        Band that holds 95 % of the bars of calibrated predictions; None without
        ``half_widths``.

    See Also
    --------
    sklearn_haptic.metrics.pit_histogram : The heights alone, and how they are defined.
    sklearn_haptic.model_selection.cross_val_predict_proba : Predicts left-out objects.

    Notes
    -----
    The trials of an object share the same ratings, so only objects are independent, and
    the band needs ``groups``. Let :math:`d_o` be the sum, over the trials of object o,
    of a bin's height less 1. The half width of the band is then
    :math:`\sqrt{n q \sum_o d_o^2}`, divided by the number of trials, where q
    is the 95th percentile of the beta distribution with parameters 1/2 and (n - 1)/2
    for n objects. If objects have equally many trials, a bar is outside exactly if
    Student's t-test over objects rejects the line (p < .05). The band holds for each
    bin on its own, so one bin in twenty is outside by chance. It is a little too narrow
    for predictions by cross-validation, whose models share objects, and too narrow at
    the ends where objects have one or two ratings, whose bars are skew: with one rating
    of each of 60 objects, one of these two bars in eleven is outside, of 12 objects one
    in five.

    References
    ----------
    C. Czado, T. Gneiting and L. Held, "Predictive model assessment for count data",
    Biometrics 65, 1254–1261, 2009. :doi:`10.1111/j.1541-0420.2009.01191.x`

    Examples
    --------
    >>> from sklearn_haptic.plotting import PITHistogramDisplay
    >>> display = PITHistogramDisplay.from_predictions(
    ...     [[2, 0, 2], [1, 2, 1]], [[0.25, 0.5, 0.25]] * 2, n_bins=4, groups=["a", "b"]
    ... )
    >>> [float(bar.get_height()) for bar in display.bars_]
    [1.5, 0.5, 0.5, 1.5]
    """

    _n_bins = 10

    heights: NDArray[np.float64]
    _: KW_ONLY
    half_widths: NDArray[np.float64] | None = None

    @classmethod
    def _of(cls, counts, proba, levels, n_bins, objects):
        heights = pit_histogram(counts, proba, n_bins)
        if objects is None:
            return cls(heights)
        of_objects = [
            pit_histogram(counts[objects == o], proba[objects == o], n_bins)
            for o in range(objects.max() + 1)
        ]
        deviation = (np.array(of_objects) - 1) * np.bincount(objects)[:, None]
        return cls(heights, half_widths=_chance(deviation) / len(objects))

    def _draw(self, ax):
        edges = np.linspace(0, 1, len(self.heights) + 1)
        self.band_ = None
        if self.half_widths is not None:
            self.band_ = ax.stairs(
                1 + self.half_widths,
                edges,
                baseline=np.maximum(1 - self.half_widths, 0),
                fill=True,
                color="0.85",
                label=f"{100 * _CONFIDENCE:g} % by chance",
            )
        self.bars_ = ax.bar(
            edges[:-1],
            self.heights,
            np.diff(edges),
            align="edge",
            fill=False,
            edgecolor=BLUE,
            linewidth=1.8,
            label="predictions",
        )
        self.uniform_line_ = ax.axhline(
            1, color="black", linestyle="--", linewidth=1.2, label="calibrated"
        )
        ax.set(
            xlabel="probability integral transform of the ratings",
            ylabel="density",
            xlim=(0, 1),
        )
        legend_beside(ax)


@dataclass(eq=False, repr=False)
class ReliabilityDisplay(_CalibrationDisplay):
    r"""Predicted against observed proportion of people who rate above each threshold.

    Use :meth:`from_predictions` or :meth:`from_estimator` to create a display. Trials
    are binned by their prediction. Where a curve is below the diagonal, fewer people
    pass the threshold than predicted. The area of a marker is proportional to the
    number of trials in its bin.

    Parameters
    ----------
    predicted : sequence of ndarray of shape (n_bins,)
        For each threshold, the mean predicted probability in each bin.
    observed : sequence of ndarray of shape (n_bins,)
        The mean observed proportion in each bin.
    n_trials : sequence of ndarray of shape (n_bins,)
        Number of trials in each bin.
    levels : ndarray of shape (n_levels,)
        The ordered levels, one more than there are thresholds.
    half_widths : sequence of ndarray of shape (n_bins,), default=None
        How far the observed proportion may lie from the diagonal by chance. By default
        no bars are drawn.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the curves.
    figure_ : matplotlib Figure
    diagonal_ : matplotlib Line2D
        Where predictions are reliable.
    curves_ : list of matplotlib Line2D
        One curve per threshold.
    points_ : list of matplotlib PathCollection
        The bins of each threshold.
    errorbars_ : list of matplotlib LineCollection
        The half widths of each threshold, above and below each point, as far as
        proportions go; empty without ``half_widths``.

    See Also
    --------
    sklearn.calibration.CalibrationDisplay : The same for binary labels.
    sklearn_haptic.model_selection.cross_val_predict_proba : Predicts left-out objects.

    Notes
    -----
    The bins of a threshold hold equally many trials, and equal predictions stay
    together, as in :func:`~sklearn.calibration.calibration_curve` with
    ``strategy="quantile"``. Each of the N people of a trial counts 1 / N.

    The bars treat objects as independent, not trials. If all people agreed on an
    object, the total of its n trials in a bin, of mean prediction p, would have the
    variance :math:`n^2 p (1 - p)`. The true variance is a share of it, which is
    estimated from all bins of the threshold, like the dispersion in quasi-binomial
    regression. Let :math:`V_b` be the sum of these variances in bin b, and
    :math:`d_{ob}` the sum of observed less predicted proportions over the trials of
    object o in it. The half width is then
    :math:`\sqrt{n q \sum_{ob} d_{ob}^2 V_b / \sum_b V_b}`, divided by the number of
    trials in the bin, with q as in :class:`PITHistogramDisplay`; for a single bin this
    is the t-test over objects. Where a bar reaches the diagonal, the deviation may be
    due to the choice of objects. In simulations of correct forecasts of 6 to 60
    objects, 3 to 7 % of the bars did not reach it, and 10 to 13 % where few objects had
    most trials.

    References
    ----------
    J. Bröcker and L. A. Smith, "Increasing the reliability of reliability diagrams",
    Weather and Forecasting 22, 651–661, 2007. :doi:`10.1175/WAF993.1`

    P. McCullagh and J. A. Nelder, "Generalized Linear Models", 2nd edition, Chapman &
    Hall, 1989, section 4.5 (over-dispersion).

    Examples
    --------
    >>> from sklearn_haptic.plotting import ReliabilityDisplay
    >>> display = ReliabilityDisplay.from_predictions(
    ...     [[3, 1], [2, 2], [1, 3], [0, 4]],
    ...     [[0.8, 0.2], [0.7, 0.3], [0.3, 0.7], [0.2, 0.8]],
    ...     n_bins=2,
    ... )
    >>> display.curves_[0].get_xydata().round(3).tolist()
    [[0.25, 0.375], [0.75, 0.875]]
    """

    _n_bins = 5

    predicted: Sequence[NDArray[np.float64]]
    observed: Sequence[NDArray[np.float64]]
    n_trials: Sequence[NDArray[np.int64]]
    _: KW_ONLY
    levels: np.ndarray
    half_widths: Sequence[NDArray[np.float64]] | None = None

    @classmethod
    def _of(cls, counts, proba, levels, n_bins, objects):
        curves = [
            _reliability(predicted, observed, n_bins, objects)
            for predicted, observed in zip(
                (1 - cdf(proba)[:, :-1]).T, (1 - cdf(shares(counts))[:, :-1]).T
            )
        ]
        *binned, half_widths = zip(*curves)
        half_widths = None if objects is None else half_widths
        return cls(*binned, levels=levels, half_widths=half_widths)

    def _draw(self, ax):
        fullest = np.concatenate(self.n_trials).max()
        (self.diagonal_,) = ax.plot(
            [0, 1], [0, 1], color="0.5", linestyle="--", linewidth=1, label="reliable"
        )
        self.curves_, self.points_, self.errorbars_ = [], [], []
        for k, colour in enumerate(colours_of(len(self.predicted))):
            x, y = self.predicted[k], self.observed[k]
            marker = _MARKERS[k % len(_MARKERS)]
            self.curves_ += ax.plot(
                x,
                y,
                color=colour,
                linewidth=1.2,
                marker=marker,
                markersize=4,
                label=f"rating above {self.levels[k]}",
            )
            area = _MARKER_AREA * self.n_trials[k] / fullest
            points = ax.scatter(x, y, area, color=[colour], marker=marker, zorder=3)
            self.points_.append(points)
            if self.half_widths is not None:
                margin = self.half_widths[k]
                ends = np.clip([y - margin, y + margin], 0, 1)
                bars = ax.vlines(x, *ends, color=[colour], linewidth=1)
                self.errorbars_.append(bars)
        if self.errorbars_:
            chance = f"range of chance, {100 * _CONFIDENCE:g} %"
            ax.plot([], [], "|", color="0.3", markersize=12, label=chance)
        ax.set(
            xlabel="predicted proportion of people",
            ylabel="observed proportion of people",
            xlim=(-0.03, 1.03),
            ylim=(-0.03, 1.03),
            aspect="equal",
        )
        legend_beside(ax)


def _check_groups(groups, counts):
    """Validate the objects of trials; return the index of each, from 0."""
    names, objects = np.unique(check_groups(groups, counts), return_inverse=True)
    if len(names) == 1:
        raise ValueError(
            "groups has one object; leave groups out, or give two or more."
        )
    return objects


def _chance(deviation):
    """Return how far the summed deviations of independent objects may lie from 0.

    `deviation`, of shape (n_objects, ...), has the expected value 0. Its sum over
    objects exceeds the limit, of shape (...), exactly if a t-test over objects rejects
    0.
    """
    n = len(deviation)
    share = betaincinv(0.5, (n - 1) / 2, _CONFIDENCE)
    return np.sqrt(n * share * (deviation**2).sum(axis=0))


def _reliability(predicted, observed, n_bins, objects):
    """Return the reliability of predicted proportions, in bins of equal size.

    For each bin, these are the means of both proportions and the number of trials; and,
    if the trials' objects are given as integers, how far the means may differ by
    chance, else None. Bins that stay empty because predictions are equal are dropped.
    """
    edges = np.quantile(predicted, np.arange(1, n_bins) / n_bins)
    _, bins = np.unique(np.searchsorted(edges, predicted), return_inverse=True)
    n_trials = np.bincount(bins)
    half_width = None
    if objects is not None:
        cell = np.ravel_multi_index((objects, bins), (objects.max() + 1, len(n_trials)))

        def totals(values=None):
            sums = np.bincount(cell, values, (objects.max() + 1) * len(n_trials))
            return sums.reshape(-1, len(n_trials))

        limit = np.linalg.norm(_chance(totals(observed - predicted)))
        mean = np.clip(totals(predicted) / np.maximum(totals(), 1), 0, 1)
        variance = (totals() ** 2 * mean * (1 - mean)).sum(axis=0)
        half_width = limit * np.sqrt(variance / (variance.sum() or 1)) / n_trials
    return (
        np.bincount(bins, predicted) / n_trials,
        np.bincount(bins, observed) / n_trials,
        n_trials,
        half_width,
    )
