"""Frozen estimators, which are used as they were fitted.

A `FrozenEstimator` hands out every attribute of what it wraps. So ``hasattr`` finds
``fit_with_positions`` in it, and calling that would fit the wrapped estimator again, in
place. Therefore a frozen estimator is unwrapped, checked, and then only predicts.
"""

import numpy as np
from sklearn.frozen import FrozenEstimator
from sklearn.utils.validation import check_is_fitted


def unfrozen(estimator):
    """Return the estimator itself, without any `FrozenEstimator` around it."""
    while isinstance(estimator, FrozenEstimator):
        estimator = estimator.estimator
    return estimator


def check_frozen(estimator, name, n_inputs, levels=None, *, names=None, position=False):
    """Check that a frozen estimator was fitted to data like those given here.

    Parameters
    ----------
    estimator : FrozenEstimator
    name : str
        Its name in error messages.
    n_inputs : int
        Number of features that it will be given.
    levels : ndarray of shape (n_levels,), default=None
        The levels that it must predict; None if that does not matter.
    names : ndarray of shape (n_features,), default=None
        Names of the features, without the position.
    position : bool, default=False
        Whether the position in the population is the last feature.

    Raises
    ------
    NotFittedError, ValueError
        If it is not fitted, takes other features or predicts other levels.
    """
    estimator = unfrozen(estimator)
    check_is_fitted(estimator)
    n_features = getattr(estimator, "n_features_in_", n_inputs)
    if n_features != n_inputs:
        raise ValueError(
            f"{name} is frozen and has {n_features} inputs, but {n_inputs} are given "
            f"here{', the position among them' * position}; fit it to the same columns."
        )
    known = getattr(estimator, "feature_names_in_", names)
    if names is not None and list(known[: len(names)]) != list(names):
        raise ValueError(
            f"{name} is frozen and has the inputs {[*known]}, but the features here "
            f"are {[*names]}; give the same columns in the same order."
        )
    known = getattr(estimator, "classes_", levels)
    if levels is not None and not np.array_equal(known, levels):
        raise ValueError(
            f"{name} is frozen and predicts {np.asarray(known).tolist()}, but "
            f"{np.asarray(levels).tolist()} are required here; fit it to the same "
            "levels."
        )
