"""Figures of people's ratings: what is drawn beside numbers computed elsewhere."""

from itertools import pairwise

import numpy as np
import pandas as pd
import polars as pl
import pytest
from matplotlib.colors import to_rgb
from scipy.stats import spearmanr

from sklearn_haptic.plotting import (
    AdjectiveCorrelationDisplay,
    InterraterAgreementDisplay,
    RatingsDisplay,
)

NAMES = ["hard", "soft", "rough"]
LUMINANCE = [0.2126, 0.7152, 0.0722]


@pytest.fixture
def counts():
    """Counts of twelve people for six objects."""
    rng = np.random.default_rng(0)
    return {name: rng.multinomial(12, rng.dirichlet(np.ones(5), 6)) for name in NAMES}


@pytest.fixture
def answers():
    """Ratings of 200 people: hard and soft opposed, rough on its own."""
    rng = np.random.default_rng(0)
    hard = rng.integers(1, 6, size=200)
    soft = np.clip(6 - hard + rng.integers(-1, 2, size=200), 1, 5)
    return pd.DataFrame(
        {"hard": hard, "soft": soft, "rough": rng.integers(1, 6, size=200)}
    )


def texts(labels):
    return [label.get_text() for label in labels]


# All ratings


def test_bars_are_as_long_as_there_are_responses(counts):
    counts["rough"][2] = [0, 1, 0, 2, 3]  # half as many people
    display = RatingsDisplay.from_counts(counts)
    scale = 12 / display.bars_[0][0].get_width() * counts["hard"][0, 0]
    lengths = np.array([[bar.get_width() for bar in bars] for bars in display.bars_])
    expected = np.concatenate([*counts.values()]).T
    np.testing.assert_allclose(lengths * scale, 12 * expected, atol=1e-9)
    for level, bars in enumerate(display.bars_):
        for i, bar in enumerate(bars):
            column, row = divmod(i, 6)
            before = expected[:level, i].sum() / 12 * 0.9
            assert bar.get_x() == pytest.approx(column - 0.45 + before)
            assert bar.get_y() + bar.get_height() / 2 == pytest.approx(row)


def test_rows_of_one_object_are_drawn_once_in_the_order_they_occur(counts):
    order = np.array([4, 4, 0, 2, 0, 4])
    trials = {name: table[order] for name, table in counts.items()}
    objects = np.array(["tile", "?", "cork", "?", "foam"])[order]
    display = RatingsDisplay.from_counts(trials, objects=objects)
    assert texts(display.ax_.get_yticklabels()) == ["foam", "tile", "cork"]
    np.testing.assert_array_equal(display.counts["soft"], counts["soft"][[4, 0, 2]])
    as_numbers = RatingsDisplay.from_counts(trials, objects=order)
    assert texts(as_numbers.ax_.get_yticklabels()) == ["4", "0", "2"]


def test_levels_adjectives_and_units_are_named(counts):
    levels = ["not", "slightly", "somewhat", "yes", "very"]
    display = RatingsDisplay.from_counts(counts, levels=levels)
    ax = display.ax_
    assert texts(ax.get_xticklabels()) == NAMES
    assert texts(ax.get_yticklabels()) == list("012345")
    assert ax.get_xlabel() == "number of responses (a full bar is 12)"
    assert ax.get_ylabel() == "object"
    assert texts(ax.get_legend().get_texts()) == levels
    assert ax.yaxis_inverted()  # the first object on top
    display.figure_.canvas.draw()


def test_higher_levels_are_darker(counts):
    display = RatingsDisplay.from_counts(counts)
    colours = np.array([bars[0].get_facecolor()[:3] for bars in display.bars_])
    assert (np.diff(colours @ LUMINANCE) < -0.05).all()


@pytest.mark.slow
def test_figure_grows_with_the_objects_and_labels_keep_apart(counts):
    many = {name: np.tile(table, (10, 1)) for name, table in counts.items()}
    few = RatingsDisplay.from_counts(counts).figure_
    display = RatingsDisplay.from_counts(many)
    assert few.get_figheight() < 3 < 8 < display.figure_.get_figheight() < 10
    display.figure_.draw_without_rendering()
    boxes = [label.get_window_extent() for label in display.ax_.get_yticklabels()]
    assert not any(a.overlaps(b) for a, b in pairwise(boxes))


def test_one_table_is_enough(counts):
    display = RatingsDisplay.from_counts(pd.DataFrame(counts["hard"]))
    assert texts(display.ax_.get_xticklabels()) == ["ratings"]
    np.testing.assert_array_equal(display.counts["ratings"], counts["hard"])


# Agreement


def test_boxes_are_quartiles_of_the_agreement_sorted_by_median(counts):
    display = InterraterAgreementDisplay.from_counts(counts)
    expected = {}
    for name, table in counts.items():
        people = [np.repeat(np.arange(1, 6), row) for row in table]
        expected[name] = np.array([1 - np.var(each, ddof=1) / 2 for each in people])
    order = sorted(NAMES, key=lambda name: -np.median(expected[name]))
    assert texts(display.ax_.get_xticklabels()) == order == [*display.agreement]
    for i, name in enumerate(order):
        np.testing.assert_allclose(display.agreement[name], expected[name])
        median = display.boxes_["medians"][i].get_ydata()
        np.testing.assert_allclose(median, np.median(expected[name]))
        box = display.boxes_["boxes"][i].get_path().vertices[:, 1]
        quartiles = np.percentile(expected[name], [25, 75])
        np.testing.assert_allclose([box.min(), box.max()], quartiles)


