"""Write the inventories by which the documentation links to other packages.

To follow newer versions of these, run `python docs/inventories/make_inventories.py`
where they are installed. An inventory lists the public classes, methods and functions
of a package; the addresses follow the scheme of its own documentation, where methods
are on the page of their class or, in most packages, on one of their own.
"""

import inspect
import zlib
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import numpy

SKLEARN = """
base calibration callback compose decomposition dummy ensemble feature_selection frozen
gaussian_process inspection isotonic kernel_approximation linear_model metrics
model_selection multioutput neighbors neural_network pipeline preprocessing svm utils
utils.discovery utils.metadata_routing utils.parallel
"""
SCIPY = "integrate interpolate linalg optimize signal sparse special stats"
MATPLOTLIB = ["axes", "figure", "pyplot"]
PAGES = {  # package: folder of its reference, documented modules
    "joblib": ("generated", ["joblib"]),
    "matplotlib": ("api/_as_gen", [f"matplotlib.{name}" for name in MATPLOTLIB]),
    "numpy": ("reference/generated", ["numpy", "numpy.linalg"]),
    "pandas": ("reference/api", ["pandas"]),
    "scipy": ("reference/generated", [f"scipy.{name}" for name in SCIPY.split()]),
    "sklearn": ("modules/generated", [f"sklearn.{name}" for name in SKLEARN.split()]),
}
# What inherited docstrings refer to besides: name, type, priority, address.
MORE = {
    "sklearn": """
accuracy_score std:label -1 modules/model_evaluation.html#accuracy-score
df_output_transform std:label -1 modules/df_output_transform.html
meta-estimator std:term 1 glossary.html#term-meta-estimator
metadata_routing std:label -1 metadata_routing.html
sklearn.set_config py:function 1 modules/generated/sklearn.set_config.html#$
sphx_glr_auto_examples_miscellaneous_plot_set_output.py std:label -1 \
auto_examples/miscellaneous/plot_set_output.html
"""
}


def public_objects(module_name):
    """Yield the name, type and value of each public class and function."""
    module = import_module(module_name)
    for name, value in vars(module).items():
        if name in getattr(module, "__all__", dir(module)) and name[0] != "_":
            if inspect.isclass(value) and not issubclass(value, numpy.generic):
                yield f"{module_name}.{name}", "py:class", value
            elif callable(value) and not inspect.isclass(value):
                yield f"{module_name}.{name}", "py:function", value


def entries(package):
    """Yield the lines of an inventory."""
    folder, modules = PAGES[package]
    for module in modules:
        for name, type_, value in public_objects(module):
            page = f"{folder}/{name}.html"
            yield f"{name} {type_} 1 {page}#$ -"
            if type_ == "py:class":
                for method, _ in inspect.getmembers(value, inspect.isroutine):
                    if not method.startswith("_"):
                        full_name = f"{name}.{method}"
                        if package not in {"joblib", "sklearn"}:
                            page = f"{folder}/{full_name}.html"
                        yield f"{full_name} py:method 1 {page}#$ -"
    for line in MORE.get(package, "").split("\n")[1:-1]:
        yield f"{line} -"


for package in PAGES:
    distribution = "scikit-learn" if package == "sklearn" else package
    head = (
        "# Sphinx inventory version 2\n"
        f"# Project: {distribution}\n"
        f"# Version: {version(distribution)}\n"
        "# The remainder of this file is compressed using zlib.\n"
    )
    lines = "".join(line + "\n" for line in sorted(entries(package)))
    path = Path(__file__).with_name(f"{package}.inv")
    path.write_bytes(head.encode() + zlib.compress(lines.encode(), 9))
