"""What each sensor contributes, and tests whether that is chance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.stats import wilcoxon

from ..utils._validation import check_numbers
from ._contributions import FULL_MODEL

# Decimals of differences in score that are more than rounding.
_DECIMALS = 12

# Columns that tell the predictions of one model apart; a table has some of them.
_UNIT = ("adjective", "procedure", "start", "fold", "object", "trial")


def contribution_summary(
    scores: pd.DataFrame,
    *,
    metric: str = "macro_mae",
    by: str | Sequence[str] | None = None,
) -> pd.DataFrame:
    """Summarise how much worse a model predicts without each sensor, and test it.

    Parameters
    ----------
    scores : DataFrame
        A table as `sensor_contributions` returns it. It may have the further columns
        ``adjective`` and ``procedure``.
    metric : str, default="macro_mae"
        Name of the score.
    by : str or list of str, default=None
        Columns of ``scores`` for each of whose values to make a summary, such as
        ``"object"`` or ``["adjective", "procedure"]``. ``"threshold"`` summarises the
        terms of the ranked probability score in place of ``metric``: does a sensor help
        to tell ratings of at most k from higher ones?

    Returns
    -------
    summary : DataFrame
        One row per sensor left out, and per value of ``by``. Columns:

        - those of ``by``, and ``held_out``, the sensor;
        - ``full`` and ``full_sd``, the mean and the standard deviation over starts of
          the full model's score, averaged over trials;
        - ``holdout`` and ``holdout_sd``, the same without the sensor;
        - ``difference`` and ``difference_sd`` of the two, positive if the sensor helps;
        - ``p_objects`` of a one-sided Wilcoxon signed-rank test whether the objects'
          differences, averaged over starts and trials, are above zero, so that the
          sensor helps; left out if ``by`` has "object" or "trial".

    Raises
    ------
    ValueError
        If the metric or a column is unknown; there is no full model, or no model
        without a sensor; models are scored on different trials, or twice on one; there
        are fewer than two starts; a score is not finite; or ``by`` has "held_out" or
        "start".

    See Also
    --------
    sklearn_haptic.plotting.SensorContributionsDisplay : Plot this summary.

    Notes
    -----
    The test takes each object for one observation, and ignores that the folds of a
    cross-validation share training trials. With fewer than five objects it is never
    below 0.05. Nothing is corrected for the number of rows: of twenty useless sensors
    at most one is expected below 0.05. Useless sensors mostly harm, so that most of
    their differences are negative.

    The paper tests over random starts on the same objects, by Kruskal and Wallis
    [1]_. That test asks whether other starts might explain a difference, and finds one
    for nearly every useless sensor, since starts end close to each other; it is not
    offered here.

    References
    ----------
    .. [1] Richardson and Kuchenbecker (2020), section 3.2 and figure 12.
       :doi:`10.3389/fnbot.2019.00116`

    F. Wilcoxon, "Individual comparisons by ranking methods", Biometrics Bulletin 1,
    80–83, 1945. :doi:`10.2307/3001968`

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_haptic.model_selection import contribution_summary
    >>> scores = pd.DataFrame(
    ...     {
    ...         "held_out": ["none"] * 4 + ["pac"] * 4,
    ...         "start": [0, 0, 1, 1] * 2,
    ...         "fold": 0,
    ...         "object": ["foam", "cork"] * 4,
    ...         "trial": [0, 1] * 4,
    ...         "emd": [0.5, 0.3, 0.5, 0.5, 0.75, 0.75, 0.75, 0.75],
    ...     }
    ... )
    >>> summary = contribution_summary(scores, metric="emd")
    >>> summary[["held_out", "full", "holdout", "difference", "p_objects"]]
      held_out  full  holdout  difference  p_objects
    0      pac  0.45     0.75         0.3       0.25
    """
    if not hasattr(scores, "columns"):
        raise TypeError(
            f"scores is a {type(scores).__name__}; give a DataFrame, as "
            "sensor_contributions returns it."
        )
    by = [] if by is None else [by] if isinstance(by, str) else list(by)
    if "threshold" in by:
        scores, metric = _melt_thresholds(scores, by), "rps"
    paired = _pair_models(scores, metric, by)
    cells = paired.groupby(by, sort=False, observed=True) if by else [((), paired)]
    summary = pd.DataFrame(
        [
            {**dict(zip(by, key)), "held_out": sensor, **row}
            for key, cell in cells
            for sensor, row in _compare_models(cell).items()
        ]
    )
    one_object = not {"object", "trial"}.isdisjoint(by)
    return summary.drop(columns="p_objects") if one_object else summary


def _melt_thresholds(scores, by):
    """Return a table with one row per threshold, its term of the RPS in "rps"."""
    terms = scores.filter(regex=r"^rps_\d+$").columns
    if terms.empty:
        raise ValueError(
            "scores has no column rps_1, rps_2, …, which by='threshold' requires; make "
            "scores with sensor_contributions."
        )
    keys = scores.columns.intersection([*by, *_UNIT, "held_out"], sort=False)
    long = scores[[*keys, *terms]].melt(keys, var_name="threshold", value_name="rps")
    # An adjective of fewer levels has fewer terms, but at least one.
    without_term = long["rps"].isna() & np.tile(scores["rps_1"].notna(), len(terms))
    long = long[~without_term]
    return long.assign(threshold=long["threshold"].str.removeprefix("rps_").astype(int))


def _pair_models(scores, metric, by):
    """Return scores with one column per model, one row per trial, fold and start."""
    missing = {"held_out", "start", "object", metric, *by}.difference(scores.columns)
    if missing:
        raise ValueError(
            f"scores has no column {sorted(missing)}; choose metric and by among "
            f"{list(scores.columns)}."
        )
    if not {"held_out", "start"}.isdisjoint(by):
        raise ValueError(f"by={by} has what each summary compares; leave it out.")
    keys = [name for name in dict.fromkeys((*by, *_UNIT)) if name in scores]
    keys = [*keys, "held_out"]
    check_numbers(scores[metric], metric)
    if scores[keys].isna().any(axis=None):
        raise ValueError(f"scores has no value in some rows of {keys}; fill them in.")
    if not np.isfinite(scores[metric]).all():
        raise ValueError(
            f"{metric} is not finite in some rows, as where a model gives a rating "
            "probability 0; choose another metric."
        )
    values = scores.set_index(keys)[metric]
    # In the order given: pandas 2 misplaces values in unstack(sort=False).
    rows = values.index.droplevel("held_out").unique()
    models = values.index.unique("held_out")
    if FULL_MODEL not in models or len(models) == 1:
        raise ValueError(
            f"held_out is {list(models)} in scores; give the full model, "
            f"{FULL_MODEL!r}, and at least one holdout."
        )
    if values.index.has_duplicates or len(values) != len(rows) * len(models):
        raise ValueError(
            "scores must have one row per model, start, fold and trial; score every "
            "model on the same trials and starts, and summarise one run at a time."
        )
    return values.unstack("held_out").reindex(rows)[models]


def _compare_models(paired):
    """Return the row of the summary of each sensor left out."""
    starts = paired.groupby("start", observed=True).mean()
    objects = paired.groupby("object", observed=True).mean()
    if len(starts) == 1:
        raise ValueError(
            "scores has one start, but standard deviations require at least "
            "two; raise n_repeats."
        )
    full = starts[FULL_MODEL]
    differences = objects.sub(objects[FULL_MODEL], axis=0)
    return {
        sensor: {
            "full": full.mean(),
            "full_sd": full.std(),
            "holdout": holdout.mean(),
            "holdout_sd": holdout.std(),
            "difference": (holdout - full).mean(),
            "difference_sd": (holdout - full).std(),
            "p_objects": signed_rank(differences[sensor], "greater")[1],
        }
        for sensor, holdout in starts.drop(columns=FULL_MODEL).items()
    }


def signed_rank(difference, alternative="two-sided"):
    """Return Wilcoxon's statistic and p of the objects' differences; 0, 1 of none.

    Those that only rounding tells apart have one rank. Those of 0, which the test does
    not count, are left out first, so that the p of few others is exact.
    """
    difference = np.round(difference, _DECIMALS)
    difference = difference[difference != 0]
    if not len(difference):
        return 0.0, 1.0
    return tuple(map(float, wilcoxon(difference, alternative=alternative)))
