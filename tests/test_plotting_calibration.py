"""PITHistogramDisplay, ReliabilityDisplay: the artists' data by other means."""

import matplotlib
import numpy as np
import pandas as pd
import pytest
from scipy import stats
from sklearn.calibration import calibration_curve
from sklearn.linear_model import LogisticRegression

from sklearn_haptic import NNPOM
from sklearn_haptic.metrics import pit_histogram
from sklearn_haptic.plotting import PITHistogramDisplay, ReliabilityDisplay
from sklearn_haptic.plotting._calibration import _reliability

COUNTS = np.tile([0, 2, 6, 3, 1], (10, 1))
DISPLAYS = [PITHistogramDisplay, ReliabilityDisplay]


@pytest.fixture
def proba():
    return np.random.default_rng(0).dirichlet(np.ones(5), size=10)


def touches(n_objects, n_trials, *, width=1.0, seed=0):
    """Ratings of 12 people, and what is to be expected of them after a touch.

    An object has a normal percept that the touches of it see with a common error and
    one each; a person sees it with an error. `width` 1 is Bayes' prediction.
    """
    rng = np.random.default_rng(seed)
    percept = rng.normal(size=n_objects)
    seen = percept + rng.normal(0, 0.5, n_objects)
    seen = (seen[:, None] + rng.normal(0, 0.3, (n_objects, n_trials))).ravel()
    noise = 0.5**2 + 0.3**2
    sd = width * np.sqrt(noise / (1 + noise) + 0.6**2)
    thresholds = [-1.5, -0.5, 0.5, 1.5]
    below = stats.norm.cdf(thresholds, seen[:, None] / (1 + noise), sd)
    edges = np.pad(below, ((0, 0), (1, 1)), constant_values=((0, 0), (0, 1)))
    felt = percept[:, None] + rng.normal(0, 0.6, (n_objects, 12))
    ratings = np.searchsorted(thresholds, felt)
    counts = (ratings[..., None] == np.arange(5)).sum(axis=1)
    groups = np.repeat(np.arange(n_objects), n_trials)
    return counts[groups], np.diff(edges), groups


# PIT histogram


def test_pit_bars_are_the_histogram():
    counts, proba, _ = touches(20, 3)
    display = PITHistogramDisplay.from_predictions(counts, proba, n_bins=7)
    heights = [bar.get_height() for bar in display.bars_]
    np.testing.assert_array_equal(heights, pit_histogram(counts, proba, 7))
    left = [bar.get_x() for bar in display.bars_]
    np.testing.assert_allclose(left, np.arange(7) / 7)
    assert display.uniform_line_.get_ydata() == [1, 1]
    assert display.band_ is None
    assert display.half_widths is None
    assert display.ax_.get_ylabel() == "density"
    assert "probability integral transform" in display.ax_.get_xlabel()
    display.figure_.canvas.draw()


@pytest.mark.parametrize("width", [1.0, 0.6, 0.4])
def test_bars_outside_the_band_are_those_a_t_test_over_objects_rejects(width):
    counts, proba, groups = touches(15, 4, width=width)
    display = PITHistogramDisplay.from_predictions(counts, proba, groups=groups)
    each = [pit_histogram(counts[groups == o], proba[groups == o]) for o in range(15)]
    p = stats.ttest_1samp(each, 1, axis=0).pvalue
    outside = np.abs(display.heights - 1) > display.half_widths
    np.testing.assert_array_equal(outside, p < 0.05)
    assert outside.any() == (width < 1)
    top, edges, bottom = display.band_.get_data()
    np.testing.assert_array_equal(top, 1 + display.half_widths)
    np.testing.assert_array_equal(bottom, np.maximum(1 - display.half_widths, 0))
    np.testing.assert_allclose(edges, np.linspace(0, 1, 11))
    texts = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert texts == ["95 % by chance", "calibrated", "predictions"]


@pytest.mark.slow
def test_the_band_holds_what_it_says_and_objects_are_what_counts():
    ax = matplotlib.figure.Figure().subplots()
    inside = {"objects": [], "trials": []}
    for seed in range(50):
        counts, proba, objects = touches(20, 2, seed=seed)
        for unit, groups in {"objects": objects, "trials": np.arange(40)}.items():
            display = PITHistogramDisplay.from_predictions(
                counts, proba, n_bins=5, groups=groups, ax=ax
            )
            inside[unit].append(np.abs(display.heights - 1) <= display.half_widths)
            ax.clear()
    assert 0.92 < np.mean(inside["objects"]) < 0.98
    assert np.mean(inside["trials"]) < 0.88


