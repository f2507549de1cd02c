import re
from fractions import Fraction

import numpy as np
import pandas as pd
import polars as pl
import pytest
from scipy.stats import rankdata

from sklearn_haptic.ratings import (
    _level_index,
    adjective_correlation,
    interrater_agreement,
    inverse_cdf,
    rating_counts,
)


def exact_level(counts, p):
    """The definition of the inverse CDF in exact arithmetic, one number at a time."""
    below, total = 0, sum(map(int, counts))
    for level, n in enumerate(map(int, counts)):
        below += n
        if n and below >= p * total:
            return level


# Counts per level


@pytest.mark.parametrize(
    "column",
    [
        [1, 2, None, 5, 2],
        np.array([1, 2, np.nan, 5, 2], dtype=np.float32),
        pd.Series([1, 2, None, 5, 2]),
        pd.Series([1, 2, None, 5, 2], dtype="Int64"),
        pd.Series([1, 2, None, 5, 2], dtype="category"),
        pl.Series([1, 2, None, 5, 2]),
    ],
    ids=["list", "array", "float", "Int64", "category", "polars"],
)
def test_rating_counts_leaves_out_missing_ratings(column):
    objects = np.array(["tile", "foam", "foam", "foam", "foam"])
    table = rating_counts(column, objects, levels=[1, 2, 3, 4, 5])
    assert table.counts.tolist() == [[0, 2, 0, 0, 1], [1, 0, 0, 0, 0]]
    assert table.objects.tolist() == ["foam", "tile"]
    assert table.levels.tolist() == [1, 2, 3, 4, 5]
    assert rating_counts(column, objects).levels.tolist() == [1, 2, 5]


def test_rating_counts_keeps_the_order_of_named_and_half_levels():
    table = rating_counts(
        ["very", "no", "a bit", "no"], [7, 7, 3, 3], levels=["no", "a bit", "very"]
    )
    assert table.counts.tolist() == [[1, 1, 0], [1, 0, 1]]
    assert table.objects.tolist() == [3, 7]
    assert rating_counts([0.5, 4.5, 0.5], [0, 0, 0]).levels.tolist() == [0.5, 4.5]


def test_rating_counts_agrees_with_a_published_table(shared_data):
    long = pd.read_csv(shared_data / "tactile_ratings" / "ratings_long.csv")
    wide = pd.read_csv(shared_data / "tactile_ratings" / "counts.csv")
    for (condition, metric), rows in long.groupby(["Condition", "Metric"]):
        table = rating_counts(rows.level5, rows.Texture)
        same = (wide.Condition == condition) & (wide.Metric == metric)
        expected = wide[same].set_index("Texture").loc[table.objects]
        np.testing.assert_array_equal(
            table.counts, expected[["n1", "n2", "n3", "n4", "n5"]]
        )


@pytest.mark.parametrize(
    "args, levels, message",
    [
        (([1, 2], ["a"]), None, "inconsistent numbers of samples"),
        (([1, 6], ["a", "a"]), [1, 2], "has the rating 6.* add it to levels"),
        (([1, 2], ["a", None]), None, "no object for rating 1"),
        (([1, None], ["a", "b"]), None, "Nobody rated the object .*'b'"),
        (([None, None], ["a", "b"]), None, "ratings holds no values"),
        (([1, 2], ["a", "a"]), [1, 1, 2], "must be distinct"),
        (([[1, 2], [1, 2]], ["a", "a"]), None, "1d array"),
    ],
)
def test_rating_counts_errors(args, levels, message):
    with pytest.raises(ValueError, match=message):
        rating_counts(*args, levels=levels)


# Inverse CDF


def test_inverse_cdf_by_hand():
    counts = [[0, 3, 6, 3, 0], [12, 0, 0, 0, 0], [1, 0, 0, 0, 1]]
    p = [0, 0.25, 0.5, 0.51, 1]
    assert inverse_cdf(counts, p).tolist() == [
        [2, 2, 3, 3, 4],
        [1, 1, 1, 1, 1],
        [1, 1, 1, 5, 5],
    ]
    assert inverse_cdf(counts, 0.5).tolist() == [3, 1, 1]
    assert inverse_cdf(counts, 0, levels=list("abcde")).tolist() == ["b", "a", "a"]
    assert inverse_cdf(pd.DataFrame(counts), p).shape == (3, 5)


def test_inverse_cdf_equals_exact_fractions():
    rng = np.random.default_rng(0)
    positions = [Fraction(i, 100) for i in range(101)]
    for n_raters in [1, 2, 3, 7, 12, 20, 50, 70, 100, 1000, 9973]:
        counts = rng.multinomial(n_raters, rng.dirichlet(np.full(5, 0.4), size=20))
        expected = [[exact_level(row, p) for p in positions] for row in counts]
        p = [float(position) for position in positions]
        assert _level_index(counts, np.array(p)).tolist() == expected
        assert (inverse_cdf(counts, p) - 1).tolist() == expected


@pytest.mark.parametrize(
    "n_raters", [*range(1, 200), 250, 500, 999, 1000, 2000, 4999, 10_000]
)
@pytest.mark.parametrize("as_proportions", [False, True])
def test_every_split_of_the_raters_is_exact_on_the_99_grid(n_raters, as_proportions):
    i = np.arange(1, 100)
    low = np.arange(n_raters + 1)[:, None]  # raters at the lower of two levels
    expected = ~((low > 0) & (100 * low >= i * n_raters))
    counts = np.hstack([low, n_raters - low])
    if as_proportions:
        counts = counts / n_raters
    np.testing.assert_array_equal(_level_index(counts, i / 100), expected)


