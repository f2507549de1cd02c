"""How often sets and bands hold the ratings of new objects, over splits of objects.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/guarantees.py FOLDER \
        [--sets films generated "one touch" tactile wine] [--splits 300] \
        [--objects 10 20 50 200] [--raters 1 5 12 60] [--seed 0] [--limits]

Each split draws objects, and for each object a crowd from its population: the shares of
stars of a film, the true distribution of a generated object, the twenty or nine answers
to a fabric or a bottle. "prefit" judges a model fitted to 50 more objects (fewer, where
there are not as many), "half" one fitted to half of the objects, "cv+" takes all for
both. New objects, of a hundred touches, have crowds of the same size. The model is
linear. Coverage is that of a person drawn anew, which is computed from the
population, or of a whole crowd by the band; errors are over splits. Beside them are
sets of the levels between the predicted quantiles ("naive"), those of the true
distributions ("oracle"), and APS by MAPIE 1, where it is installed, on a row for each
rating. Half an hour of processor time for all;
--limits prints what is not promised, in a minute or two.
"""

import warnings
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd
from data import films, slide_frames, tactile, wine
from measure import command, head, machine, plus_minus, row, standard_error
from quality import ROUGHNESS
from sklearn.decomposition import TruncatedSVD
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    ConformalRatings,
    SignalStatistics,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.ensembles._conformal_scores import level_scores

try:
    from mapie.classification import SplitConformalClassifier
except ImportError:
    SplitConformalClassifier = None

ALPHAS = (0.2, 0.1)
N_FIT, N_NEW, N_TOUCHES = 50, 100, 3
KEYS = ["data", "n", "raters", "way", "alpha"]
JUDGED = ["set", "levels", "band", "width"]


class Objects(NamedTuple):
    """What a robot felt and what a population answers, object by object."""

    X: np.ndarray  # of shape (n_objects, n_touches, n_features)
    population: np.ndarray  # of shape (n_variants, n_objects, n_levels)
    oracle: dict  # sets of the same shape, for each alpha


def by_true_distributions(P, alpha):
    """Sets of the true distributions, by the one score that covers enough of all."""
    score = level_scores(np.cumsum(P, axis=1)[:, :-1])
    order = np.argsort(score.ravel())
    reached = np.cumsum(P.ravel()[order]) / len(P)
    return score <= score.ravel()[order][np.searchsorted(reached, 1 - alpha)] + 1e-9


def known(X, population):
    shares = np.stack(
        [counts / counts.sum(axis=1, keepdims=True) for counts in population]
    )
    oracle = {a: [by_true_distributions(P, a) for P in shares] for a in ALPHAS}
    return Objects(X, shares, oracle)


def of_films(folder):
    data = films(folder, 3000)
    X = TruncatedSVD(20, random_state=0).fit_transform(data.trials)
    return known(StandardScaler().fit_transform(X)[:, None], [data.targets["stars"]])


def of_generated(folder, n_touches=N_TOUCHES):
    corpus = make_haptic_corpus(600, N_TOUCHES, sensors=["pdc"], random_state=0)
    X = SignalStatistics(n_bands=5).fit_transform(list(corpus.trials["pdc"]))
    X = StandardScaler().fit_transform(X).reshape(600, N_TOUCHES, -1)
    proba = [
        corpus.true_proba[name][::N_TOUCHES] for name in ("hard", "smooth", "cold")
    ]
    return known(X[:, :n_touches], proba)


def of_fabrics(folder):
    """Ratings by the hand, known by what feet told of the same materials."""
    data = tactile(folder)
    X = StandardScaler().fit_transform(data.trials)
    return known(X[:, None], list(data.targets.values()))


def of_wine(folder):
    data = wine(folder)
    return known(data.trials[:, None], [data.targets["bitterness"]])


SETS = {  # with the numbers of objects where there are few
    "films": (of_films, None),
    "generated": (of_generated, None),
    "one touch": (partial(of_generated, n_touches=1), None),
    "tactile": (of_fabrics, [10, 15]),
    "wine": (of_wine, [4, 7]),
}


