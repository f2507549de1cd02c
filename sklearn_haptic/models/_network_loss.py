"""The cost of a network with a hidden layer, and its gradient."""

import numpy as np
from scipy import sparse

from ._network import Head, sigmoid, sigmoid_of_sums
from ._proportional_odds import ordinal_loss

# Entries of a hidden layer that are computed at once, so that they stay in the cache.
_BLOCK = 1 << 16


class _AdjectiveLoss:
    """Negative log-likelihood of the ratings of one adjective, and its gradient.

    Observations lie one after the other, trial by trial; those of weight zero are
    left out. Parameters as for `NetworkLoss`.

    Attributes
    ----------
    trials : slice
        From the first trial with an observation to the last; all else is about these.
    """

    def __init__(self, layout, positions, level, weight, buffers):
        self.gaps = layout.gaps
        observed = np.flatnonzero(weight.any(axis=1))
        self.trials = slice(observed[0], observed[-1] + 1)
        level, weight = level[self.trials], weight[self.trials]
        positions = None if positions is None else positions[self.trials]
        used = weight > 0
        self.trial = np.nonzero(used)[0]
        self.positions = None if positions is None else positions[used]
        self.level = level[used]
        self.weight = weight[used]
        each = np.arange(len(self.trial))
        ends = np.append(0, np.cumsum(used.sum(axis=1)))
        self.sum_by_trial = sparse.csr_array((np.ones(len(each)), each, ends))
        if positions is not None:  # trials of an object often share theirs
            self.distinct, self.which = np.unique(self.positions, return_inverse=True)
            if len(self.distinct) == len(self.positions):
                self.distinct = self.positions
            self.moved = np.empty((len(self.distinct), layout.n_hidden))
        # A hidden layer for each observation, or for each trial if they share it.
        n_rows = len(weight) if positions is None else len(each)
        self.buffers = buffers[:, :n_rows]

    def __call__(self, shared, position_coef, head):
        """Return the loss and its gradient.

        Parameters
        ----------
        shared : ndarray of shape (n_trials, n_hidden)
            What the features and biases contribute.
        position_coef : ndarray of shape (1, n_hidden)
            Weights of the position; empty if it is no input.
        head : Head

        Returns
        -------
        loss : float
        g_shared, g_position_coef, g_head
            Its derivatives.
        """
        layer = self._activate(shared, position_coef)
        latent = layer @ head.output
        if self.positions is None:
            latent = latent[self.trial]
        loss, g_latent, g_first, g_raw_gaps = ordinal_loss(
            latent, self.level, self.weight, head.first[0], head.raw_gaps, self.gaps
        )
        slope = np.subtract(1, layer, out=self.buffers[1])
        slope *= layer
        if self.positions is None:
            g_shared = np.bincount(self.trial, g_latent, len(shared))
            g_head = Head(g_shared @ layer, [g_first], g_raw_gaps)
            slope *= g_shared[:, None]
            return loss, slope * head.output, 0.0, g_head
        g_head = Head(g_latent @ layer, [g_first], g_raw_gaps)
        self.sum_by_trial.data[:] = g_latent  # each row times its derivative
        g_shared = (self.sum_by_trial @ slope) * head.output
        g_position_coef = (self.positions * g_latent) @ slope * head.output
        return loss, g_shared, g_position_coef, g_head

    def _activate(self, shared, position_coef):
        """Activations of the hidden units, in the first of the buffers."""
        layer, work = self.buffers
        if self.positions is None:
            return sigmoid(shared, out=layer)

        def of_trials(values):
            return np.take(values, self.trial, axis=0, out=layer, mode="clip")

        def of_positions(values):
            if len(values) == len(work):  # as they are, one for each observation
                return values
            return np.take(values, self.which, axis=0, out=work, mode="clip")

        moved = np.multiply(self.distinct[:, None], position_coef, out=self.moved)
        return sigmoid_of_sums(shared.copy(), moved, of_trials, of_positions, out=layer)


