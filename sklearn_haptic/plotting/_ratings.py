"""Ratings of all objects, agreement of people, and correlation of adjectives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Self, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import Bunch
from sklearn.utils.validation import check_consistent_length

from ..ratings import adjective_correlation, interrater_agreement
from ..ratings._checks import check_counts, check_two_ratings
from ..utils._row_order import check_order
from ..utils._validation import check_objects
from ._display import Axes, Display
from ._style import BLUE

Counts: TypeAlias = Mapping[str, ArrayLike] | ArrayLike

_BAR_LENGTH, _BAR_HEIGHT = 0.9, 0.85  # adjectives and objects are 1 apart


@dataclass(eq=False, repr=False)
class RatingsDisplay(Display):
    """Ratings of every object on every adjective, as stacked bars.

    Use :meth:`from_counts` to create a display. There is one row per object and
    one column per adjective. The length of each part of a bar is proportional to the
    number of people who chose the level; higher levels are darker.

    Parameters
    ----------
    counts : dict of str to ndarray of shape (n_objects, n_levels)
        For each adjective, how many people gave each object each rating.
    objects : sequence of str of length n_objects
        Labels of the objects.
    levels : ndarray of shape (n_levels,)
        The ordered levels.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the bars.
    figure_ : matplotlib Figure
    bars_ : list of matplotlib BarContainer
        The parts of all bars, one container per level, adjective by adjective.

    References
    ----------
    Richardson and Kuchenbecker (2020), figure 4. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.plotting import RatingsDisplay
    >>> display = RatingsDisplay.from_counts(
    ...     {"hard": [[8, 4, 0], [0, 3, 9]], "soft": [[1, 2, 9], [10, 2, 0]]},
    ...     objects=["foam", "tile"],
    ... )
    >>> [label.get_text() for label in display.ax_.get_yticklabels()]
    ['foam', 'tile']
    """

    counts: dict[str, NDArray[np.float64]]
    _: KW_ONLY
    objects: Sequence[str]
    levels: np.ndarray

    @classmethod
    def from_counts(
        cls,
        counts: Counts,
        *,
        objects: ArrayLike | None = None,
        levels: ArrayLike | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Plot how many people gave each object each rating.

        Parameters
        ----------
        counts : dict of str to array-like of shape (n_rows, n_levels), or array-like
            For each adjective, how many people chose each level, like
            ``corpus.ratings``; or the counts of one adjective.
        objects : array-like of shape (n_rows,), default=None
            The object of each row, in words or numbers. Rows of one object, such as
            its trials, must be equal; they are drawn once, at the object's first
            place. By default each row is an object.
        levels : array-like of shape (n_levels,), default=None
            The ordered levels; by default the labels of the columns, else 1, 2, ….
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure, whose height depends on
            the number of objects.

        Returns
        -------
        display : RatingsDisplay

        Raises
        ------
        ValueError
            If counts are negative, not finite or all zero in a row, the tables differ
            in shape, or rows of one object differ.
        """
        tables, labels, levels = _counts_of_objects(counts, objects, levels)
        return cls(tables, objects=labels, levels=levels).plot(ax)

    def _figsize(self):
        return 6.4, 1.5 + 0.13 * len(self.objects)

    def _draw(self, ax):
        names, n_objects = [*self.counts], len(self.objects)
        tables = np.stack([*self.counts.values()])
        most = tables.sum(axis=2).max()
        self.bars_ = self._draw_bars(ax, _BAR_LENGTH * tables / most)
        ax.set(
            xlabel=f"number of responses (a full bar is {most:g})",
            ylabel="object",
            xlim=(-0.55, len(names) - 0.45),
            ylim=(n_objects - 0.4, -0.6),
        )
        ax.set_yticks(range(n_objects), labels=self.objects)
        ax.set_xticks(range(len(names)), labels=names)
        ax.tick_params(
            length=0, labelsize="x-small", labelbottom=False, labeltop=True, pad=2
        )
        ax.spines[:].set_visible(False)
        ax.legend(
            title="rating",
            loc="upper center",
            bbox_to_anchor=(0.5, 0),
            borderaxespad=2.5,  # below the label of the axis
            ncols=len(self.levels),
            frameon=False,
            fontsize="small",
        )

    def _draw_bars(self, ax, lengths):
        """Draw the parts of all bars: lengths are (adjectives, objects, levels)."""
        from matplotlib import colormaps

        n_adjectives, n_objects, n_levels = lengths.shape
        left = np.arange(n_adjectives)[:, None, None] - _BAR_LENGTH / 2
        starts = left + np.cumsum(lengths, axis=2) - lengths
        colours = colormaps["YlGnBu"](np.linspace(0.12, 1, n_levels))
        return [
            ax.barh(
                np.tile(np.arange(n_objects), n_adjectives),
                lengths[..., level].ravel(),
                left=starts[..., level].ravel(),
                height=_BAR_HEIGHT,
                color=colour,
                label=str(name),
            )
            for level, (name, colour) in enumerate(
                zip(self.levels, colours, strict=True)
            )
        ]


