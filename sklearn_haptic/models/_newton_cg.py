"""The linear proportional-odds model by Newton's method with conjugate gradients.

The negative log-likelihood is a sum of softplus terms, each of a difference between a
latent response and a threshold, and of one term for each gap between thresholds. It is
convex, so there is one optimum. Each Newton step eliminates the few parameters that all
trials share, the weight of the position and the thresholds, and solves for the weights
of the features by preconditioned conjugate gradients. The features are only multiplied:
they are neither copied nor decomposed, and products are in their own precision.

Several fits to the same features run in step, so that their products are one product
of matrices. Every round asks for X'u and XX'u of a vector u for each fit: with the
response to each search direction carried along, conjugate gradients need no other
product.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from ..utils._sklearn import FloatArray, one_blas_thread
from ._conditioning import magnitude, rounding_along
from ._proportional_odds import (
    LARGEST_EXPONENT,
    marginal_thresholds,
    softplus,
    softplus_and_derivative,
)

# With fewer trials or features, the preconditioner is the exact Hessian.
_FEW = 256

# Tables of at most so many values are taken to double precision. In single precision,
# features with few strong directions and a weak penalty converge slowly.
_DOUBLED = 1 << 22

# Principal directions in which the preconditioner is exact otherwise, and the trials
# that they are estimated from.
_N_DIRECTIONS, _N_SKETCHED = 64, 1000

# A term's curvature is at least this share of its slope: of observations that are very
# unlikely it vanishes, and steps would have to be halved for ever.
_LEAST_CURVATURE = 0.01

# Conjugate gradients stop when the error has fallen by this factor.
_FORCING = 0.1

# Features offset by more than this many times their spread are centred in a copy.
_LARGEST_OFFSET = 10

# Binary exponents of the spread beyond which features are scaled in a copy.
_EXPONENTS = {np.dtype(np.float32): 30, np.dtype(np.float64): 300}

_BLOCK = 1 << 18  # values that are taken to float64 at once

_HALVINGS, _LARGEST_NUMBER = 40, 500

_ROUNDING = 1e-14

# Pivot of a Hessian with a unit diagonal below which it may be singular.
_LEAST_PIVOT = 1e-5

_LARGEST_PENALTY, _NO_COST = 1e300, 1e-280


class LinearProblem(NamedTuple):
    """What one model is fitted to: observations of trials, and its penalty."""

    positions: FloatArray | None
    """The last feature of each observation, of shape (n_trials, n_observations)."""

    level: NDArray[np.intp]
    """Rank of each observation's level, of the same shape; every level occurs."""

    weight: FloatArray
    """Weight of each observation, of the same shape; the total is near 1."""

    alpha: float
    """Penalty of the squared weights of the features, and of the position."""

    scale: bool
    """Penalise the weights of features divided by the square root of their total
    variance over the weighted trials."""

    max_iter: int
    """Largest number of Newton steps."""

    tol: float
    """The fit has converged once a step changes the latent responses by no more than
    this (root mean square, weighted by curvature); a further step would change them by
    about a tenth of it."""


class LinearFit(NamedTuple):
    """A fitted model, in the units of the features."""

    coef: FloatArray
    """Weights of the features, then that of the position if there is one."""

    thresholds: FloatArray
    loss: float
    """Penalised mean negative log-likelihood."""

    loss_curve: list[float]
    """The same after each Newton step."""

    converged: bool


@one_blas_thread
def fit_linear(X, problems, on_iteration):
    """Fit linear proportional-odds models to the same features.

    Parameters
    ----------
    X : ndarray of float32 or float64 of shape (n_trials, n_features)
    problems : list of LinearProblem
    on_iteration : callable or None
        Called after each step; the fit stops if it returns true.

    Returns
    -------
    fits : list of LinearFit
    """
    weights = np.array([each.weight.sum(axis=1) for each in problems])
    features = _Features(X, weights, all(each.alpha > 0 for each in problems))
    fits = []
    for problem, spread in zip(problems, features.spread):
        size = (spread or 1.0) if problem.scale else 1.0  # of the unit alpha is for
        with np.errstate(over="ignore"):
            alpha = min(problem.alpha * (size / features.unit) ** 2, _LARGEST_PENALTY)
        fits.append(_newton(problem, features, alpha, on_iteration))
    return [features.in_given_units(*fitted) for fitted in _in_step(fits, features)]


