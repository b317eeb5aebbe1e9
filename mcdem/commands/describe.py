"""`mcdem describe`: every key that a scene file may have."""

from __future__ import annotations

from itertools import groupby
from typing import Annotated

import typer

from mcdem.errors import UserError


def describe(
    table: Annotated[str | None, typer.Argument(help="Only this table, such as flow.")] = None,
) -> None:
    """List the keys of a scene file: what to write, the default and the meaning of each."""
    from rich.console import Console
    from rich.padding import Padding
    from rich.text import Text

    from mcdem.scene import describe as keys_of_a_scene

    known = keys_of_a_scene()
    chosen = [
        key for key in known if table is None or key.table == table or key.table.startswith(f"{table}.")
    ]
    if not chosen:
        raise UserError(
            f'no table "{table}"; known are {", ".join(dict.fromkeys(key.table for key in known))}'
        )
    console = Console(soft_wrap=False)
    for name, keys in groupby(chosen, key=lambda key: key.table):
        header, *entries = keys
        console.print(Text.assemble((f"\n[{name}]", "bold"), f"  {header.meaning}"))
        for entry in entries:
            default = "" if entry.default == "required" else f"; default {entry.default}"
            console.print(Text.assemble("  ", (entry.key, "cyan"), f"  {entry.expected}", (default, "green")))
            console.print(Padding(Text(entry.meaning), (0, 0, 0, 6), expand=False))
