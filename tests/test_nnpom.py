"""The proportional-odds network against exact arithmetic, ORCA and scikit-learn."""

import mpmath
import numpy as np
import pytest
from callback_recorder import Recorder
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import expit, logit
from sklearn.base import clone
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV
from sklearn.utils._testing import ignore_warnings

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, SensorFusionNNPOM
from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.models._conditioning import Conditioning
from sklearn_haptic.models._network import Layout, sigmoid_of_sums
from sklearn_haptic.models._network_loss import NetworkLoss
from sklearn_haptic.models._proportional_odds import (
    GAPS,
    SoftplusGaps,
    SquaredGaps,
    level_probabilities,
    ordinal_loss,
    thresholds_from,
)
from sklearn_haptic.models._quantile_positions import training_observations
from sklearn_haptic.models._solvers import Monitor, irprop_plus

REFERENCE_CASES = [
    f"{data}_{case}"
    for data in ("melanoma_fs_H10", "tae_H3", "toy_H5")
    for case in ("init_eps0.5", "sin", "stress", "trained200")
]


def _from_orca(case, gaps=SquaredGaps):
    """ORCA's parameters in this package's layout."""
    n_hidden, n_features = int(case["hidden"]), case["X_train"].shape[1]
    params = case["params"].ravel()
    n_first = n_hidden * (n_features + 1)
    layer = params[:n_first].reshape(n_hidden, n_features + 1, order="F")
    output, t = params[n_first : n_first + n_hidden], params[n_first + n_hidden :]
    raw_gaps = t[1:]
    if gaps is SoftplusGaps:
        raw_gaps = t[1:] ** 2 + np.log(-np.expm1(-(t[1:] ** 2)))
    flat = np.concatenate(
        (layer[:, 1:].T.ravel(), layer[:, 0], output, t[:1], raw_gaps)
    )
    return flat, Layout(n_features, n_hidden, (len(t) + 1,), gaps), t


def _to_orca(params, layout):
    """This package's parameters, or their gradient, in ORCA's layout."""
    coef, bias, [(output, first, raw_gaps)] = layout.split(params)
    layer = np.column_stack((bias, coef.T)).ravel(order="F")
    return np.concatenate((layer, output, first, raw_gaps))


@pytest.mark.parametrize("alpha", [1, 70_000, 10**9])
def test_whole_numbers_are_penalties_as_any(alpha):
    """From 65,520 on they were infinite, for they became numbers of half precision."""
    X, y = np.array([[-2000.0], [-900], [100], [1500]]), [1, 1, 2, 2]
    settings = {"n_hidden": 0, "scale_features": False}
    proba = NNPOM(alpha=alpha, **settings).fit(X, y).predict_proba(X)
    same = NNPOM(alpha=float(alpha), **settings).fit(X, y).predict_proba(X)
    assert_array_equal(proba, same)


@pytest.mark.parametrize("gaps", [SoftplusGaps, SquaredGaps])
@pytest.mark.parametrize("name", REFERENCE_CASES)
def test_cost_and_gradient_equal_sixty_digit_arithmetic(shared_data, name, gaps):
    case = np.load(shared_data / "nnpom_reference" / f"{name}.npz")
    params, layout, t = _from_orca(case, gaps)
    y = case["y_train"].ravel().astype(int)[:, None] - 1
    observed = None, y, np.ones(y.shape)
    loss = NetworkLoss(layout, case["X_train"], [observed], float(case["lam"]))
    cost, grad = loss(params)
    ours = _to_orca(grad, layout)
    if gaps is SoftplusGaps:
        _, _, [head] = layout.split(params)
        ours[len(ours) - len(t) + 1 :] *= 2 * t[1:] / expit(head.raw_gaps)
    exact = case["exact_grad"].ravel()
    assert cost == pytest.approx(float(case["exact_cost"]), rel=1e-12)
    assert np.abs(ours - exact).max() <= 1e-12 * max(1, np.abs(exact).max())


