"""Which material is it: this package beside plain statistics and MiniRocket.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/materials.py FOLDER \
        [--parts seconds runs time stream fabrics] [--rows MiniRocket …]

seconds  Slides over twenty materials, of which stretches of 0.5, 1 and 2 s are cut at
         random; learned from ten runs of each, tested on the five others in turn.
runs     The same, whole, learned from one, two, five and ten runs.
time     Whole slides of one run, learned from the five runs nearest in time and from
         the five furthest, also with the level of the first 0.1 s subtracted.
stream   The same by `AnytimeRegressor` after 0.5, 1 and 2 s, every third run.
fabrics  Slides over seven fabrics, one of five forces left out in turn.

Cells are the accuracies of logistic regression and of a ridge classifier. All parts
take a quarter of an hour on one core; MiniRocket needs the extra ``aeon``.
"""

import warnings
from functools import partial

import data
import numpy as np
from heads import RIDGE, OfAeon, minirocket
from measure import command, head, row
from sklearn.base import clone
from sklearn.compose import make_column_transformer
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import LeaveOneGroupOut
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from sklearn_haptic import (
    AnytimeRegressor,
    RepairTrials,
    SignalStatistics,
    TaxelGrid,
    make_haptic_pipeline,
)

HEADS = LogisticRegression(max_iter=1000), RIDGE


def describe(touch):
    """Statistics of each channel and bands of vibration, as docs/materials.md has."""
    parts = []
    for name, signal in touch.items():
        x = np.asarray(signal, dtype=float)
        parts += [x.mean(axis=0), x.std(axis=0), x.min(axis=0), x.max(axis=0)]
        if name == "pac":
            power = np.abs(np.fft.rfft(x - x.mean(axis=0), axis=0)) ** 2
            starts = np.arange(32) * len(power) // 32
            bands = np.add.reduceat(power, starts) / len(x)
            parts.append(np.log(bands + 1e-9).ravel())
    return np.concatenate(parts)


def describe_all(trials):
    """The same of every touch."""
    if isinstance(trials, list):
        return np.array([describe({"": signal}) for signal in trials])
    return np.array([describe(touch) for _, touch in trials.iterrows()])


def families(described):
    """Name -> features, standardised."""
    whole = SignalStatistics(n_bands=32)
    if isinstance(described, list):
        whole = make_column_transformer(*((clone(whole), s) for s in described))
    return {
        "make_haptic_pipeline": make_haptic_pipeline(described, random_state=0)[0],
        "SignalStatistics": make_pipeline(whole, StandardScaler()),
        "twenty lines": make_pipeline(
            FunctionTransformer(describe_all), StandardScaler()
        ),
        "MiniRocket": make_pipeline(OfAeon(minirocket), StandardScaler()),
    }


def accuracies(features, trials, y, folds):
    """Accuracy of both heads over all test trials of the folds."""
    right = [[], []]
    for train, test in folds:
        A, B = (take(trials, rows) for rows in (train, test))
        steps = clone(features)
        A, B = steps.fit_transform(A), steps.transform(B)
        for hits, each in zip(right, HEADS):
            hits.append(clone(each).fit(A, y[train]).predict(B) == y[test])
    return [np.concatenate(hits).mean() for hits in right]


def take(trials, rows):
    return [trials[i] for i in rows] if isinstance(trials, list) else trials.iloc[rows]


def compare(title, described, columns, y, rows):
    """Print the accuracies of some features; columns are (label, trials, folds)."""
    head("features", *(label for label, *_ in columns), title=title)
    for name, features in families(described).items():
        if rows and name not in rows:
            continue
        cells = [accuracies(features, X, y, folds) for _, X, folds in columns]
        row(name, *("/".join(f"{a:.3f}" for a in cell) for cell in cells))


def blocks(run, n_runs=10):
    """Folds of three blocks of five runs; of one block if few runs are learned from."""
    for block in range(3):
        inside = (run - 1) // 5 == block
        train, test = np.flatnonzero(~inside), np.flatnonzero(inside)
        if n_runs < 10:
            train, test = test[(run[test] - 1) % 5 < n_runs], train
        yield train, test


def neighbours(run, nearest):
    """Folds of one run, with the five runs nearest to it or furthest from it."""
    for each in range(1, 16):
        others = sorted(set(range(1, 16)) - {each}, key=lambda other: abs(other - each))
        chosen = others[:5] if nearest else others[-5:]
        yield np.flatnonzero(np.isin(run, chosen)), np.flatnonzero(run == each)


def in_streams(slides, material, run, seconds=(0.5, 1, 2)):
    """Print the accuracy of touches in progress, by time between runs."""
    head("five runs", *(f"{s:g} s" for s in seconds), title="materials, in progress")
    model = make_haptic_pipeline(random_state=0).set_params(model=HEADS[0])
    model = AnytimeRegressor(model, durations=seconds, sampling_rates=data.RATES, cv=5)
    for nearest in (True, False):
        right = []
        for train, test in list(neighbours(run, nearest))[::3]:
            fitted = clone(model)
            fitted.fit(slides.iloc[train], material[train], groups=run[train])
            proba = fitted.predict_proba_over_time(slides.iloc[test], seconds)
            named = fitted.classes_[proba.argmax(axis=2)]
            right.append(named == material[test, np.newaxis])
        accuracy = np.concatenate(right).mean(axis=0)
        name = "nearest" if nearest else "furthest"
        row(name, *(f"{each:.3f}" for each in accuracy))


def main():
    parser = command(__doc__, folder=True)
    parts = ["seconds", "runs", "time", "stream", "fabrics"]
    parser.add_argument("--parts", nargs="+", default=parts, choices=parts)
    parser.add_argument("--rows", nargs="+", help="by default all")
    arguments = parser.parse_args()
    show = partial(compare, rows=arguments.rows)
    warnings.simplefilter("ignore")  # few iterations
    frames, material, run = data.slide_frames(arguments.folder)
    slides = data.by_sensor(frames)
    if "seconds" in arguments.parts:
        at, columns = np.random.default_rng(0).uniform(size=len(frames)), []
        for n in (50, 100, 200):
            cut = [f[int(u * (len(f) - n)) :][:n] for f, u in zip(frames, at)]
            columns.append((f"{n / 100:g} s", data.by_sensor(cut), [*blocks(run)]))
        show("materials, by seconds of touch", data.SENSORS, columns, material)
    if "runs" in arguments.parts:
        columns = [(f"{n} runs", slides, [*blocks(run, n)]) for n in (1, 2, 5, 10)]
        show("materials, by runs learned from", data.SENSORS, columns, material)
    if "time" in arguments.parts:
        mended = RepairTrials(rest={name: 10 for name in data.SENSORS if name != "pac"})
        mended = mended.fit_transform(slides)
        columns = [
            (f"{label}{text}", X, [*neighbours(run, label == "nearest")])
            for X, text in ((slides, ""), (mended, ", less the start"))
            for label in ("nearest", "furthest")
        ]
        show("materials, by time between runs", data.SENSORS, columns, material)
    if "stream" in arguments.parts:
        in_streams(slides, material, run)
    if "fabrics" in arguments.parts:
        frames, fabric, force, _ = data.fabric_slides(arguments.folder)
        folds = list(LeaveOneGroupOut().split(force, groups=force))
        columns = [("force left out", frames, folds)]
        show("fabrics", TaxelGrid((4, 4)), columns, fabric)


if __name__ == "__main__":
    main()
