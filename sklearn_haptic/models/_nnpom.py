"""The neural-network proportional odds model as an estimator."""

from __future__ import annotations

import warnings
from numbers import Integral, Real
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.callback import CallbackSupportMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils import check_random_state

from ..utils._folds import TakesGroups
from ..utils._sklearn import (
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
from ..utils._validation import check_features
from ._conditioning import Conditioning
from ._network import Layout, Network
from ._network_loss import NetworkLoss
from ._newton_cg import LinearProblem, fit_linear
from ._observations import (
    one_trial_each,
    rank_levels,
    scaled_to_unit_weight,
    single_ratings,
    used_trials,
)
from ._ordinal import OrdinalClassifierMixin
from ._proportional_odds import GAPS, thresholds_of_all_levels
from ._shared_features import hold_out_trials, refuse_adjectives
from ._solvers import SOLVERS, Monitor, validation_error


class NNPOM(TakesGroups, CallbackSupportMixin, OrdinalClassifierMixin, BaseEstimator):
    """Proportional-odds ordinal regression on one layer of logistic units.

    The neural-network proportional odds model of Gutiérrez et al. [1]_, with a
    log-likelihood that neither cancels nor overflows. It is trained on single
    ratings or on the counts of many people's ratings, which equals training on
    each rating in turn. ``n_hidden=0`` is the linear proportional odds model.

    Bring features in different units to a common one first, for example with
    `sklearn.preprocessing.StandardScaler`: the penalty holds those of small numbers
    back. Simulated friction beside a force in newtons had an RPS of .55, beside
    millinewtons .71, that of a guess. A feature that varies less than max(n_trials,
    n_features) rounding errors (2.2e-16) times as much as the others cannot be told
    from rounding and gets no weight. With ``scale_features=True`` neither the common
    unit nor an offset matters, except that an offset of 1e8 times the spread costs the
    probabilities eight of their sixteen digits.

    Parameters
    ----------
    n_hidden : int, default=10
        Number of hidden units; 0 for the linear model.
    alpha : float, default=1.0
        L2 penalty (lambda in the paper) of all weights, but not of the hidden biases
        and thresholds. It is added to the *sum* of the observations' negative
        log-likelihoods, so repeating every observation weakens it. Search it on a log
        scale.
    scale_features : bool, default=True
        Centre the features and divide all by the square root of their total
        variance, so that the same alpha and the same start values suit any number
        of features in any common unit; `coefs_` are for the features as given. The
        paper does not scale.
    gaps : {"softplus", "squared"}, default="softplus"
        What makes the gap between two thresholds, which must be positive, of a free
        parameter t: its softplus, log(1 + exp(t)), or its square, as in the paper.
        Parameters start evenly spread over (-0.5, 0.5), so gaps start between 0.47 and
        0.97 or between 0 and 0.25. Squares have a minimum for either sign of t, and the
        cost rises without bound between them. The linear model has no use for it.
    solver : {"lbfgs", "irprop+"}, default="lbfgs"
        Solver of networks with hidden units. The paper uses "irprop+". "lbfgs" reaches
        the same cost in fewer iterations; it works on the features' principal
        directions, of which there are at most as many as trials, whatever the number of
        features. The linear model is fitted by Newton's method with conjugate
        gradients, in time and memory that grow as the table of features, which is not
        copied; a float32 table stays float32.
    max_iter : int, default=500
        Largest number of iterations of the solver.
    tol : float, default=1e-4
        The solver has converged when no component of the gradient of the mean cost
        exceeds this; "lbfgs" measures the gradient in its own coordinates. The linear
        model has converged when a Newton step changes the latent responses by no more
        than this, root mean square; the next step would change them by about a tenth.
    early_stopping : bool, default=False
        Set validation trials aside, measure their error every 10 iterations, stop when
        it has not decreased in ``n_iter_no_change`` iterations, and keep the best
        model. The error is the absolute error of the most probable level,
        macro-averaged per trial. Give `fit` the trials' objects as ``groups``, so that
        whole objects validate. The linear model, which has one optimum, ignores this.
    n_iter_no_change : int, default=150
        Patience of early stopping, in iterations.
    validation_fraction : float, default=0.1
        Share of the trials (of the groups, if ``fit`` is given any) that validate
        for early stopping.
    levels : array-like of shape (n_levels,), default=None
        All ordered levels, so that one absent from the training data keeps its
        column. By default they are what ``y`` is labelled with: the categories of an
        ordered categorical, or the columns of a table of counts, numbers sorted and
        words in the order of the columns. Without labels they are 1, 2, … for counts
        and the sorted ratings that occur.
    random_state : int, RandomState instance or None, default=None
        Draws the start values of the weights and the validation trials. Without
        hidden units nothing is random. With a weak penalty a network has several
        minima, and which one it reaches also depends, by rounding, on the order of the
        trials.

    Attributes
    ----------
    levels_, classes_ : ndarray of shape (n_levels,)
        The ordered levels.
    coefs_ : list of ndarray
        Weights of shape (n_features, n_hidden) into the hidden units and of
        shape (n_hidden,) out of them, or (n_hidden, n_adjectives) if several were
        learned; one array of shape (n_features,) if there are no units.
    intercepts_ : ndarray of shape (n_hidden,)
        Biases of the hidden units.
    thresholds_ : ndarray of shape (n_levels - 1,), or (n_adjectives, n_levels - 1)
        Thresholds between the levels; infinite or equal around levels without a
        training rating.
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

    _parameter_constraints = {  # noqa: RUF012
        "n_hidden": [Interval(Integral, 0, None, closed="left")],
        "alpha": [Interval(Real, 0, None, closed="left")],
        "scale_features": ["boolean"],
        "gaps": [StrOptions(set(GAPS))],
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
        gaps: Literal["softplus", "squared"] = "softplus",
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
        self.gaps = gaps
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
            One rating per trial, or how many people gave each rating. Such counts of
            several adjectives, as an array of shape (n_trials, n_adjectives,
            n_levels), are learned together: the adjectives share the hidden units.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial, in training and in validation. A weight of 2 equals
            the trial given twice, if groups keep both on one side. The penalty is added
            to the weighted sum: multiplying all weights by a factor acts like dividing
            ``alpha`` by it.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial. Early stopping validates on whole objects, and
            warns without groups.

        Returns
        -------
        self : NNPOM
        """
        X, counts, levels, sample_weight, groups = used_trials(
            self, X, y, self.levels, sample_weight, groups
        )
        level, weight, validation_weight = single_ratings(counts, sample_weight)
        rng = check_random_state(self.random_state)
        train, validation = slice(None), None
        share = self.validation_share()
        if share > 0:
            train, v = hold_out_trials(self, len(X), groups, share, rng)
            validation = X[v], None, level[v], validation_weight[v]
        observed = X[train], None, level[train], weight[train]
        return self._fit(observed, validation, levels, rng)

    @with_callbacks
    def fit_with_positions(
        self,
        X: FloatArray,
        positions: FloatArray | None,
        level: NDArray[np.integer],
        weight: FloatArray,
        *,
        levels: np.ndarray,
        validation: Observations | None = None,
        feature_names: np.ndarray | None = None,
    ) -> Self:
        """Fit as if each trial were repeated with one more feature, its position.

        The cost, its gradient and the fitted model are those of `fit` on the
        repeated rows ``[x, position]``, which are never built; but
        ``scale_features`` scales X alone. `DistributionalOrdinalRegressor` calls this,
        with validated input, on an estimator that has it.

        Parameters
        ----------
        X : ndarray of shape (n_trials, n_features)
            Features of each trial; of shape (n_trials, n_observations, n_features)
            if its observations do not share them, with an axis for several adjectives
            as below.
        positions : ndarray of shape (n_trials, n_observations), or None
            The last feature of each observation, if there is one. For several
            adjectives, this and the next two have the shape (n_trials, n_adjectives,
            n_observations).
        level : ndarray of int of shape (n_trials, n_observations)
            Index into ``levels`` of each observation's rating.
        weight : ndarray of shape (n_trials, n_observations)
            Weight of each observation.
        levels : ndarray of shape (n_levels,)
            The ordered levels.
        validation : tuple of (X, positions, level, weight), default=None
            Validation trials; None for no early stopping. Observations of zero weight
            do not count; all others of a trial have the trial's weight.
        feature_names : ndarray of shape (n_features,), default=None
            Names of the features, if they have any; the last feature is named
            ``"position"``.

        Returns
        -------
        self : NNPOM
            The fitted network; the position is the last of its inputs.
        """
        self._validate_params()
        rng = check_random_state(self.random_state)
        train = X, positions, level, weight
        if X.ndim > 2:
            train = one_trial_each(*train)
        self._fit(train, validation, levels, rng)
        self.n_features_in_ = X.shape[-1] + (positions is not None)
        if feature_names is not None:
            self.feature_names_in_ = np.append(feature_names, "position")
        return self

    def _fit(self, train, validation, levels, rng):
        """Fit to validated observations; attributes are set once the fit is over."""
        X, _, _, weight = train
        several = weight.ndim == 3
        if several and self.n_hidden == 0:
            refuse_adjectives("NNPOM with n_hidden=0")
        with fit_task(self, X, max_subtasks=self.max_iter) as task:
            if self.n_hidden == 0:
                fit_linear_networks([self], X, [train[1:]], levels, task.on_iteration)
            else:
                found = self._minimise(train, validation, len(levels), rng, task)
                self._take(*found, levels, several)
        return self

    def _take(self, network, loss, loss_curve, n_iter, levels, several=False):
        """Set what was fitted."""
        self.loss_, self.loss_curve_, self.n_iter_ = loss, loss_curve, n_iter
        output, thresholds = network.output, network.thresholds
        if not several:
            output, thresholds = output[:, 0], thresholds[0]
        self.coefs_ = [network.coef, output] if self.n_hidden else [network.coef]
        self.intercepts_, self.thresholds_ = network.bias, thresholds
        self.levels_ = self.classes_ = levels

    @one_blas_thread
    def _minimise(self, train, validation, n_levels, rng, task):
        """Return the network, its cost, the cost after each iteration, their number."""
        X, positions, level, weight = train
        weight, alpha = scaled_to_unit_weight(weight, self.alpha)
        adjectives = rank_levels(positions, level, weight, n_levels)
        present = [each.present for each in adjectives]
        learned = [each for each in adjectives if len(each.present) > 1]
        n_inputs = X.shape[1] + (positions is not None)
        n_present = tuple(len(each.present) for each in learned)
        layout = Layout(n_inputs, self.n_hidden, n_present, GAPS[self.gaps])
        if not learned:  # every adjective has one level, which is always predicted
            network = layout.network(np.zeros(layout.size), present, n_levels)
            return network, 0.0, [], 0
        start = rng.uniform(-0.5, 0.5, layout.size)  # as Gutiérrez et al. (2016) do
        trial_weight = weight.reshape(len(weight), -1).sum(axis=1)
        scale, rotate = self.scale_features, self.solver == "lbfgs"
        features = Conditioning(X, layout, alpha, trial_weight, scale, rotate)
        observations = [each.observations for each in learned]
        loss = NetworkLoss(
            features.layout, features.inputs, observations, features.alpha
        )

        def network_of(params):
            return layout.network(features.invert(params), present, n_levels)

        def error_of(params):
            return validation_error(network_of(params), *validation)

        looked_at = None if validation is None else error_of
        monitor = Monitor(looked_at, self.n_iter_no_change, task.on_iteration)
        options = {"max_iter": self.max_iter, "tol": self.tol, "callback": monitor}
        params, n_iter, converged = SOLVERS[self.solver](
            loss, features.apply(start), **options
        )
        if monitor.best_params is not None:
            params = monitor.best_params
        elif not converged:
            self._warn_of_no_convergence(n_iter)
        return network_of(params), float(loss(params)[0]), monitor.costs, n_iter

    def _warn_of_no_convergence(self, n_iter):
        warnings.warn(
            f"NNPOM did not converge ({n_iter} iterations, max_iter={self.max_iter}); "
            "increase max_iter or alpha, unless alpha is huge.",
            ConvergenceWarning,
            stacklevel=4,
        )

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """Predict the probability of each level.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)

        Returns
        -------
        proba : ndarray of shape (n_trials, n_levels)
            Rows sum to 1; columns as in ``levels_``. If several adjectives were
            learned, every prediction has a further axis for them behind that of the
            trials.
        """
        proba = self.predict_proba_with_positions(check_features(self, X), None)
        return np.ascontiguousarray(proba[:, 0])

    def predict_proba_with_positions(
        self, X: FloatArray, positions: FloatArray | None
    ) -> NDArray[np.float64]:
        """Predict for each trial at each position, sharing the trial's features.

        Parameters
        ----------
        X : ndarray of shape (n_trials, n_features)
            Validated features, without the position.
        positions : ndarray of shape (n_positions,), or None
            The last feature, if it is a position.

        Returns
        -------
        proba : ndarray of shape (n_trials, n_positions, n_levels)
        """
        latent = self._forward(X, positions)[0]
        return self._of_adjectives(self._network.probabilities(latent), -2)

    def predict_latent_with_positions(
        self, X: FloatArray, positions: FloatArray | None
    ) -> NDArray[np.float64]:
        """Predict the latent response of each trial at each position.

        Parameters
        ----------
        X : ndarray of shape (n_trials, n_features)
            Validated features, without the position.
        positions : ndarray of shape (n_positions,), or None
            The last feature, if it is a position.

        Returns
        -------
        latent : ndarray of shape (n_trials, n_positions)
            The response that `thresholds_` divide into levels.
        """
        return self._of_adjectives(self._forward(X, positions)[0], -1)

    def validation_share(self) -> float:
        """Share of the trials that early stopping validates on, 0 without it."""
        stops = self.early_stopping and self.n_hidden > 0
        return self.validation_fraction if stops else 0.0

    def hidden_activations_with_positions(
        self, X: FloatArray, positions: FloatArray
    ) -> NDArray[np.float64]:
        """Return the activations of the hidden units for each trial at each position.

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
        return self._forward(X, positions)[1]

    def predict_latent(self, X: ArrayLike) -> NDArray[np.float64]:
        """Predict the latent response f, which the thresholds divide into levels.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)

        Returns
        -------
        latent : ndarray of shape (n_trials,)
        """
        return self.predict_latent_with_positions(check_features(self, X), None)[:, 0]

    def hidden_activations(self, X: ArrayLike) -> NDArray[np.float64]:
        """Return the activations of the hidden units, the network's own features.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)

        Returns
        -------
        hidden : ndarray of shape (n_trials, n_hidden)
            Values in [0, 1]; no columns for the linear model.
        """
        return self._forward(check_features(self, X), None)[1][:, 0]

    @one_blas_thread
    def _forward(self, X, positions):
        positions = None if positions is None else np.atleast_2d(positions)
        return self._network.forward(X, positions)

    def _of_adjectives(self, predicted, axis):
        """Drop the axis of the adjectives if the network was fitted to one alone."""
        return predicted if self.thresholds_.ndim == 2 else predicted.squeeze(axis)

    @property
    def _network(self):
        """The fitted attributes as a network."""
        thresholds = np.atleast_2d(self.thresholds_)
        output = self.coefs_[1] if len(self.coefs_) > 1 else np.empty(0)
        output = output.reshape(len(self.intercepts_), len(thresholds))
        return Network(self.coefs_[0], self.intercepts_, output, thresholds)


def fit_linear_networks(networks, X, observations, levels, on_iteration=None):
    """Fit networks without hidden units to the same trials, all at once.

    They share the products with the features, so that many fits take little more time
    than few.

    Parameters
    ----------
    networks : list of NNPOM
        Without hidden units; they are fitted.
    X : ndarray of shape (n_trials, n_features)
    observations : list of tuple of (positions, level, weight)
        What `NNPOM.fit_with_positions` takes for each of them.
    levels : ndarray of shape (n_levels,)
        The ordered levels.
    on_iteration : callable, default=None
        As `fit_linear` takes it.
    """
    problems, ranked = [], []
    for network, (positions, level, weight) in zip(networks, observations):
        weight, alpha = scaled_to_unit_weight(weight, network.alpha)
        ranked += rank_levels(positions, level, weight, len(levels))
        options = network.scale_features, network.max_iter, network.tol
        problems.append(LinearProblem(*ranked[-1].observations, alpha, *options))
    fits = fit_linear(X, problems, on_iteration)
    for network, ratings, fitted in zip(networks, ranked, fits):
        n_iter = len(fitted.loss_curve)
        if not fitted.converged:
            network._warn_of_no_convergence(n_iter)
        present = ratings.present
        between = thresholds_of_all_levels(fitted.thresholds, present, len(levels))
        found = Network(fitted.coef, np.empty(0), np.empty((0, 1)), between[None])
        network._take(found, fitted.loss, fitted.loss_curve, n_iter, levels)
