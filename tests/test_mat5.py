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

from sklearn_haptic.datasets._mat5 import list_mat5

FILES = sorted(Path(scipy.io.matlab.__file__).parent.glob("tests/data/*.mat"))
# SciPy gives fields of one name other names.
FILES = [path for path in FILES if path.name != "nasty_duplicate_fieldnames.mat"]
VARIABLES = {
    "ratings": np.arange(24.0).reshape(2, 3, 4),
    "complex": np.array([1 + 2j]),
    "flags": np.array([True, False]),
    "text": np.array(["hard", "soft"]),
    "cells": np.array(["rough", np.ones(3)], dtype=object),
    "words": np.array(["rough", "", "weich, naß"], dtype=object),
    "struct": {"a": 1.5, "b": {"c": "text"}},
    "empty": np.empty((0, 0)),
    "sparse": sparse.csc_array(np.eye(3)),
}


def mat_file(variables=VARIABLES, **options):
    file = io.BytesIO()
    savemat(file, variables, **options)
    return file.getvalue()


def read_all(data):
    return {v.name: v.read() for v in list_mat5(data, 10**6)}


def fields_of(name, value):
    """Yield what SciPy read, each field of a struct on its own."""
    if type(value) is np.ndarray and value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from fields_of(f"{name}.{field}", value[field].item())
    elif type(value) is np.ndarray:
        yield name, value


def is_compared(value):
    return value.dtype.kind in "iuf" or (value.dtype.kind == "U" and value.ndim < 3)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_what_matlab_wrote_is_read_as_scipy_reads_it(path):
    data = path.read_bytes()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            expected = loadmat(io.BytesIO(data), chars_as_strings=True)
        except Exception:
            pytest.skip("SciPy does not read it")
    if 0 in data[:4]:
        with pytest.raises(ValueError, match="version 4"):
            read_all(data)
        return
    if path.name == "broken_utf8.mat":
        with pytest.raises(UnicodeDecodeError):
            read_all(data)
        return
    found = read_all(data)
    for name, value in expected.items():
        if name.startswith("__"):
            continue
        for field, numbers in fields_of(name, value):
            if not is_compared(numbers):
                continue
            if numbers.dtype.kind == "U":
                numbers = [text.strip() for text in numbers.ravel()]
            np.testing.assert_array_equal(found[field], numbers)
            assert np.shape(found[field]) == np.shape(numbers)


@pytest.mark.parametrize("do_compression", [False, True])
def test_what_scipy_writes_is_read(do_compression):
    data = mat_file(do_compression=do_compression)
    found = read_all(data)
    np.testing.assert_array_equal(found["ratings"], VARIABLES["ratings"])
    np.testing.assert_array_equal(found["flags"], [[True, False]])
    assert found["text"] == ["hard", "soft"]
    assert found["words"] == ["rough", "", "weich, naß"]
    assert found["cells"] is found["complex"] is found["sparse"] is None
    assert found["struct.a"] == 1.5
    assert found["struct.b.c"] == ["text"]
    assert found["empty"].shape == (0, 0)
    listed = {v.name: (v.shape, v.matlab_class) for v in list_mat5(data, 10**6)}
    assert listed["ratings"] == ((2, 3, 4), "double")
    assert listed["complex"] == ((1, 1), "complex double")
    assert listed["cells"] == ((1, 2), "cell")


@pytest.mark.parametrize("do_compression", [False, True])
def test_file_cut_anywhere_is_refused(do_compression):
    data = mat_file({"ratings": np.ones((2, 3))}, do_compression=do_compression)
    for size in range(129, len(data)):
        with pytest.raises((ValueError, zlib.error, struct.error)):
            read_all(data[:size])


FLIP_ALL = """
import sys
from sklearn_haptic.datasets._mat5 import list_mat5

data = sys.stdin.buffer.read()
for place in range(8 * 128, 8 * len(data)):
    damaged = bytearray(data)
    damaged[place // 8] ^= 1 << place % 8
    try:
        for variable in list_mat5(bytes(damaged), 10**6):
            variable.read()
    except Exception:
        pass
print("done")
"""


@pytest.mark.slow
def test_no_flipped_bit_ends_the_process():
    """In a process of its own, as SciPy's reader crashes on some of them."""
    process = subprocess.run(
        [sys.executable, "-c", FLIP_ALL], input=mat_file(), capture_output=True
    )
    assert process.returncode == 0, process.stderr
    assert process.stdout == b"done\n"


def test_compressed_values_of_another_checksum_are_refused():
    data = bytearray(mat_file({"ratings": np.ones((9, 9))}, do_compression=True))
    data[-1] ^= 1
    with pytest.raises(zlib.error, match="incorrect data check"):
        read_all(bytes(data))


def element(kind, content):
    """Tag and content of an element, made without SciPy."""
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def array(matlab_class, shape, *parts, name=b"x"):
    flags = struct.pack("<II", matlab_class, 0)
    shape = struct.pack(f"<{len(shape)}i", *shape)
    return element(
        14, b"".join([element(6, flags), element(5, shape), element(1, name), *parts])
    )


def mat5(*elements):
    return b" " * 124 + b"\0\1IM" + b"".join(elements)


def test_a_file_made_by_hand():
    data = mat5(
        array(6, (2, 2), element(2, bytes([1, 2, 3, 4])), name=b"small"),
        array(4, (2, 2), element(4, "acbd".encode("utf-16-le")), name=b"text"),
        array(4, (1, 2), element(16, "😀".encode()), name=b"emoji"),
        array(2, (1, 2), element(5, struct.pack("<i", 8)), element(1, b""), name=b"s"),
    )
    found = read_all(data)
    assert found["small"].tolist() == [[1, 3], [2, 4]]
    assert found["text"] == ["ab", "cd"]
    assert found["emoji"] == ["😀"]
    assert found["s"] is None


@pytest.mark.parametrize(
    "broken, message",
    [
        (array(6, (2, 2), element(9, bytes(24))), "another number"),
        (array(4, (1, 1), element(4, b"\0\xd8")), "unexpected end of data"),
        (array(4, (1, 3), element(4, b"a\0")), "another size"),
        (array(1, (10**4, 10**4)), "cells of another number"),
        (array(99, (1, 1)), "array of class 99"),
        (array(6, (-1, 1)), "dimensions"),
        (array(2, (1, 1), element(5, bytes(4)), element(1, b"a")), "without names"),
        (element(3, b"12345678"), "variable of type 3"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_does_not_fit_is_refused(broken, message):
    with pytest.raises(ValueError, match=message):
        read_all(mat5(broken))
