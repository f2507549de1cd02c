"""The BioTac finger, and the procedures by which a PR2 touched with two of them.

pac is the vibration of the fluid under the skin, pdc its pressure, tac the heat flow,
tdc the temperature, and the electrodes measure the deformation of the skin.
"""

from typing import Literal, TypeAlias, get_args

import numpy as np

from ..utils._validation import check_names

FRAME_RATE = 100  # frames per second
# Samples per frame and channels of each sensor of one finger.
SENSORS = {
    "pac": (22, 1),
    "pdc": (1, 1),
    "tac": (1, 1),
    "tdc": (1, 1),
    "electrodes": (1, 19),
}
SAMPLING_RATES = {name: n * FRAME_RATE for name, (n, _) in SENSORS.items()}

Procedure: TypeAlias = Literal["squeeze", "hold", "slow_slide", "fast_slide"]
PROCEDURES = get_args(Procedure)

# Where the electrodes are in mm, x towards the tip of the finger, y across it.
_X = [0.993, -2.7, -6.2, -8.0, -10.5, -13.4, 4.763, 3.031, 3.031, 1.299]
_Y = [-4.855, -3.513, -3.513, -4.956, -3.513, -4.956, 0.0, -1.95, 1.95, 0.0]
ELECTRODE_X = np.array([*_X, *_X[:6], -2.8, -9.8, -13.6])
ELECTRODE_Y = np.array([*_Y, *(-y for y in _Y[:6]), 0.0, 0.0, 0.0])

# The numbers of the electrodes whose mean is each pixel: rows from the tip of the
# finger to its base, columns left, middle and right.
_PIXELS = [
    [[8], [7], [9]],
    [[1], [10], [11]],
    [[2], [17], [12]],
    [[3], [2, 17, 12, 3, 13, 4, 14], [13]],
    [[4], [3, 13, 4, 14, 5, 18, 15], [14]],
    [[5], [18], [15]],
    [[6], [19], [16]],
]


def columns_of(procedures, sensors):
    """Return the names of the columns of a corpus of several procedures.

    Examples
    --------
    >>> from sklearn_haptic.recordings._biotac import columns_of
    >>> columns_of(["hold", "squeeze"], ["pac"])
    ['hold_pac', 'squeeze_pac']
    """
    return [f"{procedure}_{sensor}" for procedure in procedures for sensor in sensors]


def biotac_layout():
    """Arrange the 19 electrodes of a BioTac finger as an image.

    Returns
    -------
    layout : ndarray of shape (7, 3, 19)
        Weight of each electrode in each pixel. Two pixels have no electrode, the
        middle ones of rows 3 and 4. Each is the mean of its neighbours that have one,
        because the 2020 paper does not say how it interpolates them.

    Examples
    --------
    >>> from sklearn_haptic.recordings._biotac import biotac_layout
    >>> biotac_layout()[0].argmax(axis=1) + 1
    array([8, 7, 9])
    """
    layout = np.zeros((len(_PIXELS), 3, 19))
    for row, pixels in enumerate(_PIXELS):
        for column, electrodes in enumerate(pixels):
            layout[row, column, np.array(electrodes) - 1] = 1 / len(electrodes)
    return layout


def check_procedures(procedure, where):
    """Return the procedures as a list; refuse unknown ones, and none."""
    asked = [procedure] if isinstance(procedure, str) else procedure
    return check_names(asked, list(PROCEDURES), "procedure", where)


def rates_of(columns):
    """Return the sampling rate of each column of trials, by its sensor.

    Examples
    --------
    >>> from sklearn_haptic.recordings._biotac import rates_of
    >>> rates_of(["pac", "hold_pac", "hold_pdc"])
    {'pac': 2200, 'hold_pac': 2200, 'hold_pdc': 100}
    """
    return {column: SAMPLING_RATES[column.rsplit("_", 1)[-1]] for column in columns}
