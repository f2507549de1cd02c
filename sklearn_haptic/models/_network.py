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

from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.special import expit, log_expit

# Odds beyond its exponential, and their reciprocals, are not normal numbers.
_LARGEST_EXPONENT = 709.0


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
    latent : ndarray of shape (n_observations,)
        The latent response f.
    level : ndarray of int of shape (n_observations,)
        The index of the level of each observation, 0 … n_levels - 1.
    weight : ndarray of shape (n_observations,)
        The non-negative weight of each observation.
    first : float
        The first threshold.
    gap_logits : ndarray of shape (n_levels - 2,)
        The gaps between thresholds before the softplus.

    Returns
    -------
    loss : float
        The weighted sum of -log P.
    grad_latent : ndarray of shape (n_observations,)
    grad_first : float
    grad_gap_logits : ndarray of shape (n_levels - 2,)
    """
    n_levels = len(gap_logits) + 2
    padded = np.concatenate(([-np.inf], thresholds_from(first, gap_logits), [np.inf]))
    above = latent - padded[1:][level]  # how far f lies above the upper threshold
    below = padded[level] - latent
    inner = np.bincount(level, weight, minlength=n_levels)[1:-1]
    loss = weight @ (softplus(above) + softplus(below))
    loss += inner @ softplus(-gap_logits)

    push_up = weight * expit(above)  # of the upper threshold, and of f downwards
    push_down = weight * expit(below)
    grad_thresholds = (
        np.bincount(level, push_down, minlength=n_levels)[1:]
        - np.bincount(level, push_up, minlength=n_levels)[:-1]
    )
    later = np.cumsum(grad_thresholds[::-1])[::-1]  # of this threshold and all above
    grad_gaps = later[1:] * expit(gap_logits) - inner * expit(-gap_logits)
    return loss, push_up - push_down, later[0], grad_gaps


def level_probabilities(latent, thresholds):
    """Return P(level) as products of positive factors, on a new last axis.

    Against arithmetic of 60 digits each is off by less than a rounding error (2.2e-16)
    times the largest of 1, the latent response and the thresholds in size; they sum to
    1 within 4 rounding errors. Those below 1e-300 may come out as 0.
    """
    # Levels come first until the end, so that every operation is contiguous.
    shape = (-1,) + (1,) * np.ndim(latent)
    odds = np.exp(np.minimum(latent - thresholds.reshape(shape), _LARGEST_EXPONENT))
    at_or_below = 1 / (1 + odds)
    proba = np.ones((len(thresholds) + 1, *np.shape(latent)))
    proba[:-1] = at_or_below
    proba[1:] *= odds * at_or_below
    proba[1:-1] *= -np.expm1(-np.diff(thresholds)).reshape(shape)
    proba /= proba.sum(axis=0)
    return np.moveaxis(proba, 0, -1)


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
    n_weights = n_inputs * max(n_hidden, 1)
    coef, bias, output = params[:n_weights], params[:0], params[:0]
    if n_hidden:
        coef = coef.reshape(n_inputs, n_hidden)
        bias = params[n_weights : n_weights + n_hidden]
        output = params[n_weights + n_hidden : n_weights + 2 * n_hidden]
    n_weights += 2 * n_hidden
    return (
        coef,
        bias,
        output,
        params[n_weights : n_weights + 1],
        params[n_weights + 1 :],
    )


def split_heads(params, n_inputs, n_hidden, n_levels):
    """View the parts of the parameters of a network that adjectives share.

    Parameters
    ----------
    params : ndarray
        Weights and biases of the hidden units, then the output weights and thresholds
        of each adjective; with one adjective, what `unpack` takes.
    n_inputs, n_hidden : int
    n_levels : sequence of int
        Number of levels of each adjective.

    Returns
    -------
    coef, bias : ndarray
        As `unpack` returns them.
    heads : list of (output, first, gap_logits)
        Of each adjective, as `unpack` returns them.
    """
    coef, bias, *_ = unpack(params, n_inputs, n_hidden)
    heads, start = [], coef.size + bias.size
    for n in n_levels:
        edges = np.cumsum((start, n_hidden, 1, n - 2))
        heads.append(tuple(params[i:j] for i, j in pairwise(edges)))
        start = edges[-1]
    return coef, bias, heads


def linear_response(X, coef):
    """Return X @ coef; where it overflows, infinite with the sign of the exact sum.

    Terms that overflow one by one may cancel, and kernels with a fused multiply-add
    then leave an infinity of either sign, depending on the order of their sums.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        response = X @ coef
        finite = np.isfinite(response)
        if finite.all():
            return response
        of_row = np.frexp(np.abs(X).max(axis=-1))[1]
        of_column = np.frexp(np.abs(coef).max(axis=0))[1]
        scaled = np.ldexp(X, -of_row[..., None]) @ np.ldexp(coef, -of_column)
        exact = np.ldexp(scaled, np.add.outer(of_row, of_column))
    return np.where(finite, response, exact)


