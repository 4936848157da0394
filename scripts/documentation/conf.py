"""How Sphinx makes the site; see build.py."""

from __future__ import annotations

import re
from importlib.metadata import version as version_of
from typing import Any

project = "koopman-lab"
release = version = version_of("koopman-lab")
copyright = "the authors; MIT license"  # noqa: A001  (Sphinx's name)
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "README"
myst_heading_anchors = 4
html_theme = "alabaster"
html_theme_options = {"page_width": "72em", "sidebar_width": "17em"}
html_sidebars = {
    # The tree of contents is long, and to draw it beside every module takes longer than the rest.
    "api/*": ["about.html", "searchfield.html", "relations.html"],
    "[!a]*": ["about.html", "searchfield.html", "navigation.html"],
}
html_show_sourcelink = False
html_copy_source = False
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_member_order = "bysource"
napoleon_use_ivar = True  # attributes of a class stand in its text; as members they would twice
suppress_warnings = ["ref.python"]  # names of types in signatures, which several modules have

TYPED = re.compile(r"(?<![`:\w])`([^`\n]+)`(?![`\w])")
"""What a person types, between single backticks as in the guides."""


def _as_restructured_text(
    app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Take for text what only Sphinx takes for markup: bars of absolute values."""
    del app, what, name, thing, options
    for number, line in enumerate(lines):
        parts = re.split(r"(``.*?``)", TYPED.sub(r"``\1``", line))
        parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
        lines[number] = "".join(parts)


def setup(app: Any) -> None:
    """Be heard before napoleon."""
    app.connect("autodoc-process-docstring", _as_restructured_text, priority=400)
