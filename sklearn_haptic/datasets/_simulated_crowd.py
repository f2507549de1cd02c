"""Simulated people who rate how objects feel.

Each person perceives six qualities of an object, imperfectly, and turns them into ten
ratings from 1 to 5 with habits of their own. All errors are normal, so the
distribution of ratings in the whole population is known exactly: it is a cumulative
probit model.
"""

import numpy as np
from scipy.special import ndtr

PERCEPTS = ("firm", "rough", "slick", "cold", "lively", "tacky")
LEVELS = np.arange(1, 6)
_CUTS = LEVELS[:-1] + 0.5

# Per adjective: mean rating of an average object; rating points per standard deviation
# (sd) of each percept, in the order of PERCEPTS; sd of a person's error.
_ADJECTIVES = {
    "hard": (3.0, (2.2, 0, 0, 0, 0, 0), 0.35),
    "soft": (2.5, (-1.7, -0.7, 0, 0, 0, 0), 0.45),
    "rough": (1.4, (0, 1.3, 0, 0, 0, 0), 0.50),
    "smooth": (3.0, (0.4, -1.5, 0.4, 0, 0, 0), 0.75),
    "slippery": (1.7, (0.3, -0.6, 0.8, 0, 0, 0), 0.50),
    "sticky": (0.5, (0, 0, 0, 0, 0, 0.4), 0.45),
    "cold": (1.6, (0.2, 0, 0, 1.2, 0, 0), 0.45),
    "warm": (1.2, (-0.1, 0, 0, -0.4, 0, 0), 0.70),
    "moldable": (2.3, (-1.2, 0, 0, 0, 0.8, 0), 0.80),
    "springy": (2.3, (-1.1, 0, 0, 0, 1.1, 0), 0.80),
}
ADJECTIVES = tuple(_ADJECTIVES)
_MEANS = np.array([mean for mean, _, _ in _ADJECTIVES.values()])
_LOADINGS = np.array([loading for _, loading, _ in _ADJECTIVES.values()], float).T
_ERRORS = np.array([error for _, _, error in _ADJECTIVES.values()])
# Sd of one person's perception of each percept, in units of the percept's sd.
_PERCEPTION = np.array([0.25, 0.4, 0.4, 0.35, 0.7, 0.4])
_BIAS = 0.3  # sd of a person's shift of an adjective's ratings
_STRETCH = 0.15  # sd of a person's relative use of the scale about its middle


def population(percepts):
    """Return the distribution of ratings in the whole population.

    Percepts are standard scores of shape (n_objects, 6), in the order of ``PERCEPTS``;
    the probabilities of each level of each adjective have the shape (n_objects, 10, 5).
    """
    centre = _MEANS + percepts @ _LOADINGS
    variance = (
        _ERRORS**2
        + _BIAS**2
        + _PERCEPTION**2 @ _LOADINGS**2
        + _STRETCH**2 * (centre - 3) ** 2
    )
    below = ndtr((_CUTS - centre[..., None]) / np.sqrt(variance)[..., None])
    return np.diff(below, axis=-1, prepend=0.0, append=1.0)


def rate(percepts, groups, n_raters, rng):
    """Draw the ratings of disjoint groups of people, each with its own objects.

    Percepts are as in `population`; `groups` tells which group of people, of `n_raters`
    each, rates each object. The levels, from 1 to 5, have the shape (n_objects,
    n_raters, 10).
    """
    people = (groups.max() + 1, n_raters, len(ADJECTIVES))
    bias = rng.normal(scale=_BIAS, size=people)[groups]
    stretch = rng.normal(scale=_STRETCH, size=people)[groups]
    shape = (len(percepts), n_raters)
    slips = rng.normal(scale=_PERCEPTION, size=(*shape, len(PERCEPTS)))
    errors = rng.normal(scale=_ERRORS, size=(*shape, len(ADJECTIVES)))
    centre = (_MEANS + percepts @ _LOADINGS)[:, None]
    latent = centre + stretch * (centre - 3) + bias + slips @ _LOADINGS + errors
    return 1 + np.searchsorted(_CUTS, latent)