def test_objects_with_more_trials_weigh_more_in_the_band():
    # Heights of objects: 2, 0 (three trials of a), 0, 2 (one of b).
    counts = [[1, 0]] * 3 + [[0, 1]]
    display = PITHistogramDisplay.from_predictions(
        counts, [[0.5, 0.5]] * 4, n_bins=2, groups=["a", "a", "a", "b"]
    )
    np.testing.assert_array_equal(display.heights, [1.5, 0.5])
    share = np.sin(0.95 * np.pi / 2) ** 2  # quantile of the arcsine distribution
    np.testing.assert_allclose(display.half_widths, np.sqrt(2 * share * 10) / 4)


# Reliability


def test_reliability_equals_the_calibration_curve_of_single_ratings():
    counts, proba, _ = touches(40, 1)
    display = ReliabilityDisplay.from_predictions(counts, proba, n_bins=4)
    for k in range(4):
        rated_above = np.concatenate(
            [np.repeat(np.arange(5), row) > k for row in counts]
        )
        predicted = np.repeat(proba[:, k + 1 :].sum(axis=1), 12)
        true, mean = calibration_curve(
            rated_above, predicted, n_bins=4, strategy="quantile"
        )
        x, y = display.curves_[k].get_data()
        np.testing.assert_allclose(x, mean)
        np.testing.assert_allclose(y, true, atol=1e-12)
        np.testing.assert_allclose(display.points_[k].get_offsets(), np.c_[x, y])
        np.testing.assert_array_equal(display.n_trials[k], [10] * 4)
    assert display.errorbars_ == []


def test_right_predictions_are_on_the_diagonal():
    proba = np.random.default_rng(1).dirichlet(np.ones(5), size=60)
    display = ReliabilityDisplay.from_predictions(120 * proba, proba)
    for curve in display.curves_:
        np.testing.assert_allclose(*curve.get_data(), atol=1e-12)
    counts, proba, _ = touches(4000, 1)
    display = ReliabilityDisplay.from_predictions(counts, proba)
    for curve in display.curves_:
        np.testing.assert_allclose(*curve.get_data(), atol=0.03)
    display = PITHistogramDisplay.from_predictions(counts, proba)
    np.testing.assert_allclose(display.heights, 1, atol=0.1)


def test_equal_predictions_share_a_bin_and_its_marker_is_larger():
    proba = np.array([[0.9, 0.1]] * 30 + [[0.2, 0.8]] * 10)
    counts = np.array([[3, 1]] * 30 + [[1, 3]] * 10)
    display = ReliabilityDisplay.from_predictions(counts, proba, n_bins=8)
    np.testing.assert_allclose(
        display.curves_[0].get_xydata(), [[0.1, 0.25], [0.8, 0.75]]
    )
    np.testing.assert_array_equal(display.n_trials[0], [30, 10])
    areas = display.points_[0].get_sizes()
    assert areas[0] == pytest.approx(3 * areas[1])


def test_bars_of_one_bin_reach_the_diagonal_unless_a_t_test_rejects_it():
    counts, proba, groups = touches(40, 3)
    display = ReliabilityDisplay.from_predictions(
        counts, proba, n_bins=1, groups=groups
    )
    rejected = []
    for k in range(4):
        observed = counts[::3, k + 1 :].sum(axis=1) / 12
        predicted = proba[:, k + 1 :].sum(axis=1).reshape(40, 3).mean(axis=1)
        p = stats.ttest_rel(observed, predicted).pvalue
        ((x, low), (_, high)) = display.errorbars_[k].get_segments()[0]
        assert (low <= x <= high) != (p < 0.05)
        mean, margin = observed.mean(), display.half_widths[k][0]
        ends = max(mean - margin, 0), min(mean + margin, 1)
        assert (low, high) == pytest.approx(ends)
        rejected.append(p < 0.05)
    assert 0 < sum(rejected) < 4
    texts = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert texts[-1] == "range of chance, 95 %"


def test_bars_of_bins_by_a_loop():
    counts, proba, groups = touches(9, 3)
    display = ReliabilityDisplay.from_predictions(
        counts, proba, n_bins=3, groups=groups
    )
    for k in range(4):
        predicted = proba[:, k + 1 :].sum(axis=1)
        observed = counts[:, k + 1 :].sum(axis=1) / 12
        squares, variances = 0, []
        for trials in np.split(np.argsort(predicted), 3):
            variances.append(0)
            for o in range(9):
                of_object = [t for t in trials if groups[t] == o]
                if of_object:
                    squares += sum(observed[t] - predicted[t] for t in of_object) ** 2
                    p = np.mean([predicted[t] for t in of_object])
                    variances[-1] += len(of_object) ** 2 * p * (1 - p)
        share = stats.beta.ppf(0.95, 0.5, 4)
        expected = np.sqrt(9 * share * squares * np.divide(variances, sum(variances)))
        np.testing.assert_allclose(display.half_widths[k], expected / 9)


