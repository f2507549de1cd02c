"""The paper's whole experiment, from recordings to its figures, resumable."""

from ._run import read_study, run_study

__all__ = ["read_study", "run_study"]
