"""What is learned from ratings of which only means and deviations are published.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/published.py FOLDER \
        [--parts moments vibrations]

moments     Films and materials, whose full counts are known, reduced to mean and
            deviation, to the mean with a deviation borrowed from objects rated near
            the middle of the scale, and to the mean alone. A linear model is fitted to
            what `counts_from_moments` makes of them. Scores are against full counts,
            out of fold; differences to a model of full counts are paired, ± is the
            standard error over objects. "Target" is the RPS of what is fitted.
vibrations  R² of people's mean ratings of 80 vibrations, averaged over three draws of
            ten folds, by the default model, by ridge regression of the distributions
            from several features, and by both baselines, beside the ceiling; means over
            adjectives of RPS and of the MAE of the mean. MiniRocket needs ``aeon``.

Each takes two minutes. Probabilities below 1e-3 count as 1e-3 in the log score.
"""

import importlib.util

import data
import numpy as np
from heads import OfAeon, linear, minirocket
from measure import SCORES, command, head, plus_minus, row
from sklearn.linear_model import RidgeCV
from sklearn.metrics import mean_absolute_error, r2_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from sklearn_haptic import (
    DummyDistribution,
    RegressedDistribution,
    Signal,
    SignalStatistics,
    make_haptic_pipeline,
)
from sklearn_haptic.metrics import noise_ceiling, ranked_probability_score
from sklearn_haptic.model_selection import cross_val_predict_proba
from sklearn_haptic.ratings import counts_from_moments, rating_mean

OF_MEANS = ranked_probability_score, mean_absolute_error
RIDGE = RegressedDistribution(RidgeCV(np.logspace(-1, 5, 13)))


def reduced(counts):
    """Name -> what is left of the counts of five levels."""
    levels = np.arange(1, 6)
    mean, shares = rating_mean(counts), counts / counts.sum(axis=1, keepdims=True)
    std = np.sqrt((shares * (levels - mean[:, None]) ** 2).sum(axis=1))
    known = {
        "mean and deviation": std,
        "mean, deviation borrowed": std[np.abs(mean - 3) < 0.5].mean(),
        "mean alone": None,
    }
    return {"full counts": shares} | {
        name: counts_from_moments(mean, each, levels=levels).to_numpy()
        for name, each in known.items()
    }


def judge(counts, proba, target):
    """RPS, log score and RPS of the target, of each object."""
    floor = np.maximum(proba, 1e-3)
    floor /= floor.sum(axis=1, keepdims=True)
    rps, log = SCORES["RPS"], SCORES["log score"]
    pairs = (rps, proba), (log, floor), (rps, target)
    return np.array([score(counts, p, average=False) for score, p in pairs])


def moments(folder):
    scores = "RPS", "log score", "more RPS", "more log score", "target"
    for name in ("films", "tactile"):
        found = getattr(data, name)(folder)
        head("fitted to", *scores, title=f"{name}: {len(found.groups)} objects")
        model = make_pipeline(found.given, linear())
        given = {"groups": found.groups, "cv": found.folds}
        by_kind = {}
        for counts in found.targets.values():
            for kind, y in reduced(counts).items():
                proba = cross_val_predict_proba(model, found.trials, y, **given)
                by_kind.setdefault(kind, []).append(judge(counts, proba, y))
        by_kind = {kind: np.mean(each, axis=0) for kind, each in by_kind.items()}
        for kind, each in by_kind.items():
            more = [plus_minus(m) for m in (each - by_kind["full counts"])[:2]]
            means = [f"{mean:.3f}" for mean in each.mean(axis=1)]
            row(kind, *means[:2], *more, means[2])


def padded(trials, n_times=32_000):
    """Silence after each vibration, up to 16 s."""
    return [np.pad(each, ((0, n_times - len(each)), (0, 0))) for each in trials]


def rivals():
    """Name -> features and a model of distributions."""
    default = make_haptic_pipeline(Signal(rate=2000), random_state=0)
    others = {"`SignalStatistics`": SignalStatistics()}
    if importlib.util.find_spec("aeon"):
        after = make_pipeline(FunctionTransformer(padded), OfAeon(minirocket))
        others["MiniRocket, padded"] = after
        others["MiniRocket, stretched"] = OfAeon(minirocket, stretch=True)
    found = {
        "default model": (default[0], default[-1]),
        "default features, ridge": (default[0], RIDGE),
        **{
            f"{name}, ridge": (make_pipeline(features, StandardScaler()), RIDGE)
            for name, features in others.items()
        },
    }
    nothing = FunctionTransformer(lambda trials: np.zeros((len(trials), 1)))
    return found | {
        "marginal": (nothing, DummyDistribution()),
        "barycentre": (nothing, DummyDistribution("barycentre")),
    }


def out_of_fold(features, model, found):
    """Predictions of every target; features are learned once in each fold."""
    proba = {name: np.zeros(y.shape) for name, y in found.targets.items()}
    for train, test in found.folds:
        A = features.fit_transform([found.trials[i] for i in train])
        B = features.transform([found.trials[i] for i in test])
        for name, y in found.targets.items():
            groups = {"groups": found.groups[train]} if hasattr(model, "cv") else {}
            fitted = model.fit(A, y.iloc[train], **groups)
            proba[name][test] = fitted.predict_proba(B)
    return proba


def vibrations(folder):
    found = data.vibrations(folder)
    head("R²", *found.targets, "RPS", "MAE", title="Vibrations")
    draws = [
        found._replace(folds=data.split(found.groups, 10, seed)) for seed in range(3)
    ]
    for name, rival in rivals().items():
        r2, others = [], []
        for draw in draws:
            proba = out_of_fold(*rival, draw)
            for adjective, y in found.targets.items():
                mean, predicted = (
                    rating_mean(each, levels=y.columns)
                    for each in (y, proba[adjective])
                )
                r2.append(r2_score(mean, predicted))
                rps = ranked_probability_score(y, proba[adjective])
                others.append((rps, mean_absolute_error(mean, predicted)))
        print_scores(name, np.reshape(r2, (len(draws), -1)).mean(axis=0), others)
    for who in ("truth", "raters"):
        r2, *others = (
            [noise_ceiling(y, score)[who] for y in found.targets.values()]
            for score in (r2_score, *OF_MEANS)
        )
        print_scores(f"ceiling: {who}", r2, np.transpose(others))


def print_scores(name, r2, others):
    rps, mae = np.mean(others, axis=0)
    cells = [f"{each:.2f}" for each in r2] + [f"{rps:.3f}", f"{mae:.2f}"]
    row(name, *(cell.replace("-", "−") for cell in cells))


PARTS = {"moments": moments, "vibrations": vibrations}


def main():
    parser = command(__doc__, folder=True)
    parser.add_argument("--parts", nargs="+", default=[*PARTS], choices=PARTS)
    options = parser.parse_args()
    for part in options.parts:
        PARTS[part](options.folder)


if __name__ == "__main__":
    main()
