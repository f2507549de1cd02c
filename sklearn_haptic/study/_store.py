"""The files of a study: its settings and its units.

A unit of work is named by a tuple, its kind first, such as ``("models", "hold",
"rough", 0)``. It is kept in two files: ``models/hold_rough_0.csv``, a table, or
``.npz``, arrays; and ``models/hold_rough_0.json``, a record with the SHA-256 of the
first. The record is written last, and each file appears whole or not at all. A unit is
therefore finished if its record can be read and the checksum is right. Nothing that is
read from these files is executed, and links count as damaged files.
"""

import io
import json
import os
import re
import stat
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from uuid import uuid4

import numpy as np
import pandas as pd

from ._settings import describe_setting

_SETTINGS = "study.json"


# Control characters, which end lines and names of files, and halves of characters.
_UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\ud800-\udfff]")


# Data types of the columns of a table that are not text.
_NUMBERS = re.compile(r"u?int(8|16|32|64)|float(16|32|64)")


# Bytes that most file systems allow in a name, less a suffix.
_LONGEST_NAME = 250


def write_atomically(path, data, *, replace=True):
    """Write a file so that it is there whole or, after a crash, as it was before.

    Parameters
    ----------
    path : Path
        Its folder must exist.
    data : bytes
    replace : bool, default=True
        Whether to replace a file of this name. If not, a file of this name stays as it
        is, even if it appears in the meantime.

    Raises
    ------
    OSError
        If the file cannot be written; the error has the name of the file.
    """
    unfinished = path.with_name(f"{uuid4().hex}.tmp")
    try:
        with open(unfinished, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if replace:
            os.replace(unfinished, path)
        else:
            _link(unfinished, path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error
    finally:
        with suppress(OSError):
            unfinished.unlink()


def _link(source, path):
    """Give a file a second name, unless there is a file of that name."""
    try:
        os.link(source, path)
    except FileExistsError:
        pass
    except OSError:  # a file system without hard links
        with suppress(FileExistsError), open(path, "xb") as file:
            file.write(source.read_bytes())


def check_text(text, what):
    """Refuse text that a table cannot hold: control and unpaired surrogate characters.

    Parameters
    ----------
    text : str
    what : str
        What error messages call it.
    """
    if _UNPRINTABLE.search(text):
        raise ValueError(
            f"{what} {text!r} has a control character; give names without."
        )


def open_study(folder, settings):
    """Begin a study in a folder, or check that the study there has the same settings.

    Parameters
    ----------
    folder : Path
        It is made if it does not exist.
    settings : dict
        Everything that changes the results of a unit.

    Raises
    ------
    ValueError
        If the folder holds a study with other settings, or units without settings.
    """
    settings = {name: describe_setting(name, value) for name, value in settings.items()}
    path = folder / _SETTINGS
    has_units = (folder / "trials").exists()  # written after the settings
    if not path.exists():
        if has_units:
            raise ValueError(
                f"{folder} holds units of a study, but no {_SETTINGS} that says of "
                "which; restore that file, or give another folder."
            )
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_atomically(path, _to_json(settings), replace=False)
        except OSError as error:
            raise OSError(
                f"{folder} is no folder that can be written; give another ({error})."
            ) from error
    # Another process may have written its settings first.
    stored = read_settings(folder)
    for name, value in settings.items():
        if _to_json(stored.get(name)) != _to_json(value):
            raise ValueError(
                f"{folder} holds a study with {name}={stored.get(name)!r}, not "
                f"{value!r}; give the same {name}, or another folder."
            )


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
        settings = json.loads(_read_own(path))
        if not isinstance(settings, dict):
            raise ValueError("it holds no settings")
        if not isinstance(settings.get("procedures", []), list):
            raise ValueError("its procedures are no list")
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
        Further content of the record.
    """
    suffix, columns, data = _to_bytes(content)
    path = unit_path(folder, unit)
    path.parent.mkdir(exist_ok=True)
    record = {"unit": unit, "file": path.name + suffix, "columns": columns} | record
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
    path = unit_path(folder, unit)
    return _read(path.with_name(f"{path.name}.json"))


def read_record(folder, unit):
    """Return the record of a unit, None if the unit is not finished."""
    path = unit_path(folder, unit)
    intact = _read_intact(path.with_name(f"{path.name}.json"))
    return None if intact is None else intact[0]


def read_finished(folder, kind, pattern):
    """Read every unit of a kind, ordered by name.

    Parameters
    ----------
    folder : Path
    kind : str
    pattern : str
        Regular expression that names of units match; other files are ignored.

    Returns
    -------
    units : list of (content, record)

    Raises
    ------
    ValueError
        If a finished unit is damaged.
    """
    records = (folder / kind).glob("*.json")
    units = [_read(path) for path in records if re.fullmatch(pattern, path.stem)]
    return sorted(units, key=lambda unit: unit[1]["unit"])


def unit_path(folder, unit):
    """Return the path of a unit's files, without suffix.

    Raises
    ------
    ValueError
        If the name of the unit cannot be the name of a file.
    """
    kind, *rest = unit
    name = "_".join(map(str, rest))
    check_text(name, f"The name of the unit {unit},")
    if Path(name).name != name or len(os.fsencode(name)) > _LONGEST_NAME:
        raise ValueError(
            f"The unit {unit} cannot name a file; give names without slashes, of at "
            f"most {_LONGEST_NAME} bytes together."
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
        return _from_bytes(record, data), record
    except Exception as error:  # NumPy, zipfile and pandas raise a dozen types
        raise ValueError(
            f"{path.with_suffix('')}.* holds neither a table nor arrays of "
            f"numbers ({error}); delete it, and run_study does the unit again."
        ) from error


def _read_intact(path):
    """Return a unit's record and the bytes of its content, None if it is not finished.

    Whatever the record says, only the unit's own file is read.

    Parameters
    ----------
    path : Path
        The record.
    """
    try:
        record = json.loads(_read_own(path))
        own = unit_path(path.parents[1], record["unit"])
        data = _read_own(path.with_suffix(Path(record["file"]).suffix))
        same = sha256(data).hexdigest() == record["sha256"] and "columns" in record
    except (FileNotFoundError, ValueError, TypeError, KeyError, RecursionError):
        return None
    return (record, data) if same and own == path.with_suffix("") else None


def _read_own(path):
    """Return the bytes of a file that is neither a link nor a device."""
    if not stat.S_ISREG(path.lstat().st_mode):
        raise ValueError("it is no file of its own")
    return path.read_bytes()


def _to_json(value):
    return json.dumps(value, indent=1, sort_keys=True).encode()


def _to_bytes(content):
    """Return the suffix, the data types of columns and the bytes of a unit's file.

    The record keeps the data types of a table, because CSV has none.
    """
    buffer = io.BytesIO()
    if isinstance(content, dict):
        np.savez(buffer, allow_pickle=False, **content)
        return ".npz", None, buffer.getvalue()
    columns = {name: _type_of(name, column) for name, column in content.items()}
    content.to_csv(buffer, index=False, lineterminator="\n")
    return ".csv", columns, buffer.getvalue()


def _type_of(name, column):
    """Return "text", or the name of the data type of a column of numbers."""
    values = column.to_numpy()
    if _NUMBERS.fullmatch(values.dtype.name):
        return values.dtype.name
    for value in values:
        if not isinstance(value, str):
            raise ValueError(
                f"The column {name!r} has the value {value!r} among others; give "
                "numbers only, or text only."
            )
        check_text(value, f"The column {name!r} has the value")
    return "text"


def _from_bytes(record, data):
    """Return the table or the arrays, equal to the written ones in every bit."""
    buffer = io.BytesIO(data)
    if record["file"].endswith(".npz"):
        with np.load(buffer, allow_pickle=False) as arrays:
            return dict(arrays)
    # Older versions of pandas may err in the last digit of a number, and newer ones
    # deprecate `float_precision`, so numbers are parsed below.
    table = pd.read_csv(buffer, dtype=str, keep_default_na=False)
    for name in table:
        kind = record["columns"][name]
        if kind == "text":
            continue
        if not _NUMBERS.fullmatch(kind):
            raise ValueError(f"{kind!r} is no data type of numbers")
        table[name] = np.asarray(table[name], dtype=object).astype(kind)
    return table
