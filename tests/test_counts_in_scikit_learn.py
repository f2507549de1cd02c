"""What scikit-learn does with counts: each row of the guide's table, by a plain loop.

The table of docs/scikit_learn.md names functions and classes, and says of each that it
takes counts, refuses them or goes wrong. The function of that name in `CHECKS` shows
it.
"""

import re
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.calibration import CalibratedClassifierCV
from sklearn.compose import TransformedTargetRegressor
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import (
    AdaBoostClassifier,
    BaggingClassifier,
    BaggingRegressor,
    RandomForestClassifier,
    StackingClassifier,
    VotingClassifier,
)
from sklearn.experimental import enable_halving_search_cv  # noqa: F401
from sklearn.feature_selection import (
    RFE,
    RFECV,
    SelectFromModel,
    SelectKBest,
    SequentialFeatureSelector,
)
from sklearn.frozen import FrozenEstimator
from sklearn.inspection import permutation_importance
from sklearn.metrics import get_scorer
from sklearn.model_selection import (
    GridSearchCV,
    GroupKFold,
    HalvingGridSearchCV,
    KFold,
    RandomizedSearchCV,
    StratifiedGroupKFold,
    StratifiedKFold,
    StratifiedShuffleSplit,
    TunedThresholdClassifierCV,
    cross_val_predict,
    cross_val_score,
    cross_validate,
    learning_curve,
    permutation_test_score,
    train_test_split,
    validation_curve,
)
from sklearn.multiclass import OneVsRestClassifier
from sklearn.multioutput import (
    ClassifierChain,
    MultiOutputClassifier,
    MultiOutputRegressor,
    RegressorChain,
)
from sklearn.preprocessing import TargetEncoder
from sklearn.semi_supervised import SelfTrainingClassifier
from test_out_of_fold import rated

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
from sklearn_haptic.metrics import neg_rps_scorer, ranked_probability_score
from sklearn_haptic.model_selection import cross_val_predict_proba

pytestmark = pytest.mark.usefixtures("one_thread")

GUIDE = Path(__file__).resolve().parents[1] / "docs" / "scikit_learn.md"
X, COUNTS, OBJECTS = rated(20, 3)
MODEL = DistributionalOrdinalRegressor()
CV = GroupKFold(4)
FOLDS = list(CV.split(X, groups=OBJECTS))
BY_GROUP = {"groups": OBJECTS, "cv": CV}


def fit(rows=slice(None), features=slice(None), **params):
    return clone(MODEL).set_params(**params).fit(X[rows][:, features], COUNTS[rows])


def rps_of_folds(folds=FOLDS, features=slice(None), **params):
    """Minus the RPS of each fold, by a loop."""
    scores = []
    for train, test in folds:
        proba = fit(train, features, **params).predict_proba(X[test][:, features])
        scores.append(-ranked_probability_score(COUNTS[test], proba))
    return scores


def importance(model):
    """Weights of the features of a linear model, without that of the position."""
    return np.abs(model.estimator_.coefs_[0]).ravel()[:-1]


def refuses(message, *estimators):
    """What each of them raises when fitted on counts."""
    for estimator in estimators:
        with pytest.raises((ValueError, NotImplementedError), match=message):
            estimator.fit(X, COUNTS)


ONE_DIMENSION = "y should be a 1d array"


def check_cross_val_predict_proba():
    expected = np.empty(COUNTS.shape)
    for train, test in FOLDS:
        expected[test] = fit(train).predict_proba(X[test])
    np.testing.assert_array_equal(
        cross_val_predict_proba(MODEL, X, COUNTS, groups=OBJECTS, cv=CV), expected
    )


