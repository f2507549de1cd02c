"""Rules that stop a touch, against what can be worked out by hand."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, clone
from sklearn.pipeline import make_pipeline

from sklearn_haptic import NNPOM, AnytimeRegressor, SignalStatistics
from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.streaming import CertaintyThreshold, ExpectedGain
from sklearn_haptic.streaming._stopping import expected_losses, losses

DURATIONS = np.array([0.5, 1.0, 2.0, 4.0])
RULES = [CertaintyThreshold(0.9), ExpectedGain(0.02)]


def random_touches(n=200, seed=0):
    """Distributions that come nearer to the truth, of some touches sooner."""
    rng = np.random.default_rng(seed)
    true = rng.dirichlet(np.ones(5), n)
    guess = true.mean(axis=0)
    speed = rng.choice([0.1, 3], n)
    weight = np.exp(-speed[:, None] * DURATIONS)[..., None]
    return weight * guess + (1 - weight) * true[:, None], true, speed


def test_labelled_counts_are_put_in_the_order_of_levels():
    proba, true, _ = random_touches()
    counts = np.rint(20 * true) + 1
    labelled = pd.DataFrame(counts[:, ::-1], columns=[5, 4, 3, 2, 1])
    one, other = (
        ExpectedGain(0.005).fit(proba, y, durations=DURATIONS).stop_at(proba)
        for y in (counts, labelled)
    )
    np.testing.assert_array_equal(one, other)
    assert len({*one}) > 1


def test_losses_are_those_of_the_metrics():
    proba, true, _ = random_touches()
    expected = ranked_probability_score(true, proba[:, 1], average=False)
    np.testing.assert_allclose(losses(proba[:, 1], true, ordered=True), expected)
    labels = np.eye(5)[true.argmax(axis=1)]
    wrong = proba[:, 1].argmax(axis=1) != labels.argmax(axis=1)
    assert (losses(proba[:, 1], labels, ordered=False) == wrong).all()


def test_the_expected_loss_is_the_mean_over_draws():
    rng = np.random.default_rng(0)
    proba = np.array([0.1, 0.4, 0.2, 0.3])
    drawn = np.eye(4)[rng.choice(4, 100_000, p=proba)]
    for ordered in (True, False):
        each = losses(np.tile(proba, (100_000, 1)), drawn, ordered=ordered)
        expected = expected_losses(proba[None], ordered=ordered)[0]
        assert expected == pytest.approx(each.mean(), abs=0.01)


@pytest.mark.parametrize("rule", RULES, ids=str)
def test_stop_at_is_a_loop_over_touches_and_durations(rule):
    proba, true, _ = random_touches()
    proba[::3, 3] = np.nan  # touches that end before
    rule = clone(rule).fit(proba, true, durations=DURATIONS)
    index = rule.stop_at(proba)
    for i, path in enumerate(proba):
        last = np.isfinite(path).all(axis=1).sum() - 1
        k = 0
        while k < last and not rule.stops(path[None, : k + 1])[0]:
            k += 1
        assert index[i] == k


def test_certainty_is_the_largest_probability():
    proba = np.array([[[0.3, 0.6, 0.1]]])
    assert CertaintyThreshold(0.6).stops(proba)[0]
    assert not CertaintyThreshold(0.6 + 1e-9).stops(proba)[0]


def test_the_dearer_a_second_the_shorter_the_touch():
    proba, true, _ = random_touches()
    seconds, loss = [], []
    for price in (0.0, 0.01, 0.03, 0.1, 100.0):
        rule = ExpectedGain(price).fit(proba, true, durations=DURATIONS)
        index = rule.stop_at(proba)
        seconds.append(DURATIONS[index].mean())
        loss.append(losses(proba[np.arange(200), index], true, ordered=True).mean())
    assert (np.diff(seconds) <= 0).all()
    assert seconds[-1] == DURATIONS[0]
    assert loss[0] < losses(proba[:, 3], true, ordered=True).mean() + 1e-3


def test_the_rule_goes_on_with_those_that_gain():
    """Half of the touches are sure at once, the others from two seconds on."""
    sure = np.tile([1.0, 0, 0], (4, 1))
    later = np.vstack([np.tile([0.5, 0, 0.5], (2, 1)), sure[:2]])
    proba = np.tile([sure, later], (600, 1, 1))
    true = np.tile([[1, 0, 0]], (1200, 1))
    rule = ExpectedGain(0.1).fit(proba, true, durations=DURATIONS)
    assert rule.stop_at(proba[:2]).tolist() == [0, 2]


def test_the_rule_beats_every_fixed_duration_on_new_touches():
    """Loss and price together, where some touches tell all at once."""
    proba, true, _ = random_touches(2000)
    price = 0.01
    rule = ExpectedGain(price).fit(proba, true, durations=DURATIONS)
    proba, true, _ = random_touches(2000, seed=1)
    each = np.stack(
        [
            losses(proba[:, k], true, ordered=True) + price * seconds
            for k, seconds in enumerate(DURATIONS)
        ],
        axis=1,
    )
    mine = each[np.arange(2000), rule.stop_at(proba)].mean()
    assert mine < each.mean(axis=0).min() - 0.001


def test_several_adjectives_are_averaged():
    proba, true, _ = random_touches()
    both = np.stack([proba, proba], axis=2)
    for rule in RULES:
        one = clone(rule).fit(proba, true, durations=DURATIONS)
        two = clone(rule).fit(both, np.stack([true, true], 1), durations=DURATIONS)
        assert (one.stop_at(proba) == two.stop_at(both)).all()


@pytest.mark.parametrize(
    ("y", "durations", "message"),
    [
        ([[1, 2], [0, 0]], [1, 2, 3], "y has a negative or missing count, or a trial"),
        ([[1, 2], [-1, 3]], [1, 2, 3], "y has a negative or missing count, or a trial"),
        ([[1, 2], [np.nan, 3]], [1, 2, 3], "y has a negative or missing count, or"),
        ([[1, 2], [1, 0]], [1, 3, 2], "durations do not ascend"),
    ],
)
def test_rules_refuse_what_teaches_wrong(y, durations, message):
    with pytest.raises(ValueError, match=message):
        ExpectedGain().fit(np.full((2, 3, 2), 0.5), y, durations=durations)
    with pytest.raises(ValueError, match="give one distribution per trial and"):
        CertaintyThreshold().stops(np.full((3, 2), 0.5))
    with pytest.raises(ValueError, match=r"'threshold' parameter .* in the range"):
        CertaintyThreshold(90).stop_at(np.full((3, 2, 5), 0.2))


def test_durations_that_no_touch_reaches_teach_nothing():
    """Neither does no touch at all, which stops nowhere."""
    rng = np.random.default_rng(0)
    proba, y = rng.dirichlet(np.ones(3), (60, 4)), rng.multinomial(5, [0.3] * 3, 60)
    longer = np.concatenate([proba, np.full((60, 1, 3), np.nan)], axis=1)
    short = ExpectedGain().fit(proba, y, durations=[1, 2, 3, 4])
    long = ExpectedGain().fit(longer, y, durations=[1, 2, 3, 4, 5])
    np.testing.assert_array_equal(long.coefs_[:3], short.coefs_)
    np.testing.assert_array_equal(long.coefs_[3], 0)
    assert long.stop_at(longer[:0]).tolist() == []


def test_a_rule_that_only_tells_when_to_stop_is_refused():
    """Whole touches need its `stop_at`, too."""

    class Stops(BaseEstimator):
        def fit(self, proba, true, durations, ordered):
            return self

        def stops(self, proba):
            return proba.max(axis=(1, 2)) > 0.9

    pipeline = make_pipeline(SignalStatistics(), NNPOM(0))
    model = AnytimeRegressor(
        pipeline, durations=[1], sampling_rates=10, stopping=Stops()
    )
    touches = [np.ones((10, 1))] * 4
    with pytest.raises(ValueError, match=r"'stopping' parameter .* 'stop_at'"):
        model.fit(touches, np.eye(4, dtype=int), groups=range(4))
