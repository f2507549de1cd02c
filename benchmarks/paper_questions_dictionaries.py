"""Are atoms chosen for the adjective better than those that code touches best?"""

import numpy as np
from joblib import Memory
from paper_questions_data import (
    FEW,
    SCORES,
    SEEDS,
    coders,
    corpus_of,
    each_adjective,
    linear,
    of_objects,
    report,
    split,
    stacked,
    together,
)
from sklearn.preprocessing import StandardScaler

from sklearn_haptic.metrics import ranked_probability_score

ADJECTIVES = FEW[:2]
WINDOWED = ["pac", "pdc", "tac", "tdc"]  # electrodes take most of the time
PRESET = "as many as in the presets"
SIZES = {"half as many atoms": 0.5, PRESET: 1.0, "twice as many atoms": 2.0}
CHOSEN, USEFUL, BY_CLASS = (
    "number of atoms chosen for each adjective",
    "the more useful half of twice as many",
    "half from objects rated low, half from high",
)


def compute_sizes(seed):
    """For each fold, features of training and test trials for each number of atoms.

    Also, for each column of the largest, which atom it is about.
    """
    corpus = corpus_of(seed)
    trials, features = corpus.trials, []
    for train, test in split(2, corpus.objects, seed):
        of_sizes = {}
        for name, factor in SIZES.items():
            steps = coders(WINDOWED, factor).fit(trials.iloc[train])
            of_sizes[name] = [steps.transform(trials.iloc[r]) for r in (train, test)]
        features.append(of_sizes)
    return features, atom_of_columns(steps)


def compute_by_class(seed, adjective):
    """For each fold, features over atoms half of which are learned from each class.

    The classes are the objects rated below the median on average, and the others.
    """
    corpus = corpus_of(seed)
    mean = corpus.ratings[adjective] @ np.arange(5) / 12
    features = []
    for train, test in split(2, corpus.objects, seed):
        low = mean[train] < np.median(mean[train])
        halves = [
            coders(WINDOWED, 0.5).fit(corpus.trials.iloc[train[rows]])
            for rows in (low, ~low)
        ]
        steps = coders(WINDOWED)
        for name, pipeline, _ in steps.transformers:
            fitted = [half.named_transformers_[name][0] for half in halves]
            atoms = np.vstack([each.components_ for each in fitted])
            options = {"n_atoms": len(atoms), "dict_init": atoms, "max_iter": 0}
            pipeline[0].set_params(**options)
        steps.fit(corpus.trials.iloc[train])
        features.append([steps.transform(corpus.trials.iloc[r]) for r in (train, test)])
    return features


def predict(A, y, B):
    """What default models of standardised features predict."""
    scale = StandardScaler().fit(A)
    A, B = (scale.transform(Z).astype(np.float64) for Z in (A, B))
    A, B = together(A, B)
    return each_adjective(linear(), A, y, B)


def best_size(features, y, objects):
    """The number of atoms with the least RPS in three folds of training objects."""
    rps = {}
    for name, (A, _) in features.items():
        each = []
        for train, test in split(3, objects, 0):
            proba = predict(A[train], y[train], A[test])
            each.append(ranked_probability_score(y[test, 0], proba[:, 0]))
        rps[name] = np.mean(each)
    return min(rps, key=rps.get)


def atom_of_columns(steps):
    """For each column of the features, which atom of all sensors it is about."""
    atoms, first = [], 0
    for name, columns in steps.output_indices_.items():
        if name != "remainder":
            n_atoms = len(steps.named_transformers_[name][0].components_)
            atoms.append(first + np.arange(columns.stop - columns.start) % n_atoms)
            first += n_atoms
    return np.concatenate(atoms)


def useful_columns(A, y, objects, atoms):
    """Columns of the half of all sensors' atoms that has the largest coefficients.

    The size of a linear model's coefficients is summed over the columns of an atom,
    and averaged over three models, each without a third of the training objects.
    """
    use = np.zeros(atoms.max() + 1)
    A = StandardScaler().fit_transform(A).astype(np.float64)
    for train, _ in split(3, objects, 0):
        coef = linear().fit(A[train], y[train, 0]).estimator_.coefs_[0][:-1]
        use += np.bincount(atoms, np.abs(coef))
    return (use >= np.median(use))[atoms]


def dictionaries(folder):
    """Print the scores of all dictionaries."""
    memory = Memory(folder, verbose=0)
    results, notes = {}, []
    for seed in SEEDS:
        corpus = corpus_of(seed)
        folds = split(2, corpus.objects, seed)
        sizes, atoms = memory.cache(compute_sizes)(seed)
        y = stacked(corpus.ratings, ADJECTIVES)
        proba, counts = {}, dict.fromkeys(SIZES, 0)
        for i, adjective in enumerate(ADJECTIVES):
            by_class = memory.cache(compute_by_class)(seed, adjective)
            for k, (train, test) in enumerate(folds):
                known, objects = y[train, i : i + 1], corpus.objects[train]
                features = dict(sizes[k])
                size = best_size(features, known, objects)
                counts[size] += 1
                A, B = features["twice as many atoms"]
                kept = useful_columns(A, known, objects, atoms)
                features[CHOSEN] = features[size]
                features[USEFUL] = A[:, kept], B[:, kept]
                features[BY_CLASS] = by_class[k]
                for name, (A, B) in features.items():
                    of_all = proba.setdefault(name, np.empty(y.shape))
                    of_all[test, i] = predict(A, known, B)[:, 0]
        notes.append(f"seed {seed}: {counts}")
        results[seed] = {
            name: of_objects(y, each, corpus.objects, SCORES.values())
            for name, each in proba.items()
        }
    report(results, PRESET)
    print("\nchosen numbers of atoms: " + "; ".join(notes))
