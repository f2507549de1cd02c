"""Outlying ratings and outlying touches: how to find them, and what they cost."""

import numpy as np
from paper_questions_data import (
    SCORES,
    SEEDS,
    corpus_of,
    each_adjective,
    folds_of,
    linear,
    of_objects,
    out_of_fold,
    report,
    split,
    stacked,
    together,
)

from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.ratings import outlying_raters

AGAINST_TRUTH = ["RPS", "EMD"]
LEVELS = np.arange(1, 6)
LIMIT = 3.5  # robust standard scores beyond it are outliers (Iglewicz & Hoaglin 1993)
AS_GENERATED, FURTHEST = "as generated", "the 5 % furthest answers left out"
ALL, TRUE = "nothing left out", "those known to be wrong left out"


def robust_scores(values):
    """Standard scores by the median and the median absolute deviation."""
    centred = values - np.median(values)
    return centred / (1.4826 * np.median(np.abs(centred)))


def fitted(A, y, B):
    """What default models, fitted to A and y, predict for B."""
    A, B = together(A, B)
    return each_adjective(linear(), A, y, B)


def described(found, wrong):
    """How many were found, how many of them were wrong, how many were wrong."""
    return f"{found.sum()} left out, {(found & wrong).sum()} of {wrong.sum()} wrong"


# Ratings ------------------------------------------------------------------------------