@pytest.mark.parametrize("name", [c for c in REFERENCE_CASES if "stress" not in c])
def test_probabilities_equal_orca(shared_data, name):
    case = np.load(shared_data / "nnpom_reference" / f"{name}.npz")
    params, layout, _ = _from_orca(case)
    _, _, [(_, first, raw_gaps)] = layout.split(params)
    thresholds = thresholds_from(first[0], raw_gaps, SquaredGaps)
    proba = level_probabilities(case["projected_test"], thresholds)
    assert_allclose(proba, case["orca_proba_test"], atol=1e-12)


class GivenStart(np.random.RandomState):
    """Draws the values that it is given."""

    def uniform(self, low, high, size):
        assert (low, high, size) == (-0.5, 0.5, len(self.values))
        return self.values


@pytest.mark.parametrize("data", ["melanoma_fs_H10", "tae_H3", "toy_H5"])
def test_two_hundred_steps_equal_orca(shared_data, data):
    """From the start values to the parameters, cost and predictions that it ends at."""
    folder = shared_data / "nnpom_reference"
    start = np.load(folder / f"{data}_init_eps0.5.npz")
    end = np.load(folder / f"{data}_trained200.npz")
    random_state = GivenStart(0)
    random_state.values, layout, _ = _from_orca(start)
    model = NNPOM(
        layout.n_hidden,
        float(end["lam"]),
        scale_features=False,
        gaps="squared",
        solver="irprop+",
        max_iter=200,
        tol=0,
        random_state=random_state,
    )
    with pytest.warns(ConvergenceWarning):
        model.fit(start["X_train"], start["y_train"].ravel())
    expected, _, _ = _from_orca(end)
    coef, bias, [(output, _, _)] = layout.split(expected)
    assert_allclose(model.coefs_[0], coef, rtol=1e-12)
    assert_allclose(model.intercepts_, bias, rtol=1e-12)
    assert_allclose(model.coefs_[1], output, rtol=1e-12)
    assert_allclose(model.thresholds_, end["thresholds"], rtol=1e-12)
    assert model.loss_ == pytest.approx(float(end["exact_cost"]), rel=1e-12)
    assert_allclose(
        model.predict_proba(end["X_test"]), end["orca_proba_test"], atol=1e-12
    )
    assert_array_equal(model.predict(end["X_test"]), end["predicted_test"].ravel())


def test_gaps_start_as_they_say():
    """Between the squares or the softplus of ±0.5, whatever the number of units."""
    for gaps, low, high in [("squared", 0, 0.25), ("softplus", 0.474, 0.975)]:
        for n_hidden in (1, 5000):
            layout = Layout(2, n_hidden, (40,), GAPS[gaps])
            start = np.random.RandomState(0).uniform(-0.5, 0.5, layout.size)
            network = layout.network(start, [np.arange(40)], 40)
            gap = np.diff(network.thresholds[0])
            assert low < gap.min() < low + 0.05 and high - 0.05 < gap.max() < high
            assert np.abs(start).max() < 0.5


def test_both_gaps_reach_the_same_minimum():
    rng = np.random.default_rng(5)
    X, y = rng.normal(size=(80, 3)), rng.integers(0, 4, 80)
    softplus, squared = (
        NNPOM(2, gaps=gaps, tol=1e-9, random_state=0).fit(X, y) for gaps in GAPS
    )
    assert squared.loss_ == pytest.approx(softplus.loss_, rel=1e-9)
    assert_allclose(squared.thresholds_, softplus.thresholds_, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("latent", [-800.0, -30.0, 0.3, 40.0, 800.0])
@pytest.mark.parametrize("gap_logit", [-700.0, -1.0, 50.0])
def test_loss_is_exact_where_probabilities_underflow(latent, gap_logit):
    first, gaps = -0.4, np.array([gap_logit, 0.5])
    with mpmath.workdps(1100):
        cuts = [mpmath.mpf(first)]
        for gap in gaps:
            cuts.append(cuts[-1] + mpmath.log1p(mpmath.exp(mpmath.mpf(gap))))

        def below(k, f):
            return 1 / (1 + mpmath.exp(f - cuts[k]))

        f = mpmath.mpf(latent)
        proba = [below(0, f), below(1, f) - below(0, f), below(2, f) - below(1, f)]
        proba.append(1 / (1 + mpmath.exp(cuts[2] - f)))
        exact = [float(-mpmath.log(p)) for p in proba]
    for k in range(4):
        loss, *grads = ordinal_loss(
            np.array([latent]), np.array([k]), np.ones(1), first, gaps
        )
        assert loss == pytest.approx(exact[k], rel=1e-12, abs=1e-300)
        assert all(np.isfinite(grad).all() for grad in grads)


def test_counts_equal_one_row_for_each_rating():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(30, 4))
    counts = rng.integers(0, 4, size=(30, 5))
    counts[:, 2] += 1
    rows = np.repeat(X, counts.sum(axis=1), axis=0)
    labels = np.concatenate([np.repeat(np.arange(1, 6), row) for row in counts])
    for n_hidden in (0, 3):
        model = NNPOM(n_hidden, random_state=0, tol=1e-9)
        assert_allclose(
            clone(model).fit(X, counts).predict_proba(X),
            clone(model).fit(rows, labels).predict_proba(X),
            atol=1e-6,
        )


