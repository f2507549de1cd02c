"""Square roots of features of either sign."""

import numpy as np


def signed_root(features):
    """Take the square root of each magnitude and keep the sign.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._roots import signed_root
    >>> signed_root(np.array([4.0, 0.0, -9.0]))
    array([ 2.,  0., -3.])
    """
    return np.sign(features) * np.sqrt(np.abs(features))
