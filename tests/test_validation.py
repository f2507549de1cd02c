"""Which inputs are tables, which are trials, and what bad ones are told."""

import re
from datetime import date, timedelta
from itertools import permutations

import numpy as np
import pandas as pd
import polars as pl
import pytest
from scipy import sparse
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    ConformalRatings,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    DummyDistribution,
    RepairTrials,
    TouchPool,
    make_haptic_pipeline,
    resample_trials,
)
from sklearn_haptic.datasets import describe_corpus
from sklearn_haptic.metrics import (
    crps,
    macro_mae_at_positions,
    neg_macro_mae_scorer,
    noise_ceiling,
    ranked_probability_score,
)
from sklearn_haptic.model_selection import cross_val_predict_proba, model_report
from sklearn_haptic.plotting import (
    InterraterAgreementDisplay,
    PITHistogramDisplay,
    RatingsDisplay,
    ReliabilityDisplay,
    TouchTimeDisplay,
)
from sklearn_haptic.ratings import outlying_raters, rating_counts
from sklearn_haptic.recordings._sequences import Sequences, row_index
from sklearn_haptic.recordings._trials import channel_names, check_trials, is_table
from sklearn_haptic.study import run_study
from sklearn_haptic.utils._validation import check_numbers

TRIAL = np.arange(6.0).reshape(3, 2)
RAGGED = [TRIAL, TRIAL[:2]]


def object_array(cells):
    array = np.empty(len(cells), dtype=object)
    array[:] = cells
    return array


class Labelled:
    """An array with names of its axes, as of xarray."""

    def __init__(self, values):
        self.values, self.shape, self.ndim = values, values.shape, values.ndim

    def __array__(self, dtype=None, copy=None):
        return np.array(self.values, dtype, copy=copy)

    def __len__(self):
        return len(self.values)

    def __getitem__(self, key):
        return Labelled(self.values[key])

    def to_numpy(self):
        return self.values

    def to_series(self):
        return pd.Series(self.values.ravel())


