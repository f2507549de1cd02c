"""The whole experiment of Richardson & Kuchenbecker (2020), in resumable units.

A *unit* is one step of a study that is written to disk when it is finished: the trials
of a procedure, the features of a sensor, or all models of a fold. Its result depends on
nothing but the corpus, the settings and its name, from which its seeds follow.
"""

from collections.abc import Callable, Sequence
from itertools import product
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Literal

from joblib import effective_n_jobs
from sklearn.metrics import check_scoring
from sklearn.utils import Bunch
from sklearn.utils.parallel import Parallel, delayed

from .._biotac import PROCEDURES, SENSORS
from .._sklearn import (
    Interval,
    Names,
    Scorer,
    StrOptions,
    one_blas_thread,
    validate_params,
)
from .._validation import check_names
from ..models import NNPOM, DistributionalOrdinalRegressor
from ._features import compute_features
from ._models import check_models, compute_models
from ._progress import Progress
from ._results import read_study
from ._store import open_study, read_record, read_unit, write_unit
from ._study import Study
from ._trials import adjectives_of, compute_trials

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

    Parameters
    ----------
    study : Study
    units : list of tuple
    n_jobs : int or None
    report : callable, default=None
        Called with each unit and the seconds it took.
    """
    pending = [unit for unit in units if read_record(study.folder, unit) is None]
    parallel = Parallel(n_jobs=n_jobs, return_as="generator_unordered", batch_size=1)
    for finished in parallel(delayed(complete_unit)(study, unit) for unit in pending):
        if report is not None:
            report(*finished)


@validate_params(
    {
        "corpus": [callable],
        "folder": [str, PathLike],
        "adjectives": ["array-like", None],
        "procedures": ["array-like", None],
        "sensors": ["array-like", None],
        "split": [StrOptions({"group_kfold", "paper"})],
        "n_splits": [Interval(Integral, 2, None, closed="left")],
        "n_repeats": [Interval(Integral, 1, None, closed="left")],
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
    corpus: Callable[..., Bunch],
    folder: str | PathLike[str],
    *,
    adjectives: Names | None = None,
    procedures: Names | None = None,
    sensors: Names | None = None,
    split: Literal["group_kfold", "paper"] = "group_kfold",
    n_splits: int = 5,
    n_repeats: int = 2,
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
    corpus : callable
        Function that is called as ``corpus(procedure=..., sensors=[...])`` and returns
        what `load_phac2` and `make_haptic_corpus` return, the same each time:
        ``functools.partial(load_phac2, path, ratings=ratings)``, or
        ``functools.partial(make_haptic_corpus, 60, 10, random_state=0)``.
    folder : str or path-like
        Where results are kept; it is made if it does not exist.
    adjectives : array-like of str, default=None
        Adjectives to predict, by default all that the corpus has ratings of.
    procedures : array-like of str, default=None
        Some of ``"squeeze"``, ``"hold"``, ``"slow_slide"`` and ``"fast_slide"``, by
        default all.
    sensors : array-like of str, default=None
        Some of ``"pac"``, ``"pdc"``, ``"tac"``, ``"tdc"`` and ``"electrodes"``, by
        default all.
    split : {"group_kfold", "paper"}, default="group_kfold"
        "group_kfold" tests on every object: ``n_repeats`` times the objects are
        divided at random into ``n_splits`` folds, the same for every adjective and
        procedure, and a ninth of the objects not tested are for validation. "paper"
        divides them at random once per adjective, 80 % for training and 10 % each for
        validation and testing; of sixty objects that leaves six test objects, too few
        to tell methods apart.
    n_splits : int, default=5
        Number of folds of "group_kfold".
    n_repeats : int, default=2
        Number of times that "group_kfold" divides the objects.
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
        on the validation objects. By default a regressor of
        ``NNPOM(early_stopping=True, max_iter=200, n_iter_no_change=30)``;
        ``DistributionalOrdinalRegressor(**PAPER_2020)`` is the paper's.
    scoring : str, callable or None, default=None
        Score on the validation objects by which networks are chosen, higher being
        better. By default the regressor's own, the negative ranked probability score;
        :func:`~sklearn_haptic.metrics.neg_macro_mae_scorer` is the paper's.
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
    sklearn_haptic.model_selection.contribution_summary : What each sensor contributes.

    Notes
    -----
    Each sensor has a dictionary of its own for each procedure. As in the paper it is
    learned from 60 % of the trials of every object, test objects included, but from no
    ratings. All other steps are fitted to training trials only, per procedure,
    adjective and fold:

    1. Features are standardised and rotated to their principal axes; no axis is
       dropped.
    2. One network per sensor is chosen by its score on the validation objects, then a
       network that combines their activations.
    3. The combined network is fitted again from each random start, with all sensors and
       without each of them, and predicts the ratings of the test objects.

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
    if regressor is None:
        network = NNPOM(early_stopping=True, max_iter=200, n_iter_no_change=30)
        regressor = DistributionalOrdinalRegressor(network)
    if not isinstance(regressor.estimator, NNPOM):
        raise ValueError(
            f"regressor has the estimator {regressor.estimator!r}; give it an NNPOM."
        )
    check_scoring(regressor, scoring)
    study = Study(
        corpus=corpus,
        folder=Path(folder),
        sensors=check_names(sensors, list(SENSORS), "sensor", "PHAC-2"),
        split=split,
        n_splits=int(n_splits),
        n_repeats=int(n_repeats),
        n_hidden=_check_grid("n_hidden", n_hidden, int, 1),
        alpha=_check_grid("alpha", alpha, float, 0),
        n_starts=int(n_starts),
        regressor=regressor,
        scoring=scoring,
        random_state=int(random_state),
    )
    procedures = check_names(procedures, list(PROCEDURES), "procedure", "PHAC-2")
    open_study(study.folder, study.settings)

    trials = list(product(["trials"], procedures))
    complete_units(study, trials, n_jobs=n_jobs)
    features = list(product(["features"], procedures, study.sensors))
    models = [
        ("models", procedure, adjective, fold)
        for procedure in procedures
        for adjective in _choose_adjectives(study, procedure, adjectives)
        for fold in range(study.n_folds)
    ]
    check_models(study, models)
    report = None
    if verbose:
        report = Progress(study.folder, features + models, effective_n_jobs(n_jobs))
    complete_units(study, features, n_jobs=n_jobs, report=report)
    complete_units(study, models, n_jobs=n_jobs, report=report)
    return read_study(study.folder)


def _choose_adjectives(study, procedure, adjectives):
    trials, _ = read_unit(study.folder, ("trials", procedure))
    return check_names(adjectives, adjectives_of(trials), "adjective", "the corpus")


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
