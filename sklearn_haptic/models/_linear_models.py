"""Many linear models of ratings, fitted to the same trials at once."""

import numpy as np
from sklearn.base import clone
from sklearn.utils import check_random_state

from ._distributional import DistributionalOrdinalRegressor
from ._nnpom import NNPOM, fit_linear_networks
from ._quantile_positions import is_smooth


def fit_linear_models(models, X, counts, sample_weights, levels, names=None):
    """Fit linear models of ratings to the same trials, all at once.

    Penalties, training trials (by weights of 0) and ratings may differ. The models
    share the products with the features, so that many fits take little more time than
    few; each is the same as if it had been fitted alone.

    Parameters
    ----------
    models : list of DistributionalOrdinalRegressor
        Models of which `is_linear` holds.
    X : ndarray of shape (n_trials, n_features)
        Validated features, float32 or float64.
    counts : ndarray broadcastable to (n_models, n_trials, n_levels)
        Validated counts of each model's ratings.
    sample_weights : ndarray broadcastable to (n_models, n_trials)
        Weight of each trial in each model.
    levels : ndarray of shape (n_levels,)
        The ordered levels.
    names : ndarray of shape (n_features,), default=None
        Names of the features, if they have any.

    Returns
    -------
    fitted : list of DistributionalOrdinalRegressor
        Fitted clones.
    """
    models = [clone(model) for model in models]
    for model in models:
        model._validate_params()
    counts = np.broadcast_to(counts, (len(models), len(X), len(levels)))
    sample_weights = np.broadcast_to(sample_weights, (len(models), len(X)))
    observations = []
    for model, rated, weight in zip(models, counts, sample_weights):
        rng = check_random_state(model.random_state)
        model.levels_ = model.classes_ = levels
        model.n_features_in_ = X.shape[1]
        model.estimator_ = model._make_estimator(rng)
        model.estimator_._validate_params()
        model.estimator_.n_features_in_ = X.shape[1] + 1
        if names is not None:
            model.feature_names_in_ = names
            model.estimator_.feature_names_in_ = np.append(names, "position")
        model._p_transform, model._smooth = model.p_transform, True
        observations.append(model._observe(rated, weight, rng))
        level, weight = observations[-1][1:]
        model._present = np.unique(level[weight > 0])
    networks = [model.estimator_ for model in models]
    fit_linear_networks(networks, X, observations, levels)
    for model, weight in zip(models, sample_weights):
        some = np.flatnonzero(weight)
        model._smooth = is_smooth(model._predict_at, X, among=some)
    return models


def is_linear(model):
    """Return whether `fit_linear_models` can fit a model."""
    return type(model) is DistributionalOrdinalRegressor and (
        model.estimator is None
        or (
            type(model.estimator) is NNPOM
            and model.estimator.n_hidden == 0
            and model.estimator.levels is None
        )
    )
