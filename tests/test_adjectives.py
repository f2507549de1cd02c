"""Several adjectives that share a hidden layer: against sums written out by hand."""

import pickle

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import approx_fprime
from scipy.special import expit
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, SensorFusionNNPOM
from sklearn_haptic.metrics import neg_macro_mae_scorer, ranked_probability_score
from sklearn_haptic.model_selection import contribution_summary, sensor_contributions
from sklearn_haptic.models._network import Layout
from sklearn_haptic.models._network_loss import NetworkLoss
from sklearn_haptic.models._proportional_odds import softplus


def touches(n_objects=12, n_trials=2, n_adjectives=3, seed=0):
    """Trials whose adjectives are driven by the same two properties of an object."""
    rng = np.random.default_rng(seed)
    objects = np.repeat(np.arange(n_objects), n_trials)
    properties = rng.normal(size=(n_objects, 2))
    X = np.hstack((properties, properties**2, rng.normal(size=(n_objects, 3))))
    X = X[objects] + 0.4 * rng.normal(size=(len(objects), 7))
    driver = 3 * np.tanh(2 * properties @ rng.normal(size=(2, n_adjectives)))
    raters = driver[..., None] + rng.logistic(size=(*driver.shape, 8))
    level = np.digitize(raters, [-2, -0.7, 0.7, 2])
    counts = np.stack([(level == k).sum(axis=-1) for k in range(5)], axis=-1)
    return X, counts[objects].astype(float), objects


def by_hand(layout, X, observations, alpha, params, number=float):
    """Cost of the joint network, observation by observation."""
    sigmoid = expit if number is float else lambda x: 1 / (1 + mp.exp(-x))
    log, plus = (np.log, softplus) if number is float else (mp.log, _mp_softplus)
    coef, bias, heads = layout.split(params)
    penalty = sum(number(w) ** 2 for w in coef.ravel())
    loss, total = number(0), number(0)
    for (positions, level, weight), (output, first, gaps) in zip(observations, heads):
        penalty += sum(number(w) ** 2 for w in output)
        thresholds = [number(first[0])]
        for gap in gaps:
            thresholds.append(thresholds[-1] + plus(number(gap)))
        for t, j in np.ndindex(weight.shape):
            row = [*map(number, X[t]), number(positions[t, j])]
            f = number(0)
            for h in range(layout.n_hidden):
                drive = number(bias[h])
                for x, w in zip(row, coef[:, h]):
                    drive += x * number(w)
                f += number(output[h]) * sigmoid(drive)
            below = [number(0), *(sigmoid(b - f) for b in thresholds), number(1)]
            k = level[t, j]
            loss -= number(weight[t, j]) * log(below[k + 1] - below[k])
            total += number(weight[t, j])
    return (loss + number(alpha) / 2 * penalty) / total


def _mp_softplus(x):
    return mp.log(1 + mp.exp(x))


def random_problem(seed, n_trials=5, n_features=3, n_hidden=2):
    rng = np.random.default_rng(seed)
    n_levels = [5, 2, 3]
    observations = [
        (
            rng.normal(size=(n_trials, 4)),
            np.append(rng.integers(k, size=(n_trials, 3)), [[k - 1]] * n_trials, 1),
            rng.uniform(0.1, 2, size=(n_trials, 4)),
        )
        for k in n_levels
    ]
    X = rng.normal(size=(n_trials, n_features))
    layout = Layout(n_features + 1, n_hidden, tuple(n_levels))
    return layout, X, observations, rng.normal(size=layout.size)


@pytest.mark.parametrize("seed", range(3))
def test_cost_and_gradient(seed):
    layout, X, observations, params = random_problem(seed)
    loss = NetworkLoss(layout, X, observations, 0.7)
    cost, gradient = loss(params)
    with mp.workdps(60):
        exact = by_hand(layout, X, observations, 0.7, params, mpf)
        assert abs(cost / exact - 1) < 1e-14
    numeric = approx_fprime(params, lambda x: loss(x)[0], 1e-7)
    assert_allclose(gradient, numeric, atol=1e-6)


