"""The paper's whole experiment, from recordings to its figures, resumable."""

from ._comparisons import compare_networks, score_table
from ._results import read_study
from ._run import run_study

__all__ = [
    "compare_networks",
    "read_study",
    "run_study",
    "score_table",
]
