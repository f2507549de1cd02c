"""The proportional-odds network as pure functions: likelihood, gradient, start.

A rating falls at level k or below with probability ``sigma(b_k - f(x))``, where
the latent response ``f`` is a linear function of the features or of one hidden
layer of logistic units, and the thresholds ``b_1 < b_2 < …`` are shared by all
trials. Each threshold is the one before it plus ``softplus(s)``, so that

    log P(k) = log sigma(b_k - f) + log sigma(f - b_{k-1}) + log sigma(s_k),

with the one-sided term alone for the first and last level. Nothing is
subtracted and nothing is divided by a probability, so cost and gradient stay
exact where the probabilities themselves underflow.

A trial may stand for several observations that differ only in the *position* p
of the rater in the population: all arrays below have a row a trial and a column
an observation, and the features are multiplied with the weights once a trial.
"""

import numpy as np
from scipy import linalg
from scipy.special import expit, log_expit

# Second derivative of -log P in the latent response, where ratings are uncertain.
_TYPICAL_CURVATURE = 0.2


def softplus(x):
    """Return log(1 + exp(x)) without overflow."""
    return -log_expit(-x)


def thresholds_from(first, gap_logits):
    """Return the increasing thresholds ``first + cumsum(softplus(gap_logits))``."""
    return np.cumsum(np.concatenate(([first], softplus(gap_logits))))


def ordinal_loss(latent, level, weight, first, gap_logits):
    """Negative log-likelihood of the proportional-odds model, and its gradient.

    Parameters
    ----------
    latent : ndarray of shape (n_trials, n_observations) or (n_trials, 1)
        The latent response f; one column is shared by all observations.
    level : ndarray of int, broadcastable to (n_trials, n_observations)
        The index of the level of each observation, 0 … n_levels - 1.
    weight : ndarray of shape (n_trials, n_observations)
        The non-negative weight of each observation.
    first : float
        The first threshold.
    gap_logits : ndarray of shape (n_levels - 2,)
        The gaps between thresholds before the softplus.

    Returns
    -------
    loss : float
        The weighted sum of -log P.
    grad_latent : ndarray of the shape of ``latent``
    grad_first : float
    grad_gap_logits : ndarray of shape (n_levels - 2,)
    """
    n_levels = len(gap_logits) + 2
    padded = np.concatenate(([-np.inf], thresholds_from(first, gap_logits), [np.inf]))
    above = latent - padded[level + 1]  # how far f lies above the upper threshold
    below = padded[level] - latent
    flat_level = np.broadcast_to(level, weight.shape).ravel()
    level_weight = np.bincount(flat_level, weight.ravel(), minlength=n_levels)
    inner = level_weight[1:-1]
    loss = np.sum(weight * (softplus(above) + softplus(below)))
    loss += inner @ softplus(-gap_logits)

    push_up = weight * expit(above)  # of the upper threshold, and of f downwards
    push_down = weight * expit(below)
    grad_latent = push_up - push_down
    if latent.shape[1] == 1:
        grad_latent = grad_latent.sum(axis=1, keepdims=True)
    grad_thresholds = (
        np.bincount(flat_level, push_down.ravel(), minlength=n_levels)[1:]
        - np.bincount(flat_level, push_up.ravel(), minlength=n_levels)[:-1]
    )
    later = np.cumsum(grad_thresholds[::-1])[::-1]  # of this threshold and all above
    grad_gaps = later[1:] * expit(gap_logits) - inner * expit(-gap_logits)
    return loss, grad_latent, later[0], grad_gaps


def level_probabilities(latent, thresholds):
    """Return P(level) as products of positive factors, on a new last axis."""
    edge = np.asarray(latent)[..., None] - thresholds
    one = np.ones((*edge.shape[:-1], 1))
    at_or_below = np.concatenate((expit(-edge), one), axis=-1)
    at_or_above = np.concatenate((one, expit(edge)), axis=-1)
    inside = np.ones(len(thresholds) + 1)
    inside[1:-1] = -np.expm1(-np.diff(thresholds))
    proba = at_or_below * at_or_above * inside
    return proba / proba.sum(axis=-1, keepdims=True)


# Network --------------------------------------------------------------------


def unpack(params, n_inputs, n_hidden):
    """View the parts of the flat parameter vector, in their order.

    Returns
    -------
    coef : ndarray of shape (n_inputs, n_hidden), or (n_inputs,) without units
        Weights of the inputs; those of the position, if any, come last.
    bias : ndarray of shape (n_hidden,)
    output : ndarray of shape (n_hidden,)
    first : ndarray of shape (1,)
        The first threshold.
    gap_logits : ndarray of shape (n_levels - 2,)
    """
    if n_hidden == 0:
        coef, empty, rest = params[:n_inputs], params[:0], params[n_inputs:]
        return coef, empty, empty, rest[:1], rest[1:]
    ends = np.cumsum([n_inputs * n_hidden, n_hidden, n_hidden, 1])
    coef, bias, output, first, gap_logits = np.split(params, ends)
    return coef.reshape(n_inputs, n_hidden), bias, output, first, gap_logits


