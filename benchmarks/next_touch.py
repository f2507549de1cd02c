"""Which procedure to touch by next: what was felt so far, a fixed order, or chance.

    python benchmarks/next_touch.py [FILE]

Without FILE, forty-eight generated objects are touched five times each; the score is
the ranked probability score, a mean over three adjectives. With the file of recordings
`bolt_pilot_phac2_layout.h5`, the class is the material and the score is Brier's; whole
grips (levels of pressure) are held out. With `fabric_slides.npz` the class is one of
seven fabrics, the touches are slides at six speeds, and whole levels of force are held
out. Each procedure takes the seconds that its recordings last. Objects (or grips, or
forces) are held out in folds; the best fixed order is
chosen on the training rows, out of fold, and so are the expected gains.

Printed are the scores at several budgets of seconds, and the seconds of each way until
it is within .002 of the final score of the best fixed order for good.
"""

import sys
from functools import cache
from itertools import permutations

import numpy as np
import pandas as pd
from several_touches import ADJECTIVES, PROCEDURES, head, rotated
from sklearn.linear_model import LogisticRegression

from sklearn_haptic import SignalStatistics, TouchPool, make_haptic_pipeline
from sklearn_haptic.datasets import load_phac2, make_haptic_corpus

N_FOLDS = 6


def synthetic(seed=2):
    """Rows of features by procedure, seconds, counts by adjective, objects, folds."""
    rows, seconds = {}, {}
    for procedure in PROCEDURES:
        others = make_haptic_corpus(16, 2, procedure, random_state=100)
        coder = make_haptic_pipeline(random_state=0)["features"].fit(others.trials)
        corpus = make_haptic_corpus(48, 5, procedure, random_state=seed)
        rows[procedure] = rotated(coder.transform(corpus.trials))
        seconds[procedure] = np.mean([len(x) for x in corpus.trials["pdc"]]) / 100
    fold = np.random.default_rng(0).permutation(48).repeat(5) % N_FOLDS
    targets = [corpus.ratings[adjective] for adjective in ADJECTIVES]
    return rows, seconds, targets, corpus.objects, fold, head()


def recorded(path):
    """Rows of weak features, for five materials and three grips of five runs."""
    rows, seconds = {}, {}
    for procedure in PROCEDURES:
        corpus = load_phac2(path, procedure=procedure, sensors=["pdc", "tdc"])
        trials = corpus.trials
        rows[procedure] = rotated(
            np.hstack(
                [
                    np.stack([statistic(signal, axis=0) for signal in trials[sensor]])
                    for sensor in trials
                    for statistic in (np.mean, np.std)
                ]
            )
        )
        seconds[procedure] = np.mean([len(x) for x in trials["pdc"]]) / 100
    run = np.array([int(name[-2:]) for name in trials.index])
    grip = (run - 1) // 5
    model = LogisticRegression(max_iter=1000)
    return rows, seconds, [corpus.objects], run, grip, model


def fabrics(path):
    """Rows of statistics by speed, for seven fabrics at up to four forces, twice."""
    with np.load(path) as arrays:
        trials = np.split(
            arrays["taxels"].astype(np.float64), np.cumsum(arrays["length"])[:-1]
        )
        table = pd.DataFrame(
            {k: arrays[k] for k in ("fabric", "force", "repeat", "speed", "length")}
        )
    # Backwards, as not all fabrics were slid over forwards; touches of every speed.
    table = table[table["speed"] < 0].reset_index()
    keys = ["fabric", "force", "repeat"]
    wide = table.pivot(index=keys, columns="speed", values=["index", "length"])
    wide = wide.dropna().sort_index(axis=1, ascending=False)
    rows, seconds = {}, {}
    for speed in wide["index"]:
        slides = [trials[int(i)] for i in wide["index", speed]]
        name = f"{-speed} mm/s"
        rows[name] = rotated(SignalStatistics().fit_transform(slides))
        seconds[name] = wide["length", speed].mean() / 35
    fabric, force, _ = (np.asarray(each) for each in zip(*wide.index))
    model = LogisticRegression(max_iter=1000)
    return rows, seconds, [fabric], force, force, model


def score(pool, proba, true):
    if pool._ordered:
        proba, true = (np.cumsum(each, axis=-1)[..., :-1] for each in (proba, true))
    return ((proba - true) ** 2).sum(axis=-1)


