"""Models without one of their sensors.

A *holdout* is a model whose combined network was trained again with the activations of
one sensor set to zero. How much worse it predicts than the full model is what that
sensor contributes. A *start* is one draw of all random weights.
"""

from sklearn.base import clone
from sklearn.frozen import FrozenEstimator

# Value of `held_out` in tables for the model that has all sensors.
FULL_MODEL = "none"


def fit_holdouts(regressor, X, y, *, random_state, groups=None, X_val=None, y_val=None):
    """Fit the full model, and one holdout per sensor, from one start.

    The networks of the sensors are fitted once, with the full model; the holdouts share
    them.

    Parameters
    ----------
    regressor : DistributionalOrdinalRegressor
        A regressor whose estimator is a `SensorFusionNNPOM`; it is cloned.
    X, y, groups, X_val, y_val
        As in :meth:`DistributionalOrdinalRegressor.fit`.
    random_state : int
        The start.

    Returns
    -------
    models : dict of str to DistributionalOrdinalRegressor
        The fitted models by the sensor held out. The first, ``"none"``, is the full
        model; no sensor may be called so, else a ValueError is raised.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import DistributionalOrdinalRegressor, SensorFusionNNPOM
    >>> from sklearn_haptic.model_selection._holdouts import fit_holdouts
    >>> X, y = np.random.default_rng(0).normal(size=(8, 3)), [1, 1, 2, 2, 3, 3, 3, 3]
    >>> fusion = SensorFusionNNPOM({"pac": [0, 1], "tdc": [2]})
    >>> regressor = DistributionalOrdinalRegressor(fusion)
    >>> list(fit_holdouts(regressor, X, y, random_state=0))
    ['none', 'pac', 'tdc']
    """

    def fit(**params):
        model = clone(regressor).set_params(random_state=random_state, **params)
        return model.fit(X, y, groups=groups, X_val=X_val, y_val=y_val)

    full = fit()
    networks = full.estimator_.sensor_networks_
    if FULL_MODEL in networks:
        raise ValueError(
            f"A sensor is called {FULL_MODEL!r}, which stands for the full model; "
            "rename it."
        )
    frozen = {name: FrozenEstimator(network) for name, network in networks.items()}
    return {FULL_MODEL: full} | {
        name: fit(estimator__estimator=frozen, estimator__held_out=name)
        for name in networks
    }
