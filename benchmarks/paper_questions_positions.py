"""How many random positions should a trial be observed at, for how large a crowd?"""

import numpy as np
from paper_questions_data import (
    CHOICE,
    FEW,
    SEEDS,
    SOLVER,
    corpus_of,
    difference,
    each_adjective,
    linear,
    out_of_fold,
    stacked,
    together,
)

from sklearn_haptic import NNPOM

CROWDS = (5, 15, 50)
POSITIONS = (1, 3, 5, 15, 50)
DEFAULT = "the default's nodes"
MODELS = {  # a network, the adjectives, what alpha is chosen from, crowds
    "linear": (NNPOM(0, **SOLVER), FEW, (1.0, 3.0, 10.0), CROWDS),
    "ten hidden units": (NNPOM(10, **SOLVER), FEW[:2], (10.0, 30.0), CROWDS[1:2]),
}


def samplings():
    """Parameters of the regressor by name."""
    random = {
        f"{n} random": {"sampling": "random", "n_duplicates": n} for n in POSITIONS
    }
    return {DEFAULT: {}} | random


def scores_of(network, alpha, options, adjectives, seed, n_raters, folder, n_folds):
    """RPS and EMD of each object against the truth, not against its raters.

    `alpha` is the penalty beside 15 observations; for other numbers it is scaled.
    """
    corpus = corpus_of(seed, n_raters)
    y, truth = (stacked(r, adjectives) for r in (corpus.ratings, corpus.true_proba))
    scaled = alpha * options.get("n_duplicates", 15) / 15
    model = linear(random_state=seed, **options).set_params(
        estimator=network.set_params(alpha=scaled)
    )

    def predict(fold):
        A, B = together(fold.A, fold.B)
        return each_adjective(model, A, y[fold.train], B)

    return out_of_fold(predict, truth, seed, folder, ["RPS", "EMD"], n_folds)


def positions(folder):
    """Print, for each model and crowd, what random positions cost."""
    for title, (network, adjectives, alphas, crowds) in MODELS.items():
        print(f"\n**{title}**, {len(adjectives)} adjectives\n")
        head = [f"{n} raters, seed {s}" for n in crowds for s in SEEDS]
        print("| | alpha | " + " | ".join(head) + " |")
        print("|---" * (len(head) + 2) + "|")
        base = {}
        for name, options in samplings().items():

            def scores(alpha, seed, n_raters, n_folds=None):
                setting = options, adjectives, seed, n_raters, folder, n_folds  # noqa: B023
                return scores_of(network, alpha, *setting)  # noqa: B023

            rps = [scores(a, CHOICE, CROWDS[1], 2)[:, 0].mean() for a in alphas]
            alpha = alphas[int(np.argmin(rps))]
            each = {(n, s): scores(alpha, s, n) for n in crowds for s in SEEDS}
            base = base or each
            cells = [cell(each[key], base[key]) for key in each]
            print(f"| {name} | {alpha:g} | " + " | ".join(cells) + " |", flush=True)


def cell(scores, base):
    """RPS and EMD, or their differences to others'."""
    if scores is base:
        return "{:.4f}, {:.4f}".format(*scores.mean(axis=0))
    return ", ".join(f"{m:+.4f} ± {e:.4f}" for m, e in zip(*difference(scores, base)))
