"""The whole experiment of Richardson & Kuchenbecker (2020), in resumable units.

Each sensor's recordings of each exploratory procedure give features over a dictionary
of their own. For each procedure, adjective and fold a network a sensor is chosen on
validation objects, then a network that combines them; this and one holdout a sensor
predict the ratings of test objects, from several random starts.
"""

import sys
from collections.abc import Callable, Sequence
from itertools import product
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Literal

import pandas as pd
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
from ..models._distributional import DistributionalOrdinalRegressor
from ..models._nnpom import NNPOM
from ._store import (
    open_study,
    read_finished,
    read_record,
    read_settings,
    read_unit,
    write_unit,
)
from ._units import COMPUTE, NAME_OF_MODELS, Study, adjectives_of, check_models


# Sums in another order would differ in the last digit.
@one_blas_thread
def complete_unit(study, unit):
    """Compute a unit and write it; return its name and the seconds it took."""
    started = perf_counter()
    kind, *name = unit
    try:
        content, record = COMPUTE[kind](study, *name)
    except Exception as error:
        error.add_note(f"This happened in the unit {unit} of the study.")
        raise
    seconds = perf_counter() - started
    write_unit(study.folder, unit, content, seconds=seconds, **record)
    return unit, seconds


class Progress:
    """Prints a line for each finished unit, with the time left.

    Parameters
    ----------
    study : Study
    units : list of tuple
        All units, finished or not.
    n_workers : int
        How many are computed at a time.
    """

    def __init__(self, study, units, n_workers):
        records = {unit: read_record(study.folder, unit) for unit in units}
        self.seconds = {
            unit: record["seconds"] if record else None
            for unit, record in records.items()
        }
        self.n_workers = n_workers

    def __call__(self, unit, seconds):
        """Note that a unit is finished."""
        self.seconds[unit] = seconds
        n_done = sum(each is not None for each in self.seconds.values())
        print(
            f"[{n_done}/{len(self.seconds)}] {' '.join(map(str, unit))}: "
            f"{seconds:.1f} s, {self.time_left()}",
            file=sys.stderr,
            flush=True,
        )

    def time_left(self):
        """Estimate the time left from the mean time of each kind of unit."""
        total = 0.0
        for kind in COMPUTE:
            of_kind = [s for unit, s in self.seconds.items() if unit[0] == kind]
            taken = [s for s in of_kind if s is not None]
            n_left = len(of_kind) - len(taken)
            if n_left and not taken:
                return f"time left not known before the first of {n_left} {kind}"
            if n_left:
                total += n_left * sum(taken) / len(taken)
        return f"about {total / self.n_workers / 60:.1f} min left"


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
# Threads share what they limit, so it stays limited until the last has ended.
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

    Whatever is finished is in ``folder`` at once and is never computed again: call
    this function again after an interruption, or with more adjectives or procedures.
    The results are the same, bit for bit, as those of one uninterrupted run.

    Parameters
    ----------
    corpus : callable
        Called as ``corpus(procedure=..., sensors=[...])``, returns what `load_phac2`
        and `make_haptic_corpus` return:
        ``functools.partial(load_phac2, path, ratings_path=ratings_path)``, or
        ``functools.partial(make_haptic_corpus, 60, 10, random_state=0)``. It must
        return the same each time.
    folder : str or path-like
        Where results are kept; made if it is not there.
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
        divides them once an adjective at random, 80 % for training and 10 % each for
        validation and testing. Six test objects of sixty cannot tell methods apart.
    n_splits : int, default=5
        Number of folds of "group_kfold".
    n_repeats : int, default=2
        How often "group_kfold" divides the objects.
    n_hidden : array-like of int, default=(1, 5, 10, 20, 30)
        Numbers of hidden units to choose among, for each network.
    alpha : array-like of float, default=(0.001, 0.01, 0.1, 1.0, 10.0)
        Penalties to choose among, lambda in the paper.
    n_starts : int, default=10
        How often the combined model and each holdout are fitted and tested, with other
        random states.
    regressor : DistributionalOrdinalRegressor, default=None
        How networks are fitted and distributions predicted. Its estimator is an
        `NNPOM`, whose ``n_hidden`` and ``alpha`` are chosen; if it stops early, it does
        so on the validation objects. By default that with ``early_stopping=True,
        max_iter=200, n_iter_no_change=30``.
        ``DistributionalOrdinalRegressor(**PAPER_2020)`` gives the paper's.
    scoring : str, callable or None, default=None
        Score by which networks are chosen on the validation objects, higher being
        better; by default the regressor's own, the negative ranked probability score.
        The paper's is :func:`~sklearn_haptic.metrics.neg_macro_mae_scorer`.
    random_state : int, default=0
        Seed of everything random. Each unit's own seeds follow from this one and its
        name.
    n_jobs : int, default=None
        Number of jobs; one computes a unit. The results are the same for any number
        and any joblib backend.
    verbose : bool, default=True
        Whether to print a line to stderr for each finished unit, with the time left.

    Returns
    -------
    study : :class:`~sklearn.utils.Bunch`
        All finished results in ``folder``, as `read_study` returns them.

    Raises
    ------
    ValueError
        If ``folder`` holds a study with other settings, the corpus has no ratings or
        lacks an adjective, or a parameter does not fit.

    See Also
    --------
    read_study : Read the results without computing any.
    sklearn_haptic.model_selection.contribution_summary : What each sensor contributes.

    Notes
    -----
    Dictionaries are learnt from 60 % of the trials of every object, test objects
    included, as in the paper: they know nothing of ratings. All that follows uses
    training trials only: features are standardised and rotated to their principal
    axes, of which none is dropped; a network a sensor is chosen by its score on the
    validation objects, then a combined network on the activations of those; the latter
    is fitted again from each start, with all sensors and without each.

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
        report = Progress(study, features + models, effective_n_jobs(n_jobs))
    complete_units(study, features, n_jobs=n_jobs, report=report)
    complete_units(study, models, n_jobs=n_jobs, report=report)
    return read_study(study.folder)


