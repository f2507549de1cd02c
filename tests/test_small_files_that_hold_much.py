"""Files that declare, or expand to, far more than they hold must not fill the memory.

Every file is read in a process of its own, which reports what it took at its peak and
what came of it.
"""

import io
import json
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest
from scipy.io import savemat
from test_matlab_ratings import read_ratings, save_v73
from test_phac2 import STATES, write_trial

from sklearn_haptic.datasets import load_phac2
from sklearn_haptic.datasets._rated import ADJECTIVES

pytestmark = pytest.mark.slow

h5py = pytest.importorskip("h5py")

MIB = 2**20
TRIAL = "sponge_114_02"
STATE = f"{TRIAL}/state/controller_detail_state"
PDC = f"{TRIAL}/biotacs/finger_0/pdc"
OBJECTS = [114, 602]

READ = """
import json, re, sys, warnings
from contextlib import suppress
from sklearn_haptic.datasets import load_phac2
import h5py

def peak():
    with open("/proc/self/status") as file:
        return 1024 * int(re.search(r"VmHWM:\\s+(\\d+)", file.read())[1])

warnings.simplefilter("ignore")
for line in sys.stdin:
    with suppress(OSError), open("/proc/self/clear_refs", "w") as file:
        file.write("5")  # forget the peak so far
    before, outcome = peak(), None
    try:
        load_phac2(**json.loads(line))
    except Exception as error:
        outcome = f"{type(error).__name__}: {error}"
    print(json.dumps([peak() - before, outcome]), flush=True)
"""


