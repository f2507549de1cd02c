"""What careless raters cost, and what it helps to leave outlying answers out.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/careless_raters.py \
        [--quick]

Two corpora of 300 slow slides of 60 objects (seeds 0 and 1), in five folds of whole
objects. Scores are those against the whole population, means over adjectives and
objects; differences are paired, with standard errors over objects. Two minutes;
``--quick`` takes one corpus of 20 objects.
"""

import warnings

import data
import numpy as np
from heads import maxima
from measure import SCORES, command, head, of_groups, plus_minus, row
from sklearn.decomposition import PCA
from sklearn.exceptions import ConvergenceWarning
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.ratings import outlying_raters

MODEL = DistributionalOrdinalRegressor(NNPOM(0, max_iter=200, tol=1e-3))
KINDS = "as generated", "a sixth at random", "a sixth reversed"


def folds_of(corpus, seed):
    """Rows and features of training and test trials of five folds."""
    found, steps = [], make_pipeline(maxima(), StandardScaler(), PCA())
    for train, test in data.split(corpus.objects, seed=seed):
        A = steps.fit_transform(corpus.trials.iloc[train]).astype(float)
        B = steps.transform(corpus.trials.iloc[test]).astype(float)
        found.append((train, test, A, B))
    return found


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


def scores_of(y, truth, objects, folds):
    """RPS and EMD of each object by models that learn from counts of ratings."""
    scores = np.empty((len(truth), truth.shape[1], 2))
    for train, test, A, B in folds:
        for i in range(truth.shape[1]):
            proba = MODEL.fit(A, y[train, i]).predict_proba(B)
            for k, name in enumerate(("RPS", "EMD")):
                each = SCORES[name](truth[test, i], proba, average=False)
                scores[test, i, k] = each
    return of_groups(scores.mean(axis=1), objects)


def main():
    parser = command(__doc__)
    parser.add_argument("--quick", action="store_true")
    n_objects, seeds = (20, (0,)) if parser.parse_args().quick else (60, (0, 1))
    warnings.simplefilter("ignore", ConvergenceWarning)
    sets = []
    for seed in seeds:
        corpus = make_haptic_corpus(n_objects, 5, "slow_slide", random_state=seed)
        sets.append((seed, corpus, folds_of(corpus, seed)))
    for kind in KINDS:
        lines, notes = {}, []
        for seed, corpus, folds in sets:
            truth = np.stack(list(corpus.true_proba.values()), axis=1)
            ids, of_trial = np.unique(corpus.objects, return_inverse=True)
            table = corpus.rater_ratings[list(corpus.ratings)]
            clean = np.stack([table.loc[i].to_numpy() for i in ids])
            rng, base = np.random.default_rng(seed), None
            answers, person, wrong = careless(clean, kind, rng)
            kept, note = kept_answers(answers, person, wrong)
            notes.append(f"seed {seed}: {note}")
            given = answers[..., None] == np.arange(1, 6)
            for name, of_answers in kept.items():
                y = (given & of_answers[..., None]).sum(axis=1)[of_trial]
                scores = scores_of(y, truth, corpus.objects, folds)
                base = scores if base is None else base
                texts = map(plus_minus, (scores - base).T)
                cells = lines.setdefault(name, [])
                cells += f"{scores[:, 0].mean():.4f}", *texts
        columns = [f"{n}, {s}" for s in seeds for n in ("RPS", "Δ RPS", "Δ EMD")]
        head("", *columns, title=f"Raters: {kind} ({'; '.join(notes)})")
        for name, cells in lines.items():
            row(name, *cells)


if __name__ == "__main__":
    main()
