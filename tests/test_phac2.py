import csv

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sklearn_haptic.datasets import load_phac2

h5py = pytest.importorskip("h5py")

SENSORS = ["pac", "pdc", "tac", "tdc", "electrodes"]
STATES = {
    "squeeze": b"SQUEEZE_SET_PRESSURE_SLOW",
    "hold": b"HOLD_FOR_10_SECONDS",
    "slow_slide": b"SLIDE_5CM",
    "fast_slide": b"MOVE_DOWN_5CM",
}
REST = b"MOVE_ARM_START_POSITION"
SEQUENCE = [REST] * 5 + [b"DISABLED"] * 3 + [STATES["hold"]] * 4 + [b"DISABLED"]


def write_trial(file, name, states=SEQUENCE, seed=0):
    rng = np.random.default_rng(seed)
    n = len(states)
    group = file.create_group(name)
    group["state/controller_detail_state"] = np.array(states, dtype="S30")
    for finger in (0, 1):
        for sensor, width in [("pac", 22), ("electrodes", 19)]:
            values = rng.integers(0, 4096, (n, width))
            group[f"biotacs/finger_{finger}/{sensor}"] = values
        for sensor in ("pdc", "tac", "tdc"):
            group[f"biotacs/finger_{finger}/{sensor}"] = rng.integers(0, 4096, n)
    return group


@pytest.fixture
def path(tmp_path):
    """Three trials of two objects, and the file's hard links to them."""
    path = tmp_path / "corpus.h5"
    with h5py.File(path, "w") as file:
        for seed, name in enumerate(["sponge_114_02", "cup__602_01", "sponge_114_10"]):
            write_trial(file, name, seed=seed)
        file["adjectives/soft/sponge_114_02"] = file["sponge_114_02"]
        file["train_test_sets/soft/train/cup__602_01"] = file["cup__602_01"]
        file.create_group("validation_sets")
    return path


def edit(path, change):
    with h5py.File(path, "r+") as file:
        change(file)


def replace(file, name, **kwargs):
    del file[name]
    return file.create_dataset(name, **kwargs)


def assert_all_closed():
    assert h5py.h5f.get_obj_count(h5py.h5f.OBJ_ALL, h5py.h5f.OBJ_FILE) == 0


# What is loaded


def test_objects_may_be_named_like_other_groups(path):
    edit(path, lambda file: write_trial(file, "validation_block_31_1", seed=9))
    assert "validation_block_31_1" in load_phac2(path).trials.index


def test_layout_of_the_bunch(path):
    corpus = load_phac2(path)
    assert list(corpus.trials.index) == [
        "sponge_114_02",
        "sponge_114_10",
        "cup__602_01",
    ]
    assert list(corpus.trials.columns) == SENSORS
    assert_array_equal(corpus.objects, [114, 114, 602])
    assert corpus.objects.dtype.kind == "i"
    assert list(corpus.object_names) == ["sponge", "sponge", "cup"]
    assert corpus.ratings == {}
    assert corpus.rater_ratings is None
    assert_array_equal(corpus.levels, [1, 2, 3, 4, 5])
    assert corpus.sampling_rates == dict(zip(SENSORS, [2200, 100, 100, 100, 100]))
    for text in ("10.17617/3.0C79KW", "CC BY-SA 4.0", "pilot recordings"):
        assert text in corpus.DESCR
    shapes = {s: corpus.trials.loc["cup__602_01", s].shape for s in SENSORS}
    assert shapes == {
        "pac": (88, 2),
        "pdc": (4, 2),
        "tac": (4, 2),
        "tdc": (4, 2),
        "electrodes": (4, 38),
    }
    assert_all_closed()


def test_values_and_dtype(path):
    corpus = load_phac2(path, remove_baseline=False)
    with h5py.File(path) as file:
        for name in corpus.trials.index:
            fingers = [file[name][f"biotacs/finger_{i}"] for i in (0, 1)]
            for sensor in SENSORS:
                cell = corpus.trials.loc[name, sensor]
                assert cell.dtype == np.float32
                raw = [finger[sensor][8:12] for finger in fingers]
                if sensor == "electrodes":
                    assert_array_equal(cell, np.concatenate(raw, axis=1))
                else:
                    for finger in (0, 1):
                        assert_array_equal(cell[:, finger], raw[finger].ravel())


