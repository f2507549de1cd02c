"""What the paper leaves to others (section 4.2), measured.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
        python benchmarks/closed_questions.py QUESTION [--cache FOLDER] [--data FOLDER]

QUESTION is one of

    joint         one network for all adjectives, or a model of each
    combined      all adjectives at once in the combined network, with holdouts
    positions     how many random quantile positions, for crowds of 5, 15 and 50
    ratings       careless raters and outlying answers: found, and left out
    touches       touches that went wrong: found, and left out
    dictionaries  atoms chosen for the adjective

Each takes between one and five minutes of processor time, "joint" a quarter of an hour;
``--quick`` takes one corpus of 20 objects, for a trial of seconds to minutes. All but
"joint" print tables for two corpora of 300 slow slides of 60 objects (seeds 0 and 1).
There are five folds; objects are kept whole, and what is learned or chosen never sees
the test objects. Settings are chosen on a third corpus (seed 2). Scores are means over
adjectives and objects; differences are paired, with standard errors over objects.
--cache keeps the features, which are computed once and shared by the questions. "joint"
chooses units and penalties in three folds of the training objects, for each adjective
or for all at once, and takes 600 slow slides of 60 objects; --data holds the votes on
PHAC-2's objects, which it takes too (`data.py`).
"""

import warnings
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import data
import numpy as np
import pandas as pd
from heads import maxima
from joblib import Memory
from measure import (
    SCORES,
    command,
    head,
    of_groups,
    plus_minus,
    row,
    timed,
)
from sklearn.decomposition import PCA
from sklearn.exceptions import ConvergenceWarning
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, SensorFusionNNPOM
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.model_selection import sensor_contributions
from sklearn_haptic.ratings import outlying_raters

CHOICE = 2  # settings are chosen on the corpus of this seed alone
FEW = ("hard", "rough", "cold", "springy")  # adjectives of the longer questions
SOLVER = {"max_iter": 200, "tol": 1e-3}
AGAINST_TRUTH = ["RPS", "EMD"]
LIMIT = 3.5  # robust standard scores beyond it are outliers (Iglewicz & Hoaglin 1993)
SIZE = SimpleNamespace(seeds=(0, 1), n_objects=60, memory=Memory(None), data=None)

# Corpora and folds --------------------------------------------------------------------


class Fold(NamedTuple):
    """Trials of a fold, and features learned from its training objects."""

    train: np.ndarray
    test: np.ndarray
    A: np.ndarray  # features of the training trials, sensor by sensor
    B: np.ndarray  # of the test trials
    sensors: dict  # columns of each sensor
    dead: np.ndarray  # what the features are if all signals are zero


@cache
def corpus_of(seed, n_raters=12):
    """Five slow slides of each object; the touches are those of any crowd."""
    return make_haptic_corpus(
        SIZE.n_objects, 5, "slow_slide", n_raters=n_raters, random_state=seed
    )


def compute_folds(seed, n_objects):
    """Five folds by object, with features learned from the training objects.

    The standardised features of each sensor are rotated to their principal axes, all
    of them, which changes no penalised fit but makes it faster.
    """
    corpus, folds = corpus_of(seed), []
    for train, test in data.split(corpus.objects, seed=seed):
        steps = make_pipeline(maxima(), StandardScaler())
        A = steps.fit_transform(corpus.trials.iloc[train]).astype(float)
        B = steps.transform(corpus.trials.iloc[test]).astype(float)
        dead = steps[-1].transform(np.zeros((1, A.shape[1])))
        parts, sensors, n_columns = [], {}, 0
        for sensor in data.SENSORS:
            columns = steps[0].output_indices_[sensor]
            axes = PCA().fit(A[:, columns])
            parts.append([axes.transform(Z[:, columns]) for Z in (A, B, dead)])
            width = parts[-1][0].shape[1]
            sensors[sensor] = np.arange(n_columns, n_columns + width)
            n_columns += width
        A, B, dead = map(np.hstack, zip(*parts))
        folds.append(Fold(train, test, A, B, sensors, dead[0]))
    return folds


@cache
def folds_of(seed):
    return SIZE.memory.cache(compute_folds)(seed, SIZE.n_objects)


def together(A, B):
    """Features on the principal axes of all sensors, for linear models."""
    axes = PCA().fit(A)
    return axes.transform(A), axes.transform(B)


def linear(alpha=3.0, **options):
    """The default model: linear, one adjective at a time."""
    return DistributionalOrdinalRegressor(NNPOM(0, alpha, **SOLVER), **options)


