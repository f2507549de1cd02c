"""A model that says when a touch is unlike all that it learned from."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_consistent_length, check_is_fitted

from ..models._perhaps_ordered import PerhapsOrderedMixin
from ..utils._folds import check_folds_know, groups_for
from ..utils._sklearn import (
    CrossValidator,
    DocumentedEstimator,
    HasMethods,
    Trials,
    _fit_context,
)
from ..utils._validation import check_groups
from ._held_out import (
    at_classes,
    compared,
    fit_fold,
    knows_order,
    make_folds,
    mean_without,
    objects_of,
    true_shares,
)
from ._novelty import belief_at, conformal_p_values, fit_belief, nearest_distances
from ._signal_rows import (
    behind_repairs,
    columns_given,
    fit_statistics,
    rows_of,
    signals_of,
)


class NoveltyGuard(
    DocumentedEstimator, MetaEstimatorMixin, PerhapsOrderedMixin, BaseEstimator
):
    """Say how unlike the training touches a touch is, and believe the model less then.

    A model predicts as surely from a broken sensor, or from a material never touched,
    as from any other. This one measures how far the features of a touch are from the
    nearest training touch of another object. Where the touches are recordings, so are
    the statistics of their signals, by which a sensor is found that is dead, stuck or
    exchanged for another. `p_values` compares the distance with those of the training
    objects, each from all others. The prediction moves towards
    the mean distribution by as much as was best at such a distance out of fold.

    Parameters
    ----------
    estimator : Pipeline
        Steps that turn touches into rows of features, on the scale on which they
        should be compared, and a classifier behind them: for example what
        `make_haptic_pipeline` returns, which standardises them.
    cv : int, splitter or iterable of (train, test), default=5
        The folds for the predictions out of fold. A number keeps objects whole.

    Attributes
    ----------
    classes_ : ndarray of shape (n_levels,)
        The levels, or the classes.
    estimator_ : Pipeline
        The fitted model.
    distances_ : ndarray of shape (n_trials,)
        Distance of each training touch from the nearest of another object: root mean
        square difference over the features, or over the statistics of signals in the
        same unit, whichever is larger.
    belief_ : sklearn.isotonic.IsotonicRegression
        How much of the prediction is kept at a distance, from 0 to 1. Beyond the
        furthest of the training touches it falls in proportion to the distance.
    shares_ : ndarray of shape (n_levels,)
        Mean distribution of the training touches.

    See Also
    --------
    TouchPool : Pools sensors, of which a broken one can be left out.

    Notes
    -----
    The p-values are conformal: for a touch of an object drawn like the training
    objects, p is at most .05 with a probability of about .05. They are no smaller than
    1 / (number of objects + 1). If objects of a family are alike, the family is what a
    new object should be compared with; give the families as `groups`.

    The features are fitted once to all training touches, also for the predictions out
    of fold. Steps that learn from the ratings make them too good.

    The signals are those that the first step is given, behind a :class:`RepairTrials`
    the repaired ones, whose faults that one reports: the columns of recordings of a
    ColumnTransformer, or the recordings of one sensor. Their statistics are those of
    :class:`SignalStatistics`, standardised. Distances of both kinds are made to have
    the same median over training touches. So one of two broken sensors in a model of
    five is found as well, but to know which, have one guard per sensor.

    Examples
    --------
    >>> from sklearn_haptic import NoveltyGuard, make_haptic_pipeline
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> corpus = make_haptic_corpus(20, 2, sensors=["pdc"], random_state=0)
    >>> guard = NoveltyGuard(make_haptic_pipeline(["pdc"], random_state=0))
    >>> guard.fit(corpus.trials, corpus.ratings["hard"], groups=corpus.objects)
    NoveltyGuard(...)
    >>> amplified = corpus.trials.map(lambda signal: 30 * signal)
    >>> guard.p_values(amplified).max().round(2)
    np.float64(0.05)
    """

    _parameter_constraints = {  # noqa: RUF012
        "estimator": [HasMethods(["fit"])],
        "cv": ["cv_object"],
    }

    def __init__(self, estimator: Pipeline, *, cv: CrossValidator = 5) -> None:
        self.estimator = estimator
        self.cv = cv

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: Trials, y: ArrayLike, *, groups: ArrayLike | None = None) -> Self:
        """Fit the model, and learn how much to believe it at which distance.

        Parameters
        ----------
        X : array-like of length n_trials
            Training touches, as the estimator takes them.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            Counts of ratings or labels, whatever the estimator takes.
        groups : array-like of shape (n_trials,), default=None
            The object, or the family of objects, of each touch. By default each touch
            is of another object. If `y` names the objects themselves, give what divides
            their touches, such as runs.

        Returns
        -------
        self : NoveltyGuard
            The fitted model.

        Raises
        ------
        ValueError
            If the estimator is no Pipeline of features and a classifier, there are
            fewer than two objects, or each class is in one group.
        """
        if not isinstance(self.estimator, Pipeline) or len(self.estimator) < 2:
            raise ValueError(
                f"estimator is a {type(self.estimator).__name__}; give a Pipeline "
                "whose first steps return rows of features and whose last predicts."
            )
        true, classes = true_shares(y, type(self).__name__)
        check_consistent_length(X, true)
        groups = check_groups(groups, X)
        objects = objects_of(groups, len(true))
        if objects.max() == 0:
            raise ValueError(
                "Touches are compared with those of other objects, but there is 1 "
                "sample or object; give more."
            )
        fitted = clone(self.estimator)
        *_, (name, last) = fitted.steps
        rows = np.asarray(fitted[:-1].fit_transform(X, y))
        repaired, first = behind_repairs(fitted, X)
        columns = columns_given(first)
        signals, self._channel_names = signals_of(repaired, columns)
        statistics = fit_statistics(signals)
        signal_rows = rows_of(signals, statistics)
        every = np.ones(len(true), dtype=bool)
        folds = make_folds(self, rows, y, groups, objects)
        proba = np.full(true.shape, np.nan)
        for fold in folds:
            _, _, proba[fold[1]] = fit_fold(
                (name, last), rows, y, objects, every, fold, classes
            )
        last.fit(rows, y, **groups_for(last, objects))
        self._ordered = np.ndim(y) == 2 or knows_order(last)
        if not self._ordered:
            check_folds_know(y, folds)
        self._rows, self._objects = rows, objects
        self._columns, self._statistics = columns, statistics
        self._signal_rows, self._unit = signal_rows, 1.0
        self.distances_ = nearest_distances(rows, rows, objects, objects)
        if signal_rows is not None:
            of_signals = nearest_distances(signal_rows, signal_rows, objects, objects)
            middle = np.median(self.distances_), np.median(of_signals)
            self._unit = float(middle[0] / middle[1]) if min(middle) > 0 else 1.0
            self.distances_ = np.maximum(self.distances_, self._unit * of_signals)
        self._learn_belief(proba, true, mean_without(true, folds))
        self.classes_ = classes
        self.shares_ = true.mean(axis=0)
        self.estimator_ = fitted
        return self

    def _learn_belief(self, proba, true, marginal):
        tested = np.isfinite(proba).all(axis=1)
        proba, true, marginal = (
            compared(each[tested], self._ordered) for each in (proba, true, marginal)
        )
        objects = self._objects[tested]
        self.belief_ = fit_belief(
            marginal - true,
            proba - marginal,
            self.distances_[tested],
            1 / np.bincount(objects)[objects],
        )

    def _rows_of(self, X):
        check_is_fitted(self)
        return np.asarray(self.estimator_[:-1].transform(X))

    def distances(self, X: Trials) -> NDArray[np.float64]:
        """Return how far each touch is from the nearest training touch.

        Parameters
        ----------
        X : array-like of length n_trials
            Touches, as the estimator takes them. Training touches have the distance 0;
            their own are `distances_`.

        Returns
        -------
        distance : ndarray of shape (n_trials,)
        """
        return self._distances(X, self._rows_of(X))

    def _distances(self, X, rows):
        distance = nearest_distances(rows, self._rows)
        if self._signal_rows is None:
            return distance
        repaired, _ = behind_repairs(self.estimator_, X)
        signals, _ = signals_of(repaired, self._columns, self._channel_names)
        signal_rows = rows_of(signals, self._statistics)
        of_signals = nearest_distances(signal_rows, self._signal_rows)
        return np.maximum(distance, self._unit * of_signals)

    def p_values(self, X: Trials) -> NDArray[np.float64]:
        """Return how usual the distance of each touch is among objects.

        Parameters
        ----------
        X : array-like of length n_trials
            Touches, as the estimator takes them, of objects other than the training
            objects.

        Returns
        -------
        p : ndarray of shape (n_trials,)
            Small for a touch unlike the training touches.
        """
        return conformal_p_values(self.distances(X), self.distances_, self._objects)

    def predict_proba(self, X: Trials) -> NDArray[np.float64]:
        """Predict, between the model and the mean distribution.

        Parameters
        ----------
        X : array-like of length n_trials
            Touches, as the estimator takes them.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
            Share of each level, or probability of each class; rows sum to 1.
        """
        rows = self._rows_of(X)
        proba = at_classes(self.estimator_[-1], rows, self.classes_)
        distance = self._distances(X, rows)
        belief = belief_at(self.belief_, distance)[:, np.newaxis]
        return belief * proba + (1 - belief) * self.shares_

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.no_validation = True
        return tags
