import sys

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV

from sklearn_haptic.metrics import macro_mae_per_trial
from sklearn_haptic.model_selection import (
    cheapest_within_one_se,
    contribution_summary,
    speed_accuracy_frontier,
)
from sklearn_haptic.plotting import (
    InverseCDFDisplay,
    SensorContributionsDisplay,
    SpeedAccuracyDisplay,
)
from sklearn_haptic.ratings import inverse_cdf

matplotlib.use("Agg")


COUNTS = np.array([0, 2, 6, 3, 1])


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


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


# Candidates in no order of time: dominated, frontier, frontier, dominated, best.
CV_RESULTS = {
    "params": [{"size": size} for size in (3, 1, 2, 5, 4)],
    "mean_fit_time": np.array([3.5, 0.5, 1.5, 9.5, 7.5]),
    "mean_score_time": np.full(5, 0.5),
    "split0_test_score": np.array([2.0, 1.0, 4.0, 5.0, 4.0]),
    "split1_test_score": np.array([2.0, 2.0, 4.0, 4.0, 6.0]),
    "mean_test_score": np.array([2.0, 1.5, 4.0, 4.5, 5.0]),
}


def test_search_display_draws_what_the_table_holds():
    display = SpeedAccuracyDisplay.from_search(CV_RESULTS)
    points, _, (bars,) = display.errorbar_
    np.testing.assert_array_equal(points.get_xdata(), [4, 1, 2, 10, 8])
    np.testing.assert_array_equal(points.get_ydata(), CV_RESULTS["mean_test_score"])
    lengths = [np.ptp(segment[:, 1]) for segment in bars.get_segments()]
    np.testing.assert_allclose(lengths, [0, 1, 0, 1, 2])
    table = speed_accuracy_frontier(CV_RESULTS)
    np.testing.assert_array_equal(display.frontier_.get_xdata(), [1, 2, 8, 10])
    np.testing.assert_array_equal(display.frontier_.get_ydata(), [1.5, 4, 5, 5])
    np.testing.assert_array_equal(table["seconds"], [1, 2, 8])
    assert display.frontier_.get_drawstyle() == "steps-post"
    assert display.best_.get_xydata().tolist() == [[8, 5]]
    assert display.cheapest_.get_xydata().tolist() == [[2, 4]]
    assert cheapest_within_one_se(CV_RESULTS) == display.cheapest == 2


def test_search_display_names_axes_and_marks():
    results = {
        key.replace("_score", "_rps") if "_test_" in key else key: value
        for key, value in CV_RESULTS.items()
    }
    display = SpeedAccuracyDisplay.from_search(results)
    ax = display.ax_
    assert ax.get_xscale() == "log"
    assert ax.get_xlabel() == "time to fit and score, seconds a fold"
    assert ax.get_ylabel() == "mean test score (rps), higher is better"
    labels = {text.get_text() for text in ax.get_legend().get_texts()}
    assert {"frontier", "best", "cheapest within 1 SE"} <= labels
    display.figure_.canvas.draw()


def test_search_display_on_given_axes():
    figure = matplotlib.figure.Figure()
    display = SpeedAccuracyDisplay.from_search(CV_RESULTS, ax=figure.subplots())
    assert display.figure_ is figure
    assert plt.get_fignums() == []
    assert display.plot() is display
    assert display.figure_ is not figure


def test_search_display_from_a_search():
    rng = np.random.default_rng(3)
    X, y = rng.normal(size=(40, 2)), np.tile([1, 2], 20)
    scoring = ["accuracy", "neg_log_loss"]
    search = GridSearchCV(
        LogisticRegression(), {"C": [0.01, 1, 100]}, scoring=scoring, refit="accuracy"
    ).fit(X, y)
    display = SpeedAccuracyDisplay.from_search(search)
    assert display.metric == "accuracy"
    assert display.score[display.best] == search.best_score_
    other = SpeedAccuracyDisplay.from_search(search, metric="neg_log_loss")
    means = search.cv_results_["mean_test_neg_log_loss"]
    np.testing.assert_array_equal(other.score, means)


def test_search_display_without_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"pip install 'sklearn_haptic\[plot\]'"):
        SpeedAccuracyDisplay.from_search(CV_RESULTS)


