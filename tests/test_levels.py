"""Order and names of levels: whatever container says them, as if given by hand.

Everything is compared with models and scores of plain counts 1, 2, …, made by loops
from names and an order that were drawn at random.
"""

import numpy as np
import pandas as pd
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_validate
from sklearn.naive_bayes import GaussianNB

from sklearn_haptic import (
    NNPOM,
    ConformalRatings,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    SensorFusionNNPOM,
)
from sklearn_haptic.metrics import (
    dispersion,
    earth_movers_distance,
    log_score,
    macro_mae,
    neg_macro_mae_scorer,
    neg_rps_scorer,
    pit_histogram,
    ranked_probability_score,
)
from sklearn_haptic.model_selection import cross_val_predict_proba, model_report
from sklearn_haptic.plotting import (
    DistributionDisplay,
    InterraterAgreementDisplay,
    InverseCDFDisplay,
    PITHistogramDisplay,
    RatingsDisplay,
    ReliabilityDisplay,
)
from sklearn_haptic.ratings import (
    interrater_agreement,
    inverse_cdf,
    rating_cdf,
    rating_counts,
    rating_distribution,
)
from sklearn_haptic.ratings._checks import check_ratings

N = 24
RNG = np.random.default_rng(0)
X = RNG.normal(size=(N, 3))
SENSORS = {"pac": [0, 1], "tdc": [2]}
ESTIMATORS = {
    "NNPOM": NNPOM(0),
    "DistributionalOrdinalRegressor": DistributionalOrdinalRegressor(),
    "SensorFusionNNPOM": SensorFusionNNPOM(SENSORS, NNPOM(1, tol=1e-2), random_state=0),
    "DummyDistribution": DummyDistribution(),
}
WORDS = st.lists(
    st.text("abcdefgh -", min_size=1, max_size=5), min_size=2, max_size=6, unique=True
)
NUMBERS = st.lists(
    st.one_of(st.integers(-20, 20), st.sampled_from([0.5, 1.5, -2.25])),
    min_size=2,
    max_size=6,
    unique=True,
)


def ranks(seed, n_levels):
    """Index of the level that each trial was rated at; both ends occur."""
    level = np.random.default_rng(seed).integers(n_levels, size=N)
    level[:2] = 0, n_levels - 1
    return level


def counted(level, n_levels):
    """Counts of one rating per trial, by a loop."""
    counts = [[0] * n_levels for _ in level]
    for trial, k in enumerate(level):
        counts[trial][k] += 1
    return counts


def ordered_containers(words, names):
    """Ratings in every container that orders its categories."""
    categorical = pd.Categorical(words, names, ordered=True)
    return {
        "pandas categorical": categorical,
        "pandas series": pd.Series(categorical, index=np.arange(len(words)) + 7),
        "polars Enum": pl.Series(words, dtype=pl.Enum(names)),
    }


def labelled(counts, names, order, kind):
    """Counts as a table whose columns are in some order."""
    table = np.asarray(counts)[:, order]
    names = [names[k] for k in order]
    if kind == "pandas":
        return pd.DataFrame(table, columns=names)
    if kind == "pandas text":
        return pd.DataFrame(table, columns=[*map(str, names)])
    if kind == "pandas prefix":
        return pd.DataFrame(table, columns=[f"n{name}" for name in names])
    return pl.DataFrame(table, schema=[*map(str, names)], orient="row")


@pytest.mark.slow
@pytest.mark.parametrize("name", ESTIMATORS)
@settings(max_examples=5, deadline=None)
@given(names=WORDS, seed=st.integers(0, 99))
def test_ordered_categories_are_the_levels(name, names, seed):
    level = ranks(seed, len(names))
    model = ESTIMATORS[name]
    plain = model.fit(X, counted(level, len(names)))
    proba, predicted = plain.predict_proba(X), plain.predict(X)
    words = [names[k] for k in level]
    for y in ordered_containers(words, names).values():
        model.fit(X, y)
        assert model.levels_.tolist() == model.classes_.tolist() == names
        assert_array_equal(model.predict_proba(X), proba)
        assert model.predict(X).tolist() == [names[k - 1] for k in predicted]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pandas", "pandas text", "polars"])
