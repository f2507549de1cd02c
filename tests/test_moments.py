import mpmath
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import minimize
from scipy.special import xlogy

from sklearn_haptic import DistributionalOrdinalRegressor
from sklearn_haptic.metrics import noise_ceiling, ranked_probability_score
from sklearn_haptic.ratings import counts_from_moments

LEVELS = [[1, 2, 3, 4, 5], [-3, -2, -1, 0, 1, 2, 3], [0, 1], [-10, -3, 0, 3, 10]]
LEVELS += [[0, 1, 1e6], [*range(101)]]


def moments(proba, levels):
    levels = np.asarray(levels, float)
    mean = proba @ levels
    return mean, np.sqrt((proba * (levels - mean[:, None]) ** 2).sum(axis=1))


def crowds(levels, n=500, seed=0):
    """Distributions from nearly certain to nearly uniform."""
    rng = np.random.default_rng(seed)
    alphas = 0.02, 0.1, 1, 10
    return np.concatenate([rng.dirichlet([a] * len(levels), n) for a in alphas])


def by_mpmath(levels, mean, std=None, bend=0, start=None):
    """Shares proportional to exp(a x - b x²), to 60 digits."""
    with mpmath.workdps(60):
        x = [mpmath.mpf(v) for v in levels]
        mean = mpmath.mpf(mean)

        def shares(a, b):
            each = [mpmath.exp(a * (v - mean) - b * (v - mean) ** 2) for v in x]
            return [e / mpmath.fsum(each) for e in each]

        def missed(a, b=bend):
            p = shares(a, b)
            first = mpmath.fsum(q * (v - mean) for q, v in zip(p, x))
            if std is None:
                return first
            second = mpmath.fsum(q * (v - mean) ** 2 for q, v in zip(p, x))
            return first, second - mpmath.mpf(std) ** 2

        found = mpmath.findroot(missed, start, tol=1e-50, maxsteps=200)
        a, b = (found, bend) if std is None else found
        return np.array([float(p) for p in shares(a, b)]), b


def weights(levels, shares, mean):
    """Where to begin: a and b from rounded shares."""
    powers = np.vander(np.asarray(levels, float) - mean, 3)
    found = np.linalg.lstsq(powers, np.log(shares), rcond=None)[0]
    return found[1], -found[0]


@pytest.mark.parametrize("levels", LEVELS, ids=len)
def test_moments_are_those_asked_for(levels):
    proba = np.concatenate([crowds(levels), np.eye(len(levels))])
    mean, std = moments(proba, levels)
    width = np.ptp(levels)
    counts = counts_from_moments(mean, std, levels=levels)
    assert counts.columns.tolist() == levels
    assert (counts >= 0).all(axis=None)
    found = moments(counts.to_numpy(), levels)
    assert_allclose(counts.sum(axis=1), 1, rtol=1e-13)
    assert_allclose(found[0], mean, rtol=0, atol=1e-12 * width)
    assert_allclose(found[1] ** 2, std**2, rtol=0, atol=1e-12 * width**2)
    alone = counts_from_moments(mean, levels=levels).to_numpy()
    assert_allclose(moments(alone, levels)[0], mean, rtol=0, atol=1e-12 * width)
    if len(levels) == 2:
        assert_allclose(counts, proba, atol=1e-13)


@pytest.mark.parametrize(
    ("levels", "mean", "std"),
    [
        ([1, 2, 3, 4, 5], 2.3, 1.1),
        ([1, 2, 3, 4, 5], 3.0, 1.41421356),  # nearly uniform
        ([1, 2, 3, 4, 5], 1.2, 0.4000001),  # nearly two neighbours
        ([1, 2, 3, 4, 5], 4.2, 1.5999999),  # nearly both ends
        ([1, 2, 3, 4, 5], 4.999, 0.05),
        ([-3, -2, -1, 0, 1, 2, 3], -0.7, 2.0),  # two heaps
        ([-10, -3, 0, 3, 10], 4.0, 5.0),
        ([0, 0.5, 4], 0.4, 0.6),
    ],
)
def test_shares_are_those_of_sixty_digits(levels, mean, std):
    found = counts_from_moments([mean], [std], levels=levels).to_numpy()[0]
    exact, _ = by_mpmath(levels, mean, std, start=weights(levels, found, mean))
    assert_allclose(found, exact, rtol=0, atol=1e-12)
    alone = counts_from_moments([mean], levels=levels).to_numpy()[0]
    slope = weights(levels, alone, mean)[0]
    exact, _ = by_mpmath(levels, mean, start=slope)
    assert_allclose(alone, exact, rtol=0, atol=1e-12)


def test_a_borrowed_deviation_keeps_the_curvature_of_the_middle():
    levels, middle = [1, 2, 3, 4, 5, 6], 3.5
    of_middle = counts_from_moments([middle], [0.8], levels=levels).to_numpy()[0]
    start = weights(levels, of_middle, middle)
    of_middle, bend = by_mpmath(levels, middle, 0.8, start=start)
    for mean in (1.01, 2.0, 3.5, 4.4, 5.99):
        found = counts_from_moments([mean], 0.8, levels=levels).to_numpy()[0]
        start = weights(levels, found, mean)[0]
        exact, _ = by_mpmath(levels, mean, bend=bend, start=start)
        assert_allclose(found, exact, rtol=0, atol=1e-12)


