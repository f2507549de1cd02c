"""Safe reading of HDF5 files: plain data only, and nothing outside the file.

An HDF5 file can point at other files (external links, external storage, virtual
datasets), hold types that stand for objects, and declare far more values than it has
bytes. None of this belongs in a corpus of recordings, so it is refused before anything
is read. Every error says where it happened.
"""

import math
import os
import zlib
from contextlib import contextmanager
from pathlib import Path

# Most bytes of values per byte of a file. Recordings stored as int64 and compressed by
# gzip reach 13, temperature alone 70. Values that compress better are read only up to
# SMALL bytes.
_LARGEST_RATIO = 100
SMALL = 2**28
# The most that the deflate algorithm can reach.
_LARGEST_DEFLATE_RATIO = 1032


def read_start(path, n_bytes):
    """Return the first bytes of a file, or all for -1; errors name the file."""
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"There is no file {path}; give the path of one.")
    try:
        with open(path, "rb") as file:
            return file.read(n_bytes)
    except OSError as error:
        error.filename = str(path)  # missing if the disk fails
        raise


@contextmanager
def open_hdf5(path):
    """Open an HDF5 file for reading, and close it in any case.

    An ImportError is raised if h5py is not installed, a FileNotFoundError if there is
    no file, and an OSError if it is not HDF5, cut short, damaged or being written.
    """
    try:
        import h5py
    except ImportError as error:
        raise ImportError(
            f"Reading {path} requires h5py; install it with `pip install h5py`."
        ) from error
    read_start(path, 1)  # for its clear errors
    if not h5py.is_hdf5(path):
        raise OSError(f"{path} is not an HDF5 file; give one, or download it again.")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise _unreadable(path, error) from error
    with file:
        try:
            yield file
        except MemoryError as error:
            raise _unreadable(path, error) from error


def names_in(group):
    """Return the names of a group's children without opening them."""
    with _reading(group):
        names = list(group)
        if not all(isinstance(name, str) for name in names):
            raise ValueError("a name is not text")
    return names


def read_attribute(node, name):
    """Return a scalar attribute of a group or dataset, or None if there is none.

    If the attribute is an array, a ValueError is raised.
    """
    with _reading(node):
        if name not in node.attrs:
            return None
        shape = node.attrs.get_id(name).shape
    if shape != ():
        raise ValueError(
            f"The attribute {name} of {place_of(node)} has shape {shape}; it must hold "
            "one value."
        )
    with _reading(node):
        return node.attrs[name]


def get_node(group, path):
    """Return the group or dataset at ``path`` below a group.

    If it is not there, or is reached through a soft or external link, a ValueError is
    raised.
    """
    from h5py import Group, h5l

    node = group
    for name in path.split("/"):
        if not isinstance(node, Group):
            raise ValueError(f"{place_of(node)} is not a group, so it has no {name!r}.")
        with _reading(node, name):
            exists = node.id.links.exists(name.encode())
            link = node.id.links.get_info(name.encode()).type if exists else None
        if not exists:
            raise ValueError(
                f"{place_of(node)} has no {name!r}; it has {names_in(node)}."
            )
        if link != h5l.TYPE_HARD:
            raise ValueError(
                f"{name!r} in {place_of(node)} is a soft or external link, which is "
                "not followed; copy what it points at into the file."
            )
        with _reading(node, name):
            node = node[name]
    return node


def dtype_of(node):
    """Return the data type of a dataset; refuse any other node."""
    from h5py import Dataset

    if not isinstance(node, Dataset):
        raise ValueError(f"{place_of(node)} is not a dataset.")
    with _reading(node):
        return node.dtype