def _in_step(fits, features):
    """Run fits that ask for products with vectors; return what they return."""
    results, answers = [None] * len(fits), dict.fromkeys(range(len(fits)))
    while True:
        asked = {}
        for i, answer in answers.items():
            try:
                asked[i] = fits[i].send(answer)
            except StopIteration as stop:
                results[i] = stop.value
        if not asked:
            break
        back = features.back(np.array(list(asked.values())))
        answers = dict(zip(asked, zip(back, features.forth(back))))
    return results


def _newton(problem, features, alpha, on_iteration):
    """Minimise by Newton's method; yield vectors u and be sent X'u and XX'u.

    Return the weights of the features, those of the position and the thresholds, the
    cost, the cost after each step, and whether the fit converged.
    """
    likelihood, tol = _Likelihood(problem), problem.tol
    coef, latent = np.zeros(features.rows.shape[1]), np.zeros(len(features.rows))
    common = likelihood.start()
    cost, curve, last = likelihood.cost(latent, common), [], np.inf
    converged = likelihood.n_cuts == 0  # one level, which is always predicted
    slack = features.rounding**2
    for _ in range(problem.max_iter):
        if cost < _NO_COST:  # weights without a penalty grow for ever
            break
        slope, common_slope, curvature = likelihood.derivatives(latent, common)
        back, forth = yield slope - curvature.cross @ (curvature.inverse @ common_slope)
        residual = -(back + alpha * coef), -(forth + alpha * latent)
        precondition = features.preconditioner(curvature, alpha)
        step, moved, decrement = yield from _conjugate_gradients(
            residual, curvature, alpha, precondition
        )
        common_step = -curvature.inverse @ (common_slope + moved @ curvature.cross)
        decrement += common_slope @ (curvature.inverse @ common_slope)
        change = np.sqrt(decrement / curvature.diagonal.sum())
        size = likelihood.largest_step(common, common_step)
        for _ in range(_HALVINGS):
            new_coef = coef + size * step
            trial = latent + size * moved, common + size * common_step
            new_cost = likelihood.cost(*trial) + alpha / 2 * new_coef @ new_coef
            if new_cost <= cost * (1 + slack) - 1e-4 * size * decrement:
                break
            size /= 2
        else:
            converged = change <= max(tol, features.rounding)
            break
        coef, (latent, common), cost = new_coef, trial, new_cost
        curve.append(cost)
        stalled = last / 2 < change <= features.rounding
        converged = size == 1 and (change <= tol or stalled)
        last = change
        converged |= on_iteration is not None and on_iteration(len(curve))
        if converged:
            break
    total = likelihood.level_weight.sum()
    curve = [float(each / total) for each in (cost, *curve)]
    return coef, *likelihood.split(common), curve[0], curve[1:], converged


def _conjugate_gradients(residual, curvature, alpha, precondition):
    """Solve for a Newton step; yield vectors u and be sent X'u and XX'u.

    `residual` is the pair of the negative gradient r and the response Xr to it. Return
    the step, the response to it and twice the decrease of the quadratic model.
    """
    r, to_r = residual
    step, moved, decrement = np.zeros(len(r)), np.zeros(len(to_r)), 0.0
    z, to_z = precondition(r, to_r)
    error = first_error = r @ z
    direction, response = z, to_z
    for _ in range(_LARGEST_NUMBER):
        if not error > _FORCING**2 * first_error:
            break
        u = curvature.apply(response)
        back, forth = yield u
        of_direction = u @ response + alpha * direction @ direction
        if not of_direction > 0:
            break
        size = error / of_direction
        step = step + size * direction
        moved = moved + size * response
        decrement += size * error
        r = r - size * (back + alpha * direction)
        to_r = to_r - size * (forth + alpha * response)
        z, to_z = precondition(r, to_r)
        previous, error = error, r @ z
        direction = z + error / previous * direction
        response = to_z + error / previous * response
    return step, moved, decrement


