"""The documentation as a site, from the Markdown beside this file: `python -m sphinx -W docs build/site`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import bristle

project = "bristle"
author = "The bristle authors"
copyright = author  # noqa: A001  # Sphinx names it so
version = release = bristle.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "bristle_site"]
exclude_patterns = ["_ext", "export.schema.json", "results.schema.json"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # as GitHub makes them
myst_links_external_new_tab = False

nitpicky = True
nitpick_ignore_regex = [
    ("py:class", r"(?!bristle\.\w+$).*"),
    ("py:obj", r"typing\..*"),
]  # types that are not public: Python's, NumPy's, our own parts
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
default_role = "literal"

html_theme = "furo"
html_title = f"bristle {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