@pytest.mark.parametrize("name", ESTIMATORS)
@settings(max_examples=5, deadline=None)
@given(names=NUMBERS, seed=st.integers(0, 99), data=st.data())
def test_numbers_that_label_columns_are_the_levels(name, kind, names, seed, data):
    names = sorted(names)
    counts = np.random.default_rng(seed).integers(1, 9, size=(N, len(names)))
    order = data.draw(st.permutations(range(len(names))))
    y = labelled(counts, names, order, kind)
    model = ESTIMATORS[name]
    plain = model.fit(X, counts)
    proba, predicted = plain.predict_proba(X), plain.predict(X)
    rps = ranked_probability_score(counts, proba)
    model.fit(X, y)
    assert model.levels_.tolist() == names
    assert_array_equal(model.predict_proba(X), proba)
    assert model.predict(X).tolist() == [names[k - 1] for k in predicted]
    assert neg_rps_scorer(model, X, y) == -rps
    again = labelled(counts, names, order[::-1], kind)
    assert neg_rps_scorer(model, X, again) == -rps
    assert neg_macro_mae_scorer(model, X, again) == -macro_mae(counts, proba)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(
    names=st.lists(st.integers(0, 99), min_size=2, max_size=7, unique=True),
    kind=st.sampled_from(["pandas", "pandas text", "pandas prefix", "polars"]),
    given_levels=st.booleans(),
    data=st.data(),
)
def test_columns_are_put_in_the_order_of_levels(names, kind, given_levels, data):
    order = data.draw(st.permutations(range(len(names))))
    counts = np.arange(1, 3 * len(names) + 1).reshape(3, -1)
    table = labelled(counts, names, order, kind)
    levels = data.draw(st.permutations(names)) if given_levels else None
    found, found_levels = check_ratings(table, levels)
    expected = levels if given_levels else sorted(names)
    assert found_levels.tolist() == expected
    for trial in range(3):
        for k, level in enumerate(expected):
            assert found[trial, k] == counts[trial, names.index(level)]


COUNTS = np.array([[9, 2, 0, 1], [1, 3, 6, 2], [0, 4, 4, 4]])


@pytest.mark.parametrize(
    "table",
    [
        pl.DataFrame(COUNTS),
        COUNTS.tolist(),
        COUNTS.astype(np.uint64),
        COUNTS.astype(object),
    ],
)
def test_positions_of_columns_are_no_labels(table):
    counts, levels = check_ratings(table)
    assert levels.tolist() == [1, 2, 3, 4]
    assert_array_equal(counts, COUNTS)
    assert check_ratings(table, [7, 5, 1, 0])[1].tolist() == [7, 5, 1, 0]


def test_default_labels_that_are_the_levels_name_them():
    """Equal tables are read alike, whatever makes their columns."""
    by_range = pd.DataFrame(COUNTS, columns=range(4))
    by_list = pd.DataFrame(COUNTS, columns=[0, 1, 2, 3])
    for levels in ([3, 2, 1, 0], [1, 0, 2, 3], range(4)):
        for table in (by_range, by_list):
            counts, found = check_ratings(table, levels)
            assert found.tolist() == list(levels)
            assert_array_equal(counts, COUNTS[:, list(levels)])