@pytest.mark.slow
@pytest.mark.parametrize("n_objects", [6, 30])
@pytest.mark.parametrize("n_trials", [1, 10])
def test_bars_of_right_forecasts_miss_the_diagonal_in_one_case_of_twenty(
    n_objects, n_trials
):
    missed = []
    for seed in range(300):
        counts, proba, groups = touches(n_objects, n_trials, seed=seed)
        for k in range(1, 5):
            predicted = proba[:, k:].sum(axis=1)
            observed = counts[:, k:].sum(axis=1) / 12
            x, y, _, margin = _reliability(predicted, observed, 5, groups)
            missed.extend(np.abs(y - x) > margin)
    assert 0.02 < np.mean(missed) < 0.08


def test_forecasts_that_are_certain_have_no_bars():
    display = ReliabilityDisplay.from_predictions(
        [[4, 0], [4, 0], [0, 4]], np.eye(2)[[0, 0, 1]], groups=[1, 2, 3], n_bins=2
    )
    np.testing.assert_array_equal(display.half_widths, 0)


def test_thresholds_are_named_and_differ_in_lightness_and_marker(proba):
    counts = COUNTS
    display = ReliabilityDisplay.from_predictions(counts, proba, levels=[*"abcde"])
    texts = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert texts == ["reliable", *(f"rating above {level}" for level in "abcd")]
    assert display.diagonal_.get_xydata().tolist() == [[0, 0], [1, 1]]
    colours = np.array([points.get_facecolor()[0, :3] for points in display.points_])
    assert (np.diff(colours @ [0.2126, 0.7152, 0.0722]) > 0).all()
    shapes = {str(points.get_paths()[0].vertices) for points in display.points_}
    assert len(shapes) == 4
    assert display.ax_.get_xlabel() == "predicted proportion of people"
    assert display.ax_.get_ylabel() == "observed proportion of people"
    display.figure_.canvas.draw()


# Both


@pytest.mark.parametrize("display", DISPLAYS)
def test_from_estimator_equals_from_predictions(display):
    rng = np.random.default_rng(2)
    X, y = rng.normal(size=(60, 3)), rng.permutation(np.repeat([1, 2, 4], 20))
    model = LogisticRegression().fit(X, y)
    rows = np.tile([3, 6, 3], (60, 1))
    options = {"n_bins": 3, "groups": y}
    drawn = display.from_estimator(model, X, rows, **options)
    expected = display.from_predictions(
        rows, model.predict_proba(X), levels=[1, 2, 4], **options
    )
    assert vars(drawn).keys() == vars(expected).keys()
    for name in ("levels", "heights", "half_widths", "predicted"):
        if hasattr(expected, name):
            np.testing.assert_array_equal(getattr(drawn, name), vars(expected)[name])


@pytest.mark.parametrize("display", DISPLAYS)
def test_ratings_may_be_labels(display):
    X, y = np.arange(12.0)[:, None] % 5, np.tile([1, 2, 4], 4)
    model = NNPOM(n_hidden=0, levels=[1, 2, 3, 4]).fit(X, y)
    drawn = display.from_estimator(model, X, y)
    one_hot = (y[:, None] == [1, 2, 3, 4]).astype(float)
    expected = display.from_predictions(one_hot, model.predict_proba(X))
    for name in ("heights", "predicted", "observed"):
        if hasattr(expected, name):
            np.testing.assert_array_equal(getattr(drawn, name), vars(expected)[name])


@pytest.mark.parametrize("display", DISPLAYS)
def test_words_are_ordered_as_the_ratings_name_them(display):
    """Not by the alphabet, as a classifier of scikit-learn orders them."""
    X = np.random.default_rng(0).normal(size=(60, 1))
    place = np.clip(np.round(X[:, 0] + 1), 0, 2).astype(int)
    levels = ["low", "mid", "high"]
    words = pd.Series(pd.Categorical.from_codes(place, levels, ordered=True))
    drawn = display.from_estimator(LogisticRegression().fit(X, words), X, words)
    expected = display.from_estimator(LogisticRegression().fit(X, place), X, place)
    for name in ("heights", "predicted", "observed"):
        if hasattr(expected, name):
            np.testing.assert_allclose(getattr(drawn, name), vars(expected)[name])
