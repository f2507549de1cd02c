"""Folds of trials, by whole objects where these are known, and what they are given."""

import warnings
from numbers import Integral

import numpy as np
import pandas as pd
from sklearn import get_config
from sklearn.base import is_classifier
from sklearn.model_selection import GroupKFold, GroupShuffleSplit, check_cv
from sklearn.pipeline import Pipeline
from sklearn.utils.metadata_routing import (
    MetadataRequest,
    get_routing_for_object,
)
from sklearn.utils.validation import has_fit_parameter

from ._sklearn import BaseSearchCV

NO_GROUPS = (
    "fit was given no groups, so it takes each trial for another object, and trials of "
    "one object may be learned from and held out at once: call fit(..., "
    "groups=objects), in a Pipeline fit(..., model__groups=objects) by the name of its "
    "step, with range(n_trials) if each trial is of another object; searches and "
    "cross-validation of scikit-learn pass groups on after "
    "sklearn.set_config(enable_metadata_routing=True)."
)


class TakesGroups:
    """Mixin of estimators whose ``fit`` needs the objects: it requests `groups`."""

    __metadata_request__fit = {"groups": True}  # noqa: RUF012


def warn_of_no_groups(estimator, *, stacklevel=5):
    """Warn that an estimator holds out single trials.

    Its ``fit`` calls this; by default the user is beyond two decorators of it.
    """
    name = type(estimator).__name__
    warnings.warn(f"{name}: {NO_GROUPS}", UserWarning, stacklevel=stacklevel)


def number_objects(groups, n_trials):
    """Return the number of each trial's object, in the order of their first trials.

    Without groups each trial is of another object. Names of objects change nothing.

    Examples
    --------
    >>> from sklearn_haptic.utils._folds import number_objects
    >>> number_objects(["cork", "foam", "cork"], 3)
    array([0, 1, 0])
    """
    if groups is None:
        return np.arange(n_trials)
    return pd.factorize(np.asarray(groups))[0]


def _number_labels(y, n_trials):
    """Return the number of each trial's label; 0 of counts and of lists of answers."""
    one_each = y is not None and getattr(y, "shape", ())[1:] in ((), (1,))
    labels = np.array(y if one_each else None, dtype=object).ravel()
    if len(labels) != n_trials or any(map(np.ndim, labels)):
        return np.zeros(n_trials, dtype=np.intp)
    return pd.factorize(labels)[0]


class ObjectKFold(GroupKFold):
    """Folds of whole objects, of which names do not matter and sizes are balanced.

    Objects of equal size are dealt in one random order, because rows may have one of
    their own, such as each material in turn. If each object has one label, those of
    each label are dealt in turn, so that every fold knows all labels.
    """

    def split(self, X, y=None, groups=None):
        """Return an iterator of the training and test trials of each fold."""
        if groups is not None:
            groups = number_objects(groups, len(groups))
            first = np.unique(groups, return_index=True)[1]
            order = np.random.RandomState(0).permutation(len(first))
            label = _number_labels(y, len(groups))
            if (label == label[first][groups]).all():
                # Labels, too, come in random order: each may be of one object alone.
                of_objects = pd.factorize(label[first[order]])[0]
                order = order[of_objects.argsort(kind="stable")]
            groups = order.argsort()[groups]
        return super().split(X, y, groups)


def make_splitter(estimator, y, groups=None, cv=None):
    """Return a splitter of trials: by group, if groups are given and cv is a number.

    The number of folds is 5 if `cv` is None; a splitter or the folds themselves are
    used as they are. Without groups, the labels `y` of a classifier are stratified.

    Examples
    --------
    >>> from sklearn.linear_model import LogisticRegression
    >>> from sklearn_haptic.utils._folds import make_splitter
    >>> y, objects = [1, 1, 2, 2], ["cork", "cork", "foam", "foam"]
    >>> make_splitter(LogisticRegression(), y, objects, 2)
    ObjectKFold(n_splits=2, random_state=None, shuffle=False)
    >>> make_splitter(LogisticRegression(), y, None, 2)
    StratifiedKFold(n_splits=2, random_state=None, shuffle=False)
    """
    if groups is not None and (cv is None or isinstance(cv, Integral)):
        return ObjectKFold(5 if cv is None else cv)
    return check_cv(cv, y, classifier=is_classifier(estimator))