@pytest.fixture
def holdout_scores():
    """Without "pac" half a level is lost, on "hold" alone; without "tdc" nothing."""
    index = pd.MultiIndex.from_product(
        [["slow_slide", "hold"], ["none", "tdc", "pac"], range(5), range(8)],
        names=["procedure", "held_out", "start", "object"],
    )
    values = np.empty((2, 3, 5, 8))
    values[:] = 1 + 0.01 * np.arange(5)[:, None]
    values[0, 1] += np.tile([0.2, -0.2], 4)
    values[1, 2] += 0.5
    return pd.DataFrame({"emd": values.ravel()}, index).reset_index()


def test_contributions_display_draws_what_the_table_holds(holdout_scores):
    display = SensorContributionsDisplay.from_scores(
        holdout_scores, metric="emd", by="procedure"
    )
    by_model = holdout_scores.groupby(["procedure", "held_out", "start"], sort=False)
    starts = by_model["emd"].mean().groupby(["procedure", "held_out"], sort=False)
    heights = [bar.get_height() for bar in display.bars_]
    np.testing.assert_allclose(heights, starts.mean())
    (whiskers,) = display.bars_.errorbar.lines[2]
    lengths = [np.ptp(segment[:, 1]) for segment in whiskers.get_segments()]
    np.testing.assert_allclose(lengths, 2 * starts.std())
    lines = [segment[0, 1] for segment in display.full_lines_.get_segments()]
    np.testing.assert_allclose(lines, [heights[0], heights[3]])
    table = contribution_summary(holdout_scores, metric="emd", by="procedure")
    pd.testing.assert_frame_equal(display.summary, table)


def test_contributions_display_marks_what_is_significant(holdout_scores):
    display = SensorContributionsDisplay.from_scores(
        holdout_scores, metric="emd", by="procedure"
    )
    marks = [mark.get_text() for mark in display.marks_]
    assert marks == ["", "", "", "∗†"]
    below = [bar.get_x() + bar.get_width() / 2 for bar in display.bars_]
    assert [mark.xy[0] for mark in display.marks_] == pytest.approx(
        below[1:3] + below[4:]
    )


def test_contributions_display_names_axes_bars_and_groups(holdout_scores):
    display = SensorContributionsDisplay.from_scores(
        holdout_scores, metric="emd", by="procedure"
    )
    ax = display.ax_
    assert ax.get_ylabel() == "EMD, levels, lower is better"
    assert "p < .05 over starts" in ax.get_xlabel()
    assert "over objects" in ax.get_xlabel()
    names = [label.get_text() for label in ax.get_xticklabels()]
    assert names == ["−None", "−tdc", "−pac"] * 2
    (above,) = ax.child_axes
    groups = [label.get_text() for label in above.get_xticklabels()]
    assert groups == ["slow slide", "hold"]
    display.figure_.canvas.draw()


def test_contributions_display_by_object_and_by_threshold(holdout_scores):
    scores = holdout_scores.query("procedure == 'hold'")
    display = SensorContributionsDisplay.from_scores(scores, metric="emd", by="object")
    assert "over objects" not in display.ax_.get_xlabel()
    assert len(display.bars_) == 8 * 3
    terms = scores.rename(columns={"emd": "rps_1"}).assign(rps_2=0.5)
    display = SensorContributionsDisplay.from_scores(terms, by="threshold")
    assert display.ax_.get_ylabel() == "RPS, levels, lower is better"
    (above,) = display.ax_.child_axes
    groups = [label.get_text() for label in above.get_xticklabels()]
    assert groups == ["threshold 1", "threshold 2"]
    np.testing.assert_allclose([bar.get_height() for bar in display.bars_][3:], 0.5)


def test_contributions_display_on_given_axes(holdout_scores):
    scores = holdout_scores.query("procedure == 'hold'")
    figure = matplotlib.figure.Figure()
    display = SensorContributionsDisplay.from_scores(
        scores, metric="emd", ax=figure.subplots()
    )
    assert display.figure_ is figure
    assert plt.get_fignums() == []
    assert display.plot() is display
    assert display.figure_ is not figure


def test_contributions_display_without_matplotlib(holdout_scores, monkeypatch):
    scores = holdout_scores.query("procedure == 'hold'")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"pip install 'sklearn_haptic\[plot\]'"):
        SensorContributionsDisplay.from_scores(scores, metric="emd")
