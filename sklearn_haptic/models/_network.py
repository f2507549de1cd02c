"""The proportional-odds network as pure functions: prediction, likelihood, start.

A rating falls at level k or below with probability ``sigma(b_k - f(x))``, where
the latent response ``f`` is a linear function of the features or of one hidden
layer of logistic units, and the thresholds ``b_1 < b_2 < …`` are shared by all
trials. Each threshold is the one before it plus a gap ``g_k``, so that

    log P(k) = log sigma(b_k - f) + log sigma(f - b_{k-1}) + log(1 - exp(-g_k)),

with the one-sided term alone for the first and last level. Nothing is
subtracted and nothing is divided by a probability, so cost and gradient stay
exact where the probabilities themselves underflow.

Several adjectives may share the weights of the features and the hidden units;
each then has a head of its own: output weights and thresholds.

A trial may stand for several observations that differ only in the *position* p
of the rater in the population: arrays have one row per trial and one column per
observation, and the features are multiplied by the weights once per trial.
"""

from dataclasses import dataclass, replace
from itertools import accumulate, chain, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.special import expit, log_expit

from .._together import Matrix

# Odds beyond its exponential, and their reciprocals, are not normal numbers.
_LARGEST_EXPONENT = 709.0

# Entries of a hidden layer that are computed at once, so that they stay in the cache.
_BLOCK = 1 << 16

# Differences between latent responses and thresholds stay finite.
_LARGEST_LATENT = 1e300


# Thresholds -----------------------------------------------------------------
def softplus(x):
    """Return log(1 + exp(x)) without overflow."""
    return softplus_and_derivative(x)[0]


def softplus_and_derivative(x):
    """Return log(1 + exp(x)) and sigma(x), by the exponential that both need.

    This takes a quarter of the time of `log_expit` and `expit` where numpy has
    vectorised exponentials and logarithms.
    """
    odds = np.exp(-np.abs(x))  # at most 1
    return np.maximum(x, 0) + np.log1p(odds), np.where(x < 0, odds, 1) / (1 + odds)


class SoftplusGaps:
    """Each gap between two thresholds is the softplus of a free parameter."""

    @staticmethod
    def forward(raw):
        """Return the gaps and ``log(1 - exp(-gap))``."""
        return softplus(raw), log_expit(raw)

    @staticmethod
    def derivative(raw):
        """Return the derivatives of what `forward` returns."""
        return expit(raw), expit(-raw)

    @staticmethod
    def from_softplus(raw):
        """Return the parameters of the gaps that are the softplus of `raw`."""
        return raw


class SquaredGaps:
    """Each gap is the square of a free parameter, as in Gutiérrez et al. (2016).

    The cost rises without bound as a gap shrinks to nothing, so a minimum lies on
    either side of zero. A parameter below 1e-150 in size counts as 1e-150, where cost
    and gradient are still finite and lead away from zero; one beyond 1e150 as 1e150.
    """

    @staticmethod
    def forward(raw):
        """Return the gaps and ``log(1 - exp(-gap))``."""
        gap = SquaredGaps._within_range(raw) ** 2
        small = np.log(-np.expm1(-np.minimum(gap, 1)))
        return gap, np.where(gap < 1, small, np.log1p(-np.exp(-np.maximum(gap, 1))))

    @staticmethod
    def derivative(raw):
        """Return the derivatives of what `forward` returns."""
        root = SquaredGaps._within_range(raw)
        gap = root**2
        return 2 * root, 2 * root * np.exp(-gap) / -np.expm1(-gap)

    @staticmethod
    def from_softplus(raw):
        """Return the parameters of the gaps that are the softplus of `raw`."""
        return np.sqrt(softplus(raw))

    @staticmethod
    def _within_range(raw):
        return np.copysign(np.clip(np.abs(raw), 1e-150, 1e150), raw)


GAPS = {"softplus": SoftplusGaps, "squared": SquaredGaps}


def thresholds_from(first, raw_gaps, gaps=SoftplusGaps):
    """Return increasing thresholds from the first and the parameters of the gaps."""
    return np.cumsum(np.concatenate(([first], gaps.forward(raw_gaps)[0])))


def thresholds_of_all_levels(thresholds, present, n_levels):
    """Return thresholds that are infinite or equal around levels without a rating.

    Parameters
    ----------
    thresholds : ndarray of shape (len(present) - 1,)
        Thresholds between the levels that have ratings.
    present : ndarray of int
        Indices of these levels.
    n_levels : int
        Number of all levels.
    """
    edges = np.concatenate(([-np.inf], thresholds, [np.inf]))
    return edges[np.searchsorted(present, np.arange(n_levels - 1), side="right")]


