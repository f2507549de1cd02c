"""The paper's whole experiment, from recordings to its figures, resumable."""

from ._results import read_study
from ._run import run_study

__all__ = ["read_study", "run_study"]
