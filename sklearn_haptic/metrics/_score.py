"""What scores have in common: their arguments, and the mean over trials."""

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any, TypeVar, cast

import numpy as np

from ..utils._sklearn import StrOptions, validate_params
from ..utils._validation import check_order, check_weights

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
            for name, rows in given.items():
                check_order(given["y_true"], rows, name, "y_true")
            return score(*args, **kwargs)

        return cast(F, validate(in_order))

    all_known = {**_SHARED, **constraints}
    return decorate


def summarise(scores, sample_weight, average):
    """Return one score per trial, or their weighted mean."""
    return float(weighted_mean(scores, sample_weight)) if average else scores


def weighted_mean(values, sample_weight):
    """Return the weighted mean over trials, leaving out those of weight 0."""
    weight = check_weights(sample_weight, values)
    used = weight > 0
    return np.average(values[used], axis=0, weights=weight[used])
