"""How often sets and bands hold the ratings of new objects, over splits of objects.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/guarantees.py FOLDER \
        [--sets films generated "one touch" tactile wine] [--splits 300] \
        [--objects 10 20 50 200] [--raters 1 5 12 60] [--limits]

Each split draws objects, and for each a crowd from its population: the shares of stars
of a film, the true distribution of a generated object, the answers to a fabric or a
bottle. "prefit" judges a linear model fitted to 50 more objects (fewer, where there are
not as many), "half" one fitted to half of the objects, "cv+" takes all for both. The
new objects have crowds of the same size. `set` is how many people drawn anew rate
within the set, which is computed from the population, and `band` how many crowds are
within the band; errors are over splits. Beside them are the levels between predicted
quantiles ("naive"), sets of the true distributions ("oracle"), and APS by MAPIE 1,
where it is installed, on a row for each rating. The last table has the margins to what
is promised. Half an hour of processor time;
--limits tells what is not promised, in two minutes.
"""

import warnings
from functools import partial
from itertools import product

import numpy as np
import pandas as pd
from data import films, slide_frames, tactile, wine
from measure import command, head, machine, plus_minus, row
from quality import ROUGHNESS
from sklearn.decomposition import TruncatedSVD

from sklearn_haptic import NNPOM, ConformalRatings, SignalStatistics
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.ensembles._conformal_scores import level_scores

try:
    from mapie.classification import SplitConformalClassifier
except ImportError:
    SplitConformalClassifier = None

N_FIT, N_NEW, N_TOUCHES, ALPHAS = 50, 100, 3, (0.2, 0.1)
KEYS = ["data", "n", "raters", "way", "alpha"]
JUDGED = ["set", "levels", "band", "width"]
ERRORS = [f"{name}_error" for name in JUDGED]

# Data, as features of shape (n_objects, n_touches, n_features), and for each rating the
# people who gave each level, of shape (n_objects, n_levels).


def of_films(folder):
    data = films(folder, 3000)
    X = TruncatedSVD(20, random_state=0).fit_transform(data.trials)
    return X[:, None], [data.targets["stars"]]


def of_generated(folder, n_touches=N_TOUCHES):
    corpus = make_haptic_corpus(600, N_TOUCHES, sensors=["pdc"], random_state=0)
    X = SignalStatistics(n_bands=5).fit_transform(list(corpus.trials["pdc"]))
    proba = [corpus.true_proba[name] for name in ("hard", "smooth", "cold")]
    X = X.reshape(600, N_TOUCHES, -1)[:, :n_touches]
    return X, [each[::N_TOUCHES] for each in proba]


def of_few(load, folder):
    data = load(folder)
    return data.trials[:, None], [*data.targets.values()]


SETS = {  # with the numbers of objects where there are few
    "films": (of_films, None),
    "generated": (of_generated, None),
    "one touch": (partial(of_generated, n_touches=1), None),
    "tactile": (partial(of_few, tactile), [10, 15]),
    "wine": (partial(of_few, wine), [4, 7]),
}


def between_quantiles(model, X, alpha):
    proba = model.predict_proba(X)
    below = np.cumsum(proba, axis=1)
    return (below > alpha / 2) & (below - proba < 1 - alpha / 2)


def of_true_distributions(P, alpha):
    """Sets by the one score that covers enough over all objects."""
    score = level_scores(np.cumsum(P, axis=1)[:, :-1])
    order = np.argsort(score, axis=None)
    place = np.searchsorted(P.ravel()[order].cumsum() / len(P), 1 - alpha)
    return score <= score.ravel()[order][place] + 1e-9


def by_mapie(model, X, counts, new, alpha):
    """Sets of APS, which is given a row for each rating and knows no objects."""
    trial, level = np.nonzero(counts)
    times = counts[trial, level].astype(int)
    mapie = SplitConformalClassifier(
        model, confidence_level=1 - alpha, conformity_score="aps", random_state=0
    ).conformalize(X[trial.repeat(times)], model.classes_[level.repeat(times)])
    return mapie.predict_set(new)[1][..., 0]


