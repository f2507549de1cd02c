"""Sensor networks and their combination: against networks put together by hand."""

import numpy as np
import pandas as pd
import pytest
from callback_recorder import Recorder
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import expit
from sklearn.base import clone
from sklearn.compose import make_column_transformer
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from touches import ordinal_touches

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, SensorFusionNNPOM
from sklearn_haptic.metrics import neg_rps_scorer
from sklearn_haptic.models._fusion import resolve_sensors
from sklearn_haptic.models._quantile_positions import training_observations

SENSORS = {"pac": [0, 1, 2], "pdc": [3], "tdc": [4, 5]}
EXACT = {"tol": 1e-9, "max_iter": 20_000}


def touches(n_objects=16, n_trials=3):
    """Trials of six columns, three sensors; all tell something of the ratings."""
    effects = [1, 0, 0.5, -1, 0.3, 0]
    return ordinal_touches(n_objects, n_trials, effects, spread=2, noise=1)


def networks():
    # Unscaled, so that a network of rows with the position has the same penalty.
    return {
        sensor: NNPOM(2 + k, 3.0, scale_features=False, random_state=k, **EXACT)
        for k, sensor in enumerate(SENSORS)
    }


def combined():
    return NNPOM(3, 3.0, random_state=9, **EXACT)


def fusion(**params):
    return SensorFusionNNPOM(SENSORS, networks(), combined(), **params)


def sigmoid_layer(network, rows):
    return expit(rows @ network.coefs_[0] + network.intercepts_)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("held_out", [None, "pdc"])
@pytest.mark.parametrize("sampling", ["level", "random"])
def test_it_is_what_the_paper_describes(held_out, sampling):
    """Each network is fitted by hand to rows [features, p], every p the same for all.

    The combined network gets nothing but their activations, zeros for a sensor held
    out.
    """
    X, counts, _ = touches()
    # Thirty steps in the same direction, so that all reach the same of many minima.
    steps = {"solver": "irprop+", "max_iter": 30, "tol": 0}
    each = {name: net.set_params(**steps) for name, net in networks().items()}
    last = combined().set_params(**steps)
    model = DistributionalOrdinalRegressor(
        SensorFusionNNPOM(SENSORS, each, last, held_out),
        sampling=sampling,
        random_state=3,
    )
    fitted = model.fit(X, counts).estimator_

    rng = np.random.RandomState(3)  # one seed for the networks, then the positions
    seeds = np.random.RandomState(rng.randint(2**31 - 1)).randint(2**31 - 1, size=4)
    p, level, weight = training_observations(counts, 15, sampling, rng)
    trial = np.nonzero(weight)[0]
    level, p, weight = level[weight > 0], p[weight > 0], weight[weight > 0]
    rows = np.column_stack((X[trial], np.log(p / (1 - p))))
    hidden = []
    for (sensor, columns), seed in zip(SENSORS.items(), seeds):
        inputs = rows[:, [*columns, -1]]
        alone = clone(each[sensor]).set_params(random_state=seed)
        alone.fit(inputs, level, weight)
        hidden.append(sigmoid_layer(alone, inputs) * (sensor != held_out))
    hidden = np.hstack(hidden)
    assert_allclose(fitted.hidden_activations(rows), hidden, atol=1e-8)
    assert (held_out in fitted.sensor_networks_) is False
    final = clone(last).set_params(random_state=seeds[3]).fit(hidden, level, weight)
    assert_allclose(fitted.predict_proba(rows), final.predict_proba(hidden), atol=1e-7)
    assert_allclose(fitted.thresholds_, final.thresholds_, atol=1e-7)


