"""The atoms that transformers learn from recordings."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from ..features import KSVDTransformer, STHMPTransformer
from ..utils._sklearn import FloatArray, Trials
from ._display import Axes, Display
from ._signals import check_rate
from ._style import BLUE


@dataclass(eq=False, repr=False)
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

    atoms: FloatArray
    _: KW_ONLY
    names: NDArray[np.integer]
    usage: NDArray[np.float64] | None = None
    sampling_rate: float | None = None

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
        coder = _coder(estimator)
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
        plot = self._plot_lines if self.atoms.ndim == 2 else self._plot_images
        xlabel, ylabel = plot(largest)
        lowest_row = (n_atoms - 1) // n_columns
        for panel in self.axes_[lowest_row * n_columns :]:
            panel.set_xlabel(xlabel, fontsize="small")
        for panel in self.axes_[::n_columns]:
            panel.set_ylabel(ylabel, fontsize="small")

    def _plot_lines(self, largest):
        """Draw the atoms; return the labels of the axes."""
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
        self.axes_[0].set_ylim(-1.05 * largest, 1.05 * largest)
        return label, "atom\n(no unit)"

    def _plot_images(self, largest):
        """Draw the atoms; return the labels of the axes."""
        self.images_ = [
            panel.imshow(atom, cmap="viridis", vmin=-largest, vmax=largest)
            for panel, atom in zip(self.axes_, self.atoms)
        ]
        height, width = self.atoms.shape[1:]
        self.axes_[0].set(xticks=range(width), yticks=range(height))
        self.figure_.colorbar(
            self.images_[0],
            ax=list(self.axes_),
            label="atom (no unit)",
            fraction=0.04,
        )
        return "column", "row of patch"


def _coder(estimator):
    """Return a fitted transformer with atoms, perhaps the first step of a pipeline."""
    steps = estimator.steps if isinstance(estimator, Pipeline) else [("", estimator)]
    coder = next((s for _, s in steps if s not in (None, "passthrough")), None)
    if not isinstance(coder, KSVDTransformer | STHMPTransformer):
        raise ValueError(
            f"estimator is a {type(coder).__name__}, which has no atoms; give a fitted "
            "KSVDTransformer or STHMPTransformer, or a Pipeline that begins with one."
        )
    check_is_fitted(coder)
    return coder


def _usage(codes, n_atoms, *, split):
    """Return the share of codes, over all trials, that use each atom of either sign."""
    parts = [np.reshape(trial, (-1, 1 + split, n_atoms)) != 0 for trial in codes]
    return np.concatenate([part.any(axis=1) for part in parts]).mean(axis=0)
