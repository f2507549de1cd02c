"""The proportional-odds network, ready to predict, and where its parameters lie.

The latent response of the proportional-odds model is a linear function of the features
or of one hidden layer of logistic units. Several adjectives may share the weights of
the features and the hidden units; each then has a head of its own: output weights and
thresholds.

A trial may stand for several observations that differ only in the *position* p of the
rater in the population: arrays have one row per trial and one column per observation,
and the features are multiplied by the weights once per trial.
"""

from dataclasses import dataclass, replace
from itertools import accumulate, chain, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit
from sklearn.utils import gen_batches

from ._proportional_odds import (
    LARGEST_EXPONENT,
    SoftplusGaps,
    level_probabilities,
    thresholds_from,
    thresholds_of_all_levels,
)

# Differences between latent responses and thresholds stay finite.
_LARGEST_LATENT = 1e300

# Values in single precision that are taken to double at once.
_BLOCK = 1 << 18


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
    """Where the parts of a hidden layer lie in the flat vector of parameters.

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
        n_weights = self.n_inputs * self.n_hidden
        return n_weights, self.n_hidden, *chain.from_iterable(heads)

    @property
    def size(self):
        """Number of parameters."""
        return sum(self._sizes)

    def split(self, params):
        """View the parts of a vector of parameters, or of its gradient.

        Returns
        -------
        coef : ndarray of shape (n_inputs, n_hidden)
        bias : ndarray of shape (n_hidden,)
        heads : list of Head
        """
        edges = accumulate(self._sizes, initial=0)
        coef, bias, *heads = (params[i:j] for i, j in pairwise(edges))
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
        own = {"output": self.output[:, [i]], "thresholds": self.thresholds[[i]]}
        return replace(self, **own)

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
    Sums are in float64, blockwise if the features are float32.
    """
    if X.dtype == np.float32:
        response = np.empty((*X.shape[:-1], *coef.shape[1:]))
        for rows in gen_batches(len(X), max(1, _BLOCK // max(X[0].size, 1))):
            response[rows] = linear_response(X[rows].astype(np.float64), coef)
        return response
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
    odds = np.minimum(np.negative(x, out=out), LARGEST_EXPONENT, out=out)
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
    if largest > LARGEST_EXPONENT / 2:  # a product of exponentials may overflow
        return expit(np.add(spread_a(a), spread_b(b), out=out), out=out)
    for x in (a, b):
        np.exp(np.negative(x, out=x), out=x)
    odds = np.multiply(spread_a(a), spread_b(b), out=out)
    odds += 1
    return np.divide(1, odds, out=odds)
