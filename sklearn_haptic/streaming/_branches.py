"""Features of prefixes: each sensor's steps, fitted once on whole touches.

A pipeline of trials has steps that turn recordings into a row of features per touch,
and behind them a *head* that learns from the rows. The features divide into *branches*:
the transformers of a `ColumnTransformer`, each with its sensors, and those of a
`FeatureUnion`; or all steps are one branch. What is before it repairs all sensors. A
branch is felt at a duration when all of its sensors have completed it and it can code
so little; else the means of its training features stand for it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from sklearn.base import clone
from sklearn.compose import ColumnTransformer
from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import FeatureUnion, Pipeline

from ..features import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from ..features._sensor_features import BlockScaler, SensorUnion, blocks_of
from ..recordings import RepairTrials
from ..recordings._trials import ALONE, is_table
from ..utils._pipeline_steps import flat_steps

_WITHOUT_RATINGS = (
    "AnytimeRegressor fits the steps that turn touches into rows of features once for "
    "all folds, so they are not given y; put a step that learns from y behind them."
)


class Branch(NamedTuple):
    """Steps that turn the recordings of some sensors into features.

    Attributes
    ----------
    transformer : fitted transformer
    columns : str, list of str or None
        What the transformer is given: a column, a table, or trials in no column.
    repairs : sequence of RepairTrials
        Fitted; what all sensors pass through before.
    """

    transformer: object
    columns: str | list[str] | None
    repairs: Sequence[RepairTrials] = ()

    @property
    def sensors(self):
        """The names of the sensors."""
        if self.columns is None:
            return [ALONE]
        return [self.columns] if isinstance(self.columns, str) else list(self.columns)

    def transform(self, touches, which, n_samples):
        """Return the features of prefixes, of shape (n_touches, n_features)."""
        columns = self.columns
        if self.repairs and columns is not None:
            columns = list(touches.signals)
        prefixes = touches.prefixes(which, n_samples, columns)
        for repair in self.repairs:
            prefixes = repair.transform(prefixes)
        if columns != self.columns:
            prefixes = prefixes[self.columns]
        return as_rows(self.transformer.transform(prefixes))

    def incremental(self):
        """Return the coder, the pool and later steps; None for other steps."""
        steps = _flat(self.transformer)
        if (
            not self.repairs
            and len(self.sensors) == 1
            and len(steps) >= 2
            and isinstance(steps[0], (KSVDTransformer, STHMPTransformer))
            and isinstance(steps[1], TemporalMaxPool)
        ):
            return steps[0], steps[1], steps[2:]
        return None

    def least_samples(self):
        """Return the fewest samples that the branch can code."""
        coders = (s for s in _flat(self.transformer) if isinstance(s, KSVDTransformer))
        return max((coder.components_.shape[1] for coder in coders), default=1)


def fit_features(steps, touches):
    """Fit the steps of a pipeline up to the first that returns a table.

    Parameters
    ----------
    steps : list of (str, estimator)
        Steps that do something, as of :func:`flat_steps`; they are cloned.
    touches : Touches
        Whole training touches, whose ratings no step is given, because all folds share
        what it learns.

    Returns
    -------
    branches : list of Branch
        The fitted steps.
    later : list of (str, estimator)
        The steps behind them. If the step of the branches scales the blocks of sensors,
        so does the first of these, for each duration anew.

    Raises
    ------
    ValueError
        If no step before the last returns a table.
    """
    sensors = list(touches.signals)
    columns = None if sensors == [ALONE] else sensors
    whole = dict.fromkeys(sensors)
    X = touches.prefixes(np.arange(len(touches)), whole, columns)
    repairs, fitted = [], []
    for i, (name, step) in enumerate(steps[:-1]):
        step = _without_dropped(clone(step))
        try:
            frozen = isinstance(step, FrozenEstimator)
            X = step.transform(X) if frozen else step.fit_transform(X)
        except (TypeError, ValueError) as error:
            if re.search(r"\by\b", str(error)):
                error.add_note(_WITHOUT_RATINGS)
            raise
        if isinstance(step, RepairTrials) and not fitted:
            repairs.append(step)
            continue
        fitted.append((name, step))
        if is_table(X):
            parts = _parts(step, columns) if len(fitted) == 1 else None
            later = steps[i + 1 :]
            if parts and hasattr(step, "scaler_"):
                later = [("scale", BlockScaler()), *later]
            parts = parts or [Branch(Pipeline(fitted), columns)]
            return [part._replace(repairs=repairs) for part in parts], later
    raise ValueError(
        "estimator has no step before its last that turns each touch into a row of "
        "features; add one, such as TemporalMaxPool behind KSVDTransformer."
    )


def check_described(branches, rates):
    """Refuse rates that contradict those by which an estimator describes sensors."""
    for branch in branches:
        rate = rates[branch.sensors[0]]
        known = getattr(_flat(branch.transformer)[0], "rate_", None) or rate
        if len(branch.sensors) == 1 and max(rate / known, known / rate) > 1.1:
            raise ValueError(
                f"sampling_rates has {rate:g} Hz for {branch.sensors[0]!r}, which the "
                f"estimator describes by {known:g} Hz; give the same rate."
            )


def as_rows(features):
    """Return features as an array of shape (n_touches, n_features)."""
    if hasattr(features, "toarray"):
        features = features.toarray()
    return np.asarray(features)


def used_sensors(steps, named):
    """Return the named sensors that the first step behind repairs takes, or all."""
    first = next(step for _, step in steps if not isinstance(step, RepairTrials))
    if not isinstance(first, ColumnTransformer) or first.remainder != "drop":
        return named
    taken = []
    for name, transformer, columns in first.transformers:
        if transformer == "drop":
            continue
        if callable(columns):
            return named
        columns = columns if isinstance(columns, (list, tuple)) else [columns]
        if not all(isinstance(column, str) for column in columns):
            raise ValueError(
                f"The transformer {name!r} of estimator takes columns by position; "
                "name them, because only those of sampling_rates reach it."
            )
        taken += [*columns]
    unknown = [column for column in taken if column not in named]
    if unknown:
        raise ValueError(
            f"estimator takes the column {unknown[0]!r}, for which sampling_rates has "
            "no rate; add it."
        )
    return [sensor for sensor in named if sensor in taken]


def _without_dropped(step):
    """Take the columns that a ColumnTransformer drops from it: nothing records them."""
    if isinstance(step, ColumnTransformer):
        kept = [each for each in step.transformers if each[1] != "drop"]
        step.transformers = kept
    return step


def _parts(step, columns):
    """Return the branches of a fitted step, None if it cannot be divided.

    If it scales no blocks, those that unions in it scale stay as these make them.
    """
    whole = () if hasattr(step, "scaler_") else SensorUnion
    if isinstance(step, FeatureUnion):
        return _united(step, columns, whole)
    if (
        not isinstance(step, ColumnTransformer)
        or step.remainder != "drop"
        or step.transformer_weights
    ):
        return None
    branches = []
    for name, transformer, columns in step.transformers_:
        if name == "remainder" or transformer == "drop":
            continue
        if not isinstance(columns, (str, list)) or transformer == "passthrough":
            return None
        if not all(isinstance(column, str) for column in columns):
            return None
        branches += _united(transformer, columns, whole)
    return branches


def _united(transformer, columns, whole):
    """Return the transformers of a union as branches, any other as one."""
    return [Branch(each, columns) for each in blocks_of(transformer, whole)]


def _flat(transformer):
    if not isinstance(transformer, Pipeline):
        return [transformer]
    return [step for _, step in flat_steps(transformer)]
