"""Tables of what `speed_accuracy.py` measured, in Markdown."""

import numpy as np
from speed_accuracy_folds import SCORES

SECONDS = ["features", "transform", "fit", "predict"]
TITLES = ["MAE^M", "EMD", "RPS", "log score"]
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


def describe(scores, reference, n_folds):
    """The reference with its standard error, others with the paired difference."""
    if not np.isfinite(scores).all():
        return "inf"
    if scores is reference:
        return f"{scores.mean():.3f} ± {standard_error(scores, n_folds):.3f}"
    if not np.isfinite(reference).all():
        return f"{scores.mean():.3f}"
    difference = scores - reference
    error = standard_error(difference, n_folds)
    text = f"{difference.mean():+.3f} ± {error:.3f}".replace("-", "−")
    if abs(difference.mean()) > max(2 * error, 0.0005):
        text = f"**{text}**"
    return f"{scores.mean():.3f} ({text})"


def table(rows, knob, n_folds):
    """Table of one knob, without the seconds that do not depend on it."""
    rows = [row for row in rows if row["knob"] == knob]
    by_value = {}
    for row in rows:
        by_value.setdefault(row["value"], []).append(row)

    def column(value, name):
        return np.array([row[name] for row in by_value[value]])

    stages = [
        stage
        for stage in SECONDS
        if len({row[f"seconds_{stage}"] for row in rows if row["memory_mb"] != ""}) > 1
    ]
    header = [knob, *(f"{stage}, s" for stage in stages), "memory, MB", *TITLES]
    lines = [header, ["---"] * len(header)]
    first = next(iter(by_value))
    reference = {score: column(first, score) for score in SCORES}
    for value, of_value in by_value.items():
        seconds = [np.median(column(value, f"seconds_{stage}")) for stage in stages]
        cells = [
            value,
            *(f"{s:.3g}" for s in seconds),
            f"{of_value[0]['memory_mb']:.3g}",
        ]
        for score, of_reference in reference.items():
            scores = of_reference if value == first else column(value, score)
            cells.append(describe(scores, of_reference, n_folds))
        lines.append(cells)
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
