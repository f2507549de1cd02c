"""The paper's model written once more, from its text and that of Gutiérrez et al.

Plain NumPy, with the formulas as they stand there: labels at random positions, the
network and its cost by differences of cumulative probabilities, iRprop+ component by
component, early stopping, ratings at 99 positions and their error.
"""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import BaseEstimator, clone
from sklearn.model_selection import GridSearchCV, PredefinedSplit
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    SensorFusionNNPOM,
)
from sklearn_haptic.metrics import (
    macro_mae,
    macro_mae_at_positions,
    neg_macro_mae_scorer,
)
from sklearn_haptic.metrics._trial_scores import predict_and_score, score_trials
from sklearn_haptic.models._network import Layout
from sklearn_haptic.models._network_loss import NetworkLoss
from sklearn_haptic.models._proportional_odds import GAPS
from sklearn_haptic.models._solvers import irprop_plus

GRID = [i / 100 for i in range(1, 100)]


# What the paper does


def label(counts, p):
    """The smallest rating x with p <= F(x), from 0; p in exact arithmetic."""
    below = 0
    for rating, count in enumerate(counts):
        below += int(count)
        if Fraction(p) * int(sum(counts)) <= below:
            return rating
    raise AssertionError("p is above 1")


@cache
def labels_on_grid(counts):
    """The same at each hundredth, few of which a double is equal to."""
    return [label(counts, Fraction(i, 100)) for i in range(1, 100)]


def error_of_trial(predicted, true):
    """Equation 3 of the paper."""
    total = 0.0
    for rating in set(true):
        errors = [abs(a - b) for a, b in zip(predicted, true) if b == rating]
        total += sum(errors) / len(errors)
    return total / len(set(true))


class Network:
    """NNPOM: Theta1 with the biases in column 0, Theta2, and t of the thresholds."""

    def __init__(self, theta1, theta2, t):
        self.theta1, self.theta2, self.t = theta1, theta2, t

    @classmethod
    def random(cls, n_inputs, n_hidden, n_levels, seed):
        """All uniform in ±.5, drawn in the order in which the package does."""
        n = (n_inputs + 1) * n_hidden + n_hidden + n_levels - 1
        draws = iter(np.random.RandomState(seed).uniform(-0.5, 0.5, n))
        theta1 = np.empty((n_hidden, n_inputs + 1))
        for column in [*range(1, n_inputs + 1), 0]:
            for unit in range(n_hidden):
                theta1[unit, column] = next(draws)
        return cls(theta1, *np.split(np.array(list(draws)), [n_hidden]))

    def parts(self):
        return self.theta1, self.theta2, self.t

    def thresholds(self):
        b = [self.t[0]]
        for t in self.t[1:]:
            b.append(b[-1] + t**2)
        return np.array(b)

    def hidden(self, X):
        return 1 / (1 + np.exp(-(self.theta1[:, 0] + X @ self.theta1[:, 1:].T)))

    def cumulative(self, X):
        """P(y <= k), with columns of 0 and 1 on the outside."""
        f = self.hidden(X) @ self.theta2
        inner = 1 / (1 + np.exp(f[:, None] - self.thresholds()))
        return np.column_stack((np.zeros(len(X)), inner, np.ones(len(X))))

    def predict(self, X):
        return np.diff(self.cumulative(X)).argmax(axis=1)

    def gradient(self, X, y, lam):
        """The cost and its derivatives, by the chain rule from -log P(y)."""
        m, rows = len(X), np.arange(len(X))
        h, below = self.hidden(X), self.cumulative(X)
        proba = below[rows, y + 1] - below[rows, y]
        slope = below * (1 - below)  # of the cumulative probability in b - f
        of_f = (slope[rows, y + 1] - slope[rows, y]) / proba
        of_b = np.zeros(len(self.t))
        for i in range(m):
            if y[i] < len(self.t):
                of_b[y[i]] -= slope[i, y[i] + 1] / proba[i]
            if y[i] > 0:
                of_b[y[i] - 1] += slope[i, y[i]] / proba[i]
        of_t = np.empty(len(self.t))
        for k in range(len(self.t)):
            of_t[k] = of_b[k:].sum() * (2 * self.t[k] if k else 1)
        of_h = of_f[:, None] * self.theta2 * h * (1 - h)
        of_theta1 = of_h.T @ np.column_stack((np.ones(m), X))
        of_theta1[:, 1:] += lam * self.theta1[:, 1:]
        of_theta2 = of_f @ h + lam * self.theta2
        square = (self.theta1[:, 1:] ** 2).sum() + (self.theta2**2).sum()
        cost = (lam / 2 * square - np.log(proba).sum()) / m
        return cost, [of_theta1 / m, of_theta2 / m, of_t / m]


