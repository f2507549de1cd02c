"""Tables of what `speed_accuracy.py` measured: one row per value of a knob."""

import numpy as np
import pandas as pd
from speed_accuracy_folds import SCORES

SECONDS = ["features", "transform", "fit", "predict"]
PRINTED = {"mae_m": "MAE^M", "rps": "RPS", "log": "log score"}
COLUMNS = [
    *("set", "knob", "value", "repeat", "fold"),
    *(f"seconds_{stage}" for stage in SECONDS),
    "memory_mb",
    *SCORES,
]


def standard_error(scores, n_folds):
    """That of Nadeau and Bengio, of a mean over folds that share training objects."""
    test_to_train = 1 / (n_folds - 1)
    return scores.std(ddof=1) * np.sqrt(1 / len(scores) + test_to_train)


def summarise(rows, n_folds):
    """Medians of seconds, means of scores and paired differences to the first value.

    The first value of a knob has no difference, and the error of its mean. Seconds that
    do not depend on the knob are missing.
    """
    lines = []
    for (name, knob), of_knob in pd.DataFrame(rows).groupby(
        ["set", "knob"], sort=False
    ):
        of_first_fold = of_knob.iloc[: of_knob["value"].nunique()]
        reference = of_knob[of_knob["value"] == of_knob["value"].iloc[0]]
        for value, of_value in of_knob.groupby("value", sort=False):
            line = {"set": name, "knob": knob, "value": value}
            for stage in SECONDS:
                seconds = f"seconds_{stage}"
                if of_first_fold[seconds].nunique() > 1:
                    line[f"{stage}_s"] = of_value[seconds].median()
            line["memory_mb"] = of_value["memory_mb"].iloc[0]
            for score in SCORES:
                scores = of_value[score].to_numpy()
                compared = scores
                line[score] = scores.mean()
                if value != of_knob["value"].iloc[0]:
                    compared = scores - reference[score].to_numpy()
                    line[f"{score}_difference"] = compared.mean()
                if np.isfinite(compared).all():
                    line[f"{score}_error"] = standard_error(compared, n_folds)
            lines.append(line)
    compared = [c for s in SCORES for c in (s, f"{s}_difference", f"{s}_error")]
    seconds = [f"{stage}_s" for stage in SECONDS]
    columns = ["set", "knob", "value", *seconds, "memory_mb", *compared]
    return pd.DataFrame(lines, columns=columns)


def describe(line, score):
    """The reference with its standard error, others with the paired difference."""
    mean, difference, error = line[[score, f"{score}_difference", f"{score}_error"]]
    if not np.isfinite(mean):
        return "inf"
    if not np.isfinite(error):
        return f"{mean:.3f}"
    if not np.isfinite(difference):
        return f"{mean:.3f} ± {error:.3f}"
    text = f"{difference:+.3f} ± {error:.3f}".replace("-", "−")
    if abs(difference) > max(2 * error, 0.0005):
        text = f"**{text}**"
    return f"{mean:.3f} ({text})"


def table(summary, knob):
    """Markdown of one knob, without the seconds that do not depend on it."""
    lines = summary[summary["knob"] == knob]
    stages = [stage for stage in SECONDS if lines[f"{stage}_s"].notna().all()]
    costs = [*(f"{stage}, s" for stage in stages), "memory, MB"]
    header = [knob, *costs, *PRINTED.values()]
    cells = [header, ["---"] * len(header)]
    for _, line in lines.iterrows():
        measured = line[[*(f"{stage}_s" for stage in stages), "memory_mb"]]
        scores = [describe(line, score) for score in PRINTED]
        cells.append([line["value"], *(f"{x:.3g}" for x in measured), *scores])
    return "\n".join("| " + " | ".join(row) + " |" for row in cells)