def check_cross_val_predict():
    labels = cross_val_predict(MODEL, X, COUNTS, **BY_GROUP)  # right
    proba = cross_val_predict(MODEL, X, COUNTS, **BY_GROUP, method="predict_proba")
    ranks = np.column_stack([np.unique(c, return_inverse=True)[1] for c in COUNTS.T])
    assert (ranks != COUNTS).any()
    for train, test in FOLDS:
        np.testing.assert_array_equal(labels[test], fit(train).predict(X[test]))
        corrupted = clone(MODEL).fit(X[train], ranks[train]).predict_proba(X[test])
        np.testing.assert_array_equal(proba[test], corrupted)
    network = clone(MODEL).set_params(estimator=NNPOM(2, random_state=0))
    for n_adjectives in (2, 6):
        adjectives = np.stack([COUNTS] * n_adjectives, axis=1)
        with (
            warnings.catch_warnings(action="ignore", category=RuntimeWarning),
            pytest.raises((ValueError, IndexError)),
        ):
            cross_val_predict(network, X, adjectives, cv=3, method="predict_proba")
    gaps = np.array([2, 4, 8])[np.arange(60) % 3]
    model = clone(MODEL).set_params(levels=[2, 4, 8])
    with pytest.raises(ValueError, match="y has the rating 0 in trial"):
        cross_val_predict(model, X, gaps, cv=3, method="predict_proba")


def check_cross_val_score():
    for scoring in (neg_rps_scorer, None):
        scores = cross_val_score(MODEL, X, COUNTS, **BY_GROUP, scoring=scoring)
        np.testing.assert_array_equal(scores, rps_of_folds())
        results = cross_validate(MODEL, X, COUNTS, **BY_GROUP, scoring=scoring)
        np.testing.assert_array_equal(results["test_score"], scores)


def check_built_in_scorers():
    for scoring in ("accuracy", "neg_log_loss", "roc_auc_ovr", "r2"):
        with pytest.warns(UserWarning, match="Scoring failed"):
            scores = cross_val_score(MODEL, X, COUNTS, **BY_GROUP, scoring=scoring)
        assert np.isnan(scores).all()
    search = GridSearchCV(MODEL, {"n_duplicates": [1, 15]}, scoring="accuracy", cv=CV)
    with pytest.warns(UserWarning, match="Scoring failed|non-finite"):
        search.fit(X, COUNTS, groups=OBJECTS)
    assert search.best_params_ == {"n_duplicates": 1}  # the first


def check_searches():
    grid = {"n_duplicates": [3, 15]}
    expected = [rps_of_folds(n_duplicates=n) for n in grid["n_duplicates"]]
    options = {"scoring": neg_rps_scorer, "cv": CV}
    for search in (
        GridSearchCV(MODEL, grid, **options),
        RandomizedSearchCV(MODEL, grid, n_iter=2, random_state=0, **options),
    ):
        search.fit(X, COUNTS, groups=OBJECTS)
        found = np.transpose(
            [search.cv_results_[f"split{k}_test_score"] for k in range(4)]
        )
        tried = [params["n_duplicates"] for params in search.cv_results_["params"]]
        order = np.argsort(tried)
        np.testing.assert_array_equal(found[order], expected)


def check_halving():
    """With all trials in its one iteration it is a grid search."""
    grid = {"n_duplicates": [3, 15]}
    search = HalvingGridSearchCV(
        MODEL, grid, scoring=neg_rps_scorer, cv=CV, min_resources=60, random_state=0
    ).fit(X, COUNTS, groups=OBJECTS)
    found = [search.cv_results_[f"split{k}_test_score"] for k in range(4)]
    expected = [rps_of_folds(n_duplicates=n) for n in grid["n_duplicates"]]
    np.testing.assert_allclose(np.transpose(found), expected, atol=1e-12)


def check_curves():
    options = {"scoring": neg_rps_scorer, **BY_GROUP}
    sizes, _, scores = learning_curve(
        MODEL, X, COUNTS, train_sizes=[0.5, 1.0], **options
    )
    expected = [rps_of_folds([(tr[:n], te) for tr, te in FOLDS]) for n in sizes]
    np.testing.assert_array_equal(scores, expected)
    _, scores = validation_curve(
        MODEL, X, COUNTS, param_name="n_duplicates", param_range=[3, 15], **options
    )
    expected = [rps_of_folds(n_duplicates=n) for n in (3, 15)]
    np.testing.assert_array_equal(scores, expected)