def read_study(folder: str | PathLike[str]) -> Bunch:
    """Read what `run_study` has finished so far; nothing is computed or executed.

    Parameters
    ----------
    folder : str or path-like
        The folder of the study.

    Returns
    -------
    study : :class:`~sklearn.utils.Bunch`
        Dictionary-like object with the attributes:

        scores : DataFrame
            A row for each model and test trial. Columns: ``procedure``, ``adjective``
            and ``fold``; ``held_out``, the sensor, or "none" for the full model;
            ``start``; ``object``; ``trial``, its name; the scores that
            `sensor_contributions` gives; ``proba_1``, …, the predicted probability of
            each level; and ``count_1``, …, how many people chose it.
        choices : DataFrame
            A row for each network chosen. Columns: ``procedure``, ``adjective`` and
            ``fold``; ``network``, the sensor or "combined"; ``n_hidden`` and ``alpha``,
            what was chosen; and ``score``, that on the validation objects.
        baselines : DataFrame
            What a guess that knows no touch would score: two rows for each
            ``procedure``, ``adjective`` and ``fold``. ``strategy`` is that of a
            :class:`~sklearn_haptic.DummyDistribution` of all objects not tested. The
            scores are means over the test trials; ``proba_1``, … is the distribution.

        Rows are ordered by procedure, adjective and fold.

    Raises
    ------
    ValueError
        If there is no study, or none of its models is finished, or a file is damaged.

    Examples
    --------
    >>> from sklearn_haptic.study import read_study
    >>> study = read_study("study")  # doctest: +SKIP
    >>> study.scores.groupby("adjective")["rps"].mean()  # doctest: +SKIP
    """
    folder = Path(folder)
    read_settings(folder)
    units = read_finished(folder, "models", NAME_OF_MODELS)
    if not units:
        raise ValueError(f"{folder} has no finished models yet; run_study makes them.")
    records = [record for _, record in units]
    return Bunch(
        scores=pd.concat([table for table, _ in units], ignore_index=True),
        choices=pd.DataFrame(_rows_of(records, "choices")),
        baselines=pd.DataFrame(_rows_of(records, "baselines")),
    )


def _rows_of(records, name):
    """Return what the records of models list under a name, each with its unit."""
    rows = []
    for record in records:
        unit = dict(zip(("procedure", "adjective", "fold"), record["unit"][1:]))
        listed = record.get(name)
        if not isinstance(listed, list) or not all(isinstance(e, dict) for e in listed):
            raise ValueError(
                f"The record of models/{record['file']} has no list of {name}; delete "
                "that file, and run_study does the unit again."
            )
        rows.extend({**unit, **each} for each in listed)
    return rows


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
