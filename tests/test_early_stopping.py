"""Which trials stop a network early, and by what weight."""

import numpy as np
import pytest
import sklearn
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import BaseEstimator, clone
from sklearn.ensemble import GradientBoostingRegressor, HistGradientBoostingClassifier
from sklearn.linear_model import LogisticRegression, RidgeClassifierCV
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from touches import ordinal_touches

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, SensorFusionNNPOM
from sklearn_haptic.models._conditioning import EvenedFeatures
from sklearn_haptic.models._network import Network
from sklearn_haptic.models._observations import single_ratings
from sklearn_haptic.models._solvers import validation_error

STOPPING = NNPOM(3, early_stopping=True, n_iter_no_change=20, random_state=0)
FUSION = SensorFusionNNPOM({"a": [0, 1], "b": [2]}, STOPPING, STOPPING, random_state=0)
MODELS = [
    STOPPING,
    FUSION,
    DistributionalOrdinalRegressor(STOPPING, random_state=0),
    DistributionalOrdinalRegressor(FUSION, random_state=0),
]
IDS = ["network", "fusion", "regressor", "regressor of a fusion"]


def touches(n_objects=20):
    effects, cuts = [1, -0.5, 0.2], [-1, 1]
    return ordinal_touches(n_objects, 4, effects, spread=1, noise=0.5, cuts=cuts)


class Witness(BaseEstimator):
    """Notes which objects it trains and validates on; feature 0 is the object."""

    seen = []  # noqa: RUF012

    def __init__(self, validation_fraction=0.3, alpha=1.0):
        self.validation_fraction = validation_fraction
        self.alpha = alpha

    def fit(self, X, y):
        raise AssertionError("the rows were repeated")

    predict = fit

    def fit_with_positions(self, X, *observed, levels, validation, **_):
        self.levels_ = levels
        Witness.seen.append((X[:, 0].tolist(), validation[0][:, 0].tolist()))
        return self

    def validation_share(self):
        return self.validation_fraction

    def predict_proba_with_positions(self, X, positions):
        shape = len(X), len(positions), len(self.levels_)
        return np.full(shape, 1 / len(self.levels_))


@pytest.mark.parametrize("in_pipeline", [False, True])
def test_a_line_brings_the_groups_into_a_search(in_pipeline, recwarn):
    _, counts, objects = touches()
    X = objects[:, None].astype(float)
    with sklearn.config_context(enable_metadata_routing=True):
        model = DistributionalOrdinalRegressor(Witness())
        grid = {"estimator__alpha": [1.0, 2.0]}
        if in_pipeline:
            model = make_pipeline(
                StandardScaler(with_mean=False, with_std=False), model
            )
            grid = {f"distributionalordinalregressor__{k}": v for k, v in grid.items()}
        Witness.seen.clear()
        GridSearchCV(model, grid, cv=GroupKFold(4)).fit(X, counts, groups=objects)
    assert len(Witness.seen) == 4 * 2 + 1
    for trained, validated in Witness.seen:
        assert validated and not set(trained) & set(validated)
        assert all(np.sum(objects == o) == validated.count(o) for o in set(validated))
    assert not recwarn


def test_without_them_the_objects_are_torn():
    _, counts, objects = touches()
    Witness.seen.clear()
    model = DistributionalOrdinalRegressor(Witness(), random_state=0)
    with pytest.warns(UserWarning, match="fit was given no groups"):
        GridSearchCV(model, {"estimator__alpha": [1.0]}, cv=GroupKFold(4)).fit(
            objects[:, None], counts, groups=objects
        )
    assert all(set(trained) & set(validated) for trained, validated in Witness.seen)


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS, ids=IDS)
@pytest.mark.parametrize("n_objects", [2, 3])
def test_few_objects(model, n_objects):
    X, counts, objects = touches(n_objects)
    proba = clone(model).fit(X, counts, groups=objects).predict_proba(X)
    assert_allclose(proba.sum(axis=1), 1)


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["lbfgs", "irprop+"])
@pytest.mark.parametrize("n_features", [3, 120])
@pytest.mark.parametrize("model", MODELS, ids=IDS)
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
def test_weights_equal_repeated_trials(model, solver, n_features):
    """Over few iterations, since rounding errors grow on a cost with many minima."""
    X, counts, objects = touches()
    rng = np.random.default_rng(1)
    X = np.hstack((X, 0.3 * rng.normal(size=(len(X), n_features - 3))))
    weight = rng.integers(0, 4, size=len(X))
    names = [
        n for n in model.get_params() if n.split("__")[-1] in ("solver", "max_iter")
    ]
    model = clone(model).set_params(
        **{n: solver if n.endswith("solver") else 20 for n in names}
    )
    weighted = clone(model).fit(X, counts, sample_weight=weight, groups=objects)
    repeated = clone(model).fit(
        *(a.repeat(weight, axis=0) for a in (X, counts)), groups=objects.repeat(weight)
    )
    assert_allclose(weighted.predict_proba(X), repeated.predict_proba(X), atol=1e-6)


