"""What a corpus holds: its trials, its recordings and their faults, its ratings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils import Bunch
from sklearn.utils.validation import check_consistent_length

from .._biotac import PROCEDURES
from .._check_trials import count
from .._recordings import ALONE, USUAL, is_frame, iter_cells, trial_columns
from .._report import Report, Table, as_texts
from .._sklearn import Trials, validate_params
from .._validation import check_objects
from ._described_ratings import describe_ratings

_CHUNK = 2**20  # values that are looked at in one go
_MOST_ROWS = 12  # of objects that are shown


class _Corpus(Report):
    """What `describe_corpus` returns."""

    def _parts(self):
        yield self.summary
        yield _sensor_table(self.sensors)
        if self.objects is not None and self.objects["trials"].nunique() > 1:
            yield _object_table(self.objects)
        if self.ratings is not None:
            yield _rating_table(self.ratings, self.shares, self.rated)


@validate_params(
    {
        "objects": ["array-like", None],
        "procedures": ["array-like", None],
        "ratings": [Mapping, "array-like", None],
        "levels": ["array-like", None],
        "sampling_rates": [Mapping, Real, None],
        "limits": [Mapping, "array-like", None],
    },
    prefer_skip_nested_validation=True,
)
def describe_corpus(
    corpus: Bunch | Trials | Sequence[Mapping[str, ArrayLike]],
    *,
    objects: ArrayLike | None = None,
    procedures: ArrayLike | None = None,
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
    corpus : Bunch, DataFrame, list of dict, or collection of trials
        What `load_phac2` or `make_haptic_corpus` returns; or trials: a DataFrame with
        one row per trial and a column of arrays per sensor, a list with a dict of
        arrays per trial, or the trials of one sensor, as a list or a 3-D array.
    objects : array-like of shape (n_trials,), default=None
        The object of each trial; by default those of the corpus.
    procedures : array-like of shape (n_trials,), default=None
        The exploratory procedure of each trial. By default those before the names of
        the sensors, as in ``"hold_pac"``, if there are any.
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

        summary : str
            How much there is, in a sentence.
        sensors : DataFrame
            One row per sensor, or column of trials: ``n_trials`` that have it and
            ``n_missing_trials`` that have not; ``n_channels``; ``rate`` in samples per
            second; ``shortest``, ``median`` and ``longest``, the time samples of a
            trial; ``n_samples``, of all trials and channels; ``n_missing_samples``,
            which are NaN, infinite or masked. Of ``saturated``, ``dead`` and
            ``constant``, the first counts the channels of single trials that reach
            ``limits``, NaN if these are not given; the second those that are constant
            in the trial, but not in nine trials of ten; the third the channels that no
            trial moves.
        objects : DataFrame or None
            One row per object: its ``name`` if known, and the number of its trials, of
            each procedure or in the column ``trials``. None without objects.
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
    >>> print(description.summary)
    12 trials of 6 objects, 2 of each; 2 sensors; ratings on 10 adjectives.
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
    columns = _columns(given)
    n_trials = len(next(iter(columns.values())))
    if objects is None:
        objects = given.get("objects")
    if objects is not None:
        check_consistent_length(objects, np.empty(n_trials))
        objects = check_objects(objects, row="trial")
    if sampling_rates is None:
        of_corpus = given.get("sampling_rates", {})
        sampling_rates = {name: of_corpus.get(name) for name in columns}
    rates = _by_sensor(sampling_rates, columns, "sampling_rates")
    for rate in rates.values():
        if rate is not None and (not isinstance(rate, Real) or rate <= 0):
            raise ValueError(
                f"sampling_rates has {rate!r}; give samples per second, a number above "
                "0."
            )
    ranges = _by_sensor(limits, columns, "limits")
    found = {
        name: _look_at(column, name, ranges[name]) for name, column in columns.items()
    }
    sensors = pd.DataFrame(
        [{"rate": rates[name], **_sensor_row(*found[name])} for name in columns],
        index=pd.Index(list(columns), dtype=object),
    ).astype({"rate": float})
    there = {name: found[name][0] > 0 for name in columns}
    table = _objects(
        objects, given.get("object_names"), _procedures(procedures, there, n_trials)
    )
    if ratings is None:
        ratings = given.get("ratings")
    if levels is None:
        levels = given.get("levels")
    rated = describe_ratings(ratings, objects, levels, n_trials)
    return _Corpus(
        summary=_summary(n_trials, table, sensors, rated["ratings"]),
        sensors=sensors,
        objects=table,
        **rated,
    )


def _columns(given):
    """Return the trials of each sensor by name."""
    if "trials" not in given:
        raise ValueError(
            f"corpus is a {type(given).__name__} without 'trials'; give what "
            "load_phac2 returns, or trials."
        )
    trials = given["trials"]
    if isinstance(trials, str) or not hasattr(trials, "__len__") or len(trials) == 0:
        raise ValueError(
            "corpus holds no trials; give a DataFrame or a list with one entry per "
            "trial."
        )
    if is_frame(trials):
        columns = trial_columns(trials)
        if not columns:
            raise ValueError(
                f"corpus has the columns {list(trials.columns)}, none of which holds "
                "arrays; give one array per trial and sensor."
            )
        return columns
    dicts = [isinstance(trial, Mapping) for trial in trials if isinstance(trials, list)]
    if any(dicts):
        if not all(dicts):
            raise ValueError(
                f"corpus has no dict in trial {dicts.index(False)}; give one per "
                "trial, empty where nothing was recorded."
            )
        names = dict.fromkeys(name for trial in trials for name in trial)
        return {name: [trial.get(name) for trial in trials] for name in names}
    return {ALONE: trials}


def _by_sensor(option, columns, name):
    """Return the value of an option for each sensor, None where it has none."""
    if not isinstance(option, Mapping):
        return dict.fromkeys(columns, option)
    unknown = [key for key in option if key not in columns]
    if unknown:
        raise ValueError(
            f"{name} names the sensor {unknown[0]!r}, which is none of "
            f"{list(columns)}; name sensors of the corpus."
        )
    return {key: option.get(key) for key in columns}


def _look_at(column, name, limits):
    """Look at the trials of a sensor, chunk by chunk.

    Returns
    -------
    n_times : ndarray of shape (n_trials,)
        0 where the sensor is missing.
    n_missing : ndarray of shape (n_recorded,)
        Samples of all channels of each trial that has the sensor.
    varies, unknown, beyond : ndarray of bool of shape (n_recorded, n_channels)
        Whether the samples of a channel differ, are all missing, and reach `limits`;
        the last is None without these.
    """
    pair = np.asarray((-1, 1) if limits is None else limits)
    if pair.shape != (2,) or pair.dtype.kind not in "iuf" or not pair[0] < pair[1]:
        raise ValueError(
            f"limits={limits!r} must be the lowest and the highest value of the sensor."
        )
    n_times, chunks, trials, size = [], [], [], 0
    for trial, _ in iter_cells(column, name):
        n_times.append(0 if trial is None else len(trial))
        if trial is not None:
            trials.append(trial)
            size += trial.size
        if size > _CHUNK:
            chunks.append(_channels(trials, limits))
            trials, size = [], 0
    if trials or not chunks:
        chunks.append(_channels(trials, limits))
    parts = [None if part[0] is None else np.concatenate(part) for part in zip(*chunks)]
    return np.array(n_times), *parts


def _channels(trials, limits):
    """Return of trials of any lengths what `_look_at` does, but n_times."""
    if not trials:
        none = np.empty((0, 0), dtype=bool)
        return np.empty(0, dtype=int), none, none, none
    starts = np.cumsum([0, *map(len, trials[:-1])])
    samples = np.concatenate(trials)
    n_missing = np.add.reduceat(np.isnan(samples), starts, dtype=int).sum(axis=1)
    low, high = np.fmin.reduceat(samples, starts), np.fmax.reduceat(samples, starts)
    beyond = None if limits is None else (low <= limits[0]) | (high >= limits[1])
    return n_missing, high > low, np.isnan(low), beyond


def _sensor_row(n_times, n_missing, varies, unknown, beyond):
    """Return a row of the table of sensors, but its rate."""
    recorded = n_times[n_times > 0]
    n_trials, n_channels = varies.shape
    shortest, median, longest = (
        np.quantile(recorded, [0, 0.5, 1]) if n_trials else [np.nan] * 3
    )
    usual = varies.mean(axis=0) >= USUAL if n_trials else varies.any(axis=0)
    dead = (usual & ~varies & (recorded > 1)[:, None]) | unknown
    return {
        "n_trials": n_trials,
        "n_missing_trials": len(n_times) - n_trials,
        "n_channels": n_channels,
        "shortest": shortest,
        "median": median,
        "longest": longest,
        "n_samples": int(recorded.sum()) * n_channels,
        "n_missing_samples": int(n_missing.sum()),
        "saturated": np.nan if beyond is None else float(beyond.sum()),
        "dead": int(dead.sum()),
        "constant": int((~varies.any(axis=0)).sum()),
    }


def _procedures(procedures, there, n_trials):
    """Return which trials have each procedure, as a dict of masks."""
    if procedures is not None:
        check_consistent_length(procedures, np.empty(n_trials))
        procedures = check_objects(procedures, name="procedures", row="trial")
        return {each: procedures == each for each in np.unique(procedures).tolist()}
    masks: dict[str, np.ndarray] = {}
    for name, mask in there.items():
        procedure, _ = _split(name)
        if procedure:
            masks[procedure] = masks.get(procedure, False) | mask
    return masks


def _split(name):
    """Split the name of a column into a procedure, or "", and a sensor."""
    for procedure in PROCEDURES:
        if str(name).startswith(f"{procedure}_"):
            return procedure, name.removeprefix(f"{procedure}_")
    return "", name


def _objects(objects, names, procedures):
    """Return the table of objects, None if these are not known."""
    if objects is None:
        return None
    ids, first, which = np.unique(objects, return_index=True, return_inverse=True)
    columns = {}
    if names is not None:
        check_consistent_length(names, objects)
        columns["name"] = np.asarray(names)[first]
    columns["trials"] = np.bincount(which)
    for name, mask in procedures.items():
        columns[name] = np.bincount(which[mask], minlength=len(ids))
    return pd.DataFrame(columns, index=pd.Index(ids, name="object"))


def _summary(n_trials, objects, sensors, ratings):
    parts = [count(n_trials, "trials")]
    if objects is not None:
        fewest, most = objects["trials"].min(), objects["trials"].max()
        each = f"{fewest}" if fewest == most else f"{fewest} to {most}"
        parts[0] += f" of {count(len(objects), 'objects')}"
        parts[0] += f", {each} of each" * (len(objects) < n_trials)
    procedures, names = map(set, zip(*map(_split, sensors.index)))
    parts.append(count(len(names), "sensors"))
    if len(procedures) > 1:
        parts[-1] += f" in {count(len(procedures), 'procedures')}"
    if ratings is not None:
        parts.append(f"ratings on {count(len(ratings), 'adjectives')}")
    return "; ".join(parts) + "."


def _sensor_table(sensors):
    """Return the table of sensors as it is shown."""
    shown = sensors.copy()
    shown["duration"] = [
        _range(np.array(samples), rate)
        for *samples, rate in sensors[["shortest", "median", "longest", "rate"]].values
    ]
    n_samples = sensors["n_samples"].where(sensors["n_samples"] > 0)
    shown["missing"] = sensors["n_missing_samples"] / n_samples
    for column in ("dead", "saturated"):
        shown[column] /= sensors["n_trials"] * sensors["n_channels"]
    texts = {
        "n_trials": ("trials", "{:,}".format),
        "n_missing_trials": ("without it", "{:,}".format),
        "n_channels": ("channels", "{:,}".format),
        "rate": ("samples per s", "{:,.6g}".format),
        "duration": ("duration", str),
        "missing": ("samples missing", _share),
        "dead": ("channels dead", _share),
        "saturated": ("channels saturated", _share),
        "constant": ("channels never moved", "{:,}".format),
    }
    hints = []
    for column, hint in (
        ("rate", "Durations in seconds are not known without sampling_rates=."),
        ("saturated", "Which channels are saturated is not known without limits=."),
    ):
        if shown[column].isna().all():
            hints.append(hint)
            del texts[column]
    return Table("Recordings", as_texts(shown, texts), note=" ".join(hints))


def _range(n_times, rate):
    """Write a median duration and, in brackets, the shortest and the longest."""
    values, unit = (n_times, "samples") if np.isnan(rate) else (n_times / rate, "s")
    low, middle, high = map("{:,.4g}".format, values)
    if np.isnan(values[0]):
        return None
    return f"{middle} {unit}" + f" ({low}–{high})" * (low != high)


def _share(value):
    """Write a share, so that what is rare does not look like what never happens."""
    if 0 < value < 5e-5:
        return "<0.01%"
    return "0" if value == 0 else f"{100 * value:.2f}%"


def _object_table(objects):
    """Return the objects with the fewest trials as they are shown."""
    caption = "Trials of each object"
    if len(objects) > _MOST_ROWS:
        caption = f"The {_MOST_ROWS} of {len(objects)} objects with the fewest trials"
    fewest = objects.sort_values("trials", kind="stable").head(_MOST_ROWS)
    return Table(caption, fewest.astype(str))


def _rating_table(ratings, shares, rated):
    """Return the ratings as they are shown, with the shares of people tinted."""
    table = ratings.copy()
    table["people"] = [
        f"{most:.6g}" if fewest == most else f"{fewest:.6g}–{most:.6g}"
        for fewest, most in zip(ratings["fewest"], ratings["most"])
    ]
    texts = {
        "n_rated": (f"{rated}s rated", "{:,}".format),
        "people": (f"people per {rated}", str),
        "agreement": ("agreement, median", "{:.2f}".format),
        "least_agreement": ("least", "{:.2f}".format),
    }
    shares = shares.rename(
        columns=lambda level: (
            f"chose {level:.15g}" if isinstance(level, Real) else f"chose {level}"
        )
    )
    texts |= {column: (column, "{:.0%}".format) for column in shares}
    return Table(
        "Ratings",
        as_texts(table.join(shares), texts),
        shares,
        "Agreement (r_wg) is 1 where all people chose the same rating, and 0 where "
        "they might as well have drawn lots.",
    )
