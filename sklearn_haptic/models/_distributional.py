"""Distributions of ratings from any ordinal model, by sweeping the population.

Richardson & Kuchenbecker (2020) let a model predict one rating for each position
p of a rater in the population: every trial is duplicated, each duplicate carries
a position as one more feature, and its label is the object's inverse CDF there.
At prediction p sweeps the population.
"""

import warnings
from numbers import Integral
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit, logit
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone, is_regressor
from sklearn.callback import CallbackSupportMixin
from sklearn.frozen import FrozenEstimator
from sklearn.utils import check_random_state, gen_batches
from sklearn.utils._param_validation import HasMethods, Interval, StrOptions
from sklearn.utils.validation import (
    check_consistent_length,
    check_is_fitted,
    has_fit_parameter,
)

from .._check_ratings import check_attributes, validate_rated_trials, weighted
from .._check_trials import check_numbers, check_table
from .._distributions import _level_index
from .._sklearn import DocumentedEstimator, RandomState, _fit_context
from .._validation import check_groups, check_weights
from ._early_stopping import hold_out_trials, validates_on_rows
from ._frozen import check_frozen, unfrozen
from ._nnpom import NNPOM
from ._observations import relative_weights
from ._ordinal import OrdinalClassifierMixin
from ._quantile_positions import (
    crossing_positions,
    largest_jump_error,
    population_cells,
    population_quadrature,
    quantile_grid,
    share_below,
    training_observations,
)

# With 20 nodes the distribution function is off by less than 1e-4 for weights of the
# log-odds up to 2, 1e-3 up to 4. They are used if on some training trials they differ
# by no more than this from the first number of cells.
_MIXTURE_NODES = 20


_SMOOTH_ERROR, _SMOOTH_TRIALS = 0.003, 32


# What jumps is averaged over cells, over more while they may be off by this much.
_CELLS = (384, 1024, 4096, 16384)


_JUMP_ERROR = 0.0045


# With 33 nodes networks of up to 30 units were off by less than 1e-2, 1e-4 on average,
# where a grid of 99 positions is off by 1e-2.
_CROSSING_NODES = 33


# Few trials at a time, so that what is predicted for them stays in the cache; of rows
# that are repeated for every position no more than so many, and so many values.
_BATCH_SIZE, _BATCH_ROWS, _BATCH_VALUES = 256, 2**14, 2**22


def decide(proba, rule):
    """Index of the one level a distribution stands for, over the last axis."""
    if rule == "argmax":
        return proba.argmax(axis=-1)
    return np.sum(np.cumsum(proba[..., :-1], axis=-1) < 0.5, axis=-1)


