"""Distributions of ratings of which only means and deviations are published."""

from __future__ import annotations

from numbers import Integral, Real

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.special import logsumexp
from sklearn.utils.validation import check_array

from ..utils._sklearn import Interval, validate_params
from ..utils._validation import check_numbers
from ._checks import check_levels, refuse
from ._distributions import shares
from ._levels import level_values

_ROUNDING = 1e-12  # of moments on levels from 0 to 1, as computed from ratings
_NOTHING = 1e-30  # of a second moment, which a double does not tell from 0
_PRECISION = 1e-13  # of moments, relative to their magnitude
_MAX_ITER = 1000  # which only levels of most unequal distances need
_MARGIN = 4e-3  # of the range of borrowed variances, so that no level is left out
_MAX_HALVINGS = 60


@validate_params(
    {
        "mean": ["array-like"],
        "std": ["array-like", Interval(Real, 0, None, closed="left"), None],
        "levels": ["array-like"],
        "n": ["array-like", Interval(Real, 0, None, closed="neither"), None],
        "decimals": [Interval(Integral, 0, None, closed="left"), None],
    },
    prefer_skip_nested_validation=True,
)
def counts_from_moments(
    mean: ArrayLike,
    std: ArrayLike | float | None = None,
    *,
    levels: ArrayLike,
    n: ArrayLike | float | None = None,
    decimals: int | None = None,
) -> pd.DataFrame:
    r"""Distributions over the levels with published means and standard deviations.

    Many papers publish no answers, only the mean rating of each object and mostly a
    standard deviation. Of all distributions that have these, the one of greatest
    entropy assumes nothing else.

    Parameters
    ----------
    mean : array-like of shape (n_objects,)
        Mean rating of each object, in units of the scale.
    std : array-like of shape (n_objects,) or float, default=None
        Standard deviation of the ratings of each object, with divisor n: multiply
        deviations with divisor n - 1 by ``sqrt((n - 1) / n)``. One number is borrowed,
        as from a similar study: that of an object whose mean is at the middle of the
        scale. Towards the ends of the scale deviations are smaller, by as much as
        follows from changing this distribution the least. By default nothing is known
        of them.
    levels : array-like of shape (n_levels,)
        The levels, two or more ascending numbers.
    n : array-like of shape (n_objects,) or float, default=None
        Number of people who rated each object, by default not known, which gives
        shares of people. :func:`~sklearn_haptic.metrics.noise_ceiling` needs to know,
        and an `NNPOM` of its own weighs an object by its people.
    decimals : int, default=None
        Number of decimals to which means and deviations are rounded. What people
        can give but for rounding is then moved to the nearest deviation that they can,
        not refused.

    Returns
    -------
    counts : DataFrame of shape (n_objects, n_levels)
        Rows sum to ``n``, or to 1. The columns are the levels, by which models and
        scores know them; the index is that of ``mean``, if it has one.

    Raises
    ------
    ValueError
        If no people can have given such ratings: a mean lies outside the levels, or a
        deviation is too large for its mean, or too small for one between two levels. If
        the indices of columns differ.

    See Also
    --------
    rating_counts : Counts of answers, which tell more.

    Notes
    -----
    The share at level x is proportional to :math:`\exp(a x - b x^2)`, where *a* and *b*
    follow from mean and deviation (Jaynes [1]_); with a borrowed deviation, *b* is the
    same for all objects, and without any it is 0. Moments are exact to about 1e-12 of
    the scale.

    References
    ----------
    .. [1] E. T. Jaynes, "Information theory and statistical mechanics", Physical Review
       106, 620–630, 1957. :doi:`10.1103/PhysRev.106.620`

    Examples
    --------
    >>> from sklearn_haptic.ratings import counts_from_moments
    >>> counts_from_moments([2.5, 4.0], [0.5, 1.1], levels=[1, 2, 3, 4, 5]).round(3)
           1      2      3      4      5
    0  0.000  0.500  0.500  0.000  0.000
    1  0.033  0.081  0.168  0.292  0.427
    >>> counts_from_moments([-3, 0.5], 1.0, levels=range(-3, 4), n=12).round(1)
         -3   -2   -1    0    1    2    3
    0  12.0  0.0  0.0  0.0  0.0  0.0  0.0
    1   0.0  0.2  1.6  4.2  4.2  1.6  0.2
    """
    index = _index_of(mean, std=std, n=n)
    levels = check_levels(levels)
    values = level_values(levels)
    if len(values) < 2:
        raise ValueError(f"levels={values.tolist()} is one level; give two or more.")
    width = np.ptp(values)
    places = (values - values[0]) / width
    means = (_numbers(mean, "mean") - values[0]) / width
    n_objects = len(means)
    error = 0 if decimals is None else 0.5 * 10.0**-decimals / width
    outside = np.abs(means - 0.5) > 0.5 + error + _ROUNDING
    mend = f"give means from {values[0]:g} to {values[-1]:g}, or mend levels"
    refuse(outside, "lies outside the levels", mend, "mean")
    means, base, variance = np.clip(means, 0, 1), np.zeros(len(values)), None
    if std is not None and np.ndim(std):
        deviations = _numbers(std, "std", n_objects) / width
        variance = _possible(places, means, deviations, error, width)
    elif std is not None:
        base = _borrowed(places, std, width)
    counts = shares(np.exp(_nearest(places, means, base, variance)))
    if n is not None:
        people = _numbers(n, "n", n_objects) if np.ndim(n) else np.full(n_objects, n)
        refuse(people <= 0, "is not above 0", "give how many people rated", "n")
        counts = counts * people[:, None]
    return pd.DataFrame(counts, index=index, columns=levels)


