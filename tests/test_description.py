"""`describe_corpus` against RepairTrials and plain loops, and how it is shown."""

import pickle
import re

import numpy as np
import pandas as pd
import pytest

from sklearn_haptic import RepairTrials
from sklearn_haptic.datasets import describe_corpus, make_haptic_corpus
from sklearn_haptic.ratings import interrater_agreement

LIMITS = {"skin": (-2.0, 2.0)}


@pytest.fixture
def faulty():
    """Forty trials of two sensors with every fault, as a DataFrame."""
    rng = np.random.default_rng(0)
    lengths = rng.integers(2, 30, 40)
    lengths[30] = 1
    skin = [rng.normal(size=(n, 3)).astype(np.float32) for n in lengths]
    force = [rng.normal(size=4 * n) for n in lengths]
    for i in (3, 8, 9):
        skin[i][rng.random(skin[i].shape) < 0.4] = np.nan
    skin[5][:, 1] = np.inf
    for i in (12, 13):
        skin[i][:, 2] = 1.0
    skin[25][:] = 0.5
    skin[25][0] = LIMITS["skin"][1], LIMITS["skin"][0], 1.0
    force[7] = force[8] = force[9] = None
    skin[20] = np.full((4, 3), np.nan)
    skin[21] = np.ma.masked_array(skin[21], skin[21] > 0)
    skin[22] = skin[22].tolist()
    return pd.DataFrame(
        {"skin": pd.Series(skin, dtype=object), "force": pd.Series(force, dtype=object)}
    )


def test_faults_are_those_that_repair_trials_finds(faulty):
    sensors = describe_corpus(faulty, limits=LIMITS).sensors
    faults = RepairTrials(limits=LIMITS).fit(faulty).faults_
    for name in faulty:
        row = sensors.loc[name]
        of_sensor = faults[faults["sensor"] == name].groupby("fault")
        n_faults, n_samples = of_sensor.size(), of_sensor["n_samples"].sum()
        frames = n_samples.get("dropped frames", 0) * row["n_channels"]
        missing = n_samples.get("missing samples", 0) + frames
        for _, fault in faults.query("sensor == @name and fault == 'dead'").iterrows():
            cell = np.ma.filled(faulty[name][fault["trial"]], np.nan)
            gone = ~np.isfinite(cell)  # of it RepairTrials says no more than "dead"
            missing += (gone[:, fault["channel"]] & ~gone.all(axis=1)).sum()
        assert row["n_missing_samples"] == missing
        assert row["dead"] == n_faults.get("dead", 0)
        assert row["n_missing_trials"] == n_faults.get("missing sensor", 0)
        assert row["n_trials"] + row["n_missing_trials"] == len(faulty)
    assert (
        sensors.loc["skin", "saturated"]
        == ((faults["sensor"] == "skin") & (faults["fault"] == "saturated")).sum()
    )
    assert np.isnan(sensors.loc["force", "saturated"])
    assert (sensors[["n_missing_samples", "dead"]].loc["skin"] > 0).all()


def test_lengths_and_constant_channels(faulty):
    for cell in faulty["skin"]:
        np.ma.asarray(cell)[..., 0] = 3.0  # of the list only a copy
    faulty.at[22, "skin"] = None
    rates = {"skin": 100}
    sensors = describe_corpus(faulty, sampling_rates=rates).sensors
    for name, column in faulty.items():
        lengths = [
            len(cell)
            for cell in column
            if cell is not None and np.isfinite(np.ma.filled(cell, np.nan)).any()
        ]
        expected = [min(lengths), np.median(lengths), max(lengths)]
        row = sensors.loc[name]
        assert row[["shortest", "median", "longest"]].tolist() == expected
        assert row["n_samples"] == sum(lengths) * row["n_channels"]
    assert sensors["constant"].tolist() == [1, 0]
    assert sensors["rate"].tolist() == [100, pytest.approx(np.nan, nan_ok=True)]


def test_all_forms_of_trials_are_described_alike():
    trials = np.random.default_rng(0).normal(size=(6, 20, 2))
    expected = describe_corpus(trials, sampling_rates=50).sensors
    assert expected.loc["", "n_samples"] == trials.size
    for same in (list(trials), pd.Series(list(trials)), {"trials": trials}):
        found = describe_corpus(same, sampling_rates=50).sensors
        pd.testing.assert_frame_equal(found, expected)
    frame = pd.DataFrame({"acc": pd.Series(list(trials), dtype=object), "run": 1})
    found = describe_corpus(frame, sampling_rates={"acc": 50}).sensors
    assert found.index.tolist() == ["acc"]
    pd.testing.assert_frame_equal(found.set_axis(expected.index), expected)
    images = describe_corpus(trials.reshape(6, 5, 4, 2)).sensors
    assert images.loc["", ["n_channels", "median"]].tolist() == [8, 5]
    alone = describe_corpus({"trials": trials[:1], "ratings": {}})
    assert (alone.objects, alone.ratings, alone.rated) == (None, None, None)
    gone = describe_corpus(frame.assign(skin=[[]] * 6))
    assert re.search(r"^skin +– +0 +6 +0 +– +– +– +0 +0 +– +0 +0$", repr(gone), re.M)


