"""Reports: dictionary-like results that a notebook shows as HTML, print as text."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from textwrap import fill
from typing import NamedTuple

import pandas as pd
from sklearn.utils import Bunch

_WIDTH = 88  # of lines of text

# Colours are those of the page, or lie thinly over them, so that dark pages work too.
_STYLE = """
.sklearn-haptic-report { font-family: sans-serif; font-size: 14px; }
.sklearn-haptic-report > div { overflow-x: auto; }
.sklearn-haptic-report table { border-collapse: collapse; font-size: inherit;
  margin: 0.3em 0 1em; }
.sklearn-haptic-report caption { text-align: left; font-weight: bold;
  padding: 0.3em 0; white-space: nowrap; }
.sklearn-haptic-report th, .sklearn-haptic-report td { padding: 0.25em 0.6em;
  text-align: right; font-variant-numeric: tabular-nums; }
.sklearn-haptic-report td { white-space: nowrap; }
.sklearn-haptic-report thead th { border-bottom: 1px solid; vertical-align: bottom;
  font-weight: normal; }
.sklearn-haptic-report tbody th { text-align: left; font-weight: normal;
  white-space: nowrap; }
.sklearn-haptic-report p { margin: 0.3em 0; max-width: 50em; }
"""


class Table(NamedTuple):
    """A table as it is shown."""

    caption: str
    cells: pd.DataFrame
    """Of text."""
    shade: pd.DataFrame | None = None
    """Numbers from 0 to 1, by which cells of these rows and columns are tinted."""
    note: str = ""


class Report(Bunch):
    """A Bunch that is shown as sentences and tables.

    Subclasses say which, in `_parts`: texts and instances of `Table`.
    """

    def _parts(self) -> Iterator[str | Table]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return "\n\n".join(map(_as_text, self._parts()))

    def _repr_html_(self) -> str:
        parts = "".join(map(_as_html, self._parts()))
        return (
            f'<div class="sklearn-haptic-report"><style>{_STYLE}</style>{parts}</div>'
        )


def as_texts(frame, formats):
    """Return a DataFrame as text: columns renamed and each value formatted.

    `formats` maps the columns wanted to pairs of a name and a function of a value.
    Missing values are "–".

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_haptic.utils._report import as_texts
    >>> frame = pd.DataFrame({"x": [0.25, None], "y": [1, 2]})
    >>> as_texts(frame, {"x": ("share", "{:.0%}".format)})
      share
    0   25%
    1     –
    """
    columns = {
        name: ["–" if pd.isna(value) else write(value) for value in frame[column]]
        for column, (name, write) in formats.items()
    }
    return pd.DataFrame(columns, index=frame.index, dtype=object)


def _as_text(part):
    if isinstance(part, str):
        return fill(part, _WIDTH)
    note = fill(part.note, _WIDTH)
    return "\n".join(filter(None, [part.caption, part.cells.to_string(), note]))


def _as_html(part):
    if isinstance(part, str):
        return f"<p>{escape(part)}</p>"
    cells, note = part.cells, ""
    n_names = cells.index.nlevels
    names = [each if each is not None else "" for each in cells.index.names]
    head = "".join(f"<th>{escape(str(each))}</th>" for each in [*names, *cells.columns])
    rows = []
    for key, row in zip(cells.index, cells.itertuples(index=False)):
        labels = key if n_names > 1 else [key]
        shown = "".join(f"<th>{escape(str(each))}</th>" for each in labels)
        for column, value in zip(cells.columns, row):
            shown += f"<td{_tint(part.shade, key, column)}>{escape(value)}</td>"
        rows.append(f"<tr>{shown}</tr>")
    if part.note:
        note = f"<p>{escape(part.note)}</p>"
    return (
        f"<div><table><caption>{escape(part.caption)}</caption><thead><tr>{head}</tr>"
        f"</thead><tbody>{''.join(rows)}</tbody></table>{note}</div>"
    )


def _tint(shade, key, column):
    if shade is None or column not in shade.columns:
        return ""
    share = shade.at[key, column]
    if pd.isna(share):
        return ""
    return f' style="background: rgba(0, 114, 178, {0.8 * share:.2f})"'