class _Curvature(NamedTuple):
    """Hessian in the latent responses and the parameters that all trials share."""

    diagonal: FloatArray
    """Of shape (n_trials,): of each latent response."""

    cross: FloatArray
    """Of shape (n_trials, n_common): of both."""

    inverse: FloatArray
    """Of shape (n_common, n_common): inverse of that of the shared parameters."""

    def apply(self, moved):
        """Multiply by the Hessian in the responses, the shared parameters following."""
        following = self.inverse @ (moved @ self.cross)
        return self.diagonal * moved - self.cross @ following

    def within(self, responses):
        """Return the same Hessian in the weights of some responses."""
        cross = responses.T @ self.cross
        hessian = responses.T @ (self.diagonal[:, None] * responses)
        return hessian - cross @ self.inverse @ cross.T


class _Likelihood:
    """Negative log-likelihood of a problem, and its derivatives.

    Each observation has a softplus term for the threshold above its level and one for
    that below. The shared parameters are the weight of the position, if there is one,
    the first threshold and the gaps between thresholds.
    """

    def __init__(self, problem):
        level, weight, positions = problem.level, problem.weight, problem.positions
        self.n_trials, self.alpha = len(weight), problem.alpha
        used = weight > 0
        trial, level, weight = np.nonzero(used)[0], level[used], weight[used]
        self.level_weight = np.bincount(level, weight)
        n_cuts = len(self.level_weight) - 1
        above, below = level < n_cuts, level > 0
        self.trial = np.concatenate((trial[above], trial[below]))
        self.cut = np.concatenate((level[above], level[below] - 1))
        self.weight = np.concatenate((weight[above], weight[below]))
        self.sign = np.repeat([1.0, -1.0], [above.sum(), below.sum()])
        self.cell = self.trial * n_cuts + self.cut
        self.n_cuts, self.positions = n_cuts, None
        if positions is not None:
            positions = positions[used]
            self.positions = np.concatenate((positions[above], positions[below]))

    def start(self):
        """Return the shared parameters of the frequencies of the levels."""
        moving = np.zeros(int(self.positions is not None))
        return np.concatenate((moving, *marginal_thresholds(self.level_weight)))

    def split(self, common):
        """Return the weights of the position and the thresholds."""
        has_position = int(self.positions is not None)
        return common[:has_position], np.cumsum(common[has_position:])

    def largest_step(self, common, step):
        """Return a step size, at most 1, that leaves a share of every gap."""
        gaps = common[-self.n_cuts :][1:]
        shrinking = -step[-self.n_cuts :][1:] / gaps
        return min(1.0, 0.99 / max(shrinking.max(initial=0), 0.99))

    def _excess(self, latent, common):
        """Return how far each term is on the wrong side of its threshold."""
        moving, thresholds = self.split(common)
        excess = latent[self.trial] - thresholds[self.cut]
        if len(moving):
            excess += moving[0] * self.positions
        return self.sign * excess

    def cost(self, latent, common):
        """Return the cost, without the penalty of the features' weights."""
        moving, gaps = self.split(common)[0], common[-self.n_cuts :][1:]
        cost = self.weight @ softplus(self._excess(latent, common))
        cost -= self.level_weight[1:-1] @ np.log(-np.expm1(-gaps))
        return cost + self.alpha / 2 * moving @ moving

    def derivatives(self, latent, common):
        """Return the gradients by response and shared parameters, and the Hessian."""
        moving, gaps = self.split(common)[0], common[-self.n_cuts :][1:]
        wrong = softplus_and_derivative(self._excess(latent, common))[1]
        steep = self.weight * wrong
        curved = steep * np.maximum(1 - wrong, _LEAST_CURVATURE)
        steep = steep * self.sign
        shape, n = (self.n_trials, self.n_cuts), self.n_trials
        by_cell = np.bincount(self.cell, curved, n * self.n_cuts).reshape(shape)
        cross = [-_tails(by_cell)]
        of_cuts = _tails(by_cell.sum(axis=0))
        order = np.arange(self.n_cuts)
        hessian = of_cuts[np.maximum.outer(order, order)]
        slope_cuts = -_tails(np.bincount(self.cut, steep, self.n_cuts))
        inner = self.level_weight[1:-1]
        # Of -log(1 - exp(-gap)); its curvature has the slope as a factor.
        of_gaps = inner / np.expm1(np.minimum(gaps, LARGEST_EXPONENT))
        slope_cuts[1:] -= of_gaps
        hessian[order[1:], order[1:]] += of_gaps / -np.expm1(-gaps)
        if self.positions is None:
            slope_common = slope_cuts
        else:
            at = curved * self.positions
            cross.insert(0, np.bincount(self.trial, at, n)[:, None])
            beside = -_tails(np.bincount(self.cut, at, self.n_cuts))
            corner = at @ self.positions + self.alpha
            hessian = np.block([[corner, beside], [beside[:, None], hessian]])
            of_position = steep @ self.positions + self.alpha * moving[0]
            slope_common = np.append(of_position, slope_cuts)
        slope = np.bincount(self.trial, steep, n)
        curvature = _Curvature(by_cell.sum(axis=1), np.hstack(cross), _inverse(hessian))
        return slope, slope_common, curvature


