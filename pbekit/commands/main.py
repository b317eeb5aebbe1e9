"""The command `pbekit`: one file of `pbekit/commands/` for each of its subcommands.

Exit codes as of mcdem: 0 done; 2 something to mend in what was given; 130, 143, 129 interrupted (`pbekit.endings`).
"""

from __future__ import annotations

from pbekit.errors import PBEError
from pbekit.program import Program, program

COMMANDS = ("solve", "compare", "stresses", "show", "export", "efficiency")
"""Files beside this one, each with the function of its name."""


class Commands(Program):
    """Subcommands of pbekit."""

    mistakes = PBEError


app = program(
    Commands,
    "pbekit.commands",
    COMMANDS,
    "Population balances in size and shape, on tables of encounters that mcdem kernels wrote.",
)
