"""Every fault of real recordings: what is found, what is done, what is said."""

from itertools import groupby

import numpy as np
import pandas as pd
import polars as pl
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import interp1d
from scipy.special import logit
from sklearn.base import clone
from sklearn.linear_model import LinearRegression, LogisticRegression
from sklearn.pipeline import make_pipeline

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    RepairTrials,
    Signal,
    SignalStatistics,
    make_haptic_pipeline,
)
from sklearn_haptic.recordings._channel_regression import estimate_moments

MIXING = np.random.default_rng(0).normal(size=(2, 4))


def recordings(n_trials=20, seed=1):
    """Four channels that are mixtures of two, with noise; 30 samples or more."""
    rng = np.random.default_rng(seed)
    return [
        5 + rng.normal(size=(rng.integers(30, 40), 2)) @ MIXING for _ in range(n_trials)
    ]


def faults_of(repair, trials):
    table = repair.faults(trials)
    return list(table[["trial", "channel", "fault", "n_samples"]].itertuples(False))


def test_trials_without_faults_are_untouched():
    trials = recordings()
    repair = RepairTrials().fit(trials)
    assert repair.faults_.empty
    for before, after in zip(trials, repair.transform(trials), strict=True):
        assert_array_equal(before, after)
        assert not np.shares_memory(before, after)


@pytest.mark.parametrize("kind", ["NaN", "infinite", "masked"])
def test_missing_samples_are_interpolated(kind):
    trials = recordings()
    gone = np.zeros(trials[3].shape, dtype=bool)
    gone[[0, 1, 7, 8, 20], 2] = True
    gone[-1, 0] = True
    expected = trials[3].copy()
    for channel in (0, 2):  # one channel after the other, by a loop
        known = np.flatnonzero(~gone[:, channel])
        line = interp1d(
            known,
            trials[3][known, channel],
            bounds_error=False,
            fill_value=(trials[3][known[0], channel], trials[3][known[-1], channel]),
        )
        for time in np.flatnonzero(gone[:, channel]):
            expected[time, channel] = line(time)
    if kind == "masked":
        trials[3] = np.ma.array(trials[3], mask=gone)
    else:
        trials[3][gone] = np.nan if kind == "NaN" else -np.inf
    repair = RepairTrials()
    assert_allclose(repair.fit_transform(trials)[3], expected, rtol=1e-12)
    assert faults_of(repair, trials) == [
        (3, 0, "missing samples", 1),
        (3, 2, "missing samples", 5),
    ]


def test_dropped_frames_are_interpolated():
    trials = recordings()
    trials[5][10:12] = np.nan
    trials[5][20, 1] = np.nan
    repair = RepairTrials().fit(trials)
    assert faults_of(repair, trials) == [
        (5, "all", "dropped frames", 2),
        (5, 1, "missing samples", 1),
    ]
    repaired = repair.transform(trials)[5]
    step = (trials[5][12] - trials[5][9]) / 3
    assert_allclose(repaired[10:12], trials[5][9] + np.outer([1, 2], step))


def test_saturated_samples_stay_at_the_limit():
    trials = recordings()
    n_high, n_low = int((trials[0][:, 1] >= 6).sum()), int((trials[0][:, 1] <= 4).sum())
    repair = RepairTrials(limits=(4.0, 6.0)).fit(trials)
    assert (0, 1, "saturated", n_high + n_low) in faults_of(repair, trials)
    for before, after in zip(trials, repair.transform(trials)):
        assert_array_equal(np.minimum(np.maximum(before, 4.0), 6.0), after)
    assert set(repair.faults_["answer"]) == {"kept at the limit"}


def test_samples_beside_a_saturated_one_are_interpolated_to_the_limit():
    rng = np.random.default_rng(0)
    trial = np.array([100, np.nan, np.nan, np.nan, 65535, 200])
    trials = [trial, *rng.uniform(0, 4000, (12, 20))]
    repaired = RepairTrials(limits=(0, 4095)).fit_transform(trials)[0]
    assert_allclose(np.ravel(repaired)[:5], np.linspace(100, 4095, 5))


