"""The README and the guides: their code runs, what they name and link to exists."""

import re
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from joblib.externals.loky import get_reusable_executor
from scipy.io import savemat
from test_annotations import public_objects
from test_phac2 import REST, STATES, write_trial

from sklearn_haptic import NNPOM, RegressedDistribution
from sklearn_haptic.metrics import ranked_probability_score

h5py = pytest.importorskip("h5py")
pytest.importorskip("distributed")
pytest.importorskip("rich")

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
WRITTEN = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]


PEERS = {"aeon", "skpro"}  # which the tests do not install; code that needs them waits


def read(page):
    return page.read_text("utf-8")


def code_blocks(page):
    """Yield the first line, the code and, where they follow, the lines it prints."""
    pattern = r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```)?"
    for match in re.finditer(pattern, read(page), re.M | re.S):
        yield read(page).count("\n", 0, match.start(1)), *match.groups()


def write_phac2(folder):
    """Write files of three trials under the names of those of PHAC-2."""
    states = [REST] * 5 + [state for state in STATES.values() for _ in range(30)]
    with h5py.File(folder / "phac_train_test_pos_neg_90_10_1_20.h5", "w") as file:
        for seed, name in enumerate(["cup_114_01", "cup_114_02", "mat_602_01"]):
            write_trial(file, name, states, seed)
    ratings = np.random.default_rng(0).integers(1, 6, (2, 10, 12))
    savemat(folder / "ratings.mat", {"ratings": ratings, "ids": [114, 602]})
    names = ["object", "adjective", "rater"]
    index = pd.MultiIndex.from_product([[114, 602], ["hard", "rough"], range(12)])
    answers = pd.Series(ratings[:, :2].ravel(), index.set_names(names), name="rating")
    answers.to_csv(folder / "ratings.csv")


@pytest.fixture
def run(tmp_path, monkeypatch, one_thread, capsys):
    """Run a page's code block after block, as a reader would; return what it names."""

    def run(page):
        names = {"__name__": page.stem}
        for first_line, code, printed in code_blocks(page):
            needed = PEERS & set(re.findall(r"^from (\w+)", code, re.M))
            if not all(find_spec(peer) for peer in needed):
                continue
            capsys.readouterr()
            exec(compile("\n" * first_line + code, page, "exec"), names)
            if printed is not None:
                assert capsys.readouterr().out == printed, f"{page}:{first_line}"
        return names

    write_phac2(tmp_path)
    monkeypatch.chdir(tmp_path)
    get_reusable_executor().shutdown()  # workers know "cache" from where they started
    return run


@pytest.mark.slow
def test_code_of_the_readme(run):
    names = run(ROOT / "README.md")
    proba = names["corpus"].ratings["hard"][names["unseen"]] / 12
    assert proba.shape == (5, 5)  # touches of the unseen object, ratings


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES[1:] if any(code_blocks(page))], ids=lambda p: p.name
)
def test_code_of_a_guide(page, run):
    run(page)


@pytest.mark.slow
def test_code_that_needs_recordings(shared_data, monkeypatch, capsys):
    """The comparison prints the figures that its page has."""
    page = read(DOCS / "compare.md")
    code = re.search(r"^```\{code-block\} python\n(.*?)^```", page, re.M | re.S)[1]
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.path", [*sys.path])
    exec(code.replace('"FOLDER"', repr(str(shared_data))), {})
    printed = capsys.readouterr().out.replace("0.", ".").replace("+", "")
    for method in ("default", "marginal"):
        worse = re.search(rf"^\| {method} .* \| (.*) \|$", printed, re.M)[1]
        assert f"{worse} the {method}" in page


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of skpro
def test_a_regressor_of_skpro(run):
    """It passes skpro's own checks, and skpro's score is that of this package."""
    utils = pytest.importorskip("skpro.utils")
    metrics = pytest.importorskip("skpro.metrics")
    names = run(DOCS / "own_parts.md")
    X, regressor = pd.DataFrame(names["X"][names["touch"]]), names["regressor"]
    found = metrics.CRPS()(names["answers"], regressor.predict_proba(X))
    proba = NNPOM(random_state=0).fit(names["X"], names["counts"])
    proba = proba.predict_proba(names["X"])
    expected = ranked_probability_score(names["counts"], proba)
    assert found == pytest.approx(expected)

    class Checked(names["RatingsRegressor"]):
        """For a check of this docstring.

        >>> 1
        1
        """

        @classmethod
        def get_test_params(cls, parameter_set="default"):
            return [{"model": NNPOM()}, {"model": RegressedDistribution()}]

    utils.check_estimator(Checked, raise_exceptions=True, verbose=False)


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.name)
def test_commands(page):
    """Scripts, their options and the extras of the package exist."""
    text = read(page)
    project = tomllib.loads(read(ROOT / "pyproject.toml"))["project"]
    for script in re.findall(r"\b(?:examples|benchmarks|tests|docs)/\w+\.py\b", text):
        assert (ROOT / script).exists(), script
    for extras in re.findall(r"(?:sklearn_haptic|\.)\[([a-z0-9,]+)\]", text):
        assert set(extras.split(",")) <= set(project["optional-dependencies"])
    for script, words in re.findall(r"\b(\w+/\w+\.py)([^\n`]*)", text):
        for option in re.findall(r" (--[a-z-]+)", words.partition("#")[0]):
            assert f'"{option}"' in read(ROOT / script), f"{script} {option}"


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.name)
def test_links_to_files(page):
    """To files, to other pages with or without their ending, and to examples."""
    links = re.findall(r"\]\(([^)#\s]+)|\{doc\}`([^`]+)`", read(page))
    for link in map("".join, links):
        if not link.startswith("http"):
            place = page.parent / link
            if link.startswith("auto_examples/"):
                place = ROOT / "examples" / link.partition("/")[2]
                place = place.with_stem(place.stem.replace("index", "GALLERY_HEADER"))
            endings = ("", ".md", ".rst", ".py")
            assert any(Path(f"{place}{ending}").exists() for ending in endings), link


def pages_of_the_reference():
    """Return the full names of all objects that the reference lists."""
    names, module = set(), None
    for line in read(DOCS / "api.rst").splitlines():
        if line.startswith(".. automodule:: "):
            module = line.split()[-1]
        elif match := re.fullmatch(r"(?:   |\.\. data:: )(\w+)", line):
            names.add(f"{module}.{match[1]}")
    return names


def test_the_reference_lists_every_public_name():
    public = {"sklearn_haptic.PAPER_2020", *(name for name, _ in public_objects())}
    assert pages_of_the_reference() == public


def test_every_page_is_in_a_table_of_contents():
    listed = ["index"]
    for page in PAGES[1:]:
        for block in re.findall(r"^```\{toctree\}\n(.*?)^```", read(page), re.M | re.S):
            listed += re.findall(r"^(?:.* <)?([\w/]+)>?$", block, re.M)
    written = {page.stem for page in PAGES[1:]} | {"api", "auto_examples/index"}
    assert sorted(listed) == sorted(written)  # each once
