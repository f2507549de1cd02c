"""The figure of `rivals.py`: what a touch costs against how much a score gains."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

PANELS = {
    "bolt": "Recorded grips,\nhold: force, RPS",
    "bolt, all": "Recorded grips, four\nprocedures: force, RPS",
    "slow": "Generated slow slides:\nadjectives, RPS",
    "hold": "Generated holds:\nadjectives, RPS",
    "phac2": "Votes of hardness,\nfeatures given, RPS",
    "films": "Stars of films,\nfeatures given, RPS",
    "slides": "Recorded slides: which of\n20 materials, share of errors",
}
STYLES = {
    "fast": ("#D55E00", "D"),
    "accurate": ("#0072B2", "D"),
    "maxima": ("0.45", "D"),
    "statistics": ("0.45", "o"),
    "bands": ("0.45", "s"),
    "MiniRocket": ("0.45", "^"),
    "MiniRocket, own rates": ("0.45", ">"),
    "Catch22": ("0.45", "v"),
    "trees": ("#009E73", "o"),
    "quantile forest": ("#009E73", "s"),
    "kernel ridge": ("#009E73", "^"),
    "linear, alpha chosen": ("#009E73", "v"),
    "multinomial on counts": ("#009E73", "P"),
    "location and scale": ("#009E73", "X"),
    "mord LogisticAT": ("#009E73", "<"),
    "statsmodels OrderedModel": ("#009E73", ">"),
}
TITLES = {
    "presets:": ["fast", "accurate"],
    "other features, linear model:": list(STYLES)[2:8],
    "other models, features of the presets:": list(STYLES)[8:],
}


def of_panels(results):
    """One row per panel and name; two seeds are averaged."""
    results = results[results["row"].isin(STYLES)]
    panel = results["set"].str.rstrip("01")
    squares = results.assign(error=results["error"] ** 2)
    grouped = squares.groupby([panel, "row"], sort=False)
    means = grouped[["difference", "ms"]].mean()
    means["error"] = np.sqrt(grouped["error"].sum()) / grouped.size()
    return means


def draw(results, path):
    """Draw a panel per kind of set: low is better, left is cheaper."""
    points = of_panels(results)
    panels = [name for name in PANELS if name in points.index]
    figure, axes = plt.subplots(2, 4, figsize=(12, 6.2), layout="constrained")
    for ax in axes.flat[len(panels) :]:
        ax.axis("off")
    for ax, name in zip(axes.flat, panels):
        for row, point in points.loc[name].iterrows():
            colour, marker = STYLES[row]
            ours = row in TITLES["presets:"]
            ax.errorbar(
                point["ms"],
                point["difference"],
                point["error"],
                color=colour,
                marker=marker,
                markersize=10 if ours else 5,
                elinewidth=2 if ours else 0.6,
                zorder=2 if ours else 3,
            )
        ax.axhline(0, color=STYLES["fast"][0], lw=0.8, ls=":", zorder=1)
        ax.set(xscale="log", title=PANELS[name])
        ax.title.set_fontsize(10)
        ax.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter("")
        ax.set_xlabel("processor ms per touch")
    figure.supylabel('score minus that of "fast": low is better', fontsize=11)
    handles = []
    for title, names in TITLES.items():
        handles.append(Line2D([], [], ls="", label=title))
        drawn = [n for n in names if n in points.index.get_level_values("row")]
        for name in drawn:
            colour, marker = STYLES[name]
            handles.append(
                Line2D([], [], ls="", color=colour, marker=marker, label=name)
            )
    axes.flat[-1].legend(handles=handles, loc="center", fontsize=8, frameon=False)
    figure.savefig(path, dpi=85)