@pytest.mark.parametrize(
    ("labels", "levels"),
    [
        (pd.RangeIndex(1, 5), [1, 2, 3, 4]),
        (pd.RangeIndex(4), [0, 1, 2, 3]),
        (pd.RangeIndex(4, name="rating"), [0, 1, 2, 3]),
        (pd.Index([0, 1, 2, 3]), [0, 1, 2, 3]),
        (["level-1", "level-2", "level-3", "level-4"], [1, 2, 3, 4]),
        (["q7_1", "q7_2", "q7_3", "q7_10"], [1, 2, 3, 10]),
        (["q7-1", "q7-2", "q7-3", "q7-10"], [1, 2, 3, 10]),
        (["X.1", "X.1.5", "X.2", "X.2.5"], [1, 1.5, 2, 2.5]),
        (["n1", "n1.5", "n2", "n2.5"], [1, 1.5, 2, 2.5]),
        (["column_1", "column_2", "column_3", "column_4"], [1, 2, 3, 4]),
        (["-1.5", "0", "1.5", "+20"], [-1.5, 0, 1.5, 20]),
        (["hard_-1", "hard_0", "hard_1", "hard_2"], [-1, 0, 1, 2]),
        (["n-2", "n-1.5", "n1", "n2"], [-2, -1.5, 1, 2]),
        (["r_-4", "r_-3", "r_-2", "r_-1"], [-4, -3, -2, -1]),
        (["r_1e-06", "r_1e-05", "r_0.0001", "r_0.001"], [1e-6, 1e-5, 1e-4, 1e-3]),
        ([".125", ".25", ".5", "1."], [0.125, 0.25, 0.5, 1]),
        ([" -4", " -3", " -2", "-.5"], [-4, -3, -2, -0.5]),
        (["1e-06", "1e-05", "0.0001", "1e+16"], [1e-6, 1e-5, 1e-4, 1e16]),
        (
            ["\N{MINUS SIGN}4", "\N{MINUS SIGN}3", "-2", "\N{EN DASH}1"],
            [-4, -3, -2, -1],
        ),
        (["very soft", "soft", "hard", "very hard"],) * 2,
        (["0,25", "0,5", "0,75", "0,125"],) * 2,  # not 25, 5, 75 and 125
    ],
)
def test_labels_of_columns(labels, levels):
    counts, found = check_ratings(pd.DataFrame(COUNTS, columns=labels))
    assert found.tolist() == levels
    assert_array_equal(counts, COUNTS)


@pytest.mark.parametrize(
    "labels",
    [
        ["row_0", 1, 2, 3],  # of pd.crosstab(...).reset_index()
        ["Unnamed: 0", "1", "2", "3"],  # of read_csv without index_col
        ["Unnamed: 0", "n1", "n2", "n3"],
        ["n1", "n2", "n3", "total"],
    ],
)
def test_a_column_beside_numbered_ones_is_no_level(labels):
    table = pd.DataFrame([[114, 4, 2, 1], [201, 1, 1, 3]], columns=labels)
    with pytest.raises(ValueError, match="leave out columns that are no counts"):
        check_ratings(table)


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 1, 0, 2]])
def test_levels_do_not_depend_on_how_pandas_numbers_columns(order):
    tables = (
        pd.DataFrame(COUNTS),
        pd.DataFrame({k: COUNTS[:, k] for k in range(4)}),
        pd.DataFrame(COUNTS, columns=[0, 1, 2, 3]),
    )
    for table in tables:
        counts, levels = check_ratings(table[order])
        assert levels.tolist() == [0, 1, 2, 3]
        assert_array_equal(counts, COUNTS)
    counts, levels = check_ratings(tables[0], [7, 5, 1, 0])  # columns in their order
    assert levels.tolist() == [7, 5, 1, 0]
    assert_array_equal(counts, COUNTS)


def test_a_crosstab_of_ordered_ratings_keeps_their_order_and_the_level_of_nobody():
    names = ["soft", "medium", "hard", "very hard"]
    ratings = ["hard", "soft", "soft", "medium", "hard"]
    objects = ["tile", "foam", "foam", "tile", "tile"]
    given = pd.Categorical(ratings, names, ordered=True)
    table = pd.crosstab(pd.Series(objects), given)
    assert [*table.columns] == ["soft", "medium", "hard"]
    counts, levels = check_ratings(table)
    assert levels.tolist() == names
    assert counts.tolist() == [[2, 0, 0, 0], [0, 1, 2, 0]]
    assert_array_equal(counts, rating_counts(given, objects).counts)
    unordered = pd.crosstab(pd.Series(objects), pd.Series(ratings))
    with pytest.warns(UserWarning, match="alphabetical order; .* 'hard' < 'medium' <"):
        counts, levels = check_ratings(unordered)
    assert levels.tolist() == ["hard", "medium", "soft"]
    counts, levels = check_ratings(unordered, names[:3])
    assert levels.tolist() == names[:3]
    assert counts.tolist() == [[2, 0, 0], [0, 1, 2]]


