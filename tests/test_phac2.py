import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from sklearn.utils._param_validation import InvalidParameterError

from sklearn_haptic import make_haptic_pipeline
from sklearn_haptic._validation import check_names
from sklearn_haptic.datasets import MatlabRatings, load_phac2
from sklearn_haptic.datasets._hdf5 import _unreadable
from sklearn_haptic.datasets._rated import ADJECTIVES

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


def test_layout_of_the_bunch(path):
    corpus = load_phac2(path)
    assert list(corpus.trials.index) == [
        "sponge_114_02",
        "sponge_114_10",
        "cup__602_01",
    ]
    assert list(corpus.trials.columns) == SENSORS
    np.testing.assert_array_equal(corpus.objects, [114, 114, 602])
    assert corpus.objects.dtype.kind == "i"
    assert list(corpus.object_names) == ["sponge", "sponge", "cup"]
    assert corpus.ratings == {}
    assert corpus.rater_ratings is None
    np.testing.assert_array_equal(corpus.levels, [1, 2, 3, 4, 5])
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
                    np.testing.assert_array_equal(cell, np.concatenate(raw, axis=1))
                else:
                    for finger in (0, 1):
                        np.testing.assert_array_equal(
                            cell[:, finger], raw[finger].ravel()
                        )


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
            np.testing.assert_array_equal(cell, np.split(expected, 2, axis=1)[there])
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
                    np.testing.assert_allclose(
                        corpus.trials.loc[name, sensor][:, finger],
                        values[8:12].ravel() - values[:5].mean(),
                        rtol=1e-6,
                        atol=1e-4,
                    )
                values = group["electrodes"][()]
                np.testing.assert_allclose(
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
    np.testing.assert_allclose(
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
    np.testing.assert_allclose(
        cell[:, 0], tac[[0, 3, 5]] - tac[[1, 2, 6]].mean(), rtol=1e-6
    )


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
    np.testing.assert_array_equal(corpus.trials.iloc[0, 0], whole)


def test_ratings_follow_the_objects(path, tmp_path):
    ratings = np.random.default_rng(0).integers(1, 6, (2, 10, 12))
    savemat(tmp_path / "r.mat", {"ratings": ratings, "ids": [602, 114]})
    names = ["cup__602_01", "sponge_114_10", "sponge_114_02"]
    file = MatlabRatings(tmp_path / "r.mat", adjectives=ADJECTIVES)
    corpus = load_phac2(path, sensors=["pdc"], trials=names, ratings=file)
    assert corpus.ratings["rough"].shape == (3, 5)
    expected = [np.bincount(row, minlength=6)[1:] for row in ratings[:, 2]]
    np.testing.assert_array_equal(
        corpus.ratings["rough"], np.take(expected, [0, 1, 1], 0)
    )
    people = corpus.rater_ratings
    np.testing.assert_array_equal(people.loc[114, "rough"], ratings[1, 2])
    np.testing.assert_array_equal(people.loc[602, "rough"], ratings[0, 2])


# What is refused


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no file .*nothing\.h5"):
        load_phac2(tmp_path / "nothing.h5")
    with pytest.raises(IsADirectoryError, match=tmp_path.name):
        load_phac2(tmp_path)


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs /proc")
def test_errors_of_the_disk_name_the_file(path):
    """Memory at address 0 cannot be read, like a sector that is damaged."""
    with pytest.raises(OSError, match=r"Input/output error: '/proc/self/mem'"):
        load_phac2("/proc/self/mem")
    with pytest.raises(OSError, match=r"Input/output error: '/proc/self/mem'"):
        load_phac2(path, ratings="/proc/self/mem")


def test_errors_of_the_disk_are_not_taken_for_damage():
    error = _unreadable("/tac of x.h5", OSError(5, "Can't read data"))
    assert error.errno == 5
    assert str(error) == "[Errno 5] /tac of x.h5 cannot be read: Can't read data"


WRITE = """
import sys
import h5py

with h5py.File(sys.argv[1], "r+", libver=sys.argv[2]) as file:
    if sys.argv[2] == "v110":
        file.swmr_mode = True
    print("open", flush=True)
    sys.stdin.read()
"""


@pytest.mark.slow
@pytest.mark.parametrize("libver", ["earliest", "v110"])
def test_file_that_another_process_writes(tmp_path, libver):
    path = tmp_path / "corpus.h5"
    with h5py.File(path, "w", libver=libver) as file:
        write_trial(file, "sponge_114_02")
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITE, path, libver],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    with writer:
        assert writer.stdout.readline() == b"open\n"
        with pytest.raises(
            OSError, match=r"corpus\.h5 cannot be read: another process has .*; wait"
        ):
            load_phac2(path)
        writer.stdin.close()
        writer.wait()
    assert len(load_phac2(path, sensors=["pdc"]).trials) == 1


@pytest.mark.parametrize("content", [b"", b"\x89HDF", b"PK\x03\x04" * 300])
def test_not_hdf5(tmp_path, content):
    path = tmp_path / "corpus.h5"
    path.write_bytes(content)
    with pytest.raises(OSError, match=r"corpus\.h5 is not an HDF5 file"):
        load_phac2(path)


@pytest.mark.parametrize("kept", [8, 9, 95, 96, 97, 1000, 10_000, 0.5, 0.9, -1])
def test_real_file_cut_short(shared_data, tmp_path, kept):
    content = (shared_data / "bolt_pilot/bolt_pilot_phac2_layout.h5").read_bytes()
    path = tmp_path / "cut.h5"
    path.write_bytes(content[: int(kept * len(content)) if 0 < kept < 1 else kept])
    with pytest.raises(OSError, match=r"cut\.h5 cannot be read: .*cut short"):
        load_phac2(path, sensors=["pdc"])
    assert_all_closed()


def test_damaged_values(path):
    name = "sponge_114_02/biotacs/finger_1/tac"

    def compress(file):
        replace(file, name, data=np.arange(13), chunks=(13,), compression="gzip")

    edit(path, compress)
    with h5py.File(path) as file:
        chunk = file[name].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset : chunk.byte_offset + chunk.size] = bytes(chunk.size)
    path.write_bytes(content)
    with pytest.raises(OSError, match=rf"/{name} of .*corpus\.h5 .*damaged"):
        load_phac2(path)
    assert_all_closed()
    assert len(load_phac2(path, sensors=["pdc", "tdc"]).trials) == 3