def check_permutation_test_score():
    """Permuting within objects changes nothing, so that a strong signal has p = 1."""
    score, permuted, p = permutation_test_score(
        MODEL, X, COUNTS, **BY_GROUP, scoring=neg_rps_scorer, n_permutations=9
    )
    np.testing.assert_allclose(permuted, score)
    assert p == 1
    # What to do instead: objects exchange their counts.
    names, of_trial = np.unique(OBJECTS, return_inverse=True)
    first = np.array([np.argmax(name == OBJECTS) for name in names])
    rng = np.random.default_rng(0)
    for _ in range(9):
        exchanged = COUNTS[first[rng.permutation(len(names))]][of_trial]
        chance = cross_val_score(
            MODEL, X, exchanged, scoring=neg_rps_scorer, **BY_GROUP
        )
        assert chance.mean() < score


def check_permutation_importance():
    model = fit()
    found = permutation_importance(
        model, X, COUNTS, scoring=neg_rps_scorer, n_repeats=2, random_state=0
    )
    base = ranked_probability_score(COUNTS, model.predict_proba(X))
    seed = np.random.RandomState(0).randint(np.iinfo(np.int32).max + 1)
    for column in range(3):
        rng, rows = np.random.RandomState(seed), np.arange(60)
        permuted = X.copy()
        for repeat in range(2):
            rng.shuffle(rows)
            permuted[:, column] = permuted[rows, column]
            worse = ranked_probability_score(COUNTS, model.predict_proba(permuted))
            np.testing.assert_allclose(
                found.importances[column, repeat], worse - base, atol=1e-12
            )


def check_feature_selection():
    weights = importance(fit())
    options = {"importance_getter": importance}
    selected = SelectFromModel(MODEL, **options).fit(X, COUNTS).get_support()
    np.testing.assert_array_equal(selected, weights >= weights.mean())
    two = np.sort(np.argsort(weights)[1:])
    one = two[importance(fit(features=two)).argmax()]
    ranked = RFE(MODEL, n_features_to_select=1, **options).fit(X, COUNTS)
    np.testing.assert_array_equal(np.flatnonzero(ranked.support_), [one])
    ranked = RFECV(MODEL, cv=CV, scoring=neg_rps_scorer, **options)
    ranked.fit(X, COUNTS, groups=OBJECTS)
    found = [ranked.cv_results_[f"split{k}_test_score"][-1] for k in range(4)]
    np.testing.assert_allclose(found, rps_of_folds())
    forward = SequentialFeatureSelector(
        MODEL, n_features_to_select=1, scoring=neg_rps_scorer, cv=FOLDS
    ).fit(X, COUNTS)
    alone = [np.mean(rps_of_folds(features=[column])) for column in range(3)]
    np.testing.assert_array_equal(np.flatnonzero(forward.support_), np.argmax(alone))


def check_features_by_label():
    refuses(ONE_DIMENSION, SelectKBest(k=1), LinearDiscriminantAnalysis())
    refuses("Unknown label type", TargetEncoder())


def check_train_test_split():
    rows = np.arange(60)
    train, test, _, y = train_test_split(rows, COUNTS, random_state=0)
    np.testing.assert_array_equal(y, COUNTS[test])
    # Rows of counts are taken for classes, and each object is put on both sides.
    splits = [train_test_split(rows, stratify=COUNTS, test_size=20, random_state=0)]
    splitter = StratifiedShuffleSplit(1, test_size=20, random_state=0)
    splits += list(splitter.split(X, COUNTS))
    for train, test in splits:
        both = set(OBJECTS[train]) & set(OBJECTS[test])
        assert len(both) > 0.9 * len(set(OBJECTS[test]))


def check_stratified_folds():
    for splitter in (StratifiedKFold(3), StratifiedGroupKFold(3)):
        with pytest.raises(ValueError, match="Supported target types"):
            next(splitter.split(X, COUNTS))
    # Searches and cross_validate do not try: without groups they take other folds.
    scores = cross_val_score(MODEL, X, COUNTS, cv=3, scoring=neg_rps_scorer)
    folds = list(KFold(3).split(X))
    np.testing.assert_array_equal(scores, rps_of_folds(folds))


def check_frozen():
    model = fit()
    frozen = FrozenEstimator(model).fit(X[::-1], COUNTS)
    np.testing.assert_array_equal(frozen.predict_proba(X), fit().predict_proba(X))


