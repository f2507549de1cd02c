"""What is said about the package in several places is the same, and is there."""

import os
import re
import subprocess
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

import sklearn_haptic

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def read(name):
    return (ROOT / name).read_text("utf-8")


def test_one_version():
    version = sklearn_haptic.__version__
    assert metadata.version("sklearn_haptic") == version
    assert f"\nversion: {version}\n" in read("CITATION.cff")
    assert f"version = {{{version}}}" in read("docs/citing.md")
    assert read("CHANGELOG.md").startswith(f"# Changelog\n\n## {version}")
    wheels = re.findall(r"sklearn_haptic-(.*)-py3-none", read("docs/install.md"))
    assert wheels and set(wheels) == {version}


def test_extras_are_quoted_and_nothing_unpublished_is_asked_of_pypi():
    """Brackets are a pattern to zsh, and the package is not on PyPI."""
    for path in [*PAGES, *(ROOT / "sklearn_haptic").rglob("*.py")]:
        for command in re.findall(r"pip install([^\n`]*)", path.read_text("utf-8")):
            unquoted = re.sub(r'"[^"]*"', "", command)
            assert "[" not in unquoted, f"{path}: {command}"
            asks = re.search(r"(?<![/\w])sklearn_haptic(?!-)", command)
            assert not asks or path.name == "install.md", f"{path}: {command}"


@pytest.mark.skipif(os.name != "posix", reason="needs bash")
def test_the_machines_choices_are_unset(monkeypatch):
    chosen = ["OPENBLAS_CORETYPE", "OMP_NUM_THREADS", "PYTHONPATH", "PYTEST_ADDOPTS"]
    chosen += ["NVPL_BLAS_DEBUG_CPU_TYPE", "SKLEARN_ASSUME_FINITE", "MPLBACKEND"]
    kept = ["SKLEARN_HAPTIC_SHARED", "PIP_INDEX_URL", "HOME"]
    for name in chosen + kept:
        monkeypatch.setenv(name, "1")
    command = f'set -e; . "{ROOT / ".ci" / "plain"}"; env'
    lines = subprocess.check_output(["bash", "-c", command], text=True).splitlines()
    left = {line.partition("=")[0] for line in lines}
    assert left & {*chosen, *kept} == set(kept)


def test_python_versions():
    minors = re.findall(r":: 3\.(\d+)$", "\n".join(PROJECT["classifiers"]), re.M)
    assert PROJECT["requires-python"] == f">=3.{minors[0]}"
    versions = " ".join(f"python3.{minor}" for minor in minors)
    assert f"default: {versions}\n" in read(".ci/versions")
    assert f"bash .ci/versions {versions}\n" in read("docs/install.md")
