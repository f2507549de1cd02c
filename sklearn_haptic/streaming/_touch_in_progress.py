"""A touch in progress."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from ..recordings._trials import (
    ALONE,
    has_time_index,
    in_order,
    rate_of,
    seconds_of,
    without_na,
)
from ..utils._sklearn import one_blas_thread
from ..utils._validation import check_regular
from ._arriving_samples import FeltSamples
from ._recorded_touches import seconds_felt

# Stamps that tell a rate wherever samples among them were lost. Fewer are checked from
# the first duration on, as those of a recorded touch, but for so few that one lost
# sample would double the step.
_N_STAMPS, _FEWEST_STAMPS = 24, 4


class TouchInProgress:
    """A touch of which samples arrive bit by bit.

    It is made by :meth:`sklearn_haptic.AnytimeRegressor.start`.

    What it predicts is what the model predicts for the samples so far, as one recorded
    touch. An update and a prediction cost the same at any time, and memory is bounded:
    of each window only what later durations need is kept, and nothing of what follows
    the longest duration.

    Attributes
    ----------
    seconds : float
        How much of the touch has been felt, in whole samples, by all sensors that are
        not left behind.
    ignored : dict of str to int
        Of each sensor, how many samples had values that are not finite or are at the
        limits. The last finite value of the channel stands for those that are not
        finite; the others are kept at the limit, as by `RepairTrials`. A sensor with a
        channel that has no finite value is missing.
    done : bool
        Whether to stop: the model's rule says so, or the longest duration is complete.

    Examples
    --------
    >>> from sklearn_haptic import AnytimeRegressor, make_haptic_pipeline
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> corpus = make_haptic_corpus(8, 2, sensors=["pdc", "tdc"], random_state=0)
    >>> model = AnytimeRegressor(
    ...     make_haptic_pipeline(["pdc", "tdc"], random_state=0),
    ...     durations=[0.5, 1, 2, 4],
    ...     sampling_rates=corpus.sampling_rates,
    ...     cv=2,
    ... ).fit(corpus.trials, corpus.ratings["hard"], groups=corpus.objects)
    >>> touch = model.start()
    >>> recorded = corpus.trials.iloc[0]
    >>> while not touch.done:
    ...     n = round(100 * touch.seconds)
    ...     new = {name: recorded[name][n : n + 10] for name in ["pdc", "tdc"]}
    ...     proba = touch.update(new).predict_proba()
    >>> touch.seconds
    4.0
    """

    def __init__(self, model: Any, limits: Mapping[str, Any]) -> None:
        self._model = model
        self._limits = limits
        self.reset()

    def reset(self) -> Self:
        """Forget all samples; the next ones begin a new touch, for the same model.

        After a refit of the model, `start` a touch instead.

        Returns
        -------
        touch : TouchInProgress
            This touch.
        """
        model = self._model
        needed = dict(zip(model.sensors_, model._needed.T))
        shapes = model.sample_shapes_
        self._felt = FeltSamples(model._branches, shapes, needed, self._limits)
        self._stamps: dict[str, Any] = {}
        self._known: dict[tuple[bool, ...], NDArray[np.float64]] = {}
        self._stopped: dict[bytes, bool] = {}
        return self

    @one_blas_thread
    def update(self, samples: Mapping[str, ArrayLike] | ArrayLike) -> Self:
        """Add new samples.

        Parameters
        ----------
        samples : dict of str to array-like of shape (n_new, n_channels)
            New samples of any of the sensors, in the order of time; how many they are
            may differ between sensors and calls. For a model of one sensor without
            name, an array. One sample may have the shape (n_channels,), and those of
            one channel the shape (n_new,). Give NaN for samples that were lost, since
            time is counted in samples.

        Returns
        -------
        touch : TouchInProgress
            This touch.

        Raises
        ------
        ValueError
            If a sensor is unknown, its samples have another shape than in `fit`, or an
            index of time stamps contradicts its rate. No sample of any sensor is added
            then.
        """
        sensors = self._model.sensors_
        if sensors == [ALONE]:
            samples = {ALONE: samples}
        elif not isinstance(samples, Mapping):
            raise ValueError(
                f"samples is a {type(samples).__name__}; give a dict from the names of "
                f"sensors, {sensors}, to arrays."
            )
        checked = {
            sensor: self._check_samples(new, sensor) for sensor, new in samples.items()
        }
        # Those before samples that are refused do not tell against later ones.
        stamps, self._stamps = self._stamps, {}
        self._stamps = stamps | {
            sensor: self._check_stamps(stamps.get(sensor, []), new, sensor)
            for sensor, new in samples.items()
        }
        for sensor, new in checked.items():
            self._felt.add(new, sensor)
        return self

    def _check_samples(self, samples, sensor):
        """Return samples as an array of floats of shape (n_new, ...)."""
        shapes = self._model.sample_shapes_
        if sensor not in shapes:
            raise ValueError(
                f"samples names the sensor {sensor!r}; the model has {list(shapes)}."
            )
        name = _name_of(sensor)
        if isinstance(samples, pd.Series) and samples.shape == shapes[sensor] != (1,):
            samples = samples.to_frame().T  # one sample, a row of a data frame
        names = self._model._channel_names[sensor]
        samples = in_order(samples, name, names, "the trials of fit")
        return _check_samples(without_na(samples), name, shapes[sensor])

    def _check_stamps(self, stamps, samples, sensor):
        """Check the rate by the stamps of so many samples; return those to check."""
        if not has_time_index(samples):
            return stamps
        stamps = samples.index if len(stamps) == 0 else stamps.append(samples.index)
        seconds_of(stamps, f"The index of {_name_of(sensor)}")
        place = self._model.sensors_.index(sensor)
        needed = np.clip(self._model._needed[0, place], _FEWEST_STAMPS, _N_STAMPS)
        if len(stamps) < needed:
            return stamps
        rate = self._model._rates[place]
        rate_of([pd.Series(0, stamps)], rate, name=_name_of(sensor))
        return stamps if len(stamps) < _N_STAMPS else stamps[-1:]

    @property
    def seconds(self) -> float:
        """How much of the touch has been felt."""
        model, lengths = self._model, self._felt.lengths()[0]
        return float(seconds_felt(lengths, model._rates, model._max_delay))

    @property
    def ignored(self) -> dict[str, int]:
        """How many samples of each sensor are not finite or at the limits."""
        return {s: each.n_ignored for s, each in self._felt.menders.items()}

    @property
    def done(self) -> bool:
        """Whether to stop touching."""
        # Samples that wait for a channel without a good value will never be felt.
        return self._rule_stops() or self._felt.all_arrived()

    def _rule_stops(self):
        """Whether the rule stops at a complete duration, by the samples there now."""
        n_complete = self._n_complete()
        there = (self._felt.lengths()[0] >= self._model._needed[:n_complete]).tobytes()
        if there not in self._stopped:
            path = [self._predict_at(k) for k in range(n_complete)]
            self._stopped[there] = any(
                self._model._stops(np.stack(path[: k + 1])[np.newaxis])[0]
                for k in range(n_complete)
            )
        return self._stopped[there]

    @one_blas_thread
    def predict_proba(self) -> NDArray[np.float64]:
        """Predict from the longest duration that is complete.

        Returns
        -------
        proba : ndarray of shape (n_levels,) or (n_adjectives, n_levels)
            The model's `shares_` before the first duration.
        """
        n_complete = self._n_complete()
        if n_complete == 0:
            return self._model.shares_.copy()
        return self._predict_at(n_complete - 1).copy()

    def _n_complete(self):
        return int(self._model._durations_reached(self._felt.lengths())[0])

    def _predict_at(self, k):
        """Predict from the k-th duration, once for each set of sensors that have it."""
        there = self._felt.lengths()[0] >= self._model._needed[k]
        if (k, *there) not in self._known:
            proba = self._model._predict_at(self._felt, np.array([0]), k)
            self._known[k, *there] = proba[0]
        return self._known[k, *there]


def _name_of(sensor):
    return f"samples[{sensor!r}]" if sensor else "samples"


def _check_samples(samples, name, shape):
    array = check_regular(samples, name)
    if array.dtype.kind not in "fiub":
        raise ValueError(
            f"{name} is not an array of numbers; convert it, or leave out a sensor "
            "that has no new samples."
        )
    if array.dtype != np.float32:
        array = array.astype(np.float64, copy=False)
    if array.size == 0:
        return np.empty((0, *shape))
    if array.shape == shape and shape != (1,):
        return array[np.newaxis]
    if array.ndim == 1 and shape == (1,):
        return array[:, np.newaxis]
    if array.shape[1:] != shape:
        raise ValueError(
            f"{name} has shape {array.shape}, but one sample had the shape {shape} in "
            "fit; give an array of shape (n_new, ...) of such samples."
        )
    return array
