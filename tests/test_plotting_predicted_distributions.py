"""InverseCDFDisplay, DistributionDisplay: steps and bars, and what a reader sees."""

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline

from sklearn_haptic import NNPOM, ConformalRatings
from sklearn_haptic.metrics import macro_mae
from sklearn_haptic.plotting import DistributionDisplay, InverseCDFDisplay
from sklearn_haptic.ratings import inverse_cdf

COUNTS = np.array([0, 2, 6, 3, 1])
DISPLAYS = [InverseCDFDisplay, DistributionDisplay]


@pytest.fixture
def proba():
    return np.random.default_rng(0).dirichlet(np.ones(5), size=10)


def test_steps_lie_exactly_at_the_jumps_of_the_cdf():
    proba = np.array([[0.25, 0, 0.5, 0.25, 0]])
    display = InverseCDFDisplay.from_predictions(COUNTS, proba)
    values, edges, _ = display.true_line_.get_data()
    np.testing.assert_array_equal(values + 1, [2, 3, 4, 5])
    np.testing.assert_array_equal(edges, [0, 2 / 12, 8 / 12, 11 / 12, 1])
    values, edges, _ = display.trial_lines_[0].get_data()
    np.testing.assert_array_equal(values + 1, [1, 3, 4])
    np.testing.assert_array_equal(edges, [0, 0.25, 0.75, 1])


def test_ratings_alone():
    display = InverseCDFDisplay.from_counts(COUNTS, levels=list("abcde"))
    values, edges, _ = display.true_line_.get_data()
    np.testing.assert_array_equal(values, [1, 2, 3, 4])
    np.testing.assert_array_equal(edges, [0, 2 / 12, 8 / 12, 11 / 12, 1])
    assert display.trial_lines_ == []
    assert display.ax_.get_legend() is None
    assert display.ax_.get_xlabel() == "position p in the population"
    labels = [tick.get_text() for tick in display.ax_.get_yticklabels()]
    assert labels == list("abcde")
    of_trials = InverseCDFDisplay.from_counts(np.tile(COUNTS, (3, 1)))
    np.testing.assert_array_equal(of_trials.counts, COUNTS)
    display.figure_.canvas.draw()


@pytest.mark.parametrize("n_trials", [1, 2, 10, 60])
def test_lines_are_the_inverse_cdfs_within_half_a_level(n_trials):
    proba = np.random.default_rng(1).dirichlet(np.ones(5), size=n_trials)
    display = InverseCDFDisplay.from_predictions(COUNTS, proba)
    p = np.arange(1, 100) / 100
    drawn = []
    for line in display.trial_lines_:
        values, edges, _ = line.get_data()
        drawn.append(np.rint(values)[np.searchsorted(edges[1:-1], p)])
        assert np.abs(values - np.rint(values)).max() < 0.25
    np.testing.assert_array_equal(np.array(drawn) + 1, inverse_cdf(proba, p))


def test_ratings_are_drawn_as_they_were_predicted():
    """They may fall as the position grows; errors are those of equation 3."""
    p = np.arange(1, 100) / 100
    ratings = np.random.default_rng(0).integers(1, 6, size=(3, 99))
    display = InverseCDFDisplay.from_ratings(COUNTS, ratings, p)
    true = inverse_cdf(COUNTS[None], p)[0]
    for line, of_trial, score in zip(display.trial_lines_, ratings, display.scores):
        values, edges, _ = line.get_data()
        drawn = np.rint(values)[np.searchsorted(edges[1:-1], p)]
        np.testing.assert_array_equal(drawn + 1, of_trial)
        errors = [np.abs(of_trial - k)[true == k].mean() for k in np.unique(true)]
        assert score == pytest.approx(np.mean(errors))
    assert "mean MAE$^M$" in display.ax_.get_legend().get_title().get_text()
    with pytest.raises(ValueError, match="6"):
        InverseCDFDisplay.from_ratings(COUNTS, [[6, 1]], [0.2, 0.7])


@pytest.mark.parametrize("levels", [["low", "some", "high"], [3, 2, 1]])
def test_ratings_are_drawn_at_their_levels_in_any_order(levels):
    p = [0.1, 0.5, 0.9]
    display = InverseCDFDisplay.from_ratings([1, 2, 1], [levels], p, levels=levels)
    falling = InverseCDFDisplay.from_ratings(
        [1, 2, 1], [levels[::-1]], p[::-1], levels=levels
    )
    for line in (display.trial_lines_[0], falling.trial_lines_[0]):
        values, edges, _ = line.get_data()
        np.testing.assert_allclose(values, [0, 1, 2])
        np.testing.assert_allclose(edges, [0, 0.3, 0.7, 1])


def test_equal_predictions_are_set_apart():
    display = InverseCDFDisplay.from_predictions(COUNTS, np.full((10, 5), 0.2))
    heights = [line.get_data().values[0] for line in display.trial_lines_]
    assert np.diff(heights).min() > 0.02
    assert np.mean(heights) == pytest.approx(0)


