"""Few raters, and raters with habits: what shrinkage and `rater_effects` gain.

    python benchmarks/raters.py FOLDER [--parts known unseen]

FOLDER holds ``wine_ratings/`` (9 judges, 8 wines [1]_) and ``tactile_ratings/`` (20
people, 16 materials, three adjectives in three conditions [2]_). A simulated crowd is
that of the generated corpus: 24 people rate 60 objects on ten adjectives.

known: of each object N people's ratings are known, drawn at random for each object.
From these the distribution of its ratings is estimated, and scored by the ranked
probability score (RPS) against everybody else's ratings of the object, or against the
whole population of the simulated crowd. Printed is the score of the raw counts and what
the others gain on it (negative is better), with standard errors over objects; the
ceiling is the score of the whole population.

unseen: a model learns from the touches of 48 generated objects, of which N people rated
each, and predicts objects never touched; raw counts beside shrunken ones, with the
strength chosen by leaving out ratings, or by grouped cross-validation of the model.

.. [1] Randall, J. (1989). The analysis of sensory data by generalised linear model.
   Biometrical Journal 31, 781-793.
.. [2] Cleland, L. D. et al. (2024). Journal of Neurophysiology.
"""

import argparse
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.model_selection import GroupKFold

from sklearn_haptic import NNPOM, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.datasets._simulated_crowd import population, rate
from sklearn_haptic.metrics import noise_ceiling, ranked_probability_score
from sklearn_haptic.raters import rater_effects, shrink_counts
from sklearn_haptic.ratings import rating_counts

LEVELS = np.arange(1, 6)
# Strengths of shrinkage, and penalties, among which the model's validation chooses.
STRENGTHS, ALPHAS = [0, 0.5, 1, 2, 4, 8], [3, 10, 30]


def wine(folder):
    """One set: ratings (objects, raters), and no truth but these."""
    table = pd.read_csv(folder / "wine_ratings" / "ordinal_wine.csv")
    return [(table.pivot(index="bottle", columns="judge", values="rating"), None)]


def tactile(folder, *, pooled):
    """Nine sets; levels are quintiles of each person's ratings, or of everybody's."""
    table = pd.read_csv(folder / "tactile_ratings" / "ratings_long.csv")
    sets = []
    for _, rows in table.groupby(["Condition", "Metric"]):
        level = rows.level5
        if pooled:
            level = 1 + pd.qcut(rows.Rating.rank(method="first"), 5, labels=False)
        rows = rows.assign(level=level)
        sets.append(
            (rows.pivot(index="Texture", columns="Participant", values="level"), None)
        )
    return sets


def simulated(seed, careless=0.0):
    """Ten sets, one per adjective, with the truth; some people answer at random."""
    rng = np.random.default_rng(seed)
    percepts = rng.normal(size=(60, 6))
    ratings = rate(percepts, np.zeros(60, dtype=int), 24, rng)
    random = rng.random(24) < careless
    answers = rng.integers(1, 6, size=ratings.shape)
    ratings = np.where(random[None, :, None], answers, ratings)
    truth = population(percepts)
    return [(pd.DataFrame(ratings[..., a]), truth[:, a]) for a in range(10)]


def few(wide, n, rng):
    """Ratings of n people of each object, drawn anew for each, and the others'."""
    ratings = wide.to_numpy(dtype=float)
    order = np.argsort(rng.random(ratings.shape), axis=1)
    known = (order < n) & ~np.isnan(ratings)
    row, person = np.nonzero(known)
    table = rating_counts(ratings[known], row, person, levels=LEVELS)
    others = np.stack(
        [((ratings == level) & ~known).sum(axis=1) for level in LEVELS], axis=1
    )
    return table, others


def estimates(table, n):
    found = {"raw": table.counts}
    if n > 1:
        found["shrunken"] = shrink_counts(table.counts)
    if len(table.raters) > 1:
        found["raters"] = rater_effects(table).counts
    return found


def known(name, sets, sizes, n_draws, seed=0):
    rng = np.random.default_rng(seed)
    for n in sizes:
        scores = {}
        for wide, truth in sets:
            for _ in range(n_draws):
                table, others = few(wide, n, rng)
                target = others if truth is None else truth
                for method, counts in estimates(table, n).items():
                    score = ranked_probability_score(
                        target,
                        counts / counts.sum(axis=1, keepdims=True),
                        average=False,
                    )
                    scores.setdefault(method, []).append(score)
                if truth is None:
                    ceiling = noise_ceiling(others, average=False).truth
                else:
                    ceiling = ranked_probability_score(truth, truth, average=False)
                scores.setdefault("ceiling", []).append(ceiling)
        scores = {method: np.mean(each, axis=0) for method, each in scores.items()}
        cells = [f"{scores['raw'].mean():.3f}"]
        for method in ("shrunken", "raters"):
            if method in scores:
                cells.append(describe(scores[method] - scores["raw"]))
            else:
                cells.append("–")
        cells.append(f"{scores['ceiling'].mean():.3f}")
        print(f"| {name} | {n} | " + " | ".join(cells) + " |", flush=True)


