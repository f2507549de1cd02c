"""What follows from a predicted distribution, by every estimator that predicts one."""

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    AnytimeRegressor,
    ConformalRatings,
    ContinuousRatingsRegressor,
    DistributionBlend,
    NoveltyGuard,
    TemporalMaxPool,
    TouchPool,
)

RNG = np.random.default_rng(0)
OBJECTS = np.repeat(np.arange(20), 2)
X = RNG.normal(size=(40, 2)) + OBJECTS[:, np.newaxis] / 5
COUNTS = RNG.multinomial(9, [0.1, 0.2, 0.4, 0.3], size=40)
TRIALS = [np.tile(row, (8, 1)) for row in X]
HEAD = make_pipeline(TemporalMaxPool(), NNPOM(0))
# Those of the objects are drawn alike.
pytestmark = pytest.mark.filterwarnings("ignore:The ratings of different groups")
MODELS = {
    "blend": (DistributionBlend([("linear", NNPOM(0))]), X),
    "pool": (TouchPool([("linear", NNPOM(0), [0, 1])]), X),
    "guard": (NoveltyGuard(make_pipeline(StandardScaler(), NNPOM(0))), X),
    "sets": (ConformalRatings(NNPOM(0)), X),
    "anytime": (AnytimeRegressor(HEAD, durations=[0.5], sampling_rates=10), TRIALS),
}
POSITIONS = np.array([0.05, 0.3, 0.5, 0.77, 1.0])


@pytest.mark.parametrize("name", MODELS)
def test_levels(name):
    model, trials = MODELS[name]
    model.fit(trials, COUNTS, groups=OBJECTS)
    proba = model.predict_proba(trials)
    below = model.predict_cdf(trials)
    np.testing.assert_allclose(below, np.cumsum(proba, axis=1), atol=1e-12)
    for shares, found in zip(proba, model.predict_quantile(trials, POSITIONS)):
        reached = np.cumsum(shares) >= POSITIONS[:, np.newaxis] - 1e-12
        np.testing.assert_array_equal(found, 1 + reached.argmax(axis=1))
    drawn = model.sample(trials, 20_000, random_state=0)
    seen = (drawn[..., np.newaxis] == model.classes_).mean(axis=1)
    np.testing.assert_allclose(seen, proba, atol=0.015)


def test_continuous_ratings():
    answers = 50 + 10 * X[:, :1] + RNG.normal(size=(40, 9))
    model = ContinuousRatingsRegressor(NNPOM(0), n_cells=6).fit(X, answers)
    drawn = model.sample(X, 20_000, random_state=0)
    seen = (drawn[..., np.newaxis] <= model.grid_).mean(axis=1)
    below = model.predict_cdf(X, model.grid_)  # with those at the lowest end
    np.testing.assert_allclose(seen, below, atol=0.015)
    np.testing.assert_allclose(
        np.quantile(drawn, 0.3, axis=1), model.predict_quantile(X, 0.3), rtol=0.02
    )


def test_touches_of_one_object_are_asked_together():
    pool = MODELS["pool"][0].fit(X, COUNTS, groups=OBJECTS)
    proba = pool.predict_proba(X, groups=OBJECTS)
    below = pool.predict_cdf(X, groups=OBJECTS)
    np.testing.assert_allclose(below, np.cumsum(proba, axis=1), atol=1e-12)
    rating = pool.predict_quantile(X, 0.5, groups=OBJECTS)
    assert (rating[::2] == rating[1::2]).all()
    assert (rating == 1 + (below < 0.5).sum(axis=1)).all()
    assert (pool.predict(X, groups=OBJECTS) == 1 + proba.argmax(axis=1)).all()


def test_classes_without_an_order_have_no_cdf():
    y = np.array(["cork", "foam"])[OBJECTS % 2]
    runs = np.tile([0, 1], 20)
    pool = TouchPool([("a", LogisticRegression(), [0, 1])], cv=2).fit(X, y, groups=runs)
    for ask in (
        lambda: pool.predict_cdf(X),
        lambda: pool.predict_quantile(X, 0.5),
        lambda: pool.sample(X),
    ):
        with pytest.raises(ValueError, match="The classes of this TouchPool have no"):
            ask()
