"""Comparisons of two distributions, and scales from pairwise judgements."""

from itertools import product

import mpmath
import numpy as np
import pandas as pd
import polars as pl
import pytest
from scipy.stats import mannwhitneyu
from sklearn.linear_model import LogisticRegression

from sklearn_haptic import ContinuousRatingsRegressor
from sklearn_haptic.pairs import pairwise_scale, probability_of_superiority

# Probability of superiority


def test_superiority_compares_levels_by_their_labels():
    words = pd.DataFrame([[1, 2, 5]], columns=["low", "mid", "high"])
    array, swapped = words.to_numpy(), words[["high", "low", "mid"]]
    expected = probability_of_superiority(array, [[3, 1, 1]])
    others = pd.DataFrame([[1, 3, 1]], columns=["high", "low", "mid"])
    assert probability_of_superiority(words, others) == expected
    assert probability_of_superiority(words, swapped) == pytest.approx(0.5)
    numbers = pd.DataFrame([[5, 1, 2]], columns=[3, 1, 2])
    assert probability_of_superiority(array, numbers) == pytest.approx(0.5)
    with pytest.raises(ValueError, match=r"columns of second are .*levels are"):
        probability_of_superiority(numbers, numbers.rename(columns={1: 4}))


def test_superiority_counts_pairs_of_people():
    rng = np.random.default_rng(0)
    first, second = rng.integers(0, 5, size=(2, 20, 5)) + np.eye(5, dtype=int)[0]
    split = probability_of_superiority(first, second)
    apart = probability_of_superiority(first, second, ties="apart")
    for a, b, one, three in zip(first, second, split, apart):
        people = np.repeat(np.arange(5), a), np.repeat(np.arange(5), b)
        pairs = [np.sign(x - y) for x, y in product(*people)]
        expected = [np.mean(np.equal(pairs, sign)) for sign in (1, 0, -1)]
        np.testing.assert_allclose(three, expected, atol=1e-12)
        assert one == pytest.approx(expected[0] + expected[1] / 2)
        u = mannwhitneyu(*people).statistic
        assert one == pytest.approx(u / len(pairs))


def test_superiority_of_one_over_many_is_antisymmetric():
    rng = np.random.default_rng(0)
    one, many = rng.dirichlet(np.ones(4), size=1), rng.dirichlet(np.ones(4), size=5_000)
    forth = probability_of_superiority(one, many)
    assert forth.shape == (5_000,)
    np.testing.assert_allclose(forth, 1 - probability_of_superiority(many, one))
    large = rng.integers(1, 9, size=(100_000, 5))
    np.testing.assert_allclose(probability_of_superiority(large, large), 0.5)


def test_superiority_of_cells_is_that_of_continuous_ratings():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(20, 1))
    y = X + rng.normal(size=(20, 10))
    model = ContinuousRatingsRegressor(n_cells=8).fit(X, y)
    cells = np.diff(model.predict_cdf(X[:2]), axis=1)
    people = model.predict_quantile(X[:2], (np.arange(4000) + 0.5) / 4000)
    expected = np.searchsorted(people[1], people[0]).mean() / 4000
    found = probability_of_superiority(cells[:1], cells[1:])
    assert found == pytest.approx(expected, abs=1e-3)


# Scales


def judgements(n_judgements, n_objects=8, model="thurstone", seed=0):
    rng = np.random.default_rng(seed)
    truth = rng.normal(size=n_objects)
    truth -= truth.mean()
    first = rng.integers(n_objects, size=n_judgements)
    second = (first + rng.integers(1, n_objects, size=n_judgements)) % n_objects
    error = rng.normal if model == "thurstone" else rng.logistic
    won = truth[first] - truth[second] + error(size=n_judgements) > 0
    return truth, np.where(won, first, second), np.where(won, second, first)


@pytest.mark.parametrize("alpha", [0.01, 1.0])
def test_bradley_terry_is_a_logistic_regression_of_differences(alpha):
    _, winners, losers = judgements(300)
    rows = np.eye(8)[winners] - np.eye(8)[losers]
    label = np.arange(300) % 2  # half of the rows the other way round
    sign = 2 * label - 1
    regression = LogisticRegression(
        C=1 / alpha, fit_intercept=False, tol=1e-12, max_iter=10_000
    ).fit(rows * sign[:, None], label)
    scale = pairwise_scale(winners, losers, model="bradley-terry", alpha=alpha)
    np.testing.assert_allclose(scale.values, regression.coef_[0], atol=1e-6)


