"""What each knob costs and gains, one at a time around a base setting.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
        python benchmarks/speed_accuracy.py FOLDER [--csv FILE] [--folds FILE] \
        [--figure FILE] [--quick] [--sets synthetic bolt movie phac2] \
        [--knobs atoms "hidden units" …]

FOLDER holds ``bolt_pilot/``, ``movie_ratings/`` and ``phac2_static/``; the synthetic
set needs none of them. It takes about an hour on one core, with ``--quick`` a few
minutes. Progress goes to stderr, one Markdown table per knob to stdout. The knobs are
in `speed_accuracy_settings.py`.

There are five folds of whole objects, repeated with other folds and seeds. Dictionaries
and scaling are fitted to the training trials alone. The first value of every knob is
its reference, which has scores ± standard errors. The others have their score and, in
brackets, the paired difference to the reference on the same folds ± the standard error
of that difference, in bold where it exceeds twice that error. The folds of a
cross-validation share training objects, so the standard errors are those of Nadeau
and Bengio [1]_, which are larger than the naive ones.

The base has the defaults of the transformers and of `DistributionalOrdinalRegressor`,
but keeps the means of windows. Features are standardised and rotated to as many axes
as there are trials, which loses nothing and makes every later fit faster. ``alpha`` is
10 throughout, also with hidden units, unless a value says otherwise; presets have the
default, 3. Nothing is fitted to the test trials.

Seconds are processor time on one thread, medians over folds. "features" learns
dictionaries and codes, scales and rotates the training trials; "transform" codes,
scales and rotates the test trials; "fit" and "predict" are those of the head, per
adjective. Memory is the peak that Python and NumPy report to tracemalloc, in separate
runs on the first fold: of one sensor's features at a time, or of the head, whichever
the knob changes.

.. [1] Nadeau, C. & Bengio, Y. (2003). Inference for the generalization error.
   Machine Learning 52. https://doi.org/10.1023/A:1024068626366
"""

import argparse
import csv
import os
import sys
import time
import warnings
from pathlib import Path

import pandas as pd
from sklearn.exceptions import ConvergenceWarning
from speed_accuracy_data import REPEATS, load
from speed_accuracy_figure import draw
from speed_accuracy_folds import folds
from speed_accuracy_settings import FEATURE_KNOBS, KNOBS
from speed_accuracy_tables import COLUMNS, summarise, table

started = time.perf_counter()


def say(text):
    minutes = (time.perf_counter() - started) / 60
    print(f"[{minutes:5.1f} min] {text}", file=sys.stderr, flush=True)


def measure(name, data, knobs, n_folds, n_repeats, write):
    """One row per fold, knob and value; ``write`` is given each as it comes."""
    rows = []
    for fold in folds(data, n_folds, n_repeats):
        for knob in knobs:
            for value, setting in KNOBS[knob].items():
                seconds, scores = fold.evaluate(setting)
                memory = ""
                if fold.repeat == fold.fold == 0:
                    of_features = knob in FEATURE_KNOBS
                    memory = (
                        fold.features_memory if of_features else fold.head_memory
                    )(setting)
                row = [name, knob, value, fold.repeat, fold.fold]
                rows.append(dict(zip(COLUMNS, [*row, *seconds, memory, *scores])))
                write(rows[-1])
            say(f"{name}, repeat {fold.repeat}, fold {fold.fold}: {knob}")
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", nargs="+", default=list(REPEATS), choices=REPEATS)
    parser.add_argument("--knobs", nargs="+", default=list(KNOBS), choices=KNOBS)
    parser.add_argument("--repeats", type=int, help="how often the folds are drawn")
    parser.add_argument("--quick", action="store_true", help="small sets, three folds")
    parser.add_argument("--figure", type=Path, help="file for a figure of features")
    parser.add_argument("--csv", type=Path, help="file for one row per value")
    parser.add_argument(
        "--folds", type=Path, help="file for one row per value and fold"
    )
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)
    warnings.simplefilter("ignore", DeprecationWarning)  # mord 0.7 on SciPy 1.17
    n_folds = 3 if arguments.quick else 5
    with open(arguments.folds or os.devnull, "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()

        def write(row):
            writer.writerow(row)
            file.flush()

        summaries = []
        for name in arguments.sets:
            data = load(name, arguments.folder, arguments.quick)
            knobs = [
                knob
                for knob in arguments.knobs
                if not (data.is_table and knob in FEATURE_KNOBS)
            ]
            n_repeats = arguments.repeats or (1 if arguments.quick else REPEATS[name])
            rows = measure(name, data, knobs, n_folds, n_repeats, write)
            print(f"\n## {name}: {data.title}, {n_repeats} × {n_folds} folds")
            summaries.append(summarise(rows, n_folds))
            for knob in knobs:
                print(f"\n{table(summaries[-1], knob)}", flush=True)
    summary = pd.concat(summaries)
    if arguments.csv:
        summary.to_csv(arguments.csv, index=False, float_format="%.4g")
    if arguments.figure and "dictionaries" in arguments.knobs:
        draw(summary[summary["set"].isin(["synthetic", "bolt"])], arguments.figure)


if __name__ == "__main__":
    main()