@pytest.mark.parametrize("std", [0.13, 0.3, 1, 1.5, 1.9])
def test_a_borrowed_deviation_suits_every_mean(std):
    ends = 10.0 ** -np.arange(1, 15)
    mean = np.concatenate([np.linspace(1, 5, 41), 1 + ends, 5 - ends])
    counts = counts_from_moments(mean, std, levels=range(1, 6)).to_numpy()
    found, deviation = moments(counts, range(1, 6))
    assert_allclose(found, mean, rtol=0, atol=1e-12)
    assert_allclose(deviation[20], std, atol=1e-12)  # of the mean at the middle
    mirrored = counts_from_moments(6 - mean, std, levels=range(1, 6)).to_numpy()
    assert_allclose(mirrored[:, ::-1], counts, atol=1e-12)


@pytest.mark.parametrize("proba", crowds(range(7), 3, seed=1)[3:])
def test_no_distribution_with_these_moments_has_more_entropy(proba):
    levels = np.arange(-3, 4)
    powers = np.vander(levels, 3, increasing=True).T
    mean, std = moments(proba[None], levels)
    counts = counts_from_moments(mean, std, levels=levels).to_numpy()[0]
    search = minimize(
        lambda p: xlogy(p, p).sum(),
        proba,
        method="SLSQP",
        bounds=[(0, 1)] * 7,
        constraints={"type": "eq", "fun": lambda p: powers @ (p - proba)},
        options={"ftol": 1e-12, "maxiter": 500},
    )
    assert xlogy(counts, counts).sum() <= search.fun + 1e-7
    assert xlogy(counts, counts).sum() <= xlogy(proba, proba).sum() + 1e-12


def test_extremes_are_exact():
    counts = counts_from_moments(
        [1, 5, 3, 2.5, 3, 1.5], [0, 0, 0, 0.5, 2, 0.5], levels=range(1, 6), n=8
    )
    assert_array_equal(
        counts,
        [
            [8, 0, 0, 0, 0],
            [0, 0, 0, 0, 8],
            [0, 0, 8, 0, 0],
            [0, 4, 4, 0, 0],
            [4, 0, 0, 0, 4],
            [4, 4, 0, 0, 0],
        ],
    )
    alone = counts_from_moments([1, 3, 5], levels=range(1, 6))
    assert_allclose(alone, [[1, 0, 0, 0, 0], [0.2] * 5, [0, 0, 0, 0, 1]], atol=1e-14)


def test_rows_do_not_depend_on_each_other_and_many_are_cheap():
    proba = np.random.default_rng(0).dirichlet(np.ones(5), 100_000)
    mean, std = moments(proba, range(1, 6))
    counts = counts_from_moments(mean, std, levels=range(1, 6)).to_numpy()
    found = moments(counts, range(1, 6))
    assert_allclose(found, [mean, std], rtol=0, atol=1e-10)
    few = counts_from_moments(mean[7:9], std[7:9], levels=range(1, 6))
    assert_allclose(few, counts[7:9], rtol=0, atol=1e-15)


def test_what_users_do_next():
    objects = ["foam", "tile", "wool"]
    mean = pd.Series([1.5, 4.2, 2.0], index=objects)
    counts = counts_from_moments(
        mean, [0.6, 0.9, 0.7], levels=range(1, 6), n=[9, 12, 9]
    )
    assert counts.index.tolist() == objects
    assert_allclose(counts.sum(axis=1), [9, 12, 9])
    y = counts.loc[["tile", "tile", "foam", "wool"]]
    model = DistributionalOrdinalRegressor().fit([[3.0], [3.1], [0.2], [1.0]], y)
    assert model.classes_.tolist() == [1, 2, 3, 4, 5]
    proba = model.predict_proba([[3.0], [3.1], [0.2], [1.0]])
    assert ranked_probability_score(y, proba) < 1
    assert noise_ceiling(y).truth > 0


def test_what_is_rounded_is_moved_to_what_people_can_give():
    crowd = np.random.default_rng(0).multinomial(12, [0.02, 0.9, 0.08], 300)
    mean, std = moments(crowd / 12, [1, 2, 3])
    mean, std = mean.round(2), std.round(2)
    with pytest.raises(ValueError, match="std is too small for the mean"):
        counts_from_moments(mean, std, levels=[1, 2, 3])
    found = counts_from_moments(mean, std, levels=[1, 2, 3], decimals=2, n=12)
    assert_allclose(found, crowd, atol=0.2)
    counts_from_moments([3.004, 0.996], [0.004, 0], levels=[1, 2, 3], decimals=2)
    for mean, std in ([2.9, 0.46], [2.5, 0.49], [2.0, 1.02], [3.006, 0.0]):
        with pytest.raises(ValueError, match=r"(mean lies|std is too)"):
            counts_from_moments([mean], [std], levels=[1, 2, 3], decimals=2)
