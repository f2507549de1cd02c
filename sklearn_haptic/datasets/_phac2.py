"""The Penn Haptic Adjective Corpus 2 (PHAC-2): raw trials from its HDF5 file.

A robot with two BioTac fingers squeezed, held and slid over 60 objects, ten times
each. A trial is a group ``<object>_<id>_<run>`` at the root of the file; the state of
the robot's controller marks which rows belong to which exploratory procedure.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils import Bunch

from ..ratings import RatingTable
from ..recordings._biotac import (
    PROCEDURES,
    SENSORS,
    Procedure,
    check_procedures,
    columns_of,
    rates_of,
)
from ..utils._sklearn import Names, StrOptions, validate_params
from ..utils._validation import check_names
from ._hdf5 import check_stored, get_node, names_in, open_hdf5, place_of, read_rows
from ._matlab_ratings import LEVELS, MatlabRatings
from ._phac2_ratings import rate_trials

PROCEDURE_STATES = {
    "squeeze": b"SQUEEZE_SET_PRESSURE_SLOW",
    "hold": b"HOLD_FOR_10_SECONDS",
    "slow_slide": b"SLIDE_5CM",
    "fast_slide": b"MOVE_DOWN_5CM",
}
REST_STATE = b"MOVE_ARM_START_POSITION"
REST_FRAMES = (100, 110)

FINGERS = ["finger_0", "finger_1"]
# Object, id and run; ids of more digits do not fit in 64 bits.
_TRIAL_NAME = re.compile(r"(.*)_(\d{1,18})_(\d{1,18})", re.DOTALL)
NOT_TRIALS = ("adjectives", "train_test", "validation")

DESCR = """\
Penn Haptic Adjective Corpus 2 (PHAC-2)
=======================================

Recordings of a PR2 robot that touched objects with two BioTac fingers, by four
exploratory procedures: squeeze, hold, slow slide and fast slide. The whole corpus has
60 everyday objects touched ten times each, and twelve people rated each of them from
1 to 5 on ten haptic adjectives. Its pilot recordings have the same layout: five
materials, touched 74 times in all, without ratings. What a file holds is told by
``describe_corpus``.

:Source: Edmond, the open research data repository of the Max Planck Society,
    https://doi.org/10.17617/3.0C79KW
:Files: ``phac_train_test_pos_neg_90_10_1_20.h5`` (472 MB: all 600 trials) and a
    small MATLAB file (the ratings)
:Licence: CC BY-SA 4.0
:Reference: B. A. Richardson and K. J. Kuchenbecker, "Learning to predict perceptual
    distributions of haptic adjectives", Frontiers in Neurorobotics 13:116, 2020,
    https://doi.org/10.3389/fnbot.2019.00116
