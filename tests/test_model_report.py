"""`model_report` against loops over folds and objects written by hand."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy.stats import ttest_1samp
from sklearn.base import BaseEstimator, clone
from sklearn.compose import ColumnTransformer
from sklearn.dummy import DummyClassifier
from sklearn.frozen import FrozenEstimator
from sklearn.metrics import accuracy_score, balanced_accuracy_score, confusion_matrix
from sklearn.model_selection import GridSearchCV, GroupKFold, KFold
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from test_out_of_fold import COUNTS, OBJECTS, REGRESSOR, X

from sklearn_haptic import (
    NNPOM,
    ConformalRatings,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import (
    crps,
    dispersion,
    earth_movers_distance,
    log_score,
    macro_mae,
    noise_ceiling,
    ranked_probability_score,
)
from sklearn_haptic.model_selection import cross_val_predict_proba, model_report
from sklearn_haptic.model_selection._model_report import gain_over_objects
from sklearn_haptic.utils._folds import ObjectKFold

pytestmark = pytest.mark.usefixtures("one_thread")

LINEAR = DistributionalOrdinalRegressor(NNPOM(0, alpha=3.0))
FUNCTIONS = {
    "rps": ranked_probability_score,
    "emd": earth_movers_distance,
    "macro_mae": macro_mae,
    "log_score": log_score,
    "dispersion": dispersion,
}


@pytest.fixture(scope="module")
def report():
    y = {"first": COUNTS, 2: np.roll(COUNTS, 5, axis=0)}
    return model_report(LINEAR, X, y, groups=OBJECTS, cv=3)


def test_scores_of_the_model_and_of_both_baselines(report):
    assert report.scores.index.get_level_values(0).unique().tolist() == [*("first", 2)]
    models = {
        "model": LINEAR,
        "marginal": DummyDistribution(),
        "barycentre": DummyDistribution("barycentre"),
    }
    for name, model in models.items():
        proba = cross_val_predict_proba(model, X, COUNTS, groups=OBJECTS, cv=3)
        for score, function in FUNCTIONS.items():
            expected = function(COUNTS, proba)
            assert report.scores.at[("first", name), score] == pytest.approx(expected)
        if name == "model":
            np.testing.assert_allclose(report.predicted["first"], proba, atol=1e-12)


def test_gains_are_paired_over_objects(report):
    proba = {}
    for model in (LINEAR, DummyDistribution(), DummyDistribution("barycentre")):
        proba[model] = cross_val_predict_proba(model, X, COUNTS, groups=OBJECTS, cv=3)
    rps = [
        ranked_probability_score(COUNTS, each, average=False) for each in proba.values()
    ]
    guess = min(rps[1:], key=np.mean)
    of_objects = [
        (guess - rps[0])[each == OBJECTS].mean() for each in np.unique(OBJECTS)
    ]
    row = report.gains.loc["first"]
    assert row["rps"] == pytest.approx(rps[0].mean())
    assert row["rps_guess"] == pytest.approx(guess.mean())
    assert row["gain"] == pytest.approx(np.mean(of_objects))
    error = np.std(of_objects, ddof=1) / np.sqrt(len(of_objects))
    assert row["standard_error"] == pytest.approx(error)
    assert ttest_1samp(of_objects, 0).pvalue < 0.05 and row["verdict"] == "better"


def test_the_ceiling_is_half_the_distance_between_two_people(report):
    """Of all pairs of people who rated the object of a trial, averaged over trials."""
    expected = []
    for row in COUNTS:
        people = np.repeat(np.arange(len(row)), row.astype(int))
        far = np.abs(people[:, None] - people).sum()
        expected.append(far / (len(people) * (len(people) - 1)) / 2)
    assert report.gains.at["first", "rps_ceiling"] == pytest.approx(np.mean(expected))
    alone = model_report(LINEAR, X, COUNTS.argmax(axis=1), groups=OBJECTS, cv=3)
    assert np.isnan(alone.gains["rps_ceiling"].iloc[0])


def test_the_conclusion_says_what_the_tables_do(report):
    assert report.gains["verdict"].tolist() == ["better", "not shown"]
    gain = report.gains["gain"].mean()
    told = f"its RPS is lower by {gain:.3f} on average over 2 adjectives (95% interval "
    assert told in report.conclusion
    assert report.conclusion.endswith(f"over {len(np.unique(OBJECTS))} objects).")
    shown = repr(report)
    assert report.conclusion in re.sub(r"\s+", " ", shown)
    for name, row in report.gains.iterrows():
        numbers = [f"{row[c]:.3f}".rstrip("0") for c in ("dispersion", "rps", "gain")]
        assert re.search(rf"^{name} +1 to 5 .*" + ".*".join(numbers), shown, re.M)


def test_levels_are_those_that_the_ratings_name():
    named = pd.DataFrame(COUNTS, columns=[-3, -1, 0, 1, 3])
    report = model_report(LINEAR, X, named, groups=OBJECTS, cv=3)
    assert report.gains["levels"].tolist() == ["-3 to 3"]


@pytest.mark.parametrize("n_objects", [4, 12])
def test_the_interval_of_few_objects_holds(n_objects):
    """In 95% of draws, however unequal the numbers of touches."""
    rng = np.random.default_rng(0)
    touches = np.resize([1, 2, 4, 3], n_objects)
    objects, held = np.repeat(np.arange(n_objects), touches), 0
    for _ in range(2000):
        gains = rng.normal(size=n_objects)[objects] + rng.normal(size=len(objects)) / 4
        found = gain_over_objects(gains, objects)
        assert found["gain"] == pytest.approx(gains.mean())
        assert (found["lower"] > 0 or found["upper"] < 0) == (
            found["verdict"] != "not shown"
        )
        held += found["lower"] < 0 < found["upper"]
    assert 0.935 < held / 2000 < 0.965  # three standard errors


@pytest.mark.parametrize(
    ("sign", "verdict", "words"),
    [
        (1, "better", "The model is better than guessing: its RPS is lower by 0."),
        (-1, "worse", "The model is worse than guessing: its RPS is higher by 0."),
    ],
)
def test_verdict_of_a_model_that_knows(sign, verdict, words):
    """Of two sets of features, one is the answer and the other its contrary."""

    class Knows(DummyDistribution):
        def predict_proba(self, X):
            return X[:, 5:] if sign < 0 else X[:, :5]

    share = COUNTS / COUNTS.sum(axis=1, keepdims=True)
    told = np.hstack([share, np.eye(5)[4 - COUNTS.argmax(axis=1)]])
    report = model_report(Knows(), told, COUNTS, groups=OBJECTS, cv=4)
    assert report.gains["verdict"].tolist() == [verdict]
    assert report.conclusion.startswith(words)
    assert ("raise its penalty" in report.conclusion) == (sign < 0)


def test_a_baseline_is_no_better_than_itself():
    counts = COUNTS * [1, 1, 1, 1, 0] + np.eye(5, dtype=int)[4] * (
        OBJECTS[:, None] == 0
    )
    report = model_report(DummyDistribution(), X, counts, groups=OBJECTS, cv=3)
    assert report.gains["verdict"].tolist() == ["not shown"]
    assert report.conclusion.startswith("The model is not shown to be better than")
    assert re.search(r"^barycentre .* inf ", repr(report), re.M)


def test_given_test_trials_and_labels():
    labels = COUNTS.argmax(axis=1) + 3
    train, test = next(GroupKFold(4).split(X, groups=OBJECTS))
    report = model_report(REGRESSOR, X, labels, groups=OBJECTS, cv=[(train, test)])
    assert report.tested.tolist() == test.tolist()
    model = clone(REGRESSOR).fit(X[train], labels[train])
    found = report.predicted["ratings"][:, : len(model.classes_)]
    np.testing.assert_allclose(found, model.predict_proba(X[test]))
    assert (
        f" {len(test)} trials were predicted in 1 fold, learned from at least "
        f"{len(train)} others."
    ) in report.summary
    rows = model_report(REGRESSOR, X, labels, groups=OBJECTS, cv=[(train, test[::-1])])
    np.testing.assert_allclose(rows.predicted["ratings"], report.predicted["ratings"])


def test_adjectives_learned_together():
    both = np.stack([COUNTS, COUNTS[:, ::-1]], axis=1)
    report = model_report(REGRESSOR, X, both, groups=OBJECTS, cv=3)
    assert report.gains.index.tolist() == ["ratings[:, 0]", "ratings[:, 1]"]
    proba = cross_val_predict_proba(REGRESSOR, X, both, groups=OBJECTS, cv=3)
    for i, name in enumerate(report.gains.index):
        np.testing.assert_allclose(report.predicted[name], proba[:, i], atol=1e-12)


def test_objects_on_both_sides_are_told():
    cv = KFold(4, shuffle=True, random_state=0)
    with pytest.warns(UserWarning, match="groups parameter is ignored"):
        report = model_report(DummyDistribution(), X, COUNTS, groups=OBJECTS, cv=cv)
    known = sum(np.isin(OBJECTS[b], OBJECTS[a]).sum() for a, b in cv.split(X))
    assert f"But {known} test trials are of objects that were" in report.summary
    report = model_report(DummyDistribution(), X, COUNTS, cv=cv)
    assert f"over {len(X)} trials" in report.conclusion
    assert "is not known (groups=)" in report.summary
    report = model_report(DummyDistribution(), X, COUNTS, groups=OBJECTS)
    assert report.summary.endswith(
        "By groups=, no test object was touched in training."
    )


def test_sensors_times_and_html():
    corpus = make_haptic_corpus(6, 2, sensors=["pdc", "tac", "tdc"], random_state=0)
    model = make_haptic_pipeline(["pdc", "tdc"], random_state=0)
    y = {"<b>hard</b>": corpus.ratings["hard"]}
    report = model_report(model, corpus.trials, y, groups=corpus.objects, cv=2)
    assert report.seconds_to_learn > report.seconds_per_touch > 0
    assert not hasattr(model["model"], "classes_")  # a clone was fitted
    y["c"] = corpus.ratings["cold"]
    two = model_report(model, corpus.trials, y, cv=2)
    html = two._repr_html_()
    assert "<b>" not in html and "<th>&lt;b&gt;hard" in html
    assert two.gains.index.tolist() == ["<b>hard</b>", "c"]


def test_words_are_in_the_order_of_the_ratings_not_of_the_alphabet():
    """Classifiers sort their classes, and the alphabet has "9" behind "10"."""
    place = np.arange(len(X)) % 3
    ranks = pd.Series(pd.Categorical(place, ordered=True))
    numbers = model_report(GaussianNB(), X, ranks, cv=3)
    words = np.array(["2", "9", "10"])[place]
    y = pd.Series(pd.Categorical(words, ["2", "9", "10", "11"], ordered=True))
    named = model_report(GaussianNB(), X, y, cv=3)
    np.testing.assert_allclose(named.gains["rps"], numbers.gains["rps"])
    np.testing.assert_allclose(
        named.predicted["ratings"][:, :3], numbers.predicted["ratings"]
    )
    assert named.gains["levels"].tolist() == ["2 to 11"]


def test_a_gain_of_rounding_is_no_verdict():
    model = DistributionalOrdinalRegressor(DummyClassifier(strategy="prior"))
    for seed in range(6, 16):
        rng = np.random.default_rng(seed)
        n_objects = int(rng.integers(6, 21))
        objects = np.repeat(range(n_objects), 3)
        shares = rng.dirichlet(np.ones(5), n_objects)
        counts = np.array([rng.multinomial(12, each) for each in shares])[objects]
        features = rng.normal(size=(len(objects), 3))
        report = model_report(model, features, counts, groups=objects, cv=5)
        assert report.gains["verdict"].item() == "not shown"


def test_confusions_have_a_column_for_a_class_never_predicted():
    words = np.repeat(["ash", "cup", "tin"], 12)
    objects = np.tile(np.arange(6), 6)
    report = model_report(
        DummyClassifier(strategy="constant", constant="tin"),
        np.zeros((36, 1)),
        words,
        groups=objects,
        cv=3,
    )
    expected = confusion_matrix(words, np.full(36, "tin"))
    confusions = report.confusions["ratings"]
    np.testing.assert_array_equal(confusions, expected)
    assert [*confusions.columns] == [*confusions.index] == ["ash", "cup", "tin"]
    assert (confusions.index.name, confusions.columns.name) == ("true", "predicted")


def test_classes_have_no_order():
    """Accuracies and confusions as scikit-learn computes them."""
    rng = np.random.default_rng(0)
    words = np.array(["wood", "cork", "foam"])[rng.integers(3, size=len(X))]
    features = X + 2 * (words == "cork")[:, None]
    report = model_report(GaussianNB(), features, words, groups=OBJECTS, cv=3)
    folds = list(ObjectKFold(3).split(X, words, OBJECTS))
    predicted = np.empty(len(X), dtype=words.dtype)
    for train, test in folds:
        model = GaussianNB().fit(features[train], words[train])
        predicted[test] = model.predict(features[test])
    guess = np.full(len(X), max(words, key=words.tolist().count))
    for who, each in {"model": predicted, "most frequent": guess}.items():
        row = report.scores.loc["ratings", who]
        assert row["accuracy"] == pytest.approx(accuracy_score(words, each))
        balanced = balanced_accuracy_score(words, each)
        assert row["balanced_accuracy"] == pytest.approx(balanced)
    expected = confusion_matrix(words, predicted)
    np.testing.assert_array_equal(report.confusions["ratings"], expected)
    np.testing.assert_array_equal(report.predicted["ratings"], predicted)
    gains = (predicted == words) - (guess == words).astype(float)
    assert report.gains["gain"].item() == pytest.approx(gains.mean())
    assert "its accuracy is higher by" in report.conclusion
    assert report.summary.endswith("By groups=, no test group was touched in training.")
    with pytest.raises(ValueError, match=r"^Most touches held out are .* such as runs"):
        model_report(GaussianNB(), features, words, groups=words, cv=3)
    rare = np.where(OBJECTS[0] == OBJECTS, "rare", words)
    summary = model_report(GaussianNB(), features, rare, groups=OBJECTS, cv=3).summary
    assert f"{np.sum(rare == 'rare')} test trials could not be" in summary
    assert "(rare)" in summary
    unordered = pd.Series(words, dtype="category")
    again = model_report(GaussianNB(), features, unordered, groups=OBJECTS, cv=3)
    pd.testing.assert_frame_equal(again.gains, report.gains)


def test_noise_does_not_look_better_than_the_most_frequent_class():
    """Of equally frequent classes that of the training trials is the rarest tested."""
    rng = np.random.default_rng(0)
    words = np.repeat(["wood", "cork", "foam", "felt"], 10)
    folds = KFold(5, shuffle=True, random_state=0)
    verdicts = []
    for _ in range(20):
        noise = rng.normal(size=(40, 2))
        report = model_report(KNeighborsClassifier(1), noise, words, cv=folds)
        assert report.gains["accuracy_guess"].item() == 0.25
        verdicts += report.gains["verdict"].tolist()
    assert verdicts.count("better") <= 2


@pytest.mark.filterwarnings("ignore:GridSearchCV has cv=2, which splits by trial")
@pytest.mark.parametrize("place", ["around", "behind", "searched", "guaranteed"])
def test_sliders_beside_guesses_that_pool_answers(place):
    """The CRPS of both guesses by its definition: mean distances of answers."""
    rng = np.random.default_rng(0)
    answers = 20 * (X[:, :1] + rng.normal(size=(len(X), 5)))
    answers[3, 2:] = np.nan
    scaler, grid = StandardScaler(), np.linspace(-120, 120, 1201)
    model = ContinuousRatingsRegressor(make_pipeline(scaler, LINEAR), grid=grid)
    if place != "around":
        model = make_pipeline(scaler, ContinuousRatingsRegressor(LINEAR, grid=grid))
    if place == "searched":
        model = GridSearchCV(model, {}, cv=2)
    alone = model
    if place == "guaranteed":
        model = ConformalRatings(model)
    report = model_report(model, X, answers, groups=OBJECTS, cv=3)
    quantiles = cross_val_predict_proba(
        model, X, answers, groups=OBJECTS, cv=3, method="predict_quantile"
    )
    np.testing.assert_array_equal(quantiles, report.predicted["ratings"])
    expected, by_hand = np.empty((2, len(X)))
    folds = ObjectKFold(3).split(X, groups=OBJECTS)
    for train, test in folds:
        # Each training trial has the same weight, however many answered.
        weight = np.repeat(1 / np.isfinite(answers[train]).sum(axis=1), 5) / len(train)
        pool = answers[train].ravel()
        weight, pool = weight[np.isfinite(pool)], pool[np.isfinite(pool)]
        within = weight @ np.abs(pool[:, None] - pool) @ weight / 2
        for trial in test:
            own = answers[trial][np.isfinite(answers[trial])]
            expected[trial] = np.mean(np.abs(own[:, None] - pool) @ weight) - within
        fitted = clone(alone).fit(X[train], answers[train])
        fitted = getattr(fitted, "best_estimator_", fitted)
        steps, Z = [fitted], X[test]
        if place != "around":
            steps, Z = fitted[1:], fitted[0].transform(Z)
        cdf = steps[0].predict_cdf(Z)
        by_hand[test] = crps(answers[test], cdf, grid, average=False)
    scores = report.scores["crps"]["ratings"]
    assert scores["marginal"] == pytest.approx(expected.mean(), rel=0.005)
    assert scores["model"] == pytest.approx(by_hand.mean(), rel=0.005)
    row = report.gains.loc["ratings"]
    best = scores[["marginal", "barycentre"]].min()
    assert row["gain"] == pytest.approx(best - scores["model"])
    assert row["crps_ceiling"] == noise_ceiling(answers, crps).truth < row["crps"]
    assert row["verdict"] == "better"
    assert "its CRPS is lower by" in report.conclusion


def test_sliders_of_several_adjectives_in_lists():
    one = [[10, 20], [30], [40, 50, 60], [90]] * (len(X) // 4)
    model = ContinuousRatingsRegressor(LINEAR)
    report = model_report(model, X, {"hard": one, "soft": one[::-1]}, cv=2)
    assert report.gains.index.tolist() == ["hard", "soft"]
    assert report.gains["crps_ceiling"].isna().all()  # some trials have one answer
    single = model_report(model, X, X[:, 0], groups=OBJECTS, cv=2)  # without a warning
    assert single.gains["verdict"].tolist() == ["better"]


def test_whole_numbers_may_be_levels_or_classes():
    numbers = np.arange(len(X)) % 12
    with pytest.raises(ValueError, match=r"12 different whole numbers, of classes or"):
        model_report(DummyDistribution(), X, numbers.astype(float), cv=3)
    levels = pd.Series(pd.Categorical(numbers, ordered=True))
    report = model_report(DummyDistribution(), X, levels, cv=3)
    assert report.gains["levels"].tolist() == ["0 to 11"]
    assert report.summary.startswith("36 trials")
    with pytest.raises(ValueError, match="report on them in two calls"):
        y = {"a": numbers.astype(str), "b": numbers % 3}
        model_report(DummyDistribution(), X, y)


@pytest.mark.parametrize("place", ["alone", "behind", "searched"])
def test_the_model_says_what_numbers_are(place):
    """A classifier of scikit-learn takes them for classes, a model of ratings not."""
    numbers = np.arange(len(X)) % 7
    for model, score, reading in [
        (GaussianNB(), "accuracy", "classes; an ordered pandas.Categorical has levels"),
        (DummyDistribution(), "rps", "levels; as text (astype(str)) they are classes"),
    ]:
        if place != "alone":
            model = make_pipeline(StandardScaler(), model)
        if place == "searched":
            model = GridSearchCV(model, {}, cv=2)
        report = model_report(model, X, numbers, cv=3)
        assert score in report.scores
        assert report.summary.startswith(f"Labels were read as {reading}. ")
    classes = model_report(GaussianNB(), X, numbers, cv=3)
    words = model_report(GaussianNB(), X, numbers.astype(str), cv=3)
    pd.testing.assert_frame_equal(classes.gains, words.gains)


@pytest.mark.parametrize("columns", [[0, 1], slice(0, 2), ["a", "b"]])
def test_columns_of_a_transformer_in_any_form(columns):
    frame = pd.DataFrame(X[:, :2], columns=["a", "b"])
    first = ColumnTransformer([("all", "passthrough", columns)])
    model = make_pipeline(first, LINEAR)
    found = model_report(model, frame, COUNTS, groups=OBJECTS, cv=3).gains
    same = model_report(LINEAR, X[:, :2], COUNTS, groups=OBJECTS, cv=3).gains
    pd.testing.assert_frame_equal(found, same)


class Uniform(BaseEstimator):
    """Predicts that all levels are as likely, in as many rows and columns as told."""

    def __init__(self, n_rows=None, classes=(1, 2, 3, 4, 5)):
        self.n_rows, self.classes = n_rows, classes

    def fit(self, X, y):
        if self.classes:
            self.classes_ = np.array(self.classes)
        return self

    def predict_proba(self, X):
        return np.full((self.n_rows or len(X), 5), 0.2)


def test_guesses_that_are_always_right():
    agreed = np.tile([0, 9, 0, 0, 0], (len(X), 1))
    report = model_report(Uniform(), X, agreed, groups=OBJECTS, cv=3)
    told = "The model is worse than guessing: its RPS is higher by 0.600 "
    assert report.conclusion.startswith(told)


@pytest.mark.parametrize(
    ("model", "cv", "message"),
    [
        (Uniform(), [], "cv has no folds"),
        (Uniform(), [([0], [])], "or one without training or test trials"),
        (Uniform(classes=None), 3, "Uniform has no classes_"),
        (Uniform(classes=(1, 2)), 3, "for 12 trials and 2 levels; return one row"),
        (Uniform(n_rows=1), 3, "Uniform predicts an array of shape (1, 5) for"),
    ],
)
def test_bad_models_and_folds(model, cv, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        model_report(model, X, COUNTS, groups=OBJECTS, cv=cv)


def test_what_is_frozen_is_told():
    frozen = FrozenEstimator(clone(LINEAR).fit(X, COUNTS))
    report = model_report(frozen, X, COUNTS, groups=OBJECTS, cv=3)
    proba = frozen.predict_proba(X)
    np.testing.assert_allclose(report.predicted["ratings"], proba)
    assert "What is frozen had learned before" in report.summary
    report = model_report(DummyDistribution(), X, COUNTS, groups=OBJECTS, cv=3)
    assert "frozen" not in report.summary
