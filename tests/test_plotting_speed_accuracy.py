"""SpeedAccuracyDisplay: what the table holds is what is drawn."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV

from sklearn_haptic.model_selection import (
    cheapest_within_one_se,
    neg_seconds_scorer,
    speed_accuracy_frontier,
)
from sklearn_haptic.plotting import SpeedAccuracyDisplay

# Candidates in no order of time: dominated, frontier, frontier, dominated, best.
CV_RESULTS = {
    "params": [{"size": size} for size in (3, 1, 2, 5, 4)],
    "split0_test_neg_seconds": -np.array([4.0, 1.0, 2.0, 9.0, 8.0]),
    "split1_test_neg_seconds": -np.array([4.0, 1.0, 2.0, 11.0, 8.0]),
    "mean_test_neg_seconds": -np.array([4.0, 1.0, 2.0, 10.0, 8.0]),
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
        key.replace("_score", "_rps"): value for key, value in CV_RESULTS.items()
    }
    display = SpeedAccuracyDisplay.from_search(results)
    ax = display.ax_
    assert ax.get_xscale() == "log"
    assert ax.get_xlabel() == "time to predict, seconds per trial"
    assert ax.get_ylabel() == "mean test score (rps), higher is better"
    labels = {text.get_text() for text in ax.get_legend().get_texts()}
    assert {"frontier", "best", "cheapest (to a tenth) within 1 SE"} <= labels
    display.figure_.canvas.draw()


def test_sensors_on_the_frontier_are_named_and_short_times_in_milliseconds():
    subsets = [("a",), ("b",), ("c",), ("a", "b"), ("b", "c")]
    results = CV_RESULTS | {"params": [{"sensors": subset} for subset in subsets]}
    for key in CV_RESULTS:
        if "neg_seconds" in key:
            results[key] = np.divide(CV_RESULTS[key], 1000)
    display = SpeedAccuracyDisplay.from_search(results)
    names = [(mark.xy[0], mark.get_text()) for mark in display.names_]
    assert names == [(0.001, "b"), (0.002, "c"), (0.008, "b\nc")]
    in_another_order = pd.DataFrame(results)[::-1]
    same = SpeedAccuracyDisplay.from_search(in_another_order)
    assert [(mark.xy[0], mark.get_text()) for mark in same.names_] == names
    assert display.ax_.get_xlabel() == "time to predict, milliseconds per trial"
    assert display.ax_.xaxis.get_major_formatter()(0.002, 0) == "2"
    assert SpeedAccuracyDisplay.from_search(CV_RESULTS).names_ == []


@pytest.mark.slow
def test_search_display_from_a_search():
    rng = np.random.default_rng(3)
    X, y = rng.normal(size=(40, 2)), np.tile([1, 2], 20)
    scoring = {name: name for name in ("accuracy", "neg_log_loss")}
    scoring["neg_seconds"] = neg_seconds_scorer
    search = GridSearchCV(
        LogisticRegression(), {"C": [0.01, 1, 100]}, scoring=scoring, refit="accuracy"
    ).fit(X, y)
    display = SpeedAccuracyDisplay.from_search(search)
    assert display.metric == "accuracy"
    assert display.score[display.best] == search.best_score_
    other = SpeedAccuracyDisplay.from_search(search, metric="neg_log_loss")
    means = search.cv_results_["mean_test_neg_log_loss"]
    np.testing.assert_array_equal(other.score, means)
