"""Models, metrics and ratings at the extremes of their input.

Judged by arithmetic of hundreds of digits or of exact fractions, by models whose
distributions are known, and by inputs that differ in nothing that matters.
"""

import operator
from fractions import Fraction
from itertools import accumulate, pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import logit
from sklearn.base import clone
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils._testing import ignore_warnings

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, DummyDistribution
from sklearn_haptic.metrics import (
    dispersion,
    earth_movers_distance,
    log_score,
    macro_mae,
    pit_histogram,
    ranked_probability_score,
)
from sklearn_haptic.models._network import Layout, linear_response, sigmoid_of_sums
from sklearn_haptic.models._network_loss import NetworkLoss
from sklearn_haptic.models._proportional_odds import (
    SoftplusGaps,
    SquaredGaps,
    level_probabilities,
    marginal_thresholds,
    ordinal_loss,
    softplus,
    thresholds_from,
)
from sklearn_haptic.models._quantile_positions import share_below, training_observations
from sklearn_haptic.models._solvers import irprop_plus
from sklearn_haptic.ratings import (
    adjective_correlation,
    interrater_agreement,
    inverse_cdf,
)
from sklearn_haptic.ratings._distributions import level_at

EPS = np.finfo(np.float64).eps
MAX = np.finfo(np.float64).max
TINY = np.finfo(np.float64).smallest_subnormal
NETWORKS = [pytest.param(NNPOM(0), id="linear")]
NETWORKS += [
    pytest.param(
        NNPOM(3, gaps=gaps, solver=solver, random_state=0), id=f"{solver}3{gaps}"
    )
    for gaps in ("softplus", "squared")
    for solver in ("lbfgs", "irprop+")
]
fit_quietly = ignore_warnings(category=ConvergenceWarning)


def examples(n):
    return settings(  # without shrinking, which takes minutes of long arithmetic
        max_examples=n,
        phases=(Phase.explicit, Phase.generate),
        derandomize=True,
        deadline=None,
        database=None,
        print_blob=False,
    )


