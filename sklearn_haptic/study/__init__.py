"""The paper's whole experiment, from recordings to its figures, resumable."""

from ._comparisons import compare_procedures, compare_sensors, score_table
from ._results import read_study
from ._run import run_study

__all__ = [
    "compare_procedures",
    "compare_sensors",
    "read_study",
    "run_study",
    "score_table",
]
