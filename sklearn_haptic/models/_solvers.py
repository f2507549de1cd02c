"""Minimisers of a smooth cost: L-BFGS and iRprop+."""

import numpy as np
from scipy import optimize

# Igel & Hüsken's iRprop+ as used by Gutiérrez et al. (2016).
_GROW, _SHRINK, _FIRST_STEP, _LARGEST_STEP = 1.2, 0.5, 0.0123, 50.0


# Size of the gradient where the last digits of a cost near 1 no longer change.
_ROUNDING = 1e-6


_STOPPED = 99  # status that scipy gives a search which a callback ended


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


def lbfgs(fun, x0, *, max_iter, tol, callback, bounds=None):
    """Minimise by scipy's L-BFGS-B; arguments and results as for `irprop_plus`.

    Where the cost no longer falls, the search ends; it has converged only if the
    gradient is small there, which it is not under an extreme penalty.

    Parameters
    ----------
    bounds : ndarray of shape (n_params, 2), default=None
        Smallest and largest value of each parameter; `x0` is brought within them.
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


SOLVERS = {"lbfgs": lbfgs, "irprop+": irprop_plus}
