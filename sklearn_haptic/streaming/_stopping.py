"""When to stop touching.

A rule sees what was predicted at each duration so far and says whether to stop. Its
*loss* is the expected ranked probability score (RPS) of ordered levels, else the share
of errors of the most probable class.
"""

from __future__ import annotations

from numbers import Real
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from ..ratings._distributions import shares as as_shares
from ..ratings._levels import in_order_of_levels, levels_of_columns
from ..utils._sklearn import Interval, _fit_context
from ..utils._validation import check_numbers

# Number of touches that the prior of the slopes is worth, which is that they are 0.
_PRIOR = 100


def losses(proba, shares, *, ordered):
    """Return the loss of each prediction, averaged over adjectives if there are any.

    Parameters
    ----------
    proba, shares : ndarray of shape (n_trials, ..., n_levels)
        Predicted and true.
    ordered : bool
        Whether the levels have an order.

    Returns
    -------
    loss : ndarray of shape (n_trials,)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.streaming._stopping import losses
    >>> proba, shares = np.array([[0.5, 0.25, 0.25]]), np.array([[0.0, 0.0, 1.0]])
    >>> losses(proba, shares, ordered=True), losses(proba, shares, ordered=False)
    (array([0.8125]), array([1.]))
    """
    if ordered:
        above = np.cumsum(proba, axis=-1)[..., :-1]
        true = np.cumsum(shares, axis=-1)[..., :-1]
        # The mean score of all people, not the distance of the distributions.
        loss = (above**2 * (1 - true) + (1 - above) ** 2 * true).sum(axis=-1)
    else:
        best = proba.argmax(axis=-1)[..., np.newaxis]
        loss = 1 - np.take_along_axis(shares, best, axis=-1)[..., 0]
    return loss.mean(axis=tuple(range(1, loss.ndim)))


def expected_losses(proba, *, ordered):
    """Return the loss that each prediction expects if it is right itself."""
    return losses(proba, proba, ordered=ordered)


def changes(path):
    """Return how far the last prediction is from the one before, in total variation."""
    if path.shape[1] == 1:
        return np.zeros(len(path))
    moved = np.abs(path[:, -1] - path[:, -2]).sum(axis=-1) / 2
    return moved.mean(axis=tuple(range(1, moved.ndim)))


def _whole(proba):
    """Return which predictions, of shape (n_trials, n_durations, ...), are there."""
    return np.isfinite(proba).all(axis=tuple(range(2, proba.ndim)))


def shrunken_regression(state, gain):
    """Regress on standardised columns, with slopes shrunk towards 0.

    A slope is shrunk by half from as many touches as the prior is worth, and the less
    the more there are.

    Parameters
    ----------
    state : ndarray of shape (n_trials, n_columns)
    gain : ndarray of shape (n_trials,)

    Returns
    -------
    coefs : ndarray of shape (1 + n_columns,)
        Intercept and slopes.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.streaming._stopping import shrunken_regression
    >>> state, gain = np.array([[0.0], [2.0]] * 50), np.array([1.0, 5.0] * 50)
    >>> shrunken_regression(state, gain)
    array([2., 1.])
    """
    scale = state.std(axis=0)
    scale[scale <= 1e-9 * np.abs(state).max(axis=0, initial=0)] = np.inf  # constant
    centre = state.mean(axis=0)
    X = (state - centre) / scale
    penalised = X.T @ X + _PRIOR * np.eye(X.shape[1])
    slopes = np.linalg.solve(penalised, X.T @ (gain - gain.mean())) / scale
    return np.append(gain.mean() - centre @ slopes, slopes)