def test_two_levels_linear_is_logistic_regression():
    rng = np.random.default_rng(1)
    X = rng.normal(size=(200, 5))
    y = (X @ rng.normal(size=5) + rng.logistic(size=200) > 0).astype(int)
    ours = NNPOM(0, alpha=2.0, scale_features=False, tol=1e-9).fit(X, y)
    peer = LogisticRegression(C=1 / 2.0, tol=1e-9).fit(X, y)
    assert_allclose(ours.coefs_[0], peer.coef_[0], atol=1e-6)
    assert_allclose(ours.thresholds_, -peer.intercept_, atol=1e-6)


def test_row_space_rotation_reaches_the_same_minimum():
    n_hidden = 3
    rng = np.random.default_rng(2)
    X, y = rng.normal(size=(20, 60)), rng.integers(0, 4, 20)
    model = NNPOM(
        n_hidden, scale_features=False, random_state=0, tol=1e-8, max_iter=2000
    ).fit(X, y)

    observed = None, y[:, None], np.ones((20, 1))
    cost = NetworkLoss(Layout(60, n_hidden, (4,)), X, [observed], 1.0)

    params = np.concatenate(
        [
            *[coef.ravel() for coef in model.coefs_[:1]],
            model.intercepts_,
            *model.coefs_[1:],
            model.thresholds_[:1],
            np.log(np.expm1(np.diff(model.thresholds_))),
        ]
    )
    value, grad = cost(params)
    assert value == pytest.approx(model.loss_, rel=1e-12)
    assert np.abs(grad).max() < 1e-6


@pytest.mark.parametrize("scale", [False, True])
@pytest.mark.parametrize("rotate", [False, True])
def test_conditioning_and_back(scale, rotate):
    """One network, told in scaled features, the solver's inputs and given features."""
    rng = np.random.default_rng(2)
    X, positions = 5 + 3 * rng.normal(size=(30, 4)), rng.normal(size=(30, 2))
    layout = Layout(5, 3, (4,))
    params = rng.normal(size=layout.size)
    features = Conditioning(X, layout, 0.7, np.ones(30), scale, rotate)
    start = features.apply(params)
    scaled = (X - X.mean(axis=0)) / np.sqrt(X.var(axis=0).sum()) if scale else X
    expected, *others = (
        each.network(values, [np.arange(4)], 4).predict_proba(seen, positions)
        for each, values, seen in [
            (layout, params, scaled),
            (features.layout, start, features.inputs),
            (layout, features.invert(start), X),
        ]
    )
    for proba in others:
        assert_allclose(proba, expected, rtol=1e-9)


@pytest.mark.parametrize("n_hidden", [0, 3])
@pytest.mark.parametrize("solver", ["lbfgs", "irprop+"])
def test_scaled_features_have_a_total_variance_of_one(n_hidden, solver):
    """The same as fitting features scaled beforehand, weights included."""
    rng = np.random.default_rng(2)
    X, y = 5 + 7 * rng.normal(size=(30, 4)), rng.integers(0, 4, 30)
    weight = rng.integers(0, 3, 30)
    repeated = np.repeat(X, weight, axis=0)
    scaled = (X - repeated.mean(axis=0)) / np.sqrt(repeated.var(axis=0).sum())
    model = NNPOM(n_hidden, solver=solver, max_iter=50, random_state=0)
    with ignore_warnings(category=ConvergenceWarning):
        ours = clone(model).fit(X, y, weight)
        peer = model.set_params(scale_features=False).fit(scaled, y, weight)
    assert_allclose(ours.predict_proba(X), peer.predict_proba(scaled), rtol=1e-7)


