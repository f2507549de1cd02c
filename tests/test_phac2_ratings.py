"""`load_phac2(ratings=…)` given tables of answers or counts, beside plain loops."""

import numpy as np
import pandas as pd
import pytest
from test_phac2 import write_trial

from sklearn_haptic.datasets import load_phac2
from sklearn_haptic.ratings import RatingTable, adjective_correlation, rating_counts

h5py = pytest.importorskip("h5py")

OBJECT_OF = {
    "cup_7_01": 7,
    "sponge_114_02": 114,
    "sponge_114_10": 114,
    "mat_602_01": 602,
}
TRIALS = list(OBJECT_OF)
ADJECTIVES = ["springy", "bouncy", "hard"]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("corpus") / "corpus.h5"
    with h5py.File(path, "w") as file:
        for seed, name in enumerate(OBJECT_OF):
            write_trial(file, name, seed=seed)
    return path


@pytest.fixture
def answers():
    """Nine raters, of whom some leave out a rating, in any order of objects."""
    rng = np.random.default_rng(0)
    rows = [
        (object_id, rater, adjective, rng.choice([1, 2, 3, 4, 5, np.nan]))
        for adjective in ADJECTIVES
        for object_id in rng.permutation([7, 114, 602])
        for rater in rng.permutation(9)
    ]
    return pd.DataFrame(rows, columns=["object", "rater", "adjective", "rating"])


def load(path, ratings):
    return load_phac2(path, sensors=["pdc"], trials=TRIALS, ratings=ratings)


def assert_counted(corpus, answers, levels=range(1, 6)):
    """Compare the counts of each trial with those of a plain loop."""
    assert list(corpus.ratings) == ADJECTIVES
    assert len(corpus.levels) == len(levels)
    for adjective, counts in corpus.ratings.items():
        assert counts.dtype == np.int64
        for row, object_id in zip(counts, OBJECT_OF.values()):
            expected = [0] * len(levels)
            for which, _, of, rating in answers.itertuples(index=False):
                if which == object_id and of == adjective and rating in levels:
                    expected[levels.index(rating)] += 1
            assert row.tolist() == expected


@pytest.mark.parametrize("dtype", [object, float, "Int64", "category"])
def test_answers_of_any_type(path, answers, dtype):
    given = answers.assign(rating=answers["rating"].astype(dtype))
    load(path, given).levels[:] = 0  # which later corpora do not share
    assert_counted(load(path, given.astype({"object": object})), answers)


def test_answers_of_polars(path, answers):
    polars = pytest.importorskip("polars")
    table = polars.DataFrame(answers.to_dict("list")).fill_nan(None)
    assert_counted(load(path, table), answers)
    words = polars.Enum(["none", "little", "some", "much", "all"])
    names = dict(zip([1.0, 2.0, 3.0, 4.0, 5.0], words.categories))
    column = table["rating"].replace_strict(names, default=None, return_dtype=words)
    corpus = load(path, table.with_columns(rating=column))
    assert_counted(corpus, answers)
    assert corpus.levels.tolist() == words.categories.to_list()


@pytest.mark.parametrize("missing", ["", "NA", "NaN"])
def test_csv(path, answers, tmp_path, missing):
    file = tmp_path / "answers.txt"
    given = answers.assign(
        rater=answers["rater"].map("{:03}".format),
        comment='a "comment",\nof two lines',
        rating=answers["rating"].astype("Int64"),
    )
    given.to_csv(file, index=False, na_rep=missing, encoding="utf-8-sig")
    for each in (file, str(file)):
        corpus = load(path, each)
        assert_counted(corpus, answers)
    raters = corpus.rater_ratings.index.levels[1]
    assert raters.tolist() == [f"{rater:03}" for rater in range(9)]


def test_answers_in_ordered_words(path, answers):
    """In the order of the categories, also those that nobody chose."""
    words = ["never", "hardly", "somewhat", "mostly", "much", "always"]
    codes = answers["rating"].fillna(0).astype(int) - 1
    column = pd.Categorical.from_codes(codes, words, ordered=True)
    corpus = load(path, answers.assign(rating=column))
    assert corpus.levels.tolist() == words
    assert_counted(corpus, answers, range(1, 7))
    people = corpus.rater_ratings
    again = rating_counts(people["hard"], people.index.get_level_values("object"))
    assert again.levels.tolist() == words
    again = again.counts_for([*OBJECT_OF.values()]).to_numpy()
    np.testing.assert_array_equal(again, corpus.ratings["hard"])


def test_answers_stay_available(path, answers):
    people = load(path, answers).rater_ratings
    assert people.index.names == ["object", "rater"]
    assert people.index.is_monotonic_increasing
    assert list(people) == ADJECTIVES
    for row in answers.dropna().itertuples():
        assert people.loc[(row.object, row.rater), row.adjective] == row.rating
    assert people.count().sum() == answers["rating"].count()
    both = answers.pivot(index=["object", "rater"], columns="adjective")["rating"]
    expected = both[["springy", "hard"]].corr("spearman").iloc[0, 1]
    rho = adjective_correlation(people).rho
    np.testing.assert_allclose(rho.loc["springy", "hard"], expected, rtol=1e-12)
    some = load_phac2(path, sensors=["pdc"], trials=TRIALS[:1], ratings=answers)
    assert set(some.rater_ratings.index.get_level_values("object")) == {7}


def test_counts(path, answers):
    """Tables that know the raters, or not, and counts with labels in any order."""
    tables = {
        adjective: RatingTable.from_long(own, levels=range(1, 6))
        for adjective, own in answers.groupby("adjective", sort=False)
    }
    corpus = load(path, tables)
    assert_counted(corpus, answers)
    expected = load(path, answers).rater_ratings
    pd.testing.assert_frame_equal(corpus.rater_ratings, expected)
    table = tables["hard"]
    frame = pd.DataFrame(table.counts, table.objects, table.levels)
    for same in (
        frame.iloc[::-1, [3, 1, 0, 4, 2]].add_prefix("n"),
        frame.set_axis([*"12345"], axis=1),
    ):
        corpus = load(path, tables | {"hard": same})
        assert_counted(corpus, answers)
        assert corpus.rater_ratings is None


@pytest.mark.parametrize("last", [6.5, 1e19])
def test_counts_of_other_levels(path, last):
    words = pd.CategoricalIndex(["some", "all"], ["none", "some", "all"], ordered=True)
    table = pd.DataFrame([[1, 2], [3, 4], [5, last]], [602, 114, 7], words)
    corpus = load(path, {"hard": table})
    assert corpus.levels.tolist() == ["none", "some", "all"]
    expected = [[0, 5, last], [0, 3, 4], [0, 3, 4], [0, 1, 2]]
    np.testing.assert_array_equal(corpus.ratings["hard"], expected)


def test_objects_that_nobody_rated_may_be_left_out(path, answers):
    counts = pd.DataFrame([[1, 2], [0, 0], [3, 4]], [7, 114, 602])
    options = {"sensors": ["pdc"], "trials": TRIALS[:1] + TRIALS[3:]}
    found = load_phac2(path, ratings={"hard": counts}, **options).ratings["hard"]
    np.testing.assert_array_equal(found, [[1, 2], [3, 4]])
    with pytest.raises(ValueError, match=r"\['hard'\] has no ratings of objects .114."):
        load(path, {"hard": counts})
