"""The dictionary format that OpenFOAM and OpenQBMM read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def dictionary(entries: Mapping[str, Any], depth: int = 0) -> str:
    """Entries, sub-dictionaries and lists of named dictionaries, in the format of OpenFOAM's files."""
    pad, lines = "    " * depth, []
    for name, value in entries.items():
        if isinstance(value, Mapping):
            lines += [f"{pad}{name}", f"{pad}{{", dictionary(value, depth + 1), f"{pad}}}"]
        elif isinstance(value, list):
            lines += [f"{pad}{name}", f"{pad}("]
            for item, inner in value:
                lines += [f"{pad}    {item}", f"{pad}    {{", dictionary(inner, depth + 2), f"{pad}    }}"]
            lines.append(f"{pad});")
        else:
            text = f"{value:.10g}" if isinstance(value, float) else str(value)
            lines.append(f"{pad}{name} {text};")
    return "\n".join(line for line in lines if line)


def file(comment: str, entries: Mapping[str, Any]) -> str:
    """A file of entries, with a comment that says what it is."""
    lines = "\n".join(f"// {line}".rstrip() for line in comment.splitlines())
    return f"{lines}\n\n{dictionary(entries)}\n"
