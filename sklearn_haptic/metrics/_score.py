"""What scores have in common: their arguments, and the mean over trials."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from ..utils._sklearn import StrOptions, validate_params
from ..utils._validation import check_weights

CONSTRAINTS = {
    "y_true": ["array-like"],
    "y_proba": ["array-like"],
    "sample_weight": ["array-like", None],
    "levels": ["array-like", None],
}


UNITS = [StrOptions({"levels", "scale"})]

F = TypeVar("F", bound=Callable[..., Any])


def as_score(**constraints: list[Any]) -> Callable[[F], F]:
    """Decorate a score: validate its parameters, and keep its type."""
    decorate: Callable[[F], F] = validate_params(
        {**CONSTRAINTS, "average": ["boolean"], **constraints},
        prefer_skip_nested_validation=True,
    )
    return decorate


def summarise(scores, sample_weight, average):
    """Return one score per trial, or their weighted mean."""
    return float(weighted_mean(scores, sample_weight)) if average else scores


def weighted_mean(values, sample_weight):
    """Return the weighted mean over trials, leaving out those of weight 0."""
    weight = check_weights(sample_weight, values)
    used = weight > 0
    return np.average(values[used], axis=0, weights=weight[used])
