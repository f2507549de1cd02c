"""Earth mover's distance of distributions."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..ratings._checks import check_distributions
from ..ratings._distributions import cdf
from ..ratings._levels import level_values
from ._score import UNITS, as_score, summarise


@as_score(units=UNITS)
def earth_movers_distance(
    y_true: ArrayLike,
    y_proba: ArrayLike,
    *,
    sample_weight: ArrayLike | None = None,
    average: bool = True,
    levels: ArrayLike | None = None,
    units: Literal["levels", "scale"] = "levels",
) -> float | NDArray[np.float64]:
    r"""Earth mover's distance between predicted and true distribution.

    Parameters
    ----------
    y_true : array-like of shape (n_trials, n_levels) or (n_trials,)
    y_proba : array-like of shape (n_trials, n_levels)
    sample_weight : array-like of shape (n_trials,), default=None
    average : bool, default=True
    levels : array-like of shape (n_levels,), default=None
    units : {"levels", "scale"}, default="levels"
        All six are those of :func:`macro_mae`.

    Returns
    -------
    score : float or ndarray of shape (n_trials,)
        Distance in levels, from 0 (best) to n_levels - 1; or in units of the scale.

    Raises
    ------
    ValueError
        If a row of ``y_proba`` is not a distribution, a trial has no ratings or
        unknown ones, or the shapes differ.

    Notes
    -----
    The distance is the probability to be moved, times the levels by which it moves.
    On a line this is the area between the CDFs,
    :math:`\sum_{k=1}^{K-1} |\hat F_k - F_k|`, and that between the inverse CDFs (the
    Wasserstein-1 distance).

    References
    ----------
    Y. Rubner, C. Tomasi and L. J. Guibas, "The earth mover's distance as a metric
    for image retrieval", International Journal of Computer Vision 40, 99–121,
    2000. :doi:`10.1023/A:1026543900054`

    Examples
    --------
    >>> from sklearn_haptic.metrics import earth_movers_distance
    >>> earth_movers_distance([[0, 0, 4]], [[0.25, 0.25, 0.5]])
    0.75
    """
    counts, proba, levels = check_distributions(y_true, y_proba, levels)
    gaps = np.diff(level_values(levels, units))
    scores = (np.abs(cdf(proba) - cdf(counts))[:, :-1] * gaps).sum(axis=1)
    return summarise(scores, sample_weight, average)
