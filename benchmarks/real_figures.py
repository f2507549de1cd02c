"""Figures of real recordings and ratings: what is predicted, and beside which rivals.

    python benchmarks/real_figures.py FOLDER [--sets films hardness …] [--to FOLDER]

FOLDER holds the sets that `frontier_heads.py` and `other_sensors.py` read. Everything
is predicted out of fold: films, objects, materials, forces or runs are left out whole.
The upper panel shows predictions. The lower panel shows how much worse (to the right)
or better (to the left) each rival is than the default, with intervals of 95 % over
films, objects, materials, forces and speeds, or runs. Settings that rivals have are
chosen inside the training folds. The random kernels of MiniRocket are drawn from
all trials. Needs the extra `aeon`. A minute on one core; give it one thread.
"""

import argparse
import warnings
from pathlib import Path

import frontier_heads as heads
import matplotlib.pyplot as plt
import numpy as np
import other_sensors as others
from scipy.stats import t
from sklearn import set_config
from sklearn.dummy import DummyClassifier
from sklearn.model_selection import cross_val_predict

from sklearn_haptic import DummyDistribution, make_haptic_pipeline
from sklearn_haptic.metrics import ranked_probability_score

BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "0.45"


# What is predicted --------------------------------------------------------------------


def distributions(name, folder):
    """Targets, groups, the default's predictions, and the RPS of each model."""
    targets, groups, tables = heads.SETS[name](folder)
    (y,), groups = targets.values(), np.asarray(groups)
    y, found = np.asarray(y, dtype=float), heads.models(tables[0][2].shape[1])
    models = {
        "ours": found["default: linear, alpha=3"],
        "guess: mean": (DummyDistribution("marginal"), False),
        "guess: centre": (DummyDistribution("barycentre"), False),
        "ours, penalty searched": found["linear, alpha chosen"],
        "kernel ridge": found["kernel ridge"],
        "quantile forest": found["quantile forest"],
        "extremely randomised trees": found["trees"],
    }
    scores, predicted = {}, None
    for label, (model, rotated) in models.items():
        proba = heads.predict(model, rotated, y, groups, tables)
        predicted = proba if predicted is None else predicted
        each = ranked_probability_score(y, proba, average=False)
        scores[label] = heads.of_objects(each, groups)
    return y, groups, predicted, scores


def classes(described, trials, frames, y, groups, folds, clusters):
    """The classes that are predicted, and the errors in each cluster by each model."""
    rows = {
        "ours": (make_haptic_pipeline(described, random_state=0)[0], trials),
        "guess: most frequent": (None, np.zeros((len(y), 1))),
        "statistics of signals": (others.statistics(described), trials),
        "MiniRocket, cut": ("passthrough", others.kernels(frames, False)),
        "MiniRocket, stretched": ("passthrough", others.kernels(frames, True)),
    }
    scores, predicted, splits = {}, None, list(folds.split(y, groups=groups))
    _, which = np.unique(clusters, return_inverse=True)
    for label, (features, X) in rows.items():
        model = others.with_ridge(features) if features else DummyClassifier()
        found = cross_val_predict(model, X, y, cv=splits)
        predicted = found if predicted is None else predicted
        scores[label] = 100 * np.bincount(which, found != y) / np.bincount(which)
    return y, predicted, scores


# Panels -------------------------------------------------------------------------------


def beside_rivals(ax, scores, unit):
    """Differences from the first model, with intervals of 95 %."""
    ours, *rivals = scores
    differences = {name: scores[name] - scores[ours] for name in rivals}
    half = {
        name: d.std(ddof=1) / np.sqrt(len(d)) * t.ppf(0.975, len(d) - 1)
        for name, d in differences.items()
    }
    ends = [  # of all but the guesses, which would hide how the others differ
        1.2 * (abs(d.mean()) + half[name])
        for name, d in differences.items()
        if not name.startswith("guess")
    ]
    ax.set_xlim(-max(ends), max(ends))
    for row, (name, each) in enumerate(differences.items()):
        worse, error = each.mean(), half[name]
        clear = abs(worse) > error
        colour = GREY if not clear else (BLUE if worse > 0 else ORANGE)
        print(f"  {name}: {worse:+.3f} ± {error:.3f}")
        if worse > max(ends):
            ax.text(
                max(ends), row, f"+{worse:.2g} →", color=BLUE, ha="right", va="center"
            )
            continue
        marker = "s" if clear and worse < 0 else "o"
        ax.errorbar(worse, row, xerr=error, fmt=marker, color=colour, capsize=3)
    ax.axvline(0, color="black", linewidth=1)
    ax.set_yticks(range(len(rivals)), labels=rivals)
    ax.set(
        ylim=(len(rivals) - 0.5, -0.5), xlabel=f"{unit}\n← better · worse than ours →"
    )
    ax.set_title(f"Beside rivals (ours: {scores[ours].mean():.2g})", size=11)
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