class DistributionalOrdinalRegressor(
    DocumentedEstimator,
    CallbackSupportMixin,
    MetaEstimatorMixin,
    OrdinalClassifierMixin,
    BaseEstimator,
):
    """Predict the distribution of the ratings a crowd would give.

    Any ordinal model, classifier or regressor is trained on observations of
    each trial at several positions p of the population of raters, and predicts
    a distribution by letting p sweep the population [1]_.

    Parameters
    ----------
    estimator : estimator object, default=None
        What predicts a rating from features and position. By default
        ``NNPOM(n_hidden=0, alpha=3)``. `NNPOM`, or another that has the methods
        named in the Notes, shares a trial's features between its observations; any
        other is fitted on one row for each observation, labelled 0, 1, … by level.
        One in a `sklearn.frozen.FrozenEstimator` is used as it was fitted, to the
        features and the position as given by ``p_transform``; `fit` then only checks
        that its inputs and levels are those of the trials.
    n_duplicates : int, default=15
        Observations of each trial. Their weights sum to this number, which an
        estimator's penalty works against.
    sampling : {"level", "lattice", "stratified", "random"}, default="level"
        How positions are chosen. "level": quadrature nodes within the stretch
        of the population at each level, weighted by its size, so that no rating
        is missed and nothing is random; the estimator must take sample weights.
        "lattice": evenly spaced, turned for each trial. "stratified": at random
        within even stretches. "random": at random (the paper).
    p_transform : {"logit", None}, default="logit"
        What is given to the estimator as its last feature: the log-odds of p,
        which reach into the tails of the distribution, or p itself (the paper).
    balance : {"macro", None}, default=None
        "macro" lets the levels of a trial count equally, however many people
        chose them, as the macro-averaged error does.
    monotone : bool, default=False
        Constrain `NNPOM` to ratings that never fall as p grows. Predicted
        distributions are sorted in any case.
    decode : {"mixture", "quantile"}, default="mixture"
        "mixture" averages the probabilities of the levels over the population:
        calibrated, better by RPS and log score. "quantile" decides on one
        rating at each position and measures the share of each (the paper):
        sharper, better by absolute error, with probabilities that are often
        exactly 0. This parameter and the next two are choices at prediction:
        `set_params` may change them after `fit`.
    rule : {"median", "argmax"}, default="median"
        How "quantile" decides: the median level, at every position, or the most
        probable, at ``n_quantiles`` positions (the paper).
    n_quantiles : int, default=99
        Positions of the rule "argmax", and of the ratings of trials held out for
        early stopping, evenly spaced: 0.01, …, 0.99.
    levels : array-like of shape (n_levels,), default=None
        All ordered levels, so that one absent from the training data keeps its
        column. By default they are what ``y`` is labelled with: the categories of an
        ordered categorical, or the columns of a table of counts, numbers sorted and
        words in the order of the columns. Without labels they are 1, 2, … for counts
        and the sorted ratings that occur.
    random_state : int, RandomState instance or None, default=None
        Random positions, validation trials, and the ``random_state`` of
        ``estimator``, which is left as it is if this is None.

    Attributes
    ----------
    estimator_ : estimator object
        The fitted estimator, with the position as its last feature.
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
    rewards the first, proper scores reward the second.

    Several attributes, such as the adjectives of a corpus, may be learnt together by
    an `NNPOM` with hidden units: the attributes share these, and each has output
    weights and thresholds of its own. It is one fit, and what one attribute tells of
    a touch can help with another, as the paper suggests [1]_ (section 4.2). The
    penalty works against the observations of all attributes, so it can be larger.

    An estimator may offer three methods, documented with `NNPOM`:
    ``fit_with_positions`` and ``predict_proba_with_positions`` take the features of a
    trial once for all its positions, and ``predict_latent_with_positions``, with
    ``thresholds_``, lets "quantile" find by the rule "median" where the latent
    response crosses each threshold.

    The population is swept on 20 quadrature nodes where these suffice, which `fit`
    finds out on some of its trials, as for a `NNPOM` or a logistic regression. What
    jumps as p grows, such as trees or any regressor, whose ratings are rounded, is
    predicted at 384 positions, and at 1024 more for trials whose jumps need them, so
    that the distribution function is off by less than 0.005 (`benchmarks/ordinal.py`).

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

    # Splitters take groups too: passing them does not mean that fit wants them.
    __metadata_request__fit = {"groups": False}  # noqa: RUF012

    _parameter_constraints = {  # noqa: RUF012
        "estimator": [HasMethods(["fit", "predict"]), None],
        "n_duplicates": [Interval(Integral, 1, None, closed="left")],
        "sampling": [StrOptions({"level", "lattice", "stratified", "random"})],
        "p_transform": [StrOptions({"logit"}), None],
        "balance": [StrOptions({"macro"}), None],
        "monotone": ["boolean"],
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
        sampling: Literal["level", "lattice", "stratified", "random"] = "level",
        p_transform: Literal["logit"] | None = "logit",
        balance: Literal["macro"] | None = None,
        monotone: bool = False,
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
        self.balance = balance
        self.monotone = monotone
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
            How many people gave the trial's object each rating, or one rating. Such
            counts of several attributes, as an array of shape (n_trials,
            n_attributes, n_levels), are learnt together; see the Notes.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial, also among those held out for early stopping. With
            ``sampling="level"`` 2 equals the trial given twice, if groups keep both
            on one side; the other samplings draw positions for each trial. A factor
            of all weights acts like its inverse on the estimator's penalty.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial, so that an estimator with
            ``early_stopping=True`` validates on whole objects; it warns if it has
            to do without. In a search or cross-validation they reach `fit` after
            ``sklearn.set_config(enable_metadata_routing=True)`` and
            ``DistributionalOrdinalRegressor(...).set_fit_request(groups=True)``.
        X_val : array-like of shape (n_val_trials, n_features), default=None
            Trials on which an estimator with ``early_stopping=True`` validates; by
            default a share of those in ``X``.
        y_val : array-like of shape (n_val_trials, n_levels) or (n_val_trials,), \
                default=None
            Their ratings.

        Returns
        -------
        self : DistributionalOrdinalRegressor
            The fitted regressor.
        """
        frozen = isinstance(self.estimator, FrozenEstimator)
        levels = self.levels
        if levels is None and frozen:
            levels = getattr(self.estimator, "levels_", None)
        X, counts, self.levels_ = validate_rated_trials(self, X, y, levels)
        self.classes_ = self.levels_
        groups = check_groups(groups, X)
        sample_weight = check_weights(sample_weight, X)
        used = sample_weight > 0
        X, counts, sample_weight = X[used], counts[used], sample_weight[used]
        groups = None if groups is None else groups[used]
        rng = check_random_state(self.random_state)
        self.estimator_ = self._make_estimator(rng)
        self._p_transform = self.p_transform
        self._shares_features = hasattr(self.estimator_, "fit_with_positions")
        validation = self._check_validation(X_val, y_val)
        if frozen:
            self._check_frozen(X, counts)
            self._smooth = self._is_smooth(X)
            return self
        positions, level, weight = (
            each.reshape(*counts.shape[:-1], -1)
            for each in training_observations(
                counts.reshape(-1, counts.shape[-1]),
                self.n_duplicates,
                self.sampling,
                self.balance,
                rng,
            )
        )
        weight = weighted(weight, sample_weight)
        inputs = self._transform(positions)
        if validation is not None:
            validation = self._validation_set(*validation)
        elif self._shares_features and getattr(
            self.estimator_, "early_stopping", False
        ):
            train, held_out = hold_out_trials(
                self, len(X), groups, self.estimator_.validation_fraction, rng
            )
            validation = self._validation_set(
                X[held_out], counts[held_out], relative_weights(sample_weight)[held_out]
            )
            X, inputs, level, weight = (a[train] for a in (X, inputs, level, weight))
        context = self._init_callback_context(max_subtasks=1)
        context.call_on_fit_task_begin(estimator=self, X=X, y=y)
        task = context.subcontext(task_name="fit estimator")
        with task.propagate_callback_context(self.estimator_):
            if self._shares_features:
                self.estimator_.fit_with_positions(
                    X,
                    inputs,
                    level,
                    weight,
                    levels=self.levels_,
                    monotone=self.monotone,
                    validation=validation,
                    feature_names=getattr(self, "feature_names_in_", None),
                )
            else:
                self._fit_repeated_rows(X, inputs, level, weight)
        self._smooth = self._is_smooth(X)
        context.call_on_fit_task_end(
            estimator=self, X=X, y=y, reconstruction_attributes={}
        )
        return self

    def _check_validation(self, X_val, y_val):
        """Return the validation trials and their counts, None if none are given."""
        if X_val is None and y_val is None:
            return None
        if X_val is None or y_val is None:
            raise ValueError("X_val and y_val belong together; give both or neither.")
        if isinstance(self.estimator, FrozenEstimator) or not (
            self._shares_features and getattr(self.estimator_, "early_stopping", False)
        ):
            raise ValueError(
                "X_val requires an estimator that stops early; use an NNPOM with "
                "early_stopping=True, or leave X_val and y_val out."
            )
        X_val = check_table(self, X_val, dtype=np.float64, reset=False)
        counts, _ = check_attributes(y_val, self.levels_, name="y_val")
        check_consistent_length(X_val, counts)
        return X_val, counts

    def _check_frozen(self, X, counts):
        """Check a fitted estimator, which takes features and the position."""
        if self.monotone:
            raise ValueError(
                "monotone=True constrains what is fitted, but estimator is frozen; set "
                "monotone=False, predicted distributions are sorted in any case."
            )
        self._present = np.arange(len(self.levels_))
        levels = self.levels_ if self._shares_features else self._present
        if is_regressor(self.estimator_):
            levels = None
        n_inputs = X.shape[1] + 1
        check_frozen(
            self.estimator,
            "estimator",
            n_inputs,
            levels,
            names=getattr(self, "feature_names_in_", None),
            position=True,
        )
        middle = self._transform(np.array([0.5]))
        predicted = self._predict_at(X[:1], middle).shape[2:]
        if predicted != counts.shape[1:]:
            raise ValueError(
                f"estimator is frozen and predicts an array of shape {predicted} for a "
                f"trial, but y has {counts.shape[1:]}; fit it to the same attributes "
                "and levels."
            )

    def _make_estimator(self, rng):
        if self.estimator is None:
            estimator = NNPOM(n_hidden=0, alpha=3.0)
        else:
            estimator = clone(self.estimator)
        if isinstance(estimator, FrozenEstimator):
            return unfrozen(estimator)
        if self.random_state is not None:
            seed = int(rng.randint(np.iinfo(np.int32).max))
            names = [
                name
                for name in estimator.get_params()
                if name == "random_state" or name.endswith("__random_state")
            ]
            estimator.set_params(**dict.fromkeys(names, seed))
        return estimator

    def _transform(self, positions):
        return logit(positions) if self._p_transform == "logit" else positions

    def _validation_set(self, X, counts, sample_weight=1.0):
        """Trials at the positions of the grid, with their true ratings there."""
        grid = quantile_grid(self.n_quantiles)
        rows = counts.reshape(-1, counts.shape[-1])
        level = _level_index(rows, np.broadcast_to(grid, (len(rows), len(grid))))
        level = level.reshape(*counts.shape[:-1], -1)
        inputs = np.broadcast_to(self._transform(grid), level.shape)
        return X, inputs, level, (np.ones(level.shape).T * sample_weight).T

    def _fit_repeated_rows(self, X, inputs, level, weight):
        name = type(self.estimator_).__name__
        if self.monotone:
            raise ValueError(
                f"monotone=True requires an NNPOM, but estimator is a {name}; set "
                "monotone=False, predicted distributions are sorted in any case."
            )
        if weight.ndim == 3:
            raise ValueError(
                f"y has the ratings of several attributes, which {name} cannot share; "
                "use an NNPOM, or fit a model to each attribute."
            )
        used = weight > 0
        rows = np.column_stack((X, np.zeros(len(X))))[np.nonzero(used)[0]]
        rows[:, -1] = inputs[used]
        level, weight = level[used], weight[used]
        self._present = np.unique(level)
        if not is_regressor(self.estimator_):  # classes without gaps
            level = np.searchsorted(self._present, level)
        if validates_on_rows(self.estimator_, len(rows)):
            warnings.warn(
                f"{name} stops early by rows that it holds out itself, other positions "
                "of the trials that it learns from, and so stops too late; set its "
                "early_stopping=False (or n_iter_no_change=None).",
                UserWarning,
                stacklevel=4,  # beyond this, fit, and its decorator
            )
        if np.ptp(weight) == 0:
            self.estimator_.fit(rows, level)
            return
        if not has_fit_parameter(self.estimator_, "sample_weight"):
            raise ValueError(
                f"{name} takes no sample_weight, which sampling={self.sampling!r} and "
                f"balance={self.balance!r} need for these ratings; use "
                "sampling='lattice' with balance=None."
            )
        self.estimator_.fit(rows, level, sample_weight=weight)

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """Predict the distribution of ratings.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
            Share of the population at each level; rows sum to 1. Here and in all
            that is predicted, if several attributes were learnt, they are a further
            axis behind that of the trials.
        """
        check_is_fitted(self)
        X = check_table(self, X, dtype=np.float64, reset=False)
        proba = self._decode(X)
        return proba / proba.sum(axis=-1, keepdims=True)

    def _decode(self, X):
        if self.decode == "mixture":
            if self._smooth:
                return self._average(X, *population_quadrature(_MIXTURE_NODES))
            return self._average_over_cells(X)
        if self.rule == "argmax":
            grid = quantile_grid(self.n_quantiles)
            return self._average(X, grid, np.ones(len(grid)), "argmax")
        if hasattr(self.estimator_, "predict_latent_with_positions"):
            batches = gen_batches(len(X), _BATCH_SIZE)
            return np.concatenate([self._decode_latent(X[batch]) for batch in batches])
        return self._average_over_cells(X, "median")

    def _is_smooth(self, X):
        """Whether few nodes give about the same mixture of training trials as many."""
        some = X[:: max(1, len(X) // _SMOOTH_TRIALS)][:_SMOOTH_TRIALS]
        few = self._average(some, *population_quadrature(_MIXTURE_NODES))
        many = self._average(some, *population_cells(_CELLS[0]))
        return np.abs(np.cumsum(few - many, axis=-1)).max() <= _SMOOTH_ERROR

    def _average_over_cells(self, X, rule=None):
        """Average what may jump anywhere, with more cells for the trials that need."""
        cells = population_cells(_CELLS[0])
        proba, error = self._average(X, *cells, rule, with_error=True)
        rough = np.flatnonzero(error > _JUMP_ERROR)
        for n_cells in _CELLS[1:]:
            if len(rough) == 0:
                break
            cells = population_cells(n_cells)
            proba[rough], error = self._average(X[rough], *cells, rule, with_error=True)
            rough = rough[error > _JUMP_ERROR]
        return proba

    def _average(self, X, positions, weight, rule=None, *, with_error=False):
        """Average probabilities, or what a rule decides, over positions.

        With `with_error` also return the largest error by jumps between positions.
        """
        size = _BATCH_SIZE
        if not hasattr(self.estimator_, "predict_proba_with_positions"):
            rows = min(_BATCH_ROWS, _BATCH_VALUES // X.shape[1])
            size = max(1, min(size, rows // len(positions)))
        inputs, averages, errors = self._transform(positions), [], []
        for batch in gen_batches(len(X), size):
            at_position = self._predict_at(X[batch], inputs)
            if rule is not None:
                decided = decide(at_position, rule)[..., None]
                at_position = (decided == np.arange(len(self.levels_))).astype(float)
            averages.append(np.einsum("tp...,p->t...", at_position, weight))
            if with_error:
                cdf = np.cumsum(at_position, axis=-1)
                errors.append(largest_jump_error(cdf, weight))
        average = np.concatenate(averages)
        return (average, np.concatenate(errors)) if with_error else average

    def _decode_latent(self, X):
        """Quantile decoding at every position: where f crosses the thresholds."""
        to_position = expit if self._p_transform == "logit" else np.positive
        inputs = self._transform(crossing_positions(_CROSSING_NODES))
        latent = self.estimator_.predict_latent_with_positions(X, inputs)
        thresholds = self.estimator_.thresholds_
        if latent.ndim == 2:
            cdf = share_below(latent, thresholds, inputs, to_position)
        else:
            each = [
                share_below(f, between, inputs, to_position)
                for f, between in zip(np.moveaxis(latent, -1, 0), thresholds)
            ]
            cdf = np.stack(each, axis=1)
        return np.maximum(np.diff(cdf, axis=-1, prepend=0, append=1), 0)

    def _predict_at(self, X, inputs):
        """Probabilities of shape (n_trials, n_positions, n_levels)."""
        if hasattr(self.estimator_, "predict_proba_with_positions"):
            return self.estimator_.predict_proba_with_positions(X, inputs)
        n_levels = len(self.levels_)
        rows = np.column_stack((X, np.zeros(len(X)))).repeat(len(inputs), axis=0)
        rows[:, -1] = np.tile(inputs, len(X))
        proba = np.zeros((len(rows), n_levels))
        if is_regressor(self.estimator_):
            level = np.rint(self.estimator_.predict(rows)).astype(int)
            proba[np.arange(len(rows)), np.clip(level, 0, n_levels - 1)] = 1
        elif hasattr(self.estimator_, "predict_proba"):
            proba[:, self._present] = self.estimator_.predict_proba(rows)
        else:
            level = self._present[self.estimator_.predict(rows)]
            proba[np.arange(len(rows)), level] = 1
        return proba.reshape(len(X), len(inputs), n_levels)

    def predict_cdf(self, X: ArrayLike) -> NDArray[np.float64]:
        """Predict the share of the population at each level or below.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.

        Returns
        -------
        cdf : ndarray of shape (n_trials, n_levels)
            Rows rise to exactly 1.
        """
        return _cdf(self.predict_proba(X))

    def predict_quantile(self, X: ArrayLike, p: ArrayLike) -> np.ndarray:
        """Predict the rating of the people at given positions.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.
        p : float or array-like of shape (n_positions,)
            Positions in the population, from 0 (lowest rating) to 1.

        Returns
        -------
        rating : ndarray of shape (n_trials,) or (n_trials, n_positions)
            The inverse of `predict_cdf`; never falls as p grows.
        """
        return _quantile(self.predict_proba(X), p, self.levels_)

    def predict(self, X: ArrayLike) -> np.ndarray:
        """Predict the most common rating; ``predict_quantile(X, 0.5)`` is the median.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.

        Returns
        -------
        rating : ndarray of shape (n_trials,)
        """
        proba = self.predict_proba(X)
        return self.levels_[proba.argmax(axis=-1)]

    def sample(
        self, X: ArrayLike, n_samples: int = 1, *, random_state: RandomState = None
    ) -> np.ndarray:
        """Draw ratings of random people from the predicted distributions.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.
        n_samples : int, default=1
            Number of people.
        random_state : int, RandomState instance or None, default=None
            Who they are.

        Returns
        -------
        rating : ndarray of shape (n_trials, n_samples)
        """
        if not isinstance(n_samples, Integral) or n_samples < 1:
            raise ValueError(f"n_samples={n_samples!r} must be a positive integer.")
        proba = self.predict_proba(X)
        rows = proba.reshape(-1, proba.shape[-1])
        p = check_random_state(random_state).uniform(size=(len(rows), n_samples))
        rating = self.levels_[_level_index(rows, p)]
        return rating.reshape(*proba.shape[:-1], n_samples)


def _cdf(proba):
    cdf = np.cumsum(proba, axis=-1)
    cdf[..., -1] = 1.0
    return np.minimum(cdf, 1.0)


def _quantile(proba, p, levels):
    check_numbers(p, "p")
    p = np.asarray(p, dtype=np.float64)
    if p.ndim > 1 or not np.all((p >= 0) & (p <= 1)):
        raise ValueError(
            "p must be a number or a list of numbers from 0 to 1; got "
            f"{p.tolist() if p.size < 10 else p.shape}."
        )
    rows = proba.reshape(-1, proba.shape[-1])
    index = _level_index(rows, np.broadcast_to(p, (len(rows), p.size)))
    return levels[index].reshape(*proba.shape[:-1], *p.shape)


PAPER_2020: dict[str, Any] = {
    "estimator": NNPOM(
        n_hidden=10,
        alpha=1.0,
        scale_features=False,
        solver="irprop+",
        max_iter=500,
        early_stopping=True,
        n_iter_no_change=150,
        validation_fraction=1 / 9,
    ),
    "n_duplicates": 15,
    "sampling": "random",
    "p_transform": None,
    "balance": None,
    "monotone": False,
    "decode": "quantile",
    "rule": "argmax",
    "n_quantiles": 99,
}
"""Parameters of `DistributionalOrdinalRegressor` in Richardson & Kuchenbecker.

The paper chooses ``estimator__n_hidden`` among 1, 5, 10, 20, 30 and
``estimator__alpha`` among 0.001 … 10 on validation objects.
Pass the trials' objects to ``fit`` as `groups`, so that early stopping validates
on whole objects as the paper does.
"""