@pytest.mark.slow
def test_any_damaged_byte_gives_a_clear_error_or_none(path):
    """A flipped byte may go unseen, but never ends in another kind of error."""
    content = path.read_bytes()
    for position in np.random.default_rng(0).integers(0, len(content), 200):
        damaged = bytearray(content)
        damaged[position] ^= 0xFF
        path.write_bytes(damaged)
        try:
            load_phac2(path)
        except (OSError, ValueError) as error:
            assert "corpus.h5" in str(error)
    assert_all_closed()


def test_trial_without_the_procedure(path):
    with pytest.raises(
        ValueError,
        match=r"'sponge_114_02' of .*corpus\.h5 has no procedure 'squeeze': .*"
        r"'DISABLED', 'HOLD_FOR_10_SECONDS', 'MOVE_ARM_START_POSITION'",
    ):
        load_phac2(path, procedure="squeeze")
    assert_all_closed()


@pytest.mark.parametrize(
    "params, message",
    [
        ({"sensors": ["pac", "pcd"]}, r"sensor 'pcd'.*'pdc', .*'electrodes'"),
        ({"trials": ["sponge_114_03"]}, r"trial 'sponge_114_03'.*corpus.h5.*114_02'"),
        ({"sensors": []}, "No sensor is asked for"),
        ({"trials": []}, "No trial is asked for"),
        ({"sensors": ["pac", "pac"]}, "sensor 'pac' is asked for twice"),
    ],
)
def test_unknown_names(path, params, message):
    with pytest.raises(ValueError, match=message):
        load_phac2(path, **params)


