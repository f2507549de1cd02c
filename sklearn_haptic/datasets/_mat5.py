"""Safe reading of MATLAB files of versions 5 to 7, which does not trust their tags.

Every size in a file is compared with that of its container, and only the variables
asked for are decompressed. SciPy's reader does neither: a damaged file can make it end
the process, and a small one can make it fill the memory.

References
----------
"MAT-File Format", The MathWorks, 2024, chapter "Level 5 MAT-File Format".
"""

import math
import struct
import zlib
from collections.abc import Callable
from functools import partial
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

_HEADER_SIZE = 128
_HEAD_SIZE = 4096  # more than the class, dimensions and name of a variable take
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
_NUMBERS = {
    **{1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4"},
    **{6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"},
}
_TEXT = {1: "utf-8", 2: "utf-8", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_CLASSES = {
    **{1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 6: "double"},
    **{7: "single", 8: "int8", 9: "uint8", 10: "int16", 11: "uint16", 12: "int32"},
    **{13: "uint32", 14: "int64", 15: "uint64", 16: "function_handle", 17: "opaque"},
}
NUMERIC_CLASSES = tuple(_CLASSES[i] for i in range(6, 16))


class Variable(NamedTuple):
    """A variable, or a field of a struct, of a MATLAB file."""

    name: str
    matlab_class: str
    """Class in MATLAB; "complex double" and the like are separate classes."""
    shape: tuple[int, ...]
    read: Callable[[], Any]
    """Return numbers as an array, texts as a list, anything else as None."""


def list_mat5(data, limit):
    """Yield the variables of a file; each field of a struct counts as one.

    Parameters
    ----------
    data : bytes
        The whole file.
    limit : int
        The most bytes to which a variable may be decompressed.

    Yields
    ------
    variable : Variable
        Numbers and text are decompressed when they are read, structs immediately.

    Raises
    ------
    ValueError, struct.error, zlib.error
        If a tag has an unknown type, or a size or number that does not fit.
    MemoryError
        If a struct would exceed the limit.

    Examples
    --------
    >>> import io
    >>> from scipy.io import savemat
    >>> from sklearn_haptic.datasets._mat5 import list_mat5
    >>> file = io.BytesIO()
    >>> savemat(file, {"ratings": [[1, 2], [3, 4]]})
    >>> [variable] = list_mat5(file.getvalue(), 1000)
    >>> variable.name, variable.matlab_class, variable.shape
    ('ratings', 'int64', (2, 2))
    >>> variable.read().tolist()
    [[1, 2], [3, 4]]
    """
    _require(0 not in data[:4], "it is of version 4, which has no third axis")
    order = {b"IM": "<", b"MI": ">"}.get(data[126:_HEADER_SIZE])
    _require(order is not None, "it has no header")
    elements = _elements(memoryview(data)[_HEADER_SIZE:], order, padded=False)
    for kind, content in elements:
        if kind == _COMPRESSED:
            head = zlib.decompressobj().decompress(content, _HEAD_SIZE)
            kind, size = struct.unpack_from(f"{order}II", head)
            head, load = head[8:], partial(_inflate, content, size, limit)
        else:
            head, load = content, partial(memoryview, content)
        _require(kind == _MATRIX, f"variable of type {kind}")
        yield from _list_matrix(head, load, order)


def _elements(data, order, *, padded=True):
    """Yield the type and content of each element."""
    start = 0
    while start < len(data):
        kind, size = struct.unpack_from(f"{order}II", data, start)
        if kind >> 16:  # a small element, its content within the tag
            kind, size = kind & 0xFFFF, kind >> 16
            _require(size <= 4, f"small element of {size} bytes")
            content, end = data[start + 4 : start + 4 + size], start + 8
        else:
            content = data[start + 8 : start + 8 + size]
            _require(len(content) == size, f"element of type {kind} is cut short")
            end = start + 8 + size
        yield kind, content
        start = end + -end % 8 if padded else end


def _inflate(content, size, limit):
    """Return the content of the one element that a compressed element holds."""
    if size > limit:
        raise MemoryError(f"{size} bytes of values would come of {len(content)}")
    padding = 7
    stream = zlib.decompressobj()
    data = stream.decompress(content, 8 + size + padding + 1)
    _require(stream.eof and 8 + size <= len(data), "compressed values cut short")
    return memoryview(data)[8 : 8 + size]


def _list_matrix(head, load, order, name=None):
    """Yield a variable, or the fields of a struct, given its first bytes.

    ``load()`` returns all its bytes. The name of a field comes from the struct.
    """
    matlab_class, shape, own_name = _read_head(head, order)
    name = own_name if name is None else name
    if matlab_class == "struct" and math.prod(shape) == 1:
        yield from _list_struct(load(), order, name)
    else:
        read = partial(_read_matrix, load, order)
        if matlab_class in NUMERIC_CLASSES and load.func is memoryview:
            read()  # checks their number and copies nothing
        yield Variable(name, matlab_class, shape, read)


def _read_head(head, order):
    """Return the class, shape and name of an array."""
    if len(head) == 0:
        return "double", (0, 0), ""
    head = islice(_elements(head, order), 3)
    kind, flags = next(head)
    _require(kind == _UINT32 and len(flags) == 8, "array without flags")
    [flags] = struct.unpack_from(f"{order}I", flags)
    matlab_class = _CLASSES.get(flags & 0xFF)
    _require(matlab_class is not None, f"array of class {flags & 0xFF}")
    if matlab_class == "opaque":
        return matlab_class, (), _as_name(*next(head))
    (kind, shape), name = head
    _require(kind in (_INT32, _UINT32) and len(shape) % 4 == 0, "no dimensions")
    shape = struct.unpack(f"{order}{len(shape) // 4}i", shape)
    _require(2 <= len(shape) <= 32 and min(shape) >= 0, f"dimensions {shape}")
    if flags & 0x800:
        matlab_class = f"complex {matlab_class}"
    return matlab_class, shape, _as_name(*name)


def _as_name(kind, name):
    _require(kind in _TEXT, "no name")
    return bytes(name).decode("utf-8", "replace")


def _read_matrix(load, order):
    """Return the numbers or rows of text of an array; None for any other class."""
    content = load()
    if len(content) == 0:
        return np.empty((0, 0))
    matlab_class, shape, _ = _read_head(content, order)
    parts = islice(_elements(content, order), 3, None)
    if matlab_class in NUMERIC_CLASSES:
        [(kind, values)] = parts
        _require(kind in _NUMBERS, f"values of type {kind}")
        values = np.frombuffer(values, order + _NUMBERS[kind])
        _require(values.size == math.prod(shape), "values of another number")
        return values.reshape(shape, order="F")
    if matlab_class == "char":
        [(kind, text)] = parts
        _require(kind in _TEXT, f"text of type {kind}")
        encoding = _TEXT[kind] + {"<": "-le", ">": "-be"}[order] * (kind in (4, 17, 18))
        units = str(text, encoding).encode("utf-16-le", "surrogatepass")
        units = np.frombuffer(units, "<u2")
        if math.prod(shape) == 1 and units.size == 0:  # a single blank is left out
            units = np.array([ord(" ")], "<u2")
        _require(units.size == math.prod(shape), "text of another size")
        return rows_of_text(units.reshape(shape, order="F"))
    if matlab_class == "cell":
        cells = [content for _, content in islice(parts, math.prod(shape))]
        _require(len(cells) == math.prod(shape), "cells of another number")
        return join_cells(_read_matrix(partial(memoryview, c), order) for c in cells)
    return None


def _list_struct(content, order, name):
    """Yield the fields of a struct."""
    parts = islice(_elements(content, order), 3, None)
    (width_kind, width), (names_kind, names), *_ = islice(parts, 2)
    _require((width_kind, names_kind) == (_INT32, _INT8), "struct without fields")
    [width] = struct.unpack(f"{order}i", width)
    _require(width > 0, "fields without names")
    n_fields = len(names) // width
    for i in range(n_fields):
        kind, content = next(parts, (None, b""))
        _require(kind == _MATRIX, "fields of another number")
        field = bytes(names[i * width : (i + 1) * width]).partition(b"\0")[0]
        field = f"{name}.{field.decode('utf-8', 'replace')}"
        yield from _list_matrix(content, partial(memoryview, content), order, field)


def rows_of_text(units):
    """Return the rows of a character matrix of UTF-16, stripped of blanks.

    An array with another number of axes than two is not text, so None is returned. A
    UnicodeError is raised if the characters are not UTF-16.
    """
    if units.ndim != 2:
        return None
    if units.size == 0:  # of however many rows
        return []
    if units.min() < 0 or units.max() > 0xFFFF:
        raise UnicodeError("a character exceeds 16 bits")
    return [row.astype("<u2").tobytes().decode("utf-16-le").strip() for row in units]


def join_cells(cells):
    """Return the texts of cells of one row each, or None if any is something else."""
    texts = []
    for cell in cells:
        if not isinstance(cell, list) or len(cell) > 1:
            return None
        texts += cell or [""]
    return texts


def _require(condition, problem):
    if not condition:
        raise ValueError(problem)