def test_the_fit_is_a_minimum_of_the_cost_written_out():
    """No step in any parameter, the features' weights included, lowers the cost."""
    X, counts, _ = touches(4, 2)
    X = X[:, :3]
    model = NNPOM(
        2, 0.5, scale_features=False, tol=1e-9, max_iter=5000, random_state=0
    ).fit(X, counts)
    # Positions of zero weight: the by-hand cost has them, the model has none.
    level = np.broadcast_to(np.arange(5), counts[:, 0].shape)
    observations = [
        (np.zeros(level.shape), level, each) for each in counts.swapaxes(0, 1)
    ]

    def cost(params):
        parts = np.split(params, [6, 8, 14])
        coef, bias = np.vstack((parts[0].reshape(3, 2), [0, 0])), parts[1]
        outputs, heads = parts[2].reshape(2, 3), parts[3].reshape(3, 4)
        own = [
            np.concatenate((outputs[:, a], heads[a, :1], np.log(np.expm1(np.diff(h)))))
            for a, h in enumerate(heads)
        ]
        flat = np.concatenate((coef.ravel(), bias, *own))
        return by_hand(Layout(4, 2, (5, 5, 5)), X, observations, 0.5, flat)

    fitted = np.concatenate(
        [
            model.coefs_[0].ravel(),
            model.intercepts_,
            model.coefs_[1].ravel(),
            model.thresholds_.ravel(),
        ]
    )
    assert model.loss_ == pytest.approx(cost(fitted), rel=1e-12)
    assert_allclose(approx_fprime(fitted, cost, 1e-6), 0, atol=1e-5)


@pytest.mark.parametrize("sampling", ["level", "random"])
@pytest.mark.parametrize("solver", ["lbfgs", "irprop+"])
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
def test_one_adjective_is_no_special_case(sampling, solver):
    X, counts, _ = touches()
    network = NNPOM(3, 3.0, solver=solver, max_iter=50)
    model = DistributionalOrdinalRegressor(network, sampling=sampling, random_state=0)
    one = clone(model).fit(X, counts[:, 0]).predict_proba(X)
    among = clone(model).fit(X, counts[:, :1]).predict_proba(X)
    assert_allclose(among[:, 0], one, rtol=1e-6)


@pytest.mark.parametrize("decode", ["mixture", "quantile"])
def test_what_is_predicted_has_an_axis_of_adjectives(decode):
    X, counts, _ = touches()
    model = DistributionalOrdinalRegressor(
        NNPOM(3, 3.0, random_state=0), decode=decode
    ).fit(X, counts)
    proba, cdf = model.predict_proba(X), model.predict_cdf(X)
    assert proba.shape == counts.shape
    assert_allclose(proba.sum(axis=-1), 1, rtol=1e-14)
    assert_allclose(cdf, np.cumsum(proba, axis=-1), atol=1e-14)
    p = np.array([0.2, 0.5, 0.9])
    quantiles = model.predict_quantile(X, p)
    for t, a, i in np.ndindex(quantiles.shape):
        assert quantiles[t, a, i] == 1 + np.searchsorted(cdf[t, a], p[i])
    assert_array_equal(model.predict_quantile(X, 0.5), quantiles[..., 1])
    assert_array_equal(model.predict(X), proba.argmax(axis=-1) + 1)
    sample = model.sample(X[:2], 4000, random_state=0)
    share = np.mean(sample[..., None] == np.arange(1, 6), axis=2)
    assert_allclose(share, proba[:2], atol=0.04)
    each = [ranked_probability_score(counts[:, a], proba[:, a]) for a in range(3)]
    assert model.score(X, counts) == pytest.approx(-np.mean(each), rel=1e-14)


def test_quantile_decoding_equals_a_fine_grid():
    X, counts, _ = touches()
    network = NNPOM(3, 3.0, random_state=0)
    model = DistributionalOrdinalRegressor(network, decode="quantile").fit(X, counts)
    p = (np.arange(20_000) + 0.5) / 20_000
    latent = model.estimator_.predict_latent_with_positions(X, np.log(p / (1 - p)))
    for a, thresholds in enumerate(model.estimator_.thresholds_):
        below = [(latent[..., a] <= b).mean(axis=1) for b in thresholds]
        cdf = np.stack(below, axis=1)
        found = np.cumsum(model.predict_proba(X)[:, a], axis=1)[:, :-1]
        assert_allclose(found, cdf, atol=0.01)


