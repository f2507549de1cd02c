"""SensorContributionsDisplay: points, whiskers, marks and groups."""

import numpy as np
import pandas as pd
import pytest

from sklearn_haptic.model_selection import contribution_summary
from sklearn_haptic.plotting import SensorContributionsDisplay


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
    values[1, 2] += 0.5 + 0.02 * np.array([1, -1, 2, 0, -2])[:, None]
    return pd.DataFrame({"emd": values.ravel()}, index).reset_index()


@pytest.mark.slow
def test_contributions_display_draws_what_the_table_holds(holdout_scores):
    display = SensorContributionsDisplay.from_scores(
        holdout_scores, metric="emd", by="procedure"
    )
    by_model = holdout_scores.groupby(["procedure", "held_out", "start"], sort=False)
    of_starts = by_model["emd"].mean().to_numpy().reshape(2, 3, 5)
    gains = (of_starts[:, 1:] - of_starts[:, :1]).reshape(4, 5)
    points, _, (whiskers,) = display.points_
    np.testing.assert_allclose(points.get_ydata(), gains.mean(axis=1), atol=1e-12)
    lengths = [np.ptp(segment[:, 1]) for segment in whiskers.get_segments()]
    np.testing.assert_allclose(lengths, 2 * gains.std(axis=1, ddof=1), atol=1e-12)
    table = contribution_summary(holdout_scores, metric="emd", by="procedure")
    pd.testing.assert_frame_equal(display.summary, table)


def test_absolute_bars_are_the_scores_of_all_models(holdout_scores):
    display = SensorContributionsDisplay.from_scores(
        holdout_scores, metric="emd", by="procedure", absolute=True
    )
    by_model = holdout_scores.groupby(["procedure", "held_out", "start"], sort=False)
    of_starts = by_model["emd"].mean().to_numpy().reshape(6, 5)
    heights = [bar.get_height() for bar in display.bars_]
    np.testing.assert_allclose(heights, of_starts.mean(axis=1))
    lengths = [np.ptp(line[:, 1]) for line in display.points_[2][0].get_segments()]
    np.testing.assert_allclose(lengths, 2 * of_starts.std(axis=1, ddof=1))
    names = [label.get_text() for label in display.ax_.get_xticklabels()]
    assert names == ["none", "tdc", "pac"] * 2
    assert [mark.get_text() for mark in display.marks_] == ["", "", "", "", "", "†"]
    assert display.ax_.get_ylabel() == "EMD, levels"
    assert display.ax_.get_ylim()[0] == 0


def test_contributions_display_marks_what_is_significant(holdout_scores):
    display = SensorContributionsDisplay.from_scores(
        holdout_scores, metric="emd", by="procedure"
    )
    marks = [mark.get_text() for mark in display.marks_]
    assert marks == ["", "", "", "†"]
    harmful = holdout_scores.assign(emd=3 - holdout_scores["emd"])
    display = SensorContributionsDisplay.from_scores(
        harmful, metric="emd", by="procedure"
    )
    assert [mark.get_text() for mark in display.marks_] == ["", "", "", ""]
    below = display.points_[0].get_xdata()
    assert [mark.xy[0] for mark in display.marks_] == pytest.approx(below)


@pytest.mark.slow
def test_contributions_display_names_axes_points_and_groups(holdout_scores):
    display = SensorContributionsDisplay.from_scores(
        holdout_scores, metric="emd", by="procedure"
    )
    ax = display.ax_
    assert ax.get_ylabel() == "EMD without the sensor\nless EMD with all, levels"
    assert "p < .05 over objects" in ax.get_xlabel()
    names = [label.get_text() for label in ax.get_xticklabels()]
    assert names == ["tdc", "pac"] * 2
    (above,) = ax.child_axes
    groups = [label.get_text() for label in above.get_xticklabels()]
    assert groups == ["slow slide\nEMD 1.02", "hold\nEMD 1.02"]
    display.figure_.canvas.draw()


@pytest.mark.slow
def test_contributions_display_by_object_and_by_threshold(holdout_scores):
    scores = holdout_scores.query("procedure == 'hold'")
    display = SensorContributionsDisplay.from_scores(scores, metric="emd", by="object")
    assert "over objects" not in display.ax_.get_xlabel()
    assert len(display.points_[0].get_xdata()) == 8 * 2
    terms = scores.rename(columns={"emd": "rps_1"}).assign(rps_2=0.5)
    display = SensorContributionsDisplay.from_scores(terms, by="threshold")
    assert (
        display.ax_.get_ylabel() == "RPS without the sensor\nless RPS with all, levels"
    )
    (above,) = display.ax_.child_axes
    groups = [label.get_text() for label in above.get_xticklabels()]
    assert groups == ["threshold 1\nRPS 1.02", "threshold 2\nRPS 0.50"]
    np.testing.assert_allclose(display.points_[0].get_ydata()[2:], 0, atol=1e-12)