def paths(pool, X, order_of):
    """Predictions of each row after each touch, and the touches in their order."""
    names = list(pool.estimators_)
    out = np.empty((len(X), len(names) + 1, len(pool.classes_)))
    taken = []
    subsets = {}

    def predicted(felt):
        key = frozenset(felt)
        if key not in subsets:
            gone = [c for n, _, cs in pool.estimators if n not in key for c in cs]
            part = X.copy()
            part[gone] = np.nan
            subsets[key] = pool.predict_proba(part)
        return subsets[key]

    for i in range(len(X)):
        felt = []
        out[i, 0] = predicted(felt)[i]
        while len(felt) < len(names):
            felt.append(order_of(felt, out[i, len(felt)]))
            out[i, len(felt)] = predicted(felt)[i]
        taken.append(felt)
    return out, taken


def at_budgets(losses, taken, seconds, budgets):
    """Score of what is complete at each budget, of shape (n_rows, n_budgets)."""
    ends = np.array([np.cumsum([0, *(seconds[n] for n in felt)]) for felt in taken])
    place = (ends[:, :, None] <= budgets + 1e-9).sum(axis=1) - 1
    return np.take_along_axis(losses, place, axis=1)


def best_order(pool, seconds, budgets):
    """The fixed order of the least area below its training curve, out of fold."""
    names = list(pool.estimators_)

    excess = cache(lambda felt: pool.expected_excess([list(felt)]))

    def area(order):
        losses = [excess(frozenset(order[:k])) for k in range(len(names) + 1)]
        return at_budgets(np.array([losses]), [order], seconds, budgets).mean()

    return min(permutations(names), key=area)


def main(data):
    rows, seconds, targets, groups, fold, model = data
    frames = [pd.DataFrame(x).add_prefix(f"{name}_") for name, x in rows.items()]
    X = pd.concat(frames, axis=1)
    members = [(n, model, list(f.columns)) for n, f in zip(rows, frames)]
    budgets = np.arange(0, sum(seconds.values()) + 0.5, 0.5)
    curves = {}
    for y in targets:
        for k in np.unique(fold):
            train, test = fold != k, fold == k
            pool = TouchPool(members).fit(X[train], y[train], groups=groups[train])
            true = (
                y[test] / y[test].sum(axis=1, keepdims=True)
                if y.ndim == 2
                else (y[test][:, None] == pool.classes_)
            )
            fixed = best_order(pool, seconds, budgets)
            rng = np.random.default_rng(0)

            def adaptive(felt, proba, pool=pool):
                gains = pool.expected_gains(felt, proba)
                return max(gains, key=lambda n: gains[n] / seconds[n])

            ways = {
                "fixed": lambda felt, _, fixed=fixed: fixed[len(felt)],
                "adaptive": adaptive,
                "random": lambda felt, _, rng=rng: rng.choice(
                    [name for name in rows if name not in felt]
                ),
                "as listed": lambda felt, _: list(rows)[len(felt)],
            }
            for way, order_of in ways.items():
                out, taken = paths(pool, X[test], order_of)
                losses = score(pool, out, np.asarray(true)[:, None])
                curve = at_budgets(losses, taken, seconds, budgets)
                curves.setdefault(way, []).append(curve)
    print({name: round(float(s), 2) for name, s in seconds.items()})
    curves = {way: np.concatenate(each) for way, each in curves.items()}
    final = curves["fixed"].mean(axis=0)[-1]
    ends = [t for t in (0, 1, 2, 5, 8, 12, 16, 20, 40, 80) if t < budgets[-1]]
    shown = np.searchsorted(budgets, [*ends, budgets[-1]])
    print("| seconds |", *(f"{budgets[i]:g} |" for i in shown), "to final score |")
    for way, each in curves.items():
        mean = each.mean(axis=0)
        late = np.flatnonzero(mean > final + 0.002)
        reached = budgets[late[-1] + 1] if len(late) else 0.0
        print(f"| {way} |", *(f"{mean[i]:.3f} |" for i in shown), f"{reached:.1f} |")
    gap = (curves["adaptive"] - curves["fixed"]).mean(axis=1)
    print(
        f"adaptive − fixed, mean over seconds: {gap.mean():+.4f} ± "
        f"{gap.std() / len(gap) ** 0.5:.4f}"
    )


if __name__ == "__main__":
    data = synthetic
    if len(sys.argv) > 1:
        data = fabrics if sys.argv[1].endswith(".npz") else recorded
    main(data(*sys.argv[1:]))
