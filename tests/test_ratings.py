from fractions import Fraction
from itertools import permutations

import numpy as np
import pandas as pd
import polars as pl
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import rankdata, spearmanr

from sklearn_haptic.ratings import (
    RatingTable,
    adjective_correlation,
    interrater_agreement,
    inverse_cdf,
    outlying_raters,
    rating_cdf,
    rating_counts,
    rating_distribution,
    rating_mean,
    shrink_counts,
)
from sklearn_haptic.ratings._correlation import _holm
from sklearn_haptic.ratings._distributions import level_at


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
        pd.Series([1, 2, pd.NA, 5, 2], dtype=object),
        [1, 2, pd.NA, 5, 2],
        pd.array([1, 2, None, 5, 2], dtype="Int64"),
        pl.Series([1, 2, None, 5, 2]),
        pl.Series([1.0, 2.0, float("nan"), 5.0, 2.0]),
    ],
    ids=[
        *("list", "array", "float", "Int64", "category", "object", "NA", "extension"),
        *("polars", "polars float"),
    ],
)
def test_rating_counts_leaves_out_missing_ratings(column):
    objects = np.array(["tile", "foam", "foam", "foam", "foam"])
    table = rating_counts(column, objects, levels=[1, 2, 3, 4, 5])
    assert table.counts.to_numpy().tolist() == [[0, 2, 0, 0, 1], [1, 0, 0, 0, 0]]
    assert table.objects.tolist() == ["foam", "tile"]
    assert table.levels.tolist() == [1, 2, 3, 4, 5]
    assert rating_counts(column, objects).levels.tolist() == [1, 2, 5]


def test_rating_counts_keeps_the_order_of_named_and_half_levels():
    table = rating_counts(
        ["very", "no", "a bit", "no"], [7, 7, 3, 3], levels=["no", "a bit", "very"]
    )
    assert table.counts.to_numpy().tolist() == [[1, 1, 0], [1, 0, 1]]
    assert table.objects.tolist() == [3, 7]
    table = rating_counts([0.5, 4.5, 0.5], [0, 0, 0], levels=[0.5, 2.5, 4.5])
    assert table.counts.to_numpy().tolist() == [[2, 0, 1]]


@pytest.mark.parametrize(
    "column",
    [
        ["very", "no", float("nan"), "no"],
        np.array(["very", "no", None, "no"], dtype=object),
        pd.Series(["very", "no", None, "no"]),
        pd.Series(["very", "no", np.nan, "no"], dtype=object),
        pd.Series(["very", "no", None, "no"], dtype="category"),
        pl.Series(["very", "no", None, "no"]),
        pl.Series(["very", "no", None, "no"], dtype=pl.Categorical),
    ],
    ids=["list", "array", "str", "object", "category", "polars", "polars category"],
)
def test_rating_counts_of_named_levels_with_missing_ratings(column):
    table = rating_counts(column, [7, 7, 7, 3], levels=["no", "a bit", "very"])
    assert table.counts.to_numpy().tolist() == [[1, 0, 0], [1, 0, 1]]


def test_counts_of_one_level_are_not_given_as_if_they_were_ratings():
    with pytest.raises(ValueError, match=r"All ratings are 3, .*; list all levels"):
        rating_counts([3, 3, 3], ["a", "a", "b"]).counts_for(["a", "b"])
    table = rating_counts([3, 3, 3], ["a", "a", "b"], levels=[1, 2, 3])
    assert table.counts_for(["b", "a"]).to_numpy().tolist() == [[0, 0, 1], [0, 0, 2]]


def test_rating_counts_takes_the_order_of_ordered_categories():
    levels = ["no", "a bit", "very"]
    column = pd.Series(pd.Categorical(["very", "no", None], levels, ordered=True))
    table = rating_counts(column, ["a", "a", "a"])
    assert table.levels.tolist() == levels
    assert table.counts.to_numpy().tolist() == [[1, 0, 1]]
    assert rating_counts(
        column, ["a"] * 3, levels=["very", "no"]
    ).counts.to_numpy().tolist() == [[1, 1]]


