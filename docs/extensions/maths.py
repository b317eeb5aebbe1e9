"""Formulas as SVG, drawn when the manual is built: they need neither a script nor the network where they are read."""

from __future__ import annotations

import html
import re
from functools import cache
from typing import Any

import ziamath
from docutils import nodes

SIZE = 17.0
"""Pixels of the letters of a formula; the page's text has 16."""

WRITTEN = {
    r"\\dfrac": r"\\frac",
    r"\\tfrac": r"\\frac",
    r"\\mathsf\{": r"\\mathbf{",
    r"\\boldsymbol\{": r"\\mathbf{",
}
"""Commands that ziamath draws under another name."""


@cache
def drawn(latex: str, inline: bool) -> tuple[str, float]:
    """A formula as SVG, in the colour of the text about it, and how far it goes below the line [px]."""
    # A sign is no operation.
    latex = re.sub(r"(^|[=(,&{]|\\le|\\propto)\s*-(?=[^}=])", r"\1{-}", latex)
    for given, known in WRITTEN.items():
        latex = re.sub(given, known, latex)
    formula = ziamath.Latex(latex, size=SIZE, inline=inline, color="currentColor")
    return formula.svg(), -float(formula.getyofst())


def svg_of(latex: str, inline: bool) -> str:
    """The element of a formula, readable aloud."""
    picture, below = drawn(latex, inline)
    style = f' style="vertical-align: {-below:.2f}px"' if inline else ""
    opening = f'<svg role="img" aria-label="{html.escape(latex, quote=True)}"{style} '
    return picture.replace("<svg ", opening, 1)


def visit_inline(self: Any, node: nodes.math) -> None:
    """Write a formula within a line."""
    self.body.append(f'<span class="formula">{svg_of(node.astext(), True)}</span>')
    raise nodes.SkipNode


def visit_display(self: Any, node: nodes.math_block) -> None:
    """Write a formula of its own, with its number and the anchor of links to it."""
    self.body.append(self.starttag(node, "div", CLASS="equation"))
    self.body.append(f'<div class="formula">{svg_of(node.astext(), False)}</div>')
    if node["number"]:
        from sphinx.util.math import get_node_equation_number

        number = get_node_equation_number(self, node)
        self.body.append(f'<span class="number">({number})')
        self.add_permalink_ref(node, "Link to this equation")
        self.body.append("</span>")
    self.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Make it the renderer of Sphinx's formulas."""
    app.add_html_math_renderer("svg", (visit_inline, None), (visit_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
