"""Touches in progress: what an update costs, and what seconds of touch buy.

    python benchmarks/streaming.py latency
    python benchmarks/streaming.py hold
    python benchmarks/streaming.py squeeze
    python benchmarks/streaming.py slow_slide
    python benchmarks/streaming.py halves
    python benchmarks/streaming.py biotac_slides.npz

The first streams a minute of five sensors in updates of 10 ms and prints milliseconds
of processor time, beside those of recomputing from all samples so far (half a minute).
`halves` prints why half of a slow slide costs something: the loss by the first two
seconds, the next two, and all four, by heads that share more or less with their
neighbours, beside the loss out of fold on the training objects.
The others print the loss at each duration: the RPS of three adjectives on 24 generated
objects, with models fitted to 48 others, or the share of errors of twenty materials on
later runs of slides. Below are dispersion and the outer tenths of the PIT histogram of
each duration, and the mean seconds and loss of rules of stopping (one to two minutes
each).
"""

import sys
import time

import numpy as np
import pandas as pd
from sklearn.linear_model import LogisticRegression

from sklearn_haptic import AnytimeRegressor, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import (
    dispersion,
    pit_histogram,
    ranked_probability_score,
)
from sklearn_haptic.streaming import CertaintyThreshold, ExpectedGain

RATES = {"pac": 2200, "pdc": 100, "tac": 100, "tdc": 100, "electrodes": 100}
DURATIONS = [0.1, 0.25, 0.5, 1, 2, 4, 8]
LONGEST = {"hold": 8, "squeeze": 4, "slow_slide": 4}
RULES = {
    "expected gain": [ExpectedGain(p) for p in (0.001, 0.003, 0.01, 0.03, 0.1)],
    "probability": [CertaintyThreshold(t) for t in (0.3, 0.5, 0.7, 0.9, 0.97)],
}


def pipeline(head=None):
    """The preset "fast", with windows short enough for a quarter of a second."""
    model = make_haptic_pipeline(list(RATES), random_state=0)
    for sensor in ("pdc", "tac", "tdc"):
        model.set_params(**{f"features__{sensor}__codes__ksvdtransformer__window": 20})
    model.set_params(features__electrodes__codes__sthmptransformer__spatial_cells=(1,))
    return model if head is None else model.set_params(model=head)


