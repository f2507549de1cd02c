"""A grid search over five sensors: what caches and a shared rotation save.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/search.py

The paper's grid, five numbers of hidden units by five penalties, in five folds with
objects kept whole: 125 fits of `make_haptic_pipeline` on a small synthetic corpus. Each
search runs once, with an empty cache, in one process. Speed-ups are ratios of
processor time, which other load on the machine disturbs less than it does the clock.

"memory= of the steps" is that of the transformers and of the pooling. "then PCA"
rotates the features to as many axes as there are training trials, once a fold, instead
of in every fit of the head. The networks' start values are drawn for other axes then,
so their scores differ; those of a linear head, which has one optimum, do not. About
six minutes.
"""

import os
import platform
import tempfile
import time
import warnings
from datetime import date
from pathlib import Path

import joblib
import numpy as np
import scipy
import sklearn
from sklearn.decomposition import PCA
from sklearn.exceptions import ConvergenceWarning
from sklearn.model_selection import GridSearchCV, GroupKFold

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_rps_scorer

GRID = {
    "estimator__n_hidden": [1, 5, 10, 20, 30],
    "estimator__alpha": [0.001, 0.01, 0.1, 1.0, 10.0],
}
CONVERGING = {"estimator__alpha": [0.1, 1.0, 10.0]}
NETWORK, LINEAR = (
    DistributionalOrdinalRegressor(network, levels=[1, 2, 3, 4, 5], random_state=0)
    for network in (NNPOM(max_iter=50), NNPOM(n_hidden=0, tol=1e-8, max_iter=2000))
)


def whole_model(*, step_memory=None, pipeline_memory=None, rotate=False):
    """Features of five sensors, standardised, and the paper's network."""
    model = make_haptic_pipeline(memory=step_memory, random_state=0)
    if rotate:
        model.steps.insert(-1, ("pca", PCA()))
    return model.set_params(memory=pipeline_memory, model=NETWORK)


def search_scores(estimator, grid, X, y, cv):
    """Search; return scores of shape (n_settings, n_folds)."""
    search = GridSearchCV(
        estimator,
        grid,
        scoring=neg_rps_scorer,
        cv=cv,
        refit=False,
        error_score="raise",
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # few iterations
        results = search.fit(X, y).cv_results_
    return np.column_stack([results[f"split{i}_test_score"] for i in range(len(cv))])


def one_search(trials, y, folds, **options):
    """Search over the whole pipeline."""
    grid = {f"model__{name}": values for name, values in GRID.items()}
    return search_scores(whole_model(**options), grid, trials, y, folds)


def fold_by_fold(trials, y, folds, **options):
    """Compute the features of a fold, then search over the head alone."""
    scores = []
    for train, test in folds:
        features = whole_model(**options)[:-1].fit(trials.iloc[train])
        X = features.transform(trials)
        scores.append(search_scores(NETWORK, GRID, X, y, [(train, test)]))
    return np.hstack(scores)


def megabytes(folder):
    return sum(f.stat().st_size for f in folder.rglob("*") if f.is_file()) / 1e6


def stages(trials, y, folds):
    """Print what is left: features once a fold, and the head's fits on them."""
    linear = []
    for rotate in (False, True):
        start = time.process_time()
        ready = []
        for train, test in folds:
            features = whole_model(rotate=rotate)[:-1]
            X_train = features.fit_transform(trials.iloc[train])
            X_test = features.transform(trials.iloc[test])
            ready.append((np.vstack((X_train, X_test)), np.append(train, test)))
        computed = time.process_time()
        splits = [[(np.arange(len(t)), np.arange(len(t), len(y)))] for t, _ in folds]
        for (X, order), split in zip(ready, splits):
            search_scores(NETWORK, GRID, X, y[order], split)
        fitted = time.process_time()
        print(
            f"{'With' if rotate else 'Without'} PCA: features once a fold "
            f"{computed - start:.1f} s, fits and scores of the head "
            f"{fitted - computed:.1f} s\n",
            flush=True,
        )
        linear.append(
            [
                search_scores(LINEAR, CONVERGING, X, y[order], split)
                for (X, order), split in zip(ready, splits)
            ]
        )
    change = np.abs(np.subtract(*linear)).max()
    print(f"Largest change of a converged linear head's score by PCA: {change:.1g}\n")


def search_table(trials, y, folds):
    print("| | s, clock | s, processor | speed-up | cache, MB | scores | best |")
    print("|---" * 7 + "|", flush=True)
    variants = [
        ("no cache", one_search, ()),
        ("`Pipeline(memory=)`", one_search, ("pipeline_memory",)),
        ("`memory=` of the steps", one_search, ("step_memory",)),
        ("both", one_search, ("step_memory", "pipeline_memory")),
        (
            "both, then PCA",
            one_search,
            ("step_memory", "pipeline_memory", "rotate"),
        ),
        ("fold by fold", fold_by_fold, ()),
        ("fold by fold, then PCA", fold_by_fold, ("rotate",)),
    ]
    reference = None
    for name, search, options in variants:
        with tempfile.TemporaryDirectory() as folder:
            values = {
                option: option == "rotate" or os.path.join(folder, option)
                for option in options
            }
            clock, processor = time.perf_counter(), time.process_time()
            scores = search(trials, y, folds, **values)
            clock = time.perf_counter() - clock
            processor = time.process_time() - processor
            size = megabytes(Path(folder))
        if reference is None:
            reference = scores, processor
        same = "equal" if np.array_equal(scores, reference[0]) else "other starts"
        print(
            f"| {name} | {clock:.0f} | {processor:.0f} | {reference[1] / processor:.1f}"
            f" | {size:.0f} | {same} | {scores.mean(axis=1).max():.4f} |",
            flush=True,
        )


if __name__ == "__main__":
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        if os.environ.get(variable) != "1":
            raise SystemExit(f"Set {variable}=1: the tables are for one thread.")
    versions = [f"{m.__name__} {m.__version__}" for m in (np, scipy, sklearn, joblib)]
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores")
    print(f"Python {platform.python_version()}, {', '.join(versions)}")
    print(f"{date.today()}\n")
    corpus = make_haptic_corpus(20, 4, procedure="slow_slide", random_state=0)
    y = corpus.ratings["hard"]
    folds = list(GroupKFold(5).split(corpus.trials, y, corpus.objects))
    stages(corpus.trials, y, folds)
    search_table(corpus.trials, y, folds)
