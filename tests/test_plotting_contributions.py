"""SensorContributionsDisplay: bars, whiskers, marks and groups."""

import sys

import matplotlib
import matplotlib.pyplot as plt
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
    values[1, 2] += 0.5
    return pd.DataFrame({"emd": values.ravel()}, index).reset_index()


@pytest.mark.slow
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


@pytest.mark.slow
def test_contributions_display_names_axes_bars_and_groups(holdout_scores):
    display = SensorContributionsDisplay.from_scores(
        holdout_scores, metric="emd", by="procedure"
    )
    ax = display.ax_
    assert ax.get_ylabel() == "EMD, levels, lower is better"
    assert "p < .05 over starts" in ax.get_xlabel()
    assert "over objects" in ax.get_xlabel()
    names = [label.get_text() for label in ax.get_xticklabels()]
    assert names == ["all", "−tdc", "−pac"] * 2
    (above,) = ax.child_axes
    groups = [label.get_text() for label in above.get_xticklabels()]
    assert groups == ["slow slide", "hold"]
    display.figure_.canvas.draw()


@pytest.mark.slow
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
    with pytest.raises(ImportError, match="pip install matplotlib"):
        SensorContributionsDisplay.from_scores(scores, metric="emd")
