"""Predictions of trials by models that were fitted without their objects.

All that learns or judges by such predictions comes through here: folds are made and
checked, models are fitted to them and told the objects, and what they predict is put
at the same classes.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import comb
from sklearn.base import clone
from sklearn.model_selection import check_cv
from sklearn.utils.parallel import Parallel, delayed

from ..models._linear_models import fit_linear_models, is_linear
from ..models._shared_features import refuse_adjectives
from ..ratings._checks import check_adjectives, check_rated, validate_rated_trials
from ..ratings._distributions import as_distributions, cdf, shares
from ..ratings._levels import knows_order
from ..utils._folds import ObjectKFold, number_objects, warn_of_no_groups
from ..utils._pipeline_steps import is_frozen, last_step
from ..utils._row_order import check_orders
from ..utils._sklearn import _check_method_params, _num_samples, _safe_indexing
from ..utils._validation import check_groups, check_weights

Fold = tuple[NDArray[np.intp], NDArray[np.intp]]

POSITIONS = np.linspace(0, 1, 101)
"""Of the quantiles that are predicted out of fold."""

FROZEN = (
    "What is frozen had learned before: if from test objects too, the model is worse "
    "on new objects than it looks."
)


# Folds -------------------------------------------------------------------------


def infer_objects(y, weight=None):
    """Return the number of each trial's object, as far as counts tell; None if not.

    Trials of one object have the same counts of its ratings, so trials of equal counts,
    or of shares that are equal in single precision, are taken to be of one object.
    Several objects may share their counts where people agree: if three quarters chose
    one level, and more than a fifth of the trials and twice the median number have
    these counts, they are divided, in their order, into objects of the median number of
    trials. Else most objects would be held out at once where people agree about most.
    Trials of weight 0 are objects of their own.

    These tell no objects: labels; counts of a single rating each; counts of which more
    than a tenth are of one trial alone; counts of so few people that more than a third
    of all possible ones occur; and counts that are to be divided, if their trials are
    no multiple of the median number, or those of other counts mostly lie apart.

    Examples
    --------
    >>> from sklearn_haptic.ensembles._out_of_fold import infer_objects
    >>> infer_objects([[4, 1], [2, 3], [4, 1], [2, 3]])
    array([0, 1, 0, 1])
    >>> infer_objects([[9, 0]] * 4 + [[8, 1]] * 2 + [[2, 7]] * 2)
    array([0, 0, 1, 1, 2, 2, 3, 3])
    >>> infer_objects([[9, 0]] * 5 + [[8, 1]] * 2 + [[2, 7]] * 2) is None
    True
    >>> infer_objects([[9, 0], [9, 0], [8, 1], [2, 7]] * 2) is None
    True
    >>> infer_objects([[2, 0]] * 4 + [[1, 1]] * 2 + [[0, 2]] * 2) is None
    True
    >>> infer_objects([[1, 0], [1, 0], [0, 1]]) is None
    True
    >>> infer_objects([[4, 1], [3, 2], [2, 3]]) is None
    True
    """
    if np.ndim(y) < 2:
        return None
    used = np.flatnonzero(np.ones(len(y)) if weight is None else weight)
    counts = np.reshape(np.asarray(y, dtype=float), (len(y), -1))[used]
    if not (np.count_nonzero(counts, axis=1) > 1).any():
        return None
    mantissa, exponent = np.frexp(counts)
    alike = np.ldexp(mantissa.astype(np.float32).astype(float), exponent) + 0.0  # no -0
    same = number_objects([row.tobytes() for row in alike], len(alike))
    size = np.bincount(same)
    usual = np.median(size)
    agreed = shares(counts).max(axis=1)[np.unique(same, return_index=True)[1]] >= 0.75
    shared = agreed & (size > len(counts) / 5) & (size >= 2 * usual)
    begins = same[np.diff(same, prepend=-1) != 0]
    # Few counts come again elsewhere by chance where rows are ordered by object.
    apart = shared.any() and np.sum(~shared[begins]) > 1.5 * np.sum(~shared)
    if (
        apart
        or np.sum(size == 1) > len(counts) / 10
        or len(size) > _n_possible(counts) / 3
        or (size[shared] % usual).any()
    ):
        return None
    sharing = np.where(shared, size // usual, 1).astype(np.intp)
    place = pd.Series(same).groupby(same).cumcount().to_numpy()
    part = place * sharing[same] // size[same]
    objects = -1 - np.arange(len(y))
    objects[used] = same + len(size) * part
    return number_objects(objects, len(y))


def _n_possible(counts):
    """Return how many different counts as many people can give.

    Of shares and percentages, also rounded, so many people are assumed as would make
    them whole numbers; if they are more than a hundred, there is no end of different
    shares.
    """
    share = shares(counts)
    off = ((n, np.abs(n * share - np.round(n * share)).max()) for n in range(1, 101))
    n_people = next((n for n, most in off if most < min(0.1, 0.006 * n)), np.inf)
    if (counts % 1 == 0).all():
        n_people = min(n_people, np.median(counts.sum(axis=1)))
    n_others = counts.shape[1] - 1
    return comb(n_people + n_others, n_others) if n_people < np.inf else np.inf


def make_folds(
    estimator, X, y, groups, members, weight=None, *, n_folds=None, stacklevel=6
):
    """Return the folds of an estimator's ``cv``, which keep objects whole.

    It warns if nothing tells the objects, and of members that learned before.

    Parameters
    ----------
    estimator : estimator object
        It has a parameter ``cv``; a number makes at most one fold per object.
    X, y : array-like of length n_trials
    groups : array-like of shape (n_trials,) or None
        Without groups, counts tell the objects if they can. If not, it warns, and the
        trials of each label are dealt to the folds in turn.
    members : iterable of estimator objects
        What is fitted to the folds.
    weight : ndarray of shape (n_trials,), default=None
        Trials of weight 0 are in no fold that is made here, and need not be tested.
    n_folds : int, default=None
        The number of folds, or of objects if there are fewer, if ``cv`` is None; by
        default ten up to 50 objects, and fewer of more, down to five from 84 on. Of few
        objects a fold should leave out few, and models of many take long.
    stacklevel : int, default=6
        Where the user is: beyond ``fit``, which calls this, and its decorators.

    Returns
    -------
    folds : list of (ndarray of int, ndarray of int)
    objects : ndarray of int of shape (n_trials,)
        The number of each trial's object.

    Raises
    ------
    ValueError
        If trials and ratings differ in number, there are fewer than two objects, a fold
        trains on an object that it tests, or the folds do not test each trial once.
    """
    check_rated(X, y)
    n_trials, cv = _num_samples(X), estimator.cv
    groups = infer_objects(y, weight) if groups is None else check_groups(groups, X)
    if groups is None:
        warn_of_no_groups(estimator, stacklevel=stacklevel)
    warn_of_frozen(members, stacklevel=stacklevel)
    objects = number_objects(groups, n_trials)
    used = np.flatnonzero(np.ones(n_trials) if weight is None else weight)
    n_objects = len(np.unique(objects[used]))
    if n_objects < 2:
        raise ValueError(
            f"{type(estimator).__name__} learns from held-out objects, but there is 1 "
            "sample or object; give more."
        )
    if cv is not None and not isinstance(cv, Integral):
        split = check_cv(cv).split(X, y, groups)
        least = np.isin(np.arange(n_trials), used)
        return check_folds(split, n_trials, least, objects, groups), objects
    n_folds = n_folds or min(max(5, 500 // n_objects), 10)
    n_folds = min(n_folds if cv is None else cv, n_objects)
    split = ObjectKFold(n_folds).split(used, _safe_indexing(y, used), objects[used])
    return [(used[train], used[test]) for train, test in split], objects


def check_folds(folds, n_trials, least=1, objects=None, names=None):
    """Return the folds as indices; refuse those that leak or are incomplete.

    Parameters
    ----------
    folds : iterable of (train, test)
    n_trials : int
    least : int, array-like of shape (n_trials,) or None, default=1
        How often each trial is tested at least; at most it is once. None is any number.
    objects : ndarray of int of shape (n_trials,), default=None
        What a fold must not both train on and test; by default the trials.
    names : ndarray of shape (n_trials,), default=None
        The names of the objects, for the message.
    """
    trials = np.arange(n_trials)
    objects = trials if objects is None else objects
    folds = [(trials[train], trials[test]) for train, test in folds]
    if not folds or not all(len(part) for fold in folds for part in fold):
        raise ValueError(
            "cv has no folds, or one without training or test trials; give each fold "
            "some of both."
        )
    n_tests = np.zeros(n_trials, dtype=int)
    for train, test in folds:
        np.add.at(n_tests, test, 1)
        both = np.isin(objects[test], objects[train])
        if both.any():
            trial = test[both.argmax()]
            what = f"trial {trial}" if names is None else repr(names.tolist()[trial])
            raise ValueError(
                f"cv trains on {what} in the fold that tests it; keep whole objects "
                "on one side."
            )
    wrong = np.zeros(1) if least is None else (n_tests > 1) | (n_tests < least)
    if wrong.any():
        trial = wrong.argmax()
        raise ValueError(
            f"cv tests trial {trial} {n_tests[trial]} times; choose a splitter that "
            "tests each trial exactly once, such as GroupKFold, KFold or "
            "LeaveOneGroupOut."
        )
    return folds


def warn_of_divided(folds, groups, *, stacklevel=4):
    """Warn of folds that train on other trials of the objects that they test."""
    if groups is None:
        return
    for train, test in folds:
        divided = np.isin(groups[test], groups[train])
        if divided.any():
            warnings.warn(
                "cv trains on some trials and tests others of "
                f"{groups[test][divided].tolist()[0]!r}, so that scores are better "
                "than those of new objects; take a splitter that keeps groups whole, "
                "such as GroupKFold.",
                UserWarning,
                stacklevel=stacklevel,
            )
            return


def check_folds_know(y, folds):
    """Refuse labels without an order if folds do not train on most that they test.

    Examples
    --------
    >>> from sklearn_haptic.ensembles._out_of_fold import check_folds_know
    >>> check_folds_know(["cork", "cork", "foam"], [([0, 2], [1]), ([1], [0, 2])])
    """
    y = np.asarray(y)
    known = [np.isin(y[test], y[train]) for train, test in folds]
    if np.concatenate(known).mean() < 0.5:
        raise ValueError(
            "Most touches held out are of classes that their fold has no training "
            "touch of; give several touches of each class, and groups that divide each "
            "class, such as runs."
        )


def warn_of_frozen(estimators, *, stacklevel):
    """Warn of models whose predictions are of no fold."""
    if any(map(is_frozen, estimators)):
        warnings.warn(FROZEN, UserWarning, stacklevel=stacklevel)


# Models ------------------------------------------------------------------------


def check_members(members, form):
    """Return the names of members, which are tuples of a name and an estimator first.

    A ValueError says that they are not such a list, of the `form` given, or that one is
    no estimator.
    """
    try:
        names, estimators, *_ = zip(*members)
        if len({len(member) for member in members} | {form.count(",") + 1}) > 1:
            raise ValueError
    except (TypeError, ValueError):
        raise ValueError(
            f"estimators must be a list of one or more {form} tuples."
        ) from None
    for name, estimator in zip(names, estimators):
        if not hasattr(estimator, "fit"):
            raise ValueError(
                f"The member {name!r} is {estimator!r}; give an estimator, or leave "
                "the member out."
            )
    return list(names)


class Task(NamedTuple):
    """A model to fit to some trials, and to predict others.

    Attributes
    ----------
    name : str or None
        Its name in messages, if it is one of several.
    estimator : estimator object
        It is cloned.
    X, y : array-like of length n_trials
    fold : tuple of (ndarray of int, ndarray of int)
        Training and test trials; there may be no test trials.
    params : mapping
        Arguments of ``fit``; of those of length n_trials it gets its part.
    """

    name: str | None
    estimator: Any
    X: Any
    y: Any
    fold: Fold
    params: Mapping[str, Any]


def fit_clone(estimator, X, y, **params):
    """Return a fitted clone of an estimator."""
    return clone(estimator).fit(X, y, **params)


def run_tasks(
    tasks: Sequence[Task],
    classes: np.ndarray | None,
    *,
    n_jobs: int | None = None,
    fit: Callable[..., Any] = fit_clone,
) -> list[tuple[Any, np.ndarray]]:
    """Fit the models of some tasks, and predict their test trials.

    Parameters
    ----------
    tasks : list of Task
    classes : ndarray of shape (n_classes,), or None
        What the columns of predictions are; None to keep all models and predict later.
    n_jobs : int, default=None
    fit : callable, default=fit_clone
        Called with an estimator, X, y and the arguments of ``fit``.

    Returns
    -------
    done : list of (model or None, ndarray of shape (n_test, ..., n_classes) or None)
        Models of tasks whose test trials are predicted are not kept.
    """
    fitted = _fit_linear(tasks) if fit is fit_clone else [None] * len(tasks)
    return Parallel(n_jobs=n_jobs)(
        delayed(_run)(*each, classes, fit) for each in zip(tasks, fitted)
    )


def _fit_linear(tasks):
    """Fit the linear models of counts, those of the same trials at once.

    Return the model of each task, None of those that remain to be fitted.
    """
    together: dict[Any, list[int]] = {}
    for i, (_, estimator, X, y, _, params) in enumerate(tasks):
        known = params.keys() <= {"sample_weight", "groups"}
        watched = hasattr(estimator, "_skl_callbacks")
        if is_linear(estimator) and np.ndim(y) == 2 and known and not watched:
            key = id(X), id(y), str(estimator.levels)
            together.setdefault(key, []).append(i)
    models: list[Any] = [None] * len(tasks)
    for same in together.values():
        some = [tasks[i] for i in same]
        weights = np.zeros((len(some), _num_samples(some[0].X)))
        for weight, task in zip(weights, some):
            train = task.fold[0]
            given = task.params.get("sample_weight")
            np.add.at(weight, train, check_weights(given, weight)[train])  # may repeat
        estimators = [clone(task.estimator) for task in some]
        given = some[0].X, some[0].y, estimators[0].levels
        X, counts, levels = validate_rated_trials(estimators[0], *given)
        names = getattr(estimators[0], "feature_names_in_", None)
        fitted = fit_linear_models(estimators, X, counts, weights, levels, names)
        for i, model in zip(same, fitted):
            models[i] = model
    return models


def _run(task, model, classes, fit):
    train, test = task.fold
    if model is None:
        arguments = task.X, task.y, train, task.params, fit, task.name
        model = fit_fold(task.estimator, *arguments)
    if classes is None:
        return model, None
    what = task.name, np.ndim(task.y) == 2, knows_order(model)
    if len(test) == 0:
        nothing = np.empty((0, len(model.classes_)))
        return model, at_classes(nothing, model.classes_, classes, *what)
    predicted = predict_fold(model, _safe_indexing(task.X, test), name=task.name)
    return None, at_classes(*predicted, classes, *what)


def fit_fold(estimator, X, y, train, params, fit=fit_clone, name=None):
    """Return a clone of an estimator, fitted to the training trials."""
    check_orders(X=X, y=y, **params)
    params = _check_method_params(X, params, indices=train)
    X, y = _safe_indexing(X, train), _safe_indexing(y, train)
    try:
        return fit(estimator, X, y, **params)
    except ValueError as error:
        if np.ndim(y) < 2 or "1d array" not in str(error):
            raise
        raise ValueError(
            f"{_who(estimator, name)} or a step of it takes labels, but no counts; "
            "give a classifier to a DistributionalOrdinalRegressor as estimator, which "
            "does, and choose features without ratings."
        ) from error


def predict_at(model, X, classes):
    """Predict shares of all classes, by a model of a task."""
    proba, known = predict_fold(model, X)
    if not np.isin(known, classes).all():  # those of columns without labels
        known = classes
    return at_classes(proba, known, classes, ordered=knows_order(model))


def predict_fold(model, X_test, method=None, name=None):
    """Return the predictions of a fitted model and, if it predicts any, the levels.

    The `method` that users ask for is named to them; by default probabilities are.
    """
    if method == "predict":
        return model.predict(X_test), None
    if method == "predict_quantile":
        last, X_test = last_step(model, X_test)
        if not hasattr(last, "predict_quantile"):
            raise ValueError(
                f"{_who(model, name)} has no predict_quantile; set another method, or "
                "give a model of this package."
            )
        return last.predict_quantile(X_test, POSITIONS), None
    who, n_trials = _who(model, name), _num_samples(X_test)
    if not hasattr(model, "predict_proba"):
        mend = (
            f"from which method={method!r} is computed; set method='predict' or, for "
            "sliders, 'predict_quantile', or "
        )
        if method is None:
            mend = "give it to a DistributionalOrdinalRegressor as estimator, or "
        raise ValueError(f"{who} has no predict_proba, {mend}give a classifier.")
    proba = as_distributions(model.predict_proba(X_test), who)
    if not hasattr(model, "classes_"):
        raise ValueError(
            f"{who} has no classes_, which say what the columns of its predictions "
            "are; set them in fit, lowest level first, or for sliders "
            "method='predict_quantile'."
        )
    shape = np.shape(proba)
    if shape[:1] + shape[-1:] != (n_trials, len(model.classes_)):
        raise ValueError(
            f"{who} predicts an array of shape {shape} for {n_trials} trials and "
            f"{len(model.classes_)} levels; return one row per trial and one column "
            "per level."
        )
    return proba, model.classes_


def at_classes(proba, known, classes, name=None, of_counts=False, ordered=False):
    """Put probabilities of known classes at all classes; others get none.

    A model of counts knows all, or classes 1, 2, … of columns without labels. One that
    is ordered has them in the same order.
    """
    known, every = known.tolist(), classes.tolist()
    if of_counts and known == [*range(1, len(every) + 1)]:
        known = every
    place = {each: i for i, each in enumerate(every)}
    strange = not {*known} <= place.keys() or (of_counts and known != every)
    if strange or (ordered and sorted(known, key=place.get) != known):
        raise ValueError(
            f"{'A fold' if name is None else f'The member {name!r}'} has the levels "
            f"{known}, but {every} are required, in this order; give all members the "
            "same levels, or ratings that name theirs, as an ordered categorical and "
            "the columns of a table of counts do."
        )
    full = np.zeros((*proba.shape[:-1], len(every)), dtype=proba.dtype)
    full[..., [place[each] for each in known]] = proba
    return full


# What predictions are compared with ---------------------------------------------


def mean_without(true, folds):
    """Return for each trial the mean of the training rows of the fold that tests it."""
    marginal = np.full(true.shape, np.nan)
    for train, test in folds:
        marginal[test] = true[train].mean(axis=0)
    return marginal


def true_shares(y, levels, name):
    """Return labels or counts as shares of the levels, and the levels.

    `levels` are those that a member has set, if one has. The estimator `name` refuses
    the ratings of several adjectives. Words may be labels without an order; a member
    that needs one says so.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "y has words")
        counts, classes = check_adjectives(y, levels)
    if counts.ndim == 3:
        refuse_adjectives(name)
    return shares(counts), classes


def compared(proba, ordered):
    """Return what the score compares: CDFs, or probabilities without an order."""
    return cdf(proba)[..., :-1] if ordered else proba


def in_order(predicted, folds):
    """Join what the folds predict, in ascending order of their test trials."""
    order = np.argsort(np.concatenate([test for _, test in folds]))
    return np.concatenate(predicted)[order]


def _who(model, name):
    kind = type(model).__name__
    return kind if name is None else f"The member {name!r}, a {kind},"