def test_level_index_takes_positions_for_each_row():
    counts = np.array([[1, 1, 2], [0, 5, 5]])
    p = np.array([[0.25, 0.26], [0.5, 0.51]])
    assert _level_index(counts, p).tolist() == [[0, 1], [1, 2]]


@pytest.mark.parametrize("scale", [1e-300, 1e-12, 1.0, 1e12, 1e300])
def test_inverse_cdf_does_not_depend_on_the_scale_of_weights(scale):
    counts = np.array([[0.0, 3, 5, 4, 0], [1, 1, 1, 1, 1]])
    p = np.linspace(0, 1, 61)
    np.testing.assert_array_equal(
        inverse_cdf(counts * scale, p), inverse_cdf(counts, p)
    )


@pytest.mark.parametrize(
    "counts, p, message",
    [
        ([[1, 2]], 1.01, "p must lie within"),
        ([[1, 2]], [-0.1], "p must lie within"),
        ([[1, 2]], [[0.1, 0.2]], "1d array"),
        ([[1, 2]], np.nan, "p must lie within"),
        ([1, 2], 0.5, "Expected 2D array"),
        ([[1, 2], [0, 0]], 0.5, "no ratings in trial 1"),
        ([[1, -2]], 0.5, "negative count in trial 0"),
        ([[1, np.inf]], 0.5, "counts contains infinity"),
    ],
)
def test_inverse_cdf_errors(counts, p, message):
    with pytest.raises(ValueError, match=message):
        inverse_cdf(counts, p)


# Agreement and correlation


def test_interrater_agreement_equals_the_variance_of_the_ratings():
    rng = np.random.default_rng(1)
    ratings = rng.integers(1, 6, size=(30, 12))
    counts = (ratings[:, :, None] == np.arange(1, 6)).sum(axis=1)
    np.testing.assert_allclose(
        interrater_agreement(counts), 1 - ratings.var(axis=1, ddof=1) / 2
    )


def test_interrater_agreement_at_its_landmarks():
    agreement = interrater_agreement([[0, 12, 0, 0, 0], [6, 0, 0, 0, 6]])
    np.testing.assert_allclose(agreement, [1, 1 - 48 / 11 / 2])
    # All ratings equally frequent: zero but for the divisor N - 1.
    np.testing.assert_allclose(interrater_agreement(np.full((1, 5), 1e6)), 0, atol=1e-6)


def test_interrater_agreement_of_random_ratings_averages_to_zero():
    rng = np.random.default_rng(2)
    counts = rng.multinomial(12, np.full(5, 0.2), size=20_000)
    assert abs(interrater_agreement(counts).mean()) < 0.01


def test_interrater_agreement_needs_two_raters():
    with pytest.raises(ValueError, match="fewer than two ratings in row 1"):
        interrater_agreement([[0, 2, 0], [0, 1, 0]])


@pytest.mark.parametrize("n_adjectives", [2, 4])
def test_adjective_correlation_is_pearson_of_ranks(n_adjectives):
    ratings = np.random.default_rng(3).integers(1, 6, size=(40, n_adjectives))
    ratings[:, 1] = 6 - ratings[:, 0]
    result = adjective_correlation(ratings)
    np.testing.assert_allclose(
        result.rho, np.corrcoef(rankdata(ratings, axis=0), rowvar=False), atol=1e-12
    )
    np.testing.assert_allclose(np.diag(result.rho), 1)
    assert result.rho[0, 1] == pytest.approx(-1)
    assert result.pvalue.shape == result.rho.shape
    assert result.names.tolist() == [f"x{i}" for i in range(n_adjectives)]


@pytest.mark.parametrize("frame", [pd.DataFrame, pl.DataFrame])
def test_adjective_correlation_names_and_p_values(frame):
    table = frame({"hard": [5, 4, 2, 1, 1], "soft": [1, 2, 2, 5, 4]})
    result = adjective_correlation(table)
    assert result.names.tolist() == ["hard", "soft"]
    # Ranks less 3: (2, 1, 0, -1.5, -1.5) and (-2, -.5, -.5, 2, 1).
    rho = -9 / 9.5
    assert result.rho[0, 1] == pytest.approx(rho)
    # Student's t with 3 degrees of freedom has a CDF in closed form.
    t = abs(rho) / np.sqrt(1 - rho**2)  # over the root of 3
    p_value = 1 - 2 / np.pi * (t / (1 + t**2) + np.arctan(t))
    assert result.pvalue[0, 1] == pytest.approx(p_value)


@pytest.mark.parametrize(
    "ratings, message",
    [
        ({"hard": [1, 2, 3], "soft": [2, 2, 2]}, "All ratings of 'soft' are equal"),
        ({"hard": [1, 2, 3], "soft": [2, None, 1]}, "ratings contains NaN"),
        ({"hard": [1, 2, 3]}, "minimum of 2 is required"),
        ({"hard": [1, 2], "soft": [2, 1]}, "minimum of 3 is required"),
    ],
)
def test_adjective_correlation_errors(ratings, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        adjective_correlation(pd.DataFrame(ratings))