def test_rating_counts_agrees_with_a_published_table(shared_data):
    long = pd.read_csv(shared_data / "tactile_ratings" / "ratings_long.csv")
    wide = pd.read_csv(shared_data / "tactile_ratings" / "counts.csv")
    for (condition, metric), rows in long.groupby(["Condition", "Metric"]):
        table = rating_counts(rows.level5, rows.Texture)
        same = (wide.Condition == condition) & (wide.Metric == metric)
        expected = wide[same].set_index("Texture").loc[table.objects]
        assert_array_equal(table.counts, expected[["n1", "n2", "n3", "n4", "n5"]])


# Distribution and CDF


def test_distribution_and_cdf_by_hand():
    counts = [[0, 3, 6, 3, 0], [1, 1, 1, 0, 0], [7, 0, 0, 0, 0]]
    expected = [
        [0, 1 / 4, 1 / 2, 1 / 4, 0],
        [1 / 3, 1 / 3, 1 / 3, 0, 0],
        [1, 0, 0, 0, 0],
    ]
    assert rating_distribution(counts).tolist() == expected
    expected = [[0, 1 / 4, 3 / 4, 1, 1], [1 / 3, 2 / 3, 1, 1, 1], [1, 1, 1, 1, 1]]
    assert rating_cdf(counts).tolist() == expected


@pytest.mark.parametrize("n_raters", [1, 3, 7, 12, 49, 1000])
def test_cdf_is_the_nearest_double_and_ends_in_one(n_raters):
    rng = np.random.default_rng(n_raters)
    counts = rng.multinomial(n_raters, [0.1, 0.2, 0.4, 0.2, 0.1], size=200)
    expected = [
        [float(Fraction(int(below), n_raters)) for below in np.cumsum(row)]
        for row in counts
    ]
    cdf = rating_cdf(counts)
    assert cdf.tolist() == expected
    assert (cdf[:, -1] == 1).all()


@pytest.mark.parametrize("scale", [1e-300, 0.1, 1e300])
def test_cdf_of_weights_ends_in_one_and_is_the_sum_of_the_distribution(scale):
    weights = np.random.default_rng(0).dirichlet(np.ones(7), size=500) * scale
    cdf = rating_cdf(weights)
    assert (cdf[:, -1] == 1).all()
    assert (np.diff(cdf, axis=1) >= 0).all()
    proba = rating_distribution(weights)
    assert_allclose(np.cumsum(proba, axis=1), cdf, atol=1e-15)


@pytest.mark.parametrize(
    "levels", [range(-3, 4), np.arange(1, 4.25, 0.5), [0, 25, 50, 75, 90, 95, 100]]
)
def test_tables_of_counts_are_labelled_with_objects_and_levels(levels):
    rng = np.random.default_rng(0)
    answers = rng.choice(levels, (9, 50), p=[0, 0.1, 0.2, 0.1, 0.3, 0.3, 0])
    objects = np.array([*"ihgfedcba"])
    table = rating_counts(answers.ravel(), np.repeat(objects, 50), levels=levels)
    assert [*table.counts.index] == sorted(objects)
    of_object = answers[::-1]
    mean = of_object.mean(axis=1)
    pooled = (50 * mean + 3 * (mean.sum() - mean) / 8) / 53
    median = np.quantile(of_object, 0.5, axis=1, method="inverted_cdf")
    for counts in (
        table.counts,
        table.counts.iloc[:, ::-1],
        table.counts_for(sorted(objects)),
        pl.from_pandas(table.counts.set_axis([f"{x:g}" for x in levels], axis=1)),
    ):
        share = rating_distribution(counts)
        assert [*rating_cdf(counts).columns] == [*share.columns] == [*levels]
        assert_allclose(rating_mean(counts), mean)
        assert_allclose(rating_mean(share), mean)
        assert_allclose(rating_mean(shrink_counts(counts, 3)), pooled)
        for each in (counts, share):
            assert_array_equal(inverse_cdf(each, 0.5), median)


def test_words_label_shares_in_their_order():
    answers = pd.Categorical(["low", "high", "low"], ["low", "mid", "high"])
    table = rating_counts(answers.as_ordered(), ["a", "a", "b"])
    share = rating_distribution(table.counts)
    assert inverse_cdf(share, 1).tolist() == ["high", "low"]
    assert inverse_cdf(shrink_counts(table.counts, 1), 0).tolist() == ["low", "low"]


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


