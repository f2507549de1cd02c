"""Which trials are trained and tested on: the one rule of all that takes groups."""

from numbers import Integral

from sklearn.base import is_classifier
from sklearn.model_selection import GroupKFold, check_cv
from sklearn.utils._missing import is_pandas_na


def make_splitter(estimator, y, groups=None, cv=None):
    """Return what splits the trials: by group, if groups are given and cv is a number.

    Parameters
    ----------
    estimator : estimator object
        A classifier's labels are stratified where there are no groups.
    y : array-like of shape (n_trials, ...)
        Labels or counts.
    groups : array-like of shape (n_trials,), default=None
        The object of each trial.
    cv : int, splitter or iterable, default=None
        A number of folds, by default 5, or what splits the trials.

    Returns
    -------
    splitter : object
        Has ``split(X, y, groups)``.

    Raises
    ------
    ValueError
        If a trial has no group.

    Examples
    --------
    >>> from sklearn.linear_model import LogisticRegression
    >>> from sklearn_haptic._folds import make_splitter
    >>> y, objects = [1, 1, 2, 2], ["cork", "cork", "foam", "foam"]
    >>> make_splitter(LogisticRegression(), y, objects, 2)
    GroupKFold(n_splits=2, random_state=None, shuffle=False)
    >>> make_splitter(LogisticRegression(), y, None, 2)
    StratifiedKFold(n_splits=2, random_state=None, shuffle=False)
    """
    for trial, group in enumerate(() if groups is None else groups):
        if group is None or is_pandas_na(group) or group != group:
            raise ValueError(
                f"groups has no object for trial {trial}; name the object of every "
                "trial."
            )
    if groups is not None and (cv is None or isinstance(cv, Integral)):
        return GroupKFold(5 if cv is None else cv)
    return check_cv(cv, y, classifier=is_classifier(estimator))
