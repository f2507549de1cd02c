"""The figures of quality that the pages show.

    python benchmarks/figures.py rivals benchmarks/rivals.csv FILE.png
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
        python benchmarks/figures.py real FOLDER [--sets films …] [--to FOLDER]

The first draws what `quality.py` wrote. The second predicts the recordings and ratings
of FOLDER (`data.py`) out of fold, in a minute on one core, and shows below predictions
how much worse (to the right) or better each rival is than the default, with intervals
of 95 % over films, objects, materials, forces and speeds, or runs. ``--sets hardness``
takes seconds.
"""

import warnings
from pathlib import Path

import data
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from heads import DEFAULT, models, with_ridge
from measure import command, of_groups, standard_error
from quality import Tables, classes, fold_proba
from scipy.stats import t
from sklearn import config_context
from sklearn.dummy import DummyClassifier
from sklearn.model_selection import LeaveOneGroupOut, cross_val_predict

from sklearn_haptic import TaxelGrid, make_haptic_pipeline
from sklearn_haptic.metrics import ranked_probability_score

BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "0.45"


# Real recordings and ratings ----------------------------------------------------------


NAMES = {
    "guess": "marginal",
    "linear, penalty searched": "linear, alpha chosen",
    "kernel ridge": "kernel ridge",
    "random forest": "random forest",
}


def distributions(name, folder):
    """Counts, groups, the default's predictions, and the RPS of each model."""
    found = data.RATED[name](folder)
    tables = Tables(found.trials, found.folds, found.given)
    (y,), groups = found.targets.values(), np.asarray(found.groups)
    features, _ = tables.of(DEFAULT)
    rivals = models(features[0][2].shape[1])
    compared = {"ours": make_haptic_pipeline(random_state=0)[-1]}
    compared |= {name: rivals[of] for name, of in NAMES.items()}
    scores, predicted = {}, None
    for label, model in compared.items():
        proba, *_ = fold_proba(model, features, y, groups)
        predicted = proba if predicted is None else predicted
        each = ranked_probability_score(y, proba, average=False)
        scores[label] = of_groups(each, groups)
    return y, groups, predicted, scores


def named(described, trials, frames, y, groups, clusters):
    """Predict classes; return predictions and the errors in each cluster by model."""
    made = classes(described, None, trials, frames)
    compared = {
        "ours": made["described"],
        "guess: most frequent": (None, np.zeros((len(y), 1))),
        "statistics of signals": made["statistics"],
        "MiniRocket, cut": made["MiniRocket, cut"],
        "MiniRocket, stretched": made["MiniRocket, stretched"],
    }
    scores, predicted = {}, None
    splits = list(LeaveOneGroupOut().split(y, groups=groups))
    for label, (features, X) in compared.items():
        model = with_ridge(features) if features else DummyClassifier()
        found = cross_val_predict(model, X, y, cv=splits)
        predicted = found if predicted is None else predicted
        scores[label] = 100 * of_groups(found != y, clusters)
    return predicted, scores


# Panels -------------------------------------------------------------------------------


def beside_rivals(ax, scores, unit):
    """Differences from the first model, with intervals of 95 %."""
    ours, *rivals = scores
    each = np.array([scores[name] - scores[ours] for name in rivals])
    half = standard_error(each.T) * t.ppf(0.975, each.shape[1] - 1)
    title = f"Beside rivals (ours: {scores[ours].mean():.2g})"
    draw_differences(ax, rivals, each.mean(axis=1), half, unit, title)


