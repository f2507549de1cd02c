"""What is said about the package in several places is the same, and is there."""

import os
import re
import subprocess
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

import sklearn_haptic
from sklearn_haptic.utils._sklearn import DOCUMENTATION_URL

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


def test_addresses_are_those_of_pages_and_figures():
    """On the documentation's site: pages in its root, the figures of pages below."""
    addresses = list(PROJECT["urls"].values())
    addresses += re.findall(r"https?://[^\s)>\"]+", read("README.md"))
    paths = [
        address.removeprefix(DOCUMENTATION_URL)
        for address in addresses
        if address.startswith(DOCUMENTATION_URL)
    ]
    assert any(path.startswith("_images/") for path in paths)
    for path in filter(None, paths):
        folder, _, name = path.rpartition("/")
        if folder == "_images":
            assert (ROOT / "docs" / "images" / name).exists()
            assert any(f"](images/{name})" in page.read_text() for page in PAGES)
        elif folder == "auto_examples":
            assert (name, (ROOT / "examples").exists()) == ("index.html", True)
        else:
            page = ROOT / "docs" / name
            found = [page.with_suffix(suffix).exists() for suffix in (".md", ".rst")]
            assert folder == "" and any(found), path


def test_figures_of_the_readme_have_addresses():
    """PyPI shows the README without the files beside it."""
    images = re.findall(r"!\[[^\]]*\]\(([^)]*)\)", read("README.md"))
    assert images and all(image.startswith("https://") for image in images)


def test_extras_are_quoted_and_nothing_unpublished_is_asked_of_pypi():
    """Brackets are a pattern to zsh, and the package is not on PyPI."""
    for path in [*PAGES, *(ROOT / "sklearn_haptic").rglob("*.py")]:
        for command in re.findall(r"pip install([^\n`]*)", path.read_text("utf-8")):
            unquoted = re.sub(r'"[^"]*"', "", command)
            assert "[" not in unquoted, f"{path}: {command}"
            asks = re.search(r"(?<![/\w])sklearn_haptic(?!-)", command)
            assert not asks or path.name == "install.md", f"{path}: {command}"


def test_what_a_broad_prediction_says_is_said_in_the_same_words():
    words = (
        "A narrow prediction says that people will agree about the object; a broad "
        "one says only that a rating is hard to foresee, because people disagree or "
        "because one touch does not tell what they agree on"
    )
    for name in ("README.md", "docs/index.md", "docs/method.md"):
        assert " ".join(read(name).split()).count(words) == 1, name


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