def distance_to_others(answers):
    """Earth mover's distance of each answer to the others about the same object.

    The distance of a single answer to a distribution is its mean absolute difference
    to the other answers.

    Parameters
    ----------
    answers : ndarray of shape (n_objects, n_raters, n_adjectives)

    Returns
    -------
    distance : ndarray of the same shape
    """
    apart = np.abs(answers[:, :, None] - answers[:, None])
    return apart.sum(axis=2) / (answers.shape[1] - 1)


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
    third = np.arange(len(answers))[:, None] % 3
    person = third * n_raters + np.arange(n_raters)
    n_people = 3 * n_raters
    if kind == AS_GENERATED:
        return answers, person, np.empty(0, dtype=int)
    wrong = rng.choice(n_people, n_people // 6, replace=False)
    theirs = np.isin(person, wrong)
    if kind == "six of 36 people at random":
        answers[theirs] = rng.integers(1, 6, size=answers[theirs].shape)
    else:
        answers[theirs] = 6 - answers[theirs]
    return answers, person, wrong


def outliers(answers, person):
    """People whom `outlying_raters` calls outlying."""
    objects = np.broadcast_to(np.arange(len(person))[:, None], person.shape)
    rows = answers.reshape(-1, answers.shape[-1])
    result = outlying_raters(rows, objects.ravel(), person.ravel())
    return result.index[result["outlying"]].to_numpy()


def counted(answers, kept):
    """Counts of shape (n_objects, n_adjectives, n_levels) of the answers kept."""
    return ((answers[..., None] == LEVELS) & kept[..., None]).sum(axis=1)


def ratings(folder):
    """Print what careless raters cost, and what it helps to leave outliers out."""
    kinds = AS_GENERATED, "six of 36 people at random", "six of 36 people reversed"
    for kind in kinds:
        results, notes = {}, []
        for seed in SEEDS:
            corpus, rng = corpus_of(seed), np.random.default_rng(seed)
            truth, names = stacked(corpus.true_proba), list(corpus.ratings)
            ids, of_trial = np.unique(corpus.objects, return_inverse=True)
            clean = [corpus.rater_ratings.loc[i, names].to_numpy() for i in ids]
            answers, person, wrong = careless(np.stack(clean), kind, rng)
            found = outliers(answers, person)
            distance = distance_to_others(answers)
            kept = {
                ALL: np.ones(person.shape, dtype=bool),
                "outlying people left out": ~np.isin(person, found),
                FURTHEST: distance <= np.quantile(distance, 0.95),
                TRUE: ~np.isin(person, wrong),
            }
            right = len(np.intersect1d(found, wrong))
            notes.append(
                f"seed {seed}: {len(found)} people left out, {right} of {len(wrong)} "
                "careless"
            )
            results[seed] = {}
            for name, of_answers in kept.items():
                if of_answers.ndim == 2:
                    of_answers = of_answers[..., None]
                y = counted(answers, of_answers)[of_trial]
                results[seed][name] = out_of_fold(
                    lambda fold, y=y: fitted(fold.A, y[fold.train], fold.B),
                    truth,
                    seed,
                    folder,
                    AGAINST_TRUTH,
                )
        print(f"\n**Raters: {kind}** ({'; '.join(notes)})")
        report(results, ALL, AGAINST_TRUTH)


# Touches ------------------------------------------------------------------------------


def surprise(X, y, objects):
    """How much worse than its object's other touches each is predicted.

    The RPS, a mean over adjectives, is measured out of fold, by models of other
    objects. The log score will not do: it is infinite for a level that nobody chose
    for any of these.
    """
    score = np.empty(len(X))
    for train, test in split(5, objects, 0):
        proba = fitted(X[train], y[train], X[test])
        flat = y[test].reshape(-1, 5), proba.reshape(-1, 5)
        each = ranked_probability_score(*flat, average=False).reshape(proba.shape[:2])
        score[test] = each.mean(axis=1)
    for i in np.unique(objects):
        score[objects == i] -= np.median(score[objects == i])
    return score


def strangeness(X, objects):
    """Distance of a touch to the mean of its object's other touches, logarithmic."""
    distance = np.empty(len(X))
    for t, i in enumerate(objects):
        others = (objects == i) & (np.arange(len(X)) != t)
        distance[t] = np.linalg.norm(X[t] - X[others].mean(axis=0))
    return np.log(distance)


def broken(fold, objects, kind, rng):
    """Break a tenth of the training touches; return features, rows of ratings, which.

    A touch of another object is recorded under its object's name, or all signals of one
    sensor are zero.
    """
    X, rated_as = fold.A.copy(), fold.train.copy()
    wrong = np.zeros(len(X), dtype=bool)
    if kind == AS_GENERATED:
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


def touches(folder):
    """Print what broken touches cost, and what it helps to leave outliers out."""
    for kind in (AS_GENERATED, "a tenth under another name", "a dead sensor"):
        results, notes = {}, []
        for seed in SEEDS:
            corpus, rng = corpus_of(seed), np.random.default_rng(seed)
            y, truth = stacked(corpus.ratings), stacked(corpus.true_proba)
            proba, left_out = {}, {}
            for fold in folds_of(seed, folder):
                X, rated_as, wrong = broken(fold, corpus.objects, kind, rng)
                called = corpus.objects[rated_as]
                by_score = robust_scores(surprise(X, y[rated_as], called)) > LIMIT
                by_features = robust_scores(strangeness(X, called)) > LIMIT
                found = {
                    ALL: np.zeros(len(X), dtype=bool),
                    "outlying score": by_score,
                    "outlying features": by_features,
                    TRUE: wrong,
                }
                for name, out in found.items():
                    predicted = fitted(X[~out], y[rated_as[~out]], fold.B)
                    proba.setdefault(name, np.empty(y.shape))[fold.test] = predicted
                    left_out.setdefault(name, []).append((out, wrong))
            results[seed] = {
                name: of_objects(
                    truth, each, corpus.objects, [SCORES[s] for s in AGAINST_TRUTH]
                )
                for name, each in proba.items()
            }
            for name in ("outlying score", "outlying features"):
                out, wrong = (np.concatenate(each) for each in zip(*left_out[name]))
                notes.append(f"seed {seed}, {name}: {described(out, wrong)}")
        print(f"\n**Touches: {kind}** ({'; '.join(notes)})")
        report(results, ALL, AGAINST_TRUTH)
