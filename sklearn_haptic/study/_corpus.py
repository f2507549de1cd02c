"""Corpora of a study: functions that load a procedure, or procedures in memory."""

from collections.abc import Mapping
from functools import partial

import pandas as pd
from sklearn.utils import Bunch

from ..recordings._biotac import PROCEDURES, SENSORS

# What a procedure consists of.
_KINDS = {"trials": pd.DataFrame, "objects": object, "ratings": Mapping}


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
        If a mapping has no procedures, their names could be mistaken for each other, or
        a procedure lacks trials, objects, ratings or a sensor.

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
    if not corpus or not all(isinstance(each, Mapping) for each in corpus.values()):
        raise ValueError(
            "corpus is a dict, but not of procedures; give one Bunch or dict with "
            "trials, objects and ratings per procedure, such as {'tap': {...}}."
        )
    for procedure, touches in corpus.items():
        for name, kind in _KINDS.items():
            given = name in touches
            if not given or not isinstance(touches[name], kind):
                fault = f"{name} that are no {kind.__name__}" if given else f"no {name}"
                raise ValueError(
                    f"corpus[{procedure!r}] has {fault}; give trials (a DataFrame with "
                    "one row per trial and one column per sensor), objects (one id per "
                    "trial) and ratings (a dict from each adjective to its counts)."
                )
        columns = [("objects", touches["objects"]), *touches["ratings"].items()]
        for name, values in columns:
            if len(values) != len(touches["trials"]):
                raise ValueError(
                    f"corpus[{procedure!r}] has {len(touches['trials'])} trials, but "
                    f"{len(values)} rows of {name!r}; give one row per trial."
                )
    procedures = check_file_names([*corpus], "procedure")
    shared = [
        sensor
        for sensor in corpus[procedures[0]]["trials"].columns
        if all(sensor in corpus[p]["trials"] for p in procedures)
    ]
    if not shared:
        raise ValueError(
            "The procedures of corpus have no sensor in common; give them the same "
            "columns of trials, or make one study per procedure."
        )
    check_file_names(shared, "sensor")
    return partial(_take, corpus), procedures, shared


def _take(corpus, *, procedure, sensors):
    """Return the touches of a procedure, of the sensors asked for alone."""
    touches = corpus[procedure]
    return Bunch(**{**touches, "trials": touches["trials"][sensors]})


def check_file_names(names, what):
    """Refuse names that could be mistaken in the name of a unit's file.

    ``"slide"`` and ``"slide_fast"`` could: the file of ``("slide", "fast_soft")`` is
    that of ``("slide_fast", "soft")``.
    """
    for name in names:
        if not isinstance(name, str) or not name:
            raise ValueError(f"corpus has the {what} {name!r}; name it by text.")
        for other in names:
            if other != name and str(other).startswith(f"{name}_"):
                raise ValueError(
                    f"corpus has the {what}s {name!r} and {other!r}, whose files could "
                    "be mistaken for each other; rename one so that it does not begin "
                    f"with '{name}_'."
                )
    return names
