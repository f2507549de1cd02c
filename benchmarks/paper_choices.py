"""What each of the paper's settings changes, one at a time, on generated touches.

    OMP_NUM_THREADS=1 python benchmarks/paper_choices.py

Two corpora of 20 objects and 5 trials, Fast Slide, one adjective, three sensors, each
with a network of five units, and a combined network of five; penalties of 0.1, 1 and 10
are chosen from on validation objects. Three folds keep objects whole. The first table
starts from the defaults of `run_study` and changes one setting to the paper's; the
second starts from the paper's and changes one back. Differences are means over objects
of both corpora, with the standard error over objects, positive where the change is for
the worse; seconds are those of the processor, for features and for networks.
"""

import argparse
import warnings
from dataclasses import dataclass, replace
from functools import cache
from time import process_time

import numpy as np
from sklearn.base import clone
from sklearn.exceptions import ConvergenceWarning
from sklearn.frozen import FrozenEstimator
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    SensorFusionNNPOM,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_macro_mae_scorer
from sklearn_haptic.metrics._trial_scores import predict_and_score
from sklearn_haptic.study._features import (
    cells_of,
    choose_trials,
    default_coder,
    learn_features,
    rotate_features,
)
from sklearn_haptic.study._models import fit_best
from sklearn_haptic.study._split import split_objects

SENSORS = ["pac", "pdc", "electrodes"]
PROCEDURE, ALPHAS, N_FOLDS = "fast_slide", (0.1, 1.0, 10.0), 3
SCORES = {"macro_mae": "MAE^M", "rps": "RPS", "log_score": "log score"}


@dataclass(frozen=True)
class Coding:
    """How features are made."""

    exact: bool
    keep_mean: bool = True
    short_pyramid: bool = True
    of_training_objects: bool = False


@dataclass(frozen=True)
class Choices:
    """All settings that the two presets of a study differ in, and some more."""

    coding: Coding
    scale: str  # "as extracted", "standardised" or "standardised and rotated"
    network: NNPOM
    decoding: tuple[str, ...]  # parameters of the regressor that are the paper's
    by_macro_mae: bool


POSITIONS = ("n_duplicates", "sampling", "p_transform", "decode", "rule", "n_quantiles")
N_HIDDEN = 5
DEFAULT = Choices(
    Coding(exact=False),
    "standardised and rotated",
    NNPOM(N_HIDDEN, early_stopping=True, max_iter=200, n_iter_no_change=30),
    (),
    by_macro_mae=False,
)
PAPER = Choices(
    Coding(exact=True),
    "as extracted",
    PAPER_2020["estimator"].set_params(n_hidden=N_HIDDEN),
    POSITIONS,
    by_macro_mae=True,
)


def changed(base, other):
    """Return choices that differ from `base` in one row, which is as in `other`."""

    def coding(**changes):
        return replace(base, coding=replace(base.coding, **changes))

    def network(*names):
        changes = {name: getattr(other.network, name) for name in names}
        return replace(base, network=clone(base.network).set_params(**changes))

    steps = "solver", "max_iter", "tol", "n_iter_no_change"
    return {
        "all of them": other,
        "all levels of the pyramid": coding(short_pyramid=False),
        "update of K-SVD": coding(exact=other.coding.exact),
        "means of windows removed": coding(keep_mean=False),
        "dictionaries from training objects": coding(of_training_objects=True),
        "features standardised, not rotated": replace(base, scale="standardised"),
        f"features {other.scale}": replace(base, scale=other.scale),
        "scale within the network": network("scale_features"),
        f"{other.network.gaps} gaps": network("gaps"),
        "solver and its patience": network(*steps),
        "positions and decoding": replace(base, decoding=other.decoding),
        "score to choose by": replace(base, by_macro_mae=other.by_macro_mae),
    }


@cache
def load(seed):
    return make_haptic_corpus(20, 5, PROCEDURE, random_state=seed)


@cache
def folds(seed):
    objects = load(seed).objects
    return split_objects(
        objects, "group_kfold", n_splits=N_FOLDS, n_repeats=1, seed=seed
    )


@cache
def features(seed, sensor, coding, fold):
    """Return the features of all trials, and the seconds that they took."""
    started = process_time()
    corpus = load(seed)
    trials = list(corpus.trials[sensor])
    chosen = choose_trials(corpus.objects, seed)
    if fold is not None:
        chosen = np.intersect1d(chosen, folds(seed)[fold].train)
    coder = default_coder(sensor, "exact" if coding.exact else "approximate", trials)
    coder.set_params(random_state=seed, remove_mean=not coding.keep_mean)
    cells = cells_of(PROCEDURE, sensor) if coding.short_pyramid else (16, 8, 4, 2, 1)
    X, _ = learn_features(trials, chosen, coder, cells)
    return X.astype(np.float64), process_time() - started