def test_thurstone_in_sixty_digits():
    winners, losers = [0, 0, 1, 1, 2, 0, 0], [1, 2, 2, 0, 1, 1, 1]
    scale = pairwise_scale(winners, losers, alpha=0.1)
    with mpmath.workdps(60):

        def gradient(*s):
            g = [s_i / 10 for s_i in s]
            for a, b in zip(winners, losers):
                slope = mpmath.npdf(s[a] - s[b]) / mpmath.ncdf(s[a] - s[b])
                g[a], g[b] = g[a] - slope, g[b] + slope
            return g

        exact = mpmath.findroot(gradient, scale.values.tolist())
        information = mpmath.zeros(3)
        for a, b in zip(winners, losers):
            d = exact[a] - exact[b]
            slope = mpmath.npdf(d) / mpmath.ncdf(d)
            e = mpmath.matrix([(i == a) - (i == b) for i in range(3)])
            information += slope * (slope + d) * e * e.T
        inverse = (information + mpmath.eye(3) / 10) ** -1
        centre = mpmath.eye(3) - mpmath.ones(3) / 3
        covariance = centre * inverse * centre
    np.testing.assert_allclose(scale.values, np.array(exact, float).ravel(), rtol=1e-10)
    np.testing.assert_allclose(
        scale.covariance, np.array(covariance.tolist(), float), rtol=1e-9
    )


@pytest.mark.parametrize("model", ["thurstone", "bradley-terry"])
def test_scale_recovers_the_truth_within_its_standard_errors(model):
    z = []
    for seed in range(30):
        truth, winners, losers = judgements(600, model=model, seed=seed)
        scale = pairwise_scale(winners, losers, model=model)
        z.append((scale.values - truth) / np.sqrt(np.diag(scale.covariance)))
    assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.15


def test_weights_are_repeated_judgements_and_half_judgements_are_ties():
    repeated = pairwise_scale(["a", "a", "a", "b"], ["b", "b", "b", "a"])
    weighted = pairwise_scale(["a", "b"], ["b", "a"], sample_weight=[3, 1])
    np.testing.assert_allclose(repeated.values, weighted.values, atol=1e-9)
    tie = pairwise_scale(["a", "b"], ["b", "a"], sample_weight=[0.5, 0.5])
    np.testing.assert_allclose(tie.values, 0, atol=1e-12)


@pytest.mark.parametrize("model", ["thurstone", "bradley-terry"])
@pytest.mark.parametrize("alpha", [1e-9, 0.1, 1e9])
def test_object_that_never_lost_stays_finite(model, alpha):
    winners, losers = ["a"] * 50 + ["b"] * 50, ["b"] * 50 + ["c"] * 50
    scale = pairwise_scale(winners, losers, model=model, alpha=alpha)
    assert np.isfinite(scale.values).all() and np.isfinite(scale.covariance).all()
    assert scale.values[0] > scale.values[1] > scale.values[2]
    assert abs(scale.values.sum()) < 1e-9
    np.testing.assert_allclose(scale.covariance, scale.covariance.T)


def test_objects_without_a_link_are_refused():
    with pytest.raises(
        ValueError, match=r"No judgement connects the objects \['x', 'y"
    ):
        pairwise_scale(["a", "b", "x"], ["b", "c", "y"])
    with pytest.raises(ValueError, match="No judgement connects"):
        pairwise_scale(["a", "b"], ["b", "c"], sample_weight=[1, 0])


@pytest.mark.parametrize("frame", [pd.DataFrame, pl.DataFrame])
def test_scale_as_a_target_of_trials(frame):
    table = frame({"more": ["tile", "tile", "cork"], "less": ["foam", "cork", "foam"]})
    scale = pairwise_scale(table["more"], table["less"])
    assert scale.objects.tolist() == ["cork", "foam", "tile"]
    cork, foam, tile = scale.values
    assert scale.values_for(["tile", "foam", "tile"]).tolist() == [tile, foam, tile]
    assert tile > cork > foam
    assert "tile" in repr(scale) and "covariance" not in repr(scale)  # a large matrix
    with pytest.raises(ValueError, match=r"no judgements of objects \['felt'\]"):
        scale.values_for(["tile", "felt"])


@pytest.mark.parametrize("n_judgements", [1, 5_000, 100_000])
def test_scale_of_many_judgements(n_judgements):
    truth, winners, losers = judgements(
        n_judgements, n_objects=200 if n_judgements > 1 else 2
    )
    scale = pairwise_scale(winners, losers)
    if n_judgements == 1:
        assert scale.values[scale.objects == winners] > 0
    else:
        assert np.corrcoef(scale.values, truth)[0, 1] > 0.95
