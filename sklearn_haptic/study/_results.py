"""The tables of everything that a study has finished."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

import pandas as pd
from sklearn.utils import Bunch

from ..recordings._biotac import PROCEDURES
from ._store import read_finished, read_settings


def read_study(folder: str | PathLike[str]) -> Bunch:
    """Read what `run_study` has finished so far, without computing anything.

    Parameters
    ----------
    folder : str or path-like
        The folder of the study.

    Returns
    -------
    study : :class:`~sklearn.utils.Bunch`
        Dictionary-like object with the attributes:

        scores : DataFrame
            One row per combined model and test trial. Columns: ``procedure``,
            ``adjective`` and ``fold``; ``held_out``, the sensor left out, or "none" for
            the full model; ``start``; ``object``; ``trial``, its name; the scores that
            `sensor_contributions` gives; ``proba_1``, …, the predicted probability of
            each level; and ``count_1``, …, how many people chose it.
        sensor_scores : DataFrame
            The same of each sensor's own network, one row per network and test trial:
            ``network`` is the sensor, and there is no ``held_out`` and no ``start``,
            because it is the network that was chosen for the sensor.
        choices : DataFrame
            One row per chosen network. Columns: ``procedure``, ``adjective`` and
            ``fold``; ``network``, the sensor or "combined"; the chosen ``n_hidden`` and
            ``alpha``; and ``score``, the score on the validation objects.
        baselines : DataFrame
            Scores of predictions made without touch, two rows per ``procedure``,
            ``adjective`` and ``fold``. ``strategy`` is that of a
            :class:`~sklearn_haptic.DummyDistribution` fitted to the ratings of all
            objects not tested. The scores are means over the test trials; ``proba_1``,
            … is the predicted distribution.
        truth : DataFrame
            Scores of the distribution of the whole population, of which the raters
            are a sample, one row per ``procedure``, ``adjective`` and ``fold``; empty
            if the corpus has no ``true_proba``, as real ones have none. It is what a
            model would score that knew everything but who was asked.

        Rows are sorted by procedure, adjective and fold.

    Raises
    ------
    ValueError
        If there is no study, none of its models is finished, or a file is damaged.

    Examples
    --------
    >>> from sklearn_haptic.study import read_study
    >>> study = read_study("study")  # doctest: +SKIP
    >>> study.scores.groupby("adjective")["rps"].mean()  # doctest: +SKIP
    """
    folder = Path(folder)
    procedures = read_settings(folder).get("procedures", PROCEDURES)
    # Of files that name units of models; other files are ignored.
    name = rf"({'|'.join(re.escape(str(each)) for each in procedures)})_.*_\d+"
    units = read_finished(folder, "models", name)
    if not units:
        raise ValueError(f"{folder} has no finished models yet; run_study makes them.")
    records = [record for _, record in units]
    for table, record in units:
        if "network" not in table:
            raise ValueError(
                f"models/{record['file']} has no column 'network'; delete that file, "
                "and run_study does the unit again."
            )
    scores = pd.concat([table for table, _ in units], ignore_index=True)
    combined = scores["network"] == "combined"
    of_sensors = scores[~combined].drop(columns=["held_out", "start"], errors="ignore")
    return Bunch(
        scores=scores[combined].drop(columns="network").reset_index(drop=True),
        sensor_scores=of_sensors.reset_index(drop=True),
        choices=pd.DataFrame(_rows_of(records, "choices")),
        baselines=pd.DataFrame(_rows_of(records, "baselines")),
        truth=pd.DataFrame(_rows_of(records, "truth")),
    )


def _rows_of(records, name):
    """Return what the records of models list under a name, each with its unit."""
    rows = []
    for record in records:
        unit = dict(zip(("procedure", "adjective", "fold"), record["unit"][1:]))
        listed = record.get(name)
        if not isinstance(listed, list) or not all(isinstance(e, dict) for e in listed):
            raise ValueError(
                f"The record of models/{record['file']} has no list of {name}; delete "
                "that file, and run_study does the unit again."
            )
        rows.extend({**unit, **each} for each in listed)
    return rows
