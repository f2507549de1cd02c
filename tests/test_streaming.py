"""Touches in progress predict what the model predicts for the samples so far."""

import runpy
import time
from copy import deepcopy
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from short_touches import (
    COUNTS,
    HEAD,
    OBJECTS,
    RATES,
    TOUCHES,
    coded,
    cut,
    features,
    make_model,
    statistics,
)
from sklearn.base import clone
from sklearn.decomposition import PCA
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline, make_union
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from sklearn_haptic import (
    NNPOM,
    AnytimeRegressor,
    DistributionalOrdinalRegressor,
    RepairTrials,
    Signal,
    SignalStatistics,
    STHMPTransformer,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.streaming import CertaintyThreshold

pytestmark = pytest.mark.filterwarnings("ignore:.*fit was given no groups")


def both_statistics(table):
    return np.hstack([statistics(table[sensor]) for sensor in table])


def mixed(sensor):
    """One sensor by the package's steps and another behind them, one by foreign."""
    if sensor == "slow":
        return FunctionTransformer(statistics)
    return make_pipeline(coded(sensor), PCA(3, random_state=0))


def shares_and_means(sensor, root=False):
    pool = TemporalMaxPool((2, 1), statistics=("share", "mean"), root=root)
    return make_pipeline(coded(sensor)[0], pool)


roots_of_shares = partial(shares_and_means, root=True)
PIPELINES = {
    "package": lambda: make_pipeline(features(), StandardScaler(), HEAD),
    "other statistics": lambda: make_pipeline(features(shares_and_means), HEAD),
    "roots": lambda: make_pipeline(features(roots_of_shares), HEAD),
    "mixed": lambda: make_pipeline(features(mixed), HEAD),
    "joint": lambda: make_pipeline(FunctionTransformer(both_statistics), HEAD),
}


@pytest.fixture(scope="module", params=PIPELINES)
def model(request):
    model = make_model(PIPELINES[request.param](), cv=2)
    return model.fit(TOUCHES, COUNTS, groups=OBJECTS)


@pytest.fixture(scope="module")
def of_codes():
    model = make_model(cv=2, stopping=CertaintyThreshold(0.5))
    return model.fit(TOUCHES, COUNTS, groups=OBJECTS)


def as_recorded(model, felt):
    """The prediction for samples that are given as one recorded touch."""
    cells = {s: [x] if len(x) else [None] for s, x in felt.items()}
    table = pd.DataFrame({s: pd.Series(x, dtype=object) for s, x in cells.items()})
    return model.predict_proba(table)[0]


@pytest.mark.filterwarnings("ignore:A touch lacks a sensor, and with it features")
@pytest.mark.filterwarnings("ignore:A touch goes on without")
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_any_chunks_predict_as_the_samples_so_far(model, data):
    """Sensors run ahead, fall behind and are left out at random."""
    trial = data.draw(st.integers(0, len(TOUCHES) - 1))
    touch, felt = model.start(), dict.fromkeys(RATES, 0)
    for _ in range(data.draw(st.integers(1, 8))):
        new = {}
        for sensor, rate in RATES.items():
            if data.draw(st.booleans(), label=sensor):
                n = data.draw(st.integers(0, int(1.5 * rate)))
                start = felt[sensor]
                new[sensor] = TOUCHES[sensor][trial][start : start + n]
                felt[sensor] += len(new[sensor])
        touch.update(new)
        prefix = {s: TOUCHES[s][trial][:n] for s, n in felt.items()}
        assert_allclose(
            touch.predict_proba(), as_recorded(model, prefix), rtol=0, atol=1e-12
        )


def test_every_prefix_sample_by_sample(of_codes):
    touch, x = of_codes.start(), TOUCHES.iloc[5]
    for i in range(int(2.2 * RATES["fast"])):
        new = {"fast": x["fast"][i]}
        if i % 4 == 3:
            new["slow"] = x["slow"][i // 4]
        touch.update(new)
        felt = {"fast": x["fast"][: i + 1], "slow": x["slow"][: (i + 1) // 4]}
        assert_allclose(
            touch.predict_proba(), as_recorded(of_codes, felt), rtol=0, atol=1e-12
        )


def test_single_precision_stays_single():
    """A level that varies by a millionth tells precisions apart; so do all codes."""
    rng = np.random.default_rng(1)
    touches = [1e4 + 0.01 * rng.normal(size=(90, 1)) for _ in OBJECTS]
    touches = [touch.astype(np.float32) for touch in touches]
    parts = make_union(coded("slow"), SignalStatistics(("mean", "slope")))
    model = make_model(make_pipeline(parts, StandardScaler(), HEAD), sampling_rates=40)
    model.fit(touches, COUNTS, groups=OBJECTS)
    for recorded in touches[:5]:
        touch = model.start()
        for start in range(0, len(recorded), 7):
            touch.update(recorded[start : start + 7]).update([]).update(recorded[:0])
        assert_array_equal(touch.predict_proba(), model.predict_proba([recorded])[0])


def test_seconds_count_samples(of_codes):
    touch = of_codes.start()
    assert touch.seconds == 0
    touch.update({"fast": np.ones((4, 2))})
    assert touch.seconds == 0  # the slow sensor is not yet late
    touch.update({"slow": np.ones((1, 2))})
    assert touch.seconds == pytest.approx(0.1)
    touch.update({"fast": np.ones((400, 2))})
    assert touch.seconds == pytest.approx(10.1)  # by now it is


def test_a_touch_is_done_where_the_rule_stops_recorded_ones(of_codes):
    _, seconds = of_codes.predict_when_done(TOUCHES)
    assert len(set(seconds)) > 1
    for trial, stop in enumerate(seconds):
        touch, x = of_codes.start(), TOUCHES.iloc[trial]
        n = 0
        while not touch.done:
            touch.update({s: x[s][n * r : (n + 1) * r] for s, r in TENTHS.items()})
            n += 1
        assert touch.seconds == pytest.approx(stop)


@pytest.mark.filterwarnings("ignore:A touch goes on without")
def test_asking_whether_a_touch_is_done_changes_nothing(of_codes):
    """Sensors come one after the other, by halves of a second."""
    x = TOUCHES.iloc[0]
    asked, silent = of_codes.start(), of_codes.start()
    for half in range(4):
        for sensor, rate in RATES.items():
            n = round(rate / 2)
            new = {sensor: x[sensor][half * n : (half + 1) * n]}
            asked.update(new)
            silent.update(new)
            _ = asked.done
        assert asked.done == deepcopy(silent).done
        assert_array_equal(asked.predict_proba(), silent.predict_proba())


@pytest.mark.parametrize("first", [0, 1])
def test_a_sensor_slower_than_the_delay_is_waited_for(first):
    """Its samples come at the begin of their steps, or at the end."""
    rng = np.random.default_rng(0)
    level = np.arange(40) % 5
    X = pd.DataFrame(
        {
            "fast": [rng.normal(size=(400, 1)) * (1 + each) for each in level],
            "slow": [rng.normal(size=(10, 1)) for _ in level],
        }
    )
    rates = {"fast": 200, "slow": 5}
    sensors = {s: Signal(rate) for s, rate in rates.items()}
    pipeline = make_haptic_pipeline(sensors, random_state=0)
    model = AnytimeRegressor(
        pipeline.set_params(model=DistributionalOrdinalRegressor()),
        durations=[0.5, 1, 2],
        sampling_rates=rates,
    )
    model.fit(X, np.eye(5, dtype=int)[level] * 9 + 1, groups=np.arange(40) % 20)
    touch, shorter = model.start(), X[:1].copy()
    for i in range(400):
        touch.update({"fast": X["fast"][0][i]})
        if (i + first) % 40 == 0:  # the sample of this step of 0.2 s
            n = i // 40
            touch.update({"slow": X["slow"][0][n]})
        if i == 369:  # of 1.85 s
            shorter.at[0, "fast"] = X["fast"][0][:370]
            _, seconds = model.predict_when_done(shorter)  # its last is of 1.8 s
            assert seconds == 1
            assert not touch.done
    assert touch.done
    assert_allclose(touch.predict_proba(), model.predict_proba(X[:1])[0], atol=1e-9)


TENTHS = {sensor: round(rate / 10) for sensor, rate in RATES.items()}


def test_without_a_rule_a_touch_takes_the_longest_duration(model):
    proba, seconds = model.predict_when_done(cut(TOUCHES, 1.5))
    assert (seconds == 1).all()
    assert_array_equal(proba, model.predict_proba(cut(TOUCHES, 1.5)))
    proba, seconds = model.predict_when_done(cut(TOUCHES, 0.3))
    assert (seconds == 0).all()
    assert_allclose(proba, np.tile(model.shares_, (24, 1)))
    touch = model.start().update(dict(cut(TOUCHES, 1.5).iloc[0]))
    assert not touch.done
    assert touch.update({s: np.ones((int(r), 2)) for s, r in RATES.items()}).done


def test_reset_begins_a_new_touch(of_codes):
    fresh, used = of_codes.start(), of_codes.start()
    used.update(dict(TOUCHES.iloc[3]))
    assert used.done
    used.reset()
    assert used.seconds == 0
    for touch in (fresh, used):
        touch.update(dict(cut(TOUCHES, 1).iloc[7]))
    assert (fresh.predict_proba() == used.predict_proba()).all()


@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_samples_that_are_not_finite_repeat_the_last_one(of_codes, data):
    """However they are cut into chunks; before the first finite one, that one counts.

    Saturated samples are kept at the limit.
    """
    recorded = {s: np.array(TOUCHES[s][2]) for s in RATES}
    bad, n_bad = {s: x.copy() for s, x in recorded.items()}, {}
    for sensor, x in bad.items():
        at = data.draw(st.lists(st.integers(0, len(x) - 2), max_size=6, unique=True))
        for i in at:
            x[i, data.draw(st.integers(0, 1))] = data.draw(
                st.sampled_from([np.nan, np.inf, -np.inf, 100.0, -100.0, 1e3])
            )
        n_bad[sensor] = len(at)
        known = pd.DataFrame(x).replace([np.inf, -np.inf], np.nan)
        recorded[sensor] = known.ffill().bfill().clip(-100, 100).to_numpy()
    touch = of_codes.start(dict.fromkeys(RATES, (-100, 100)))
    n_chunks = data.draw(st.integers(1, 6))
    chunks = {s: np.array_split(x, n_chunks) for s, x in bad.items()}
    for i in range(n_chunks):
        touch.update({s: chunks[s][i] for s in RATES})
    assert touch.ignored == n_bad
    assert_allclose(
        touch.predict_proba(), as_recorded(of_codes, recorded), rtol=0, atol=1e-12
    )


def test_limits_are_those_of_repair_trials(of_codes):
    """Of numbers of NumPy, in single precision, and of all sensors together."""
    x = {s: np.clip(TOUCHES[s][2], -9, 1.1).astype(np.float32) for s in RATES}
    n_at_limit = {s: int((x[s] == np.float32(1.1)).any(axis=1).sum()) for s in RATES}
    assert min(n_at_limit.values()) > 0
    for pair in ((-10, 1.1), np.array([-10, 1.1]), [np.int8(-10), np.float64(1.1)]):
        for limits in (pair, dict.fromkeys(RATES, pair)):
            assert of_codes.start(limits).update(x).ignored == n_at_limit


def test_a_channel_that_rests_at_its_limit_is_no_missing_sensor(of_codes):
    """As a taxel that reads 0 until it is pressed; `RepairTrials` keeps such values."""
    limits = dict.fromkeys(RATES, (0, 1.1))
    x = {s: np.clip(TOUCHES[s][2], 0, 3) for s in RATES}
    for signal in x.values():
        signal[:, 1] = 0
    repaired = RepairTrials(limits=limits).fit(TOUCHES).transform(pd.DataFrame([x]))
    touch = of_codes.start(limits)
    for i in range(20):
        touch.update({s: np.array_split(x[s], 20)[i] for s in RATES})
    assert touch.seconds == pytest.approx(min(len(x[s]) / r for s, r in RATES.items()))
    assert_allclose(
        touch.predict_proba(), of_codes.predict_proba(repaired)[0], atol=1e-12
    )


def test_a_sensor_that_never_works_is_missing(of_codes):
    touch, x = of_codes.start(), TOUCHES.iloc[4]
    dead = x["slow"].copy()
    dead[:, 1] = np.nan
    touch.update({"fast": x["fast"], "slow": dead})
    assert touch.ignored == {"fast": 0, "slow": len(dead)}
    expected = as_recorded(of_codes, {"fast": x["fast"], "slow": []})
    with pytest.warns(UserWarning, match="goes on without 'slow', which is late"):
        assert_allclose(touch.predict_proba(), expected, atol=1e-12)


@pytest.mark.parametrize("order", [[1, 0], [0, 0], [0, 1]])
def test_stamps_are_checked_before_anything_is_predicted_from_them(of_codes, order):
    """Packets in another order or twice at once, another rate at the first duration."""
    first = of_codes.durations_[0]
    n = int(np.ceil(first * RATES["slow"]))
    rate = RATES["slow"] * (3 if order == [0, 1] else 1)
    samples = pd.DataFrame(TOUCHES["slow"].iloc[0][:n], index=np.arange(n) / rate)
    packets = [samples[: n // 2], samples[n // 2 :]]
    touch = of_codes.start()
    refused = r"must be finite and increase|is sampled at 30"
    with pytest.raises(ValueError, match=refused):
        for i in order:
            touch.update({"slow": packets[i]})
    assert touch.seconds < first


def test_a_touch_without_a_good_sample_comes_to_an_end(of_codes):
    touch = of_codes.start()
    for _ in range(100):
        assert not touch.done
        nothing = {
            sensor: np.full((int(rate / 10), 2), np.nan)
            for sensor, rate in RATES.items()
        }
        if touch.update(nothing).done:
            break
    assert touch.seconds == 0
    assert_array_equal(touch.predict_proba(), of_codes.shares_)
    assert sum(touch.ignored.values()) > 0


def test_a_touch_belongs_to_the_model_at_its_start(of_codes):
    model = clone(of_codes).fit(TOUCHES, COUNTS, groups=OBJECTS)
    touch, x = model.start(), TOUCHES.iloc[4]
    half = {sensor: x[sensor][: len(x[sensor]) // 2] for sensor in RATES}
    rest = {sensor: x[sensor][len(x[sensor]) // 2 :] for sensor in RATES}
    touch.update(half)
    model.set_params(durations=[0.5, 0.7]).fit(TOUCHES, COUNTS[::-1], groups=OBJECTS)
    assert_allclose(
        touch.update(rest).predict_proba(), as_recorded(of_codes, x), atol=1e-12
    )


def test_ties_of_coarse_signals_do_not_depend_on_what_comes_together():
    rng = np.random.default_rng(0)
    touches = [rng.integers(-1, 2, (200, 2)).astype(float) for _ in range(20)]
    model = make_model(
        make_pipeline(*coded("fast"), HEAD), durations=[0.5, 1], sampling_rates=100
    ).fit(touches, COUNTS[:20])
    expected = model.predict_proba(touches)
    for touch, proba in zip(touches, expected):
        new = model.start()
        for sample in touch:
            new.update(sample)
        assert_allclose(new.predict_proba(), proba, rtol=0, atol=1e-12)


def test_electrodes_adjectives_and_one_unnamed_sensor():
    rng = np.random.default_rng(0)
    touches = [rng.normal(size=(n, 19)) for n in rng.integers(30, 60, 12)]
    counts = rng.integers(1, 5, (12, 2, 3))
    codes = make_pipeline(
        STHMPTransformer(3, 2, max_iter=2, random_state=0), TemporalMaxPool((4, 1))
    )
    head = DistributionalOrdinalRegressor(
        NNPOM(1, max_iter=2000, alpha=10), random_state=0
    )
    model = make_model(
        make_pipeline(codes, head), durations=[0.02, 0.3], sampling_rates=100, cv=2
    ).fit(touches, counts)
    touch = model.start()
    for i in range(30):  # two frames are fewer than the four cells
        proba = touch.update(touches[0][i]).predict_proba()
        expected = model.predict_proba([touches[0][: i + 1]])[0]
        assert_allclose(proba, expected, rtol=0, atol=1e-12)
    assert proba.shape == (2, 3)
    assert touch.done


def test_classes_from_statistics_of_one_channel():
    rng = np.random.default_rng(0)
    materials = np.repeat(["cork", "foam"], 6)
    touches = [
        rng.normal(loc=loc, size=(50, 1)) for loc in np.where(materials == "cork", 0, 2)
    ]
    pipeline = make_pipeline(FunctionTransformer(statistics), LogisticRegression())
    model = make_model(pipeline, durations=[1, 2], sampling_rates=20, cv=2)
    model.fit(touches, materials)
    touch = model.start((-10, 10))
    for i in range(0, 50, 7):
        touch.update(touches[9][i : i + 7, 0])
        expected = model.predict_proba([touches[9][: i + 7]])[0]
        assert_allclose(touch.predict_proba(), expected, atol=1e-12)
    assert model.classes_[touch.predict_proba().argmax()] == "foam"


def test_what_is_kept_and_what_an_update_costs_do_not_grow(of_codes):
    """100,000 samples: a late tenth takes no longer than an early one."""
    touch, rng = of_codes.start(), np.random.default_rng(0)
    new = {s: rng.normal(size=(10 * n, 2)) for s, n in TENTHS.items()}
    seconds = []
    for _ in range(2500):
        start = time.process_time()
        touch.update(new).predict_proba()
        seconds.append(time.process_time() - start)
    assert touch.seconds == 2500
    assert np.median(seconds[-500:]) < 3 * np.median(seconds[100:600]) + 1e-4
    pools = touch._felt._pools.values()
    kept = [each.nbytes for p in pools for each in (p._rest, *p._kept.values())]
    assert sum(kept) < 100_000


def test_the_node_of_the_examples_says_what_is_known_before_it_is_done():
    """Also if a duration is no whole number of samples."""
    path = Path(__file__).parents[1] / "examples" / "run_touch_node.py"
    rng = np.random.default_rng(0)
    X = [rng.normal(size=(60, 1)) for _ in range(24)]
    model = AnytimeRegressor(
        make_haptic_pipeline(None, random_state=0),
        durations=[0.5, 1],
        sampling_rates=1000 / 28,
        cv=2,
    )
    model.fit(X, rng.multinomial(9, [0.2, 0.3, 0.5], 24), groups=np.arange(24))
    said, done = [], []
    node = runpy.run_path(str(path))["TouchNode"](
        model, lambda _, proba: said.append(proba), done.append
    )
    for sample in X[0]:
        node.touch.update(sample)
        node.on_timer()
    assert len(done) == 1 and len(said) == 2
    assert_allclose(said[-1], model.predict_proba(X[:1])[0], atol=1e-12)


def test_the_node_of_the_examples_replays_a_recorded_touch(of_codes):
    """Without ROS: its predictions are the model's, and it says once to stop."""
    path = Path(__file__).parents[1] / "examples" / "run_touch_node.py"
    example = runpy.run_path(str(path))
    said, done = [], []
    node = example["TouchNode"](of_codes, lambda *new: said.append(new), done.append)
    _, stops = of_codes.predict_when_done(TOUCHES)
    for trial in (0, 17):
        said.clear(), done.clear()
        node.on_start()
        example["replay"](node, TOUCHES.iloc[trial], RATES, sleep=lambda _: None)
        assert done == pytest.approx([stops[trial]])
        assert [seconds for seconds, _ in said] == pytest.approx(
            [d for d in of_codes.durations_ if d <= stops[trial]]
        )
        for seconds, proba in said:
            expected = of_codes.predict_proba(cut(TOUCHES, seconds))[trial]
            assert_allclose(proba, expected, atol=1e-12)
    said.clear(), done.clear()
    node.on_start()  # a touch without a sensor that works ends too
    dead = {sensor: np.full((100, 2), np.nan) for sensor in RATES}
    example["replay"](node, dead, RATES, sleep=lambda _: None)
    assert (said, done) == ([], [0.0])


@pytest.mark.parametrize("n", [0, 1])
def test_hardly_any_samples(model, n):
    touch = model.start().update({s: np.ones((n, 2)) for s in RATES})
    assert_array_equal(touch.predict_proba(), model.shares_)
    assert not touch.done


def test_samples_of_nullable_types(of_codes):
    touch = dict(cut(TOUCHES, 1).iloc[0])
    nullable = {s: pd.DataFrame(each).astype("Float64") for s, each in touch.items()}
    for each in (touch, nullable):
        each["fast"] = each["fast"].copy()
    touch["fast"][5, 0] = np.nan
    nullable["fast"].iloc[5, 0] = pd.NA
    expected = of_codes.start().update(touch)
    found = of_codes.start().update(nullable)
    assert found.ignored == expected.ignored
    assert_array_equal(found.predict_proba(), expected.predict_proba())


def test_a_bad_update_changes_nothing(of_codes):
    touch = of_codes.start().update(dict(cut(TOUCHES, 1).iloc[0]))
    before = touch.predict_proba()
    with pytest.raises(ValueError, match="samples\\['slow'\\] has shape"):
        touch.update({"fast": np.ones((100, 2)), "slow": np.ones((3, 5))})
    assert touch.seconds == 1
    assert (touch.predict_proba() == before).all()
