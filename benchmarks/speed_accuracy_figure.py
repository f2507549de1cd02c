"""The figure of `speed_accuracy.py`: what settings of the features cost and gain.

python benchmarks/speed_accuracy_figure.py FILE.csv FIGURE
"""

import sys

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.ticker import LogLocator
from speed_accuracy_settings import FEATURE_KNOBS
from speed_accuracy_tables import SECONDS

COLOURS = {
    "base": "0.2",
    "quick": "#E69F00",
    "medium": "#009E73",
    "slow": "#0072B2",
}
SCORES = {"rps": "RPS", "mae_m": "MAE^M"}


def draw(summary, path):
    """Draw one column of panels per set, one row per score."""
    summary = summary[summary["knob"].isin(list(FEATURE_KNOBS))]
    sets = list(summary["set"].unique())
    figure, axes = plt.subplots(
        len(SCORES),
        len(sets),
        figsize=(4.5 * len(sets) + 0.5, 3 * len(SCORES)),
        sharex="col",
        squeeze=False,
        layout="constrained",
    )
    for column, name in zip(axes.T, sets):
        for ax, score in zip(column, SCORES):
            draw_panel(ax, summary[summary["set"] == name], score)
        column[0].set_title(name)
        column[-1].set_xlabel("processor time per fold, s")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, frameon=False)
    figure.savefig(path, dpi=150)


def draw_panel(ax, lines, score):
    """Draw time against the difference in a score to the base, dictionaries in colour.

    The first value of each other knob is the base as well.
    """
    seconds = lines[[f"{stage}_s" for stage in SECONDS]].sum(axis=1)
    for (_, line), time in zip(lines.iterrows(), seconds):
        coloured = line["knob"] == "dictionaries"
        difference, error = line[[f"{score}_difference", f"{score}_error"]]
        if pd.isna(difference):
            if not coloured:
                continue
            difference, error = 0.0, 0.0
        style = {"color": "0.75", "marker": ".", "markersize": 5, "linewidth": 0.7}
        label = "others" * (line["value"] == "half")
        if coloured:
            label = line["value"]
            style = {"color": COLOURS[label], "marker": "D", "markersize": 8}
            style |= {"linewidth": 2, "zorder": 3}
        style = {"zorder": 2, "linestyle": "", "label": label} | style
        ax.errorbar(time, difference, error, **style)
    ax.axhline(0, color="0.4", linewidth=0.7, zorder=1)
    ax.set(xscale="log", ylabel=f"{SCORES[score]} minus that of the base")
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter("")


if __name__ == "__main__":
    draw(pd.read_csv(sys.argv[1]), sys.argv[2])
