"""Continuous ratings: their score, the grid, and the regressor of distributions."""

import mpmath
import numpy as np
import pandas as pd
import polars as pl
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from sklearn.ensemble import RandomForestClassifier
from sklearn.exceptions import DataConversionWarning
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DummyDistribution,
)
from sklearn_haptic.metrics import (
    crps,
    neg_rps_scorer,
    noise_ceiling,
    ranked_probability_score,
)
from sklearn_haptic.models._continuous import make_grid
from sklearn_haptic.ratings._continuous import check_answers


def crowd(n_objects=30, n_people=12, seed=0):
    """Sliders of people who feel two features of each object."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n_objects, 2))
    spread = 8 * np.exp(0.4 * X[:, 1:])
    y = 50 + 15 * X[:, :1] + spread * rng.normal(size=(n_objects, n_people))
    return X, np.clip(y, 0, 100)


# The score


def integral(answers, cdf, values):
    """The definition, by numerical integration for one answer after another."""

    def F(x):
        if x < values[0] or x >= values[-1]:
            return float(x >= values[-1])
        return np.interp(x, values, cdf)

    return np.mean(
        [
            quad(
                lambda x, y=y: (F(x) - (x >= y)) ** 2,
                min(y, values[0]) - 1,
                max(y, values[-1]) + 1,
                points=[*values, y],
                limit=400,
            )[0]
            for y in answers
        ]
    )


@pytest.mark.parametrize("seed", range(8))
def test_crps_is_the_integral(seed):
    rng = np.random.default_rng(seed)
    values, cdf = np.sort(rng.normal(size=(4, 6))), np.sort(rng.uniform(size=(4, 6)))
    if seed % 2:  # no jumps at the ends
        cdf[:, 0], cdf[:, -1] = 0, 1
    answers = 2 * rng.normal(size=(4, 3))
    expected = [integral(*each) for each in zip(answers, cdf, values)]
    assert_allclose(crps(answers, cdf, values, average=False), expected, atol=1e-8)


def test_crps_of_levels_is_the_ranked_probability_score_of_the_scale():
    levels, counts, proba = [-3.0, 0, 10], [[1, 4, 2]], [[0.2, 0.5, 0.3]]
    ratings = np.repeat(levels, counts[0])
    score = crps([ratings], [0, 0.2, 0.2, 0.7, 0.7, 1], np.repeat(levels, 2))
    assert score == pytest.approx(
        ranked_probability_score(counts, proba, levels=levels, units="scale")
    )


def test_crps_takes_sums_of_probabilities_which_round():
    cdf = np.cumsum([0.1, 0.2, 0.3, 0.1, 0.2, 0.1])
    assert cdf[-1] == np.nextafter(1, 2)
    expected = crps([2.5], [*cdf[:-1], 1], range(6))
    assert crps([2.5], cdf, range(6)) == expected


def test_crps_is_exact_in_sixty_digits_far_from_zero():
    values, cdf, y = [1e6, 1e6 + 1, 1e6 + 3], [0, 0.25, 1], 1e6 + 2
    with mpmath.workdps(60):
        exact = sum(
            mpmath.quad(lambda x, f=f: f(x) ** 2, [a, b])
            for f, a, b in [
                (lambda x: x / 4, 0, 1),
                (lambda x: (1 + 3 * (x - 1) / 2) / 4, 1, 2),
                (lambda x: 1 - (1 + 3 * (x - 1) / 2) / 4, 2, 3),
            ]
        )
    assert crps([y], cdf, values) == pytest.approx(float(exact), rel=1e-12)


def test_crps_takes_weights_and_uneven_answers():
    ragged, padded = [[1, 2, 4], [3]], [[1, 2, 4], [3, np.nan, np.nan]]
    cdf, values = [0, 0.5, 1], [[0, 2, 5], [1, 3, 4]]
    each = crps(ragged, cdf, values, average=False)
    assert_array_equal(crps(padded, cdf, values, average=False), each)
    assert crps(ragged, cdf, values, sample_weight=[3, 1]) == pytest.approx(
        (3 * each[0] + each[1]) / 4
    )


@pytest.mark.parametrize("n_trials", [1, 100_000])
def test_crps_of_many_trials(n_trials):
    rng = np.random.default_rng(0)
    cdf = np.sort(rng.uniform(size=(n_trials, 21)), axis=1)
    grid, answers = np.linspace(0, 1, 21), rng.uniform(size=(n_trials, 3))
    scores = crps(answers, cdf, grid, average=False)
    assert scores[-1] == pytest.approx(integral(answers[-1], cdf[-1], grid), abs=1e-8)


def test_noise_ceiling_of_continuous_ratings_is_the_gini_mean_difference():
    answers = [[1.0, 4, 9], [2, 2, np.nan]]
    ceiling = noise_ceiling(answers, crps, average=False)
    assert_allclose(ceiling.truth, [(3 + 8 + 5) / 3 / 2, 0])
    assert_allclose(ceiling.raters, [(3 + 8 + 5) / 3 / 2 * 4 / 3, 0])


# Answers


@pytest.mark.parametrize(
    "y",
    [
        [[1, 2], [3, None]],
        [[1, 2], [3]],
        [np.array([1, 2]), np.array([3.0])],
        (pd.Series([1, 2]), pd.Series([3])),
        [pd.Series([1, 2]), pd.Series([3, None], index=[7, 6])],
        np.array([[1, 2], [3, np.nan]]),
        pd.DataFrame({"Ann": [1, 3], "Bo": [2, None]}),
        pd.DataFrame({"Ann": [1, 3], "Bo": [2, None]}, dtype="Int64"),
        pl.DataFrame({"Ann": [1, 3], "Bo": [2, None]}),
        pd.Series([[1, 2], [3]], index=[7, 9]),
    ],
    ids=[
        *("None", "ragged", "arrays", "series", "labelled series", "array", "pandas"),
        *("Int64", "polars", "series of lists"),
    ],
)
def test_answers_in_any_container(y):
    assert_array_equal(check_answers(y), [[1, 2], [3, np.nan]])
    with pytest.warns(DataConversionWarning, match="column-vector"):
        assert_array_equal(check_answers(np.array([[1], [2]])), [[1], [2]])
    assert_array_equal(check_answers([[1], [2]]), [[1], [2]])


# The regressor


@pytest.mark.parametrize("grid", [None, np.linspace(0, 100, 21)])
def test_regressor_of_a_crowd_beats_the_marginal_and_other_people(grid):
    X, y = crowd(60)
    unseen, true = crowd(300, seed=1)
    model = ContinuousRatingsRegressor(grid=grid).fit(X, y)
    ceiling = noise_ceiling(true, crps)
    pooled = np.quantile(y, np.linspace(0, 1, 101))
    marginal = crps(true, np.linspace(0, 1, 101), pooled)
    assert ceiling.truth < -model.score(unseen, true) < ceiling.raters < marginal


def test_predictions_are_those_of_the_levels_of_the_grid():
    X, y = crowd()
    edges = np.array([0, 30, 45, 60, 80, 100.0])
    model = ContinuousRatingsRegressor(grid=edges).fit(X, y)
    counts = np.stack([np.histogram(each, edges)[0] for each in y])
    proba = DistributionalOrdinalRegressor().fit(X, counts).predict_proba(X)
    assert_allclose(np.diff(model.predict_cdf(X), axis=1), proba, atol=1e-12)
    points = [-1, 0, 37.5, 100, 200]
    at = model.predict_cdf(X, points)
    assert_array_equal(at[:, [0, 3, 4]], [[0, 1, 1]] * len(X))
    heap = (y == 0).sum() / (y <= 30).sum()
    assert_allclose(at[:, 1], heap * proba[:, 0])
    assert_allclose(at[:, 2], proba[:, 0] + proba[:, 1] / 2)
    assert_allclose(model.predict(X), proba @ [15, 37.5, 52.5, 70, 90], rtol=1e-12)
    assert_array_equal(model.predict_cdf(X, 37.5), at[:, 2])


@pytest.mark.parametrize("rare", [[100], [90, 100], [10, 60, 90, 100]])
def test_rare_answers_widen_no_cell_of_frequent_ones(rare):
    """On a slider that snaps to tens: the mean, and the CDF halfway, are kept."""
    y = np.r_[np.repeat([0.0, 20, 40, 80], [10, 30, 70, 140]), rare]
    model = ContinuousRatingsRegressor(DummyDistribution())
    model.fit(np.zeros((len(y), 1)), y)
    assert model.predict([[0]])[0] == pytest.approx(y.mean(), abs=0.3)
    halfway = np.arange(5, 80, 10.0)
    expected = (y[:, np.newaxis] <= halfway).mean(axis=0)
    assert_allclose(model.predict_cdf([[0]], halfway)[0], expected, atol=0.005)


@pytest.mark.parametrize("at_end", [3, 4, 5, 20])
def test_the_share_of_people_at_an_end_is_kept(at_end):
    """However few of all they are, on the scale as it is and turned round."""
    rng = np.random.default_rng(0)
    y = np.append(np.zeros(at_end), rng.integers(1, 100, 180 - at_end))
    for answers, halfway in (y, 0.5), (100 - y, 99.5):
        model = ContinuousRatingsRegressor(DummyDistribution())
        model.fit(np.zeros((len(y), 1)), answers)
        found = model.predict_cdf([[0]], halfway)[0]
        at_lowest = found if halfway < 50 else 1 - found
        assert at_lowest == pytest.approx(at_end / 180, rel=0.07)


@pytest.mark.parametrize("seed", range(20))
def test_the_grid_of_a_scale_turned_round_is_turned_round(seed):
    """Also where two gaps are equally near to a quantile."""
    y = np.random.default_rng(seed).binomial(100, 0.5, size=(60, 3)).astype(float)
    grid = make_grid(y, np.ones(60), 30)
    turned = make_grid(100 - y, np.ones(60), 30)
    assert_allclose(100 - turned[::-1], grid, atol=1e-12)


@pytest.mark.parametrize("n_low", range(2, 8))
def test_a_quantile_between_heaps_is_the_top_of_the_lower_one(n_low):
    """Where just so many people are below, whatever their shares add up to."""
    y = np.r_[np.linspace(10, 40, n_low), np.linspace(80, 95, n_low)]
    model = ContinuousRatingsRegressor(DummyDistribution())
    model.fit(np.zeros((len(y), 1)), y)
    assert_allclose(model.predict_cdf([[0]], 60.0), 0.5)
    assert model.predict_quantile([[0]], 0.5)[0] < 50
    assert model.predict_quantile([[0]], 0.51)[0] > 70


@pytest.mark.parametrize("grid", [None, np.linspace(0, 100, 31)])
def test_people_at_the_ends_of_the_slider_are_there(grid):
    """Of a hundred, thirty are at 0 and twenty at 100."""
    y = np.concatenate((np.zeros(30), np.arange(1, 100, 2), np.full(20, 100)))
    model = ContinuousRatingsRegressor(DummyDistribution(), grid=grid)
    model.fit(np.zeros((100, 1)), y)
    quantiles = model.predict_quantile([[0]], [0.1, 0.25, 0.55, 0.85, 0.95])[0]
    assert_array_equal(quantiles[[0, 1, 3, 4]], [0, 0, 100, 100])
    assert_allclose(quantiles[2], 50, atol=2)
    assert_allclose(model.predict_cdf([[0]], [0, 99.999]), [[0.3, 0.8]], atol=0.005)
    drawn = model.sample([[0]], 10_000, random_state=0)
    assert_allclose([(drawn == end).mean() for end in (0, 100)], [0.3, 0.2], atol=0.02)


@pytest.mark.parametrize(
    "grid, y",
    [
        (np.arange(-3, 3.1, 0.2), [-3.0, -1.0, 0.5, 1.0, 3.0, 3.0, 3.0, 3.0]),
        (None, [-3.0, -1.0, 0.5, 1.0, 3.0, 3.0 - 1e-15, 3.0, np.nextafter(3, 4)]),
        (None, [-3.0, -1.0, 0.5, 1.0, 3.0, 3.0 - 4e-12, 3.0, 3.0]),
    ],
)
def test_rounding_takes_nobody_from_the_end(grid, y):
    for sign in (1, -1):
        edges = grid if grid is None or sign == 1 else -grid[::-1]
        model = ContinuousRatingsRegressor(DummyDistribution(), grid=edges)
        model.fit(np.zeros((8, 1)), sign * np.array(y))
        drawn = sign * model.sample([[0]], 4000, random_state=0)
        assert_allclose((drawn > 3 - 1e-9).mean(), 0.5, atol=0.03)
        assert_allclose(model.grid_[[0, -1]], [-3, 3], rtol=1e-12)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_answers_on_edges_that_rounding_moves_are_in_the_cell_below(dtype):
    grid, stops = np.arange(-1, 1.05, 0.1), np.arange(-10, 11) / 10
    model = ContinuousRatingsRegressor(DummyDistribution(), grid=grid)
    model.fit(np.zeros((21, 1)), stops.astype(dtype))
    assert_allclose(model.predict_cdf([[0]])[0, 1:], np.arange(2, 22) / 21)


def test_one_far_answer_does_not_put_the_others_at_the_end():
    y = np.append(np.linspace(0, 100, 99), 1e10)
    model = ContinuousRatingsRegressor(DummyDistribution()).fit(np.zeros((100, 1)), y)
    assert_allclose(model.predict_quantile([[0]], 0.5), 50, atol=5)


def test_the_heap_of_an_object_does_not_weigh_more_for_its_many_answers():
    y = [[0.0] * 8 + [5.0] * 2, [5.0, 50.0], [5.0, 95.0]]
    model = ContinuousRatingsRegressor(DummyDistribution(), grid=[0, 10, 90, 100])
    model.fit(np.zeros((3, 1)), y)  # 0.8 + 0.2, 0.5 and 0.5 in the first cell
    assert_allclose(model._spread[1], 10 * 0.8 / 2)


@pytest.mark.parametrize("grid", [None, [0, 3, 50, 100], np.linspace(0, 100, 11)])
def test_score_is_that_of_the_predicted_quantiles_also_of_people_at_an_end(grid):
    rng = np.random.default_rng(0)
    X = rng.normal(size=(80, 1))
    y = np.clip(50 + 80 * X + 20 * rng.normal(size=(80, 12)), 0, 100)
    model = ContinuousRatingsRegressor(grid=grid).fit(X, y)
    p = (np.arange(9999) + 0.5) / 9999
    expected = crps(y, p, model.predict_quantile(X, p))
    assert -model.score(X, y) == pytest.approx(expected, abs=1e-5)


def test_quantiles_invert_the_cdf():
    X, y = crowd()
    model = ContinuousRatingsRegressor().fit(X, y)
    p = np.array([0.01, 0.3, 0.5, 0.99])
    quantiles = model.predict_quantile(X, p)
    for x, row in zip(X, quantiles):
        reached = model.predict_cdf([x], row)[0]
        at_end = np.isin(row, model.grid_[[0, -1]])
        assert_allclose(reached[~at_end], p[~at_end], atol=1e-12)
        assert (reached[at_end] >= p[at_end]).all()
    assert_array_equal(model.predict_quantile(X, 0.5), quantiles[:, 2])
    ends = model.predict_quantile(X, [0, 1])
    assert (ends >= model.grid_[0]).all() and (ends <= model.grid_[-1]).all()


def test_grid_of_quantiles_holds_equally_many_and_gives_heaps_a_cell():
    y = np.r_[np.zeros(50), np.arange(1, 51)]
    model = ContinuousRatingsRegressor(n_cells=10).fit(np.zeros((100, 1)), y)
    halved = (1 / 51 + 10.5) / 2  # as wider than a fifth of the range
    inner = [1 / 51, halved, 10.5, 20.5, 30.5, 40.5, 49.5]
    assert_allclose(model.grid_, [0, *inner, 50])
    y = [[0, 10], [20, np.nan], [30, np.nan]]  # the answers of a trial share its weight
    uneven = ContinuousRatingsRegressor(n_cells=3).fit(np.eye(3), y)
    assert_allclose(uneven.grid_, [0, 5, 10 + 10 * 2 / 3, 25, 30])
    two = ContinuousRatingsRegressor().fit([[0.0], [1], [2], [3]], [0, 0, 1, 1])
    assert_allclose(two.grid_, [0, 0.5 / 30, 1 - 0.5 / 30, 1])
    heaps = np.r_[[0] * 30, np.arange(20, 40), [41] * 23, 42, 99, [100] * 25]
    model = ContinuousRatingsRegressor().fit(np.zeros((100, 1)), heaps)
    found = model.predict_quantile([[0.0]], [0.2, 0.6, 0.9])[0]
    assert_allclose(found, [0, 41, 100], atol=0.5)


def test_answers_far_from_the_others_are_predicted_where_they_are():
    """One object of sixty, one answer of two hundred, and a long tail."""
    rng = np.random.default_rng(0)
    mean = np.append(rng.uniform(20, 60, 59), 90)
    answers = mean[:, None] + 4 * rng.normal(size=(60, 12))
    model = ContinuousRatingsRegressor().fit(mean[:, None] / 10, answers)
    assert model.predict([[9.0]])[0] == pytest.approx(90, abs=3)
    nothing = np.zeros((60, 1))
    few_far = np.where(rng.uniform(size=(60, 12)) < 0.005, 500, answers)
    for far in few_far, np.exp(1.5 * rng.normal(size=(60, 12))):
        model = ContinuousRatingsRegressor(DummyDistribution()).fit(nothing, far)
        assert len(model.grid_) <= 46
        mean, middle = far.mean(), np.median(far)
        assert model.predict(nothing)[0] == pytest.approx(mean, rel=0.02)
        found = model.predict_quantile(nothing, 0.5)[0]
        assert found == pytest.approx(middle, rel=0.05)


@pytest.mark.parametrize("top", [2, 5, 10, 20])
def test_the_mean_of_whole_numbers_is_kept_and_the_cdf_halfway(top):
    """However unevenly people use them; each number has a cell of its own."""
    rng = np.random.default_rng(top)
    share = np.sort(rng.uniform(0.4, 1, top + 1))
    y = rng.choice(top + 1, p=share / share.sum(), size=(60, 12)).astype(float)
    model = ContinuousRatingsRegressor(DummyDistribution()).fit(np.zeros((60, 1)), y)
    assert len(model.grid_) == 2 * top + 2  # and the gap between two numbers one
    assert model.predict([[0]])[0] == pytest.approx(y.mean(), rel=1e-12)
    halfway = np.arange(top) + 0.5
    expected = (y[..., np.newaxis] <= halfway).mean(axis=(0, 1))
    assert_allclose(model.predict_cdf([[0]], halfway)[0], expected, atol=1e-12)


def test_lists_of_answers_in_the_only_column_of_a_table():
    y = [[1.0, 2], [3, 4, 9], [5]]
    X = np.arange(3.0)[:, np.newaxis]
    found = ContinuousRatingsRegressor().fit(X, pd.DataFrame({"slider": y}))
    expected = ContinuousRatingsRegressor().fit(X, y)
    assert_array_equal(found.predict_cdf(X), expected.predict_cdf(X))


def test_a_classifier_that_takes_counts_for_labels_is_refused():
    rng = np.random.default_rng(0)
    X, y = rng.normal(size=(40, 2)), rng.uniform(size=(40, 3))
    model = ContinuousRatingsRegressor(RandomForestClassifier(5)).fit(X, y)
    with pytest.raises(ValueError, match=r"^RandomForestClassifier predicts no "):
        model.predict(X)
    counts = rng.multinomial(9, [0.2, 0.3, 0.5], 40)
    forest = RandomForestClassifier(5).fit(X, counts)
    with pytest.raises(ValueError, match=r"^RandomForestClassifier predicts no "):
        neg_rps_scorer(forest, X, counts)


def test_a_cell_ends_below_the_next_answer_also_next_to_it():
    low = np.float64(1)
    y = np.repeat([0, low, np.nextafter(low, 2), 2], [1, 1, 9, 1])
    model = ContinuousRatingsRegressor(DummyDistribution()).fit(np.zeros((12, 1)), y)
    counts = np.diff(model.predict_cdf([[0]])[0]) * 12
    assert_allclose(counts, [1, 0, 1, 9, 0, 1])
    assert model.grid_[3] < y[2] < model.grid_[4]


@pytest.mark.parametrize("low, high", [(0, 100), (-1e300, 1e300), (1e-300, 1e300)])
def test_people_who_leave_a_slider_at_an_end_are_predicted_there(low, high):
    """By as good as the score of the best distribution, also at extremes."""
    y = np.random.default_rng(0).choice([low, high], (40, 8))
    X = np.zeros((40, 1))
    model = ContinuousRatingsRegressor(DummyDistribution()).fit(X, y)
    at = np.linspace(0.05, 0.95, 9)
    found = model.predict_cdf(X[:1], low * (1 - at) + high * at)[0]
    assert_allclose(found, (y == low).mean(), atol=1e-12)
    with np.errstate(over="ignore"):
        assert_allclose(model.predict(X[:1]), y.mean(), rtol=1e-6)


def test_regressor_in_searches_pipelines_and_with_ragged_answers():
    X, y = crowd()
    groups = np.repeat(np.arange(15), 2)
    model = make_pipeline(StandardScaler(), ContinuousRatingsRegressor(NNPOM(0)))
    search = GridSearchCV(
        model,
        {"continuousratingsregressor__estimator__alpha": [1, 10]},
        cv=GroupKFold(3),
    )
    y[0, 3] = np.nan
    search.fit(X, y, groups=groups)
    ragged = [row[~np.isnan(row)].tolist() for row in y]
    other = GridSearchCV(model, search.param_grid, cv=search.cv)
    other.fit(X, ragged, groups=groups)
    assert search.best_score_ == other.best_score_
    assert_array_equal(search.predict(X), other.predict(X))


@pytest.mark.parametrize("grid", [None, [0, 2, 4, 8]])
def test_trials_of_weight_zero_do_not_make_ratings_differ(grid):
    model = ContinuousRatingsRegressor(NNPOM(0), grid=grid)
    with pytest.raises(ValueError, match=r"All ratings in y are 1\.0 \(n_samples=2\)"):
        model.fit([[0], [1], [2]], [1, 5, 1], sample_weight=[1, 0, 1])


# Objects of the trials


def remembering(base):
    """An estimator that remembers the groups that its `fit` was given."""

    class Remembers(base):
        def fit(self, X, y, sample_weight=None, *, groups=None):
            self.given_ = groups, sample_weight
            return super().fit(X, y, sample_weight, groups=groups)

    return Remembers


def test_groups_reach_the_estimator_also_behind_other_steps():
    X, y = crowd()
    objects = np.arange(len(X)) // 2
    weight = np.arange(1.0, len(X) + 1)
    model = remembering(DistributionalOrdinalRegressor)()
    scaled = make_pipeline(StandardScaler(), make_pipeline(StandardScaler(), model))
    for estimator, last in [(model, lambda m: m), (scaled, lambda m: m[-1][-1])]:
        fitted = ContinuousRatingsRegressor(estimator).fit(X, y, weight, groups=objects)
        groups, weights = last(fitted.estimator_).given_
        assert_array_equal(groups, objects)
        assert_array_equal(weights, weight)


def test_groups_keep_objects_whole_in_early_stopping():
    X, y = crowd()
    stops = DistributionalOrdinalRegressor(NNPOM(2, early_stopping=True, max_iter=20))
    model = ContinuousRatingsRegressor(stops.set_params(random_state=0), n_cells=5)
    with pytest.warns(UserWarning, match="given no groups"):
        model.fit(X, y)
    model.fit(X, y, groups=np.arange(len(X)))  # no warning, which would be an error
    assert model.predict(X).shape == (30,)


def test_groups_change_nothing_where_none_are_needed():
    X, y = crowd()
    model = ContinuousRatingsRegressor(DummyDistribution())
    alone = model.fit(X, y).predict_cdf(X)
    model.fit(X, y, groups=np.arange(len(X)))
    assert_array_equal(model.predict_cdf(X), alone)


def test_trials_without_weight_may_lie_outside_a_given_grid():
    X, y = np.arange(8.0)[:, None], np.arange(16.0).reshape(8, 2)
    weight = np.array([1.0] * 7 + [0.0])
    grid = np.linspace(0, 13, 5)
    without = ContinuousRatingsRegressor(grid=grid).fit(X[:-1], y[:-1])
    model = ContinuousRatingsRegressor(grid=grid).fit(X, y, weight)
    assert_allclose(model.predict_cdf(X), without.predict_cdf(X))


@pytest.mark.parametrize("answer", [-1.0, 0.0, 0.5, 1.0])
def test_crps_over_a_span_beyond_the_largest_number(answer):
    """Of an even distribution: the cubes of the shares on either side."""
    largest, below = 1.7e308, (1 + answer) / 2
    expected = (below**3 + (1 - below) ** 3) / 3 * 2 * largest
    found = crps([answer * largest], [0, 1], [-largest, largest])
    assert found == pytest.approx(expected, rel=1e-12)