@pytest.mark.parametrize("levels", [None, ["low", "mid", "high"], [-1, 0, 5]])
def test_ratings_against_loops(levels):
    rng = np.random.default_rng(1)
    objects = np.array(["b", "a", "b", "c", "c", "d"])
    of_object = {name: rng.multinomial(7, [0.2, 0.3, 0.5]) for name in "abcd"}
    of_object["c"] = np.array([0, 0, 1])  # one person: no agreement
    of_object["d"] = np.zeros(3, dtype=int)  # nobody
    counts = np.array([of_object[name] for name in objects])
    found = describe_corpus(
        np.zeros((6, 5, 1)), objects=objects, ratings={"hard": counts}, levels=levels
    )
    agreement = interrater_agreement([of_object["a"], of_object["b"]])
    expected = [3, 1, 7, agreement.mean(), agreement.min()]
    np.testing.assert_allclose(found.ratings.loc["hard"].to_numpy(float), expected)
    shares = np.mean([of_object[name] / of_object[name].sum() for name in "abc"], 0)
    np.testing.assert_allclose(found.shares.loc["hard"], shares)
    assert found.shares.columns.tolist() == (levels or [1, 2, 3])
    assert found.rated == "object"
    assert found.objects["trials"].to_dict() == {"a": 1, "b": 2, "c": 2, "d": 1}


def test_ratings_of_trials_and_of_several_scales():
    labels = [1, 3, 3, np.nan, 2, 1]
    counts = np.tile([[2, 0], [1, 1]], (3, 1))
    found = describe_corpus(
        np.zeros((6, 5)),
        objects=[0, 0, 1, 1, 2, 2],
        ratings={"cold": labels, "nice": counts},
    )
    assert found.rated == "trial"
    assert found.ratings["n_rated"].tolist() == [5, 6]
    assert np.isnan(found.ratings.loc["cold", "agreement"])
    np.testing.assert_allclose(found.shares.loc["cold", [1, 2, 3]], [0.4, 0.2, 0.4])
    assert found.shares.loc["nice"].tolist()[:2] == [0.75, 0.25]
    assert np.isnan(found.shares.loc["nice", 3])


def test_levels_of_several_scales_ascend():
    ratings = {"cold": [1, 3.0], "warm": [2, 5]}
    found = describe_corpus(np.zeros((2, 4)), ratings=ratings)
    assert found.shares.columns.tolist() == [1, 2, 3, 5]
    np.testing.assert_array_equal(found.shares.loc["warm"], [np.nan, 0.5, np.nan, 0.5])
    words = {"cold": pd.Categorical(["no", "yes"], ["no", "yes"], ordered=True)}
    words["odd"] = pd.Categorical(["so", "ah"], ["so", "ah"], ordered=True)
    found = describe_corpus(np.zeros((2, 4)), ratings=words)
    assert found.shares.columns.tolist() == ["no", "yes", "so", "ah"]


def test_names_of_objects_belong_to_trials():
    corpus = make_haptic_corpus(3, 2, sensors=["tdc"], random_state=0)
    some = {**corpus, "trials": corpus.trials[2:], "objects": corpus.objects[2:]}
    with pytest.raises(ValueError, match="inconsistent numbers of samples"):
        describe_corpus({**some, "ratings": {}})


def test_what_is_shown(faulty):
    """Every table in both forms, as text of a user's own names."""
    evil = "<b>'&'"
    found = describe_corpus(
        faulty.rename(columns={"skin": evil}),
        objects=[evil] * 15 + ["b"] * 25,
        ratings={"nice": np.tile([3, 4], (40, 1))},
        levels=["lo", evil],
    )
    html = found._repr_html_()
    assert evil in repr(found) and evil not in html
    missing = f"{found.sensors['n_missing_samples'].iloc[0]:,}"
    for text in ("Recordings", missing, "2 objects", "0.571", "Agreement"):
        assert text in html and text in repr(found)
    shown = repr(describe_corpus(faulty, objects=[*range(39), 5]))
    assert "39 objects, of which at most 12 with the fewest trials" in shown


def test_a_description_can_be_saved(faulty):
    found = describe_corpus(faulty)
    assert repr(pickle.loads(pickle.dumps(found))) == repr(found)
    assert found._repr_html_() == pickle.loads(pickle.dumps(found))._repr_html_()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"objects": [1]}, "inconsistent numbers of samples"),
        ({"ratings": [[1, 2]]}, "inconsistent numbers of samples"),
        ({"ratings": {"hard": [[0, 1], [2]]}}, "ratings['hard'] is no array of one"),
        ({"ratings": [1, 2], "levels": [1, 3]}, "ratings['ratings'] has the rating 2"),
        ({"limits": ("low", "high")}, "limits=('low', 'high') must be the lowest"),
        ({"sampling_rates": {"acc": 9}}, "sampling_rates names the sensor 'acc'"),
        ({"sampling_rates": 0}, "sampling_rates has 0; give a number above"),
        ({"sampling_rates": {"": "fast"}}, "sampling_rates has 'fast'; give a num"),
        ({"ratings": np.ones((2, 3, 4))}, "ratings['ratings'] has shape (2, 3, 4);"),
        # Trials without a rating count when trials are numbered.
        ({"ratings": [[0, 0], [-1, 2]]}, "a negative count in trial 1"),
        ({"ratings": [None, 9], "levels": [1, 2]}, "the rating 9 in trial 1"),
    ],
)
def test_bad_options(options, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        describe_corpus(np.zeros((2, 4, 1)), **options)


@pytest.mark.parametrize("of", ["objects", "ratings"])
def test_rows_in_another_order_are_refused(of):
    trials = pd.DataFrame({"acc": [np.zeros((4, 1))] * 2}, index=["a", "b"])
    with pytest.raises(ValueError, match="the row labels of trials in another order"):
        describe_corpus(trials, **{of: pd.Series([1, 2], ["b", "a"])})


def test_time_stamps_tell_the_rate():
    trials = [pd.DataFrame({"x": np.arange(30.0)}, np.arange(30) / 200)] * 2
    rate = describe_corpus(trials).sensors["rate"]
    assert rate.tolist() == [pytest.approx(200)]
    with pytest.raises(ValueError, match="at 200 Hz by its index, but 1000 Hz"):
        describe_corpus(trials, sampling_rates=1000)