def check_stored(node, dtype_kinds):
    """Check that a node is a dataset, with values of given kinds in its own file.

    `dtype_kinds` are NumPy's kind codes that are accepted, ``"iuf"`` for real numbers.
    A ValueError is raised if it is no dataset, or its values are in another file or of
    another kind; an OSError if the file does not store as many values as it declares.
    """
    from h5py import h5d

    dtype = dtype_of(node)
    if dtype.kind not in dtype_kinds:
        wanted = {"S": "byte strings", "O": "references"}.get(dtype_kinds, "numbers")
        raise ValueError(f"{place_of(node)} has dtype {dtype}; it must hold {wanted}.")
    with _reading(node):
        creation, shape = node.id.get_create_plist(), node.shape or ()
        stored, size = node.id.get_storage_size(), node.id.get_type().get_size()
        is_whole = stored >= math.prod(shape) * size
    if creation.get_layout() == h5d.VIRTUAL or creation.get_external_count():
        raise ValueError(
            f"{place_of(node)} keeps its values in another file, which is not read; "
            "copy them into this one."
        )
    if creation.get_layout() == h5d.CHUNKED:
        chunk = creation.get_chunk()
        with _reading(node):
            n_chunks = node.id.get_num_chunks()
        is_whole = n_chunks >= math.prod(-(-n // m) for n, m in zip(shape, chunk))
        check_expansion(node, math.prod(chunk) * size)
        if creation.get_nfilters() and stored * _LARGEST_DEFLATE_RATIO > SMALL:
            _check_chunks(node, math.prod(chunk) * size)
    if not is_whole:
        raise OSError(
            f"{place_of(node)} declares shape {shape}, but the file does not hold as "
            "many values: it was not written to its end, or is damaged. Write them, or "
            "download the file again."
        )


def _check_chunks(dataset, size):
    """Refuse chunks larger than ``size``, for which HDF5 would allocate memory."""
    with _reading(dataset):
        chunks = []
        dataset.id.chunk_iter(chunks.append)
        for chunk in chunks:
            if chunk.size * _LARGEST_DEFLATE_RATIO > SMALL:
                _, data = dataset.id.read_direct_chunk(chunk.chunk_offset)
                checksums = 64  # more than they take
                if len(_inflate(data, size + checksums)) > size + checksums:
                    raise ValueError("a chunk holds more than its values")


def _inflate(data, limit):
    """Decompress to one byte beyond a limit at most; nothing if it is no stream."""
    try:
        return zlib.decompressobj().decompress(data, limit + 1)
    except zlib.error:
        return b""


def largest_expansion(path, small=SMALL):
    """Return how many bytes of values may be read from a file."""
    return max(small, _LARGEST_RATIO * os.path.getsize(path))


def check_expansion(node, n_bytes, small=SMALL):
    """Refuse to read far more bytes than the file of a node can plausibly hold.

    If they exceed `largest_expansion` of the file, an OSError is raised.
    """
    if n_bytes <= small:
        return
    path = node.file.filename
    if n_bytes > largest_expansion(path, small):
        raise OSError(
            f"{place_of(node)} cannot be read: {n_bytes / 2**20:.0f} MiB of values "
            f"would come of a file of {os.path.getsize(path)} bytes. If they are what "
            "was recorded, store them without compression."
        )


def read_rows(dataset, rows=slice(None)):
    """Return some rows of a dataset as an array, after a check of their size."""
    with _reading(dataset):
        n_rows = len(range(*rows.indices(len(dataset))))
        n_values = n_rows * math.prod(dataset.shape[1:])
    check_expansion(dataset, n_values * dtype_of(dataset).itemsize)
    with _reading(dataset):
        return dataset[rows]


def read_references(dataset):
    """Return the nodes that an array of references points at, in its order."""
    import h5py

    check_stored(dataset, "O")
    if h5py.check_ref_dtype(dataset.dtype) is not h5py.Reference:
        raise ValueError(f"{place_of(dataset)} must hold references.")
    with _reading(dataset):
        return [dataset.file[reference] for reference in dataset[:].flat]


def place_of(node):
    return f"{node.name} of {node.file.filename}"


@contextmanager
def _reading(node, child=None):
    try:
        yield
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        place = place_of(node) if child is None else f"{child!r} in {place_of(node)}"
        raise _unreadable(place, error) from error


def _unreadable(place, error):
    """Return an error that says why something cannot be read, and the remedy."""
    if isinstance(error, MemoryError):
        reason = "it takes more memory than there is; ask for fewer trials or sensors."
    elif isinstance(error, BlockingIOError) or "open for write" in str(error):
        reason = (
            "another process has the file open for writing; wait until it has closed "
            "it. If there is none, one was stopped: mend the file by `h5clear -s`."
        )
    elif getattr(error, "errno", None):
        return OSError(error.errno, f"{place} cannot be read: {error.strerror}")
    else:
        reason = f"the file is cut short or damaged ({error}); download it again."
    return OSError(f"{place} cannot be read: {reason}")
