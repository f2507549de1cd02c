"""Tables of a study: networks beside guesses and the truth, with tests over objects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.stats import friedmanchisquare, wilcoxon
from sklearn.utils import Bunch

from ..metrics import (
    earth_movers_distance,
    log_score,
    macro_mae,
    noise_ceiling,
    ranked_probability_score,
)
from ..model_selection._contributions import FULL_MODEL

_CELL = ["adjective", "procedure"]
_SCORES = {
    "macro_mae": macro_mae,
    "emd": earth_movers_distance,
    "rps": ranked_probability_score,
    "log_score": log_score,
}


def score_table(study: Bunch, *, metric: str = "macro_mae") -> pd.DataFrame:
    """Put the score of every network beside the guesses that know no touch.

    Parameters
    ----------
    study : Bunch
        As `run_study` and `read_study` return it.
    metric : str, default="macro_mae"
        Name of a score; lower is better in all.

    Returns
    -------
    table : DataFrame
        One row per adjective and procedure. Columns: ``combined``, the combined
        network, mean over starts; one for each sensor, its own network alone;
        ``marginal`` and ``barycentre``, the guesses of
        :class:`~sklearn_haptic.DummyDistribution`; ``ceiling``, what the whole
        population is expected to score, as
        :func:`~sklearn_haptic.metrics.noise_ceiling` estimates it, NaN if an object has
        fewer than two ratings or, but for the RPS, is alone or its counts are not
        whole; ``truth``, the score of the population itself, if the corpus knows it;
        and ``no_better``, whether the combined network is no better than the better
        guess. All are means over folds and test trials.

    Raises
    ------
    ValueError
        If the metric is unknown.

    Examples
    --------
    >>> from sklearn_haptic.study import read_study, score_table
    >>> table = score_table(read_study("study"), metric="rps")  # doctest: +SKIP
    >>> table["no_better"].sum()  # doctest: +SKIP
    """
    _check_metric(study, metric)
    full = study.scores[study.scores["held_out"] == FULL_MODEL]
    parts = [
        full.groupby(_CELL)[metric].mean().rename("combined"),
        *(
            table.groupby([*_CELL, of], sort=False)[metric].mean().unstack(of)
            for table, of in (
                (study.sensor_scores, "network"),
                (study.baselines, "strategy"),
            )
        ),
    ]
    if metric in _SCORES:
        cells = full.groupby(_CELL)[[c for c in full if c not in _CELL]]
        parts.append(cells.apply(_ceiling, _SCORES[metric]).rename("ceiling"))
    if len(study.truth):
        parts.append(study.truth.groupby(_CELL)[metric].mean().rename("truth"))
    table = pd.concat(parts, axis=1)
    guesses = table[study.baselines["strategy"].unique()].min(axis=1)
    return table.assign(no_better=table["combined"] >= guesses)


def _ceiling(rows, score):
    """Return what the population is expected to score at the ratings of some trials."""
    by_object = rows.groupby("object")
    counts = by_object.first().filter(regex=r"^count_\d+$").to_numpy()
    if (counts.sum(axis=1) < 2).any():
        return np.nan
    unfit = len(counts) < 2 or (counts % 1 != 0).any()
    if unfit and score is not ranked_probability_score:
        return np.nan
    weight = by_object.size().to_numpy()
    return noise_ceiling(counts, score, sample_weight=weight, random_state=0).truth


def compare_sensors(
    study: Bunch,
    *,
    metric: str = "macro_mae",
    by: str | Sequence[str] | None = None,
) -> pd.DataFrame:
    """Test whether the combined network beats the network of each single sensor.

    Parameters
    ----------
    study : Bunch
        As `run_study` and `read_study` return it.
    metric : str, default="macro_mae"
        Name of a score; lower is better in all.
    by : str or list of str, default=None
        ``"adjective"``, ``"procedure"`` or both, for each of whose values to make the
        comparison; by default one over all.

    Returns
    -------
    comparison : DataFrame
        One row per sensor, and per value of ``by``. Columns: those of ``by``;
        ``network``, the sensor; ``combined`` and ``single``, the means of the objects'
        scores; ``difference``, single less combined, positive if the combined network
        is better; ``n_objects``; and ``p_objects`` of a Wilcoxon signed-rank test
        whether the objects' differences are centred at zero.

    Raises
    ------
    ValueError
        If the metric or a value of ``by`` is unknown.

    Notes
    -----
    Both networks predict the same trials, so the test is a paired one. An object is one
    observation: its score is averaged over starts, trials, folds, and whatever else
    ``by`` does not name, because touches of one object are not independent. With fewer
    than six objects ``p_objects`` is never below 0.05. No p-value is corrected for the
    number of rows.

    Examples
    --------
    >>> from sklearn_haptic.study import compare_sensors, read_study
    >>> compare_sensors(read_study("study"), by="adjective")  # doctest: +SKIP
    """
    by = _check_by(by, _CELL)
    keys = [*_CELL, "fold", "object"]
    combined = _of_objects(study, metric, keys).rename("combined")
    single = study.sensor_scores.groupby([*keys, "network"], sort=False)[metric].mean()
    paired = single.rename("single").reset_index().join(combined, on=keys)
    rows = []
    for key, cell in paired.groupby([*by, "network"], sort=False):
        objects = cell.groupby("object")[["combined", "single"]].mean()
        difference = objects["single"] - objects["combined"]
        rows.append(
            {
                **dict(zip([*by, "network"], key)),
                **objects.mean(),
                "difference": difference.mean(),
                "n_objects": len(objects),
                "p_objects": wilcoxon(difference).pvalue if difference.any() else 1.0,
            }
        )
    return pd.DataFrame(rows)


def compare_procedures(
    study: Bunch, *, metric: str = "macro_mae", by: str | None = "adjective"
) -> pd.DataFrame:
    """Test whether the combined networks of the procedures predict equally well.

    Parameters
    ----------
    study : Bunch
        As `run_study` and `read_study` return it.
    metric : str, default="macro_mae"
        Name of a score; lower is better in all.
    by : "adjective" or None, default="adjective"
        Whether to compare for each adjective, or over all.

    Returns
    -------
    comparison : DataFrame
        One row per adjective, or one row. Columns: ``adjective``; for each procedure
        the mean of its objects' scores; ``n_objects``; ``statistic`` and ``p_objects``
        of the test.

    Raises
    ------
    ValueError
        If there is one procedure only, no object is tested with every procedure, or the
        metric is unknown.

    Notes
    -----
    The test is Friedman's [1]_, for two procedures Wilcoxon's signed-rank test. Both
    compare each object with itself: all procedures touch the same objects, and a study
    splits them alike, whereas a Kruskal–Wallis test would take the procedures' scores
    for independent samples, and the large differences between objects for noise. An
    object is one observation, averaged over starts, trials and folds; objects that some
    procedure lacks are left out. With few objects Friedman's p, from the chi-squared
    distribution, is approximate.

    References
    ----------
    .. [1] M. Friedman, "The use of ranks to avoid the assumption of normality implicit
       in the analysis of variance", JASA 32, 675–701, 1937.
       :doi:`10.1080/01621459.1937.10503522`

    Examples
    --------
    >>> from sklearn_haptic.study import compare_procedures, read_study
    >>> compare_procedures(read_study("study"), metric="rps")  # doctest: +SKIP
    """
    by = _check_by(by, ["adjective"])
    objects = _of_objects(study, metric, [*by, "procedure", "object"])
    table = objects.unstack("procedure").dropna()
    if table.shape[1] < 2 or table.empty:
        raise ValueError(
            "The study has no object that is tested with two procedures or more; "
            "run_study adds procedures to its folder."
        )
    cells = table.groupby("adjective") if by else [(None, table)]
    rows = []
    for adjective, cell in cells:
        statistic, p = _test_procedures(cell.to_numpy().T)
        rows.append(
            ({"adjective": adjective} if by else {})
            | cell.mean().to_dict()
            | {"n_objects": len(cell), "statistic": statistic, "p_objects": p}
        )
    return pd.DataFrame(rows)


def _test_procedures(scores):
    """Test rows of scores of the same objects; equal rows are no evidence."""
    if (scores == scores[0]).all():
        return 0.0, 1.0
    test = wilcoxon if len(scores) == 2 else friedmanchisquare
    result = test(*scores)
    return float(result.statistic), float(result.pvalue)


def _of_objects(study, metric, keys):
    """Mean score of the combined network of every object."""
    _check_metric(study, metric)
    full = study.scores[study.scores["held_out"] == FULL_MODEL]
    return full.groupby(keys)[metric].mean()


def _check_metric(study, metric):
    scores = study.scores.columns
    known = scores[scores.get_loc("trial") + 1 : scores.get_loc("proba_1")]
    if metric not in known:
        raise ValueError(f"metric={metric!r} must be one of {list(known)}.")


def _check_by(by, known):
    by = [] if by is None else [by] if isinstance(by, str) else list(by)
    unknown = [name for name in by if name not in known]
    if unknown:
        raise ValueError(f"by has {unknown[0]!r}, but it must be among {known}.")
    return by