def _index_of(mean, **others):
    """Return the index of means, if they have one; others must have the same."""
    if not isinstance(mean, pd.Series):
        return None
    for name, each in others.items():
        if isinstance(each, pd.Series) and not each.index.equals(mean.index):
            raise ValueError(f"{name} has another index than mean; give equal ones.")
    return mean.index


def _numbers(values, name, n_objects=None):
    """Validate one number per object."""
    check_numbers(values, name)
    values = check_array(values, dtype=np.float64, ensure_2d=False, input_name=name)
    shape = values.shape if n_objects is None else (n_objects,)
    if values.ndim != 1 or values.shape != shape:
        raise ValueError(
            f"{name} has shape {values.shape}; give one number per object, of one "
            "adjective at a time."
        )
    return values


def _bounds(places, means):
    """Return the levels beside each mean, the least variance and the greatest."""
    below = np.searchsorted(places, means, side="right") - 1
    below = np.clip(below, 0, len(places) - 2)
    a, b = places[below], places[below + 1]
    return a, b, (means - a) * (b - means), means * (1 - means)


def _possible(places, means, std, error, width):
    """Return variances; refuse deviations that no people can give.

    With the error of a mean, the variance that two levels allow changes by its slope.
    """
    a, b, least, most = _bounds(places, means)
    lower = least - np.abs(a + b - 2 * means) * error - error**2 - _ROUNDING
    upper = most + np.abs(1 - 2 * means) * error + _ROUNDING
    small, large = (std + error) ** 2 < lower, np.maximum(std - error, 0) ** 2 > upper
    refuse(std < 0, "has a negative number", "deviations are 0 or more", "std")
    for bad, what, at, bound in (
        (small, "small", "at least", least),
        (large, "large", "at most", most),
    ):
        mend = f"give {at} {width * np.sqrt(bound[np.argmax(bad)]):.6g}, or mend mean"
        refuse(bad, f"is too {what} for the mean", mend, "std")
    return np.clip(std**2, least, most)


