"""Centre, scale and rotate features so that a cost curves evenly, and back."""

from dataclasses import replace

import numpy as np
from scipy import linalg

# Second derivative of -log P in the latent response, where ratings are uncertain.
_TYPICAL_CURVATURE = 0.2

# Features whose products are smaller, relative to the largest, are principal axes.
_AXES_TOLERANCE = 1e-10


def feature_means(X, weight):
    """Return the weighted means over trials; of a constant feature, the constant."""
    return X[0] + weight / weight.sum() @ (X - X[0])


def total_spread(X, weight):
    """Return the square root of the features' total variance over weighted trials."""
    unit = magnitude(X)
    X = X / unit
    X -= feature_means(X, weight)
    return unit * np.sqrt(weight @ np.einsum("ij,ij->i", X, X) / weight.sum())


def magnitude(X):
    """Return the power of two by which to divide X so that its squares stay in range.

    Dividing by a power of two changes no digit.
    """
    largest = np.float64(max(X.max(initial=0), -X.min(initial=0)))
    if 0 < largest < np.finfo(X.dtype).tiny:
        raise ValueError(
            f"X varies by no more than {largest:.0e}, so that weights would overflow; "
            "give its features in a smaller unit."
        )
    return np.ldexp(1.0, np.frexp(largest)[1] - 1)


def rounding_along(axes, offset, n_trials):
    """Return how far features extend along axes by rounding alone.

    `offset` is how large each feature was before it was centred. One that is constant
    is exactly 0 then, however large it was, so give 0 for it.
    """
    each = np.sqrt(np.square(axes).T @ np.square(offset))
    return 10 * np.finfo(float).eps * np.sqrt(n_trials) * each


class EvenedFeatures:
    """Features in a basis of weights in which the cost curves about evenly.

    The axes are orthonormal and near the principal directions of the features, as
    many as the trials span. Each is then scaled by the curvature that the data and
    the penalty give it. With more features than trials nothing is lost, since the
    penalty drives weights outside the span to zero. Directions along which the
    features extend less than max(n_trials, n_features) rounding errors (2.2e-16)
    times their largest extent, or no more than `rounding_along` them, cannot be told
    from rounding, and get no weight.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
    alpha : float
        Penalty of the weights.
    trial_weight : float or ndarray of shape (n_trials,)
        Weight of each trial; 2 gives the same basis as the trial given twice.
    offset : ndarray of shape (n_features,), default=None
        As of :func:`rounding_along`; by default 0.

    Attributes
    ----------
    inputs : ndarray of shape (n_trials, rank)
        The features in the new basis.
    alpha : ndarray of shape (rank,)
        Penalty of the weights of each input.
    """

    def __init__(self, X, alpha, trial_weight, offset=None):
        trial_weight = np.broadcast_to(trial_weight, len(X))
        mean_weight = trial_weight.mean()
        # Equal weights are exactly 1 then, whatever the rounding of their sums.
        root_weight = np.sqrt(np.round(trial_weight / mean_weight, 12))[:, None]
        unit = magnitude(X)
        X = X / unit
        offset = np.zeros(X.shape[1]) if offset is None else offset / unit
        span = None  # orthonormal basis of the span of the trials
        if X.shape[1] > X.shape[0]:
            span, triangle = linalg.qr(X.T, mode="economic", check_finite=False)
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
        self._axes = axes if span is None else span @ axes
        kept &= length > rounding_along(self._axes, offset, len(X))
        root_alpha = np.sqrt(alpha) / unit
        stiffness = root_alpha / np.sqrt(_TYPICAL_CURVATURE * mean_weight)
        scale = np.hypot(length[kept], stiffness) / np.sqrt(len(X))
        self.inputs = X[:, kept] / scale
        self.alpha = (root_alpha / scale) ** 2
        self._axes, self._scale = self._axes[:, kept], scale * unit

    def to_features(self, weights):
        """Return weights of the features from weights of the inputs."""
        return self._axes @ (weights.T / self._scale).T

    def to_inputs(self, weights):
        """Return weights of the inputs from weights of the features, in their span."""
        return ((self._axes.T @ weights).T * self._scale).T


class Conditioning:
    """Features made easy for a solver, and the way back to the user's units.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
    layout : Layout
        The parameters of a network of these features.
    alpha : float
        Penalty of all weights, those of scaled features if `scale` is true.
    trial_weight : ndarray of shape (n_trials,)
    scale : bool
        Centre the features and divide all by the square root of their total variance.
    rotate : bool
        Take the features to the axes of `EvenedFeatures`.

    Attributes
    ----------
    inputs : ndarray of shape (n_trials, n_inputs)
        What the solver sees in place of the features.
    layout : Layout
        The parameters of a network of these inputs.
    alpha : ndarray of shape (n_inputs + 1,)
        Penalty of each input's weights and, last, of the output weights.
    """

    def __init__(self, X, layout, alpha, trial_weight, scale, rotate):
        # The same sums in any memory layout.
        X = np.ascontiguousarray(X, dtype=np.float64)
        self._features_layout, self._n_features = layout, X.shape[1]
        self._centre, self._spread, self._axes = np.zeros(X.shape[1]), 1.0, None
        if scale:
            self._centre = feature_means(X, trial_weight)
            X = X - self._centre
            self._spread = total_spread(X, trial_weight) or 1.0
            X = X / self._spread
        input_alpha = np.full(X.shape[1], alpha)
        if rotate:
            offset = np.where(X.any(axis=0), self._centre / self._spread, 0)
            self._axes = EvenedFeatures(X, alpha, trial_weight, offset)
            X, input_alpha = self._axes.inputs, self._axes.alpha
        self.inputs = X
        has_position = layout.n_inputs - self._n_features  # 0 or 1
        self.alpha = np.append(input_alpha, np.full(has_position + 1, alpha))
        self.layout = replace(layout, n_inputs=X.shape[1] + has_position)

    def apply(self, params):
        """Return start values for the inputs from start values for scaled features."""
        if self._axes is None:
            return params
        coef, bias, heads = self._features_layout.split(params)
        of_features, of_position = np.split(coef, [self._n_features])
        coef = np.concatenate((self._axes.to_inputs(of_features), of_position))
        return self.layout.join(coef, bias, heads)

    def invert(self, params):
        """Return the parameters for features in the user's units."""
        coef, bias, heads = self.layout.split(params)
        of_inputs, of_position = np.split(coef, [self.inputs.shape[1]])
        if self._axes is not None:
            of_inputs = self._axes.to_features(of_inputs)
        of_features = of_inputs / self._spread
        at_centre = self._centre @ of_features
        coef = np.concatenate((of_features, of_position))
        return self._features_layout.join(coef, bias - at_centre, heads)