def ordinal_loss(latent, level, weight, first, raw_gaps, gaps=SoftplusGaps):
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
    raw_gaps : ndarray of shape (n_levels - 2,)
        The free parameters of the gaps between thresholds.
    gaps : class, default=SoftplusGaps
        How the gaps depend on them.

    Returns
    -------
    loss : float
        The weighted sum of -log P.
    grad_latent : ndarray of shape (n_observations,)
    grad_first : float
    grad_raw_gaps : ndarray of shape (n_levels - 2,)
    """
    n_levels = len(raw_gaps) + 2
    thresholds = thresholds_from(first, raw_gaps, gaps)
    padded = np.concatenate(([-np.inf], thresholds, [np.inf]))
    above = latent - padded[1:][level]  # how far f lies above the upper threshold
    below = padded[level] - latent
    inner = np.bincount(level, weight, minlength=n_levels)[1:-1]
    of_above, push_up = softplus_and_derivative(above)
    of_below, push_down = softplus_and_derivative(below)
    loss = weight @ (of_above + of_below) - inner @ gaps.forward(raw_gaps)[1]
    push_up *= weight  # of the upper threshold, and of f downwards
    push_down *= weight
    grad_thresholds = (
        np.bincount(level, push_down, minlength=n_levels)[1:]
        - np.bincount(level, push_up, minlength=n_levels)[:-1]
    )
    later = np.cumsum(grad_thresholds[::-1])[::-1]  # of this threshold and all above
    of_gaps, of_log_factors = gaps.derivative(raw_gaps)
    grad_raw_gaps = later[1:] * of_gaps - inner * of_log_factors
    return loss, push_up - push_down, later[0], grad_raw_gaps


def level_probabilities(latent, thresholds):
    """Return P(level) as products of positive factors, on a new last axis.

    Against arithmetic of 60 digits, each is off by less than a rounding error (2.2e-16)
    times the largest of 1, the latent response and the thresholds in size; they sum to
    1 within 4 rounding errors. Those below 1e-300 may be returned as 0; a level between
    equal thresholds, or beyond an infinite one, has exactly 0.
    """
    lower = np.concatenate(([-np.inf], thresholds))
    upper = np.concatenate((thresholds, [np.inf]))
    absent = lower >= upper
    if absent.any():
        proba = np.zeros((*np.shape(latent), len(absent)))
        proba[..., ~absent] = level_probabilities(latent, upper[~absent][:-1])
        return proba
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
class Head(NamedTuple):
    """What an adjective does not share: views of a flat vector of parameters."""

    output: NDArray[np.float64]
    """Output weights of the hidden units, of shape (n_hidden,)."""

    first: NDArray[np.float64]
    """The first threshold, of shape (1,)."""

    raw_gaps: NDArray[np.float64]
    """The free parameters of the gaps between thresholds, of shape (n_levels - 2,)."""


@dataclass(frozen=True)
class Layout:
    """Where the parts of a network lie in the flat vector of parameters.

    First the weights of the inputs, those of the position last; then the biases of
    the hidden units; then the head of each adjective.
    """

    n_inputs: int
    n_hidden: int
    n_levels: tuple[int, ...]
    """Number of levels of each adjective; at least two."""

    gaps: type = SoftplusGaps

    @property
    def _sizes(self):
        heads = ((self.n_hidden, 1, n - 2) for n in self.n_levels)
        n_weights = self.n_inputs * max(self.n_hidden, 1)
        return n_weights, self.n_hidden, *chain.from_iterable(heads)

    @property
    def size(self):
        """Number of parameters."""
        return sum(self._sizes)

    def split(self, params):
        """View the parts of a vector of parameters, or of its gradient.

        Returns
        -------
        coef : ndarray of shape (n_inputs, n_hidden), or (n_inputs,) without units
        bias : ndarray of shape (n_hidden,)
        heads : list of Head
        """
        edges = accumulate(self._sizes, initial=0)
        coef, bias, *heads = (params[i:j] for i, j in pairwise(edges))
        if self.n_hidden:
            coef = coef.reshape(self.n_inputs, self.n_hidden)
        return coef, bias, list(map(Head, heads[::3], heads[1::3], heads[2::3]))

    @staticmethod
    def join(coef, bias, heads):
        """Return a vector of parameters from the parts that `split` returns."""
        return np.concatenate((coef.ravel(), bias, *chain.from_iterable(heads)))

    def network(self, params, present, n_levels):
        """Return the network that has these parameters.

        Parameters
        ----------
        params : ndarray of shape (size,)
        present : list of ndarray of int
            Indices of the levels that ratings of each adjective have; an adjective
            with a single one has no head.
        n_levels : int
            Number of all levels.
        """
        coef, bias, heads = self.split(params)
        remaining = iter(heads)
        output = np.zeros((self.n_hidden, len(present)))
        thresholds = np.empty((len(present), n_levels - 1))
        for i, levels in enumerate(present):
            between = np.empty(0)
            if len(levels) > 1:
                head = next(remaining)
                output[:, i] = head.output
                between = thresholds_from(head.first[0], head.raw_gaps, self.gaps)
            thresholds[i] = thresholds_of_all_levels(between, levels, n_levels)
        return Network(coef, bias, output, thresholds)


@dataclass(frozen=True, eq=False)
class Network:
    """A proportional-odds network of one or several adjectives, ready to predict."""

    coef: NDArray[np.float64]
    """Weights of the inputs, of shape (n_inputs, n_hidden), or (n_inputs,) without
    hidden units; those of the position, if it is an input, come last."""

    bias: NDArray[np.float64]
    """Biases of the hidden units, of shape (n_hidden,)."""

    output: NDArray[np.float64]
    """Output weights, of shape (n_hidden, n_adjectives)."""

    thresholds: NDArray[np.float64]
    """Thresholds between all levels, of shape (n_adjectives, n_levels - 1); infinite
    or equal around levels that cannot occur."""

    def adjective(self, i):
        """Return the network of one of the adjectives alone."""
        return replace(
            self, output=self.output[:, [i]], thresholds=self.thresholds[[i]]
        )

    def forward(self, X, positions=None):
        """Return the latent response and the hidden activations of each observation.

        Parameters
        ----------
        X : ndarray of shape (n_trials, n_features)
            Or of shape (n_trials, n_positions, n_features), where the observations
            of a trial do not share their features.
        positions : ndarray broadcastable to (n_trials, n_positions), default=None
            The input that the observations of a trial do not share; without it a
            trial is one observation.

        Returns
        -------
        latent : ndarray of shape (n_trials, n_positions, n_adjectives)
        hidden : ndarray of shape (n_trials, n_positions, n_hidden)
        """
        shared = linear_response(X, self.coef[: X.shape[-1]])
        if X.ndim == 2:
            shared = shared[:, None]
        if len(self.bias) == 0:
            latent = shared if positions is None else shared + positions * self.coef[-1]
            latent, hidden = latent[..., None], np.empty((*latent.shape, 0))
        else:
            shared = shared + self.bias
            if positions is None:
                hidden = sigmoid(shared)
            else:
                moved = positions[:, :, None] * self.coef[-1]
                hidden = sigmoid_of_sums(shared, moved)
            latent = hidden @ self.output
        return np.clip(latent, -_LARGEST_LATENT, _LARGEST_LATENT), hidden

    def probabilities(self, latent):
        """Return P(level) for the latent responses that `forward` returns.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_positions, n_adjectives, n_levels)
        """
        each = [
            level_probabilities(latent[..., i], between)
            for i, between in enumerate(self.thresholds)
        ]
        if len(each) == 1:
            return each[0][..., None, :]  # a view: nothing is copied
        return np.stack(each, axis=-2)

    def predict_proba(self, X, positions=None):
        """Return P(level) of each observation, as `forward` takes them."""
        return self.probabilities(self.forward(X, positions)[0])


def linear_response(X, coef):
    """Return X @ coef; where it overflows, infinity with the sign of the exact sum.

    Terms that overflow one by one may cancel. Kernels with a fused multiply-add then
    return an infinity of either sign, depending on the order in which they add.
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