def irprop_steps(network, X, y, lam):
    """Igel and Hüsken's iRprop+, one component after the other, without end."""
    parts = [part.copy() for part in network.parts()]
    size = [np.full(part.shape, 0.0123) for part in parts]
    step = [np.zeros(part.shape) for part in parts]
    before, cost_before = [np.zeros(part.shape) for part in parts], np.inf
    while True:
        cost, gradient = Network(*parts).gradient(X, y, lam)
        for w, d, s, g0, g in zip(parts, size, step, before, gradient):
            for i in np.ndindex(w.shape):
                if g0[i] * g[i] > 0:
                    d[i] = min(1.2 * d[i], 50)
                elif g0[i] * g[i] < 0:
                    d[i] *= 0.5
                    s[i] = -s[i] if cost > cost_before else 0.0
                    w[i] += s[i]
                    g0[i] = 0.0
                    continue
                s[i] = -np.sign(g[i]) * d[i]
                w[i] += s[i]
                g0[i] = g[i]
        cost_before = cost
        yield Network(*(part.copy() for part in parts))


def train(network, X, y, lam, error):
    """Look every 10 of 500 iterations, wait for 150, keep the best."""
    best, best_error, best_iteration = None, np.inf, 0
    for iteration, moved in enumerate(irprop_steps(network, X, y, lam), 1):
        if iteration % 10 == 0:
            now = error(moved)
            if now < best_error:
                best, best_error, best_iteration = moved, now, iteration
            if iteration - best_iteration >= 150 or iteration == 500:
                return best, iteration


def duplicates(X, positions):
    """A row per trial and position, which is the last feature."""
    return np.array([[*x, p] for x, own in zip(X, positions) for p in own])


def mean_error(ratings, counts):
    """Average of equation 3 over trials, of ratings at 99 positions each."""
    errors = [
        error_of_trial(predicted, labels_on_grid(tuple(of_trial)))
        for predicted, of_trial in zip(ratings, counts)
    ]
    return sum(errors) / len(errors)


# The corpus, and the package's model of it


def touches(n_objects=16, n_trials=3, seed=0):
    """Features in units of their own, far from zero and unlike in spread."""
    rng = np.random.default_rng(seed)
    objects = np.repeat(np.arange(n_objects), n_trials)
    latent = rng.permutation(np.linspace(-2.5, 2.5, n_objects))
    noise = rng.normal(size=(len(objects), 4))
    X = latent[objects, None] * [1, -0.5, 0.2, 0] + 0.3 * noise
    raters = latent[:, None] + rng.logistic(size=(n_objects, 12))
    level = np.digitize(raters, [-2, -0.7, 0.7, 2])
    counts = np.stack([(level == k).sum(axis=1) for k in range(5)], axis=1)
    return X * [0.3, 1, 2, 0.1] + [0.5, 0, 1, 0], counts[objects], objects


def three_parts(objects):
    """Training, validation and test objects: 10, 3 and 3 of 16."""
    return objects < 10, (objects >= 10) & (objects < 13), objects >= 13