@dataclass(eq=False, repr=False)
class InterraterAgreementDisplay(Display):
    """How far people agree on each adjective, as box plots over objects.

    Use :meth:`from_counts` to create a display. Each box plot shows r_wg over
    objects: the quartiles, whiskers up to 1.5 times their distance, and the objects
    beyond. The adjective with the highest median comes first. At the dotted line,
    ratings scatter as if drawn uniformly from the levels.

    Parameters
    ----------
    agreement : dict of str to ndarray of shape (n_objects,)
        Agreement r_wg on each object, for each adjective.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the box plots.
    figure_ : matplotlib Figure
    boxes_ : dict of str to list of matplotlib artists
        What :meth:`matplotlib.axes.Axes.boxplot` returned.
    zero_line_ : matplotlib Line2D
        The line of no agreement.

    See Also
    --------
    sklearn_haptic.ratings.interrater_agreement : The numbers.

    References
    ----------
    Richardson and Kuchenbecker (2020), figure 9. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.plotting import InterraterAgreementDisplay
    >>> display = InterraterAgreementDisplay.from_counts(
    ...     {"soft": [[4, 4, 4], [6, 2, 4]], "hard": [[8, 4, 0], [0, 3, 9]]}
    ... )
    >>> [label.get_text() for label in display.ax_.get_xticklabels()]
    ['hard', 'soft']
    """

    agreement: dict[str, NDArray[np.float64]]

    @classmethod
    def from_counts(
        cls,
        counts: Counts,
        *,
        objects: ArrayLike | None = None,
        ax: Axes | None = None,
    ) -> Self:
        """Compute and plot the agreement of the people who rated each object.

        Parameters
        ----------
        counts : dict of str to array-like of shape (n_rows, n_levels), or array-like
            For each adjective, how many people chose each level, like
            ``corpus.ratings``; or the counts of one adjective.
        objects : array-like of shape (n_rows,), default=None
            The object of each row. Rows of one object, such as its trials, must be
            equal and count once. By default each row is an object.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : InterraterAgreementDisplay

        Raises
        ------
        ValueError
            If an object has fewer than two ratings, counts are negative or not finite,
            the tables differ in shape, or rows of one object differ.
        """
        tables, _, _ = _counts_of_objects(counts, objects, None)
        for name, table in tables.items():
            check_two_ratings(table, _called(name, counts))
        agreement = {name: interrater_agreement(t) for name, t in tables.items()}
        by_median = sorted(agreement, key=lambda name: -np.median(agreement[name]))
        return cls({name: agreement[name] for name in by_median}).plot(ax)

    def _draw(self, ax):
        self.boxes_ = ax.boxplot(
            [*self.agreement.values()],
            tick_labels=[*self.agreement],
            widths=0.6,
            patch_artist=True,
            boxprops={"facecolor": BLUE, "alpha": 0.45},
            medianprops={"color": "black", "linewidth": 1.8},
            flierprops={"marker": "o", "markersize": 3},
        )
        self.zero_line_ = ax.axhline(
            0,
            color="black",
            linewidth=0.9,
            linestyle=":",
            zorder=1,
            label="as if at random",
        )
        n_objects = len(next(iter(self.agreement.values())))
        ax.set(
            xlabel=f"adjective ({n_objects} objects each)",
            ylabel="interrater agreement $r_{wg}$ (1: all agree)",
        )
        ax.set_ylim(top=1.05)
        if len(self.agreement) > 6:
            ax.tick_params(axis="x", labelrotation=45)
        ax.legend(loc="lower right", bbox_to_anchor=(1, 1), frameon=False)


