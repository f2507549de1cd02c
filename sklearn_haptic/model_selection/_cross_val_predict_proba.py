"""Predictions of each trial by a model that was fitted without it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from numbers import Integral
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator
from sklearn.utils.parallel import Parallel, delayed

from ..ensembles._out_of_fold import (
    at_classes,
    check_folds,
    fit_fold,
    in_order,
    predict_fold,
    warn_of_divided,
    warn_of_frozen,
)
from ..ratings._checks import check_rated, check_ratings
from ..ratings._distributions import cdf
from ..ratings._levels import (
    in_named_order,
    levels_of_columns,
    levels_of_ratings,
    names_levels,
)
from ..utils._folds import groups_among, groups_for, make_splitter
from ..utils._sklearn import (
    CrossValidator,
    HasMethods,
    StrOptions,
    Trials,
    _num_samples,
    _safe_indexing,
    validate_params,
)
from ..utils._validation import check_groups, is_text

_Method: TypeAlias = Literal[
    "predict_proba", "predict_cdf", "predict_quantile", "predict"
]


@validate_params(
    {
        "estimator": [HasMethods(["fit", "predict"])],
        "y": ["array-like"],
        "groups": ["array-like", None],
        "cv": ["cv_object"],
        "method": [StrOptions({*get_args(_Method)})],
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
    method: _Method = "predict_proba",
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
        The object of each trial, for the splitter, and for ``fit`` of an estimator, or
        of the last step of a Pipeline, that requests them.
    cv : int, splitter or iterable of (train, test), default=None
        The folds, which test each trial once. An int, or None for 5, is a number of
        folds: of whole objects if ``groups`` are given, else as in
        :class:`~sklearn.model_selection.GridSearchCV`. Objects of one label each are
        dealt label by label, so that all folds have all classes. Of ratings this makes
        scores too good, the model's and the guess's alike (by 7 % for 20 objects rated
        once, 3 % for 80): give their counts, or ``cv=GroupKFold(5, shuffle=True)``.
    method : {"predict_proba", "predict_cdf", "predict_quantile", "predict"}, \
            default="predict_proba"
        What to predict: the probability of each level, the probability of each level
        or below, the rating at the 101 quantile positions 0, 0.01, …, 1, or what the
        estimator's ``predict`` returns. Of sliders, ask a `ContinuousRatingsRegressor`
        for quantiles: ``crps(y, numpy.linspace(0, 1, 101), quantiles)``.
    n_jobs : int, default=None
        Number of jobs, each of which fits and predicts one fold.
    params : dict, default=None
        Further arguments of the estimator's ``fit``. Of values that are as long as
        ``X``, those of the training trials are passed.

    Returns
    -------
    predicted : ndarray of shape (n_trials, n_levels), (n_trials, 101) or (n_trials,)
        Rows in the order of ``X``. If several adjectives were learned, they are a
        further axis behind that of the trials. Columns are the levels of all trials, in
        the order of the estimator's ``levels``, else in that which ``y`` names: where
        the training trials of a fold lack a label, its probability is 0 in that fold,
        as that of a column of counts without any count is.

    Raises
    ------
    ValueError
        If the folds do not test each trial exactly once, or train on a trial that they
        test; a trial has no group; or the estimator predicts no distribution, or one
        array for each column of the counts.

    Warns
    -----
    UserWarning
        If a fold trains on some trials of a group and tests others, the estimator is
        frozen, or its levels have another order than the columns of ``y``.

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
    groups = groups_among(params) if groups is None else groups
    X, y = check_rated(X, y)
    groups = check_groups(groups, X, y)
    splitter = make_splitter(estimator, y, groups, cv)
    for_fit = groups_for(estimator, groups) | dict(params)
    folds = check_folds(splitter.split(X, y, groups), _num_samples(X))
    warn_of_divided(folds, groups)
    warn_of_frozen([estimator], stacklevel=4)
    outcomes = Parallel(n_jobs=n_jobs)(
        delayed(_run_fold)(estimator, X, y, *fold, for_fit, method) for fold in folds
    )
    if method in ("predict", "predict_quantile"):
        return in_order([predicted for predicted, _ in outcomes], folds)
    result, levels = join_folds(estimator, y, outcomes, folds)
    _warn_of_other_order(y, levels)
    return cdf(result) if method == "predict_cdf" else result


def _warn_of_other_order(y, levels):
    """Warn if scores would read predictions in another order, as `y` has it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        named, _ = levels_of_columns(y, None, "y")
    if named is None and names_levels(y):
        named = levels_of_ratings(levels, y, None, "y")
    elif np.ndim(y) == 1 and not is_text(levels):
        named = np.sort(levels)
    if named is not None and named.tolist() != levels.tolist():
        warnings.warn(
            f"Predictions are in the order of the estimator's {levels.tolist()}, which "
            "y does not have; give scores the same levels=.",
            UserWarning,
            stacklevel=4,
        )


def _run_fold(estimator, X, y, train, test, params, method):
    """Fit to the training trials; return the predictions and the model's levels."""
    model = fit_fold(estimator, X, y, train, params)
    return predict_fold(model, _safe_indexing(X, test), method)


def join_folds(estimator, y, outcomes, folds):
    """Join the probabilities and levels that each fold predicts.

    Returns
    -------
    proba : ndarray of shape (n_tested, n_levels)
        Of the test trials of all folds, in ascending order.
    levels : ndarray of shape (n_levels,)
    """
    levels = max((classes for _, classes in outcomes), key=len)
    if np.ndim(y) == 1 and not np.isin(y, levels).all():  # each fold lacks a label
        levels = check_ratings(y)[1]
    proba = in_order(
        [at_classes(each, known, levels) for each, known in outcomes], folds
    )
    return in_named_order(proba, levels, y, estimator)