@pytest.fixture(scope="module")
def load_in_another_process():
    """Return the bytes that `load_phac2` took at its peak, and its error if any."""
    if not sys.platform.startswith("linux"):
        pytest.skip("needs /proc")
    process = subprocess.Popen(
        [sys.executable, "-c", READ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )

    def load(**params):
        params = {name: str(value) for name, value in params.items()}
        print(json.dumps(params), file=process.stdin, flush=True)
        return json.loads(process.stdout.readline())

    with process:
        yield load


def deflated_zeros(n_bytes, head=b""):
    """Compress some bytes and as many zeros, by repeating the same block."""
    stream = zlib.compressobj(9, wbits=-15)
    data = b"\x78\xda" + stream.compress(head) + stream.flush(zlib.Z_FULL_FLUSH)
    block = stream.compress(bytes(MIB)) + stream.flush(zlib.Z_FULL_FLUSH)
    data += n_bytes // MIB * block + stream.compress(bytes(n_bytes % MIB))
    low, high = zlib.adler32(head) % 2**16, zlib.adler32(head) >> 16
    high = (high + n_bytes * low) % 65521
    return data + stream.flush() + struct.pack(">HH", high, low)


def test_zeros_are_compressed_as_zlib_does():
    data = deflated_zeros(3 * MIB + 5, b"head")
    assert zlib.decompress(data) == b"head" + bytes(3 * MIB + 5)


# Recordings -----------------------------------------------------------------------


def declared_states(file):
    del file[STATE]
    file.create_dataset(STATE, (10**8,), "S30", chunks=(10**6,), compression="gzip")


def declared_states_in_one_piece(file):
    del file[STATE]
    file.create_dataset(STATE, (10**8,), "S30")


def compressed_states(file):
    del file[STATE]
    states = file.create_dataset(
        STATE, (2 * 10**7,), "S30", chunks=(10**6,), compression="gzip"
    )
    hold = zlib.compress(STATES["hold"].ljust(30, b"\0") * 10**6)
    for i in range(20):
        states.id.write_direct_chunk((i * 10**6,), hold)


def one_huge_chunk(file):
    del file[PDC]
    pdc = file.create_dataset(
        PDC, (13,), "i8", chunks=(10**8,), maxshape=(None,), compression="gzip"
    )
    pdc.id.write_direct_chunk((0,), deflated_zeros(8 * 10**8))


def a_chunk_of_more_than_its_values(file):
    del file[PDC]
    # HDF5 1.14 writes at most 65,535 bytes for chunks below 4 KiB.
    settings = {"maxshape": (None,), "chunks": (2_000,), "compression": "gzip"}
    pdc = file.create_dataset(PDC, (13,), "i8", **settings)
    pdc.id.write_direct_chunk((0,), deflated_zeros(400 * MIB))


@pytest.mark.parametrize(
    "change, message",
    [
        (declared_states, r"declares shape \(100000000,\), but .* not hold as many"),
        (declared_states_in_one_piece, r"declares shape \(100000000,\), but"),
        (compressed_states, "572 MiB of values would come of a file of"),
        (one_huge_chunk, "763 MiB of values would come of a file of"),
        (a_chunk_of_more_than_its_values, "a chunk holds more than its values"),
    ],
)
def test_recordings(tmp_path, load_in_another_process, change, message):
    path = tmp_path / "corpus.h5"
    with h5py.File(path, "w") as file:
        write_trial(file, TRIAL)
        change(file)
    assert path.stat().st_size < 3 * MIB
    peak, error = load_in_another_process(path=path)
    assert error is not None
    assert peak < 40 * MIB
    with pytest.raises(OSError, match=rf"corpus\.h5 .*{message}"):
        load_phac2(path)


def test_trials_that_are_one_and_the_same(tmp_path):
    """Sixty names of a trial, each of which may be read."""
    path, n = tmp_path / "corpus.h5", 10**5
    with h5py.File(path, "w") as file:
        group = file.create_group("sponge_114_00")
        states = np.full(n, STATES["hold"], "S30")
        values = np.zeros((n, 19), "i1")
        for place, data in [
            ("state/controller_detail_state", states),
            ("biotacs/finger_0/electrodes", values),
            ("biotacs/finger_1/electrodes", values),
        ]:
            group.create_dataset(place, data=data, compression="gzip")
        for run in range(1, 60):
            file[f"sponge_114_{run:02}"] = group
    with pytest.raises(OSError, match=r"MiB of values would come of a file of"):
        load_phac2(path, sensors=["electrodes"], remove_baseline=False)


@pytest.mark.parametrize("n_frames, n_trials", [(400_000, 1), (4_000, 60)])
def test_what_compresses_well_and_is_all_there_is_read(tmp_path, n_frames, n_trials):
    """Silent sensors, compressed by up to 1000; more than an hour in one trial."""
    path = tmp_path / "corpus.h5"
    states = np.full(n_frames, STATES["hold"], "S30")
    with h5py.File(path, "w") as file:
        for run in range(n_trials):
            group = file.create_group(f"sponge_114_{run:02}")
            options = {"compression": "gzip", "compression_opts": 9, "chunks": True}
            group.create_dataset(
                "state/controller_detail_state", data=states, **options
            )
            for finger in (0, 1):
                for sensor, width in [("pdc", ()), ("electrodes", (19,))]:
                    place = f"biotacs/finger_{finger}/{sensor}"
                    values = np.full((n_frames, *width), 7)
                    group.create_dataset(place, data=values, **options)
    trials = load_phac2(
        path, sensors=["pdc", "electrodes"], remove_baseline=False
    ).trials
    for sensor, n_channels in [("pdc", 2), ("electrodes", 38)]:
        for cell in trials[sensor]:
            assert cell.shape == (n_frames, n_channels)
            assert (cell == 7).all()


def test_a_real_corpus_compressed(shared_data, tmp_path):
    """All recordings of the pilot, each dataset compressed as far as gzip can."""
    source = shared_data / "bolt_pilot/bolt_pilot_phac2_layout.h5"
    path = tmp_path / "compressed.h5"
    with h5py.File(source) as old, h5py.File(path, "w") as new:
        trials = list(old)[::9]

        def copy(name, node):
            if isinstance(node, h5py.Dataset) and node.ndim:
                new.create_dataset(
                    f"{trial}/{name}",
                    data=node[()],
                    chunks=True,
                    shuffle=True,
                    compression="gzip",
                    compression_opts=9,
                )

        for trial in trials:
            old[trial].visititems(copy)
    expected = load_phac2(source, trials=trials).trials
    found = load_phac2(path, trials=trials).trials
    for trial in trials:
        for sensor in expected:
            np.testing.assert_array_equal(
                found.loc[trial, sensor], expected.loc[trial, sensor]
            )


# Ratings --------------------------------------------------------------------------


@pytest.fixture
def corpus(tmp_path):
    path = tmp_path / "corpus.h5"
    with h5py.File(path, "w") as file:
        for seed, name in enumerate([TRIAL, "cup_602_01"]):
            write_trial(file, name, seed=seed)
    return path


def compressed_variable(name, shape, matlab_class=9, in_struct=False):
    """A variable of zeros, a byte each, compressed without making room for it."""
    n = int(np.prod(shape))

    def element(kind, content):
        return (
            struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)
        )

    def head_of(matlab_class, shape, name):
        return (
            element(6, struct.pack("<II", matlab_class, 0))
            + element(5, struct.pack(f"<{len(shape)}i", *shape))
            + element(1, name)
        )

    head = head_of(matlab_class, shape, name.encode()) + struct.pack("<II", 2, n)
    size = len(head) + n + -n % 8
    head = struct.pack("<II", 14, size) + head
    if in_struct:
        fields = element(5, struct.pack("<i", 8)) + element(1, b"field".ljust(8, b"\0"))
        outer = head_of(2, (1, 1), b"s") + fields
        head = struct.pack("<II", 14, len(outer) + 8 + size) + outer + head
    data = deflated_zeros(n + -n % 8, head)
    return struct.pack("<II", 15, len(data)) + data


def save_mat(path, *variables):
    path.write_bytes(b" " * 124 + b"\0\1IM" + b"".join(variables))


RATINGS = np.random.default_rng(0).integers(1, 6, (2, 10, 12))
ORDER = {"ids": OBJECTS, "names": np.array(ADJECTIVES, dtype=object)}


def real_variables(**options):
    file = io.BytesIO()
    savemat(file, {"ratings": RATINGS} | ORDER, **options)
    return file.getvalue()[128:]


