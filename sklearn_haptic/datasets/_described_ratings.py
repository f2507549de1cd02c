"""How many people rated what, and how far they agree: tables of a description."""

from collections.abc import Mapping
from numbers import Real

import numpy as np
import pandas as pd
from sklearn.utils.validation import check_consistent_length

from .._check_ratings import check_counts, match_levels
from .._distributions import shares
from .._validation import check_regular, drop_missing
from ..ratings import interrater_agreement


def describe_ratings(ratings, objects, levels, n_trials):
    """Return the tables of ratings, and what was rated."""
    if ratings is None or (isinstance(ratings, Mapping) and not ratings):
        return {"ratings": None, "shares": None, "rated": None}
    if not isinstance(ratings, Mapping):
        ratings = {"ratings": ratings}
    counts, levels_of = {}, {}
    for name, y in ratings.items():
        check_consistent_length(y, np.empty(n_trials))
        counts[name], levels_of[name] = _counts(y, levels, f"ratings[{name!r}]")
    rated = "trial"
    if objects is not None:
        _, first, which = np.unique(objects, return_index=True, return_inverse=True)
        if all(np.array_equal(each, each[first][which]) for each in counts.values()):
            rated = "object"
            counts = {name: each[first] for name, each in counts.items()}
    names = pd.Index(list(counts), name="adjective", dtype=object)
    table = pd.DataFrame([_rating_row(each) for each in counts.values()], index=names)
    shares = pd.concat(
        [pd.Series(_mean_shares(counts[name]), levels_of[name]) for name in counts],
        axis=1,
        keys=names,
    ).T
    several = any(
        not np.array_equal(each, shares.columns) for each in levels_of.values()
    )
    if several and all(isinstance(level, Real) for level in shares):
        shares = shares.sort_index(axis=1)  # scales that differ, lowest level first
    return {
        "ratings": table,
        "shares": shares,
        "rated": rated,
    }


def _counts(y, levels, name):
    """Return counts of shape (n_trials, n_levels), 0 where unrated, and the levels."""
    shape = check_regular(y, name).shape
    if len(shape) > 2:
        raise ValueError(
            f"{name} has shape {shape}; give a dict with the counts of each adjective."
        )
    if len(shape) == 1 or shape[1] == 1:
        ratings, given = drop_missing(y, name)
        matches, levels = match_levels(
            ratings, y, levels, name, rows=np.flatnonzero(given)
        )
        counts = np.zeros((len(given), len(levels)))
        counts[given] = matches
        return counts, levels
    counts, levels = check_counts(y, levels, name=name, unrated=True)
    if not counts.any():
        raise ValueError(f"{name} has no ratings at all; leave it out.")
    return counts, levels


def _rating_row(counts):
    """Return a row of the table of ratings."""
    people = counts.sum(axis=1)
    rated, several = people[people > 0], counts[people >= 2]
    agreement = interrater_agreement(several) if len(several) else np.array([np.nan])
    return {
        "n_rated": len(rated),
        "fewest": rated.min(),
        "most": rated.max(),
        "agreement": np.median(agreement),
        "least_agreement": agreement.min(),
    }


def _mean_shares(counts):
    return shares(counts[counts.any(axis=1)]).mean(axis=0)
