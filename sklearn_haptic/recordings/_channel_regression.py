"""Regression of channels on each other, learned where some are dead in some trials."""

import numpy as np

# Estimates of dead channels and of moments, in turn.
_MAX_ITER, _CONVERGED = 100, 1e-7
_RIDGE = 1e-8  # makes correlations of collinear channels invertible
_ROUNDING = 1e-12  # channels that vary less, relative to their level, are constant


def estimate_channels(trial, dead, mean, scale, correlation):
    """Estimate dead channels from the others, by linear regression.

    Parameters
    ----------
    trial : ndarray of shape (n_times, n_channels)
        A trial.
    dead : ndarray of bool of shape (n_channels,)
        The channels to estimate.
    mean, scale, correlation
        Of the samples of working channels, see :func:`estimate_moments`.

    Returns
    -------
    estimated : ndarray of shape (n_times, n_dead)
        The regression of each dead channel on all others.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.recordings._channel_regression import estimate_channels
    >>> trial, dead = np.array([[0.0, 3.0], [0.0, 5.0]]), np.array([True, False])
    >>> scale, correlation = np.array([2.0, 1.0]), np.ones((2, 2))
    >>> estimate_channels(trial, dead, np.ones(2), scale, correlation)
    array([[5.],
           [9.]])
    """
    live = ~dead
    among_live = correlation[np.ix_(live, live)]
    weights = np.linalg.pinv(among_live, rcond=1e-12, hermitian=True)
    weights = weights @ correlation[np.ix_(live, dead)]
    departure = (trial[:, live] - mean[live]) / np.where(scale > 0, scale, 1)[live]
    return departure @ weights * scale[dead] + mean[dead]


def estimate_moments(trials, dead):
    """Estimate the moments of channels that are dead in some trials.

    They are those of maximum likelihood for normal samples, found by the EM algorithm:
    dead channels are estimated from the others, and with them the moments, in turn.
    (Covariances of each pair of channels, over the trials in which both live, do not
    fit together if trials differ: their regression can be worse than none.)

    Parameters
    ----------
    trials : list of ndarray of shape (n_times_i, n_channels)
        Trials without NaN.
    dead : ndarray of bool of shape (n_trials, n_channels)
        The channels of each trial to leave out. One that is left out of all trials has
        the mean and scale 0.

    Returns
    -------
    mean, scale : ndarray of shape (n_channels,)
        The scale is the standard deviation.
    correlation : ndarray of shape (n_channels, n_channels)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.recordings._channel_regression import estimate_moments
    >>> trials = [np.array([[0.0, 1.0], [2.0, 5.0]]), np.array([[4.0, 0.0]])]
    >>> mean, *_ = estimate_moments(trials, np.array([[False, False], [False, True]]))
    >>> mean.round(5)  # the second is twice the first, plus one
    array([2., 5.])
    """
    n_times = np.array([len(trial) for trial in trials])
    n_alive = np.maximum(n_times @ ~dead, 1)
    pairs = list(zip(trials, dead))
    size = np.max([np.abs(t).max(axis=0) * ~gone for t, gone in pairs], axis=0)
    size = np.where(size > 0, size, 1).astype(np.float64)  # so that no square overflows
    mean = sum((t / size).sum(axis=0) * ~gone for t, gone in pairs) / n_alive
    squares = sum(np.square(t / size - mean).sum(axis=0) * ~gone for t, gone in pairs)
    scale = np.sqrt(squares / n_alive)
    varies = scale > _ROUNDING * np.abs(mean)
    scale[~varies] = 1
    units = [(t / size - mean) / scale * (varies & ~gone) for t, gone in pairs]
    shift, correlation = _maximise(units, dead)
    deviation = np.sqrt(correlation.diagonal()) * varies
    mean, scale = (mean + scale * varies * shift) * size, scale * deviation * size
    deviation[deviation == 0] = 1
    return mean, scale, correlation / np.outer(deviation, deviation)


def _maximise(units, dead):
    """Return the means and covariances of greatest likelihood, by the EM algorithm."""
    sums = []  # of the samples of all trials in which the same channels are dead
    for gone in np.unique(dead, axis=0):
        rows = np.vstack([units[i] for i in np.flatnonzero((dead == gone).all(axis=1))])
        sums.append((gone, len(rows), rows.sum(axis=0), rows.T @ rows))
    n_times, n_channels = sum(map(len, units)), dead.shape[1]
    shift, covariance = np.zeros(n_channels), np.eye(n_channels)
    for gone, n, total, products in sums:
        if n > n_channels and not gone.any():  # from which one dead channel is exact
            shift = total / n
            covariance = products / n - np.outer(shift, shift)
    for _ in range(_MAX_ITER):
        precision = np.linalg.inv(covariance + _RIDGE * np.eye(n_channels))
        filled = [_filled(*each, shift, precision) for each in sums]
        previous, shift = covariance, sum(total for total, _ in filled) / n_times
        covariance = sum(products for _, products in filled) / n_times
        covariance -= np.outer(shift, shift)
        if np.abs(covariance - previous).max() <= _CONVERGED:
            break
    return shift, covariance


def _filled(gone, n, total, products, shift, precision):
    """Return the sums and products of samples whose dead channels are estimated."""
    live, total, products = ~gone, total.copy(), products.copy()
    unsure = np.linalg.inv(precision[np.ix_(gone, gone)])
    weights = -precision[np.ix_(live, gone)] @ unsure
    rest = shift[gone] - shift[live] @ weights
    cross = products[np.ix_(live, live)] @ weights + np.outer(total[live], rest)
    total[gone] = total[live] @ weights + n * rest
    products[np.ix_(live, gone)], products[np.ix_(gone, live)] = cross, cross.T
    both = weights.T @ cross + np.outer(rest, total[gone]) + n * unsure
    products[np.ix_(gone, gone)] = both
    return total, products
