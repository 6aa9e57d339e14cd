"""Configuration of Sphinx for these pages (``make docs``). The pages need no network."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path
from typing import cast

from sphinx.application import Sphinx

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "extensions")]

project = "crankslider"
project_copyright = "the authors of crankslider"
version = release = version_of("crankslider")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "mathml", "from_code", "pictures"]
exclude_patterns = ["_build"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 3
smartquotes = False  # quotes in settings are typed as shown

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
python_maximum_signature_line_length = 90
add_module_names = False

html_theme = "furo"
html_title = f"crankslider {version}"
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_math_renderer = "mathml"
html_copy_source = html_show_sourcelink = False


def text_alone(_app: Sphinx, what: str, _name: str, *others: object) -> None:
    """Start the text of a property with an escaped blank: Napoleon reads text before a colon as a type."""
    *_, lines = others
    if what == "property":
        cast(list[str], lines).insert(0, r"\ ")


def setup(app: Sphinx) -> None:
    """Run before Napoleon, which has the default priority of 500."""
    app.connect("autodoc-process-docstring", text_alone, priority=400)