@pytest.mark.parametrize("channels", [[0], [0, 1, 2, 3]])
def test_a_trial_that_is_saturated_throughout_is_kept_at_the_limit(channels):
    trials = [trial[:, channels] for trial in recordings()]
    repair = RepairTrials(limits=(-9.0, 20.0)).fit(trials)
    pressed = np.full((40, len(channels)), 20.0)
    pressed[3] = np.nan
    assert_array_equal(repair.transform([pressed])[0], np.full_like(pressed, 20.0))
    assert {row[2] for row in faults_of(repair, [pressed])} <= {
        "saturated",
        "dropped frames",
        "missing samples",
    }
    pressed[:, 0] = 3.0  # at no limit
    found = faults_of(repair, [pressed])
    dead = (0, "all", "dead sensor", 40) if len(channels) == 1 else (0, 0, "dead", 40)
    assert [row for row in found if "dead" in row[2]] == [dead]


@pytest.mark.parametrize("factor", [1e-155, 1, 1e155, 1e300])
def test_dead_channels_are_those_of_linear_regression(factor):
    trials = [trial[:30] for trial in recordings()]
    rng = np.random.default_rng(0)
    trials = [trial + rng.normal(scale=0.3, size=trial.shape) for trial in trials]
    repair = RepairTrials().fit(trials)
    samples = np.concatenate(trials)
    touch = trials[4].copy()
    touch[:, [1, 3]] = 0.0, np.nan  # one stuck, one without any sample
    regression = LinearRegression().fit(samples[:, [0, 2]], samples[:, [1, 3]])
    expected = regression.predict(touch[:, [0, 2]])
    repair = RepairTrials().fit([trial * factor for trial in trials])
    touch *= factor
    repaired = repair.transform([touch])[0]
    assert_allclose(repaired[:, [1, 3]] / factor, expected, rtol=1e-9)
    assert_array_equal(repaired[:, [0, 2]], touch[:, [0, 2]])
    assert faults_of(repair, [touch]) == [(0, 1, "dead", 30), (0, 3, "dead", 30)]


@pytest.mark.parametrize("n_resting", [0, 10])
def test_lost_channels_do_not_tell_how_channels_go_together(n_resting):
    """Of a channel that is lost in some trials, and may rest in others."""
    rng = np.random.default_rng(0)
    trials = [3000 + trial @ rng.normal(size=(4, 4)) for trial in recordings()]
    for trial in trials[:n_resting]:
        trial[:, 3] = 3000.0
    lost = [13, 14, 15]
    for i in lost:
        trials[i][:, 3] = np.nan
    others = [trial for i, trial in enumerate(trials) if i not in lost]
    samples = np.concatenate(others)
    regression = LinearRegression().fit(samples[:, :3], samples[:, 3])
    repair = RepairTrials().fit(trials)
    assert faults_of(repair, trials) == [(i, 3, "dead", len(trials[i])) for i in lost]
    repaired = repair.transform([*trials, None])
    for i in lost:
        expected = regression.predict(trials[i][:, :3])
        assert_allclose(repaired[i][:, 3], expected, rtol=1e-9)
    alone = RepairTrials().fit(others)
    assert_array_equal(repaired[-1], alone.transform([None])[0])


def sums_and_differences(n_trials):
    """The first two channels are a sum and a difference of the three others."""
    rng = np.random.default_rng(0)
    mixing = np.column_stack([[1, 1, 1], [1, -1, 0], np.eye(3)])
    return [7 + rng.normal(size=(100, 3)) @ mixing for _ in range(n_trials)]