def fit_sets(X, y, objects, base=None):
    """Return sets of a fitted model, or of models of folds if there is none."""
    base, method = (NNPOM(0), "cv+") if base is None else (base, "prefit")
    return ConformalRatings(base, method=method).fit(X, y, groups=objects)


def one_split(X, P, n_objects, n_raters, rng):
    """Yield the way that makes sets, alpha, and what is `JUDGED`."""
    n_fit = min(N_FIT, len(P) - n_objects - 1)
    old, fit, new = np.split(rng.permutation(len(P)), [n_objects, n_objects + n_fit])
    crowd = rng.multinomial(n_raters, P)

    def touches(objects):
        touched = objects.repeat(X.shape[1])
        return np.concatenate(X[objects]), crowd[touched], touched

    def fitted(objects):
        return NNPOM(0).fit(*touches(objects)[:2])

    half = n_objects // 2
    ways = {
        "cv+": fit_sets(*touches(old)),
        "half": fit_sets(*touches(old[half:]), fitted(old[:half])),
    }
    sets = {}
    felt, answers, touched = touches(new[: N_NEW // X.shape[1]])
    if n_fit > 2:
        known = fitted(fit)
        ways["prefit"] = fit_sets(*touches(old), known)
        sets["naive"] = partial(between_quantiles, known)
        sets["oracle"] = lambda _, alpha: of_true_distributions(P, alpha)[touched]
        if SplitConformalClassifier is not None and (n_objects, n_raters) == (50, 12):
            sets["MAPIE"] = partial(by_mapie, known, *touches(old)[:2])
    sets = {way: model.predict_set for way, model in ways.items()} | sets
    below = np.cumsum(answers, axis=1) / n_raters
    for (way, choose), alpha in product(sets.items(), ALPHAS):
        chosen, inside, width = choose(felt, alpha), np.nan, np.nan
        if way in ways:
            lower, upper = ways[way].predict_band(felt, alpha)
            inside = ((lower <= below + 1e-9) & (below <= upper + 1e-9)).all(axis=1)
            inside, width = inside.mean(), (upper - lower)[:, :-1].mean()
        covered = (P[touched] * chosen).sum(axis=1).mean()
        yield way, alpha, covered, chosen.sum(axis=1).mean(), inside, width


def limits(X, populations, folder, n_splits, alpha=0.2):
    """Print what is covered where people or touches are not drawn as in training."""
    rng, levels, X = np.random.default_rng(0), np.arange(5), X[:, 0]
    head("", "coverage", title=f"What is not promised, for {1 - alpha:.0%}")

    def show(name, covered):
        row(name, plus_minus(covered, 3, ""))

    for n_raters in (1, 12):
        members, others, kinds = [], [], []
        for _ in range(n_splits):
            P = populations[rng.integers(len(populations))]
            old, new = np.split(rng.permutation(len(P))[: 50 + N_NEW], [50])
            # Each person keeps a place in the population, whatever the object.
            place = rng.uniform(size=n_raters)
            rated = (np.cumsum(P, axis=1)[..., None] < place).sum(axis=1).clip(max=4)
            panel = (rated[..., None] == levels).mean(axis=1)
            chosen = fit_sets(X[old], panel[old], old).predict_set(X[new], alpha)
            members.append((chosen * panel[new]).sum(axis=1).mean())
            others.append((chosen * P[new]).sum(axis=1).mean())
            sets = fit_sets(X[old], rng.multinomial(n_raters, P[old]), old)
            covered = (sets.predict_set(X[new], alpha) * P[new]).sum(axis=1)
            proba = sets.predict_proba(X[new])
            order = np.argsort(proba @ levels**2 - (proba @ levels) ** 2)
            kinds.append([third.mean() for third in np.array_split(covered[order], 3)])
        show(f"a panel of {n_raters}: its members", members)
        show(f"a panel of {n_raters}: others", others)
    for name, each in zip(("narrow", "middle", "wide"), np.transpose(kinds)):
        show(f"{name} predictions, 12 raters", each)
    frames, material, run = slide_frames(folder, 599)
    X, y = SignalStatistics(n_bands=8).fit_transform(frames), np.eye(3)[ROUGHNESS]
    y, early, later = y[material - 1], np.flatnonzero(run <= 5), np.flatnonzero(run > 5)

    def slides(old, new):
        chosen = fit_sets(X[old], y[old], old).predict_set(X[new], alpha)
        return (chosen * y[new]).sum(axis=1)

    show("slides of runs 6 to 15, from 1 to 5", slides(early, later))
    drawn = [np.split(rng.permutation(early), [80]) for _ in range(20)]
    show("other slides of runs 1 to 5", [slides(*each).mean() for each in drawn])


def show_margins(table):
    """Print how near each way comes to what it promises, over all settings."""
    head("", "settings", "missed", "worst", *KEYS, title="Margins (below 0: missed)")
    one, folds, half = (table[table.way == way] for way in ("prefit", "cv+", "half"))
    most = (1 - one.alpha) * (one.n + 1) / one.n + 0.015
    folds, half = folds[folds.n >= 20], half[half.n >= 20]
    fewer = half.levels.to_numpy() - folds.levels
    for name, margin in {
        "one model, from below": one.set + 3 * one.set_error - 1 + one.alpha,
        "one model, from above": most - one.set,
        "one model, bands": one.band - 0.99 + one.alpha,
        "cv+, sets": folds.set - 0.99 + folds.alpha,
        "cv+, bands": folds.band - 0.99 + folds.alpha,
        "cv+, levels fewer than of a half": fewer,
    }.items():
        if len(margin):
            worst = [f"{margin.min():+.4f}", *table.loc[margin.idxmin(), KEYS]]
            row(name, len(margin), (margin < 0).sum(), *worst)


def main():
    parser = command(__doc__, folder=True)
    parser.add_argument("--sets", nargs="+", default=[*SETS], choices=SETS)
    parser.add_argument("--splits", type=int, default=300)
    parser.add_argument("--objects", nargs="+", type=int, default=[10, 20, 50, 200])
    parser.add_argument("--raters", nargs="+", type=int, default=[1, 5, 12, 60])
    parser.add_argument("--limits", action="store_true", help="what is not promised")
    options = parser.parse_args()
    warnings.filterwarnings("ignore", "alpha=")
    machine("mapie")
    if options.limits:
        return limits(*of_generated(None), options.folder, options.splits)
    head(*KEYS, *JUDGED, *ERRORS)
    table = []
    for name in options.sets:
        load, sizes = SETS[name]
        X, populations = load(options.folder)
        populations = [y / y.sum(axis=1, keepdims=True) for y in populations]
        for n, raters in product(sizes or options.objects, options.raters):
            rng, splits = np.random.default_rng([n, raters]), []
            for _ in range(options.splits):
                P = populations[rng.integers(len(populations))]
                splits.extend(one_split(X, P, n, raters, rng))
            splits = pd.DataFrame(splits, columns=["way", "alpha", *JUDGED])
            splits = splits.groupby(["way", "alpha"], sort=False)
            cell = splits.mean().join(splits.sem().add_suffix("_error")).reset_index()
            cell = cell.assign(data=name, n=n, raters=raters)[[*KEYS, *JUDGED, *ERRORS]]
            for key, figures in cell.set_index(KEYS).iterrows():
                row(*key, *figures.map("{:.4f}".format))
            table.append(cell)
    show_margins(pd.concat(table, ignore_index=True))


if __name__ == "__main__":
    main()