def parts_of(model):
    """A fitted NNPOM with the biases in column 0, and its thresholds."""
    theta1 = np.column_stack((model.intercepts_, model.coefs_[0].T))
    return theta1, model.coefs_[1], model.thresholds_


def assert_equal_networks(model, network):
    assert model.gaps == "squared"
    expected = network.theta1, network.theta2, network.thresholds()
    for ours, theirs in zip(parts_of(model), expected):
        assert_allclose(ours, theirs, rtol=0, atol=1e-10)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_model_agrees_with_the_papers(seed):
    """Labels, start, steps, the iteration kept, ratings and error."""
    X, counts, objects = touches(seed=seed)
    training, validating, testing = three_parts(objects)
    model = DistributionalOrdinalRegressor(**PAPER_2020, random_state=seed)
    model.set_params(estimator__n_hidden=3, estimator__alpha=0.1)
    model.fit(
        X[training], counts[training], X_val=X[validating], y_val=counts[validating]
    )

    rng = np.random.RandomState(seed)
    network_seed = rng.randint(2**31 - 1)
    p = rng.uniform(size=(training.sum(), 15))
    y = np.array([label(c, q) for c, own in zip(counts[training], p) for q in own])
    assert set(y) == {0, 1, 2, 3, 4}

    def ratings(network, X):
        rows = duplicates(X, [GRID] * len(X))
        return network.predict(rows).reshape(len(X), 99)

    def error(network):
        return mean_error(ratings(network, X[validating]), counts[validating])

    start = Network.random(5, 3, 5, network_seed)
    best, n_iter = train(start, duplicates(X[training], p), y, 0.1, error)

    assert model.estimator_.n_iter_ == n_iter
    assert_equal_networks(model.estimator_, best)
    ours, theirs = model.predict_rating(X[testing], GRID), ratings(best, X[testing])
    assert_array_equal(ours, theirs + 1)
    expected = mean_error(theirs, counts[testing])
    score = macro_mae_at_positions(counts[testing], ours, GRID)
    assert score == pytest.approx(expected, abs=1e-10)
    assert neg_macro_mae_scorer(model, X[testing], counts[testing]) == -score
    share = [[(row == k).mean() for k in range(5)] for row in theirs]
    assert_allclose(model.predict_proba(X[testing]), share, atol=1e-10)


def test_combined_network_agrees_with_the_papers():
    """Figure 8: the sensors' hidden units, each given p, feed one more network."""
    X, counts, objects = touches()
    training, validating, testing = three_parts(objects)
    one = PAPER_2020["estimator"].set_params(n_hidden=2, alpha=0.1)
    sensors = {"pac": [0, 1], "tdc": [2, 3]}
    fusion = SensorFusionNNPOM(sensors, one, clone(one).set_params(n_hidden=3))
    model = DistributionalOrdinalRegressor(
        **PAPER_2020 | {"estimator": fusion}, random_state=4
    )
    model.fit(
        X[training], counts[training], X_val=X[validating], y_val=counts[validating]
    )

    rng = np.random.RandomState(4)
    seeds = np.random.RandomState(rng.randint(2**31 - 1))
    seeds = [seeds.randint(2**31 - 1) for _ in range(3)]
    p = rng.uniform(size=(training.sum(), 15))
    y = np.array([label(c, q) for c, own in zip(counts[training], p) for q in own])

    def trained(n_inputs, n_hidden, seed, inputs):
        def error(network):
            rows = inputs(X[validating], [GRID] * validating.sum())
            ratings = network.predict(rows).reshape(-1, 99)
            return mean_error(ratings, counts[validating])

        start = Network.random(n_inputs, n_hidden, 5, seed)
        return train(start, inputs(X[training], p), y, 0.1, error)[0]

    def inputs_of(columns):
        return lambda X, p: duplicates(X[:, columns], p)

    of_sensor = [
        trained(3, 2, seed, inputs_of(columns))
        for seed, columns in zip(seeds, sensors.values())
    ]

    def hidden(X, p):
        parts = [
            network.hidden(inputs_of(columns)(X, p))
            for network, columns in zip(of_sensor, sensors.values())
        ]
        return np.column_stack(parts)

    combined = trained(4, 3, seeds[2], hidden)
    networks = [*model.estimator_.sensor_networks_.values()]
    for ours, theirs in zip(
        [*networks, model.estimator_.final_network_], [*of_sensor, combined]
    ):
        assert_equal_networks(ours, theirs)
    ratings = combined.predict(hidden(X[testing], [GRID] * testing.sum()))
    assert_array_equal(
        model.predict_rating(X[testing], GRID), ratings.reshape(-1, 99) + 1
    )


