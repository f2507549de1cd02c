"""Where the documentation is, and the links to it in the HTML of estimators."""

DOCUMENTATION_URL = "https://sklearn-haptic.readthedocs.io/en/stable/"


class DocumentedEstimator:
    """Mixin, before `BaseEstimator`: the page of an estimator in this documentation.

    scikit-learn's HTML representation of an estimator links to this page. It reads
    both attributes and names the module up to its first private part, so that the
    page is that of the public name.
    """

    _doc_link_module = "sklearn_haptic"
    _doc_link_template = (
        DOCUMENTATION_URL + "generated/{estimator_module}.{estimator_name}.html"
    )
