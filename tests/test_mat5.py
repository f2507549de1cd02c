import io
import struct
import subprocess
import sys
import warnings
import zlib
from pathlib import Path

import numpy as np
import pytest
import scipy.io.matlab
from scipy import sparse
from scipy.io import loadmat, savemat

from sklearn_haptic.datasets._mat5 import check_mat5

FILES = sorted(Path(scipy.io.matlab.__file__).parent.glob("tests/data/*.mat"))
VARIABLES = {
    "ratings": np.arange(24.0).reshape(2, 3, 4),
    "complex": np.array([1 + 2j]),
    "flags": np.array([True, False]),
    "text": np.array(["hard", "soft"]),
    "cells": np.array(["rough", np.ones(3)], dtype=object),
    "struct": {"a": 1.5, "b": {"c": "text"}},
    "empty": np.empty((0, 0)),
    "sparse": sparse.csc_array(np.eye(3)),
}


def mat_file(variables=VARIABLES, **options):
    file = io.BytesIO()
    savemat(file, variables, **options)
    return file.getvalue()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_what_matlab_wrote_and_scipy_reads_is_accepted(path):
    data = path.read_bytes()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            loadmat(io.BytesIO(data))
        except Exception:
            pytest.skip("SciPy does not read it")
    check_mat5(data)


@pytest.mark.parametrize("do_compression", [False, True])
@pytest.mark.parametrize("format", ["4", "5"])
def test_what_scipy_writes_is_accepted(do_compression, format):
    variables = VARIABLES if format == "5" else {"ratings": np.ones((2, 3))}
    check_mat5(mat_file(variables, do_compression=do_compression, format=format))


@pytest.mark.parametrize("do_compression", [False, True])
def test_file_cut_anywhere_is_refused(do_compression):
    data = mat_file({"ratings": np.ones((2, 3))}, do_compression=do_compression)
    for size in range(129, len(data)):
        with pytest.raises((ValueError, zlib.error, struct.error)):
            check_mat5(data[:size])


FLIP_ALL = """
import io, sys, warnings
from scipy.io import loadmat
from sklearn_haptic.datasets._mat5 import check_mat5

warnings.simplefilter("ignore")
data = sys.stdin.buffer.read()
for place in range(8 * 128, 8 * len(data)):
    damaged = bytearray(data)
    damaged[place // 8] ^= 1 << place % 8
    try:
        check_mat5(bytes(damaged))
        loadmat(io.BytesIO(damaged))
    except Exception:
        pass
print("done")
"""


def test_no_flipped_bit_ends_the_process():
    """In a process of its own, as SciPy alone crashes on some of them."""
    process = subprocess.run(
        [sys.executable, "-c", FLIP_ALL], input=mat_file(), capture_output=True
    )
    assert process.returncode == 0, process.stderr
    assert process.stdout == b"done\n"


def test_compressed_values_of_another_checksum_are_refused():
    data = bytearray(mat_file({"ratings": np.ones((9, 9))}, do_compression=True))
    data[-1] ^= 1
    with pytest.raises(zlib.error, match="incorrect data check"):
        check_mat5(bytes(data))
