"""The files of a study: its settings and its units.

A unit of work is named by a tuple, its kind first, such as ``("models", "hold",
"rough", 0)``. It is kept in one file, here ``models/hold,rough,0.npz``: arrays, or the
columns of a table, and a record in JSON. A file gets its name when it is whole, so a
unit is finished if its file exists. Nothing that is read from these files is executed.
"""

import json
import os
from contextlib import contextmanager, suppress
from io import BytesIO
from urllib.parse import quote
from uuid import uuid4

import joblib
import numpy as np
import pandas as pd

_SETTINGS = "study.json"


def write_atomically(path, data, *, replace=True):
    """Write a file so that it is there whole or, after a crash, as it was before.

    Unless `replace` is true, a file of this name stays as it is, even if it appears in
    the meantime. If the file cannot be written, an OSError names it.
    """
    unfinished = path.with_name(f"{uuid4().hex}.tmp")
    try:
        with open(unfinished, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if replace:
            os.replace(unfinished, path)
            return
        try:
            os.link(unfinished, path)
        except OSError:  # there is a file, or the file system has no hard links
            if not path.exists():
                os.replace(unfinished, path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error
    finally:
        with suppress(OSError):
            unfinished.unlink()


def open_study(folder, settings):
    """Begin a study in a folder, or check that the study there has the same settings.

    Parameters
    ----------
    folder : Path
        It is made if it does not exist.
    settings : dict
        Everything that changes the results of a unit. What is not JSON is kept as a
        hash of its pickle.

    Raises
    ------
    ValueError
        If the folder holds a study with other settings, or units without settings, or
        a setting cannot be pickled.
    """
    try:
        data = json.dumps(settings, default=joblib.hash, indent=1)
    except Exception as error:  # whatever pickling some object raises
        raise ValueError(
            "A setting cannot be pickled, so the study could not recognise it when it "
            f"goes on ({error}); as corpus give recordings, or a function of a module, "
            "perhaps in a functools.partial."
        ) from error
    path = folder / _SETTINGS
    if not path.exists():
        if (folder / "trials").exists():  # written after the settings
            raise ValueError(
                f"{folder} holds units of a study, but no {_SETTINGS} that says of "
                "which; restore that file, or give another folder."
            )
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_atomically(path, data.encode(), replace=False)
        except OSError as error:
            raise OSError(
                f"{folder} is no folder that can be written; give another ({error})."
            ) from error
    # Another process may have written its settings first.
    stored = read_settings(folder)
    for name, value in json.loads(data).items():
        if stored.get(name) != value:
            raise ValueError(
                f"{folder} holds a study with {name}={stored.get(name)!r}, not "
                f"{value!r}; give the same {name}, or another folder."
            )


def read_settings(folder):
    """Return the settings of the study in a folder, a dict.

    Raises
    ------
    ValueError
        If there is no study, or its settings are damaged.
    """
    path = folder / _SETTINGS
    try:
        return {"procedures": [], **json.loads(path.read_bytes())}
    except FileNotFoundError as error:
        raise ValueError(
            f"{folder} holds no study: {_SETTINGS} is missing; run_study makes one."
        ) from error
    except (OSError, ValueError, TypeError, RecursionError) as error:
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
    content : DataFrame or dict of str to array-like
        Columns of numbers or of text, or arrays of numbers.
    **record : JSON values
        What else is known of the unit.
    """
    buffer, arrays = BytesIO(), {}
    for name, values in content.items():
        array = np.asarray(values)
        arrays[name] = np.array(array.tolist()) if array.dtype.hasobject else array
    record = np.array(json.dumps(record))
    np.savez(buffer, allow_pickle=False, **arrays, record=record)
    path = unit_path(folder, unit)
    path.parent.mkdir(exist_ok=True)
    write_atomically(path, buffer.getvalue())


def read_unit(folder, unit):
    """Return the arrays of a unit by their names, and its record.

    Raises
    ------
    ValueError
        If the unit is not finished, or its file is damaged.
    """
    with _opened(folder, unit) as file:
        content = dict(file)
        return content, json.loads(content.pop("record").item())


def read_table(folder, unit):
    """Return the table of a unit, and its record."""
    content, record = read_unit(folder, unit)
    return pd.DataFrame(content), record


def read_record(folder, unit):
    """Return the record of a unit, None if the unit is not finished."""
    if not unit_path(folder, unit).exists():
        return None
    with _opened(folder, unit) as file:
        return json.loads(file["record"].item())


@contextmanager
def _opened(folder, unit):
    """Open the file of a unit; what goes wrong with it names it."""
    path = unit_path(folder, unit)
    try:
        with open(path, "rb") as raw, np.load(raw, allow_pickle=False) as file:
            yield file
    except Exception as error:  # NumPy and zipfile raise a dozen types
        raise ValueError(
            f"{path} is missing or damaged ({error}); delete it, and run_study does "
            "this unit again."
        ) from error


def unit_path(folder, unit):
    """Return the path of a unit's file, one of its own whatever names the unit has."""
    kind, *names = unit
    name = ",".join(quote(str(each), safe=" ") for each in names)
    return folder / kind / f"{name}.npz"
