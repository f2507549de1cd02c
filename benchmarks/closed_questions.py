"""Two of the questions that the paper leaves to others (section 4.2), measured.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
        python benchmarks/closed_questions.py QUESTION [--data FOLDER] [--quick]

joint    One network for all adjectives, or a model of each, of 600 slow slides of 60
         objects and, with FOLDER (`data.py`), of votes on PHAC-2's objects. Units and
         penalties are chosen in three folds of the training objects. A quarter of an
         hour.
ratings  Careless raters and outlying answers: found, and left out, in two corpora of
         300 slow slides of 60 objects (seeds 0 and 1). Two minutes.

There are five folds of whole objects; what is learned or chosen never sees the test
objects. Scores are means over adjectives and objects; differences are paired, with
standard errors over objects. ``--quick`` takes one corpus of 20 objects and few
settings.
"""

import warnings
from functools import partial
from pathlib import Path

import data
import numpy as np
import pandas as pd
from heads import maxima
from measure import SCORES, command, head, of_groups, plus_minus, row, timed
from sklearn.decomposition import PCA
from sklearn.exceptions import ConvergenceWarning
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.ratings import outlying_raters


def stacked(ratings):
    """Counts, or true shares, of shape (n_trials, n_adjectives, n_levels)."""
    return np.stack(list(ratings.values()), axis=1)


def folds_of(steps, trials, objects, seed=0):
    """Yield rows and features of training and test trials of five folds."""
    for train, test in data.split(objects, seed=seed):
        A = steps.fit_transform(trials.iloc[train]).astype(float)
        yield train, test, A, steps.transform(trials.iloc[test]).astype(float)


def each_adjective(model, A, y, B):
    """Fit one model per adjective; predictions of shape (n, n_adjectives, n_levels)."""
    each = [model.fit(A, y[:, i]).predict_proba(B) for i in range(y.shape[1])]
    return np.stack(each, axis=1)


def of_trials(y, proba, names):
    """Scores of trials and adjectives, of shape (n_trials, n_adjectives, n_scores)."""
    flat = [each.reshape(-1, y.shape[-1]) for each in (y, proba)]
    values = [SCORES[name](*flat, average=False) for name in names]
    return np.stack(values, axis=-1).reshape(*y.shape[:2], len(names))


def of_objects(y, proba, objects, names):
    """Scores of each object, means over its trials and adjectives."""
    return of_groups(of_trials(y, proba, names).mean(axis=1), objects)


def report(results, base, names, title):
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
    network = NNPOM(*setting, max_iter=200, tol=1e-3, random_state=0)
    return DistributionalOrdinalRegressor(network)


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


def joint_sets(folder, n_objects):
    """Title, trials, targets, objects and features to be fitted of each set."""
    corpus = make_haptic_corpus(n_objects, 10, "slow_slide", random_state=0)
    features = make_pipeline(maxima(), StandardScaler(), PCA())
    title = f"Generated: {len(corpus.trials)} slow slides, ten adjectives"
    yield title, corpus.trials, stacked(corpus.ratings), corpus.objects, features
    if folder:
        X, _, objects, *_ = data.votes(folder)
        binary = data.adjectives_of_votes(folder)
        features = make_pipeline(StandardScaler(), PCA())
        title = f"PHAC-2, {len(binary)} adjectives, yes or no"
        yield title, pd.DataFrame(X), stacked(binary), objects, features


def joint(folder, n_objects, seeds):
    """Print models of each adjective beside one network for all."""
    alphas = (3.0, 10.0, 30.0, 100.0)
    lines = [(0, alpha) for alpha in (1.0, *alphas)]
    networks = [(n, alpha) for n in (5, 10, 20, 30) for alpha in alphas]
    if len(seeds) == 1:
        lines, networks = lines[:2], networks[1:3]
    ways = {
        "linear, each its penalty": (one_by_one, lines, True),
        "networks, each its setting": (one_by_one, networks, True),
        "one network for all": (all_at_once, networks, False),
    }
    names = ["RPS", "log score"]
    for title, trials, y, objects, features in joint_sets(folder, n_objects):
        proba = {name: np.empty(y.shape) for name in ways}
        seconds = dict.fromkeys(ways, 0.0)
        for train, test, A, B in folds_of(features, trials, objects):
            for name, (predict, settings, own) in ways.items():
                search = partial(inner_rps, predict, settings)
                taken, rps = timed(search, A, y[train], objects[train])
                best = [settings[i] for i in rps.argmin(axis=0)]
                best = best if own else settings[rps.mean(axis=1).argmin()]
                fitting, proba[name][test] = timed(predict, best, A, y[train], B)
                seconds[name] += taken + fitting
        scores = {n: of_objects(y, p, objects, names) for n, p in proba.items()}
        report({0: scores}, "one network for all", names, title)
        print("seconds:", {name: round(each) for name, each in seconds.items()})


# Outlying ratings --------------------------------------------------------------------


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


def ratings(_, n_objects, seeds):
    """Print what careless raters cost, and what it helps to leave outliers out."""
    corpora, folds, names = {}, {}, ["RPS", "EMD"]
    model = DistributionalOrdinalRegressor(NNPOM(0, max_iter=200, tol=1e-3))
    for seed in seeds:
        corpora[seed] = c = make_haptic_corpus(
            n_objects, 5, "slow_slide", random_state=seed
        )
        steps = make_pipeline(maxima(), StandardScaler(), PCA())
        folds[seed] = list(folds_of(steps, c.trials, c.objects, seed))
    for kind in ("as generated", "a sixth at random", "a sixth reversed"):
        results, notes = {}, []
        for seed, corpus in corpora.items():
            truth, rng = stacked(corpus.true_proba), np.random.default_rng(seed)
            ids, of_trial = np.unique(corpus.objects, return_inverse=True)
            table = corpus.rater_ratings[list(corpus.ratings)]
            clean = np.stack([table.loc[i].to_numpy() for i in ids])
            answers, person, wrong = careless(clean, kind, rng)
            kept, note = kept_answers(answers, person, wrong)
            notes.append(f"seed {seed}: {note}")
            given = answers[..., None] == np.arange(1, 6)
            results[seed] = {}
            for name, of_answers in kept.items():
                y = (given & of_answers[..., None]).sum(axis=1)[of_trial]
                proba = np.empty(truth.shape)
                for train, test, A, B in folds[seed]:
                    proba[test] = each_adjective(model, A, y[train], B)
                found = of_objects(truth, proba, corpus.objects, names)
                results[seed][name] = found
        title = f"Raters: {kind} ({'; '.join(notes)})"
        report(results, "nothing left out", names, title)


def main():
    questions = {"joint": joint, "ratings": ratings}
    parser = command(__doc__)
    parser.add_argument("question", choices=questions)
    parser.add_argument("--data", metavar="FOLDER", type=Path)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    n_objects, seeds = (20, (0,)) if arguments.quick else (60, (0, 1))
    warnings.simplefilter("ignore", ConvergenceWarning)
    questions[arguments.question](arguments.data, n_objects, seeds)


if __name__ == "__main__":
    main()
