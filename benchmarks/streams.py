"""Touches in progress: what seconds of touch buy, and when to stop.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/streams.py PART \
        [FOLDER] [--quick]

PART is one of

hold, squeeze, slow_slide  The RPS at each duration, of three adjectives on 24 generated
          objects, with models fitted to 48 others; one to two minutes.
slides    The share of errors of twenty materials on later runs of slides (FOLDER); two
          minutes. Below are, for these four, dispersion and the outer tenths of the PIT
          histogram at each duration, and mean seconds and loss of rules of stopping.
early     The same by features of the presets, by statistics in 32 bands, and beside
          early classifiers of aeon, TEASER and a threshold on probability, in the first
          six seconds of slides (FOLDER); aeon classifies by MiniRocket features of all
          44 channels at 100 Hz, and rules of this package are shown on the same
          predictions. Learned from runs 1 to 10, tested on 11 to 15. Five minutes;
          needs the extra `aeon`.
halves    Why half of a slow slide costs something: the loss by the first two seconds,
          the next two, and all four, by models that share more or less with their
          neighbours, beside the loss out of fold on the training objects; two minutes.
short     Touches with fewer windows than cells, from pressure and temperature cut into
          stretches at random and pooled into 16, 8, 4, 2 and 1 cells: what a cell holds
          if it is the window in which the cell begins; the one or two windows that it
          covers in part; the window at its middle and the two beside it (the
          package's); every window; zeros where no window begins; or if levels of more
          cells than the shortest training touch has windows are dropped. Accuracy of
          twenty materials (FOLDER) and RPS of generated fast slides; four minutes.

``--quick`` takes fewer objects or durations.
"""

import sys
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

import data
import numpy as np
import pandas as pd
from data import RATES
from heads import RIDGE, linear, minirocket
from measure import (
    command,
    head,
    of_groups,
    plus_minus,
    row,
)
from sklearn.base import clone
from sklearn.compose import make_column_transformer
from sklearn.decomposition import PCA
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    AnytimeRegressor,
    KSVDTransformer,
    SignalStatistics,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import dispersion, pit_histogram, ranked_probability_score
from sklearn_haptic.streaming import CertaintyThreshold, ExpectedGain

DURATIONS = [0.1, 0.25, 0.5, 1, 2, 4, 8]
LONGEST = {"hold": 8, "squeeze": 4, "slow_slide": 4}
ADJECTIVES = "hard", "cold", "slippery"
CLASSIFIER = LogisticRegression(C=0.1, max_iter=500)
RULES = {f"probability {t:g}": CertaintyThreshold(t) for t in (0.3, 0.5, 0.7, 0.8)}
RULES |= {f"probability {t:g}": CertaintyThreshold(t) for t in (0.9, 0.97)}
RULES |= {
    f"expected gain, price {p:g}": ExpectedGain(p)
    for p in (0.1, 0.03, 0.01, 0.003, 0.001)
}


def pipeline(model=None):
    """The preset "fast", with windows short enough for a quarter of a second."""
    steps = make_haptic_pipeline(data.SENSORS, random_state=0)
    for sensor in ("pdc", "tac", "tdc"):
        steps.set_params(**{f"features__{sensor}__codes__ksvdtransformer__window": 20})
    steps.set_params(features__electrodes__codes__sthmptransformer__spatial_cells=(1,))
    return steps if model is None else steps.set_params(model=model)


