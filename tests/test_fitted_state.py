"""What was fitted stays fitted: frozen estimators, interrupted fits, new parameters."""

import sys
from copy import copy
from pathlib import Path

import mord
import numpy as np
import pandas as pd
import pytest
from fitted_models import MODELS, fitted, groups_of, methods_of
from sklearn.base import clone
from sklearn.ensemble import RandomForestRegressor
from sklearn.exceptions import NotFittedError
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LogisticRegression, Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import sklearn_haptic
from sklearn_haptic import (
    NNPOM,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    RegressedDistribution,
    SensorFusionNNPOM,
)

pytestmark = pytest.mark.filterwarnings("ignore:scipy.optimize. The `disp`")

SENSORS = {"a": [0], "b": [1, 2]}
BASES = [
    NNPOM(2, random_state=0),
    SensorFusionNNPOM(SENSORS, NNPOM(2), NNPOM(3), random_state=0),
    LogisticRegression(),
    make_pipeline(StandardScaler(), LogisticRegression()),
    Ridge(),
    RandomForestRegressor(5, random_state=0),
]


def touches(seed=0):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(60, 3))
    drive = 2 * X[:, :1] - X[:, 1:2] + rng.logistic(size=(60, 9))
    level = np.digitize(drive, [-1, 1])
    return X, np.stack([(level == k).sum(axis=1) for k in range(3)], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES, ids=lambda e: type(e).__name__)
@pytest.mark.parametrize("times", [1, 2])
def test_a_frozen_estimator_is_not_fitted_again(base, times):
    X, counts = touches()
    model = DistributionalOrdinalRegressor(
        clone(base), sampling="random", random_state=0
    )
    model.fit(X, counts)
    before = model.predict_proba(X)
    frozen = model.estimator_
    for _ in range(times):
        frozen = FrozenEstimator(frozen)
    other = DistributionalOrdinalRegressor(frozen, random_state=5)
    other.fit(X[::-1], counts[:, ::-1])
    np.testing.assert_array_equal(model.predict_proba(X), before)
    np.testing.assert_array_equal(other.predict_proba(X), before)
    assert other.estimator_ is model.estimator_


def test_a_frozen_combined_network_is_not_fitted_again():
    X, counts = touches()
    fusion = SensorFusionNNPOM(SENSORS, NNPOM(2), NNPOM(3), random_state=0)
    for make in (DistributionalOrdinalRegressor, lambda fusion: fusion):
        full = make(clone(fusion)).fit(X, counts)
        fitted = getattr(full, "estimator_", full)
        before = full.predict_proba(X)
        networks = {n: FrozenEstimator(f) for n, f in fitted.sensor_networks_.items()}
        final = FrozenEstimator(fitted.final_network_)
        again = make(SensorFusionNNPOM(SENSORS, networks, final)).fit(X, counts[::-1])
        np.testing.assert_array_equal(full.predict_proba(X), before)
        np.testing.assert_array_equal(again.predict_proba(X), before)
        # New networks of the sensors below the same combined one.
        other = make(SensorFusionNNPOM(SENSORS, NNPOM(2, random_state=1), final))
        assert not np.allclose(other.fit(X, counts).predict_proba(X), before)
        np.testing.assert_array_equal(full.predict_proba(X), before)


@pytest.mark.parametrize("make", [ContinuousRatingsRegressor, RegressedDistribution])
def test_what_fit_decides_cannot_be_frozen(make):
    """The cells of a grid, or the mean from which a regressor's shares depart."""
    X, counts = touches()
    base = make().fit(X, counts).estimator_
    for frozen in (FrozenEstimator(base), make_pipeline(FrozenEstimator(base))):
        name = make.__name__
        with pytest.raises(ValueError, match=f"^estimator is frozen, but {name} dec"):
            make(frozen).fit(X, counts)


def test_networks_of_sensors_serve_another_grid():
    """They give hidden units; the combined network learns the cells."""
    X, counts = touches()
    answers = np.repeat(X[:, :1], 4, axis=1) + np.arange(4)
    levels = DistributionalOrdinalRegressor(SensorFusionNNPOM(SENSORS), random_state=0)
    networks = clone(levels).fit(X, counts).estimator_.sensor_networks_
    frozen = {name: FrozenEstimator(network) for name, network in networks.items()}
    levels.set_params(estimator__estimator=frozen)
    model = ContinuousRatingsRegressor(levels).fit(X, answers)
    used = model.estimator_.estimator_.sensor_networks_
    for name, network in networks.items():
        np.testing.assert_array_equal(used[name].coefs_[0], network.coefs_[0])
    assert np.corrcoef(model.predict(X), X[:, 0])[0, 1] > 0.5