"""


@validate_params(
    {
        "path": [str, os.PathLike],
        "procedure": [StrOptions(set(PROCEDURES)), "array-like"],
        "sensors": ["array-like", None],
        "trials": ["array-like", None],
        "ratings": "no_validation",
        "remove_baseline": ["boolean"],
    },
    prefer_skip_nested_validation=True,
)
def load_phac2(
    path: str | os.PathLike[str],
    *,
    procedure: Procedure | Sequence[Procedure] = "hold",
    sensors: Names | None = None,
    trials: Names | None = None,
    ratings: str
    | os.PathLike[str]
    | MatlabRatings
    | Mapping[str, RatingTable | pd.DataFrame]
    | ArrayLike
    | None = None,
    remove_baseline: bool = True,
) -> Bunch:
    """Load one or several exploratory procedures of the PHAC-2 corpus.

    Only the sensors, trials and rows asked for are read. Download the files from
    https://doi.org/10.17617/3.0C79KW (CC BY-SA 4.0). Requires h5py:
    ``pip install h5py``.

    Parameters
    ----------
    path : str or path-like
        The HDF5 file of trials, ``phac_train_test_pos_neg_90_10_1_20.h5`` or
        another of the same layout.
    procedure : {"squeeze", "hold", "slow_slide", "fast_slide"} or list of them, \
            default="hold"
        The exploratory procedure, whose rows are those in which the controller was in
        its state. If the state recurs, its stretches are joined. Of a list, each trial
        has all procedures, in columns such as ``"hold_pac"``.
    sensors : array-like of str, default=None
        Some of ``"pac"``, ``"pdc"``, ``"tac"``, ``"tdc"`` and ``"electrodes"``, in
        the order of the columns wanted; by default all, in this order.
    trials : array-like of str, default=None
        Names of trials, such as ``"kitchen_sponge_114_10"``, in the order of the rows
        wanted; by default all, ordered by object id, then run.
    ratings : path, DataFrame, dict or MatlabRatings, default=None
        What people answered about the objects, in one of three forms:

        - a table with one row per answer, as a DataFrame of pandas or polars or the
          path of a CSV file in UTF-8, with the columns ``object`` (its id), ``rater``,
          ``adjective`` and ``rating``. A missing rating is left out, and nobody may
          answer twice;
        - a dict with the counts of each adjective: a
          :class:`~sklearn_haptic.ratings.RatingTable`, or a pandas.DataFrame indexed
          by the objects' ids, with one column per level;
        - a :class:`~sklearn_haptic.datasets.MatlabRatings`.

        The levels are 1 to 5, or else the ordered categories of the column ``rating``
        (of pandas, or an Enum of polars), or those that the counts are of.
    remove_baseline : bool, default=True
        Subtract from each channel its mean at rest in the same trial: over the rows
        in which the arm moves to its start, or rows 100 to 109 if there are none.
        The level at rest differs between fingers and drifts over the day. That of
        temperature drifts by ten times what contact adds and, as the trials of an
        object are recorded together, can give the object away. Signs are kept, unlike
        in the code of the corpus's authors, which negates.

    Returns
    -------
    corpus : :class:`~sklearn.utils.Bunch`
        Dictionary-like object with attributes:

        trials : DataFrame of shape (n_trials, n_sensors)
            One row per trial, named by the index, and one column per sensor. Each cell
            is a float32 array in counts of the 12-bit converter, with n frames of
            10 ms: pac ``(22 * n, 2)``; pdc, tac and tdc ``(n, 2)``, with one column per
            finger; electrodes ``(n, 38)``, the 19 of finger 0, then those of finger 1.
            With a single finger, the shapes are ``(22 * n, 1)``, ``(n, 1)`` and
            ``(n, 19)``.
        objects : ndarray of shape (n_trials,)
            The id of each trial's object, for grouped cross-validation.
        object_names : ndarray of shape (n_trials,)
            The name of each trial's object. Some names belong to two objects.
        ratings : dict of str to ndarray of shape (n_trials, n_levels)
            For each adjective, how many people gave each trial's object each level.
            Empty without ``ratings``.
        rater_ratings : DataFrame of shape (n_rated, n_adjectives) or None
            Each person's answers, as :func:`~sklearn_haptic.ratings.rating_counts` and
            :func:`~sklearn_haptic.ratings.adjective_correlation` take them: one row per
            object and person who rated it, both in the index, and one column per
            adjective, NaN where a rating is missing. A person is the ``rater`` of the
            table, or the place in the MATLAB array, from 1; only the file's authors
            know whether a place means the same person for two objects. None without
            ``ratings``, or if they are counts.
        levels : ndarray of shape (n_levels,)
            The levels, lowest first: 1 to 5 unless ``ratings`` has others.
        sampling_rates : dict of str to int
            Samples per second of each sensor.
        DESCR : str
            What the corpus is and where it comes from.

    Raises
    ------
    ImportError
        If h5py is not installed.
    FileNotFoundError
        If a file is missing.
    OSError
        If a file is not of its format, is cut short or damaged, or is being written by
        another process; if a dataset declares more values than the file holds: more
        than were written, or more than 100 times the size of the file and 256 MiB.
    ValueError
        If a name is unknown; if a trial lacks the procedure or a sensor, or holds
        data of another shape or type; if some trials have one finger and others two;
        if the file links elsewhere; or if the ratings are not where they are said to
        be, lack an object, have one that the corpus does not have, have a rating that
        is no level, or have two answers of one person.

    Notes
    -----
    The published files have the MD5 sums ``1817bda104b97167b93f80d920f0afa3`` (trials)
    and ``8212ded8c50401787c684b46a7b86860`` (ratings). Damage to the structure of a
    file is noticed; damage to values without a checksum shows only in these sums.

    References
    ----------
    .. [1] Richardson and Kuchenbecker (2020). :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.datasets import load_phac2
    >>> corpus = load_phac2(
    ...     "phac_train_test_pos_neg_90_10_1_20.h5",
    ...     procedure="slow_slide",
    ...     sensors=["pac", "electrodes"],
    ... )  # doctest: +SKIP
    >>> corpus.trials.loc["kitchen_sponge_114_10", "electrodes"].shape
    ... # doctest: +SKIP
    (500, 38)

    With ratings from a table:

    >>> corpus = load_phac2(
    ...     "phac_train_test_pos_neg_90_10_1_20.h5", ratings="answers.csv"
    ... )  # doctest: +SKIP
    >>> corpus.ratings["hard"].shape  # doctest: +SKIP
    (600, 5)
    """
    sensors = check_names(sensors, list(SENSORS), "sensor", "the corpus")
    procedures = check_procedures(procedure, "the corpus")
    columns = sensors if isinstance(procedure, str) else columns_of(procedures, sensors)
    with open_hdf5(path) as file:
        parsed = _parse_trial_names(file)
        names = check_names(trials, sorted(parsed, key=parsed.get), "trial", path)
        objects = np.array([parsed[name][0] for name in names])
        counts, levels, answers = {}, LEVELS.copy(), None
        if ratings is not None:
            known = {object_id for object_id, _, _ in parsed.values()}
            counts, levels, answers = rate_trials(ratings, objects, known)
        cells = {column: np.empty(len(names), dtype=object) for column in columns}
        for i, name in enumerate(names):
            trial = get_node(file, name)
            fingers = _fingers(trial)
            if i == 0:
                first = fingers
            elif fingers != first:
                raise ValueError(
                    f"Trial {name!r} of {path} has {' and '.join(fingers)}, but trial "
                    f"{names[0]!r} has {' and '.join(first)}; load the ones apart from "
                    "the others through trials=."
                )
            signals = _read_trial(trial, fingers, procedures, sensors, remove_baseline)
            for column, signal in zip(columns, signals):
                cells[column][i] = signal
    return Bunch(
        trials=pd.DataFrame(cells, index=pd.Index(names, name="trial", dtype=object)),
        objects=objects,
        object_names=np.array([parsed[name][2] for name in names]),
        ratings=counts,
        rater_ratings=answers,
        levels=levels,
        sampling_rates=rates_of(columns),
        DESCR=DESCR,
    )


def _parse_trial_names(file):
    """Return {trial: (object id, run, object name)}, parsed from the right."""
    parsed, name_of = {}, {}
    for name in names_in(file):
        parts = _TRIAL_NAME.fullmatch(name)
        if parts is None and name.startswith(NOT_TRIALS):
            continue
        if parts is None:
            raise ValueError(
                f"{name!r} at the root of {file.filename} is no trial; trials are "
                "named <object>_<id>_<run>, such as 'kitchen_sponge_114_10'."
            )
        object_id, run, object_name = int(parts[2]), int(parts[3]), parts[1].rstrip("_")
        if name_of.setdefault(object_id, object_name) != object_name:
            raise ValueError(
                f"{file.filename} has two objects of id {object_id}, "
                f"{name_of[object_id]!r} and {object_name!r}; give each its own."
            )
        parsed[name] = object_id, run, object_name
    if not parsed:
        raise ValueError(
            f"{file.filename} has no trials; give a file with groups named "
            "<object>_<id>_<run> at its root."
        )
    return parsed


def _fingers(trial):
    """Return the fingers that a trial has, one or both."""
    biotacs = get_node(trial, "biotacs")
    there = names_in(biotacs) if hasattr(biotacs, "keys") else []
    return [finger for finger in FINGERS if finger in there] or FINGERS[:1]


def _read_trial(trial, fingers, procedures, sensors, remove_baseline):
    """Yield arrays of shape (n_times, n_channels), sensor by sensor in a procedure."""
    dataset = get_node(trial, "state/controller_detail_state")
    check_stored(dataset, "S")
    if dataset.ndim != 1:
        raise ValueError(_shape_error(dataset, "(n_frames,)"))
    states = read_rows(dataset)
    rest = None
    for procedure in procedures:
        rows = _procedure_rows(trial, states, procedure)
        if remove_baseline and rest is None:
            rest = _rest_rows(trial, states)
        for sensor in sensors:
            signals = [
                _read_finger(trial, finger, sensor, len(states), rows, rest)
                for finger in fingers
            ]
            yield np.hstack(signals)


def _procedure_rows(trial, states, procedure):
    rows = _stretches(states == PROCEDURE_STATES[procedure])
    if len(rows) == 0:
        found = [state.decode("ascii", "replace") for state in np.unique(states)]
        raise ValueError(
            f"Trial {trial.name[1:]!r} of {trial.file.filename} has no procedure "
            f"{procedure!r}: its states are {found}. Leave the trial out through "
            "trials=."
        )
    return rows


def _rest_rows(trial, states):
    rest = _stretches(states == REST_STATE)
    if len(rest) > 0:
        return rest
    if len(states) < REST_FRAMES[1]:
        raise ValueError(
            f"Trial {trial.name[1:]!r} of {trial.file.filename} has no state "
            f"{REST_STATE.decode()} and only {len(states)} rows, so no rest level; "
            "use remove_baseline=False."
        )
    return [REST_FRAMES]


def _stretches(mask):
    """Return the (start, stop) of each run of true values."""
    edges = np.diff(mask.astype(np.int8), prepend=0, append=0)
    return np.flatnonzero(edges).reshape(-1, 2)


def _read_finger(trial, finger, sensor, n_frames, rows, rest):
    """Return one finger's signal, less its mean at rest, as (n_times, n_channels)."""
    dataset = get_node(trial, f"biotacs/{finger}/{sensor}")
    check_stored(dataset, "iuf")
    n_samples, n_channels = SENSORS[sensor]
    width = n_samples * n_channels
    shape = (n_frames, width) if width > 1 else (n_frames,)
    if dataset.shape != shape:
        raise ValueError(_shape_error(dataset, f"{shape}, one row per state"))
    signal = _read_stretches(dataset, rows).reshape(-1, n_channels)
    if rest is not None:
        signal = signal - _read_stretches(dataset, rest).reshape(-1, n_channels).mean(0)
    with np.errstate(over="ignore"):
        signal = signal.astype(np.float32)
    finite = np.isfinite(signal).all(axis=1)
    if not finite.all():
        raise ValueError(
            f"{place_of(dataset)} has NaN or infinity in sample {np.argmin(finite)} of "
            "the procedure or at rest; leave the trial out through trials=."
        )
    return signal


def _read_stretches(dataset, stretches):
    return np.concatenate(
        [read_rows(dataset, slice(start, stop)) for start, stop in stretches]
    )


def _shape_error(dataset, wanted):
    return f"{place_of(dataset)} has shape {dataset.shape}; it must be {wanted}."
