"""The figure of `speed_accuracy.py`: what settings of the features cost and gain."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogLocator
from speed_accuracy_settings import FEATURE_KNOBS
from speed_accuracy_tables import SECONDS, standard_error

PRESET_COLOURS = {
    "base": "0.2",
    "fast": "#E69F00",
    "medium": "#009E73",
    "slow": "#0072B2",
}
SCORES = {"rps": "RPS", "mae_m": "MAE^M"}


def draw(rows, path, n_folds):
    """Draw one column of panels per set, one row per score."""
    rows = [row for row in rows if row["knob"] in FEATURE_KNOBS]
    sets = list(dict.fromkeys(row["set"] for row in rows))
    figure, axes = plt.subplots(
        len(SCORES),
        len(sets),
        figsize=(4.5 * len(sets) + 0.5, 3 * len(SCORES)),
        sharex="col",
        squeeze=False,
        layout="constrained",
    )
    for column, name in zip(axes.T, sets):
        settings = {}
        for row in rows:
            if row["set"] == name:
                settings.setdefault((row["knob"], row["value"]), []).append(row)
        for ax, score in zip(column, SCORES):
            draw_panel(ax, settings, score, n_folds)
        column[0].set_title(name)
        column[-1].set_xlabel("processor time per fold, s")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, frameon=False)
    figure.savefig(path, dpi=150)


def draw_panel(ax, settings, score, n_folds):
    """Draw time against the difference in a score to the base, presets in colour."""
    reference = np.array([row[score] for row in settings["presets", "base"]])
    for (knob, value), rows in settings.items():
        difference = np.array([row[score] for row in rows]) - reference
        seconds = [sum(row[f"seconds_{s}"] for s in SECONDS) for row in rows]
        style = {"color": "0.75", "marker": ".", "markersize": 5, "linewidth": 0.7}
        label = "others" * (value == "all")
        if knob == "presets":
            style = {"color": PRESET_COLOURS[value], "marker": "D", "markersize": 8}
            style |= {"linewidth": 2, "zorder": 3}
            label = value
        ax.errorbar(
            np.median(seconds),
            difference.mean(),
            standard_error(difference, n_folds),
            **{"zorder": 2, "linestyle": "", "label": label} | style,
        )
    ax.axhline(0, color="0.4", linewidth=0.7, zorder=1)
    ax.set(xscale="log", ylabel=f"{SCORES[score]} minus that of the base")
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter("")