@pytest.mark.parametrize("labels", [["soft", "medium", "hard"], ["1", "2", "3"]])
@pytest.mark.parametrize("total", ["All", "total", "n", "99"])
@pytest.mark.parametrize("people", [1, 9])
def test_totals_beside_counts_are_refused(labels, total, people):
    """What crosstab(margins=True) and counts.sum(axis=1) add is no level."""
    counts = np.random.default_rng(0).multinomial(9, [0.2, 0.3, 0.5], size=12)
    table = pd.DataFrame(counts * people / 9, columns=labels)
    assert check_ratings(table)[0].shape == (12, 3)
    with pytest.raises(ValueError, match="leave out columns that are no counts"):
        check_ratings(table.assign(**{total: table.sum(axis=1)}))


def test_margins_of_few_objects_are_refused_by_their_name():
    answers = pd.DataFrame(
        {"object": list("aaabbbccc"), "feel": ["low", "mid", "high"] * 2 + ["low"] * 3}
    )
    table = pd.crosstab(answers["object"], answers["feel"], margins=True).iloc[:-1]
    with pytest.raises(ValueError, match="'All' of counts is the sum of all others"):
        rating_distribution(table)


def test_a_level_that_half_of_two_people_chose_everywhere_is_no_total():
    table = pd.DataFrame([[1, 1, 0, 0], [0, 1, 1, 0], [0, 1, 0, 1]] * 4)
    assert check_ratings(table)[0].tolist() == table.to_numpy().tolist()


@pytest.mark.parametrize(
    "words",
    [
        ["soft", "hard", "middling"],
        np.array(["soft", "hard", "middling"]),
        pd.Series(["soft", "hard", "middling"]),
        pd.Categorical(["soft", "hard", "middling"]),
        pl.Series(["soft", "hard", "middling"]),
        pl.Series(["soft", "hard", "middling"], dtype=pl.Categorical),
    ],
)
def test_words_in_no_order_are_sorted_with_a_warning_that_a_user_can_end(words):
    told = (
        "words, which have no order of their own; they are taken as 'hard' < 'middling'"
        r" < 'soft'. Give an ordered categorical .* or levels=\[...\], lowest level"
    )
    sorted_counts = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    with pytest.warns(UserWarning, match="^y has " + told):
        counts, levels = check_ratings(words)
    assert levels.tolist() == ["hard", "middling", "soft"]
    assert counts.tolist() == sorted_counts
    with pytest.warns(UserWarning, match="^ratings has " + told):
        assert (
            rating_counts(words, [1, 2, 3]).counts.to_numpy().tolist() == sorted_counts
        )
    for fit in (NNPOM(0), DummyDistribution(), SensorFusionNNPOM({"pac": [0]})):
        with pytest.warns(UserWarning, match="^y has " + told):
            fit.fit([[0], [1], [2]], words)
    order = ["soft", "middling", "hard"]
    assert check_ratings(words, order)[0].tolist() == [[1, 0, 0], [0, 0, 1], [0, 1, 0]]
    model = NNPOM(0, levels=order).fit([[0], [1], [2]], words)
    assert set(model.predict([[0], [1], [2]])) <= set(order)
    assert ranked_probability_score(words, np.eye(3), levels=order) > 0


