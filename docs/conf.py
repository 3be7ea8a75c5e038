"""Configuration of the documentation site; `build.py` runs it."""

import re
from typing import Any

from sphinx.ext.napoleon.docstring import GoogleDocstring

from pneumo_casadi import __version__

project = "pneumo_casadi"
author = "The pneumo_casadi authors"
copyright = author
release = version = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
html_theme = "furo"
html_title = f"pneumo_casadi {__version__}"
mathjax_path = "tex-svg.js"  # copied by build.py; letters are paths, so no font is loaded
mathjax3_config = {"options": {"enableMenu": False}}
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
exclude_patterns = ["static"]
suppress_warnings = ["myst.header", "ref.python"]  # `N` is a shape, not a link

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_preprocess_types = False


def setup(app: Any) -> None:
    """Make docstrings and signatures readable as they stand on a page."""
    app.connect("autodoc-process-docstring", _plain_references)
    app.connect("autodoc-process-signature", _plain_defaults)
    # A docstring such as "A caution: some numbers are worse" states no type.
    GoogleDocstring._consume_inline_attribute = _whole_text


def _whole_text(docstring: GoogleDocstring) -> tuple[str, list[str]]:
    """Return no type and all lines of what describes an attribute."""
    return "", docstring._consume_to_end()


def _plain_defaults(*arguments: Any) -> tuple[str | None, str | None]:
    """Let a frozen empty mapping, where it is a default, stand as an empty one."""
    signature, returned = arguments[-2:]
    return signature and signature.replace("mappingproxy({})", "{}"), returned


def _plain_references(*arguments: Any) -> None:
    """Let numbered references stand as text: their numbers repeat from docstring to docstring."""
    lines = arguments[-1]
    lines[:] = [re.sub(r"(?:^\.\. (?=\[))|(?<=\[\d\])_", "", line) for line in lines]
