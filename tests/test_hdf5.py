"""Safe reading of HDF5 files: whole, plain, not being written, and as large as said.

Files that declare or expand to far more than they hold are read in a process of its
own, which reports what it took at its peak and what came of it.
"""

import json
import subprocess
import sys
import zlib

import numpy as np
import pytest
from test_phac2 import STATES, assert_all_closed, edit, replace, write_trial

from sklearn_haptic.datasets import load_phac2

h5py = pytest.importorskip("h5py")

MIB = 2**20
TRIAL = "sponge_114_02"
STATE = f"{TRIAL}/state/controller_detail_state"
TAC = f"{TRIAL}/biotacs/finger_1/tac"


@pytest.fixture
def path(tmp_path):
    """A file of one trial."""
    with h5py.File(tmp_path / "corpus.h5", "w") as file:
        write_trial(file, TRIAL)
    return tmp_path / "corpus.h5"


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


def declared_states(file):
    replace(file, STATE, shape=10**8, dtype="S30", chunks=(10**6,), compression="gzip")


def declared_states_in_one_piece(file):
    replace(file, STATE, shape=10**8, dtype="S30")


def compressed_states(file):
    states = replace(
        file, STATE, shape=2 * 10**7, dtype="S30", chunks=(10**6,), compression="gzip"
    )
    hold = zlib.compress(STATES["hold"].ljust(30, b"\0") * 10**6)
    for i in range(20):
        states.id.write_direct_chunk((i * 10**6,), hold)


def one_huge_chunk(file):
    tac = replace(
        file,
        TAC,
        shape=13,
        dtype="i8",
        chunks=(10**8,),
        maxshape=(None,),
        compression=1,
    )
    tac.id.write_direct_chunk((0,), zlib.compress(bytes(8 * 10**8), 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    "change, message",
    [
        (declared_states, r"declares shape \(100000000,\), 2.86e\+03 MiB, but the"),
        (declared_states_in_one_piece, r"declares shape \(100000000,\), 2.86e\+03 MiB"),
        (compressed_states, r"declares shape \(20000000,\), 572 MiB"),
        (one_huge_chunk, r"declares shape \(13,\), 763 MiB"),
    ],
)
def test_more_declared_than_held(path, load_in_another_process, change, message):
    edit(path, change)
    assert path.stat().st_size < 5 * MIB
    peak, error = load_in_another_process(path=path)
    assert error is not None
    assert peak < 40 * MIB
    with pytest.raises(OSError, match=rf"corpus\.h5 {message}"):
        load_phac2(path)


@pytest.mark.parametrize("chunks", [None, (5,)])
def test_values_that_were_never_written_are_not_zeros(path, chunks):
    def stop_early(file):
        tac = replace(file, TAC, shape=13, dtype="i8", chunks=chunks)
        if chunks:
            tac[:10] = 1

    edit(path, stop_early)
    with pytest.raises(OSError, match=rf"/{TAC} of .* declares shape \(13,\)"):
        load_phac2(path)
    assert len(load_phac2(path, sensors=["pdc"]).trials) == 1


@pytest.mark.slow
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
            OSError, match=r"corpus\.h5 cannot be read \(.*; close the file where"
        ):
            load_phac2(path)
        writer.stdin.close()
        writer.wait()
    assert len(load_phac2(path, sensors=["pdc"]).trials) == 1


def test_damaged_values(path):
    def compress(file):
        replace(file, TAC, data=np.arange(13), chunks=(13,), compression="gzip")

    edit(path, compress)
    with h5py.File(path) as file:
        chunk = file[TAC].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset : chunk.byte_offset + chunk.size] = bytes(chunk.size)
    path.write_bytes(content)
    with pytest.raises(OSError, match=rf"/{TAC} of .*corpus\.h5 .*damaged"):
        load_phac2(path)
    assert_all_closed()
    assert len(load_phac2(path, sensors=["pdc", "tdc"]).trials) == 1


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


def test_virtual_dataset_is_refused(path):
    def change(file):
        layout = h5py.VirtualLayout(13, dtype="i8")
        layout[:] = h5py.VirtualSource("other.h5", "data", 13)
        del file[TAC]
        file.create_virtual_dataset(TAC, layout)

    edit(path, change)
    with pytest.raises(ValueError, match=rf"/{TAC} of .*in another file"):
        load_phac2(path)


def test_missing_extra(path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ImportError, match="requires h5py; install it with"):
        load_phac2(path)