def test_levels_absent_from_training_keep_their_column():
    X = np.linspace(-2, 2, 40)[:, None]
    y = np.where(X[:, 0] > 0, 5, 3)
    model = NNPOM(n_hidden=0, levels=[1, 2, 3, 4, 5, 6]).fit(X, y)
    proba = model.predict_proba(X)
    assert proba.shape == (40, 6)
    assert (proba[:, [0, 1, 3, 5]] == 0).all()
    assert_allclose(proba.sum(axis=1), 1, rtol=1e-15)
    without = NNPOM(n_hidden=0).fit(X, y)
    assert_allclose(proba[:, [2, 4]], without.predict_proba(X))
    assert model.thresholds_[:2].tolist() == [-np.inf, -np.inf]
    assert model.thresholds_[2] == model.thresholds_[3]
    assert model.thresholds_[4] == np.inf


def test_fit_with_positions_equals_repeated_rows():
    rng = np.random.default_rng(3)
    X, positions = rng.normal(size=(25, 40)), rng.normal(size=(25, 6))
    level = rng.integers(0, 4, (25, 6))
    weight = rng.uniform(size=(25, 6))
    rows = np.column_stack((np.repeat(X, 6, axis=0), positions.ravel()))
    layout = Layout(41, 4, (4,))
    params = rng.uniform(-0.5, 0.5, layout.size)
    shared = NetworkLoss(layout, X, [(positions, level, weight)], 0.7)(params)
    observed = None, level.reshape(-1, 1), weight.reshape(-1, 1)
    repeated = NetworkLoss(layout, rows, [observed], 0.7)(params)
    assert shared[0] == pytest.approx(repeated[0], rel=1e-13)
    largest = np.abs(repeated[1]).max()
    assert_allclose(shared[1], repeated[1], rtol=0, atol=1e-13 * largest)
    for n_hidden in (0, 4):
        model = NNPOM(n_hidden, random_state=0).fit_with_positions(
            X, positions, level, weight, levels=np.arange(4)
        )
        grid = np.array([-1.0, 0.5])
        at_grid = np.column_stack((np.repeat(X, 2, axis=0), np.tile(grid, 25)))
        assert_allclose(
            model.predict_proba_with_positions(X, grid).reshape(50, 4),
            model.predict_proba(at_grid),
            rtol=1e-12,
        )


def test_observations_that_share_no_features_are_trials_of_their_own():
    rng = np.random.default_rng(3)
    X, positions = rng.normal(size=(25, 6, 4)), rng.normal(size=(25, 6))
    level, weight = rng.integers(0, 4, (25, 6)), rng.integers(0, 3, (25, 6)) * 1.0
    rows = np.dstack((X, positions)).reshape(-1, 5)
    model = NNPOM(0, scale_features=False, tol=1e-9)
    flat = clone(model).fit(rows, level.ravel(), weight.ravel())
    model.fit_with_positions(X, positions, level, weight, levels=np.arange(4))
    assert_allclose(model.predict_proba(rows), flat.predict_proba(rows), rtol=1e-6)


def test_shared_features_at_the_size_of_a_study():
    """Cost and gradient of repeated rows; positions that trials share and do not."""
    rng = np.random.default_rng(5)
    X = rng.normal(size=(60, 300))
    counts = rng.integers(0, 4, size=(6, 5)).repeat(10, axis=0) + 1.0
    layout = Layout(301, 30, (5,))
    params = rng.uniform(-0.5, 0.5, layout.size)
    for sampling in ("level", "random"):
        positions, level, weight = training_observations(
            counts, 15, sampling, np.random.RandomState(0)
        )
        positions = logit(positions)
        shared = NetworkLoss(layout, X, [(positions, level, weight)], 2.0)(params)
        rows = np.column_stack(
            (X.repeat(positions.shape[1], axis=0), positions.ravel())
        )
        observed = None, level.reshape(-1, 1), weight.reshape(-1, 1)
        repeated = NetworkLoss(layout, rows, [observed], 2.0)(params)
        assert shared[0] == pytest.approx(repeated[0], rel=1e-12)
        assert_allclose(
            shared[1], repeated[1], rtol=0, atol=1e-12 * np.abs(repeated[1]).max()
        )


