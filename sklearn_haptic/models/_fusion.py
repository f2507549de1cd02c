"""One network per sensor, and one that combines what they have learned.

Richardson & Kuchenbecker (2020) train a network on the features of each sensor. The
activations of the hidden units of these networks, not their outputs, are the inputs of
a combined network. Setting those of one sensor to zero and training the combined
network again shows what the sensor contributes.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone
from sklearn.callback import CallbackSupportMixin
from sklearn.frozen import FrozenEstimator
from sklearn.utils import check_random_state

from ..utils._folds import TakesGroups
from ..utils._sklearn import (
    FloatArray,
    HasMethods,
    Observations,
    RandomState,
    _fit_context,
    fit_task,
    one_blas_thread,
    with_callbacks,
)
from ..utils._validation import check_features
from ._nnpom import NNPOM
from ._observations import single_ratings, used_trials
from ._ordinal import OrdinalClassifierMixin
from ._shared_features import check_frozen, hold_out_trials, refuse_adjectives, unfrozen

_Network: TypeAlias = NNPOM | FrozenEstimator

_NETWORK = HasMethods(["fit_with_positions", "hidden_activations_with_positions"])


def resolve_sensors(sensors, feature_names, n_features):
    """Return the indices of the columns of each sensor, as `sensors` or names tell.

    Sensors are in the order of their first mention. The name of a column without a
    prefix, and a sensor with unknown columns or none, raise a ValueError.

    Examples
    --------
    >>> from sklearn_haptic.models._fusion import resolve_sensors
    >>> resolve_sensors(None, ["pac__0", "pac__1", "tdc__0"], 3)
    {'pac': array([0, 1]), 'tdc': array([2])}
    >>> resolve_sensors({"pac": slice(2), "tdc": [2]}, None, 3)
    {'pac': array([0, 1]), 'tdc': array([2])}
    """
    if sensors is not None:
        if not sensors:
            raise ValueError("sensors={} names no sensor; give the columns of each.")
        return {
            sensor: _resolve_columns(sensor, columns, feature_names, n_features)
            for sensor, columns in sensors.items()
        }
    names = [] if feature_names is None else [str(name) for name in feature_names]
    if not any("__" in name for name in names):
        warnings.warn(
            "X has no column names to tell sensors by, such as 'pac__0', so all "
            "columns are taken to be of one sensor; name the columns, in a pipeline by "
            "set_output(transform='pandas'), or set sensors.",
            UserWarning,
            stacklevel=3,
        )
        return {"all": np.arange(n_features)}
    columns = {}
    for i, name in enumerate(names):
        sensor, separator, _ = name.partition("__")
        if not separator:
            raise ValueError(
                f"Column {name!r} of X has no prefix that names its sensor, as other "
                "columns have; rename it or set sensors."
            )
        columns.setdefault(sensor, []).append(i)
    return {sensor: np.array(indices) for sensor, indices in columns.items()}


def _resolve_columns(sensor, columns, feature_names, n_features):
    try:
        if not isinstance(columns, slice):
            columns = np.atleast_1d(columns)
            if columns.dtype.kind in "UO":
                known = () if feature_names is None else feature_names
                index = {name: i for i, name in enumerate(known)}
                columns = [index[name] for name in columns]
        found = np.arange(n_features)[columns]
        found[0]
    except (IndexError, KeyError) as error:
        raise ValueError(
            f"sensors has columns for {sensor!r} that are not in X ({error}), or none; "
            f"name some of its {n_features} columns."
        ) from error
    return found


def n_units(network):
    """Return the number of hidden units: those fitted, if the network is frozen."""
    if isinstance(network, FrozenEstimator):
        return len(network.intercepts_)
    return network.n_hidden


class SensorFusionNNPOM(
    TakesGroups,
    CallbackSupportMixin,
    MetaEstimatorMixin,
    OrdinalClassifierMixin,
    BaseEstimator,
):
    """Combine one network per sensor by the activations of their hidden units.

    The columns of each sensor, with the quantile position if there is one, train a
    network of their own. The activations of all hidden units are the inputs of a
    combined network [1]_. This is meant to be the ``estimator`` of
    `DistributionalOrdinalRegressor`, which gives all networks the same positions.

    Parameters
    ----------
    sensors : dict of str to columns, default=None
        The columns of each sensor: indices, names, a slice or a mask. By default
        columns are grouped by the prefix before ``"__"`` in their names, which a
        ColumnTransformer puts there; ``set_output(transform="pandas")`` brings the
        names to this estimator. Columns of no sensor are not used.
    estimator : NNPOM or dict of str to NNPOM, default=None
        One network for all sensors, or one for each; by default
        ``NNPOM(n_hidden=10, alpha=10)``. A network in a
        `sklearn.frozen.FrozenEstimator` is used as it was fitted.
    final_estimator : NNPOM, default=None
        The combined network; by default ``NNPOM(n_hidden=0, alpha=10)``, and of ten
        hidden units, which the paper's has too, for several adjectives. A network in a
        `sklearn.frozen.FrozenEstimator` is used as it was fitted, to as many
        activations and the same adjectives and levels.
    held_out : str, default=None
        The sensor whose activations are zero in training and prediction.
    random_state : int, RandomState instance or None, default=None
        Draws the start values of all networks, in place of their own
        ``random_state``; None leaves these as they are.

    Attributes
    ----------
    sensors_ : dict of str to ndarray of int
        The columns of each sensor.
    sensor_networks_ : dict of str to NNPOM
        The fitted network of each sensor that is not held out.
    final_network_ : NNPOM
        The fitted combined network.
    levels_, classes_ : ndarray of shape (n_levels,)
        The ordered levels.
    thresholds_ : ndarray of shape (n_levels - 1,), or (n_adjectives, n_levels - 1)
        Thresholds of the combined network.
    n_features_in_ : int
        Number of features.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the features, if they have any.

    See Also
    --------
    sklearn_haptic.model_selection.sensor_contributions : Hold out each sensor in turn.

    Notes
    -----
    Let p be the position, x_s the features of sensor s and h_s(x_s, p) the activations
    of its network. The latent response is that of the combined network at
    (h_1, …, h_S), so the position enters through the sensors' networks alone.

    Several adjectives can be learned together: they share the hidden units of all
    networks, and each has output weights and thresholds of its own in each network.
    The paper leaves this to others [1]_ (section 4.2).

    References
    ----------
    .. [1] Richardson, B. A. & Kuchenbecker, K. J. (2020). Learning to predict
       perceptual distributions of haptic adjectives. Frontiers in Neurorobotics
       13, 116, section 2.3.3 and Figure 8. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    Vibration tells how people rate these objects, temperature does not.

    >>> import numpy as np
    >>> from sklearn_haptic import DistributionalOrdinalRegressor, SensorFusionNNPOM
    >>> rng = np.random.default_rng(0)
    >>> X = rng.normal(size=(40, 4))
    >>> counts = rng.poisson(2 * np.exp(np.outer(X[:, 0], [-1, 0, 1]))) + 1
    >>> fusion = SensorFusionNNPOM({"pac": [0, 1], "tdc": [2, 3]}, random_state=0)
    >>> full = DistributionalOrdinalRegressor(fusion).fit(X, counts)
    >>> fusion.set_params(held_out="pac")
    SensorFusionNNPOM(held_out='pac', ...)
    >>> deaf = DistributionalOrdinalRegressor(fusion).fit(X, counts)
    >>> full.score(X, counts) > deaf.score(X, counts)
    True
    """

    _parameter_constraints = {  # noqa: RUF012
        "sensors": [dict, None],
        "estimator": [_NETWORK, dict, None],
        "final_estimator": [_NETWORK, None],
        "held_out": [str, None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        sensors: Mapping[str, ArrayLike | slice] | None = None,
        estimator: _Network | Mapping[str, _Network] | None = None,
        final_estimator: NNPOM | None = None,
        held_out: str | None = None,
        *,
        random_state: RandomState = None,
    ) -> None:
        self.sensors = sensors
        self.estimator = estimator
        self.final_estimator = final_estimator
        self.held_out = held_out
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        *,
        groups: ArrayLike | None = None,
    ) -> Self:
        """Fit the networks of the sensors, then the combined one.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial.
        y : array-like of shape (n_trials,) or (n_trials, n_levels)
            One rating per trial, or how many people gave each rating. Labels determine
            the levels, as for `NNPOM`, and such counts of several adjectives, of shape
            (n_trials, n_adjectives, n_levels), are learned together.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial, as in :meth:`NNPOM.fit`.
        groups : array-like of shape (n_trials,), default=None
            The object of each trial, so that early stopping validates on whole objects,
            the same for all networks; without them it warns.

        Returns
        -------
        self : SensorFusionNNPOM
        """
        final = self.final_estimator
        known = "levels_" if isinstance(final, FrozenEstimator) else "levels"
        levels = getattr(final, known, None)
        X, counts, levels, sample_weight, groups = used_trials(
            self, X, y, levels, sample_weight, groups
        )
        names = getattr(self, "feature_names_in_", None)
        self.sensors_ = resolve_sensors(self.sensors, names, X.shape[1])
        self._has_position = False
        level, weight, counted = single_ratings(counts, sample_weight)
        validation = None
        share = self.validation_share()
        if share > 0:
            seeded = self._stopping_early()[0] if self.random_state is None else self
            rng = check_random_state(seeded.random_state)
            train, validating = hold_out_trials(self, len(X), groups, share, rng)
            validation = X[validating], None, level[validating], counted[validating]
            X, level, weight = X[train], level[train], weight[train]
        return self._fit_networks(X, None, level, weight, levels, validation)

    @with_callbacks
    def fit_with_positions(
        self,
        X: FloatArray,
        positions: FloatArray,
        level: NDArray[np.integer],
        weight: FloatArray,
        *,
        levels: np.ndarray,
        validation: Observations | None = None,
        feature_names: np.ndarray | None = None,
    ) -> Self:
        """Fit to observations of each trial at several positions.

        The parameters are those of :meth:`NNPOM.fit_with_positions`. Every network gets
        the same positions; those that stop early use the validation trials.
        """
        self._validate_params()
        self.n_features_in_ = X.shape[1] + 1
        if feature_names is not None:
            self.feature_names_in_ = np.append(feature_names, "position")
        self.sensors_ = resolve_sensors(self.sensors, feature_names, X.shape[1])
        self._has_position = True
        return self._fit_networks(X, positions, level, weight, levels, validation)

    def _fit_networks(self, X, positions, level, weight, levels, validation):
        if self.held_out is not None and self.held_out not in self.sensors_:
            raise ValueError(
                f"held_out={self.held_out!r} is not among the sensors "
                f"{list(self.sensors_)}; name one of them."
            )
        networks, final_network = self._make_networks(levels, weight.shape[1:-1])
        self._n_hidden = {name: n_units(each) for name, each in networks.items()}
        networks.pop(self.held_out, None)
        self.sensor_networks_ = {
            sensor: unfrozen(network) for sensor, network in networks.items()
        }
        self.final_network_ = unfrozen(final_network)
        self.levels_ = self.classes_ = levels

        def inputs_of(sensor, X, positions):
            if sensor is not None:
                return X[:, self.sensors_[sensor]], positions
            if positions is None:
                return self._activations(X)[:, 0], None
            hidden = self._activations(X, positions.reshape(len(X), -1))
            return hidden.reshape(*positions.shape, -1), None

        unfitted = {
            sensor: network
            for sensor, network in {**networks, None: final_network}.items()
            if not isinstance(network, FrozenEstimator)
        }
        with fit_task(self, X, max_subtasks=len(unfitted)) as task:
            for sensor, network in unfitted.items():
                which = f"network of {sensor}" if sensor else "combined network"
                train = *inputs_of(sensor, X, positions), level, weight
                validating = None
                if validation is not None and network.early_stopping:
                    validating = *inputs_of(sensor, *validation[:2]), *validation[2:]
                with task.fit_of(f"fit {which}", network):
                    network.fit_with_positions(
                        *train, levels=levels, validation=validating
                    )
        self.thresholds_ = self.final_network_.thresholds_
        return self

    def _make_networks(self, levels, adjectives):
        """Clone and seed the networks of the sensors and the combined one.

        `adjectives` is the shape of several adjectives, () of a single one.
        """
        of_sensor = self.estimator
        if of_sensor is None:
            of_sensor = NNPOM(n_hidden=10, alpha=10.0)
        if not isinstance(of_sensor, dict):
            of_sensor = dict.fromkeys(self.sensors_, of_sensor)
        if of_sensor.keys() != self.sensors_.keys():
            raise ValueError(
                f"estimator has networks for {list(of_sensor)}, but the sensors are "
                f"{list(self.sensors_)}; give one network for each sensor."
            )
        networks = {sensor: clone(of_sensor[sensor]) for sensor in self.sensors_}
        default = NNPOM(n_hidden=10 if adjectives else 0, alpha=10.0)
        given = self.final_estimator
        final_network = clone(default if given is None else given)
        for sensor, network in networks.items():
            self._check_network(sensor, network, levels)
        if isinstance(final_network, FrozenEstimator):
            n_hidden = sum(n_units(network) for network in networks.values())
            check_frozen(final_network, "final_estimator", n_hidden, levels)
            known = final_network.thresholds_.shape[:-1]
            if known != adjectives:
                (predicted,), (rated,) = known or ("one",), adjectives or ("one",)
                raise ValueError(
                    f"final_estimator is frozen and predicts {predicted} adjectives, "
                    f"but y has {rated}; fit it to the same adjectives."
                )
        elif adjectives and final_network.n_hidden == 0:
            refuse_adjectives("final_estimator with n_hidden=0")
        if self.random_state is not None:
            rng = check_random_state(self.random_state)
            for network in (*networks.values(), final_network):
                seed = int(rng.randint(np.iinfo(np.int32).max))
                if not isinstance(network, FrozenEstimator):
                    network.set_params(random_state=seed)
        return networks, final_network

    def _check_network(self, sensor, network, levels):
        if not hasattr(network, "hidden_activations_with_positions"):
            raise TypeError(
                f"estimator has a {type(unfrozen(network)).__name__} for sensor "
                f"{sensor!r}, but an NNPOM is required (of a fitted regressor, its "
                "estimator_)."
            )
        n_inputs = len(self.sensors_[sensor]) + self._has_position
        if isinstance(network, FrozenEstimator):
            names = getattr(self, "feature_names_in_", None)
            names = None if names is None else names[self.sensors_[sensor]]
            which, position = f"The network of sensor {sensor!r}", self._has_position
            check_frozen(network, which, n_inputs, names=names, position=position)
        elif network.levels is not None and [*network.levels] != [*levels]:
            raise ValueError(
                f"The network of sensor {sensor!r} has levels={[*network.levels]}, "
                "which would be ignored; give them to final_estimator, or to what is "
                "around this model."
            )
        if n_units(network) == 0:
            raise ValueError(
                f"The network of sensor {sensor!r} has n_hidden=0, so no activations "
                "to combine; set it to at least 1."
            )

    def _stopping_early(self):
        # Frozen networks count, so that all models that share them train on the same
        # trials.
        given = self.estimator
        networks = given.values() if isinstance(given, dict) else [given]
        networks = *networks, self.final_estimator
        return [each for each in networks if getattr(each, "early_stopping", False)]

    def validation_share(self) -> float:
        """Share of the trials that early stopping validates on.

        It is the largest of the networks that stop early, 0 if none does.
        """
        return max((n.validation_fraction for n in self._stopping_early()), default=0.0)

    @one_blas_thread
    def _activations(self, X, positions=None):
        """Put the activations of all sensors side by side, 0 for the one held out."""
        shape = len(X), 1 if positions is None else np.shape(positions)[-1]
        return np.concatenate(
            [
                self.sensor_networks_[sensor].hidden_activations_with_positions(
                    X[:, columns], positions
                )
                if sensor in self.sensor_networks_
                else np.zeros((*shape, self._n_hidden[sensor]))
                for sensor, columns in self.sensors_.items()
            ],
            axis=-1,
        )

    def hidden_activations(self, X: ArrayLike) -> NDArray[np.float64]:
        """Activations of the hidden units of the sensors' networks.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)

        Returns
        -------
        hidden : ndarray of shape (n_trials, n_units)
            Values in (0, 1), sensor by sensor; 0 for the sensor held out.
        """
        X = check_features(self, X)
        inputs = (X[:, :-1], X[:, -1:]) if self._has_position else (X,)
        return self._activations(*inputs)[:, 0]

    def predict_latent(self, X: ArrayLike) -> NDArray[np.float64]:
        """Predict the latent response, which the thresholds cut into levels.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)

        Returns
        -------
        latent : ndarray of shape (n_trials,)
        """
        hidden = self.hidden_activations(X)
        return self.final_network_.predict_latent(hidden)

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
        hidden = self.hidden_activations(X)
        return self.final_network_.predict_proba(hidden)

    def predict_latent_with_positions(
        self, X: FloatArray, positions: FloatArray
    ) -> NDArray[np.float64]:
        """Predict as :meth:`NNPOM.predict_latent_with_positions` does."""
        return self._predict_with_positions("predict_latent", X, positions)

    def predict_proba_with_positions(
        self, X: FloatArray, positions: FloatArray
    ) -> NDArray[np.float64]:
        """Predict as :meth:`NNPOM.predict_proba_with_positions` does."""
        return self._predict_with_positions("predict_proba", X, positions)

    def _predict_with_positions(self, method, X, positions):
        hidden = self._activations(X, positions)
        rows = hidden.reshape(-1, hidden.shape[-1])
        predicted = getattr(self.final_network_, method)(rows)
        return predicted.reshape(*hidden.shape[:2], *predicted.shape[1:])
