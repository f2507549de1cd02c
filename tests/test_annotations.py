"""Annotations: that all are there, say what is validated, and hold for a user."""

import inspect
import os
import re
import subprocess
import sys
from ast import literal_eval
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from types import UnionType
from typing import Literal, Union, get_args, get_origin, get_type_hints

import pandas as pd
import pytest
from sklearn.base import BaseEstimator
from sklearn.utils._param_validation import StrOptions, make_constraint

import sklearn_haptic

MODULES = (
    "sklearn_haptic",
    "sklearn_haptic.datasets",
    "sklearn_haptic.metrics",
    "sklearn_haptic.model_selection",
    "sklearn_haptic.plotting",
    "sklearn_haptic.ratings",
    "sklearn_haptic.streaming",
    "sklearn_haptic.study",
)


def public_objects():
    """Yield every public class and function, once each, with its full name."""
    seen = set()
    for name in MODULES:
        module = import_module(name)
        for key in [key for key in module.__all__ if key not in seen]:
            if callable(getattr(module, key)):
                seen.add(key)
                yield f"{name}.{key}", getattr(module, key)


def own_methods(cls):
    """Yield the public methods and properties that this package defines."""
    names = [name for name in dir(cls) if not name.startswith("_")]
    for name in ("__init__", *names):
        method = inspect.getattr_static(cls, name)
        method = getattr(method, "fget", getattr(method, "__func__", method))
        module = getattr(method, "__module__", None) or ""  # of a default, none
        if module.startswith("sklearn_haptic"):
            yield name, method


def public_callables():
    for name, each in public_objects():
        if inspect.isclass(each):
            for method_name, method in own_methods(each):
                yield pytest.param(method, 1, id=f"{name}.{method_name}")
        else:
            yield pytest.param(each, 0, id=name)


def test_modules_are_attributes_of_the_package():
    modules = [name.rpartition(".")[2] for name in MODULES[1:]]
    code = f"""
import sklearn_haptic
for name in {modules}:
    assert name in dir(sklearn_haptic)
    assert getattr(sklearn_haptic, name).__name__ == "sklearn_haptic." + name
assert not hasattr(sklearn_haptic, "rating")
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(("function", "n_bound"), [*public_callables()])
def test_every_parameter_and_return_is_annotated(function, n_bound):
    signature = inspect.signature(function)
    parameters = list(signature.parameters.values())[n_bound:]
    missing = [each.name for each in parameters if each.annotation is each.empty]
    assert missing == []
    assert signature.return_annotation is not signature.empty


@pytest.mark.parametrize(("function", "n_bound"), [*public_callables()])
def test_help_shows_the_names_of_types(function, n_bound):
    """And not what they stand for, such as unions of NumPy's private protocols."""
    shown = str(inspect.signature(function))
    assert not re.search(r"\b(numpy|collections|pandas|sklearn_haptic)\.", shown)


@pytest.mark.parametrize(("name", "each"), [*public_objects()])
def test_defaults_are_those_documented(name, each):
    text = re.sub(r"\\\n *", "", inspect.getdoc(each))
    for key, parameter in inspect.signature(each).parameters.items():
        said = re.search(rf"^(?:\w+, )*{key}(?:, \w+)* : .*default=(.*)$", text, re.M)
        if said and parameter.default is not parameter.empty:
            default = getattr(parameter.default, "__name__", parameter.default)
            assert said[1] == default or literal_eval(said[1]) == default, key


def validated_parameters():
    for name, each in public_objects():
        constraints = getattr(each, "_skl_parameter_constraints", None)
        if inspect.isclass(each) and issubclass(each, BaseEstimator):
            constraints, each = each._parameter_constraints, each.__init__
        for parameter, allowed in (constraints or {}).items():
            if isinstance(allowed, list):
                yield pytest.param(each, parameter, allowed, id=f"{name}-{parameter}")


@pytest.mark.parametrize(
    ("function", "parameter", "allowed"), [*validated_parameters()]
)
def test_annotations_allow_what_validation_allows(function, parameter, allowed):
    hint = get_type_hints(function, localns={"pd": pd})[parameter]
    parts = get_args(hint) if get_origin(hint) in (Union, UnionType) else [hint]
    options = {o for c in allowed if isinstance(c, StrOptions) for o in c.options}
    literals = [get_args(part) for part in parts if get_origin(part) is Literal]
    assert {option for each in literals for option in each} == options
    takes_none = any(make_constraint(c).is_satisfied_by(None) for c in allowed)
    assert (type(None) in parts) == takes_none
    default = inspect.signature(function).parameters[parameter].default
    assert takes_none or default is not None


def test_the_package_says_that_it_is_typed():
    assert (files("sklearn_haptic") / "py.typed").is_file()


