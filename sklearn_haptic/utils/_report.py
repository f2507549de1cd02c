"""Reports: dictionary-like results that a notebook shows as HTML, print as text."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from textwrap import fill

import pandas as pd
from sklearn.utils import Bunch


class Report(Bunch):
    """A Bunch that is shown as sentences and tables.

    Subclasses say which, in `_parts`: texts and DataFrames.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_haptic.utils._report import Report
    >>> class Shares(Report):
    ...     def _parts(self):
    ...         yield "Half of them."
    ...         yield pd.DataFrame({"share": [0.5, None]})
    >>> Shares()
    Half of them.
    <BLANKLINE>
      share
    0   0.5
    1     –
    """

    def _parts(self) -> Iterator[str | pd.DataFrame]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return "\n\n".join(
            fill(part, 88)
            if isinstance(part, str)
            else part.to_string(na_rep="–", float_format=_number)
            for part in self._parts()
        )

    def _repr_html_(self) -> str:
        return "".join(
            f"<p>{escape(part)}</p>"
            if isinstance(part, str)
            else part.to_html(na_rep="–", float_format=_number)
            for part in self._parts()
        )


def _number(value):
    return f"{round(value, 3):,.10g}"
