"""Tables that know raters, and shrinkage of the counts of few."""

import io

import numpy as np
import pandas as pd
import polars as pl
import pytest

from sklearn_haptic import NNPOM, DummyDistribution
from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.ratings import (
    RatingTable,
    inverse_cdf,
    rating_counts,
    shrink_counts,
)

# Tables

LONG = """object,rater,rating
tile,Ann,5
foam,Bo,1
foam,Ann,2
tile,Cy,4
tile,Bo,
"""


@pytest.mark.parametrize("read", [pd.read_csv, pl.read_csv], ids=["pandas", "polars"])
def test_tables_of_pandas_and_polars(read):
    levels = [1, 2, 3, 4, 5]
    table = RatingTable.from_long(read(io.StringIO(LONG)), levels=levels)
    assert table.counts.to_numpy().tolist() == [[1, 1, 0, 0, 0], [0, 0, 0, 1, 1]]
    assert table.objects.tolist() == ["foam", "tile"]
    assert table.raters.tolist() == ["Ann", "Bo", "Cy"]
    assert table.answers.tolist() == [[0, 0, 1], [0, 1, 0], [1, 0, 4], [1, 2, 3]]
    assert table.counts_for(["tile"]).to_dict("list") == dict(
        zip(levels, [[0], [0], [0], [1], [1]])
    )


def test_table_of_trials_with_columns_of_other_names():
    frame = pd.DataFrame(
        {"trial": ["t2", "t1"], "who": [7, 7], "rough": ["very", "no"]}
    )
    table = RatingTable.from_long(
        frame, object="trial", rater="who", rating="rough", levels=["no", "very"]
    )
    expected = {"no": [0, 1], "very": [1, 0]}
    assert table.counts_for(["t2", "t1"]).to_dict("list") == expected
    assert table.raters.tolist() == [7]


@pytest.mark.parametrize(
    "levels", [[-3, 0, 3], [0.5, 1.0, 7.0], [3, 2, 1], ["no", "so", "very"], [*"cab"]]
)
def test_a_model_knows_the_levels_of_counts(levels):
    """Without being told, in their order, also those that nobody chose."""
    ratings, objects = np.take(levels, [0, 0, 2, 2, 0]), [*"aabbb"]
    table = rating_counts(ratings, objects, levels=levels)
    trials = pd.Series([*"bab"], index=[7, 8, 9])
    y = table.counts_for(trials)
    assert y.index.tolist() == [7, 8, 9]
    assert y.to_numpy().tolist() == [[1, 0, 2], [2, 0, 0], [1, 0, 2]]
    model = DummyDistribution().fit(np.zeros((3, 1)), y)
    assert model.levels_.tolist() == levels
    told = DummyDistribution(levels=levels).fit(np.zeros((3, 1)), y.to_numpy())
    assert (model.predict_proba([[0]]) == told.predict_proba([[0]])).all()
    assert (inverse_cdf(y, 0.9) == np.take(levels, [2, 0, 2])).all()


def test_rows_of_objects_in_place_of_trials_are_told_apart():
    table = rating_counts([1, 2], ["a", "b"])
    with pytest.raises(ValueError, match=r"\[3, 2\]; give y one row .*counts_for\("):
        NNPOM().fit(np.zeros((3, 1)), table.counts)


@pytest.mark.parametrize("n_objects", [1, 5_000])
def test_table_of_many_ratings(n_objects):
    rng = np.random.default_rng(0)
    objects, raters = np.repeat(np.arange(n_objects), 3), np.tile([5, 9, 7], n_objects)
    ratings = rng.integers(1, 6, size=3 * n_objects)
    order = rng.permutation(3 * n_objects)
    table = rating_counts(
        ratings[order], objects[order], raters[order], levels=range(1, 6)
    )
    assert table.counts.to_numpy().sum() == 3 * n_objects
    by_rater = ratings.reshape(-1, 3)[:, [0, 2, 1]]
    np.testing.assert_array_equal(table.answers[:, 2], by_rater.ravel() - 1)


# Shrinkage


def test_strength_is_that_of_a_plain_loop():
    rng = np.random.default_rng(0)
    counts = rng.multinomial(4, rng.dirichlet(np.ones(4), size=12))
    counts[3] = [1, 0, 0, 0]  # cannot be left out
    shares = counts / counts.sum(axis=1, keepdims=True)

    def loss(strength):
        total = 0
        for i, row in enumerate(counts):
            others = np.delete(shares, i, axis=0).mean(axis=0)
            if row.sum() < 2:
                continue
            for level, n in enumerate(row):
                if n:
                    left = row - np.eye(4)[level]
                    proba = (left + strength * others) / (left.sum() + strength)
                    rps = ranked_probability_score([level], [proba], levels=range(4))
                    total += n / row.sum() * rps
        return total

    candidates = [0, *2.0 ** np.arange(-3, 11, 0.5)]
    expected = shrink_counts(counts, min(candidates, key=loss))
    np.testing.assert_array_equal(shrink_counts(counts), expected)


def test_shrunken_counts_keep_their_number_and_reach_both_ends():
    counts = np.array([[4, 0, 0], [0, 1, 1], [0, 0, 3]])
    np.testing.assert_array_equal(shrink_counts(counts, 0), counts)
    alike = shrink_counts(counts, np.inf)
    np.testing.assert_allclose(alike[0], 4 * np.array([0, 0.25, 0.75]))
    some = shrink_counts(counts, 2)
    np.testing.assert_allclose(some.sum(axis=1), counts.sum(axis=1))
    np.testing.assert_allclose(some[0] / 4, (counts[0] + 2 * alike[0] / 4) / 6)


def test_chosen_strength_is_near_the_concentration_of_the_crowd():
    rng = np.random.default_rng(0)
    truth = rng.dirichlet([1, 1, 2, 1], size=5_000)
    counts = rng.multinomial(3, truth)
    shrunken = shrink_counts(counts) / 3
    assert np.mean((shrunken - truth) ** 2) < np.mean((counts / 3 - truth) ** 2) / 2


def test_percentages_are_no_people_to_shrink():
    counts = np.array([[2, 1, 1], [0, 1, 3], [1, 1, 2]])
    with pytest.warns(
        UserWarning, match=r"^counts has rows that sum to 100, which are"
    ):
        shrink_counts(25 * counts)
    with pytest.raises(ValueError, match=r"^counts has rows that sum to 1, which"):
        shrink_counts(counts / 4, strength=1)
