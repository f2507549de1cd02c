"""Settings of the documentation, built by `python -m sphinx -W docs docs/_build/html`.

No network is needed. `-D plot_gallery=0` leaves the examples unexecuted; `git clean
-dfX docs examples` removes all that a build makes.
"""

import warnings

from docutils.nodes import SkipNode
from latex2mathml.converter import convert

from sklearn_haptic import __version__

project = "sklearn_haptic"
author = copyright = "the sklearn_haptic developers"
version = release = __version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.extlinks",
    "sphinx.ext.intersphinx",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "_templates", "inventories"]
nitpicky = True  # no dead reference
default_role = "literal"
extlinks = {"doi": ("https://doi.org/%s", "doi:%s")}

# Guides
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
copybutton_prompt_text = ">>> "

# Reference
templates_path = ["_templates"]
add_module_names = False
toc_object_entries_show_parents = "hide"
autodoc_typehints = "none"  # the docstrings say more
numpydoc_class_members_toctree = False
numpydoc_show_class_members = False  # by the template of classes
intersphinx_mapping = {
    name: (url, f"inventories/{name}.inv")
    for name, url in {
        "joblib": "https://joblib.readthedocs.io/en/stable/",
        "matplotlib": "https://matplotlib.org/stable/",
        "numpy": "https://numpy.org/doc/stable/",
        "pandas": "https://pandas.pydata.org/docs/",
        "scipy": "https://docs.scipy.org/doc/scipy/",
        "sklearn": "https://scikit-learn.org/stable/",
    }.items()
}

# Gallery: a warning of an example fails the build
warnings.filterwarnings("error", module="__main__|sklearn|numpy|scipy|pandas")
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "auto_examples",
    "filename_pattern": r"/plot_",
    "ignore_pattern": r"\brun_",
    "within_subsection_order": "FileNameSortKey",
    "backreferences_dir": "generated/backreferences",
    "doc_module": ("sklearn_haptic",),
    "reference_url": {"sklearn_haptic": None},
    "capture_repr": (),  # what examples print, and no Text(0.5, 0.99, …) of a title
    "download_all_examples": False,
    "remove_config_comments": True,
    "write_computation_times": False,  # of a page that asks for scripts of others
}

# Pages
html_theme = "pydata_sphinx_theme"
html_title = project
html_logo = html_favicon = "_static/logo.svg"
html_static_path = ["_static"]
html_css_files = ["custom.css"]
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": project},
    "navbar_persistent": ["search-button"],
    "navigation_with_keys": False,
    "show_prev_next": False,
    "header_links_before_dropdown": 8,
    "show_toc_level": 2,
}
html_context = {"default_mode": "auto"}
html_sidebars = {  # of pages without pages below them
    name: [] for name in ("index", "install", "real_data", "changelog", "contributing")
}
html_math_renderer = "mathml"  # browsers draw it, with no script and no network


def inline_math(self, node):
    """Write a formula in a line of text."""
    self.body.append(convert(node.astext()))
    raise SkipNode


def displayed_math(self, node):
    """Write a formula on a line of its own."""
    self.body.append(convert(node.astext(), display="block"))
    raise SkipNode


def setup(app):
    """Register how formulas are written."""
    app.add_html_math_renderer("mathml", (inline_math, None), (displayed_math, None))
