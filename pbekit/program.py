"""A command line program, for both packages: its subcommands, and what it answers to mistakes and interruptions."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import typer
from typer.core import TyperGroup

from pbekit import endings
from pbekit.files import said_of_system


class Program(TyperGroup):
    """Subcommands that answer a user's mistake with its message, and a refusal of the system with its reason."""

    mistakes: ClassVar[type[Exception]]
    """Exceptions whose message is for the user."""
    renamed: ClassVar[Mapping[str, str]] = {}
    """{earlier name of a subcommand: today's}"""

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
            endings.say(problem)
            raise typer.Exit(endings.exit_code()) from None
        # Not through rich, which would take [flow] for a colour.
        typer.secho(f"error: {said}", fg="red", err=True)
        raise typer.Exit(2)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The subcommand that is asked for; an earlier name is answered with today's."""
        if args and args[0] in self.renamed:
            name = ctx.info_name
            ctx.fail(f"`{name} {args[0]}` is now `{name} {self.renamed[args[0]]}`.")
        return super().resolve_command(ctx, args)


def program(answers: type[Program], package: str, commands: Sequence[str], purpose: str) -> typer.Typer:
    """The program whose subcommands are functions of a package, each in a file of its own name.

    Parameters
    ----------
    answers : to mistakes and to earlier names
    package : in which the files are
    commands : their names, in the order in which the help lists them
    purpose : first line of the help
    """
    app = typer.Typer(
        cls=answers,
        help=purpose,
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode="markdown",
    )
    for name in commands:
        app.command()(getattr(importlib.import_module(f"{package}.{name}"), name))
    return app


def finite(value: float | None) -> float | None:
    """A callback of options that are numbers: typer's bounds let nan and inf pass."""
    if value is not None and not math.isfinite(value):
        raise typer.BadParameter(f"{value} is not a finite number")
    return value


def checked(check: Callable[[Any], object]) -> Callable[[Any], Any]:
    """A callback of an option that `check` refuses by raising, if it is given."""

    def callback(value: Any) -> Any:
        if value is not None:
            check(value)
        return value

    return callback
