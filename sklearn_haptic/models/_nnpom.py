"""The neural-network proportional odds model as an estimator."""

import warnings
from numbers import Integral, Real
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.callback import CallbackSupportMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted

from .._check_ratings import validate_rated_trials, weighted
from .._distributions import macro_error
from .._sklearn import (
    DocumentedEstimator,
    FloatArray,
    Interval,
    Observations,
    RandomState,
    StrOptions,
    _fit_context,
    fit_task,
    one_blas_thread,
    with_callbacks,
)
from .._validation import check_groups, check_table, check_weights
from ._conditioning import EvenedFeatures, change_weights, feature_means, total_spread
from ._early_stopping import hold_out_trials
from ._network import (
    NetworkLoss,
    SharedLoss,
    forward,
    initial_params,
    level_probabilities,
    monotone_bounds,
    split_heads,
    thresholds_from,
    unpack,
)
from ._ordinal import OrdinalClassifierMixin
from ._solvers import Monitor, irprop_plus, lbfgs

# In units of the total weight; more would make no difference but overflow.
_LARGEST_PENALTY = 1e300


# Differences between latent responses and thresholds stay finite.
_LARGEST_LATENT = 1e300


def relative_weights(sample_weight):
    """Weights of trials in units of the largest; all stay above 0."""
    relative = sample_weight / sample_weight.max()
    return np.maximum(relative, np.finfo(np.float64).tiny)


def single_ratings(X, counts, groups, sample_weight):
    """Turn counts into observations without positions: one for each level of a trial.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
    counts : ndarray of shape (n_trials, ..., n_levels)
    groups : ndarray of shape (n_trials,), or None
    sample_weight : ndarray of shape (n_trials,)
        Trials of weight 0 are left out of all that is returned.

    Returns
    -------
    X, groups
    level, weight : ndarray of the shape of `counts`
        What `NNPOM.fit_with_positions` trains on.
    validation_weight : ndarray of the shape of `counts`
        In place of `weight` where it validates: a trial counts by its own weight, by
        however many people it was rated.
    """
    used = sample_weight > 0
    X, counts, sample_weight = X[used], counts[used], sample_weight[used]
    groups = None if groups is None else groups[used]
    level = np.broadcast_to(np.arange(counts.shape[-1]), counts.shape)
    validation_weight = ((counts > 0).T * relative_weights(sample_weight)).T
    return X, groups, level, weighted(counts, sample_weight), validation_weight


def adjectives_of(positions, level, weight):
    """Return positions, level and weight of each adjective."""
    if weight.ndim == 2:
        return [(positions, level, weight)]
    return [
        (None if positions is None else positions[:, i], level[:, i], weight[:, i])
        for i in range(weight.shape[1])
    ]


def rank_levels(positions, level, weight, n_levels):
    """Rank the levels that ratings have, for each adjective from 0 without gaps.

    Parameters
    ----------
    positions, level, weight : ndarray
        As `NNPOM.fit_with_positions` takes them.
    n_levels : int
        Number of all levels.

    Returns
    -------
    present : list of ndarray of int
        The levels that ratings of each adjective have.
    observations : list of (positions, rank, weight)
        Of each adjective with more than one such level; ranks are indices into it.
    level_weights : list of ndarray
        Weight of each of the levels of these adjectives.
    """
    all_present, observations, level_weights = [], [], []
    for positions_of, level_of, weight_of in adjectives_of(positions, level, weight):
        level_weight = np.bincount(
            level_of.ravel(), weight_of.ravel(), minlength=n_levels
        )
        present = np.flatnonzero(level_weight)
        all_present.append(present)
        if len(present) > 1:
            rank = np.searchsorted(present, level_of)
            rank = np.minimum(rank, len(present) - 1)  # where the weight is zero
            observations.append((positions_of, rank, weight_of))
            level_weights.append(level_weight[present])
    return all_present, observations, level_weights


