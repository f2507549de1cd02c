"""How much of a touch each sensor has felt, and which durations are complete.

Durations and the time felt are in seconds. A sensor has completed a duration when it
has as many samples as its rate gives in that time. A sensor that lags far behind the
others is missing: the touch goes on without it.
"""

import numpy as np

# Seconds, far below the time between two samples.
_ROUNDING = 1e-6


def samples_in(seconds, rate):
    """Return how many whole samples of a sensor there are in so many seconds.

    Examples
    --------
    >>> from sklearn_haptic.streaming._prefixes import samples_in
    >>> samples_in([0.25, 0.3], 22)
    array([5, 6])
    """
    return np.floor((np.asarray(seconds) + _ROUNDING) * rate).astype(np.intp)


def seconds_felt(seconds, max_delay):
    """Return the seconds of a touch that all sensors have that are not left behind.

    Parameters
    ----------
    seconds : ndarray of shape (..., n_sensors)
        What each sensor has recorded.
    max_delay : float
        A sensor more than so many seconds behind the furthest is left behind.

    Returns
    -------
    felt : ndarray of shape (...)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.streaming._prefixes import seconds_felt
    >>> seconds_felt(np.array([[2.0, 1.9], [2.0, 0.0]]), 0.5)
    array([1.9, 2. ])
    """
    return np.where(_left_behind(seconds, max_delay), np.inf, seconds).min(axis=-1)


def durations_complete(n_samples, rates, needed, max_delay):
    """Return how many durations all sensors have completed that are not left behind.

    Parameters
    ----------
    n_samples : ndarray of int of shape (..., n_sensors)
        What each sensor has recorded.
    rates : ndarray of shape (n_sensors,)
    needed : ndarray of int of shape (n_durations, n_sensors)
        Samples of each sensor in each duration, ascending.
    max_delay : float
        As in :func:`seconds_felt`.

    Returns
    -------
    n_complete : ndarray of int of shape (...)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.streaming._prefixes import durations_complete
    >>> needed = np.array([[5, 50], [11, 100]])
    >>> n_samples = np.array([[5, 50], [11, 99], [0, 100]])
    >>> durations_complete(n_samples, np.array([22, 200]), needed, 0.1)
    array([1, 1, 2])
    """
    complete = (n_samples[..., np.newaxis, :] >= needed).sum(axis=-2)
    left_behind = _left_behind(n_samples / rates, max_delay)
    return np.where(left_behind, len(needed), complete).min(axis=-1)


def _left_behind(seconds, max_delay):
    return seconds < seconds.max(axis=-1, keepdims=True) - max_delay - _ROUNDING
