"""`load_phac2(ratings=…)` given tables of answers or counts, beside a plain loop."""

from collections import Counter

import numpy as np
import pandas as pd
import pytest
from test_phac2 import write_trial

from sklearn_haptic.datasets import load_phac2
from sklearn_haptic.datasets._rated import ADJECTIVES, ratings_of_trials
from sklearn_haptic.datasets._rating_tables import count_answers, read_csv
from sklearn_haptic.ratings import adjective_correlation, rating_counts

h5py = pytest.importorskip("h5py")

OBJECT_OF = {
    "cup_7_01": 7,
    "sponge_114_02": 114,
    "sponge_114_10": 114,
    "mat_602_01": 602,
}
TRIALS = list(OBJECT_OF)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("corpus") / "corpus.h5"
    with h5py.File(path, "w") as file:
        for seed, name in enumerate(OBJECT_OF):
            write_trial(file, name, seed=seed)
    return path


@pytest.fixture
def answers():
    """Nine raters, of whom some leave out a rating, in any order."""
    rng = np.random.default_rng(0)
    rows = [
        (
            object_id,
            rater,
            adjective,
            rng.integers(1, 6) if rng.random() > 0.1 else None,
        )
        for object_id in (7, 114, 602)
        for rater in range(1, 10)
        for adjective in ("springy", "bouncy", "hard")
    ]
    table = pd.DataFrame(rows, columns=["object", "rater", "adjective", "rating"])
    return table.sample(frac=1, random_state=0).reset_index(drop=True)


def load(path, ratings, **options):
    return load_phac2(path, sensors=["pdc"], trials=TRIALS, ratings=ratings, **options)


def counted(rows, adjective, levels=range(1, 6), trials=TRIALS, object_of=OBJECT_OF):
    """Count the answers of each trial's object by a plain loop."""
    counts = Counter()
    for object_id, _, of, rating in rows:
        if of == adjective and rating == rating and rating is not None:
            counts[object_id, rating] += 1
    return [[counts[object_of[trial], level] for level in levels] for trial in trials]


def assert_counted(corpus, rows, levels=range(1, 6)):
    assert list(corpus.ratings) == ["hard", "springy", "bouncy"]
    for adjective, counts in corpus.ratings.items():
        np.testing.assert_array_equal(counts, counted(rows, adjective, levels))
        assert counts.dtype == np.int64
    np.testing.assert_array_equal(corpus.levels, list(levels))


@pytest.mark.parametrize("dtype", [object, int, float, str, "string", "0000"])
def test_ids_of_any_type(path, answers, dtype):
    rows = [*answers.itertuples(index=False)]
    ids = answers["object"]
    ids = ids.map("{:05d}".format) if dtype == "0000" else ids.astype(dtype)
    assert_counted(load(path, answers.assign(object=ids)), rows)


@pytest.mark.parametrize("dtype", [object, float, "Int64", "category"])
def test_ratings_of_any_type(path, answers, dtype):
    rows = [*answers.itertuples(index=False)]
    given = answers.assign(rating=answers["rating"].astype(float).astype(dtype))
    assert_counted(load(path, given), rows)


def test_polars(path, answers):
    polars = pytest.importorskip("polars")
    rows = [*answers.itertuples(index=False)]
    answers["rating"] = (
        answers["rating"].astype(object).where(answers["rating"] > 0, None)
    )
    table = polars.DataFrame(answers.to_dict("list"), strict=False)
    assert_counted(load(path, table), rows)
    words = polars.Enum(["a little", "somewhat", "much"])
    first = table.filter(polars.col("rating") <= 3).with_columns(
        rating=polars.col("rating").map_elements(
            lambda rating: words.categories[int(rating) - 1],
            return_dtype=polars.String,
        )
    )
    corpus = load(path, first.with_columns(rating=first["rating"].cast(words)))
    few = [row for row in rows if row.rating is not None and row.rating <= 3]
    for adjective, counts in corpus.ratings.items():
        np.testing.assert_array_equal(counts, counted(few, adjective, range(1, 4)))
    assert corpus.levels.tolist() == ["a little", "somewhat", "much"]


@pytest.mark.parametrize("missing", ["", "NA", "NaN"])
def test_csv(path, answers, tmp_path, missing):
    rows = [*answers.itertuples(index=False)]
    file = tmp_path / "Answers.CSV"
    answers["comment"] = 'a "comment",\nof two lines'
    answers.to_csv(file, index=False, na_rep=missing, encoding="utf-8-sig")
    corpus = load(path, file)
    assert_counted(corpus, rows)
    assert_counted(load(path, str(file)), rows)
    from_table = load(path, answers)
    assert corpus.rater_ratings.index.levels[1].tolist() == [*"123456789"]  # as text
    np.testing.assert_array_equal(corpus.rater_ratings, from_table.rater_ratings)


def test_text_of_a_csv_file_stays_text(tmp_path):
    lines = "rating,rater,note,adjective,object\n1e5,007,,null,114\r\n\n nan,x,a,b, 7\n"
    (tmp_path / "a.csv").write_text(lines, newline="")
    table = read_csv(tmp_path / "a.csv")
    assert list(table) == ["object", "rater", "adjective", "rating"]
    rows = [["114", "007", "null", "1e5"], [" 7", "x", "b", " nan"]]
    assert table.to_numpy().tolist() == rows


def test_ordered_words(path, answers):
    """In the order of the categories, also those that nobody chose."""
    words = ["never", "hardly", "somewhat", "mostly", "much", "always"]
    rows = [*answers.itertuples(index=False)]
    column = answers["rating"].map(lambda k: words[int(k) - 1] if k == k else None)
    column = pd.Categorical(column, words, ordered=True)
    corpus = load(path, answers.assign(rating=column))
    assert corpus.levels.tolist() == words
    for adjective, counts in corpus.ratings.items():
        np.testing.assert_array_equal(counts, counted(rows, adjective, range(1, 7)))
    people = corpus.rater_ratings
    again = rating_counts(people["hard"], people.index.get_level_values("object"))
    np.testing.assert_array_equal(again.levels, words)
    np.testing.assert_array_equal(
        again.counts_for([OBJECT_OF[trial] for trial in TRIALS]), corpus.ratings["hard"]
    )


def test_answers_stay_available(path, answers):
    people = load(path, answers).rater_ratings
    assert people.index.names == ["object", "rater"]
    assert people.index.is_monotonic_increasing
    assert list(people) == ["hard", "springy", "bouncy"]
    for object_id, rater, adjective, rating in answers.itertuples(index=False):
        found = people.loc[(object_id, rater), adjective]
        assert found == rating or (np.isnan(found) and np.isnan(rating))
    both = answers.pivot(index=["object", "rater"], columns="adjective")["rating"]
    expected = both.astype(float)[["hard", "springy"]].corr("spearman").iloc[0, 1]
    rho = adjective_correlation(people).rho
    np.testing.assert_allclose(rho[0, 1], expected, rtol=1e-12)
    some = load_phac2(path, sensors=["pdc"], trials=TRIALS[:1], ratings=answers)
    assert set(some.rater_ratings.index.get_level_values("object")) == {7}


def test_ratings_by_trial(path):
    """Each trial has its own, and a person may rate two trials of an object."""
    rng = np.random.default_rng(0)
    rows = [
        (trial, rater, "hard", rng.integers(1, 6)) for trial in TRIALS for rater in "ab"
    ]
    table = pd.DataFrame(rows, columns=["trial", "rater", "adjective", "rating"])
    corpus = load(path, table.sample(frac=1, random_state=0))
    own = {trial: trial for trial in TRIALS}
    expected = counted(rows, "hard", object_of=own)
    np.testing.assert_array_equal(corpus.ratings["hard"], expected)
    assert corpus.rater_ratings.index.names == ["trial", "rater"]
    assert len(corpus.rater_ratings) == 8


def test_counts(path, answers):
    """A RatingTable, and tables with rows and columns in any order."""
    rows = [*answers.itertuples(index=False)]
    tables = {}
    for adjective in ("hard", "springy", "bouncy"):
        own = answers[answers["adjective"] == adjective]
        tables[adjective] = rating_counts(
            own["rating"], own["object"].astype(str), levels=range(1, 6)
        )
    corpus = load(path, tables)
    assert_counted(corpus, rows)
    assert corpus.rater_ratings is None
    frames = {
        adjective: pd.DataFrame(table.counts, table.objects, table.levels)
        for adjective, table in tables.items()
    }
    frames["hard"] = frames["hard"].iloc[::-1, [3, 1, 0, 4, 2]].add_prefix("n")
    frames["springy"] = frames["springy"].set_axis([*"12345"], axis=1)
    assert_counted(load(path, tables | frames), rows)


def test_counts_of_other_levels(path):
    columns = pd.CategoricalIndex(
        ["some", "all"], ["none", "some", "all"], ordered=True
    )
    table = pd.DataFrame([[1, 2], [3, 4], [5, 6.5]], [602, 114, 7], columns)
    corpus = load(path, {"hard": table})
    assert corpus.levels.tolist() == ["none", "some", "all"]
    np.testing.assert_array_equal(
        corpus.ratings["hard"], [[0, 5, 6.5], [0, 3, 4], [0, 3, 4], [0, 1, 2]]
    )


def test_a_hundred_thousand_answers():
    rng = np.random.default_rng(0)
    n_objects, n_raters, n_adjectives = 1000, 10, 10
    grid = np.indices((n_objects, n_raters, n_adjectives)).reshape(3, -1)
    order = rng.permutation(grid.shape[1])
    object_ids, raters, adjectives = grid[:, order]
    ratings = rng.integers(1, 6, grid.shape[1])
    table = pd.DataFrame(
        {
            "object": object_ids,
            "rater": raters,
            "adjective": np.take(ADJECTIVES, adjectives),
            "rating": ratings,
        }
    )
    object_of = {f"x_{i}_1": i for i in range(n_objects)}
    rated = count_answers(table, "ratings")
    found, people = ratings_of_trials(rated, object_of, object_of)
    expected = np.zeros((n_objects, n_adjectives, 5), dtype=int)
    for row, adjective, rating in zip(object_ids, adjectives, ratings):
        expected[row, adjective, rating - 1] += 1
    for i, adjective in enumerate(ADJECTIVES):
        np.testing.assert_array_equal(found[adjective], expected[:, i])
    assert people.shape == (n_objects * n_raters, n_adjectives)