@pytest.mark.slow
def test_validation_errors_are_weighted():
    """All weight on the trials of one held-out object: its error alone decides."""
    X, counts, objects = touches(10)
    errors = {}
    network = NNPOM(4, 1e-3, tol=0, random_state=3, early_stopping=True)
    network.set_params(validation_fraction=0.2, max_iter=200, n_iter_no_change=200)
    unweighted = clone(network).fit(X, counts, groups=objects)
    for scale in (1.0, 1e-12):
        weight = np.where(objects % 2, 1.0, scale)
        model = clone(network).fit(X, counts, weight, groups=objects)
        errors[scale] = model.predict_proba(X)
    assert_array_equal(errors[1.0], unweighted.predict_proba(X))
    assert not np.allclose(errors[1.0], errors[1e-12], atol=1e-3)


@pytest.mark.parametrize("tiny", [1e-3, 1e-300])
def test_validation_errors_by_plain_loops(tiny):
    """Trials count by their weights, relative to which none is lost, not by raters."""
    rng = np.random.default_rng(0)
    X, counts = rng.normal(size=(12, 2)), rng.poisson(2, size=(12, 4)) + np.eye(12, 4)
    weight = tiny * np.array([1, 2] * 6)
    weight[0] = 1 / tiny
    network = Network(
        np.array([2.0, -1.0]), np.empty(0), np.empty((0, 1)), np.array([[-1, 0, 1.0]])
    )
    level, _, counted = single_ratings(counts, weight)
    errors = []
    for x, row in zip(X[1:], counts[1:]):
        below = 1 / (1 + np.exp(x @ [2.0, -1.0] - np.array([-1, 0, 1.0])))
        predicted = np.diff(below, prepend=0, append=1).argmax()
        errors.append(np.mean([abs(predicted - k) for k in range(4) if row[k]]))
    expected = np.average(errors, weights=weight[1:] if tiny > 1e-9 else None)
    found = validation_error(network, X[1:], None, level[1:], counted[1:])
    assert found == pytest.approx(expected, rel=1e-12)


def test_the_basis_of_the_solver_is_that_of_repeated_trials():
    rng = np.random.default_rng(0)
    X, weight = rng.normal(size=(30, 4)), rng.integers(1, 5, size=30)
    weighted = EvenedFeatures(X, 2.0, weight * 3.0)
    repeated = EvenedFeatures(X.repeat(weight, axis=0), 2.0, 3.0)
    assert_allclose(weighted.alpha, repeated.alpha, rtol=1e-12)
    assert_allclose(
        np.abs(weighted.inputs.repeat(weight, axis=0)),
        np.abs(repeated.inputs),
        rtol=1e-9,
    )


@pytest.mark.parametrize(
    ("estimator", "off"),
    [
        (
            HistGradientBoostingClassifier(early_stopping=True, max_iter=3),
            {"early_stopping": False},
        ),
        (
            GradientBoostingRegressor(n_iter_no_change=2, n_estimators=3),
            {"n_iter_no_change": None},
        ),
        (
            make_pipeline(
                StandardScaler(),
                HistGradientBoostingClassifier(early_stopping=True, max_iter=3),
            ),
            {"histgradientboostingclassifier__early_stopping": False},
        ),
    ],
    ids=["histogram", "gradient", "pipeline"],
)
def test_estimators_that_hold_out_rows_themselves(estimator, off, recwarn):
    X, counts, objects = touches()
    model = DistributionalOrdinalRegressor(
        clone(estimator), sampling="random", random_state=0
    )
    with pytest.warns(UserWarning, match="rows that it holds out itself"):
        model.fit(X, counts, groups=objects)
    model.estimator.set_params(**off)
    model.fit(X, counts, groups=objects)
    assert not recwarn


@pytest.mark.parametrize("place", ["alone", "in a pipeline"])
def test_estimators_that_cross_validate_on_rows(place):
    """Other positions of a trial are no other trial, so penalties get too weak."""
    X, counts, _ = touches()
    estimator = RidgeClassifierCV([0.1, 1000.0])
    if place != "alone":
        estimator = make_pipeline(StandardScaler(), estimator)
    model = DistributionalOrdinalRegressor(estimator, sampling="random", random_state=0)
    with pytest.warns(UserWarning, match="cross-validates on rows that it holds out"):
        model.fit(X, counts)


def test_more_than_10_000_rows_make_histogram_boosting_stop_early():
    X, counts, _ = touches(200)
    for base, warned in [
        (HistGradientBoostingClassifier(max_iter=2), True),
        (HistGradientBoostingClassifier(max_iter=2, early_stopping=False), False),
        (LogisticRegression(), False),
    ]:
        model = DistributionalOrdinalRegressor(base, sampling="random", random_state=0)
        if warned:
            with pytest.warns(UserWarning, match="rows that it holds out itself"):
                model.fit(X, counts)
        else:
            model.fit(X, counts)