def stacked(ratings, adjectives=None):
    """Counts, or true shares, of shape (n_trials, n_adjectives, n_levels)."""
    return np.stack([ratings[name] for name in adjectives or ratings], axis=1)


def each_adjective(model, A, y, B):
    """Fit one model per adjective; predictions of shape (n, n_adjectives, n_levels)."""
    each = [model.fit(A, y[:, i]).predict_proba(B) for i in range(y.shape[1])]
    return np.stack(each, axis=1)


def by_default(A, y, B):
    """What default models, fitted to A and y, predict for B."""
    A, B = together(A, B)
    return each_adjective(linear(), A, y, B)


# Scores and tables --------------------------------------------------------------------


def of_trials(y, proba, names):
    """Scores of trials and adjectives, of shape (n_trials, n_adjectives, n_scores)."""
    flat = (each.reshape(-1, y.shape[-1]) for each in (y, proba))
    y_flat, proba_flat = flat
    values = [SCORES[name](y_flat, proba_flat, average=False) for name in names]
    return np.stack(values, axis=-1).reshape(*y.shape[:2], len(names))


def of_objects(y, proba, objects, names):
    """Scores of each object, means over its trials and adjectives."""
    return of_groups(of_trials(y, proba, names).mean(axis=1), objects)


def out_of_fold(predict, target, seed, names=("RPS", "EMD", "MAE^M"), n_folds=None):
    """Scores of each object; ``predict`` returns those of a fold's test trials."""
    folds = folds_of(seed)[:n_folds]
    rows = np.concatenate([fold.test for fold in folds])
    proba = np.concatenate([predict(fold) for fold in folds])
    return of_objects(target[rows], proba, corpus_of(seed).objects[rows], names)


def chosen(scores_of, alphas):
    """The penalty with the least RPS on two folds of the corpus for choices."""
    rps = [scores_of(alpha, CHOICE, n_folds=2)[:, 0].mean() for alpha in alphas]
    return alphas[int(np.argmin(rps))]


def report(results, base, names, title=None):
    """Scores by seed and model, and differences to a base for each score and seed."""
    seeds = list(results)
    cells = [f"Δ {name}, {seed}" for name in names for seed in seeds]
    head("", *(f"RPS, {seed}" for seed in seeds), *cells, title=title)
    for model in results[seeds[0]]:
        cells = [f"{results[seed][model][:, 0].mean():.4f}" for seed in seeds]
        for k in range(len(names)):
            for seed in seeds:
                gain = results[seed][model][:, k] - results[seed][base][:, k]
                cells.append("" if model == base else plus_minus(gain))
        row(model, *cells)


# One network for all adjectives -------------------------------------------------------


def network_of(setting):
    n_hidden, alpha = setting
    return DistributionalOrdinalRegressor(
        NNPOM(n_hidden, alpha, **SOLVER, random_state=0)
    )


def all_at_once(setting, A, y, B):
    return network_of(setting).fit(A, y).predict_proba(B)


def one_by_one(settings, A, y, B):
    """One model per adjective; one setting, or one for each."""
    if np.ndim(settings) == 1:
        settings = [settings] * y.shape[1]
    each = [
        each_adjective(network_of(s), A, y[:, i : i + 1], B)
        for i, s in enumerate(settings)
    ]
    return np.concatenate(each, axis=1)


def inner_rps(predict, settings, A, y, objects):
    """RPS of each setting and adjective on validation objects."""
    rps = np.zeros((len(settings), y.shape[1]))
    for train, validation in data.split(objects, 3):
        for i, setting in enumerate(settings):
            proba = predict(setting, A[train], y[train], A[validation])
            scores = of_trials(y[validation], proba, ["RPS"])
            rps[i] += scores.mean(axis=(0, 2))
    return rps


def joint_sets():
    """Title, trials, targets, objects and features to be fitted of each set."""
    corpus = make_haptic_corpus(SIZE.n_objects, 10, "slow_slide", random_state=0)
    features = make_pipeline(maxima(), StandardScaler(), PCA())
    title = f"Generated: {len(corpus.trials)} slow slides, ten adjectives"
    yield title, corpus.trials, stacked(corpus.ratings), corpus.objects, features
    if SIZE.data:
        X, _, objects, *_ = data.votes(SIZE.data)
        binary = data.adjectives_of_votes(SIZE.data)
        features = make_pipeline(StandardScaler(), PCA())
        title = f"PHAC-2, {len(binary)} adjectives, yes or no"
        yield title, pd.DataFrame(X), stacked(binary), objects, features


