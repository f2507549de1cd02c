"""What few raters, and raters with habits, tell of an object.

`shrink_counts` draws the counts of an object that few people rated towards those of the
others. `rater_effects` tells what is due to the object from what is due to the people
who happened to rate it: how each shifts and spreads the scale, and how often each
answers without care.
"""

from __future__ import annotations

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.special import expit, logit
from sklearn.utils import Bunch

from ._check_ratings import check_counts, known_answers
from ._shrinkage import leave_one_out_strength, mean_of_others
from ._sklearn import Interval, validate_params
from .ratings import RatingTable

__all__ = ["rater_effects", "shrink_counts", "shrinkage_strength"]


def shrinkage_strength(counts: ArrayLike) -> float:
    r"""Choose how far to shrink the counts of objects, by leaving out each rating.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people gave each object each level; one row per object.

    Returns
    -------
    strength : float
        Number of people that the population counts for, from 0 to infinity; to be
        given to :func:`shrink_counts`.

    Raises
    ------
    ValueError
        If there are fewer than two objects, counts are not whole numbers, or no object
        has two ratings, so that none can be left out.

    Notes
    -----
    Each rating is predicted from the other ratings of its object and from the mean
    distribution of the other objects, as `shrink_counts` would. The strength with
    the lowest ranked probability score is chosen, every object counting equally.

    Examples
    --------
    >>> from sklearn_haptic.raters import shrinkage_strength
    >>> shrinkage_strength([[3, 0, 0], [0, 0, 3], [3, 0, 0], [0, 0, 3]])  # people agree
    0.0
    >>> shrinkage_strength([[1, 0, 1], [1, 0, 1], [1, 0, 1], [1, 0, 1]])  # objects do
    inf
    """
    counts, _ = check_counts(counts)
    return leave_one_out_strength(counts)


@validate_params(
    {
        "counts": ["array-like"],
        "strength": [Interval(Real, 0, np.inf, closed="both"), None],
    },
    prefer_skip_nested_validation=True,
)
def shrink_counts(
    counts: ArrayLike, strength: float | None = None
) -> NDArray[np.float64]:
    r"""Draw the counts of each object towards the population of objects.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people gave each object each level; one row per object.
    strength : float, default=None
        Number of people that the population counts for, from 0 (counts stay as they
        are) to infinity (all objects are alike). By default
        :func:`shrinkage_strength` chooses it.

    Returns
    -------
    counts : ndarray of shape (n_objects, n_levels)
        Shrunken counts, as many as before in each row.

    Raises
    ------
    ValueError
        If there are fewer than two objects, or no strength is given and none can be
        chosen.

    Notes
    -----
    With the counts :math:`n_k` of N people and the mean distribution :math:`\pi` of the
    other objects, the share at level k is
    :math:`(n_k + m \pi_k) / (N + m)` for the strength m: the mean of the posterior if
    objects have a Dirichlet prior of this mean and concentration.

    Examples
    --------
    >>> from sklearn_haptic.raters import shrink_counts
    >>> shrink_counts([[2, 0, 0], [0, 1, 1], [0, 2, 0]], strength=1)
    array([[1.33333333, 0.5       , 0.16666667],
           [0.33333333, 1.        , 0.66666667],
           [0.33333333, 1.5       , 0.16666667]])
    """
    counts, _ = check_counts(counts)
    if strength is None:
        strength = leave_one_out_strength(counts)
    n = counts.sum(axis=1, keepdims=True)
    drawn = 1.0 if np.isinf(strength) else strength / (n + strength)
    return (1 - drawn) * counts + drawn * n * mean_of_others(counts)