def draw_differences(ax, rivals, mean, half, unit, title):
    """Draw by how much each is worse, and its interval; blue if clearly."""
    # Guesses would hide how the others differ.
    end = max(
        1.2 * (abs(m) + h)
        for name, m, h in zip(rivals, mean, half)
        if not name.startswith("guess")
    )
    ax.set_xlim(-end, end)
    for row, (name, worse, error) in enumerate(zip(rivals, mean, half)):
        clear = abs(worse) > error
        colour = GREY if not clear else (BLUE if worse > 0 else ORANGE)
        print(f"  {name}: {worse:+.3f} ± {error:.3f}")
        if worse > end:
            style = {"color": BLUE, "ha": "right", "va": "center"}
            ax.text(end, row, f"+{worse:.2g} →", **style)
            continue
        marker = "s" if clear and worse < 0 else "o"
        ax.errorbar(worse, row, xerr=error, fmt=marker, color=colour, capsize=3)
    ax.axvline(0, color="black", linewidth=1)
    ax.set_yticks(range(len(rivals)), labels=rivals)
    ax.set(
        ylim=(len(rivals) - 0.5, -0.5), xlabel=f"{unit}\n← better · worse than ours →"
    )
    ax.set_title(title, size=11)
    ax.locator_params(axis="x", nbins=4)
    ax.spines[["top", "right", "left"]].set_visible(False)
    ax.tick_params(axis="y", length=0)


def objects_in_a_row(ax, y, groups, proba, rated, unit):
    """The probability of each level, one column per object; a dot where it is."""
    names = np.unique(groups)
    mean = np.array([proba[groups == name].mean(axis=0) for name in names])
    truth = np.array([y[groups == name][0].argmax() for name in names])
    order = np.lexsort((mean @ np.arange(y.shape[1]), truth))
    ax.imshow(mean[order].T, cmap="Blues", aspect="auto", origin="lower", vmin=0)
    ax.plot(np.arange(len(names)), truth[order], "_", color=ORANGE, ms=5, mew=2)
    ax.set(xlabel=unit, ylabel=rated, xticks=[], yticks=range(y.shape[1]))


def confusion(ax, y, predicted):
    """How often each class is taken for each."""
    kinds = np.unique(y)
    share = np.array([[np.mean(predicted[y == a] == b) for b in kinds] for a in kinds])
    ax.imshow(share, cmap="Blues", vmin=0, vmax=1)
    style = {"ha": "center", "va": "center", "size": 7, "color": ORANGE}
    for (row, column), value in np.ndenumerate(share):
        if value and row != column:
            ax.text(column, row, f"{100 * value:.0f}", **style)
    ax.set_yticks(range(len(kinds)), labels=kinds, size=8)
    ax.set_xticks([])
    ax.set(xlabel="taken for, in the same order (errors in %)")


# Rivals -------------------------------------------------------------------------------

FEATURES = "maxima", "statistics", "bands", "MiniRocket"
MODELS = "linear", "linear, alpha chosen", "random forest", "boosting", "kernel ridge"
PANELS = {
    "bolt": ("Other features: force of grips", FEATURES, "ms", "{:.1f} ms a touch"),
    "slow0": ("Other features: slow slides", FEATURES, "ms", "{:.1f} ms a touch"),
    "phac2": ("Other models: hardness", MODELS, "learning_s", "{:.2f} s to learn"),
    "films": ("Other models: films", MODELS, "learning_s", "{:.2f} s to learn"),
}


def draw_rivals(results, path):
    """Draw how much worse than the default features and models are, with their cost."""
    figure, axes = plt.subplots(
        2, 2, figsize=(9, 6.6), height_ratios=(4, 5), layout="constrained"
    )
    for ax, (name, (title, rows, cost, said)) in zip(axes.flat, PANELS.items()):
        found = results[results["set"] == name].set_index("row")
        rivals = found.reindex(rows).dropna(how="all")
        names = [f"{row}\n" + said.format(c) for row, c in rivals[cost].items()]
        title += f"\n(ours: {said.format(found.at[DEFAULT, cost])})"
        errors = 2 * rivals["error"]
        draw_differences(ax, names, rivals["difference"], errors, "RPS", title)
    figure.savefig(path, dpi=85)


# Figures ------------------------------------------------------------------------------