def forward(X, positions, coef, bias, output):
    """Latent response and hidden activations of every trial at every position.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
        Or of shape (n_trials, n_positions, n_features), where the observations of a
        trial do not share their features.
    positions : ndarray broadcastable to (n_trials, n_positions), or None
        The extra input that the observations of a trial do not share.
    coef, bias, output : ndarray
        As `unpack` returns them; `output` of shape (n_hidden, n_adjectives) of a
        network that adjectives share.

    Returns
    -------
    latent : ndarray of shape (n_trials, n_positions), or with n_adjectives behind
    hidden : ndarray of shape (n_trials, n_positions, n_hidden), or None
    """
    shared = linear_response(X, coef[: X.shape[-1]])
    if X.ndim == 2:
        shared = shared[:, None]
    if len(output) == 0:
        return (shared if positions is None else shared + positions * coef[-1]), None
    shared = shared + bias
    if positions is None:
        hidden = expit(shared)
    else:
        hidden = sigmoid_of_sums(shared, positions[:, :, None] * coef[-1])
    return hidden @ output, hidden


def sigmoid_of_sums(a, b, spread_a=np.asarray, spread_b=np.asarray, out=None):
    """Return sigma(a + b) from as many exponentials as a and b have entries.

    Parameters
    ----------
    a, b : ndarray
        Summands; overwritten.
    spread_a, spread_b : callable
        Take `a` and `b`, or arrays like them, to shapes that broadcast.
    out : ndarray, default=None
        Where to put the result.
    """
    largest = max(extreme for x in (a, b) for extreme in (-x.min(), x.max()))
    if largest > _LARGEST_EXPONENT / 2:  # a product of exponentials may overflow
        return expit(np.add(spread_a(a), spread_b(b), out=out), out=out)
    for x in (a, b):
        np.exp(np.negative(x, out=x), out=x)
    odds = np.multiply(spread_a(a), spread_b(b), out=out)
    odds += 1
    return np.divide(1, odds, out=odds)


class NetworkLoss:
    """Penalised mean negative log-likelihood of the network, and its gradient.

    With W the sum of the weights, the cost is ``(NLL + alpha / 2 * |weights|²) /
    W``; hidden biases and thresholds are not penalised. A weight of 2 therefore
    equals the same row given twice. Observations of weight zero cost nothing.

    Against arithmetic of hundreds of digits, for parameters up to 250 in size, which
    saturate most units, the cost was off by less than 1e-15 of its size, the gradient
    by less than 1e-14 of its largest component, or of 1 if that is smaller.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
    positions : ndarray of shape (n_trials, n_observations), or None
        The extra input that the observations of a trial do not share.
    level : ndarray of int, broadcastable to (n_trials, n_observations)
        The index of the level of each observation.
    weight : ndarray of shape (n_trials, n_observations)
        The non-negative weight of each observation.
    n_hidden : int
    alpha : float or ndarray of shape (n_inputs + 1,)
        Penalty, the same for all or that of each input's weights and, last, of
        the output weights.
    """

    def __init__(self, X, positions, level, weight, n_hidden, alpha):
        self.X, self.n_hidden = X, n_hidden
        self.n_inputs = X.shape[1] + (positions is not None)
        alpha = np.broadcast_to(alpha, self.n_inputs + 1)
        self.input_alpha, self.output_alpha = alpha[:-1], alpha[-1]
        # Observations lie one after the other, trial by trial.
        used = weight > 0
        self.trial = np.nonzero(used)[0]
        self.positions = None if positions is None else positions[used]
        self.level = np.broadcast_to(level, weight.shape)[used]
        self.weight = weight[used]
        self.total = self.weight.sum()
        each = np.arange(len(self.trial))
        ends = np.append(0, np.cumsum(used.sum(axis=1)))
        self.sum_by_trial = sparse.csr_array((np.ones(len(each)), each, ends))
        if positions is not None:  # trials of an object often share theirs
            self.distinct, self.which = np.unique(self.positions, return_inverse=True)
            self.moved = np.empty((len(self.distinct), n_hidden))
        # A hidden layer for each observation, or for each trial if they share it.
        n_rows = X.shape[0] if positions is None else len(each)
        self.buffers = np.empty((2, n_rows, n_hidden))

    def __call__(self, params):
        """Return the cost and its gradient at `params`, laid out as by `unpack`."""
        coef, bias, output, first, gap_logits = unpack(
            params, self.n_inputs, self.n_hidden
        )
        layer, work = self.buffers
        shared = self.X @ coef[: self.X.shape[1]]
        if self.n_hidden:
            layer = self._activate(shared + bias, coef)
            latent = layer @ output
        elif self.positions is None:
            latent = shared
        else:
            latent = shared[self.trial] + self.positions * coef[-1]

        loss, g_latent, g_first, g_gaps = ordinal_loss(
            latent[self.trial] if self.positions is None else latent,
            self.level,
            self.weight,
            first[0],
            gap_logits,
        )
        if self.positions is None:
            g_latent = self.sum_by_trial @ g_latent

        g_layer, g_output, g_bias = g_latent, output, bias
        if self.n_hidden:
            g_output = g_latent @ layer + self.output_alpha * output
            g_layer = np.subtract(1, layer, out=work)
            g_layer *= layer
            g_layer *= g_latent[:, None]
            g_layer *= output
        g_shared = g_layer if self.positions is None else self.sum_by_trial @ g_layer
        if self.n_hidden:
            g_bias = g_shared.sum(axis=0)
        g_coef = (self.input_alpha * coef.T).T
        loss += 0.5 * (np.vdot(g_coef, coef) + self.output_alpha * (output @ output))
        g_coef[: self.X.shape[1]] += self.X.T @ g_shared
        if self.positions is not None:
            g_coef[-1] += self.positions @ g_layer
        grad = np.concatenate((g_coef.ravel(), g_bias, g_output, [g_first], g_gaps))
        grad /= self.total
        return loss / self.total, grad

    def _activate(self, shared, coef):
        """Activations of the hidden units, in the first of the buffers."""
        layer, work = self.buffers
        if self.positions is None:
            return expit(shared, out=layer)

        def of_trials(values):
            return np.take(values, self.trial, axis=0, out=layer, mode="clip")

        def of_positions(values):
            return np.take(values, self.which, axis=0, out=work, mode="clip")

        np.multiply.outer(self.distinct, coef[-1], out=self.moved)
        return sigmoid_of_sums(shared, self.moved, of_trials, of_positions, out=layer)


