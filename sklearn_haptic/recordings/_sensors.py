"""Descriptions of sensors, from which `make_haptic_pipeline` chooses transformers."""

from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, TypeAlias

import numpy as np

from ._biotac import SAMPLING_RATES

_LONGEST_WINDOW = 10  # samples of a window whose length is not given


@dataclass(frozen=True)
class Signal:
    """A sensor whose channels have no order in space, such as an accelerometer.

    Parameters
    ----------
    rate : float, default=None
        Samples per second in Hz. None, if it is not known, leaves out the codes of
        windows, and statistics of each channel remain, which need no rate.
    window : float, default=None
        Seconds of a window, about as long as the shortest event that matters. By
        default ten samples or half a second, whichever is shorter, but at least two: on
        recorded touches, ten predicted better than fifty.

    Raises
    ------
    ValueError
        If `rate` is no positive number, or `window` is shorter than two samples or
        given without a rate.

    See Also
    --------
    make_haptic_pipeline : Build a model of described sensors.

    Examples
    --------
    >>> from sklearn_haptic import Signal
    >>> Signal(rate=1000).n_samples, Signal(rate=12).n_samples
    (10, 6)
    >>> Signal(rate=2200, window=0.01).n_samples
    22
    """

    rate: float | None = None
    window: float | None = None

    def __post_init__(self) -> None:
        for name in ("rate", "window"):
            value = getattr(self, name)
            if value is None:
                continue
            if not (isinstance(value, Real) and 0 < float(value) < np.inf):
                unit = "samples per second" if name == "rate" else "seconds"
                raise ValueError(
                    f"{name}={value!r} must be a positive number of {unit}, or None."
                )
        if self.window is not None and (
            self.rate is None or round(self.rate * self.window) < 2
        ):
            raise ValueError(
                f"window={self.window!r} s must hold two samples or more at "
                f"rate={self.rate!r} Hz; lengthen it or give the rate."
            )

    @property
    def n_samples(self) -> int | None:
        """Samples of a window; None if the rate is not known."""
        if self.rate is None:
            return None
        if self.window is None:
            return min(_LONGEST_WINDOW, max(2, round(self.rate / 2)))
        return round(self.rate * self.window)


@dataclass(frozen=True)
class TaxelGrid:
    """A sensor whose channels form an image, such as a pressure array.

    No rate is needed: images are coded one by one, and the bands of the statistics are
    fractions of the rate, whatever it is.

    Parameters
    ----------
    layout : tuple of int (n_rows, n_columns), array-like of shape (n_rows, n_columns, \
            n_channels), "biotac" or None, default=None
        How the channels form the image. A tuple says that they come row by row. An
        array has the weight of each channel in each pixel: ``np.eye(16)[wiring]`` is
        that of 4 × 4 taxels if ``wiring[i, j]`` is the channel in row i and column j.
        "biotac" has the 19 electrodes of a BioTac. None takes trials that are images
        already, of shape (n_times, n_rows, n_columns).

    Raises
    ------
    ValueError
        If `layout` is none of these.

    See Also
    --------
    make_haptic_pipeline : Build a model of described sensors.

    Notes
    -----
    Several fingers or pads of the same layout stand one after the other in the channels
    of a trial, and their images side by side.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import TaxelGrid
    >>> TaxelGrid((4, 4)).weights.shape
    (4, 4, 16)
    >>> TaxelGrid(np.eye(4)[[[3, 2], [0, 1]]]).weights.argmax(axis=2)
    array([[3, 2],
           [0, 1]])
    """

    layout: Any = None

    def __post_init__(self) -> None:
        layout = self.layout
        if layout is None or (isinstance(layout, str) and layout == "biotac"):
            return
        fault = ValueError(
            f"layout={layout!r} must be (n_rows, n_columns), an array of weights of "
            "shape (n_rows, n_columns, n_channels), 'biotac', or None for images."
        )
        try:
            array = np.asarray(layout, dtype=np.float64)
        except (TypeError, ValueError):
            raise fault from None
        if array.shape == (2,):
            if not all(isinstance(n, Integral) and int(n) > 0 for n in layout):
                raise fault
            frozen: Any = tuple(int(n) for n in layout)
        elif array.ndim == 3 and array.size and np.isfinite(array).all():
            frozen = tuple(tuple(map(tuple, row)) for row in array.tolist())
        else:
            raise fault
        # Of tuples alone, so that descriptions can be compared and hashed.
        object.__setattr__(self, "layout", frozen)

    @property
    def weights(self) -> Any:
        """The layout as :class:`STHMPTransformer` takes it."""
        if self.layout is None or self.layout == "biotac":
            return self.layout
        layout = np.asarray(self.layout)
        if layout.ndim == 1:
            return np.eye(layout.prod()).reshape(*layout, -1)
        return layout


Sensor: TypeAlias = Signal | TaxelGrid

# The sensors of a BioTac, with the windows of the 2020 paper.
_WINDOWS = {"pac": 0.01, "pdc": 0.5, "tac": 0.5, "tdc": 0.5}
BIOTAC = {
    name: Signal(rate, _WINDOWS[name]) if name in _WINDOWS else TaxelGrid("biotac")
    for name, rate in SAMPLING_RATES.items()
}
