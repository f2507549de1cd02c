"""Tables of a study: networks beside guesses and the truth, with tests over objects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import pandas as pd
from scipy.stats import friedmanchisquare
from sklearn.utils import Bunch

from ..metrics import log_score, noise_ceiling
from ..metrics._proper_scores import PROPER_SCORES
from ..metrics._trial_scores import SCORES
from ..model_selection._contribution_summary import signed_rank
from ..model_selection._contributions import FULL_MODEL

_CELL = ["adjective", "procedure"]
# By what networks can be compared.
_COMPARED = {"sensors": _CELL, "procedures": ["adjective"]}


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
        network as it was chosen; one for each sensor, its own network as it was chosen;
        ``marginal`` and ``barycentre``, the guesses of
        :class:`~sklearn_haptic.DummyDistribution`; ``ceiling``, what the whole
        population is expected to score, as
        :func:`~sklearn_haptic.metrics.noise_ceiling` estimates it, NaN for "macro_mae"
        and "emd", which are not proper, or if an object has fewer than two ratings;
        ``truth``, the score of the population itself, if the corpus knows it; and
        ``no_better``, whether the combined network is no better than the better guess.
        All are means over the test trials of all folds.

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
    full = _full(study)
    combined = study.networks[study.networks["network"] == "combined"]
    tested = combined[[*_CELL, "fold"]]  # one row per test trial
    guessed = study.baselines.merge(tested)
    parts = [
        table.groupby([*_CELL, of], sort=False)[metric].mean().unstack(of)
        for table, of in ((study.networks, "network"), (guessed, "strategy"))
    ]
    parts.insert(0, parts[0].pop("combined"))
    if metric in SCORES:
        cells = full.groupby(_CELL)[[c for c in full if c not in _CELL]]
        parts.append(cells.apply(_ceiling, SCORES[metric]).rename("ceiling"))
    if len(study.truth):
        truth = study.truth.merge(tested)
        parts.append(truth.groupby(_CELL)[metric].mean().rename("truth"))
    table = pd.concat(parts, axis=1)
    guesses = table[study.baselines["strategy"].unique()].min(axis=1)
    return table.assign(no_better=~(table["combined"] < guesses))  # nor if NaN


def _ceiling(rows, score):
    """Return what the population is expected to score at the ratings of some trials."""
    counts = rows.filter(regex=r"^count_\d+$").dropna(axis=1).to_numpy()
    unfit = score is log_score and (counts % 1 != 0).any()
    if unfit or score not in PROPER_SCORES or (counts.sum(axis=1) < 2).any():
        return np.nan
    return noise_ceiling(counts, score).truth


def compare_networks(
    study: Bunch,
    between: Literal["sensors", "procedures"] = "sensors",
    *,
    metric: str = "macro_mae",
    by: str | Sequence[str] | None = None,
) -> pd.DataFrame:
    """Test whether combining sensors helps, or whether procedures differ.

    Parameters
    ----------
    study : Bunch
        As `run_study` and `read_study` return it.
    between : {"sensors", "procedures"}, default="sensors"
        Whether to compare the combined network with the network of each single sensor,
        or the combined networks of all procedures.
    metric : str, default="macro_mae"
        Name of a score; lower is better in all.
    by : str or list of str, default=None
        ``"adjective"`` and, between sensors, ``"procedure"``: for each of these values
        to make the comparison; by default one over all.

    Returns
    -------
    comparison : DataFrame
        Between sensors one row per sensor, and per value of ``by``. Columns: those of
        ``by``; ``network``, the sensor; ``combined`` and ``single``, the means of the
        objects' scores; ``difference``, single less combined, positive if the combined
        network is better; ``n_objects``; and ``p_objects`` of Wilcoxon's signed-rank
        test.

        Between procedures one row per value of ``by``. Columns: those of ``by``; for
        each procedure the mean of its objects' scores; ``n_objects``; ``statistic`` and
        ``p_objects`` of Friedman's test [1]_, for two procedures of Wilcoxon's.

    Raises
    ------
    ValueError
        If ``between``, the metric or a value of ``by`` is unknown, or no object is
        tested with two procedures.

    Notes
    -----
    Between sensors, each network is the one that was chosen among those of the grid, as
    it was then fitted: a mean over the starts of the combined network would be no match
    for the best of many fits.

    All tests compare each object with itself: networks and procedures predict the same
    objects, which a study splits alike if all procedures have them. A Kruskal–Wallis
    test would take the scores of procedures for independent samples, and the
    differences between objects for noise. An object is one observation, averaged over
    trials, folds, starts and whatever else ``by`` does not name, because touches of one
    object are not independent. Of each adjective, objects that some procedure lacks are
    left out. With fewer than six objects, Wilcoxon's p is never below 0.05; with few,
    Friedman's p, from the chi-squared distribution, is approximate. No p-value is
    corrected for the number of rows, and none allows for test objects of a fold that
    share a model: of procedures that do not differ, .10 had a Wilcoxon p below .05 and
    .13 a Friedman p, of simulated studies with 40 objects in five folds.

    References
    ----------
    .. [1] M. Friedman, "The use of ranks to avoid the assumption of normality implicit
       in the analysis of variance", JASA 32, 675–701, 1937.
       :doi:`10.1080/01621459.1937.10503522`

    Examples
    --------
    >>> from sklearn_haptic.study import compare_networks, read_study
    >>> study = read_study("study")  # doctest: +SKIP
    >>> compare_networks(study, by="adjective")  # doctest: +SKIP
    >>> compare_networks(study, "procedures", metric="rps")  # doctest: +SKIP
    """
    _check_metric(study, metric)
    if between not in _COMPARED:
        raise ValueError(f"between={between!r} must be one of {[*_COMPARED]}.")
    by = [] if by is None else [by] if isinstance(by, str) else list(by)
    for name in by:
        if name not in _COMPARED[between]:
            raise ValueError(
                f"by has {name!r}, but between {between} it must be among "
                f"{_COMPARED[between]}."
            )
    if between == "sensors":
        scores, compared, compare = study.networks, "network", _compare_sensors
    else:
        scores, compared, compare = _full(study), "procedure", _compare_procedures
    cell = [*_COMPARED[between], "object"]
    scores = scores.groupby([*cell, "fold", compared], sort=False)[metric].mean()
    table = scores.groupby([*cell, compared], sort=False).mean()
    table = table.unstack(compared).dropna()
    if table.shape[1] < 2 or table.empty:
        raise ValueError(
            "The study has no object that is tested with two procedures or more; "
            "run_study adds procedures to its folder."
        )
    table = table.groupby([*by, "object"], sort=False).mean()
    rows: list[dict[str, object]] = []
    for key, objects in table.groupby(by, sort=False) if by else [((), table)]:
        rows.extend({**dict(zip(by, key)), **row} for row in compare(objects))
    return pd.DataFrame(rows)


def _compare_sensors(objects):
    """Test the columns of single sensors against that of the combined network."""
    combined = objects.pop("combined")
    for sensor, single in objects.items():
        difference = single - combined
        yield {
            "network": sensor,
            "combined": combined.mean(),
            "single": single.mean(),
            "difference": difference.mean(skipna=False),
            "n_objects": len(objects),
            "p_objects": signed_rank(difference)[1],
        }


def _compare_procedures(objects):
    """Test all columns at once; equal columns are no evidence."""
    scores = np.round(objects.to_numpy().T, 12)  # what rounding tells apart is equal
    statistic, p = 0.0, 1.0
    if len(scores) == 2:
        statistic, p = signed_rank(scores[0] - scores[1])
    elif (scores != scores[0]).any():
        statistic, p = friedmanchisquare(*scores)
    yield {
        **objects.mean(),
        "n_objects": len(objects),
        "statistic": float(statistic),
        "p_objects": float(p),
    }


def _full(study):
    """Rows of the combined network with all sensors, of every start."""
    return study.scores[study.scores["held_out"] == FULL_MODEL]


def _check_metric(study, metric):
    scores = study.scores.columns
    known = scores[scores.get_loc("trial") + 1 : scores.get_loc("proba_1")]
    if metric not in known:
        raise ValueError(f"metric={metric!r} must be one of {list(known)}.")
