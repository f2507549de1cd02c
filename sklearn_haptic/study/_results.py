"""The tables of everything that a study has finished."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import pandas as pd
from sklearn.utils import Bunch

from ._corpus import adjectives_of
from ._models import CHOSEN
from ._store import read_settings, read_table, unit_path
from ._study import count_folds


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
            each level, numbered from the lowest; and ``count_1``, …, how many people
            chose it. Of single ratings, levels are those that occur.
        networks : DataFrame
            The same of each network as it was fitted when it was chosen, one row per
            network and test trial: ``network`` is the sensor, or "combined", and there
            is no ``held_out`` and no ``start``.
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
    settings = read_settings(folder)
    units = []
    for procedure in sorted(settings["procedures"]):
        if not unit_path(folder, ("trials", procedure)).exists():
            continue
        trials, _ = read_table(folder, ("trials", procedure))
        for adjective in sorted(adjectives_of(trials)):
            for fold in range(count_folds(settings)):
                name = {"procedure": procedure, "adjective": adjective, "fold": fold}
                unit = ("models", *name.values())
                if unit_path(folder, unit).exists():
                    units.append((name, *read_table(folder, unit)))
    if not units:
        raise ValueError(f"{folder} has no finished models yet; run_study makes them.")
    scores = pd.concat([table for _, table, _ in units], ignore_index=True)
    chosen = scores["start"] == CHOSEN
    networks = scores[chosen].drop(columns=["held_out", "start"])
    return Bunch(
        scores=scores[~chosen].drop(columns="network").reset_index(drop=True),
        networks=networks.reset_index(drop=True),
        **{
            what: pd.DataFrame(
                [name | row for name, _, record in units for row in record[what]]
            )
            for what in ("choices", "baselines", "truth")
        },
    )