RIGHT = """
from functools import partial
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    KSVDTransformer,
    STHMPTransformer,
    SensorFusionNNPOM,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import load_phac2, make_haptic_corpus
from sklearn_haptic.metrics import log_score, neg_rps_scorer
from sklearn_haptic.model_selection import sensor_contributions
from sklearn_haptic.plotting import InverseCDFDisplay
from sklearn_haptic.ratings import interrater_agreement
from sklearn_haptic.study import run_study

Floats = NDArray[np.float64]


def score(trials: list[Floats], y: list[list[int]], groups: NDArray[np.int64]) -> float:
    codes = KSVDTransformer(n_atoms=8, window=22, random_state=0).fit_transform(trials)
    X = TemporalMaxPool(cells=(4, 2, 1), memory="cache").fit(codes).transform(codes)
    frames = STHMPTransformer(layout=np.ones((2, 2, 4))).fit(trials).transform(codes)
    TemporalMaxPool([2, 1], split="floor").fit(frames)
    network = assert_type(NNPOM(alpha=1, levels=[1, 2, 3]), NNPOM)
    model = DistributionalOrdinalRegressor(network, n_duplicates=9, decode="quantile")
    assert_type(model.fit(X, y, groups=groups), DistributionalOrdinalRegressor)
    proba = assert_type(model.predict_proba(X), Floats)
    assert_type(log_score(y, proba, average=False), float | Floats)
    assert_type(interrater_agreement(y), Floats)
    model.sample([[0.0, 1.0]], 3, random_state=np.random.RandomState(0))
    InverseCDFDisplay.from_predictions(y[0], proba, levels=["soft", "hard"])
    assert_type(neg_rps_scorer(model, X, y), float)
    return model.score(X, y)


fusion = SensorFusionNNPOM({"pac": slice(2), "tdc": [2, 3]}, {"pac": NNPOM()})
sensor_contributions(DistributionalOrdinalRegressor(fusion), [[0.0]], [1], cv=3)
DistributionalOrdinalRegressor(**PAPER_2020)
corpus = load_phac2("trials.h5", procedure="squeeze", sensors=["pac"])
make_haptic_pipeline(("pac", "tdc")).fit(corpus.trials, [1, 2])
run_study(partial(make_haptic_corpus, 9), "folder", alpha=[1], scoring=neg_rps_scorer)
"""

WRONG = """
from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    KSVDTransformer,
    SensorFusionNNPOM,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import load_phac2, make_haptic_corpus
from sklearn_haptic.metrics import dispersion, log_score
from sklearn_haptic.model_selection import cheapest_within_one_se
from sklearn_haptic.plotting import InverseCDFDisplay
from sklearn_haptic.ratings import inverse_cdf
from sklearn_haptic.study import run_study

X, y, proba = [[0.0], [1.0]], [[2, 1], [1, 2]], [[0.5, 0.5], [0.5, 0.5]]
NNPOM(n_hidden="ten")
NNPOM(solver="adam")
NNPOM().fit(X)
NNPOM().predict_proba(X, y)
DistributionalOrdinalRegressor(sampling="levels")
DistributionalOrdinalRegressor().fit(X, y, None, X)
DummyDistribution("mean")
KSVDTransformer(windows=22)
KSVDTransformer(memory=5)
SensorFusionNNPOM(["pac", "tdc"])
TemporalMaxPool(cells=8)
make_haptic_pipeline(memory=5)
load_phac2(None)
load_phac2("trials.h5", procedure="holds")
make_haptic_corpus("60")
log_score(y)
name: str = dispersion(y, proba)
index: str = cheapest_within_one_se({})
InverseCDFDisplay.from_predictions(y)
inverse_cdf(y, 0.5, [1, 2])
run_study("corpus", "folder")
"""


@pytest.mark.slow
def test_mypy_accepts_right_code_and_rejects_wrong_code(tmp_path):
    pytest.importorskip("mypy")
    (tmp_path / "right.py").write_text(RIGHT)
    (tmp_path / "wrong.py").write_text(WRONG)
    options = ("--strict", "--follow-imports=silent", "--no-incremental")
    run = subprocess.run(
        [sys.executable, "-m", "mypy", *options, "right.py", "wrong.py"],
        cwd=tmp_path,
        env=os.environ | {"MYPYPATH": str(Path(sklearn_haptic.__file__).parents[1])},
        capture_output=True,
        text=True,
    )
    assert run.stderr == ""
    places = re.findall(r"^(\w+\.py):(\d+): error:", run.stdout, re.MULTILINE)
    calls = WRONG.splitlines()
    wrong = range(calls.index('NNPOM(n_hidden="ten")') + 1, len(calls) + 1)
    assert set(places) == {("wrong.py", str(line)) for line in wrong}, run.stdout
