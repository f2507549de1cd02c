"""Safe reading of HDF5 files: plain data only, and nothing outside the file.

An HDF5 file can point at other files (external links, external storage, virtual
datasets), hold types that stand for objects, and declare far more values than it has
bytes. None of this belongs in a corpus of recordings, so it is refused before anything
is read. Every error says where it happened.
"""

import math
import os
from contextlib import contextmanager
from pathlib import Path

# A dataset may declare so many bytes of any file, and so many per byte of a larger one.
# Recordings stored as int64 and compressed by gzip reach 13, temperature alone 70.
_SMALL = 2**28
_LARGEST_RATIO = 100


def check_file(path):
    """Refuse a path that is not one of a file."""
    if not Path(path).is_file():
        raise FileNotFoundError(f"There is no file {path}; give the path of one.")


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
    check_file(path)
    with _reading(path):
        file = h5py.File(path, "r")
    with file:
        yield file


def names_in(group):
    """Return the names of a group's children without opening them."""
    with _reading(place_of(group)):
        return [str(name) for name in group]


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
        with _reading(f"{name!r} in {place_of(node)}"):
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
        with _reading(f"{name!r} in {place_of(node)}"):
            node = node[name]
    return node


def check_stored(node, kinds):
    """Check that a node is a dataset whose values are all in its own file.

    `kinds` are the kind codes of NumPy that are accepted, ``"iuf"`` for real numbers.
    A ValueError is raised if it is no dataset, or its values are in another file or of
    another kind; an OSError if it declares more values than the file holds.
    """
    from h5py import Dataset, h5d

    if not isinstance(node, Dataset):
        raise ValueError(f"{place_of(node)} is not a dataset.")
    with _reading(place_of(node)):
        dtype, shape, chunk = node.dtype, node.shape or (), node.chunks
        settings = node.id.get_create_plist()
        if chunk is None:
            n_bytes = math.prod(shape) * dtype.itemsize
            is_whole = node.id.get_storage_size() >= n_bytes
        else:
            n_chunks = math.prod(-(-n // m) for n, m in zip(shape, chunk))
            n_bytes = max(n_chunks, 1) * math.prod(chunk) * dtype.itemsize
            is_whole = node.id.get_num_chunks() >= n_chunks
    if dtype.kind not in kinds:
        wanted = "byte strings" if kinds == "S" else "numbers"
        raise ValueError(f"{place_of(node)} has dtype {dtype}; it must hold {wanted}.")
    if settings.get_layout() == h5d.VIRTUAL or settings.get_external_count():
        raise ValueError(
            f"{place_of(node)} keeps its values in another file, which is not read; "
            "copy them into this one."
        )
    largest = max(_SMALL, _LARGEST_RATIO * os.path.getsize(node.file.filename))
    if not is_whole or n_bytes > largest:
        raise OSError(
            f"{place_of(node)} declares shape {shape}, {n_bytes / 2**20:.3g} MiB, but "
            "the file does not hold as many values; write all of them, without "
            "compression if they are that much alike, or download the file again."
        )


def read_rows(dataset, rows=()):
    """Return some rows, by default all, of a dataset that was checked as an array."""
    with _reading(place_of(dataset)):
        return dataset[rows]


def place_of(node):
    """Return what error messages call a group or dataset."""
    return f"{node.name} of {node.file.filename}"


@contextmanager
def _reading(place):
    try:
        yield
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        raise OSError(
            f"{place} cannot be read ({error}); close the file where it is written, or "
            "download it again if it is no HDF5, cut short or damaged."
        ) from error
