"""Sets of ratings and bands of crowds that keep their word for a new object.

Objects are exchangeable, and touches and raters are nested in them: hierarchical
conformal prediction, with models fitted without the objects that they are tested on.
"""

from __future__ import annotations

import math
import warnings
from numbers import Integral, Real
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, MetaEstimatorMixin, is_regressor
from sklearn.utils import RegressorTags
from sklearn.utils.validation import check_is_fitted

from ..models import ContinuousRatingsRegressor, DistributionalOrdinalRegressor
from ..models._ordinal import OrdinalClassifierMixin
from ..ratings._checks import check_adjectives, check_rated, record_features
from ..ratings._continuous import cdf_at, check_answers, check_values
from ..ratings._distributions import cdf, level_at, shares
from ..ratings._levels import (
    knows_order,
    levels_set_in,
    names_levels,
    refuse_unnamed,
)
from ..utils._folds import (
    TakesGroups,
    groups_for,
    number_objects,
    warn_of_no_groups,
)
from ..utils._pipeline_steps import last_step
from ..utils._row_order import check_orders
from ..utils._sklearn import (
    CrossValidator,
    HasMethods,
    StrOptions,
    Trials,
    _fit_context,
    _num_samples,
    _safe_indexing,
)
from ..utils._validation import check_groups
from ._conformal_scores import (
    TOLERANCE,
    band_bounds,
    band_residuals,
    level_scores,
    monotone_band,
    value_bounds,
    value_scores,
    weight_at_least,
    without_gaps,
)
from ._out_of_fold import (
    Task,
    make_folds,
    predict_at,
    predict_fold,
    run_tasks,
    true_shares,
)

_UNNAMED = (
    "y does not name its levels, so that no set holds a level that nobody gave in "
    "training; give counts, or an ordered pandas.Categorical of all levels."
)


