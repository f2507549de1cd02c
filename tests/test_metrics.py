import pickle
from fractions import Fraction
from functools import partial

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import entropy, wasserstein_distance
from sklearn import config_context
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.datasets import make_classification
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import log_loss, mean_absolute_error, r2_score
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_validate
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import DummyDistribution
from sklearn_haptic.metrics import (
    dispersion,
    earth_movers_distance,
    log_score,
    macro_mae,
    neg_macro_mae_scorer,
    neg_rps_scorer,
    noise_ceiling,
    pit_histogram,
    ranked_probability_score,
)
from sklearn_haptic.ratings import counts_from_moments, interrater_agreement
from sklearn_haptic.ratings._distributions import macro_error

SCORES = [macro_mae, ranked_probability_score, earth_movers_distance, log_score]
METRICS = [*SCORES, pit_histogram, dispersion]
LEVELS = np.arange(1, 6)


@pytest.fixture(scope="module")
def crowd():
    """Ratings of 40 objects by 12 people, and predictions with a few zeros."""
    rng = np.random.default_rng(0)
    counts = rng.multinomial(12, rng.dirichlet(np.full(5, 0.7), size=40))
    proba = rng.dirichlet(np.full(5, 0.7), size=40)
    proba[::5] = rng.multinomial(99, proba[::5]) / 99
    return counts, proba


@pytest.mark.parametrize("score", [*METRICS, neg_macro_mae_scorer, noise_ceiling])
def test_scores_are_saved_by_their_public_name(score):
    saved = pickle.dumps(score, protocol=0)  # in text
    assert f"sklearn_haptic.metrics\n{score.__name__}\n".encode() in saved
    assert pickle.loads(saved) is score


# Macro-averaged error


def exact_quantile(weights, p):
    below, total = 0, sum(weights)
    for level, weight in enumerate(weights):
        below += weight
        if weight and below >= p * total:
            return level


def exact_macro_mae(counts, weights, n_quantiles=99):
    """Equation 3 for one trial in exact arithmetic."""
    errors = {}
    for i in range(1, n_quantiles + 1):
        p = Fraction(i, n_quantiles + 1)
        true = exact_quantile(counts, p)
        errors.setdefault(true, []).append(abs(exact_quantile(weights, p) - true))
    return float(sum(Fraction(sum(e), len(e)) for e in errors.values()) / len(errors))


@pytest.mark.parametrize("n_quantiles", [9, 99])
def test_macro_mae_equals_exact_arithmetic(n_quantiles):
    rng = np.random.default_rng(1)
    counts = rng.multinomial(12, rng.dirichlet(np.full(5, 0.5), size=60))
    weights = rng.multinomial(20, rng.dirichlet(np.full(5, 0.5), size=60))
    expected = [
        exact_macro_mae(c, w, n_quantiles)
        for c, w in zip(counts.tolist(), weights.tolist(), strict=True)
    ]
    assert_allclose(
        macro_mae(counts, weights / 20, average=False, n_quantiles=n_quantiles),
        expected,
        rtol=1e-14,
    )


# Ranked probability score, earth mover's distance, log score


def test_rps_equals_scoringrules():
    # scoringrules 0.10.0: rps_score(y, proba)
    y = [1, 3, 5]
    proba = [
        [0.1, 0.2, 0.3, 0.25, 0.15],
        [0.5, 0.125, 0.125, 0.125, 0.125],
        [0, 0, 0.1, 0.2, 0.7],
    ]
    assert_allclose(
        ranked_probability_score(y, proba, levels=LEVELS, average=False),
        [1.4825, 0.71875, 0.1],
    )


@pytest.mark.parametrize("score", [ranked_probability_score, log_score])
def test_counts_score_as_the_mean_over_their_raters(score, crowd):
    counts, proba = crowd
    proba = 0.9 * proba + 0.02
    trial, y = np.nonzero(counts)
    by_rater = score(y + 1, proba[trial], levels=LEVELS, average=False)
    expected = np.bincount(trial, weights=counts[trial, y] * by_rater) / 12
    assert_allclose(score(counts, proba, average=False), expected)