@pytest.mark.parametrize(
    "params, message",
    [
        ({"procedure": "slide"}, "'procedure' .*'fast_slide'"),
        ({"sensors": "pac"}, "'sensors'"),
        ({"trials": "sponge_114_02"}, "'trials'"),
        ({"remove_baseline": 3}, "'remove_baseline'"),
    ],
)
def test_invalid_parameters(path, params, message):
    with pytest.raises(InvalidParameterError, match=message):
        load_phac2(path, **params)


TAC = "sponge_114_02/biotacs/finger_1/tac"
PAC = "sponge_114_02/biotacs/finger_1/pac"


@pytest.mark.parametrize(
    "name, change, message",
    [
        (TAC, {"data": np.zeros(12)}, r"shape \(12,\); it must be \(13,\)"),
        (TAC, {"data": np.zeros((13, 2))}, r"shape \(13, 2\); it must be \(13,\)"),
        (TAC, {"data": 3}, r"shape \(\); it must be"),
        (TAC, {"data": ["a"] * 13}, "dtype object; it must hold numbers"),
        (TAC, {"data": np.full(13, b"a")}, r"dtype \|S1; it must hold numbers"),
        (TAC, {"data": np.zeros(13, "i4,f4")}, "it must hold numbers"),
        (TAC, {"shape": 13, "dtype": h5py.ref_dtype}, "it must hold numbers"),
        (
            TAC,
            {"shape": 13, "dtype": "i8", "external": "/etc/passwd"},
            "keeps its values in another file",
        ),
        (
            PAC,
            {"data": np.zeros((13, 21))},
            r"shape \(13, 21\); it must be \(13, 22\)",
        ),
        (
            "sponge_114_02/state/controller_detail_state",
            {"data": ["HOLD_FOR_10_SECONDS"] * 13},
            "dtype object; it must hold byte strings",
        ),
        (
            "sponge_114_02/state/controller_detail_state",
            {"data": np.array([[STATES["hold"]]])},
            r"shape \(1, 1\); it must be \(n_frames,\)",
        ),
        (
            "sponge_114_02/state/controller_detail_state",
            {"data": np.array(SEQUENCE[:-1])},
            r" \(13, 22\); it must be \(12, 22\)",
        ),
    ],
)
def test_wrong_shape_or_dtype(path, name, change, message):
    edit(path, lambda file: replace(file, name, **change))
    with pytest.raises(ValueError, match=rf"/sponge_114_02/.*corpus\.h5.*{message}"):
        load_phac2(path)
    assert_all_closed()


def test_virtual_dataset_is_refused(path):
    def change(file):
        layout = h5py.VirtualLayout(13, dtype="i8")
        layout[:] = h5py.VirtualSource("other.h5", "data", 13)
        del file[TAC]
        file.create_virtual_dataset(TAC, layout)

    edit(path, change)
    with pytest.raises(ValueError, match=rf"/{TAC} of .*in another file"):
        load_phac2(path)


@pytest.mark.parametrize(
    "name, message",
    [
        (TAC, r"/sponge_114_02/biotacs/finger_1 of .*corpus\.h5 has no 'tac'.*'pdc'"),
        ("sponge_114_02/biotacs", r"/sponge_114_02 of .*corpus\.h5 has no 'biotacs'"),
        ("sponge_114_02/state/controller_detail_state", "has no 'controller_detail"),
    ],
)
def test_missing_parts(path, name, message):
    def change(file):
        del file[name]

    edit(path, change)
    with pytest.raises(ValueError, match=message):
        load_phac2(path)


def test_a_group_in_place_of_a_dataset_and_the_reverse(path):
    def change(file):
        del file[TAC]
        file.create_group(TAC)

    edit(path, change)
    with pytest.raises(ValueError, match=rf"/{TAC} of .* is not a dataset"):
        load_phac2(path)
    edit(path, lambda file: replace(file, "sponge_114_02/biotacs", data=1))
    with pytest.raises(ValueError, match=r"biotacs of .* is not a group"):
        load_phac2(path)
    edit(path, lambda file: replace(file, "sponge_114_02", data=1))
    with pytest.raises(ValueError, match=r"/sponge_114_02 of .* is not a group"):
        load_phac2(path)


