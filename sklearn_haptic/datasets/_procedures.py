"""Corpora of one procedure, or of several in the same trials."""

from ..recordings._biotac import PROCEDURES, SAMPLING_RATES
from ..utils._validation import check_names


def check_procedures(procedure, where):
    """Return the procedures as a list; refuse unknown ones, and none."""
    asked = [procedure] if isinstance(procedure, str) else procedure
    return check_names(asked, list(PROCEDURES), "procedure", where)


def rates_of(columns):
    """Return the sampling rate of each column of trials, by its sensor.

    Examples
    --------
    >>> from sklearn_haptic.datasets._procedures import rates_of
    >>> rates_of(["pac", "hold_pac", "hold_pdc"])
    {'pac': 2200, 'hold_pac': 2200, 'hold_pdc': 100}
    """
    return {column: SAMPLING_RATES[column.rsplit("_", 1)[-1]] for column in columns}