def scaled(X, scale, train):
    """Return features as the networks take them."""
    if scale == "standardised and rotated":
        return rotate_features(X, train)
    if scale == "standardised":
        scaler = StandardScaler().set_output(transform="default")
        return scaler.fit(X[train]).transform(X)
    return X


def run(choices, adjective, seed):
    """Return the scores of each test object, and seconds of features and networks."""
    corpus, scores, seconds = load(seed), {}, np.zeros(2)
    counts = corpus.ratings[adjective]
    regressor = DistributionalOrdinalRegressor(
        choices.network,
        **{name: PAPER_2020[name] for name in choices.decoding},
        random_state=seed,
    )
    best_of = {
        "scoring": neg_macro_mae_scorer if choices.by_macro_mae else None,
        "together": choices.network.solver == "irprop+",
    }
    for fold, parts in enumerate(folds(seed)):
        of_fold = fold if choices.coding.of_training_objects else None
        blocks = []
        for sensor in SENSORS:
            X, taken = features(seed, sensor, choices.coding, of_fold)
            blocks.append(X)
            if fold == 0 or of_fold is not None:
                seconds[0] += taken
        started = process_time()
        blocks = [scaled(X, choices.scale, parts.train) for X in blocks]
        ends = np.cumsum([X.shape[1] for X in blocks])
        columns, frozen = {}, {}
        for sensor, X, end in zip(SENSORS, blocks, ends):
            grid = [clone(regressor).set_params(estimator__alpha=a) for a in ALPHAS]
            model = fit_best(grid, X, counts, parts, **best_of)[2]
            columns[sensor] = slice(end - X.shape[1], end)
            frozen[sensor] = FrozenEstimator(model.estimator_)
        fusion = SensorFusionNNPOM(columns, frozen, choices.network)
        name = "estimator__final_estimator__alpha"
        grid = [
            clone(regressor).set_params(estimator=clone(fusion)).set_params(**{name: a})
            for a in ALPHAS
        ]
        X = np.hstack(blocks)
        model = fit_best(grid, X, counts, parts, **best_of)[2]
        _, (of_trials,) = predict_and_score(model, X[parts.test], counts[parts.test])
        seconds[1] += process_time() - started
        tested = corpus.objects[parts.test]
        for each in np.unique(tested):
            scores[each] = [of_trials[name][tested == each].mean() for name in SCORES]
    return np.array([scores[each] for each in sorted(scores)]), seconds


def described(scores, of_base):
    """Return the mean difference and its error; the mean if there is no difference."""
    if np.isinf([scores, of_base]).any():
        return f"{scores.mean():.3f}".replace("inf", "infinite")
    difference = scores - of_base
    error = difference.std(ddof=1) / np.sqrt(len(difference))
    return f"{difference.mean():+.3f} ± {error:.3f}"


def print_table(base, other, adjective, seeds):
    def both(choices):
        results = [run(choices, adjective, seed) for seed in seeds]
        scores, seconds = zip(*results)
        return np.concatenate(scores), np.sum(seconds, axis=0)

    of_base, seconds = both(base)
    head = "changed", *SCORES.values(), "features, s", "networks, s"
    print(f"| {' | '.join(head)} |")
    print("|---" * len(head) + "|")
    means = " | ".join(f"{mean:.3f}" for mean in of_base.mean(axis=0))
    means = means.replace("inf", "infinite")
    print(f"| nothing | {means} | {seconds[0]:.0f} | {seconds[1]:.0f} |", flush=True)
    for name, choices in changed(base, other).items():
        if choices == base:
            continue
        scores, seconds = both(choices)
        cells = " | ".join(map(described, scores.T, of_base.T))
        print(f"| {name} | {cells} | {seconds[0]:.0f} | {seconds[1]:.0f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--adjective", default="hard")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)
    with threadpool_limits(1, user_api="blas"):
        for name, base, other in (
            ("From the defaults to the paper's", DEFAULT, PAPER),
            ("From the paper's to the defaults", PAPER, DEFAULT),
        ):
            print(f"{name}:\n")
            print_table(base, other, arguments.adjective, arguments.seeds)
            print(flush=True)


if __name__ == "__main__":
    main()