def assert_read(path):
    ratings, _ = read_ratings(path, OBJECTS, OBJECTS)
    expected = [np.bincount(row, minlength=6)[1:] for row in RATINGS[:, 2]]
    np.testing.assert_array_equal(ratings["rough"], expected)


@pytest.mark.parametrize(
    "shape, matlab_class",
    [((4 * 10**8, 1), 9), ((2, 10, 2 * 10**7), 4), ((10**4, 10, 4000), 9)],
)
def test_unrelated_variables_are_not_decompressed(
    corpus, load_in_another_process, shape, matlab_class
):
    path = corpus.with_name("ratings.mat")
    bomb = compressed_variable("bomb", shape, matlab_class)
    save_mat(path, bomb, real_variables(do_compression=True))
    assert path.stat().st_size < MIB
    assert_read(path)
    peak, error = load_in_another_process(path=corpus, ratings=path)
    assert error is None
    assert peak < 40 * MIB


def test_ratings_that_expand_too_far(corpus, load_in_another_process):
    """400 MB of them in a file of 390 KB; in a struct, which has to be looked into."""
    path = corpus.with_name("ratings.mat")
    for in_struct in (False, True):
        save_mat(
            path, compressed_variable("a", (2, 10, 2 * 10**7), in_struct=in_struct)
        )
        assert path.stat().st_size < MIB
        peak, error = load_in_another_process(path=corpus, ratings=path)
        assert peak < 40 * MIB
        assert error.startswith(f"OSError: {path} takes too much memory (4000")
        assert error.endswith("save its ratings alone, without compression.")


def test_ratings_that_expand_far_are_read(tmp_path):
    """Ten million people who all agree: 400 times what the file takes."""
    path = tmp_path / "ratings.mat"
    savemat(path, {"a": np.ones((2, 10, 10**5))}, do_compression=True)
    assert path.stat().st_size < 2 * 10**6 * 8 / 400
    order = {"objects": OBJECTS, "adjectives": ADJECTIVES}
    ratings, _ = read_ratings(path, OBJECTS, OBJECTS, **order)
    np.testing.assert_array_equal(ratings["hard"], [[10**5, 0, 0, 0, 0]] * 2)


@pytest.mark.parametrize(
    "shape, chunks, outcome",
    [
        ((10**8, 10), None, None),
        ((10**5, 10**4), (10**4, 10**3), None),
        ((10, 10**6, 100), (1, 10**4, 10), None),
        ((10**7, 10, 2), (10**5, 10, 2), "does not hold as many values"),
        ((10**7, 10, 2), None, "does not hold as many values"),
    ],
)
def test_version_7_3(corpus, load_in_another_process, shape, chunks, outcome):
    path = corpus.with_name("ratings.mat")
    save_v73(path, {"ratings": RATINGS} | ORDER)
    with h5py.File(path, "r+") as file:
        if outcome is not None:
            del file["ratings"]
        file.create_dataset("bomb", shape, "f8", chunks=chunks)
    peak, error = load_in_another_process(path=corpus, ratings=path)
    assert peak < 40 * MIB
    if outcome is None:
        assert error is None
        assert_read(path)
    else:
        assert outcome in error


def test_ratings_of_version_7_3_that_expand_too_far(corpus, load_in_another_process):
    path = corpus.with_name("ratings.mat")
    save_v73(path, {"ids": OBJECTS})
    with h5py.File(path, "r+") as file:
        bomb = file.create_dataset(
            "bomb", (10**7, 10, 2), "u1", chunks=(10**7, 10, 2), compression=9
        )
        bomb.id.write_direct_chunk((0, 0, 0), deflated_zeros(2 * 10**8))
    assert path.stat().st_size < MIB
    peak, error = load_in_another_process(path=corpus, ratings=path)
    assert peak < 40 * MIB
    assert "191 MiB of values would come of a file of" in error


# Memory that is not there ---------------------------------------------------------


LIMITED = """
import resource, sys
from sklearn_haptic.datasets import load_phac2
import h5py

with open("/proc/self/statm") as file:
    now = int(file.read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (now + 2**27, now + 2**27))
try:
    load_phac2(sys.argv[1], sensors=["electrodes"], remove_baseline=False)
except OSError as error:
    print(error)
"""


def test_lack_of_memory_names_the_file(tmp_path):
    if not sys.platform.startswith("linux"):
        pytest.skip("needs /proc")
    path, n = tmp_path / "corpus.h5", 10**6
    with h5py.File(path, "w") as file:
        group = file.create_group(TRIAL)
        group["state/controller_detail_state"] = np.full(n, STATES["hold"], "S30")
        for finger in (0, 1):
            values = np.zeros((n, 19), "i8")
            group[f"biotacs/finger_{finger}/electrodes"] = values
    process = subprocess.run(
        [sys.executable, "-c", LIMITED, path], capture_output=True, text=True
    )
    assert "corpus.h5 cannot be read: it takes more memory than" in process.stdout
    assert "ask for fewer trials or sensors" in process.stdout
