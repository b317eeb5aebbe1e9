"""The command `mcdem`: one file of `mcdem/commands/` for each of its subcommands.

Exit codes: 0 done; 1 a defect of the program, with its traceback; 2 something to mend in what was given, said in a line;
3 `mcdem check` warns; 130 interrupted, what was computed is kept.
"""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperGroup

from mcdem.commands import (
    check,
    cost,
    describe,
    efficiency,
    encounter,
    figures,
    kernels,
    plot,
    report,
    run,
    sweep,
    thin,
    vary,
    view,
)
from mcdem.errors import UserError


class Commands(TyperGroup):
    """Subcommands that answer a user's mistake with its message instead of a traceback."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except UserError as problem:
            # Not through rich, which would take [flow] for a colour.
            typer.secho(f"error: {problem}", fg="red", err=True)
            raise typer.Exit(2) from None
        except KeyboardInterrupt:
            typer.secho("interrupted", err=True)
            raise typer.Exit(130) from None


app = typer.Typer(
    cls=Commands,
    help="Shear aggregation and breakup of colloids: Monte Carlo over encounters resolved by Stokesian dynamics.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
for module in (
    run,
    sweep,
    plot,
    figures,
    report,
    thin,
    encounter,
    view,
    efficiency,
    cost,
    vary,
    kernels,
    check,
    describe,
):
    app.command()(getattr(module, module.__name__.rpartition(".")[2]))


def main() -> None:
    """Entry point of the console script."""
    app(prog_name="mcdem")
