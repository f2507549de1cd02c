"""Distributions of ratings on two real sets: this package beside its baselines.

    python benchmarks/real_ratings.py FOLDER [--sets movie phac2] [--models default …]

FOLDER holds ``movie_ratings/Movie.npz`` (7755 films, their features and the
distribution of their five-star ratings [1]_) and ``phac2_static/`` (600 trials of
60 objects, 188 hand-crafted features, one hardness vote from 0 to 5 per object).

Ten folds, films or objects kept whole. Within each training fold every model
chooses its penalty (the paper's also its hidden units, on one validation set as
in the paper) on validation groups of that fold, so that no reported fold was seen.
Means ± standard errors over folds.

.. [1] Geng, X. (2016). Label distribution learning. IEEE TKDE 28(7).
"""

import argparse
import time
import warnings
from pathlib import Path

import mord
import numpy as np
from sklearn import set_config
from sklearn.base import clone
from sklearn.decomposition import TruncatedSVD
from sklearn.exceptions import ConvergenceWarning
from sklearn.model_selection import GridSearchCV, GroupKFold, GroupShuffleSplit
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    DummyDistribution,
)
from sklearn_haptic.metrics import (
    dispersion,
    earth_movers_distance,
    log_score,
    macro_mae,
    neg_macro_mae_scorer,
    neg_rps_scorer,
    ranked_probability_score,
)

ALPHAS = np.logspace(-1, 2, 7)
SCORES = {
    "MAE^M": macro_mae,
    "EMD": earth_movers_distance,
    "RPS": ranked_probability_score,
    "log score": log_score,
    "dispersion": dispersion,
}


def movie(folder):
    data = np.load(folder / "movie_ratings" / "Movie.npz")
    scale = make_pipeline(TruncatedSVD(100, random_state=0), StandardScaler())
    return data["X"], 12 * data["D"], np.arange(len(data["X"])), scale, None


def phac2(folder):
    data = np.load(folder / "phac2_static" / "phac2_static.npz")
    votes = np.genfromtxt(
        folder / "phac2_static" / "objects.csv",
        delimiter=",",
        names=True,
        dtype=None,
        encoding="utf-8",
    )
    ids = votes.dtype.names[0]
    of_object = dict(zip(votes[ids], votes["hardness_votes"]))
    objects = data["object_id"]
    y = np.array([of_object[i] for i in objects])
    X = data["X_static"].reshape(len(objects), -1)
    return X, y, objects, StandardScaler(), np.arange(6)


def models(levels):
    """Each model with the grid that is searched for it and the score to choose by."""
    regressor = DistributionalOrdinalRegressor
    by_alpha = {"estimator__alpha": ALPHAS}
    paper = regressor(**PAPER_2020, levels=levels, random_state=0)
    paper.set_fit_request(groups=True)  # it stops early on whole objects
    paper_grid = {
        "estimator__n_hidden": [1, 10, 30],
        "estimator__alpha": [0.01, 0.1, 1, 10],
    }
    default = regressor(NNPOM(n_hidden=0), levels=levels)
    return {
        "marginal": (DummyDistribution("marginal", levels=levels), {}, None),
        "W1 barycentre": (DummyDistribution("barycentre", levels=levels), {}, None),
        "paper's settings": (paper, paper_grid, neg_macro_mae_scorer),
        "default": (default, by_alpha, neg_rps_scorer),
        "default, quantile decoding": (
            clone(default).set_params(decode="quantile"),
            by_alpha,
            neg_rps_scorer,
        ),
        "default, 10 hidden units": (
            regressor(NNPOM(10), levels=levels, random_state=0),
            by_alpha,
            neg_rps_scorer,
        ),
        "mord LogisticAT": (
            regressor(mord.LogisticAT(), levels=levels),
            {"estimator__alpha": np.logspace(0, 5, 6)},  # it takes features as they are
            neg_rps_scorer,
        ),
        "counts, no p": (
            NNPOM(n_hidden=0, levels=levels),
            {"alpha": ALPHAS},
            neg_rps_scorer,
        ),
    }


def evaluate(estimator, grid, scorer, X, y, groups, scale):
    scores = []
    for train, test in GroupKFold(10, shuffle=True, random_state=0).split(
        X, groups=groups
    ):
        features = clone(scale).fit(X[train])
        A, B = features.transform(X[train]), features.transform(X[test])
        model = clone(estimator)
        if grid:
            inner = GroupShuffleSplit(1, test_size=1 / 9, random_state=0)
            if scorer is neg_rps_scorer and len(X) < 1000:
                inner = GroupKFold(4)
            search = GridSearchCV(model, grid, scoring=scorer, cv=inner)
            model = search.fit(A, y[train], groups=groups[train]).best_estimator_
        else:
            model.fit(A, y[train])
        proba = model.predict_proba(B)
        levels = model.levels_
        scores.append(
            [score(y[test], proba, levels=levels) for score in SCORES.values()]
        )
    return np.array(scores)


def describe(score):
    if not np.isfinite(score).all():
        return "inf"
    error = score.std(ddof=1) / np.sqrt(len(score))
    return f"{score.mean():.3f} ± {error:.3f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sets", nargs="+", default=["movie", "phac2"])
    parser.add_argument("--models", nargs="+")
    arguments = parser.parse_args()
    set_config(enable_metadata_routing=True)
    warnings.simplefilter("ignore", ConvergenceWarning)
    warnings.simplefilter("ignore", DeprecationWarning)  # mord 0.7 on SciPy 1.17
    for name in arguments.sets:
        X, y, groups, scale, levels = {"movie": movie, "phac2": phac2}[name](
            arguments.folder
        )
        print(f"\n{name}: {len(X)} rows, {len(np.unique(groups))} groups")
        print("| model | " + " | ".join(SCORES) + " | s |")
        print("|---" * (len(SCORES) + 2) + "|")
        for label, (estimator, grid, scorer) in models(levels).items():
            if arguments.models and label not in arguments.models:
                continue
            start = time.process_time()
            scores = evaluate(estimator, grid, scorer, X, y, groups, scale)
            cells = [describe(score) for score in scores.T]
            seconds = time.process_time() - start
            print(
                f"| {label} | " + " | ".join(cells) + f" | {seconds:.0f} |", flush=True
            )


if __name__ == "__main__":
    main()