def test_levels_that_an_adjective_never_has():
    X, counts, _ = touches()
    counts[:, 0, [1, 4]] = 0
    counts[:, 0, 2] += 1
    counts[:, 1] = [0, 0, 0, 8, 0]
    model = DistributionalOrdinalRegressor(NNPOM(3, random_state=0)).fit(X, counts)
    proba = model.predict_proba(X)
    assert not proba[:, 0, [1, 4]].any() and proba[:, 0, [0, 2, 3]].all()
    assert_array_equal(proba[:, 1], [[0, 0, 0, 1, 0]] * len(X))
    assert proba[:, 2].all()
    assert (np.ptp(proba[:, 2], axis=0) > 0.01).all()
    all_agree = np.zeros_like(counts)
    all_agree[..., 2] = 8
    proba = model.fit(X, all_agree).predict_proba(X)
    assert_array_equal(proba, all_agree / 8)


def test_weights_equal_repeated_trials():
    X, counts, _ = touches()
    weight = np.random.default_rng(0).integers(0, 3, len(X))
    network = NNPOM(2, 3.0, tol=1e-10, max_iter=5000, random_state=0)
    model = DistributionalOrdinalRegressor(network)
    weighted = clone(model).fit(X, counts, sample_weight=weight)
    repeated = clone(model).fit(X.repeat(weight, 0), counts.repeat(weight, 0))
    assert_allclose(weighted.predict_proba(X), repeated.predict_proba(X), atol=1e-5)
    expected = np.repeat(
        ranked_probability_score(
            counts.reshape(-1, 5),
            weighted.predict_proba(X).reshape(-1, 5),
            average=False,
        )
        .reshape(-1, 3)
        .mean(axis=1),
        weight,
    ).mean()
    assert weighted.score(X, counts, weight) == pytest.approx(-expected)


def test_early_stopping_averages_the_error_of_all_adjectives():
    X, counts, objects = touches(30)
    train, held_out = objects < 24, objects >= 24
    network = NNPOM(8, 1e-3, tol=0, random_state=0, early_stopping=True)
    model = DistributionalOrdinalRegressor(network, decode="quantile", rule="argmax")
    errors = []
    for n_iter in (10, 20, 40, 80):
        model.set_params(estimator__max_iter=n_iter)
        model.fit(X[train], counts[train], X_val=X[held_out], y_val=counts[held_out])
        errors.append(-neg_macro_mae_scorer(model, X[held_out], counts[held_out]))
    assert (np.diff(errors) <= 1e-12).all()
    drawn = clone(model).set_params(random_state=0).fit(X, counts, groups=objects)
    loaded = pickle.loads(pickle.dumps(drawn))
    assert_array_equal(loaded.predict_proba(X), drawn.predict_proba(X))


def test_without_positions():
    X, counts, _ = touches()
    network = NNPOM(3, random_state=0).fit(X, counts)
    assert network.predict_proba(X).shape == counts.shape
    assert network.predict_latent(X).shape == (len(X), 3)
    assert network.hidden_activations(X).shape == (len(X), 3)
    hidden = expit(X @ network.coefs_[0] + network.intercepts_)
    assert_allclose(network.predict_latent(X), hidden @ network.coefs_[1], rtol=1e-12)
    assert_array_equal(network.predict(X), network.predict_proba(X).argmax(axis=-1) + 1)


def test_a_combined_network_without_units_to_share():
    X, counts, _ = touches()
    fusion = SensorFusionNNPOM({"pac": [0]}, final_estimator=NNPOM(0))
    with pytest.raises(ValueError, match="a final_estimator with n_hidden=0 cannot"):
        DistributionalOrdinalRegressor(fusion).fit(X, counts)


# A network per sensor and one that combines them --------------------------------------


SENSORS = {"pac": [0, 1, 2], "pdc": [3, 4], "tdc": [5, 6]}


def small_fusion(**params):
    options = {"tol": 1e-9, "max_iter": 20_000}
    first = NNPOM(2, 3.0, scale_features=False, random_state=1, **options)
    last = NNPOM(3, 2.0, scale_features=False, random_state=2, **options)
    return SensorFusionNNPOM(SENSORS, first, last, **params)