def films(folder):
    y, _, proba, scores = distributions("films", folder)
    figure = plt.figure(figsize=(5.2, 5.4), layout="constrained")
    above, below = figure.subfigures(2, 1)
    error, least = (
        ranked_probability_score(y, p, average=False)
        for p in (proba, y / y.sum(axis=1, keepdims=True))
    )
    order, stars = np.argsort(error - least), np.arange(1, 6)
    axes = above.subplots(1, 3, sharex=True, sharey=True)
    names = {"a good one": 0.1, "the median": 0.5, "a bad one": 0.9}
    for ax, (name, q) in zip(axes, names.items()):
        film = order[round(q * (len(y) - 1))]
        ax.bar(stars, proba[film], color=BLUE)
        ax.plot(stars, y[film] / y[film].sum(), "o", color=ORANGE, mec="white", ms=7)
        ax.set(yticks=[], xlabel="stars", xticks=stars)
        ax.set_title(name, size=9)
        ax.spines[["top", "right", "left"]].set_visible(False)
    words = {"■ predicted": BLUE, "● people": ORANGE}
    for row, (word, colour) in enumerate(words.items()):
        at = {"x": 0.02, "y": 0.95 - 0.1 * row, "transform": axes[0].transAxes}
        axes[0].text(s=word, color=colour, weight="bold", size=7.5, **at)
    above.suptitle("Stars of three films: predictions and people", size=11)
    beside_rivals(below.subplots(), scores, "RPS")
    return figure


def two_panels(first, *arguments, scores, unit, title, heights=(1, 1)):
    """Predictions above, rivals below: legible on a phone."""
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(5.2, 5.4), height_ratios=heights, layout="constrained"
    )
    first(above, *arguments)
    above.set_title(title, size=11)
    beside_rivals(below, scores, unit)
    return figure


def hardness(folder):
    y, groups, proba, scores = distributions("phac2", folder)
    return two_panels(
        objects_in_a_row, y, groups, proba, "votes for hard",
        "60 objects, softest first",
        scores=scores, unit="RPS", title="Predicted (shade) and true (line) votes",
    )  # fmt: skip


def grips(folder):
    y, _, proba, scores = distributions("bolt", folder)
    figure = two_panels(
        objects_in_a_row, y, np.arange(len(y)), proba, "force, counts",
        "74 grips, weakest first",
        scores=scores, unit="RPS", title="Predicted (shade) and true (line) force",
    )  # fmt: skip
    figure.axes[0].set_yticks(range(3), labels=[100, 150, 200])
    return figure


def fabrics(folder):
    frames, y, force, condition = data.fabric_slides(folder)
    grid = TaxelGrid((4, 4))
    predicted, scores = named(grid, frames, frames, y, force, condition)
    return two_panels(
        confusion, y, predicted, scores=scores, unit="errors, %", heights=(1.6, 1),
        title="Fabric, at a force never trained on",
    )  # fmt: skip


def slides(folder):
    frames, y, run = data.slide_frames(folder)
    trials, blocks = data.by_sensor(frames), (run - 1) // 5
    predicted, scores = named(data.BIOTAC, trials, frames, y, blocks, run)
    return two_panels(
        confusion, y, predicted, scores=scores, unit="errors, %", heights=(2, 1),
        title="Which of twenty materials, in runs left out",
    )  # fmt: skip


FIGURES = {f.__name__: f for f in (films, hardness, grips, fabrics, slides)}


def main():
    parser = command(__doc__)
    parser.add_argument("figure", choices=["rivals", "real"])
    parser.add_argument("source", type=Path, help="CSV file, or folder of data sets")
    parser.add_argument("file", type=Path, nargs="?", help="the figure of a CSV file")
    parser.add_argument("--sets", nargs="+", default=list(FIGURES), choices=FIGURES)
    parser.add_argument("--to", type=Path, default=Path("docs/images"))
    arguments = parser.parse_args()
    if arguments.figure != "real":
        draw_rivals(pd.read_csv(arguments.source), arguments.file)
        return
    warnings.simplefilter("ignore")  # of mord and few iterations
    with config_context(enable_metadata_routing=True):
        for name in arguments.sets:
            print(name, flush=True)
            figure = FIGURES[name](arguments.source)
            figure.savefig(arguments.to / f"real_{name}.png", dpi=110)
            plt.close(figure)


if __name__ == "__main__":
    main()