@pytest.mark.parametrize("base", BASES, ids=lambda e: type(e).__name__)
def test_frozen_estimators_that_do_not_fit_the_trials(base):
    X, counts = touches()
    fitted = (
        DistributionalOrdinalRegressor(clone(base), sampling="random", random_state=0)
        .fit(X, counts)
        .estimator_
    )
    model = DistributionalOrdinalRegressor(FrozenEstimator(fitted))
    with pytest.raises(ValueError, match=r"has n_features_in_=4, but 3 is .*, the pos"):
        model.fit(X[:, :2], counts)
    if not isinstance(base, (Ridge, RandomForestRegressor)):
        with pytest.raises(
            ValueError, match=r"3 levels|frozen and has classes_=\[0, 1, 2\]"
        ):
            model.fit(X, counts[:, :2] + 1)
    with pytest.raises(
        ValueError, match=r"shape \(3,\) for a trial, but y has \(2, 3\)"
    ):
        model.fit(X, np.stack([counts, counts], axis=1))
    with pytest.raises(
        ValueError, match="X_val requires an estimator that stops early"
    ):
        model.fit(X, counts, X_val=X, y_val=counts)
    with pytest.raises(NotFittedError):
        DistributionalOrdinalRegressor(FrozenEstimator(clone(base))).fit(X, counts)


def test_frozen_networks_of_a_fusion_that_do_not_fit():
    X, counts = touches()
    fusion = SensorFusionNNPOM(SENSORS, NNPOM(2), NNPOM(3), random_state=0)
    final = FrozenEstimator(fusion.fit(X, counts).final_network_)
    with pytest.raises(ValueError, match=r"final_estimator is .* n_features_in_=4"):
        SensorFusionNNPOM(SENSORS, NNPOM(3), final).fit(X, counts)
    with pytest.raises(ValueError, match="2 columns of counts, but there are 3 levels"):
        SensorFusionNNPOM(SENSORS, NNPOM(2), final).fit(X, counts[:, :2] + 1)
    model = DistributionalOrdinalRegressor(SensorFusionNNPOM(SENSORS, NNPOM(2), final))
    with pytest.raises(ValueError, match=r"classes_=\[1, 2, 3\], but \[1, 2\] is requ"):
        model.fit(X, counts[:, :2] + 1)
    for unfitted in ({"estimator": NNPOM(2)}, {"final_estimator": NNPOM(2)}):
        ((name, network),) = unfitted.items()
        model = SensorFusionNNPOM(SENSORS, **{name: FrozenEstimator(network)})
        with pytest.raises(NotFittedError):
            model.fit(X, counts)


