"""What scores have in common: their arguments, their type, the mean over trials."""

from collections.abc import Callable
from typing import Any, Literal, Protocol, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..utils._sklearn import StrOptions, validate_params
from ..utils._validation import check_weights

CONSTRAINTS = {
    "y_true": ["array-like"],
    "y_proba": ["array-like"],
    "sample_weight": ["array-like", None],
    "levels": ["array-like", None],
}


UNITS = [StrOptions({"levels", "scale"})]


class Score(Protocol):
    """Type of a score: a float, or an array with ``average=False``."""

    @overload
    def __call__(
        self,
        y_true: ArrayLike,
        y_proba: ArrayLike,
        *,
        sample_weight: ArrayLike | None = ...,
        average: Literal[True] = ...,
        levels: ArrayLike | None = ...,
        **options: Any,
    ) -> float: ...

    @overload
    def __call__(
        self,
        y_true: ArrayLike,
        y_proba: ArrayLike,
        *,
        sample_weight: ArrayLike | None = ...,
        average: Literal[False],
        levels: ArrayLike | None = ...,
        **options: Any,
    ) -> NDArray[np.float64]: ...


def as_score(**constraints: list[Any]) -> Callable[[Callable[..., Any]], Score]:
    """Decorate a score: validate its parameters, and state its type once for all."""
    decorate: Any = validate_params(
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