class NNPOM(
    DocumentedEstimator, CallbackSupportMixin, OrdinalClassifierMixin, BaseEstimator
):
    """Proportional-odds ordinal regression on one layer of logistic units.

    The neural-network proportional odds model of Gutiérrez et al. [1]_, with a
    log-likelihood that neither cancels nor overflows. It is trained on single
    ratings or on the counts of many people's ratings, which equals training on
    each rating in turn. ``n_hidden=0`` is the linear proportional odds model.

    Features in different units are best brought to one first
    (`sklearn.preprocessing.StandardScaler`): what varies less than 1e-13 times as much
    as the rest counts as rounding and gets no weight. The unit itself and an offset do
    not matter with ``scale_features=True``; an offset of 1e8 spreads costs
    probabilities eight of their sixteen digits.

    Parameters
    ----------
    n_hidden : int, default=10
        Number of hidden units; 0 for the linear model.
    alpha : float, default=1.0
        L2 penalty (lambda in the paper) of all weights but the hidden biases
        and thresholds, beside the *sum* of the observations' negative
        log-likelihoods: repeating every observation weakens it. Search it on a
        log scale.
    scale_features : bool, default=True
        Centre the features and divide all by the square root of their total
        variance, so that the same alpha and the same start values suit any number
        of features in any unit; `coefs_` are for the features as given. False is
        the paper's.
    solver : {"lbfgs", "irprop+"}, default="lbfgs"
        "irprop+" is the paper's. "lbfgs" reaches the same cost in fewer
        iterations; it works on the features' principal directions, as many as the
        trials span, whatever the number of features.
    max_iter : int, default=500
        Most iterations of the solver.
    tol : float, default=1e-4
        Largest component of the gradient of the mean cost at convergence, for
        "lbfgs" in its own coordinates.
    early_stopping : bool, default=False
        Hold out some trials, measure their error every 10 iterations, stop when
        it has not decreased in ``n_iter_no_change`` iterations, and keep the
        best model. The error is the per-trial macro-averaged absolute error of
        the most probable level. Give `fit` the trials' objects as ``groups``, so
        that whole objects are held out.
    n_iter_no_change : int, default=150
        Patience of early stopping, in iterations.
    validation_fraction : float, default=0.1
        Share of the trials (of the groups, if ``fit`` is given any) held out
        for early stopping.
    levels : array-like of shape (n_levels,), default=None
        All ordered levels, so that one absent from the training data keeps its
        column. By default they are what ``y`` is labelled with: the categories of an
        ordered categorical, or the columns of a table of counts, numbers sorted and
        words in the order of the columns. Without labels they are 1, 2, … for counts
        and the sorted ratings that occur.
    random_state : int, RandomState instance or None, default=None
        Start values of the weights and the validation trials. Without hidden
        units and early stopping nothing is random.

    Attributes
    ----------
    levels_, classes_ : ndarray of shape (n_levels,)
        The ordered levels.
    coefs_ : list of ndarray
        Weights of shape (n_features, n_hidden) into the hidden units and of
        shape (n_hidden,) out of them, (n_hidden, n_adjectives) if several were learnt;
        one array of shape (n_features,) if there are no units.
    intercepts_ : ndarray of shape (n_hidden,)
        Biases of the hidden units.
    thresholds_ : ndarray of shape (n_levels - 1,), or (n_adjectives, n_levels - 1)
        Thresholds between the levels; infinite or equal around levels that no
        training rating has.
    loss_ : float
        Final cost: penalised mean negative log-likelihood.
    loss_curve_ : list of float
        Cost after each iteration.
    n_iter_ : int
        Iterations run.
    n_features_in_ : int
        Number of features.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the features, if they have any.

    See Also
    --------
    DistributionalOrdinalRegressor : Predicts distributions through this network.

    References
    ----------
    .. [1] Gutiérrez, P. A., Pérez-Ortiz, M., Sánchez-Monedero, J.,
       Fernández-Navarro, F. & Hervás-Martínez, C. (2016). Ordinal regression
       methods: survey and experimental study. IEEE Transactions on Knowledge and
       Data Engineering 28(1), 127–146. :doi:`10.1109/TKDE.2015.2457911`

    Examples
    --------
    Five people rate each of four objects; two features describe an object.

    >>> import numpy as np
    >>> from sklearn_haptic import NNPOM
    >>> X = np.array([[-1.0, 0.2], [-0.4, -1.0], [0.3, 0.9], [1.1, -0.1]])
    >>> counts = np.array([[4, 1, 0], [2, 3, 0], [0, 3, 2], [0, 1, 4]])
    >>> model = NNPOM(n_hidden=0).fit(X, counts)
    >>> model.predict_proba([[0.0, 0.0]]).round(2)
    array([[0.2 , 0.59, 0.2 ]])
    >>> model.predict([[-2.0, 0.0], [2.0, 0.0]])
    array([1, 3])
    """

    # Splitters take groups too: passing them does not mean that fit wants them.
    __metadata_request__fit = {"groups": False}  # noqa: RUF012

    _parameter_constraints = {  # noqa: RUF012
        "n_hidden": [Interval(Integral, 0, None, closed="left")],
        "alpha": [Interval(Real, 0, None, closed="left")],
        "scale_features": ["boolean"],
        "solver": [StrOptions({"lbfgs", "irprop+"})],
        "max_iter": [Interval(Integral, 1, None, closed="left")],
        "tol": [Interval(Real, 0, None, closed="left")],
        "early_stopping": ["boolean"],
        "n_iter_no_change": [Interval(Integral, 1, None, closed="left")],
        "validation_fraction": [Interval(Real, 0, 1, closed="neither")],
        "levels": ["array-like", None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        n_hidden: int = 10,
        alpha: float = 1.0,
        *,
        scale_features: bool = True,
        solver: Literal["lbfgs", "irprop+"] = "lbfgs",
        max_iter: int = 500,
        tol: float = 1e-4,
        early_stopping: bool = False,
        n_iter_no_change: int = 150,
        validation_fraction: float = 0.1,
        levels: ArrayLike | None = None,
        random_state: RandomState = None,
    ) -> None:
        self.n_hidden = n_hidden
        self.alpha = alpha
        self.scale_features = scale_features
        self.solver = solver
        self.max_iter = max_iter
        self.tol = tol
        self.early_stopping = early_stopping
        self.n_iter_no_change = n_iter_no_change
        self.validation_fraction = validation_fraction
        self.levels = levels
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        *,
        groups: ArrayLike | None = None,
    ) -> Self:
        """Fit the network to ratings.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.
        y : array-like of shape (n_trials,) or (n_trials, n_levels)
            One rating a trial, or how many people gave each rating. Such counts of
            several adjectives, as an array of shape (n_trials, n_adjectives,
            n_levels), are learnt together: the adjectives share the hidden units.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial, also among those held out for early stopping. 2
            equals the trial given twice, if groups keep both on one side. Penalties
            are beside the weighted sum: a factor of all weights acts like its inverse
            on ``alpha``.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial; early stopping holds out whole objects, and
            warns if it has to do without. In a search or cross-validation they reach
            `fit` after ``sklearn.set_config(enable_metadata_routing=True)`` and
            ``NNPOM(...).set_fit_request(groups=True)``.

        Returns
        -------
        self : NNPOM
            The fitted network.
        """
        X, counts, self.levels_ = validate_rated_trials(self, X, y, self.levels)
        groups = check_groups(groups, X)
        sample_weight = check_weights(sample_weight, X)
        X, groups, level, weight, counted = single_ratings(
            X, counts, groups, sample_weight
        )
        rng = check_random_state(self.random_state)
        if not self.early_stopping:
            return self._fit(X, None, level, weight, None, rng)
        train, held_out = hold_out_trials(
            self, len(X), groups, self.validation_fraction, rng
        )
        validation = X[held_out], None, level[held_out], counted[held_out]
        return self._fit(X[train], None, level[train], weight[train], validation, rng)

    @with_callbacks
    def fit_with_positions(
        self,
        X: FloatArray,
        positions: FloatArray | None,
        level: NDArray[np.integer],
        weight: FloatArray,
        *,
        levels: np.ndarray,
        monotone: bool = False,
        validation: Observations | None = None,
        feature_names: np.ndarray | None = None,
    ) -> Self:
        """Fit as if each trial were repeated with one more feature, its position.

        The cost, its gradient and the fitted model are those of `fit` on the
        repeated rows ``[x, position]``, which are never built. This is what
        `DistributionalOrdinalRegressor` calls on an estimator that has it; the
        input has been validated.

        Parameters
        ----------
        X : ndarray of shape (n_trials, n_features)
            Features of each trial; of shape (n_trials, n_observations, n_features)
            if its observations do not share them.
        positions : ndarray of shape (n_trials, n_observations), or None
            The last feature of each observation, if there is one. Of several
            adjectives, this and the next two have the shape (n_trials, n_adjectives,
            n_observations).
        level : ndarray of int of shape (n_trials, n_observations)
            Index into ``levels`` of each observation's rating.
        weight : ndarray of shape (n_trials, n_observations)
            Weight of each observation.
        levels : ndarray of shape (n_levels,)
            The ordered levels.
        monotone : bool, default=False
            Keep the latent response from falling as the position grows, by
            non-negative weights of the position and out of the hidden units;
            for the "lbfgs" solver.
        validation : tuple of (X, positions, level, weight), default=None
            Trials for early stopping; None for no early stopping. Observations of
            zero weight do not count; those of a trial share its weight.
        feature_names : ndarray of shape (n_features,), default=None
            Names of the features, if they have any; the last feature is named
            ``"position"``.

        Returns
        -------
        self : NNPOM
            The fitted network; the position is the last of its inputs.
        """
        self._validate_params()
        self.n_features_in_ = X.shape[-1] + (positions is not None)
        if feature_names is not None:
            self.feature_names_in_ = np.append(feature_names, "position")
        self.levels_ = levels
        rng = check_random_state(self.random_state)
        if X.ndim == 3:  # each observation is a trial of its own
            used = weight > 0
            X, level, weight = X[used], level[used][:, None], weight[used][:, None]
            positions = None if positions is None else positions[used][:, None]
        return self._fit(X, positions, level, weight, validation, rng, monotone)

    def _fit(self, X, positions, level, weight, validation, rng, monotone=False):
        with fit_task(self, X, max_subtasks=self.max_iter) as task:
            self._minimise(
                X,
                positions,
                level,
                weight,
                validation,
                rng,
                monotone,
                task.on_iteration,
            )
        return self

    @one_blas_thread
    def _minimise(
        self, X, positions, level, weight, validation, rng, monotone, on_iteration
    ):
        if monotone and self.solver != "lbfgs":
            raise ValueError(
                f"monotone=True requires solver='lbfgs', but solver={self.solver!r}; "
                "set one of the two."
            )
        self.classes_ = self.levels_
        n_hidden, n_inputs = self.n_hidden, self.n_features_in_
        self._several = weight.ndim == 3
        if self._several and n_hidden == 0:
            raise ValueError(
                "n_hidden=0 leaves nothing that several adjectives could share; set it "
                "to at least 1, or fit a model to each adjective."
            )
        # Only their ratio matters; a power of four is exact, also under the root.
        exponent = 2 * (np.frexp(weight.sum())[1] // 2)
        with np.errstate(over="ignore"):
            alpha = min(np.ldexp(self.alpha, -exponent), _LARGEST_PENALTY)
        weight = np.ldexp(weight, -exponent)
        self._present, observations, level_weights = rank_levels(
            positions, level, weight, len(self.levels_)
        )
        if not observations:
            self._store_constant()
            return
        n_levels = [len(each) for each in level_weights]
        params = initial_params(n_inputs, n_hidden, level_weights, rng)
        trial_weight = weight.reshape(len(weight), -1).sum(axis=1)
        X = np.ascontiguousarray(X)  # the same sums in any layout
        centre, spread = np.zeros(X.shape[1]), 1.0
        if self.scale_features:
            centre = feature_means(X, trial_weight)
            X = X - centre
            spread = total_spread(X, trial_weight) or 1.0
            X = X / spread
        evened = None
        if self.solver == "lbfgs":
            evened = EvenedFeatures(X, alpha, trial_weight)
            params = change_weights(
                params, evened.to_inputs, X.shape[1], n_hidden, n_inputs
            )
            X = evened.inputs
            n_inputs = X.shape[1] + (positions is not None)
            n_others = n_inputs + 1 - X.shape[1]  # the position and the output
            alpha = np.append(evened.alpha, np.full(n_others, alpha))
        if len(observations) == 1:
            fun = NetworkLoss(X, *observations[0], n_hidden, alpha)
        else:
            fun = SharedLoss(X, observations, n_hidden, alpha)

        def to_features(weights):
            weights = weights if evened is None else evened.to_features(weights)
            return weights / spread

        def of_features(params):
            params = change_weights(params, to_features, X.shape[1], n_hidden, n_inputs)
            coef, bias, _, first, _ = unpack(params, self.n_features_in_, n_hidden)
            at_centre = centre @ coef[: len(centre)]
            if n_hidden:
                bias -= at_centre
            else:
                first += at_centre
            return params

        def validation_error(params):
            self._store(of_features(params), n_levels)
            X_val, *observed = validation
            errors = []
            for i, (at, true, counted) in enumerate(adjectives_of(*observed)):
                latent = forward(X_val, at, *self._weights)[0]
                latent = latent[..., i] if self._several else latent
                predicted = self._proba_of(latent, i).argmax(axis=-1)
                error = macro_error(predicted, true, counted > 0)
                errors.append(np.average(error, weights=counted.max(axis=1)))
            return np.mean(errors)

        monitor = Monitor(
            None if validation is None else validation_error,
            self.n_iter_no_change,
            on_iteration,
        )
        options = {"max_iter": self.max_iter, "tol": self.tol, "callback": monitor}
        if self.solver == "lbfgs":
            bounds = None
            if monotone:
                bounds = monotone_bounds(len(params), n_inputs, n_hidden, n_levels)
                params = np.clip(params, *bounds.T)
            result = lbfgs(fun, params, bounds=bounds, **options)
        else:
            result = irprop_plus(fun, params, **options)
        params, self.n_iter_, converged = result
        if monitor.best_params is not None:
            params = monitor.best_params
        elif not converged:
            warnings.warn(
                f"NNPOM did not converge ({self.n_iter_} iterations, "
                f"max_iter={self.max_iter}); increase max_iter or alpha, unless alpha "
                "is huge, or use early_stopping=True.",
                ConvergenceWarning,
                stacklevel=3,
            )
        self.loss_ = float(fun(params)[0])
        self.loss_curve_ = monitor.costs
        self._store(of_features(params), n_levels)

    def _store(self, params, n_levels):
        coef, bias, heads = split_heads(
            params, self.n_features_in_, self.n_hidden, n_levels
        )
        heads = iter(heads)
        outputs, thresholds, self._present_thresholds = [], [], []
        for present in self._present:
            output, between = np.zeros(self.n_hidden), np.empty(0)
            if len(present) > 1:
                output, first, gap_logits = next(heads)
                between = thresholds_from(first[0], gap_logits)
            # Infinite or equal around levels that no rating has.
            edges = np.concatenate(([-np.inf], between, [np.inf]))
            upper = np.arange(len(self.levels_) - 1)
            thresholds.append(edges[np.searchsorted(present, upper, side="right")])
            self._present_thresholds.append(between)
            outputs.append(output)
        self.intercepts_ = bias
        self.coefs_ = [coef]
        self.thresholds_ = np.stack(thresholds)
        if self.n_hidden:
            self.coefs_.append(np.stack(outputs, axis=1))
        if not self._several:
            self.coefs_[1:] = [output[:, 0] for output in self.coefs_[1:]]
            self.thresholds_ = self.thresholds_[0]

    def _store_constant(self):
        """Fit the model that always predicts the only level there is."""
        n_hidden = self.n_hidden
        self._store(np.zeros(self.n_features_in_ * max(n_hidden, 1) + n_hidden), [])
        self.loss_, self.loss_curve_, self.n_iter_ = 0.0, [], 0

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """Predict the probability of each level.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
            Rows sum to 1; columns as in ``levels_``. Here and in all that is predicted,
            if several adjectives were learnt, they are a further axis behind that of
            the trials.
        """
        return np.ascontiguousarray(self._proba(self.predict_latent(X)))

    def predict_proba_with_positions(
        self, X: FloatArray, positions: FloatArray
    ) -> NDArray[np.float64]:
        """Predict for each trial at each position, sharing the trial's features.

        Parameters
        ----------
        X : ndarray of shape (n_trials, n_features)
            Validated features, without the position.
        positions : ndarray of shape (n_positions,)
            The last feature.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_positions, n_levels)
        """
        return self._proba(self.predict_latent_with_positions(X, positions))

    def predict_latent_with_positions(
        self, X: FloatArray, positions: FloatArray
    ) -> NDArray[np.float64]:
        """Predict the latent response of each trial at each position.

        Parameters
        ----------
        X : ndarray of shape (n_trials, n_features)
            Validated features, without the position.
        positions : ndarray of shape (n_positions,)
            The last feature.

        Returns
        -------
        latent : ndarray of shape (n_trials, n_positions)
            What `thresholds_` cut into levels.
        """
        return self._forward_with_positions(X, positions)[0]

    def validation_share(self) -> float:
        """Share of the trials that early stopping validates on.

        Returns
        -------
        share : float
            ``validation_fraction``; 0 without early stopping.
        """
        return self.validation_fraction if self.early_stopping else 0.0

    def hidden_activations_with_positions(
        self, X: FloatArray, positions: FloatArray
    ) -> NDArray[np.float64]:
        """Activations of the hidden units for each trial at each position.

        Parameters
        ----------
        X : ndarray of shape (n_trials, n_features)
            Validated features, without the position.
        positions : ndarray of shape (n_positions,) or (n_trials, n_positions)
            The last feature.

        Returns
        -------
        hidden : ndarray of shape (n_trials, n_positions, n_hidden)
            Values in [0, 1].
        """
        return self._forward_with_positions(X, positions)[1]

    def _forward_with_positions(self, X, positions):
        return self._apply(X, np.atleast_2d(positions))

    def predict(self, X: ArrayLike) -> np.ndarray:
        """Predict the most probable level.

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

    def predict_latent(self, X: ArrayLike) -> NDArray[np.float64]:
        """Predict the latent response f, which the thresholds cut into levels.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.

        Returns
        -------
        latent : ndarray of shape (n_trials,)
        """
        return self._forward(X)[0][:, 0]

    def hidden_activations(self, X: ArrayLike) -> NDArray[np.float64]:
        """Activations of the hidden units, the network's own features.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.

        Returns
        -------
        hidden : ndarray of shape (n_trials, n_hidden)
            Values in [0, 1]; no columns for the linear model.
        """
        latent, hidden = self._forward(X)
        return np.empty((len(latent), 0)) if hidden is None else hidden[:, 0]

    def _forward(self, X):
        check_is_fitted(self)
        X = check_table(self, X, dtype=np.float64, reset=False)
        return self._apply(X, None)

    @property
    def _weights(self):
        output = self.coefs_[1] if len(self.coefs_) > 1 else self.intercepts_
        return self.coefs_[0], self.intercepts_, output

    @one_blas_thread
    def _apply(self, X, positions):
        latent, hidden = forward(X, positions, *self._weights)
        return np.clip(latent, -_LARGEST_LATENT, _LARGEST_LATENT), hidden

    def _proba(self, latent):
        if not self._several:
            return self._proba_of(latent, 0)
        each = [self._proba_of(f, i) for i, f in enumerate(np.moveaxis(latent, -1, 0))]
        return np.stack(each, axis=-2)

    def _proba_of(self, latent, adjective):
        levels = self._present[adjective]
        present = level_probabilities(latent, self._present_thresholds[adjective])
        if len(levels) == len(self.levels_):
            return present
        proba = np.zeros((*latent.shape, len(self.levels_)))
        proba[..., levels] = present
        return proba
