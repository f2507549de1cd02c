"""What the package imports is what a plain install brings."""

import ast
import re
import sys
import tomllib
from pathlib import Path

import pytest

import sklearn_haptic

PACKAGE = Path(sklearn_haptic.__file__).parent
PYPROJECT = PACKAGE.parent / "pyproject.toml"
DISTRIBUTIONS = {"sklearn": "scikit-learn"}
OPTIONAL = {"h5py": "phac2", "matplotlib": "plot"}


def imports(tree):
    """Yield the third-party packages that a module imports when it runs."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [node.module]
        else:
            yield from imports(node)
            continue
        for name in {name.split(".")[0] for name in names}:
            if name not in sys.stdlib_module_names | {PACKAGE.name}:
                yield name


def names_of(requirements):
    return {re.match(r"[\w-]+", requirement).group() for requirement in requirements}


@pytest.mark.slow
def test_a_plain_install_brings_what_the_package_imports():
    if not PYPROJECT.exists():
        pytest.skip("needs the source tree")
    project = tomllib.loads(PYPROJECT.read_text())["project"]
    core = names_of(project["dependencies"])
    for path in PACKAGE.rglob("*.py"):
        for name in imports(ast.parse(path.read_text())):
            if name in OPTIONAL:
                extra = project["optional-dependencies"][OPTIONAL[name]]
                assert name in names_of(extra)
            else:
                assert DISTRIBUTIONS.get(name, name) in core, path
