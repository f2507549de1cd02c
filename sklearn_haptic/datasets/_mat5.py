"""The structure of MATLAB files of version 5, checked before SciPy reads them.

SciPy's reader believes the tags of a file, and one that is damaged can make it end
the process. Here every tag is compared with what holds it and what it holds.

References
----------
"MAT-File Format", The MathWorks, 2024, chapter "Level 5 MAT-File Format".
"""

import math
import struct
import zlib

_HEADER_SIZE = 128
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
# Bytes of a value of each type that is a number, and of each that is text.
_NUMBERS = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
_TEXT = {16: 1, 17: 2, 18: 4}
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_NUMERIC_CLASSES = range(6, 16)
_FUNCTION, _OPAQUE = 16, 17


def check_mat5(data):
    """Make sure that a file of version 5 is what its tags say.

    Parameters
    ----------
    data : bytes
        The whole file. Older versions are left to SciPy, which reads them safely.

    Raises
    ------
    ValueError, struct.error, zlib.error
        If a tag has an unknown type, or a size or number that does not fit.

    Examples
    --------
    >>> import io
    >>> from scipy.io import savemat
    >>> from sklearn_haptic.datasets._mat5 import check_mat5
    >>> file = io.BytesIO()
    >>> savemat(file, {"ratings": [[1, 2], [3, 4]]})
    >>> check_mat5(file.getvalue())
    >>> check_mat5(file.getvalue()[:-8])
    Traceback (most recent call last):
        ...
    ValueError: element of type 14 is cut short
    """
    if 0 in data[:4]:  # version 4, which has no header
        return
    order = {b"IM": "<", b"MI": ">"}.get(data[126:_HEADER_SIZE])
    if order is None:
        raise ValueError("it has no header")
    for kind, content in _elements(
        memoryview(data)[_HEADER_SIZE:], order, padded=False
    ):
        if kind == _COMPRESSED:
            [(kind, content)] = _elements(memoryview(zlib.decompress(content)), order)
        _require(kind == _MATRIX, f"variable of type {kind}")
        _check_matrix(content, order)


def _elements(data, order, *, padded=True):
    """Yield type and content of each element in turn."""
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


def _check_matrix(data, order):
    """Check an array: flags, then for most classes dimensions and name, then values."""
    if len(data) == 0:
        return
    (kind, flags), *parts = _elements(data, order)
    _require(kind == _UINT32 and len(flags) == 8, "array without flags")
    flags = struct.unpack_from(f"{order}I", flags)[0]
    matlab_class, is_complex = flags & 0xFF, bool(flags & 0x800)
    if matlab_class == _OPAQUE:
        _check_types(parts, [*[_INT8] * 3, _MATRIX])
        _check_matrix(parts[-1][1], order)
        return
    (dims_kind, dims), (name_kind, _), *parts = parts
    _require(dims_kind in (_INT32, _UINT32) and len(dims) % 4 == 0, "no dimensions")
    dims = struct.unpack(f"{order}{len(dims) // 4}i", dims)
    _require(2 <= len(dims) <= 32 and min(dims) >= 0, f"array of dimensions {dims}")
    _require(name_kind in (_INT8, *_TEXT), "no name")
    size = math.prod(dims)
    if matlab_class in _NUMERIC_CLASSES:
        _require(len(parts) == 1 + is_complex, "array without values")
        for kind, content in parts:
            _require(kind in _NUMBERS, f"values of type {kind}")
            _require(len(content) == size * _NUMBERS[kind], "values of another number")
    elif matlab_class == _CHAR:
        [(kind, content)] = parts
        _require(kind in _NUMBERS | _TEXT, f"text of type {kind}")
        width = (_NUMBERS | _TEXT)[kind]
        # A single blank may be left out.
        _require(size <= max(len(content) // width, 1), "text cut short")
    elif matlab_class == _SPARSE:
        _require(len(parts) == 3 + is_complex, "sparse array without values")
        _require(
            all(kind in _NUMBERS for kind, _ in parts), "sparse array of no numbers"
        )
    elif matlab_class in (_CELL, _STRUCT, _OBJECT, _FUNCTION):
        if matlab_class == _OBJECT:
            _check_types(parts[:1], [_INT8])
            parts = parts[1:]
        if matlab_class in (_STRUCT, _OBJECT):
            _check_types(parts[:2], [_INT32, _INT8])
            (_, width), (_, names), *parts = parts
            size *= len(names) // struct.unpack(f"{order}I", width)[0]
        if matlab_class == _FUNCTION:
            size = 1
        _check_types(parts, [_MATRIX] * len(parts))
        _require(len(parts) == size, "cells of another number")
        for _, content in parts:
            _check_matrix(content, order)
    else:
        raise ValueError(f"array of class {matlab_class}")


def _check_types(parts, expected):
    found = [kind for kind, _ in parts]
    _require(found == expected, f"elements of types {found}, not {expected}")


def _require(condition, problem):
    if not condition:
        raise ValueError(problem)