@pytest.mark.parametrize("size", [1.0, 300.0, 400.0, 1e5])
def test_sigmoid_of_sums(size):
    """Against scipy, where the exponentials of the parts overflow too."""
    rng = np.random.default_rng(6)
    a, b = size * rng.normal(size=(50, 1)), size * rng.normal(size=(1, 40))
    b[0, :20] = -a[:20, 0] + rng.normal(size=20)  # large parts, small sums
    expected = expit(a + b)
    assert_allclose(
        sigmoid_of_sums(a, b), expected, rtol=1e-15 * max(size, 10), atol=1e-300
    )


def test_irprop_minimises_a_quadratic():
    scale = np.array([1.0, 100.0, 0.01])

    def fun(x):
        return 0.5 * np.sum(scale * (x - 3) ** 2), scale * (x - 3)

    x, n_iter, converged = irprop_plus(
        fun, np.zeros(3), max_iter=500, tol=1e-8, callback=lambda x, cost: False
    )
    assert converged and n_iter < 500
    assert_allclose(x, 3, atol=1e-5)


def test_every_tenth_iterate_is_validated_and_the_best_kept():
    errors = {10: 3.0, 20: 2.0, 30: 1.0, 40: 2.0, 50: np.nextafter(1.0, 0)}
    monitor = Monitor(lambda params: errors[params.item()], 20, None)
    params, stopped = np.zeros(1), []
    for i in range(1, 51):
        params[:] = i
        stopped.append(monitor(params, 0.0))
    assert stopped.index(True) == 49  # the thirtieth was the best
    assert monitor.best_params == [30] and monitor.best_error == 1


def test_early_stopping_keeps_whole_objects_and_the_best_model():
    rng = np.random.default_rng(6)
    X = rng.normal(size=(100, 30))
    y = np.clip(np.round(X[:, 0] + rng.normal(size=100)) + 3, 1, 5).astype(int)
    objects = np.repeat(np.arange(20), 5)
    model = NNPOM(
        20,
        alpha=1e-3,
        solver="irprop+",
        early_stopping=True,
        n_iter_no_change=30,
        random_state=0,
    ).fit(X, y, groups=objects)
    assert model.n_iter_ < 500
    assert model.loss_ > min(model.loss_curve_)  # stopped later, kept an earlier one
    assert model.n_iter_ % 10 == 0


def test_trials_of_weight_zero_are_no_trials_for_early_stopping():
    rng = np.random.default_rng(9)
    X, y = rng.normal(size=(60, 4)), rng.integers(1, 4, 60)
    used = np.arange(60) % 2 == 0
    model = NNPOM(3, early_stopping=True, n_iter_no_change=20, random_state=0)
    each = np.arange(60)
    weighted = clone(model).fit(X, y, sample_weight=used.astype(float), groups=each)
    removed = clone(model).fit(X[used], y[used], groups=each[used])
    assert_array_equal(weighted.predict_proba(X), removed.predict_proba(X))


def test_warns_without_convergence():
    rng = np.random.default_rng(7)
    X, y = rng.normal(size=(50, 5)), rng.integers(0, 5, 50)
    with pytest.warns(ConvergenceWarning, match="max_iter=2.*increase max_iter"):
        NNPOM(5, max_iter=2, random_state=0).fit(X, y)


def test_hidden_activations():
    rng = np.random.default_rng(8)
    X, y = rng.normal(size=(30, 3)), rng.integers(0, 3, 30)
    model = NNPOM(4, random_state=0).fit(X, y)
    hidden = model.hidden_activations(X)
    assert hidden.shape == (30, 4) and (hidden > 0).all() and (hidden < 1).all()
    assert_allclose(hidden @ model.coefs_[1], model.predict_latent(X))
    linear = NNPOM(0).fit(X, y)
    assert linear.hidden_activations(X).shape == (30, 0)