def joint():
    """Print models of each adjective beside one network for all."""
    alphas = (3.0, 10.0, 30.0, 100.0)
    lines = [(0, alpha) for alpha in (1.0, *alphas)]
    networks = [(n, alpha) for n in (5, 10, 20, 30) for alpha in alphas]
    ways = {
        "linear, each apart": (one_by_one, lines, True),
        "linear, one penalty": (one_by_one, lines, False),
        "networks, each apart": (one_by_one, networks, True),
        "networks, one setting": (one_by_one, networks, False),
        "one network for all": (all_at_once, networks, False),
    }
    names = ["RPS", "EMD", "MAE^M", "log score"]
    for title, trials, y, objects, features in joint_sets():
        proba = {name: np.empty(y.shape) for name in ways}
        seconds = dict.fromkeys(ways, 0.0)
        for train, test in data.split(objects):
            A = features.fit_transform(trials.iloc[train]).astype(float)
            B = features.transform(trials.iloc[test]).astype(float)
            searched = {}
            for name, (predict, settings, own) in ways.items():
                key = predict.__name__, len(settings)
                if key not in searched:
                    search = partial(inner_rps, predict, settings)
                    searched[key] = timed(search, A, y[train], objects[train])
                taken, rps = searched[key]
                best = [settings[i] for i in rps.argmin(axis=0)]
                best = best if own else settings[rps.mean(axis=1).argmin()]
                fitting, proba[name][test] = timed(predict, best, A, y[train], B)
                seconds[name] += taken + fitting
        scores = {n: of_objects(y, p, objects, names) for n, p in proba.items()}
        report({0: scores}, "one network for all", names, title)
        print("seconds:", {name: round(each) for name, each in seconds.items()})


# The combined network -----------------------------------------------------------------


APART, AT_ONCE = "combined, each adjective apart", "combined, all adjectives at once"
RIVALS = {
    APART: (3.0, 10.0),
    AT_ONCE: (10.0, 30.0),
    "linear, each apart": (1.0, 3.0, 10.0),
    "one network, all at once": (10.0, 30.0, 100.0),
}


def combined_model(name, alpha, sensors):
    """Ten units for each sensor and ten that combine them, or for all features."""
    if name == "linear, each apart":
        return linear(alpha)
    network = NNPOM(10, alpha, **SOLVER)
    if name in (APART, AT_ONCE):
        network = SensorFusionNNPOM(sensors, network, network)
    return DistributionalOrdinalRegressor(network, random_state=0)


def combined_scores(name, alpha, seed, n_folds=None):
    y = stacked(corpus_of(seed).ratings)

    def predict(fold):
        model = combined_model(name, alpha, fold.sensors)
        if "at once" in name:
            return model.fit(fold.A, y[fold.train]).predict_proba(fold.B)
        return each_adjective(model, fold.A, y[fold.train], fold.B)

    return out_of_fold(predict, y, seed, n_folds=n_folds)


def contributions(name, alpha, seed):
    """RPS of each object (row) by the full model and without each sensor."""
    corpus, tables = corpus_of(seed), []
    y = stacked(corpus.ratings)
    for fold in folds_of(seed):
        rows = np.concatenate((fold.train, fold.test))
        ends = np.split(np.arange(len(rows)), [len(fold.train)])
        for target in [y[rows]] if name == AT_ONCE else y[rows].swapaxes(0, 1):
            model = combined_model(name, alpha, fold.sensors)
            X = np.vstack((fold.A, fold.B))
            held_out = {"cv": [ends], "n_repeats": 1, "random_state": 0}
            groups = corpus.objects[rows]
            tables.append(
                sensor_contributions(model, X, target, groups=groups, **held_out)
            )
    return pd.concat(tables).pivot_table("rps", "object", "held_out", sort=False)


