"""The README and the guides: their code runs, and their links lead somewhere."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def code_blocks(page):
    return re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)


def test_code_of_the_readme():
    """Block after block, as a reader would run it."""
    names = {}
    for block in code_blocks(ROOT / "README.md"):
        exec(block, names)
    proba = names["corpus"].ratings["hard"][names["unseen"]] / 12
    assert proba.shape == (5, 5)  # touches of the unseen object, ratings
    assert [name for name, *_ in names["features"].transformers] == [
        "pipeline-1",
        "pipeline-2",
    ]


def test_code_of_the_joint_network():
    names = {}
    (block,) = code_blocks(ROOT / "docs" / "shared_hidden_layer.md")
    exec(block, names)
    assert names["model"].predict_proba(names["X"]).shape == (24, 10, 5)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_to_files(page):
    for link in re.findall(r"\]\(([^)#\s]+)", page.read_text("utf-8")):
        if not link.startswith("http"):
            assert (page.parent / link).exists(), link