@pytest.mark.parametrize("score", [ranked_probability_score, log_score])
def test_truth_scores_best(score):
    rng = np.random.default_rng(3)
    counts = rng.integers(1, 12, size=(50, 5))
    truth = counts / counts.sum(axis=1, keepdims=True)
    other = 0.95 * truth + 0.05 * rng.dirichlet(np.ones(5), size=50)
    assert (
        score(counts, truth, average=False) < score(counts, other, average=False)
    ).all()


def test_emd_equals_scipy(crowd):
    counts, proba = crowd
    expected = [
        wasserstein_distance(LEVELS, LEVELS, count, predicted)
        for count, predicted in zip(counts, proba, strict=True)
    ]
    assert_allclose(
        earth_movers_distance(counts, proba, average=False), expected, atol=1e-14
    )


def test_log_score_equals_scikit_learn(crowd):
    proba = 0.9 * crowd[1] + 0.02
    y = np.random.default_rng(4).integers(1, 6, size=len(proba))
    weight = np.arange(len(y))
    assert log_score(y, proba, levels=LEVELS) == pytest.approx(
        log_loss(y, proba, labels=LEVELS)
    )
    assert log_score(y, proba, sample_weight=weight, levels=LEVELS) == pytest.approx(
        log_loss(y, proba, sample_weight=weight, labels=LEVELS)
    )


def test_log_score_of_impossible_and_certain_ratings():
    scores = log_score(
        [[1, 1], [0, 3], [0, 3]], [[0, 1], [0, 1], [1, 0]], average=False
    )
    assert scores.tolist() == [np.inf, 0, np.inf]
    assert not np.signbit(scores[1])
    assert log_score([[1, 1], [0, 3]], [[0, 1], [0, 1]]) == np.inf
    # A trial that does not count does not make the average NaN.
    assert log_score([[1, 1], [0, 3]], [[0, 1], [0, 1]], sample_weight=[0, 1]) == 0
    assert np.isfinite(log_score([[1, 1]], [[5e-324, 1]]))


# Calibration


def exact_pit(counts, proba, n_bins):
    """Heights for one trial, by the area that each rating's interval has in a bin."""
    heights = [Fraction(0)] * n_bins
    below = Fraction(0)
    for n, share in zip(counts, proba, strict=True):
        for j in range(n_bins):
            left, right = Fraction(j, n_bins), Fraction(j + 1, n_bins)
            if share == 0:
                inside = left <= below < right or (right == below == 1)
                part = Fraction(int(inside))
            else:
                overlap = min(right, below + share) - max(left, below)
                part = max(overlap, 0) / share
            heights[j] += n_bins * Fraction(n, sum(counts)) * part
        below += share
    return [float(height) for height in heights]


@pytest.mark.parametrize("n_bins", [1, 4, 10])
def test_pit_equals_exact_arithmetic(n_bins):
    rng = np.random.default_rng(5)
    counts = rng.multinomial(12, rng.dirichlet(np.ones(4), size=30))
    weights = rng.multinomial(64, rng.dirichlet(np.full(4, 0.3), size=30))
    weights[:3] = [64, 0, 0, 0], [0, 0, 0, 64], [32, 0, 0, 32]
    expected = [
        exact_pit(c, [Fraction(w, 64) for w in row], n_bins)
        for c, row in zip(counts.tolist(), weights.tolist(), strict=True)
    ]
    heights = pit_histogram(counts, weights / 64, n_bins)
    assert_allclose(heights, np.mean(expected, axis=0), atol=1e-13)
    assert heights.mean() == pytest.approx(1)


def test_pit_of_a_point_on_an_edge_is_in_the_upper_bin_also_rounded():
    assert 0.7 + 0.1 < 0.8
    heights = pit_histogram([[0, 0, 4, 0]], [[0.7, 0.1, 0, 0.2]])
    assert heights.tolist() == [0] * 8 + [10, 0]


def test_pit_is_flat_for_the_truth_and_u_shaped_for_narrow_predictions():
    rng = np.random.default_rng(6)
    truth = rng.dirichlet(np.ones(5), size=4000)
    y = [rng.choice(LEVELS, p=p) for p in truth]
    assert_allclose(pit_histogram(y, truth, levels=LEVELS), 1, atol=0.12)
    narrow = truth**3 / (truth**3).sum(axis=1, keepdims=True)
    heights = pit_histogram(y, narrow, levels=LEVELS)
    assert min(heights[0], heights[-1]) > 1.2 > 1 > heights[4:6].mean()
    assert dispersion(y, narrow, levels=LEVELS) < 0.7
    assert dispersion(y, truth, levels=LEVELS) == pytest.approx(1, abs=0.05)