def rater_effects(table: RatingTable) -> Bunch:
    r"""Tell objects from the habits of the people who rated them.

    Where each object is rated by a few of many people, its counts depend on who they
    are. This model finds who rates high or low, who uses the ends or the middle of the
    scale, and who answers at random, and tells how all people would have rated each
    object. People must have rated several objects each, and objects share people.

    Parameters
    ----------
    table : RatingTable
        Ratings that know their raters: ``rating_counts(ratings, objects, raters)``,
        `RatingTable.from_long` or `RatingTable.from_wide`.

    Returns
    -------
    effects : :class:`~sklearn.utils.Bunch`
        With the attributes

        shift : ndarray of shape (n_raters,)
            How much higher than the average person each of ``table.raters`` rates, in
            units of the latent scale.
        spread : ndarray of shape (n_raters,)
            How much of the scale each uses, 1 on average.
        careless : ndarray of shape (n_raters,)
            Probability that an answer of the person has nothing to do with the object.
        location : ndarray of shape (n_objects,)
            Where each of ``table.objects`` lies on the latent scale.
        thresholds : ndarray of shape (n_levels - 1,)
            Borders between the levels on the latent scale.
        counts : ndarray of shape (n_objects, n_levels)
            Robust counts: as many as people rated the object, in the distribution that
            careful answers of all people together would have.

    Raises
    ------
    ValueError
        If the table does not know its raters, or has one object, rater or level.

    Notes
    -----
    With the logistic CDF :math:`\sigma`, thresholds :math:`\tau_k`, K levels, the
    location :math:`\theta_i` of object i, and the shift :math:`b_j`, spread
    :math:`a_j` and carelessness :math:`\varepsilon_j` of person j,

    .. math:: P(y_{ij} \le k) = (1 - \varepsilon_j)\,
        \sigma\!\left(\frac{\tau_k - b_j}{a_j} - \theta_i\right)
        + \varepsilon_j \frac kK.

    The penalised likelihood is maximised: :math:`\theta`, b and log a have normal
    priors, whose variances are estimated in turn with them (by the diagonal of the
    expected information), and :math:`\varepsilon` a beta prior of mean 0.1. Counts
    average the careful part over all people, each by the share of care, and over the
    uncertainty of the location.

    What people disagree on beyond shift and spread is taken to be as large for all
    objects. Counts of many raters each tell that better by themselves.

    References
    ----------
    V. E. Johnson and J. H. Albert, Ordinal Data Modeling, Springer, 1999, chapter 5.
    :doi:`10.1007/b98832`

    Examples
    --------
    Bo rates higher than Ann and Cy, and only Bo has rated the tile:

    >>> from sklearn_haptic.raters import rater_effects
    >>> from sklearn_haptic.ratings import rating_counts
    >>> table = rating_counts(
    ...     [1, 3, 1, 2, 4, 2, 3, 5, 3, 4],
    ...     ["foam"] * 3 + ["cork"] * 3 + ["felt"] * 3 + ["tile"],
    ...     ["Ann", "Bo", "Cy"] * 3 + ["Bo"],
    ...     levels=[1, 2, 3, 4, 5],
    ... )
    >>> effects = rater_effects(table)
    >>> effects.shift.round(1)
    array([-1.7,  3.4, -1.7])
    """
    answers, people = known_answers(table)
    sizes = len(table.objects), len(people), len(table.levels)
    if min(sizes) < 2:
        raise ValueError(
            "table has {} objects, {} raters and {} levels; the habits of raters are "
            "told from two or more of each.".format(*sizes)
        )
    model = _Model(answers, *sizes)
    parts, uncertainty = model.fit()
    location, shift, log_spread, log_odds, thresholds = parts
    return Bunch(
        shift=shift,
        spread=np.exp(log_spread),
        careless=expit(log_odds),
        location=location,
        thresholds=thresholds,
        counts=table.counts.sum(axis=1, keepdims=True)
        * model.of_all_people(parts, uncertainty),
    )


# Pseudo-answers, careless and careful, of the prior on each person's carelessness.
_CARELESS, _CAREFUL = 1.0, 9.0
# Rounds of parameters and variances at most, which change by less than 2 % in the end.
_ROUNDS = 10
# Variances of the priors of locations, shifts and logarithms of spreads at the start.
_START_VARIANCES = 4.0, 1.0, 0.1
# People over whom predictions are averaged at most, and nodes of a location.
_MOST_PEOPLE, _NODES = 256, 9