@dataclass(eq=False, repr=False)
class AdjectiveCorrelationDisplay(Display):
    """Rank correlation of the ratings of every pair of adjectives, as a matrix.

    Use :meth:`from_ratings` to create a display. Synonyms and antonyms are framed
    and bold; correlations that are not significant are grey.

    Parameters
    ----------
    correlation : Bunch
        What :func:`~sklearn_haptic.ratings.adjective_correlation` returned.
    significance : float, default=0.05
        The level of significance used for it.
    threshold : float, default=0.5
        The least strength of synonyms and antonyms used for it.
    corrected : bool, default=True
        Whether p-values are corrected for the number of pairs, after Holm.

    Attributes
    ----------
    ax_ : matplotlib Axes
        Axes with the matrix.
    figure_ : matplotlib Figure
    image_ : matplotlib AxesImage
        The matrix below its diagonal.
    colorbar_ : matplotlib Colorbar
        The scale of colours.
    texts_ : list of matplotlib Text
        The correlations, row by row.
    frames_ : list of matplotlib Rectangle
        Frames of synonyms and antonyms, row by row.

    See Also
    --------
    sklearn_haptic.ratings.adjective_correlation : The numbers.

    References
    ----------
    Richardson and Kuchenbecker (2020), figure 10. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> from sklearn_haptic.plotting import AdjectiveCorrelationDisplay
    >>> display = AdjectiveCorrelationDisplay.from_ratings(
    ...     [[1, 5, 2], [2, 4, 2], [4, 2, 1], [5, 1, 2], [3, 2, 4]]
    ... )
    >>> [text.get_text() for text in display.texts_]
    ['−.97', '−.22', '.00']
    """

    correlation: Bunch
    _: KW_ONLY
    significance: float = 0.05
    threshold: float = 0.5
    corrected: bool = True

    @classmethod
    def from_ratings(
        cls,
        ratings: ArrayLike,
        *,
        significance: float = 0.05,
        threshold: float = 0.5,
        corrected: bool = True,
        ax: Axes | None = None,
    ) -> Self:
        """Correlate the ratings of all pairs of adjectives and plot the matrix.

        Parameters
        ----------
        ratings : array-like of shape (n_ratings, n_adjectives)
            One row per person and object, one column per adjective, like
            ``corpus.rater_ratings``; missing ratings are None, NaN or NA.
        significance : float, default=0.05
            Level of significance.
        threshold : float, default=0.5
            Least strength of synonyms and antonyms.
        corrected : bool, default=True
            Whether to correct p-values for the number of pairs, after Holm. The paper
            does not.
        ax : matplotlib Axes, default=None
            Axes to plot on; by default those of a new figure.

        Returns
        -------
        display : AdjectiveCorrelationDisplay

        Raises
        ------
        ValueError
            If the ratings have no correlations; see
            :func:`~sklearn_haptic.ratings.adjective_correlation`.
        """
        correlation = adjective_correlation(
            ratings, significance=significance, threshold=threshold
        )
        return cls(
            correlation,
            significance=significance,
            threshold=threshold,
            corrected=corrected,
        ).plot(ax)

    def _figsize(self):
        return 6.4, 5.2

    def _draw(self, ax):
        from matplotlib.patches import Rectangle

        names = [*map(str, self.correlation.rho)]
        # Rows from the second adjective, columns to the last but one.
        n = len(names) - 1
        below = np.tri(n, dtype=bool)
        self.image_ = ax.imshow(
            np.ma.array(self.correlation.rho.iloc[1:, :-1], mask=~below),
            cmap="RdBu_r",
            vmin=-1,
            vmax=1,
            aspect="auto",
        )
        self.colorbar_ = self.figure_.colorbar(
            self.image_, ax=ax, label="Spearman's ρ", shrink=0.8
        )
        self.texts_, self.frames_ = [], []
        for row, column in np.argwhere(below):
            self._write(ax, row, column)
        ax.set_xticks(range(n), labels=names[:-1], rotation=45, ha="right")
        ax.set_yticks(range(n), labels=names[1:])
        ax.tick_params(length=0)
        ax.spines[:].set_visible(False)
        ax.legend(
            [
                Rectangle((0, 0), 1, 1, fill=False, linewidth=1.6),
                Rectangle((0, 0), 1, 1, color="0.5"),
            ],
            [
                f"synonyms, antonyms:\n|ρ| ≥ {self.threshold:g}, "
                f"p ≤ {self.significance:g}{' (Holm)' * self.corrected}",
                f"not significant: p > {self.significance:g}",
            ],
            loc="lower right" if n == 1 else "upper right",  # in empty cells, or above
            bbox_to_anchor=(1, 1),
            frameon=False,
            fontsize="small",
        )

    def _write(self, ax, row, column):
        """Write the correlation of one cell, and frame it if its pair is related."""
        from matplotlib.patches import Rectangle

        pair = row + 1, column
        rho = self.correlation.rho.iat[pair]
        pvalues = "pvalue_holm" if self.corrected else "pvalue"
        significant = self.correlation[pvalues].iat[pair] <= self.significance
        related = significant and abs(rho) >= self.threshold
        if related:
            frame = Rectangle(
                (column - 0.47, row - 0.47), 0.94, 0.94, fill=False, linewidth=1.6
            )
            self.frames_.append(ax.add_patch(frame))
        text = ax.text(
            column,
            row,
            _correlation(rho),
            color=_ink(self.image_.to_rgba(rho)) if significant else "0.5",
            weight="bold" if related else "normal",
            fontsize="small",
            ha="center",
            va="center",
        )
        self.texts_.append(text)


