"""The whole experiment of Richardson & Kuchenbecker (2020), on PHAC-2 or generated.

Run it as

    python examples/run_full_study.py --demo                  # about a minute
    python examples/run_full_study.py --split paper --jobs 2  # a quarter of an hour
    python examples/run_full_study.py --paper --jobs 2        # as in the paper: hours
    python examples/run_full_study.py --jobs 8 --phac2 \
        phac_train_test_pos_neg_90_10_1_20.h5 --ratings ratings.csv

You can interrupt it at any time: the same command resumes where it stopped. It prints
the scores beside those of single sensors, of guesses without touch and, for generated
touches, of the truth. It also says whether the combined network beats single sensors,
whether the exploratory procedures differ, and what each sensor contributes. The folder
then holds every prediction (see docs/study.md), and figures like those of the paper:
figure_11.png has the true ratings of an object and the predicted distributions of its
touches, of "cold" and Fast Slide as in the paper if the study has them; figure_12.png
has the scores with all sensors and without each, figure_12_differences.png what each
sensor adds.
"""

import argparse
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from sklearn_haptic.datasets import load_phac2, make_haptic_corpus
from sklearn_haptic.model_selection import contribution_summary
from sklearn_haptic.plotting import InverseCDFDisplay, SensorContributionsDisplay
from sklearn_haptic.study import (
    compare_networks,
    run_study,
    score_table,
)

SCORES = {"macro_mae": "MAE^M", "emd": "EMD", "rps": "RPS", "log_score": "log score"}
DEMO = {
    "procedures": ["hold", "fast_slide"],
    "adjectives": ["hard", "rough"],
    "sensors": ["pac", "pdc", "tac"],
    "n_repeats": 1,
    "n_hidden": [1, 10],
    "alpha": [1.0, 10.0],
    "n_starts": 3,
}


def parse_arguments():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--phac2", help="HDF5 file of trials; generated if not given")
    parser.add_argument("--ratings", help="CSV file of ratings, with --phac2")
    parser.add_argument("--folder", type=Path, help="where results are kept")
    parser.add_argument("--demo", action="store_true", help="a small study")
    parser.add_argument("--paper", action="store_true", help="the paper's settings")
    parser.add_argument("--split", choices=["group_kfold", "paper"])
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    arguments = parser.parse_args()
    if (arguments.phac2 is None) != (arguments.ratings is None):
        parser.error("--phac2 and --ratings belong together; give both or neither.")
    return arguments


def make_corpus(arguments):
    if arguments.phac2 is not None:
        return partial(load_phac2, arguments.phac2, ratings=arguments.ratings)
    n_objects, n_trials = (20, 4) if arguments.demo else (60, 10)
    return partial(make_haptic_corpus, n_objects, n_trials, random_state=0)


def print_scores(study, metric):
    """Print a score of all networks, guesses, ceiling and truth; lower is better."""
    table = score_table(study, metric=metric)
    worse = table.pop("no_better")
    shown = table.map("{:.3f}".format)
    shown["combined"] += worse.map({True: "*", False: " "})
    print(f"\n{SCORES[metric]}, lower is better\n{shown.to_string()}")
    print(f"* no better than the better guess: {worse.sum()} of {len(worse)}")


def print_means(study):
    """Print the mean of each score over all adjectives and procedures."""
    means = {
        name: score_table(study, metric=metric).drop(columns="no_better").mean()
        for metric, name in SCORES.items()
    }
    table = pd.DataFrame(means).map("{:.3f}".format)
    print(f"\nmeans of all adjectives and procedures\n{table.to_string()}")
    largest = study.choices["alpha"] == study.choices["alpha"].max()
    print(f"\nlargest penalty chosen: {largest.sum()} of {len(largest)} networks")