@pytest.mark.parametrize("n_hidden", [1, 4])
def test_every_step_is_that_of_a_plain_loop(n_hidden):
    X, counts, _ = touches()
    y = counts.argmax(axis=1)
    y = np.searchsorted(np.unique(y), y)
    n_levels = y.max() + 1
    start = Network.random(4, n_hidden, n_levels, 0)
    layout = Layout(4, n_hidden, (n_levels,), GAPS["squared"])
    theta1, theta2, t = start.parts()
    flat = np.concatenate((theta1[:, 1:].T.ravel(), theta1[:, 0], theta2, t))
    path = []
    loss = NetworkLoss(layout, X, [(None, y[:, None], np.ones((len(y), 1)))], 0.5)
    irprop_plus(
        loss, flat, max_iter=120, tol=0, callback=lambda x, cost: path.append(x.copy())
    )
    for ours, theirs in zip(path, irprop_steps(start, X, y, 0.5)):
        coef, bias, [(output, first, raw_gaps)] = layout.split(ours)
        assert_allclose(coef.T, theirs.theta1[:, 1:], atol=1e-12)
        assert_allclose(bias, theirs.theta1[:, 0], atol=1e-12)
        assert_allclose(output, theirs.theta2, atol=1e-12)
        assert_allclose([*first, *raw_gaps], theirs.t, atol=1e-12)


# Ratings one by one, and their error


class Falling(BaseEstimator):
    """Decides on the level in `table` that belongs to a trial and a position."""

    table = np.random.default_rng(0).integers(5, size=(6, 99))

    def fit(self, X, y):
        raise AssertionError("the rows were repeated")

    predict = fit

    def fit_with_positions(self, X, *observed, **_):
        return self

    def validation_share(self):
        return 0.0

    def predict_proba_with_positions(self, X, positions):
        index = np.rint(positions * 100).astype(int).clip(1, 99) - 1
        level = self.table[X[:, 0].astype(int)][:, index]
        return 0.1 + 0.5 * (level[..., None] == np.arange(5))


@pytest.fixture
def falling():
    model = DistributionalOrdinalRegressor(**PAPER_2020 | {"estimator": Falling()})
    counts = np.random.default_rng(1).integers(0, 4, size=(6, 5))
    counts[:, 2] += 1
    X = np.arange(6.0)[:, None]
    return model.fit(X, counts), X, counts


def test_ratings_are_predicted_one_by_one(falling):
    model, X, _ = falling
    assert_array_equal(model.predict_rating(X, GRID), Falling.table + 1)
    assert_array_equal(
        model.predict_quantile(X, GRID), np.sort(Falling.table, axis=1) + 1
    )
    assert_array_equal(model.predict_rating(X, 0.3), Falling.table[:, 29] + 1)
    many = model.predict_rating(X[np.arange(5000) % 6], GRID[::-1])
    assert_array_equal(many, Falling.table[np.arange(5000) % 6, ::-1] + 1)