def test_dispersion_by_hand():
    proba = [[0.5, 0.5, 0], [0, 0.5, 0.5]]  # variance 1/4 each, means .5 and 1.5
    counts = [[1, 0, 1], [0, 2, 0]]  # squares (.25 + 2.25) / 2 and .25
    assert dispersion(counts, proba) == pytest.approx(0.25 / 0.75)
    assert dispersion(counts, proba, sample_weight=[0, 2]) == pytest.approx(1)
    assert dispersion([[0, 2, 0]], [[0, 1, 0]]) == 1
    assert dispersion([[0, 2, 0]], [[0.5, 0, 0.5]]) == np.inf


# What all have in common


@pytest.mark.parametrize("metric", METRICS)
def test_weights_repeat_trials(metric, crowd):
    counts, proba = crowd
    weight = np.arange(len(counts)) % 3
    assert_allclose(
        metric(counts, proba, sample_weight=weight),
        metric(np.repeat(counts, weight, axis=0), np.repeat(proba, weight, axis=0)),
        rtol=1e-12,
    )


@pytest.mark.parametrize("score", SCORES)
def test_average_is_the_mean_of_the_trials(score, crowd):
    counts, proba = crowd
    scores = score(counts, proba, average=False)
    assert scores.shape == (len(counts),)
    average = score(counts, proba)
    assert isinstance(average, float)
    assert average == pytest.approx(scores.mean())


@pytest.mark.parametrize("metric", METRICS)
def test_labels_are_counts_of_one(metric):
    proba = np.random.default_rng(7).dirichlet(np.ones(3), size=6)
    y = np.array(["some", "none", "much", "much", "none", "some"])
    levels = ["none", "some", "much"]
    counts = (y[:, None] == levels).astype(int)
    assert_array_equal(metric(y, proba, levels=levels), metric(counts, proba))
    assert_array_equal(metric(counts * 7, proba), metric(counts, proba), strict=True)


@pytest.mark.parametrize("metric", METRICS)
def test_single_precision_and_rounded_probabilities_pass(metric, crowd):
    counts, _ = crowd
    proba = np.random.default_rng(8).dirichlet(np.ones(5), size=len(counts))
    assert_allclose(
        metric(counts, proba.astype(np.float32)), metric(counts, proba), rtol=1e-5
    )


# Scorers


class CountsMarginal(ClassifierMixin, BaseEstimator):
    """Predicts the mean distribution of ratings, shrunk towards uniform."""

    def __init__(self, shrinkage=0.0):
        self.shrinkage = shrinkage

    def fit(self, X, y):
        self.classes_ = np.arange(1, y.shape[1] + 1)
        share = (y / y.sum(axis=1, keepdims=True)).mean(axis=0)
        self.proba_ = (1 - self.shrinkage) * share + self.shrinkage / y.shape[1]
        return self

    def predict_proba(self, X):
        return np.tile(self.proba_, (len(X), 1))


@pytest.mark.parametrize(
    "scorer, score",
    [(neg_rps_scorer, ranked_probability_score), (neg_macro_mae_scorer, macro_mae)],
)
def test_scorers_search_over_counts_by_group(scorer, score, crowd):
    counts, _ = crowd
    X, groups = np.zeros((len(counts), 1)), np.arange(len(counts)) // 4
    pipeline = make_pipeline(StandardScaler(), CountsMarginal())
    search = GridSearchCV(
        pipeline,
        {"countsmarginal__shrinkage": [0.0, 0.5]},
        scoring=scorer,
        cv=GroupKFold(4),
        error_score="raise",
    ).fit(X, counts, groups=groups)
    assert search.score(X, counts) == -score(counts, search.predict_proba(X))
    train, test = next(GroupKFold(4).split(X, counts, groups))
    fold = CountsMarginal().fit(X[train], counts[train]).predict_proba(X[test])
    assert search.cv_results_["split0_test_score"][0] == -score(counts[test], fold)