def generated(procedure, quick):
    """A corpus, and which trials are for training."""
    n_objects = 18 if quick else 72
    corpus = make_haptic_corpus(n_objects, 3, procedure=procedure, random_state=3)
    order = np.random.default_rng(3).permutation(np.unique(corpus.objects))
    return corpus, np.isin(corpus.objects, order[: n_objects * 2 // 3])


def loss_of(y, proba, classes):
    """Loss of each trial and duration."""
    if np.ndim(y) == 1:
        return (classes[proba.argmax(axis=2)] != y[:, None]).astype(float)
    each = [ranked_probability_score(y, p, average=False) for p in proba.swapaxes(0, 1)]
    return np.stack(each, axis=1)


def stop(rule, out_of_fold, y, path, durations, classes):
    """Where a rule that learns from training trials stops others."""
    one_hot = y if np.ndim(y) == 2 else y[:, None] == classes
    options = {"durations": durations, "ordered": np.ndim(y) == 2}
    return clone(rule).fit(out_of_fold, one_hot, **options).stop_at(path)


# What seconds buy ---------------------------------------------------------------------


def curve(touches, targets, groups, train, durations, model, cv):
    """Print the loss at each duration and by each rule; groups are the units."""
    model = AnytimeRegressor(model, durations=durations, sampling_rates=RATES, cv=cv)
    frames = touches["pdc"].map(len)[~train].to_numpy()
    reached = frames[:, None] >= 100 * np.array(durations) - 1e-6
    head("seconds", *durations)
    total, stopped = 0, dict.fromkeys(RULES, 0)
    for name, y in targets.items():
        model.fit(touches[train], y[train], groups=groups[train])
        proba = model.predict_proba_over_time(touches[~train], durations)
        loss = loss_of(y[~train], proba, model.classes_)
        row(name, *(f"{each:.3f}" for each in loss.mean(axis=0)))
        if y.ndim == 2:
            at_each = list(proba.swapaxes(0, 1))
            row("dispersion", *(f"{dispersion(y[~train], p):.2f}" for p in at_each))
            pit = np.array([pit_histogram(y[~train], p) for p in at_each])
            row("PIT, outer tenths", *(f"{p[0]:.2f}, {p[-1]:.2f}" for p in pit))
        total = total + loss / len(targets)
        path = np.where(reached[..., None], proba, np.nan)
        for label, rule in RULES.items():
            at = stop(rule, model.oof_proba_, y[train], path, durations, model.classes_)
            result = np.take(durations, at), loss[np.arange(len(at)), at]
            stopped[label] = stopped[label] + np.array(result) / len(targets)
    units, mean = groups[~train], total.mean(axis=0)
    head("rule", "seconds", "loss", "fixed duration", "to the longest")
    for k, seconds in enumerate(durations):
        gain = plus_minus(of_groups(total[:, k] - total[:, -1], units))
        row("fixed", f"{seconds:g}", f"{mean[k]:.3f}", "", gain)
    for label, (seconds, loss) in stopped.items():
        fixed = np.interp(np.log(seconds.mean()), np.log(durations), mean)
        gain = plus_minus(of_groups(loss - total[:, -1], units))
        row(label, f"{seconds.mean():.2f}", f"{loss.mean():.3f}", f"{fixed:.3f}", gain)


def procedure(name, quick):
    corpus, train = generated(name, quick)
    names = ADJECTIVES[: 1 if quick else 3]
    targets = {a: corpus.ratings[a] for a in names}
    durations = [d for d in DURATIONS if d <= LONGEST[name]][2 if quick else 0 :]
    curve(corpus.trials, targets, corpus.objects, train, durations, pipeline(), 3)


def slides(folder, quick):
    frames, material, run = data.slide_frames(folder, dtype=float)
    durations = [0.5, 1] if quick else [*DURATIONS[:-1], 7.5]
    trials, model = data.by_sensor(frames), pipeline(CLASSIFIER)
    curve(trials, {"material": material}, run, run <= 10, durations, model, 5)


def halves(quick):
    corpus, train = generated("slow_slide", quick)
    head("touch", "seconds", "loss", "out of fold", "2 s to the longest")
    cases = [("0–2 s", 0, 2, 0), ("2–4 s", 2, 4, 0)]
    cases += [(f"0–4 s, sharing {x}", 0, 4, x) for x in (0, 0.5, 1)]
    for name, start, end, sharing in cases:
        cut = {
            s: [x[start * r : end * r] for x in corpus.trials[s]]
            for s, r in RATES.items()
        }
        cut = pd.DataFrame(cut)
        durations = [d for d in (1, 2, 4) if d <= end - start]
        model = AnytimeRegressor(
            pipeline(),
            durations=durations,
            sampling_rates=RATES,
            cv=3,
            sharing=sharing,
        )
        loss = inner = 0
        for adjective in ADJECTIVES:
            y = corpus.ratings[adjective]
            model.fit(cut[train], y[train], groups=corpus.objects[train])
            proba = model.predict_proba_over_time(cut[~train], durations)
            loss = loss + loss_of(y[~train], proba, None) / 3
            inner = inner + loss_of(y[train], model.oof_proba_, None).mean(axis=0) / 3
        gain = of_groups(loss[:, 1] - loss[:, -1], corpus.objects[~train])
        for k, seconds in list(enumerate(durations))[1:]:
            means = f"{loss[:, k].mean():.3f}", f"{inner[k]:.3f}"
            row(name, seconds, *means, plus_minus(gain))


# Beside early classifiers -------------------------------------------------------------


def show(name, right, seconds):
    row(name, f"{np.mean(seconds):.2f}", plus_minus(1.0 - right, 2, ""))


def show_rules(name, path, out_of_fold, y, y_train, classes, durations):
    """Fixed durations, and where rules of this package stop."""
    right = classes[path.argmax(axis=2)] == y[:, None]
    for k, seconds in enumerate(durations):
        show(f"{name}, fixed {seconds:g} s", right[:, k], seconds)
    for label, each in RULES.items():
        at = stop(each, out_of_fold, y_train, path, durations, classes)
        hit = right[np.arange(len(at)), at]
        show(f"{name}, {label}", hit, np.take(durations, at))


def early(folder, quick):
    from aeon.classification.early_classification import (
        TEASER,
        ProbabilityThresholdEarlyClassifier,
    )

    points = [25, 50] if quick else [10, 25, 50, 100, 200, 400, 599]
    durations = [n / 100 for n in points]
    frames, y, run = data.slide_frames(folder, points[-1], float)
    train, touches = run <= 10, data.by_sensor(frames)
    head("rule", "seconds, mean", "share of errors")
    statistics = make_column_transformer(
        *((SignalStatistics(n_bands=32), sensor) for sensor in touches)
    )
    for name, model in {
        "codes": pipeline(CLASSIFIER),
        "statistics": make_pipeline(statistics, StandardScaler(), CLASSIFIER),
    }.items():
        model = AnytimeRegressor(model, durations=durations, sampling_rates=RATES)
        model.fit(touches[train], y[train], groups=run[train])
        path, oof = (
            model.predict_proba_over_time(touches[~train], durations),
            model.oof_proba_,
        )
        errors = loss_of(y[train], oof, model.classes_).mean(axis=0).round(2)
        print(f"{name}, out of fold: errors {errors}")
        show_rules(name, path, oof, y[~train], y[train], model.classes_, durations)

    X = np.stack(frames).swapaxes(1, 2).astype(np.float32)
    options = {"classification_points": points, "random_state": 0}
    with TemporaryDirectory() as memory:
        steps = minirocket(), StandardScaler(), PCA(random_state=0), CLASSIFIER
        rockets = make_pipeline(*steps, memory=memory)

        def show_peer(name, fitted):
            predicted, _ = fitted.predict(X[~train])
            stopped = np.take(points, fitted.state_info[:, 0]) / 100
            show(f"aeon, {name}", predicted == y[~train], stopped)

        fitted = ProbabilityThresholdEarlyClassifier(rockets, **options)
        fitted.fit(X[train], y[train])
        for threshold in (0.3, 0.5, 0.7, 0.8, 0.9, 0.97):
            fitted.probability_threshold = threshold
            show_peer(f"probability {threshold:g}", fitted)
        path, oof = [], []
        for n, each in zip(points, fitted.estimators_):
            path.append(each.predict_proba(X[~train, :, :n]))
            folds = list(GroupKFold(5).split(y[train], groups=run[train]))
            oof.append(
                cross_val_predict(
                    rockets, X[train, :, :n], y[train], cv=folds, method="predict_proba"
                )
            )
        path, oof = np.stack(path, axis=1), np.stack(oof, axis=1)
        of_test = path, oof, y[~train], y[train], np.unique(y), durations
        show_rules("MiniRocket", *of_test)
        show_peer("TEASER", TEASER(rockets, **options).fit(X[train], y[train]))


# Short touches ------------------------------------------------------------------------

CELLS = (16, 8, 4, 2, 1)
ATOMS = {"pdc": 25, "tac": 25, "tdc": 10}
# Seconds of training and of test touches.
STRETCHES = {
    "whole, test 1": ((99, 99), (1, 1)),
    "1": ((1, 1), (1, 1)),
    "2, test 0.6": ((2, 2), (0.6, 0.6)),
    "1.2 to 3.5": ((1.2, 3.5), (1.2, 3.5)),
    "whole": ((99, 99), (99, 99)),
}


def level(codes, n_cells, rule):
    """The features of a level of the pyramid."""
    n_times, cell = len(codes), np.arange(n_cells)
    if n_cells <= n_times or rule in ("beside", "dropped"):
        return TemporalMaxPool((n_cells,)).fit_transform([codes]).ravel()
    first = cell * n_times // n_cells
    if rule == "begin":
        return codes[first].ravel()
    if rule == "covered":
        last = -(-(cell + 1) * n_times // n_cells) - 1
        return np.maximum(codes[first], codes[last]).ravel()
    if rule == "all":
        return np.tile(codes.max(axis=0), (n_cells, 1)).ravel()
    out = np.zeros((n_cells, codes.shape[1]))  # zeros
    out[-(-np.arange(n_times) * n_cells // n_times)] = codes
    return out.ravel()


def pool(codes, rule, train):
    """Features of all touches of a sensor."""
    shortest = min(len(codes[i]) for i in train)
    cells = [n for n in CELLS if rule != "dropped" or n <= shortest]
    return np.array(
        [np.concatenate([level(each, n, rule) for n in cells]) for each in codes]
    )


def scores(trials, folds, score, seconds):
    """The score of every rule, one row per fold."""
    table = []
    for fold, (train, test) in enumerate(folds):
        rng = np.random.default_rng(fold)
        frames = rng.uniform(*seconds[1], len(trials))
        frames[train] = rng.uniform(*seconds[0], len(train))
        frames, places = (100 * frames).astype(int), rng.uniform(size=len(trials))
        codes = []
        for sensor, n_atoms in ATOMS.items():
            cut = []
            for trial, n, place in zip(trials[sensor], frames, places):
                start = int(place * max(0, len(trial) - n))
                cut.append(np.asarray(trial[start : start + n], dtype=float))
            coder = KSVDTransformer(
                n_atoms, window=50, remove_mean=False, max_iter=20, random_state=0
            )
            coder.fit([cut[i] for i in train])
            codes.append(list(coder.transform(cut)))
        rules = "begin", "covered", "beside", "all", "zeros", "dropped"
        features = [np.hstack([pool(c, rule, train) for c in codes]) for rule in rules]
        table.append([score(X, train, test) for X in features])
    return np.mean(table, axis=0)


def short(folder, quick):
    """Print a row for each length of touches."""
    frames, material, run = data.slide_frames(folder, dtype=float)
    blocks = [(run - 1) // 5 == b for b in range(1 if quick else 3)]
    folds = [(np.flatnonzero(~b), np.flatnonzero(b)) for b in blocks]

    def accuracy(X, train, test):
        model = make_pipeline(StandardScaler(), RIDGE)
        return model.fit(X[train], material[train]).score(X[test], material[test])

    corpus = make_haptic_corpus(40, 4, "fast_slide", sensors=[*ATOMS], random_state=0)
    by_object = list(GroupKFold(4).split(corpus.objects, groups=corpus.objects))

    def rps(X, train, test):
        model, found = make_pipeline(StandardScaler(), linear()), []
        for adjective in ("hard", "rough", "cold"):
            y = corpus.ratings[adjective]
            proba = model.fit(X[train], y[train]).predict_proba(X[test])
            found.append(ranked_probability_score(y[test], proba))
        return np.mean(found)

    lengths = list(STRETCHES)
    rules = "begin", "covered", "beside", "all", "zeros", "dropped"
    head("touches", "seconds", *rules)
    for name, trials, splits, score, used in [
        ("slides, accuracy", data.by_sensor(frames), folds, accuracy, lengths[:-1]),
        ("generated, RPS", corpus.trials, by_object, rps, lengths[2:]),
    ]:
        for length in used[:1] if quick else used:
            means = scores(trials, splits, score, STRETCHES[length])
            row(name, length, *(f"{mean:.3f}" for mean in means))


def main():
    of_folder = {"slides": slides, "early": early, "short": short}
    parser = command(__doc__)
    parser.add_argument("part", choices=[*LONGEST, *of_folder, "halves"])
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # of aeon
    if arguments.part in of_folder:
        if arguments.folder is None:
            sys.exit("Name the folder of data sets.")
        of_folder[arguments.part](arguments.folder, arguments.quick)
    elif arguments.part == "halves":
        halves(arguments.quick)
    else:
        procedure(arguments.part, arguments.quick)


if __name__ == "__main__":
    main()
