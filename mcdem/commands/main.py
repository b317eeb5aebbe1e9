"""The command `mcdem`: one file of `mcdem/commands/` for each of its subcommands.

Exit codes: 0 done; 1 a defect of the program, with its traceback; 2 something to mend in what was given, said in a line;
3 `mcdem check` warns; 130, 143, 129 interrupted by Ctrl-C, SIGTERM, SIGHUP, what was computed is kept (`pbekit.endings`).
"""

from __future__ import annotations

from typing import Any

import typer

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
from pbekit.program import Program

NOW_CALLED = {"thin": "compress", "vary": "sensitivity"}
"""Earlier names of subcommands."""


class Commands(Program):
    """Subcommands of mcdem; earlier names are answered with today's."""

    mistakes = UserError

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and args[0] in NOW_CALLED:
            ctx.fail(f"`mcdem {args[0]}` is now `mcdem {NOW_CALLED[args[0]]}`.")
        return super().resolve_command(ctx, args)


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
