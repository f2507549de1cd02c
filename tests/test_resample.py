"""Resampling by time stamps, and rates that they contradict."""

import numpy as np
import pandas as pd
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy import signal
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline

from sklearn_haptic import (
    AnytimeRegressor,
    KSVDTransformer,
    RepairTrials,
    Signal,
    SignalStatistics,
    STHMPTransformer,
    make_haptic_pipeline,
    resample_trials,
)


def rate_of(trials):
    return SignalStatistics().fit(trials).rate_


def waves(times):
    return np.column_stack([np.sin(2 * np.pi * 3 * times), times])


@pytest.mark.parametrize("jitter", [0, 0.2])
@pytest.mark.parametrize("clock", [1001, 990])
def test_a_clock_that_is_off_keeps_vibrations(clock, jitter):
    """Straight lines had errors of 4, 14 and 30 % of the amplitude."""
    steps = np.random.default_rng(0).uniform(1 - jitter, 1 + jitter, 4000) / clock
    times = 7 + np.cumsum(steps)
    frequencies = np.array([100, 200, 300])
    trial = np.sin(2 * np.pi * np.outer(times, frequencies))
    resampled = resample_trials([trial], [times], 1000, longest_gap=0.01)[0]
    new = times[0] + np.arange(len(resampled)) / 1000
    assert new[-1] <= times[-1] < new[-1] + 0.001
    error = (resampled - np.sin(2 * np.pi * np.outer(new, frequencies)))[9:-9]
    assert (np.sqrt(2 * np.mean(error**2, axis=0)) < [0.003, 0.015, 0.08]).all()


def test_gaps_and_rests_are_straight_lines():
    """Also beside them no curve leaves what was measured by much."""
    trial = np.r_[np.zeros(20), 4095 * np.ones(30), np.zeros(20)]
    times = np.arange(70) / 100
    times[35:] += 0.3
    times[10] = times[9] + 1e-9
    resampled = resample_trials([trial[:, None]], [times], 1000, longest_gap=np.inf)
    new = np.arange(len(resampled[0])) / 1000
    line = np.interp(new, times, trial)
    steps = (line > 0) & (line < 4095)
    assert_array_equal(resampled[0][~steps, 0], line[~steps])
    assert (abs(resampled[0][:, 0] - line) < 500).all()
    noise = np.random.default_rng(0).normal(size=70)
    resampled = resample_trials([noise[:, None]], [times], 1000, longest_gap=np.inf)
    assert abs(resampled[0]).max() < 1.5 * abs(noise).max()
    in_gap = (new > times[34]) & (new < times[35])
    assert_array_equal(resampled[0][in_gap, 0], np.interp(new, times, noise)[in_gap])


def test_an_even_rate_stays_as_it_is():
    times = np.arange(300) / 35
    trial = waves(times)
    assert_allclose(resample_trials([trial], [times], 35)[0], trial, atol=1e-12)


@pytest.mark.parametrize("factor", [2, 5, 10])
def test_decimation_is_that_of_scipy(factor):
    times = np.arange(1001) / 1000
    trial = waves(times) + np.random.default_rng(0).normal(size=(1001, 2))
    resampled = resample_trials([trial], [times], 1000 / factor)[0]
    expected = signal.resample_poly(trial, 1, factor, padtype="line")
    assert_allclose(resampled, expected, atol=1e-9)


def stamped(times, kind, frame=pd.DataFrame):
    """A recording whose index has the times of its samples."""
    seconds = pd.to_timedelta(times, unit="s")
    index = {
        "seconds": times,
        "durations": seconds,
        "dates": pd.Timestamp("2026-11-22", tz="UTC") + seconds,
    }[kind]
    trial = pd.DataFrame(waves(times), index)
    return trial if frame is pd.DataFrame else trial[0]


