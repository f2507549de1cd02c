"""Distributions of continuous ratings, by an ordinal model of the cells of a grid."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn import get_config
from sklearn.base import BaseEstimator, MetaEstimatorMixin, RegressorMixin, clone
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import (
    check_array,
    check_is_fitted,
    column_or_1d,
)

from ..metrics import crps
from ..ratings._checks import check_rated, record_features
from ..ratings._continuous import cdf_at, check_answers, check_values, quantile_at
from ..ratings._distributions import as_distributions, cdf, shares
from ..utils._folds import TakesGroups, groups_for
from ..utils._row_order import check_orders
from ..utils._sklearn import HasMethods, Interval, Trials, _fit_context
from ..utils._validation import check_groups, check_numbers, check_weights
from ._distributional import DistributionalOrdinalRegressor
from ._ordinal import DistributionMixin
from ._shared_features import refuse_frozen


def make_grid(answers, weight, n_cells):
    """Choose the edges of cells from the lowest answer to the highest, ascending.

    A trial's weight is shared by its answers. Of the gaps between neighbouring answers,
    the first, the last and those nearest to quantiles, both of two equally near, hold
    an edge. It divides the gap inversely to the weights of the two answers: a heap of
    equal answers has a narrow cell, and where each answer has a cell, the mean of the
    cells' middles is that of the answers. Gaps wider than one of `n_cells` equal cells
    hold two edges, so far apart that only this much is divided. Cells with answers that
    are wider than two equal ones are divided.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.models._continuous import make_grid
    >>> make_grid(np.array([[0, 0, 0, 1, 9]]), np.ones(1), 9).tolist()
    [0.0, 0.25, 1.5, 8.5, 9.0]
    """
    given = ~np.isnan(answers) & (weight > 0)[:, None]
    each = np.broadcast_to((weight / given.sum(axis=1).clip(1))[:, None], given.shape)
    values, which = np.unique(answers[given], return_inverse=True)
    share = np.bincount(which, each[given])
    below = np.cumsum(share)[:-1] / share.sum()
    asked = np.arange(1, n_cells) / n_cells + np.array([[-1e-12], [1e-12]])  # of ties
    gap = np.searchsorted((below[:-1] + below[1:]) / 2, asked)
    gap = np.unique(np.append(gap, [0, len(below) - 1]))
    lower, upper = values[gap], values[gap + 1]
    part = share[gap + 1] / (share[gap] + share[gap + 1])
    below_upper, equal = np.nextafter(upper, lower), np.ptp(values) / n_cells
    inner = np.clip((1 - part) * lower + part * upper, lower, below_upper)
    wide = upper - lower > equal
    inner[wide] = (lower + part * equal)[wide]
    second = np.minimum(upper - (1 - part) * equal, below_upper)[wide]
    edges = np.unique(np.concatenate((values[:1], inner, second, values[-1:])))
    holds = np.bincount(np.searchsorted(edges[1:-1], values), minlength=len(edges) - 1)
    n_parts = np.ceil(np.diff(edges) / (2 * equal) - 1e-9).astype(int).clip(1)
    n_parts[holds == 0] = 1
    parts = [
        np.linspace(*cell, n, endpoint=False)
        for *cell, n in zip(edges, edges[1:], n_parts)
    ]
    return np.concatenate((*parts, edges[-1:]))


def put_on_edges(answers, edges, tolerance):
    """Return answers of which those that rounding keeps from an edge are on it."""
    nearest = np.searchsorted((edges[:-1] + edges[1:]) / 2, answers)
    near = np.abs(answers - edges[nearest]) <= tolerance[nearest]
    return np.where(near, edges[nearest], answers)


def heaps_at_ends(answers, weight, edges):
    """Return the points of a piecewise linear map from the scale to the grid.

    Equal answers at an end of the scale are one value there. In the grid they take as
    large a part of the cell at the end as they are of its answers, which share the
    weight of their trial.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.models._continuous import heaps_at_ends
    >>> answers = np.array([[0.0, 0.0, 0.0, 7.0], [5.0, 50.0, 99.0, 100.0]])
    >>> points, spread = heaps_at_ends(answers, np.ones(2), np.r_[0.0, 10, 90, 100])
    >>> points
    array([  0.,   0.,  10.,  90., 100., 100.])
    >>> spread
    array([  0.,   6.,  10.,  90.,  95., 100.])
    """
    n_answers = (~np.isnan(answers)).sum(axis=1).clip(1)
    each = np.broadcast_to((weight / n_answers)[:, np.newaxis], answers.shape)
    points = np.concatenate((edges[:1], edges, edges[-1:]))
    spread = points.copy()
    for end, inner in ((0, 1), (-1, -2)):
        inside = answers <= edges[1] if end == 0 else answers > edges[-2]
        if total := each[inside].sum():
            share = each[answers == edges[end]].sum() / total
            spread[inner] += share * (edges[inner] - edges[end])
    return points, spread


def count_in_cells(answers, edges):
    """Count the answers of each trial in each cell, which includes its upper edge."""
    n_cells = len(edges) - 1
    cell = np.searchsorted(edges[1:-1], answers)
    cell += n_cells * np.arange(len(answers))[:, None]
    counts = np.bincount(cell[~np.isnan(answers)], minlength=len(answers) * n_cells)
    return counts.reshape(-1, n_cells).astype(np.float64)


def _for_last(model, given):
    """Name arguments of `fit` as a model wants them: a Pipeline for its last step."""
    prefix = ""
    while isinstance(model, Pipeline) and not get_config()["enable_metadata_routing"]:
        name, model = model.steps[-1]
        prefix += f"{name}__"
    return {prefix + key: value for key, value in given.items()}


class ContinuousRatingsRegressor(
    TakesGroups, MetaEstimatorMixin, DistributionMixin, RegressorMixin, BaseEstimator
):
    """Regressor that predicts the distribution of a crowd's continuous ratings.

    Ratings on a slider or a visual analogue scale are numbers without levels. They are
    sorted into the cells of a grid, an ordinal model learns how many fall into each,
    and the predicted CDF is linear within a cell. The finer the grid, the less it
    matters.

    Parameters
    ----------
    estimator : estimator object, default=None
        The ordinal model of the cells, which takes counts and has ``predict_proba``; by
        default ``DistributionalOrdinalRegressor()``. It may be a pipeline.
    grid : array-like of shape (n_edges,), default=None
        The edges of the cells, ascending, such as ``numpy.linspace(0, 100, 31)``. A
        rating on an edge counts in the cell below it, so answers at edges make means
        half a cell too low, and at the first edge half a cell too high. By default
        equally many training ratings lie between two edges, and the edges between
        different ratings; where they lie far apart, there are further edges.
    n_cells : int, default=30
        Number of cells, if the grid is not given. Where many ratings are equal, there
        are fewer, and where some lie far apart, more: no cell that holds ratings is
        wider than two of `n_cells` equal ones.

    Attributes
    ----------
    estimator_ : estimator object
        The fitted ordinal model.
    grid_ : ndarray of shape (n_edges,)
        The edges of the cells.
    n_features_in_ : int
        Number of features.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the features, if they have any.

    See Also
    --------
    DistributionalOrdinalRegressor : Predicts ratings that have levels.
    metrics.crps : The score of a predicted CDF.

    Notes
    -----
    The CDF at the edges is that of an ordinal model whose levels are the cells. Between
    two edges it is off by less than the probability of the cell, which is about
    ``1 / n_cells`` on average. The predicted distribution never leaves the grid. Of
    answers with a long tail, as magnitudes on an open scale have, the mean comes out
    too high (lognormal answers by 2 to 13 % in simulations); give their logarithms.

    The default is linear and has one width for all touches. Where a feature told how
    far people agree (simulated), its bands of 80 % held .999 of the ratings of touches
    on which they agree, and .39 of others. Those of ten hidden units,
    ``DistributionalOrdinalRegressor(NNPOM(10, alpha=3))``, held .92 and .79, and the
    CRPS was lower by 8 %. Answers that some people leave at an end whatever they touch
    are moved with the touch, too: of a fifth at 0, those of objects rated high were
    predicted as .01, of others as .60, where .19 and .30 were true. Nor does it know
    what touches do not tell: learned from 20 useless features of 24 objects, its CRPS
    was 3.7 above that of guessing (11.8), and around the model that
    `make_haptic_pipeline` ends in, a :class:`DistributionBlend`, .4.

    Equal ratings are spread over their cell, which the default makes the narrower the
    more there are. At the ends of the scale, where many people may leave a slider, they
    are not: quantiles, samples, `score` and the CDF at given values have as large a
    share of the cell at the end as its answers had in `fit`. Elsewhere, equal ratings
    have a cell of their own if they are ``2 / n_cells`` of all or more, of which the
    CDF at that rating holds about half: of whole numbers and of other stops of a
    slider, ask for the CDF halfway to the next one.

    Examples
    --------
    Three people moved a slider from 0 to 100 for each of four objects; one did not
    answer.

    >>> import numpy as np
    >>> from sklearn_haptic import ContinuousRatingsRegressor
    >>> X = np.array([[-1.0], [-0.4], [0.3], [1.1]])
    >>> y = [[12, 20, 31], [25, 33, 50], [48, 57], [70, 83, 95]]
    >>> model = ContinuousRatingsRegressor(grid=np.linspace(0, 100, 11)).fit(X, y)
    >>> model.predict_quantile([[-1.0], [1.1]], [0.1, 0.5, 0.9]).round()
    array([[12., 20., 39.],
           [52., 82., 96.]])
    >>> model.predict_cdf([[-1.0], [1.1]], [25, 50, 75]).round(2)
    array([[0.6 , 0.99, 1.  ],
           [0.  , 0.07, 0.45]])
    """

    _parameter_constraints = {  # noqa: RUF012
        "estimator": [HasMethods(["fit", "predict_proba"]), None],
        "grid": ["array-like", None],
        "n_cells": [Interval(Integral, 2, None, closed="left")],
    }

    def __init__(
        self,
        estimator: BaseEstimator | None = None,
        *,
        grid: ArrayLike | None = None,
        n_cells: int = 30,
    ) -> None:
        self.estimator = estimator
        self.grid = grid
        self.n_cells = n_cells

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True  # it is no R²
        return tags

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(
        self,
        X: Trials,
        y: ArrayLike | Sequence[ArrayLike],
        sample_weight: ArrayLike | None = None,
        *,
        groups: ArrayLike | None = None,
    ) -> Self:
        """Choose the grid and fit the ordinal model.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever ``estimator`` takes.
        y : array-like of shape (n_trials,) or (n_trials, n_answers), or list of \
                array-like
            One rating per trial; or several, NaN where somebody gave none; or one list
            of ratings, of any length, per trial.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial, if ``estimator`` takes weights. Scale them to a mean
            of 1, because weights far below make its penalty too strong.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial, passed on to ``estimator`` if it requests them:
            for early stopping, the weights of a :class:`DistributionBlend`, or the
            folds of a search.

        Returns
        -------
        self : ContinuousRatingsRegressor
            The fitted regressor.

        Raises
        ------
        ValueError
            If the ratings do not fit the grid, or the estimator is frozen.
        """
        record_features(self, X, y)
        answers = check_answers(y)
        check_rated(X, answers)
        weight = check_weights(sample_weight, X)
        answers, grid = self._make_grid(answers, weight)
        model: Any = self.estimator
        model = DistributionalOrdinalRegressor() if model is None else clone(model)
        refuse_frozen(model, type(self).__name__, "the cells of its grid")
        params = groups_for(model, check_groups(groups, X))
        if sample_weight is not None:
            params |= _for_last(model, {"sample_weight": weight})
        self.estimator_: Any = model.fit(X, count_in_cells(answers, grid), **params)
        self.grid_ = grid
        self._points, self._spread = heaps_at_ends(answers, weight, grid)
        return self

    def _make_grid(self, answers, weight):
        used = answers[weight > 0]
        lowest, highest = np.nanmin(used), np.nanmax(used)
        if lowest == highest:
            raise ValueError(
                f"All ratings in y are {lowest} (n_samples={len(used)}); a grid needs "
                "at least two different ones."
            )
        if self.grid is None:
            ends = np.array([lowest, highest])
            rounding = np.full(2, 1e-11 * np.abs(ends).max())
            answers = put_on_edges(answers, ends, rounding)
            return answers, make_grid(answers, weight, self.n_cells)
        check_numbers(self.grid, "grid")
        edges = check_array(self.grid, ensure_2d=False, dtype=np.float64, copy=True)
        edges = column_or_1d(edges)
        if len(edges) < 3 or not (np.diff(edges) > 0).all():
            raise ValueError(
                f"grid={edges.tolist()} must be three edges or more that ascend."
            )
        width = np.pad(np.diff(edges), 1, mode="edge")
        tolerance = 1e-5 * np.minimum(width[:-1], width[1:])  # also of float32
        answers = put_on_edges(answers, edges, tolerance)
        used = answers[weight > 0]
        if np.nanmin(used) < edges[0] or np.nanmax(used) > edges[-1]:
            raise ValueError(
                f"y has ratings from {lowest} to {highest}, but grid reaches from "
                f"{edges[0]} to {edges[-1]}; widen it or mend the ratings."
            )
        return answers, edges

    # No predict_proba: scikit-learn expects none of a regressor.
    def _predict_ordered(self, X, params):
        """Predict the share of each cell of the grid."""
        check_is_fitted(self)
        proba = self.estimator_.predict_proba(X, **params)
        return shares(as_distributions(proba, type(self.estimator_).__name__))

    def predict_cdf(  # type: ignore[override]
        self, X: Trials, values: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Predict the share of the population that rates at values or below.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.
        values : float or array-like of shape (n_values,), default=None
            Values on the scale. By default the edges in ``grid_``, between which the
            CDF is linear as for :func:`~sklearn_haptic.metrics.crps`, with people at an
            end in its cell.

        Returns
        -------
        cdf : ndarray of shape (n_trials, n_values), or (n_trials,) for a scalar
            Rows never fall as the values grow.
        """
        below = np.pad(cdf(self._predict_ordered(X, {})), ((0, 0), (1, 0)))
        if values is None:
            return below
        spread = np.interp(check_values(values), self._points, self._spread)
        at = cdf_at(spread, below, self.grid_)
        return at if np.ndim(values) else at[:, 0]

    def _ratings_at(self, proba, p):
        below = np.pad(cdf(proba), ((0, 0), (1, 0)))
        spread = quantile_at(p, below, self.grid_)
        return np.interp(spread, self._spread, self._points)

    def predict(self, X: Trials) -> NDArray[np.float64]:
        """Predict the mean rating; ``predict_quantile(X, 0.5)`` is the median.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.

        Returns
        -------
        rating : ndarray of shape (n_trials,)
        """
        return self._predict_ordered(X, {}) @ ((self.grid_[:-1] + self.grid_[1:]) / 2)

    def score(
        self,
        X: Trials,
        y: ArrayLike | Sequence[ArrayLike],
        sample_weight: ArrayLike | None = None,
    ) -> float:
        """Return the negative mean continuous ranked probability score.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.
        y : array-like of shape (n_trials,) or (n_trials, n_answers), or list of \
                array-like
            Ratings, as for `fit`.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial.

        Returns
        -------
        score : float
            Higher is better; :func:`~sklearn_haptic.metrics.crps` with another sign.
        """
        check_orders(X=X, y=y, sample_weight=sample_weight)
        below = self.predict_cdf(X)
        below = cdf_at(self._spread, below, self.grid_)
        return -float(crps(y, below, self._points, sample_weight=sample_weight))