@pytest.mark.slow
def test_inverse_cdf_equals_exact_fractions():
    rng = np.random.default_rng(0)
    positions = [Fraction(i, 100) for i in range(101)]
    for n_raters in [1, 2, 3, 7, 12, 20, 50, 70, 100, 1000, 9973]:
        counts = rng.multinomial(n_raters, rng.dirichlet(np.full(5, 0.4), size=20))
        expected = [[exact_level(row, p) for p in positions] for row in counts]
        p = [float(position) for position in positions]
        assert level_at(counts, np.array(p)).tolist() == expected
        assert (inverse_cdf(counts, p) - 1).tolist() == expected


@pytest.mark.slow
@pytest.mark.parametrize("as_proportions", [False, True])
def test_every_split_of_the_raters_is_exact_on_the_99_grid(as_proportions):
    i = np.arange(1, 100)
    for n_raters in [*range(1, 200), 250, 500, 999, 1000, 2000, 4999, 10_000]:
        low = np.arange(n_raters + 1)[:, None]  # raters at the lower of two levels
        expected = ~((low > 0) & (100 * low >= i * n_raters))
        counts = np.hstack([low, n_raters - low])
        if as_proportions:
            counts = counts / n_raters
        assert_array_equal(level_at(counts, i / 100), expected)


def test_level_at_takes_positions_for_each_row():
    counts = np.array([[1, 1, 2], [0, 5, 5]])
    p = np.array([[0.25, 0.26], [0.5, 0.51]])
    assert level_at(counts, p).tolist() == [[0, 1], [1, 2]]


@pytest.mark.parametrize("scale", [1e-300, 1e-12, 1.0, 1e12, 1e300])
def test_inverse_cdf_does_not_depend_on_the_scale_of_weights(scale):
    counts = np.array([[0.0, 3, 5, 4, 0], [1, 1, 1, 1, 1]])
    p = np.linspace(0, 1, 61)
    assert_array_equal(inverse_cdf(counts * scale, p), inverse_cdf(counts, p))


# Agreement and correlation


def test_interrater_agreement_equals_the_variance_of_the_ratings():
    rng = np.random.default_rng(1)
    ratings = rng.integers(1, 6, size=(30, 12))
    counts = (ratings[:, :, None] == np.arange(1, 6)).sum(axis=1)
    assert_allclose(interrater_agreement(counts), 1 - ratings.var(axis=1, ddof=1) / 2)


@pytest.mark.parametrize("n_adjectives", [2, 4])
def test_adjective_correlation_is_pearson_of_ranks(n_adjectives):
    ratings = np.random.default_rng(3).integers(1, 6, size=(40, n_adjectives))
    ratings[:, 1] = 6 - ratings[:, 0]
    result = adjective_correlation(ratings)
    assert_allclose(
        result.rho, np.corrcoef(rankdata(ratings, axis=0), rowvar=False), atol=1e-12
    )
    assert_allclose(np.diag(result.rho), 1)
    assert result.rho.iat[0, 1] == pytest.approx(-1)
    assert result.pvalue.shape == result.rho.shape
    assert result.rho.columns.tolist() == [f"x{i}" for i in range(n_adjectives)]


@pytest.mark.parametrize("frame", [pd.DataFrame, pl.DataFrame])
def test_adjective_correlation_names_and_p_values(frame):
    table = frame({"hard": [5, 4, 2, 1, 1], "soft": [1, 4, 2, 5, 4]})
    result = adjective_correlation(table)
    assert result.rho.columns.tolist() == ["hard", "soft"]
    # Ranks less 3: (2, 1, 0, -1.5, -1.5) and (-2, .5, -1, 2, .5).
    rho = -7.25 / 9.5
    assert result.rho.iat[0, 1] == pytest.approx(rho)
    # Student's t with 3 degrees of freedom has a CDF in closed form.
    t = abs(rho) / np.sqrt(1 - rho**2)  # over the root of 3
    p_value = 1 - 2 / np.pi * (t / (1 + t**2) + np.arctan(t))
    assert result.pvalue.iat[0, 1] == pytest.approx(p_value)


@pytest.mark.parametrize("n", [3, 4, 6])
def test_few_rows_in_one_order_may_be_so_by_chance(n):
    ratings = np.column_stack((range(n), range(n)))
    steps = np.diff([*permutations(range(n))], axis=1)
    in_order = (steps == 1).all(axis=1) | (steps == -1).all(axis=1)
    result = adjective_correlation(ratings)
    assert result.pvalue.iat[0, 1] == pytest.approx(in_order.mean())
    assert result.relation.iat[0, 1] == (n == 6)


@pytest.mark.parametrize(
    "frame",
    [
        pd.DataFrame,
        pl.DataFrame,
        lambda columns: pd.DataFrame(columns).astype("Int64"),
        lambda columns: pd.DataFrame(columns).astype("category"),
        lambda columns: pd.DataFrame(columns).astype("Int64").astype(object),
    ],
    ids=["pandas", "polars", "Int64", "category", "object"],
)
def test_adjective_correlation_of_missing_ratings(frame):
    """Rows 0 and 4 lack one of the first two, so that their ranks are 1, 2, 3."""
    columns = {
        "hard": [5, 1, 2, 3, None],
        "soft": [None, 3, 1, 2, 5],
        "rough": [1, 2, 2, 4, 3],
    }
    table = frame(columns)
    result = adjective_correlation(table)
    assert result.n_ratings.to_numpy().tolist() == [[4, 3, 4], [3, 4, 4], [4, 4, 5]]
    # Ranks 1, 2, 3 and 3, 1, 2: 1 - 6 * (4 + 1 + 1) / (3 * 8).
    assert result.rho.iat[0, 1] == pytest.approx(-0.5)
    # Ranks less their mean 2.5: (1.5, -1.5, -.5, .5) and (-1.5, 0, 0, 1.5).
    assert result.rho.iat[0, 2] == pytest.approx(-1.5 / np.sqrt(5 * 4.5))
    values = np.array([*columns.values()], dtype=float).T
    for i, j in [(0, 1), (0, 2), (1, 2)]:
        expected = spearmanr(values[:, i], values[:, j], nan_policy="omit")
        assert (
            result.rho.iat[i, j]
            == result.rho.iat[j, i]
            == pytest.approx(expected.statistic)
        )
        assert result.pvalue.iat[i, j] == result.pvalue.iat[j, i]
        assert result.pvalue.iat[i, j] == pytest.approx(expected.pvalue)


def test_holm_by_hand():
    # Sorted .01, .02, .03, .04, times 4, 3, 2, 1: .04, .06, .06, .04, never falling.
    assert_allclose(_holm(np.array([0.03, 0.01, 0.04, 0.02])), [0.06, 0.04, 0.06, 0.06])
    assert _holm(np.array([0.4, 0.9])).tolist() == [0.8, 0.9]
    assert _holm(np.array([0.6, 0.7])).tolist() == [1, 1]
    assert _holm(np.array([0.3])).tolist() == [0.3]


def test_holm_rejects_what_the_stepwise_rule_does():
    rng = np.random.default_rng(0)
    for _ in range(200):
        pvalue = rng.random(8) ** 4
        rejected = np.zeros(8, dtype=bool)
        for step, i in enumerate(np.argsort(pvalue)):
            if pvalue[i] > 0.05 / (8 - step):
                break
            rejected[i] = True
        assert_array_equal(_holm(pvalue) <= 0.05, rejected)


def test_synonyms_and_antonyms_are_strong_and_significant():
    rng = np.random.default_rng(0)
    hard = rng.normal(size=60)
    table = pd.DataFrame(
        {
            "hard": hard,
            "soft": -hard + 0.5 * rng.normal(size=60),
            "firm": hard + 0.4 * rng.normal(size=60),
            "cold": 0.8 * hard + rng.normal(size=60),
            "odd": rng.normal(size=60),
        }
    )
    result = adjective_correlation(table, threshold=0.7)
    strong, relation = np.abs(result.rho) >= 0.7, result.relation.to_numpy()
    assert relation[:3, :3].tolist() == [[0, -1, 1], [-1, 0, -1], [1, -1, 0]]
    assert not relation[3:].any() and not relation[:, 3:].any()
    assert (
        not strong.iat[0, 3] and result.pvalue_holm.iat[0, 3] < 0.05
    )  # significant, weak
    loose = adjective_correlation(table, threshold=0)
    assert loose.relation.iat[0, 3] == 1
    significant = (loose.pvalue_holm <= 0.05) & ~np.eye(5, dtype=bool)
    assert_array_equal(loose.relation != 0, significant)
    assert not loose.relation.iloc[4].any()
    few = adjective_correlation(table[:6], threshold=0)
    assert (
        0.7 < few.rho.iat[0, 2] < 1 and few.relation.iat[0, 2] == 0
    )  # strong, six rows
    strict = adjective_correlation(table, significance=1e-12, threshold=0)
    assert_array_equal(
        strict.relation != 0, (strict.pvalue_holm <= 1e-12) & ~np.eye(5, dtype=bool)
    )


def test_pairs_are_those_of_the_matrices_strongest_first():
    ratings = np.random.default_rng(1).integers(1, 6, size=(50, 5)).astype(float)
    ratings[:, 3] = np.clip(6 - ratings[:, 1] + (ratings[:, 0] > 4), 1, 5)
    ratings[:7, 1] = np.nan
    result = adjective_correlation(pd.DataFrame(ratings, columns=list("abcde")))
    pairs = result.pairs
    assert len(pairs) == 10
    assert (np.diff(np.abs(pairs["rho"])) <= 0).all()
    assert pairs.loc[0, ["first", "second", "relation"]].tolist() == [*"bd", "antonyms"]
    words = {0: "neither", 1: "synonyms", -1: "antonyms"}
    for _, pair in pairs.iterrows():
        at = pair["first"], pair["second"]
        assert at[0] < at[1]
        for field in ("rho", "pvalue", "pvalue_holm", "n_ratings"):
            assert pair[field] == result[field].at[at] == result[field].at[at[::-1]]
        assert pair["relation"] == words[result.relation.at[at]]
    assert_array_equal(
        np.sort(pairs["pvalue_holm"]),
        np.sort(_holm(result.pvalue.to_numpy()[np.triu_indices(5, 1)])),
    )


def test_continuous_ratings_are_refused_unless_their_levels_are_given():
    ratings, objects = [0.5, 1.25, 0.5], ["foam", "foam", "tile"]
    with pytest.raises(ValueError, match=r"continuous ratings, such as 0\.5 in row 0"):
        rating_counts(ratings, objects)
    table = rating_counts(ratings, objects, levels=[0.5, 1.25])
    assert table.counts.to_numpy().tolist() == [[1, 1], [1, 0]]


# Outlying raters


def many_answers(n_people=12, n_objects=10, seed=0):
    """Answers, objects and raters of a crowd that roughly agrees; some are missing."""
    rng = np.random.default_rng(seed)
    objects = np.repeat(np.arange(n_objects), n_people)
    raters = np.tile([f"person {i:02d}" for i in range(n_people)], n_objects)
    truth = rng.uniform(1, 5, size=(n_objects, 3))[objects]
    answers = np.clip(np.rint(truth + 0.7 * rng.normal(size=truth.shape)), 1, 5)
    answers[rng.uniform(size=answers.shape) < 0.1] = np.nan
    shuffled = rng.permutation(len(objects))
    return answers[shuffled], objects[shuffled], raters[shuffled]


def test_agreement_is_the_correlation_with_the_mean_of_all_others():
    """Of standardised ratings, stacked over adjectives; habits do not change it."""
    answers, objects, raters = many_answers()
    frame = pd.DataFrame(answers).groupby([raters, objects]).first()
    frame = (
        (
            (frame - frame.groupby(level=0).transform("mean"))
            / (frame.groupby(level=0).transform("std"))
        )
        .stack()
        .unstack(level=0)
    )  # one row per object and adjective
    result = outlying_raters(answers, objects, raters)
    assert result.index.tolist() == frame.columns.tolist()
    for person, own in frame.items():
        others = frame.drop(columns=person).mean(axis=1)[own.notna()]
        factors = [
            each - each.groupby(level=1).transform("mean")
            for each in (own.dropna(), others)
        ]
        # Of one adjective this is Pearson's; all adjectives weigh by their variance.
        expected = np.dot(*factors) / np.sqrt(np.prod([f @ f for f in factors]))
        assert result.at[person, "agreement"] == pytest.approx(expected, rel=2e-3)
    habits = np.unique(raters, return_inverse=True)[1][:, None]
    turned = outlying_raters(answers * (1 + habits) + 5 * habits, objects, raters)
    pd.testing.assert_frame_equal(turned, result)


def test_objects_that_one_person_alone_rated_change_no_agreement():
    answers, objects, raters = many_answers()
    expected = outlying_raters(answers, objects, raters)
    alone = np.full((5, answers.shape[1]), [[1], [5], [5], [5], [5]])
    answers = np.vstack((answers, alone))
    objects = np.append(objects, 100 + np.arange(5))
    raters = np.append(raters, np.repeat(raters[:1], 5))
    pd.testing.assert_frame_equal(outlying_raters(answers, objects, raters), expected)


def test_people_of_one_answer_agree_with_nobody_and_hide_nobody():
    answers, objects, raters = many_answers(12, 20, seed=1)
    careless = raters == "person 03"
    answers[careless] = 6 - answers[careless]
    expected = outlying_raters(answers, objects, raters)
    assert expected.index[expected["outlying"]].tolist() == ["person 03"]
    passers_by = [f"passer-by {i:02d}" for i in range(12)]
    result = outlying_raters(
        np.vstack((answers, np.full((12, 3), 2.0))),
        np.append(objects, np.arange(12)),
        np.append(raters, passers_by),
    )
    assert result.loc[passers_by].drop(columns="outlying").isna().all(axis=None)
    assert result.index[result["outlying"]].tolist() == ["person 03"]


@pytest.mark.parametrize("careless", ["random", "reversed"])
def test_careless_raters_are_found(careless):
    answers, objects, raters = many_answers(30, 20, seed=1)
    assert not outlying_raters(answers, objects, raters)["outlying"].any()
    rows = np.isin(raters, ["person 03", "person 17"])
    rng = np.random.default_rng(0)
    answers[rows] = (
        rng.integers(1, 6, size=answers[rows].shape)
        if careless == "random"
        else 6 - answers[rows]
    )
    result = outlying_raters(answers, objects, raters)
    assert result.index[result["outlying"]].tolist() == ["person 03", "person 17"]
    table = pd.DataFrame(answers, columns=list("abc"))
    same = outlying_raters(table, pd.Series(objects), pd.Series(raters))
    pd.testing.assert_frame_equal(same, result)
    table = rating_counts(answers[:, 0], objects, raters, levels=[1, 2, 3, 4, 5])
    one = outlying_raters(answers[:, :1], objects, raters)
    pd.testing.assert_frame_equal(outlying_raters(table), one)
    assert repr(table).startswith("RatingTable(") and len(repr(table)) < 88


def test_a_huge_answer_or_scale_of_one_person_hides_no_other():
    answers, objects, raters = many_answers(30, 20, seed=1)
    answers = answers[:, :1].astype(float)
    answers[raters == "person 03"] *= -1
    agreement = outlying_raters(answers, objects, raters)["agreement"]
    scaled = answers * np.where(raters == "person 05", 1e12, 1)[:, np.newaxis]
    assert_allclose(outlying_raters(scaled, objects, raters)["agreement"], agreement)
    answers[(raters == "person 05").argmax()] = -(2**31)
    result = outlying_raters(answers, objects, raters)
    assert result.index[result["outlying"]].tolist()[:1] == ["person 03"]


def test_outlying_raters_of_a_table_whose_levels_are_uneven():
    frame = pd.DataFrame(
        [
            (o, r, v)
            for o in range(4)
            for r, v in enumerate([0, 0, 10, 10, 100 * (o + 1)])
        ],
        columns=["object", "rater", "rating"],
    )
    expected = outlying_raters(frame[["rating"]], frame["object"], frame["rater"])
    got = outlying_raters(RatingTable.from_long(frame))
    pd.testing.assert_frame_equal(got, expected)


def test_a_second_rating_is_refused_but_not_rows_of_other_adjectives():
    """A person's own second rating would count among those of everybody else."""
    answers, objects, raters = many_answers()
    with pytest.raises(ValueError, match=r"two of the object .* by the rater"):
        outlying_raters(
            np.r_[answers, answers[:1]],
            np.r_[objects, objects[:1]],
            np.r_[raters, raters[:1]],
        )
    apart = np.full((2, *answers.shape), np.nan)
    apart[0, :, 0], apart[1, :, 1:] = answers[:, 0], answers[:, 1:]
    got = outlying_raters(
        np.concatenate(apart), np.tile(objects, 2), np.tile(raters, 2)
    )
    pd.testing.assert_frame_equal(got, outlying_raters(answers, objects, raters))


def test_raters_who_cannot_be_compared():
    """One whose object nobody else rated, and one who always answers alike."""
    answers = np.array([[1, 2, 5], [2, 3, 4], [1, 3, 4], [5, 2, 1], [3, 3, 3]])
    objects, raters = np.tile(range(3), 5), np.repeat([*"abcde"], 3)
    result = outlying_raters(
        [*answers.reshape(-1, 1), [2]], [*objects, 3], [*raters, "f"]
    )
    assert result.loc["f"].isna().tolist() == [True, True, True, False]
    assert result.at["e", "agreement"] == 0 and result.at["d", "agreement"] < -0.9


def test_few_false_alarms_whatever_the_habits():
    """At most one study in twenty, with shifts and spreads of every size."""
    rng, alarms = np.random.default_rng(0), 0
    objects, raters = map(np.ravel, np.indices((25, 12)))
    for _ in range(300):
        felt = rng.normal(size=25)[objects] + 0.7 * rng.normal(size=300)
        habit = np.exp(rng.normal(size=12))[raters] * felt + rng.normal(size=12)[raters]
        alarms += outlying_raters(habit[:, None], objects, raters)["outlying"].any()
    assert alarms / 300 < 0.05


@pytest.mark.parametrize(
    "n_raters, n_objects, each", [(60, 30, 5), (100, 20, 4), (40, 10, 3)]
)
def test_few_false_alarms_among_people_who_rated_few_objects(n_raters, n_objects, each):
    rng, alarms = np.random.default_rng(0), 0
    raters = np.repeat(range(n_raters), each)
    for _ in range(60):
        objects = np.concatenate(
            [rng.choice(n_objects, each, replace=False) for _ in range(n_raters)]
        )
        felt = rng.normal(size=n_objects)[objects]
        answers = np.rint(3 + felt + 0.8 * rng.normal(size=len(felt))).clip(1, 5)
        alarms += outlying_raters(answers[:, None], objects, raters)["outlying"].any()
    assert alarms <= 6


@pytest.mark.parametrize(
    "n_objects, noise, n_levels, found",
    [(6, 0.3, 5, 0.5), (20, 0.2, 5, 0.9), (20, 0.2, 3, 0.9), (60, 0.1, 2, 0.9)],
)
def test_few_false_alarms_among_people_who_nearly_agree(
    n_objects, noise, n_levels, found
):
    """Who answers one object otherwise is not careless; who answers at random is."""
    rng, called = np.random.default_rng(0), np.empty((100, 2))
    objects, raters = map(np.ravel, np.indices((n_objects, 12)))
    for each in called:
        felt = rng.integers(n_levels, size=n_objects)[objects]
        careful = np.rint(felt + noise * rng.normal(size=len(felt)))
        careful = careful.clip(0, n_levels - 1)[:, None]
        each[0] = outlying_raters(careful, objects, raters)["outlying"].any()
        careful[raters == 3] = rng.integers(n_levels, size=(n_objects, 1))
        each[1] = outlying_raters(careful, objects, raters).at[3, "outlying"]
    alarms, right = called.mean(axis=0)
    assert alarms <= 0.05 and right >= found


def test_people_who_agree_alike_are_not_outlying_by_rounding():
    objects, raters = np.divmod(np.arange(400), 20)
    same = np.random.default_rng(0).uniform(0, 100, 20)[objects]
    for answers in (same, np.full(400, 3.0), same * 2.0**raters):
        result = outlying_raters(answers[:, None], objects, raters)
        assert_array_equal(result["score"], 0)
        assert not result["outlying"].any()
    turned = np.where(raters == 3, -same, same)
    result = outlying_raters(turned[:, None], objects, raters)
    assert result.index[result["outlying"]].tolist() == [3]