def combined():
    """Print the scores of all models, then what each sensor contributes."""
    results, alphas = {seed: {} for seed in SIZE.seeds}, {}
    for name, choice in RIVALS.items():
        alphas[name] = alpha = chosen(partial(combined_scores, name), choice)
        seconds = 0.0
        for seed in SIZE.seeds:
            taken, results[seed][name] = timed(combined_scores, name, alpha, seed)
            seconds += taken
        print(f"{name}: alpha {alpha:g}, {seconds:.0f} s", flush=True)
    report(results, APART, ["RPS", "EMD", "MAE^M"])
    ways = [(name, seed) for seed in SIZE.seeds for name in (APART, AT_ONCE)]
    tables = {way: contributions(way[0], alphas[way[0]], way[1]) for way in ways}
    head("RPS without", *(f"{name}, {seed}" for name, seed in ways))
    for sensor in data.SENSORS:
        row(sensor, *(plus_minus(t[sensor] - t["none"]) for t in tables.values()))


# Random positions ---------------------------------------------------------------------


def positions():
    """Print, for each model and crowd, what random positions cost."""
    crowds = (5, 15, 50)
    samplings = {"the default's nodes": {}}
    samplings |= {
        f"{n} random": {"sampling": "random", "n_duplicates": n}
        for n in (1, 3, 5, 15, 50)
    }

    def scores_of(options, n_raters, alpha, seed, n_folds=None):
        """RPS and EMD against the truth; alpha is the penalty beside 15 positions."""
        corpus = corpus_of(seed, n_raters)
        y, truth = (stacked(of, FEW) for of in (corpus.ratings, corpus.true_proba))
        scaled = alpha * options.get("n_duplicates", 15) / 15
        model = linear(scaled, random_state=seed, **options)

        def predict(fold):
            A, B = together(fold.A, fold.B)
            return each_adjective(model, A, y[fold.train], B)

        return out_of_fold(predict, truth, seed, AGAINST_TRUTH, n_folds)

    ways = [(n, seed) for n in crowds for seed in SIZE.seeds]
    cells = [f"{n} raters, seed {seed}" for n, seed in ways]
    head("RPS, EMD", "alpha", *cells)
    base = None
    for name, options in samplings.items():
        setting = partial(scores_of, options)
        alpha = chosen(partial(setting, 15), (1.0, 3.0, 10.0))
        each = [setting(n, alpha, seed) for n, seed in ways]
        if base is None:
            base = each
            cells = ["{:.4f}, {:.4f}".format(*s.mean(axis=0)) for s in each]
        else:
            gains = [s - b for s, b in zip(each, base)]
            cells = [", ".join(map(plus_minus, gain.T)) for gain in gains]
        row(name, f"{alpha:g}", *cells)


# Outlying ratings and touches ---------------------------------------------------------


