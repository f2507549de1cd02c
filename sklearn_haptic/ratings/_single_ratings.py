"""Checks of tables of single ratings, one column per adjective."""

import numpy as np
from sklearn.utils.validation import check_array

from ..utils._validation import check_numbers, missing_to_none


def check_single_ratings(ratings, **least):
    """Validate a table of single ratings; return it as float64, NaN where missing."""
    with np.errstate(invalid="ignore"):  # of missing categories, cast by pandas
        check_numbers(ratings, "ratings")
    shape = np.shape(ratings)
    if len(shape) != 2:
        raise ValueError(
            f"ratings has shape {shape}; give a table with one row per person and "
            "object and one column per adjective, also if there is only one."
        )
    return check_array(
        missing_to_none(ratings, "ratings"),
        dtype=np.float64,
        ensure_all_finite="allow-nan",
        input_name="ratings",
        **least,
    )
