"""Descriptions of a study's settings, by which one value is told from another.

A description is JSON. It is the same in every session and differs between different
values. Arrays and tables are described by a checksum of their content, objects by their
class and state, functions by the name under which they can be imported, or by their
code.
"""

import json
import os
import sys
from collections.abc import Mapping
from copyreg import dispatch_table
from dis import get_instructions
from functools import partial
from hashlib import sha256
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType

import numpy as np
from sklearn.base import BaseEstimator


def describe_setting(name, value):
    """Return the description of a value; say what is wrong if there is none.

    Parameters
    ----------
    name : str
        What error messages call the value.
    value : object

    Raises
    ------
    ValueError
        If the value holds something that cannot be recognised in another session, such
        as an open file.
    """
    try:
        return describe(value)
    except Exception as error:  # whatever the state of some object raises
        raise ValueError(
            f"{name} could not be recognised when the study goes on "
            f"({type(error).__name__}: {error}); give a function of a module, or a "
            "functools.partial of one, with arguments such as numbers, paths, arrays "
            "and tables."
        ) from error


def describe(value):
    """Return a description of a value that is JSON and the same in every session.

    Parameters
    ----------
    value : object
        A number, text, collection, array, table, estimator or function; or an object
        that can be pickled, whose class and state are described.

    Returns
    -------
    description : dict, list, str, int, float, bool or None

    Examples
    --------
    >>> from functools import partial
    >>> from sklearn_haptic.study._settings import describe
    >>> describe(partial(sorted, reverse=True))
    {'function': 'builtins.sorted', 'args': [], 'keywords': {'reverse': True}}
    >>> from sklearn.preprocessing import StandardScaler
    >>> describe(StandardScaler(copy=False))["with_std"]
    True
    """
    if isinstance(value, np.generic) and value.dtype.kind in "biufU":
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray):
        return _describe_array(value)
    if isinstance(value, os.PathLike):
        return describe(os.fspath(value))
    if isinstance(value, (bytes, bytearray, memoryview)):
        return {"bytes": sha256(value).hexdigest()}
    if isinstance(value, Mapping):
        return _describe_mapping(value)
    if isinstance(value, (list, tuple)):
        return [describe(item) for item in value]
    if isinstance(value, (set, frozenset)):
        return {"set": sorted(map(_to_text, value))}
    if _is_table(value):
        return _describe_table(value)
    if isinstance(value, BaseEstimator):
        return {"class": _name(type(value)), **describe(value.get_params(deep=False))}
    if isinstance(value, partial):
        return {
            "function": describe(value.func),
            "args": describe(value.args),
            "keywords": describe(value.keywords),
        }
    if isinstance(value, ModuleType):
        return value.__name__
    if isinstance(value, FunctionType):
        return _describe_function(value)
    if isinstance(value, type) or (
        isinstance(value, BuiltinFunctionType)
        and (value.__self__ is None or isinstance(value.__self__, ModuleType))
    ):
        return _name(value)
    return _describe_object(value)


def _to_text(value):
    return json.dumps(describe(value), sort_keys=True)


def _digest(value):
    """Checksum of a description."""
    return sha256(_to_text(value).encode("utf-8", "surrogatepass")).hexdigest()


def _name(value):
    return f"{value.__module__}.{value.__qualname__}"


def _describe_mapping(mapping):
    if all(isinstance(key, str) for key in mapping):
        return {str(key): describe(item) for key, item in mapping.items()}
    items = [[_to_text(key), _to_text(item)] for key, item in mapping.items()]
    return {"items": sorted(items)}


def _describe_array(array):
    """Describe an array by its data type, its shape and a checksum of its values."""
    if isinstance(array, np.ma.MaskedArray):
        array = np.ma.asarray(array)
        return {"masked": [describe(array.tolist()), str(array.dtype)]}
    if array.dtype.kind in "OT":  # objects, or text of any length
        checksum = _digest(array.ravel().tolist())
    elif array.dtype.hasobject:
        raise TypeError(f"an array of {array.dtype} has fields of objects")
    else:
        checksum = sha256(np.ascontiguousarray(array)).hexdigest()
    return {
        "dtype": "object" if array.dtype.kind == "O" else str(array.dtype),
        "shape": list(array.shape),
        "sha256": checksum,
    }


def _is_table(value):
    """Whether a value is a DataFrame, Series or Index of pandas or polars."""
    library = type(value).__module__.partition(".")[0]
    return library in ("pandas", "polars") and hasattr(value, "to_numpy")


def _describe_table(table):
    """Describe a table, a column or an index by its names, data types and values."""
    index = getattr(table, "index", None)
    content = [getattr(table, "name", None), None if callable(index) else index]
    if hasattr(table, "columns"):
        columns = table.items() if hasattr(table, "iloc") else table.to_dict().items()
        content.extend(map(list, columns))
    else:
        content.extend([getattr(table, "dtype", None), table.to_numpy()])
    return {"class": _name(type(table)), "sha256": _digest(content)}


def _describe_function(function):
    """Describe a function by its name or, if it has none of its own, by its code."""
    name = _name(function)
    if function.__module__ != "__main__" and _find(function) is function:
        return name
    variables = {
        key: function.__globals__[key]
        for key in _globals_of(function.__code__)
        if key in function.__globals__
    }
    content = [
        _code_of(function.__code__),
        function.__defaults__,
        function.__kwdefaults__,
        [cell.cell_contents for cell in function.__closure__ or ()],
        variables,
    ]
    return {"function": name, "sha256": _digest(content)}


def _find(function):
    """Return what its module has under the name of a function."""
    found = sys.modules.get(function.__module__)
    for name in function.__qualname__.split("."):
        found = getattr(found, name, None)
    return found


def _nested(code):
    """Code of functions within a function."""
    return [each for each in code.co_consts if isinstance(each, CodeType)]


def _globals_of(code):
    """Names of the global variables that a function reads."""
    names = {
        step.argval for step in get_instructions(code) if step.opname == "LOAD_GLOBAL"
    }
    return names.union(*map(_globals_of, _nested(code)))


def _code_of(code):
    """Return what a function does, wherever it is written."""
    constants = [each for each in code.co_consts if not isinstance(each, CodeType)]
    within = [_code_of(each) for each in _nested(code)]
    return [code.co_code, code.co_names, code.co_varnames, constants, within]


def _describe_object(value):
    """Describe an object by what a pickle of it would hold: its class and state."""
    reduce = dispatch_table.get(type(value))
    reduced = value.__reduce_ex__(4) if reduce is None else reduce(value)
    if isinstance(reduced, str):
        return f"{getattr(value, '__module__', type(value).__module__)}.{reduced}"
    make, args, *state = reduced
    # State, then items of a list and of a dict, which are iterators.
    state = state[:1] + [list(items or ()) for items in state[1:3]]
    return {"class": _name(type(value)), "sha256": _digest([make, args, state])}