class _Model:
    """The model of `rater_effects`, whose parameters are one vector of five parts.

    These are the locations of objects, the shifts of people, the logarithms of their
    spreads, the log-odds of their carelessness, and the thresholds, as the first of
    them and the logarithms of the gaps.
    """

    def __init__(self, answers, n_objects, n_raters, n_levels):
        self.object, self.rater, self.level = answers.T
        self.sizes = n_objects, n_raters, n_levels
        self.borders = np.cumsum([n_objects, n_raters, n_raters, n_raters])

    def fit(self):
        """Alternate between the parameters and the variances of their priors.

        Return the five parts, and the variance of each location.
        """
        share = np.bincount(self.level, minlength=self.sizes[2]) + 0.5
        cuts = logit(np.cumsum(share)[:-1] / share.sum())
        x = np.zeros(self.borders[-1] + len(cuts))
        x[self.borders[2] : self.borders[3]] = np.log(_CARELESS / _CAREFUL)
        x[self.borders[3] :] = np.r_[cuts[0], np.log(np.diff(cuts))]
        variances = np.array(_START_VARIANCES)
        for _ in range(_ROUNDS):
            x = minimize(
                self.loss,
                x,
                variances,
                jac=True,
                method="L-BFGS-B",
                options={"maxiter": 500},
            ).x
            parts = self.split(x)
            uncertain = self.posterior_variances(parts, variances)
            old, variances = (
                variances,
                np.array(
                    [np.mean(part**2 + v) for part, v in zip(parts, uncertain)]
                ).clip(1e-3, 100),
            )
            if np.allclose(old, variances, rtol=0.02):
                break
        return parts, uncertain[0]

    def split(self, x):
        """Return the five parts, the last as thresholds."""
        *parts, cuts = np.split(x, self.borders)
        return *parts, np.cumsum(np.r_[cuts[:1], np.exp(cuts[1:])])

    def loss(self, x, variances):
        """Return the penalised negative log-likelihood and its gradient."""
        parts = self.split(x)
        location, shift, log_spread, log_odds, cuts = parts
        spread, careless = np.exp(log_spread)[self.rater], expit(log_odds)
        care = 1 - careless[self.rater]
        n_levels = self.sizes[2]
        # Distance of the border below and above each answer from what is reported.
        borders = np.array([self.level - 1, self.level])
        ends = (borders < 0) | (borders == n_levels - 1)
        gap = cuts[borders % (n_levels - 1)] - shift[self.rater]
        z = gap / spread - location[self.object]
        below = np.where(ends, borders >= 0, expit(z))
        careful = below[1] - below[0]
        proba = care * careful + (1 - care) / n_levels
        value = -np.log(proba).sum()

        slope = np.where(ends, 0, expit(z) * expit(-z)) * (care / proba)
        slope[1] *= -1  # now the derivative of the value by z
        n_objects, n_raters, _ = self.sizes
        of_z, of_gap = slope.sum(axis=0), slope.sum(axis=0) / spread
        by_log_odds = (careful - 1 / n_levels) * care * (1 - care) / proba
        by_cut = np.bincount(
            (borders % (n_levels - 1)).ravel(),
            (slope / spread).ravel(),
            minlength=n_levels - 1,
        )
        gradient = [
            np.bincount(self.object, -of_z, minlength=n_objects),
            np.bincount(self.rater, -of_gap, minlength=n_raters),
            np.bincount(
                self.rater, -(slope * gap / spread).sum(axis=0), minlength=n_raters
            ),
            np.bincount(self.rater, by_log_odds, minlength=n_raters),
        ]
        for part, by_part, variance in zip(parts, gradient, variances):
            value += part @ part / variance / 2
            by_part += part / variance
        value -= _CARELESS * np.log(careless).sum()
        value -= _CAREFUL * np.log1p(-careless).sum()
        gradient[3] += (_CARELESS + _CAREFUL) * careless - _CARELESS
        # A threshold moves with the first one and with every gap below it.
        by_cut = np.cumsum(by_cut[::-1])[::-1]
        by_cut[1:] *= np.diff(cuts)
        return value, np.concatenate([*gradient, by_cut])

    def posterior_variances(self, parts, variances):
        """Return those of the first three parts, by the expected information."""
        location, shift, log_spread, log_odds, cuts = parts
        spread = np.exp(log_spread)[self.rater, None]
        gap = cuts - shift[self.rater, None]
        z = gap / spread - location[self.object, None]
        proba = np.diff(expit(z), axis=1, prepend=0, append=1) + 1e-12
        slope = expit(z) * expit(-z)
        care = expit(-log_odds)[self.rater]
        found = []
        for index, size, by_parameter, variance in zip(
            (self.object, self.rater, self.rater),
            (len(location), len(shift), len(shift)),
            (slope, slope / spread, slope * gap / spread),
            variances,
        ):
            change = np.diff(by_parameter, axis=1, prepend=0, append=0)
            information = care * (change**2 / proba).sum(axis=1)
            total = np.bincount(index, information, minlength=size)
            found.append(1 / (total + 1 / variance))
        return found

    def of_all_people(self, parts, uncertainty):
        """Return the distribution of the careful answers of all people, by object."""
        location, shift, log_spread, log_odds, cuts = parts
        some = slice(None, None, -(-len(shift) // _MOST_PEOPLE))
        care = expit(-log_odds)[some]
        borders = (cuts - shift[some, None]) / np.exp(log_spread)[some, None]
        below = np.zeros((len(location), len(cuts)))
        nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
        for node, weight in zip(nodes, weights / weights.sum()):
            place = location + np.sqrt(uncertainty) * node
            for border, share in zip(borders, care / care.sum()):
                below += weight * share * expit(border - place[:, None])
        return np.maximum(np.diff(below, axis=1, prepend=0, append=1), 0)
