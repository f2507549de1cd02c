"""Proportional odds with a scale that depends on the touch, for `frontier_heads.py`.

P(y <= k) = sigma((b_k - f(x)) exp(-s(x))), f and s linear. To check cost and gradient
against arithmetic of 400 digits: ``python benchmarks/location_scale.py``
"""

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, log_expit
from sklearn.base import BaseEstimator

from sklearn_haptic.models._ordinal import OrdinalClassifierMixin


def negative_log_likelihood(params, X, shares, alpha, scale_alpha):
    """Penalised sum over trials and levels of -share log P, and its gradient.

    The parameters are those of the thresholds (the first, and the logs of the gaps
    between them), then the weights of f and of s.
    """
    n_thresholds, n_features = shares.shape[1] - 1, X.shape[1]
    first, log_gaps, f, s = np.split(
        params, [1, n_thresholds, n_thresholds + n_features]
    )
    gaps = np.exp(log_gaps)
    thresholds = np.cumsum(np.concatenate((first, gaps)))
    shrink = np.exp(-(X @ s))[:, None]
    z = (thresholds - (X @ f)[:, None]) * shrink
    # log(sigma(b) - sigma(a)) = log sigma(b) + log sigma(-a) + log(1 - exp(a - b))
    width = np.diff(z, axis=1)
    log_p = np.zeros_like(shares)
    log_p[:, :-1] += log_expit(z)
    log_p[:, 1:] += log_expit(-z)
    log_p[:, 1:-1] += np.log(-np.expm1(-width))
    loss = -np.sum(shares * log_p)

    g_z = -shares[:, :-1] * expit(-z) + shares[:, 1:] * expit(z)
    g_width = -shares[:, 1:-1] / np.expm1(width)
    g_z[:, 1:] += g_width
    g_z[:, :-1] -= g_width
    g_thresholds = (g_z * shrink).sum(axis=0)
    later = np.cumsum(g_thresholds[::-1])[::-1]
    g_f = -X.T @ (g_z * shrink).sum(axis=1) + alpha * f
    g_s = -X.T @ (g_z * z).sum(axis=1) + scale_alpha * s
    loss += 0.5 * alpha * (f @ f) + 0.5 * scale_alpha * (s @ s)
    return loss, np.concatenate((later[:1], later[1:] * gaps, g_f, g_s))


class LocationScale(OrdinalClassifierMixin, BaseEstimator):
    """Linear location and scale, fitted to the shares of each level.

    The location starts from zero weights, as does the scale. Penalties are of features
    divided by the root of their total variance, as those of `NNPOM`.
    """

    def __init__(self, alpha=0.2, scale_alpha=2.0):
        self.alpha = alpha
        self.scale_alpha = scale_alpha

    def fit(self, X, y):
        shares = y / y.sum(axis=1, keepdims=True)
        self.levels_ = self.classes_ = np.arange(1, y.shape[1] + 1)
        self.mean_, self.unit_ = X.mean(axis=0), np.sqrt(X.var(axis=0).sum())
        X = (X - self.mean_) / self.unit_
        below = np.clip(np.cumsum(shares.mean(axis=0))[:-1], 1e-3, 1 - 1e-3)
        start = np.log(below / (1 - below))
        gaps = np.log(np.maximum(np.diff(start), 1e-2))
        params = np.concatenate((start[:1], gaps, np.zeros(2 * X.shape[1])))
        self.params_ = minimize(
            negative_log_likelihood,
            params,
            (X, shares, self.alpha, self.scale_alpha),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": 300, "maxcor": 30, "gtol": 1e-4 * len(X)},
        ).x
        return self

    def predict_proba(self, X):
        X = (X - self.mean_) / self.unit_
        n_thresholds = len(self.levels_) - 1
        first, log_gaps, f, s = np.split(
            self.params_, [1, n_thresholds, n_thresholds + X.shape[1]]
        )
        thresholds = np.cumsum(np.concatenate((first, np.exp(log_gaps))))
        below = expit((thresholds - (X @ f)[:, None]) * np.exp(-(X @ s))[:, None])
        return np.diff(below, axis=1, prepend=0, append=1)


def check(n_runs=5):
    """Print the largest errors of cost and gradient against 400 digits."""
    from mpmath import exp, log, mp, mpf

    mp.dps = 400  # some probabilities are as small as 1e-200

    def exact(params, X, shares, alpha, scale_alpha):
        thresholds = [params[0]]
        for log_gap in params[1 : shares.shape[1] - 1]:
            thresholds.append(thresholds[-1] + exp(log_gap))
        f, s = np.split(params[shares.shape[1] - 1 :], 2)
        total = alpha * (f @ f) / 2 + scale_alpha * (s @ s) / 2
        for x, share in zip(X, shares):
            scale, location = exp(x @ s), x @ f
            below = [1 / (1 + exp((location - b) / scale)) for b in thresholds]
            p = np.diff([mpf(0), *below, mpf(1)])
            total -= sum(w * log(q) for w, q in zip(share, p))
        return total

    rng, step, worst = np.random.default_rng(0), mpf(10) ** -50, np.zeros(2)
    multiple = np.vectorize(mpf, otypes=[object])
    for _ in range(n_runs):
        X, shares = rng.normal(size=(6, 3)), rng.dirichlet(np.ones(5), 6)
        params = rng.normal(size=10)
        cost, grad = negative_log_likelihood(params, X, shares, 0.3, 0.7)
        given = multiple(X), multiple(shares), mpf("0.3"), mpf("0.7")
        params = multiple(params)
        shifts = multiple(np.eye(10)) * step
        true = [
            (exact(params + d, *given) - exact(params - d, *given)) / step / 2
            for d in shifts
        ]
        worst = np.maximum(
            worst,
            (
                abs(cost / exact(params, *given) - 1),
                max(abs(g - t) for g, t in zip(grad, true)) / max(abs(grad)),
            ),
        )
    print("largest relative error of the cost, of the gradient:", *map(float, worst))


if __name__ == "__main__":
    check()