def test_ratings_of_several_adjectives():
    X, counts, _ = touches()
    both = np.stack((counts, counts[:, ::-1]), axis=1)
    settings = PAPER_2020 | {"estimator": NNPOM(2, random_state=0), "random_state": 0}
    model = DistributionalOrdinalRegressor(**settings).fit(X, both)
    ratings = model.predict_rating(X, GRID)
    assert ratings.shape == (len(X), 2, 99)
    for t, x in enumerate(X[:3]):
        proba = model.estimator_.predict_proba([[*x, p] for p in GRID])
        assert_array_equal(ratings[t], proba.argmax(axis=-1).T + 1)
    errors = [mean_error(ratings[:, a] - 1, both[:, a]) for a in (0, 1)]
    score = neg_macro_mae_scorer(model, X, both)
    assert score == pytest.approx(-np.mean(errors), abs=1e-12)


def test_error_of_raw_pairs_by_plain_loops(falling):
    model, X, counts = falling
    expected = [mean_error([a], [c]) for a, c in zip(Falling.table, counts)]
    ratings = model.predict_rating(X, GRID)
    each = macro_mae_at_positions(counts, ratings, GRID, average=False)
    assert_allclose(each, expected, rtol=1e-12)
    weight = np.arange(6.0)
    mean = macro_mae_at_positions(counts, ratings, GRID, sample_weight=weight)
    assert mean == pytest.approx(np.average(expected, weights=weight))
    words = np.array(["a", "b", "c", "d", "e"])
    named = macro_mae_at_positions(
        counts, words[ratings - 1], GRID, levels=words, average=False
    )
    assert_array_equal(named, each)
    in_order = np.sort(ratings, axis=1)
    assert_array_equal(
        macro_mae_at_positions(counts, in_order, GRID, average=False),
        macro_mae(counts, model.predict_proba(X), average=False),
    )
    assert (each != macro_mae(counts, model.predict_proba(X), average=False)).any()


def test_every_trial_of_a_study_is_scored_as_in_the_paper(falling):
    """By its ratings as predicted; its other scores are of the distribution."""
    model, X, counts = falling
    proba, (scores,) = predict_and_score(model, X, counts)
    expected = [
        mean_error([row], [count]) for row, count in zip(model.estimator_.table, counts)
    ]
    assert_allclose(scores["macro_mae"], expected, rtol=0, atol=1e-10)
    of_distribution = score_trials(counts, proba)
    assert (scores["macro_mae"] != of_distribution.pop("macro_mae")).any()
    for name, score in of_distribution.items():
        assert_array_equal(scores[name], score)
    model.set_params(decode="mixture")
    proba, (scores,) = predict_and_score(model, X, counts)
    assert_array_equal(scores["macro_mae"], macro_mae(counts, proba, average=False))


def test_the_scorer_scores_what_the_paper_scores(falling):
    """In a pipeline and behind a search too; other decodings are scored as ever."""
    model, X, counts = falling
    expected = -mean_error(Falling.table, counts)
    score = neg_macro_mae_scorer
    assert score(model, X, counts) == pytest.approx(expected)
    assert score(make_pipeline(model), X, counts) == pytest.approx(expected)
    shifted = make_pipeline(FunctionTransformer(lambda X: X - 1), model)
    assert score(shifted, X + 1, counts) == pytest.approx(expected)
    search = GridSearchCV(
        shifted,
        {"distributionalordinalregressor__n_duplicates": [1]},
        cv=PredefinedSplit(np.repeat([-1, 0], 6)),
        scoring=score,
    )
    twice = np.tile(X + 1, (2, 1)), np.tile(counts, (2, 1))
    search.fit(*twice)
    assert search.best_score_ == pytest.approx(expected)
    assert score(search, X + 1, counts) == pytest.approx(expected)
    for changed in ({"decode": "mixture"}, {"rule": "median"}):
        other = clone(model).set_params(**changed).fit(X, counts)
        assert score(other, X, counts) == -macro_mae(counts, other.predict_proba(X))
