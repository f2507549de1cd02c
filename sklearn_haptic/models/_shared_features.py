"""What `DistributionalOrdinalRegressor` asks of its base estimator.

The regressor observes each trial at several quantile positions in the population of
raters. A base estimator that has `NNPOM`'s methods ``fit_with_positions``,
``predict_proba_with_positions`` and ``validation_share`` takes the features of a trial
once for all its positions; `RepeatedRows` adapts every other estimator, by one row per
observation. So the regressor has one path for all.

What these methods are given has been validated, and the position is on the scale that
``p_transform`` chooses. An estimator that cannot learn several adjectives calls
`refuse_adjectives`. One whose predictions are a latent response cut by ``thresholds_``
may offer ``predict_latent_with_positions``: the median rating is then found at every
position, from where the response crosses the thresholds, instead of at some positions.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import is_regressor
from sklearn.frozen import FrozenEstimator
from sklearn.utils import gen_batches
from sklearn.utils.validation import check_is_fitted, has_fit_parameter

from ..utils._folds import validation_split, warn_of_no_groups
from ..utils._pipeline_steps import learned_before

# Rows, and values in them, that an estimator is given at once for prediction.
_BATCH_ROWS, _BATCH_VALUES = 2**14, 2**22

# More rows than this make scikit-learn's histogram boosting stop early by itself.
_AUTO_EARLY_STOPPING = 10_000


def share_features(estimator, present, n_levels):
    """Return the estimator itself if it shares features, an adapter otherwise."""
    if hasattr(estimator, "fit_with_positions"):
        return estimator
    return RepeatedRows(estimator, present, n_levels)


def seed_estimator(estimator, rng):
    """Set each ``random_state`` of an estimator and its steps to one drawn seed."""
    seed = int(rng.randint(np.iinfo(np.int32).max))
    names = (n for n in estimator.get_params() if n.split("__")[-1] == "random_state")
    estimator.set_params(**dict.fromkeys(names, seed))


def fit_with_weights(estimator, X, y, weight, refusal):
    """Fit an estimator; one that takes no weights only if they are all equal.

    Equal weights other than 1 matter beside a penalty. A ValueError says otherwise that
    the estimator takes no weights, but, as `refusal` goes on, that they differ.
    """
    if (weight != 1).any() and has_fit_parameter(estimator, "sample_weight"):
        return estimator.fit(X, y, sample_weight=weight)
    if np.ptp(weight) > 0:
        raise ValueError(
            f"{type(estimator).__name__} takes no sample_weight, but {refusal}"
        )
    return estimator.fit(X, y)


def check_output(predicted, shape):
    """Return what an estimator predicts; refuse another shape, NaN and infinity."""
    predicted = np.asarray(predicted)
    if predicted.shape != shape or not np.isfinite(predicted).all():
        raise ValueError(
            f"estimator predicts an array of shape {predicted.shape}, or NaN or "
            f"infinity; give an estimator of finite outputs of shape {shape}."
        )
    return predicted


def hold_out_trials(estimator, n_trials, groups, fraction, random_state):
    """Split off validation trials; return the indices of both parts.

    Whole objects validate if the trials' `groups` are given; else a warning names the
    estimator, whose ``fit`` calls this. `fraction` is the share of the objects, or of
    the trials, that validates; at least one does. If nothing would be left to train on,
    a ValueError says so.
    """
    split = validation_split(n_trials, groups, fraction, random_state)
    if groups is None:
        warn_of_no_groups(estimator, stacklevel=6)
    return split


def validates_on_rows(estimator, n_rows):
    """Say how an estimator, or a step of it, validates on its rows, and the mend.

    None if it does not.
    """
    params = estimator.get_params()
    for name, fraction in params.items():
        if name.split("__")[-1] == "cv" and fraction != "prefit":
            return (
                "cross-validates on",
                "fits too closely; choose its settings by a search around this model, "
                "over folds of whole objects",
            )
        step = name.removesuffix("validation_fraction")
        if step == name or fraction is None:
            continue
        patient = params.get(f"{step}n_iter_no_change") is not None
        early = params.get(f"{step}early_stopping", patient)
        if early is True or (early == "auto" and n_rows > _AUTO_EARLY_STOPPING):
            return (
                "stops early by",
                "stops too late; set its early_stopping=False (or "
                "n_iter_no_change=None)",
            )
    return None


def refuse_adjectives(name):
    """Raise the error of an estimator that cannot learn several adjectives."""
    raise ValueError(
        f"y has the ratings of several adjectives, which a {name} cannot share; use an "
        "NNPOM or a SensorFusionNNPOM with hidden units, or fit a model to each "
        "adjective."
    )


def unfrozen(estimator):
    """Return the estimator itself, without any `FrozenEstimator` around it.

    A `FrozenEstimator` hands out every attribute of what it wraps. So ``hasattr`` finds
    ``fit_with_positions`` in it, and calling that would fit the wrapped estimator
    again, in place. Therefore it is unwrapped, checked, and then only predicts.
    """
    while isinstance(estimator, FrozenEstimator):
        estimator = estimator.estimator
    return estimator


def refuse_frozen(estimator, owner, learned):
    """Refuse a frozen estimator where `fit` decides what it would have to know.

    Frozen networks of sensors, in a dict, need not know it.
    """
    parts = [estimator, *estimator.get_params().values()]
    if any(map(learned_before, parts)):
        raise ValueError(
            f"estimator is frozen, but {owner} decides in fit what it learns, {learned}"
            f"; freeze the whole {owner} instead."
        )


def check_frozen(estimator, name, n_inputs, levels=None, *, names=None, position=False):
    """Check that a frozen estimator was fitted to data like those given here.

    Parameters
    ----------
    estimator : FrozenEstimator
    name : str
        Its name in error messages.
    n_inputs : int
        Number of features that it will be given.
    levels : ndarray of shape (n_levels,), default=None
        The levels that it must predict; None if that does not matter.
    names : ndarray of shape (n_features,), default=None
        Names of the features, without the position.
    position : bool, default=False
        Whether the position in the population is the last feature.

    Raises
    ------
    NotFittedError, ValueError
        If it is not fitted, takes other features or predicts other levels.
    """
    estimator = unfrozen(estimator)
    check_is_fitted(estimator)
    for attribute, given in (
        ("n_features_in_", n_inputs),
        ("feature_names_in_", names),
        ("classes_", levels),
    ):
        known = getattr(estimator, attribute, given)
        if given is None:
            continue
        compared = known[: len(given)] if given is names else known
        if not np.array_equal(compared, given):
            raise ValueError(
                f"{name} is frozen and has {attribute}={np.array(known).tolist()}, but "
                f"{np.array(given).tolist()} is required here; fit it to the same "
                f"columns in the same order{', the position last,' * position} and to "
                "the same levels."
            )


@dataclass(frozen=True)
class RepeatedRows:
    """Repeat a trial's row for each of its positions, for estimators that do not share.

    Parameters
    ----------
    estimator : estimator object
        A classifier of the levels that ratings have, labelled 0, 1, … without gaps, or
        a regressor of the index of the level.
    present : ndarray of int
        Indices of the levels that ratings have.
    n_levels : int
        Number of all levels.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.linear_model import LogisticRegression
    >>> from sklearn_haptic.models._shared_features import RepeatedRows
    >>> base = RepeatedRows(LogisticRegression(), np.array([0, 2]), 3)
    >>> X, positions = np.zeros((4, 1)), np.tile([-1.0, 1.0], (4, 1))
    >>> level, weight = np.tile([0, 2], (4, 1)), np.ones((4, 2))
    >>> base.fit_with_positions(X, positions, level, weight, levels=np.arange(3))
    >>> base.predict_proba_with_positions(X[:1], np.array([-9.0, 9.0])).round()
    array([[[1., 0., 0.],
            [0., 0., 1.]]])
    """

    estimator: Any
    present: NDArray[np.integer]
    n_levels: int

    def fit_with_positions(self, X, positions, level, weight, **_not_needed):
        """Fit the estimator to one row per observation, the position its last column.

        Raises
        ------
        ValueError
            If there are several adjectives, or the observations differ in weight and
            the estimator takes no weights.

        Warns
        -----
        UserWarning
            If the estimator stops early, or chooses, by rows that it holds out itself.
        """
        name = type(self.estimator).__name__
        if weight.ndim == 3:
            refuse_adjectives(name)
        used = weight > 0
        rows = np.column_stack((X[np.nonzero(used)[0]], positions[used]))
        level, weight = level[used], weight[used]
        if not is_regressor(self.estimator):
            level = np.searchsorted(self.present, level)
        if found := validates_on_rows(self.estimator, len(rows)):
            validates, mend = found
            warnings.warn(
                f"{name} {validates} rows that it holds out itself, other positions of "
                f"the trials that it learns from, and so {mend}.",
                UserWarning,
                stacklevel=5,  # beyond this, fit, and its decorators
            )
        fit_with_weights(
            self.estimator,
            rows,
            level,
            weight,
            "the observations differ in weight; set sampling='random', and "
            "give equal sample_weight or none.",
        )

    def predict_proba_with_positions(self, X, positions):
        """Predict for each trial at each position, from few rows at a time."""
        n_rows = min(_BATCH_ROWS, _BATCH_VALUES // X.shape[1])
        n_trials = max(1, n_rows // len(positions))
        proba = [
            self._predict_rows(X[batch], positions)
            for batch in gen_batches(len(X), n_trials)
        ]
        return np.concatenate(proba).reshape(len(X), len(positions), self.n_levels)

    def _predict_rows(self, X, positions):
        estimator, n_rows = self.estimator, len(X) * len(positions)
        repeated = X.repeat(len(positions), axis=0)
        rows = np.column_stack((repeated, np.tile(positions, len(X))))
        proba = np.zeros((n_rows, self.n_levels))
        regressor = is_regressor(estimator)
        if not regressor and hasattr(estimator, "predict_proba"):
            known = self.present[estimator.classes_]
            shape = n_rows, len(known)
            proba[:, known] = check_output(estimator.predict_proba(rows), shape)
            return proba
        levels = np.arange(self.n_levels) if regressor else self.present
        place = check_output(estimator.predict(rows), (n_rows,))
        place = np.clip(place, 0, len(levels) - 1)
        for nearest in (np.ceil(place - 0.5), np.floor(place + 0.5)):  # or both nearest
            proba[np.arange(n_rows), levels[nearest.astype(int)]] += 0.5
        return proba

    def validation_share(self):
        """Return 0: other estimators take no validation trials."""
        return 0.0
