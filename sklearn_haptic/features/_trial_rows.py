"""What the transformers share that turn each trial into one row of features."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import TransformerMixin
from sklearn.callback import CallbackSupportMixin
from sklearn.utils.validation import check_is_fitted

from ..recordings._sequences import Sequences, row_index
from ..recordings._trials import (
    TABLE_FOR_TRIALS,
    channel_names,
    check_sequences,
    check_trials,
    is_table,
)
from ..utils._sklearn import Names, _check_feature_names_in, _get_output_config
from ..utils._validation import check_table


class TrialRows(CallbackSupportMixin, TransformerMixin):
    """Mixin for transformers that turn each trial into one row of features.

    `fit` calls `_record(X)`, and `transform` calls `_check(X)`; both return the trials
    as a list of arrays or as :class:`Sequences`. Each row of a table is a trial with
    one channel. `_names(columns)` returns the names of the features of these columns.
    """

    def get_feature_names_out(
        self, input_features: Names | None = None
    ) -> NDArray[np.object_]:
        """Return the names of the features.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Checked against the columns seen in `fit`; ignored if these have no names.

        Returns
        -------
        names : ndarray of str objects
            Cell, channel or column, and what was computed of it: see the class.
        """
        check_is_fitted(self)
        return np.asarray(self._names(self._columns(input_features)), dtype=object)

    def _record(self, X):
        """Validate the trials given to `fit` and remember their columns."""
        self.takes_trials_ = not is_table(X)
        self._channel_names = channel_names(X)
        if not self.takes_trials_:
            return self._check_rows(X, reset=True)
        trials = self._check_trials(X)
        vars(self).pop("feature_names_in_", None)  # of an earlier fit
        if isinstance(trials, Sequences):
            self.feature_names_in_ = trials.feature_names
            self.n_features_in_ = len(trials.feature_names)
        else:
            self.n_features_in_ = trials[0].shape[1]
        return trials

    def _check(self, X):
        """Validate the trials given to `transform`."""
        if not self.takes_trials_:
            return self._check_rows(X)
        if is_table(X) and not isinstance(X, list):
            raise ValueError(TABLE_FOR_TRIALS)
        trials = self._check_trials(X, self.n_features_in_)
        self._check_column_names(trials)
        return trials

    def _with_index(self, rows, X):
        """Give rows the index of the trials if the output is to be a DataFrame."""
        index = row_index(X)
        if index is None or _get_output_config("transform", self)["dense"] != "pandas":
            return rows
        # scikit-learn adds the names, but not the index of trials.
        return pd.DataFrame(rows, index=index)

    def _columns(self, input_features):
        """Return the names of the channels or columns of the trials."""
        named = hasattr(self, "feature_names_in_")
        if named or not self.takes_trials_:
            columns = _check_feature_names_in(self, input_features)
        if not self.takes_trials_:
            return ["ch0"]
        return columns if named else [f"ch{i}" for i in range(self.n_features_in_)]

    def _check_rows(self, X, *, reset=False):
        rows = isinstance(X, list) and {getattr(row, "ndim", 0) for row in X} == {1}
        if not is_table(X) and not (rows and len({*map(len, X)}) == 1):
            raise ValueError(
                "X is a collection of trials, but fit was given a table; give both in "
                "the same form."
            )
        X = check_table(self, X, dtype=[np.float64, np.float32], reset=reset)
        return list(X[:, :, np.newaxis])

    def _check_trials(self, X, n_columns=None):
        if isinstance(X, Sequences):
            check_sequences(X, n_columns=n_columns)
            return X
        return check_trials(X, n_channels=n_columns, names=self._channel_names)

    def _check_column_names(self, trials):
        names = getattr(trials, "feature_names", None)
        known = getattr(self, "feature_names_in_", names)
        if names is None or np.array_equal(known, names):
            return
        i = np.argmax(known != names)
        raise ValueError(
            f"Column {i} of X is named {names[i]!r}, but {known[i]!r} in fit; give "
            "sequences from the step that fit was given."
        )

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags
