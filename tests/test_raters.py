"""Tables that know raters, shrinkage, the habits of raters."""

import io

import numpy as np
import pandas as pd
import polars as pl
import pytest
from scipy.special import expit

from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.raters import (
    _Model,
    rater_effects,
    shrink_counts,
    shrinkage_strength,
)
from sklearn_haptic.ratings import RatingTable, rating_counts, rating_mean

# Tables

LONG = """object,rater,rating
tile,Ann,5
foam,Bo,1
foam,Ann,2
tile,Cy,4
tile,Bo,
"""
WIDE = """object,Ann,Bo,Cy
tile,5,,4
foam,2,1,
"""


@pytest.mark.parametrize("read", [pd.read_csv, pl.read_csv], ids=["pandas", "polars"])
def test_long_and_wide_tables_are_the_same(read):
    levels = [1, 2, 3, 4, 5]
    tables = [
        RatingTable.from_long(read(io.StringIO(LONG)), levels=levels),
        RatingTable.from_wide(read(io.StringIO(WIDE)), levels=levels),
    ]
    for table in tables:
        assert table.counts.tolist() == [[1, 1, 0, 0, 0], [0, 0, 0, 1, 1]]
        assert table.objects.tolist() == ["foam", "tile"]
        assert table.raters.tolist() == ["Ann", "Bo", "Cy"]
        assert table.answers.tolist() == [[0, 0, 1], [0, 1, 0], [1, 0, 4], [1, 2, 3]]
        assert table.counts_for(["tile"]).tolist() == [[0, 0, 0, 1, 1]]


def test_tables_from_parquet(tmp_path):
    path = tmp_path / "ratings.parquet"
    pl.read_csv(io.StringIO(LONG)).write_parquet(path)
    table = RatingTable.from_long(pl.read_parquet(path))
    assert table.counts.tolist() == [[1, 1, 0, 0], [0, 0, 1, 1]]


def test_table_of_trials_with_columns_of_other_names():
    frame = pd.DataFrame(
        {"trial": ["t2", "t1"], "who": [7, 7], "rough": ["very", "no"]}
    )
    table = RatingTable.from_long(
        frame, object="trial", rater="who", rating="rough", levels=["no", "very"]
    )
    assert table.counts_for(["t2", "t1"]).tolist() == [[0, 1], [1, 0]]
    assert table.raters.tolist() == [7]


def test_wide_table_takes_ordered_categories():
    levels = ["no", "a bit", "very"]
    frame = pd.DataFrame({"object": ["tile", "foam"], "Ann": ["no", "very"]})
    frame["Ann"] = pd.Categorical(frame["Ann"], levels, ordered=True)
    table = RatingTable.from_wide(frame)
    assert table.levels.tolist() == levels
    assert table.counts.tolist() == [[0, 0, 1], [1, 0, 0]]


def test_what_is_doubled_or_missing_is_refused():
    frame = pd.read_csv(io.StringIO(LONG))
    twice = pd.concat([frame, frame[:1]])
    with pytest.raises(ValueError, match="two of the object 'tile' by the rater 'Ann'"):
        RatingTable.from_long(twice)
    with pytest.raises(ValueError, match="raters names nobody in row 1"):
        RatingTable.from_long(frame.assign(rater=["Ann", None, "Bo", "Cy", "Di"]))
    with pytest.raises(ValueError, match="0 columns 'person' among"):
        RatingTable.from_long(frame, rater="person")
    wide = pd.read_csv(io.StringIO(WIDE))
    with pytest.raises(ValueError, match="two of the object 'foam' by the rater 'Ann'"):
        RatingTable.from_wide(pd.concat([wide, wide[1:]]))
    with pytest.raises(ValueError, match="Nobody rated the object 'cork'"):
        RatingTable.from_wide(pd.concat([wide, pd.DataFrame({"object": ["cork"]})]))
    with pytest.raises(ValueError, match="no column but 'object'"):
        RatingTable.from_wide(wide[["object"]])
    with pytest.raises(ValueError, match=r"no ratings of objects \['cork'\]"):
        RatingTable.from_wide(wide).counts_for(["tile", "cork"])


@pytest.mark.parametrize("n_objects", [1, 5_000, 100_000])
def test_table_of_many_ratings(n_objects):
    rng = np.random.default_rng(0)
    objects, raters = np.repeat(np.arange(n_objects), 3), np.tile([5, 9, 7], n_objects)
    ratings = rng.integers(1, 6, size=3 * n_objects)
    order = rng.permutation(3 * n_objects)
    table = rating_counts(
        ratings[order], objects[order], raters[order], levels=range(1, 6)
    )
    assert table.counts.sum() == 3 * n_objects
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
    assert shrinkage_strength(counts) == min(candidates, key=loss)


def test_shrunken_counts_keep_their_number_and_reach_both_ends():
    counts = np.array([[4, 0, 0], [0, 1, 1], [0, 0, 3]])
    np.testing.assert_array_equal(shrink_counts(counts, 0), counts)
    alike = shrink_counts(counts, np.inf)
    np.testing.assert_allclose(alike[0], 4 * np.array([0, 0.25, 0.75]))
    some = shrink_counts(counts, 2)
    np.testing.assert_allclose(some.sum(axis=1), counts.sum(axis=1))
    np.testing.assert_allclose(some[0] / 4, (counts[0] + 2 * alike[0] / 4) / 6)
    np.testing.assert_array_equal(
        shrink_counts(counts), shrink_counts(counts, shrinkage_strength(counts))
    )


