import numpy as np
import pandas as pd
import pytest

from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.plotting import TouchTimeDisplay

pytest.importorskip("matplotlib")

SECONDS = [0.5, 1, 2]
OBJECTS = np.repeat(np.arange(5), 4)
RNG = np.random.default_rng(0)
COUNTS = RNG.integers(1, 9, (20, 4))
PROBA = RNG.dirichlet(np.ones(4), (20, 3))
STOPS = RNG.integers(0, 3, (2, 20))


def by_object(scores):
    means = np.array([scores[i == OBJECTS].mean() for i in range(5)])
    return means.mean(), means.std(ddof=1) / np.sqrt(5)


def test_the_curve_is_the_mean_over_objects():
    display = TouchTimeDisplay.from_predictions(COUNTS, PROBA, SECONDS, groups=OBJECTS)
    for k in range(3):
        scores = ranked_probability_score(COUNTS, PROBA[:, k], average=False)
        mean, se = by_object(scores)
        assert display.score[k] == pytest.approx(mean)
        assert display.score_se[k] == pytest.approx(se)
    line = display.errorbar_[0].get_xydata()
    np.testing.assert_allclose(line, np.column_stack([SECONDS, display.score]))
    assert display.stops_ is None


def test_objects_change_errors_not_means():
    counts = np.array([[4, 0]] * 8 + [[0, 4]])
    proba = np.tile([[[0.5, 0.5], [0.9, 0.1]]], (9, 1, 1))
    objects, stops = [0] * 8 + [1], {"rule": np.array([0] * 8 + [1])}
    alone, grouped = (
        TouchTimeDisplay.from_predictions(
            counts, proba, [1, 2], stopped=stops, groups=groups
        )
        for groups in (None, objects)
    )
    expected = ranked_probability_score(counts, proba[:, 1])
    for display in alone, grouped:
        assert display.score == pytest.approx([0.25, expected])
        assert display.rules["rule"][0, :2] == pytest.approx([10 / 9, 2.81 / 9])
    # Both deviations, 8/9 below and above, divided by what a mean of two takes away.
    away = 8 / 9 * (0.81 - 0.01) / 9
    se = away * np.sqrt(1 / (1 - 8 / 9) + 1 / (1 - 1 / 9))
    assert grouped.score_se[1] == pytest.approx(se)


def test_columns_in_the_order_of_the_classes_of_the_model():
    """By brute force; the alphabet puts "large" before "medium" and "small"."""
    order = ["small", "medium", "large"]
    sizes = pd.Series(pd.Categorical(["small", "medium"], order, ordered=True))
    proba = np.array([[[0.1, 0.1, 0.8]], [[0.7, 0.2, 0.1]]])
    alphabet = np.sort(order)
    error = TouchTimeDisplay.from_predictions(
        sizes.astype(str), proba, [1], levels=alphabet, metric="error"
    )
    assert error.score == 0.5
    rps = TouchTimeDisplay.from_predictions(sizes, proba, [1], levels=alphabet)
    assert rps.score == pytest.approx((0.2**2 + 0.1**2 + 0.1**2 + (0.9 - 0.2) ** 2) / 2)


def test_rules_are_points_of_mean_seconds_and_score():
    display = TouchTimeDisplay.from_predictions(
        COUNTS, PROBA, SECONDS, stopped={"rule": STOPS}, groups=OBJECTS
    )
    for stops, point in zip(STOPS, display.rules["rule"]):
        reached = PROBA[np.arange(20), stops]
        mean, se = by_object(ranked_probability_score(COUNTS, reached, average=False))
        assert point == pytest.approx([np.take(SECONDS, stops).mean(), mean, se])
    share = [line[1, 1] / 0.2 for line in display.stops_.get_segments()]
    np.testing.assert_allclose(share, np.bincount(STOPS[-1], minlength=3) / 20)
    texts = [text.get_text() for text in display.ax_.texts]
    assert texts == [f"{each:.0%}" for each in share]
    height = display.ax_.transAxes.inverted().transform(
        display.ax_.transData.transform([(1, y) for y in display.score])
    )[:, 1]
    assert height.min() > 0.2  # the highest that a bar can be


def test_errors_of_classes():
    labels = COUNTS.argmax(axis=1)
    display = TouchTimeDisplay.from_predictions(
        labels, PROBA, SECONDS, metric="error", stopped={"rule": STOPS[0]}
    )
    for k in range(3):
        assert display.score[k] == np.mean(PROBA[:, k].argmax(axis=1) != labels)
    assert "errors" in display.ax_.get_ylabel()
    assert list(display.rules_) == ["rule"]


def test_standard_error_of_two_touches():
    counts, proba = [[1, 0], [0, 1]], [[[0.5, 0.5]], [[0.75, 0.25]]]
    display = TouchTimeDisplay.from_predictions(counts, proba, [1.0])
    assert display.score_se == pytest.approx([(0.5625 - 0.25) / 2])  # half of the range