def _tails(values):
    """Return the sums from each place of the last axis to its end."""
    return values[..., ::-1].cumsum(axis=-1)[..., ::-1]


def _inverse(hessian):
    """Invert a positive definite matrix whose scales may differ by any factor."""
    scale = np.sqrt(np.maximum(np.diagonal(hessian), np.finfo(float).tiny))
    values, vectors = linalg.eigh(hessian / np.outer(scale, scale))
    vectors = vectors / scale[:, None]
    return vectors / np.maximum(values, _ROUNDING) @ vectors.T


def _solver(hessian):
    """Return a function that solves for a vector.

    Directions in which the Hessian is 0 but for rounding, as of collinear features
    without a penalty, are left out: along them nothing is known, and a step would be
    of any length.
    """
    scale = 1 / np.sqrt(np.maximum(np.diagonal(hessian), np.finfo(float).tiny))
    hessian = hessian * np.outer(scale, scale)
    try:
        factor = linalg.cho_factor(hessian, check_finite=False)
        regular = np.diagonal(factor[0]).min(initial=1) > _LEAST_PIVOT
    except linalg.LinAlgError:
        regular = False
    if regular:
        return lambda r: scale * linalg.cho_solve(factor, scale * r, check_finite=False)
    values, vectors = linalg.eigh(hessian, check_finite=False)
    known = values > _ROUNDING * len(values) * values[-1]
    root = scale[:, None] * vectors[:, known] / np.sqrt(values[known])
    return lambda r: root @ (r @ root)


