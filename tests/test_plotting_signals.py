"""SignalsDisplay: what was recorded is what is drawn, at its time."""

import matplotlib
import numpy as np
import pandas as pd
import pytest

from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.plotting import SignalsDisplay

SENSORS = ["pac", "pdc", "tac", "tdc", "electrodes"]
PROCEDURES = ["hold", "fast_slide"]


@pytest.fixture(scope="module")
def by_procedure():
    return {
        name: make_haptic_corpus(2, 1, name, random_state=0).trials.iloc[1]
        for name in PROCEDURES
    }


def recording(n_times=30, n_channels=3):
    return np.random.default_rng(0).normal(size=(n_times, n_channels))


def test_lines_and_images_are_the_recordings(by_procedure):
    display = SignalsDisplay.from_trials(by_procedure)
    assert display.axes_.shape == (5, 2)
    assert list(display.lines_) == SENSORS[:4]
    for sensor, rate in zip(SENSORS, [2200, 100, 100, 100]):
        for trial, lines in zip(by_procedure.values(), display.lines_[sensor]):
            assert len(lines) == 2
            for line, channel in zip(lines, trial[sensor].T):
                np.testing.assert_array_equal(line.get_ydata(), channel)
                seconds = np.arange(len(channel)) / rate
                np.testing.assert_allclose(line.get_xdata(), seconds)
    for trial, image in zip(by_procedure.values(), display.images_["electrodes"]):
        np.testing.assert_array_equal(image.get_array(), trial["electrodes"].T)
        n_times = len(trial["electrodes"])
        np.testing.assert_allclose(image.get_extent(), [0, n_times / 100, 37.5, -0.5])


@pytest.mark.slow
def test_panels_are_linked_and_labelled(by_procedure):
    display = SignalsDisplay.from_trials(by_procedure)
    axes, figure = display.axes_, display.figure_
    figure.canvas.draw()
    assert [panel.get_title() for panel in axes[0]] == ["hold", "fast slide"]
    assert {panel.get_xlabel() for panel in axes[-1]} == {"time, s"}
    labels = [panel.get_ylabel() for panel in axes[:, 0]]
    assert labels == [*(f"{s}\ncounts" for s in SENSORS[:4]), "electrodes"]
    for row in axes:
        assert row[0].get_ylim() == row[1].get_ylim()
    for column in axes.T:
        assert len({panel.get_xlim() for panel in column}) == 1
    fingers = [text.get_text() for text in axes[4, 0].get_yticklabels()]
    assert fingers == ["finger 0", "finger 1"]
    np.testing.assert_array_equal(axes[4, 0].get_yticks(), [9, 28])
    limits = {image.get_clim() for image in display.images_["electrodes"]}
    values = np.concatenate([trial["electrodes"] for trial in by_procedure.values()])
    largest = np.abs(values).max()  # of either sign: 0 has the middle colour
    assert limits == {(-largest, largest)}
    assert "counts" in {
        each.get_ylabel() for row in axes for p in row for each in p.child_axes
    }
    (legend,) = (p.get_legend() for p in axes.ravel() if p.get_legend())
    assert [text.get_text() for text in legend.get_texts()] == fingers


def test_any_sensor_of_any_number_of_channels():
    trial = {"taxels": recording(20, 16), "accelerometer": recording(200)}
    display = SignalsDisplay.from_trials(
        trial,
        sampling_rate={"taxels": 50, "accelerometer": 500},
        unit={"accelerometer": "m/s²"},
    )
    assert display.axes_.shape == (2, 1)
    assert display.images_["taxels"][0].get_extent()[1] == 0.4
    assert display.units == {"taxels": "reading", "accelerometer": "m/s²"}
    (lines,) = display.lines_["accelerometer"]
    assert lines[0].get_xdata()[-1] == pytest.approx(199 / 500)
    assert display.axes_[1, 0].get_ylabel() == "accelerometer\nm/s²"
    names = [text.get_text() for text in display.axes_[1, 0].get_legend().get_texts()]
    assert names == ["channel 0", "channel 1", "channel 2"]
    lightness = [
        matplotlib.colors.to_rgb(line.get_color()) @ np.array([0.21, 0.72, 0.07])
        for line in lines
    ]
    assert np.diff(lightness).min() > 0.1


@pytest.mark.parametrize("n_channels", [1, 8, 9])
def test_one_array(n_channels):
    values = recording(n_channels=n_channels)
    display = SignalsDisplay.from_trials(values, sampling_rate=10, unit="N")
    assert display.axes_.shape == (1, 1)
    assert display.titles == [""]
    assert len(display.images_) == (n_channels > 8)
    assert sum(map(len, display.lines_.get("", []))) == n_channels * (n_channels < 9)


def test_a_row_of_stamped_recordings_is_one_trial():
    at = np.arange(200) / 200
    axes = pd.DataFrame(np.zeros((200, 3)), at, list("xyz"))
    row = pd.DataFrame({"acc": [axes], "gyro": [axes]}).iloc[0]
    display = SignalsDisplay.from_trials(row, sampling_rate=200)
    assert [*display.signals] == ["acc", "gyro"] and display.titles == [""]
    with pytest.raises(ValueError, match="sampled at 200 Hz by its index, but 1000"):
        SignalsDisplay.from_trials(row, sampling_rate=1000)


def test_rows_of_a_table_are_columns_of_panels(by_procedure):
    table = pd.DataFrame({"pdc": [t["pdc"] for t in by_procedure.values()]})
    display = SignalsDisplay.from_trials(table)
    assert [panel.get_title() for panel in display.axes_[0]] == ["0", "1"]
    table.index = ["same", "same"]
    assert SignalsDisplay.from_trials(table).axes_.shape == (1, 2)
    one = SignalsDisplay.from_trials(table.iloc[0])
    np.testing.assert_array_equal(
        one.lines_["pdc"][0][1].get_ydata(), by_procedure["hold"]["pdc"][:, 1]
    )


def test_given_axes_hold_the_panels():
    figure = matplotlib.figure.Figure(layout="constrained")
    left, right = figure.subplots(1, 2)
    display = SignalsDisplay.from_trials(recording(), sampling_rate=10, ax=right)
    assert display.ax_ is right and not right.axison
    assert display.figure_ is figure
    figure.canvas.draw()
    assert display.axes_[0, 0].get_position().x0 > left.get_position().x1


def test_axes_on_no_grid_are_refused():
    ax = matplotlib.figure.Figure().add_axes((0, 0, 1, 1))
    with pytest.raises(ValueError, match=r"ax is on no grid.*pyplot\.subplots"):
        SignalsDisplay.from_trials(recording(), sampling_rate=10, ax=ax)