def groups_among(params):
    """Return the groups among the arguments of a ``fit``, or of a step's; or None."""
    for name, value in params.items():
        if name.split("__")[-1] == "groups":
            return value
    return None


def groups_for(estimator, groups):
    """Return the arguments that tell an estimator's ``fit`` the groups that it takes.

    Without metadata routing, the last step of a pipeline is told by its name, and the
    estimator in a search only if it is in such a step: the search keeps ``groups`` for
    its splitter. A UserWarning names a search whose splitter takes none.

    Examples
    --------
    >>> from sklearn.linear_model import LogisticRegression
    >>> from sklearn_haptic import make_haptic_pipeline
    >>> from sklearn_haptic.utils._folds import groups_for
    >>> groups_for(LogisticRegression(), ["cork", "foam"])
    {}
    >>> groups_for(make_haptic_pipeline(), ["cork", "foam"])
    {'model__groups': ['cork', 'foam']}
    """
    if groups is None:
        return {}
    if isinstance(estimator, BaseSearchCV):
        _warn_of_divided_objects(estimator, groups)
    if get_config()["enable_metadata_routing"]:
        asked = _requested(estimator, "fit", groups)
        if isinstance(estimator, Pipeline):  # which names what its model may want
            asked = asked or _requested(estimator[-1], "fit", groups)
        return asked
    if isinstance(estimator, Pipeline):
        name, last = estimator.steps[-1]
        params = groups_for(last, groups)
        return {f"{name}__{param}": value for param, value in params.items()}
    if isinstance(estimator, BaseSearchCV):
        params = groups_for(estimator.estimator, groups)
        params.pop("groups", None)
        splitter = check_cv(estimator.cv)
        return params | _requested(splitter, "split", groups)
    return _requested(estimator, "fit", groups)


def _warn_of_divided_objects(search, groups):
    """Warn of a search whose folds divide the trials of an object."""
    cv = search.cv
    by_trial = cv is None or isinstance(cv, Integral) or hasattr(cv, "split")
    if not by_trial or _requested(check_cv(cv), "split", groups):
        return
    if number_objects(groups, len(groups)).max() + 1 < len(groups):
        warnings.warn(
            f"{type(search).__name__} has cv={cv!r}, which splits by trial, so that it "
            "chooses settings by trials of objects that it learned from; give it "
            "cv=GroupKFold().",
            UserWarning,
            stacklevel=5,
        )


def _requested(consumer, method, groups):
    by_name = method == "fit" and not get_config()["enable_metadata_routing"]
    if by_name and not has_fit_parameter(consumer, "groups"):
        return {}  # which it could not hand on; RidgeCV cannot even be asked
    try:
        routing = get_routing_for_object(consumer)
    except NotImplementedError:  # by AdaBoost, which takes no metadata
        return {}
    if routing.consumes(method, ["groups"]) or (
        isinstance(routing, MetadataRequest)  # where None is a parameter of no request
        and getattr(routing, method).requests.get("groups", False) is None
    ):
        return {"groups": groups}
    return {}


def validation_split(n_trials, groups, fraction, random_state):
    """Divide trials into training and validation trials; return the indices of both.

    If the object of each trial is given as `groups`, objects stay whole. `fraction` is
    the share of the objects, or of the trials, that validates, at least one. If nothing
    would be left to train on, a ValueError says so.
    """
    units = "trial" if groups is None else "object"
    groups = number_objects(groups, n_trials)
    n_units = len(np.unique(groups))
    if np.ceil(fraction * n_units) >= n_units:
        raise ValueError(
            f"Early stopping holds out {fraction:.3g} of the {units}s, at least one, "
            f"but there {'is' if n_units == 1 else 'are'} {n_units}, which leaves none "
            f"to train on; give more {units}s, a smaller validation_fraction, or set "
            "early_stopping=False."
        )
    splitter = GroupShuffleSplit(1, test_size=fraction, random_state=random_state)
    return next(splitter.split(np.empty(n_trials), groups=groups))
