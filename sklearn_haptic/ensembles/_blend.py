"""The mean of the distributions that several models predict."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn import get_config
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.pipeline import Pipeline
from sklearn.utils import indexable
from sklearn.utils.metadata_routing import (
    MetadataRouter,
    MethodMapping,
    process_routing,
)
from sklearn.utils.validation import (
    check_is_fitted,
    has_fit_parameter,
)

from ..models._baselines import DummyDistribution
from ..models._ordinal import OrdinalClassifierMixin
from ..models._shared_features import refuse_adjectives
from ..ratings._checks import check_adjectives, check_rated, record_features
from ..ratings._distributions import cdf, raised
from ..ratings._levels import are_counts, levels_set_in, names_levels
from ..utils._folds import TakesGroups, groups_for, number_objects
from ..utils._pipeline_steps import last_step
from ..utils._sklearn import (
    CrossValidator,
    Trials,
    _BaseComposition,
    _fit_context,
)
from ..utils._validation import check_groups, check_weights
from ._blend_weights import blend_exponent, blend_weights
from ._out_of_fold import Task, check_members, infer_objects, make_folds, run_tasks

MARGINAL = "marginal"


class DistributionBlend(
    TakesGroups, MetaEstimatorMixin, OrdinalClassifierMixin, _BaseComposition
):
    """Classifier that predicts the mean of the distributions of several models.

    Models that err differently are better together. A model may be a whole pipeline
    with features of its own, so that families of features are joined after, not before,
    the models. The marginal, which ignores the features, is always a member: where
    there is nothing to learn it gets the weight. A mean is broader than its members;
    where held-out ratings show that it is too broad or too sharp, its probabilities are
    raised to a power. The weights minimise the ranked probability score of predictions
    by models that were fitted without a trial's object; they are drawn towards the
    marginal by what two objects would say against the others, and the power towards 1.

    Where all trials of each object have the same ratings, these are one observation,
    however often the object was touched: its trials share a weight of 1. Ratings that
    differ between the trials of an object are observations of each trial. Objects
    count equally where the weights of the members are learned, unless `sample_weight`
    differs.

    Parameters
    ----------
    estimators : list of (str, estimator) tuples
        The members, beside the marginal: classifiers that take counts per level, such
        as those of this package and pipelines that end in one.
    cv : int, splitter or iterable of (train, test), default=None
        The folds on which the weights are learned, whole objects in each; by default
        ten up to 50 objects, or as many as there are, and fewer of more, down to five.
        Objects are dealt to these at random, but alike in each fit to the same rows;
        other orders of rows lead to other weights, and of 12 objects to an RPS that
        differs by 2 to 6 %, of 40 by at most .7 %.
    levels : array-like of shape (n_levels,), default=None
        All ordered levels, by default as for `DistributionalOrdinalRegressor`.
    n_jobs : int, default=None
        Number of jobs, each of which fits one model.

    Attributes
    ----------
    estimators_ : dict of str to estimator object
        The members of positive weight, fitted to all trials; beside the marginal alone
        the first one too, which checks what is to be predicted.
    weights_ : dict of str to float
        The weight of each member.
    exponent_ : float
        The power to which the probabilities of the mean are raised; above 1 it makes
        them sharper.
    rps_ : dict of str to float
        Ranked probability score of each member on held-out trials, averaged over
        objects; lower is better.
    levels_, classes_ : ndarray of shape (n_levels,)
        The ordered levels.
    n_features_in_ : int
        Number of features, if ``X`` has columns.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the features, if they have any.

    See Also
    --------
    RegressedDistribution : Distributions by any regressor, such as trees.
    DummyDistribution : The marginal.

    Notes
    -----
    Without metadata routing, `sample_weight` goes to all members, and `groups` to those
    that request them, for instance to a search that chooses a penalty by folds of whole
    objects. With it, both go to the members that request them. If no `sample_weight` is
    given, the weights by object reach every member that takes weights, in either case,
    but for a blend, which finds them itself. So a penalty that was chosen for a member
    alone is as many times too strong here as objects were touched: where they were
    touched ten times, logistic regression with ``C=0.01`` lost 2 to 12 % of RPS, and
    nothing with ``C=0.1``.

    Examples
    --------
    Six objects, touched twice each and rated by four people.

    >>> import numpy as np
    >>> from sklearn.linear_model import Ridge
    >>> from sklearn_haptic import (
    ...     DistributionalOrdinalRegressor, DistributionBlend, RegressedDistribution
    ... )
    >>> objects = np.repeat(range(6), 2)
    >>> X = (objects + np.tile([0, 0.2], 6))[:, None]
    >>> counts = np.array([[4, 0], [4, 0], [3, 1], [2, 2], [0, 4], [1, 3]])[objects]
    >>> blend = DistributionBlend(
    ...     [
    ...         ("ordinal", DistributionalOrdinalRegressor()),
    ...         ("ridge", RegressedDistribution(Ridge())),
    ...     ]
    ... ).fit(X, counts, groups=objects)
    >>> blend.predict_proba([[0.0], [5.0]]).round(1)
    array([[1., 0.],
           [0., 1.]])
    """

    _parameter_constraints = {  # noqa: RUF012
        "estimators": [list],
        "cv": ["cv_object"],
        "levels": ["array-like", None],
        "n_jobs": [Integral, None],
    }

    def __init__(
        self,
        estimators: Sequence[tuple[str, BaseEstimator]],
        *,
        cv: CrossValidator = None,
        levels: ArrayLike | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.estimators = estimators
        self.cv = cv
        self.levels = levels
        self.n_jobs = n_jobs

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the parameters, by default with those of the members."""
        return self._get_params("estimators", deep=deep)

    def set_params(self, **params: Any) -> Self:
        """Set parameters; a member by its name, its own as ``name__parameter``."""
        return self._set_params("estimators", **params)

    def get_metadata_routing(self) -> MetadataRouter:
        """Return which metadata `fit` takes, and which it passes to the members."""
        mapping = MethodMapping().add(caller="fit", callee="fit")
        router = MetadataRouter(owner=self).add_self_request(self)
        return router.add(method_mapping=mapping, **dict(self.estimators))

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(
        self,
        X: Trials,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        *,
        groups: ArrayLike | None = None,
    ) -> Self:
        """Learn the weights, then fit the members to all trials.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as all members take them.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            How many people gave the trial's object each rating, or one rating per
            trial.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial. If the ratings of its trials are the same, an object
            weighs the mean of theirs, in units of the largest. Otherwise, and where
            nothing tells the objects, a common factor matters too, as it does for most
            models: weights far below 1 make the members' penalties too strong, so scale
            them to a mean of 1. Members get the weights if their ``fit`` takes
            `sample_weight`.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial. Without them, trials of equal counts are taken to
            be of one object, or of several if they are many and most people agree, and
            trials, not objects, weigh the same. If counts cannot tell objects, `fit`
            warns, and takes each trial for an object.

        Returns
        -------
        self : DistributionBlend
            The fitted blend.

        Raises
        ------
        ValueError
            If there are fewer than two objects, a fold trains on an object that it
            tests, a member cannot take counts or weights, or names of members are
            not distinct.
        """
        record_features(self, X, y)
        # Columns without labels are 1, 2, …, which members of other levels refuse.
        named = names_levels(y) or not are_counts(y)
        counts, levels = check_adjectives(
            y, levels_set_in(self) if named else self.levels
        )
        if counts.ndim == 3:
            refuse_adjectives(type(self).__name__)
        (X,) = indexable(X)
        check_rated(X, counts)
        given = None if sample_weight is None else check_weights(sample_weight, X)
        weight = held_out = check_weights(given, X)
        used = weight > 0
        if groups is not None:
            groups = check_groups(groups, X)
            objects = number_objects(groups, len(counts))
            n_touches = np.maximum(np.bincount(objects, used), 1)
            held_out = weight / n_touches[objects]
            held_out /= np.bincount(objects, held_out).max()
            of_objects = _are_of_objects(counts[used], objects[used])
            weight = held_out if of_objects else weight
        elif (groups := infer_objects(counts, weight)) is not None:
            # Objects that share counts are not all told apart, so trials weigh alike.
            per_object = np.sum(used) / len(np.unique(groups[used]))
            weight = held_out = weight / (weight.max() * per_object)
        members = self._check_members()
        params = self._route(members, given, groups, weight)
        # Counts of a single level would be taken for ratings.
        y = counts if len(levels) > 1 else np.repeat(levels, len(counts))
        folds, _ = make_folds(self, X, y, groups, members.values(), weight)
        tasks = [
            Task(name, member, X, y, fold, params[name])
            for name, member in members.items()
            for fold in folds
        ]
        proba = [each for _, each in run_tasks(tasks, levels, n_jobs=self.n_jobs)]
        tested = np.concatenate([test for _, test in folds])
        proba = np.reshape(np.concatenate(proba), (len(members), len(tested), -1))
        share, exponent, scores = _learn(proba, counts[tested], held_out[tested])
        used = [name for name, w in zip(members, share) if w > 0]
        if used == [MARGINAL]:  # which takes anything; another one checks what is given
            used.append(self.estimators[0][0])
        every = np.arange(len(counts)), np.arange(0)
        tasks = [Task(name, members[name], X, y, every, params[name]) for name in used]
        fitted = run_tasks(tasks, levels, n_jobs=self.n_jobs)
        self.estimators_ = {name: model for name, (model, _) in zip(used, fitted)}
        self.weights_ = dict(zip(members, share.tolist()))
        self.exponent_ = exponent
        self.rps_ = dict(zip(members, scores))
        self.levels_ = self.classes_ = levels
        return self

    def predict_proba(self, X: Trials) -> NDArray[np.float64]:
        """Predict the distribution of ratings.

        Parameters
        ----------
        X : array-like of length n_trials
            Features or trials, as all members take them.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
            Share of the population at each level; rows sum to 1.
        """
        check_is_fitted(self)
        mean = sum(
            self.weights_[name] * member.predict_proba(X)
            for name, member in self.estimators_.items()
        )
        return raised(mean, self.exponent_)

    def _check_members(self):
        """Return the members by name, the marginal last."""
        names = check_members(self.estimators, "(name, estimator)")
        self._validate_names([*names, MARGINAL])
        return dict(self.estimators) | {MARGINAL: DummyDistribution()}

    def _route(self, members, sample_weight, groups, weight):
        """Return the arguments of each of `members`, which may become another."""
        given = {} if sample_weight is None else {"sample_weight": sample_weight}
        params = {}
        routing = get_config()["enable_metadata_routing"]
        routed = process_routing(self, "fit", groups=groups, **given) if routing else {}
        for name, member in self.estimators:
            argument = _weight_argument(member)
            own = isinstance(last_step(member)[0], DistributionBlend)
            if own and sample_weight is None:
                argument = None  # It weighs objects itself.
            if routing:
                params[name] = dict(routed[name].fit)
                if given and "sample_weight" not in params[name]:
                    argument = None
                elif given:
                    argument = "sample_weight"
                elif argument is not None:
                    members[name] = _asking_for_weights(member)
                    argument = "sample_weight"
            elif given and argument is None:
                raise ValueError(
                    f"The member {name!r} takes no sample_weight; give none, or enable "
                    "metadata routing and say by set_fit_request which members request "
                    "it."
                )
            else:
                params[name] = groups_for(member, groups)
            if argument is not None:
                params[name][argument] = sample_weight if own else weight
        return params | {MARGINAL: {"sample_weight": weight}}


