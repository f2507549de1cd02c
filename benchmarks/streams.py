"""Touches in progress: what seconds of touch buy, and when to stop.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/streams.py PART \
        [FOLDER] [--quick]

hold, squeeze, slow_slide  The RPS at each duration, of three adjectives on 24 generated
          objects, with models fitted to 48 others; one to two minutes.
slides    The share of errors of twenty materials on later runs of slides (FOLDER); two
          minutes. For ratings there are also dispersions, and for all of these mean
          seconds and loss of rules of stopping.

``--quick`` takes fewer objects or durations.
"""

import sys
from pathlib import Path

import data
import numpy as np
from data import RATES
from measure import command, head, of_groups, plus_minus, row
from sklearn.base import clone
from sklearn.linear_model import LogisticRegression

from sklearn_haptic import AnytimeRegressor, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import dispersion, ranked_probability_score
from sklearn_haptic.streaming import CertaintyThreshold, ExpectedGain

DURATIONS = [0.1, 0.25, 0.5, 1, 2, 4, 8]
LONGEST = {"hold": 8, "squeeze": 4, "slow_slide": 4}
ADJECTIVES = "hard", "cold", "slippery"
CLASSIFIER = LogisticRegression(C=0.1, max_iter=500)
THRESHOLDS, PRICES = (0.3, 0.5, 0.7, 0.8, 0.9, 0.97), (0.1, 0.03, 0.01, 0.003, 0.001)
RULES = {f"probability {t:g}": CertaintyThreshold(t) for t in THRESHOLDS}
RULES |= {f"expected gain, price {p:g}": ExpectedGain(p) for p in PRICES}


def pipeline(model=None):
    """The default, with windows short enough for a quarter of a second."""
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


def main():
    parser = command(__doc__)
    parser.add_argument("part", choices=[*LONGEST, "slides"])
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    if arguments.part in LONGEST:
        procedure(arguments.part, arguments.quick)
    elif arguments.folder is None:
        sys.exit("Name the folder of data sets.")
    else:
        slides(arguments.folder, arguments.quick)


if __name__ == "__main__":
    main()
