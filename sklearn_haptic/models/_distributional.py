"""Distributions of ratings from any ordinal model, by sweeping the population.

Richardson & Kuchenbecker (2020) train a model to predict the rating at each quantile
position p in the population of raters. Every trial is duplicated, each duplicate has a
position as one more feature, and its label is the object's inverse CDF there. To
predict a distribution, p sweeps the population.
"""

from __future__ import annotations

from collections import UserDict
from numbers import Integral
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit, logit
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone, is_regressor
from sklearn.callback import CallbackSupportMixin
from sklearn.frozen import FrozenEstimator
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_consistent_length

from ..ratings._checks import check_adjectives, weighted
from ..ratings._distributions import level_at, quantile_grid
from ..ratings._levels import levels_set_in
from ..utils._folds import TakesGroups
from ..utils._sklearn import (
    HasMethods,
    Interval,
    RandomState,
    StrOptions,
    _fit_context,
    fit_task,
    validate_parameter_constraints,
)
from ..utils._validation import (
    FLOATS,
    check_features,
    check_positions,
    check_table,
)
from ._nnpom import NNPOM
from ._observations import relative_weights, used_trials
from ._ordinal import OrdinalClassifierMixin
from ._quantile_positions import (
    average_over_cells,
    clip_positions,
    is_smooth,
    mixture,
    ratings_at,
    share_between_crossings,
    share_of_modes,
    training_observations,
)
from ._shared_features import (
    check_frozen,
    hold_out_trials,
    seed_estimator,
    share_features,
    unfrozen,
)