def _are_of_objects(counts, objects):
    """Whether all trials of each object have the same ratings."""
    _, first, objects = np.unique(objects, return_index=True, return_inverse=True)
    below = cdf(counts)
    return np.allclose(below, below[first][objects], rtol=0, atol=1e-6)


def _weight_argument(member):
    """Return the argument of a member's ``fit`` by which trials weigh, None of none."""
    if isinstance(member, Pipeline):
        name, last = member.steps[-1]
        argument = _weight_argument(last)
        return argument and f"{name}__{argument}"
    inner = getattr(member, "estimator", None)
    known = [member] if inner is None else [member, inner]
    takes = all(has_fit_parameter(each, "sample_weight") for each in known)
    return "sample_weight" if takes else None


def _asking_for_weights(member):
    """Return a clone that gets weights by metadata routing where it takes any.

    Of a pipeline that is its last step, as without routing.
    """
    member = clone(member)
    if _weight_argument(member) is None:
        return _without_weights(member)
    if isinstance(member, Pipeline):
        *others, (name, last) = member.steps
        others = [(key, _without_weights(step)) for key, step in others]
        return member.set_params(steps=[*others, (name, _asking_for_weights(last))])
    return member.set_fit_request(sample_weight=True)


def _without_weights(estimator):
    """Return an estimator of which no part requests weights."""
    for part in [estimator, *getattr(estimator, "get_params", dict)().values()]:
        if hasattr(part, "fit") and has_fit_parameter(part, "sample_weight"):
            part.set_fit_request(sample_weight=False)
    return estimator


def _learn(proba, counts, weight):
    """Return weights, the exponent, and each member's score on held-out trials."""
    true = cdf(counts)[:, :-1]
    departure = np.moveaxis(cdf(proba)[..., :-1], 0, 1) - true[:, None]
    share = blend_weights(departure, weight)
    mean = np.einsum("m,mtk->tk", share, proba)
    exponent = blend_exponent(mean, true, weight)
    scores = (departure**2).sum(axis=2).T + (true * (1 - true)).sum(axis=1)
    return share, exponent, np.average(scores, axis=1, weights=weight).tolist()
