"""Cells of a pyramid: the parts into which each level divides time or space."""

import numpy as np


def cell_bounds(n_items, n_cells, split="balanced"):
    """Divide a line of items into cells; return where each begins and ends.

    Parameters
    ----------
    n_items : int
        Number of items, at least one.
    n_cells : int
        Number of cells.
    split : {"balanced", "floor"}, default="balanced"
        "balanced" cells differ by one item at most. With "floor" each has
        ``n_items // n_cells`` items and the last one also takes the remainder. With
        fewer items than cells, the cells overlap for either value: each has the item
        at its middle and the neighbours of that item.

    Returns
    -------
    starts, stops : ndarray of shape (n_cells,)
        Index of the first item of each cell, and one past the index of its last.

    Examples
    --------
    >>> from sklearn_haptic.features._pyramid_cells import cell_bounds
    >>> cell_bounds(11, 4)
    (array([0, 2, 5, 8]), array([ 2,  5,  8, 11]))
    >>> cell_bounds(11, 4, "floor")
    (array([0, 2, 4, 6]), array([ 2,  4,  6, 11]))
    >>> cell_bounds(3, 4)
    (array([0, 0, 0, 1]), array([2, 3, 3, 3]))
    """
    edges = np.arange(n_cells + 1)
    if n_items < n_cells:
        middle = (2 * edges[:-1] + 1) * n_items // (2 * n_cells)
        return np.maximum(middle - 1, 0), np.minimum(middle + 2, n_items)
    if split == "floor":
        edges *= n_items // n_cells
        edges[-1] = n_items
    else:
        edges = edges * n_items // n_cells
    return edges[:-1], edges[1:]


def check_cells(cells, name="cells"):
    """Return the levels of a pyramid as a tuple of distinct positive integers."""
    levels = np.asarray(cells)
    if (
        levels.ndim != 1
        or levels.dtype.kind not in "iu"
        or levels.min(initial=1) < 1
        or not 0 < len(levels) == len(np.unique(levels))
    ):
        raise ValueError(
            f"{name}={cells!r} must list distinct positive integers, one per level."
        )
    return tuple(levels.tolist())