class DistributionalOrdinalRegressor(
    TakesGroups,
    CallbackSupportMixin,
    MetaEstimatorMixin,
    OrdinalClassifierMixin,
    BaseEstimator,
):
    """Classifier that predicts the distribution of a crowd's ratings.

    To scikit-learn it is a classifier whose classes are the ordered levels. Its base
    estimator, which may be a classifier or a regressor, learns from observations of
    each trial at several quantile positions p in the population of raters, 0 the
    lowest rating and 1 the highest. To predict a distribution, p sweeps the population
    [1]_.

    Parameters
    ----------
    estimator : estimator object, default=None
        The base estimator, which predicts a rating from the features and the position;
        by default ``NNPOM(n_hidden=0, alpha=3)``. `NNPOM`, or another that has the
        methods in the Notes, takes a trial's features once for all its observations.
        Any other is fitted to one row per observation, labelled 0, 1, … by the place of
        its level among all levels, or, for a classifier, among those that anybody gave,
        as a ``class_weight`` has to know.
        A `sklearn.frozen.FrozenEstimator` is used as it was fitted, to the features and
        the position as given by ``p_transform``; `fit` only checks that its inputs, and
        the levels of a classifier, are those of the trials. A frozen regressor has to
        predict the places 0, 1, … of levels.
    n_duplicates : int, default=15
        Total weight of the observations of a trial, so that a larger one makes the
        estimator's penalty weaker in comparison; with random positions also their
        number.
    sampling : {"level", "random"}, default="level"
        How positions are chosen. "level": the middles of 16 cells of the population,
        the same for all trials, where each level has the weight of the people in the
        cell who chose it, so that no rating is missed and nothing is random; the
        estimator must take sample weights. There are three cells if each trial has
        ratings of one level only. "random": at random (the paper). Settings that count
        rows, such as ``min_samples_leaf``, count observations.
    p_transform : {"logit", None}, default="logit"
        What the estimator gets as its last feature: the log-odds of p, which reach
        into the tails of the distribution, or p itself (the paper).
    decode : {"mixture", "quantile"}, default="mixture"
        "mixture" averages the probabilities of the levels over the population. It is
        calibrated if the estimator predicts probabilities, and better by RPS and log
        score. "quantile" decides on one rating per position and measures the share of
        each (the paper). It is sharper and better by absolute error, with probabilities
        that are often exactly 0. This parameter and the next two take effect at
        prediction, so `set_params` may change them after `fit`.
    rule : {"median", "argmax"}, default="median"
        How "quantile" decides: on the median level, at every position, or on the most
        probable, at ``n_quantiles`` positions (the paper).
    n_quantiles : int, default=99
        Number of evenly spaced positions, 0.01, …, 0.99 by default, at which the rule
        "argmax" decides and validation trials are observed for early stopping.
    levels : array-like of shape (n_levels,), default=None
        All ordered levels, so that one absent from the training data keeps its
        column. By default they are what labels ``y``: the categories of an ordered
        categorical, or the columns of a table of counts, numbers sorted and words in
        the order of the columns. Without labels they are 1, 2, … for counts, and the
        sorted ratings that occur otherwise.
    random_state : int, RandomState instance or None, default=None
        Draws the random positions, the validation trials and the ``random_state`` of
        ``estimator``, which stays as it is if this is None.

    Attributes
    ----------
    estimator_ : estimator object
        The fitted estimator; the position is its last feature.
    levels_, classes_ : ndarray of shape (n_levels,)
        The ordered levels.
    n_features_in_ : int
        Number of features, without the position.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the features, if they have any.

    See Also
    --------
    PAPER_2020 : The parameters of Richardson & Kuchenbecker (2020).
    DummyDistribution : Baselines that ignore the features.

    Notes
    -----
    With "quantile" the model estimates the centre of the quantile functions that
    objects with these features may have, a Wasserstein-1 barycentre, and with
    "mixture" their average distribution. The macro-averaged error of the paper
    rewards the first, proper scores reward the second. Both estimates are as good as
    the fit at each position: where a fifth of the objects that felt alike had high
    ratings and the others low ones, the default's CDF was off by .04, and its earth
    mover's distance with "quantile" was 13 % above that of a guess. The quantile
    functions of few people are steps: learned from 12, 5 and 3 people per object,
    "quantile" had a dispersion of about .84, .64 and .46, and from single answers it
    gives one rating all probability. `predict_rating` decides in the same way.

    Standardise features in different units, for example with
    `sklearn.preprocessing.StandardScaler`: the default divides all by one spread, so
    that those of small numbers hardly count (see :class:`NNPOM`).

    An `NNPOM` with hidden units, or a `SensorFusionNNPOM`, can learn several adjectives
    together: they share the units, and each has output weights and thresholds of its
    own. What one adjective tells of a touch can then help with another, as the paper
    suggests [1]_ (section 4.2). The observations of all adjectives add up in the cost,
    so the penalty can be larger.

    To take the features of a trial once for all its positions, an estimator offers the
    methods ``fit_with_positions``, ``predict_proba_with_positions`` and
    ``validation_share``, documented with `NNPOM`. If it also offers
    ``predict_latent_with_positions`` and ``thresholds_``, "quantile" with the rule
    "median" finds where the latent response crosses each threshold.

    A regressor, or a classifier without ``predict_proba``, predicts one level at each
    position, and not how far ratings are from it. Those of a regressor are too narrow:
    of simulated ratings of 12, 3 and 1 people, ridge regression had a dispersion of
    .58, .34 and 0, and an RPS 5, 12 and 49 % above that of the default. Give regressors
    to :class:`RegressedDistribution` instead. Those of a classifier may be too broad:
    `RidgeClassifier` had a dispersion of 1.8, and an RPS 40 % above that of logistic
    regression.

    Probabilities are taken as the estimator predicts them. Neighbours, kernels and
    strong penalties hardly see the position, which is one feature among many, and then
    predict nearly the same rating at all positions: give :class:`RegressedDistribution`
    a regressor of neighbours instead.

    An `NNPOM` has one set of thresholds for all touches. The default moves
    distributions along the scale but cannot widen them, so that what features tell of
    how far people agree is lost. Where one simulated feature told the mean and another
    the width, its CDF was off by .07 on average, that of ten hidden units or of
    :class:`RegressedDistribution` by .02; where features told the width alone, by .12,
    .03 and .02. Where all touches had one width it was off by .003. For the same reason
    it moves answers that do not depend on the touch: where a fifth of all answers were
    the lowest level whatever was touched, it predicted .03 of these for the objects
    rated highest, and ten hidden units .12, with an RPS lower by 2.5 %.

    The population is swept on 20 quadrature nodes where these suffice, as they do for
    an `NNPOM` or a logistic regression; `fit` tests this on up to 256 trials. The
    predictions of trees, and of any regressor, whose ratings are rounded (halfway ones
    to both levels alike), jump as p grows. They are averaged over 384 positions, and
    over 1024 or more for trials whose jumps need them, so that the CDF is off by less
    than 0.005 (`benchmarks/networks.py`); of single small trees, it was off by up to
    0.014 for a few trials. Where people are divided on fewer than one trial in a
    hundred, the test may miss these, and the CDF of a single tree, of a few boosted
    ones, or of polynomials and hidden units was off by up to 0.05 there.

    References
    ----------
    .. [1] Richardson, B. A. & Kuchenbecker, K. J. (2020). Learning to predict
       perceptual distributions of haptic adjectives. Frontiers in Neurorobotics
       13, 116. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    Twelve people rate each of four objects from 1 to 5.

    >>> import numpy as np
    >>> from sklearn_haptic import DistributionalOrdinalRegressor
    >>> X = np.array([[-1.0], [-0.4], [0.3], [1.1]])
    >>> counts = np.array(
    ...     [[8, 3, 1, 0, 0], [3, 6, 2, 1, 0], [0, 2, 5, 4, 1], [0, 0, 1, 5, 6]]
    ... )
    >>> model = DistributionalOrdinalRegressor().fit(X, counts)
    >>> model.predict_proba([[1.5]]).round(2)
    array([[0.  , 0.01, 0.06, 0.28, 0.65]])
    >>> model.predict_quantile([[-1.0], [1.5]], [0.1, 0.5, 0.9])
    array([[1, 1, 3],
           [4, 5, 5]])
    """

    _parameter_constraints = {  # noqa: RUF012
        "estimator": [HasMethods(["fit", "predict"]), None],
        "n_duplicates": [Interval(Integral, 1, None, closed="left")],
        "sampling": [StrOptions({"level", "random"})],
        "p_transform": [StrOptions({"logit"}), None],
        "decode": [StrOptions({"mixture", "quantile"})],
        "rule": [StrOptions({"median", "argmax"})],
        "n_quantiles": [Interval(Integral, 1, None, closed="left")],
        "levels": ["array-like", None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        estimator: BaseEstimator | None = None,
        *,
        n_duplicates: int = 15,
        sampling: Literal["level", "random"] = "level",
        p_transform: Literal["logit"] | None = "logit",
        decode: Literal["mixture", "quantile"] = "mixture",
        rule: Literal["median", "argmax"] = "median",
        n_quantiles: int = 99,
        levels: ArrayLike | None = None,
        random_state: RandomState = None,
    ) -> None:
        self.estimator = estimator
        self.n_duplicates = n_duplicates
        self.sampling = sampling
        self.p_transform = p_transform
        self.decode = decode
        self.rule = rule
        self.n_quantiles = n_quantiles
        self.levels = levels
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        *,
        groups: ArrayLike | None = None,
        X_val: ArrayLike | None = None,
        y_val: ArrayLike | None = None,
    ) -> Self:
        """Fit the estimator on each trial at several positions.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            How many people gave the trial's object each rating, or one rating per
            trial. Counts of several adjectives, of shape (n_trials, n_adjectives,
            n_levels), are learned together; see the Notes.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial, also where early stopping validates on it. With
            ``sampling="level"`` a weight of 2 equals giving the trial twice, if groups
            keep both on the same side of the split and the estimator counts no rows;
            "random" draws positions for each trial anew. Multiplying all weights by a
            factor divides the penalty of an estimator that takes weights by it, so
            scale them to a mean of 1; an estimator that takes none, as a Pipeline, is
            fitted without them if they are equal.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial, so that an estimator with
            ``early_stopping=True`` validates on whole objects; without them it warns.
        X_val : array-like of shape (n_val_trials, n_features), default=None
            Validation trials of an estimator with ``early_stopping=True``; by default
            it validates on a share of those in ``X``. In a Pipeline the steps before
            transform them only by ``transform_input=["X_val"]`` and metadata routing.
        y_val : array-like of shape (n_val_trials, n_levels) or (n_val_trials,), \
                default=None
            Their ratings.

        Returns
        -------
        self : DistributionalOrdinalRegressor
        """
        frozen = isinstance(self.estimator, FrozenEstimator)
        levels = self.levels
        if levels is None and frozen:
            levels = getattr(self.estimator, "levels_", None)
        _refuse_own_levels(self.estimator, levels)
        X, counts, levels, sample_weight, groups = used_trials(
            self, X, y, levels, sample_weight, groups
        )
        self.levels_ = self.classes_ = levels
        rng = check_random_state(self.random_state)
        self.estimator_ = self._make_estimator(rng)
        self._p_transform = self.p_transform
        self._present = np.arange(len(self.levels_))
        share = 0.0 if frozen else self._base.validation_share()
        validation = self._check_validation(X_val, y_val, share)
        if frozen:
            self._check_frozen(X, counts)
            self._smooth = is_smooth(self._predict_at, X)
            return self
        inputs, level, weight = self._observe(counts, sample_weight, rng)
        self._present = np.unique(level[weight > 0])
        if validation is None and share > 0:
            train, validating = hold_out_trials(self, len(X), groups, share, rng)
            trial_weight = relative_weights(sample_weight)[validating]
            validation = X[validating], counts[validating], trial_weight
            X, inputs, level, weight = (a[train] for a in (X, inputs, level, weight))
        if validation is not None:
            validation = self._validation_set(*validation)
        self._smooth = False  # for callbacks, which may predict during the fit
        with (
            fit_task(self, X, y, max_subtasks=1) as task,
            task.fit_of("fit estimator", self.estimator_),
        ):
            names = getattr(self, "feature_names_in_", None)
            options = {"validation": validation, "feature_names": names}
            self._base.fit_with_positions(
                X, inputs, level, weight, levels=self.levels_, **options
            )
        self._smooth = is_smooth(self._predict_at, X)
        return self

    @property
    def _base(self):
        """The estimator, or an adapter to it, as one that shares features."""
        return share_features(self.estimator_, self._present, len(self.levels_))

    def _make_estimator(self, rng):
        default = NNPOM(n_hidden=0, alpha=3.0)
        estimator = clone(default if self.estimator is None else self.estimator)
        if isinstance(estimator, FrozenEstimator):
            return unfrozen(estimator)
        if self.random_state is not None:
            seed_estimator(estimator, rng)
        return estimator

    def _check_validation(self, X_val, y_val, share):
        """Return the validation trials and their counts, None if none are given."""
        if (X_val is None) != (y_val is None):
            raise ValueError("X_val and y_val belong together; give both or neither.")
        if X_val is None:
            return None
        if share == 0:
            raise ValueError(
                "X_val requires an estimator that stops early; use an NNPOM with "
                "early_stopping=True, or leave X_val and y_val out."
            )
        X_val = check_table(self, X_val, dtype=FLOATS, reset=False)
        counts, _ = check_adjectives(y_val, self.levels_, name="y_val")
        check_consistent_length(X_val, counts)
        return X_val, counts

    def _check_frozen(self, X, counts):
        """Check a fitted estimator, which takes the features and the position."""
        labels = self.levels_ if self._base is self.estimator_ else self._present
        labels = None if is_regressor(self.estimator_) else labels
        names = getattr(self, "feature_names_in_", None)
        n_inputs = X.shape[1] + 1
        check_frozen(
            self.estimator, "estimator", n_inputs, labels, names=names, position=True
        )
        predicted = self._predict_at(X[:1], np.array([0.5])).shape[2:]
        if predicted != counts.shape[1:]:
            raise ValueError(
                f"estimator is frozen and predicts an array of shape {predicted} for a "
                f"trial, but y has {counts.shape[1:]}; fit it to the same adjectives "
                "and levels."
            )

    def _observe(self, counts, sample_weight, rng):
        """Return what is observed of each trial: inputs, levels and weights."""
        rows = counts.reshape(-1, counts.shape[-1])
        observed = training_observations(rows, self.n_duplicates, self.sampling, rng)
        shape = *counts.shape[:-1], -1
        positions, level, weight = (each.reshape(shape) for each in observed)
        return self._to_input(positions), level, weighted(weight, sample_weight)

    def _validation_set(self, X, counts, trial_weight=1.0):
        """Return trials at the positions of the grid, with their true ratings there."""
        grid = quantile_grid(self.n_quantiles)
        level = level_at(counts, grid)
        inputs = np.broadcast_to(self._to_input(grid), level.shape)
        return X, inputs, level, (np.ones(level.shape).T * trial_weight).T

    def _to_input(self, positions):
        return logit(positions) if self._p_transform == "logit" else positions

    def _to_position(self, inputs):
        return expit(inputs) if self._p_transform == "logit" else inputs

    def _predict_at(self, X, positions):
        return self._base.predict_proba_with_positions(X, self._to_input(positions))

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """Predict the distribution of ratings.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
            Share of the population at each level; rows sum to 1. If several
            adjectives were learned, all predictions have an axis of adjectives behind
            that of the trials.
        """
        X = check_features(self, X)
        proba = self._decode(X)
        return proba / proba.sum(axis=-1, keepdims=True)

    def _check_decoding(self):
        """Check what may be set after fit."""
        names = ("decode", "rule", "n_quantiles")
        validate_parameter_constraints(
            {name: self._parameter_constraints[name] for name in names},
            {name: getattr(self, name) for name in names},
            type(self).__name__,
        )

    def _decode(self, X):
        self._check_decoding()
        if self.decode == "mixture":
            return mixture(self._predict_at, X, self._smooth)
        if self.rule == "argmax":
            return share_of_modes(self._predict_at, X, self.n_quantiles)
        base = self._base
        if hasattr(base, "predict_latent_with_positions"):
            return share_between_crossings(base, X, self._to_input, self._to_position)
        return average_over_cells(self._predict_at, X, "median")

    def predict_rating(self, X: ArrayLike, p: ArrayLike) -> np.ndarray:
        """Predict the rating at given quantile positions, each by itself.

        At each position the ``rule`` decides on one level, whatever ``decode`` is. With
        the rule "argmax" this is what the paper predicts, and
        :func:`~sklearn_haptic.metrics.macro_mae_at_positions` scores it as the paper
        does. Nothing is sorted: a rating may fall as p grows, where `predict_quantile`
        gives the inverse of a distribution.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.
        p : float or array-like of shape (n_positions,)
            Positions in the population, from 0 (lowest rating) to 1.

        Returns
        -------
        rating : ndarray of shape (n_trials,) or (n_trials, n_positions)
        """
        self._check_decoding()
        X = check_features(self, X)
        p = check_positions(p)
        positions = clip_positions(np.atleast_1d(p))
        rating = self.levels_[ratings_at(self._predict_at, X, positions, self.rule)]
        return rating if p.ndim else rating[..., 0]