def forward(X, positions, coef, bias, output):
    """Latent response and hidden activations of every observation.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
    positions : ndarray broadcastable to (n_trials, n_observations), or None
        The extra input that the observations of a trial do not share.
    coef, bias, output : ndarray
        As `unpack` returns them.

    Returns
    -------
    latent : ndarray of shape (n_trials, n_observations)
    hidden : ndarray of shape (n_trials, n_observations, n_hidden), or None
    """
    shared = X @ coef[: X.shape[1]]
    if len(output) == 0:
        latent = shared[:, None]
        return (latent if positions is None else latent + positions * coef[-1]), None
    shared = (shared + bias)[:, None]
    if positions is not None:
        shared = shared + positions[:, :, None] * coef[-1]
    hidden = expit(shared)
    return hidden @ output, hidden


def network_loss(params, X, positions, level, weight, n_hidden, alpha):
    """Penalised mean negative log-likelihood of the network, and its gradient.

    With W the sum of the weights, the cost is ``(NLL + alpha / 2 * |weights|²) /
    W``; hidden biases and thresholds are not penalised. A weight of 2 therefore
    equals the same row given twice. `alpha` may be an array of shape (n_inputs +
    1,): the penalty of each input's weights, and of the output weights.
    """
    alpha = np.broadcast_to(alpha, X.shape[1] + (positions is not None) + 1)
    input_alpha, output_alpha = alpha[:-1], alpha[-1]
    n_inputs = X.shape[1] + (positions is not None)
    coef, bias, output, first, gap_logits = unpack(params, n_inputs, n_hidden)
    latent, hidden = forward(X, positions, coef, bias, output)
    loss, g_latent, g_first, g_gaps = ordinal_loss(
        latent, level, weight, first[0], gap_logits
    )
    if n_hidden == 0:
        g_coef = np.empty_like(coef)
        g_coef[: X.shape[1]] = X.T @ g_latent.sum(axis=1)
        if positions is not None:
            g_coef[-1] = np.sum(g_latent * positions)
        g_bias = g_output = bias
    else:
        g_output = np.einsum("to,toh->h", g_latent, hidden)
        g_hidden = g_latent[:, :, None] * (output * hidden * (1.0 - hidden))
        g_shared = g_hidden.sum(axis=1)
        g_coef = np.empty_like(coef)
        g_coef[: X.shape[1]] = X.T @ g_shared
        if positions is not None:
            g_coef[-1] = np.einsum("to,toh->h", positions, g_hidden)
        g_bias = g_shared.sum(axis=0)
    penalty = (input_alpha * coef.T).T
    g_coef = g_coef + penalty
    g_output = g_output + output_alpha * output
    loss += 0.5 * (np.sum(penalty * coef) + output_alpha * (output @ output))
    grad = np.concatenate((g_coef.ravel(), g_bias, g_output, [g_first], g_gaps))
    total = weight.sum()
    return loss / total, grad / total


def initial_params(n_inputs, n_hidden, level_weight, random_state):
    """Start values: uniform in (-0.5, 0.5), as Gutiérrez et al. (2016) do.

    The linear model has one minimum, so it starts from zero weights and the
    thresholds of the ratings without features.
    """
    n_gaps = len(level_weight) - 2
    if n_hidden:
        n_params = n_inputs * n_hidden + 2 * n_hidden + 1 + n_gaps
        return random_state.uniform(-0.5, 0.5, n_params)
    below = np.cumsum(level_weight)[:-1] / np.sum(level_weight)
    thresholds = np.log(below) - np.log1p(-below)
    gap_logits = np.log(np.expm1(np.diff(thresholds)))
    return np.concatenate((np.zeros(n_inputs), thresholds[:1], gap_logits))


def even_out(X, alpha, trial_weight):
    """Change the basis of the features so that the cost curves about evenly.

    The axes are the principal directions of ``X``, as many as its rows span,
    each scaled by the curvature that data and penalty give it. With more features
    than trials nothing is lost, since the penalty drives weights outside that
    span to zero.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
    alpha : float
        Penalty of the weights.
    trial_weight : float
        Mean weight of a trial.

    Returns
    -------
    inputs : ndarray of shape (n_trials, rank)
        ``X @ basis``.
    basis : ndarray of shape (n_features, rank)
        Turns weights of the inputs into weights of the features.
    inverse : ndarray of shape (rank, n_features)
        Turns weights of the features into weights of the inputs.
    alpha : ndarray of shape (rank,)
        Penalty of the weights of each input.
    """
    left, singular, axes = linalg.svd(X, full_matrices=False)
    rank = np.sum(singular > singular[:1] * max(X.shape) * np.finfo(X.dtype).eps)
    left, singular, axes = left[:, :rank], singular[:rank], axes[:rank]
    stiffness = alpha / (_TYPICAL_CURVATURE * trial_weight)
    scale = np.sqrt((singular**2 + stiffness) / len(X))
    return (
        left * (singular / scale),
        axes.T / scale,
        axes * scale[:, None],
        (alpha / scale**2),
    )


def change_basis(params, matrix, n_inputs, n_hidden):
    """Multiply the feature weights by a matrix; the position's stay as they are."""
    n_features = matrix.shape[1]
    coef = unpack(params, n_inputs, n_hidden)[0]
    changed = np.concatenate((matrix @ coef[:n_features], coef[n_features:]))
    return np.concatenate((changed.ravel(), params[coef.size :]))


def monotone_bounds(n_params, n_inputs, n_hidden):
    """Bounds that keep the position's and the output weights non-negative."""
    lower = np.full(n_params, -np.inf)
    coef, _, output, _, _ = unpack(lower, n_inputs, n_hidden)
    coef[-1:] = 0.0
    output[:] = 0.0
    return np.stack((lower, np.full(n_params, np.inf)), axis=1)