@pytest.mark.slow
@pytest.mark.parametrize("routing", [False, True])
@pytest.mark.parametrize("scorer", [neg_rps_scorer, neg_macro_mae_scorer])
def test_a_search_weights_its_scores(scorer, routing):
    X, y = make_classification(n_samples=60, n_classes=3, n_informative=4)
    weight = np.repeat([0.1, 1.0], 30)
    train, test = folds = np.arange(0, 60, 2), np.arange(1, 60, 2)
    with config_context(enable_metadata_routing=routing):
        model = LogisticRegression()
        if routing:
            model.set_fit_request(sample_weight=True)
        search = GridSearchCV(model, {"C": [1]}, scoring=scorer, cv=[folds])
        score = search.fit(X, y, sample_weight=weight).best_score_
    model.fit(X[train], y[train], sample_weight=weight[train])
    expected = scorer(model, X[test], y[test], sample_weight=weight[test])
    assert score == pytest.approx(expected)
    assert score != pytest.approx(scorer(model, X[test], y[test]))


@pytest.mark.slow
@pytest.mark.parametrize("scorer", [neg_rps_scorer, neg_macro_mae_scorer])
def test_scorers_take_labels_weights_workers_and_pickle(scorer):
    X, y = make_classification(n_samples=60, n_classes=3, n_informative=4)
    model = LogisticRegression().fit(X, y)
    assert scorer(model, X[:5], y[:5]) <= 0
    first = scorer(model, X, y, sample_weight=np.eye(60)[0])
    assert first == pytest.approx(scorer(model, X[:1], y[:1]))
    assert pickle.loads(pickle.dumps(scorer)) is scorer
    result = cross_validate(
        model, X, y, scoring={"a": scorer}, n_jobs=2, error_score="raise"
    )
    assert np.isfinite(result["test_a"]).all()


def test_macro_mae_of_level_indices_by_hand():
    predicted = np.array([[0, 1, 1, 2], [0, 0, 0, 0]])
    level = np.array([[0, 0, 1, 1], [3, 0, 0, 0]])
    # trial 0: level 0 errs (0 + 1) / 2, level 1 errs (0 + 1) / 2: mean 0.5
    # trial 1: level 3 errs 3, level 0 errs 0: mean 1.5
    assert macro_error(predicted, level).tolist() == [0.5, 1.5]
    counted = np.array([[True] * 4, [False, True, True, True]])
    assert macro_error(predicted, level, counted).tolist() == [0.5, 0]


# Units of the scale, and the noise ceiling

VALUES = np.array([-3.0, -2.5, 0, 1, 7])


def test_scores_in_units_of_the_scale_are_their_definitions():
    rng = np.random.default_rng(0)
    counts = rng.integers(0, 4, size=(20, 5)) + np.eye(5, dtype=int)[0]
    proba = rng.dirichlet(np.ones(5), size=20)
    given = {"levels": VALUES, "units": "scale", "average": False}
    rps = ranked_probability_score(counts, proba, **given)
    emd = earth_movers_distance(counts, proba, **given)
    mae = macro_mae(counts, proba, **given)
    for i, (n, q) in enumerate(zip(counts, proba)):
        f = n / n.sum()
        assert emd[i] == pytest.approx(wasserstein_distance(VALUES, VALUES, f, q))
        distance = np.abs(VALUES[:, None] - VALUES)
        kernel = f @ distance @ q - q @ distance @ q / 2  # E|X - y| - E|X - X'| / 2
        assert rps[i] == pytest.approx(kernel)
        errors = {}
        for p in np.arange(1, 100) / 100:
            true, predicted = (
                VALUES[np.searchsorted(np.cumsum(w) / np.sum(w), p - 1e-12)]
                for w in (n, q)
            )
            errors.setdefault(true, []).append(abs(true - predicted))
        expected = np.mean([np.mean(each) for each in errors.values()])
        assert mae[i] == pytest.approx(expected)
    mean = proba @ VALUES
    spread = (proba @ VALUES**2 - mean**2).sum()
    scatter = (
        counts / counts.sum(1, keepdims=True) * (VALUES - mean[:, None]) ** 2
    ).sum()
    assert dispersion(counts, proba, levels=VALUES, units="scale") == pytest.approx(
        spread / scatter
    )


