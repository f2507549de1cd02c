"""Repair of what is wrong with real recordings, with a record of what was done."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral
from typing import Any, Self

import numpy as np
import pandas as pd
from scipy.sparse import issparse
from sklearn.base import BaseEstimator, OneToOneFeatureMixin, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from ..utils._sklearn import Interval, Trials, _fit_context, _wrap_data_with_container
from ..utils._validation import check_table, is_missing
from ._faults import repair_trial, usual_trials
from ._trials import (
    ALONE,
    cells_of,
    channel_names,
    check_trials,
    has_time_index,
    is_table,
    trial_columns,
)

_COLUMNS = ["trial", "sensor", "channel", "fault", "n_samples", "answer", "offset"]


def stamps_of(cell):
    """Return the time stamps of a trial, if it has any that ascend."""
    ascend = has_time_index(cell) and cell.index.is_monotonic_increasing
    return cell.index if ascend else None


def _with_columns(X, columns):
    """Return a copy of a data frame with other trials in some columns."""
    X = X.copy()
    for name, cells in columns.items():
        X[name] = pd.Series(cells, X.index, dtype=object)
    return X


def as_given(trial, cell, shape, names):
    """Return a repaired trial in the shape of its samples, with the stamps it had."""
    trial = trial.reshape(-1, *shape)
    if has_time_index(cell) and len(cell) == len(trial):
        return pd.DataFrame(trial, cell.index, names)
    return trial


def _all_missing(X):
    """Whether every entry of a collection is None, NaN or NA; a table has rows."""
    sized = hasattr(X, "__len__") and not issparse(X)
    return sized and len(X) > 0 and all(map(is_missing, X))


def lengths_of(cells):
    """Return the samples of each trial by sensor, NaN where one is missing."""
    return pd.DataFrame(
        {
            name: [np.nan if cell is None else len(cell) for cell in each]
            for name, each in cells.items()
        }
    )


def paces_of(lengths):
    """Return how many samples each sensor usually has for one of each other.

    Parameters
    ----------
    lengths : DataFrame of shape (n_trials, n_sensors)
        Of :func:`lengths_of`.

    Returns
    -------
    paces : ndarray of shape (n_sensors, n_sensors)

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_haptic.recordings._repair import paces_of
    >>> paces_of(pd.DataFrame({"pac": [220.0, 440.0], "pdc": [10.0, 20.0]}))[0]
    array([ 1., 22.])
    """
    return np.array([lengths.rdiv(lengths[s], axis=0).median() for s in lengths])


def read_faulty(column, name, shape=None, names=None):
    """Return trials as arrays of shape (n_times, n_channels), None if nothing is known.

    With them, return the shape of a time sample and the names of the channels.
    """
    names = channel_names(column) if names is None else names
    trials = check_trials(
        column,
        name="X" if name == ALONE else f"X[{name!r}]",
        ndims=(2, 3),
        n_channels=shape,
        names=names,
        missing=True,
        finite=False,
    )
    there = [trial for trial in trials if trial is not None]
    shape = there[0].shape[1:] if there and shape is None else shape
    cells = [
        None
        if trial is None or np.isnan(trial).all()
        else trial.reshape(len(trial), -1)
        for trial in trials
    ]
    return cells, (shape, names)


def by_sensor(option, sensors, name):
    """Return the value of an option for each sensor, None where it has none."""
    if not isinstance(option, Mapping):
        return dict.fromkeys(sensors, option)
    unknown = [key for key in option if key not in sensors]
    if unknown:
        raise ValueError(
            f"{name} names the sensor {unknown[0]!r}, which is none of {[*sensors]}."
        )
    return {key: option.get(key) for key in sensors}


def check_limits(limits):
    """Return the lowest and the highest value of a sensor, None if not given.

    They are those of single precision if these are nearer to each other, because a
    recording may have been of it.
    """
    ends = np.asarray((-1, 1) if limits is None else limits)
    if ends.shape != (2,) or ends.dtype.kind not in "iuf" or not ends[0] < ends[1]:
        raise ValueError(
            f"limits={limits!r} must be the lowest and the highest value of the sensor."
        )
    if limits is None:
        return None
    with np.errstate(over="ignore"):
        low, high = ends.astype(np.float32).tolist()
    return max(ends[0].item(), low), min(ends[1].item(), high)


def _refuse_filled(cells, where):
    """Refuse trials that NaN has made equally long, which is no fault of a sensor."""
    cells = [cell for cell in cells if cell is not None]
    n_times = len(cells[0])
    if any(len(cell) != n_times for cell in cells):
        return
    missing = [np.isnan(cell[::-1]).all(axis=1).argmin() for cell in cells]
    if min(missing) < max(missing) and np.median(missing) > 0.05 * n_times:
        raise ValueError(
            f"{where} has trials of one length, most of which end in NaN, as if filled "
            "up; give a list of trials, each cut after its last sample."
        )


def _check_rest(rest):
    if rest is not None and (not isinstance(rest, Integral) or rest < 1):
        raise ValueError(f"rest={rest!r} must be a number of samples, at least 1.")
    return rest


class TrialRepair:
    """What :class:`RepairTrials` does; it adds the parameters and `set_output`."""

    limits: Any
    rest: Any

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: Trials, y: None = None) -> Self:
        """Learn what the trials are like, and report their faults.

        Parameters
        ----------
        X : DataFrame with columns of trials, collection of trials, or array-like of \
                shape (n_trials, n_times)
            Trials.
        y : None
            Ignored.

        Returns
        -------
        self : RepairTrials
            The fitted transformer.

        Raises
        ------
        ValueError
            If `limits` or `rest` cannot be, name a sensor that `X` has not, or no
            trial has a sensor; if NaN fills trials up to one length.
        """
        takes_trials = not is_table(X) or _all_missing(X)
        if takes_trials:
            read = {name: read_faulty(c, name) for name, c in trial_columns(X).items()}
        else:
            read = {ALONE: (self._rows(X, reset=True), ((1,), None))}
        limits = by_sensor(self.limits, read, "limits")
        rest = by_sensor(self.rest, read, "rest")
        settings, usual = {}, {}
        for name, (cells, samples) in read.items():
            where = "X" if name == ALONE else f"X[{name!r}]"
            if all(cell is None for cell in cells):
                raise ValueError(f"{where} holds no samples at all; leave it out.")
            _refuse_filled(cells, where)
            settings[name] = check_limits(limits[name]), _check_rest(rest[name])
            usual[name] = usual_trials(cells, samples, *settings[name])
        if takes_trials:
            vars(self).pop("feature_names_in_", None)
            if hasattr(X, "columns"):
                self.feature_names_in_ = np.asarray(X.columns, dtype=object)
                self.n_features_in_ = len(self.feature_names_in_)
            else:
                self.n_features_in_ = len(usual[ALONE].mean)
        self.takes_trials_, self._settings, self._usual = takes_trials, settings, usual
        self._paces = paces_of(lengths_of({name: read[name][0] for name in read}))
        self._faults = self._rows_of_faults(X)
        return self

    # That of TransformerMixin would make a table of trials, by `set_output`.
    def fit_transform(self, X: Trials, y: None = None) -> Any:
        """Learn what the trials are like, and repair them.

        Parameters
        ----------
        X, y
            As for `fit`.

        Returns
        -------
        repaired : DataFrame, Series, list of ndarray, or ndarray
            As of `transform`.
        """
        return self.fit(X).transform(X)

    def transform(self, X: Trials) -> Any:
        """Repair trials.

        Parameters
        ----------
        X : DataFrame with columns of trials, collection of trials, or array-like of \
                shape (n_trials, n_times)
            Trials of the sensors seen in `fit`.

        Returns
        -------
        repaired : DataFrame, Series, list of ndarray, or ndarray
            A DataFrame or Series if `X` is one, with the same index, an array for a
            table, and a list for other collections of trials. `set_output` changes
            nothing but that of a table.

        Raises
        ------
        ValueError
            If a sensor or a channel seen in `fit` is absent.
        """
        check_is_fitted(self)
        if not self.takes_trials_:
            rows = [trial.ravel() for trial, _ in self._repair(X)[ALONE]]
            return _wrap_data_with_container("transform", np.array(rows), X, self)
        given = trial_columns(X, list(self._usual))
        repaired = {
            name: [
                as_given(trial, cell, *self._usual[name].samples)
                for (trial, _), cell in zip(pairs, cells_of(given[name]))
            ]
            for name, pairs in self._repair(X).items()
        }
        if hasattr(X, "columns"):
            return _with_columns(X, repaired)
        if isinstance(X, pd.Series):
            return pd.Series(repaired[ALONE], X.index, dtype=object, name=X.name)
        return repaired[ALONE]

    def faults(self, X: Trials) -> pd.DataFrame:
        """Report what `transform` repairs.

        Parameters
        ----------
        X
            As for `transform`.

        Returns
        -------
        faults : pandas.DataFrame
            One row per trial, channel and fault, with the columns "trial" (its
            position), "sensor" ("" for the trials of one sensor), "channel" (its
            number, or "all"), "fault", "n_samples" (of this trial, as it came; 0 where
            the sensor is missing), "answer" and "offset" (what was subtracted from the
            channel, NaN for other faults).
        """
        check_is_fitted(self)
        return pd.DataFrame(self._rows_of_faults(X), columns=_COLUMNS)

    @property
    def faults_(self) -> pd.DataFrame:
        """The faults of the trials of `fit`."""
        check_is_fitted(self)
        return pd.DataFrame(self._faults, columns=_COLUMNS)

    def _rows_of_faults(self, X):
        return [
            (i, name, *fault)
            for name, pairs in self._repair(X).items()
            for i, (_, faults) in enumerate(pairs)
            for fault in faults
        ]

    def _repair(self, X):
        """Return the repaired trials of each sensor with their faults."""
        if self.takes_trials_:
            columns = trial_columns(X, list(self._usual))
            cells = {
                name: read_faulty(column, name, *self._usual[name].samples)[0]
                for name, column in columns.items()
            }
            stamps = {name: map(stamps_of, cells_of(c)) for name, c in columns.items()}
        else:
            cells = {ALONE: self._rows(X)}
            stamps = {ALONE: [None] * len(cells[ALONE])}
        lengths, repaired = lengths_of(cells), {}
        for (name, each), paces in zip(cells.items(), self._paces):
            usual, settings = self._usual[name], self._settings[name]
            expected = (lengths * paces).median(axis=1)
            repaired[name] = [
                repair_trial(cell, usual, *settings, length, at)
                for cell, length, at in zip(each, expected, stamps[name])
            ]
        return repaired

    def _rows(self, X, *, reset=False):
        """Validate a table, whose rows are trials with one channel."""
        X = check_table(
            self,
            X,
            dtype=[np.float64, np.float32],
            reset=reset,
            ensure_all_finite="allow-nan",
        )
        return [None if np.isnan(row).all() else row[:, np.newaxis] for row in X]

    def __sklearn_is_fitted__(self):
        return hasattr(self, "_usual")

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        tags.input_tags.allow_nan = True
        return tags


class RepairTrials(TrialRepair, OneToOneFeatureMixin, TransformerMixin, BaseEstimator):
    """Repair what is wrong with real recordings, and report every repair.

    The transformers of features refuse recordings with missing values. As the first
    step of a Pipeline, this one repairs them before:

    ===============  ===============================  ================================
    fault            found                            answer
    ===============  ===============================  ================================
    missing samples  NaN, infinite or masked          interpolated in time, channel by
                                                      channel
    dropped frames   NaN in all channels at a time    interpolated in time
    saturated        at or beyond `limits`            kept at the limit, the nearest
                                                      value that is known
    dead             no sample in the trial or, if    estimated from the other channels
                     `rest` is given, at rest; or     by linear regression
                     constant throughout it within
                     `limits`, for longer than in
                     nine trials of ten
    dead sensor      all channels are dead, or        the most typical trial of `fit`
                     constant as they often are
    missing sensor   None, NaN or no samples in       the most typical trial of `fit`
                     place of the trial
    rest level       `rest` is given                  the median of the first `rest`
                                                      samples is subtracted
    ===============  ===============================  ================================

    Parameters
    ----------
    limits : tuple of float (low, high) or mapping of str to tuple, default=None
        Lowest and highest value that the sensor can give, or those of each sensor by
        name. By default no sample counts as saturated.
    rest : int or mapping of str to int, default=None
        Number of samples at the begin of every trial in which nothing is touched, or
        those of each sensor by name. By default the level is left as it is.

    Attributes
    ----------
    faults_ : pandas.DataFrame
        The faults of the trials of `fit`, see `faults`.
    takes_trials_ : bool
        Whether trials were fitted; else a table.
    n_features_in_ : int
        Number of columns of a DataFrame or table, of channels of other trials.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the columns of a DataFrame.

    See Also
    --------
    resample_trials : Resample by time stamps, which shows the frames that were dropped.

    Notes
    -----
    `X` may be a DataFrame of trials with one column per sensor, of which columns
    without trials stay as they are, the trials of one sensor, or a table, each row of
    which is a trial with one channel. Trials keep their container, and those of pandas
    with an index of time stamps keep it. To leave faulty trials out instead, take those
    that have no row in `faults_` but of their rest level.

    What is estimated is learned from the trials of `fit` alone, and of each channel
    from those in which it works; no trial needs to be whole. A channel without a sample
    in all of them is 0. No more than repairs the faults is changed: a trial without
    faults comes out as it went in.

    The most typical trial is cut, or held at its end, to be as long as the touch: that
    of a missing sensor by the samples that the others have, in the usual proportion.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import RepairTrials
    >>> force = np.arange(5.0)
    >>> trials = [np.column_stack([force, 2 * force + i]) for i in range(9)]
    >>> trials.append(np.array([[0, 9], [1, 9], [np.nan, 9], [3, 9]]))
    >>> repair = RepairTrials().fit(trials)
    >>> repair.faults_[["trial", "channel", "fault", "answer"]]
       trial  channel            fault                             answer
    0      9        0  missing samples                       interpolated
    1      9        1             dead  estimated from the other channels
    >>> repair.transform(trials)[9]
    array([[ 0.,  4.],
           [ 1.,  6.],
           [ 2.,  8.],
           [ 3., 10.]])
    """

    _parameter_constraints = {  # noqa: RUF012
        "limits": ["array-like", Mapping, None],
        "rest": [Interval(Integral, 1, None, closed="left"), Mapping, None],
    }

    def __init__(
        self,
        *,
        limits: tuple[float, float] | Mapping[str, tuple[float, float]] | None = None,
        rest: int | Mapping[str, int] | None = None,
    ) -> None:
        self.limits = limits
        self.rest = rest