class _Features:
    """Centred features as conjugate gradients need them.

    Where trials or features are few, an equivalent small matrix stands for them: the
    features themselves, or their coordinates in the span of the trials.

    Attributes
    ----------
    rows : ndarray of shape (n_trials, n_inputs)
        What is multiplied.
    spread : ndarray of shape (n_problems,)
        Square root of the features' total variance over the trials of each problem.
    unit : float
        A power of two near the spread; inputs are in this unit.
    rounding : float
        Change of the latent responses that may be due to rounding.
    """

    def __init__(self, X, trial_weight, penalised):
        total = trial_weight.sum(axis=0)
        largest = magnitude(X)
        origin = X[0] / largest  # constant features are exactly zero after this
        centre = np.zeros(X.shape[1])
        for rows, block in _blocks(X, largest, origin):
            centre += total[rows] @ block
        centre = origin + centre / total.sum()
        squares, shift = np.empty(len(X)), np.zeros((len(trial_weight), X.shape[1]))
        for rows, block in _blocks(X, largest, centre):
            squares[rows] = np.einsum("ij,ij->i", block, block)
            shift += trial_weight[:, rows] @ block
        shift /= trial_weight.sum(axis=1)[:, None]
        square = trial_weight @ squares / trial_weight.sum(axis=1)
        variance = square - np.einsum("ij,ij->i", shift, shift)
        variance[variance < _ROUNDING * len(X) * square] = 0
        self.spread = largest * np.sqrt(variance)
        self.unit = largest
        if variance.any():
            self.unit = np.ldexp(1.0, np.frexp(self.spread.max())[1] - 1)
        self.centre, self._axes = largest * centre, None
        self.rows, self._row_unit = X, self.unit
        self._offset = self.centre / self.unit
        few = min(X.shape) <= _FEW
        doubled = few or X.size <= _DOUBLED
        far = linalg.norm(centre) > _LARGEST_OFFSET * np.sqrt(variance.max())
        extreme = abs(np.frexp(self.unit)[1]) > _EXPONENTS[X.dtype]
        if doubled or far or extreme:
            self.rows = np.empty(X.shape, np.float64 if doubled else X.dtype)
            for rows, block in _blocks(X, largest, centre):
                self.rows[rows] = block * (largest / self.unit)
            self._row_unit, self._offset = 1.0, np.zeros(X.shape[1])
        self.rounding = 1e-7 if self.rows.dtype == np.float64 else 1e-4
        if few:
            self._reduce(penalised)
        else:
            self._find_directions(np.flatnonzero(total))

    def _reduce(self, penalised):
        """Take few features as they are, many in coordinates of the trials' span.

        Many are as many as the trials, which tell of nothing outside their span. What
        extends no further than rounding may is made 0. Without a penalty that is more,
        because unequally weighted trials tell less of a coordinate than of a feature.
        """
        n_trials, varies = len(self.rows), self.rows.any(axis=0)
        least = max(self.rows.shape) * np.finfo(float).eps
        if self.rows.shape[1] > min(_FEW, n_trials - 1):
            rows = self.rows.T
            self._axes, rows = linalg.qr(rows, mode="economic", check_finite=False)
            self.rows = np.ascontiguousarray(rows.T)
            self._offset = np.zeros(self.rows.shape[1])
            least = least if penalised else np.sqrt(_ROUNDING)
        length = np.sqrt(np.einsum("ij,ij->j", self.rows, self.rows))
        self.rows[:, length <= least * length.max(initial=0)] = 0
        if self._axes is not None:
            offset = np.where(varies, self.centre / self.unit, 0)
            along = n_trials * rounding_along(self._axes, offset, n_trials)
            self.rows[:, length <= along] = 0

    def _find_directions(self, used):
        """Find principal directions of some trials, by a randomised range finder."""
        rng = np.random.default_rng(0)
        some = np.sort(rng.permutation(used)[:_N_SKETCHED])
        sketch = self.rows[some]
        directions = rng.normal(size=(_N_DIRECTIONS, len(some)))
        directions = self.forth(self.back(directions, sketch), sketch)
        directions = self.back(directions, sketch).T
        self._directions, _ = linalg.qr(directions, mode="economic", check_finite=False)
        self._responses = np.ascontiguousarray(self.forth(self._directions.T).T)
        # Along any further direction they vary by about this, or less.
        self._beyond = np.square(self._responses).mean(axis=0).min()

    def back(self, vectors, rows=None):
        """Return X'u of each vector u."""
        rows = self.rows if rows is None else rows
        products = vectors.astype(rows.dtype) @ rows / np.float64(self._row_unit)
        return products - np.outer(vectors.sum(axis=1), self._offset)

    def forth(self, vectors, rows=None):
        """Return Xv of each vector v."""
        rows = self.rows if rows is None else rows
        products = (vectors / self._row_unit).astype(rows.dtype) @ rows.T
        return products - (vectors @ self._offset)[:, None]

    def preconditioner(self, curvature, alpha):
        """Return a function that nearly solves for r, given r and Xr; and the response.

        It is exact in the span of the directions, and a scalar outside.
        """
        exact = not hasattr(self, "_directions")
        responses = self.rows if exact else self._responses
        hessian = curvature.within(responses)
        hessian[np.diag_indices(len(hessian))] += alpha
        inside = _solver(hessian)
        if exact:

            def within(r, to_r):
                z = inside(r)
                return z, self.rows @ z

            return within
        outside = alpha + curvature.diagonal.sum() * self._beyond

        def both(r, to_r):
            along = r @ self._directions
            step = inside(along) - along / outside
            z = r / outside + self._directions @ step
            return z, to_r / outside + self._responses @ step

        return both

    def in_given_units(self, coef, position_coef, thresholds, *rest):
        """Return the fitted model of the features as they were given."""
        if self._axes is not None:
            coef = self._axes @ coef
        coef = coef / self.unit
        thresholds = thresholds + self.centre @ coef
        return LinearFit(np.concatenate((coef, position_coef)), thresholds, *rest)


def _blocks(X, unit, origin):
    """Yield slices of trials and their features, in a unit and less an origin."""
    size = max(1, _BLOCK // X.shape[1])
    for start in range(0, len(X), size):
        rows = slice(start, start + size)
        block = X[rows].astype(np.float64)
        block /= unit
        block -= origin
        yield rows, block