def print_comparisons(study):
    """Say whether combining sensors helps, and whether procedures differ."""
    sensors = compare_networks(study)
    print("\nDoes the combined network beat the network of a single sensor? MAE^M of")
    print("objects; a positive difference says yes; p by Wilcoxon's test over objects.")
    print(sensors.to_string(index=False, float_format="{:.3f}".format))
    if study.scores["procedure"].nunique() < 2:
        return
    procedures = compare_networks(study, "procedures", by="adjective")
    print(
        "\nDo the exploratory procedures differ? MAE^M of objects; p by Friedman's test"
    )
    print("over objects (Wilcoxon's for two procedures).")
    print(procedures.to_string(index=False, float_format="{:.3f}".format))
    differ = (procedures["p_objects"] < 0.05).sum()
    print(f"p < .05 for {differ} of {len(procedures)} adjectives")


def print_summary(study):
    """Print Figure 12 as a table."""
    table = score_table(study)
    summary = contribution_summary(study.scores, by=["procedure", "adjective"])
    helps = (summary["p_objects"] < 0.05).sum()
    print(f"the sensor left out helps in {helps} of {len(summary)} holdouts (p < .05)")
    for (procedure, adjective), rows in summary.groupby(["procedure", "adjective"]):
        full, guesses = rows.iloc[0], table.loc[(adjective, procedure)]
        star = "*" if guesses["no_better"] else ""
        print(
            f"\n{adjective}, {procedure}: MAE^M {full['full']:.3f} "
            f"(sd over starts {full['full_sd']:.3f}){star}, "
            f"marginal {guesses['marginal']:.3f}, "
            f"barycentre {guesses['barycentre']:.3f}"
        )
        columns = ["held_out", "difference", "difference_sd", "p_objects"]
        print(rows[columns].to_string(index=False, float_format="{:.3f}".format))


def plot_contributions(scores, absolute):
    """Plot Figure 12: one row per procedure, one group per adjective."""
    by_procedure = list(scores.groupby("procedure"))
    n_points = scores["adjective"].nunique() * scores["held_out"].nunique()
    figure, axes = plt.subplots(
        len(by_procedure),
        squeeze=False,
        sharey=True,
        figsize=(max(6.4, 0.22 * n_points), 3.2 * len(by_procedure)),
        layout="constrained",
    )
    for ax, (procedure, rows) in zip(axes[:, 0], by_procedure):
        SensorContributionsDisplay.from_scores(
            rows, by="adjective", absolute=absolute, ax=ax
        )
        ax.set_title(procedure.replace("_", " "), loc="left")
    return figure


def plot_ratings(scores):
    """Plot Figure 11 for the object that is predicted as well as half of them."""
    keys = ["procedure", "adjective", "fold", "object"]
    model = scores[(scores["held_out"] == "none") & (scores["start"] == 0)]
    for column, wanted in (("procedure", "fast_slide"), ("adjective", "cold")):
        if (model[column] == wanted).any():
            model = model[model[column] == wanted]
    errors = model.groupby(keys)["macro_mae"].mean().sort_values()
    chosen = errors.index[len(errors) // 2]
    rows = model.set_index(keys).sort_index().loc[chosen]
    display = InverseCDFDisplay.from_predictions(
        rows.filter(like="count_"), rows.filter(like="proba_")
    )
    procedure, adjective, _, name = chosen
    display.ax_.set_title(f"object {name}, {adjective}, {procedure.replace('_', ' ')}")
    return display.figure_


def main():
    arguments = parse_arguments()
    options = DEMO if arguments.demo else {}
    if arguments.split is not None:
        options = options | {"split": arguments.split}
    if arguments.paper:
        options = options | {"protocol": "paper"}
    name = "study_paper" if arguments.paper else "study"
    folder = arguments.folder or Path(name + "_demo" * arguments.demo)
    corpus = make_corpus(arguments)
    study = run_study(corpus, folder, n_jobs=arguments.jobs, **options)
    for metric in ("macro_mae", "rps"):
        print_scores(study, metric)
    print_means(study)
    print_comparisons(study)
    print_summary(study)
    for name, absolute in (("figure_12", True), ("figure_12_differences", False)):
        figure = plot_contributions(study.scores, absolute)
        figure.savefig(folder / f"{name}.png", dpi=150)
    plot_ratings(study.scores).savefig(folder / "figure_11.png", dpi=150)
    print(f"\nFigures saved in {folder}")


if __name__ == "__main__":
    main()