def latency():
    corpus = make_haptic_corpus(14, 2, random_state=0)
    touches = corpus.trials.map(np.float64)
    model = AnytimeRegressor(
        pipeline(), durations=DURATIONS, sampling_rates=RATES, cv=2
    ).fit(touches, corpus.ratings["hard"], groups=corpus.objects)
    minute = {s: np.vstack([touches[s].iloc[0]] * 6) for s in RATES}
    chunks = [
        {s: minute[s][i * r // 100 : (i + 1) * r // 100] for s, r in RATES.items()}
        for i in range(6000)
    ]
    touch, update, predict = model.start(), [], []
    for new in chunks:
        update.append(seconds_of(lambda new=new: touch.update(new)))
        predict.append(seconds_of(touch.predict_proba))
    print("ms of processor time     median    95 %    99 %     max")
    for start, end in ((0, 1), (1, 8), (9, 10), (59, 60)):
        for name, each in (("update", update), ("prediction", predict)):
            row = 1e3 * np.percentile(each[100 * start : 100 * end], [50, 95, 99, 100])
            print(
                f"{name:10s} {start:2d} to {end:2d} s ", *(f"{ms:7.2f}" for ms in row)
            )
    for end in (1, 8, 60):
        so_far = pd.DataFrame({s: [x[: end * RATES[s]]] for s, x in minute.items()})
        each = [
            seconds_of(lambda so_far=so_far: model.predict_proba(so_far))
            for _ in range(5)
        ]
        print(f"recomputed at {end:2d} s   {1e3 * np.median(each):7.2f}")


def seconds_of(function):
    start = time.process_time()
    function()
    return time.process_time() - start


def slides(path):
    with np.load(path) as arrays:
        frames = np.split(
            arrays["frames"].astype(np.float64), np.cumsum(arrays["length"])[:-1]
        )
        materials, run = arrays["material"], arrays["run"]
    columns = {"tdc": [0], "tac": [1], "pdc": [2], "electrodes": range(25, 44)}
    touches = {s: [x[:, list(c)] for x in frames] for s, c in columns.items()}
    touches["pac"] = [x[:, 3:25].reshape(-1, 1) for x in frames]
    return pd.DataFrame(touches), materials, run


def generated(procedure):
    corpus = make_haptic_corpus(72, 3, procedure=procedure, random_state=3)
    order = np.random.default_rng(3).permutation(np.unique(corpus.objects))
    return corpus, np.isin(corpus.objects, order[:48])


def loss_of(y, proba, classes):
    if np.ndim(y) == 1:
        return (classes[proba.argmax(axis=1)] != y).astype(float)
    return ranked_probability_score(y, proba, average=False)


def mean_and_se(values, groups):
    each = np.array([values[groups == g].mean() for g in np.unique(groups)])
    return each.mean(), each.std(ddof=1) / np.sqrt(len(each))


def accuracy(what):
    if what in LONGEST:
        corpus, train = generated(what)
        touches, groups = corpus.trials, corpus.objects
        ratings = {a: corpus.ratings[a] for a in ("hard", "cold", "slippery")}
        units = groups[~train]
        durations = [d for d in DURATIONS if d <= LONGEST[what]]
        model, cv = pipeline(), 3
    else:
        touches, materials, groups = slides(what)
        train, ratings = groups <= 10, {"material": materials}
        units = materials[~train]
        durations = [*DURATIONS[:-1], 7.5]
        model, cv = pipeline(LogisticRegression(C=0.1, max_iter=500)), 5
    model = AnytimeRegressor(model, durations=durations, sampling_rates=RATES, cv=cv)
    frames = touches["pdc"].map(len)[~train].to_numpy()
    reached = frames[:, None] >= 100 * np.array(durations) - 1e-6
    print(f"{'seconds':22s}", *(f"{d:7g}" for d in durations))
    total, by_rule = 0, {name: 0 for name in RULES}
    for name, y in ratings.items():
        model.fit(touches[train], y[train], groups=groups[train])
        proba = model.predict_proba_over_time(touches[~train], durations)
        loss = np.stack(
            [loss_of(y[~train], p, model.classes_) for p in proba.swapaxes(0, 1)], 1
        )
        print(f"{name:22s}", *(f"{x:7.3f}" for x in loss.mean(axis=0)))
        if y.ndim == 2:
            calibration(y[~train], proba)
        total = total + loss / len(ratings)
        one_hot = y if y.ndim == 2 else y[:, None] == model.classes_
        path = np.where(reached[..., None], proba, np.nan)
        for rule, settings in RULES.items():
            for i, each in enumerate(settings):
                each.fit(
                    model.oof_proba_,
                    one_hot[train],
                    durations=durations,
                    ordered=y.ndim == 2,
                )
                at = each.stop_at(path)
                result = np.zeros((len(settings), 2, len(at)))
                result[i] = np.take(durations, at), loss[np.arange(len(at)), at]
                by_rule[rule] = by_rule[rule] + result / len(ratings)
    print("\nall, against the longest duration")
    for k, seconds in enumerate(durations):
        mean, se = mean_and_se(total[:, k] - total[:, -1], units)
        print(f"{seconds:6g} s {total[:, k].mean():.3f}  {mean:+.4f} ± {se:.4f}")
    curve = total.mean(axis=0)
    for rule, settings in RULES.items():
        for each, (seconds, loss) in zip(settings, by_rule[rule]):
            fixed = np.interp(np.log(seconds.mean()), np.log(durations), curve)
            mean, se = mean_and_se(loss - total[:, -1], units)
            print(
                f"{each!s:32s} {seconds.mean():5.2f} s  {loss.mean():.3f} (fixed "
                f"{fixed:.3f})  {mean:+.4f} ± {se:.4f}"
            )


def halves():
    corpus, train = generated("slow_slide")
    cases = [
        ("0–2 s", 0, 2, 0, pipeline()),
        ("2–4 s", 2, 4, 0, pipeline()),
        *((f"0–4 s, sharing {x}", 0, 4, x, pipeline()) for x in (0, 0.5, 1)),
    ]
    for name, start, end, sharing, steps in cases:
        cut = {
            s: [x[start * r : end * r] for x in corpus.trials[s]]
            for s, r in RATES.items()
        }
        cut = pd.DataFrame(cut)
        durations = [d for d in (1, 2, 4) if d <= end - start]
        model = AnytimeRegressor(
            steps, durations=durations, sampling_rates=RATES, cv=3, sharing=sharing
        )
        loss = inner = 0
        for adjective in ("hard", "cold", "slippery"):
            y = corpus.ratings[adjective]
            model.fit(cut[train], y[train], groups=corpus.objects[train])
            proba = model.predict_proba_over_time(cut[~train], durations).swapaxes(0, 1)
            loss += np.stack([loss_of(y[~train], p, None) for p in proba], 1) / 3
            proba = model.oof_proba_.swapaxes(0, 1)
            inner += np.mean([loss_of(y[train], p, None) for p in proba], axis=1) / 3
        mean, se = mean_and_se(loss[:, 1] - loss[:, -1], corpus.objects[~train])
        for k, seconds in list(enumerate(durations))[1:]:
            print(
                f"{name:24s} {seconds} s  {loss[:, k].mean():.3f}, out of fold "
                f"{inner[k]:.3f}"
            )
        print(f"  2 s against the longest {mean:+.4f} ± {se:.4f}", flush=True)


def calibration(y, proba):
    spread = [dispersion(y, p) for p in proba.swapaxes(0, 1)]
    print(f"{'  dispersion':22s}", *(f"{x:7.2f}" for x in spread))
    pit = np.array([pit_histogram(y, p) for p in proba.swapaxes(0, 1)])
    for name, column in (("lowest", 0), ("highest", -1)):
        print(f"  PIT, {name:15s}", *(f"{x:7.2f}" for x in pit[:, column]))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    if sys.argv[1] in ("latency", "halves"):
        {"latency": latency, "halves": halves}[sys.argv[1]]()
    else:
        accuracy(sys.argv[1])