def describe(difference):
    error = difference.std(ddof=1) / np.sqrt(len(difference))
    return f"{difference.mean():+.3f} ± {error:.3f}"


def unseen(adjectives=("hard", "rough", "cold"), seeds=(0,)):
    """Gain of shrunken targets for objects never touched, from 1, 3, 6, 12 raters."""
    differences = {}
    for seed in seeds:
        corpus = make_haptic_corpus(
            60, 4, "slow_slide", sensors=["pdc", "tac"], random_state=seed
        )
        pipeline = make_haptic_pipeline(["pdc", "tac"], random_state=0)
        X = pipeline[:-1].fit_transform(corpus.trials)  # learned without any rating
        objects = corpus.objects
        rng = np.random.default_rng(seed)
        for adjective in adjectives:
            wide = corpus.rater_ratings[adjective].unstack()
            truth = corpus.true_proba[adjective]
            for n in (1, 3, 6, 12):
                table, _ = few(wide, n, rng)
                table = rating_counts(
                    LEVELS[table.answers[:, 2]],
                    wide.index[table.answers[:, 0]],
                    levels=LEVELS,
                )
                found = cross_validate(pipeline[-1], X, objects, table, truth)
                for method, scores in found.items():
                    by_object = pd.Series(scores).groupby(objects).mean()
                    differences.setdefault((n, method), []).append(by_object)
    methods = "leave-one-out", "by the model", "penalty"
    print("\n| raters | raw RPS | " + " | ".join(methods) + " |\n" + "|---" * 5 + "|")
    for n in (1, 3, 6, 12):
        raw = pd.concat(differences[n, "raw"]).to_numpy()
        cells = [f"{raw.mean():.3f}"]
        for method in methods:
            each = differences.get((n, method))
            gain = "–" if each is None else describe(pd.concat(each).to_numpy() - raw)
            cells.append(gain)
        print(f"| {n} | " + " | ".join(cells) + " |", flush=True)


def cross_validate(model, X, objects, table, truth):
    """Score per trial of a model of raw and of shrunken counts, five folds."""
    row = {each: i for i, each in enumerate(table.objects)}
    rows = np.array([row[each] for each in objects])

    def predict(train, test, strength, alpha=3):
        inside = np.unique(rows[train])
        counts = table.counts.astype(float)
        counts[inside] = shrink_counts(counts[inside], strength)
        regressor = model.set_params(estimator=NNPOM(n_hidden=0, alpha=alpha))
        return regressor.fit(X[train], counts[rows[train]]).predict_proba(X[test])

    def validated(train, setting):
        folds = GroupKFold(3).split(X[train], groups=objects[train])
        return np.mean(
            [
                ranked_probability_score(
                    table.counts[rows[train[out]]],
                    predict(train[into], train[out], *setting),
                )
                for into, out in folds
            ]
        )

    found = {}
    for train, test in GroupKFold(5, shuffle=True, random_state=0).split(
        X, groups=objects
    ):
        by_model = [(strength,) for strength in STRENGTHS]
        by_penalty = [(0, alpha) for alpha in ALPHAS]
        chosen = {
            "raw": (0,),
            "by the model": min(by_model, key=partial(validated, train)),
            "penalty": min(by_penalty, key=partial(validated, train)),
        }
        if table.counts.sum(axis=1).max() > 1:
            chosen["leave-one-out"] = (None,)
        for method, setting in chosen.items():
            score = found.setdefault(method, np.empty(len(X)))
            score[test] = ranked_probability_score(
                truth[test], predict(train, test, *setting), average=False
            )
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--parts", nargs="+", default=["known", "unseen"])
    arguments = parser.parse_args()
    if "known" in arguments.parts:
        print("| set | raters | raw RPS | shrunken | rater effects | ceiling |")
        print("|---|---|---|---|---|---|")
        folder = arguments.folder
        known("wine", wine(folder), (1, 3, 6), 20)
        own = tactile(folder, pooled=False)
        known("tactile, own quintiles", own, (1, 3, 6, 12), 4)
        known("tactile, pooled", tactile(folder, pooled=True), (1, 3, 6, 12), 4)
        known("simulated", simulated(1), (1, 3, 6, 12), 1)
        known("simulated, a fifth careless", simulated(2, 0.2), (1, 3, 6, 12), 1)
    if "unseen" in arguments.parts:
        unseen()


if __name__ == "__main__":
    main()
