"""Continuous ratings beside other methods, and scales from pairwise judgements.

    python benchmarks/scales.py FOLDER [--parts sliders cells pairs]

FOLDER holds ``wine_ratings/`` and ``tactile_ratings/`` (see `raters.py`).

sliders: CRPS (lower is better) of `ContinuousRatingsRegressor` and what others differ
from it (positive is worse), with standard errors over objects, all on objects that no
model was fitted to. wine: bitterness on a line of 100 mm by 9 judges, from temperature
and contact. tactile: log-ratios of 20 people's ratings of a material by hand, from the
mean ratings of it under the foot. generated: 24 people move a slider for each of 48
objects touched three times, from pressure and temperature; roughness there is hardly
felt. Penalties and sizes of leaves are chosen by grouped cross-validation within the
training objects. The ceiling is the expected score of the whole population.

cells: the same score by kind and number of cells, on a crowd whose features tell all.

pairs: a known scale of 12 objects recovered from judgements of random pairs: the error,
also in units of the stated standard error (1 if that is right), and how often its
interval of 95 % holds the truth, over 200 crowds.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.special import expit, ndtr
from sklearn.ensemble import RandomForestRegressor
from sklearn.linear_model import Ridge
from sklearn.model_selection import GroupKFold
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import crps, noise_ceiling
from sklearn_haptic.pairs import pairwise_scale

# Sets: features and answers of trials, and the object of each trial


def wine(folder):
    table = pd.read_csv(folder / "wine_ratings" / "ordinal_wine.csv")
    y = table.pivot(index="bottle", columns="judge", values="response")
    of_bottle = table.drop_duplicates("bottle").set_index("bottle").loc[y.index]
    X = np.column_stack((of_bottle.temp == "warm", of_bottle.contact == "yes"))
    return [(X.astype(float), y.to_numpy(float), np.arange(len(y)))]


def tactile(folder):
    table = pd.read_csv(folder / "tactile_ratings" / "ratings_long.csv")
    feet = table[table.Condition != "hand"]
    X = feet.pivot_table(
        index="Texture", columns=["Condition", "Metric"], values="log_ratio"
    ).to_numpy()
    sets = []
    for _, rows in table[table.Condition == "hand"].groupby("Metric"):
        y = rows.pivot(index="Texture", columns="Participant", values="log_ratio")
        sets.append((X, y.to_numpy(), np.arange(len(y))))
    return sets


def generated(seed=0):
    rng = np.random.default_rng(seed)
    corpus = make_haptic_corpus(
        48, 3, "slow_slide", sensors=["pdc", "tac"], random_state=seed
    )
    X = make_haptic_pipeline(["pdc", "tac"], random_state=0)[:-1].fit_transform(
        corpus.trials  # learned without any rating
    )
    properties = StandardScaler().set_output(transform="pandas")
    properties = properties.fit_transform(corpus.properties.select_dtypes("number"))
    sets = []
    for name in ("firmness", "roughness"):
        y = sliders(properties[name].to_numpy(), properties["relaxation"], rng)
        rows = properties.index.get_indexer(corpus.objects)
        sets.append((X, y[rows], corpus.objects))
    return sets


def sliders(percept, spread, rng, n_people=24):
    """Sliders from 0 to 100 of people who agree more on some objects than on others."""
    shape = (len(percept), n_people)
    errors = 8 * np.exp(0.4 * np.asarray(spread))[:, None] * rng.normal(size=shape)
    habits = rng.normal(scale=5, size=n_people)
    return np.clip(50 + 18 * percept[:, None] + habits + errors, 0, 100)


# Methods: training trials, features of test trials, setting -> CDF and its points


def ours(X, y, X_test, alpha, grid="quantile"):
    base = DistributionalOrdinalRegressor(NNPOM(n_hidden=0, alpha=alpha))
    model = ContinuousRatingsRegressor(base, grid=grid).fit(X, y)
    return model.predict_cdf(X_test), model.grid_


def ours_even(X, y, X_test, alpha):
    return ours(X, y, X_test, alpha, "even")


def marginal(X, y, X_test, _):
    values = np.sort(y[~np.isnan(y)])
    return steps(np.full((len(X_test), len(values)), 1 / len(values)), values)


def quantile_forest(X, y, X_test, leaf):
    """Meinshausen (2006): training answers weighted by how often they share a leaf."""
    forest = RandomForestRegressor(100, min_samples_leaf=leaf, random_state=0)
    forest.fit(X, np.nanmean(y, axis=1))
    same = forest.apply(X_test)[:, None] == forest.apply(X)
    weight = (same / same.sum(axis=1, keepdims=True)).mean(axis=2)
    given = ~np.isnan(y)
    each = (weight[:, :, None] * (given / given.sum(axis=1, keepdims=True)))[:, given]
    order = np.argsort(y[given])
    return steps(each[:, order], y[given][order])


def steps(weight, values):
    """Step CDF, as points of which each is given twice."""
    below = np.cumsum(weight, axis=1)
    below /= below[:, -1:]
    cdf = np.stack((np.column_stack((np.zeros(len(below)), below[:, :-1])), below), 2)
    return cdf.reshape(len(below), -1), np.repeat(values, 2)


def ridge_on_quantiles(X, y, X_test, alpha):
    p = np.arange(1, 20) / 20
    model = Ridge(alpha).fit(X, np.nanquantile(y, p, axis=1).T)
    return p, np.sort(model.predict(X_test), axis=1)


METHODS = {
    "ContinuousRatingsRegressor": (ours, [1, 3, 10, 30]),
    "the same, even grid": (ours_even, [1, 3, 10, 30]),
    "quantile forest": (quantile_forest, [1, 3, 9]),
    "ridge on 19 quantiles": (ridge_on_quantiles, np.logspace(-1, 4, 6)),
    "marginal": (marginal, [None]),
}


def score_by_object(method, settings, X, y, objects):
    """CRPS of each object; settings are chosen within the training objects."""
    scores = np.empty(len(X))
    for train, test in GroupKFold(5, shuffle=True, random_state=0).split(
        X, groups=objects
    ):
        A, B = X[train], X[test]
        chosen, best = settings[0], np.inf
        for setting in settings if len(settings) > 1 else []:
            loss = np.mean(
                [
                    crps(
                        y[train][out], *method(A[into], y[train][into], A[out], setting)
                    )
                    for into, out in GroupKFold(3).split(A, groups=objects[train])
                ]
            )
            if loss < best:
                chosen, best = setting, loss
        scores[test] = crps(y[test], *method(A, y[train], B, chosen), average=False)
    return pd.Series(scores).groupby(objects).mean()


def compare_sliders(folder):
    sets = {"wine": wine(folder), "tactile": tactile(folder), "generated": generated()}
    print("| method | " + " | ".join(sets) + " | processor time, s |")
    print("|---" * (len(sets) + 2) + "|")
    reference = {}
    for label, (method, settings) in METHODS.items():
        start, cells = time.process_time(), []
        for name, several in sets.items():
            scores = pd.concat(
                [score_by_object(method, settings, *each) for each in several], axis=1
            ).mean(axis=1)
            if name not in reference:
                reference[name] = scores
                cells.append(f"{scores.mean():.3f}")
            else:
                cells.append(describe((scores - reference[name]).to_numpy()))
        seconds = time.process_time() - start
        print(f"| {label} | " + " | ".join(cells) + f" | {seconds:.0f} |", flush=True)
    ceilings = [
        np.mean([noise_ceiling(y, crps).truth for _, y, _ in several])
        for several in sets.values()
    ]
    cells = [f"{each:.3f}" for each in ceilings]
    print("| ceiling | " + " | ".join(cells) + " | |")


def describe(difference):
    error = difference.std(ddof=1) / np.sqrt(len(difference))
    return f"{difference.mean():+.3f} ± {error:.3f}"


def compare_cells():
    """A crowd whose two features are what people feel; 40 objects, 400 to test."""
    rng = np.random.default_rng(0)
    z = rng.normal(size=(440, 2))
    y = sliders(z[:, 0], z[:, 1], rng)
    train, test = slice(40), slice(40, None)
    ceiling = noise_ceiling(y[test], crps)
    print(f"\nceiling {ceiling.truth:.3f}, other people {ceiling.raters:.3f}\n")
    print("| cells | quantile | even |\n|---|---|---|")
    for n_cells in (5, 10, 20, 30, 50, 100):
        scores = [
            -ContinuousRatingsRegressor(grid=grid, n_cells=n_cells)
            .fit(z[train], y[train])
            .score(z[test], y[test])
            for grid in ("quantile", "even")
        ]
        print(f"| {n_cells} | " + " | ".join(f"{each:.3f}" for each in scores) + " |")


def compare_pairs():
    print(
        "\n| model | judgements | RMS error | in standard errors | in 95 % interval |"
    )
    print("|---|---|---|---|---|")
    for model, share in [("thurstone", ndtr), ("bradley-terry", expit)]:
        for n in (66, 200, 1000):
            rng = np.random.default_rng(0)
            errors, deviations = [], []
            for _ in range(200):
                truth = rng.normal(size=12)
                truth -= truth.mean()
                first = rng.integers(12, size=n)
                second = (first + rng.integers(1, 12, size=n)) % 12
                won = rng.random(n) < share(truth[first] - truth[second])
                winners, losers = np.where(won, (first, second), (second, first))
                scale = pairwise_scale(winners, losers, model=model)
                error = scale.values - truth[scale.objects]
                errors.append(np.mean(error**2))
                deviations.append(error / np.sqrt(np.diag(scale.covariance)))
            z = np.concatenate(deviations)
            print(
                f"| {model} | {n} | {np.sqrt(np.mean(errors)):.2f} | "
                f"{np.sqrt(np.mean(z**2)):.2f} | {np.mean(np.abs(z) < 1.96):.3f} |",
                flush=True,
            )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--parts", nargs="+", default=["sliders", "cells", "pairs"])
    arguments = parser.parse_args()
    if "sliders" in arguments.parts:
        compare_sliders(arguments.folder)
    if "cells" in arguments.parts:
        compare_cells()
    if "pairs" in arguments.parts:
        compare_pairs()


if __name__ == "__main__":
    main()
