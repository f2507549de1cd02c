"""Minimisers of a smooth cost, and the early stopping of either."""

import numpy as np
from scipy import optimize

# Igel & Hüsken's iRprop+ as used by Gutiérrez et al. (2016).
_GROW, _SHRINK, _FIRST_STEP, _LARGEST_STEP = 1.2, 0.5, 0.0123, 50.0


_VALIDATION_INTERVAL = 10  # iterations between two looks at the validation error


_ROUNDING = 1e-6  # of the gradient of a cost near 1, which is flat to its last digits


_STOPPED = 99  # status of scipy's minimisers that a callback ended


def irprop_plus(fun, x0, *, max_iter, tol, callback):
    """Minimise by resilient backpropagation with weight backtracking.

    Parameters
    ----------
    fun : callable
        Returns cost and gradient.
    x0 : ndarray
        Where to start.
    max_iter : int
        Number of steps.
    tol : float
        The search ends once no component of the gradient exceeds it.
    callback : callable
        Called with ``(x, cost)`` after each step; stops the search if true.

    References
    ----------
    Igel, C. & Hüsken, M. (2003). Empirical evaluation of the improved Rprop
    learning algorithms. Neurocomputing 50, 105–123.
    :doi:`10.1016/S0925-2312(01)00700-7`
    """
    x = x0.copy()
    size = np.full_like(x, _FIRST_STEP)
    step = np.zeros_like(x)
    previous_grad = np.zeros_like(x)
    previous_cost = np.inf
    for iteration in range(max_iter):
        cost, grad = fun(x)
        if np.max(np.abs(grad)) <= tol:
            return x, iteration, True
        agreement = np.sign(previous_grad) * np.sign(grad)
        size[agreement > 0] *= _GROW
        size[agreement < 0] *= _SHRINK
        np.minimum(size, _LARGEST_STEP, out=size)
        turned = agreement < 0
        backtrack = -step if cost > previous_cost else np.zeros_like(x)
        step = np.where(turned, backtrack, -np.sign(grad) * size)
        x += step
        previous_grad = np.where(turned, 0.0, grad)
        previous_cost = cost
        if callback(x, cost):
            return x, iteration + 1, True
    return x, max_iter, False


def lbfgs(fun, x0, *, bounds, max_iter, tol, callback):
    """Minimise by scipy's L-BFGS-B; arguments as for `irprop_plus`.

    A search that ends because the cost no longer falls has converged only if little
    is left of the gradient, which under an extreme penalty is not so.
    """

    def stop(intermediate_result):
        if callback(intermediate_result.x, intermediate_result.fun):
            raise StopIteration

    result = optimize.minimize(
        fun,
        x0,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
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
    lower, upper = (-np.inf, np.inf) if bounds is None else bounds.T
    downhill = np.clip(result.x - result.jac, lower, upper) - result.x
    flat = np.max(np.abs(downhill)) <= max(tol, _ROUNDING)
    return result.x, result.nit, flat or result.status == _STOPPED


class Monitor:
    """Records the cost of each iteration and keeps the best validated model.

    Parameters
    ----------
    validation_error : callable or None
        Gives the error of parameters; None for no early stopping.
    patience : int
        Iterations without a smaller error after which to stop.
    end_iteration : callable or None
        Called after each iteration; stops the search if true.
    """

    def __init__(self, validation_error, patience, end_iteration):
        self.validation_error = validation_error
        self.patience = patience
        self.end_iteration = end_iteration
        self.costs = []
        self.best_error, self.best_params, self.best_iter = np.inf, None, 0

    def __call__(self, params, cost):
        self.costs.append(float(cost))
        iteration = len(self.costs)
        if self.end_iteration is not None and self.end_iteration():
            return True
        if self.validation_error is None or iteration % _VALIDATION_INTERVAL:
            return False
        error = self.validation_error(params)
        if error < self.best_error:
            self.best_error, self.best_iter = error, iteration
            self.best_params = params.copy()
        return iteration - self.best_iter >= self.patience
