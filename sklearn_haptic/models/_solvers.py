"""Minimisers of a smooth cost, L-BFGS and iRprop+, and when they stop early."""

import numpy as np
from scipy import optimize

from ..ratings._distributions import macro_error
from ._observations import of_each_adjective

# Igel & Hüsken's iRprop+ as used by Gutiérrez et al. (2016).
_GROW, _SHRINK, _FIRST_STEP, _LARGEST_STEP = 1.2, 0.5, 0.0123, 50.0

# Size of the gradient where the last digits of a cost near 1 no longer change.
_ROUNDING = 1e-6

_TIE = 1e-12  # share by which errors may differ that are the same but for rounding

_CACHED = 8192  # parameters that a step is computed for at once, to stay in the cache

_VALIDATION_INTERVAL = 10  # iterations between two looks at the validation error

_STOPPED = 99  # status that scipy gives a search which a callback ended


def irprop_plus(fun, x0, *, max_iter, tol, callback):
    """Minimise by resilient backpropagation with weight backtracking.

    Parameters
    ----------
    fun : callable
        Returns cost and gradient, which is overwritten.
    x0 : ndarray
        Where to start.
    max_iter : int
        Number of steps.
    tol : float
        The search ends once no component of the gradient exceeds it.
    callback : callable
        Called with ``(x, cost)`` after each step; the search stops if it returns true.

    Returns
    -------
    x : ndarray
    n_iter : int
    converged : bool
        Also true if the callback stopped the search.

    References
    ----------
    Igel, C. & Hüsken, M. (2003). Empirical evaluation of the improved Rprop
    learning algorithms. Neurocomputing 50, 105–123.
    :doi:`10.1016/S0925-2312(01)00700-7`
    """
    x = x0.copy()
    size = np.full_like(x, _FIRST_STEP)
    step = np.zeros_like(x)
    previous_sign = np.zeros_like(x)
    previous_cost = np.inf
    for iteration in range(max_iter):
        cost, grad = fun(x)
        if max(grad.max(), -grad.min()) <= tol:
            return x, iteration, True
        back = -1.0 if cost > previous_cost else 0.0
        for i in range(0, len(x), _CACHED):
            arrays = x, grad, size, step, previous_sign
            _move(*(each[i : i + _CACHED] for each in arrays), back)
        previous_cost = cost
        if callback(x, cost):
            return x, iteration + 1, True
    return x, max_iter, False


def _move(x, grad, size, step, previous_sign, back):
    """Take a step of `irprop_plus` in place; `grad` is overwritten.

    Where the gradient has turned, it is the last step times `back`.
    """
    sign = np.sign(grad, out=grad)
    agreement = np.multiply(previous_sign, sign, out=previous_sign)
    turned = agreement < 0
    # By arithmetic, since masks take ten times as long: 1.2, 1 or 0.5.
    size *= 1 + np.minimum((_GROW - 1) * agreement, (1 - _SHRINK) * agreement)
    np.minimum(size, _LARGEST_STEP, out=size)
    sign *= ~turned
    previous_sign[:] = sign
    step *= back * turned
    step -= np.multiply(sign, size, out=sign)
    x += step


def lbfgs(fun, x0, *, max_iter, tol, callback):
    """Minimise by scipy's L-BFGS-B; arguments and results as for `irprop_plus`.

    Where the cost no longer falls, the search ends; it has converged only if the
    gradient is small there, which it is not under an extreme penalty.
    """

    def stop(intermediate_result):
        if callback(intermediate_result.x, intermediate_result.fun):
            raise StopIteration

    result = optimize.minimize(
        fun,
        x0,
        jac=True,
        method="L-BFGS-B",
        callback=stop,
        options={
            "maxiter": max_iter,
            "maxfun": 20 * max_iter,
            # A longer memory saves iterations; of many parameters it costs too much.
            "maxcor": 30 if x0.size < 2000 else 10,
            "gtol": tol,
            "ftol": np.finfo(float).eps,
        },
    )
    flat = np.max(np.abs(result.jac)) <= max(tol, _ROUNDING)
    return result.x, result.nit, flat or result.status == _STOPPED


SOLVERS = {"lbfgs": lbfgs, "irprop+": irprop_plus}


def validation_error(network, X, positions, level, weight):
    """Return the error of a network on validation trials.

    It is the absolute error of the most probable level, averaged over the levels that
    occur in a trial, over trials by weight, and over adjectives. The validation trials
    are given as to `NNPOM.fit_with_positions`.
    """
    errors = []
    adjectives = of_each_adjective(positions, level, weight)
    for i, (at, true, counted) in enumerate(adjectives):
        own = X[:, i] if X.ndim == 4 else X
        predicted = network.adjective(i).predict_proba(own, at)[:, :, 0].argmax(axis=-1)
        error = macro_error(predicted, true, counted > 0)
        errors.append(np.average(error, weights=counted.max(axis=1)))
    return np.mean(errors)


class Monitor:
    """Callback of a solver that records the costs and keeps the best parameters.

    Parameters
    ----------
    validation_error : callable or None
        Returns the validation error of parameters; None for no early stopping.
    patience : int
        Number of iterations without a smaller error after which the search stops.
    on_iteration : callable or None
        Called with the number of each iteration; the search stops if it returns true.
    """

    def __init__(self, validation_error, patience, on_iteration):
        self.validation_error = validation_error
        self.patience = patience
        self.on_iteration = on_iteration
        self.costs = []
        self.best_error, self.best_params, self.best_iter = np.inf, None, 0

    def __call__(self, params, cost):
        self.costs.append(float(cost))
        iteration = len(self.costs)
        if self.on_iteration is not None and self.on_iteration(iteration):
            return True
        if self.validation_error is None or iteration % _VALIDATION_INTERVAL:
            return False
        error = self.validation_error(params)
        if error < self.best_error * (1 - _TIE):
            self.best_error, self.best_iter = error, iteration
            self.best_params = params.copy()
        return iteration - self.best_iter >= self.patience