def check_ensembles():
    part = [("one", MODEL)]
    refuses(ONE_DIMENSION, CalibratedClassifierCV(MODEL), BaggingClassifier(MODEL))
    refuses(ONE_DIMENSION, StackingClassifier(part), AdaBoostClassifier(MODEL))
    refuses("only supports binary or multiclass", VotingClassifier(part))


def check_one_against_the_rest():
    refuses("Multioutput target data is not supported", OneVsRestClassifier(MODEL))
    refuses(ONE_DIMENSION, SelfTrainingClassifier(MODEL))
    refuses("Only binary classification", TunedThresholdClassifierCV(MODEL))


def check_a_model_for_each_column():
    """Each column of counts is taken for labels, unless the levels are given."""
    wrong = MultiOutputClassifier(MODEL).fit(X, COUNTS)
    for column, proba in enumerate(wrong.predict_proba(X)):
        expected = clone(MODEL).fit(X, COUNTS[:, column]).predict_proba(X)
        np.testing.assert_array_equal(proba, expected)
        assert proba.shape[1] == len(np.unique(COUNTS[:, column]))
    for alike in (MultiOutputRegressor, ClassifierChain, RegressorChain):
        assert alike(MODEL).fit(X, COUNTS).predict(X).max() > 5  # no rating
    given = clone(MODEL).set_params(levels=[1, 2, 3, 4, 5])
    refuses("which is not among levels", MultiOutputClassifier(given))
    refuses("which is not among levels", ClassifierChain(given))
    refuses("which is not among levels", MultiOutputRegressor(given))
    refuses("which is not among levels", RegressorChain(given))
    forest = RandomForestClassifier(2, random_state=0).fit(X, COUNTS)
    assert [len(p[0]) for p in forest.predict_proba(X)] == [
        len(np.unique(column)) for column in COUNTS.T
    ]
    with pytest.raises(ValueError, match="as if it took each column of y for labels"):
        cross_val_predict_proba(forest, X, COUNTS, cv=CV, groups=OBJECTS)


def check_transformed_target():
    model = TransformedTargetRegressor(MODEL).fit(X, COUNTS)
    np.testing.assert_array_equal(model.predict(X).ravel(), fit().predict(X))
    assert not hasattr(model, "predict_proba")
    labelled = pd.DataFrame(COUNTS, columns=[-2, -1, 0, 1, 2])
    for lossy in (model, BaggingRegressor(MODEL, 5, random_state=0)):
        assert (
            clone(lossy).fit(X, labelled).predict(X).min() >= 1
        )  # the labels are lost
        assert not hasattr(lossy, "predict_proba")


CHECKS = {
    "cross_val_predict_proba": check_cross_val_predict_proba,
    "cross_val_predict": check_cross_val_predict,
    "cross_val_score": check_cross_val_score,
    "cross_validate": check_cross_val_score,
    '"accuracy"': check_built_in_scorers,
    '"neg_log_loss"': check_built_in_scorers,
    "GridSearchCV": check_searches,
    "RandomizedSearchCV": check_searches,
    "HalvingGridSearchCV": check_halving,
    "learning_curve": check_curves,
    "validation_curve": check_curves,
    "permutation_test_score": check_permutation_test_score,
    "permutation_importance": check_permutation_importance,
    "RFE": check_feature_selection,
    "RFECV": check_feature_selection,
    "SelectFromModel": check_feature_selection,
    "SequentialFeatureSelector": check_feature_selection,
    "SelectKBest": check_features_by_label,
    "LinearDiscriminantAnalysis": check_features_by_label,
    "TargetEncoder": check_features_by_label,
    "train_test_split": check_train_test_split,
    "StratifiedShuffleSplit": check_train_test_split,
    "StratifiedKFold": check_stratified_folds,
    "StratifiedGroupKFold": check_stratified_folds,
    "FrozenEstimator": check_frozen,
    "CalibratedClassifierCV": check_ensembles,
    "StackingClassifier": check_ensembles,
    "VotingClassifier": check_ensembles,
    "BaggingClassifier": check_ensembles,
    "AdaBoostClassifier": check_ensembles,
    "OneVsRestClassifier": check_one_against_the_rest,
    "SelfTrainingClassifier": check_one_against_the_rest,
    "TunedThresholdClassifierCV": check_one_against_the_rest,
    "MultiOutputClassifier": check_a_model_for_each_column,
    "MultiOutputRegressor": check_a_model_for_each_column,
    "RegressorChain": check_a_model_for_each_column,
    "ClassifierChain": check_a_model_for_each_column,
    "RandomForestClassifier": check_a_model_for_each_column,
    "TransformedTargetRegressor": check_transformed_target,
    "BaggingRegressor": check_transformed_target,
}


