"""Docstrings as Sphinx reads them: what the house writes in plain text, between the summary and numpydoc's sections.

indented lines              are shown as they stand
name : meaning              lines of this form in a row are a list
`name`                      is a name; `|` and `*` are themselves
"""

from __future__ import annotations

import re
from typing import Any

ENTRY = re.compile(r"^((?:``)?[\w.*\[\]\"'(), -]{1,60}?(?:``)?) +: +(.*)$")
WIDE = re.compile(r"^([\w\"',()/*.: -]{1,40}?)  +(\S.*)$")
SECTION = re.compile(r"^-{3,}$")


def readable(lines: list[str]) -> list[str]:
    """The text before the first section of numpydoc, in reStructuredText; the sections as they are."""
    end = next((k - 1 for k, line in enumerate(lines) if SECTION.match(line.strip()) and k), len(lines))
    found: list[str] = []
    for paragraph in paragraphs(lines[:end]):
        if paragraph[0].startswith(" "):
            found += ["::", "", *(f"    {line}" for line in paragraph), ""]
        elif entries(paragraph):
            found += [*listed(paragraph), ""]
        else:
            found += [*broken(paragraph), ""]
    return found + [escaped(line) for line in lines[end:]]


def paragraphs(lines: list[str]) -> list[list[str]]:
    """Lines between blank ones; those of an indented block stay together."""
    found: list[list[str]] = []
    blank = True
    for line in lines:
        if not line.strip():
            blank = True
            continue
        indented = line.startswith(" ")
        if blank and indented and found and found[-1][0].startswith(" "):
            found[-1] += ["", line]
        elif blank:
            found.append([line])
        else:
            found[-1].append(line)
        blank = False
    return found


def entries(paragraph: list[str]) -> bool:
    """Whether it is a list of names and meanings."""
    heads = [line for line in paragraph if not line.startswith(" ")]
    named = [line for line in heads if ENTRY.match(line) or WIDE.match(line)]
    return bool(named) and len(named) == len(heads)


def listed(paragraph: list[str]) -> list[str]:
    """Its lines as a definition list."""
    found: list[str] = []
    for line in paragraph:
        match = ENTRY.match(line) or WIDE.match(line)
        if match and not line.startswith(" "):
            name = match[1].strip().strip("`")
            found += [f"``{name}``", f"    {escaped(match[2])}"]
        else:
            found.append(f"    {escaped(line.strip())}")
    return found


def broken(paragraph: list[str]) -> list[str]:
    """Plain text; lines that an indented one follows keep it as shown."""
    found: list[str] = []
    literal = False
    for line in paragraph:
        if line.startswith(" ") and not line.strip().startswith(("- ", "* ")):
            if paragraph[0].startswith(("- ", "* ")):
                found.append(escaped(line))
                continue
            if not literal:
                found += ["", "::", ""]
            literal = True
            found.append(f"    {line}")
            continue
        if literal:
            found.append("")
        literal = False
        if line.startswith("- ") and found and not found[-1].startswith(("- ", " ")) and found[-1]:
            found.append("")
        found.append(escaped(line))
    return found


def escaped(line: str) -> str:
    """A line in which `|` and a lone `*` are themselves, outside names."""
    parts = re.split(r"(``.*?``|`[^`]*`)", line)
    for k in range(0, len(parts), 2):
        parts[k] = re.sub(r"(?<!\*)\*(?!\*)", r"\\*", parts[k].replace("|", r"\|"))
        parts[k] = re.sub(r"(\w)_(?!\w)", r"\1\\_", parts[k])
    return "".join(parts)


def read(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Before numpydoc sees a docstring."""
    lines[:] = [] if lines[:1] and lines[0].startswith("Alias for field number") else readable(lines)


def setup(app: Any) -> dict[str, bool]:
    """Join it to Sphinx."""
    app.connect("autodoc-process-docstring", read, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
