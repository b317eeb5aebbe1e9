"""Earlier names of keys: refused in a scene file with the new name, and renamed where a dataset holds them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import tomlkit

KEYS = {
    "numerics.max_step": "numerics.implicit.max_step",
    "numerics.event_step": "numerics.implicit.event_step",
    "numerics.far_field_lag": "numerics.implicit.far_field_tolerance",
    "numerics.paper_base_step": "numerics.explicit_euler.base_step",
    "numerics.paper_step_velocity": "numerics.explicit_euler.step_velocity",
    "numerics.paper_close_gap": "numerics.explicit_euler.close_gap",
    "numerics.end_inert": "numerics.end_stable",
    "numerics.pair_selection": "numerics.event_selection",
    "hydrodynamics.cutoff_reading": "hydrodynamics.cutoff_convention",
}
"""Old dotted key to new."""

VALUES = {
    ("numerics.scheme", "paper"): "explicit_euler",
    ("numerics.event_selection", "clocks"): "majorant_rejection",
    ("numerics.event_selection", "inversion"): "inverse_transform",
}
"""(New dotted key, old value) to new value."""


def _at(tables: Any, dotted: str) -> Any:
    for name in dotted.split("."):
        if not isinstance(tables, dict) or name not in tables:
            return None
        tables = tables[name]
    return tables


def old_words(tables: dict[str, Any]) -> Iterator[str]:
    """What to write instead of each earlier key or value in the tables of a scene, a line each."""
    for old, new in KEYS.items():
        if _at(tables, old) is not None:
            table, _, key = old.rpartition(".")
            place, _, name = new.rpartition(".")
            where = f"[{place}] {name}" if place != table else name
            yield f'[{table}] key "{key}" is now {where}: rename it'
    for (dotted, value), new in VALUES.items():
        if _at(tables, dotted) == value:
            table, _, key = dotted.rpartition(".")
            yield f'[{table}] {key} = "{value}" is now "{new}": rename it'


def renewed(text: str) -> str:
    """The text of a dataset's scene, with the present names of its keys and values."""
    document = tomlkit.parse(text)
    if not list(old_words(document.unwrap())):
        return text
    for old, new in KEYS.items():
        value = _at(document, old)
        if value is None:
            continue
        *tables, key = old.split(".")
        del _at(document, ".".join(tables))[key]
        place: Any = document
        *tables, key = new.split(".")
        for name in tables:
            place = place.setdefault(name, tomlkit.table())
        place[key] = value
    for (dotted, before), now in VALUES.items():
        if _at(document, dotted) == before:
            table, _, key = dotted.rpartition(".")
            _at(document, table)[key] = now
    return tomlkit.dumps(document)
