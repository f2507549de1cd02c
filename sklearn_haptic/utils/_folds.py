"""Folds of trials, by whole objects where these are known, and what they are given."""

from numbers import Integral

import numpy as np
from sklearn import get_config
from sklearn.base import is_classifier
from sklearn.model_selection import GroupKFold, GroupShuffleSplit, check_cv
from sklearn.pipeline import Pipeline
from sklearn.utils.metadata_routing import (
    MetadataRouter,
    MethodMapping,
    get_routing_for_object,
    process_routing,
)


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
    GroupKFold(n_splits=2, random_state=None, shuffle=False)
    >>> make_splitter(LogisticRegression(), y, None, 2)
    StratifiedKFold(n_splits=2, random_state=None, shuffle=False)
    """
    if groups is not None and (cv is None or isinstance(cv, Integral)):
        return GroupKFold(5 if cv is None else cv)
    return check_cv(cv, y, classifier=is_classifier(estimator))


def check_folds_know(y, folds):
    """Refuse labels without an order of which no fold trains on any that it tests.

    Examples
    --------
    >>> from sklearn_haptic.utils._folds import check_folds_know
    >>> check_folds_know(["cork", "cork", "foam"], [([0, 2], [1]), ([1], [0, 2])])
    """
    y = np.asarray(y)
    if not any(np.isin(y[test], y[train]).any() for train, test in folds):
        raise ValueError(
            "No fold trains on a class that it tests; give several touches of each "
            "class, and groups that divide each class, such as runs."
        )


def route(estimator, splitter, groups, params):
    """Return the arguments of the splitter's ``split`` and of the estimator's ``fit``.

    Groups are for the splitter and `params`, a dict, for ``fit``; with metadata
    routing, both are for whichever requests them.

    Examples
    --------
    >>> from sklearn.model_selection import GroupKFold
    >>> from sklearn_haptic import NNPOM
    >>> from sklearn_haptic.utils._folds import route
    >>> route(NNPOM(), GroupKFold(2), ["cork", "foam"], {})
    ({'groups': ['cork', 'foam']}, {})
    """
    if not get_config()["enable_metadata_routing"]:
        return {"groups": groups}, params
    if groups is not None:
        params = {**params, "groups": groups}
    router = MetadataRouter(owner="cross-validation")
    for name, each, callee in [
        ("splitter", splitter, "split"),
        ("estimator", estimator, "fit"),
    ]:
        mapping = MethodMapping().add(caller="fit", callee=callee)
        router.add(method_mapping=mapping, **{name: each})
    routed = process_routing(router, "fit", **params)
    return routed.splitter.split, routed.estimator.fit


def groups_for(estimator, groups):
    """Return the arguments that tell an estimator's ``fit`` the groups it requests.

    Examples
    --------
    >>> from sklearn_haptic import NNPOM, make_haptic_pipeline
    >>> from sklearn_haptic.utils._folds import groups_for
    >>> groups_for(NNPOM(), ["cork", "foam"])
    {}
    >>> groups_for(make_haptic_pipeline(preset="accurate"), ["cork", "foam"])
    {'model__groups': ['cork', 'foam']}
    """
    if isinstance(estimator, Pipeline) and not get_config()["enable_metadata_routing"]:
        name, last = estimator.steps[-1]
        params = groups_for(last, groups)
        return {f"{name}__{param}": value for param, value in params.items()}
    try:
        routing = get_routing_for_object(estimator)
    except NotImplementedError:  # by AdaBoost, which takes no metadata
        return {}
    return dict.fromkeys(routing.consumes("fit", ["groups"]), groups)


def validation_split(n_trials, groups, fraction, random_state):
    """Divide trials into training and validation trials; return the indices of both.

    If the object of each trial is given as `groups`, objects stay whole. `fraction` is
    the share of the objects, or of the trials, that validates, at least one. If nothing
    would be left to train on, a ValueError says so.
    """
    units = "trial" if groups is None else "object"
    n_units = n_trials if groups is None else len(np.unique(groups))
    if np.ceil(fraction * n_units) >= n_units:
        raise ValueError(
            f"Early stopping holds out {fraction:.3g} of the {units}s, at least one, "
            f"but there {'is' if n_units == 1 else 'are'} {n_units}, which leaves none "
            f"to train on; give more {units}s, a smaller validation_fraction, or set "
            "early_stopping=False."
        )
    groups = np.arange(n_trials) if groups is None else groups
    splitter = GroupShuffleSplit(1, test_size=fraction, random_state=random_state)
    return next(splitter.split(np.empty(n_trials), groups=groups))