def careless(answers, kind, rng):
    """A sixth of the people answer at random, or with the scale reversed.

    Each person rates every third object, as in PHAC-2: 36 people for 60 objects.

    Returns
    -------
    answers : ndarray of shape (n_objects, n_raters, n_adjectives)
    person : ndarray of int of shape (n_objects, n_raters)
    wrong : ndarray of int
        The careless people.
    """
    answers, n_raters = answers.copy(), answers.shape[1]
    person = np.arange(len(answers))[:, None] % 3 * n_raters + np.arange(n_raters)
    if kind == "as generated":
        return answers, person, np.empty(0, dtype=int)
    wrong = rng.choice(3 * n_raters, n_raters // 2, replace=False)
    theirs = np.isin(person, wrong)
    if kind == "a sixth at random":
        answers[theirs] = rng.integers(1, 6, size=answers[theirs].shape)
    else:
        answers[theirs] = 6 - answers[theirs]
    return answers, person, wrong


def kept_answers(answers, person, wrong):
    """Name of a rule -> which answers it keeps, and how many people were found."""
    objects = np.broadcast_to(np.arange(len(person))[:, None], person.shape)
    rows = answers.reshape(-1, answers.shape[-1])
    result = outlying_raters(rows, objects.ravel(), person.ravel())
    found = result.index[result["outlying"]].to_numpy()
    # The earth mover's distance of an answer to the others about the same object.
    apart = np.abs(answers[:, :, None] - answers[:, None])
    distance = apart.sum(axis=2) / (answers.shape[1] - 1)
    kept = {
        "nothing left out": np.ones_like(person, dtype=bool)[..., None],
        "outlying people left out": ~np.isin(person, found)[..., None],
        "the 5 % furthest answers left out": distance <= np.quantile(distance, 0.95),
        "those known to be wrong left out": ~np.isin(person, wrong)[..., None],
    }
    right = len(np.intersect1d(found, wrong))
    return kept, f"{len(found)} people left out, {right} of {len(wrong)} careless"


def ratings():
    """Print what careless raters cost, and what it helps to leave outliers out."""
    for kind in ("as generated", "a sixth at random", "a sixth reversed"):
        results, notes = {}, []
        for seed in SIZE.seeds:
            corpus, rng = corpus_of(seed), np.random.default_rng(seed)
            truth, names = stacked(corpus.true_proba), list(corpus.ratings)
            ids, of_trial = np.unique(corpus.objects, return_inverse=True)
            clean = [corpus.rater_ratings.loc[i, names].to_numpy() for i in ids]
            answers, person, wrong = careless(np.stack(clean), kind, rng)
            kept, note = kept_answers(answers, person, wrong)
            notes.append(f"seed {seed}: {note}")
            given = answers[..., None] == np.arange(1, 6)
            results[seed] = {}
            for name, of_answers in kept.items():
                y = (given & of_answers[..., None]).sum(axis=1)[of_trial]
                results[seed][name] = out_of_fold(
                    lambda fold, y=y: by_default(fold.A, y[fold.train], fold.B),
                    truth,
                    seed,
                    AGAINST_TRUTH,
                )
        title = f"Raters: {kind} ({'; '.join(notes)})"
        report(results, "nothing left out", AGAINST_TRUTH, title)


def broken(fold, objects, kind, rng):
    """Break a tenth of the training touches; return features, rows of ratings, which.

    A touch of another object is recorded under its object's name, or all signals of one
    sensor are zero.
    """
    X, rated_as = fold.A.copy(), fold.train.copy()
    wrong = np.zeros(len(X), dtype=bool)
    if kind == "as generated":
        return X, rated_as, wrong
    wrong[rng.choice(len(X), len(X) // 10, replace=False)] = True
    for t in np.flatnonzero(wrong):
        if kind == "a dead sensor":
            columns = fold.sensors[rng.choice(list(fold.sensors))]
            X[t, columns] = fold.dead[columns]
        else:
            others = np.flatnonzero(objects[fold.train] != objects[fold.train[t]])
            rated_as[t] = fold.train[rng.choice(others)]
    return X, rated_as, wrong


def outlying(values):
    """Whether a robust standard score of the values is above the limit."""
    centred = values - np.median(values)
    return centred / (1.4826 * np.median(np.abs(centred))) > LIMIT


def outlying_touches(X, y, objects):
    """Touches of an outlying score, and of outlying features.

    The score is the RPS out of fold by models of other objects, minus the median of the
    object's touches; features are judged by the logarithm of their distance to the mean
    of the object's other touches.
    """
    score = np.empty(len(X))
    for train, test in data.split(objects):
        proba = by_default(X[train], y[train], X[test])
        score[test] = of_trials(y[test], proba, ["RPS"]).mean(axis=(1, 2))
    distance = np.empty(len(X))
    for i in np.unique(objects):
        of_object = np.flatnonzero(objects == i)
        score[of_object] -= np.median(score[of_object])
        for t in of_object:
            others = X[of_object[of_object != t]]
            distance[t] = np.linalg.norm(X[t] - others.mean(axis=0))
    return {
        "outlying score": outlying(score),
        "outlying features": outlying(np.log(distance)),
    }


def touches():
    """Print what broken touches cost, and what it helps to leave outliers out."""
    for kind in ("as generated", "a tenth under another name", "a dead sensor"):
        results, notes = {}, []
        for seed in SIZE.seeds:
            corpus, rng = corpus_of(seed), np.random.default_rng(seed)
            y, truth = stacked(corpus.ratings), stacked(corpus.true_proba)
            proba, left_out = {}, {}
            for fold in folds_of(seed):
                X, rated_as, wrong = broken(fold, corpus.objects, kind, rng)
                found = {"nothing left out": np.zeros(len(X), dtype=bool)}
                found |= outlying_touches(X, y[rated_as], corpus.objects[rated_as])
                found["those known to be wrong left out"] = wrong
                for name, out in found.items():
                    predicted = by_default(X[~out], y[rated_as[~out]], fold.B)
                    proba.setdefault(name, np.empty(y.shape))[fold.test] = predicted
                    counts = out.sum(), (out & wrong).sum(), wrong.sum()
                    left_out[name] = left_out.get(name, 0) + np.array(counts)
            results[seed] = {
                name: of_objects(truth, each, corpus.objects, AGAINST_TRUTH)
                for name, each in proba.items()
            }
            for name in ("outlying score", "outlying features"):
                said = "{} left out, {} of {} wrong".format(*left_out[name])
                notes.append(f"seed {seed}, {name}: {said}")
        title = f"Touches: {kind} ({'; '.join(notes)})"
        report(results, "nothing left out", AGAINST_TRUTH, title)


# Dictionaries -------------------------------------------------------------------------


WINDOWED = data.SENSORS[:4]  # electrodes take most of the time
PRESET, TWICE = "as many as in the presets", "twice as many atoms"
SIZES = {"half as many atoms": 0.5, PRESET: 1.0, TWICE: 2.0}


def compute_sizes(seed, n_objects):
    """For each of two folds, features of both parts for each number of atoms.

    Also, for each column of the largest, which atom it is about.
    """
    corpus, features = corpus_of(seed), []
    for train, test in data.split(corpus.objects, 2, seed):
        of_sizes = {}
        for name, factor in SIZES.items():
            steps = maxima(WINDOWED, factor).fit(corpus.trials.iloc[train])
            parts = [steps.transform(corpus.trials.iloc[r]) for r in (train, test)]
            of_sizes[name] = parts
        features.append(of_sizes)
    atoms, first = [], 0
    for name in WINDOWED:
        columns = steps.output_indices_[name]
        n_atoms = len(steps.named_transformers_[name][0].components_)
        atoms.append(first + np.arange(columns.stop - columns.start) % n_atoms)
        first += n_atoms
    return features, np.concatenate(atoms)


def scaled_default(A, y, B):
    scale = StandardScaler().fit(A)
    return by_default(scale.transform(A).astype(float), y, scale.transform(B))


def best_size(features, y, objects):
    """The number of atoms with the least RPS in three folds of training objects."""
    rps = dict.fromkeys(features, 0.0)
    for name, (A, _) in features.items():
        for train, test in data.split(objects, 3):
            proba = scaled_default(A[train], y[train], A[test])
            rps[name] += ranked_probability_score(y[test, 0], proba[:, 0])
    return min(rps, key=rps.get)


def useful_columns(A, y, objects, atoms):
    """Columns of the half of all atoms that has the largest coefficients.

    The size of a linear model's coefficients is summed over the columns of an atom,
    and over three models, each without a third of the training objects.
    """
    use = np.zeros(atoms.max() + 1)
    A = StandardScaler().fit_transform(A).astype(float)
    for train, _ in data.split(objects, 3):
        coef = linear().fit(A[train], y[train, 0]).estimator_.coefs_[0][:-1]
        use += np.bincount(atoms, np.abs(coef))
    return (use >= np.median(use))[atoms]


def dictionaries():
    """Print the scores of more, fewer and the more useful atoms."""
    results, names = {}, ["RPS", "EMD", "MAE^M"]
    for seed in SIZE.seeds:
        corpus = corpus_of(seed)
        sizes, atoms = SIZE.memory.cache(compute_sizes)(seed, SIZE.n_objects)
        y, proba = stacked(corpus.ratings, FEW[:2]), {}
        for k, (train, test) in enumerate(data.split(corpus.objects, 2, seed)):
            objects = corpus.objects[train]
            for i in range(y.shape[1]):
                known, features = y[train, i : i + 1], dict(sizes[k])
                size = best_size(features, known, objects)
                A, B = features[TWICE]
                kept = useful_columns(A, known, objects, atoms)
                features["a number chosen for each adjective"] = features[size]
                features[f"the more useful half of {TWICE}"] = A[:, kept], B[:, kept]
                for name, (A, B) in features.items():
                    of_all = proba.setdefault(name, np.empty(y.shape))
                    of_all[test, i] = scaled_default(A, known, B)[:, 0]
        results[seed] = {
            name: of_objects(y, each, corpus.objects, names)
            for name, each in proba.items()
        }
    report(results, PRESET, names)


QUESTIONS = [joint, combined, positions, ratings, touches, dictionaries]


def main():
    questions = {question.__name__: question for question in QUESTIONS}
    parser = command(__doc__)
    parser.add_argument("question", choices=questions)
    parser.add_argument("--cache", metavar="FOLDER")
    parser.add_argument("--data", metavar="FOLDER", type=Path)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    SIZE.memory, SIZE.data = Memory(arguments.cache, verbose=0), arguments.data
    if arguments.quick:
        SIZE.seeds, SIZE.n_objects = (0,), 20
    warnings.simplefilter("ignore", ConvergenceWarning)
    seconds, _ = timed(questions[arguments.question])
    print(f"\n{seconds:.0f} s of processor time")


if __name__ == "__main__":
    main()
