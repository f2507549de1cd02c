"""InverseCDFDisplay: steps at the jumps, and what a reader sees."""

import sys

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression

from sklearn_haptic.metrics import macro_mae_per_trial
from sklearn_haptic.plotting import InverseCDFDisplay
from sklearn_haptic.ratings import inverse_cdf

COUNTS = np.array([0, 2, 6, 3, 1])


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


@pytest.mark.parametrize(
    "counts, message",
    [
        ([[1, 2], [2, 1]], "counts has different ratings for different trials"),
        ([0, 0], "counts has no ratings in trial 0"),
        ([1, -1], "counts has a negative count in trial 0"),
    ],
)
def test_errors_of_ratings_alone(counts, message):
    with pytest.raises(ValueError, match=message):
        InverseCDFDisplay.from_counts(counts)


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


def test_equal_predictions_are_set_apart():
    display = InverseCDFDisplay.from_predictions(COUNTS, np.full((10, 5), 0.2))
    heights = [line.get_data().values[0] for line in display.trial_lines_]
    assert np.diff(heights).min() > 0.02
    assert np.mean(heights) == pytest.approx(0)


def test_labels_levels_and_errors_are_shown(proba):
    levels = ["not at all", "slightly", "somewhat", "rough", "very"]
    display = InverseCDFDisplay.from_predictions(COUNTS, proba, levels=levels)
    ax = display.ax_
    assert ax.get_xlabel() == "position p in the population"
    assert ax.get_ylabel() == "rating"
    assert [tick.get_text() for tick in ax.get_yticklabels()] == levels
    scores = macro_mae_per_trial(np.tile(COUNTS, (10, 1)), proba, average=False)
    np.testing.assert_array_equal(display.scores, scores)
    legend = ax.get_legend()
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[:2] == ["true ratings", f"trial 1: {scores[0]:.2f}"]
    assert f"{scores.mean():.2f}" in legend.get_title().get_text()
    assert display.figure_ is ax.figure
    display.figure_.canvas.draw()


def test_trials_in_greyscale_print_grow_lighter(proba):
    display = InverseCDFDisplay.from_predictions(COUNTS, proba)
    colours = np.array([line.get_edgecolor()[:3] for line in display.trial_lines_])
    assert (np.diff(colours @ [0.2126, 0.7152, 0.0722]) > 0).all()


def test_given_axes_are_used_and_no_figure_is_made(proba):
    figure = matplotlib.figure.Figure()
    ax = figure.subplots()
    display = InverseCDFDisplay.from_predictions(COUNTS, proba, ax=ax)
    assert display.ax_ is ax
    assert display.figure_ is figure
    assert plt.get_fignums() == []
    assert display.plot() is display
    assert display.ax_ is not ax


def test_from_estimator_equals_from_predictions():
    rng = np.random.default_rng(2)
    X, y = rng.normal(size=(60, 3)), rng.permutation(np.repeat([1, 2, 3], 20))
    model = LogisticRegression().fit(X, y)
    rows = np.tile([3, 6, 3], (5, 1))
    display = InverseCDFDisplay.from_estimator(model, X[:5], rows)
    np.testing.assert_allclose(display.y_proba, model.predict_proba(X[:5]), rtol=1e-15)
    np.testing.assert_array_equal(display.counts, [3, 6, 3])
    np.testing.assert_array_equal(display.levels, [1, 2, 3])


@pytest.mark.parametrize(
    "y_true, y_proba, message",
    [
        ([[1, 2], [2, 1]], [[0.5, 0.5]] * 2, "trials of one object only"),
        ([1, 2, 3], [[0.5, 0.5]], "y_proba has 2 columns, but y_true has 3"),
        ([1, 2], [[0.5, 0.6]], "no distribution in trial 0"),
        ([0, 0], [[0.5, 0.5]], "no ratings in trial 0"),
    ],
)
def test_errors(y_true, y_proba, message):
    with pytest.raises(ValueError, match=message):
        InverseCDFDisplay.from_predictions(y_true, y_proba)


def test_without_matplotlib_the_extra_is_named(proba, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"pip install 'sklearn_haptic\[plot\]'"):
        InverseCDFDisplay.from_predictions(COUNTS, proba)
