"""A model that says when a touch is unlike all that it learned from.

A touch is as unlike others as its features are distant from the nearest touch of
another object. The distances of the training touches, each from the other objects, say
how unusual a distance is, and predictions out of fold how much to believe at each.

A sensor that is dead, stuck, amplified or in the place of another one may have codes
like those of a quiet touch. Its level, its power and its spectrum are unlike any, so
that distances are those of signals, too: of each sensor by itself, because one of many
channels would hide one of a single channel.
"""

from __future__ import annotations

import warnings
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.compose import ColumnTransformer
from sklearn.isotonic import IsotonicRegression
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import gen_batches
from sklearn.utils.validation import check_is_fitted

from ..features import SignalStatistics
from ..models._ordinal import OrdinalClassifierMixin
from ..ratings._levels import knows_order, levels_set_in
from ..recordings import RepairTrials
from ..recordings._sequences import Sequences
from ..recordings._trials import channel_names, check_trials, is_table, trial_columns
from ..utils._folds import TakesGroups, groups_for
from ..utils._pipeline_steps import flat_steps
from ..utils._sklearn import (
    CrossValidator,
    HasMethods,
    Trials,
    _fit_context,
    _get_column_indices,
    _safe_indexing,
)
from ..utils._validation import column_of
from ._conformal_scores import TOLERANCE, weight_at_least
from ._out_of_fold import (
    Task,
    check_folds_know,
    compared,
    make_folds,
    mean_without,
    predict_at,
    run_tasks,
    true_shares,
)

# So few objects that no p-value falls below .05.
_FEW_OBJECTS = 19
# Distances that are computed at once.
_BLOCK = 2**22
# Features that vary by less than this share of the most variable one are constant.
_CONSTANT = 1e-12

# Beyond this, in units of the largest departure in training, all are equally far.
_FAR = 1e100