class ConformalRatings(
    TakesGroups, MetaEstimatorMixin, OrdinalClassifierMixin, BaseEstimator
):
    r"""Predict sets of ratings, and bands of crowds, that keep their word.

    For a new object, a person drawn anew rates within the set with a probability of at
    least 1 - `alpha`, and the CDF of a crowd as large as those of training lies within
    the band. This holds for any model and any distribution of ratings, if the object
    and those of training are exchangeable, and their touches as long and by as many
    sensors; a better model has smaller sets. It holds on average over objects, not for
    each kind of object.

    Parameters
    ----------
    estimator : estimator object, default=None
        The model: a classifier with ``predict_proba``, by default
        ``DistributionalOrdinalRegressor()``, or for sliders a
        :class:`ContinuousRatingsRegressor`; also a pipeline or a search that ends in
        one.
    method : {"cv+", "prefit"}, default="cv+"
        "cv+": a model is fitted without each fold of objects and judged by them, so
        that all objects serve for both. "prefit": `estimator` was fitted to other
        objects before, and those given to `fit` only judge it; wrap it in a
        :class:`~sklearn.frozen.FrozenEstimator` if this is to be cloned. It is not
        copied: if it is fitted again, fit this again.
    cv : int, splitter or iterable of (train, test), default=None
        The folds of "cv+", whole objects in each; by default 10, or as many as there
        are objects, dealt as in :class:`TouchPool`. With few objects, more folds make
        smaller sets.
    n_jobs : int, default=None
        Number of jobs, each of which fits one model.

    Attributes
    ----------
    estimator_ : estimator object
        The model fitted to all trials, or the one given.
    estimators_ : list of estimator object
        The model of each fold, or the one given.
    n_objects_ : int
        Number of objects that judge.
    alpha_min_ : float
        The smallest `alpha` of which sets can leave anything out:
        ``1 / (n_objects_ + 1)``.
    levels_, classes_ : ndarray of shape (n_levels,)
        The ordered levels. Sliders have none.
    grid_ : ndarray of shape (n_edges,)
        For sliders, the edges of the cells of ``estimator_``.
    n_features_in_ : int
        Number of features, if ``X`` has columns.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the features, if they have any.

    See Also
    --------
    NoveltyGuard : Says whether a touch is like those of training.

    Notes
    -----
    A level's score is how far it is from the predicted median,
    :math:`2\max(F(y - 1) - 1/2,\, 1/2 - F(y),\, 0)`, and larger beyond all that is
    predicted. A value of a slider has :math:`|2F(y) - 1|`, and an end of the scale the
    smallest of its cell, because many people may leave a slider there. The p-value is
    the weight of the training ratings with a score as large, each from the model fitted
    without its object, and of one more for the new object, divided by the number of
    objects and 1. The ratings of an object weigh 1 together, as many as there are. With
    a model fitted before, the set of levels with :math:`p > \alpha` holds a new rating
    with a probability of :math:`1 - \alpha` or more [1]_ [2]_. With the models of folds
    it does so in practice; for folds of one object :math:`1 - 2\alpha` is proved [3]_.
    The predicted median and the levels between chosen ones are always added.

    References
    ----------
    .. [1] Lee, Barber and Willett (2023), Distribution-free inference with hierarchical
       data. :doi:`10.48550/arXiv.2306.06342`
    .. [2] Angelopoulos, Bates, Fisch, Lei and Schuster (2022), Conformal risk control.
       :doi:`10.48550/arXiv.2208.02814`
    .. [3] Barber, Candès, Ramdas and Tibshirani (2021), Predictive inference with the
       jackknife+. :doi:`10.1214/20-AOS1965`

    Examples
    --------
    Twenty objects, touched twice each.

    >>> from sklearn_haptic import ConformalRatings, make_haptic_pipeline
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> corpus = make_haptic_corpus(20, 2, sensors=["pdc"], random_state=0)
    >>> model = ConformalRatings(make_haptic_pipeline(["pdc"], random_state=0))
    >>> counts = corpus.ratings["hard"]
    >>> model.fit(corpus.trials, counts, groups=corpus.objects)
    ConformalRatings(...)
    >>> new = make_haptic_corpus(2, 1, sensors=["pdc"], random_state=1).trials
    >>> model.predict_set(new, alpha=0.2)
    array([[ True,  True,  True, False, False],
           [False,  True,  True,  True, False]])
    """

    _parameter_constraints = {  # noqa: RUF012
        "estimator": [HasMethods(["fit"]), None],
        "method": [StrOptions({"cv+", "prefit"})],
        "cv": ["cv_object"],
        "n_jobs": [Integral, None],
    }

    def __init__(
        self,
        estimator: BaseEstimator | None = None,
        *,
        method: Literal["cv+", "prefit"] = "cv+",
        cv: CrossValidator = None,
        n_jobs: int | None = None,
    ) -> None:
        self.estimator = estimator
        self.method = method
        self.cv = cv
        self.n_jobs = n_jobs

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        if hasattr(self.estimator, "fit") and is_regressor(self.estimator):
            tags.estimator_type, tags.classifier_tags = "regressor", None
            tags.regressor_tags = RegressorTags(poor_score=True)  # it is no R²
        return tags

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: Trials, y: ArrayLike, *, groups: ArrayLike | None = None) -> Self:
        """Fit the models, and score the ratings of objects unknown to each.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as the estimator takes them.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            How many people gave the trial's object each rating, or one rating per
            trial; of sliders what :class:`ContinuousRatingsRegressor` takes.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial. Without them `fit` warns, and takes each trial
            for an object.

        Returns
        -------
        self : ConformalRatings
            The fitted model.

        Raises
        ------
        ValueError
            If there are fewer than two objects for folds, a fold trains on an object
            that it tests, or the estimator predicts no distribution.
        NotFittedError
            If the method is "prefit" and the estimator is not fitted.
        """
        record_features(self, X, y)
        for name in ("classes_", "levels_", "grid_"):  # of another kind of ratings
            self.__dict__.pop(name, None)
        base: Any = self.estimator
        if base is None:
            base = DistributionalOrdinalRegressor()
        self._sliders = isinstance(last_step(base)[0], ContinuousRatingsRegressor)
        if not self._sliders and not hasattr(base, "predict_proba"):
            raise ValueError(
                f"estimator={base!r} predicts no distribution; give a classifier with "
                "predict_proba, or for sliders a ContinuousRatingsRegressor."
            )
        if self._sliders:  # lists of answers are no array
            y = check_answers(y)
            y = y[:, 0] if y.shape[1] == 1 else y
        else:
            levels = levels_set_in(base)
            true_shares(y, levels, type(self).__name__)  # refuses what are no ratings
        named = self._sliders or levels is not None or names_levels(y)
        X, y = check_rated(X, y)
        if np.ndim(y) == 1 and not named and self.method != "prefit":
            warnings.warn(_UNNAMED, UserWarning, stacklevel=4)
        n_trials = _num_samples(X)
        every = np.arange(n_trials), np.arange(0)
        if groups is None:
            warn_of_no_groups(self)
            groups = every[0]  # counts that tell too few objects would promise less
        groups = check_groups(groups, X)
        if self.method == "prefit":
            check_is_fitted(base)
            folds, objects = [every[::-1]], number_objects(groups, n_trials)
            models = [base, base]
        else:
            folds, objects = make_folds(self, X, y, groups, [base], n_folds=10)
            params = groups_for(base, objects)
            # Messages number the trials of the first that is fitted.
            tasks = [Task(None, base, X, y, fold, params) for fold in [every, *folds]]
            models = [model for model, _ in run_tasks(tasks, None, n_jobs=self.n_jobs)]
        self.estimator_, *self.estimators_ = models
        if self._sliders:
            self.grid_ = last_step(self.estimator_)[0].grid_
        else:
            _, classes = predict_fold(self.estimator_, _safe_indexing(X, [0]))
            if not knows_order(self.estimator_):
                _, named = check_adjectives(y)  # warns of words, which have no order
                if names_levels(y):
                    refuse_unnamed(classes, named)
                classes = named if np.isin(classes, named).all() else classes
            counts, self.levels_ = check_adjectives(y, classes)
            y, self.classes_ = shares(counts), self.levels_
        self.n_objects_ = int(objects.max()) + 1
        self.alpha_min_ = 1 / (self.n_objects_ + 1)
        share = 1 / np.bincount(objects)[objects]
        self._known = [
            self._calibrate(model, _safe_indexing(X, test), y[test], share[test])
            for model, (_, test) in zip(self.estimators_, folds)
        ]
        return self

    def _calibrate(self, model, X, y, share):
        """Return the scores of a fold, their weights, its residuals and theirs."""
        below, grid = self._below(model, X)
        if self._sliders:
            answers = np.reshape(y, (len(y), -1))
            given = shares((~np.isnan(answers)).astype(np.float64))
            score = value_scores(answers, below, grid)
            edges = self.grid_[1:-1, np.newaxis, np.newaxis]
            true = ((answers <= edges) * given).sum(axis=2).T
        else:
            given, score, true = y, level_scores(below), cdf(y)[:, :-1]
        residual = band_residuals(true, self._at_thresholds(below, grid))
        weight, used = share[:, np.newaxis] * given, given > 0
        return score[used] + TOLERANCE, weight[used], residual + TOLERANCE, share

    def _below(self, model, X):
        """Return CDFs at all levels but the highest, or at the edges of a grid."""
        if not self._sliders:
            return cdf(predict_at(model, X, self.classes_))[:, :-1], None
        last, X = last_step(model, X)
        return last.predict_cdf(X), last.grid_

    def _at_thresholds(self, below, grid):
        """Return CDFs at the points where bands are bounded."""
        return cdf_at(self.grid_[1:-1], below, grid) if self._sliders else below

    def _folds(self, X):
        """Yield what the model of each fold predicts, and what is known of it."""
        for model, known in zip(self.estimators_, self._known):
            yield *self._below(model, X), *known

    def _needed(self, alpha):
        """Check alpha; return the weight of training ratings that it asks for."""
        check_is_fitted(self)
        if not isinstance(alpha, Real) or not 0 < alpha < 1:
            raise ValueError(
                f"alpha={alpha!r} must be a number between 0 and 1, such as .1 for "
                "sets that hold 90 % of ratings."
            )
        if alpha + TOLERANCE < self.alpha_min_:
            least = math.ceil(1 / (alpha + TOLERANCE) - 1)
            warnings.warn(
                f"alpha={alpha} needs {least} objects or more, but there are "
                f"{self.n_objects_}, so that nothing is left out; give more objects or "
                f"an alpha of {self.alpha_min_:.3g} or more.",
                UserWarning,
                stacklevel=3,
            )
        return (1 - alpha) * (self.n_objects_ + 1) - TOLERANCE

    def predict_set(self, X: Trials, alpha: float = 0.1) -> NDArray[np.bool_]:
        """Predict which levels a person drawn anew may give.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as the estimator takes them.
        alpha : float, default=0.1
            Share of ratings that may be outside.

        Returns
        -------
        chosen : ndarray of bool of shape (n_trials, n_levels)
            Neighbouring levels, the predicted median among them. All, with a warning,
            if `alpha` is below `alpha_min_`.

        Raises
        ------
        ValueError
            If `alpha` is not between 0 and 1, or the ratings are those of sliders.
        """
        self._needed(alpha)
        if self._sliders:
            raise ValueError("Sliders have no levels; use predict_interval.")
        return self._set(X, alpha)

    def _set(self, X, alpha):
        chosen = self.p_values(X) > alpha + TOLERANCE  # of alpha = 1 - 0.9
        median = level_at(self.predict_proba(X), np.array([0.5]))
        np.put_along_axis(chosen, median, True, axis=1)
        return without_gaps(chosen)

    def predict_interval(
        self, X: Trials, alpha: float = 0.1
    ) -> tuple[np.ndarray, np.ndarray]:
        """Predict between which ratings that of a person drawn anew lies.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as the estimator takes them.
        alpha : float, default=0.1
            Share of ratings that may be outside.

        Returns
        -------
        lower, upper : ndarray of shape (n_trials,)
            The lowest and the highest level of the set, or values of a slider, which
            are infinite if `alpha` is below `alpha_min_`.

        Raises
        ------
        ValueError
            If `alpha` is not between 0 and 1.
        """
        needed = self._needed(alpha)
        if not self._sliders:
            chosen = self._set(X, alpha)
            last = chosen.shape[1] - 1 - chosen[:, ::-1].argmax(axis=1)
            return self.classes_[chosen.argmax(axis=1)], self.classes_[last]
        folds = [fold[:4] for fold in self._folds(X)]
        median = self.predict_quantile(X, 0.5)
        return (
            np.minimum(value_bounds(folds, needed, -1), median),
            np.maximum(value_bounds(folds, needed, 1), median),
        )

    def predict_band(
        self, X: Trials, alpha: float = 0.1
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Predict between which CDFs that of a crowd lies, at all levels at once.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as the estimator takes them.
        alpha : float, default=0.1
            Share of crowds that may be outside anywhere. A crowd is as many people as
            rated each object in training.

        Returns
        -------
        lower, upper : ndarray of shape (n_trials, n_levels) or (n_trials, n_edges)
            Bounds of the share of people at each level or below, or of sliders at the
            edges in `grid_`; rows never fall.

        Raises
        ------
        ValueError
            If `alpha` is not between 0 and 1.
        """
        needed = self._needed(alpha)
        folds = [
            (self._at_thresholds(below, grid), residual, share)
            for below, grid, _, _, residual, share in self._folds(X)
        ]
        middle = self._at_thresholds(*self._below(self.estimator_, X))
        lower, upper = monotone_band(
            np.minimum(band_bounds(folds, needed, -1), middle),
            np.maximum(band_bounds(folds, needed, 1), middle),
        )
        one = np.ones((len(lower), 1))
        if not self._sliders:
            return np.hstack((lower, one)), np.hstack((upper, one))
        # Of the ends of a grid is known what is known of the next edges.
        lower = np.hstack((0 * one, lower, lower[:, -1:]))
        return lower, np.hstack((upper[:, :1], upper, one))

    def p_values(
        self, X: Trials, values: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return how usual a rating would be, were it that of the next object.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as the estimator takes them.
        values : array-like of shape (n_values,), default=None
            For sliders, the ratings; by default the edges in `grid_`.

        Returns
        -------
        p : ndarray of shape (n_trials, n_levels) or (n_trials, n_values)
            From `alpha_min_` to 1. Levels whose p-value exceeds `alpha` are in the set.

        Raises
        ------
        ValueError
            If values are given, but the ratings have levels.
        """
        check_is_fitted(self)
        if values is not None:
            if not self._sliders:
                raise ValueError(
                    "values are of sliders; leave them out for the p-values of levels."
                )
            values = check_values(values)
        reached: Any = 0
        for below, grid, score, weight, *_ in self._folds(X):
            if self._sliders:
                at = self.grid_ if values is None else values
                new = value_scores(np.tile(at, (len(below), 1)), below, grid)
            else:
                new = level_scores(below)
            reached = reached + weight_at_least(new, score, weight)
        # Sums of thirds are rounded, so that p equals alpha where it should.
        return np.round((1 + reached) / (self.n_objects_ + 1), 12)

    def predict_proba(self, X: Trials) -> NDArray[np.float64]:
        """Predict the distribution of ratings, by the model fitted to all trials.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as the estimator takes them.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels) or (n_trials, n_cells)
            Share of the population at each level, or of sliders in each cell of
            `grid_`; rows sum to 1.
        """
        check_is_fitted(self)
        if self._sliders:
            last, X = last_step(self.estimator_, X)
            return last._predict_ordered(X, {})
        return predict_at(self.estimator_, X, self.classes_)

    def _ratings_at(self, proba, p):
        if self._sliders:
            return last_step(self.estimator_)[0]._ratings_at(proba, p)
        return super()._ratings_at(proba, p)

    def predict_cdf(self, X: Trials, **params: Any) -> NDArray[np.float64]:
        """Predict the CDF of ratings, by the model fitted to all trials.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as the estimator takes them.
        **params : dict
            Further arguments of the model's ``predict_cdf``, such as the ``values`` of
            sliders.

        Returns
        -------
        cdf : ndarray of shape (n_trials, n_levels) or (n_trials, n_values)
            Of sliders by default at the edges in `grid_`.
        """
        check_is_fitted(self)
        if self._sliders:
            last, X = last_step(self.estimator_, X)
            return last.predict_cdf(X, **params)
        return super().predict_cdf(X, **params)

    def predict(self, X: Trials, **params: Any) -> np.ndarray:
        """Predict as the model fitted to all trials does.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as the estimator takes them.
        **params : dict
            Further arguments of the model's ``predict``.

        Returns
        -------
        rating : ndarray of shape (n_trials,)
        """
        check_is_fitted(self)
        return self.estimator_.predict(X, **params)

    def score(
        self, X: Trials, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> float:
        """Return the score of the distributions predicted, as of a model of its kind.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as the estimator takes them.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            Ratings, as for `fit`.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial.

        Returns
        -------
        score : float
            The negative mean ranked probability score, of sliders the continuous one;
            higher is better.
        """
        check_is_fitted(self)
        if self._sliders:
            check_orders(X=X, y=y, sample_weight=sample_weight)
            last, X = last_step(self.estimator_, X)
            return last.score(X, y, sample_weight)
        return super().score(X, y, sample_weight)
