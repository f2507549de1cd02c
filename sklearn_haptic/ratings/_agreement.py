"""Agreement of the people who rated an object."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._checks import check_counts, check_two_ratings


def interrater_agreement(counts: ArrayLike) -> NDArray[np.float64]:
    r"""Agreement r_wg of the people who rated each object.

    Parameters
    ----------
    counts : array-like of shape (n_objects, n_levels)
        How many people chose each level, two or more people per object. Levels
        count as equally far apart.

    Returns
    -------
    r_wg : ndarray of shape (n_objects,)
        1 where all chose the same level, 0 where the ratings scatter as if drawn
        uniformly from the levels, negative where they scatter more. Negative
        values are kept.

    Raises
    ------
    ValueError
        If an object has fewer than two ratings, rows are shares of people, or the
        counts are negative or not finite.

    Notes
    -----
    With the sample variance :math:`S_X^2` of an object's ratings (divisor
    :math:`N - 1`, so that uniformly random ratings average to zero) and
    :math:`A` levels,

    .. math:: r_{wg} = 1 - \frac{S_X^2}{(A^2 - 1) / 12}.

    References
    ----------
    L. R. James, R. G. Demaree and G. Wolf, "Estimating within-group interrater
    reliability with and without response bias", Journal of Applied Psychology
    69(1), 85–98, 1984. :doi:`10.1037/0021-9010.69.1.85`

    T. A. O'Neill, "An overview of interrater agreement on Likert scales for
    researchers and practitioners", Frontiers in Psychology 8, 2017.
    :doi:`10.3389/fpsyg.2017.00777`

    Examples
    --------
    >>> from sklearn_haptic.ratings import interrater_agreement
    >>> interrater_agreement([[0, 0, 12, 0, 0], [6, 0, 0, 0, 6]]).round(3)
    array([ 1.   , -1.182])
    """
    counts, _ = check_counts(counts)
    check_two_ratings(counts, "counts")
    levels = np.arange(1, counts.shape[1] + 1)
    n_ratings = counts.sum(axis=1)
    deviation = levels - (counts @ levels / n_ratings)[:, None]
    variance = (counts * deviation**2).sum(axis=1) / (n_ratings - 1)
    return 1 - variance / ((len(levels) ** 2 - 1) / 12)