@pytest.mark.slow
def test_a_held_out_sensor_has_no_say():
    X, counts, _ = touches()
    full, deaf = (
        DistributionalOrdinalRegressor(fusion(held_out=sensor)).fit(X, counts)
        for sensor in (None, "pac")
    )
    changed = X.copy()
    changed[:, SENSORS["pac"]] = 1e3
    assert_array_equal(deaf.predict_proba(changed), deaf.predict_proba(X))
    assert np.abs(full.predict_proba(changed) - full.predict_proba(X)).max() > 0.1
    for sensor, network in deaf.estimator_.sensor_networks_.items():
        same = full.estimator_.sensor_networks_[sensor]
        assert_array_equal(network.coefs_[0], same.coefs_[0])
    rows = np.column_stack((X, np.zeros(len(X))))
    full, deaf = (m.estimator_.hidden_activations(rows) for m in (full, deaf))
    assert_array_equal(deaf[:, 2:], full[:, 2:])
    assert not deaf[:, :2].any() and full[:, :2].all()


def test_all_sensors_held_out_is_no_sensor():
    """What is left is the marginal distribution of all trials."""
    X, counts, _ = touches()
    model = SensorFusionNNPOM({"pac": slice(None)}, held_out="pac").fit(X, counts)
    marginal = counts.sum(axis=0) / counts.sum()
    assert_allclose(model.predict_proba(X[:3]), [marginal] * 3, atol=1e-4)


@pytest.mark.slow
def test_fitted_networks_are_shared():
    X, counts, _ = touches()
    full = DistributionalOrdinalRegressor(fusion(), sampling="random", random_state=0)
    full.fit(X, counts)
    fitted = full.estimator_.sensor_networks_
    frozen = {sensor: FrozenEstimator(network) for sensor, network in fitted.items()}
    again = clone(full).set_params(estimator__estimator=frozen).fit(X, counts)
    for sensor, network in again.estimator_.sensor_networks_.items():
        assert_array_equal(network.coefs_[0], fitted[sensor].coefs_[0])
    assert_array_equal(again.predict_proba(X), full.predict_proba(X))
    for sensor in SENSORS:
        held_out = {"estimator__held_out": sensor}
        apart = clone(full).set_params(**held_out).fit(X, counts)
        shared = clone(again).set_params(**held_out).fit(X, counts)
        assert_array_equal(shared.predict_proba(X), apart.predict_proba(X))
    # Networks that are not trained on these ratings stay as they are.
    other = clone(again).fit(X, counts[:, ::-1])
    for sensor, network in other.estimator_.sensor_networks_.items():
        assert_array_equal(network.coefs_[0], fitted[sensor].coefs_[0])


@pytest.mark.slow
def test_without_positions_it_combines_networks_of_trials():
    X, counts, _ = touches()
    weight = np.random.default_rng(0).uniform(0.5, 2, len(X))
    level = counts.argmax(axis=1)
    words = pd.Categorical.from_codes(level, list("edcba"), ordered=True)
    for y in (counts, level, words):
        model = fusion().fit(X, y, weight)
        hidden = []
        for sensor, columns in SENSORS.items():
            alone = networks()[sensor].fit(X[:, columns], y, weight)
            hidden.append(sigmoid_layer(alone, X[:, columns]))
        hidden = np.hstack(hidden)
        assert_allclose(model.hidden_activations(X), hidden, rtol=1e-12)
        final = combined().fit(hidden, y, weight)
        assert_allclose(model.predict_proba(X), final.predict_proba(hidden), rtol=1e-6)
        assert_array_equal(model.predict(X), final.predict(hidden))
        assert_allclose(
            model.predict_latent(X), final.predict_latent(hidden), atol=1e-6
        )
        assert_array_equal(model.classes_, final.classes_)


@pytest.mark.parametrize(
    "columns",
    [
        [1, 2],
        slice(1, 3),
        ["pac__b", "pac__c"],
        [False, True, True],
        np.array([-2, -1]),
        range(1, 3),
    ],
    ids=str,
)
def test_columns_in_any_form(columns):
    names = ["pac__a", "pac__b", "pac__c"]
    assert resolve_sensors({"s": columns}, names, 3)["s"].tolist() == [1, 2]
    assert resolve_sensors({"s": "pac__c"}, names, 3)["s"].tolist() == [2]


