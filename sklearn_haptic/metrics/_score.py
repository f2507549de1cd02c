"""What scores have in common: their arguments, and the mean over trials."""

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any, TypeVar, cast

import numpy as np

from ..ratings._levels import are_counts, has_default_columns, names_levels
from ..utils._row_order import check_orders
from ..utils._sklearn import StrOptions, validate_params
from ..utils._validation import check_weights

_SHARED = {
    "y_true": ["array-like"],
    "y_proba": ["array-like"],
    "sample_weight": ["array-like", None],
    "average": ["boolean"],
    "levels": ["array-like", None],
    "units": [StrOptions({"levels", "scale"})],
}

F = TypeVar("F", bound=Callable[..., Any])


def as_score(**constraints: list[Any]) -> Callable[[F], F]:
    """Decorate a score: validate its parameters, those that scores share alike.

    What is given of the trials of ``y_true`` in another order is refused.
    """

    def decorate(score: F) -> F:
        arguments = signature(score)
        own = [name for name in arguments.parameters if name in all_known]
        validate = validate_params(
            {name: all_known[name] for name in own}, prefer_skip_nested_validation=True
        )

        @wraps(score)
        def in_order(*args, **kwargs):
            given = arguments.bind(*args, **kwargs).arguments
            check_orders(**given)
            check_scale(**given)
            return score(*args, **kwargs)

        return cast(F, validate(in_order))

    all_known = {**_SHARED, **constraints}
    return decorate


def check_scale(y_true, y_proba=None, levels=None, units="levels", **others):
    """Refuse a scale of counts that do not say what their levels are."""
    if units == "levels" or levels is not None or not are_counts(y_true, "y_true"):
        return
    tables = y_true, y_proba
    if not any(names_levels(t) and not has_default_columns(t) for t in tables):
        raise ValueError(
            "The columns of y_true do not say what the levels are, so their scale has "
            "no units; give levels=[...], lowest first."
        )


def summarise(scores, sample_weight, average):
    """Return one score per trial, or their weighted mean."""
    return float(weighted_mean(scores, sample_weight)) if average else scores


def weighted_mean(values, sample_weight):
    """Return the weighted mean over trials, leaving out those of weight 0."""
    weight = check_weights(sample_weight, values)
    used = weight > 0
    return np.average(values[used], axis=0, weights=weight[used])


def mean_over_objects(values, objects):
    """Return the mean of trials, its error over objects, and degrees of freedom.

    Trials count equally, so that objects count by their trials. The error and the
    degrees of freedom of Student's t are those of a mean of independent objects with
    these weights, as of Bell and McCaffrey (2002). Of a single object they are NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.metrics._score import mean_over_objects
    >>> mean_over_objects(np.array([1.0, 3.0, 2.0, 2.5]), ["a", "a", "b", "b"])
    (2.125, 0.125, 1.0)
    """
    ids, which = np.unique(objects, return_inverse=True)
    mean = float(values.mean())
    if len(ids) == 1:
        return mean, np.nan, np.nan
    weight = np.bincount(which) / len(values)
    deviation = np.bincount(which, values - mean) / len(values)
    error = np.sqrt((deviation**2 / (1 - weight)).sum())
    return mean, float(error), float(1 / (weight**2).sum() - 1)
