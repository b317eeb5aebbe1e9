"""The command `mcdem`: one file of `mcdem/commands/` for each of its subcommands.

Exit codes: 0 done; 1 a defect of the program, with its traceback; 2 something to mend in what was given, said in a line;
3 `mcdem check` warns; 130, 143, 129 interrupted by Ctrl-C, SIGTERM, SIGHUP, what was computed is kept (`pbekit.endings`).
"""

from __future__ import annotations

import sys
from typing import Any

import typer
from typer.core import TyperGroup

from mcdem.commands import (
    check,
    compress,
    cost,
    describe,
    efficiency,
    encounter,
    figures,
    kernels,
    plot,
    report,
    run,
    sensitivity,
    sweep,
    view,
)
from mcdem.errors import UserError
from pbekit import endings

NOW_CALLED = {"thin": "compress", "vary": "sensitivity"}
"""Earlier names of subcommands."""


class Commands(TyperGroup):
    """Subcommands that answer a user's mistake with its message instead of a traceback."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and args[0] in NOW_CALLED:
            ctx.fail(f"`mcdem {args[0]}` is now `mcdem {NOW_CALLED[args[0]]}`.")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            done = super().invoke(ctx)
            sys.stdout.flush()
            return done
        except UserError as problem:
            # Not through rich, which would take [flow] for a colour.
            typer.secho(f"error: {problem}", fg="red", err=True)
            raise typer.Exit(2) from None
        except OSError as problem:
            from pbekit.files import said_of_system

            if (said := said_of_system(problem)) is None:
                raise
            typer.secho(f"error: {said}", fg="red", err=True)
            raise typer.Exit(2) from None
        except KeyboardInterrupt as problem:
            endings.tell(problem)
            raise typer.Exit(endings.exit_code()) from None


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
    compress,
    encounter,
    view,
    efficiency,
    cost,
    sensitivity,
    kernels,
    check,
    describe,
):
    app.command()(getattr(module, module.__name__.rpartition(".")[2]))


def main() -> None:
    """The command, where the console script of an older installation looks for it."""
    endings.program(lambda: app(prog_name="mcdem"))
