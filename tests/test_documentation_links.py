"""The HTML of estimators links to the pages of the reference."""

import re

import pytest
from sklearn.compose import ColumnTransformer
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from test_docs import pages_of_the_reference

import sklearn_haptic
from sklearn_haptic import (
    NNPOM,
    AnytimeRegressor,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    KSVDTransformer,
    NoveltyGuard,
    STHMPTransformer,
    TemporalMaxPool,
    TouchPool,
    make_haptic_pipeline,
)
from sklearn_haptic.utils._sklearn import DOCUMENTATION_URL

PUBLIC = [getattr(sklearn_haptic, name) for name in sklearn_haptic.__all__]
ESTIMATORS = [each for each in PUBLIC if hasattr(each, "_repr_html_")]


def links(estimator):
    """Return the addresses of documentation in the HTML of an estimator."""
    html = estimator._repr_html_()
    tags = re.findall(r'<a class="sk-estimator-doc-link[^>]*>', html)
    return {link for tag in tags for link in re.findall(r'href="([^"]+)"', tag)}


def page(estimator):
    return f"{DOCUMENTATION_URL}generated/sklearn_haptic.{estimator.__name__}.html"


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda each: each.__name__)
def test_alone(estimator):
    pipeline = make_haptic_pipeline(["pdc"])
    required = {
        DistributionBlend: [[("linear", NNPOM())]],
        TouchPool: [[("linear", NNPOM(), [0])]],
    }.get(estimator, [pipeline] if estimator is NoveltyGuard else [])
    timed = {"estimator": pipeline, "durations": [1], "sampling_rates": 100}
    options = timed if estimator is AnytimeRegressor else {}
    assert page(estimator) in links(estimator(*required, **options))
    assert f"sklearn_haptic.{estimator.__name__}" in pages_of_the_reference()


def test_all_estimators_are_tested():
    names = {estimator.__name__ for estimator in ESTIMATORS}
    assert {"NNPOM", "DummyDistribution", "STHMPTransformer"} < names


@pytest.mark.slow
def test_inside_other_estimators():
    features = ColumnTransformer(
        [
            ("pdc", make_pipeline(KSVDTransformer(), TemporalMaxPool()), ["pdc"]),
            ("skin", make_pipeline(STHMPTransformer(), TemporalMaxPool()), ["skin"]),
        ]
    )
    regressor = DistributionalOrdinalRegressor(NNPOM())
    model = make_pipeline(features, StandardScaler(), regressor)
    found = links(model) | links(GridSearchCV(model, {}))
    ours = {link for link in found if link.startswith(DOCUMENTATION_URL)}
    assert ours == {
        page(each)
        for each in (
            *(KSVDTransformer, STHMPTransformer, TemporalMaxPool),
            *(NNPOM, DistributionalOrdinalRegressor),
        )
    }
    theirs = {link.rpartition("/")[2] for link in found - ours}
    assert theirs == {
        "sklearn.compose.ColumnTransformer.html",
        "sklearn.model_selection.GridSearchCV.html",
        "sklearn.pipeline.Pipeline.html",
        "sklearn.preprocessing.StandardScaler.html",
    }
    assert all(link.startswith("https://scikit-learn.org/") for link in found - ours)


def test_a_class_of_a_user_has_no_page_here():
    class Mine(NNPOM):
        """Not of this package."""

    assert links(Mine()) == set()