class _Rule(BaseEstimator):
    """Base of the rules, which decide by `_stops` and may learn by `_learn`."""

    _parameter_constraints: dict[str, list[object]] = {}  # noqa: RUF012

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(
        self,
        proba: ArrayLike,
        y: ArrayLike,
        *,
        durations: ArrayLike,
        ordered: bool = True,
    ) -> Self:
        """Learn from predictions out of fold.

        Parameters
        ----------
        proba : array-like of shape (n_trials, n_durations, ..., n_levels)
            Predictions of touches by models fitted without them, such as `oof_proba_`
            of `AnytimeRegressor`. NaN where a touch is not so long.
        y : array-like of shape (n_trials, ..., n_levels)
            Counts of ratings, or 1 for the true class and 0 for others. Labelled
            columns of levels are put in their order, which has to be that of
            `proba`: of a model with its own ``levels=``, give an array in their order.
        durations : array-like of shape (n_durations,)
            Seconds.
        ordered : bool, default=True
            Whether the levels have an order.

        Returns
        -------
        self : object
            The fitted rule.
        """
        check_numbers(y, "y")
        counts = np.asarray(y, dtype=np.float64)
        if ordered and counts.ndim == 2:
            _, order = levels_of_columns(y, None, "y")
            counts = in_order_of_levels(counts, order)
        shape, expected = np.shape(proba), counts.shape
        if len(shape) < 3 or shape[1] != len(np.atleast_1d(durations)):
            raise ValueError(
                f"proba has shape {shape}; give one distribution per duration, as the "
                "oof_proba_ of an AnytimeRegressor."
            )
        if (*shape[:1], *shape[2:]) != expected:
            raise ValueError(
                f"proba has shape {shape}, but y has shape {expected}; give the counts "
                "of the same trials and levels."
            )
        if (np.diff(durations) <= 0).any():
            raise ValueError("durations do not ascend; put the shortest first.")
        if not ((counts >= 0) & (counts < np.inf)).all() or (counts.sum(-1) == 0).any():
            raise ValueError(
                "y has a negative or missing count, or a trial without ratings; give "
                "the counts of rated trials."
            )
        self.durations_ = np.asarray(durations, dtype=np.float64)
        self.ordered_ = ordered
        self._learn(proba, counts)
        return self

    def _learn(self, proba, y):
        """Learn from predictions out of fold and counts, once `durations_` are set."""

    def stops(self, path: ArrayLike) -> NDArray[np.bool_]:
        """Tell whether to stop; `stop_at` tells of whole touches.

        Parameters
        ----------
        path : array-like of shape (n_trials, n_so_far, ..., n_levels)
            Predictions of the durations so far.

        Returns
        -------
        stops : ndarray of bool of shape (n_trials,)
        """
        path = np.asarray(path)
        if path.ndim < 3:
            raise ValueError(
                f"path has shape {path.shape}; give one distribution per trial and "
                "duration so far."
            )
        return np.asarray(self._stops(path))

    def _stops(self, path):
        """Whether to stop, for an array of predictions so far."""
        raise NotImplementedError

    def stop_at(self, proba: ArrayLike) -> NDArray[np.intp]:
        """Find where whole touches are stopped.

        Parameters
        ----------
        proba : array-like of shape (n_trials, n_durations, ..., n_levels)
            Predictions of each duration; NaN where a touch is not so long.

        Returns
        -------
        index : ndarray of int of shape (n_trials,)
            Index of the duration; the last one of a touch that is never stopped.
        """
        self._validate_params()
        proba = np.asarray(proba)
        given = _whole(proba)
        index = np.maximum(given.sum(axis=1) - 1, 0)
        going = np.ones(len(proba), dtype=bool)
        for k in range(proba.shape[1] - 1):
            which = np.flatnonzero(going & (index > k))
            if len(which):
                stop = which[self.stops(proba[which, : k + 1])]
                index[stop], going[stop] = k, False
        return index


