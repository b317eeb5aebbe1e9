"""The command `mcdem`: one file of `mcdem/commands/` for each of its subcommands.

Exit codes: 0 done; 1 a defect of the program, with its traceback; 2 something to mend in what was given, said in a line;
3 `mcdem check` warns; 130, 143, 129 interrupted by Ctrl-C, SIGTERM, SIGHUP, what was computed is kept (`pbekit.endings`).
"""

from __future__ import annotations

from mcdem.errors import UserError
from pbekit.program import Program, program

COMMANDS = (
    "run",
    "sweep",
    "plot",
    "figures",
    "report",
    "compress",
    "encounter",
    "view",
    "efficiency",
    "cost",
    "sensitivity",
    "kernels",
    "check",
    "describe",
)
"""Files beside this one, each with the function of its name."""
NOW_CALLED = {"thin": "compress", "vary": "sensitivity"}
"""Earlier names of subcommands."""


class Commands(Program):
    """Subcommands of mcdem; earlier names are answered with today's."""

    mistakes = UserError
    renamed = NOW_CALLED


app = program(
    Commands,
    "mcdem.commands",
    COMMANDS,
    "Shear aggregation and breakup of colloids: Monte Carlo over encounters resolved by Stokesian dynamics.",
)
