"""How far the counts of an object are drawn towards those of the others."""

import numpy as np

from ._distributions import cdf, shares

# Candidates for the strength, in people.
_STRENGTHS = np.r_[0, 2.0 ** np.arange(-3, 11, 0.5), np.inf]


def mean_of_others(counts):
    """Return the mean distribution of all other objects, for each object."""
    if len(counts) < 2:
        raise ValueError("counts has one object; shrinkage needs others beside it.")
    share = shares(counts)
    return np.maximum(share.sum(axis=0) - share, 0) / (len(share) - 1)


def leave_one_out_strength(counts):
    """Choose the strength, in people, by which the others best predict each rating."""
    if (counts % 1 != 0).any():
        raise ValueError(
            "counts must be whole numbers of people, of whom one is left out at a time."
        )
    population = cdf(mean_of_others(counts))[:, :-1]
    several = counts.sum(axis=1) >= 2
    if not several.any():
        raise ValueError(
            "counts has no object with two ratings, so that no strength can be chosen "
            "by leaving one out; have some objects rated again, or give strength."
        )
    counts, population = counts[several], population[several]
    n = counts.sum(axis=1, keepdims=True)
    below, share = np.cumsum(counts, axis=1)[:, :-1], cdf(counts)[:, :-1]

    def score(strength):
        kept = 0 if np.isinf(strength) else 1 / (n - 1 + strength)
        drawn = 1 - (n - 1) * kept
        of_lower = (below - 1) * kept + drawn * population  # a rating here or below
        of_higher = below * kept + drawn * population
        return (share * (of_lower - 1) ** 2 + (1 - share) * of_higher**2).sum()

    return float(_STRENGTHS[np.argmin([score(each) for each in _STRENGTHS])])
