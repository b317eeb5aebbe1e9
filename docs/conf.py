"""Sphinx, as the manual uses it.  Strict: `python -m docs` takes any warning for an error."""

from __future__ import annotations

import os
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from docs.extensions.sources import linkcode_resolve as linkcode_resolve  # noqa: E402

project = "pbekit"
author = copyright = "the pbekit developers"
release = version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
language = "en"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx.ext.linkcode",
    "sphinx_copybutton",
    "docs.extensions.maths",
    "docs.extensions.sources",
    "docs.extensions.docstrings",
    "docs.extensions.reference",
    "docs.extensions.console",
    "docs.extensions.verdicts",
]
WITHOUT_NOTEBOOKS = bool(os.environ.get("MANUAL_WITHOUT_NOTEBOOKS"))
exclude_patterns = ["included/*", *(["gallery/*"] if WITHOUT_NOTEBOOKS else [])]

# Markdown, and notebooks.
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "fieldlist", "attrs_inline"]
myst_heading_anchors = 3
myst_dmath_double_inline = False
myst_update_mathjax = False
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "build/manual-cells")
nb_execution_excludepatterns = ["gallery/*"]
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_execution_timeout = 600
nb_merge_streams = True

# Formulas are SVG; equations are numbered by page.
html_math_renderer = "svg"
numfig = True
math_numfig = True
numfig_secnum_depth = 1
math_eqref_format = "Eq. ({number})"

# Docstrings.  What stands in single backticks there is a name where it is one of the reference, else code.
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
nitpicky = True
nitpick_ignore_regex = [("py:obj", ".*"), ("py:class", ".*"), ("py:exc", ".*"), ("py:data", ".*")]
suppress_warnings = ["toc.excluded", "myst.xref_missing"] if WITHOUT_NOTEBOOKS else []

# Pages that need neither a network nor a server.
html_theme = "furo"
html_title = f"pbekit {release}"
html_static_path = ["static"]
html_css_files = ["manual.css"]
html_show_search_summary = False
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
copybutton_prompt_text = r"\$ |>>> "
copybutton_prompt_is_regexp = True
copybutton_only_copy_prompt_lines = True
pygments_style = "friendly"