@pytest.mark.parametrize("name", ["sponge_114_02", TAC])
@pytest.mark.parametrize("kind", ["dangling", "soft", "external"])
def test_links_are_not_followed(path, tmp_path, name, kind):
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        write_trial(file, "sponge_114_02")
    link = {
        "dangling": h5py.SoftLink("/nowhere"),
        "soft": h5py.SoftLink("/" + name.replace("_02", "_10")),
        "external": h5py.ExternalLink(str(other), "/" + name),
    }[kind]

    def change(file):
        del file[name]
        file[name] = link

    edit(path, change)
    last = name.rpartition("/")[2]
    with pytest.raises(ValueError, match=rf"'{last}' in .*corpus\.h5 is a soft or ext"):
        load_phac2(path)
    assert_all_closed()


def test_no_trials(tmp_path):
    path = tmp_path / "corpus.h5"
    with h5py.File(path, "w") as file:
        file.create_group("adjectives")
    with pytest.raises(ValueError, match=r"corpus\.h5 has no trials"):
        load_phac2(path)


@pytest.mark.parametrize("name", ["spo\rnge_114_03", "spo\nnge_7_1", " _1_1", "ß_٣_1"])
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


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 5_000, 100_000])
def test_names_are_chosen_in_linear_time(n):
    """As many comparisons of names as there are names, up to a factor."""
    n_compared = 0

    class Name(str):
        __hash__ = str.__hash__

        def __eq__(self, other):
            nonlocal n_compared
            n_compared += 1
            return str.__eq__(self, other)

    known = [Name(f"sponge_{i}_1") for i in range(n)]
    asked = [str(name) for name in known[::-1]]
    assert check_names(asked, known, "trial", "the file") == asked
    assert n_compared < 20 * n
    with pytest.raises(ValueError, match=r"'sponge_0_1' is asked for twice"):
        check_names([*asked, "sponge_0_1"], known, "trial", "the file")


@pytest.mark.parametrize(
    "name", ["notes", "sponge_114", "sponge_x_01", f"sponge_{10**18}_1"]
)
def test_names_that_are_no_trials(path, name):
    edit(path, lambda file: file.create_group(name))
    with pytest.raises(ValueError, match=rf"'{name}' at the root of .*corpus\.h5"):
        load_phac2(path)


def test_names_that_are_no_text(path):
    edit(path, lambda file: file.create_group(b"caf\xe9_101_01"))
    with pytest.raises(OSError, match=r"corpus\.h5 .*a name is not text"):
        load_phac2(path)


def test_missing_extra(path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ImportError, match="requires h5py; install it with"):
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
                    np.testing.assert_array_equal(cell, expected)
                    level = values[rest].reshape(-1, n_channels).mean(axis=0)
                    np.testing.assert_allclose(
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
def test_real_recordings_of_one_finger(bolt_pilot, tmp_path):
    both, path = bolt_pilot / "bolt_pilot_phac2_layout.h5", tmp_path / "one.h5"
    names = list(load_phac2(both, sensors=["tdc"]).trials.index[::5])
    with h5py.File(both) as source, h5py.File(path, "w") as copy:
        for name in names:
            for part in ("state", "biotacs/finger_1"):
                source.copy(f"{name}/{part}", copy, name=f"{name}/{part}")
    corpus = load_phac2(path, procedure="slow_slide")
    two = load_phac2(both, procedure="slow_slide", trials=names)
    for sensor in SENSORS:
        for cell, expected in zip(corpus.trials[sensor], two.trials[sensor]):
            np.testing.assert_array_equal(cell, np.split(expected, 2, axis=1)[1])
    levels = np.unique(corpus.objects, return_inverse=True)[1]
    model = make_haptic_pipeline(random_state=0).fit(corpus.trials, levels)
    assert model.predict_proba(corpus.trials).shape == (len(names), 5)


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


@pytest.mark.slow
def test_rest_is_zero_and_contact_is_not(bolt_pilot):
    """While held, the pressure of every trial lies above its level at rest."""
    corpus = load_phac2(bolt_pilot / "bolt_pilot_phac2_layout.h5", sensors=["pdc"])
    medians = np.array([np.median(cell) for cell in corpus.trials["pdc"]])
    assert medians.min() > 20
    assert medians.max() < 500