def confusion(ax, y, predicted, names):
    """How often each class is taken for each."""
    kinds = np.unique(y)
    share = np.array([[np.mean(predicted[y == a] == b) for b in kinds] for a in kinds])
    ax.imshow(share, cmap="Blues", vmin=0, vmax=1)
    for (row, column), value in np.ndenumerate(share):
        if value and row != column:
            ax.text(
                column, row, f"{100 * value:.0f}", ha="center", va="center", size=7,
                color=ORANGE,
            )  # fmt: skip
    ax.set_yticks(range(len(kinds)), labels=kinds if names is None else names, size=8)
    ax.set_xticks([])
    ax.set(xlabel="taken for, in the same order (errors in %)")


# Figures ------------------------------------------------------------------------------


def films(folder):
    y, _, proba, scores = distributions("films", folder)
    figure = plt.figure(figsize=(5.2, 5.4), layout="constrained")
    above, below = figure.subfigures(2, 1)
    error = ranked_probability_score(y, proba, average=False)
    error -= ranked_probability_score(
        y, y / y.sum(axis=1, keepdims=True), average=False
    )
    order = np.argsort(error)
    axes = above.subplots(1, 3, sharex=True, sharey=True)
    for ax, q, name in zip(
        axes, (0.1, 0.5, 0.9), ("a good one", "the median", "a bad one")
    ):
        film = order[round(q * (len(y) - 1))]
        stars = np.arange(1, 6)
        ax.bar(stars, proba[film], color=BLUE)
        ax.plot(stars, y[film] / y[film].sum(), "o", color=ORANGE, mec="white", ms=7)
        ax.set(yticks=[], xlabel="stars", xticks=stars)
        ax.set_title(name, size=9)
        ax.spines[["top", "right", "left"]].set_visible(False)
    axes[0].text(0.3, 0.24, "■ predicted", color=BLUE, weight="bold", size=7.5)
    axes[0].text(0.3, 0.29, "● people", color=ORANGE, weight="bold", size=7.5)
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
    trials, frames, y, splits = others.fabrics(folder)
    with np.load(folder / "fabric_slides" / "fabric_slides.npz") as arrays:
        condition = 1000 * arrays["force"].astype(int) + arrays["speed"].astype(int)
    force = splits["fabric, force"]
    y, predicted, scores = classes(
        others.TaxelGrid((4, 4)), trials, frames, y, *force, condition
    )
    return two_panels(
        confusion, y, predicted, None,
        scores=scores, unit="errors, %", heights=(1.6, 1),
        title="Fabric, at a force never trained on",
    )  # fmt: skip


def slides(folder):
    trials, frames, y, splits = others.materials(folder)
    with np.load(folder / "biotac_slides" / "biotac_slides.npz") as arrays:
        run = arrays["run"]
    (split,) = splits.values()
    y, predicted, scores = classes(others.BIOTAC, trials, frames, y, *split, run)
    return two_panels(
        confusion, y, predicted, None, scores=scores, unit="errors, %", heights=(2, 1),
        title="Which of twenty materials, in runs left out",
    )  # fmt: skip


FIGURES = {f.__name__: f for f in (films, hardness, grips, fabrics, slides)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", nargs="+", default=list(FIGURES), choices=FIGURES)
    parser.add_argument("--to", type=Path, default=Path("docs/images"))
    arguments = parser.parse_args()
    set_config(enable_metadata_routing=True)
    warnings.simplefilter("ignore")  # of mord and few iterations
    for name in arguments.sets:
        print(name, flush=True)
        figure = FIGURES[name](arguments.folder)
        figure.savefig(arguments.to / f"real_{name}.png", dpi=110)
        plt.close(figure)


if __name__ == "__main__":
    main()
