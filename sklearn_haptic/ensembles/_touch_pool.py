"""One prediction from whichever touches of an object there are."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from numbers import Integral
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, MetaEstimatorMixin
from sklearn.utils.validation import check_is_fitted

from ..models._ordinal import OrdinalClassifierMixin
from ..models._regressed import proper_shares
from ..ratings._distributions import shares
from ..ratings._levels import knows_order, levels_set_in
from ..recordings._trials import check_columns
from ..utils._folds import (
    TakesGroups,
    groups_for,
    number_objects,
)
from ..utils._sklearn import (
    CrossValidator,
    Trials,
    _BaseComposition,
    _determine_key_type,
    _fit_context,
    _safe_indexing,
)
from ..utils._validation import check_groups, check_names, column_of, refuse_empty
from ._out_of_fold import (
    Task,
    check_folds_know,
    check_members,
    compared,
    make_folds,
    mean_without,
    predict_at,
    run_tasks,
    true_shares,
)
from ._pool_moments import (
    Breadth,
    class_power,
    error_moments,
    expected_error,
    felt_touches,
    means_of_touches,
    pairs_of,
    pool_breadth,
    pool_weights,
    possible,
    spread_moments,
    with_breadth,
)

MARGINAL = "marginal"
_MOST_OBJECTS = 500  # by which the breadth is judged


class TouchPool(
    TakesGroups, MetaEstimatorMixin, OrdinalClassifierMixin, _BaseComposition
):
    """Pool the predictions of several models over the touches of an object.

    Each member predicts from columns of its own: of a sensor, of a procedure, or of all
    of them. A row that lacks a column is predicted by the members that do not need it;
    nothing stands in for what is missing. A row that lacks everything gets the mean
    distribution of the training rows.

    The prediction is a weighted mean. The weights are learned from predictions out of
    fold: they are those with the best ranked probability score for exactly the members
    and the number of touches that there are. The mean distribution of the training rows
    is always a member, whose weight is negative where a mean of many members would be
    too flat. As touches of an object share much of their error, further ones of the
    same kind change little. The mean is then blurred, or raised to a power, by as much
    as makes it as broad as it was wrong out of fold: a dispersion of 1.

    Parameters
    ----------
    estimators : list of (str, estimator, columns) tuples
        The members. Columns are those of ``X`` that the estimator is given: names of a
        DataFrame or indices of an array; one gives the estimator a column of trials, a
        list of them a table. A member of all columns learns from their joined features,
        and serves where all are there.
    cv : int, splitter or iterable of (train, test), default=5
        The folds for the predictions out of fold. A number keeps objects whole, which
        are dealt to the folds at random, but alike in each fit; objects of one label
        each, label by label.
    n_jobs : int, default=None
        Number of jobs, each of which fits one model.

    Attributes
    ----------
    classes_ : ndarray of shape (n_levels,)
        The levels, or the classes.
    estimators_ : dict of str to estimator object
        The members, fitted to the rows that have their columns.
    shares_ : ndarray of shape (n_levels,)
        Mean distribution of the training rows.
    oof_proba_ : ndarray of shape (n_trials, n_members, n_levels)
        Prediction of each training row by members fitted without its object. NaN where
        a column is missing.

    See Also
    --------
    DistributionBlend : A mean of models that all see the same columns.

    Notes
    -----
    Of the error of a mean of predictions, only the mean products of the members' errors
    have to be known, in one touch and in two touches of one object. `fit` estimates
    both over objects, and makes them positive semidefinite, as products of errors are;
    the weights follow by quadratic programming. So any set of members and any number of
    touches has weights of its own, and each is learned from all training rows. So has
    the breadth: the mean variance of the predictions is to equal the mean square of the
    ratings' distances from the predicted means, judged by pools of as many touches of
    each training object, in the order of its rows and of the members, if it has all the
    members. Another order mostly changed no probability by more than .05, once by .2
    with eight objects, and the mean score by .001. Pools of more touches than a
    training object has are somewhat too broad. What two touches have in common is
    learned from the objects touched more than once: with two or three of these among
    25, pools of four touches gained .88 to .99 of what they gain where all 25 were.
    Members that few rows have are a risk: of 30 generated objects whose touches were by
    one of three procedures, in shares of 70, 21 and 9 %, one pool in twenty was worse
    than the mean distribution by .05 or more, and the plain mean of the members was
    better by .014. Few objects are another: pools of sensors that tell nothing, learned
    from five objects, were worse than the mean distribution by .04 of RPS, once by .4.
    With fewer than ten objects, give one model the joined features. Many members cost
    more: of 30 objects, four that tell nothing .015, and twenty .07.

    If a member knows no order of the levels, as those of scikit-learn, the Brier score
    takes the place of the ranked probability score, also for the power, and the touches
    of a class within a group are those of an object. That is so of an ordered
    categorical, too, so make such a classifier the estimator of a
    :class:`DistributionalOrdinalRegressor`: where touches of an object had different
    answers, a pool of logistic regressions was worse than one touch (RPS of .74 and
    .69), but with them as estimators better (.65 and .68).

    Where a negative weight of the mean distribution makes a probability negative, the
    CDF is clipped and sorted, and probabilities of classes below 0 are 0. A level may
    then have no probability at all, or, between levels that many choose, about as much
    as it would lack (up to .2 where half of the objects divide people in two camps).

    Examples
    --------
    >>> from sklearn_haptic import TouchPool, make_haptic_pipeline
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> corpus = make_haptic_corpus(
    ...     10, 2, ["hold", "squeeze"], sensors=["pdc", "tdc"], random_state=0
    ... )
    >>> hold, squeeze = ["hold_pdc", "hold_tdc"], ["squeeze_pdc", "squeeze_tdc"]
    >>> pool = TouchPool(
    ...     [
    ...         ("hold", make_haptic_pipeline(hold, random_state=0), hold),
    ...         ("squeeze", make_haptic_pipeline(squeeze, random_state=0), squeeze),
    ...     ],
    ...     cv=2,
    ... )
    >>> pool.fit(corpus.trials, corpus.ratings["hard"], groups=corpus.objects)
    TouchPool(...)
    >>> trials = corpus.trials.copy()
    >>> trials.loc[trials.index[0], "squeeze_pdc"] = None
    >>> pool.predict_proba(trials).shape
    (20, 5)

    All touches of an object, pooled:

    >>> together = pool.predict_proba(trials, groups=corpus.objects)
    >>> bool((together[0] == together[1]).all())
    True
    """

    _parameter_constraints = {  # noqa: RUF012
        "estimators": [list],
        "cv": ["cv_object"],
        "n_jobs": [Integral, None],
    }

    def __init__(
        self,
        estimators: Sequence[tuple[str, BaseEstimator, Any]],
        *,
        cv: CrossValidator = 5,
        n_jobs: int | None = None,
    ) -> None:
        self.estimators = estimators
        self.cv = cv
        self.n_jobs = n_jobs

    @property
    def _members(self):
        try:
            return [(name, estimator) for name, estimator, _ in self.estimators]
        except (TypeError, ValueError):  # what is no such list, as `fit` will say
            return self.estimators

    @_members.setter
    def _members(self, members):
        self.estimators = [
            (name, estimator, columns)
            for (name, estimator), (*_, columns) in zip(members, self.estimators)
        ]

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the parameters, by default with those of the members."""
        return self._get_params("_members", deep=deep)

    def set_params(self, **params: Any) -> Self:
        """Set parameters; a member by its name, its own as ``name__parameter``."""
        self.estimators = params.pop("estimators", self.estimators)
        return self._set_params("_members", **params)

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: Trials, y: ArrayLike, *, groups: ArrayLike | None = None) -> Self:
        """Fit the members, and learn how their errors go together.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_trials, n_columns)
            A row per touch. NaN, None or a recording of no samples, or of NaN alone,
            stands for what was not felt.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            Counts of ratings or labels, whatever the members take.
        groups : array-like of shape (n_trials,), default=None
            The object of each row. Rows of one object are touches of it. Without them,
            rows of equal counts are of one object, or of several if they are many and
            most people agree; some objects whose few raters chanced to give equal
            counts are then taken for one, and pools are too narrow. If counts cannot
            tell objects, `fit` warns, and takes each row for another one. If `y` names
            the objects themselves, give what divides their touches, such as runs. Of
            ratings, give the objects alone, not runs or materials: the ratings of a
            group are averaged. A UserWarning tells of groups that hardly differ in
            their ratings, unless rows of equal ratings make them differ by chance.

        Returns
        -------
        self : TouchPool
            The fitted pool.

        Raises
        ------
        ValueError
            If the estimators are no such tuples, their names are not distinct, they
            take columns of a DataFrame by position, a fold trains on an object that it
            tests, a column of a member is missing in all rows of a fold, or most
            touches held out are of classes that their fold has not learned.
        """
        names = check_members(self.estimators, "(name, estimator, columns)")
        self._validate_names([*names, MARGINAL])
        X = _as_table(X)
        members = [estimator for _, estimator, _ in self.estimators]
        true, classes = true_shares(y, levels_set_in(self), type(self).__name__)
        folds, objects = make_folds(self, X, y, groups, members)
        fitted, oof = self._fit_members(X, y, objects, folds, classes)
        marginal = mean_without(true, folds)[:, np.newaxis]
        ordered = np.size(y) > len(true) or all(map(knows_order, fitted.values()))
        if ordered:
            _warn_of_groups(compared(true, ordered), objects)
        else:
            check_folds_know(y, folds)
            # Of what is touched in a run, each class is an object.
            objects = objects * true.shape[1] + true.argmax(axis=1)
            objects = number_objects(objects, len(true))
        # A pool is to predict the ratings of an object, not of one of its touches.
        of_objects = pd.DataFrame(true).groupby(objects).mean().to_numpy()
        true = of_objects[objects]
        proba = np.concatenate((oof, marginal), axis=1)
        departure = compared(proba, ordered) - compared(true, ordered)[:, np.newaxis]
        self._moments = possible(error_moments(departure, objects))
        self._ordered = ordered
        self._spread = spread_moments(proba, true, objects) if ordered else None
        judged = np.random.RandomState(0).permutation(len(of_objects))[:_MOST_OBJECTS]
        judged.sort()
        some = np.isin(objects, judged)
        self._objects = np.searchsorted(judged, objects[some])
        self._proba, self._true = proba[some], of_objects[judged]
        self.classes_ = classes
        self.shares_ = true.mean(axis=0)
        self.oof_proba_ = oof
        self.estimators_ = fitted
        self._columns = [columns for *_, columns in self.estimators]
        self._width = None if hasattr(X, "columns") else X.shape[1]
        return self

    def _fit_members(self, X, y, objects, folds, classes):
        """Return the members fitted to all rows, and predictions out of fold."""
        every = np.arange(len(objects)), np.arange(0)
        tasks, places = [], []
        for i, (name, estimator, columns) in enumerate(self.estimators):
            part = _columns(X, columns)
            there = _has_values(part)
            rows, place = np.flatnonzero(there), np.cumsum(there) - 1
            own = _safe_indexing(part, rows), _safe_indexing(y, rows)
            params = groups_for(estimator, objects[rows])
            for fold in [*folds, every]:
                train, test = (place[each[there[each]]] for each in fold)
                if len(train) == 0:
                    raise ValueError(
                        f"No training row has all columns of the member {name!r}; give "
                        "rows that have them, in every fold, or leave the member out."
                    )
                tasks.append(Task(name, estimator, *own, (train, test), params))
                places.append((rows[test], i))
        done = run_tasks(tasks, classes, n_jobs=self.n_jobs)
        oof = np.full((len(objects), len(self.estimators), len(classes)), np.nan)
        for place, (_, proba) in zip(places, done):
            oof[place] = proba
        fitted = [model for model, _ in done[len(folds) :: len(folds) + 1]]
        return {name: model for (name, *_), model in zip(self.estimators, fitted)}, oof

    def predict_proba(
        self, X: Trials, groups: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Predict from the columns that each row, or each object, has.

        Parameters
        ----------
        X : DataFrame or array-like of shape (n_trials, n_columns)
            A row per touch, with all columns of `fit`; what was not felt is missing as
            there.
        groups : array-like of shape (n_trials,), default=None
            The object of each row. All rows of one object get the same prediction, from
            all of them. By default each row is predicted from itself alone.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
            Share of each level, or probability of each class; rows sum to 1.
        """
        check_is_fitted(self)
        groups = check_groups(groups, X)
        X = _as_table(X)
        if self._width not in (None, X.shape[1]):
            raise ValueError(
                f"X has {X.shape[1]} columns, but had {self._width} in fit; give the "
                "same ones in the same order."
            )
        parts = [_columns(X, columns) for columns in self._columns]
        there = np.column_stack([_has_values(part) for part in parts])
        proba = np.zeros((*there.shape, len(self.classes_)))
        for i, (member, part) in enumerate(zip(self.estimators_.values(), parts)):
            rows = np.flatnonzero(there[:, i])
            if len(rows):
                part = _safe_indexing(part, rows)
                proba[rows, i] = predict_at(member, part, self.classes_)
        return self._pool(proba, there, groups)

    def _pool(self, proba, there, groups):
        """Return the weighted means of the members' predictions, of shape (n, k)."""
        if not len(there):
            return np.empty((0, len(self.classes_)))
        objects = number_objects(groups, len(there))
        n_touches = np.zeros((objects.max() + 1, there.shape[1]))
        total = np.zeros((*n_touches.shape, proba.shape[2]))
        np.add.at(n_touches, objects, there)
        np.add.at(total, objects, proba)
        order = np.argsort(objects, kind="stable")
        share, known = np.empty((len(total), there.shape[1] + 1)), {}
        breadth = np.empty((len(total), 2))
        for i, rows in enumerate(np.split(order, np.cumsum(np.bincount(objects))[:-1])):
            touches = felt_touches(there[rows])
            key = touches.tobytes()
            if key not in known:
                known[key] = self._weights(touches)
            share[i], breadth[i] = known[key]
        mean = total / np.maximum(n_touches, 1)[..., np.newaxis]
        marginal = np.broadcast_to(self.shares_, (len(mean), 1, len(self.shares_)))
        pooled = self._mean(np.concatenate((mean, marginal), axis=1), share)
        return with_breadth(pooled, Breadth(*np.hsplit(breadth, 2)))[objects]

    def _weights(self, touches):
        """Return the weights of the members, the marginal the last; the breadth."""
        pairs = pairs_of(touches)
        share, _ = pool_weights(self._moments, pairs)
        if not share[:-1].any():
            return share, Breadth()
        used = np.flatnonzero(share)
        proba, touches = self._proba[:, used], touches[:, used]
        means, objects = means_of_touches(proba, self._objects, touches)
        if not len(means):  # members that no object has together
            return share, Breadth()
        pools = self._mean(means, np.tile(share[used], (len(means), 1)))
        true = self._true[objects]
        if not self._ordered:
            return share, class_power(pools, true)
        return share, pool_breadth(pools, true, self._spread, share, pairs)

    def _mean(self, proba, share):
        """Return weighted means of members, of shape (n, n_members, n_levels)."""
        pooled = np.einsum("oi,oik->ok", share, proba)
        if not self._ordered:
            return shares(np.maximum(pooled, 0))
        return proper_shares(np.cumsum(pooled, axis=1)[:, :-1])

    def weights(self, touches: Sequence[Sequence[str]]) -> dict[str, float]:
        """Return the weight of each member in the pool of some touches.

        Parameters
        ----------
        touches : list of lists of str
            Of each touch of an object the members that predict from it:
            ``[["hold"], ["hold", "squeeze"]]``.

        Returns
        -------
        weights : dict of str to float
            The weight of each member, all its touches together, and of
            ``"marginal"``, which may be negative; they sum to 1. They are no measure of
            importance: of members that predict alike, as one that tells nothing and the
            marginal, only the sum matters (5.14 and -5.11).
        """
        share, _ = self._weights(self._touches(touches))
        return dict(zip([*self.estimators_, MARGINAL], share.tolist()))

    def breadth(self, touches: Sequence[Sequence[str]]) -> dict[str, float]:
        """Return what makes a pool as broad as it errs.

        Parameters
        ----------
        touches : list of lists of str
            As for `weights`.

        Returns
        -------
        breadth : dict of str to float
            The ``"power"`` to which probabilities are raised, from 1 to 4, and the
            ``"blur"``: how much of each level goes to its neighbours, half to each,
            from 0 to 1. At most one changes the pool. Classes are never blurred, and
            their power may be below 1.
        """
        return self._weights(self._touches(touches))[1]._asdict()

    def expected_excess(self, touches: Sequence[Sequence[str]]) -> float:
        """Return how far a prediction from some touches is expected to be off.

        Parameters
        ----------
        touches : list of lists of str
            As for `weights`.

        Returns
        -------
        excess : float
            Mean squared distance of the mean's CDF, before its breadth is mended, from
            that of the ratings: its ranked probability score without the share that is
            due to people's differing, but with what chance makes of few people's
            ratings (.16 for .11 with ten people). Without an order of levels, its Brier
            score. In simulations of 12 to 48 objects its mean was within a quarter of
            the truth, and a third above it for four touches where training objects had
            one; of single pools it was mostly .6 to 1.4 times the truth, of 12 objects
            .5 to 2. Where training rows lack many cells, it was below half of it in up
            to a fifth of pools of 12 or 24 objects.
        """
        pairs = pairs_of(self._touches(touches))
        share, _ = pool_weights(self._moments, pairs)
        return expected_error(self._moments, share, pairs)

    def _touches(self, touches):
        check_is_fitted(self)
        names = list(self.estimators_)
        there = np.zeros((max(len(touches), 1), len(names)), dtype=bool)
        for row, members in zip(there, touches):
            asked = check_names(members, names, "member", "the pool") if members else []
            row[[names.index(name) for name in asked]] = True
        return felt_touches(there)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.no_validation = True
        return tags


def _warn_of_groups(ratings, groups):
    """Warn if groups differ in their ratings hardly more than chance makes them differ.

    So do runs, in each of which the same objects were touched. The ratio of variances
    between and within groups is 1 by chance, and warned of below 2.

    Parameters
    ----------
    ratings : ndarray of shape (n_trials, n_levels)
    groups : ndarray of int of shape (n_trials,)
        From 0 to the number of groups minus 1.
    """
    size = np.bincount(groups)
    between, within = len(size) - 1, len(groups) - len(size)  # degrees of freedom
    means = pd.DataFrame(ratings).groupby(groups).transform("mean").to_numpy()
    explained = ((means - ratings.mean(axis=0)) ** 2).sum()
    rest = ((ratings - means) ** 2).sum()
    if rest > 0 and explained * within < 2 * rest * between:
        warnings.warn(
            "The ratings of different groups differ hardly more than those of the same "
            "group. If the groups are runs or materials, give the objects: TouchPool "
            "averages the ratings of a group.",
            UserWarning,
            stacklevel=4,
        )


def _as_table(X):
    """Return rows in a list as an array, and anything else unchanged."""
    check_columns(X, [])
    refuse_empty(X)
    X = X if hasattr(X, "shape") or hasattr(X, "columns") else np.asarray(X)
    if len(X.shape) != 2:
        raise ValueError(
            f"X has shape {X.shape}; give a table with a row per touch and a column "
            "per sensor."
        )
    return X


def _columns(X, columns):
    """Return some columns of a table, by name if it is labelled.

    Another table may have labelled columns in another order.
    """
    labels = [*getattr(X, "columns", ())]
    if labels != [*range(len(labels))] and _determine_key_type(columns) != "str":
        raise ValueError(
            f"A member takes columns of X by position, {columns!r}; name them, by "
            "text, because they may come in another order."
        )
    asked = np.ravel(np.array(columns, dtype=object)).tolist()
    check_columns(X, [name for name in asked if isinstance(name, str)])
    return _safe_indexing(X, columns, axis=1)


def _has_values(table):
    """Whether no cell of a row is missing, be it a number or a recording."""
    n_columns = table.shape[1] if len(table.shape) == 2 else 1
    there = np.ones(table.shape[0], dtype=bool)
    for i in range(n_columns):
        column = np.asarray(column_of(table, i))
        if column.dtype.kind == "O":
            there &= np.array([not np.all(pd.isna(value)) for value in column], bool)
        elif column.dtype.kind == "f":
            there &= ~np.isnan(column)
    return there