def sigmoid(x, out=None):
    """Return sigma(x), by an exponential that is several times as fast as `expit`."""
    odds = np.minimum(np.negative(x, out=out), _LARGEST_EXPONENT, out=out)
    odds = np.exp(odds, out=out)
    odds += 1
    return np.divide(1, odds, out=odds)


def sigmoid_of_sums(a, b, spread_a=np.asarray, spread_b=np.asarray, out=None):
    """Return sigma(a + b) from as many exponentials as a and b have entries.

    Parameters
    ----------
    a, b : ndarray
        Summands; overwritten.
    spread_a, spread_b : callable
        Bring `a` and `b`, or arrays of their shapes, to shapes that broadcast.
    out : ndarray, default=None
        Receives the result.
    """
    largest = max(extreme for x in (a, b) for extreme in (-x.min(), x.max()))
    if largest > _LARGEST_EXPONENT / 2:  # a product of exponentials may overflow
        return expit(np.add(spread_a(a), spread_b(b), out=out), out=out)
    for x in (a, b):
        np.exp(np.negative(x, out=x), out=x)
    odds = np.multiply(spread_a(a), spread_b(b), out=out)
    odds += 1
    return np.divide(1, odds, out=odds)


# Cost -----------------------------------------------------------------------
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
        shared : ndarray of shape (n_trials, n_hidden), or (n_trials,) without units
            What the features and biases contribute.
        position_coef : ndarray of shape (1, n_hidden), or (1,) without units
            Weights of the position; empty if it is no input.
        head : Head

        Returns
        -------
        loss : float
        g_shared, g_position_coef, g_head
            Its derivatives.
        """
        layer = None
        if len(head.output):
            layer = self._activate(shared, position_coef)
            latent = layer @ head.output
        elif self.positions is None:
            latent = shared
        else:
            latent = shared[self.trial] + self.positions * position_coef

        loss, g_latent, g_first, g_raw_gaps = ordinal_loss(
            latent[self.trial] if self.positions is None else latent,
            self.level,
            self.weight,
            head.first[0],
            head.raw_gaps,
            self.gaps,
        )
        if layer is None or self.positions is None:
            g_shared = np.bincount(self.trial, g_latent, len(shared))
        if layer is None:
            g_head = Head(head.output, [g_first], g_raw_gaps)
            if self.positions is None:
                return loss, g_shared, 0.0, g_head
            return loss, g_shared, self.positions @ g_latent, g_head

        slope = np.subtract(1, layer, out=self.buffers[1])
        slope *= layer
        if self.positions is None:
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
        by_block = len(self.blocks) > 1 and X.shape[0] > X.shape[1]
        self.matrix = None if by_block else Matrix(X)
        self.total = sum(each.weight.sum() for _, of in self.blocks for _, each in of)

    def _divide(self, observations):
        """Return slices of trials, and the losses of the adjectives rated there."""
        n_trials, n_hidden = len(self.X), self.layout.n_hidden
        n_rows = max(
            1 if positions is None else weight.shape[1]
            for positions, _, weight in observations
        )
        size = max(1, _BLOCK // (n_hidden * n_rows)) if n_hidden else n_trials
        buffers = np.empty((2, min(size, n_trials) * n_rows, n_hidden))
        blocks = []
        for start in range(0, n_trials, size):
            rows = slice(start, start + size)
            losses = [
                (
                    i,
                    _AdjectiveLoss(
                        self.layout,
                        None if positions is None else positions[rows],
                        np.broadcast_to(level, weight.shape)[rows],
                        weight[rows],
                        buffers,
                    ),
                )
                for i, (positions, level, weight) in enumerate(observations)
                if weight[rows].any()
            ]
            blocks.append((rows, losses))
        return blocks

    def __call__(self, params):
        """Return the cost and its gradient."""
        n_features = self.X.shape[1]
        grad = np.zeros(len(params))
        coef, bias, heads = self.layout.split(params)
        g_coef, g_bias, g_heads = self.layout.split(grad)
        shared = None if self.matrix is None else self.matrix.times(coef[:n_features])
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
            if len(bias):
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
            self.matrix.add_transposed_times(g_shared, g_coef[:n_features])
        grad /= self.total
        return (loss + 0.5 * square) / self.total, grad


def initial_params(layout, level_weights, random_state):
    """Return start values: uniform in (-0.5, 0.5), as Gutiérrez et al. (2016) do.

    The linear model has one minimum, so it starts from zero weights and the
    thresholds of the ratings without features. `level_weights` has for each adjective
    the weight of each of its levels, all positive.
    """
    if layout.n_hidden:
        return random_state.uniform(-0.5, 0.5, layout.size)
    (weight,) = level_weights
    share = np.maximum(weight / np.sum(weight), np.finfo(np.float64).tiny)
    below = np.log(np.cumsum(share))  # of this level and all before
    above = np.log(np.cumsum(share[::-1])[::-1])
    first = below[:1] - above[1:2]
    # With q = p + share, exp(logit(q) - logit(p)) - 1 = share / (p (1 - q)).
    raw_gaps = np.log(share[1:-1]) - below[:-2] - above[2:]
    raw_gaps = layout.gaps.from_softplus(raw_gaps)
    return np.concatenate((np.zeros(layout.n_inputs), first, raw_gaps))


def monotone_bounds(layout):
    """Return bounds that keep the position's and the output weights non-negative."""
    lower = np.full(layout.size, -np.inf)
    coef, _, heads = layout.split(lower)
    coef[-1:] = 0.0
    for head in heads:
        head.output[:] = 0.0
    return np.stack((lower, np.full(layout.size, np.inf)), axis=1)