@pytest.mark.parametrize("unit", [1e-300, 1e-150, 1e150, 1e300])
def test_dispersion_does_not_depend_on_the_unit(unit):
    counts, proba, levels = [[1, 4, 2]], [[0.2, 0.5, 0.3]], np.array([-1, 0, 3])
    expected = dispersion(counts, proba, levels=levels, units="scale")
    scaled = dispersion(counts, proba, levels=levels * unit, units="scale")
    assert scaled == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("score", [ranked_probability_score, earth_movers_distance])
def test_a_scale_of_equal_steps_multiplies_the_score(score):
    counts, proba = [[1, 4, 2]], [[0.2, 0.5, 0.3]]
    of_percent = score(counts, proba, levels=[0, 50, 100], units="scale")
    assert of_percent == pytest.approx(50 * score(counts, proba))


@pytest.mark.parametrize("n_raters", [2, 12])
def test_noise_ceiling_is_what_the_truth_and_other_people_score(n_raters):
    rng = np.random.default_rng(0)
    truth = rng.dirichlet(np.ones(5), size=20_000)
    counts, others = rng.multinomial(n_raters, truth, size=(2, 20_000))
    rps = partial(ranked_probability_score, levels=VALUES, units="scale")
    ceiling = noise_ceiling(counts, rps)
    assert ceiling.truth == pytest.approx(rps(counts, truth), rel=0.02)
    assert ceiling.raters == pytest.approx(rps(counts, others / n_raters), rel=0.02)


@pytest.mark.parametrize("score", [r2_score, mean_absolute_error])
@pytest.mark.parametrize("n_raters", [6, 12])
def test_noise_ceiling_of_means_is_what_the_truth_and_other_people_score(
    score, n_raters
):
    rng = np.random.default_rng(0)
    truth = rng.dirichlet(np.ones(5), size=20_000)
    counts, others = rng.multinomial(n_raters, truth, size=(2, 20_000))
    mean = counts @ VALUES / n_raters
    ceiling = noise_ceiling(pd.DataFrame(counts, columns=VALUES), score)
    close = {"rel": 0.03, "abs": 0.02}
    assert ceiling.truth == pytest.approx(score(mean, truth @ VALUES), **close)
    others = score(mean, others @ VALUES / n_raters)
    assert ceiling.raters == pytest.approx(others, **close)
    # Both see means and deviations only.
    deviation = np.sqrt(counts @ VALUES**2 / n_raters - mean**2)
    again = counts_from_moments(mean, deviation, levels=VALUES, n=n_raters)
    assert noise_ceiling(again, score).truth == pytest.approx(ceiling.truth)


def test_noise_ceiling_of_r2_is_of_all_trials():
    counts = [[3, 2, 0], [0, 2, 5], [9, 9, 9]]
    weighted = noise_ceiling(counts, r2_score, sample_weight=[1, 2, 0])
    assert weighted == noise_ceiling(np.repeat(counts, [1, 2, 0], axis=0), r2_score)
    with pytest.raises(ValueError, match="y_true has equal means, of which"):
        noise_ceiling([counts[0], counts[0]], r2_score)
    with pytest.raises(ValueError, match="no trial alone has an R²; leave it out"):
        noise_ceiling(counts, r2_score, average=False)


@pytest.mark.parametrize("n_raters", [3, 6, 12])
@pytest.mark.parametrize("concentration", [0.15, 1])
def test_noise_ceiling_of_the_log_score_is_the_entropy(n_raters, concentration):
    rng = np.random.default_rng(0)
    truth = rng.dirichlet(np.full(5, concentration), size=20_000)
    ceiling = noise_ceiling(rng.multinomial(n_raters, truth), log_score)
    assert ceiling.truth == pytest.approx(entropy(truth, axis=1).mean(), rel=0.04)
    assert np.isinf(ceiling.raters)


@pytest.mark.parametrize("scorer", [neg_rps_scorer, neg_macro_mae_scorer])
def test_scorers_order_words_as_the_ratings_do_not_by_the_alphabet(scorer):
    rng = np.random.default_rng(0)
    X = rng.normal(size=(60, 1))
    place = np.clip(np.round(X[:, 0] + 1), 0, 2).astype(int)
    levels = ["low", "mid", "high"]
    words = pd.Series(pd.Categorical.from_codes(place, levels, ordered=True))
    numbered = scorer(LogisticRegression().fit(X, place), X, place)
    model = LogisticRegression().fit(X, words)
    assert scorer(model, X, words) == pytest.approx(numbered)
    with pytest.warns(UserWarning, match="y has words, .* 'high' < 'low' < 'mid'"):
        assert scorer(model, X, words.astype(object)) != pytest.approx(numbered)
    told = DummyDistribution(levels=sorted(levels)).fit(X, words.astype(object))
    scorer(told, X, words.astype(object))  # no warning, which would be an error