def touches(n_trials=30, n_features=4, seed=0):
    """Features, and the counts of five levels, every level used."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(0, 5, (n_trials, 5))
    counts[:, 2] += 1
    return rng.normal(size=(n_trials, n_features)), counts


def assert_distributions(proba):
    assert np.isfinite(proba).all() and (proba >= 0).all()
    assert np.abs(proba.sum(axis=-1) - 1).max() <= 4 * EPS


# The network's cost and gradient


def exact_cost(params, layout, X, positions, level, weight, alpha):
    """The cost by its definition, with differences of cumulative probabilities."""
    coef, bias, [(output, first, raw_gaps)] = layout.split(
        np.array(params, dtype=object)
    )
    gaps = raw_gaps**2
    if layout.gaps is SoftplusGaps:
        gaps = [mpmath.log(1 + mpmath.exp(gap)) for gap in raw_gaps]
    cuts = [-mpmath.inf, *accumulate([first[0], *gaps]), mpmath.inf]

    def sigmoid(z):
        return 1 / (1 + mpmath.exp(-z))

    total = mpmath.mpf(alpha) / 2 * (np.sum(coef**2) + np.sum(output**2))
    for i, j in np.ndindex(weight.shape):
        inputs = np.append(X[i], [] if positions is None else positions[i, j])
        hidden = np.array([mpmath.mpf(x) for x in inputs]) @ coef + bias
        latent = np.array([sigmoid(z) for z in hidden]) @ output
        proba = sigmoid(cuts[level[i, j] + 1] - latent)
        proba -= sigmoid(cuts[level[i, j]] - latent)
        total -= mpmath.mpf(weight[i, j]) * mpmath.log(proba)
    return total / mpmath.fsum(map(mpmath.mpf, weight.ravel()))


def exact_cost_and_gradient(params, *data):
    """Central differences of a step of 1e-30 leave sixty digits of the gradient."""
    with mpmath.workdps(700):
        params, step = [mpmath.mpf(x) for x in params], mpmath.mpf(10) ** -30
        grad = []
        for i in range(len(params)):
            up, down = list(params), list(params)
            up[i] += step
            down[i] -= step
            grad.append((exact_cost(up, *data) - exact_cost(down, *data)) / (2 * step))
        return float(exact_cost(params, *data)), np.array(grad, dtype=np.float64)


@pytest.mark.slow
@pytest.mark.parametrize("shared", [False, True], ids=["rows", "positions"])
@pytest.mark.parametrize("gaps", [SoftplusGaps, SquaredGaps])
@examples(8)
@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.sampled_from([0.01, 1.0, 10.0, 100.0]),
    weight_digits=st.integers(0, 12),
)
def test_cost_and_gradient_where_units_saturate(
    shared, gaps, seed, size, weight_digits
):
    rng = np.random.default_rng(seed)
    X, level = rng.normal(size=(2, 2)), rng.integers(0, 4, (2, 2))
    positions = rng.normal(size=(2, 2)) if shared else None
    weight = 10 ** rng.uniform(-weight_digits, weight_digits, (2, 2))
    layout = Layout(2 + shared, 2, (4,), gaps)
    params = size * rng.uniform(-1, 1, layout.size)
    if gaps is SquaredGaps:
        _, _, [head] = layout.split(params)
        head.raw_gaps[:] = np.copysign(np.abs(head.raw_gaps) ** 0.5, head.raw_gaps)
    observed = positions, level, weight
    cost, grad = NetworkLoss(layout, X, [observed], 0.7)(params)
    exact, exact_grad = exact_cost_and_gradient(params, layout, X, *observed, 0.7)
    assert cost == pytest.approx(exact, rel=1e-14)
    atol = 1e-13 * max(1, np.abs(exact_grad).max())
    assert_allclose(grad, exact_grad, rtol=0, atol=atol)


@pytest.mark.slow
@examples(30)
@given(
    latent=st.floats(-1e3, 1e3),
    first=st.floats(-1e3, 1e3),
    gap_logits=st.lists(st.floats(-700, 1e3), max_size=18),
)
@example(latent=0.5, first=0.0, gap_logits=[-30.0])
def test_probabilities_of_two_to_twenty_levels(latent, first, gap_logits):
    thresholds = thresholds_from(first, np.array(gap_logits))
    proba = level_probabilities(np.array([latent]), thresholds)
    assert_distributions(proba)
    with mpmath.workdps(1000):
        below = [1 / (1 + mpmath.exp(mpmath.mpf(latent) - b)) for b in thresholds]
        exact = np.diff([mpmath.mpf(0), *below, mpmath.mpf(1)]).astype(np.float64)
    largest = max(1, abs(latent), np.abs(thresholds).max())
    assert_allclose(proba[0], exact, rtol=8 * EPS * largest, atol=1e-300)


@pytest.mark.parametrize("latent", [-1e300, -1e4, TINY, 1e4, 1e300])
def test_probabilities_of_latent_responses_beyond_all_thresholds(latent):
    proba = level_probabilities(np.array([latent]), np.array([-3.0, 0.0, 3.0]))
    assert_distributions(proba)
    if abs(latent) > 1:
        assert proba[0, -1 if latent > 0 else 0] == 1


def test_softplus_and_sigmoids_at_the_ends_of_the_numbers():
    x = np.array([-np.inf, -1e308, -750.0, -TINY, TINY, 750.0, 1e308, np.inf])
    expected = [0, 0, np.exp(-750), np.log(2), np.log(2), 750, 1e308, np.inf]
    assert_allclose(softplus(x), expected, rtol=1e-15)
    a, b = np.array([[-1e308], [1e308]]), np.array([[-1e308, 0.0, 9e307]])
    with np.errstate(over="ignore"):
        sigmoid = sigmoid_of_sums(a, b)
    assert_array_equal(sigmoid, [[0, 0, 0], [0.5, 1, 1]])


@pytest.mark.slow
@examples(50)
@given(
    st.lists(
        st.floats(1e-100, 1e100) | st.sampled_from([1.0, 1e12, 1e17]),
        min_size=2,
        max_size=20,
    )
)
def test_linear_start_has_the_frequencies_of_the_levels(weight):
    """To full precision, where one rating stands among 1e200."""
    first, gaps = marginal_thresholds(np.array(weight))
    with mpmath.workdps(300):
        cuts = list(accumulate(map(mpmath.mpf, [*first, *gaps])))
        below = [mpmath.mpf(0), *(1 / (1 + mpmath.exp(-cut)) for cut in cuts), 1]
        total = mpmath.fsum(weight)
        for (start, end), w in zip(pairwise(below), weight):
            assert abs((end - start) * total / w - 1) < 1e-9


@pytest.mark.parametrize("root", [1e-150, 1e-9, 0.1, 0.9, 1.1, 6.0, 1e9, 1e150])
@pytest.mark.parametrize("sign", [1, -1])
def test_squared_gaps_of_any_size(root, sign):
    t = np.array([sign * root])
    gap, log_factor = SquaredGaps.forward(t)
    slope, log_slope = SquaredGaps.derivative(t)
    with mpmath.workdps(400):
        exact = mpmath.mpf(root) ** 2
        left = mpmath.exp(-exact) if root < 1e9 else mpmath.mpf(0)
        expected = mpmath.log1p(-left), 2 * sign * root * left / (1 - left)
        expected = [float(x) for x in (exact, *expected)]
    atol = np.finfo(float).tiny
    assert_allclose(
        [gap[0], log_factor[0], log_slope[0]], expected, rtol=1e-14, atol=atol
    )
    assert slope[0] == 2 * t[0]


@pytest.mark.parametrize("t", [0.0, -0.0, TINY, -1e-200, 1e-160, 1e200, -MAX])
def test_squared_gaps_at_zero_and_beyond_all_numbers(t):
    """Finite cost and gradient, which lead away from equal thresholds."""
    t = np.array([t, 0.5])
    for latent in (-1e300, 0.0, 1e300):
        proba = level_probabilities(
            np.array([latent]), thresholds_from(-0.4, t, SquaredGaps)
        )
        assert_distributions(proba)
    for level in range(4):
        loss, *grads = ordinal_loss(
            np.zeros(1), np.array([level]), np.ones(1), -0.4, t, SquaredGaps
        )
        assert np.isfinite(loss) and all(np.isfinite(grad).all() for grad in grads)
        if level == 1 and abs(t[0]) < 1:
            assert loss > 600 and np.sign(grads[-1][0]) == -np.copysign(1, t[0])


class NoDraws(np.random.RandomState):
    def uniform(self, low, high, size):
        return np.zeros(size)


def test_thresholds_that_are_equal_at_the_start():
    """They part, and the network ends at the frequencies of constant features."""
    _, counts = touches()
    model = NNPOM(2, gaps="squared", solver="irprop+", max_iter=2000, tol=1e-7)
    model.set_params(random_state=NoDraws(0))
    proba = model.fit(np.zeros((30, 2)), counts).predict_proba([[0, 0]])
    assert np.isfinite(model.loss_) and (np.diff(model.thresholds_) > 0).all()
    frequencies = counts.sum(axis=0) / counts.sum()
    assert_allclose(proba[0], frequencies, atol=1e-5)
    with pytest.warns(ConvergenceWarning, match="did not converge"):
        model.set_params(solver="lbfgs").fit(np.zeros((30, 2)), counts)
    assert_distributions(model.predict_proba([[0, 0]]))
    assert np.isfinite(model.loss_)


# Fits whose result is known


@pytest.mark.slow
@pytest.mark.parametrize("model", NETWORKS)
@pytest.mark.parametrize(
    ("value", "scale_features"),
    [(0.0, True), (0.1, True), (-1e12, True), (1e-150, True), (0.0, False)],
)
def test_constant_features_predict_the_frequencies(model, value, scale_features):
    _, counts = touches()
    X = np.full((30, 3), value)
    model = clone(model).set_params(
        scale_features=scale_features, tol=1e-7, max_iter=2000
    )
    proba = fit_quietly(model.fit)(X, counts).predict_proba(X)
    assert_distributions(proba)
    frequencies = counts.sum(axis=0) / counts.sum()
    assert_allclose(proba[0], frequencies, atol=1e-5)
    assert max(np.abs(coef).max() for coef in model.coefs_) < 0.1


@pytest.mark.parametrize("model", NETWORKS)
def test_one_trial_predicts_its_own_frequencies(model):
    X, counts = touches(1)
    model = clone(model).set_params(tol=1e-7)
    proba = fit_quietly(model.fit)(X, counts).predict_proba(X)
    assert_allclose(proba, counts / counts.sum(), atol=1e-5)
    certain = model.fit(X, [3]).predict_proba(X)
    assert certain.tolist() == [[1.0]] and model.predict(X).tolist() == [3]


@pytest.mark.slow
@pytest.mark.parametrize("model", NETWORKS)
def test_separable_trials_without_a_penalty(model):
    X = np.arange(60.0)[:, None]
    y = np.arange(60) // 3  # twenty levels
    model = clone(model).set_params(alpha=0, max_iter=200)
    proba = fit_quietly(model.fit)(X, y).predict_proba(X)
    assert_distributions(proba)
    assert np.isfinite(model.loss_) and np.isfinite(model.thresholds_).all()
    two = clone(model).set_params(tol=0)  # as far as rounding lets it go
    halves = X[:, 0] >= 30
    proba = fit_quietly(two.fit)(X, halves).predict_proba(X)
    assert_distributions(proba)
    assert (two.predict(X) == halves).all()
    assert proba[[0, -1], [0, 1]].min() > 0.999


@pytest.mark.slow
@pytest.mark.parametrize("model", NETWORKS)
@pytest.mark.parametrize("unused", [[0], [2], [4], [0, 1, 3]])
def test_levels_never_used(model, unused):
    """First, inner and last ones: as if they did not exist, to the last digit."""
    X, counts = touches()
    used = np.setdiff1d(np.arange(5), unused)
    counts[:, unused] = 0
    proba = fit_quietly(clone(model).fit)(X, counts).predict_proba(X)
    without = fit_quietly(clone(model).fit)(X, counts[:, used]).predict_proba(X)
    assert_array_equal(proba[:, used], without)
    assert (proba[:, unused] == 0).all()


@pytest.mark.parametrize("model", NETWORKS)
def test_raters_who_agree_are_one_rater(model):
    """As many unanimous raters as the penalty grows: 1, 16 and 16384."""
    X, counts = touches()
    y = counts.argmax(axis=1) + 1
    proba = [fit_quietly(clone(model).fit)(X, y).predict_proba(X)]
    for n_raters in (1, 16, 16384):
        unanimous = n_raters * np.eye(5)[y - 1]
        crowd = clone(model).set_params(alpha=model.alpha * n_raters)
        proba.append(fit_quietly(crowd.fit)(X, unanimous).predict_proba(X))
    assert_distributions(np.array(proba))
    for other in proba[1:]:
        assert_allclose(other, proba[0], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("model", NETWORKS)
@pytest.mark.parametrize("exponent", [-500, -40, 40, 500])
def test_powers_of_two_in_features_and_weights_change_no_digit(model, exponent):
    X, counts = touches()
    factor = 2.0**exponent
    expected = fit_quietly(clone(model).fit)(X, counts).predict_proba(X)
    scaled = fit_quietly(clone(model).fit)(X * factor, counts)
    assert_array_equal(scaled.predict_proba(X * factor), expected)
    weighted = clone(model).set_params(alpha=model.alpha * factor)
    fit_quietly(weighted.fit)(X, counts, sample_weight=np.full(len(X), factor))
    assert_array_equal(weighted.predict_proba(X), expected)


@pytest.mark.parametrize("model", NETWORKS)
@pytest.mark.parametrize("offset", [2.0**14, 2.0**26])
def test_features_far_from_zero(model, offset):
    """Rounding of the weighted sums is all that is left of the offset."""
    X, counts = touches()
    X = np.round(X * 2**20) / 2**20
    expected = fit_quietly(clone(model).fit)(X, counts).predict_proba(X)
    shifted = fit_quietly(clone(model).fit)(X + offset, counts)
    assert_allclose(shifted.predict_proba(X + offset), expected, rtol=16 * EPS * offset)


@pytest.mark.slow
@pytest.mark.parametrize("model", NETWORKS)
def test_weights_of_zero_and_of_a_million_million(model):
    X, counts = touches()
    heavy = np.arange(30) % 3 == 0
    weight = np.where(heavy, 1e12, 0.0)
    model = clone(model).set_params(alpha=1e12, tol=1e-7)
    removed = fit_quietly(clone(model).fit)(X[heavy], counts[heavy], weight[heavy])
    zero = fit_quietly(clone(model).fit)(X, counts, weight)
    assert_array_equal(zero.predict_proba(X), removed.predict_proba(X))
    light = fit_quietly(clone(model).fit)(X, counts, np.maximum(weight, 1.0))
    assert_distributions(light.predict_proba(X))
    if model.n_hidden == 0:
        assert_allclose(light.predict_proba(X), removed.predict_proba(X), atol=1e-5)


def test_a_penalty_that_leaves_the_cost_without_digits():
    """It either reaches the frequencies of the levels or says that it did not."""
    X, counts = touches()
    frequencies = counts.sum(axis=0) / counts.sum()
    for n_hidden, alpha in [(0, 1e8), (0, 1e300), (3, 1e8)]:
        proba = NNPOM(n_hidden, alpha, random_state=0).fit(X, counts).predict_proba(X)
        assert_allclose(proba, np.tile(frequencies, (30, 1)), atol=1e-3)
    for alpha in (1e30, 1e300):
        with pytest.warns(ConvergenceWarning, match="did not converge"):
            NNPOM(3, alpha, random_state=0).fit(X, counts)


@pytest.mark.parametrize("size", [1e-250, 1.0, 1e250])
def test_irprop_minds_the_sign_of_the_gradient_alone(size):
    def fun(x):
        return size * np.sum((x - 3) ** 2), 2 * size * (x - 3)

    x, n_iter, _ = irprop_plus(
        fun, np.zeros(2), max_iter=80, tol=0, callback=lambda x, cost: False
    )
    assert_allclose(x, 3, atol=1e-6)
    assert n_iter == 80


@pytest.mark.parametrize("n_hidden", [0, 3])
@pytest.mark.parametrize(
    "layout", [np.asfortranarray, lambda X: X.repeat(2, 1)[:, ::2]]
)
def test_layout_of_the_features_changes_no_digit(n_hidden, layout):
    X, counts = touches()
    model = NNPOM(n_hidden, random_state=0)
    fits = [clone(model).fit(features, counts) for features in (X, layout(X))]
    assert_array_equal(*(each.predict_proba(X) for each in fits))


@pytest.mark.parametrize("n_hidden", [0, 3])
def test_order_of_trials(n_hidden):
    """Sums in another order: the last digits of the cost, then those of the model."""
    X, counts = touches()
    order = np.random.default_rng(1).permutation(len(X))
    layout = Layout(4, 3, (5,))
    params = np.random.default_rng(2).normal(size=layout.size)
    level = np.arange(5)[None]
    (cost, grad), (other_cost, other_grad) = (
        NetworkLoss(layout, X[rows], [(None, level, counts[rows] * 1.0)], 1.0)(params)
        for rows in (np.arange(30), order)
    )
    assert cost == pytest.approx(other_cost, rel=1e-14)
    assert_allclose(grad, other_grad, atol=1e-14)
    for base in (
        NNPOM(n_hidden, alpha=3, tol=1e-9, random_state=0),
        DistributionalOrdinalRegressor(
            NNPOM(n_hidden, alpha=3, tol=1e-9), random_state=0
        ),
    ):
        proba = clone(base).fit(X, counts).predict_proba(X)
        again = clone(base).fit(X, counts).predict_proba(X)
        permuted = clone(base).fit(X[order], counts[order]).predict_proba(X)
        assert_array_equal(again, proba)
        assert_allclose(permuted, proba, atol=1e-6)


@pytest.mark.slow
@examples(100)
@given(st.data(), st.integers(1, 5), st.integers(1, 9), st.integers(0, 3))
def test_the_sign_of_a_response_that_overflows_is_exact(data, n, n_features, n_hidden):
    """Against fractions, whichever way the kernel sums."""
    shape = (n_features, n_hidden) if n_hidden else (n_features,)
    numbers = st.floats(-1.7e308, 1.7e308)
    X = data.draw(arrays(np.float64, (n, n_features), elements=numbers))
    coef = data.draw(arrays(np.float64, shape, elements=numbers))
    response = linear_response(X, coef)
    exact_coef = np.vectorize(Fraction, otypes=[object])(coef)
    exact_X = np.vectorize(Fraction, otypes=[object])(X)
    exact = exact_X @ exact_coef
    size = abs(exact_X) @ abs(exact_coef)
    assert response.shape == exact.shape
    for value, true, largest in zip(response.flat, exact.flat, size.flat):
        rounding = largest * Fraction(1e-14) + Fraction(9 * TINY)
        if abs(true) > 2**1024 + rounding:
            assert value == (np.inf if true > 0 else -np.inf)
        else:
            assert abs(Fraction(float(np.clip(value, -MAX, MAX))) - true) <= rounding


def test_single_precision_is_summed_in_double_block_by_block(monkeypatch):
    monkeypatch.setattr("sklearn_haptic.models._network._BLOCK", 8)
    X = np.random.default_rng(0).normal(size=(11, 3)).astype(np.float32)
    coef = np.array([1.0, -2.0, 0.3])
    assert_allclose(linear_response(X, coef), X.astype(float) @ coef, rtol=1e-14)


@pytest.mark.parametrize("n_trials", [1, 2, 3, 50])
@pytest.mark.parametrize("order", ["C", "F"])
def test_prediction_far_from_the_training_features(n_trials, order):
    """Certain, by the sign of the response, also where its terms overflow."""
    X, counts = touches()
    model = DistributionalOrdinalRegressor(NNPOM(0)).fit(X * 1e-150, counts)
    coef = model.estimator_.coefs_[0][:-1]
    away = 1e250 * np.sign(coef)
    mixed = away * [1, -1, 1, -1]
    exact = sum(map(operator.mul, map(Fraction, mixed), map(Fraction, coef)))
    certain = np.eye(5)[[4, 0, 4 if exact > 0 else 0]]
    for decode in ("mixture", "quantile"):
        model.set_params(decode=decode)
        for row, expected in zip([away, -away, mixed], certain):
            rows = np.array([row] * n_trials, order=order)
            proba = model.predict_proba(rows)
            assert_allclose(proba, [expected] * n_trials, atol=1e-300)
    network = NNPOM(3, random_state=0).fit(X, counts)
    assert_distributions(network.predict_proba(X * 1e305))


# The distributional regressor

CROWDS = {
    "unanimous": lambda counts: 12 * np.eye(5)[counts.argmax(axis=1)],
    "one rater": lambda counts: np.eye(5)[counts.argmax(axis=1)],
    "the same": lambda counts: np.tile([0, 0, 12, 0, 0], (len(counts), 1)),
    "first and last": lambda counts: counts * [1, 0, 0, 0, 1] + [1, 0, 0, 0, 0],
    "10,000 raters": lambda counts: 2500 * counts,
    "rare": lambda counts: np.where(counts > 2, 1e12, counts),
    "subnormal": lambda counts: np.where(counts > 2, 1, counts * TINY),
    "ties": lambda counts: np.tile([20, 20, 20, 20, 20], (len(counts), 1)),
}


def assert_consistent(model, X):
    """All predictions are those of one distribution, which is one."""
    proba, cdf = model.predict_proba(X), model.predict_cdf(X)
    assert_distributions(proba)
    assert (cdf[:, -1] == 1).all() and (np.diff(cdf) >= 0).all()
    assert_allclose(cdf, proba.cumsum(axis=1), atol=4 * EPS)
    assert_array_equal(model.predict(X), model.levels_[proba.argmax(axis=1)])
    p = np.array([0, TINY, EPS, 0.01, 0.5, 0.99, 1 - EPS, 1 - EPS / 2, 1])
    quantiles = model.predict_quantile(X, p)
    assert (np.diff(quantiles) >= 0).all()
    for row, chosen in zip(proba, quantiles):
        assert (row[chosen - 1] > 0).all()
        below = [*accumulate(map(Fraction, row.tolist()))]
        for position, level in zip(p.tolist(), chosen):
            if position in (EPS, 1 - EPS, 1 - EPS / 2):  # within the tolerance
                continue
            rank = Fraction(position) * below[-1]
            exact = next(k for k, b in enumerate(below) if b >= rank and row[k] > 0)
            assert level == exact + 1 or abs(below[exact] - rank) < 40 * EPS


@pytest.mark.slow
@pytest.mark.parametrize("crowd", CROWDS)
@pytest.mark.parametrize("sampling", ["level", "random"])
def test_every_crowd_gives_consistent_predictions(crowd, sampling):
    X, counts = touches()
    for n_hidden in (0, 3):
        model = DistributionalOrdinalRegressor(
            NNPOM(n_hidden, max_iter=60), sampling=sampling, random_state=0
        )
        fit_quietly(model.fit)(X, CROWDS[crowd](counts))
        for decode in ("mixture", "quantile"):
            assert_consistent(model.set_params(decode=decode), X)
        assert_consistent(model.set_params(rule="argmax"), X)


@pytest.mark.slow
@examples(40)
@given(
    counts=st.lists(st.sampled_from([0, 1, 2, 70, 10**12]), min_size=2, max_size=20),
    n_duplicates=st.sampled_from([1, 2, 15, 1000]),
    sampling=st.sampled_from(["level", "random"]),
)
def test_observations_of_extreme_counts(counts, n_duplicates, sampling):
    """Every label is the rating at its position; every rating has its weight."""
    counts = counts if any(counts) else [*counts[:-1], 1]
    positions, level, weight = training_observations(
        np.array([counts], dtype=np.float64),
        n_duplicates,
        sampling,
        np.random.RandomState(0),
    )
    assert ((positions > 0) & (positions < 1)).all()
    assert np.isfinite(logit(positions)).all()
    assert weight.sum() == pytest.approx(n_duplicates, rel=1e-12)
    below = [*accumulate(counts)]
    tolerance = 4 * len(counts) * EPS * below[-1]
    if sampling == "level":
        share = np.bincount(level[0], weight[0], len(counts)) / n_duplicates
        assert_allclose(share * below[-1], counts, rtol=1e-12, atol=tolerance)
        return
    for p, k in zip(positions[0].tolist(), level[0]):
        rank = Fraction(p) * below[-1]
        assert counts[k] > 0
        assert below[k] - counts[k] - tolerance <= rank <= below[k] + tolerance


class Uniform:
    """A generator of the smallest and largest numbers that there are in [0, 1)."""

    def uniform(self, size):
        return np.resize([0.0, 1 - EPS / 2], size)


def test_positions_next_to_zero_and_one():
    counts = np.array([[1.0, 0, 1, 0], [0, 1e12, 1, 0]])
    positions, level, _ = training_observations(counts, 4, "random", Uniform())
    assert ((positions > 0) & (positions < 1)).all()
    assert np.isfinite(logit(positions)).all()
    assert (np.take_along_axis(counts, level, axis=1) > 0).all()


@examples(60)
@given(
    latent=st.lists(st.integers(-3, 3), min_size=2, max_size=12),
    thresholds=st.lists(st.integers(-3, 3), min_size=1, max_size=6),
)
def test_share_below_of_responses_that_touch_the_thresholds(latent, thresholds):
    """Against the lengths of the pieces in exact fractions."""
    thresholds = sorted(thresholds)
    n_pieces = len(latent) - 1
    expected = []
    for cut in thresholds:
        length = Fraction(0)
        for left, right in pairwise(latent):
            if left == right:
                length += left <= cut
            else:
                part = Fraction(cut - left, right - left)
                part = min(max(part, Fraction(0)), Fraction(1))
                length += part if right > left else 1 - part
        expected.append(float(length / n_pieces))
    share = share_below(
        np.array([latent], dtype=np.float64),
        np.array(thresholds, dtype=np.float64),
        np.linspace(0, 1, len(latent)),
        np.positive,
    )
    assert_allclose(share[0], expected, atol=4 * EPS)


@pytest.mark.parametrize("strategy", ["marginal", "barycentre"])
def test_baselines_of_hundreds_of_levels_and_extreme_counts(strategy):
    rng = np.random.default_rng(0)
    counts = rng.integers(0, 3, (500, 300)) * 10.0 ** rng.integers(-300, 13, (500, 1))
    model = DummyDistribution(strategy).fit(counts, counts + 1e-300)
    assert_distributions(model.proba_)
    cdf = model.proba_.cumsum()
    share = (counts + 1e-300) / (counts + 1e-300).sum(axis=1, keepdims=True)
    centre = np.mean if strategy == "marginal" else np.median
    assert_allclose(cdf, centre(share.cumsum(axis=1), axis=0), atol=1e-13)


# Metrics


def exact_scores(counts, proba):
    """Every score of one trial in exact fractions and sixty digits."""
    f = [Fraction(n) / sum(map(Fraction, counts)) for n in counts]
    p = [Fraction(x) / sum(map(Fraction, proba)) for x in proba]
    F, P = [*accumulate(f)], [*accumulate(p)]
    mean = sum(k * x for k, x in enumerate(p))
    spread = sum(x * (k - mean) ** 2 for k, x in enumerate(p))
    scatter = sum(x * (k - mean) ** 2 for k, x in enumerate(f))
    with mpmath.workdps(60):
        log = mpmath.fsum(
            mpmath.inf
            if x == 0
            else -mpmath.mpf(n.numerator)
            / n.denominator
            * mpmath.log(mpmath.mpf(x.numerator) / x.denominator)
            for n, x in zip(f, p)
            if n
        )
    return {
        ranked_probability_score: float(
            sum((a - b) ** 2 + b * (1 - b) for a, b in zip(P, F))
        ),
        earth_movers_distance: float(sum(abs(a - b) for a, b in zip(P, F))),
        log_score: float(log),
        dispersion: float(spread / scatter) if scatter else (np.inf if spread else 1.0),
    }


# The CDF of this PIT rounds to more than 1.
PAIRS = [(10**12, 0), (0, 2**40), (10**12, 7), (10**12, 2**40), (3, 0), (0, 2**40)]


@pytest.mark.slow
@example(PAIRS)
@examples(150)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([0, 1, 3, 10**12]), st.sampled_from([0, 1, 7, 2**40])
        ),
        min_size=1,
        max_size=9,
    ).filter(lambda pairs: all(map(any, zip(*pairs))))
)
def test_scores_equal_exact_arithmetic(pairs):
    counts, parts = map(list, zip(*pairs))
    proba = [part / sum(parts) for part in parts]
    levels = np.arange(len(counts))
    table = [0] if len(counts) == 1 else [counts]  # one column is one of labels
    for score, expected in exact_scores(counts, proba).items():
        ours = score(table, [proba], levels=levels)
        assert ours == pytest.approx(expected, rel=1e-9, abs=1e-13)
    p = [Fraction(i, 100) for i in range(1, 100)]
    quantiles = [
        [next(k for k, b in enumerate(accumulate(w)) if b >= x * sum(w)) for x in p]
        for w in (counts, parts)
    ]
    errors = {}
    for true, predicted in zip(*quantiles):
        errors.setdefault(true, []).append(abs(true - predicted))
    expected = np.mean([np.mean(each) for each in errors.values()])
    assert macro_mae(table, [proba], levels=levels) == pytest.approx(expected)
    heights = pit_histogram(table, [proba], levels=levels)
    assert (heights >= 0).all() and heights.mean() == pytest.approx(1)


def test_log_score_is_never_negative():
    """Though probabilities may sum to a little more than one."""
    assert log_score([[3, 0]], [[1 + 9e-7, 0]]) == 0
    single = np.array([[1 / 3, 1 / 3, 1 / 3]], dtype=np.float32)
    assert log_score([[1, 1, 1]], single) == pytest.approx(np.log(3), rel=1e-15)


@pytest.mark.parametrize(
    "score", [macro_mae, ranked_probability_score, log_score, dispersion]
)
def test_weights_of_trials_in_scores(score):
    counts, proba = [[3, 1], [1, 3]], [[0.6, 0.4], [0.9, 0.1]]
    first = score(counts[:1], proba[:1])
    assert score(counts, proba, sample_weight=[1e12, 0]) == first
    assert score(counts, proba, sample_weight=[1e12, 1e-12]) == pytest.approx(first)


# Ratings


@pytest.mark.parametrize("n_levels", [2, 100, 500])
@pytest.mark.parametrize("unit", [1, 10**9, Fraction(1, 3)])
def test_ties_at_every_position(n_levels, unit):
    """A step of the distribution at each position that is asked for."""
    counts = np.full((1, n_levels), float(unit))
    p = np.arange(n_levels + 1) / n_levels
    expected = np.maximum(np.arange(n_levels + 1), 1)
    assert_array_equal(inverse_cdf(counts, p)[0], expected)
    between = (np.arange(n_levels) + 1e-9) / n_levels
    assert_array_equal(inverse_cdf(counts, between)[0], expected[1:])


@pytest.mark.slow
@examples(100)
@given(
    counts=st.lists(st.integers(0, 2 * 10**11), min_size=2, max_size=5).filter(any),
    i=st.integers(0, 100),
)
def test_inverse_cdf_of_a_million_million_raters(counts, i):
    """Exact at hundredths: the tolerance is less than a hundredth of a rater."""
    below = [*accumulate(counts)]
    rank = Fraction(i, 100) * below[-1]
    exact = next(k for k, b in enumerate(below) if b >= rank and counts[k])
    assert level_at(np.array([counts]), np.array([i / 100]))[0, 0] == exact


@pytest.mark.parametrize("unit", [TINY, 1e-300, 1e300])
def test_inverse_cdf_of_the_smallest_and_largest_weights(unit):
    weights = unit * np.array([[0.0, 1, 2, 1]])
    p = [0, TINY, 0.25, 0.26, 0.75, 0.76, 1 - EPS / 2, 1]
    assert inverse_cdf(weights, p).tolist() == [[2, 2, 2, 3, 3, 4, 4, 4]]


@examples(60)
@given(
    st.lists(st.sampled_from([0, 1, 2, 10**12]), min_size=2, max_size=300).filter(
        lambda counts: sum(counts) > 1
    )
)
def test_agreement_equals_exact_arithmetic(counts):
    n, n_levels = sum(counts), len(counts)
    mean = Fraction(sum(k * c for k, c in enumerate(counts)), n)
    variance = sum(c * (k - mean) ** 2 for k, c in enumerate(counts)) / (n - 1)
    exact = 1 - variance / Fraction(n_levels**2 - 1, 12)
    assert interrater_agreement([counts])[0] == pytest.approx(float(exact), abs=1e-12)


def test_correlation_of_the_largest_numbers():
    ratings = [[1e308, TINY], [-1e308, 2 * TINY], [0, 0]]
    assert_allclose(adjective_correlation(ratings).rho.iat[0, 1], -0.5)


@pytest.mark.parametrize("offset", [0, 10, 1e3, 1e6])
@pytest.mark.parametrize("copies", ["the sum", "another unit", "one-hot"])
@pytest.mark.parametrize("regressor", [False, True])
def test_without_a_penalty_a_redundant_feature_changes_nothing(
    offset, copies, regressor
):
    """Along what collinear features leave unknown, weights would be of any size."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        X = rng.normal(size=(60, 4))
        kind = np.arange(60) % 3
        y = np.digitize(2 * X[:, 0] + kind + rng.logistic(size=60), [0, 1, 2])
        if copies == "one-hot":
            X = np.c_[X, np.eye(3)[kind][:, 1:]]
            more = np.eye(3)[kind][:, :1]
        else:
            more = X.sum(axis=1) if copies == "the sum" else 3.3 * X[:, 1]
        model = NNPOM(0, alpha=0, tol=1e-8)
        if regressor:
            model = DistributionalOrdinalRegressor(model)
        more = np.c_[X, more] + offset
        expected = clone(model).fit(X, y).predict_proba(X)
        found = model.fit(more, y).predict_proba(more)
        assert_allclose(found, expected, atol=1e-8 * (1 + offset / 100))


