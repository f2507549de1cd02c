"""Predictions of each trial by a model that was fitted without it."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, clone
from sklearn.utils import indexable
from sklearn.utils.parallel import Parallel, delayed

from ..ratings._checks import check_ratings
from ..ratings._distributions import cdf
from ..ratings._levels import in_named_order
from ..utils._folds import make_splitter, route
from ..utils._sklearn import (
    CrossValidator,
    HasMethods,
    StrOptions,
    Trials,
    _check_method_params,
    _num_samples,
    _safe_indexing,
    validate_params,
)
from ..utils._validation import check_groups


@validate_params(
    {
        "estimator": [HasMethods(["fit", "predict"])],
        "y": ["array-like"],
        "groups": ["array-like", None],
        "cv": ["cv_object"],
        "method": [StrOptions({"predict_proba", "predict_cdf", "predict"})],
        "n_jobs": [Integral, None],
        "params": [dict, None],
    },
    prefer_skip_nested_validation=False,
)
def cross_val_predict_proba(
    estimator: BaseEstimator,
    X: Trials,
    y: ArrayLike,
    *,
    groups: ArrayLike | None = None,
    cv: CrossValidator = None,
    method: Literal["predict_proba", "predict_cdf", "predict"] = "predict_proba",
    n_jobs: int | None = None,
    params: Mapping[str, Any] | None = None,
) -> np.ndarray:
    """Predict each trial by a model that was fitted without it.

    For each fold, a clone of the estimator is fitted to the training trials, with their
    ratings unchanged, and predicts the test trials. Do not use
    :func:`~sklearn.model_selection.cross_val_predict` with counts: for
    ``method="predict_proba"`` it replaces the values in each column of a
    two-dimensional ``y`` by their ranks before it fits, so that the model learns other
    distributions than those that people gave.

    Parameters
    ----------
    estimator : estimator object
        The model to fit, such as a Pipeline or a search.
    X : DataFrame, array-like or collection of trials
        The trials, in any form that the estimator takes.
    y : array-like of shape (n_trials,), (n_trials, n_levels) or \
            (n_trials, n_adjectives, n_levels)
        Labels, how many people gave each level, or such counts of several adjectives.
    groups : array-like of shape (n_trials,), default=None
        The object of each trial, for the splitter.
    cv : int, splitter or iterable of (train, test), default=None
        The folds, which test each trial once. An int, or None for 5, is a number of
        folds: of whole objects if ``groups`` are given, else as in
        :class:`~sklearn.model_selection.GridSearchCV`.
    method : {"predict_proba", "predict_cdf", "predict"}, default="predict_proba"
        What to predict: the probability of each level, the probability of each level
        or below, or what the estimator's ``predict`` returns. For quantiles, pass the
        probabilities to :func:`~sklearn_haptic.ratings.inverse_cdf`.
    n_jobs : int, default=None
        Number of jobs, each of which fits and predicts one fold.
    params : dict, default=None
        Arguments of the estimator's ``fit``, such as ``{"groups": objects}`` for early
        stopping on whole objects. Of values that are as long as ``X``, those of the
        training trials are passed. With metadata routing enabled, ``params`` and
        ``groups`` go to whichever of the splitter and ``fit`` requests them.

    Returns
    -------
    predicted : ndarray of shape (n_trials, n_levels) or (n_trials,)
        Rows in the order of ``X``. If several adjectives were learned, they are a
        further axis behind that of the trials. Columns are the levels of all trials, in
        the order that ``y`` names, if it names one, else in that of the estimator:
        where the training trials of a fold lack a label, its probability is 0 in that
        fold, as that of a column of counts without any count is.

    Raises
    ------
    ValueError
        If the folds do not test each trial exactly once, or train on a trial that they
        test; a trial has no group; or the estimator predicts no distribution, or one
        array for each column of the counts.

    See Also
    --------
    sklearn_haptic.metrics : Scores of predicted distributions.

    Notes
    -----
    Progress is shown by the callbacks of the estimator, fold by fold, and by joblib:
    ``with joblib.parallel_config(verbose=10)``.

    Examples
    --------
    Three objects, touched twice each and rated by four people.

    >>> import numpy as np
    >>> from sklearn_haptic import DummyDistribution
    >>> from sklearn_haptic.model_selection import cross_val_predict_proba
    >>> X = np.zeros((6, 1))
    >>> counts = np.repeat([[4, 0, 0], [0, 4, 0], [0, 2, 2]], 2, axis=0)
    >>> objects = ["foam", "foam", "cork", "cork", "tile", "tile"]
    >>> cross_val_predict_proba(
    ...     DummyDistribution(), X, counts, groups=objects, cv=3
    ... )
    array([[0.  , 0.75, 0.25],
           [0.  , 0.75, 0.25],
           [0.5 , 0.25, 0.25],
           [0.5 , 0.25, 0.25],
           [0.5 , 0.5 , 0.  ],
           [0.5 , 0.5 , 0.  ]])
    """
    params = {} if params is None else params
    groups = params.get("groups") if groups is None else groups
    X, y = indexable(X, y)
    groups = check_groups(groups, X)
    splitter = make_splitter(estimator, y, groups, cv)
    for_split, for_fit = route(estimator, splitter, groups, params)
    folds = check_folds(splitter.split(X, y, **for_split), _num_samples(X))
    outcomes = Parallel(n_jobs=n_jobs)(
        delayed(_predict_fold)(clone(estimator), X, y, *fold, for_fit, method)
        for fold in folds
    )
    if method == "predict":
        return in_order([predicted for predicted, _ in outcomes], folds)
    result, _ = join_folds(y, outcomes, folds)
    return cdf(result) if method == "predict_cdf" else result


def check_folds(folds, n_trials, least=1):
    """Return the folds as indices; refuse those that do not test each trial once.

    With `least=0`, trials may be tested not at all.
    """
    trials = np.arange(n_trials)
    folds = [(trials[train], trials[test]) for train, test in folds]
    if not folds or not all(len(part) for fold in folds for part in fold):
        raise ValueError(
            "cv has no folds, or one without training or test trials; give each fold "
            "some of both."
        )
    n_tests = np.zeros(n_trials, dtype=int)
    for train, test in folds:
        np.add.at(n_tests, test, 1)
        both = np.isin(test, train)
        if both.any():
            raise ValueError(
                f"cv trains on trial {test[both.argmax()]} in the fold that tests it; "
                "leave the test trials out of the training trials."
            )
    wrong = (n_tests > 1) | (n_tests < least)
    if wrong.any():
        trial = wrong.argmax()
        raise ValueError(
            f"cv tests trial {trial} {n_tests[trial]} times; choose a splitter that "
            "tests each trial exactly once, such as GroupKFold, KFold or "
            "LeaveOneGroupOut."
        )
    return folds


def _predict_fold(model, X, y, train, test, params, method):
    """Fit to the training trials; return the predictions and, if any, the levels."""
    fit_fold(model, X, y, train, params)
    return predict_fold(model, _safe_indexing(X, test), method)


def fit_fold(model, X, y, train, params):
    """Fit to the training trials, with their part of the arguments of ``fit``."""
    params = _check_method_params(X, params, indices=train)
    model.fit(_safe_indexing(X, train), _safe_indexing(y, train), **params)


def predict_fold(model, X_test, method="predict_proba"):
    """Return the predictions of a fitted model and, if it predicts any, the levels."""
    if method == "predict":
        return model.predict(X_test), None
    if not hasattr(model, "predict_proba"):
        raise ValueError(
            f"{type(model).__name__} has no predict_proba, from which method="
            f"{method!r} is computed; set method='predict', or give a classifier."
        )
    proba = model.predict_proba(X_test)
    if isinstance(proba, list):
        raise ValueError(
            f"{type(model).__name__} took each column of y for labels of its own, and "
            "predicts a list of arrays; give it to a DistributionalOrdinalRegressor as "
            "estimator, which takes counts."
        )
    if not hasattr(model, "classes_"):
        raise ValueError(
            f"{type(model).__name__} has no classes_, which say what the columns of "
            "its predictions are; set them in fit, lowest level first."
        )
    shape, n_trials = np.shape(proba), _num_samples(X_test)
    if shape[:1] + shape[-1:] != (n_trials, len(model.classes_)):
        raise ValueError(
            f"{type(model).__name__} predicts an array of shape {shape} for "
            f"{n_trials} trials and {len(model.classes_)} levels; return one row per "
            "trial and one column per level."
        )
    return proba, model.classes_


def join_folds(y, outcomes, folds):
    """Join the probabilities and levels that each fold predicts.

    Returns
    -------
    proba : ndarray of shape (n_tested, n_levels)
        Of the test trials of all folds, in ascending order.
    levels : ndarray of shape (n_levels,)
    """
    levels = _levels_of_all(y, [classes for _, classes in outcomes])
    proba = in_order([_at_levels(levels, *outcome) for outcome in outcomes], folds)
    return in_named_order(proba, levels, y)


def in_order(predicted, folds):
    """Join what the folds predict, in ascending order of their test trials."""
    order = np.argsort(np.concatenate([test for _, test in folds]))
    return np.concatenate(predicted)[order]


def _levels_of_all(y, classes):
    """Return the ordered levels of all trials, given those of each fold."""
    levels = max(classes, key=len)
    if np.ndim(y) == 1 and not np.isin(y, levels).all():
        levels = check_ratings(y)[1]
    return levels


def _at_levels(levels, proba, classes):
    """Add columns of probability 0 for levels that a fold's training trials lack."""
    place = {level: i for i, level in enumerate(levels.tolist())}
    if not {*classes.tolist()} <= place.keys():
        raise ValueError(
            f"The folds have different levels, {classes.tolist()} and "
            f"{levels.tolist()}; give the estimator all levels, lowest first."
        )
    full = np.zeros((*proba.shape[:-1], len(levels)), dtype=proba.dtype)
    full[..., [place[each] for each in classes.tolist()]] = proba
    return full
