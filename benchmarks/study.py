"""What a study of generated touches takes, and what the paper's settings change.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/study.py TABLE [--quick]

TABLE is one of

time      Seconds by the clock of one process, as the records of the study have them:
          run nothing else beside. Hold, five sensors, ten trials per object, the
          paper's split, its grid and ten starts, 15 to 60 objects; some minutes.
choices   One setting at a time changed from the defaults to the paper's protocol, and
          back: two corpora of 20 objects and 5 trials, Fast Slide, *hard*, three
          sensors, networks of five units, three penalties; three folds keep objects
          whole. Differences are means over the objects of both corpora, ± the standard
          error over objects, positive where the change is for the worse; seconds are
          those of the processor. A quarter of an hour.

``--quick`` takes few objects, one corpus and fewer changes: seconds to a minute.
"""

import warnings
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from data import SENSORS
from measure import command, head, of_groups, plus_minus, row, timed
from sklearn.base import clone
from threadpoolctl import threadpool_limits

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    KSVDTransformer,
    STHMPTransformer,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import neg_macro_mae_scorer, neg_rps_scorer
from sklearn_haptic.study import run_study

# The seconds of a unit stand in its record, which is not public.
from sklearn_haptic.study._store import read_record

ADJECTIVES = ["hard", "rough"]


def stopping(patience, max_iter):
    """Return a regressor that stops early."""
    network = NNPOM(early_stopping=True, max_iter=max_iter, n_iter_no_change=patience)
    return DistributionalOrdinalRegressor(network)


def seconds_of(n_objects, protocol):
    """Mean seconds of the units of a study of Hold: of features, and of models."""
    with TemporaryDirectory() as folder:
        run_study(
            partial(make_haptic_corpus, n_objects, 10, random_state=0),
            folder,
            protocol=protocol,
            adjectives=ADJECTIVES,
            procedures=["hold"],
            split="paper",
            verbose=False,
        )
        features = [("features", "hold", sensor) for sensor in SENSORS]
        models = [("models", "hold", adjective, 0) for adjective in ADJECTIVES]
        return [
            np.mean([read_record(Path(folder), unit)["seconds"] for unit in units])
            for units in (features, models)
        ]


def time(quick):
    """Time the units of several numbers of objects, means of two adjectives."""
    units = "a dictionary and its features", "all models of a fold"
    protocols = ("default",) if quick else ("default", "paper")
    head("objects", *(f"{protocol}: {u}" for protocol in protocols for u in units))
    for n_objects in (15,) if quick else (15, 30, 60):
        found = [s for name in protocols for s in seconds_of(n_objects, name)]
        row(n_objects, *(f"{seconds:.1f}" for seconds in found))


# The paper's settings -----------------------------------------------------------------

SCORES = {"macro_mae": "MAE^M", "rps": "RPS", "log_score": "log score"}
REGRESSORS = {
    "default": stopping(30, 200),
    "paper": DistributionalOrdinalRegressor(**PAPER_2020),
}
DECODING = set(PAPER_2020) - {"estimator"}


def changes(base, other):
    """Name -> settings of `run_study` that make one change to a protocol."""
    to_paper, theirs = other == "paper", REGRESSORS[other]
    update = {"default": "approximate", "paper": "exact"}
    coders = {
        "pac": KSVDTransformer(40, window=22, update=update[base]),
        "pdc": KSVDTransformer(25, window=50, update=update[base]),
        "electrodes": STHMPTransformer(update=update[base]),
    }  # which remove the means of windows

    def network(*names):
        given = {
            f"estimator__{name}": getattr(theirs.estimator, name) for name in names
        }
        return {"regressor": clone(REGRESSORS[base]).set_params(**given)}

    decoding = {name: getattr(theirs, name) for name in DECODING}
    decoding = clone(REGRESSORS[base]).set_params(**decoding)
    return {
        "nothing": {},
        "all of them": {"protocol": other},
        "update of K-SVD": {"update": update[other]},
        "means of windows removed": {"sensors": coders},
        "dictionaries from training objects": {"dictionaries": "training objects"},
        "features as extracted" if to_paper else "features standardised and rotated": {
            "standardise": not to_paper
        },
        "scale within the network": network("scale_features"),
        f"{theirs.estimator.gaps} gaps": network("gaps"),
        "solver and its patience": network(
            "solver", "max_iter", "tol", "n_iter_no_change"
        ),
        "positions and decoding": {"regressor": decoding},
        "score to choose by": {
            "scoring": neg_macro_mae_scorer if to_paper else neg_rps_scorer
        },
    }


def scores_of(settings, seeds, n_objects):
    """Scores of each object by the full model, shape (n_objects, n_scores)."""
    found = []
    for seed in seeds:
        with TemporaryDirectory() as folder:
            study = run_study(
                partial(make_haptic_corpus, n_objects, 5, random_state=seed),
                folder,
                adjectives=["hard"],
                procedures=["fast_slide"],
                split="group_kfold",
                n_splits=3,
                n_repeats=1,
                n_hidden=[5],
                alpha=[0.1, 1.0, 10.0],
                n_starts=1,
                random_state=seed,
                verbose=False,
                **{"sensors": ["pac", "pdc", "electrodes"]} | settings,
            )
        full = study.scores.query("held_out == 'none'")
        found.append(of_groups(full[list(SCORES)].to_numpy(), full["object"]))
    return np.concatenate(found)


def choices(quick):
    """Print what each change to the protocols of a study changes."""
    seeds, n_objects = ((0,), 9) if quick else ((0, 1), 20)
    for base, other in (("default", "paper"), ("paper", "default")):
        title = f'From protocol="{base}" to protocol="{other}"'
        head("changed", *SCORES.values(), "seconds", title=title)
        of_base = None
        for name, settings in list(changes(base, other).items())[
            : 3 if quick else None
        ]:
            settings = {"protocol": base} | settings
            seconds, scores = timed(scores_of, settings, seeds, n_objects)
            if of_base is None:
                of_base = scores
                cells = [f"{mean:.3f}" for mean in scores.mean(axis=0)]
                cells = [cell.replace("inf", "infinite") for cell in cells]
            else:
                pairs = zip(scores.T, of_base.T)
                cells = [
                    plus_minus(a - b, 3) if np.isfinite([a, b]).all() else "infinite"
                    for a, b in pairs
                ]
            row(name, *cells, f"{seconds:.0f}")


def main():
    tables = {"time": time, "choices": choices}
    parser = command(__doc__)
    parser.add_argument("table", choices=tables)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # of fits that end early
    with threadpool_limits(1, user_api="blas"):
        tables[arguments.table](arguments.quick)


if __name__ == "__main__":
    main()