KINDS = ["seconds", "durations", "dates"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("frame", [pd.DataFrame, pd.Series])
def test_the_rate_is_that_of_the_index(kind, frame):
    rng = np.random.default_rng(0)
    times = [
        np.delete(np.arange(n) / 35, [5, 6, 9]) + rng.uniform(-1e-3, 1e-3, n - 3)
        for n in (40, 60)
    ]
    trials = [stamped(each, kind, frame) for each in times]
    assert rate_of(trials) == pytest.approx(35, rel=0.02)
    even = resample_trials([*trials, None])
    assert [each is None for each in even] == [False, False, True]
    assert len(even[0]) == pytest.approx(40, abs=1)


RATES = [30, 35, 60, 90, 120, 300, 400, 420, 450, 600, 650, 700, 750, 833, 900, 1000]
UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def floored(times, unit):
    """Durations in whole units, as loggers write them; or seconds since 1970."""
    if unit == "epoch":
        return 1.7e9 + times
    counts = np.floor(times / UNITS[unit] + 1e-6).astype(int)
    return pd.to_timedelta(counts, unit=unit)


@pytest.mark.parametrize("unit", ["ms", "us", "epoch"])
@pytest.mark.parametrize("rate", [*RATES, 1500, 2000])
def test_rounded_stamps_hardly_change_the_rate(rate, unit):
    if unit == "ms" and rate > 1000:
        pytest.skip("some stamps are the same")
    rng = np.random.default_rng(0)
    times = [rng.uniform(0, 0.01) + np.arange(n) / rate for n in (100, 101, 150)]
    trials = [pd.Series(each, floored(each, unit)) for each in times]
    for some in (trials, trials[:1]):
        assert rate_of(some) == pytest.approx(rate, rel=0.06 if unit == "ms" else 0.001)
    statistics = SignalStatistics(rate=rate).fit(trials)
    statistics.transform(trials[::-1])
    statistics.transform([trials[1].iloc[:20], trials[1].iloc[:3]])
    for trial, even in zip(trials, resample_trials(trials, rate=rate)):
        if rate <= 500 or unit != "ms":
            assert np.isfinite(even).all()  # nothing was lost
        step = 1 / rate + 2 * UNITS.get(unit, 0) + 1e-6
        differences = np.abs(even[:, 0] - trial.iloc[: len(even)])
        assert np.nanmax(differences) < step


@pytest.mark.parametrize("rate", [30, 90, 300, 420, 1000])
@pytest.mark.parametrize("jitter", [0, 0.1])
def test_lost_samples_hardly_change_the_rate(rate, jitter):
    """One in twenty, by chance."""
    rng = np.random.default_rng(0)
    times = [
        (np.arange(300) + rng.uniform(-jitter, jitter, 300))[rng.random(300) > 0.05]
        / rate
        for _ in range(3)
    ]
    trials = [pd.Series(each, pd.to_timedelta(each, unit="s")) for each in times]
    assert rate_of(trials) == pytest.approx(rate, rel=0.05)
    SignalStatistics(rate=rate).fit(trials)
    lost = [np.isnan(each).any() for each in resample_trials(trials, rate=rate)]
    assert all(lost)


@pytest.mark.parametrize("rate", [1000, 2200, 50_000])
def test_seconds_since_1970_keep_the_last_sample(rate):
    times = 1.7e9 + 0.123456 + np.arange(10 * rate) / rate
    trial = np.sin(np.arange(len(times)))
    even = resample_trials([trial], [times], rate)[0][:, 0]
    assert even.shape == trial.shape
    assert_allclose(even, trial, atol=5e-7 * rate)


@pytest.mark.parametrize("kind", KINDS)
def test_resampling_by_the_index_is_that_by_its_seconds(kind):
    times = [np.delete(np.arange(n) / 10, [5, 6]) for n in (20, 31)]
    trials = [stamped(each, kind) for each in times]
    by_index = resample_trials([*trials, None])
    by_times = resample_trials([waves(each) for each in times], times, 10)
    for one, other in zip(by_index[:2], by_times, strict=True):
        assert_allclose(one, other, atol=1e-9)
    assert by_index[2] is None


@pytest.mark.parametrize("library", [pd, pl])
def test_stamps_may_be_a_column(library):
    times = np.arange(20) / 10
    a, b = waves(times).T
    trial = library.DataFrame({"a": a, "when": times, "b": b})
    resampled = resample_trials([trial], "when", 20)[0]
    expected = resample_trials([waves(times)], [times], 20)[0]
    assert_allclose(resampled, expected, atol=1e-12)
    with pytest.raises(ValueError, match=r"^Trial 0 has no column 'at' of time"):
        resample_trials([trial], "at")


@pytest.mark.parametrize("zone", [None, "UTC", "Asia/Tokyo"])
def test_stamps_may_be_dates_of_a_time_zone(zone):
    dates = pd.date_range("2026-11-22", periods=20, freq="20ms", tz=zone)
    trial = pd.DataFrame({"when": dates, "a": np.arange(20.0)})
    expected = resample_trials([trial[["a"]]], [np.arange(20) / 50])[0]
    for stamps in ([trial["when"]], [list(dates)], [dates.to_pydatetime()]):
        found = resample_trials([trial[["a"]]], stamps)[0]
        assert_allclose(found, expected, atol=1e-9)
    found = resample_trials([trial], "when")[0]
    assert_allclose(found, expected, atol=1e-9)


def test_a_trial_without_samples_is_passed_over():
    times = np.arange(20) / 10
    empty = stamped(times[:0], "durations")
    resampled = resample_trials([empty, stamped(times, "durations"), None])
    assert resampled[0] is None
    assert resampled[2] is None
    assert len(resampled[1]) == 20


def test_columns_are_put_in_the_order_of_the_first_trial():
    times = np.arange(20) / 10
    expected = resample_trials([waves(times)], [times], 20)[0]
    for library in (pd, pl):
        named = dict(zip("ab", waves(times).T))
        trial = library.DataFrame(named)
        stamped = library.DataFrame({"when": times} | named)
        for resampled in (
            resample_trials([trial, waves(times), trial[["b", "a"]]], [times] * 3, 20),
            resample_trials([stamped, stamped[["b", "when", "a"]]], "when", 20),
        ):
            for each in resampled:
                assert_array_equal(each, expected)
        odd = library.DataFrame({"a": times, "c": times})
        with pytest.raises(ValueError, match=r"^Trial 1 of trials and the first"):
            resample_trials([trial, odd], [times] * 2, 20)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("kind", [int, float])
def test_stamps_in_another_unit(unit, kind):
    for rate in (35, 100, 500, 1000):
        times = np.arange(60) / rate
        stamps = (times / UNITS[unit] + 1e6).astype(kind)
        trial = pd.DataFrame({"a": times, "when": stamps})
        for asked in (rate / 2, rate, 4 * rate):
            with pytest.raises(ValueError, match=r"^The stamps of trial 0 have steps"):
                resample_trials([trial], "when", asked)
            found = resample_trials([trial], "when", asked, unit=unit)[0]
            durations = [pd.to_timedelta(stamps, unit=unit)]
            same = resample_trials([trial[["a"]]], durations, asked)[0]
            n = min(len(found), len(same))  # of which rounding may cost the last
            assert max(len(found), len(same)) <= n + 1
            assert_allclose(found[:n], same[:n], atol=1e-6)
            assert len(found) == pytest.approx(60 * asked / rate, rel=0.1)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_stamps_in_seconds_that_are_said_to_be_shorter(unit):
    times = np.arange(100) / 100
    with pytest.raises(ValueError, match="which cannot be sampled at 100 Hz"):
        resample_trials([waves(times)], [times], 100, unit=unit)


def test_stamps_of_single_precision_lose_no_sample():
    """The last is kept, and only what was dropped is NaN."""
    rng = np.random.default_rng(0)
    for rate in (50, 200, 1000):
        times = np.arange(rate) / rate + 1
        kept = np.sort(rng.permutation(rate)[: rate - 5])
        kept = np.unique([0, *kept, rate - 1])
        found = resample_trials([waves(times[kept])], [times[kept].astype("f4")], rate)
        gone = np.setdiff1d(np.arange(rate), kept)
        assert_array_equal(np.flatnonzero(np.isnan(found[0][:, 0])), gone)


@pytest.mark.parametrize("kind", ["int64", "uint64", "Int64", "object"])
def test_nanoseconds_since_1970_are_not_rounded(kind):
    """Double precision tells those of today apart by 256 ns only."""
    nanoseconds = np.arange(200, dtype=np.int64) * 22_676 + 1_790_000_000_123_456_789
    trial = np.sin(np.arange(200))
    stamps = pd.Series(nanoseconds, dtype=kind)
    found = resample_trials([trial], [stamps], 1e9 / 22_676, unit="ns")[0]
    assert_allclose(found[:, 0], trial, atol=1e-9)


@pytest.mark.parametrize("kind", ["int16", "int32", "Int16"])
def test_differences_of_short_integers_do_not_overflow(kind):
    """From -30 to 30 seconds: their difference is more than an int16 can hold."""
    stamps = pd.Series(np.arange(-30_000, 30_001, 1000), dtype=kind)
    trial = np.arange(61.0)
    found = resample_trials([trial], [stamps], 1, unit="ms")[0]
    assert_allclose(found[:, 0], trial, atol=1e-9)


@pytest.mark.parametrize("wrong", [1e12, 1e300])
def test_one_wrong_stamp_is_refused(wrong):
    times = np.arange(50) / 100
    for bad in (np.append(times[:-1], wrong), np.insert(times[1:], 0, -wrong)):
        with pytest.raises(ValueError, match=r"^The stamps of trial 1 have steps of 0"):
            resample_trials([waves(times)] * 2, [times, bad], 100)


def test_slow_and_gappy_recordings_are_resampled():
    """Every second or two, with a gap of a minute, or to a far higher rate."""
    for step, rate in ((1, 1), (1, 20), (2, 2), (2.5, 2), (0.1, 2200), (0.25, 1000)):
        times = step * np.array([0, 1, 2, 60, 61, 62, 63, 64])
        resampled = resample_trials([times], [times], rate, longest_gap=np.inf)[0]
        assert_allclose(resampled[:, 0], np.arange(len(resampled)) / rate, rtol=1e-9)
    two = [np.array([0.0, 3.0]), np.arange(50) / 10]  # a trial that is nothing but gap
    assert len(resample_trials(two, two, 10)[0]) == 31


def test_a_rate_that_cannot_be_told_is_refused():
    times = np.arange(20) / 10
    with pytest.raises(ValueError, match=r"^No trial has two samples, to tell a rate"):
        resample_trials([waves(times[:1])], [times[:1]])
    for trial in (waves(times), pd.DataFrame(waves(times))):  # an index that counts
        with pytest.raises(ValueError, match=r"^Trial 0 has no index of time stamps"):
            resample_trials([trial])


def test_stamps_that_do_not_increase_are_named_by_their_place():
    trial = stamped(np.zeros(5), "durations")
    with pytest.raises(ValueError, match=r"^The index of trial 0 of X must be finite"):
        SignalStatistics().fit([trial])
    trial["when"] = 0.0
    with pytest.raises(ValueError, match=r"^The column 'when' of trial 0 must be fin"):
        resample_trials([trial], "when")


SENSORS = [{"q": Signal(rate=100)}, {"q": None}]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sensors", SENSORS, ids=["described", "not"])
def test_stamps_that_contradict_the_rate_are_refused(sensors, kind):
    """Of a sensor that is described, one that is not, and in a touch in progress."""
    trials = [stamped(np.arange(n) / 100, kind) for n in (60, 70, 80)]
    model = make_haptic_pipeline(sensors, random_state=0)
    objects = {"model__groups": range(3)}
    model.fit(pd.DataFrame({"q": trials}), [1, 2, 3], **objects)
    plain = pd.DataFrame({"q": [trial.to_numpy() for trial in trials]})
    known = model.predict_proba(pd.DataFrame({"q": trials}))
    assert_array_equal(known, model.predict_proba(plain))
    faster = pd.DataFrame({"q": [trials[0], stamped(np.arange(60) / 1000, kind)]})
    with pytest.raises(ValueError, match=r"^Trial 1 of X\['q'\] is sampled at 1000 Hz"):
        model.predict_proba(faster)
    again = make_haptic_pipeline({"q": Signal(rate=1000)}, random_state=0)
    with pytest.raises(ValueError, match=r"100 Hz by .*, but 1000 Hz .* all, also for"):
        again.fit(pd.DataFrame({"q": trials}), [1, 2, 3], **objects)
    if sensors["q"] is None:
        with pytest.raises(ValueError, match=r"^Trial . .* Hz is usual"):
            model.fit(faster, [1, 2])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "coder",
    [KSVDTransformer(4, window=5, max_iter=1), STHMPTransformer(4, max_iter=1)],
    ids=["K-SVD", "ST-HMP"],
)
def test_codes_are_of_touches_at_the_rate_of_training(coder, kind):
    def touch(rate):
        at = stamped(np.arange(60) / rate, kind).index
        return pd.DataFrame(np.random.default_rng(0).normal(size=(60, 19)), at)

    coder.fit([touch(100)] * 3)
    assert coder.rate_ == pytest.approx(100)
    coder.transform([touch(100).to_numpy()])
    with pytest.raises(ValueError, match=r"^Trial 1 of X is sampled at 300 Hz"):
        coder.transform([touch(100), touch(300)])
    with pytest.raises(ValueError, match=r"Hz is usual"):
        coder.fit([touch(100), touch(300)])