class SharedLoss:
    """The cost of a network that several adjectives share, and its gradient.

    The adjectives share the hidden layer; each has output weights and thresholds of
    its own, and observations of its own of the same trials. With one adjective this is
    `NetworkLoss`. Behind the product of features and weights each adjective has a
    network whose inputs are the trials, one by one.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
    observations : list of (positions, level, weight)
        Of each adjective, as `NetworkLoss` takes them.
    n_hidden : int
        At least 1.
    alpha : float or ndarray of shape (n_inputs + 1,)
        As `NetworkLoss` takes it.
    """

    def __init__(self, X, observations, n_hidden, alpha):
        self.X, self.n_hidden = X, n_hidden
        self.n_levels = [level.max() + 1 for _, level, _ in observations]
        n_trials, n_features = X.shape
        n_positions = int(observations[0][0] is not None)
        alpha = np.broadcast_to(alpha, n_features + n_positions + 1)
        self.input_alpha = alpha[:-1]
        each_trial = sparse.eye_array(n_trials, format="csr")
        own_alpha = np.append(np.zeros(n_trials + n_positions), alpha[-1])
        self.networks = [
            NetworkLoss(each_trial, *observed, n_hidden, own_alpha)
            for observed in observations
        ]
        self.total = sum(network.total for network in self.networks)

    def __call__(self, params):
        """Return the cost and its gradient at `params`, as `split_heads` has them."""
        n_trials, n_features = self.X.shape
        coef, bias, heads = split_heads(
            params, len(self.input_alpha), self.n_hidden, self.n_levels
        )
        common = np.vstack((self.X @ coef[:n_features], coef[n_features:], bias))
        g_coef = (self.input_alpha * coef.T).T
        loss = 0.5 * np.vdot(g_coef, coef)
        g_common, g_heads = np.zeros_like(common), []
        for network, head in zip(self.networks, heads):
            mean, grad = network(np.concatenate((common.ravel(), *head)))
            loss += network.total * mean
            grad *= network.total
            g_common += grad[: common.size].reshape(common.shape)
            g_heads.append(grad[common.size :])
        g_coef[:n_features] += self.X.T @ g_common[:n_trials]
        g_coef[n_features:] += g_common[n_trials:-1]
        grad = np.concatenate((g_coef.ravel(), g_common[-1], *g_heads))
        return loss / self.total, grad / self.total


def initial_params(n_inputs, n_hidden, level_weights, random_state):
    """Start values: uniform in (-0.5, 0.5), as Gutiérrez et al. (2016) do.

    The linear model has one minimum, so it starts from zero weights and the
    thresholds of the ratings without features. `level_weights` has for each adjective
    the weight of each of its levels, all positive.
    """
    if n_hidden:
        n_own = sum(n_hidden + len(weight) - 1 for weight in level_weights)
        return random_state.uniform(-0.5, 0.5, (n_inputs + 1) * n_hidden + n_own)
    (weight,) = level_weights
    share = np.maximum(weight / np.sum(weight), np.finfo(np.float64).tiny)
    below = np.log(np.cumsum(share))  # of this level and all before
    above = np.log(np.cumsum(share[::-1])[::-1])
    first = below[:1] - above[1:2]
    # With q = p + share, exp(logit(q) - logit(p)) - 1 = share / (p (1 - q)).
    gap_logits = np.log(share[1:-1]) - below[:-2] - above[2:]
    return np.concatenate((np.zeros(n_inputs), first, gap_logits))


def monotone_bounds(n_params, n_inputs, n_hidden, n_levels):
    """Bounds that keep the position's and the output weights non-negative."""
    lower = np.full(n_params, -np.inf)
    coef, _, heads = split_heads(lower, n_inputs, n_hidden, n_levels)
    coef[-1:] = 0.0
    for output, _, _ in heads:
        output[:] = 0.0
    return np.stack((lower, np.full(n_params, np.inf)), axis=1)
