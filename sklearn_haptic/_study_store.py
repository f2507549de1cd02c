"""What a study keeps on disk: its settings, and units that are finished or not.

A unit of work is named by a tuple, its kind first, such as ``("models", "hold",
"rough", 0)``. It is kept in two files: ``models/hold_rough_0.csv``, a table, or
``.npz``, arrays; and ``models/hold_rough_0.json``, a record with the SHA-256 of the
first. The record is written last, and each file appears whole or not at all, so a
unit is finished if its record can be read and the checksum is right. Nothing read
from these files is executed.
"""

import io
import json
import os
from collections.abc import Mapping
from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

_SETTINGS = "study.json"
# Columns that stay text whatever they look like.
_NAMES = ("procedure", "adjective", "held_out", "trial")


def write_atomically(path, data):
    """Write a file so that it is there whole or, after a crash, as it was before.

    Parameters
    ----------
    path : Path
        Its folder must exist.
    data : bytes
    """
    unfinished = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    with open(unfinished, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(unfinished, path)


def describe(value):
    """Return a setting as JSON can hold it, the same in every session.

    Parameters
    ----------
    value : object
        A number, text, path, collection, estimator, function or
        `functools.partial`. Of a function the name is taken, of a partial the
        arguments too, and of other objects what `repr` gives.

    Returns
    -------
    description : dict, list, str, int, float, bool or None

    Examples
    --------
    >>> from functools import partial
    >>> from sklearn_haptic._study_store import describe
    >>> describe(partial(sorted, reverse=True))
    {'function': 'builtins.sorted', 'args': [], 'keywords': {'reverse': True}}
    >>> from sklearn_haptic import TemporalMaxPool
    >>> describe(TemporalMaxPool(cells=(2, 1)))
    {'class': 'TemporalMaxPool', 'cells': [2, 1], 'memory': None, 'split': 'balanced'}
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {str(key): describe(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [describe(item) for item in value]
    if isinstance(value, BaseEstimator):
        return {"class": type(value).__name__, **describe(value.get_params(deep=False))}
    if isinstance(value, partial):
        return {
            "function": describe(value.func),
            "args": describe(value.args),
            "keywords": describe(value.keywords),
        }
    if hasattr(value, "__qualname__"):
        return f"{value.__module__}.{value.__qualname__}"
    return repr(value)


def open_study(folder, settings):
    """Begin a study in a folder, or make sure that the one there is the same.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    settings : dict
        Everything that changes the results of a unit.

    Raises
    ------
    ValueError
        If the folder holds a study with other settings, or units without any.
    """
    settings = json.loads(json.dumps(describe(settings)))
    path = folder / _SETTINGS
    if path.exists():
        stored = read_settings(folder)
        for name, value in settings.items():
            if stored.get(name) != value:
                raise ValueError(
                    f"{folder} holds a study with {name}={stored.get(name)!r}, not "
                    f"{value!r}; give the same {name}, or another folder."
                )
        return
    if (folder / "trials").exists():
        raise ValueError(
            f"{folder} holds units of a study, but no {_SETTINGS} that says of which; "
            "restore that file, or give another folder."
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(path, _to_json(settings))
    except OSError as error:
        raise OSError(
            f"{folder} is no folder that can be written; give another ({error})."
        ) from error


def read_settings(folder):
    """Read the settings of the study in a folder.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    settings : dict

    Raises
    ------
    ValueError
        If there is no study, or its settings are damaged.
    """
    path = folder / _SETTINGS
    try:
        settings = json.loads(path.read_bytes())
        if not isinstance(settings, dict):
            raise ValueError("it holds no settings")
        return settings
    except FileNotFoundError as error:
        raise ValueError(
            f"{folder} holds no study: {_SETTINGS} is missing; run_study makes one."
        ) from error
    except (ValueError, RecursionError) as error:
        raise ValueError(
            f"{path} is damaged ({error}); restore it, or run the study in another "
            "folder."
        ) from error


def write_unit(folder, unit, content, **record):
    """Write a finished unit.

    Parameters
    ----------
    folder : Path
    unit : tuple
        Name of the unit, its kind first.
    content : DataFrame or dict of str to ndarray
        A table is kept as CSV, arrays as .npz.
    **record : JSON values
        What else to remember.
    """
    suffix, data = _to_bytes(content)
    path = _path(folder, unit)
    path.parent.mkdir(exist_ok=True)
    record = {"unit": unit, "file": path.name + suffix} | record
    write_atomically(path.with_name(record["file"]), data)
    record["sha256"] = sha256(data).hexdigest()
    write_atomically(path.with_name(f"{path.name}.json"), _to_json(record))


def read_unit(folder, unit):
    """Read a unit.

    Parameters
    ----------
    folder : Path
    unit : tuple
        Name of the unit, its kind first.

    Returns
    -------
    content : DataFrame or dict of str to ndarray
    record : dict

    Raises
    ------
    ValueError
        If the unit is not finished.
    """
    path = _path(folder, unit)
    return _read(path.with_name(f"{path.name}.json"))


def read_record(folder, unit):
    """Return the record of a unit, None if the unit is not finished."""
    path = _path(folder, unit)
    intact = _read_intact(path.with_name(f"{path.name}.json"))
    return None if intact is None else intact[0]


def read_finished(folder, kind):
    """Read every unit of a kind, ordered by name.

    Parameters
    ----------
    folder : Path
    kind : str

    Returns
    -------
    units : list of (content, record)

    Raises
    ------
    ValueError
        If a unit that was finished is damaged.
    """
    units = [_read(path) for path in (folder / kind).glob("*.json")]
    return sorted(units, key=lambda unit: unit[1]["unit"])


def _path(folder, unit):
    """Return the path of a unit's files without suffix."""
    kind, *rest = unit
    name = "_".join(map(str, rest))
    if Path(name).name != name:
        raise ValueError(
            f"The unit {unit} cannot name a file; give names without slashes."
        )
    return folder / kind / name


def _read(path):
    intact = _read_intact(path)
    if intact is None:
        raise ValueError(
            f"The unit of {path} is missing or damaged; run_study with its settings, "
            "procedure and adjective does it again."
        )
    record, data = intact
    try:
        return _from_bytes(Path(record["file"]).suffix, data), record
    except Exception as error:  # NumPy, zipfile and pandas raise a dozen types
        raise ValueError(
            f"{path.with_suffix('')}.* holds neither a table nor arrays of "
            f"numbers ({error}); delete it, and run_study does the unit again."
        ) from error


def _read_intact(path):
    """Return a unit's record and the bytes of its content, None if it has to be done.

    Whatever the record says, only the unit's own file is read.

    Parameters
    ----------
    path : Path
        The record.
    """
    try:
        record = json.loads(path.read_bytes())
        own = _path(path.parents[1], record["unit"])
        data = path.with_suffix(Path(record["file"]).suffix).read_bytes()
        same = sha256(data).hexdigest() == record["sha256"]
    except (FileNotFoundError, ValueError, TypeError, KeyError, RecursionError):
        return None
    return (record, data) if same and own == path.with_suffix("") else None


def _to_json(value):
    return json.dumps(value, indent=1).encode()


def _to_bytes(content):
    """Return the suffix and the bytes of the file that holds a table or arrays."""
    buffer = io.BytesIO()
    if isinstance(content, dict):
        np.savez(buffer, allow_pickle=False, **content)
        return ".npz", buffer.getvalue()
    content.to_csv(buffer, index=False, lineterminator="\n")
    return ".csv", buffer.getvalue()


def _from_bytes(suffix, data):
    """Return the table or arrays, equal to those written in every bit."""
    buffer = io.BytesIO(data)
    if suffix == ".npz":
        with np.load(buffer, allow_pickle=False) as arrays:
            return dict(arrays)
    # Parsed here, as pandas itself may err in the last digit of a number.
    table = pd.read_csv(buffer, dtype=str, keep_default_na=False)
    for name in table.columns.difference(_NAMES, sort=False):
        table[name] = _parse(np.asarray(table[name], dtype=object))
    return table


def _parse(texts):
    """Return texts as whole numbers, or as numbers, or as they are."""
    for kind in (np.int64, np.float64):
        try:
            return texts.astype(kind)
        except ValueError:
            continue
    return texts