@pytest.mark.parametrize("kind", KINDS)
def test_stamps_that_go_back_are_refused(kind):
    trials = [stamped(np.arange(60) / 100, kind) for _ in range(3)]
    statistics = SignalStatistics().fit(trials)
    back = stamped(np.r_[np.arange(30, 60), np.arange(30)] / 100, kind)
    with pytest.raises(ValueError, match="must be finite and increase from sample to"):
        statistics.transform([back])


def test_stamps_that_contradict_the_rate_of_a_stream_are_refused():
    rng = np.random.default_rng(0)
    trials = [rng.normal(size=(200, 2)) for _ in range(20)]
    model = AnytimeRegressor(
        make_haptic_pipeline({"q": Signal(rate=100)}, random_state=0),
        durations=[0.5, 1],
        sampling_rates={"q": 100},
        cv=2,
    ).fit(pd.DataFrame({"q": trials}), np.arange(20) % 2 + 1, groups=range(20))
    frames = [pd.DataFrame(trial, np.arange(200) / 1000) for trial in trials]
    with pytest.raises(ValueError, match=r"^Trial 0 of X\['q'\] is sampled at 1000 Hz"):
        model.predict_proba(pd.DataFrame({"q": frames}))
    for n in (1, 3, 50):  # samples at a time
        touch = model.start()
        with pytest.raises(ValueError, match=r"samples\['q'\] is sampled at 1000 Hz"):
            for i in range(0, 60, n):
                touch.update({"q": frames[0].iloc[i : i + n]})
        assert touch.seconds < 0.25
        right = frames[0].set_axis(np.arange(200) / 100)
        touch.reset()
        for i in range(0, 60, n):
            touch.update({"q": right.iloc[:60].iloc[i : i + n]})
        assert_array_equal(
            touch.predict_proba(),
            model.predict_proba(pd.DataFrame({"q": [trials[0][:60]]}))[0],
        )


