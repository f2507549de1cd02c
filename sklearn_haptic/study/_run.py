"""The whole experiment of Richardson & Kuchenbecker (2020), in resumable units.

A *unit* is one step of a study that is written to disk when it is finished: the trials
of a procedure, the features of a sensor, or all models of a fold. Its result depends on
nothing but the corpus, the settings and its name, from which its seeds follow.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

import numpy as np
from joblib import effective_n_jobs
from sklearn.metrics import check_scoring
from sklearn.utils import Bunch
from sklearn.utils.parallel import Parallel, delayed

from ..features import KSVDTransformer, STHMPTransformer
from ..models import NNPOM, DistributionalOrdinalRegressor
from ..utils._sklearn import (
    Interval,
    Names,
    Scorer,
    StrOptions,
    one_blas_thread,
    validate_params,
)
from ..utils._validation import check_names
from ._corpus import adjectives_of, compute_trials, open_corpus
from ._features import compute_features
from ._models import check_models, compute_models
from ._results import read_study
from ._store import open_study, read_record, read_table, unit_path, write_unit
from ._study import PROTOCOLS, Study, count_folds

_COMPUTE = {
    "trials": compute_trials,
    "features": compute_features,
    "models": compute_models,
}


# With another number of threads, sums would differ in the last digit.
@one_blas_thread
def complete_unit(study, unit):
    """Compute a unit and write it; return its name and the seconds it took."""
    started = perf_counter()
    kind, *name = unit
    try:
        content, record = _COMPUTE[kind](study, *name)
    except Exception as error:
        error.add_note(f"This happened in the unit {unit} of the study.")
        raise
    seconds = perf_counter() - started
    write_unit(study.folder, unit, content, seconds=seconds, **record)
    return unit, seconds


def complete_units(study, units, *, n_jobs, report=None):
    """Compute the units that are not finished, in any order.

    `report`, if given, is called with each unit and the seconds it took.
    """
    pending = [unit for unit in units if not unit_path(study.folder, unit).exists()]
    parallel = Parallel(n_jobs=n_jobs, return_as="generator_unordered", batch_size=1)
    for finished in parallel(delayed(complete_unit)(study, unit) for unit in pending):
        if report is not None:
            report(*finished)


class Progress:
    """Prints one line per finished unit, with the time left.

    Parameters
    ----------
    folder : Path
        Folder of the study.
    units : list of tuple
        All units, finished or not.
    n_workers : int
        Number of units that are computed at a time.
    """

    def __init__(self, folder, units, n_workers):
        self.n_workers = n_workers
        self.seconds = {}
        for unit in units:
            record = read_record(folder, unit)
            self.seconds[unit] = np.nan if record is None else record["seconds"]

    def __call__(self, unit, seconds):
        """Note that a unit is finished; the rest takes the mean time of its kind."""
        self.seconds[unit] = seconds
        left = 0.0
        for kind in ("features", "models"):
            taken = np.array([s for name, s in self.seconds.items() if name[0] == kind])
            unknown = np.isnan(taken)
            if unknown.any():
                known = taken[~unknown].mean() if not unknown.all() else np.nan
                left += unknown.sum() * known
        n_done = sum(s == s for s in self.seconds.values())
        expected = f"about {left / self.n_workers / 60:.1f} min left"
        print(
            f"[{n_done}/{len(self.seconds)}] {' '.join(map(str, unit))}: "
            f"{seconds:.1f} s, {expected if left == left else 'time left not known'}",
            file=sys.stderr,
            flush=True,
        )


@validate_params(
    {
        "corpus": [callable, Mapping],
        "folder": [str, PathLike],
        "protocol": [StrOptions(set(PROTOCOLS))],
        "adjectives": ["array-like", None],
        "procedures": ["array-like", None],
        "sensors": ["array-like", Mapping, None],
        "split": [StrOptions({"group_kfold", "paper"}), None],
        "n_splits": [Interval(Integral, 2, None, closed="left")],
        "n_repeats": [Interval(Integral, 1, None, closed="left")],
        "update": [StrOptions({"approximate", "exact"}), None],
        "dictionaries": [StrOptions({"all objects", "training objects"})],
        "standardise": ["boolean", None],
        "n_hidden": ["array-like"],
        "alpha": ["array-like"],
        "n_starts": [Interval(Integral, 1, None, closed="left")],
        "regressor": [DistributionalOrdinalRegressor, None],
        "scoring": [str, callable, None],
        "random_state": [Interval(Integral, 0, None, closed="left")],
        "n_jobs": [Integral, None],
        "verbose": ["boolean"],
    },
    prefer_skip_nested_validation=False,
)
# Threads of one process share this limit; it holds until the last of them has ended.
@one_blas_thread
def run_study(
    corpus: Callable[..., Bunch] | Mapping[str, Mapping[str, Any]],
    folder: str | PathLike[str],
    *,
    protocol: Literal["default", "paper"] = "default",
    adjectives: Names | None = None,
    procedures: Names | None = None,
    sensors: Names | Mapping[str, KSVDTransformer | STHMPTransformer] | None = None,
    split: Literal["group_kfold", "paper"] | None = None,
    n_splits: int = 5,
    n_repeats: int = 2,
    update: Literal["approximate", "exact"] | None = None,
    dictionaries: Literal["all objects", "training objects"] = "all objects",
    standardise: bool | None = None,
    n_hidden: Sequence[int] = (1, 5, 10, 20, 30),
    alpha: Sequence[float] = (0.001, 0.01, 0.1, 1.0, 10.0),
    n_starts: int = 10,
    regressor: DistributionalOrdinalRegressor | None = None,
    scoring: str | Scorer | None = None,
    random_state: int = 0,
    n_jobs: int | None = None,
    verbose: bool = True,
) -> Bunch:
    """Run the experiment of Richardson & Kuchenbecker, or what is left of it.

    Whatever is finished is written to ``folder`` at once and is never computed again.
    Call this function again after an interruption, or with more adjectives or
    procedures: the results are the same, bit for bit, as those of one uninterrupted
    run.

    Parameters
    ----------
    corpus : callable, or mapping of str to Bunch or dict
        Either a function that is called as ``corpus(procedure=..., sensors=[...])`` and
        returns what `load_phac2` and `make_haptic_corpus` return, the same each time:
        ``functools.partial(load_phac2, path, ratings=ratings)``, or
        ``functools.partial(make_haptic_corpus, 60, 10, random_state=0)``.

        Or the recordings in memory, of any procedures and any sensors: for the name of
        each procedure a Bunch or dict of ``trials``, a DataFrame with one row per trial
        (its index names them), one column per sensor, and arrays of shape ``(n_times,
        n_channels)`` or images of shape ``(n_times, height, width)`` in its cells;
        ``objects``, the id of each trial's object; and ``ratings``, for each adjective
        counts of shape ``(n_trials, n_levels)``.
    folder : str or path-like
        Where results are kept; it is made if it does not exist.
    protocol : {"default", "paper"}, default="default"
        What ``split``, ``update``, ``standardise``, ``regressor`` and ``scoring`` are
        where they are not given. "paper" has all particulars that the text of the paper
        fixes; "default" differs where other settings were measured to be better.
    adjectives : array-like of str, default=None
        Adjectives to predict, by default all that the corpus has ratings of.
    procedures : array-like of str, default=None
        Some of those of the corpus, by default all. A function as corpus has
        ``"squeeze"``, ``"hold"``, ``"slow_slide"`` and ``"fast_slide"``.
    sensors : array-like of str, or mapping of str to transformer, default=None
        Some of those that all procedures have, by default all of these. A function as
        corpus has ``"pac"``, ``"pdc"``, ``"tac"``, ``"tdc"`` and ``"electrodes"``,
        which are coded as in the paper. Other signals are coded by a `KSVDTransformer`
        of 25 atoms with windows of 50 samples, images by an `STHMPTransformer` of 10
        atoms, both without removal of means. A mapping gives each sensor a transformer
        of its own: ``{"mic": KSVDTransformer(40, window=22)}``.
    split : {"group_kfold", "paper"}, default=None
        By default that of the protocol, which bears its name or is "group_kfold".
        "group_kfold" tests on every object: ``n_repeats`` times the objects are
        divided at random into ``n_splits`` folds, the same for every adjective and all
        procedures of the same objects, and a ninth of the objects not tested are for
        validation. "paper" divides them at random once per adjective, 80 % for training
        and 10 % each for validation and testing; of sixty objects that leaves six test
        objects, too few to tell methods apart.
    n_splits : int, default=5
        Number of folds of "group_kfold".
    n_repeats : int, default=2
        Number of times that "group_kfold" divides the objects.
    update : {"approximate", "exact"}, default=None
        Update of an atom in K-SVD, where ``sensors`` gives no transformer; see
        `KSVDTransformer`. By default exact with the protocol "paper", else approximate.
    dictionaries : {"all objects", "training objects"}, default="all objects"
        Whose recordings dictionaries are learned from, 60 % of the trials of each. "all
        objects", as in the paper, includes the test objects. "training objects" learns
        a dictionary for each fold, with the split "paper" for each adjective too, which
        takes that many times the time and the disk.
    standardise : bool, default=None
        Whether to standardise features and rotate them to the principal axes of the
        training trials, or to take them as they were extracted. By default they are
        taken as extracted with the protocol "paper" alone.
    n_hidden : array-like of int, default=(1, 5, 10, 20, 30)
        Numbers of hidden units among which each network's is chosen.
    alpha : array-like of float, default=(0.001, 0.01, 0.1, 1.0, 10.0)
        Penalties among which each network's is chosen, lambda in the paper.
    n_starts : int, default=10
        Number of times that the combined model, and the model without each sensor, are
        fitted and tested, each time with another random state.
    regressor : DistributionalOrdinalRegressor, default=None
        How networks are fitted and distributions predicted. Its estimator is an
        `NNPOM`, whose ``n_hidden`` and ``alpha`` are chosen; early stopping, if any, is
        on the validation objects. By default ``DistributionalOrdinalRegressor(
        **PAPER_2020)`` with the protocol "paper", else a regressor of
        ``NNPOM(early_stopping=True, max_iter=200, n_iter_no_change=30)``.
    scoring : str, callable or None, default=None
        Score on the validation objects by which networks are chosen, higher being
        better. By default :func:`~sklearn_haptic.metrics.neg_macro_mae_scorer` with
        the protocol "paper", else the regressor's own, the negative ranked probability
        score.
    random_state : int, default=0
        Seed of everything random. The seeds of a unit follow from this one and the
        unit's name.
    n_jobs : int, default=None
        Number of jobs, each of which computes one unit. The results are the same for
        any number and any joblib backend.
    verbose : bool, default=True
        Whether to print one line to stderr per finished unit, with the time left.

    Returns
    -------
    study : :class:`~sklearn.utils.Bunch`
        All finished results in ``folder``, as `read_study` returns them.

    Raises
    ------
    ValueError
        If ``folder`` holds a study with other settings, the corpus has no ratings or
        lacks an adjective, or a parameter has a wrong value.

    See Also
    --------
    read_study : Read the results without computing any.
    score_table : Every network beside the guesses that know no touch.
    sklearn_haptic.model_selection.contribution_summary : What each sensor contributes.

    Notes
    -----
    Each sensor has a dictionary of its own for each procedure. As in the paper it is by
    default learned from 60 % of the trials of every object, test objects included, but
    from no ratings. All other steps are fitted to training trials only, per procedure,
    adjective and fold:

    1. Features are taken as extracted, or standardised and rotated to their principal
       axes; no axis is dropped.
    2. One network per sensor is chosen by its score on the validation objects, then a
       network that combines their activations.
    3. The combined network is fitted again from each random start, with all sensors and
       without each of them, and predicts the ratings of the test objects. So does the
       network of each sensor alone.

    References
    ----------
    B. A. Richardson and K. J. Kuchenbecker, "Learning to predict perceptual
    distributions of haptic adjectives", Frontiers in Neurorobotics 13, 2020, sections
    2.2 and 2.3. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from functools import partial
    >>> from tempfile import TemporaryDirectory
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> from sklearn_haptic.study import run_study
    >>> with TemporaryDirectory() as folder:
    ...     study = run_study(
    ...         partial(make_haptic_corpus, 10, 2, random_state=0),
    ...         folder,
    ...         adjectives=["hard"],
    ...         procedures=["fast_slide"],
    ...         sensors=["pdc", "tdc"],
    ...         split="paper",
    ...         n_hidden=[2],
    ...         alpha=[1.0, 10.0],
    ...         n_starts=2,
    ...         verbose=False,
    ...     )
    >>> study.choices["network"].tolist()
    ['pdc', 'tdc', 'combined']
    >>> study.scores.groupby("held_out").size().to_dict()
    {'none': 4, 'pdc': 4, 'tdc': 4}
    """
    load, known_procedures, known_sensors = open_corpus(corpus)
    coders = _check_coders(sensors)
    given = {
        "split": split,
        "update": update,
        "standardise": standardise,
        "regressor": regressor,
        "scoring": scoring,
    }
    given = {name: value for name, value in given.items() if value is not None}
    study = Study(
        corpus=load,
        folder=Path(folder),
        procedures=known_procedures,
        sensors=check_names(
            list(coders) or sensors, known_sensors, "sensor", "the corpus"
        ),
        coders=coders,
        dictionaries=dictionaries,
        n_splits=int(n_splits),
        n_repeats=int(n_repeats),
        n_hidden=_check_grid("n_hidden", n_hidden, int, 1),
        alpha=_check_grid("alpha", alpha, float, 0),
        n_starts=int(n_starts),
        random_state=int(random_state),
        **PROTOCOLS[protocol] | given,
    )
    _check_study(study)
    procedures = check_names(procedures, known_procedures, "procedure", "the corpus")
    open_study(study.folder, study.settings)

    _complete_study(study, procedures, adjectives, n_jobs, verbose)
    return read_study(study.folder)


def _complete_study(study, procedures, adjectives, n_jobs, verbose):
    """Compute the units that are not finished: trials, then features, then models."""
    trials = list(product(["trials"], procedures))
    complete_units(study, trials, n_jobs=n_jobs)
    models, features = [], {}
    for procedure in procedures:
        known = adjectives_of(read_table(study.folder, ("trials", procedure))[0])
        asked = check_names(adjectives, known, "adjective", "the corpus")
        for name in product([procedure], asked, range(count_folds(vars(study)))):
            models.append(("models", *name))
            for sensor in study.sensors:  # a dictionary serves several models
                features[study.features_unit(procedure, sensor, *name[1:])] = None
    check_models(study, models)
    features = [*features]
    report = None
    if verbose:
        report = Progress(study.folder, features + models, effective_n_jobs(n_jobs))
    complete_units(study, features, n_jobs=n_jobs, report=report)
    # Models read features alone: recordings in memory are not sent to other processes.
    study = replace(study, corpus=None)
    complete_units(study, models, n_jobs=n_jobs, report=report)


def _check_study(study):
    """Refuse what the networks or the tables of a study cannot take."""
    if not isinstance(study.regressor.estimator, NNPOM):
        raise ValueError(
            f"regressor has the estimator {study.regressor.estimator!r}; give it an "
            "NNPOM."
        )
    check_scoring(study.regressor, study.scoring)
    for name in {"combined", "marginal", "barycentre"}.intersection(study.sensors):
        raise ValueError(
            f"A sensor is called {name!r}, as is another column of the tables of a "
            "study; rename it."
        )


def _check_coders(sensors):
    """Return the transformers that sensors are given; none if they are only named."""
    coders = dict(sensors) if isinstance(sensors, Mapping) else {}
    for sensor, coder in coders.items():
        if not isinstance(coder, (KSVDTransformer, STHMPTransformer)):
            raise ValueError(
                f"sensors[{sensor!r}] is {coder!r}; give a KSVDTransformer or an "
                "STHMPTransformer, or name the sensors in a list."
            )
    return coders


def _check_grid(name, values, kind, least):
    number = Integral if kind is int else Real
    if not len(values) or not all(
        isinstance(value, number) and value >= least for value in values
    ):
        raise ValueError(
            f"{name}={values!r} must list {'whole ' if kind is int else ''}numbers of "
            f"at least {least}."
        )
    return list(map(kind, values))