@pytest.mark.parametrize("n_objects", [5_000, 100_000])
def test_chosen_strength_is_near_the_concentration_of_the_crowd(n_objects):
    rng = np.random.default_rng(0)
    truth = rng.dirichlet([1, 1, 2, 1], size=n_objects)
    counts = rng.multinomial(3, truth)
    assert 3 <= shrinkage_strength(counts[:5_000]) <= 8
    shrunken = shrink_counts(counts) / 3
    assert np.mean((shrunken - truth) ** 2) < np.mean((counts / 3 - truth) ** 2) / 2


# Habits of raters


def panel(n_objects, n_raters, n_each, careless=0, seed=0):
    """Answers of people with habits, and what they come from."""
    rng = np.random.default_rng(seed)
    location, shift = 2 * rng.normal(size=n_objects), rng.normal(size=n_raters)
    spread = np.exp(0.3 * rng.normal(size=n_raters))
    random = np.arange(n_raters) < careless
    objects = np.repeat(np.arange(n_objects), n_each)
    raters = np.argsort(rng.random((n_objects, n_raters)), axis=1)[:, :n_each].ravel()
    latent = location[objects] + rng.logistic(size=len(objects))
    cuts = np.array([-3, -1, 1, 3])
    ratings = np.searchsorted(cuts, shift[raters] + spread[raters] * latent)
    answers = rng.integers(5, size=len(objects))
    ratings = np.where(random[raters], answers, ratings)
    below = expit((cuts - shift[:, None]) / spread[:, None] - location[:, None, None])
    proba = np.diff(below, axis=2, prepend=0, append=1)[:, ~random].mean(axis=1)
    table = rating_counts(ratings, objects, raters, levels=range(5))
    return table, location, shift, spread, proba


def test_gradient_is_that_of_the_definition():
    table, *_ = panel(7, 5, 3)
    model = _Model(table.answers, 7, 5, 5)
    rng = np.random.default_rng(0)
    x = rng.normal(scale=0.4, size=7 + 15 + 4)
    variances = np.array([4.0, 1.0, 0.1])

    def loss(x):
        location, shift, log_spread, log_odds, cuts = model.split(x)
        value = (location @ location / 4 + shift @ shift) / 2
        value += log_spread @ log_spread / 0.1 / 2
        careless = expit(log_odds)
        value -= np.log(careless).sum() + 9 * np.log(1 - careless).sum()
        for i, j, k in table.answers:
            borders = np.r_[-np.inf, cuts, np.inf]
            z = (borders[k : k + 2] - shift[j]) / np.exp(log_spread[j]) - location[i]
            careful = expit(z[1]) - expit(z[0])
            value -= np.log((1 - careless[j]) * careful + careless[j] / 5)
        return value

    value, gradient = model.loss(x, variances)
    assert value == pytest.approx(loss(x), rel=1e-12)
    steps = 1e-6 * np.eye(len(x))
    numeric = [(loss(x + step) - loss(x - step)) / 2e-6 for step in steps]
    np.testing.assert_allclose(gradient, numeric, atol=1e-6)


def test_habits_are_recovered():
    table, location, shift, spread, _ = panel(400, 20, 10, careless=3)
    effects = rater_effects(table)
    careful = slice(3, None)
    assert np.corrcoef(effects.location, location)[0, 1] > 0.9
    assert np.corrcoef(effects.shift[careful], shift[careful])[0, 1] > 0.97
    assert np.corrcoef(effects.spread[careful], spread[careful])[0, 1] > 0.9
    assert effects.careless[:3].min() > 0.4 > 0.15 > effects.careless[careful].max()
    assert (np.diff(effects.thresholds) > 0).all()


@pytest.mark.parametrize("careless", [0, 3])
def test_three_raters_are_worth_more_than_their_counts(careless):
    table, *_, truth = panel(150, 15, 3, careless)
    effects = rater_effects(table)
    np.testing.assert_allclose(effects.counts.sum(axis=1), 3)
    floor = ranked_probability_score(truth, truth)
    raw, shrunken, robust = (
        ranked_probability_score(truth, counts / 3) - floor
        for counts in (table.counts, shrink_counts(table.counts), effects.counts)
    )
    # Three people drawn from the truth are off by a third of its own score.
    assert robust < shrunken < raw
    assert robust < floor / 3


def test_panel_of_extreme_answers_stays_finite():
    same = rating_counts(
        [1, 1, 5, 5], ["a", "a", "b", "b"], [1, 2] * 2, levels=range(1, 6)
    )
    effects = rater_effects(same)
    for values in (effects.shift, effects.spread, effects.location, effects.counts):
        assert np.isfinite(values).all()
    np.testing.assert_allclose(effects.shift[0], effects.shift[1], atol=1e-3)


def test_panel_without_raters_is_refused():
    with pytest.raises(ValueError, match="table does not know its raters"):
        rater_effects(rating_counts([1, 2], ["a", "b"]))
    with pytest.raises(ValueError, match="2 objects, 1 raters and 2 levels"):
        rater_effects(rating_counts([1, 2], ["a", "b"], ["Ann", "Ann"]))


@pytest.mark.slow
def test_panel_of_many_answers():
    """Six answers leave an error of 0.7 beside a spread of 2, a correlation of 0.94."""
    table, location, *_ = panel(5_000, 100, 6)
    effects = rater_effects(table)
    found = np.corrcoef(effects.location, location)[0, 1]
    assert found > 0.9
    assert found > np.corrcoef(rating_mean(table.counts), location)[0, 1] + 0.02
