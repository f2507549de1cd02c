"""The samples of a sensor as they arrive: mended, coded, and kept while needed.

The cells of a prefix depend on its length, but the durations are known in advance, and
so are the edges of all of their cells. Between two neighbouring edges only the maxima,
sums or numbers of non-zero values of every column have to be kept. Memory is bounded by
the durations, and an update costs the same at any time.
"""

import numpy as np
import pandas as pd

from ..features import KSVDTransformer
from ..features._pooling import cell_bounds, signed_root
from ._branches import as_rows
from ._recorded_touches import Touches

# Windows that wait to be coded together, which takes little longer than one by itself.
_TOGETHER = 64


class MendedSamples:
    """Keep saturated samples at their limit, and mend those that are not finite.

    The last finite one of the channel stands for these. Samples before the first of a
    channel wait for it.

    Parameters
    ----------
    shape : tuple of int
        Shape of one sample.
    low, high : float
        Values at or beyond these limits are saturated.
    limit : int
        Most samples that wait; a channel without a finite one among them is dead.

    Attributes
    ----------
    n_ignored : int
        Number of samples of which some value was saturated or not finite.
    """

    def __init__(self, shape, low, high, limit):
        self._low, self._high, self._limit = low, high, limit
        self._waiting = np.empty((0, *shape))
        self._last = np.full((1, *shape), np.nan)
        self.n_ignored = 0

    def mend(self, samples):
        """Return the samples that are finite or mended by now."""
        if len(samples) == 0:
            return samples
        good = (samples > self._low) & (samples < self._high)  # false for NaN
        if good.all() and not len(self._waiting):
            self._last = samples[-1:].copy()
            return samples
        flat = good.reshape(len(good), -1)
        self.n_ignored += int(len(good) - flat.all(axis=1).sum())
        kept = samples.clip(self._low, self._high)
        samples = np.where(np.isfinite(samples), kept, np.nan)
        before = self._last.astype(samples.dtype)
        samples = np.concatenate([self._waiting.astype(samples.dtype), samples])
        known = np.concatenate([before, samples])
        table = pd.DataFrame(known.reshape(len(known), -1))
        if table.isna().all().any():
            self._waiting = samples[: self._limit]
            return samples[:0]
        mended = table.ffill().bfill().to_numpy(copy=True).reshape(known.shape)
        self._last, self._waiting = mended[-1:].copy(), samples[:0]
        return mended[1:]


class KeptSamples:
    """Keep the samples of the longest duration, for steps that need all of them.

    Parameters
    ----------
    shape : tuple of int
        Shape of one sample.
    limit : int
        How many samples to keep.
    """

    def __init__(self, shape, limit):
        self._samples, self._n = np.zeros((limit, *shape)), 0

    def add(self, samples):
        """Keep samples; those of single precision are kept and computed in it."""
        if len(samples) == 0:
            return
        dtype = np.result_type(self._samples, samples) if self._n else samples.dtype
        self._samples = self._samples.astype(dtype, copy=False)
        end = min(self._n + len(samples), len(self._samples))
        self._samples[self._n : end] = samples[: end - self._n]
        self._n = end

    def first(self, n):
        """Return the first n samples, or what there is of them."""
        return self._samples[: min(n, self._n)]