@pytest.mark.parametrize("there", [0, 1])
def test_one_finger(path, there):
    both = load_phac2(path)

    def change(file):
        for name in both.trials.index:
            del file[f"{name}/biotacs/finger_{1 - there}"]

    edit(path, change)
    one = load_phac2(path)
    for sensor in SENSORS:
        for cell, expected in zip(one.trials[sensor], both.trials[sensor]):
            width = 19 if sensor == "electrodes" else 1
            assert_array_equal(cell, np.split(expected, 2, axis=1)[there])
            assert cell.shape == (len(expected), width)


@pytest.mark.parametrize("name", ["sponge_114_02", "cup__602_01"])
def test_fingers_of_one_trial_missing(path, name):
    edit(path, lambda file: file.pop(f"{name}/biotacs/finger_1"))
    with pytest.raises(ValueError, match=r"Trial '.*corpus\.h5 has finger_0.*trials="):
        load_phac2(path)
    assert len(load_phac2(path, trials=[name]).trials) == 1
    edit(path, lambda file: file.pop(f"{name}/biotacs/finger_0"))
    with pytest.raises(ValueError, match=f"/{name}/biotacs of .* has no 'finger_0'"):
        load_phac2(path, trials=[name])


def test_baseline_is_the_mean_at_rest(path):
    corpus = load_phac2(path)
    with h5py.File(path) as file:
        for name in corpus.trials.index:
            for finger in (0, 1):
                group = file[name][f"biotacs/finger_{finger}"]
                for sensor in ("pac", "tdc"):
                    values = group[sensor][()]
                    assert_allclose(
                        corpus.trials.loc[name, sensor][:, finger],
                        values[8:12].ravel() - values[:5].mean(),
                        rtol=1e-6,
                        atol=1e-4,
                    )
                values = group["electrodes"][()]
                assert_allclose(
                    corpus.trials.loc[name, "electrodes"][:, 19 * finger :][:, :19],
                    values[8:12] - values[:5].mean(axis=0),
                    rtol=1e-6,
                    atol=1e-4,
                )


def test_baseline_without_rest_state_is_rows_100_to_109(tmp_path):
    path = tmp_path / "corpus.h5"
    with h5py.File(path, "w") as file:
        long = [b"DISABLED"] * 115 + [STATES["hold"]] * 3
        tdc = write_trial(file, "a_101_01", long)["biotacs/finger_1/tdc"][()]
        write_trial(file, "b_102_01", [b"DISABLED"] * 99 + [STATES["hold"]] * 3)
    corpus = load_phac2(path, sensors=["tdc"], trials=["a_101_01"])
    assert_allclose(
        corpus.trials.iloc[0, 0][:, 1], tdc[115:] - tdc[100:110].mean(), rtol=1e-6
    )
    with pytest.raises(ValueError, match=r"'b_102_01'.*corpus\.h5.*only 102 rows"):
        load_phac2(path)
    assert len(load_phac2(path, remove_baseline=False).trials) == 2


def test_recurring_states_are_joined(tmp_path):
    path = tmp_path / "corpus.h5"
    hold = STATES["hold"]
    states = [hold, REST, REST, hold, b"DISABLED", hold, REST]
    with h5py.File(path, "w") as file:
        tac = write_trial(file, "a_101_01", states)["biotacs/finger_0/tac"][()]
    cell = load_phac2(path, sensors=["tac"]).trials.iloc[0, 0]
    assert_allclose(cell[:, 0], tac[[0, 3, 5]] - tac[[1, 2, 6]].mean(), rtol=1e-6)


def test_order_is_by_id_then_run_or_as_asked(path):
    edit(path, lambda file: write_trial(file, "z_99_01"))
    edit(path, lambda file: write_trial(file, "sponge_114_9"))
    names = ["z_99_01", "sponge_114_02", "sponge_114_9", "sponge_114_10", "cup__602_01"]
    assert list(load_phac2(path, sensors=["pdc"]).trials.index) == names
    asked = load_phac2(path, sensors=["tdc", "pdc"], trials=names[::-2])
    assert list(asked.trials.index) == names[::-2]
    assert list(asked.trials.columns) == ["tdc", "pdc"]
    assert asked.sampling_rates == {"tdc": 100, "pdc": 100}


def test_only_what_is_asked_for_is_read(path):
    """Other sensors and trials may be missing, of no use, or point elsewhere."""

    def spoil(file):
        del file["sponge_114_02/biotacs/finger_0/electrodes"]
        del file["sponge_114_02/biotacs/finger_1/pac"]
        replace(file, "sponge_114_02/biotacs/finger_1/tac", data=["text"])
        del file["sponge_114_10/state"]
        file["cup__602_01/biotacs/finger_0/gone"] = h5py.SoftLink("/nowhere")
        file["adjectives/other"] = h5py.ExternalLink("other.h5", "/")

    whole = load_phac2(path, sensors=["pdc"]).trials.loc["sponge_114_02", "pdc"]
    edit(path, spoil)
    corpus = load_phac2(path, sensors=["pdc"], trials=["sponge_114_02", "cup__602_01"])
    assert_array_equal(corpus.trials.iloc[0, 0], whole)


