"""Ratings of objects or trials, and those that the trials of a corpus have."""

import re
from collections.abc import Iterable, Mapping
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from .._validation import is_missing

ADJECTIVES = (
    *("hard", "soft", "rough", "smooth", "slippery"),
    *("sticky", "cold", "warm", "moldable", "springy"),
)
LEVELS = np.arange(1, 6)
_DIGITS = re.compile("[0-9]{1,18}")  # more do not fit in 64 bits


class Rated(NamedTuple):
    """What was rated, and how."""

    source: str
    """What error messages call it."""
    by: str
    """"object" or "trial"."""
    ids: list[Any]
    """The objects or trials rated, distinct."""
    adjectives: list[str]
    counts: np.ndarray
    """Array of shape (n_ids, n_adjectives, n_levels)."""
    levels: np.ndarray
    answers: pd.DataFrame | None
    """Each person's ratings, indexed by id and person, one column per adjective."""


def ratings_of_trials(
    rated: Rated, object_of: Mapping[str, int], trials: Iterable[str]
) -> tuple[dict[str, np.ndarray], pd.DataFrame | None]:
    """Return the counts of each trial, and the answers that they count.

    `object_of` maps the name of each trial of the corpus to its object; `trials` names
    those whose ratings are wanted. Counts are a dict from each adjective to an array of
    shape (n_trials, n_levels); answers are a DataFrame of shape (n_rated, n_adjectives)
    sorted by id and person, or None. A ValueError says that something rated is not in
    the corpus, or that a trial has no rating on an adjective.
    """
    source, by, ids, adjectives, counts, _, answers = rated
    if by == "trial":
        known: set[Any] = set(object_of)
        wanted: list[Any] = list(trials)
    else:
        known = set(object_of.values())
        wanted = [object_of[trial] for trial in trials]
    unknown = [each for each in ids if each not in known]
    if unknown:
        raise ValueError(
            f"{source} has ratings of {by}s that the corpus does not have, "
            f"{unknown[:5]}{' and more' * (len(unknown) > 5)}; leave them out or mend "
            f"their ids (the corpus has {by}s such as {min(known)!r})."
        )
    row_of = {each: row for row, each in enumerate(ids)}
    for each in sorted(set(wanted)):
        if each not in row_of:
            raise ValueError(
                f"{source} has no ratings of {by} {each!r}; it has {len(ids)} {by}s "
                f"such as {min(row_of)!r}. Leave {_its_trials(by)} out through trials=."
            )
        for name, total in zip(adjectives, counts[row_of[each]].sum(axis=1)):
            if total == 0:
                raise ValueError(
                    f"{source} has no {name!r} rating of {by} {each!r}; leave "
                    f"{_its_trials(by)} out through trials=."
                )
    rows = [row_of[each] for each in wanted]
    if answers is not None:
        answers = answers[answers.index.isin(wanted, level=by)].sort_index()
    return {name: counts[rows, i] for i, name in enumerate(adjectives)}, answers


def _its_trials(by):
    return "the object's trials" if by == "object" else "the trial"


def object_ids(values: Iterable[Any], source: str) -> list[int]:
    """Return ids of objects as whole numbers, which they are in a corpus.

    Text is read as a number, so "007" and "7" are the object 7. If one is missing or no
    whole number, a ValueError is raised.
    """
    read: dict[object, int] = {}
    for value in values:
        if is_missing(value):
            raise ValueError(f"{source} lacks the object of a row; name it.")
        if value not in read:
            read[value] = _whole_number(value, source)
    return [read[value] for value in values]


def _whole_number(value, source):
    if isinstance(value, str) and _DIGITS.fullmatch(value.strip()):
        return int(value)
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if is_number and abs(value) < 2**63 and value == int(value):
        return int(value)
    raise ValueError(
        f"{source} has the object {value!r}; give the ids that the names of trials "
        "have, <object>_<id>_<run>: whole numbers such as 114."
    )