def test_prefixes_name_the_sensors_of_a_pipeline():
    X, counts, _ = touches()
    frame = pd.DataFrame(X, columns=list("abcdef"))
    columns = make_column_transformer(
        (StandardScaler(), ["d"]), ("passthrough", ["f", "e"])
    )
    regressor = DistributionalOrdinalRegressor(SensorFusionNNPOM(random_state=0))
    model = make_pipeline(columns, StandardScaler(), regressor)
    model.set_output(transform="pandas").fit(frame, counts)
    fitted = model[-1].estimator_
    assert {sensor: c.tolist() for sensor, c in fitted.sensors_.items()} == {
        "standardscaler": [0],
        "passthrough": [1, 2],
    }
    assert fitted.feature_names_in_.tolist() == [
        "standardscaler__d",
        "passthrough__f",
        "passthrough__e",
        "position",
    ]
    by_hand = {"standardscaler": [0], "passthrough": [1, 2]}
    same = clone(regressor).set_params(estimator__sensors=by_hand)
    Z = model[:-1].transform(frame)
    assert_array_equal(
        same.fit(Z.to_numpy(), counts).predict_proba(Z.to_numpy()),
        model.predict_proba(frame),
    )


def test_columns_without_sensors():
    X, counts, _ = touches()
    with pytest.warns(UserWarning, match="no column names to tell sensors by"):
        model = SensorFusionNNPOM(random_state=0).fit(X, counts)
    assert list(model.sensors_) == ["all"]
    with pytest.raises(ValueError, match="Column 'b' of X has no prefix"):
        resolve_sensors(None, ["pac__a", "b"], 2)


@pytest.mark.slow
def test_search_over_networks_and_holdouts():
    X, counts, objects = touches()
    final = NNPOM(2, random_state=0)
    model = SensorFusionNNPOM(SENSORS, NNPOM(2, 5, random_state=0), final)
    search = GridSearchCV(
        DistributionalOrdinalRegressor(model),
        {
            "estimator__final_estimator__alpha": [1, 100],
            "estimator__estimator__n_hidden": [1, 2],
            "estimator__held_out": [None, "pac"],
        },
        scoring=neg_rps_scorer,
        cv=GroupKFold(2),
    ).fit(X, counts, groups=objects)
    assert len(np.unique(search.cv_results_["mean_test_score"])) == 8
    assert search.best_params_["estimator__held_out"] is None


@pytest.mark.slow
def test_every_network_that_stops_early_validates_on_the_same_trials():
    X, counts, objects = touches(40)
    train, held_out = objects < 32, objects >= 32
    stopping = NNPOM(4, 0.01, max_iter=300, tol=0, random_state=0, early_stopping=True)
    stopping.set_params(n_iter_no_change=20)
    model = DistributionalOrdinalRegressor(
        SensorFusionNNPOM(SENSORS, stopping, stopping)
    )
    model.fit(X[train], counts[train], X_val=X[held_out], y_val=counts[held_out])
    for sensor, columns in SENSORS.items():
        alone = DistributionalOrdinalRegressor(stopping).fit(
            X[train][:, columns],
            counts[train],
            X_val=X[held_out][:, columns],
            y_val=counts[held_out],
        )
        network = model.estimator_.sensor_networks_[sensor]
        assert_array_equal(alone.estimator_.coefs_[0], network.coefs_[0])
    final = model.estimator_.final_network_
    assert final.n_iter_ < 300
    # It kept the best of its iterations by the error on the validation trials alone.
    model.set_params(estimator__final_estimator=clone(stopping).set_params(max_iter=10))
    model.fit(X[train], counts[train], X_val=X[held_out], y_val=counts[held_out])
    assert model.estimator_.final_network_.n_iter_ == 10
    grouped = clone(model).fit(X, counts, groups=objects)
    assert grouped.estimator_.validation_share() == 0.1
    final = clone(stopping).set_params(validation_fraction=0.3)
    assert SensorFusionNNPOM(SENSORS, stopping, final).validation_share() == 0.3
    assert SensorFusionNNPOM(SENSORS).validation_share() == 0


