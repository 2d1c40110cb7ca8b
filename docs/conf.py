"""How Sphinx builds the documentation: `make docs`, which takes every warning for an error."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from docutils import nodes
from latex2mathml.converter import convert

import rungwise

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

project = "rungwise"
author = "The rungwise contributors"
copyright = author
release = version = rungwise.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
exclude_patterns = ["_build"]
highlight_language = "text"

# Pages are Markdown; headings are targets of links, as on a code host.
myst_enable_extensions = ["deflist", "dollarmath", "attrs_inline"]
myst_heading_anchors = 4

# Notebooks are stored with what they printed, which `tests/test_newcomer.py` compares with what they print.
nb_execution_mode = "off"

# Docstrings name code between single backquotes.
default_role = "code"
autosummary_generate = True
autodoc_typehints = "description"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = False  # signatures that are made from lists have more defaults than their source

templates_path = ["_templates"]

html_theme = "furo"
html_title = f"rungwise {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
# Formulas are MathML, which browsers draw without a script from the network.
html_math_renderer = "mathml"


def plain(*arguments: Any) -> None:
    """Docstrings are plain text with code between backquotes: bars, stars and underscores mark nothing."""
    lines = arguments[-1]
    for index, line in enumerate(lines):
        parts = line.split("`")
        parts[::2] = [re.sub(r"[|*]|(?<=\w)_(?!\w)", r"\\\g<0>", part) for part in parts[::2]]
        lines[index] = "`".join(parts)


def inside(*arguments: Any) -> None:
    """Links of pages to files of the repository that are pages here, too, lead to these."""
    source = arguments[-1]
    source[0] = re.sub(r"\]\(\.\./(CONTRIBUTING|CHANGELOG)\.md", lambda m: f"]({m[1].lower()}.md", source[0])


def inline_formula(translator: HTML5Translator, node: nodes.Element) -> None:
    """A formula in a line of text."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def displayed_formula(translator: HTML5Translator, node: nodes.Element) -> None:
    """A formula of its own, which scrolls where the page is too narrow."""
    translator.body.append(f'<div class="formula">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def wrap_sentences(*arguments: Any) -> None:
    """Blocks whose long lines are sentences or commands are wrapped; source code and tables are not."""
    page: nodes.document = arguments[1]
    for block in page.findall(nodes.literal_block):
        if block.get("language") not in ("python", "yaml") and not has_columns(block.astext()):
            block["classes"].append("wraps")


def has_columns(text: str) -> bool:
    """Whether spaces in lines of a text put words below each other."""
    return any(re.search(r"\S {2,}\S", line) for line in text.splitlines())


def setup(app: Sphinx) -> None:
    """Docstrings are changed before napoleon reads them."""
    app.add_html_math_renderer("mathml", (inline_formula, None), (displayed_formula, None))
    app.connect("autodoc-process-docstring", plain, priority=100)
    app.connect("source-read", inside)
    app.connect("doctree-resolved", wrap_sentences)
