"""What a command line program answers, for both packages: a mistake in one line, an interruption with its exit code."""

from __future__ import annotations

import sys
from typing import Any, ClassVar

import typer
from typer.core import TyperGroup

from pbekit import endings
from pbekit.files import said_of_system


class Program(TyperGroup):
    """Subcommands that answer a user's mistake with its message, and a refusal of the system with its reason."""

    mistakes: ClassVar[type[Exception]]
    """Exceptions whose message is for the user."""

    def invoke(self, ctx: Any) -> Any:
        """Run the subcommand."""
        try:
            done = super().invoke(ctx)
            sys.stdout.flush()
            return done
        except self.mistakes as problem:
            said = str(problem)
        except OSError as problem:
            why = said_of_system(problem)
            if why is None:
                raise
            said = why
        except KeyboardInterrupt as problem:
            endings.tell(problem)
            raise typer.Exit(endings.exit_code()) from None
        # Not through rich, which would take [flow] for a colour.
        typer.secho(f"error: {said}", fg="red", err=True)
        raise typer.Exit(2)