def test_holdouts_train_on_the_trials_of_the_full_model():
    """Also where only the sensors' networks, which they share, stop early."""
    X, counts, objects = touches()
    model = SensorFusionNNPOM(SENSORS, NNPOM(2, early_stopping=True))
    full = DistributionalOrdinalRegressor(model, random_state=0)
    full.fit(X, counts, groups=objects)
    networks = full.estimator_.sensor_networks_
    frozen = {name: FrozenEstimator(network) for name, network in networks.items()}
    again = clone(full).set_params(estimator__estimator=frozen)
    again.fit(X, counts, groups=objects)
    assert_array_equal(again.predict_proba(X), full.predict_proba(X))


def test_shapes_of_what_is_predicted_at_positions():
    X, counts, _ = touches()
    model = DistributionalOrdinalRegressor(fusion()).fit(X, counts).estimator_
    p = np.array([-1.0, 0.0, 2.0])
    proba = model.predict_proba_with_positions(X, p)
    latent = model.predict_latent_with_positions(X, p)
    for k, position in enumerate(p):
        rows = np.column_stack((X, np.full(len(X), position)))
        assert_allclose(proba[:, k], model.predict_proba(rows), rtol=1e-12)
        assert_allclose(latent[:, k], model.predict_latent(rows), rtol=1e-12)


def test_one_level_only():
    X, counts, _ = touches()
    only = np.zeros_like(counts)
    only[:, 3] = 12
    proba = DistributionalOrdinalRegressor(fusion()).fit(X, only).predict_proba(X)
    assert_array_equal(proba, np.eye(5)[[3] * len(X)])


def test_progress_of_every_network():
    X, counts, _ = touches()
    recorder = Recorder()
    model = DistributionalOrdinalRegressor(fusion())
    model.set_callbacks(recorder).fit(X, counts)
    finished = [
        owner for owner, task in zip(recorder.owners, recorder.tasks) if task == "fit"
    ]
    assert finished == [
        *["NNPOM"] * 4,
        "SensorFusionNNPOM",
        "DistributionalOrdinalRegressor",
    ]


def test_a_frozen_network_of_other_columns():
    X, counts, _ = touches()
    narrow = DistributionalOrdinalRegressor(NNPOM(2)).fit(X[:, :2], counts).estimator_
    model = SensorFusionNNPOM({"pac": [0, 1, 2]}, {"pac": FrozenEstimator(narrow)})
    with pytest.raises(
        ValueError, match=r"has n_features_in_=3, but 4 .* position last"
    ):
        DistributionalOrdinalRegressor(model).fit(X, counts)


@pytest.mark.parametrize("columns", [[True, False], [0.5]])
def test_columns_that_cannot_be(columns):
    with pytest.raises(ValueError, match="columns for 'a'"):
        SensorFusionNNPOM({"a": columns}).fit(*touches()[:2])


def test_networks_of_sensors_that_are_none():
    peers = dict.fromkeys(SENSORS, LogisticRegression())
    with pytest.raises(TypeError, match="a LogisticRegression for sensor 'pac'"):
        SensorFusionNNPOM(SENSORS, peers).fit(*touches()[:2])


def test_levels_of_sensor_networks_are_not_ignored():
    X, counts, _ = touches()
    levels = [*range(counts.shape[1], 0, -1)]
    peers = {sensor: NNPOM(2, levels=levels) for sensor in SENSORS}
    model = SensorFusionNNPOM(SENSORS, peers)
    with pytest.raises(ValueError, match=r"has levels=.*; give them to final"):
        model.fit(X, counts)
    model.set_params(final_estimator=NNPOM(0, levels=levels))
    assert model.fit(X, counts).classes_.tolist() == levels