def _refuse_own_levels(estimator, levels):
    """Refuse levels of an estimator inside, which would be ignored."""
    own = None if estimator is None else levels_set_in(estimator)
    if own is not None and (levels is None or [*own] != [*levels]):
        raise ValueError(
            f"estimator has levels={[*own]}, which would be ignored; give them to the "
            "DistributionalOrdinalRegressor."
        )


class _Settings(UserDict[str, Any]):
    """Parameters that hand out a copy of an estimator, so that theirs never changes."""

    def __getitem__(self, name):
        return clone(self.data[name], safe=False)


PAPER_2020 = _Settings(
    estimator=NNPOM(
        n_hidden=10,
        alpha=1.0,
        scale_features=False,
        gaps="squared",
        solver="irprop+",
        max_iter=500,
        tol=0.0,
        early_stopping=True,
        n_iter_no_change=150,
        validation_fraction=1 / 9,
    ),
    n_duplicates=15,
    sampling="random",
    p_transform=None,
    decode="quantile",
    rule="argmax",
    n_quantiles=99,
)
"""Parameters of `DistributionalOrdinalRegressor` in Richardson & Kuchenbecker (2020).

The paper chooses ``estimator__n_hidden`` among 1, 5, 10, 20, 30 and
``estimator__alpha`` among 0.001 … 10 on validation objects.
Give ``fit`` the trials' objects as `groups`, so that early stopping validates on whole
objects as the paper does. Features are taken as they are. Thresholds and start values
are those of the implementation that the paper used (Gutiérrez et al. 2016), and so is
the limit of 500 iterations; nothing but early stopping ends a search before it. The
estimator is a copy whenever it is asked for.
"""