@pytest.mark.parametrize("y", [[3, 1, 2], [1.0, 2.0], [True, False], pd.Series([2, 1])])
def test_numbers_and_booleans_have_an_order(y):
    assert check_ratings(y)[1].tolist() == sorted(set(y))


SCORES = [
    ranked_probability_score,
    earth_movers_distance,
    log_score,
    macro_mae,
    dispersion,
    pit_histogram,
]
PROBA = np.array([[0.5, 0.25, 0.125, 0.125], [0, 0.25, 0.5, 0.25], [0.25] * 4])
NAMES = [1, 2, 4, 5]


@pytest.mark.slow
@pytest.mark.parametrize("score", SCORES)
@pytest.mark.parametrize("kind", ["pandas", "pandas text", "polars"])
@settings(max_examples=10, deadline=None)
@given(
    order=st.permutations(range(4)),
    order_of_proba=st.permutations(range(4)),
    levels=st.permutations(NAMES),
)
def test_scores_match_truth_and_prediction_by_name(
    score, kind, order, order_of_proba, levels
):
    y = labelled(COUNTS + 1, NAMES, order, kind)
    proba = labelled(PROBA, NAMES, order_of_proba, kind)
    expected = score(COUNTS + 1, PROBA)
    assert_array_equal(score(y, PROBA), expected)
    assert_array_equal(score(y, proba), expected)
    place = [NAMES.index(level) for level in levels]
    expected = score((COUNTS + 1)[:, place], PROBA[:, place])
    assert_array_equal(score(y, proba, levels=levels), expected)
    assert_array_equal(score(y, PROBA[:, place], levels=levels), expected)
    one_each = [NAMES[k] for k in (3, 0, 2)]
    expected = score(counted([3, 0, 2], 4), PROBA)
    assert_array_equal(score(one_each, proba), expected)


def test_a_category_without_a_column_is_chosen_and_predicted_by_nobody():
    names = ["soft", "mid", "hard"]
    columns = pd.CategoricalIndex(["hard", "soft"], names, ordered=True)
    y = pd.DataFrame([[3, 1], [0, 2]], columns=columns)
    proba = pd.DataFrame([[0.5, 0.5], [0.25, 0.75]], columns=columns)
    assert_array_equal(
        ranked_probability_score(y, proba, average=False),
        ranked_probability_score(
            [[1, 0, 3], [2, 0, 0]], [[0.5, 0, 0.5], [0.75, 0, 0.25]], average=False
        ),
    )


def test_other_columns_than_the_model_knows_are_refused():
    model = NNPOM(0).fit(X[:3], pd.DataFrame(COUNTS, columns=NAMES))
    for columns in ([1, 2, 3, 4], [1, 2, 4, 6], ["a", "b", "c", "d"]):
        y = pd.DataFrame(COUNTS, columns=columns)
        message = r"^The columns of y_true are .*, but the levels are \[1, 2, 4, 5\]"
        with pytest.raises(ValueError, match=message):
            neg_rps_scorer(model, X[:3], y)
        with pytest.raises(ValueError, match=r"^The columns of y_proba are"):
            ranked_probability_score(COUNTS, y.div(y.sum(axis=1), axis=0), levels=NAMES)
    assert neg_rps_scorer(model, X[:3], COUNTS) == neg_rps_scorer(
        model, X[:3], pd.DataFrame(COUNTS[:, ::-1], columns=NAMES[::-1])
    )


def test_validation_ratings_are_matched_by_name():
    counts = RNG.integers(1, 9, size=(N, 4))
    y = pd.DataFrame(counts, columns=NAMES)
    model = DistributionalOrdinalRegressor(
        NNPOM(2, early_stopping=True, max_iter=30, tol=1e-9), random_state=0
    )
    plain = model.fit(X, counts, X_val=X[:9], y_val=counts[:9]).predict_proba(X)
    model.fit(X, y, X_val=X[:9], y_val=y[:9][[5, 1, 4, 2]])
    assert_array_equal(model.predict_proba(X), plain)
    with pytest.raises(ValueError, match=r"^The columns of y_val are"):
        model.fit(X, y, X_val=X, y_val=pd.DataFrame(counts, columns=[1, 2, 3, 4]))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pandas", "polars"])