def nearest_distances(rows, train, objects=None, train_objects=None):
    """Return the distance of each row from the nearest training row.

    Parameters
    ----------
    rows : ndarray of shape (n_rows, n_features)
    train : ndarray of shape (n_train, n_features)
    objects : ndarray of shape (n_rows,), default=None
        Objects of the rows, of which training rows are passed over.
    train_objects : ndarray of shape (n_train,), default=None
        Objects of the training rows.

    Returns
    -------
    distance : ndarray of shape (n_rows,)
        Root mean square difference over features. Features that are constant in
        training, which tell no scale, count as the same in all rows.
    """
    rows, train = (np.asarray(each, dtype=np.float64) for each in (rows, train))
    with np.errstate(over="ignore"):
        spread = np.ptp(train, axis=0)
    constant = spread <= _CONSTANT * spread.max()
    if not constant.all():
        rows = np.where(constant, train[0], rows)
    centre = np.median(train, axis=0)  # one row that lies far out does not move it
    departure = np.abs(train - centre)
    unit = np.median(departure[departure > 0]) if departure.any() else 1.0
    points = np.clip((train - centre) / unit, -_FAR, _FAR)
    half = np.einsum("ij,ij->i", points, points) / 2
    distance = np.empty(len(rows))
    for batch in gen_batches(len(rows), max(1, _BLOCK // len(train))):
        with np.errstate(over="ignore"):
            x = np.clip((rows[batch] - centre) / unit, -_FAR, _FAR)
        far = half - x @ points.T  # half the square, but for what a row has in common
        if objects is not None:
            far[objects[batch, np.newaxis] == train_objects] = np.inf
        # Squares of differences cancel nothing, and in their own unit do not overflow.
        with np.errstate(over="ignore"):
            departure = np.abs(rows[batch] - train[far.argmin(axis=1)])
        largest = departure.max(axis=1, keepdims=True)
        largest[largest == 0] = 1
        share = np.where(np.isinf(largest), 1, departure / largest)
        distance[batch] = largest[:, 0] * np.sqrt((share**2).mean(axis=1))
    return distance


def furthest(of_kinds, units):
    """Return the largest of the distances of several kinds, in their units."""
    return np.max([unit * each for unit, each in zip(units, of_kinds)], axis=0)


def conformal_p_values(distance, known, objects):
    """Return the share of objects at least as far away, the new one among them.

    Each object counts by the share of its touches that are. Were an object drawn like
    the training objects, its p-value would be at most p with a probability of about p.

    Parameters
    ----------
    distance : ndarray of shape (n_rows,)
    known : ndarray of shape (n_train,)
        Distance of each training touch from the other objects.
    objects : ndarray of int of shape (n_train,)
        Number of the object of each training touch, from 0.

    Returns
    -------
    p : ndarray of shape (n_rows,)
        From 1 / (number of objects + 1) to 1.
    """
    weight = 1 / np.bincount(objects)[objects]
    reached = weight_at_least(distance, known * (1 + TOLERANCE), weight)
    # Sums of tenths are rounded, so that p is .05 where it should be.
    return np.round((1 + reached) / (objects.max() + 2), 12)


def fit_belief(departure, from_marginal, distance, weight):
    r"""Learn how much to believe predictions, as a falling function of the distance.

    If m is the marginal's CDF minus the true one, and d the predicted minus the
    marginal's, belief w has the score :math:`\|m + wd\|^2`. It is least at
    :math:`-m^T d / \|d\|^2`, and by :math:`\|d\|^2` times the squared difference worse
    elsewhere, so that a weighted isotonic regression is the best falling function.

    Parameters
    ----------
    departure : ndarray of shape (n_trials, n_thresholds)
        The marginal minus the truth, out of fold.
    from_marginal : ndarray of shape (n_trials, n_thresholds)
        The prediction minus the marginal, out of fold.
    distance, weight : ndarray of shape (n_trials,)

    Returns
    -------
    belief : IsotonicRegression
        From distances to weights from 0 to 1.
    """
    square = np.einsum("tk,tk->t", from_marginal, from_marginal)
    product = np.einsum("tk,tk->t", from_marginal, departure)
    best = np.divide(-product, square, out=np.ones_like(square), where=square > 0)
    belief = IsotonicRegression(
        y_min=0, y_max=1, increasing=False, out_of_bounds="clip"
    )
    weight = weight * square if square.any() else weight  # a model of the mean alone
    return belief.fit(distance, best, sample_weight=weight)


def belief_at(belief, distance):
    """Return the belief at distances; beyond the furthest it falls in proportion."""
    furthest = belief.X_max_
    beyond = np.divide(
        furthest, distance, out=np.ones_like(distance), where=distance > furthest
    )
    return belief.predict(distance) * beyond


def behind_repairs(pipeline, X):
    """Return touches as repaired by the first steps, and the step behind these."""
    steps = [step for _, step in flat_steps(pipeline)]
    while len(steps) > 1 and isinstance(steps[0], RepairTrials):
        X = steps.pop(0).transform(X)
    return X, steps[0]


def columns_given(step, X):
    """Return the columns that a fitted step is given; None for all there is.

    Those of a data frame are named, since another one may have them in another order.
    """
    names = list(getattr(X, "columns", ()))
    if isinstance(step, ColumnTransformer):
        given = [columns for _, each, columns in step.transformers_ if each != "drop"]
        places = [i for columns in given for i in _get_column_indices(X, columns)]
        if names:  # others hold no recordings
            recorded = trial_columns(X)
            places = [i for i in places if names[i] in recorded]
    elif not names or is_table(X):
        return None
    else:
        recorded = trial_columns(X)
        places = [i for i, name in enumerate(names) if name in recorded]
    named = bool(names) and all(isinstance(name, str) for name in names)
    return [names[i] for i in places] if named else places


def signals_of(X, columns, names=None):
    """Return the recordings in some columns, and the names of their channels.

    Parameters
    ----------
    X : collection of trials, or table with trials in its columns
    columns : list or None
        Columns to take; None takes X.
    names : list of (list or None), default=None
        The names of the channels in `fit`, in whose order they are put.

    Returns
    -------
    signals : list of (list of ndarray of shape (n_times_i, n_channels) or None)
        Images as channels. None in place of what are no recordings.
    names : list of (list or None)
    """
    parts = [X] if columns is None else [_part(X, each) for each in columns]
    names = [channel_names(part) for part in parts] if names is None else names
    signals = [
        None if isinstance(part, Sequences) or is_table(part) else _flat(part, each)
        for part, each in zip(parts, names)
    ]
    return signals, names


def _part(X, column):
    part = _safe_indexing(X, column, axis=1)
    return column_of(part, 0) if len(part.shape) > 1 else part


def _flat(part, names):
    trials = check_trials(part, ndims=(2, 3), names=names)
    return [each.reshape(len(each), -1) for each in trials]


def fit_statistics(signals):
    """Return what turns the recordings of each sensor into standardised statistics."""
    return [
        None
        if trials is None
        else make_pipeline(SignalStatistics(), StandardScaler()).fit(trials)
        for trials in signals
    ]


def rows_of(signals, statistics):
    """Return the statistics of each sensor that has recordings."""
    return [
        np.asarray(each.transform(trials))
        for trials, each in zip(signals, statistics)
        if each is not None
    ]


class NoveltyGuard(
    TakesGroups, MetaEstimatorMixin, OrdinalClassifierMixin, BaseEstimator
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
        square difference over the features, or over the statistics of a sensor's
        signals in the same unit, whichever is largest.
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
    1 / (number of objects + 1), so that `fit` warns of fewer than 19. If objects of a
    family are alike, the family is what a new object should be compared with; give the
    families as `groups`. Features that learn their scale from the training touches fit
    these better than new ones: if hundreds of them hardly correlate, p is too small
    where objects are few (in simulations of 20 objects at most .05 for up to two in
    five).

    The features are fitted once to all training touches, also for the predictions out
    of fold. Steps that learn from the ratings make them too good. What is constant in
    training, such as a channel that is always at rest, tells no scale, so that a change
    of it is not seen. Nor is a fault that a training touch has: with a dead sensor in
    one of 90, dead sensors were noticed in no touch instead of all. Look at the touches
    that stand out in `distances_`, and leave out those that are faulty.

    The signals are those that the first step is given, behind a :class:`RepairTrials`
    the repaired ones, whose faults that one reports: the columns of recordings of a
    ColumnTransformer, or the recordings of one sensor, but not rows of a table. Their
    statistics are those of :class:`SignalStatistics`, standardised. The distances of
    each sensor and of the features are made to have the same median over training
    touches. So one sensor of five that is dead is found as well, but to know which,
    have one guard per sensor. That finds smaller faults, too: on recorded slides, it
    noticed a gain of 3 or 0.3 in .99 or more of touches (of electrodes, which differ
    more from touch to touch, in .04 or less), and one guard of all five in .01 to .58.

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
            The object, or the family of objects, of each touch. Without them,
            touches of equal counts are of one object, or of several if they are
            many and most people agree. If counts cannot tell objects, `fit` warns, and
            takes each touch for another one. If `y` names the objects themselves, give
            what divides their touches, such as runs. Of a pipeline, only the last step
            is told them.

        Returns
        -------
        self : NoveltyGuard
            The fitted model.

        Raises
        ------
        ValueError
            If the estimator is no Pipeline of features and a classifier, there are
            fewer than two objects, a fold trains on an object that it tests, or most
            touches held out are of classes that their fold has not learned.
        """
        if not isinstance(self.estimator, Pipeline) or len(self.estimator) < 2:
            raise ValueError(
                f"estimator is a {type(self.estimator).__name__}; give a Pipeline "
                "whose first steps return rows of features and whose last predicts."
            )
        levels = levels_set_in(self.estimator)
        true, classes = true_shares(y, levels, type(self).__name__)
        folds, objects = make_folds(self, X, y, groups, [self.estimator])
        self._warn_of_few_objects(objects.max() + 1)
        fitted = clone(self.estimator)
        if isinstance(fitted[-1], Pipeline):
            fitted = Pipeline(flat_steps(fitted))
        *_, (name, last) = fitted.steps
        rows = np.asarray(fitted[:-1].fit_transform(X, y))
        repaired, first = behind_repairs(fitted, X)
        columns = columns_given(first, repaired)
        signals, channels = signals_of(repaired, columns)
        statistics = fit_statistics(signals)
        kinds = [rows, *rows_of(signals, statistics)]
        every = np.arange(len(true)), np.arange(0)
        params = groups_for(last, objects)
        *done, (last, _) = run_tasks(
            [Task(name, last, rows, y, fold, params) for fold in [*folds, every]],
            classes,
        )
        fitted.steps[-1] = name, last
        proba = np.full(true.shape, np.nan)
        for (_, test), (_, predicted) in zip(folds, done):
            proba[test] = predicted
        ordered = np.size(y) > len(true) or knows_order(last)
        if not ordered:
            check_folds_know(y, folds)
        of_kinds = [nearest_distances(each, each, objects, objects) for each in kinds]
        middles = np.median(of_kinds, axis=1).tolist()
        units = [middles[0] / m if min(middles[0], m) > 0 else 1.0 for m in middles]
        distances = furthest(of_kinds, units)
        marginal, truth, proba = (
            compared(each, ordered) for each in (mean_without(true, folds), true, proba)
        )
        weight = 1 / np.bincount(objects)[objects]
        self.belief_ = fit_belief(marginal - truth, proba - marginal, distances, weight)
        self.distances_ = distances
        self._ordered, self._channel_names, self._columns = ordered, channels, columns
        self._kinds, self._units = kinds, units
        self._objects, self._statistics = objects, statistics
        self.classes_ = classes
        self.shares_ = true.mean(axis=0)
        self.estimator_ = fitted
        return self

    def _warn_of_few_objects(self, n_objects):
        if n_objects < _FEW_OBJECTS:
            warnings.warn(
                f"No p-value is below 1/{n_objects + 1}, since there are {n_objects} "
                f"objects; give {_FEW_OBJECTS} or more for values of .05.",
                UserWarning,
                stacklevel=5,  # beyond this, fit, and its decorators
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
        repaired, _ = behind_repairs(self.estimator_, X)
        signals, _ = signals_of(repaired, self._columns, self._channel_names)
        kinds = [rows, *rows_of(signals, self._statistics)]
        return furthest(map(nearest_distances, kinds, self._kinds), self._units)

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
        proba = predict_at(self.estimator_[-1], rows, self.classes_)
        distance = self._distances(X, rows)
        belief = belief_at(self.belief_, distance)[:, np.newaxis]
        return belief * proba + (1 - belief) * self.shares_

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.no_validation = True
        return tags