CHANGES = [
    (NNPOM(2, random_state=0), {"n_hidden": 0}),
    (NNPOM(2, random_state=0), {"n_hidden": 7, "levels": [5, 6, 7]}),
    (NNPOM(0), {"n_hidden": 3, "solver": "irprop+", "scale_features": False}),
    (BASES[1], {"held_out": "a"}),
    (BASES[1], {"held_out": "nonsense", "sensors": {"c": [0]}}),
    (
        SensorFusionNNPOM(SENSORS, NNPOM(2), held_out="b", random_state=0),
        {"held_out": None},
    ),
    (BASES[1], {"estimator__n_hidden": 9, "final_estimator__n_hidden": 0}),
    (DistributionalOrdinalRegressor(), {"p_transform": None}),
    (DistributionalOrdinalRegressor(p_transform=None), {"p_transform": "logit"}),
    (
        DistributionalOrdinalRegressor(decode="quantile"),
        {"p_transform": None, "levels": [3, 2, 1], "estimator": Ridge()},
    ),
    (
        DistributionalOrdinalRegressor(mord.LogisticAT(), random_state=0),
        {"p_transform": None, "sampling": "random"},
    ),
    (
        DistributionalOrdinalRegressor(NNPOM(2, random_state=0)),
        {"estimator__n_hidden": 0, "sampling": "random"},
    ),
    (DummyDistribution(), {"strategy": "barycentre", "levels": [3, 2, 1]}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("model", "change"), CHANGES, ids=str)
def test_parameters_changed_after_fit_change_no_prediction(model, change):
    X, counts = touches()
    model = clone(model).fit(X, counts)
    before = model.predict_proba(X), model.predict(X)
    model.set_params(**change)
    np.testing.assert_array_equal(model.predict_proba(X), before[0])
    np.testing.assert_array_equal(model.predict(X), before[1])
    assert np.isfinite(model.score(X, counts))


def test_decoding_is_a_choice_at_prediction():
    X, counts = touches()
    model = DistributionalOrdinalRegressor(NNPOM(2, random_state=0)).fit(X, counts)
    for choice in (
        {"decode": "quantile"},
        {"rule": "argmax"},
        {"n_quantiles": 9},
        {"decode": "mixture"},
    ):
        model.set_params(**choice)
        before_fit = clone(model).fit(X, counts)
        np.testing.assert_array_equal(
            model.predict_proba(X), before_fit.predict_proba(X)
        )


def test_a_frozen_estimator_takes_features_of_the_names_it_was_fitted_to():
    X = pd.DataFrame({"a": [-1.0, 0.0, 1.0], "b": [0.0, 0.5, 0.0]})
    counts = np.array([[8, 3, 1], [2, 8, 2], [1, 3, 8]])
    fitted = DistributionalOrdinalRegressor(NNPOM(n_hidden=0)).fit(X, counts)
    frozen = FrozenEstimator(fitted.estimator_)
    again = DistributionalOrdinalRegressor(frozen).fit(X, counts)
    np.testing.assert_array_equal(again.predict_proba(X), fitted.predict_proba(X))
    with pytest.raises(ValueError, match=r"\['a', 'b', 'position'\], but .*order"):
        DistributionalOrdinalRegressor(frozen).fit(X[["b", "a"]], counts)


# Fits that do not end ----------------------------------------------------------

PACKAGE = str(Path(sklearn_haptic.__file__).parent)
OWN = [name for name in MODELS if name != "search"]  # which is scikit-learn's


def run_lines(function, error=None, stop=None):
    """Call a function; count lines of the package, and raise an error at one."""
    n_lines = 0

    def trace(frame, event, _):
        nonlocal n_lines
        if not frame.f_code.co_filename.startswith(PACKAGE):
            return None
        if event == "line" and inside(frame):
            n_lines += 1
            if n_lines == stop:
                raise error
        return trace

    def inside(frame):
        """Whether a frame is called by ``fit``, or is of it, not of a decorator."""
        if frame.f_code.co_name == "call":  # where what ends a limit would be undone
            return False
        while frame is not None:
            if frame.f_code.co_name in ("fit", "fit_transform"):
                return True
            frame = frame.f_back
        return False

    sys.settrace(trace)
    try:
        function()
    finally:
        sys.settrace(None)
    return n_lines


def outcome(model, X):
    """What a model makes of trials, as lists of arrays."""
    method = "predict_proba" if hasattr(model, "predict_proba") else "predict_cdf"
    method = "transform" if hasattr(model, "transform") else method
    return list(getattr(model, method)(X))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("name", OWN)
def test_a_fit_that_does_not_end_leaves_the_old_model_or_none(name):
    model, X, y = MODELS[name]
    held_out = groups_of(name)
    model = clone(fitted(name)).fit(X, y, **held_out)
    before = outcome(model, X)
    other = X.iloc[::-1] if hasattr(X, "iloc") else X[::-1]

    def refit(model):
        model.fit(other, y, **held_out)

    n_lines = min(run_lines(lambda: refit(clone(model))) for _ in range(2))
    assert n_lines > 3
    for share in (0.0, 0.2, 0.6, 0.95, 1.0):
        stop = 1 + int(share * (n_lines - 1))
        for error in (RuntimeError("in fit"), KeyboardInterrupt()):
            with pytest.raises(type(error)):
                run_lines(lambda: refit(model), error, stop)
            for old, new in zip(before, outcome(model, X), strict=True):
                np.testing.assert_array_equal(old, new)
            new = clone(model)
            with pytest.raises(type(error)):
                run_lines(lambda new=new: refit(new), error, stop)
            with pytest.raises(NotFittedError):
                outcome(new, X)


@pytest.mark.parametrize("name", OWN)
def test_a_refused_refit_leaves_the_old_model(name):
    """Settings that are refused early or late, after others have been accepted."""
    _, X, y = MODELS[name]
    model = clone(fitted(name))
    before = set(vars(model))
    with pytest.raises((ValueError, TypeError)):
        model.fit(X[:0] if not hasattr(X, "iloc") else X.iloc[:0], y)
    assert set(vars(model)) == before


# Parameters --------------------------------------------------------------------

# Choices at prediction, as their documentation says.
AT_PREDICTION = {"decode", "rule", "n_quantiles", "memory", "n_jobs"}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*OWN} - {"sensor features", "pipeline"}))
def test_no_parameter_is_read_at_prediction(name):
    """scikit-learn's FeatureUnion and Pipeline, which these are, read their own."""
    _, X, _ = MODELS[name]
    model = copy(fitted(name))
    before = outcome(model, X)
    for parameter in model.get_params(deep=False).keys() - AT_PREDICTION:
        setattr(model, parameter, object())
    for old, new in zip(before, outcome(model, X), strict=True):
        np.testing.assert_array_equal(old, new)


@pytest.mark.parametrize("name", OWN)
def test_what_is_not_fitted_says_so(name):
    unfitted, X, y = MODELS[name]
    asked = 0
    for method, call in methods_of(clone(unfitted), X, y).items():
        if method in ("transform", "distances", "p_values", "weights", "breadth") or (
            method.startswith(("predict", "sample", "score", "start", "expected"))
        ):
            asked += 1
            with pytest.raises(NotFittedError):
                call()
    assert asked