@pytest.mark.parametrize("n_intact", [0, 2, 100])
def test_channels_are_estimated_although_all_sessions_lack_one(n_intact):
    """The first in half of the trials, the second in the others."""
    whole = sums_and_differences(21)
    trials = [trial.copy() for trial in whole[:20]] + [whole[20][:n_intact]]
    for i, trial in enumerate(trials[:20]):
        trial[:, i // 10] = np.nan
    repaired = RepairTrials().fit_transform(trials[: 20 + (n_intact > 0)])
    for before, after in zip(whole[:20], repaired):
        assert_allclose(after, before, atol=1e-5)


def test_channels_are_those_of_least_squares_where_they_live():
    """Of two that never live together, each by the others, with noise."""
    rng = np.random.default_rng(1)
    trials = [t + 0.5 * rng.normal(size=t.shape) for t in sums_and_differences(20)]
    for i, trial in enumerate(trials):
        trial[:, i // 10] = np.nan
    repair = RepairTrials().fit(trials)
    repaired = repair.transform([*trials, None])
    for gone, lacking, having in (
        (0, slice(0, 10), slice(10, 20)),
        (1, slice(10, 20), slice(0, 10)),
    ):
        samples = np.concatenate(trials[having])
        regression = LinearRegression().fit(samples[:, 2:], samples[:, gone])
        touch = np.concatenate(trials[lacking])[:, 2:]
        estimated = np.concatenate(repaired[lacking])[:, gone]
        # Nothing tells how the two go together, apart from the others.
        assert_allclose(estimated, regression.predict(touch), atol=0.05)
    assert any(np.array_equal(repaired[-1], trial) for trial in repaired[:-1])


def test_three_sessions_lack_three_channels():
    """Two of them tell the third, but never in the session of the other one."""
    rng = np.random.default_rng(0)
    whole = []
    for _ in range(30):
        common = rng.normal(size=(100, 1))
        both = common + 0.3 * rng.normal(size=(100, 2))
        whole.append(np.column_stack([both.sum(axis=1), both, common]))
    trials = [trial.copy() for trial in whole]
    for i, trial in enumerate(trials):
        trial[:, i // 10] = np.nan
    mean, scale, correlation = estimate_moments(
        [np.nan_to_num(trial) for trial in trials], np.isnan(trials).all(axis=1)
    )
    covariance = correlation * np.outer(scale, scale)
    of_pairs = pd.DataFrame(np.concatenate(trials)).cov()  # of each pair where it lives
    assert_allclose(covariance, of_pairs, atol=0.15)
    assert np.linalg.eigvalsh(covariance).min() > -1e-9
    assert_allclose(mean, np.nanmean(np.concatenate(trials), 0), atol=0.1)
    repaired = RepairTrials().fit_transform(trials)
    for i, of_session in enumerate((slice(0, 10), slice(10, 20), slice(20, 30))):
        true = np.concatenate(whole[of_session])[:, i]
        found = np.concatenate(repaired[of_session])[:, i]
        assert np.polyfit(true, found, 1)[0] == pytest.approx(1, abs=0.15)


def test_moments_without_dead_channels_are_those_of_the_samples():
    trials = recordings()
    dead = np.zeros((len(trials), 4), dtype=bool)
    mean, scale, correlation = estimate_moments(trials, dead)
    covariance = correlation * np.outer(scale, scale)
    samples = np.concatenate(trials)
    assert_allclose(mean, samples.mean(axis=0), rtol=1e-12)
    assert_allclose(covariance, np.cov(samples.T, ddof=0), atol=1e-12)


@pytest.mark.parametrize("stuck", [0.0, np.nan])
def test_no_trial_is_whole(stuck):
    """A channel like no other has the mean of the trials in which it works."""
    trials = [3000 + np.random.default_rng(i).normal(size=(50, 12)) for i in range(12)]
    means = []
    for i, trial in enumerate(trials):
        means.append(np.mean([each[:, i] for each in trials if each is not trial]))
        trial[:, i] = stuck
    repair = RepairTrials().fit(trials)
    assert faults_of(repair, trials) == [(i, i, "dead", 50) for i in range(12)]
    for i, repaired in enumerate(repair.transform(trials)):
        assert repaired[:, i].mean() == pytest.approx(means[i], abs=0.2)
    typical = repair.transform([None])[0]
    assert np.abs(typical - 3000).max() < 6
    assert (repair.transform(trials) == typical).all(axis=(1, 2)).sum() == 1


def test_a_channel_without_any_sample_is_zero():
    trials = recordings()
    whole = RepairTrials().fit([trial[:, :3] for trial in trials])
    for trial in trials:
        trial[:, 3] = np.nan
    repair = RepairTrials().fit(trials)
    assert set(repair.faults_["fault"]) == {"dead"}
    for trial in [*repair.transform(trials), repair.transform([None])[0]]:
        assert (trial[:, 3] == 0).all()
    typical = [each.transform([None])[0][:, :3] for each in (repair, whole)]
    assert_array_equal(*typical)


def test_a_dead_channel_is_reported_once():
    trials = recordings()
    trials[2][:, 1] = 8.0  # stuck, with a gap
    trials[2][4, 1] = np.nan
    repair = RepairTrials(limits=(-9.0, 9.0), rest=5).fit(trials)
    found = repair.faults_.query("trial == 2")
    assert found[found["channel"] == 1]["fault"].tolist() == ["dead"]
    assert found[found["fault"] == "rest level"]["channel"].tolist() == [0, 2, 3]


@pytest.mark.parametrize("n_without", [0, 3, 20])
def test_touches_without_a_channel_do_not_hide_a_dead_one(n_without):
    rng = np.random.default_rng(0)
    signals = np.cumsum(rng.normal(size=(30, 200, 2)), axis=1)
    trials = [*np.concatenate([signals, signals @ [[1.0], [2.0]] + 4], axis=2)]
    true = trials[0][:, 2].copy()
    trials[0][:, 2] = 7
    for trial in trials[1 : 1 + n_without]:
        trial[:, 2] = np.nan
    repaired = RepairTrials().fit_transform(trials)
    assert_allclose(repaired[0][:, 2], true, atol=1e-6)


def test_a_channel_that_often_rests_is_not_dead():
    trials = recordings()
    for trial in trials[:3]:
        trial[:, 0] = 2.0
    repair = RepairTrials()
    for before, after in zip(trials, repair.fit_transform(trials)):
        assert_array_equal(before, after)
    assert repair.faults_.empty


def test_the_most_typical_trial_is_nearest_in_every_channel():
    ramp = np.arange(-4.0, 5)[:, None]
    levels = [[3, 102], [8, 101], [0, 101], [2, 101], [9, 102]]
    trials = [ramp + level for level in levels]
    far = np.abs(levels - np.median(levels, axis=0)) / np.std(levels, axis=0)
    assert far.sum(axis=1).argmin() == 3
    assert_array_equal(RepairTrials().fit(trials).transform([None])[0], trials[3])


@pytest.mark.parametrize("channels", [[0], [0, 1, 2, 3]])
def test_a_dead_sensor_has_the_most_typical_trial(channels):
    trials = [trial[:, channels] for trial in recordings()]
    repair = RepairTrials().fit([*trials, None])
    typical = repair.transform([None])[0]
    held = np.vstack([typical, np.tile(typical[-1], (90, 1))])
    for n_times in (7, 90):  # as long as the touch is
        dead = np.full((n_times, len(channels)), 3.0)
        with_gaps = dead.copy()
        with_gaps[2, 0] = np.nan
        for touch in (dead, with_gaps):
            assert_array_equal(repair.transform([touch])[0], held[:n_times])
            assert faults_of(repair, [touch]) == [(0, "all", "dead sensor", n_times)]
    assert faults_of(repair, [None]) == [(0, "all", "missing sensor", 0)]


@pytest.mark.parametrize("gone", ["slow", "fast"])
def test_a_missing_sensor_lasts_as_long_as_the_others(gone):
    """Of 100 and 2200 samples per second, in touches of other seconds than in fit."""

    def touches(lengths):
        data = np.random.default_rng(0).normal(size=(max(lengths) * 22, 1))
        X = {"slow": [data[:n] for n in lengths]}
        X["fast"] = [data[: 22 * n] for n in lengths]
        return pd.DataFrame(X, dtype=object)

    X = touches([50, 60, 70, 80])
    X.loc[1, "slow"], X.loc[2, "fast"] = None, None
    repair = RepairTrials().fit(X)
    typical = repair.transform(touches([1]).assign(**{gone: None}))[gone][0]
    assert len(typical) == len(touches([1])[gone][0])
    new = touches([7, 300]).assign(**{gone: None})
    for trial, whole in zip(repair.transform(new)[gone], touches([7, 300])[gone]):
        assert trial.shape == whole.shape


def test_a_short_touch_may_rest_as_long_as_others_do():
    """Of a slow channel of whole numbers, as a temperature has."""
    rng = np.random.default_rng(0)
    level = [np.round(rng.normal(size=(400, 2)).cumsum(0) / 20) for _ in range(40)]
    longest = [
        [max(len([*run]) for _, run in groupby(channel)) for channel in trial.T]
        for trial in level
    ]
    usual = np.sort(longest, axis=0)[35]  # that of nine trials of ten
    repair = RepairTrials().fit(level)
    for n_times in range(1, 400):
        found = faults_of(repair, [np.full((n_times, 2), 7.0)])
        dead = np.flatnonzero(n_times > usual)
        every = [(0, "all", "dead sensor", n_times)]
        one = [(0, i, "dead", n_times) for i in dead]
        assert found == (every if len(dead) == 2 else one)


def test_contact_is_not_taken_for_rest():
    """Where the samples at rest are lost, of one channel or all, or but for some."""
    rng = np.random.default_rng(0)
    shape = np.repeat([0, 800.0], [50, 150])[:, np.newaxis]
    force = [100 + shape + rng.normal(size=(200, 2)) for _ in range(8)]
    force[3][:50] = np.nan
    force[4][:50, 1] = np.nan
    force[5][10:60] = np.nan
    repair = RepairTrials(rest=50).fit(force)
    for trial in repair.transform(force):
        assert np.abs(trial - shape)[60:].max() < 6
    found = repair.faults_.set_index("trial").query("fault != 'rest level'")
    assert found["fault"].tolist() == ["dead sensor", "dead", "dropped frames"]


def test_trials_keep_their_time_stamps():
    """So that the next step refuses those that contradict its rate."""
    stamps = [pd.to_timedelta(np.arange(len(t)) / 50, unit="s") for t in recordings()]
    trials = [
        pd.DataFrame(trial, at, list("wxyz")) for trial, at in zip(recordings(), stamps)
    ]
    trials[2].iloc[4:6] = np.nan
    trials[3] = None
    repaired = RepairTrials().fit_transform(trials)
    assert isinstance(repaired.pop(3), np.ndarray)
    for trial, before in zip(repaired, [t for t in trials if t is not None]):
        pd.testing.assert_frame_equal(trial, before.interpolate(), check_freq=False)
    for rate in (50, 100):
        model = make_pipeline(RepairTrials(), SignalStatistics(rate=rate))
        if rate == 50:
            assert len(model.fit_transform(trials)) == len(trials)
        else:
            with pytest.raises(ValueError, match="sampled at 50 Hz by its index"):
                model.fit(trials)


def test_samples_are_interpolated_by_their_time_stamps():
    """Where samples are lost, the next one is not the next in time."""
    at = np.r_[np.arange(10), np.arange(20, 30)] / 100
    trial = pd.DataFrame({"x": at, "y": 1 - at}, at)
    trial.iloc[9, 0] = np.nan
    for index in (
        trial.index,
        pd.to_timedelta(at, unit="s"),
        pd.to_datetime(at, unit="s"),
        pd.Timestamp("2026-11-26T07:30:00.123456789", tz="UTC")
        + pd.to_timedelta(at, unit="s"),
    ):
        (repaired,) = RepairTrials().fit_transform([trial.set_axis(index)])
        assert_allclose(repaired.to_numpy(), np.column_stack((at, 1 - at)), atol=1e-15)


def test_a_touch_that_other_channels_feel_is_not_of_a_dead_sensor():
    """Of a skin whose taxels rest at a constant, most touches reach the first one."""
    rng = np.random.default_rng(0)
    trials = [np.zeros((20, 4)) for _ in range(20)]
    for i, trial in enumerate(trials):
        reached = [0, 1 + i % 3] if i else [1, 2]
        trial[:, reached] = rng.normal(size=(20, len(reached)))
    repair = RepairTrials().fit(trials)
    assert [row[:3] for row in faults_of(repair, trials)] == [(0, 0, "dead")]
    assert_array_equal(repair.transform(trials)[0][:, 1:], trials[0][:, 1:])
    at_rest = [np.zeros((20, 4))]
    assert [row[1:3] for row in faults_of(repair, at_rest)] == [("all", "dead sensor")]


@pytest.mark.parametrize("limit", [3.3, 4.7, 0.1])
def test_single_precision_is_saturated_at_the_limit_also_among_double(limit):
    trials = [np.random.default_rng(i).uniform(0, 0.09, (30, 1)) for i in range(5)]
    trials[2][4:7] = limit
    single = [trial.astype(np.float32) for trial in trials]
    for given in (trials, single, [*single[:4], trials[4]]):
        faults = RepairTrials(limits=(-limit, limit)).fit(given).faults_
        assert faults[["trial", "fault", "n_samples"]].to_numpy().tolist() == [
            [2, "saturated", 3]
        ]


def test_nullable_types_of_pandas():
    trials = recordings()
    trials[3][4:6, 1] = np.nan
    nullable = [pd.DataFrame(trial).convert_dtypes() for trial in trials]
    expected = RepairTrials().fit_transform(trials)
    for repaired, known in zip(RepairTrials().fit_transform(nullable), expected):
        assert_array_equal(repaired, known)
    with pytest.raises(ValueError, match="Trial 3 of X contains NaN or infinity"):
        SignalStatistics().fit(nullable)


def test_a_table_for_a_fit_to_one_sensor_is_refused():
    repair = RepairTrials().fit(recordings())
    table = pd.DataFrame({"skin": recordings()})
    with pytest.raises(ValueError, match="give the column that holds them"):
        repair.transform(table)


def test_a_sensor_of_which_one_channel_lives_is_not_dead():
    trials = recordings()
    touch = trials[4].copy()
    touch[:, :3] = 0.0
    repair = RepairTrials().fit(trials)
    assert [row[:3] for row in faults_of(repair, [touch])] == [
        (0, i, "dead") for i in range(3)
    ]
    assert_array_equal(repair.transform([touch])[0][:, 3], touch[:, 3])


@pytest.mark.parametrize("nothing", [None, np.nan, pd.NA, [], np.full((3, 4), np.nan)])
def test_a_missing_sensor_has_the_most_typical_trial(nothing):
    trials = recordings()
    levels = np.array([[*t.mean(axis=0), *t.std(axis=0)] for t in trials])
    distances = [  # by a loop over trials and levels
        sum(
            abs(row[j] - np.median(levels[:, j])) / np.std(levels[:, j])
            for j in range(levels.shape[1])
        )
        for row in levels
    ]
    typical = trials[int(np.argmin(distances))]
    repair = RepairTrials().fit([*trials, nothing])
    assert_array_equal(repair.transform([nothing])[0], typical)
    assert repair.faults_["fault"].tolist() == ["missing sensor"]
    assert repair.faults_["trial"].tolist() == [len(trials)]


def test_two_columns_of_one_name_are_refused():
    X = pd.DataFrame({"x": [np.ones((5, 1))] * 3, "y": [np.zeros((5, 1))] * 3})
    X.columns = ["x", "x"]
    with pytest.raises(ValueError, match="X has the column 'x' twice"):
        RepairTrials().fit(X)


def test_rest_level_is_subtracted():
    trials = recordings()
    drifted = [trial + i for i, trial in enumerate(trials)]
    repair = RepairTrials(rest=5).fit(drifted)
    for i, (trial, after) in enumerate(zip(trials, repair.transform(drifted))):
        offset = np.median(trial[:5], axis=0)
        assert_allclose(after, trial - offset, atol=1e-12)
        of_trial = repair.faults_[repair.faults_["trial"] == i]
        assert_allclose(of_trial["offset"], offset + i)
        assert set(of_trial["fault"]) == {"rest level"}


def test_several_sensors_in_a_data_frame():
    skin, force = recordings(seed=1), [t[:, :1] for t in recordings(seed=2)]
    trials = pd.DataFrame({"skin": skin, "force": force, "speed": np.arange(20.0)})
    trials.index = [f"touch{i}" for i in range(20)]
    trials.at["touch2", "force"] = None
    trials.at["touch3", "skin"] = np.where(
        np.arange(len(skin[3]))[:, None] == 4, np.nan, skin[3]
    )
    before = trials.copy()
    repair = RepairTrials(rest={"force": 3}, limits={"skin": (-99, 99)})
    repaired = repair.fit_transform(trials)
    pd.testing.assert_index_equal(repaired.index, trials.index)
    assert repaired["speed"].equals(trials["speed"])
    table = repair.faults_
    assert table[table["fault"] == "rest level"]["sensor"].unique() == ["force"]
    rest = table[table["fault"] != "rest level"]
    assert rest[["trial", "sensor", "fault"]].to_numpy().tolist() == [
        [3, "skin", "dropped frames"],
        [2, "force", "missing sensor"],
    ]
    alone = RepairTrials(rest=3).fit(list(trials["force"]))
    for one, other in zip(alone.transform(trials["force"]), repaired["force"]):
        n_times = min(len(one), len(other))  # of the missing one, as of the skin
        assert_array_equal(one[:n_times], other[:n_times])
    assert trials["force"]["touch2"] is None and trials["skin"] is not None
    assert trials["skin"]["touch3"] is before["skin"]["touch3"]
    # A sensor that is missing in all of the trials to predict.
    none = repair.transform(trials.iloc[:2].assign(force=None))["force"]
    assert len(none) == 2 and np.isfinite(np.concatenate([*none])).all()


def test_frames_of_polars_hold_no_trials():
    with pytest.raises(ValueError, match=r"^X is a frame of polars; give a"):
        RepairTrials().fit(pl.DataFrame({"skin": [[1.0, 2.0], [3.0]]}))


def test_images_and_single_precision():
    rng = np.random.default_rng(0)
    images = [rng.normal(size=(9, 2, 3)).astype(np.float32) for _ in range(12)]
    images[4][3, 1, 2] = np.nan
    repaired = RepairTrials().fit_transform(images)
    assert repaired[4].shape == (9, 2, 3) and repaired[4].dtype == np.float32
    assert_allclose(
        repaired[4][3, 1, 2], (images[4][2, 1, 2] + images[4][4, 1, 2]) / 2, rtol=1e-6
    )


@pytest.mark.parametrize("output", ["pandas", "polars"])
def test_set_output_leaves_trials_as_they_are(output):
    trials = recordings()
    trials[3][2, 1] = np.nan
    plain = RepairTrials().fit_transform(trials)
    index = [f"touch{i}" for i in range(20)]
    one_sensor = {
        list: trials,
        pd.Series: pd.Series(trials, index),
        pd.DataFrame: pd.DataFrame({"skin": trials}, index),
    }
    for kind, X in one_sensor.items():
        repair = RepairTrials().set_output(transform=output)
        for repaired in (repair.fit_transform(X), repair.transform(X)):
            assert type(repaired) is kind
            if hasattr(repaired, "index") and kind is not list:
                assert repaired.index.tolist() == index
            cells = repaired["skin"] if hasattr(X, "columns") else repaired
            for one, other in zip(cells, plain, strict=True):
                assert_array_equal(one, other)
    counts = np.random.default_rng(0).multinomial(9, [0.3, 0.3, 0.4], size=20)
    sensor = Signal(100, window=0.2)
    model = make_pipeline(RepairTrials(), make_haptic_pipeline(sensor, random_state=0))
    objects = {"hapticpipeline__model__groups": np.arange(20)}
    expected = model.fit(trials, counts, **objects).predict_proba(trials)
    model = clone(model).set_output(transform=output).fit(trials, counts, **objects)
    assert_allclose(model.predict_proba(trials), expected)


def test_rows_of_a_table_are_trials_of_one_channel():
    X = np.random.default_rng(0).normal(size=(12, 8))
    X[2, 3] = np.nan
    repaired = RepairTrials().set_output(transform="pandas").fit_transform(X)
    assert repaired.shape == (12, 8)
    assert repaired.iloc[2, 3] == pytest.approx((X[2, 2] + X[2, 4]) / 2)


def two_sensors(seed):
    """Touches of two kinds, which either sensor can tell."""
    rng = np.random.default_rng(seed)
    kinds = np.arange(36) % 2
    skin = [
        1 + kind + 0.1 * rng.normal(size=(60, 1)) + 0.3 * rng.normal(size=(60, 4))
        for kind in kinds
    ]
    force = [(1.0 + kind) * rng.normal(size=(60, 2)) for kind in kinds]
    for trial in [*skin, *force]:
        trial[:5] *= 0.01  # at rest
    return pd.DataFrame({"skin": skin, "force": force}), kinds


@pytest.fixture(scope="module")
def repairing():
    """A model of two sensors that repairs both."""
    sensors = {"skin": Signal(100), "force": Signal(100)}
    repair = RepairTrials(limits={"skin": (-9, 9)}, rest={"skin": 5})
    model = make_haptic_pipeline(sensors, random_state=0)
    model.set_params(model=DistributionalOrdinalRegressor(NNPOM(0, alpha=3.0)))
    for _, parts, _ in model["features"].transformers:
        codes = parts["codes"]  # of noise, maxima tell more than means and shares
        codes[0].set_params(max_iter=5)
        codes[1].set_params(statistics=("max",), root=False)
    model = make_pipeline(repair, *model.set_params(model=LogisticRegression()))
    return model.fit(*two_sensors(0))


def _without(trial, where):
    trial[where] = np.nan
    return trial


def _masked(trial):
    mask = np.zeros(trial.shape, dtype=bool)
    mask[20:30, 1] = True
    return np.ma.array(trial, mask=mask)


def _with(trial, where, value):
    trial[where] = value
    return trial


ON_REAL_HANDS = {
    "NaN": ("missing samples", lambda x: _without(x, (slice(20, 30), 1))),
    "infinite": ("missing samples", lambda x: _with(x, (slice(20, 22), 1), np.inf)),
    "masked": ("missing samples", _masked),
    "dropped frames": ("dropped frames", lambda x: _without(x, slice(20, 26))),
    "saturated": ("saturated", lambda x: _with(x, (slice(20, 22), 2), 9.0)),
    "dead channel": ("dead", lambda x: _with(x, (slice(None), 3), 0.7)),
    "dead sensor": ("dead sensor", lambda x: 0 * x + 2),
    "missing sensor": ("missing sensor", lambda x: None),
    "drift of the rest level": ("rest level", lambda x: x + 3.0),
}


@pytest.mark.parametrize("name", ON_REAL_HANDS)
def test_a_model_predicts_from_faulty_touches_and_names_the_fault(repairing, name):
    trials, kinds = two_sensors(1)
    fault, spoil = ON_REAL_HANDS[name]
    whole = repairing.predict_proba(trials)
    faulty = trials.assign(skin=[spoil(trial.copy()) for trial in trials["skin"]])
    proba = repairing.predict_proba(faulty)
    assert np.mean(whole.argmax(axis=1) == kinds) == 1
    if fault.endswith("sensor"):  # the other one is left
        log_odds = logit(proba[:, 1])
        assert log_odds[kinds == 1].min() > log_odds[kinds == 0].max() + 2
    else:
        assert np.mean(proba.argmax(axis=1) == kinds) >= 0.95
        assert np.abs(proba - whole).mean() < 0.15
    found = repairing[0].faults(faulty)
    named = found[(found["sensor"] == "skin") & (found["fault"] == fault)]
    assert set(named["trial"]) == set(range(len(trials)))
    if fault == "rest level":
        assert (named["offset"] > 2.5).all()


def test_an_array_of_trials_keeps_all_channels():
    """One of three dimensions is as the list of its trials; one of objects likewise."""
    X = np.random.default_rng(0).normal(size=(6, 5, 2))
    cells = np.empty((6, 1), dtype=object)
    cells[:, 0] = [*X]
    for trials in (X, [*X], cells[:, 0], cells):
        repaired = RepairTrials().fit(trials).transform(trials)
        for found, trial in zip(repaired, X, strict=True):
            assert_array_equal(found, trial)


@pytest.mark.parametrize("seed", range(20))
def test_channels_that_are_constant_equal_or_rounded_can_be_estimated(seed):
    """Finite, in single precision and at any scale, whichever channels are dead."""
    rng = np.random.default_rng(seed)
    trials = []
    for _ in range(12):
        trial = rng.normal(size=(rng.integers(2, 30), 6)) * 10.0 ** np.arange(-9, 9, 3)
        trial[:, 0], trial[:, 2] = 25.3, trial[:, 1]
        trial[:, 3] = trial[:, 3].round(1)
        trials.append(trial.astype([np.float32, np.float64][seed % 2]))
    for trial in trials:
        trial[:, rng.random(6) < 0.3] = np.nan
    trials.append(np.ones((3, 6)))
    repaired = RepairTrials().fit_transform(trials)
    assert all(np.isfinite(trial).all() for trial in repaired)


@pytest.mark.parametrize("form", ["array", "column"])
@pytest.mark.parametrize("n_more", [0, 1, 50])
def test_nan_that_fills_trials_up_to_one_length(form, n_more):
    cut = recordings()
    filled = np.full((20, max(map(len, cut)) + n_more, 4), np.nan)
    for row, trial in zip(filled, cut):
        row[: len(trial)] = trial
    X = filled if form == "array" else pd.DataFrame({"skin": list(filled)})
    name = "X" if form == "array" else r"X\['skin'\]"
    with pytest.raises(ValueError, match=f"^{name} has trials of one length, most of"):
        RepairTrials().fit(X)
    assert not len(RepairTrials().fit(cut).faults_)


@pytest.mark.parametrize(("n_trials", "n_missing"), [(3, 20), (18, 1)])
def test_samples_missing_at_the_end_are_repaired(n_trials, n_missing):
    X = np.array([trial[:30] for trial in recordings()])
    X[:n_trials, -n_missing:] = np.nan
    repair = RepairTrials().fit(X)
    assert faults_of(repair, X) == [
        (i, "all", "dropped frames", n_missing) for i in range(n_trials)
    ]
    held = repair.transform(X)[0][-n_missing:]
    assert_array_equal(held, np.tile(X[0, -n_missing - 1], (n_missing, 1)))
