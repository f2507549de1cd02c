"""Predict from touches of any length."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from copy import copy
from itertools import groupby
from numbers import Real
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from ..ensembles._out_of_fold import (
    check_folds_know,
    make_folds,
    predict_at,
    run_tasks,
)
from ..features._sensor_features import BlockScaler
from ..models._ordinal import OrdinalClassifierMixin
from ..ratings._checks import check_adjectives
from ..ratings._distributions import raised, shares
from ..ratings._levels import knows_order, only_column
from ..recordings._repair import by_sensor, check_limits
from ..utils._folds import TakesGroups
from ..utils._pipeline_steps import flat_steps
from ..utils._sklearn import (
    CrossValidator,
    HasMethods,
    Interval,
    Trials,
    _fit_context,
    one_blas_thread,
)
from ..utils._validation import count
from ._arriving_samples import FeltSamples
from ._branches import check_described, fit_features, used_sensors
from ._heads import best_power, fit_head, head_tasks
from ._recorded_touches import (
    check_alike,
    check_durations,
    check_rates,
    check_times,
    check_touches,
    durations_complete,
    samples_in,
)
from ._touch_in_progress import TouchInProgress

_UNDIVIDED = (
    "A touch lacks a sensor, and with it features of others, because the estimator "
    "does not divide them by sensor; let a ColumnTransformer without weights, with a "
    "column for each transformer, be its first step, behind RepairTrials."
)


class AnytimeRegressor(
    TakesGroups, OrdinalClassifierMixin, MetaEstimatorMixin, BaseEstimator
):
    """Predict from touches of any length, by a pipeline fitted to prefixes.

    A model of whole touches is worse than guessing on the first seconds of one. This
    one learns from the first seconds: `fit` cuts the training touches to each of the
    `durations`, and a touch is predicted from the longest duration that it has
    completed.

    The steps of the pipeline up to the first that returns a row per touch, such as
    dictionaries and pooling, are fitted once, to whole touches. The steps behind them
    are the *head*, of which each duration has its own. The probabilities of each
    duration are then calibrated on predictions out of fold.

    Parameters
    ----------
    estimator : Pipeline
        Steps that turn recordings into features, and behind them an estimator with
        ``predict_proba``. It may be what `make_haptic_pipeline` returns, or a pipeline
        of other steps that take such trials.
    durations : array-like of shape (n_durations,)
        Seconds from the start at which predictions are made, ascending. They should
        grow by a factor, as 0.25, 0.5, 1, 2, 4. A first step whose windows are longer
        than a duration is left out of it, as codes are in `make_haptic_pipeline`.
    sampling_rates : float or dict of str to float
        Samples per second: a number for the recordings of one sensor, or of each
        column of a DataFrame. Columns that the estimator does not use are ignored.
    max_delay : float, default=0.1
        Seconds by which the next sample of a sensor may be late, by what the others
        have recorded, before the touch goes on without it, with a warning. Means of
        training features stand for those of a missing sensor, which leaves the
        prediction as sure as with it.
    cv : int, splitter or iterable, default=5
        Folds of the training touches for the predictions out of fold. A number keeps
        objects whole if `fit` is given `groups`.
    stopping : CertaintyThreshold, ExpectedGain or None, default=None
        When a touch is done, which the rule learns from predictions out of fold. By
        default when the longest duration is complete; one duration is a fixed rule.

    Attributes
    ----------
    classes_ : ndarray of shape (n_levels,)
        The levels, or the classes.
    durations_ : ndarray of shape (n_durations,)
        The durations in seconds.
    sensors_ : list of str
        Columns that are used; ``[""]`` for the recordings of one sensor.
    sample_shapes_ : dict of str to tuple of int
        Shape of one sample of each sensor.
    heads_ : list of Pipeline
        The head of each duration.
    powers_ : ndarray of shape (n_durations,)
        Power to which the probabilities of each duration are raised. Below 1 the head
        was too sure. The limits are 0.22, at which the last step needs a stronger
        penalty or more objects to learn from, and 4.5, at which it needs a weaker one.
    shares_ : ndarray of shape (n_levels,) or (n_adjectives, n_levels)
        Mean distribution of the training touches, which is predicted before the first
        duration is complete.
    oof_proba_ : ndarray of shape (n_trials, n_durations, n_levels) or \
            (n_trials, n_durations, n_adjectives, n_levels)
        Calibrated predictions of the training touches by heads fitted without them.
        NaN where a touch is not so long.
    stopping_ : object or None
        The fitted rule.

    See Also
    --------
    make_haptic_pipeline : A pipeline of recordings of BioTac fingers.

    Notes
    -----
    Only training touches that are long enough are used for a duration, because only
    such touches are ever predicted by it. Dictionaries are fitted once to all training
    touches, also for the predictions out of fold, so no step that returns the rows, or
    comes before, is given the ratings; a step that learns from them belongs to the
    head.

    Examples
    --------
    >>> from sklearn_haptic import AnytimeRegressor, make_haptic_pipeline
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> corpus = make_haptic_corpus(
    ...     n_objects=8, n_trials=2, sensors=["pdc", "tdc"], random_state=0
    ... )
    >>> model = AnytimeRegressor(
    ...     make_haptic_pipeline(["pdc", "tdc"], random_state=0),
    ...     durations=[0.5, 1, 2, 4],
    ...     sampling_rates=corpus.sampling_rates,
    ...     cv=2,
    ... )
    >>> model.fit(corpus.trials, corpus.ratings["hard"], groups=corpus.objects)
    AnytimeRegressor(...)
    >>> model.predict_proba(corpus.trials).shape
    (16, 5)
    >>> model.predict_proba_over_time(corpus.trials, [0.2, 0.7, 3, 60]).shape
    (16, 4, 5)
    """

    _parameter_constraints = {  # noqa: RUF012
        "estimator": [HasMethods(["fit"])],
        "durations": ["array-like"],
        "sampling_rates": [Real, Mapping],
        "max_delay": [Interval(Real, 0, None, closed="left")],
        "cv": ["cv_object"],
        "stopping": [HasMethods(["fit", "stops", "stop_at"]), None],
    }

    def __init__(
        self,
        estimator: Pipeline,
        *,
        durations: ArrayLike,
        sampling_rates: float | Mapping[str, float],
        max_delay: float = 0.1,
        cv: CrossValidator = 5,
        stopping: BaseEstimator | None = None,
    ) -> None:
        self.estimator = estimator
        self.durations = durations
        self.sampling_rates = sampling_rates
        self.max_delay = max_delay
        self.cv = cv
        self.stopping = stopping

    @_fit_context(prefer_skip_nested_validation=False)
    @one_blas_thread
    def fit(self, X: Trials, y: ArrayLike, *, groups: ArrayLike | None = None) -> Self:
        """Fit to prefixes of touches.

        Parameters
        ----------
        X : DataFrame with a column per sensor, or collection of trials
            Whole training touches. All sensors of a touch start together.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            Counts of ratings or labels, whatever the last step takes; also counts of
            several adjectives, of shape (n_trials, n_adjectives, n_levels).
        groups : array-like of shape (n_trials,), default=None
            The object of each touch, so that predictions out of fold are for objects
            never touched, and for a last step that requests groups. Without them,
            touches of equal counts are of one object, or of several if they are
            many and most people agree. If counts cannot tell objects, `fit` warns, and
            takes each touch for another one. If `y` names the objects themselves, give
            what divides their touches, such as runs.

        Returns
        -------
        self : AnytimeRegressor
            The fitted model.

        Raises
        ------
        ValueError
            If durations or rates are unusable, a training touch lacks a sensor, too few
            touches are as long as a duration, no touch of a class is as long as the
            first, a fold trains on an object that it tests, or most touches held out
            are of classes that their fold has not learned.
        """
        steps = self._check_estimator()
        durations = check_durations(self.durations)
        rates = check_rates(self.sampling_rates)
        # In the order of X, whose columns an estimator may count.
        rates = {s: rates[s] for s in getattr(X, "columns", ()) if s in rates} | rates
        self.sensors_ = used_sensors(steps, list(rates))
        touches = check_touches(X, {s: rates[s] for s in self.sensors_})
        check_alike(touches, rates)
        folds, objects = make_folds(self, X, y, groups, [self.estimator], stacklevel=8)
        y = only_column(y)
        y = np.ravel(y) if np.shape(y)[1:] == (1,) else y
        self._channel_names = touches.channels
        self._rates = np.array([rates[sensor] for sensor in self.sensors_])
        self.sample_shapes_ = {
            s: each[0].shape[1:] for s, each in touches.signals.items()
        }
        self._needed = samples_in(durations[:, np.newaxis], self._rates)
        self._max_delay = self.max_delay
        self.durations_ = durations
        n_reached = self._durations_reached(touches.lengths())
        reached = n_reached[:, np.newaxis] > np.arange(len(durations))
        self._check_reached(reached, objects)
        self._branches, later = fit_features(steps, touches)
        check_described(self._branches, rates)
        rows = self._fit_rows(touches, reached)
        if isinstance(later[0][1], BlockScaler):
            later[0][1].blocks = self._block_widths()
        head = Pipeline(later)
        data = head, rows, reached, y, objects
        every = np.arange(len(touches)), np.arange(0)
        fitted = run_tasks(head_tasks(*data, [every]), None, fit=fit_head)
        self.heads_ = [each for each, _ in fitted]
        self.classes_ = max((each.classes_ for each in self.heads_), key=len)
        self._ordered = np.ndim(y) > 1 or knows_order(self.heads_[0])
        true = self._shares(y)
        self.shares_ = shares(true.sum(axis=0))
        if not self._ordered:
            check_folds_know(y, folds)
            self._warn_of_lost_classes(true, reached)
        self.oof_proba_ = np.full((*reached.shape, *self.shares_.shape), np.nan)
        tasks = [each for each in head_tasks(*data, folds) if len(each.fold[1])]
        done = run_tasks(tasks, self.classes_, fit=fit_head)
        for task, (_, proba) in zip(tasks, done):
            k, touch = np.divmod(task.fold[1], len(touches))
            self.oof_proba_[touch, k] = proba
        self.powers_ = _calibrate(self.oof_proba_, true)
        stopping = None
        if self.stopping is not None:
            stopping = clone(self.stopping).fit(
                self.oof_proba_, true, durations=durations, ordered=self._ordered
            )
        self.stopping_ = stopping
        return self

    def _check_estimator(self):
        """Return the steps; refuse what cannot be divided into features and head."""
        pipeline = isinstance(self.estimator, Pipeline)
        steps = flat_steps(self.estimator) if pipeline else []
        if len(steps) < 2:
            raise ValueError(
                f"estimator is a {type(self.estimator).__name__}; give a Pipeline "
                "whose first steps turn trials into features and whose last predicts."
            )
        last = steps[-1][1]
        name = type(last).__name__
        if not hasattr(last, "predict_proba"):
            raise ValueError(
                f"The last step of estimator, {name}, has no predict_proba; take a "
                "classifier that has one, or a DistributionalOrdinalRegressor."
            )
        return steps

    def _check_reached(self, reached, objects):
        for duration, here in zip(self.durations_, reached.T):
            n, n_objects = here.sum(), len(np.unique(objects[here]))
            if n < len(reached) and (n < 10 or n_objects < 2):
                raise ValueError(
                    f"durations holds {duration:g} s, but only {n} of {len(reached)} "
                    f"training touches are so long, of {count(n_objects, 'objects')}; "
                    "leave this duration out."
                )

    def _warn_of_lost_classes(self, true, reached):
        """Warn of the first duration at which a class has no training touch left."""
        known = true.T @ reached > 0
        lost = np.argwhere(~known.T)
        if len(lost):
            k, i = lost[0]
            warnings.warn(
                f"No training touch of the class {self.classes_[i]!r} is as long as "
                f"{self.durations_[k]:g} s, so that longer touches are never taken for "
                "it; leave such durations out, or give longer touches of it.",
                UserWarning,
                stacklevel=4,
            )

    def _durations_reached(self, lengths):
        """Return how many durations touches of so many samples have completed."""
        return durations_complete(lengths, self._rates, self._needed, self._max_delay)

    def _blocks(self, touches, which, k):
        """Return each branch's features of some prefixes, and which touches have it.

        Returns
        -------
        blocks : list of (ndarray of bool of shape (len(which),), ndarray or None)
        """
        needed = dict(zip(self.sensors_, self._needed[k]))
        lengths = touches.lengths()[which]
        long_enough = dict(zip(self.sensors_, (lengths >= self._needed[k]).T))
        # In a touch in progress, a sensor that has sent nothing is late, too.
        begun = (lengths > 0) | isinstance(touches, FeltSamples)
        late = (begun & (lengths < self._needed[k])).any(axis=0)
        if late.any():
            warnings.warn(
                f"A touch goes on without {self.sensors_[late.argmax()]!r}, which is "
                f"late by more than max_delay={self._max_delay} s; if it was not lost, "
                "check its rate, or give a larger max_delay.",
                UserWarning,
                stacklevel=6,
            )
        blocks = []
        for i, branch in enumerate(self._branches):
            each = np.array([long_enough[s] for s in branch.sensors])
            there = each.all(axis=0)
            if (each.any(axis=0) & ~there).any():
                warnings.warn(_UNDIVIDED, UserWarning, stacklevel=6)
            there &= needed[branch.sensors[0]] >= branch.least_samples()
            features = None
            if there.any() and isinstance(touches, FeltSamples):
                features = touches.features(i, k, needed)
            elif there.any():
                features = branch.transform(touches, which[there], needed)
            blocks.append((there, features))
        return blocks

    def _fit_rows(self, touches, reached):
        """Return the features of the prefixes of each duration; learn their means."""
        each = range(len(self.durations_))
        which = [np.flatnonzero(reached[:, k]) for k in each]
        blocks = [self._blocks(touches, which[k], k) for k in each]
        for k in each:
            if all(features is None for _, features in blocks[k]):
                raise ValueError(
                    f"durations holds {self.durations_[k]:g} s, which is shorter than "
                    "one window of every sensor; leave it out or use shorter windows."
                )
        found = [
            [features for _, features in of_branch if features is not None]
            for of_branch in zip(*blocks)
        ]
        widths = [features[0].shape[1] if features else 0 for features in found]
        ends = np.cumsum(widths).tolist()  # of slices that skops can write
        self._columns = [slice(end - n, end) for n, end in zip(widths, ends)]
        types = (f.dtype for features in found for f in features)
        dtype = np.result_type(np.float32, *types)  # means of whole numbers are none
        self._seen = np.array([[f is not None for _, f in each] for each in blocks])
        self._means = np.zeros((len(blocks), ends[-1]), dtype)
        for k in each:
            for columns, (_, features) in zip(self._columns, blocks[k]):
                if features is not None:
                    self._means[k, columns] = features.mean(axis=0)
        rows = np.empty((len(each), len(reached), ends[-1]), dtype)
        for k in each:
            rows[k, which[k]] = self._rows(blocks[k], k)
        return rows

    def _block_widths(self):
        """Return the number of features of each branch of each sensor."""
        branches = zip(self._branches, self._columns)
        return [
            [place.stop - place.start for _, place in of_sensor]
            for _, of_sensor in groupby(branches, key=lambda pair: pair[0].sensors)
        ]

    def _rows(self, blocks, k):
        """Join the features of all branches; means stand for what is missing.

        What no training touch had at the duration is 0.
        """
        rows = np.tile(self._means[k], (len(blocks[0][0]), 1))
        of_branches = zip(self._columns, blocks, self._seen[k])
        for columns, (there, features), seen in of_branches:
            if features is not None and seen:
                rows[there, columns] = features
        return rows

    def _shares(self, y):
        """Return labels or counts as shares of the classes."""
        if np.ndim(y) > 1:
            return shares(check_adjectives(y, self.classes_)[0])
        labels = np.asarray(y)
        known = labels[:, np.newaxis] == self.classes_
        lost = labels[~known.any(axis=1)].tolist()
        if lost:
            raise ValueError(
                f"y has the class {lost[0]!r} only where touches are shorter than "
                f"{self.durations_[0]:g} s, the first of durations; add a shorter one, "
                "or leave this class out."
            )
        return known.astype(np.float64)

    def _predict_rows(self, rows, k):
        proba = predict_at(self.heads_[k], rows, self.classes_)
        return raised(proba, self.powers_[k])

    def _predict_at(self, touches, which, k):
        """Predict some touches from their prefixes of the k-th duration."""
        return self._predict_rows(self._rows(self._blocks(touches, which, k), k), k)

    def _touches(self, X):
        check_is_fitted(self)
        rates = dict(zip(self.sensors_, self._rates.tolist()))
        return check_touches(X, rates, self.sample_shapes_, self._channel_names)

    @one_blas_thread
    def predict_proba(self, X: Trials) -> NDArray[np.float64]:
        """Predict from the longest duration that each touch has completed.

        Parameters
        ----------
        X : DataFrame with a column per sensor, or collection of trials
            Touches of any length, ended or not. None, or an array of no samples, stands
            for a missing sensor.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
            Share of each level, or probability of each class; with several adjectives
            of shape (n_trials, n_adjectives, n_levels). A touch shorter than the first
            duration gets `shares_`.
        """
        touches = self._touches(X)
        n_reached = self._durations_reached(touches.lengths())
        proba = np.tile(self.shares_, (len(touches), *[1] * self.shares_.ndim))
        for k in np.unique(n_reached[n_reached > 0]) - 1:
            which = np.flatnonzero(n_reached == k + 1)
            proba[which] = self._predict_at(touches, which, k)
        return proba

    @one_blas_thread
    def predict_proba_over_time(
        self, X: Trials, times: ArrayLike
    ) -> NDArray[np.float64]:
        """Predict each touch from what had been felt at several times.

        Parameters
        ----------
        X
            As for `predict_proba`.
        times : array-like of shape (n_times,)
            Seconds from the start. After its end a touch is predicted as at its end.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_times, n_levels)
            What `predict_proba` returns for touches cut at these times; with several
            adjectives of shape (n_trials, n_times, n_adjectives, n_levels).
        """
        touches, times = self._touches(X), check_times(times)
        lengths = touches.lengths()
        # At most so many seconds, because times may be infinite.
        end = lengths.max(initial=0) / self._rates.min()
        at_times = samples_in(np.minimum(times, end)[:, np.newaxis], self._rates)
        n_reached = self._durations_reached(
            np.minimum(lengths[:, np.newaxis], at_times)
        )
        proba = np.empty((*n_reached.shape, *self.shares_.shape))
        proba[n_reached == 0] = self.shares_
        for k in np.unique(n_reached[n_reached > 0]) - 1:
            trial, time = np.nonzero(n_reached == k + 1)
            which, place = np.unique(trial, return_inverse=True)
            proba[trial, time] = self._predict_at(touches, which, k)[place]
        return proba

    @one_blas_thread
    def predict_when_done(
        self, X: Trials
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Predict each touch from what had been felt when it was done.

        Parameters
        ----------
        X
            As for `predict_proba`.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
            Predictions at the duration at which the rule stops, or at the last that is
            complete; with several adjectives of shape (n_trials, n_adjectives,
            n_levels).
        seconds : ndarray of shape (n_trials,)
            This duration; 0 for a touch shorter than the first.
        """
        touches = self._touches(X)
        n_reached = self._durations_reached(touches.lengths())
        shape = len(touches), len(self.durations_), *self.shares_.shape
        path = np.full(shape, np.nan)
        for k in range(n_reached.max(initial=0)):
            which = np.flatnonzero(n_reached > k)
            path[which, k] = self._predict_at(touches, which, k)
        index = n_reached - 1
        if self.stopping_ is not None:
            index = self.stopping_.stop_at(path)
        proba = path[np.arange(len(index)), index]
        proba[n_reached == 0] = self.shares_
        return proba, np.where(n_reached == 0, 0.0, self.durations_[index])

    def _stops(self, path):
        """Whether touches are done, given their predictions so far."""
        if path.shape[1] == len(self.durations_):
            return np.ones(len(path), dtype=bool)
        if self.stopping_ is None:
            return np.zeros(len(path), dtype=bool)
        return self.stopping_.stops(path)

    def start(
        self,
        limits: Mapping[str, tuple[float, float]] | tuple[float, float] | None = None,
    ) -> TouchInProgress:
        """Begin a touch of which the samples arrive bit by bit.

        Parameters
        ----------
        limits : tuple of float (low, high) or dict of str to tuple, default=None
            Values at which a sensor is saturated, or those of each sensor by name.
            Samples at or beyond them are kept at the limit, as by `RepairTrials`. By
            default no limits.

        Returns
        -------
        touch : TouchInProgress
            A touch without samples.
        """
        check_is_fitted(self)
        # A touch belongs to the model as it is now, also if that is fitted again.
        of_each = by_sensor(limits, self.sensors_, "limits")
        pairs = {sensor: check_limits(pair) for sensor, pair in of_each.items()}
        return TouchInProgress(copy(self), pairs)

    def __sklearn_is_fitted__(self):
        return hasattr(self, "stopping_")  # which is set last

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.no_validation = True
        return tags


def _calibrate(proba, true):
    """Calibrate predictions, in place; return the power of each duration."""
    powers = np.ones(proba.shape[1])
    tested = np.isfinite(proba).all(axis=tuple(range(2, proba.ndim)))
    for k, here in enumerate(tested.T):
        if here.any():
            powers[k] = best_power(proba[here, k], true[here])
            proba[here, k] = raised(proba[here, k], powers[k])
    return powers
