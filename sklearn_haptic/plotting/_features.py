"""The atoms that transformers learn from recordings, and their codes of a trial."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from ..features import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from ..features._pooling import cell_bounds, signed_root
from ..utils._sklearn import FloatArray, Names, Trials
from ._display import Display
from ._signals import check_rate
from ._style import BLUE, label_blocks

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class AtomsDisplay(Display):
    """Atoms of a dictionary, as waveforms or as images of patches.

    Use :meth:`from_estimator` to create a display. All atoms share their limits.

    Parameters
    ----------
    atoms : ndarray of shape (n_atoms, n_times) or (n_atoms, height, width)
        Windows of a signal, or patches of an image, in the order of the panels.
    names : ndarray of int of shape (n_atoms,)
        The number of each atom in the dictionary.
    usage : ndarray of shape (n_atoms,), default=None
        Share of the codes in which each atom appears.
    sampling_rate : float, default=None
        Samples per second of windows.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes that hold the panels.
    axes_ : ndarray of matplotlib Axes of shape (n_atoms,)
        One panel per atom.
    figure_ : matplotlib Figure
    lines_ : list of matplotlib Line2D
        The atoms, if they are windows.
    images_ : list of matplotlib AxesImage
        The atoms, if they are patches.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import KSVDTransformer
    >>> from sklearn_haptic.plotting import AtomsDisplay
    >>> trials = list(np.random.default_rng(0).normal(size=(3, 200, 2)))
    >>> ksvd = KSVDTransformer(n_atoms=6, window=20, random_state=0).fit(trials)
    >>> display = AtomsDisplay.from_estimator(ksvd, trials, sampling_rate=100)
    >>> display.axes_[-1].get_xlabel()
    'time, ms'
    """

    def __init__(
        self,
        atoms: FloatArray,
        *,
        names: NDArray[np.integer],
        usage: NDArray[np.float64] | None = None,
        sampling_rate: float | None = None,
    ) -> None:
        self.atoms = atoms
        self.names = names
        self.usage = usage
        self.sampling_rate = sampling_rate

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        X: Trials | None = None,
        *,
        sampling_rate: float | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Plot the atoms of a fitted transformer.

        Parameters
        ----------
        estimator : KSVDTransformer, STHMPTransformer or Pipeline
            Fitted, or a fitted pipeline that begins with such a transformer.
        X : array-like of shape (n_samples, n_features) or collection of trials, \
                default=None
            Data to code, of the kind given to `fit`. The atoms are then sorted by the
            share of codes (of windows, or of spatial cells of frames) in which they
            appear, most used first. By default they stay in the dictionary's order.
        sampling_rate : float, default=None
            Samples per second. By default, and for patches, axes count samples.
        ax : matplotlib Axes, default=None
            Axes, made by ``subplots``, in which to lay out the panels; by default
            those of a new figure.

        Returns
        -------
        display : AtomsDisplay

        Raises
        ------
        ValueError
            If the estimator has no atoms, the sampling rate is not positive, or `X`
            does not fit the estimator.
        sklearn.exceptions.NotFittedError
            If the estimator is not fitted.
        """
        coder, _ = _coder_and_pool(estimator)
        if sampling_rate is not None:
            sampling_rate = check_rate(sampling_rate)
        atoms = coder.components_
        usage, order = None, np.arange(len(atoms))
        if X is not None:
            codes = coder.transform(X)
            usage = _usage(
                codes if coder.takes_trials_ else [codes],
                len(atoms),
                split=coder.get_feature_names_out()[0].endswith("+"),
            )
            order = np.argsort(-usage, kind="stable")
            usage = usage[order]
        if isinstance(coder, STHMPTransformer) and coder.takes_trials_:
            atoms = atoms.reshape(-1, *coder.patch_size_)
        return cls(
            atoms[order], names=order, usage=usage, sampling_rate=sampling_rate
        ).plot(ax)

    def _shape(self):
        """Return the number of rows and of columns of panels."""
        n_atoms = len(self.atoms)
        n_rows = -(-n_atoms // (8 if n_atoms > 10 else 5))
        return n_rows, -(-n_atoms // n_rows)

    def _figsize(self):
        n_rows, n_columns = self._shape()
        return 6.4, 1.0 + 0.95 * n_rows * (8 / n_columns) ** 0.5

    def _draw(self, ax):
        n_atoms, n_columns = len(self.atoms), self._shape()[1]
        panels = self._divide(self._shape(), sharex=True, sharey=True).ravel()
        self.axes_ = panels[:n_atoms]
        for panel in panels[n_atoms:]:
            panel.remove()
        shares = [""] * n_atoms
        if self.usage is not None:
            shares = [f": {share:.0%}" for share in self.usage]
            shares[0] = f":\n{self.usage[0]:.0%} of codes"
        first = ["atom "] + [""] * (n_atoms - 1)
        for panel, *title in zip(self.axes_, first, map(str, self.names), shares):
            panel.set_title("".join(title), fontsize="small", pad=3)
            panel.tick_params(labelsize="small")
        largest = np.abs(self.atoms).max() or 1
        if self.atoms.ndim == 2:
            self._plot_lines(n_columns, 1.05 * largest)
        else:
            self._plot_images(n_columns, largest)

    def _lowest_row(self, n_columns):
        return self.axes_[(len(self.axes_) - 1) // n_columns * n_columns :]

    def _plot_lines(self, n_columns, limit):
        time, label = np.arange(self.atoms.shape[1]), "sample"
        if self.sampling_rate is not None:
            time, label = 1000 * time / self.sampling_rate, "time, ms"
        self.lines_ = [
            panel.plot(time, atom, color=BLUE, linewidth=1.2)[0]
            for panel, atom in zip(self.axes_, self.atoms)
        ]
        for panel in self.axes_:
            panel.axhline(0, color="0.6", linewidth=0.6, zorder=0)
            panel.margins(x=0)
        self.axes_[0].set_ylim(-limit, limit)
        for panel in self._lowest_row(n_columns):
            panel.set_xlabel(label, fontsize="small")
        for panel in self.axes_[::n_columns]:
            panel.set_ylabel("atom\n(no unit)", fontsize="small")

    def _plot_images(self, n_columns, limit):
        self.images_ = [
            panel.imshow(atom, cmap="viridis", vmin=-limit, vmax=limit)
            for panel, atom in zip(self.axes_, self.atoms)
        ]
        height, width = self.atoms.shape[1:]
        self.axes_[0].set(xticks=range(width), yticks=range(height))
        for panel in self._lowest_row(n_columns):
            panel.set_xlabel("column", fontsize="small")
        for panel in self.axes_[::n_columns]:
            panel.set_ylabel("row of patch", fontsize="small")
        self.figure_.colorbar(
            self.images_[0],
            ax=list(self.axes_),
            label="atom (no unit)",
            fraction=0.04,
        )


class FeatureMapDisplay(Display):
    """Codes of a trial over time and, where these are pooled, their maxima.

    Use :meth:`from_estimator` to create a display. Rows are features: the atoms of one
    channel or spatial cell after the other; with split signs, the positive parts of all
    its atoms and then the negative parts. Below the codes is one panel per level of
    temporal pooling, whose cells lie at their times. Colours follow the square root of
    codes, since most codes are small beside the largest. Other statistics that the pool
    has, such as means, are named but not drawn.

    Parameters
    ----------
    codes : ndarray of shape (n_times, n_features)
        Codes of windows or frames.
    pooled : list of ndarray of shape (n_cells, n_features)
        Maxima over the temporal cells of each level; an empty list without pooling.
    edges : ndarray of shape (n_times + 1,)
        When each code begins and the last one ends, in seconds or samples.
    level_edges : list of ndarray of shape (n_cells + 1,)
        The same of the cells of each level.
    feature_names : sequence of str
        Name of each feature.
    time_unit : {"s", "samples"}
        Unit of the edges.
    code_unit : str
        Unit of the codes.
    not_shown : sequence of str, default=()
        What is pooled besides the maxima.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes that hold the panels.
    axes_ : ndarray of matplotlib Axes of shape (1 + n_levels,)
        The panels, top to bottom.
    figure_ : matplotlib Figure
    images_ : list of matplotlib QuadMesh
        The codes, then the maxima of each level, transposed.
    colorbar_ : matplotlib Colorbar
        Scale of all images.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_haptic import KSVDTransformer, TemporalMaxPool
    >>> from sklearn_haptic.plotting import FeatureMapDisplay
    >>> trials = list(np.random.default_rng(0).normal(size=(3, 200, 2)))
    >>> ksvd = KSVDTransformer(n_atoms=6, window=20, random_state=0)
    >>> pipeline = make_pipeline(ksvd, TemporalMaxPool((4, 1))).fit(trials)
    >>> display = FeatureMapDisplay.from_estimator(
    ...     pipeline, trials[0], sampling_rate=100
    ... )
    >>> [panel.get_title(loc="left") for panel in display.axes_]
    ['codes', 'maxima in 4 cells', 'maxima in 1 cell']
    """

    def __init__(
        self,
        codes: FloatArray,
        pooled: list[FloatArray],
        *,
        edges: NDArray[np.float64],
        level_edges: list[NDArray[np.float64]],
        feature_names: Names,
        time_unit: Literal["s", "samples"],
        code_unit: str,
        not_shown: Names = (),
    ) -> None:
        self.codes = codes
        self.pooled = pooled
        self.edges = edges
        self.level_edges = level_edges
        self.feature_names = feature_names
        self.time_unit = time_unit
        self.code_unit = code_unit
        self.not_shown = not_shown

    @classmethod
    def from_estimator(
        cls,
        estimator: BaseEstimator,
        trial: ArrayLike,
        *,
        sampling_rate: float | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Code a trial, pool its codes if the estimator does, and plot both.

        Parameters
        ----------
        estimator : KSVDTransformer, STHMPTransformer or Pipeline
            Fitted to trials: a transformer, or a pipeline of one and
            :class:`~sklearn_haptic.TemporalMaxPool`.
        trial : array-like of shape (n_times, n_channels) or (n_times, height, width)
            One recording.
        sampling_rate : float, default=None
            Samples per second; by default time is counted in samples.
        ax : matplotlib Axes, default=None
            Axes, made by ``subplots``, in which to lay out the panels; by default
            those of a new figure.

        Returns
        -------
        display : FeatureMapDisplay

        Raises
        ------
        ValueError
            If the estimator is another or was fitted to a table, the trial does not
            fit it, or the sampling rate is not positive.
        sklearn.exceptions.NotFittedError
            If the estimator is not fitted.
        """
        coder, pool = _coder_and_pool(estimator)
        if not coder.takes_trials_:
            raise ValueError(
                "estimator codes the rows of a table, which have no order in time; "
                "fit it to trials."
            )
        rate = 1.0 if sampling_rate is None else check_rate(sampling_rate)
        sequences = coder.transform([trial])
        codes = sequences[0]
        first, step, code_unit = 0.0, 1, "no unit; each frame has norm 1"
        if isinstance(coder, KSVDTransformer):
            step = coder.window_step_
            window = coder.components_.shape[1]
            first = (window - step) / 2  # so that codes lie at their windows
            code_unit = "unit of the signal × √samples"
        edges = (first + step * np.arange(len(codes) + 1)) / rate
        pooled, level_edges, not_shown = [], [], []
        if pool is not None:
            not_shown = [each for each in pool.statistics_ if each != "max"]
            maxima = TemporalMaxPool(pool.cells_, split=pool.split_)
            cells = maxima.fit_transform(sequences).reshape(-1, codes.shape[1])
            pooled = np.split(cells, np.cumsum(pool.cells_)[:-1])
            level_edges = [_cell_edges(edges, n, pool.split_) for n in pool.cells_]
        return cls(
            codes,
            pooled,
            edges=edges,
            level_edges=level_edges,
            feature_names=coder.get_feature_names_out(),
            time_unit="samples" if sampling_rate is None else "s",
            code_unit=code_unit,
            not_shown=not_shown,
        ).plot(ax)

    def _figsize(self):
        return 6.4, 3.6 + 1.3 * len(self.pooled)

    def _draw(self, ax):
        from matplotlib.colors import FuncNorm

        n_levels = len(self.pooled)
        ratios = [2.5] + [1] * n_levels
        panels = self._divide((1 + n_levels, 1), sharex=True, height_ratios=ratios)
        self.axes_ = panels.ravel()
        signed, largest = bool((self.codes < 0).any()), np.abs(self.codes).max() or 1
        scale = FuncNorm(
            (signed_root, _signed_square), vmin=-largest * signed, vmax=largest
        )
        self.images_ = [
            panel.pcolormesh(
                edges,
                np.arange(values.shape[1] + 1) - 0.5,
                values.T,
                cmap="viridis" if signed else "Blues",
                norm=scale,
                rasterized=True,
            )
            for panel, edges, values in zip(
                self.axes_,
                [self.edges, *self.level_edges],
                [self.codes, *self.pooled],
            )
        ]
        blocks = [name.partition("_atom")[0] for name in self.feature_names]
        for panel, room in zip(self.axes_, [14] + [4] * n_levels):
            panel.invert_yaxis()
            label_blocks(panel, blocks, room, "0.5")
            panel.tick_params(axis="y", labelsize="small")
        for panel, edges in zip(self.axes_[1:], self.level_edges):
            panel.vlines(
                edges[1:-1], 0, 1, transform=panel.get_xaxis_transform(), color="0.2"
            )
        titles = [f"maxima in {len(p)} cell{'s' * (len(p) > 1)}" for p in self.pooled]
        if titles and self.not_shown:
            titles[0] += f" (also pooled: {', '.join(self.not_shown)})"
        for panel, title in zip(self.axes_, ["codes", *titles]):
            panel.set_title(title, loc="left", fontsize="medium")
        self.axes_[-1].set_xlabel(f"time, {self.time_unit}")
        rows = "channel"
        if cell := re.search(r"s1of(\d+)$", blocks[0]):
            rows = f"spatial cell ({blocks[0]}: the first of {cell[1]})"
        self.axes_[0].set_ylabel(f"features: atoms of each\n{rows}")
        self.colorbar_ = self.figure_.colorbar(
            self.images_[0], ax=list(self.axes_), label=f"code ({self.code_unit})"
        )


def _cell_edges(edges, n_cells, split):
    """Return where the cells of a level begin and end, given the edges of samples."""
    if n_cells >= len(edges):  # more cells than samples, all of one length
        return np.linspace(edges[0], edges[-1], n_cells + 1)
    return edges[[*cell_bounds(len(edges) - 1, n_cells, split)[0], -1]]


def _signed_square(values):
    return np.sign(values) * np.square(values)


def _coder_and_pool(estimator):
    """Return a fitted transformer with atoms, and the pooling behind it or None."""
    steps = [estimator]
    if isinstance(estimator, Pipeline):
        steps = [
            step for _, step in estimator.steps if step not in (None, "passthrough")
        ]
    coder, *rest = steps or [None]
    pool = rest[0] if rest and isinstance(rest[0], TemporalMaxPool) else None
    if not isinstance(coder, KSVDTransformer | STHMPTransformer):
        raise ValueError(
            f"estimator is a {type(coder).__name__}, which has no atoms; give a fitted "
            "KSVDTransformer or STHMPTransformer, or a Pipeline that begins with one."
        )
    for step in (coder, pool):
        if step is not None:
            check_is_fitted(step)
    return coder, pool


def _usage(codes, n_atoms, *, split):
    """Return the share of codes, over all trials, that use each atom of either sign."""
    parts = [np.reshape(trial, (-1, 1 + split, n_atoms)) != 0 for trial in codes]
    return np.concatenate([part.any(axis=1) for part in parts]).mean(axis=0)