def plain_network(rows, coefs, bias, thresholds, adjective):
    """Hidden units and probabilities of levels of each row, unit by unit."""
    hidden, proba = np.empty((len(rows), len(bias))), np.empty((len(rows), 5))
    for r, row in enumerate(rows):
        for h, b in enumerate(bias):
            drive = b + sum(x * w for x, w in zip(row, coefs[0][:, h]))
            hidden[r, h] = 1 / (1 + np.exp(-drive))
        f = sum(a * w for a, w in zip(hidden[r], coefs[1][:, adjective]))
        edges = [0, *(1 / (1 + np.exp(f - t)) for t in thresholds[adjective]), 1]
        proba[r] = np.diff(edges)
    return hidden, proba


@pytest.mark.slow
@pytest.mark.parametrize("held_out", [None, "pdc"])
def test_combined_network_is_a_minimum_of_costs_written_out(held_out):
    """Its cost at the fit, and its derivatives there, by plain loops over ratings.

    Each cell of the population has the people of each level that are within it.
    """
    X, counts, _ = touches(6, 1)
    model = DistributionalOrdinalRegressor(
        small_fusion(held_out=held_out), n_duplicates=5
    ).fit(X, counts)
    fitted = model.estimator_
    final = fitted.final_network_
    rows, ratings = [], []  # per adjective: activations, (level, weight)
    for a in range(3):
        cells = []
        for t, people in enumerate(counts[:, a]):
            end = np.cumsum(people) / people.sum()
            for k in range(16):
                q = (2 * k + np.arange(3)) / 32
                begin, p, last = q**2 * (3 - 2 * q)
                for level, (low, high) in enumerate(zip(np.r_[0, end], end)):
                    within = min(high, last) - max(low, begin)
                    cells.append((t, level, p, max(within, 0)))
        t, level, p, weight = map(np.array, zip(*cells))
        hidden = []
        for sensor, columns in SENSORS.items():
            if sensor == held_out:
                hidden.append(np.zeros((len(t), 2)))
                continue
            network = fitted.sensor_networks_[sensor]
            inputs = np.column_stack((X[t][:, columns], np.log(p / (1 - p))))
            of_sensor = network.coefs_, network.intercepts_, network.thresholds_
            hidden.append(plain_network(inputs, *of_sensor, a)[0])
        rows.append(np.hstack(hidden))
        ratings.append((level, 5 * weight))

    def cost(params):
        coef, bias, output, raw = np.split(params, [18, 21, 30])
        coef, output = coef.reshape(6, 3), output.reshape(3, 3)
        thresholds = raw.reshape(3, 4)
        loss = total = 0.0
        for a, (level, weight) in enumerate(ratings):
            _, proba = plain_network(rows[a], [coef, output], bias, thresholds, a)
            loss -= weight @ np.log(proba[np.arange(len(level)), level])
            total += weight.sum()
        return (loss + np.sum(coef**2) + np.sum(output**2)) / total

    params = np.concatenate(
        [
            final.coefs_[0].ravel(),
            final.intercepts_,
            final.coefs_[1].ravel(),
            final.thresholds_.ravel(),
        ]
    )
    assert final.loss_ == pytest.approx(cost(params), rel=1e-12)
    assert_allclose(approx_fprime(params, cost, 1e-6), 0, atol=2e-6)
    # And it predicts, for any position, what the plain loops do.
    p = np.array([-1.0, 2.0])
    predicted = fitted.predict_proba_with_positions(X, p)
    latent = fitted.predict_latent_with_positions(X, p)
    assert latent.shape == (6, 2, 3)
    for i, a in np.ndindex(2, 3):
        hidden = fitted.hidden_activations(np.column_stack((X, np.full(6, p[i]))))
        if held_out:
            assert not hidden[:, 2:4].any()
        expected = plain_network(
            hidden, final.coefs_, final.intercepts_, final.thresholds_, a
        )[1]
        assert_allclose(predicted[:, i, a], expected, atol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_gradient_where_rows_belong_to_one_adjective_each(seed):
    layout, X, _, params = random_problem(seed, n_trials=9)
    layout = Layout(3, 2, (5, 2, 3))
    params = params[: layout.size]
    rng = np.random.default_rng(seed)
    level = np.stack([rng.integers(k, size=9) for k in layout.n_levels], 1)[..., None]
    weight = rng.uniform(0.1, 2, size=(9, 3, 1))
    weight *= (np.arange(9) // 3)[:, None, None] == np.arange(3)[:, None]
    level[[2, 5, 8], [0, 1, 2], 0] = np.subtract(layout.n_levels, 1)
    observations = [(None, level[:, a], weight[:, a]) for a in range(3)]
    loss = NetworkLoss(layout, X, observations, 0.7)
    at_zero = [(np.zeros((9, 1)), *each[1:]) for each in observations]
    with_position = np.insert(params, 6, [0.0, 0.0])
    exact = by_hand(Layout(4, 2, layout.n_levels), X, at_zero, 0.7, with_position)
    cost, gradient = loss(params)
    assert cost == pytest.approx(exact, rel=1e-13)
    numeric = approx_fprime(params, lambda x: loss(x)[0], 1e-7)
    assert_allclose(gradient, numeric, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("held_out", [None, "pac"])
@pytest.mark.parametrize("sampling", ["level", "random"])
def test_combined_network_of_one_adjective_is_no_special_case(sampling, held_out):
    X, counts, _ = touches()
    model = DistributionalOrdinalRegressor(
        small_fusion(held_out=held_out), sampling=sampling, random_state=0
    )
    one = clone(model).fit(X, counts[:, 0]).predict_proba(X)
    among = clone(model).fit(X, counts[:, :1]).predict_proba(X)
    assert_allclose(among[:, 0], one, atol=1e-6)


def test_combined_network_without_positions():
    X, counts, _ = touches()
    model = SensorFusionNNPOM(SENSORS, NNPOM(2), random_state=0).fit(X, counts)
    assert model.final_network_.n_hidden == 10
    alone = clone(model.final_network_).fit(model.hidden_activations(X), counts)
    assert_array_equal(
        model.predict_proba(X), alone.predict_proba(model.hidden_activations(X))
    )
    assert model.predict_proba(X).shape == counts.shape
    assert model.thresholds_.shape == (3, 4)


@pytest.mark.slow
def test_contributions_of_sensors_to_several_adjectives():
    """Scores of a holdout with frozen networks, and of one fitted from the start."""
    X, counts, objects = touches()
    network = NNPOM(2, 3.0)
    fusion = SensorFusionNNPOM(SENSORS, network, network)
    model = DistributionalOrdinalRegressor(fusion)
    split = [(np.flatnonzero(objects < 8), np.flatnonzero(objects >= 8))]
    table = sensor_contributions(
        model, X, counts, groups=objects, cv=split, n_repeats=2, random_state=0
    )
    assert len(table) == 4 * 2 * 3 * 8
    seed = np.random.RandomState(0).randint(np.iinfo(np.int32).max, size=2)[0]
    (train, test), *_ = split
    model.set_params(random_state=seed, estimator__held_out="pdc")
    proba = model.fit(X[train], counts[train]).predict_proba(X[test])
    rows = table.query("held_out == 'pdc' and start == 0")
    for a, rows_of in rows.groupby("adjective"):
        expected = ranked_probability_score(counts[test][:, a], proba[:, a])
        assert rows_of["rps"].mean() == pytest.approx(expected, rel=1e-6)
    summary = contribution_summary(table, metric="rps", by="adjective")
    assert len(summary) == 3 * 3


def test_frozen_combined_network_of_other_adjectives():
    X, counts, _ = touches()
    fusion = SensorFusionNNPOM(SENSORS, NNPOM(2), NNPOM(2), random_state=0)
    final = FrozenEstimator(fusion.fit(X, counts[:, :2]).final_network_)
    fusion.set_params(final_estimator=final)
    with pytest.raises(ValueError, match="predicts 2 adjectives, but y has 3"):
        fusion.fit(X, counts)
    with pytest.raises(ValueError, match="predicts 2 adjectives, but y has one"):
        fusion.fit(X, counts[:, 0])