def test_a_stream_goes_on_after_lost_frames():
    """As does the recorded touch; one that skips half of its time is refused once."""
    rng = np.random.default_rng(0)
    trials = [rng.normal(size=(200, 2)) for _ in range(20)]
    statistics = make_pipeline(SignalStatistics(("mean",)), LogisticRegression())
    model = AnytimeRegressor(statistics, durations=[0.5], sampling_rates=100, cv=2)
    model.fit(trials, np.arange(20) % 2, groups=np.arange(20) // 2)
    whole = pd.DataFrame(trials[0], np.arange(200) / 100)
    for lost, n_refused in (([3, 4], 0), ([50, 51, 52, 120], 0), (range(50, 150), 1)):
        gappy, touch, refused = whole.drop(np.asarray(lost) / 100), model.start(), 0
        for i in range(len(gappy)):
            try:
                touch.update(gappy.iloc[[i]])
            except ValueError:
                refused += 1
        assert refused == n_refused
        assert touch.seconds == pytest.approx((len(gappy) - refused) / 100)
        if n_refused:
            with pytest.raises(ValueError, match="tells no rate, because less than ha"):
                model.predict_proba([gappy])
        else:
            assert_array_equal(model.predict_proba([gappy])[0], touch.predict_proba())


@pytest.mark.parametrize("n_together", [2, 3, 4, 6, 8, 10, 16, 20, 40])
def test_stamps_of_packets_tell_no_rate(n_together):
    """At 400 Hz, each stamped when it arrives; with the rate they are resampled."""
    packet, place = np.divmod(np.arange(400), n_together)
    times = packet * n_together / 400 + place * 1e-4
    wave = np.sin(2 * np.pi * np.arange(400) / 400)[:, np.newaxis]
    message = r"of trial 0.* tells no rate, because less than half of it is in steps"
    for call in (
        lambda: resample_trials([wave], [times]),
        lambda: SignalStatistics(rate=400).fit([pd.DataFrame(wave, times)]),
        lambda: SignalStatistics().fit([pd.DataFrame(wave, times)]),
    ):
        with pytest.raises(ValueError, match=message):
            call()
    even = resample_trials([wave], [times], 400, longest_gap=np.inf)[0]
    late = 2 * np.pi * n_together / 400
    assert np.abs(even - wave[: len(even)]).max() < 1.1 * late


@settings(deadline=None)
@given(st.integers(20, 990), st.floats(0, 0.4), st.floats(0, 0.1), st.integers(0, 99))
def test_uneven_stamps_tell_the_rate(rate, jitter, lost, seed):
    """Jittered, rounded to milliseconds, and with frames lost at random."""
    rng = np.random.default_rng(seed)
    places = np.flatnonzero(rng.random(400) >= lost)
    jittered = (places + jitter * rng.uniform(-0.5, 0.5, len(places))) / rate
    for stamps in (jittered, np.unique(np.round(jittered, 3))):
        found = rate_of([pd.Series(0.0, stamps)])
        if lost == 0 or rate < 300:  # rounded stamps that are equal count as lost
            assert found == pytest.approx(rate, rel=0.2)


@pytest.mark.parametrize("n_samples, within", [(60, 0.1), (5000, 0.01)])
@pytest.mark.parametrize("cause", ["clock", "delay", "loop", "rounding", "loss"])
def test_jitter_does_not_make_rates_higher(cause, n_samples, within):
    rng = np.random.default_rng(0)
    times = np.arange(n_samples) / 300
    stamps = {
        "clock": times + rng.uniform(-0.45, 0.45, n_samples) / 300,
        "delay": np.sort(times + rng.exponential(0.25, n_samples) / 300),
        "loop": np.cumsum(rng.uniform(0.7, 1.3, n_samples)) / 300,
        "rounding": times.round(3),
        "loss": times[rng.random(n_samples) > 0.1],
    }[cause]
    assert rate_of([pd.Series(0.0, stamps)]) == pytest.approx(300, rel=within)


def test_no_vibration_comes_out_as_a_slower_one():
    times = np.arange(4000) / 1000
    trial = np.sin(2 * np.pi * 95 * times)  # an alias of 5 Hz at 100 Hz
    resampled = resample_trials([trial], [times], 100)[0]
    assert np.abs(resampled[10:-10]).max() < 0.01
    assert np.abs(trial[::10][10:-10]).max() > 0.9


@pytest.mark.parametrize(
    "rate, new, frequency", [(150, 100, 70), (1600, 1000, 700), (250, 100, 120)]
)
def test_no_image_of_a_vibration_comes_out_as_a_slower_one(rate, new, frequency):
    times = np.arange(6 * rate) / rate
    trial = np.sin(2 * np.pi * frequency * times)
    resampled = resample_trials([trial], [times], new)[0]
    assert np.abs(resampled[50:-50]).max() < 0.01


def test_dropped_frames_are_not_invented():
    times = np.delete(np.arange(50) / 35, [10, 20, 21, 22])
    trial = waves(times)
    resampled = resample_trials([trial], [times], 35)[0]
    gone = np.flatnonzero(np.isnan(resampled).all(axis=1))
    assert gone.tolist() == [10, 20, 21, 22]
    repair = RepairTrials().fit([resampled, waves(np.arange(50) / 35)])
    found = repair.faults([resampled])[["channel", "fault", "n_samples"]]
    assert found.to_numpy().tolist() == [["all", "dropped frames", 4]]
    trusted = resample_trials([trial], [times], 35, longest_gap=0.06)[0]
    assert np.flatnonzero(np.isnan(trusted[:, 0])).tolist() == [20, 21, 22]


def test_masked_samples_of_one_channel():
    times = np.arange(20) / 10
    trial = np.ma.array(waves(times), mask=False)
    trial[5, 1] = trial[0, 0] = np.ma.masked
    resampled = resample_trials([trial], [times], 10)[0]
    assert np.argwhere(np.isnan(resampled)).tolist() == [[0, 0], [5, 1]]


def test_real_slides_are_resampled(shared_data):
    """Stamps in whole milliseconds, 28 or 29 apart."""
    arrays = np.load(shared_data / "fabric_slides" / "fabric_slides.npz")
    ends = np.cumsum(arrays["length"])[:20]
    trials = np.split(arrays["taxels"][: ends[-1]], ends[:-1])
    times = np.split(arrays["time_ms"][: ends[-1]] / 1000, ends[:-1])
    for trial, stamps, new in zip(trials, times, resample_trials(trials, times, 35)):
        assert np.isfinite(new).all()
        assert len(new) == np.floor((stamps[-1] - stamps[0]) * 35 + 1e-9) + 1
        at = stamps[0] + np.arange(len(new)) / 35
        line = np.interp(at, stamps, trial[:, 5])
        largest = abs(np.diff(trial[:, 5])).max()
        assert (abs(new[:, 5] - line) < largest / 3).all()


def test_one_sample_and_single_precision():
    one = resample_trials([np.ones((1, 2), np.float32)], [[3.0]], 10)[0]
    assert one.tolist() == [[1.0, 1.0]] and one.dtype == np.float32
    short = resample_trials([np.ones((12, 2))], [np.arange(12) / 1000], 50)[0]
    assert short.tolist() == [[1.0, 1.0]]  # shorter than a step of 20 ms


def test_stamps_in_a_series_go_with_trials_by_place():
    times = pd.Series([np.arange(4) / 10, np.array([0, 0.1, 0.5, 0.6])], index=[1, 0])
    trials = pd.Series([np.arange(4.0)] * 2, index=[1, 0])
    assert [len(trial) for trial in resample_trials(trials, times, 10)] == [4, 7]