# Names of trials and objects


@pytest.mark.parametrize("name", ["spo\nnge_7_1", "ß_٣_1"])
def test_names_of_any_characters(tmp_path, name):
    path = tmp_path / "cor\rpus.h5"
    with h5py.File(path, "w") as file:
        write_trial(file, name)
    for trials in (None, [name]):
        corpus = load_phac2(path, trials=trials, sensors=["pdc"])
        assert list(corpus.trials.index) == [name]
        assert list(corpus.object_names) == [name.split("_")[0]]
        assert list(corpus.objects) == [int(name.split("_")[1])]


def test_two_objects_of_one_id(path):
    edit(path, lambda file: write_trial(file, "cork_114_03"))
    with pytest.raises(ValueError, match=r"two objects of id 114, '.*' and '.*'; give"):
        load_phac2(path)


# Real recordings


@pytest.fixture(scope="session")
def bolt_pilot(shared_data):
    return shared_data / "bolt_pilot"


@pytest.mark.slow
@pytest.mark.parametrize("procedure", list(STATES))
def test_real_recordings(bolt_pilot, procedure):
    path = bolt_pilot / "bolt_pilot_phac2_layout.h5"
    corpus = load_phac2(path, procedure=procedure)
    raw = load_phac2(path, procedure=procedure, remove_baseline=False)
    assert corpus.trials.shape == (74, 5)
    names, sizes = np.unique(corpus.objects, return_counts=True)
    assert dict(zip(names, sizes)) == {901: 15, 902: 15, 903: 14, 904: 15, 905: 15}
    with h5py.File(path) as file:
        for name in corpus.trials.index[::6]:
            states = file[name]["state/controller_detail_state"][()]
            rows, rest = states == STATES[procedure], states == REST
            for finger in (0, 1):
                group = file[name][f"biotacs/finger_{finger}"]
                for sensor in SENSORS:
                    n_channels = 19 if sensor == "electrodes" else 1
                    channels = slice(n_channels * finger, n_channels * (finger + 1))
                    values = group[sensor][()]
                    expected = values[rows].reshape(-1, n_channels)
                    cell = raw.trials.loc[name, sensor][:, channels]
                    assert_array_equal(cell, expected)
                    level = values[rest].reshape(-1, n_channels).mean(axis=0)
                    assert_allclose(
                        corpus.trials.loc[name, sensor][:, channels],
                        expected - level,
                        rtol=1e-6,
                        atol=1e-4,
                    )


@pytest.mark.slow
def test_real_recordings_of_several_procedures(bolt_pilot):
    path = bolt_pilot / "bolt_pilot_phac2_layout.h5"
    both = load_phac2(path, procedure=["squeeze", "hold"], sensors=["tdc"])
    assert list(both.trials.columns) == ["squeeze_tdc", "hold_tdc"]
    assert both.sampling_rates == {"squeeze_tdc": 100, "hold_tdc": 100}
    for procedure in ("squeeze", "hold"):
        one = load_phac2(path, procedure=procedure, sensors=["tdc"])
        pairs = zip(both.trials[f"{procedure}_tdc"], one.trials["tdc"])
        assert all(np.array_equal(a, b) for a, b in pairs)


@pytest.mark.slow
@pytest.mark.parametrize(
    "procedure, start, stop",
    [
        ("hold", "hold_on", "slow_on"),
        ("slow_slide", "slow_on", "fast_on"),
        ("fast_slide", "fast_on", "grip_off"),
        ("squeeze", "sq_on", "sq_off"),
    ],
)
def test_real_durations(bolt_pilot, procedure, start, stop):
    """As many frames as the table of segments that came with the recordings."""
    with open(bolt_pilot / "segments.csv", newline="") as file:
        segments = [
            (row["object"], int(row["run"]), int(row[stop]) - int(row[start]))
            for row in csv.DictReader(file)
        ]
    corpus = load_phac2(
        bolt_pilot / "bolt_pilot_phac2_layout.h5", procedure=procedure, sensors=["pdc"]
    )
    found = [
        (object_name, int(name[-2:]), len(cell))
        for object_name, name, cell in zip(
            corpus.object_names, corpus.trials.index, corpus.trials["pdc"]
        )
    ]
    assert sorted(found) == sorted(segments)