@pytest.mark.parametrize("offset", [0, 1e3, 1e5])
def test_redundant_features_of_hidden_units_predict_what_was_fitted(offset):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        X = rng.normal(size=(60, 4))
        y = np.digitize(2 * X[:, 0] + rng.logistic(size=60), [-1, 0, 1])
        X = np.c_[X, X.sum(axis=1)] + offset
        model = NNPOM(3, alpha=0, random_state=0, max_iter=2000).fit(X, y)
        assert log_score(y, model.predict_proba(X)) == pytest.approx(model.loss_)


@pytest.mark.parametrize("constant", [1e8, 20261126073527, 1.7e18, 1e100])
@pytest.mark.parametrize("n, d", [(60, 4), (40, 300), (300, 280)])
@pytest.mark.parametrize("n_hidden", [0, 2])
def test_a_large_constant_changes_nothing(constant, n, d, n_hidden):
    """Such as the name of a session, or one time stamp for all touches."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(n, d))
    y = np.digitize(2 * X[:, 0] + rng.logistic(size=n), [-1, 0, 1])
    model = NNPOM(n_hidden, random_state=0, tol=1e-6)
    expected = clone(model).fit(X, y).predict_proba(X)
    more = np.c_[X, np.full(n, constant)]
    assert_allclose(model.fit(more, y).predict_proba(more), expected, atol=1e-4)


@pytest.mark.parametrize("offset", [0, 1e3, 1e5])
@pytest.mark.parametrize("n, d", [(20, 300), (40, 300)])
def test_offset_features_of_few_touches_predict_what_was_fitted(offset, n, d):
    """Weighted unequally, touches tell their coordinates unequally well."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        X = rng.normal(size=(n, d)) + offset
        near = np.exp(-((np.arange(4) - 1.5 - 2 * (X[:, :1] - offset)) ** 2) / 2)
        share = near / near.sum(axis=1, keepdims=True)
        counts = np.stack(list(map(rng.multinomial, rng.choice([1, 12], n), share)))
        model = NNPOM(0, alpha=0, max_iter=300).fit(X, counts)
        cost = np.where(counts, -counts * np.log(model.predict_proba(X)), 0).sum()
        assert cost / counts.sum() == pytest.approx(model.loss_, rel=1e-6)


