"""How the errors of several touches of one object go together, and the best weights.

Touches of an object share much of their error: its ratings hold what no finger feels.
The score of a mean of predictions is a quadratic function of its weights, so the mean
products of errors out of fold, of two predictions of the same touch and of two touches
of the same object, give the best weights for any set of touches.

The weights with the best score do not make a pool as broad as it errs. It is narrower
where it errs little for most objects and much for a few; then it is blurred, a share of
each level going to its neighbours. It is broader where touches differ much; then it is
raised to a power.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar, nnls

from ..ratings._distributions import cdf, raised

# A member no further from the marginal, as a share of the marginal's mean square error,
# says no more than rounding and unfinished solving do. Its weight could be anything.
_LEAST = 1e-6


class Moments(NamedTuple):
    """Mean products of the departures of pairs of members.

    Attributes
    ----------
    same : ndarray of shape (n_members, n_members)
        Of two members' predictions from one row.
    other : ndarray of shape (n_members, n_members)
        Of predictions from two rows of one object.
    n_objects : int
        How many objects they are means of.
    """

    same: np.ndarray
    other: np.ndarray
    n_objects: int


def error_moments(departure, objects):
    """Return the mean products of departures within objects, which count equally.

    A member departs as the marginal does, and by what it adds. Mean products of these
    are correlations times sizes, so that rows that lack a member are not mixed with
    others, whose objects may be easier: the correlation is that in the rows, or pairs
    of rows, that have both, and the size is that of the marginal times its ratio in the
    rows that have the member. By how much products of two rows are less than those of
    one is learned from the objects that have both. What never occurred in one row goes
    together as in two rows of an object; what no object has, as one, so that it is not
    thought to be worth more than it is.

    Parameters
    ----------
    departure : ndarray of shape (n_rows, n_members, n_thresholds)
        Predicted minus true; NaN where a member has nothing to predict from. The last
        member is the marginal, which always has.
    objects : ndarray of int of shape (n_rows,)
        Number of the object of each row, from 0.

    Returns
    -------
    moments : Moments
    """
    there = np.isfinite(departure).all(axis=2)
    added = np.where(there[..., np.newaxis], departure, 0.0)
    added[:, :-1] -= there[:, :-1, np.newaxis] * departure[:, -1:]
    square, there = (added**2).sum(axis=2), there.astype(np.float64)
    n_members = there.shape[1]
    # Of one row and of two; the squares are those of the first member of a pair.
    products, squares = np.zeros((2, 2, n_members, n_members))
    less, n_both = np.zeros((2, n_members, n_members))
    order = np.argsort(objects, kind="stable")
    for rows in np.split(order, np.cumsum(np.bincount(objects))[:-1]):
        has, own, total = there[rows], square[rows], added[rows].sum(axis=0)
        count = has.sum(axis=0)
        number = np.array([has.T @ has, np.outer(count, count)])
        product = np.einsum("rik,rjk->ij", added[rows], added[rows])
        product = np.array([product, total @ total.T])
        first = np.array([own.T @ has, np.outer(own.sum(axis=0), count)])
        for each in (number, product, first):
            each[1] -= each[0]
        product, both = _ratio(product, number), (number > 0).all(axis=0)
        products += product
        squares += _ratio(first, number)
        less += both * (product[0] - product[1])
        n_both += both
    sizes = np.sqrt(squares * squares.swapaxes(1, 2))
    known, correlation = sizes > 0, _ratio(products, sizes)
    correlation = np.where(known, correlation, correlation[::-1])
    correlation[:, ~known.any(axis=0)] = 1.0
    marginal = squares[0, -1, -1] / (objects.max() + 1)
    size = np.sqrt(marginal * _ratio(squares[0, :, -1], squares[0, -1]))
    basis = np.eye(n_members)
    basis[:, -1] = 1.0
    same, other = correlation * np.outer(size, size)
    other = np.where(n_both > 0, same - _ratio(less, n_both), other)
    same, other = (basis @ each @ basis.T for each in (same, other))
    return Moments(same, other, int(objects.max()) + 1)


def felt_touches(there):
    """Return which members touches have, the marginal the last, in one order.

    Touches without any member do not count, unless there are no others.

    Parameters
    ----------
    there : ndarray of bool of shape (n_touches, n_members)

    Returns
    -------
    touches : ndarray of bool of shape (n_felt, n_members + 1)
    """
    there = np.asarray(there)
    felt = there.any(axis=1)
    there = there[felt] if felt.any() else there
    return np.column_stack((there[np.lexsort(there.T)], np.ones(len(there), bool)))


def pairs_of(touches):
    """Return how many touches have both members of each pair.

    Parameters
    ----------
    touches : ndarray of bool of shape (n_touches, n_members)

    Returns
    -------
    pairs : ndarray of shape (n_members, n_members)
        The numbers of touches of the members are on the diagonal.
    """
    touches = touches.astype(np.float64)
    return touches.T @ touches


def pool_weights(moments, pairs):
    """Return the best weights of the members for some touches of one object.

    The members' weights are not negative; that of the marginal is what is left to 1,
    and negative where a mean of the members would be too flat.

    Parameters
    ----------
    moments : Moments
        The marginal is the last member.
    pairs : ndarray of shape (n_members, n_members)
        How many touches have both.

    Returns
    -------
    share : ndarray of shape (n_members,)
        Weights of the members, each shared equally by the touches that have it; 0 for
        a member that has none, or that predicts the marginal.
    score : float
        Expected squared distance from the truth.
    """
    count = pairs.diagonal()
    mean = mean_products(moments, pairs)
    own = mean.diagonal()
    differs = own - 2 * mean[-1] + own[-1] > _LEAST * own[-1]
    differs[-1] = True
    used = np.flatnonzero((count > 0) & differs)
    mean = mean[np.ix_(used, used)]
    root = root_of(mean)
    share = np.zeros(len(count))
    if len(used) > 1:  # beside the marginal
        share[used[:-1]], _ = nnls(root[:, :-1] - root[:, -1:], -root[:, -1])
    share[-1] = 1 - share.sum()
    return share, float(share[used] @ mean @ share[used])


def root_of(products):
    """Return A of which A.T @ A are mean products, as far as these can be."""
    values, vectors = np.linalg.eigh(products)
    return (vectors * np.sqrt(np.maximum(values, 0))).T


def possible(moments):
    """Return moments that errors can have.

    Where members lack rows, correlations are of different rows, and a mean of some
    members may seem to have a negative square error. All members then count as erring
    by twice as much more: once would leave a mean that seems not to err. Nor is an
    error negative that touches of an object share: of few objects it may be so by
    chance, and a pool of useless members would seem to err the less, the more they
    weigh.
    """
    lowest = min(np.linalg.eigvalsh(moments.same)[0], 0.0)
    same = moments.same - 2 * lowest * np.eye(len(moments.same))
    shared = root_of(moments.other)
    return moments._replace(same=same, other=shared.T @ shared)


class Spread(NamedTuple):
    """What tells how far pools err in the mean rating, in levels.

    Attributes
    ----------
    means : Moments
        Of the departures of the means of the members.
    within : float
        Mean variance of the true distributions.
    """

    means: Moments
    within: float


def spread_moments(proba, true, objects):
    """Return the spread of members within objects, which count equally.

    Parameters
    ----------
    proba : ndarray of shape (n_rows, n_members, n_levels)
        NaN where a member has nothing to predict from.
    true : ndarray of shape (n_rows, n_levels)
    objects : ndarray of int of shape (n_rows,)

    Returns
    -------
    spread : Spread
    """
    mean, variance = _mean_and_variance(true)
    departure = _mean_and_variance(proba)[0] - mean[:, np.newaxis]
    within = np.bincount(objects, variance) / np.bincount(objects)
    means = possible(error_moments(departure[..., np.newaxis], objects))
    return Spread(means, float(within.mean()))


def means_of_touches(proba, objects, touches):
    """Return means of rows like some touches, of objects that have all members.

    A touch is a row that has its members and stands for no other touch; members that no
    row has together are taken from several. Objects with too few rows give one mean, of
    those that they have.

    Parameters
    ----------
    proba : ndarray of shape (n_rows, n_members, n_levels)
        NaN where a member has nothing to predict from.
    objects : ndarray of int of shape (n_rows,)
    touches : ndarray of bool of shape (n_touches, n_members)
        Which members a touch has.

    Returns
    -------
    means : ndarray of shape (n_means, n_members, n_levels)
    objects : ndarray of int of shape (n_means,)
    """
    there = np.isfinite(proba[..., 0])
    known = [there[:, touch].all(axis=1).any() for touch in touches]
    parts = [t[None] if k else np.diag(t)[t] for t, k in zip(touches, known)]
    touches = np.concatenate(parts)
    touches = touches[np.argsort(-touches.sum(axis=1), kind="stable")]
    free = np.ones(len(objects), dtype=bool)
    means, of_means = [proba[:0]], [objects[:0]]
    while free.any():
        first = len(means) == 1
        total = np.zeros((objects.max() + 1, *proba.shape[1:]))
        number = np.zeros(total.shape[:2])
        found = np.zeros(len(total), dtype=int)
        for touch in touches:
            usable = free
            if first:  # rather than lack a member, a row serves twice
                usable = free | (number[objects][:, touch] == 0).any(axis=1)
            rows = np.flatnonzero(usable & there[:, touch].all(axis=1))
            rows = rows[np.lexsort((~free[rows], objects[rows]))]
            which, place = np.unique(objects[rows], return_index=True)
            rows = rows[place]
            free[rows] = False
            found[which] += 1
            number[which] += touch
            total[which] += np.where(touch[:, np.newaxis], proba[rows], 0.0)
        whole = (number > 0).all(axis=1) if first else found == len(touches)
        if not whole.any():
            break
        means.append(total[whole] / number[whole][..., np.newaxis])
        of_means.append(np.flatnonzero(whole))
    return np.concatenate(means), np.concatenate(of_means)


class Breadth(NamedTuple):
    """What makes a pool as broad as it errs; at most one changes it.

    Attributes
    ----------
    power : float or ndarray of shape (n, 1)
        To which probabilities are raised, from 1 to 4, of classes from 1/4.
    blur : float or ndarray of shape (n, 1)
        How much of each level goes to its neighbours, half to each, from 0 to 1.
    """

    power: float | np.ndarray = 1.0
    blur: float | np.ndarray = 0.0


def with_breadth(proba, breadth):
    """Return distributions of shape (n, n_levels) as broad as they err.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.ensembles._pool_moments import Breadth, with_breadth
    >>> with_breadth(np.array([[0.5, 0.5, 0.0, 0.0]]), Breadth(blur=1.0))
    array([[0.5 , 0.25, 0.25, 0.  ]])
    """
    proba = raised(proba, breadth.power)
    ends = np.concatenate((proba[:, :1], proba, proba[:, -1:]), axis=1)
    neighbours = (ends[:, :-2] + ends[:, 2:]) / 2
    return (1 - breadth.blur) * proba + breadth.blur * neighbours


def pool_breadth(proba, true, spread, share, pairs):
    """Return the breadth with which pools of some touches are as broad as they err.

    The mean variance is to equal that of the true ratings and the mean squared error of
    the means, which is that of `spread` and what the breadth changes of it. It goes as
    far as brings both nearer, and costs no more than 1 % of the ranked probability
    score: a power makes peaks of what is uneven, as 21 levels of ridge regression are.

    Parameters
    ----------
    proba : ndarray of shape (n_pools, n_levels)
        Pools of training touches.
    true : ndarray of shape (n_pools, n_levels)
        The true distributions of their objects.
    spread : Spread
    share : ndarray of shape (n_members,)
        As of `pool_weights`.
    pairs : ndarray of shape (n_members, n_members)
        As for `pool_weights`.

    Returns
    -------
    breadth : Breadth
    """
    true_mean, _ = _mean_and_variance(true)
    below = cdf(true)
    differing = (below * (1 - below)).sum()  # what people's differing adds

    def rps(proba):
        return np.square(cdf(proba) - below).sum() + differing

    def beyond_error(proba):
        mean, variance = _mean_and_variance(proba)
        return np.mean(variance - (mean - true_mean) ** 2)

    error = expected_error(spread.means, share, pairs)
    mean, _ = _mean_and_variance(proba)
    wanted = spread.within + error - np.mean((mean - true_mean) ** 2)
    best = Breadth()
    excess = beyond_error(proba) - wanted
    steps = np.linspace(0, 1, 65)[1:].tolist()
    further = [Breadth(4**x) if excess > 0 else Breadth(blur=x) for x in steps]
    least, worst = abs(excess), 1.01 * rps(proba)
    for breadth in further:
        broad = with_breadth(proba, breadth)
        off = abs(beyond_error(broad) - wanted)
        if off >= least or rps(broad) > worst:
            break
        best, least = breadth, off
    return best


def class_power(proba, true):
    """Return the power of pools of classes that has the lowest Brier score.

    Parameters
    ----------
    proba : ndarray of shape (n_pools, n_classes)
    true : ndarray of shape (n_pools, n_classes)

    Returns
    -------
    breadth : Breadth
        From 1/4 to 4.
    """

    def brier(log_power):
        return ((raised(proba, 4**log_power) - true) ** 2).sum()

    found = minimize_scalar(brier, bounds=(-1, 1), method="bounded")
    return Breadth(float(4**found.x))


def _mean_and_variance(proba):
    level = np.arange(proba.shape[-1])
    mean = proba @ level
    return mean, np.einsum("...k,...k", proba, (level - mean[..., np.newaxis]) ** 2)


def expected_error(moments, share, pairs):
    """Return the mean squared error that pools of new objects are expected to have.

    That of training objects is less, by a share of one object for each member used,
    because their errors chose the weights.
    """
    error = root_of(mean_products(moments, pairs)) @ share
    n_members = np.count_nonzero(share[:-1])
    return float(error @ error) * (1 + n_members / moments.n_objects)


def mean_products(moments, pairs):
    """Return the mean products of departures in the means of touches."""
    count = pairs.diagonal()
    every = np.outer(count, count)
    return _ratio(pairs * moments.same + (every - pairs) * moments.other, every)


def _ratio(total, n):
    return np.divide(total, n, out=np.zeros_like(total), where=n > 0)