TABLES = {
    "array": np.eye(3),
    "vector": np.ones(3),
    "lists": [[1, 2], [3, 4]],
    "numbers": [1, 2, 3],
    "empty list": [],
    "string": "abc",
    "scalar": 3,
    "sparse": sparse.csr_array(np.eye(3)),
    "frame": pd.DataFrame({"a": [1.0, 2.0], "b": [3.0, 4.0]}),
    "one-column frame of numbers": pd.DataFrame({"a": [1.0, 2.0]}),
    "polars frame": pl.DataFrame({"a": [1.0, 2.0], "b": [3.0, 4.0]}),
    "dict": {"a": TRIAL, "b": TRIAL},
    "frame of numbers and names": pd.DataFrame({"a": ["x", "y"], "b": [3.0, 4.0]}),
    "polars frame of numbers and names": pl.DataFrame({"a": ["x", "y"], "b": [3, 4]}),
    "objects in two dimensions": np.array([[1, "a"], [2, "b"]], dtype=object),
}
TRIALS = {
    "list": RAGGED,
    "tuple": tuple(RAGGED),
    "three dimensions": np.stack([TRIAL, TRIAL]),
    "labelled array": Labelled(np.stack([TRIAL, TRIAL])),
    "object array": object_array(RAGGED),
    "series": pd.Series(RAGGED),
    "one-column frame": pd.DataFrame({"pac": RAGGED}),
    "sequences": Sequences(RAGGED, ["a", "b"]),
    "vectors of two lengths": [[1, 2, 3], [4, 5]],
    "object array with a column": object_array(RAGGED).reshape(2, 1),
    "frames": [pd.DataFrame(TRIAL, columns=["a", "b"]), TRIAL],
    "frames of polars": [pl.DataFrame(TRIAL, schema=["a", "b"])] * 2,
    "object array of vectors": object_array([np.ones(3), np.ones(3)]),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables(name):
    assert is_table(TABLES[name])


@pytest.mark.parametrize("name", TRIALS)
def test_trials(name):
    assert not is_table(TRIALS[name])
    trials = check_trials(TRIALS[name])
    assert [trial.ndim for trial in trials] == [2, 2]
    assert all(trial.dtype == np.float64 for trial in trials)


@pytest.mark.parametrize("form", [np.stack, lambda trials: Labelled(np.stack(trials))])
def test_arrays_of_trials_are_repaired_and_described_as_lists_are(form):
    trials = [np.arange(6.0).reshape(3, 2), np.array([[0, 1], [np.nan, 3], [4, 5]])]
    np.testing.assert_array_equal(
        RepairTrials().fit_transform(form(trials)), RepairTrials().fit_transform(trials)
    )
    of_list, of_array = (describe_corpus(X).sensors for X in (trials, form(trials)))
    pd.testing.assert_frame_equal(of_list, of_array)


def test_float32_is_kept_and_not_copied_but_mixtures_are_float64():
    single = TRIAL.astype(np.float32)
    assert check_trials([single])[0] is single
    assert {t.dtype.name for t in check_trials([single, TRIAL])} == {"float64"}
    assert check_trials([TRIAL.astype(int)])[0].dtype == np.float64


FRAME = pd.DataFrame({"x": [1.0, 2, 3], "y": [4.0, 5, 6], 7: [7.0, 8, 9]})


@pytest.mark.parametrize("library", ["pandas", "polars"])
@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_columns_of_trials_are_matched_by_name(library, order):
    first = FRAME.rename(columns=str)
    swapped = first.iloc[:, list(order)]
    wanted = np.array([[row[name] for name in "xy7"] for _, row in first.iterrows()])
    if library == "polars":
        first, swapped = pl.from_pandas(first), pl.from_pandas(swapped)
    for X, names in [
        ([first, swapped], None),
        ([swapped], channel_names([first])),
        (object_array([swapped]), ["x", "y", "7"]),
        ([wanted, first, swapped], None),
    ]:
        for trial in check_trials(X, n_channels=names and 3, names=names):
            np.testing.assert_array_equal(trial, wanted)


def test_columns_that_are_not_those_of_the_first_trial_or_of_fit():
    other = FRAME.rename(columns={"y": "z"})
    with pytest.raises(ValueError, match="Trial 1 of X and the first trial differ in"):
        check_trials([FRAME, other])
    message = "Trial 0 of X and fit differ in the column 'y'; give all trials the same"
    for bad in (other, FRAME[["x", 7]], FRAME[["x", "x", 7]]):
        with pytest.raises(ValueError, match=message.replace("'y'", "('y'|'x')")):
            check_trials([bad], n_channels=3, names=channel_names([FRAME]))


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_numbers_are_names(order):
    """Columns of a file without a header stay in the order in which they are given."""
    wired = FRAME.set_axis(range(3), axis=1)[list(order)]
    back = wired[[0, 1, 2]]
    for X in ([wired, back], [wired.to_numpy(), back, wired]):
        for trial in check_trials(X, names=list(order)):
            np.testing.assert_array_equal(trial, wired.to_numpy())
    np.testing.assert_array_equal(check_trials([wired, back])[1], wired)
    np.testing.assert_array_equal(check_trials([back, wired])[1], back)


def test_trials_without_columns_are_taken_as_they_are():
    array = FRAME.to_numpy()
    assert channel_names([array, array]) is None
    for X, names in (([array], channel_names([FRAME])), ([FRAME], None)):
        np.testing.assert_array_equal(check_trials(X, names=names)[0], array)
    with pytest.raises(ValueError, match="differ in the column 'x'"):
        check_trials([FRAME, FRAME.set_axis(range(3), axis=1)])


@pytest.mark.parametrize("library", ["pandas", "polars"])
@pytest.mark.parametrize(
    "values",
    [
        pd.date_range("2020", periods=3),
        pd.date_range("2020", periods=3, tz="UTC"),
        [timedelta(seconds=1)] * 3,
        pd.Series([date(2020, 1, 1)] * 3, dtype=object),
        pd.Series(["1", "2", "3"]),
    ],
    ids=["times", "zone", "durations", "dates", "text"],
)
def test_a_column_of_dates_or_text_is_named(library, values):
    frame = pd.DataFrame if library == "pandas" else pl.DataFrame
    table = frame({"force": [1.0, 2, 3], "when": list(values)})
    with pytest.raises(ValueError, match=r"^X is not .* \(column 'when' holds text or"):
        check_numbers(table, "X")
    check_numbers(table[["force"]], "X")


@pytest.mark.parametrize(
    "values", [{}, {"a": [1]}, {1, 2}, iter([1]), (i for i in [1]), map(abs, [1])]
)
def test_what_is_no_array(values):
    name = type(values).__name__
    with pytest.raises(ValueError, match=f"^X is a {name}, which is no array; give a"):
        check_numbers(values, "X")


def test_row_index():
    series = pd.Series(RAGGED, index=["a", "b"])
    assert row_index(series).tolist() == ["a", "b"]
    assert row_index(Sequences(RAGGED, ["x", "y"], series.index)) is series.index
    assert row_index(RAGGED) is None
    assert row_index(np.eye(2)) is None


SLIDERS = ContinuousRatingsRegressor(DummyDistribution())
REORDERED = (
    "has the row labels of {} in another order, but rows are matched by position"
)


def counts_by_name():
    """Features of named touches and, sorted by name as crosstab does, their counts."""
    names = [f"cup_{i}" for i in range(1, 13)]
    features = pd.DataFrame({"force": np.arange(12.0)}, index=names)
    answers = pd.DataFrame({"touch": names * 2, "rating": [1] * 12 + [1, 2] * 6})
    return features, pd.crosstab(answers["touch"], answers["rating"])


@pytest.mark.parametrize(
    "use",
    [
        DistributionalOrdinalRegressor().fit,
        lambda X, y: DummyDistribution().fit(X, y, np.arange(1, 13)),
        DistributionBlend([("one", DistributionalOrdinalRegressor())]).fit,
        ContinuousRatingsRegressor().fit,
        TouchPool([("force", DistributionalOrdinalRegressor(), ["force"])]).fit,
        make_haptic_pipeline(None).fit,
        lambda X, y: cross_val_predict_proba(DummyDistribution(), X, y, cv=2),
        lambda X, y: model_report(DummyDistribution(), X, y, groups=range(12), cv=2),
        lambda X, y: DummyDistribution().fit(X, y.loc[X.index]).score(X, y),
        lambda X, y: ContinuousRatingsRegressor().fit(X, y.loc[X.index]).score(X, y),
        lambda X, y: make_haptic_pipeline(None).score(X, y),
    ],
    ids=[
        "regressor",
        "baseline",
        "blend",
        "sliders",
        "pool",
        "pipeline",
        "out of fold",
        "report",
        "score",
        "score of sliders",
        "score of a pipeline",
    ],
)
def test_ratings_of_named_touches_in_another_order(use):
    X, y = counts_by_name()
    with pytest.raises(ValueError, match="^y " + REORDERED.format("X")):
        use(X, y)


def test_validation_trials_of_named_touches_in_another_order():
    X, y = counts_by_name()
    model = DistributionalOrdinalRegressor(NNPOM(2, early_stopping=True))
    with pytest.raises(ValueError, match="^y_val " + REORDERED.format("X_val")):
        model.fit(X, y.to_numpy(), X_val=X, y_val=y)


def test_ratings_of_several_touches_of_each_name_in_another_order():
    X, y = counts_by_name()
    X, y = pd.concat([X, X]), y.loc[[*X.index, *X.index]]
    model = DistributionalOrdinalRegressor()
    assert len(model.fit(X, y).predict_proba(X)) == 24
    with pytest.raises(ValueError, match="^y " + REORDERED.format("X")):
        model.fit(X, y.sort_index())


def test_folds_of_named_touches_in_another_order():
    """scikit-learn hands on a part of each, with labels that the other may lack."""
    X, y = counts_by_name()
    model, scoring = DistributionalOrdinalRegressor(), neg_macro_mae_scorer
    scores = cross_val_score(model, X, y.loc[X.index], scoring=scoring, cv=3)
    assert np.isfinite(scores).all()
    with pytest.raises(ValueError, match=REORDERED.format("X")):
        cross_val_score(model, X, y, scoring=scoring, cv=3, error_score="raise")


def test_rows_whose_labels_are_of_different_objects():
    """Those at the same place may be the same."""
    X, y = counts_by_name()
    y = y.loc[X.index].rename({"cup_3": "pot", "cup_7": "lid"})
    proba = DistributionalOrdinalRegressor().fit(X, y).predict_proba(X)
    same = DistributionalOrdinalRegressor().fit(X, y.to_numpy()).predict_proba(X)
    np.testing.assert_array_equal(proba, same)


def test_rows_in_the_order_of_touches_or_without_names():
    X, y = counts_by_name()
    expected = DistributionalOrdinalRegressor().fit(X, y.loc[X.index]).predict_proba(X)
    sorted_rows = X.loc[y.index]
    for rows, ratings in [
        (X, y.loc[X.index]),
        (sorted_rows, y),
        (sorted_rows.reset_index(drop=True), y),
        (X, y.loc[X.index].reset_index(drop=True)),
    ]:
        model = DistributionalOrdinalRegressor().fit(rows, ratings)
        np.testing.assert_allclose(model.predict_proba(X), expected, atol=1e-6)


def test_predictions_of_named_touches_in_another_order():
    X, y = counts_by_name()
    proba = pd.DataFrame(np.tile([0.7, 0.3], (12, 1)), X.index, [1, 2])
    with pytest.raises(ValueError, match="^y_proba " + REORDERED.format("y_true")):
        ranked_probability_score(y, proba)
    assert ranked_probability_score(y, proba.loc[y.index]) == pytest.approx(0.19)


@pytest.mark.parametrize(
    "use",
    [
        cross_val_predict_proba,
        model_report,
        lambda model, *data, **groups: TouchPool([("x", model, [0])]).fit(
            *data, **groups
        ),
        lambda model, *data, **groups: ConformalRatings(model).fit(*data, **groups),
    ],
    ids=["out of fold", "report", "pool", "conformal"],
)
def test_groups_in_another_order_than_ratings_where_features_have_no_labels(use):
    X, y = counts_by_name()
    groups = pd.Series(range(12), y.index[::-1])
    with pytest.raises(ValueError, match="^groups " + REORDERED.format("y")):
        use(DistributionalOrdinalRegressor(), X.to_numpy(), y, groups=groups)


def test_reports_compare_all_that_they_are_given_where_features_have_no_labels():
    X, y = counts_by_name()
    X, given = X.to_numpy(), pd.Series(range(1, 13), y.index[::-1])
    weights, adjectives = {"sample_weight": given}, {"a": y.to_numpy(), "b": y}
    with pytest.raises(ValueError, match="^sample_weight " + REORDERED.format("y")):
        model_report(SLIDERS, X, y, groups=range(12), params=weights)
    with pytest.raises(ValueError, match="^groups " + REORDERED.format(r"y\['b'\]")):
        model_report(DummyDistribution(), X, adjectives, groups=given)


@pytest.mark.parametrize("name", ["groups", "sample_weight"])
@pytest.mark.parametrize(
    "model",
    [
        NNPOM(n_hidden=0),
        DistributionalOrdinalRegressor(NNPOM(n_hidden=0)),
        DistributionBlend([("one", DistributionalOrdinalRegressor())]),
        ContinuousRatingsRegressor(),
    ],
    ids=lambda model: type(model).__name__,
)
def test_what_is_given_of_named_touches_in_another_order(model, name):
    X, y = counts_by_name()
    y = y.loc[X.index]
    given = pd.Series(range(1, 13), y.index[::-1])
    with pytest.raises(ValueError, match=f"^{name} " + REORDERED.format("X")):
        model.fit(X, y, **{name: given})
    with pytest.raises(ValueError, match=f"^{name} " + REORDERED.format("y")):
        model.fit(X.to_numpy(), y, **{name: given})


@pytest.mark.parametrize(
    "use",
    [
        lambda X, y, given: make_haptic_pipeline(None).fit(X, y, model__groups=given),
        lambda X, y, given: make_haptic_pipeline(None).score(X, y, given),
        lambda X, y, given: DummyDistribution().fit(X, y).score(X, y, given),
        lambda X, y, given: ContinuousRatingsRegressor().fit(X, y).score(X, y, given),
        lambda X, y, given: neg_macro_mae_scorer(
            DummyDistribution().fit(X, y), X, y, given
        ),
        lambda X, y, given: cross_val_predict_proba(
            DummyDistribution(), X, y, cv=2, params={"sample_weight": given}
        ),
        lambda X, y, given: (
            ConformalRatings(make_pipeline(StandardScaler(), SLIDERS))
            .fit(X, y, groups=range(12))
            .score(X, y, given)
        ),
        lambda X, y, given: ReliabilityDisplay.from_estimator(
            DummyDistribution().fit(X, y), X, y.to_numpy(), groups=given
        ),
    ],
    ids=[
        "pipeline",
        "its score",
        "score",
        "score of sliders",
        "scorer",
        "params",
        "score of a pipeline of sliders",
        "display",
    ],
)
def test_what_is_handed_on_of_named_touches_in_another_order(use):
    X, y = counts_by_name()
    y = y.loc[X.index]
    given = pd.Series(range(1, 13), y.index[::-1])
    with pytest.raises(ValueError, match=REORDERED.format("X")):
        use(X, y, given)


RATED = pd.DataFrame([[1, 2], [3, 5], [6, 9]], ["tin", "mat", "cup"])
OTHERWISE = RATED.astype(float).iloc[::-1]


@pytest.mark.parametrize(
    "name, score",
    [
        ("values", lambda y: crps(y, [0, 1], OTHERWISE)),
        ("y_pred", lambda y: macro_mae_at_positions(y, OTHERWISE, [0.2, 0.8])),
        ("sample_weight", lambda y: noise_ceiling(y, sample_weight=OTHERWISE[0])),
        (
            "groups",
            lambda y: PITHistogramDisplay.from_predictions(
                y, [[0.5, 0.5]] * 3, groups=OTHERWISE[0]
            ),
        ),
        (
            "groups",
            lambda y: TouchTimeDisplay.from_predictions(
                y, [[[0.5, 0.5]]] * 3, [1], groups=OTHERWISE[0]
            ),
        ),
    ],
    ids=["crps", "positions", "weights", "objects of a histogram", "of touch times"],
)
def test_scores_and_displays_of_named_touches_in_another_order(name, score):
    with pytest.raises(ValueError, match=f"^{name} " + REORDERED.format("y_true")):
        score(RATED)


def test_drawn_ratings_of_named_objects_in_another_order():
    first = re.escape("counts['soft']")
    tables = {"soft": RATED, "hard": OTHERWISE}
    for display in RatingsDisplay, InterraterAgreementDisplay:
        with pytest.raises(ValueError, match=REORDERED.format(first)):
            display.from_counts(tables)
        with pytest.raises(ValueError, match="^objects " + REORDERED.format("counts")):
            display.from_counts(RATED, objects=pd.Series(range(3), OTHERWISE.index))


def test_ratings_of_different_objects_are_not_drawn_side_by_side():
    other = RATED.rename({"cup": "pot"})
    with pytest.raises(ValueError, match="has other rows or levels"):
        RatingsDisplay.from_counts({"soft": RATED, "hard": other})
    RatingsDisplay.from_counts({"soft": RATED, "hard": other.reset_index(drop=True)})


def test_ratings_of_several_adjectives_in_another_order():
    model, X = DummyDistribution(), np.zeros((3, 1))
    with pytest.raises(ValueError, match=REORDERED.format(r"y\['soft'\]")):
        model_report(model, X, {"soft": RATED, "hard": OTHERWISE}, cv=3)


def test_objects_of_named_touches_in_another_order():
    X, y = counts_by_name()
    y = y.loc[X.index]
    groups = pd.Series(range(12), y.index[::-1])
    with pytest.raises(ValueError, match="^groups " + REORDERED.format("X")):
        cross_val_predict_proba(DummyDistribution(), X, y, groups=groups, cv=2)


def test_answers_in_another_order_than_their_objects():
    answers = pd.DataFrame({"object": ["tin", "mat"] * 2, "rating": [5, 1, 4, 2]})
    answers["rater"] = [1, 1, 2, 2]
    by_rating = answers.sort_values("rating")
    with pytest.raises(ValueError, match="^objects " + REORDERED.format("ratings")):
        rating_counts(by_rating["rating"], answers["object"])
    with pytest.raises(ValueError, match="^raters " + REORDERED.format("ratings")):
        rating_counts(by_rating["rating"], by_rating["object"], answers["rater"])
    with pytest.raises(ValueError, match="^objects " + REORDERED.format("ratings")):
        outlying_raters(by_rating[["rating"]], answers["object"], by_rating["rater"])
    with pytest.raises(ValueError, match="^raters " + REORDERED.format("ratings")):
        outlying_raters(by_rating[["rating"]], by_rating["object"], answers["rater"])
    expected = pd.crosstab(answers["object"], answers["rating"])
    table = rating_counts(by_rating["rating"], by_rating["object"])
    assert table.counts.to_numpy().tolist() == expected.to_numpy().tolist()


def test_stamps_of_named_touches_in_another_order():
    trials = pd.Series([np.zeros(3), np.ones(3)], ["a", "b"])
    times = pd.Series([[0, 1, 2], [0, 2, 4]], ["b", "a"])
    with pytest.raises(ValueError, match="^times " + REORDERED.format("trials")):
        resample_trials(trials, times, rate=1)
    assert [len(t) for t in resample_trials(trials, times.loc[["a", "b"]], 1)] == [5, 3]


@pytest.mark.parametrize("what", ["objects", r"ratings\['soft'\]"])
def test_a_corpus_in_another_order(tmp_path, what):
    X, y = counts_by_name()
    X = X.map(lambda force: np.full((60, 1), force))
    objects = pd.Series([f"cup {i // 2}" for i in range(12)], X.index)
    sorted_too = {"objects": objects.loc[y.index]} if what == "objects" else {}
    ratings = {"soft": y.loc[X.index] if what == "objects" else y}
    touches = {"trials": X, "objects": objects, "ratings": ratings, **sorted_too}
    with pytest.raises(ValueError, match=f"^{what} " + REORDERED.format("trials")):
        run_study({"tap": touches}, tmp_path / "study", verbose=False)