class CertaintyThreshold(_Rule):
    """Stop when the largest probability is large enough.

    It suits classes of which one is right. Ratings of people stay uncertain however
    long one touches; :class:`ExpectedGain` does not wait for what never comes.

    The threshold is no rate of errors: stopped at 0.9, a calibrated model is wrong in
    up to a tenth of the touches, and one whose distributions are too sharp more often.
    Choose it by the errors on touches that the model did not learn from, made later if
    touches will be.

    Parameters
    ----------
    threshold : float, default=0.9
        Stop when the largest probability has reached this, from 0 to 1. Of several
        adjectives the mean counts.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.streaming import CertaintyThreshold
    >>> path = np.array([[[0.5, 0.5], [0.8, 0.2], [0.95, 0.05]]])
    >>> CertaintyThreshold(0.7).stop_at(path)
    array([1])
    """

    _parameter_constraints = {  # noqa: RUF012
        "threshold": [Interval(Real, 0, 1, closed="both")],
    }

    def __init__(self, threshold: float = 0.9) -> None:
        self.threshold = threshold

    def _stops(self, path):
        certainty = path[:, -1].max(axis=-1)
        certainty = certainty.mean(axis=tuple(range(1, certainty.ndim)))
        return certainty >= self.threshold


class ExpectedGain(_Rule):
    """Stop when touching on is expected to gain less than it costs.

    What counts is how much the loss is expected to fall, not how large it is. The rule
    learns this from predictions out of fold, backwards from the longest duration: at
    each it regresses what touching on has gained, if one stops at the best time later,
    on the loss that the prediction expects of itself and on its last change. It stops
    where the regression is not above 0.

    Parameters
    ----------
    price : float, default=0.01
        Price of one second of touch, in units of the loss: the RPS of ordered levels,
        the share of errors of classes.

    Attributes
    ----------
    coefs_ : ndarray of shape (n_durations - 1, 3)
        Expected gain at each duration but the last: intercept, and slopes of the
        expected loss and of the change.

    Notes
    -----
    Slopes are shrunk towards 0, by half from 100 touches, because the touches of an
    object share most of their errors.

    References
    ----------
    F. A. Longstaff and E. S. Schwartz, "Valuing American options by simulation: a
    simple least-squares approach", Review of Financial Studies 14(1), 2001,
    :doi:`10.1093/rfs/14.1.113`.

    Examples
    --------
    Half of the touches are sure at once, the others after a second:

    >>> import numpy as np
    >>> from sklearn_haptic.streaming import ExpectedGain
    >>> sure, unsure = [[1.0, 0.0], [1.0, 0.0]], [[0.5, 0.5], [1.0, 0.0]]
    >>> proba, y = np.array([sure, unsure] * 200), np.array([[1, 0]] * 400)
    >>> rule = ExpectedGain(price=0.1).fit(proba, y, durations=[1, 2])
    >>> rule.stop_at(proba[:2])
    array([0, 1])
    """

    _parameter_constraints = {  # noqa: RUF012
        "price": [Interval(Real, 0, None, closed="left")]
    }

    def __init__(self, price: float = 0.01) -> None:
        self.price = price

    def _learn(self, proba, y):
        proba = np.asarray(proba, dtype=np.float64)
        true = as_shares(y)
        given = _whole(proba)
        steps = self.price * np.diff(self.durations_)
        self.coefs_ = np.zeros((len(steps), 3))
        cost = np.full(len(proba), np.nan)  # of a touch that goes on as the rule says
        for k in reversed(range(len(self.durations_))):
            here = given[:, k]
            loss = np.full(len(proba), np.nan)
            loss[here] = losses(proba[here, k], true[here], ordered=self.ordered_)
            further = here & np.isfinite(cost)
            if k < len(steps) and further.any():
                state = self._state(proba[further, : k + 1])
                gain = loss[further] - cost[further] - steps[k]
                self.coefs_[k] = shrunken_regression(state, gain)
                goes_on = np.flatnonzero(further)[self._gain(state, k) > 0]
                loss[goes_on] = cost[goes_on] + steps[k]
            cost = loss

    def _stops(self, path):
        check_is_fitted(self)
        k = path.shape[1] - 1
        if k == len(self.coefs_):
            return np.ones(len(path), dtype=bool)
        return self._gain(self._state(path), k) <= 0

    def _gain(self, state, k):
        return self.coefs_[k, 0] + state @ self.coefs_[k, 1:]

    def _state(self, path):
        """Return what the expected gain depends on, of shape (n_trials, 2)."""
        loss = expected_losses(path[:, -1], ordered=self.ordered_)
        return np.stack([loss, changes(path)], axis=1)
