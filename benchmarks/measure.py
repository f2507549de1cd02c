"""What the benchmarks share: times, memory, scores, errors, tables, and the machine."""

import argparse
import os
import platform
import sys
import time
import tracemalloc
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from sklearn_haptic.metrics import (
    earth_movers_distance,
    log_score,
    macro_mae,
    ranked_probability_score,
)

SCORES = {
    "RPS": ranked_probability_score,
    "EMD": earth_movers_distance,
    "MAE^M": macro_mae,
    "log score": log_score,
}


def command(doc, *, folder=False, one_thread=True):
    """Return a parser whose help is the docstring of a script.

    The tables are for one thread, so the variables that grant BLAS more are refused.
    """
    asks_for_help = {"-h", "--help"} & set(sys.argv)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        if one_thread and not asks_for_help and os.environ.get(name, "1") != "1":
            sys.exit(f"Set {name}=1: the tables are for one thread.")
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    if folder:
        parser.add_argument(
            "folder", type=Path, help="folder of the data sets, as data.py names them"
        )
    return parser


def machine(*packages):
    """Print the processor, the date and the versions of packages."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":")[1].strip() for line in lines if "model name" in line]
    said = [*names[:1], f"Python {platform.python_version()}"]
    for name in ("sklearn_haptic", "numpy", "scipy", "scikit-learn", *packages):
        try:
            said.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            said.append(f"no {name}")
    print(f"{', '.join(said)}; {date.today()}\n", flush=True)


# Time and memory ----------------------------------------------------------------------


def timed(function, *arguments, **keywords):
    """Return the processor time of a call in seconds, and its result."""
    start = time.process_time()
    result = function(*arguments, **keywords)
    return time.process_time() - start, result


def in_turn(functions, n_rounds=1, clock=time.process_time):
    """Return seconds of shape (n_rounds, n_functions); functions take turns.

    What else the machine does meets all of them then.
    """
    seconds = np.empty((n_rounds, len(functions)))
    for of_round in seconds:
        for i, function in enumerate(functions):
            start = clock()
            function()
            of_round[i] = clock() - start
    return seconds


def peak_mb(function):
    """Return the peak of what Python and NumPy allocate during a call."""
    tracemalloc.start()
    function()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def unit_rows(rows):
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


# Scores and errors --------------------------------------------------------------------


def of_groups(values, groups):
    """Return the mean of the rows of each group, in the order of their names."""
    names, which = np.unique(groups, return_inverse=True)
    values = np.asarray(values, dtype=float)
    total = np.zeros((len(names), *values.shape[1:]))
    np.add.at(total, which, values)
    n_rows = np.bincount(which).reshape(-1, *[1] * (values.ndim - 1))
    return total / n_rows


def standard_error(values):
    """Return that of the mean over the first axis."""
    values = np.asarray(values, dtype=float)
    return values.std(axis=0, ddof=1) / np.sqrt(len(values))


def plus_minus(values, digits=4, sign="+"):
    """Return the mean and its standard error as text."""
    mean, error = np.mean(values), standard_error(values)
    if not np.isfinite(mean):
        return "infinite"
    return f"{mean:{sign}.{digits}f} ± {error:.{digits}f}".replace("-", "−")


# Tables -------------------------------------------------------------------------------


def head(*cells, title=None):
    """Print the head of a Markdown table, with a title above it."""
    print(f"\n{title}\n" if title else "")
    row(*cells)
    row(*["---"] * len(cells))


def row(*cells):
    """Print a row of a Markdown table at once."""
    print("|", " | ".join(map(str, cells)), "|", flush=True)
