"""Reading HDF5 files with care: nothing outside the file, nothing but plain data.

An HDF5 file can point at other files (external links, external storage, virtual
datasets) and hold types that stand for objects. Neither has a place in a corpus of
recordings, so both are refused, and every failure says where it happened.
"""

from contextlib import contextmanager
from pathlib import Path


@contextmanager
def open_hdf5(path):
    """Open an HDF5 file for reading; it is closed whatever happens.

    Raises
    ------
    ImportError
        If h5py is not installed.
    FileNotFoundError
        If there is no file.
    OSError
        If the file is not HDF5, is cut short or is damaged.
    """
    try:
        import h5py
    except ImportError as error:
        raise ImportError(
            f"Reading {path} requires h5py; install it with `pip install h5py`."
        ) from error
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"There is no file {path}; give the path of one.")
    with open(path, "rb"):  # a folder or a lack of permission has its own clear error
        pass
    if not h5py.is_hdf5(path):
        raise OSError(f"{path} is not an HDF5 file; give one, or download it again.")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise _damaged(path, error) from error
    with file:
        yield file


def names_in(group):
    """Return the names of a group's children, none of which is opened."""
    with _reading(group):
        names = list(group)
        if not all(isinstance(name, str) for name in names):
            raise ValueError("a name is not text")
    return names


def read_attribute(node, name):
    """Return an attribute of a group or dataset, None if it has none of the name."""
    with _reading(node):
        return node.attrs.get(name)


def get_node(group, path):
    """Return the group or dataset at ``path`` below a group.

    Raises
    ------
    ValueError
        If it is not there or is reached through a soft or external link.
    """
    from h5py import Group, h5l

    node = group
    for name in path.split("/"):
        if not isinstance(node, Group):
            raise ValueError(f"{_place(node)} is not a group, so it has no {name!r}.")
        with _reading(node, name):
            exists = node.id.links.exists(name.encode())
            link = node.id.links.get_info(name.encode()).type if exists else None
        if not exists:
            raise ValueError(
                f"{_place(node)} has no {name!r}; it has {names_in(node)}."
            )
        if link != h5l.TYPE_HARD:
            raise ValueError(
                f"{name!r} in {_place(node)} is a soft or external link, which is not "
                "followed; copy what it points at into the file."
            )
        with _reading(node, name):
            node = node[name]
    return node


def dtype_of(node):
    """Return the type of a dataset's values; nothing else has one."""
    from h5py import Dataset

    if not isinstance(node, Dataset):
        raise ValueError(f"{_place(node)} is not a dataset.")
    with _reading(node):
        return node.dtype


def check_stored(node, dtype_kinds):
    """Refuse all but a dataset whose values are in its file and of some kind.

    Parameters
    ----------
    node : h5py.Dataset
        What is about to be read.
    dtype_kinds : str
        The NumPy kind codes that are accepted, ``"iuf"`` for real numbers.

    Raises
    ------
    ValueError
        If it is no dataset, or its values are in another file or of another kind.
    """
    from h5py import h5d

    dtype = dtype_of(node)
    if dtype.kind not in dtype_kinds:
        wanted = {"S": "byte strings", "O": "references"}.get(dtype_kinds, "numbers")
        raise ValueError(f"{_place(node)} has dtype {dtype}; it must hold {wanted}.")
    with _reading(node):
        creation = node.id.get_create_plist()
    if creation.get_layout() == h5d.VIRTUAL or creation.get_external_count():
        raise ValueError(
            f"{_place(node)} keeps its values in another file, which is not read; "
            "copy them into this one."
        )


def read_rows(dataset, rows=slice(None)):
    """Return some rows of a dataset as an array."""
    with _reading(dataset):
        return dataset[rows]


def read_references(dataset):
    """Return what an array of references points at, in its order."""
    import h5py

    check_stored(dataset, "O")
    if h5py.check_ref_dtype(dataset.dtype) is not h5py.Reference:
        raise ValueError(f"{_place(dataset)} must hold references.")
    with _reading(dataset):
        return [dataset.file[reference] for reference in dataset[:].flat]


def _place(node):
    return f"{node.name} of {node.file.filename}"


@contextmanager
def _reading(node, child=None):
    try:
        yield
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        place = _place(node) if child is None else f"{child!r} in {_place(node)}"
        raise _damaged(place, error) from error


def _damaged(place, error):
    return OSError(
        f"{place} cannot be read: the file is cut short or damaged ({error}); "
        "download it again."
    )