def _borrowed(places, std, width):
    """Return logarithms of the distribution whose mean is at the middle."""
    middle, variance = np.array([0.5]), np.array([(std / width) ** 2])
    least, most = np.concatenate(_bounds(places, middle)[2:])
    margin = _MARGIN * (most - least) - _ROUNDING
    if not least + margin <= variance <= most - margin:
        least, most = width * np.sqrt([least + margin, most - margin])
        raise ValueError(
            f"std={std:g} is no deviation of people who chose levels with their mean "
            f"at the middle of the scale; give {least:.6g} to {most:.6g}."
        )
    return _nearest(places, middle, np.zeros(len(places)), variance)[0]


def _nearest(places, means, base, variance=None):
    """Find the distributions nearest to a base that have these moments.

    Only people at two levels, a and b, have the least or the greatest variance. How far
    others are from both is a second moment that is precise however small it is. If only
    means are given, the search begins with equal shares at a and b: the levels beside
    the mean if the base is a bell, and the ends if it has two heaps.
    """
    a, b, least, most = _bounds(places, means)
    wide, apart = base[1] < base[0] + places[1] * (base[-1] - base[0]), most
    if variance is not None:
        wide = most - variance < variance - least
        apart = np.where(wide, most - variance, variance - least)
    a, b = np.where(wide, 0, a)[:, None], np.where(wide, 1, b)[:, None]
    upper = (means[:, None] - a) / (b - a)
    with np.errstate(divide="ignore"):
        logs = np.log((1 - upper) * (places == a) + upper * (places == b))
    near = np.where(upper < 0.5, a, b)
    statistics = np.stack([places - near, np.abs((places - a) * (places - b))], axis=1)
    targets = np.stack([means - near[:, 0], apart], axis=1)
    slope = (np.interp(b, places, base) - np.interp(a, places, base)) / (b - a)
    start, inside = base - slope * places, apart > _NOTHING
    n = 1 if variance is None else 2
    logs[inside] = _tilted(start[inside], statistics[inside, :n], targets[inside, :n])
    return logs


@np.errstate(over="ignore", under="ignore", invalid="ignore")  # of steps too long
def _tilted(start, statistics, targets):
    """Find the distributions nearest to others with given expectations of statistics.

    They are ``start * exp(weights @ statistics)`` but for a factor. Newton's method
    finds the weights; a step is halved until the dual falls enough, which the
    divergence from the old distribution to the new one tells without cancellation.
    """
    logs = start - logsumexp(start, axis=1, keepdims=True)
    rows = np.arange(len(targets))
    for _ in range(_MAX_ITER):
        p, each = np.exp(logs[rows, None]), statistics[rows]
        mean = (p * each).sum(axis=2)
        missing = targets[rows] - mean
        left = np.abs(missing) > _PRECISION * (p * np.abs(each)).sum(axis=2)
        left = left.any(axis=1)
        if not left.any():
            return logs
        rows, p, missing = rows[left], p[left], missing[left]
        each = each[left] - mean[left, :, None]
        curvature = (p * each) @ each.swapaxes(1, 2)
        step = np.linalg.solve(curvature, missing[:, :, None])
        change, p = (step * each).sum(axis=1), p[:, 0]
        gain, size = (p * change**2).sum(axis=1), np.ones(len(rows))
        noise = 1e-15 * (p * np.abs(change)).sum(axis=1)
        for _ in range(_MAX_HALVINGS):
            moved = size[:, None] * change
            divergence = np.log1p((p * (np.expm1(moved) - moved)).sum(axis=1))
            too_far = ~(divergence <= np.minimum(0.9 * size * gain + noise, 1))
            if not too_far.any():
                break
            size[too_far] /= 2
        logs[rows] += moved - divergence[:, None]
    if np.abs(missing).max() > _ROUNDING:
        raise ValueError(
            "levels are so unequally far apart that no distribution with these moments "
            "is found; give the numbers that people saw, or logarithms."
        )
    return logs