@pytest.mark.parametrize("n, d", [(6, 30), (20, 300), (40, 60)])
@pytest.mark.parametrize("people", [1, 12])
@ignore_warnings(category=ConvergenceWarning)
def test_without_a_penalty_more_features_than_touches_separate_the_levels(n, d, people):
    rng = np.random.default_rng(0)
    X = rng.normal(size=(n, d))
    counts = np.where(X[:, :1] > 0, [0, people], [people, 0])
    proba = NNPOM(0, alpha=0).fit(X, counts).predict_proba(X)
    assert_allclose(proba, counts / people, atol=1e-3)


@pytest.mark.parametrize("shape", [(6, 6), (6, 50), (40, 60), (60, 257), (1, 3)])
def test_weights_without_a_penalty_lie_in_the_span_of_the_trials(shape):
    """They are those of the least length, which a penalty of next to nothing finds."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=shape)
    y = rng.multinomial(12, [0.1, 0.2, 0.4, 0.2, 0.1], size=len(X))
    fitted = NNPOM(0, alpha=0, scale_features=False).fit(X, y)
    weights = fitted.coefs_[0].ravel()
    known = np.linalg.pinv(X - X.mean(axis=0)) @ (X - X.mean(axis=0))
    assert_allclose(known @ weights, weights, atol=1e-12)
    limit = NNPOM(0, alpha=1e-10, scale_features=False).fit(X, y)
    new = rng.normal(size=(50, shape[1]))
    assert_allclose(fitted.predict_proba(new), limit.predict_proba(new), atol=1e-3)


@pytest.mark.parametrize("n_features", [50, 200, 300])
def test_one_feature_in_a_large_unit_leaves_the_others_their_weight(n_features):
    """Whether or not there are more features than trials; with a penalty."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(100, n_features))
    felt = 2 * X[:, 1] + X[:, 2] + rng.logistic(size=(6, 100))
    levels = np.digitize(felt, [-2, -1, 1, 2]).T
    y = (levels[:, :, np.newaxis] == np.arange(5)).sum(axis=1)
    model = NNPOM(0, scale_features=False)
    proba = []
    for unit in (1e4, 1e8):  # in both, the penalty of its weight is next to nothing
        given = np.hstack((unit * X[:, :1], X[:, 1:]))
        proba.append(model.fit(given, y).predict_proba(given))
    assert_allclose(*proba, atol=1e-3)