def test_searches_keep_labels_in_every_fold(kind):
    counts = RNG.integers(1, 9, size=(N, 4))
    groups = np.arange(N) // 2
    y = labelled(counts, NAMES, [3, 1, 0, 2], kind)
    for model in (NNPOM(0), DistributionalOrdinalRegressor(NNPOM(0))):
        options = {"cv": GroupKFold(3), "scoring": neg_rps_scorer}
        found, plain = (
            cross_validate(
                model, X, each, groups=groups, return_estimator=True, **options
            )
            for each in (y, counts)
        )
        assert_array_equal(found["test_score"], plain["test_score"])
        assert all(each.levels_.tolist() == NAMES for each in found["estimator"])
        grid = {"levels": [None, NAMES]}
        search = GridSearchCV(model, grid, **options).fit(X, y, groups=groups)
        assert set(search.predict(X)) <= set(NAMES)


@pytest.mark.parametrize("container", ["pandas series", "polars Enum"])
def test_a_category_that_a_fold_lacks_keeps_its_column(container):
    names = ["soft", "mid", "hard", "unused"]
    level = np.repeat([0, 1, 2], N // 3)
    y = ordered_containers([names[k] for k in level], names)[container]
    folds = [(np.flatnonzero(level != k), np.flatnonzero(level == k)) for k in range(3)]
    result = cross_validate(
        DistributionalOrdinalRegressor(), X, y, cv=folds, return_estimator=True
    )
    for k, model in enumerate(result["estimator"]):
        assert model.levels_.tolist() == names
        proba = model.predict_proba(X)
        assert proba.shape == (N, 4)
        assert_array_equal(proba[:, [k, 3]], 0)
        by_hand = ranked_probability_score(
            counted(level[level == k], 4), proba[level == k]
        )
        assert result["test_score"][k] == -by_hand


def test_counts_name_the_order_of_a_classifier_that_knows_none():
    """A classifier of scikit-learn puts words in the order of the alphabet."""
    words, X = ["low", "some", "high"], np.arange(9.0)[:, None]
    classifier = GaussianNB().fit(X, np.repeat(words, 3))
    counts = np.random.default_rng(0).integers(1, 9, size=(9, 3))
    labelled = pd.DataFrame(counts, columns=words)
    proba = classifier.predict_proba(X)[:, [1, 2, 0]]
    score = ranked_probability_score(counts, proba)
    assert neg_rps_scorer(classifier, X, labelled) == pytest.approx(-score)
    score = macro_mae(counts, proba)
    assert neg_macro_mae_scorer(classifier, X, labelled) == pytest.approx(-score)
    display = PITHistogramDisplay.from_estimator(classifier, X, labelled)
    heights = [bar.get_height() for bar in display.bars_]
    np.testing.assert_allclose(heights, pit_histogram(counts, proba))
    display = InverseCDFDisplay.from_estimator(classifier, X[:2], labelled.loc[0])
    assert_array_equal(display.levels, words)
    with pytest.warns(UserWarning, match="'high' < 'low' < 'some'"):
        neg_rps_scorer(classifier, X, counts)


def test_the_places_of_columns_are_no_levels_of_predictions():
    """As pandas labels those of an array: levels 1 to 4 would be four of 0 to 4."""
    y, proba = np.array([1, 2, 3, 4]), np.eye(5)[[0, 1, 2, 3]]
    table = pd.DataFrame(proba, index=list("abcd"))
    with pytest.raises(ValueError, match="has 4 trials and 4 levels; give"):
        ranked_probability_score(y, table)
    assert ranked_probability_score(y, table, levels=range(1, 6)) == 0
    named = table.set_axis(range(1, 6), axis=1)
    assert ranked_probability_score(y, named) == 0


def test_predictions_in_another_order_than_the_columns_of_counts_are_warned_of():
    words = ["soft", "medium", "hard", "very hard"]
    counts = pd.DataFrame(np.eye(4, dtype=int)[ranks(0, 4)], columns=words)
    model, other = DistributionalOrdinalRegressor(levels=words), words[1:] + words[:1]
    expected = cross_val_predict_proba(model, X, counts, cv=3)
    with pytest.warns(UserWarning, match="which y does not have"):
        proba = cross_val_predict_proba(model, X, counts[other], cv=3)
    np.testing.assert_allclose(proba, expected)
    score = ranked_probability_score(counts[other], proba, levels=words)
    assert score == pytest.approx(ranked_probability_score(counts, expected))


def test_levels_without_a_category_whose_column_was_dropped():
    """As of "don't know", dropped from a crosstab: its category stays."""
    words = ["soft", "don't know", "medium", "hard"]
    index = pd.CategoricalIndex(words, words, ordered=True)
    table = pd.DataFrame(COUNTS, columns=index).drop(columns="don't know")
    counts, found = check_ratings(table, [words[0], *words[2:]])
    assert found.tolist() == [words[0], *words[2:]]
    assert_array_equal(counts, COUNTS[:, [0, 2, 3]])
    counts, found = check_ratings(table)
    assert found.tolist() == words
    assert_array_equal(counts, COUNTS * [1, 0, 1, 1])


def test_levels_of_the_model_win_over_the_categories_of_ratings():
    """As read_stata makes them by itself, in the order of the codebook."""
    words = ["low", "some", "high", "most"]
    X = np.arange(24.0)[:, None] % 8
    y = np.array(words)[(X[:, 0] // 2).astype(int)]
    model = DistributionalOrdinalRegressor(levels=words).fit(X, y)
    expected = cross_val_predict_proba(model, X, y, cv=3)
    score = -ranked_probability_score(y, model.predict_proba(X), levels=words)
    for names in (words[::-1], sorted(words)):
        named = pd.Series(pd.Categorical(y, names, ordered=True), name="y")
        assert model.score(X, named) == neg_rps_scorer(model, X, named) == score
        with pytest.warns(UserWarning, match="which y does not have"):
            assert_array_equal(cross_val_predict_proba(model, X, named, cv=3), expected)
        report = model_report(model, X, named, cv=3)
        rps = ranked_probability_score(y, expected, levels=words)
        assert report.scores.loc[("ratings", "model"), "rps"] == pytest.approx(rps)


def test_words_that_ratings_name_in_part_are_refused():
    """Their order was that of the alphabet: RPS .50 for .33."""
    words, X = ["some", "low", "high"], np.arange(9.0)[:, None]
    classifier = GaussianNB().fit(X, np.repeat(words, 3))
    y = pd.Series(pd.Categorical(np.repeat(words, 3)[:6], words[:2], ordered=True))
    counts = pd.DataFrame(np.eye(2, dtype=int)[[0, 1] * 3], columns=words[:2])
    for ratings in (y, counts):
        with pytest.raises(ValueError, match="let the categories, or columns, of y be"):
            neg_rps_scorer(classifier, X[:6], ratings)
        with pytest.raises(ValueError, match="let the categories, or columns, of y be"):
            ConformalRatings(classifier, method="prefit").fit(
                X[:6], ratings, groups=range(6)
            )
    known = DistributionalOrdinalRegressor(levels=words).fit(X, np.repeat(words, 3))
    assert np.isfinite(neg_rps_scorer(known, X[:6], y))


@pytest.mark.slow
def test_figures_name_the_levels():
    y = pd.DataFrame(COUNTS + 1, columns=NAMES)
    shuffled = y[[4, 1, 5, 2]]
    proba = pd.DataFrame(PROBA, columns=NAMES)[[5, 4, 2, 1]]
    for one in (shuffled[:1], shuffled.iloc[0]):
        for display in (
            InverseCDFDisplay.from_counts(one),
            InverseCDFDisplay.from_predictions(one, proba),
            DistributionDisplay.from_predictions(one, proba),
        ):
            assert display.levels.tolist() == NAMES
            assert_array_equal(display.counts, COUNTS[0] + 1)
    assert_array_equal(display.y_proba, PROBA)
    ratings = RatingsDisplay.from_counts({"rough": shuffled, "hard": y})
    assert ratings.levels.tolist() == NAMES
    assert_array_equal(ratings.counts["rough"], COUNTS + 1)
    assert_array_equal(
        InterraterAgreementDisplay.from_counts(shuffled).agreement["ratings"],
        interrater_agreement(COUNTS + 1),
    )
    reliability = ReliabilityDisplay.from_predictions(shuffled, proba, n_bins=2)
    plain = ReliabilityDisplay.from_predictions(COUNTS + 1, PROBA, n_bins=2)
    assert reliability.levels.tolist() == NAMES
    for observed, expected in zip(reliability.observed, plain.observed, strict=True):
        assert_array_equal(observed, expected)
    assert_array_equal(
        PITHistogramDisplay.from_predictions(shuffled, proba).heights,
        pit_histogram(COUNTS + 1, PROBA),
    )
    other = y.rename(columns={4: 3})
    with pytest.raises(ValueError, match=r"\['hard'\] has other rows or levels"):
        RatingsDisplay.from_counts({"rough": y, "hard": other})


def test_ratings_in_the_order_of_levels():
    y = pd.DataFrame(COUNTS + 1, columns=NAMES)[[5, 4, 2, 1]]
    for function in (rating_distribution, rating_cdf, interrater_agreement):
        assert_array_equal(function(y), function(COUNTS + 1))
    p = [0.1, 0.5, 0.9]
    index = inverse_cdf(COUNTS + 1, p) - 1
    assert_array_equal(inverse_cdf(y, p), np.array(NAMES)[index])


@pytest.mark.slow
@settings(deadline=None)
@given(
    objects=st.lists(
        st.integers(0, 9) | st.sampled_from([2**53, 2**53 + 1, 2**63 - 1]),
        min_size=1,
    )
    | st.lists(st.text(max_size=3), min_size=1),
    data=st.data(),
)
def test_counts_are_aligned_to_trials_whatever_the_ids(objects, data):
    levels = [1, 2, 4]
    ratings = [data.draw(st.sampled_from(levels)) for _ in objects]
    table = rating_counts(ratings, objects, levels=levels)
    wanted = data.draw(st.lists(st.sampled_from(objects), min_size=1))
    given_by_people = list(zip(objects, ratings))
    expected = [[given_by_people.count((o, k)) for k in levels] for o in wanted]
    assert table.counts_for(wanted).to_numpy().tolist() == expected
    assert table.objects.tolist() == sorted(set(objects))
    unknown = 7.5 if isinstance(objects[0], int) else "not one of them"
    with pytest.raises(ValueError, match=f"no ratings of objects .*{unknown}"):
        table.counts_for([*wanted, unknown])


@pytest.mark.parametrize("place", [0, 3])
def test_columns_that_pandas_names_are_no_levels_answers_or_features(place):
    """Of a table saved with its index and read without."""
    table = pd.DataFrame(COUNTS, columns=["very soft", "soft", "hard", "very hard"])
    read = table.copy()
    read.insert(place, f"Unnamed: {place}", range(len(table)))
    X = np.arange(len(table), dtype=float)[:, np.newaxis]
    answers, model = read.drop(columns="soft"), ContinuousRatingsRegressor(NNPOM(0))
    for call in (
        lambda: DistributionalOrdinalRegressor().fit(X, read),
        lambda: ranked_probability_score(read, np.full((len(read), 5), 0.2)),
        lambda: model.fit(X, answers),
        lambda: DistributionalOrdinalRegressor().fit(read, table),
    ):
        with pytest.raises(ValueError, match=f"has a column 'Unnamed: {place}', as pa"):
            call()
