"""Corpora of a study: procedures in memory or loaded, their trials and ratings."""

import re
from collections.abc import Mapping
from functools import partial

import numpy as np
import pandas as pd
from sklearn.utils import Bunch

from ..ratings._checks import check_ratings
from ..ratings._levels import are_counts, in_order_of_levels, levels_of_columns
from ..recordings._biotac import PROCEDURES, SENSORS
from ..utils._row_order import check_order
from ..utils._validation import lossless_array


def open_corpus(corpus):
    """Return a corpus as a function, with the procedures and sensors that it knows.

    Parameters
    ----------
    corpus : callable, or mapping of str to Bunch or dict
        As `run_study` takes it.

    Returns
    -------
    load : callable
        Takes ``procedure=`` and ``sensors=`` and returns a Bunch.
    procedures, sensors : list of str

    Raises
    ------
    ValueError
        If a mapping has no procedures, or a procedure lacks trials, objects, ratings or
        a sensor, or names its trials in another order elsewhere.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from sklearn_haptic.study._corpus import open_corpus
    >>> touches = {
    ...     "trials": pd.DataFrame({"mic": [np.zeros((9, 1)), np.ones((7, 1))]}),
    ...     "objects": ["cork", "felt"],
    ...     "ratings": {"hard": np.array([[3, 1], [0, 4]])},
    ... }
    >>> load, procedures, sensors = open_corpus({"tap": touches})
    >>> procedures, sensors
    (['tap'], ['mic'])
    >>> load(procedure="tap", sensors=["mic"]).objects
    ['cork', 'felt']
    """
    if not isinstance(corpus, Mapping):
        return corpus, list(PROCEDURES), list(SENSORS)
    if not corpus:
        raise ValueError("corpus has no procedures; give one at least.")
    shared, levels = None, {}
    for procedure, touches in corpus.items():
        try:
            trials, ratings = touches["trials"], touches["ratings"]
            sensors = [sensor for sensor in trials.columns if isinstance(sensor, str)]
            lengths = {len(touches["objects"]), *map(len, ratings.values())}
            fits = isinstance(procedure, str) and lengths == {len(trials)}
        except (TypeError, KeyError, AttributeError, IndexError):
            fits = False
        if not fits:
            raise ValueError(
                f"corpus[{procedure!r}] is no procedure; give, under a name that is "
                "text, a dict or Bunch of trials (a DataFrame with one row per trial "
                "and one column per sensor, named by text), objects (one id per trial) "
                "and ratings (a dict from each adjective to one row of counts per "
                "trial)."
            )
        check_order(trials, touches["objects"], "objects", "trials")
        for adjective, counts in ratings.items():
            name = f"ratings[{adjective!r}]"
            check_order(trials, counts, name, "trials")
            own = _levels_of(counts, name)
            if own != levels.setdefault(adjective, own):
                raise ValueError(
                    f"corpus[{procedure!r}] has the levels {own} of {adjective!r}, but "
                    f"another procedure has {levels[adjective]}; give counts of the "
                    "same levels."
                )
        shared = [s for s in sensors if shared is None or s in shared]
    if not shared:
        raise ValueError(
            "The procedures of corpus have no sensor in common; give them the same "
            "columns of trials, or make one study per procedure."
        )
    return partial(_take, corpus), [*corpus], shared


def _levels_of(ratings, name):
    if not are_counts(ratings, name):
        return check_ratings(ratings, name=name)[1].tolist()
    named, _ = levels_of_columns(ratings, None, name)
    return [*range(1, np.shape(ratings)[-1] + 1)] if named is None else named.tolist()


def _take(corpus, *, procedure, sensors):
    """Return the touches of a procedure, of the sensors asked for alone."""
    touches = corpus[procedure]
    return Bunch(**{**touches, "trials": touches["trials"][sensors]})


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
    columns, levels = names_of_trials(corpus), study.regressor.levels
    levels = levels if levels is None else lossless_array(levels)
    for adjective, counts in corpus.ratings.items():
        name = f"ratings[{adjective!r}]"
        if not are_counts(counts, name):
            counts = check_ratings(counts, levels, name=name)[0].astype(int)
        _, order = levels_of_columns(counts, levels, name)
        counts = in_order_of_levels(np.asarray(counts), order)
        for k, count in enumerate(counts.T, start=1):
            columns[f"{adjective}_{k}"] = count
    for adjective, proba in corpus.get("true_proba", {}).items():
        _, order = levels_of_columns(proba, levels, f"true_proba[{adjective!r}]")
        proba = in_order_of_levels(np.asarray(proba, dtype=float), order)
        for k, p in enumerate(proba.T, start=1):
            columns[f"{adjective}_{k}_true"] = p
    return pd.DataFrame(columns), {}


def names_of_trials(corpus):
    """Return the name and the object of each trial, as whole numbers or text."""
    ids = {"trial": corpus.trials.index, "object": corpus.objects}
    for what, each in ids.items():
        ids[what] = np.array(list(each))
        kind = pd.api.types.infer_dtype(list(each), skipna=False)
        if kind not in ("integer", "string") or ids[what].dtype.hasobject:
            raise ValueError(
                f"The {what}s of the corpus are named by {kind} values; name all by "
                "whole numbers of at most 64 bits, or all by text."
            )
    return ids


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
