"""Which of two objects: comparisons of distributions, and scales from comparisons.

Of two predicted distributions, `probability_of_superiority` tells how likely a rating
of the one is above a rating of the other. Where people gave no ratings but only said
which of two objects feels, say, rougher, `pairwise_scale` places them on a line.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from numbers import Real
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.special import expit, log_expit, log_ndtr
from sklearn.utils.validation import check_consistent_length

from ._check_ratings import check_counts
from ._distributions import cdf, shares
from ._levels import levels_of_columns
from ._sklearn import Interval, StrOptions, validate_params
from ._validation import check_objects, check_weights, rows_of_objects

__all__ = ["PairwiseScale", "pairwise_scale", "probability_of_superiority"]


@validate_params(
    {
        "first": ["array-like"],
        "second": ["array-like"],
        "ties": [StrOptions({"split", "apart"})],
    },
    prefer_skip_nested_validation=True,
)
def probability_of_superiority(
    first: ArrayLike,
    second: ArrayLike,
    *,
    ties: Literal["split", "apart"] = "split",
) -> NDArray[np.float64]:
    """Probability that a rating of one object is above one of another.

    Parameters
    ----------
    first, second : array-like of shape (n_pairs, n_levels) or (1, n_levels)
        Distributions of the ratings of the two objects of each pair, as predicted, or
        counts of people. A single row is compared with every row of the other. Labelled
        columns are put in the order of the levels, which both must share.
    ties : {"split", "apart"}, default="split"
        Whether two equal ratings count half, or are told apart.

    Returns
    -------
    probability : ndarray of shape (n_pairs,) or (n_pairs, 3)
        P(first > second) + P(first = second) / 2; or with ties apart, in columns,
        P(first > second), P(first = second) and P(first < second).

    Raises
    ------
    ValueError
        If a row is no distribution and no counts, or the shapes or labels differ.

    Notes
    -----
    The two ratings are independent: those of two people drawn at random. One person who
    feels both objects orders them more surely, since what that person's ratings have
    in common cancels. With ``ties="split"`` this is the probability of superiority,
    or common-language effect size, and for counts the Mann-Whitney U statistic divided
    by the number of pairs of people.

    The probabilities of the cells of one grid, ``numpy.diff(model.predict_cdf(X))`` of
    a :class:`~sklearn_haptic.ContinuousRatingsRegressor`, may take the place of those
    of levels. Split ties are then exact, for ratings spread evenly over a cell.

    References
    ----------
    K. O. McGraw and S. P. Wong, "A common language effect size statistic",
    Psychological Bulletin 111, 361–365, 1992. :doi:`10.1037/0033-2909.111.2.361`

    Examples
    --------
    >>> from sklearn_haptic.pairs import probability_of_superiority
    >>> sandpaper, cork = [[0, 0.25, 0.75]], [[0.5, 0.5, 0]]
    >>> probability_of_superiority(sandpaper, cork)
    array([0.9375])
    >>> probability_of_superiority(sandpaper, cork, ties="apart")
    array([[0.875, 0.125, 0.   ]])
    """
    levels, _ = levels_of_columns(first, None, "first")
    if levels is None:
        levels, _ = levels_of_columns(second, None, "second")
        second, _ = check_counts(second, levels, name="second")  # whose levels they are
    first, _ = check_counts(first, levels, name="first")
    second, _ = check_counts(second, levels, name="second")
    if first.shape[1] != second.shape[1]:
        raise ValueError(
            f"first has {first.shape[1]} levels, but second has {second.shape[1]}; "
            "give both the same levels."
        )
    if len(first) != len(second) and 1 not in (len(first), len(second)):
        raise ValueError(
            f"first has {len(first)} rows, but second has {len(second)}; give one row "
            "per pair in both, or a single one."
        )
    equal = (shares(first) * shares(second)).sum(axis=1)
    above = (shares(first)[:, 1:] * cdf(second)[:, :-1]).sum(axis=1)
    if ties == "split":
        return above + equal / 2
    below = (cdf(first)[:, :-1] * shares(second)[:, 1:]).sum(axis=1)
    return np.column_stack((above, equal, below))


@dataclass(frozen=True, eq=False)
class PairwiseScale:
    """Places of objects on a line, made of pairwise judgements by `pairwise_scale`.

    Parameters
    ----------
    objects : ndarray of shape (n_objects,)
        The objects, sorted.
    values : ndarray of shape (n_objects,)
        The place of each, with mean 0.
    covariance : ndarray of shape (n_objects, n_objects)
        Covariance of the values. That of the difference of two objects is
        ``covariance[i, i] + covariance[j, j] - 2 * covariance[i, j]``.
    """

    objects: np.ndarray
    values: NDArray[np.float64]
    covariance: NDArray[np.float64] = field(repr=False)

    def values_for(self, objects: ArrayLike) -> NDArray[np.float64]:
        """Return the value of the object of each trial, as a target of a regressor.

        Parameters
        ----------
        objects : array-like of shape (n_trials,)
            The object of each trial, by the ids of ``self.objects``.

        Returns
        -------
        values : ndarray of shape (n_trials,)

        Raises
        ------
        ValueError
            If an object is missing or not on this scale.
        """
        lacks = "The scale has no judgements"
        rows = rows_of_objects(objects, self.objects, lacks=lacks, more="judgements")
        return self.values[rows]


@validate_params(
    {
        "winners": ["array-like"],
        "losers": ["array-like"],
        "model": [StrOptions({"thurstone", "bradley-terry"})],
        "alpha": [Interval(Real, 0, None, closed="neither")],
        "sample_weight": ["array-like", None],
    },
    prefer_skip_nested_validation=True,
)
def pairwise_scale(
    winners: ArrayLike,
    losers: ArrayLike,
    *,
    model: Literal["thurstone", "bradley-terry"] = "thurstone",
    alpha: float = 0.1,
    sample_weight: ArrayLike | None = None,
) -> PairwiseScale:
    r"""Place objects on a line by judgements of which of two is more so.

    Parameters
    ----------
    winners : array-like of shape (n_judgements,)
        The object of each pair that was judged to be more so, for instance rougher.
    losers : array-like of shape (n_judgements,)
        The other object of the pair.
    model : {"thurstone", "bradley-terry"}, default="thurstone"
        Thurstone's Case V: the difference of two percepts is normal, with a standard
        deviation of 1. Bradley and Terry: it is logistic, with a scale of 1.
    alpha : float, default=0.1
        Penalty on half the sum of squares of the values, which keeps finite an object
        that never lost; the larger, the closer are all values to 0. It is the precision
        of a normal prior.
    sample_weight : array-like of shape (n_judgements,), default=None
        How often each judgement was made. A tie is half a judgement each way.

    Returns
    -------
    scale : PairwiseScale
        The objects, their values with mean 0, and the covariance of these.

    Raises
    ------
    ValueError
        If an object is missing or compared with itself, or some objects are not
        connected with the others by any judgement.

    Notes
    -----
    The values s minimise

    .. math:: -\sum_j w_j \log G(s_{a_j} - s_{b_j}) + \frac\alpha2 \sum_i s_i^2

    over the judgements that :math:`a_j` is above :math:`b_j`, where G is the normal or
    the logistic CDF. The covariance is the inverse of the second derivatives there, for
    centred values: the uncertainty that the judgements leave, if they are independent
    of each other. Several judgements by one person seldom are.

    The covariance is a dense matrix, and the fit holds five of its size: for 5,000
    objects 200 MB remain of 1 GB.

    References
    ----------
    L. L. Thurstone, "A law of comparative judgment", Psychological Review 34,
    273–286, 1927. :doi:`10.1037/h0070288`

    R. A. Bradley and M. E. Terry, "Rank analysis of incomplete block designs: I. The
    method of paired comparisons", Biometrika 39, 324–345, 1952.
    :doi:`10.1093/biomet/39.3-4.324`

    Examples
    --------
    >>> from sklearn_haptic.pairs import pairwise_scale
    >>> rougher = ["brick", "brick", "cork", "cork", "brick"]
    >>> smoother = ["cork", "cork", "brick", "tile", "tile"]
    >>> scale = pairwise_scale(rougher, smoother)
    >>> scale.values.round(2)
    array([ 0.85,  0.45, -1.3 ])
    >>> scale.values_for(["tile", "tile", "brick"]).round(2)
    array([-1.3 , -1.3 ,  0.85])
    """
    check_consistent_length(winners, losers)
    winners = check_objects(winners, name="winners")
    losers = check_objects(losers, name="losers")
    if isinstance(winners.tolist()[0], str) != isinstance(losers.tolist()[0], str):
        raise ValueError(
            "winners and losers are not of one type, one text and the other not; "
            "convert one of them."
        )
    weight = check_weights(sample_weight, winners)
    objects, index = np.unique(np.r_[winners, losers], return_inverse=True)
    won, lost = np.split(index, 2)
    if (won == lost).any():
        raise ValueError(
            f"winners and losers have the same object in row {np.argmax(won == lost)}; "
            "name two objects in every row."
        )
    won, lost, weight = (each[weight > 0] for each in (won, lost, weight))
    _refuse_islands(won, lost, objects)
    values, covariance = _fit(won, lost, weight, len(objects), model, alpha)
    return PairwiseScale(objects, values, covariance)


def _refuse_islands(won, lost, objects):
    """Refuse objects that no chain of judgements connects with the others."""
    n = len(objects)
    graph = coo_array((np.ones(len(won)), (won, lost)), shape=(n, n))
    n_parts, part = connected_components(graph, directed=False)
    if n_parts > 1:
        island = objects[part == np.argmin(np.bincount(part))].tolist()
        raise ValueError(
            f"No judgement connects the objects {island[:5]}"
            f"{' and more' * (len(island) > 5)} with the others, so they have no place "
            "on one scale; add judgements between the two, or scale each by itself."
        )


def _fit(won, lost, weight, n, model, alpha):
    """Minimise by Newton's method with step halving; the objective is convex."""
    normal = model == "thurstone"

    def loss(s):
        d = s[won] - s[lost]
        return -weight @ (log_ndtr(d) if normal else log_expit(d)) + alpha / 2 * s @ s

    def derivatives(s):
        d = s[won] - s[lost]
        if normal:
            first = np.exp(-(d**2) / 2 - np.log(2 * np.pi) / 2 - log_ndtr(d))
            second = first * (first + d)
        else:
            first, second = expit(-d), expit(d) * expit(-d)
        wins, losses = (
            np.bincount(index, weight * first, minlength=n) for index in (won, lost)
        )
        links = coo_array((weight * second, (won, lost)), shape=(n, n)).toarray()
        links += links.T
        hessian = np.diag(links.sum(axis=1) + alpha) - links
        # The same for centred values, and far from singular along their mean.
        hessian += np.trace(hessian) / n**2
        return alpha * s - wins + losses, cho_factor(hessian)

    s, value = np.zeros(n), loss(np.zeros(n))
    for _ in range(100):
        gradient, factor = derivatives(s)
        step = cho_solve(factor, gradient)
        decrement = gradient @ step
        while (new := loss(s - step)) > value and decrement > 1e-16 * value:
            step /= 2
            decrement /= 2
        s, value = s - step, new
        if decrement <= 1e-16 * value:
            break
    centre = np.eye(n) - 1 / n
    covariance = centre @ cho_solve(derivatives(s)[1], centre)
    return s - s.mean(), (covariance + covariance.T) / 2
