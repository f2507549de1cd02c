"""Predictions of trials by a model fitted without their objects, as weights need them.

`model_selection` has the same for the user; this stands below it, and can fit to those
rows alone that have what the model predicts from.
"""

import warnings
from numbers import Integral

import numpy as np
from sklearn.base import clone
from sklearn.pipeline import Pipeline

from ..models._shared_features import refuse_adjectives
from ..ratings._checks import check_adjectives
from ..ratings._distributions import cdf, shares
from ..utils._folds import groups_for, make_splitter
from ..utils._sklearn import _num_samples, _safe_indexing


def fit_fold(member, X, y, objects, there, fold, classes):
    """Fit to the training rows that have the columns, and predict such test rows.

    Parameters
    ----------
    member : tuple of (str, estimator)
        Name, and estimator to clone.
    X, y
        Features or trials, and labels or counts.
    objects : ndarray of shape (n_rows,)
        The object of each row, for members whose ``fit`` requests groups.
    there : ndarray of bool of shape (n_rows,)
        Whether a row has what the member predicts from.
    fold : tuple of (ndarray of int, ndarray of int)
        Training and test rows; there may be no test rows.
    classes : ndarray of shape (n_classes,)

    Returns
    -------
    fitted : estimator
    test : ndarray of int of shape (n_tested,)
        The test rows that are there.
    proba : ndarray of shape (n_tested, n_classes)
    """
    (name, estimator), (train, test) = member, fold
    train, test = train[there[train]], test[there[test]]
    if len(train) == 0:
        raise ValueError(
            f"No training row has all columns of the member {name!r}; give rows that "
            "have them, in every fold, or leave the member out."
        )
    fitted = clone(estimator).fit(
        _safe_indexing(X, train),
        _safe_indexing(y, train),
        **groups_for(estimator, objects[train]),
    )
    if not np.isin(fitted.classes_, classes).all():
        raise ValueError(
            f"The member {name!r} predicts {fitted.classes_}, which are not all among "
            f"{classes}; give a classifier that keeps the levels."
        )
    if len(test) == 0:
        return fitted, test, np.empty((0, len(classes)))
    return fitted, test, at_classes(fitted, _safe_indexing(X, test), classes)


def at_classes(fitted, X, classes):
    """Predict shares of all classes; one that a member has never seen gets none.

    Members may have the classes in another order, as scikit-learn sorts words.
    """
    place = {each: i for i, each in enumerate(classes.tolist())}
    proba = np.zeros((_num_samples(X), len(classes)))
    columns = [place[each] for each in fitted.classes_.tolist()]
    proba[:, columns] = fitted.predict_proba(X)
    return proba


def knows_order(estimator):
    """Whether a fitted classifier, or the last step of a pipeline, has levels."""
    last = estimator[-1] if isinstance(estimator, Pipeline) else estimator
    return hasattr(last, "levels_")


def compared(proba, ordered):
    """Return what the score compares: CDFs, or probabilities without an order."""
    return cdf(proba)[..., :-1] if ordered else proba


def objects_of(groups, n_rows):
    """Return the index of each row's object; without groups, each row has its own."""
    if groups is None:
        return np.arange(n_rows)
    return np.unique(groups, return_inverse=True)[1]


def make_folds(model, X, y, groups, objects):
    """Return the folds of the model's `cv` as indices, at most one per object.

    Without groups, the trials of each label are dealt to the folds in turn.
    """
    trials, cv = np.arange(len(objects)), model.cv
    if isinstance(cv, Integral):
        cv = min(cv, objects.max() + 1)
        if groups is None and np.ndim(y) == 1:
            _, label = np.unique(np.asarray(y), return_inverse=True)
            fold = np.empty(len(label), dtype=int)
            fold[np.argsort(label, kind="stable")] = trials % cv
            return [(trials[fold != k], trials[fold == k]) for k in range(cv)]
    splitter = make_splitter(model, y, objects, cv)
    return [(trials[i], trials[j]) for i, j in splitter.split(X, y, objects)]


def mean_without(true, folds):
    """Return for each trial the mean of the training rows of the fold that tests it."""
    marginal = np.full(true.shape, np.nan)
    for train, test in folds:
        marginal[test] = true[train].mean(axis=0)
    return marginal


def true_shares(y, name):
    """Return labels or counts as shares of the levels, and the levels.

    The estimator `name` refuses the ratings of several adjectives. Words may be labels
    without an order; a member that needs one says so.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "y has words")
        counts, classes = check_adjectives(y)
    if counts.ndim == 3:
        refuse_adjectives(name)
    return shares(counts), classes
