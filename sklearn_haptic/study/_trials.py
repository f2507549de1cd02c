"""The trials of a procedure: their names, their objects and the counts of ratings."""

import re
from collections import Counter
from numbers import Integral

import numpy as np
import pandas as pd

from ._store import check_text


def compute_trials(study, procedure):
    """Return a table of trials, one row per trial, and an empty record.

    Columns: ``trial``, its name; ``object``; and, for each adjective and level such as
    ``rough_1``, how many people chose that level; and where the corpus knows the
    truth, such as ``rough_1_true``, the probability of that level in the population.
    """
    corpus = study.corpus(procedure=procedure, sensors=study.sensors[:1])
    if not corpus.ratings:
        raise ValueError(
            "The corpus has no ratings; give load_phac2 the ratings as ratings=."
        )
    columns = names_of_trials(corpus)
    for adjective, counts in corpus.ratings.items():
        check_text(adjective, "The adjective")
        for k, count in enumerate(np.asarray(counts).T, start=1):
            columns[f"{adjective}_{k}"] = count
    for adjective, proba in corpus.get("true_proba", {}).items():
        for k, p in enumerate(np.asarray(proba, dtype=float).T, start=1):
            columns[f"{adjective}_{k}_true"] = p
    return pd.DataFrame(columns), {}


def names_of_trials(corpus):
    """Return the name and the object of each trial, as whole numbers or text.

    Raises
    ------
    ValueError
        If one is missing or of another type, or two trials share a name.
    """
    names = check_ids(corpus.trials.index, "The index of the corpus's trials")
    name, count = Counter(names.tolist()).most_common(1)[0]
    if count > 1:
        raise ValueError(
            f"The corpus has {count} trials named {name!r} in the index of its trials; "
            "give each a name of its own."
        )
    return {"trial": names, "object": check_ids(corpus.objects, "corpus.objects")}


def check_ids(ids, name):
    """Return ids unchanged, as an array of whole numbers or of text.

    Parameters
    ----------
    ids : array-like of shape (n_trials,)
    name : str
        What error messages call them.

    Returns
    -------
    ids : ndarray of int or object of shape (n_trials,)

    Raises
    ------
    ValueError
        If there are no ids, one is neither a whole number nor text, numbers and text
        are mixed, a number has more than 64 bits, or text has control characters.

    Examples
    --------
    >>> from sklearn_haptic.study._trials import check_ids
    >>> check_ids(["007", "7"], "objects")
    array(['007', '7'], dtype=object)
    """
    ids = list(ids)
    if not ids:
        raise ValueError(f"{name} is empty; give at least one trial.")
    kind = str if isinstance(ids[0], str) else Integral
    for i, each in enumerate(ids):
        if not isinstance(each, kind) or isinstance(each, bool):
            raise ValueError(
                f"{name} has {each!r} in place {i}; give whole numbers for all trials, "
                "or text for all."
            )
        if kind is str:
            check_text(each, f"{name} has the name")
    if kind is str:
        return np.array(ids, dtype=object)
    numbers = np.array(ids)
    if numbers.dtype.kind not in "iu":
        raise ValueError(f"{name} has numbers beyond 64 bits; give them as text.")
    return numbers


def adjectives_of(trials):
    """Return the adjectives in a table made by `compute_trials`."""
    counts = trials.filter(regex=r"_\d+$").columns
    return list(dict.fromkeys(name.rpartition("_")[0] for name in counts))


def counts_of(trials, adjective):
    """Return counts (n_trials, n_levels) from a table made by `compute_trials`."""
    return trials.filter(regex=rf"^{re.escape(adjective)}_\d+$").to_numpy()


def truth_of(trials, adjective):
    """Return probabilities (n_trials, n_levels); no columns if they are not known."""
    return trials.filter(regex=rf"^{re.escape(adjective)}_\d+_true$").to_numpy()