class PooledCodes:
    """Code windows and keep what is pooled of them between the edges of cells.

    Parameters
    ----------
    coder : KSVDTransformer or STHMPTransformer
        Fitted to trials.
    pool : TemporalMaxPool
        Fitted to the codes.
    shape : tuple of int
        Shape of one sample.
    needed : sequence of int
        Number of samples of each duration, ascending.
    """

    def __init__(self, coder, pool, shape, needed):
        self._coder = coder
        self._window = self._step = 1
        if isinstance(coder, KSVDTransformer):
            self._window, self._step = coder.components_.shape[1], coder.window_step_
        self._needed = needed
        self._n, self._n_rows = 0, 0
        self._rest = np.empty((0, *shape))
        rows = [(n - self._window) // self._step + 1 for n in needed]
        bounds = [
            [np.concatenate(ends) for ends in zip(*self._cells(pool, n))]
            if n > 0
            else None
            for n in rows
        ]
        edges = [each for pair in bounds if pair is not None for each in pair]
        self._edges = np.unique(np.concatenate(edges)) if edges else np.zeros(1, int)
        self._spans = [
            None if pair is None else np.searchsorted(self._edges, pair).T
            for pair in bounds
        ]
        self._root = pool.root_
        shape = len(self._edges), pool.n_features_in_
        self._kept = {
            name: np.full(shape, -np.inf if name == "max" else 0.0)
            for name in pool.statistics_
        }

    @staticmethod
    def _cells(pool, n_rows):
        return [cell_bounds(n_rows, n, pool.split_) for n in pool.cells_]

    def add(self, samples):
        """Take samples; code windows some at a time and when a duration is complete."""
        samples = samples[: max(0, self._needed[-1] - self._n)]
        if len(samples) == 0:  # whose type must not become that of samples that wait
            return
        n_complete = np.searchsorted(self._needed, self._n, side="right")
        self._n += len(samples)
        at_end = n_complete < np.searchsorted(self._needed, self._n, side="right")
        if len(self._rest):
            samples = np.concatenate([self._rest, samples])
        self._rest = samples.copy()
        if at_end or self._n_complete() >= _TOGETHER:
            self._code()

    def _n_complete(self):
        """Return the number of windows that wait to be coded."""
        return max(0, (len(self._rest) - self._window) // self._step + 1)

    def _code(self):
        n_windows = self._n_complete()
        if n_windows:
            used = (n_windows - 1) * self._step + self._window
            self._keep(self._coder.transform([self._rest[:used]])[0])
            self._rest = self._rest[n_windows * self._step :].copy()

    def _keep(self, codes):
        rows = np.arange(self._n_rows, self._n_rows + len(codes))
        self._n_rows += len(codes)
        segment = np.searchsorted(self._edges, rows, side="right") - 1
        first = np.flatnonzero(np.diff(segment, prepend=-1))
        here = segment[first]
        for name, kept in self._kept.items():
            join = np.maximum if name == "max" else np.add
            values = codes != 0 if name == "share" else codes
            new = join.reduceat(values, first, axis=0, dtype=kept.dtype)
            kept[here] = join(kept[here], new)

    def pooled(self, k):
        """Return the features of the k-th duration, of shape (1, n_features)."""
        cells = []
        for name, kept in self._kept.items():
            for start, end in self._spans[k]:
                if name == "max":
                    cells.append(kept[start:end].max(axis=0))
                else:
                    n_rows = self._edges[end] - self._edges[start]
                    cells.append(kept[start:end].sum(axis=0) / n_rows)
        features = np.concatenate(cells)[np.newaxis]
        return signed_root(features) if self._root else features


class FeltSamples:
    """What has been felt of one touch, in the place of recorded :class:`Touches`.

    Parameters
    ----------
    branches : list of Branch
        What codes the samples.
    shapes : dict of str to tuple of int
        Shape of one sample of each sensor.
    needed : dict of str to ndarray of int
        Number of samples of each duration, ascending.
    limits : dict of str to tuple of float (low, high) or None
        Values at which each sensor is saturated.
    """

    def __init__(self, branches, shapes, needed, limits):
        self._branches, self._needed = branches, needed
        self._n_samples, self._n_arrived = (
            dict.fromkeys(shapes, 0),
            dict.fromkeys(shapes, 0),
        )
        self.menders, self._kept, self._pools = {}, {}, {}
        for sensor, shape in shapes.items():
            low, high = limits[sensor] or (-np.inf, np.inf)
            mender = MendedSamples(shape, low, high, needed[sensor][-1])
            self.menders[sensor] = mender
        for i, branch in enumerate(branches):
            steps = branch.incremental()
            for s in shapes if branch.repairs else branch.sensors:
                if steps is None:
                    self._kept[s] = KeptSamples(shapes[s], needed[s][-1])
                else:
                    pool = PooledCodes(steps[0], steps[1], shapes[s], needed[s])
                    self._pools[i] = pool

    def add(self, samples, sensor):
        """Mend, code and keep new samples of a sensor."""
        self._n_arrived[sensor] += len(samples)
        samples = self.menders[sensor].mend(samples)
        self._n_samples[sensor] += len(samples)
        for i, pool in self._pools.items():
            if self._branches[i].sensors == [sensor]:
                pool.add(samples)
        if sensor in self._kept:
            self._kept[sensor].add(samples)

    def all_arrived(self):
        """Whether as many samples came as the longest duration has, good or not."""
        return all(n >= self._needed[s][-1] for s, n in self._n_arrived.items())

    def lengths(self):
        """Return the number of samples, of shape (1, n_sensors)."""
        return np.array([[*self._n_samples.values()]])

    def features(self, i, k, n_samples):
        """Return the features of a branch at the k-th duration, (1, n_features)."""
        if i not in self._pools:
            kept = {s: [kept.first(n_samples[s])] for s, kept in self._kept.items()}
            which = np.array([0])
            return self._branches[i].transform(Touches(kept), which, n_samples)
        features = self._pools[i].pooled(k)
        for step in self._branches[i].incremental()[2]:
            features = as_rows(step.transform(features))
        return features