@pytest.mark.parametrize("score", [macro_mae, earth_movers_distance, dispersion])
def test_noise_ceiling_refuses_scores_that_a_prediction_can_beat(score):
    with pytest.raises(ValueError, match=f"score={score.__name__} is not proper"):
        noise_ceiling([[2, 3], [3, 2]], score)


def test_noise_ceiling_counts_in_the_numbers_that_label_the_columns():
    counts = np.array([[4, 1, 0], [2, 2, 3], [0, 1, 5]])
    on_scale = partial(ranked_probability_score, units="scale")
    labelled = pd.DataFrame(counts, columns=[-10, 0, 3])[[3, -10, 0]]
    expected = noise_ceiling(counts, partial(on_scale, levels=[-10, 0, 3]))
    for asked in (on_scale, partial(on_scale, levels=[-10, 0, 3])):
        assert noise_ceiling(labelled, asked) == expected
    words = pd.DataFrame(counts, columns=["low", "mid", "high"])[["mid", "high", "low"]]
    in_order = partial(ranked_probability_score, levels=["low", "mid", "high"])
    assert noise_ceiling(words, in_order) == noise_ceiling(counts)


def test_percentages_are_warned_of_where_the_number_of_people_matters():
    rng = np.random.default_rng(0)
    counts = rng.multinomial(12, [0.1, 0.2, 0.4, 0.2, 0.1], size=30)
    for percentages in (100 * counts / 12, (100 * counts / 12).round()):
        for function in (noise_ceiling, interrater_agreement):
            with pytest.warns(UserWarning, match="rows that sum to 100.* percentages"):
                function(percentages)
        assert round(percentages.sum(axis=1).max()) >= 100
        as_told = percentages * 12 / 100
        truth = noise_ceiling(counts).truth
        assert_allclose(noise_ceiling(as_told).truth, truth, rtol=0.01)
    noise_ceiling(rng.multinomial(90, [0.5, 0.3, 0.2], size=30))  # no warning
    lacking = 100 * counts / 12
    lacking[0] *= 11 / 12  # one gave no answer
    with pytest.warns(UserWarning, match="rows that sum to 100"):
        noise_ceiling(lacking)
    people = np.array([[4, 4, 4, 4, 1], [0, 1, 5, 9, 2], [8, 6, 3, 0, 0]])
    rounded = np.round(100 * people / 17)
    assert rounded.sum(axis=1).tolist() == [102, 100, 100]
    with pytest.warns(UserWarning, match="rows that sum to 100"):
        noise_ceiling(rounded)
    with pytest.raises(ValueError, match="look like shares of people"):
        noise_ceiling(rounded / 100)


def test_weights_within_a_score_are_refused():
    weighted = partial(ranked_probability_score, sample_weight=[1, 0])
    with pytest.raises(ValueError, match=r"^score is given \['sample_weight'\]"):
        noise_ceiling([[6, 6], [12, 0]], weighted)


def test_noise_ceiling_of_people_who_agree_is_zero():
    for score in (ranked_probability_score, log_score):
        ceiling = noise_ceiling([[0, 5, 0], [2, 0, 0]], score, average=False)
        assert ceiling.truth.tolist() == ceiling.raters.tolist() == [0, 0]


def test_words_in_two_orders_are_refused():
    """A pivot of polars has them as they first occur, the model from low to high."""
    words = ["not", "quite", "extremely"]
    counts = pd.DataFrame([[1, 3, 2], [4, 0, 1]], columns=["quite", "not", "extremely"])
    proba = pd.DataFrame([[0.5, 0.3, 0.2], [0.2, 0.6, 0.2]], columns=words)
    with pytest.raises(ValueError, match=r"give levels=\[...\], lowest first, because"):
        ranked_probability_score(counts, proba)
    expected = ranked_probability_score(counts[words], proba)
    assert ranked_probability_score(counts, proba, levels=words) == expected
    assert ranked_probability_score(counts[words], proba[sorted(words)]) == expected
