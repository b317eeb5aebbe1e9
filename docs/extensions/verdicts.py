"""The table of verdicts (`validation/README.md`) as a page: `{verdicts}`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

README = Path(__file__).parents[2] / "validation/README.md"
COLUMNS = ("case", "claim", "source", "measured", "verdict")


def rows(text: str) -> dict[str, list[dict[str, str]]]:
    """{heading: its cases} of the table."""
    found: dict[str, list[dict[str, str]]] = {}
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        for line in body.splitlines():
            cells = [cell.strip() for cell in line.strip("|").split(" | ")]
            if line.startswith("| `") and len(cells) == len(COLUMNS):
                found.setdefault(heading.strip(), []).append(dict(zip(COLUMNS, cells, strict=True)))
    return found


class Verdicts(SphinxDirective):
    """`{verdicts}`."""

    def run(self) -> list[nodes.Node]:
        self.env.note_dependency(str(README))
        text = README.read_text(encoding="utf-8")
        counts = next(line for line in text.splitlines() if re.match(r"\d+ \w", line))
        lines: list[str] = []
        for heading, cases in rows(text).items():
            lines += [f"## {heading}", ""]
            for case in cases:
                verdict, _, why = case["verdict"].strip("|").strip().partition(": ")
                lines += [f"{verdict} {case['case']}", f": {case['claim']}", ""]
                lines += [f"  Measured: {case['measured']}.", ""]
                lines += [f"  {why[:1].upper()}{why[1:]}.", ""] if why else []
                lines += [f"  Source: {case['source']}.", ""]
        sections = self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)
        return [nodes.paragraph("", counts), *sections]


def setup(app: Any) -> dict[str, bool]:
    """Join it to Sphinx."""
    app.add_directive("verdicts", Verdicts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
