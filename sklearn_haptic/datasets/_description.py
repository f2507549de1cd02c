"""What a corpus holds: its recordings and their faults, its objects, its ratings."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils import Bunch
from sklearn.utils.validation import check_consistent_length

from ..ratings import interrater_agreement
from ..ratings._checks import check_counts, match_levels
from ..ratings._distributions import shares
from ..recordings._faults import dead_channels, longest_rests, usual_rests
from ..recordings._repair import by_sensor, check_limits, read_faulty
from ..recordings._trials import name_of, rate_of, trial_columns
from ..utils._report import Report
from ..utils._row_order import check_order
from ..utils._sklearn import Trials, validate_params
from ..utils._validation import check_objects, check_regular, count, drop_missing

_MOST_ROWS = 12  # of objects that are shown


class _Corpus(Report):
    """What `describe_corpus` returns."""

    def _parts(self):
        yield "Recordings: lengths are in samples, and faults those of single trials."
        yield self.sensors
        if self.objects is not None:
            yield (
                f"{count(len(self.objects), 'objects')}, of which at most {_MOST_ROWS} "
                "with the fewest trials are shown."
            )
            yield self.objects.sort_values("trials", kind="stable").head(_MOST_ROWS)
        if self.ratings is not None:
            yield (
                f"Ratings of {self.rated}s, and the share of people who chose each. "
                "Agreement (r_wg) is 1 where all chose the same, 0 where they might as "
                "well have drawn lots."
            )
            yield pd.concat([self.ratings, self.shares], axis=1)


@validate_params(
    {
        "objects": ["array-like", None],
        "ratings": [Mapping, "array-like", None],
        "levels": ["array-like", None],
        "sampling_rates": [Mapping, Real, None],
        "limits": [Mapping, "array-like", None],
    },
    prefer_skip_nested_validation=True,
)
def describe_corpus(
    corpus: Bunch | Trials,
    *,
    objects: ArrayLike | None = None,
    ratings: Mapping[str, ArrayLike] | ArrayLike | None = None,
    levels: ArrayLike | None = None,
    sampling_rates: Mapping[str, float] | float | None = None,
    limits: Mapping[str, tuple[float, float]] | tuple[float, float] | None = None,
) -> Bunch:
    """Describe a corpus: its trials, the faults of its recordings, its ratings.

    A notebook shows the result as tables, and `print` as text. Recordings may have
    every fault that :class:`~sklearn_haptic.RepairTrials` repairs.

    Parameters
    ----------
    corpus : Bunch, DataFrame, or collection of trials
        What `load_phac2` or `make_haptic_corpus` returns; or trials: a DataFrame with
        one row per trial and a column of arrays per sensor, or the trials of one
        sensor, as a list or a 3-D array.
    objects : array-like of shape (n_trials,), default=None
        The object of each trial; by default those of the corpus.
    ratings : dict of str to array-like, or array-like, default=None
        For each adjective or for one, how many people gave each trial's object each
        rating, of shape (n_trials, n_levels), or one rating per trial; by default those
        of the corpus. A trial without ratings has no counts but 0.
    levels : array-like of shape (n_levels,), default=None
        The levels, lowest first; by default those of the corpus, or as
        :class:`~sklearn_haptic.DistributionalOrdinalRegressor` finds them.
    sampling_rates : float or mapping of str to float, default=None
        Samples per second, of all sensors or of each; by default those of the corpus.
    limits : tuple of float (low, high) or mapping of str to tuple, default=None
        Lowest and highest value that the sensor can give, or those of each sensor. By
        default no sample counts as saturated.

    Returns
    -------
    description : :class:`~sklearn.utils.Bunch`
        Dictionary-like object with attributes:

        sensors : DataFrame
            One row per sensor, or column of trials: ``n_trials`` that have it and
            ``n_missing_trials`` that have not; ``n_channels``; ``rate`` in samples per
            second; ``shortest``, ``median`` and ``longest``, the time samples of a
            trial; ``n_samples``, of all trials and channels; ``n_missing_samples``,
            which are NaN, infinite or masked. Of ``saturated``, ``dead`` and
            ``constant``, the first counts the channels of single trials that reach
            ``limits``, NaN if these are not given; the second those that are constant
            in the trial within ``limits``, for longer than in nine trials of ten; the
            third the channels that no trial moves.
        objects : DataFrame or None
            One row per object: its ``name`` if known, and its ``trials``, their number.
            None without objects.
        ratings : DataFrame or None
            One row per adjective: ``n_rated`` objects; ``fewest`` and ``most``, people
            who rated one; ``agreement`` and ``least_agreement``, the median and the
            least r_wg of those that two or more people rated, see
            :func:`~sklearn_haptic.ratings.interrater_agreement`. None without ratings.
        shares : DataFrame or None
            One row per adjective and one column per level: the mean share of people who
            chose it, NaN if the adjective has no such level.
        rated : {"object", "trial"} or None
            What was rated: trials if those of an object differ in ratings, or if there
            are no objects.

    Raises
    ------
    ValueError
        If there are no trials; a trial is not an array of numbers or has another number
        of channels than the first; an argument has not one entry per trial; or ratings
        or their levels cannot be.

    See Also
    --------
    sklearn_haptic.RepairTrials : Its `faults_` say which trials have which faults.

    Notes
    -----
    Trials are read once and not copied as a whole.

    Examples
    --------
    >>> from sklearn_haptic.datasets import describe_corpus, make_haptic_corpus
    >>> corpus = make_haptic_corpus(6, 2, sensors=["pdc", "tdc"], random_state=0)
    >>> description = describe_corpus(corpus)
    >>> description.sensors[["n_trials", "n_channels", "rate", "median", "dead"]]
         n_trials  n_channels   rate  median  dead
    pdc        12           2  100.0  1000.0     0
    tdc        12           2  100.0  1000.0     0
    >>> description.ratings.loc["hard"]
    n_rated             6.0...
    fewest             12.0...
    most               12.0...
    agreement           ...
    least_agreement     ...
    Name: hard, dtype: float64
    """
    given: Mapping[str, Any] = (
        corpus if isinstance(corpus, Mapping) else {"trials": corpus}
    )
    trials = given.get("trials", ())
    known = not isinstance(trials, str) and hasattr(trials, "__len__") and len(trials)
    columns = trial_columns(trials) if known else {}
    if not columns:
        raise ValueError(
            "corpus has no trials; give what load_phac2 returns, or trials."
        )
    n_trials = len(next(iter(columns.values())))
    objects = given.get("objects") if objects is None else objects
    if objects is not None:
        check_consistent_length(objects, np.empty(n_trials))
        check_order(trials, objects, "objects", "trials")
        objects = check_objects(objects, row="trial")
    if sampling_rates is None:
        of_corpus = given.get("sampling_rates", {})
        sampling_rates = {name: of_corpus.get(name) for name in columns}
    rates = by_sensor(sampling_rates, columns, "sampling_rates")
    for rate in rates.values():
        if rate is not None and (not isinstance(rate, Real) or rate <= 0):
            raise ValueError(f"sampling_rates has {rate!r}; give a number above 0.")
    ranges = by_sensor(limits, columns, "limits")
    rows = [
        {
            "rate": rate_of(column, rates[name], name=name_of(column)),
            **_sensor_row(column, name, ranges[name]),
        }
        for name, column in columns.items()
    ]
    sensors = pd.DataFrame(rows, index=pd.Index(list(columns), dtype=object))
    ratings = given.get("ratings") if ratings is None else ratings
    levels = given.get("levels") if levels is None else levels
    return _Corpus(
        sensors=sensors.astype({"rate": float}),
        objects=_objects(objects, given.get("object_names")),
        **_describe_ratings(ratings, levels, objects, trials),
    )


def _sensor_row(column, name, limits):
    """Return a row of the table of sensors, but its rate."""
    limits = check_limits(limits)
    ends = (-np.inf, np.inf) if limits is None else limits
    cells = read_faulty(column, name)[0]
    there = [trial for trial in cells if trial is not None]
    n_missing, saturated = 0, 0
    for trial in there:
        lowest, highest = np.fmin.reduce(trial), np.fmax.reduce(trial)
        n_missing += np.isnan(trial).sum()
        saturated += ((lowest <= ends[0]) | (highest >= ends[1])).sum()
    recorded = np.array([len(trial) for trial in there], dtype=int)
    each = np.array([longest_rests(trial) for trial in there], ndmin=2)
    rests = usual_rests(each)
    dead = [dead_channels(trial, rests, limits).sum() for trial in there]
    shortest, median, longest = (
        np.quantile(recorded, [0, 0.5, 1]) if len(recorded) else [np.nan] * 3
    )
    return {
        "n_trials": len(recorded),
        "n_missing_trials": len(cells) - len(recorded),
        "n_channels": each.shape[1],
        "shortest": shortest,
        "median": median,
        "longest": longest,
        "n_samples": int(recorded.sum()) * each.shape[1],
        "n_missing_samples": int(n_missing),
        "saturated": np.nan if limits is None else float(saturated),
        "dead": int(sum(dead)),
        "constant": int((~np.isfinite(each)).all(axis=0).sum()),
    }


def _objects(objects, names):
    """Return the table of objects, None if these are not known."""
    if objects is None:
        return None
    ids, first, n_trials = np.unique(objects, return_index=True, return_counts=True)
    columns = {}
    if names is not None:
        check_consistent_length(names, objects)
        columns["name"] = np.asarray(names)[first]
    columns["trials"] = n_trials
    return pd.DataFrame(columns, index=pd.Index(ids, name="object"))


def _describe_ratings(ratings, levels, objects, trials):
    """Return the tables of ratings, and what was rated."""
    if ratings is None or (isinstance(ratings, Mapping) and not ratings):
        return {"ratings": None, "shares": None, "rated": None}
    if not isinstance(ratings, Mapping):
        ratings = {"ratings": ratings}
    counts, levels_of = {}, {}
    for name, y in ratings.items():
        check_consistent_length(y, trials)
        check_order(trials, y, f"ratings[{name!r}]", "trials")
        counts[name], levels_of[name] = _counts(y, levels, f"ratings[{name!r}]")
    rated = "trial"
    if objects is not None:
        _, first, which = np.unique(objects, return_index=True, return_inverse=True)
        if all(np.array_equal(each, each[first][which]) for each in counts.values()):
            rated = "object"
            counts = {name: each[first] for name, each in counts.items()}
    names = pd.Index(list(counts), name="adjective", dtype=object)
    chosen = [
        dict(zip(levels_of[name].tolist(), _mean_shares(counts[name])))
        for name in counts
    ]
    table = pd.DataFrame(chosen, index=names)
    if all(isinstance(level, Real) for level in table):
        table = table.sort_index(axis=1)  # of scales that differ, lowest level first
    return {
        "ratings": pd.DataFrame(map(_rating_row, counts.values()), index=names),
        "shares": table,
        "rated": rated,
    }


def _counts(y, levels, name):
    """Return counts of shape (n_trials, n_levels), 0 where unrated, and the levels."""
    shape = check_regular(y, name).shape
    if len(shape) > 2:
        raise ValueError(
            f"{name} has shape {shape}; give a dict with the counts of each adjective."
        )
    if len(shape) == 1 or shape[1] == 1:
        ratings, given = drop_missing(y, name)
        rows = np.flatnonzero(given)
        matches, levels = match_levels(ratings, y, levels, name, rows=rows)
        counts = np.zeros((len(given), len(levels)))
        counts[given] = matches
        return counts, levels
    counts, levels = check_counts(y, levels, name=name, unrated=True)
    if not counts.any():
        raise ValueError(f"{name} has no ratings at all; leave it out.")
    return counts, levels


def _rating_row(counts):
    """Return a row of the table of ratings."""
    people = counts.sum(axis=1)
    rated, several = people[people > 0], counts[people >= 2]
    agreement = interrater_agreement(several) if len(several) else np.array([np.nan])
    return {
        "n_rated": len(rated),
        "fewest": rated.min(),
        "most": rated.max(),
        "agreement": np.median(agreement),
        "least_agreement": agreement.min(),
    }


def _mean_shares(counts):
    return shares(counts[counts.any(axis=1)]).mean(axis=0)