def _counts_of_objects(
    counts: Counts, objects: ArrayLike | None, levels: ArrayLike | None
) -> tuple[dict[str, NDArray[np.float64]], list[str], np.ndarray]:
    """Return the counts per adjective, one row per object, its labels and levels."""
    given = counts if isinstance(counts, Mapping) else {"ratings": counts}
    if not given:
        raise ValueError("counts is of no adjective; give the counts of one or more.")
    checked = {
        name: check_counts(table, levels, name=_called(name, counts))
        for name, table in given.items()
    }
    tables = {name: table for name, (table, _) in checked.items()}
    first_name, (first_table, levels_of_all) = next(iter(checked.items()))
    check_order(given[first_name], objects, "objects", _called(first_name, counts))
    for name, (table, its_levels) in checked.items():
        called, called_first = _called(name, counts), _called(first_name, counts)
        check_order(given[first_name], given[name], called, called_first)
        same_levels = its_levels.tolist() == levels_of_all.tolist()
        other_rows = objects is None and _other_rows(given[first_name], given[name])
        if not same_levels or table.shape != first_table.shape or other_rows:
            raise ValueError(
                f"{called} has other rows or levels than {called_first}; give the same "
                "for each."
            )
    if objects is None:
        return tables, [*map(str, range(len(first_table)))], levels_of_all
    objects = check_objects(objects)
    check_consistent_length(first_table, objects)
    _, first, which = np.unique(objects, return_index=True, return_inverse=True)
    for name, table in tables.items():
        differs = (table != table[first][which]).any(axis=1)
        if differs.any():
            row = int(np.argmax(differs))
            raise ValueError(
                f"{_called(name, counts)} has other counts in row {row} than in "
                f"another of the object {objects[row].item()!r}; give all its rows the "
                "same."
            )
    rows = np.sort(first)
    labels = [*map(str, objects[rows])]
    return {name: table[rows] for name, table in tables.items()}, labels, levels_of_all


def _other_rows(first, table):
    """Whether two tables name other rows than each other."""
    named = [getattr(each, "index", None) for each in (first, table)]
    known = all(isinstance(index, pd.Index) for index in named)
    numbered = any(isinstance(index, pd.RangeIndex) for index in named)
    return known and not numbered and {*named[0]} != {*named[1]}


def _called(adjective, counts):
    """Return what messages call the counts of an adjective, which may be all counts."""
    return f"counts[{adjective!r}]" if isinstance(counts, Mapping) else "counts"


def _correlation(rho):
    """Write a correlation without the 0 before its point."""
    return f"{rho:z.2f}".replace("0.", ".").replace("-", "−")


def _ink(background):
    """Black or white, whichever is better to read on a colour."""
    luminance = np.dot(background[:3], [0.2126, 0.7152, 0.0722])
    return "white" if luminance < 0.5 else "black"
