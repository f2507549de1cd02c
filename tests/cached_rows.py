"""A check of caches, for tests of several transformers."""

import numpy as np
from sklearn.base import clone

from sklearn_haptic import TemporalMaxPool


def assert_an_entry_each(codes, changes, trials, folder):
    """Every change of the coder's parameters has cached rows of its own."""
    rows = []
    for change in changes:
        changed = clone(codes).set_params(**change).fit_transform(trials)
        pool = TemporalMaxPool((2, 1), memory=str(folder))
        rows.append(pool.fit_transform(changed))
        np.testing.assert_array_equal(
            rows[-1], TemporalMaxPool((2, 1)).fit_transform(changed)
        )
        assert all(not np.array_equal(rows[-1], row) for row in rows[:-1])
    assert len(list(folder.rglob("output.pkl"))) == len(changes)