def test_labels_levels_and_errors_are_shown(proba):
    levels = ["not at all", "slightly", "somewhat", "rough", "very"]
    proba = proba[:5]
    display = InverseCDFDisplay.from_predictions(COUNTS, proba, levels=levels)
    ax = display.ax_
    assert ax.get_xlabel() == "position p in the population"
    assert ax.get_ylabel() == "rating"
    assert [tick.get_text() for tick in ax.get_yticklabels()] == levels
    scores = macro_mae(np.tile(COUNTS, (5, 1)), proba, average=False)
    np.testing.assert_array_equal(display.scores, scores)
    legend = ax.get_legend()
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[:2] == ["true ratings", f"trial 1: {scores[0]:.2f}"]
    assert f"{scores.mean():.2f}" in legend.get_title().get_text()
    assert display.figure_ is ax.figure
    display.figure_.canvas.draw()


def test_trials_in_greyscale_print_grow_lighter(proba):
    display = InverseCDFDisplay.from_predictions(COUNTS, proba[:5])
    colours = np.array([line.get_edgecolor()[:3] for line in display.trial_lines_])
    assert (np.diff(colours @ [0.2126, 0.7152, 0.0722]) > 0).all()


def test_many_trials_have_one_colour_and_one_entry(proba):
    display = InverseCDFDisplay.from_predictions(COUNTS, proba)
    assert len({line.get_edgecolor() for line in display.trial_lines_}) == 1
    low, high = min(display.scores), max(display.scores)
    texts = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert texts == ["true ratings", f"10 trials: {low:.2f} to {high:.2f}"]


# Bars


def test_bars_are_proportions_and_means_and_points_the_trials(proba):
    display = DistributionDisplay.from_predictions(COUNTS, proba)
    heights = [bar.get_height() for bar in display.true_bars_]
    np.testing.assert_allclose(heights, [0, 2 / 12, 6 / 12, 3 / 12, 1 / 12])
    heights = [bar.get_height() for bar in display.predicted_bars_]
    np.testing.assert_allclose(heights, [column.mean() for column in proba.T])
    x, y = display.trial_points_.get_data()
    np.testing.assert_allclose(y.reshape(10, 5), proba)
    for points, bar in zip(x.reshape(10, 5).T, display.predicted_bars_):
        assert (np.diff(points) > 0).all()
        assert bar.get_x() < points[0] < points[-1] < bar.get_x() + bar.get_width()


def test_bars_of_a_level_stand_side_by_side_at_its_label(proba):
    levels = ["not at all", "slightly", "somewhat", "rough", "very"]
    display = DistributionDisplay.from_predictions(COUNTS, proba, levels=levels)
    for x, true, predicted in zip(
        display.ax_.get_xticks(), display.true_bars_, display.predicted_bars_
    ):
        assert true.get_x() + true.get_width() == pytest.approx(x)
        assert predicted.get_x() == pytest.approx(x)
    labels = [label.get_text() for label in display.ax_.get_xticklabels()]
    assert labels == levels
    assert display.ax_.get_xlabel() == "rating"
    assert display.ax_.get_ylabel() == "proportion of people"
    texts = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert texts == ["true ratings", "predicted, mean of 10 trials", "each trial"]
    display.figure_.canvas.draw()


def test_a_single_trial_has_bars_alone(proba):
    display = DistributionDisplay.from_predictions(COUNTS, proba[:1])
    assert display.trial_points_ is None
    assert len(display.ax_.lines) == 0
    texts = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert texts == ["true ratings", "predicted"]


def test_sets_are_shaded_by_how_many_hold_a_level():
    rng = np.random.default_rng(2)
    X = np.linspace(-1, 1, 40)[:, np.newaxis] + rng.normal(0, 0.3, (40, 3))
    y = np.repeat([1, 2, 3, 4], 10)
    model = ConformalRatings(NNPOM(0, levels=[1, 2, 3, 4])).fit(X, y, groups=range(40))
    display = DistributionDisplay.from_estimator(
        make_pipeline("passthrough", model), X[::7], [3, 6, 3, 0], alpha=0.4
    )
    share = model.predict_set(X[::7], 0.4).mean(axis=0)
    shaded = display.ax_.patches[8:12]
    assert 0 < share.min() < share.max() < 1
    np.testing.assert_allclose([patch.get_alpha() for patch in shaded], share / 4)
    assert [patch.get_center()[0] for patch in shaded] == [0, 1, 2, 3]
    texts = [text.get_text() for text in display.ax_.get_legend().get_texts()]
    assert "in the sets" in texts


def test_a_row_a_trial_equals_one_row(proba):
    rows = DistributionDisplay.from_predictions(np.tile(COUNTS, (10, 1)), proba)
    np.testing.assert_array_equal(rows.counts, COUNTS)


# Both


@pytest.mark.parametrize("display", DISPLAYS)
def test_from_estimator_equals_from_predictions(display):
    rng = np.random.default_rng(2)
    X, y = rng.normal(size=(60, 3)), rng.permutation(np.repeat([1, 2, 3], 20))
    model = LogisticRegression().fit(X, y)
    rows = np.tile([3, 6, 3], (5, 1))
    drawn = display.from_estimator(model, X[:5], rows)
    proba = model.predict_proba(X[:5])
    given = display.from_predictions([3, 6, 3], proba)
    assert drawn.ax_.dataLim.bounds == pytest.approx(given.ax_.dataLim.bounds)
    if display is InverseCDFDisplay:
        np.testing.assert_allclose(drawn.scores, macro_mae(rows, proba, average=False))
    else:
        np.testing.assert_allclose(drawn.y_proba, proba, rtol=1e-15)
    np.testing.assert_array_equal(drawn.counts, [3, 6, 3])
    np.testing.assert_array_equal(drawn.levels, [1, 2, 3])