def test_counts_of_one_adjective_are_called_counts():
    with pytest.raises(ValueError, match=r"^counts has fewer than two ratings in tr"):
        InterraterAgreementDisplay.from_counts([[2, 1], [1, 0]])


def test_trials_of_an_object_count_once(counts):
    trials = {name: np.repeat(table, 7, axis=0) for name, table in counts.items()}
    display = InterraterAgreementDisplay.from_counts(
        trials, objects=np.repeat(np.arange(6), 7)
    )
    alone = InterraterAgreementDisplay.from_counts(counts)
    for name in NAMES:
        np.testing.assert_array_equal(display.agreement[name], alone.agreement[name])
    assert display.ax_.get_xlabel() == "adjective (6 objects each)"


@pytest.mark.slow
def test_zero_is_marked_and_shown(counts):
    for each in (counts, {"hard": [[12, 0, 0, 0, 0], [11, 1, 0, 0, 0]]}):
        display = InterraterAgreementDisplay.from_counts(each)
        assert set(display.zero_line_.get_ydata()) == {0}
        low, high = display.ax_.get_ylim()
        assert low < 0 and high > 1
        assert "r_{wg}" in display.ax_.get_ylabel()
        assert texts(display.ax_.get_legend().get_texts()) == ["as if at random"]
        display.figure_.canvas.draw()


def test_labels_of_many_adjectives_are_turned(counts):
    many = {f"{name} {i}": counts[name] for i in range(4) for name in NAMES}
    display = InterraterAgreementDisplay.from_counts(many)
    assert {label.get_rotation() for label in display.ax_.get_xticklabels()} == {45}


# Correlation


@pytest.mark.parametrize("frame", [pd.DataFrame, pl.DataFrame])
def test_cells_hold_the_correlations_below_the_diagonal(answers, frame):
    display = AdjectiveCorrelationDisplay.from_ratings(frame(dict(answers)))
    rho = spearmanr(answers).statistic
    drawn = display.image_.get_array()
    np.testing.assert_array_equal(drawn.mask, [[False, True], [False, False]])
    np.testing.assert_allclose(drawn.compressed(), rho[[1, 2, 2], [0, 0, 1]])
    written = [float(text.replace("−", "-")) for text in texts(display.texts_)]
    np.testing.assert_allclose(written, drawn.compressed(), atol=0.005)
    assert [text.get_position() for text in display.texts_] == [(0, 0), (0, 1), (1, 1)]
    assert texts(display.ax_.get_xticklabels()) == ["hard", "soft"]
    assert texts(display.ax_.get_yticklabels()) == ["soft", "rough"]
    assert display.image_.get_clim() == (-1, 1)
    assert display.colorbar_.ax.get_ylabel() == "Spearman's ρ"
    display.figure_.canvas.draw()


def test_antonyms_are_framed_and_what_is_not_significant_is_grey(answers):
    display = AdjectiveCorrelationDisplay.from_ratings(answers)
    (frame,) = display.frames_
    assert frame.get_center() == pytest.approx((0, 0))
    assert [text.get_weight() for text in display.texts_] == ["bold", *["normal"] * 2]
    assert [text.get_color() for text in display.texts_] == ["white", "0.5", "0.5"]
    loose = AdjectiveCorrelationDisplay.from_ratings(
        answers, significance=0.99, threshold=0
    )
    assert (
        len(loose.frames_) == (loose.correlation.relation != 0).to_numpy().sum() / 2 > 1
    )
    legend = texts(loose.ax_.get_legend().get_texts())
    assert "|ρ| ≥ 0, p ≤ 0.99 (Holm)" in legend[0]


def test_the_papers_level_is_not_corrected():
    """A pair that only Holm's correction makes insignificant is written in ink."""
    ratings = np.random.default_rng(0).normal(size=(40, 5)).round(1)
    holm, raw = (
        AdjectiveCorrelationDisplay.from_ratings(
            ratings, significance=0.3, threshold=0, corrected=corrected
        )
        for corrected in (True, False)
    )
    pvalue = spearmanr(ratings).pvalue[np.tri(5, k=-1, dtype=bool)]
    grey = [text.get_color() == "0.5" for text in raw.texts_]
    np.testing.assert_array_equal(grey, pvalue > 0.3)
    assert len(raw.frames_) == (pvalue <= 0.3).sum() > len(holm.frames_)
    assert "(Holm)" not in raw.ax_.get_legend().get_texts()[0].get_text()


def test_the_legend_lies_on_no_cell(answers):
    display = AdjectiveCorrelationDisplay.from_ratings(np.array(answers)[:, :2])
    display.figure_.canvas.draw()
    legend = display.ax_.get_legend().get_window_extent()
    assert legend.y0 >= display.ax_.get_window_extent().y1


def test_figures_can_be_read_on_their_cells():
    rng = np.random.default_rng(0)
    base = rng.normal(size=300)
    mixed = [
        w * base + (1 - abs(w)) * rng.normal(size=300) for w in np.linspace(-1, 1, 9)
    ]
    display = AdjectiveCorrelationDisplay.from_ratings(np.transpose([base, *mixed]))
    values = display.image_.get_array().compressed()
    for value, text in zip(values, display.texts_, strict=True):
        ink, paper = to_rgb(text.get_color()), display.image_.to_rgba(value)[:3]
        if text.get_color() in ("black", "white"):
            assert abs(np.dot(LUMINANCE, np.subtract(ink, paper))) > 0.45


@pytest.mark.parametrize(
    "rho, text", [(-0.714, "−.71"), (1, "1.00"), (-1, "−1.00"), (-0.004, ".00")]
)
def test_how_a_correlation_is_written(rho, text):
    from sklearn_haptic.plotting._ratings import _correlation

    assert _correlation(rho) == text


# All three