@pytest.mark.parametrize("solver", ["lbfgs", "irprop+"])
def test_callbacks_see_every_iteration_and_may_stop(solver):
    rng = np.random.default_rng(8)
    X, y = rng.normal(size=(30, 3)), rng.integers(0, 3, 30)
    recorder = Recorder(stop_after=4)
    model = NNPOM(4, solver=solver, random_state=0).set_callbacks(recorder).fit(X, y)
    assert model.n_iter_ == 4
    iterations = [f"iteration {i}" for i in range(1, 5)]
    assert recorder.tasks == ["setup", *iterations, "fit", "teardown"]
    recorder.tasks.clear()
    DistributionalOrdinalRegressor(
        NNPOM(4, solver=solver, random_state=0)
    ).set_callbacks(recorder).fit(X, y)
    assert recorder.tasks[:5] == ["setup", *iterations]
    assert recorder.tasks[-1] == "teardown"


@pytest.mark.parametrize("weight", [1e-300, 1e-307])
def test_weights_against_a_penalty_that_is_not_scaled(weight):
    """Next to nothing is left of the ratings but their shares, which cost nothing."""
    rng = np.random.default_rng(0)
    X, counts = rng.normal(size=(40, 3)), rng.multinomial(9, [0.2, 0.3, 0.5], size=40)
    proba = NNPOM(0).fit(X, counts, np.full(40, weight)).predict_proba(X)
    marginal = counts.sum(axis=0) / counts.sum()
    assert_allclose(proba, [marginal] * 40, rtol=1e-6)


def test_a_product_that_underflows_is_no_trial():
    X, counts = np.eye(4), np.ones((4, 3))
    few = np.array([1.0, 1.0, 1.0, 1e-200])
    proba = NNPOM(0).fit(X, (counts.T * few).T, few).predict_proba(X)
    assert_allclose(proba, NNPOM(0).fit(X[:3], counts[:3]).predict_proba(X))


@pytest.mark.slow
@pytest.mark.parametrize("make", [NNPOM, SensorFusionNNPOM])
def test_counts_and_labels_are_scored_by_the_same_rule(make):
    """By a plain loop over people; a search no longer returns its first candidate."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(60, 3))
    level = np.digitize(2 * X[:, :1] + rng.logistic(size=(60, 9)), [-1, 0, 1])
    counts = np.stack([(level == k).sum(axis=1) for k in range(4)], axis=1)
    model = make() if make is NNPOM else make({"a": [0], "b": [1, 2]})
    model.set_params(random_state=0)
    for y in (counts, level[:, 0] + 1):
        fitted = clone(model).fit(X, y)
        cdf = np.cumsum(fitted.predict_proba(X), axis=1)
        weight, scores = rng.uniform(size=60), []
        for t in range(60):
            ratings = level[t] if y is counts else level[t, :1]
            of_people = [
                sum((cdf[t, k] - (rating <= k)) ** 2 for k in range(3))
                for rating in ratings
            ]
            scores.append(np.mean(of_people))
        assert fitted.score(X, y) == pytest.approx(-np.mean(scores))
        expected = -np.average(scores, weights=weight)
        assert fitted.score(X, y, weight) == pytest.approx(expected)
    name = "alpha" if make is NNPOM else "final_estimator__alpha"
    model.set_params(**({} if make is NNPOM else {"final_estimator": NNPOM(0)}))
    search = GridSearchCV(model, {name: [1e6, 1.0]}, cv=3).fit(X, counts)
    assert np.isfinite(search.cv_results_["mean_test_score"]).all()
    assert search.best_params_ == {name: 1.0}


def test_several_adjectives_are_scored():
    rng = np.random.default_rng(0)
    X, counts = rng.normal(size=(40, 3)), rng.integers(1, 9, size=(40, 2, 3))
    model = NNPOM(2, random_state=0).fit(X, counts)
    proba = model.predict_proba(X)
    each = [-ranked_probability_score(counts[:, a], proba[:, a]) for a in range(2)]
    assert model.score(X, counts) == pytest.approx(np.mean(each))