def names_in_the_guide():
    """What the first column of the table names."""
    section = GUIDE.read_text("utf-8")
    rows = re.findall(r"^\| (`.*?) \|", section.partition("\n## ")[0], re.M)
    return [name for row in rows for name in re.findall(r"`([\w\"]+)", row)]


def test_the_guide_names_all_that_is_checked():
    assert sorted(set(names_in_the_guide())) == sorted(
        set(CHECKS) - {"cross_val_predict_proba"}
    )


@pytest.mark.slow
@pytest.mark.parametrize("check", dict.fromkeys(CHECKS.values()))
def test_row_of_the_guide(check):
    with warnings.catch_warnings():  # a count is taken for a number that is regressed
        warnings.filterwarnings("ignore", "The number of unique classes is greater")
        check()


def words_and_levels():
    words = ["low", "middle", "high"]
    rng = np.random.default_rng(0)
    X = rng.normal(size=(60, 1))
    level = np.digitize(X[:, 0] + 0.3 * rng.normal(size=60), [-0.5, 0.5])
    return words, X, level, pd.Categorical.from_codes(level, words, ordered=True)


@pytest.mark.parametrize(
    "several",
    [
        lambda model: VotingClassifier([("one", model)], voting="soft"),
        lambda model: BaggingClassifier(model, n_estimators=2, random_state=0),
        lambda model: StackingClassifier([("one", model)]),
    ],
    ids=["voting", "bagging", "stacking"],
)
def test_single_answers_in_words(several):
    words, X, level, answers = words_and_levels()
    model = DistributionalOrdinalRegressor()
    expected = several(model).fit(X, level).predict_proba(X)
    named = several(model).fit(X, answers)
    proba = pd.DataFrame(named.predict_proba(X), columns=named.classes_)[words]
    assert np.abs(proba - expected).max(axis=None) > 0.1
    with pytest.raises(ValueError, match="which is not among levels="):
        several(clone(model).set_params(levels=words)).fit(X, answers)


def test_single_answers_in_words_out_of_fold():
    words, X, level, answers = words_and_levels()
    model, options = DistributionalOrdinalRegressor(), {"method": "predict_proba"}
    expected = cross_val_predict(model, X, level, **options)
    found = cross_val_predict(model, X, answers, **options)
    found = pd.DataFrame(found, columns=sorted(words))[words]
    assert np.abs(found - expected).max(axis=None) > 0.1
    with pytest.raises(ValueError, match="which is not among levels="):
        named = clone(model).set_params(levels=words)
        cross_val_predict(named, X, answers, **options)
    cv = KFold(5)
    right = cross_val_predict_proba(model, X, answers, cv=cv)
    expected = cross_val_predict_proba(model, X, level, cv=cv)
    np.testing.assert_array_equal(right, expected)


@pytest.mark.parametrize("name", ["neg_log_loss", "roc_auc_ovr", "top_k_accuracy"])
def test_scorers_by_name_take_words_by_the_alphabet(name):
    words, X, level, answers = words_and_levels()
    model = DistributionalOrdinalRegressor(levels=words).fit(X, answers)
    numbered = DistributionalOrdinalRegressor().fit(X, level)
    score = get_scorer(name)
    assert score(model, X, np.asarray(answers)) < score(numbered, X, level) - 0.1
    np.testing.assert_allclose(
        neg_rps_scorer(model, X, answers), neg_rps_scorer(numbered, X, level)
    )
