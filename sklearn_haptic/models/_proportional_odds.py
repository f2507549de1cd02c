"""The proportional-odds model as pure functions: thresholds, likelihood, probabilities.

A rating falls at level k or below with probability ``sigma(b_k - f)``, where f is the
latent response of a trial, and the thresholds ``b_1 < b_2 < …`` are shared by all
trials. Each threshold is the one before it plus a gap ``g_k``, so that

    log P(k) = log sigma(b_k - f) + log sigma(f - b_{k-1}) + log(1 - exp(-g_k)),

with the one-sided term alone for the first and last level. Nothing is subtracted and
nothing is divided by a probability, so cost and gradient stay exact where the
probabilities themselves underflow.
"""

import numpy as np
from scipy.special import expit, log_expit

# Odds beyond its exponential, and their reciprocals, are not normal numbers.
LARGEST_EXPONENT = 709.0


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
    def _within_range(raw):
        return np.copysign(np.clip(np.abs(raw), 1e-150, 1e150), raw)


GAPS = {"softplus": SoftplusGaps, "squared": SquaredGaps}


def thresholds_from(first, raw_gaps, gaps=SoftplusGaps):
    """Return increasing thresholds from the first and the parameters of the gaps."""
    return np.cumsum(np.concatenate(([first], gaps.forward(raw_gaps)[0])))


def marginal_thresholds(weight):
    """Return the first threshold and the gaps of the frequencies of the levels.

    `weight` is the positive weight of each level; both results are arrays.
    """
    share = np.maximum(weight / np.sum(weight), np.finfo(np.float64).tiny)
    below = np.log(np.cumsum(share))  # of this level and all before
    above = np.log(np.cumsum(share[::-1])[::-1])
    # With q = p + share, exp(logit(q) - logit(p)) - 1 = share / (p (1 - q)).
    gaps = softplus(np.log(share[1:-1]) - below[:-2] - above[2:])
    return below[:1] - above[1:2], gaps


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
    odds = np.exp(np.minimum(latent - thresholds.reshape(shape), LARGEST_EXPONENT))
    at_or_below = 1 / (1 + odds)
    proba = np.ones((len(thresholds) + 1, *np.shape(latent)))
    proba[:-1] = at_or_below
    proba[1:] *= odds * at_or_below
    proba[1:-1] *= -np.expm1(-np.diff(thresholds)).reshape(shape)
    proba /= proba.sum(axis=0)
    return np.moveaxis(proba, 0, -1)
