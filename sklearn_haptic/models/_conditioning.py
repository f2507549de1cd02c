"""Centre, scale and rotate features so that a cost curves evenly, and back."""

import numpy as np
from scipy import linalg

from ._network import unpack

# Second derivative of -log P in the latent response, where ratings are uncertain.
_TYPICAL_CURVATURE = 0.2


# Features whose products are smaller, relative to the largest, are principal axes.
_AXES_TOLERANCE = 1e-10


def feature_means(X, weight):
    """Means over trials of given weights; of constant features exactly the constant."""
    return X[0] + weight / weight.sum() @ (X - X[0])


def total_spread(X, weight):
    """Square root of the features' total variance, over trials of given weights."""
    unit = _magnitude(X)
    X = X / unit
    X -= feature_means(X, weight)
    return unit * np.sqrt(weight @ np.einsum("ij,ij->i", X, X) / weight.sum())


def _magnitude(X):
    """Power of two that brings X, and squares of it, into range; changes no digit."""
    largest = np.abs(X).max(initial=0)
    if 0 < largest < np.finfo(np.float64).tiny:
        raise ValueError(
            f"X varies by no more than {largest:.0e}, so that weights would overflow; "
            "give its features in a smaller unit."
        )
    return np.ldexp(1.0, np.frexp(largest)[1] - 1)


class EvenedFeatures:
    """Features in a basis of weights in which the cost curves about evenly.

    The axes are orthonormal, near the principal directions of the features, as
    many as the trials span, each then scaled by the curvature that data and penalty
    give it. With more features than trials nothing is lost, since the penalty
    drives weights outside that span to zero. Directions along which the features
    reach less than max(n_trials, n_features) rounding errors (2.2e-16) of what they
    reach along the longest are not told from rounding, and get no weight.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
    alpha : float
        Penalty of the weights.
    trial_weight : float or ndarray of shape (n_trials,)
        Weight of each trial. A weight of 2 gives the basis of the trial given twice.

    Attributes
    ----------
    inputs : ndarray of shape (n_trials, rank)
        The features in the new basis.
    alpha : ndarray of shape (rank,)
        Penalty of the weights of each input.
    """

    def __init__(self, X, alpha, trial_weight):
        trial_weight = np.broadcast_to(trial_weight, len(X))
        mean_weight = trial_weight.mean()
        # Equal weights are exactly 1 then, whatever the rounding of their sums.
        root_weight = np.sqrt(np.round(trial_weight / mean_weight, 12))[:, None]
        unit = _magnitude(X)
        X = X / unit
        self._span = None  # orthonormal basis of the span of the trials
        if X.shape[1] > X.shape[0]:
            self._span, triangle = linalg.qr(X.T, mode="economic", check_finite=False)
            X = triangle.T
        weighted = root_weight * X
        gram = weighted.T @ weighted
        axes = np.eye(len(gram))
        off_diagonal = np.abs(gram - np.diag(np.diagonal(gram)))
        if off_diagonal.max(initial=0) > _AXES_TOLERANCE * gram.max(initial=0):
            _, axes = linalg.eigh(gram, driver="evd", check_finite=False)
        X = X @ axes
        weighted = root_weight * X
        length = np.sqrt(np.einsum("ij,ij->j", weighted, weighted))
        kept = length > length.max(initial=0) * max(X.shape) * np.finfo(float).eps
        root_alpha = np.sqrt(alpha) / unit
        stiffness = root_alpha / np.sqrt(_TYPICAL_CURVATURE * mean_weight)
        scale = np.hypot(length[kept], stiffness) / np.sqrt(len(X))
        self.inputs = X[:, kept] / scale
        self.alpha = (root_alpha / scale) ** 2
        self._axes, self._scale = axes[:, kept], scale * unit

    def to_features(self, weights):
        """Turn weights of the inputs into weights of the features."""
        weights = self._axes @ (weights.T / self._scale).T
        return weights if self._span is None else self._span @ weights

    def to_inputs(self, weights):
        """Turn weights of the features, within the span, into those of the inputs."""
        if self._span is not None:
            weights = self._span.T @ weights
        return ((self._axes.T @ weights).T * self._scale).T


def change_weights(params, change, n_features, n_hidden, n_inputs):
    """Apply a function to the weights of the features, not to the position's."""
    coef = unpack(params, n_inputs, n_hidden)[0]
    changed = np.concatenate((change(coef[:n_features]), coef[n_features:]))
    return np.concatenate((changed.ravel(), params[coef.size :]))