class NetworkLoss:
    """Penalised mean negative log-likelihood of a network, and its gradient.

    With W the sum of the weights, the cost is ``(NLL + alpha / 2 * |weights|²) /
    W``; hidden biases and thresholds are not penalised. A weight of 2 therefore
    equals the same row given twice. Observations of weight zero cost nothing.

    The cost is off by less than 1e-15 of its size, and the gradient by less than 1e-14
    of the larger of 1 and its largest component, against arithmetic of hundreds of
    digits and for parameters up to 250 in size, which saturate most units.

    Parameters
    ----------
    layout : Layout
    X : ndarray of shape (n_trials, n_features)
    observations : list of (positions, level, weight)
        Of each adjective:

        positions : ndarray of shape (n_trials, n_observations), or None
            The input that the observations of a trial do not share.
        level : ndarray of int, broadcastable to (n_trials, n_observations)
            The index of the level of each observation.
        weight : ndarray of shape (n_trials, n_observations)
            The non-negative weight of each observation.
    alpha : float or ndarray of shape (n_inputs + 1,)
        Penalty, the same for all or that of each input's weights and, last, of
        the output weights.
    """

    def __init__(self, layout, X, observations, alpha):
        self.layout, self.X = layout, X
        alpha = np.broadcast_to(alpha, layout.n_inputs + 1)
        self.input_alpha, self.output_alpha = alpha[:-1], alpha[-1]
        self.blocks = self._divide(observations)
        # One product of all trials is fastest, unless they are many and read by block.
        self.by_block = len(self.blocks) > 1 and X.shape[0] > X.shape[1]
        self.total = sum(each.weight.sum() for _, of in self.blocks for _, each in of)

    def _divide(self, observations):
        """Return slices of trials, and the losses of the adjectives rated there."""
        n_trials, n_hidden = len(self.X), self.layout.n_hidden
        n_rows = max(
            1 if positions is None else weight.shape[1]
            for positions, _, weight in observations
        )
        size = max(1, _BLOCK // (n_hidden * n_rows))
        buffers = np.empty((2, min(size, n_trials) * n_rows, n_hidden))
        blocks = []
        for start in range(0, n_trials, size):
            rows = slice(start, start + size)
            losses = []
            for i, (positions, level, weight) in enumerate(observations):
                if weight[rows].any():
                    level = np.broadcast_to(level, weight.shape)[rows]
                    at = None if positions is None else positions[rows]
                    loss = _AdjectiveLoss(self.layout, at, level, weight[rows], buffers)
                    losses.append((i, loss))
            blocks.append((rows, losses))
        return blocks

    def __call__(self, params):
        """Return the cost and its gradient."""
        n_features = self.X.shape[1]
        grad = np.zeros(len(params))
        coef, bias, heads = self.layout.split(params)
        g_coef, g_bias, g_heads = self.layout.split(grad)
        shared = None if self.by_block else self.X @ coef[:n_features]
        np.multiply(self.input_alpha, coef.T, out=g_coef.T)
        square = np.vdot(g_coef, coef)
        for head, g_head in zip(heads, g_heads):
            np.multiply(self.output_alpha, head.output, out=g_head.output)
            square += g_head.output @ head.output
        loss, g_shared = 0.0, None if shared is None else np.zeros(shared.shape)
        for rows, losses in self.blocks:
            if shared is None:
                of_trials = self.X[rows] @ coef[:n_features]
                g_trials = np.zeros(of_trials.shape)
            else:
                of_trials, g_trials = shared[rows], g_shared[rows]
            of_trials += bias
            for i, adjective in losses:
                part, g_part, g_position_coef, g_head = adjective(
                    of_trials[adjective.trials], coef[n_features:], heads[i]
                )
                loss += part
                g_trials[adjective.trials] += g_part
                g_coef[n_features:] += g_position_coef
                for total, term in zip(g_heads[i], g_head):
                    total += term
            g_bias += g_trials.sum(axis=0)
            if shared is None:
                g_coef[:n_features] += (g_trials.T @ self.X[rows]).T  # the faster order
        if shared is not None:
            g_coef[:n_features] += self.X.T @ g_shared
        grad /= self.total
        return (loss + 0.5 * square) / self.total, grad