def judge(P, crowd, chosen, band=None):
    """Return the means over objects of `JUDGED`; sets alone have no band."""
    covered = (P * chosen).sum(axis=1).mean(), chosen.sum(axis=1).mean()
    if band is None:
        return [*covered, np.nan, np.nan]
    share = np.cumsum(crowd, axis=1) / crowd.sum(axis=1, keepdims=True)
    lower, upper = band
    inside = ((lower <= share + 1e-9) & (share <= upper + 1e-9)).all(axis=1)
    return [*covered, inside.mean(), (upper - lower)[:, :-1].mean()]


def between_quantiles(proba, alpha):
    below = np.cumsum(proba, axis=-1)
    return (below > alpha / 2) & (below - proba < 1 - alpha / 2)


def by_mapie(model, X, counts, new, alpha):
    """Sets of APS, which is given a row for each rating and knows no objects."""
    rated = np.nonzero(counts)
    rows = np.repeat(np.arange(rated[0].size), counts[rated].astype(int))
    mapie = SplitConformalClassifier(
        model, confidence_level=1 - alpha, conformity_score="aps", prefit=True
    ).conformalize(X[rated[0][rows]], model.classes_[rated[1][rows]])
    return mapie.predict_set(new)[1][..., 0]


def one_split(data, n_objects, n_raters, rng):
    """Return what `judge` finds for each alpha, by the way that made the sets."""
    variant = rng.integers(len(data.population))
    P = data.population[variant]
    n_fit = min(N_FIT, len(P) - n_objects - 1)
    old, fit, new = np.split(rng.permutation(len(P)), [n_objects, n_objects + n_fit])
    crowd = rng.multinomial(n_raters, P).astype(float)
    n_touches, n_features = data.X.shape[1:]

    def part(objects):
        touched = np.repeat(objects, n_touches)
        return data.X[objects].reshape(-1, n_features), crowd[touched], touched

    X, y, objects = part(new[: N_NEW // n_touches])
    found = {}

    def add(way, base, objects_given, method="prefit"):
        X_given, counts, groups = part(objects_given)
        sets = ConformalRatings(base, method=method).fit(X_given, counts, groups=groups)
        found[way] = [
            judge(P[objects], y, sets.predict_set(X, a), sets.predict_band(X, a))
            for a in ALPHAS
        ]

    def fitted(objects):
        return NNPOM(0).fit(*part(objects)[:2])

    add("cv+", NNPOM(0), old, "cv+")
    half = n_objects // 2
    add("half", fitted(old[:half]), old[half:])
    if n_fit < 3:
        return found
    known = fitted(fit)
    add("prefit", known, old)
    others = {
        "naive": lambda a: between_quantiles(known.predict_proba(X), a),
        "oracle": lambda a: data.oracle[a][variant][objects],
    }
    if SplitConformalClassifier is not None and (n_objects, n_raters) == (50, 12):
        others["MAPIE"] = lambda a: by_mapie(known, *part(old)[:2], X, a)
    for way, choose in others.items():
        found[way] = [judge(P[objects], y, choose(a)) for a in ALPHAS]
    return found


def limits(data, folder, n_splits, rng, alpha=0.2):
    """Print what is covered where people or touches are not drawn as in training."""
    head("", "coverage", title=f"What is not promised, for {1 - alpha:.0%}")
    for n_raters in (1, 12):
        kinds, members = [], []
        for _ in range(n_splits):
            P = data.population[rng.integers(len(data.population))]
            old, new = np.split(rng.permutation(len(P))[: 50 + N_NEW], [50])
            # Each person keeps a place in the population, whatever the object.
            places = rng.uniform(size=n_raters)
            panel = (np.cumsum(P, axis=1)[..., None] < places).sum(axis=1).clip(max=4)
            panel = (panel[..., None] == np.arange(5)).mean(axis=1)
            crowd = rng.multinomial(n_raters, P) / n_raters
            inside = []
            for answers in (panel, crowd):
                sets = ConformalRatings(NNPOM(0))
                sets.fit(data.X[old, 0], answers[old], groups=old)
                inside.append(sets.predict_set(data.X[new, 0], alpha))
            proba = sets.predict_proba(data.X[new, 0])
            spread = proba @ np.arange(5) ** 2 - (proba @ np.arange(5)) ** 2
            covered = (inside[1] * P[new]).sum(axis=1)[np.argsort(spread)]
            kinds.append([each.mean() for each in np.array_split(covered, 3)])
            members.append(
                [(inside[0] * each[new]).sum(axis=1).mean() for each in (panel, P)]
            )
        row(
            f"a panel of {n_raters}: its members",
            plus_minus(np.array(members)[:, 0], 3, ""),
        )
        row(
            f"a panel of {n_raters}: others", plus_minus(np.array(members)[:, 1], 3, "")
        )
    for name, each in zip(("narrow", "middle", "wide"), np.transpose(kinds)):
        row(f"{name} predictions, 12 raters", plus_minus(each, 3, ""))
    frames, material, run = slide_frames(folder, 599)
    X, rough = SignalStatistics(n_bands=8).fit_transform(frames), np.array(ROUGHNESS)
    early, y = run <= 5, np.eye(3)[rough[material - 1]]
    X = StandardScaler().fit(X[early]).transform(X)
    sets = ConformalRatings(NNPOM(0)).fit(
        X[early], y[early], groups=np.flatnonzero(early)
    )
    later = (sets.predict_set(X[~early], alpha) * y[~early]).sum(axis=1)
    row("slides of runs 6 to 15, from 1 to 5", plus_minus(later, 3, ""))
    within = []
    for _ in range(20):
        train, test = np.split(rng.permutation(np.flatnonzero(early)), [80])
        sets = ConformalRatings(NNPOM(0)).fit(X[train], y[train], groups=train)
        within.append((sets.predict_set(X[test], alpha) * y[test]).sum(axis=1).mean())
    row("other slides of runs 1 to 5", plus_minus(within, 3, ""))


def against_the_thresholds(table):
    """Print how near each way comes to what it promises, over all settings."""
    head("", "settings", "worst", "where", title="Margins (below 0: missed)")

    def worst(name, margin, rows):
        if len(rows):
            least = margin.idxmin()
            row(name, len(rows), f"{margin[least]:+.4f}", *rows.loc[least, KEYS])

    one = table[table.way == "prefit"]
    worst("one model, from below", one.set + 3 * one.set_error - 1 + one.alpha, one)
    most = (1 - one.alpha) * (one.n + 1) / one.n + 0.015
    worst("one model, from above", most - one.set, one)
    folds = table[(table.way == "cv+") & (table.n >= 20)]
    worst("cv+, sets", folds.set - 0.99 + folds.alpha, folds)
    halves = table[(table.way == "half") & (table.n >= 20)]
    worst("cv+, bands", folds.band - 0.99 + folds.alpha, folds)
    worst("one model, bands", one.band - 0.99 + one.alpha, one)
    smaller = pd.Series(halves.levels.to_numpy() - folds.levels.to_numpy(), folds.index)
    worst("cv+, levels fewer than of a half", smaller, folds)


def main():
    parser = command(__doc__, folder=True)
    parser.add_argument("--sets", nargs="+", default=[*SETS], choices=SETS)
    parser.add_argument("--splits", type=int, default=300)
    parser.add_argument("--objects", nargs="+", type=int, default=[10, 20, 50, 200])
    parser.add_argument("--raters", nargs="+", type=int, default=[1, 5, 12, 60])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limits", action="store_true", help="what is not promised")
    options = parser.parse_args()
    warnings.filterwarnings("ignore", "alpha=")
    machine("mapie")
    if options.limits:
        rng = np.random.default_rng(options.seed)
        return limits(of_generated(options.folder), options.folder, options.splits, rng)
    head(*KEYS, *(f"{name} ± error" for name in JUDGED))
    rows = []
    for name in options.sets:
        load, sizes = SETS[name]
        data = load(options.folder)
        for n, raters in product(sizes or options.objects, options.raters):
            rng = np.random.default_rng([options.seed, n, raters])
            splits = [one_split(data, n, raters, rng) for _ in range(options.splits)]
            for way, (i, alpha) in product(splits[0], enumerate(ALPHAS)):
                values = np.array([each[way][i] for each in splits])
                mean, error = values.mean(axis=0), standard_error(values)
                setting = name, n, raters, way, alpha
                row(*setting, *(f"{m:.3f} ± {e:.3f}" for m, e in zip(mean, error)))
                rows.append((*setting, *mean, error[0]))
    columns = [*KEYS, *JUDGED, "set_error"]
    against_the_thresholds(pd.DataFrame(rows, columns=columns))


if __name__ == "__main__":
    main()
