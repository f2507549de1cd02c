"""Rows of pandas that belong together have their labels in one order."""

from collections import Counter
from itertools import combinations

import pandas as pd


def check_order(X, rows, name="y", of="X"):
    """Refuse rows of pandas that have the labels of those of `X` in another order.

    In a fold, rows of different orders have some labels in common, at other places. If
    labels are words, this is refused too; numbers may be set anew in one of them.
    """
    if not all(isinstance(each, (pd.DataFrame, pd.Series)) for each in (X, rows)):
        return
    labels, others = X.index, rows.index
    if len(labels) != len(others) or labels.equals(others):
        return
    words = labels.inferred_type == others.inferred_type == "string"
    moved = words and (labels.isin(others) & (labels != others)).any()
    if moved or Counter(labels) == Counter(others):
        raise ValueError(
            f"{name} has the row labels of {of} in another order, but rows are matched "
            f"by position; give {name}.loc[{of}.index] if labels are unique, or "
            f"{name}.to_numpy() if the order is right."
        )


def check_orders(**given):
    """Refuse each that is given of the trials of one before it in another order."""
    for (of, X), (name, rows) in combinations(given.items(), 2):
        check_order(X, rows, name, of)
