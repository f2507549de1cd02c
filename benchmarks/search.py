"""A grid search over five sensors: what caches and a shared rotation save.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/search.py [--quick]

The paper's grid, five numbers of hidden units by five penalties, in five folds of whole
objects: 125 fits of `make_haptic_pipeline`. Each search runs once, with an empty cache,
in one process. "memory= of the steps" is that of the transformers and of the pooling.
"then PCA" rotates the features to as many axes as there are training trials, once a
fold; the networks' start values are drawn for other axes then, so their scores differ.
Before it stands what caches of some steps save where K-SVD learns the dictionaries, in
a search over eight penalties. About seven minutes; ``--quick`` takes six objects, two
folds and two settings.
"""

import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
from measure import command, head, machine, row, timed
from sklearn.compose import make_column_transformer
from sklearn.decomposition import PCA
from sklearn.exceptions import ConvergenceWarning
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    KSVDTransformer,
    STHMPTransformer,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_rps_scorer

GRID = {
    "estimator__n_hidden": [1, 5, 10, 20, 30],
    "estimator__alpha": [0.001, 0.01, 0.1, 1.0, 10.0],
}
NETWORK = DistributionalOrdinalRegressor(
    NNPOM(max_iter=50), levels=[1, 2, 3, 4, 5], random_state=0
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
        estimator, grid, scoring=neg_rps_scorer, cv=cv, refit=False, error_score="raise"
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


def search_table(trials, y, folds):
    costs = "s, clock", "s, processor", "speed-up", "cache, MB"
    head("", *costs, "scores", "best")
    variants = [
        ("no cache", one_search, ()),
        ("`Pipeline(memory=)`", one_search, ("pipeline_memory",)),
        ("`memory=` of the steps", one_search, ("step_memory",)),
        ("both", one_search, ("step_memory", "pipeline_memory")),
        ("both, then PCA", one_search, ("step_memory", "pipeline_memory", "rotate")),
        ("fold by fold", fold_by_fold, ()),
        ("fold by fold, then PCA", fold_by_fold, ("rotate",)),
    ]
    reference = None
    for name, search, options in variants:
        with tempfile.TemporaryDirectory() as folder:
            values = {
                option: option == "rotate" or f"{folder}/{option}" for option in options
            }
            clock = time.perf_counter()
            processor, scores = timed(search, trials, y, folds, **values)
            clock = time.perf_counter() - clock
            files = [f for f in Path(folder).rglob("*") if f.is_file()]
            size = sum(f.stat().st_size for f in files) / 1e6
        if reference is None:
            reference = scores, processor
        same = "equal" if np.array_equal(scores, reference[0]) else "other starts"
        ratio = f"{reference[1] / processor:.1f}"
        costs = f"{clock:.0f}", f"{processor:.0f}", ratio, f"{size:.0f}"
        row(name, *costs, same, f"{scores.mean(axis=1).max():.4f}")


def own_pipeline():
    """Dictionaries that K-SVD learns, as a reader would put them together."""
    vibration = make_pipeline(
        KSVDTransformer(40, window=22, max_iter=15, random_state=0), TemporalMaxPool()
    )
    skin = make_pipeline(
        STHMPTransformer(10, max_iter=15, random_state=0), TemporalMaxPool()
    )
    features = make_column_transformer((vibration, "pac"), (skin, "electrodes"))
    return Pipeline(
        [("features", features), ("scale", StandardScaler()), ("model", NETWORK)]
    ).set_params(model__estimator__n_hidden=0)


def table_of_parts(trials, y, folds):
    """Print what the caches of some steps save, in a search over eight penalties."""
    grid = {"model__estimator__alpha": np.logspace(-1, 2, 8)}
    coders, pools = ("ksvdtransformer", "sthmptransformer"), ("temporalmaxpool",)
    variants = {
        "no cache": (),
        "of the pooling": pools,
        "of the transformers": coders,
        "of both": coders + pools,
        "of the whole pipeline": ("memory",),
        "of both and the whole": (*coders, *pools, "memory"),
    }
    head("own pipeline, `memory=`", "s, processor", "mean score")
    for name, owners in variants.items():
        with tempfile.TemporaryDirectory() as folder:
            model = own_pipeline()
            for key in model.get_params():
                if key.endswith("memory") and key.split("__")[-2:][0] in owners:
                    model.set_params(**{key: folder})
            search = timed(search_scores, model, grid, trials, y, folds)
            row(name, f"{search[0]:.1f}", f"{search[1].mean():.8f}")


def main():
    parser = command(__doc__)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    machine("joblib")
    if quick:
        GRID.update({name: values[:1] for name, values in GRID.items()})
    n_objects, n_folds = (6, 2) if quick else (20, 5)
    corpus = make_haptic_corpus(n_objects, 4, procedure="slow_slide", random_state=0)
    y = corpus.ratings["hard"]
    folds = list(GroupKFold(n_folds).split(corpus.trials, y, corpus.objects))
    table_of_parts(corpus.trials, y, folds)
    search_table(corpus.trials, y, folds)


if __name__ == "__main__":
    main()
