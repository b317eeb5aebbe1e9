"""A command line program, for both packages: its subcommands, and what it answers to mistakes and interruptions."""

from __future__ import annotations

import contextlib
import importlib
import math
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, TextIO

import typer
from typer.core import TyperGroup

from pbekit import endings
from pbekit.files import said_of_system
from pbekit.version import __version__

OURS = ("mcdem", "pbekit")
"""Packages whose warnings are for users."""


@contextlib.contextmanager
def warnings_in_a_line() -> Iterator[None]:
    """Within, a warning of ours is a line on the terminal; those of libraries are for developers, who ask for them by -W."""
    shown = warnings.showwarning

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if category.__module__.partition(".")[0] in OURS:
            typer.secho(f"warning: {message}", fg="yellow", err=True)
        elif sys.warnoptions:
            shown(message, category, filename, lineno, file, line)

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


class Program(TyperGroup):
    """Subcommands that answer a user's mistake with its message, and a refusal of the system with its reason."""

    mistakes: ClassVar[type[Exception]]
    """Exceptions whose message is for the user."""
    renamed: ClassVar[Mapping[str, str]] = {}
    """{earlier name of a subcommand: today's}"""

    def invoke(self, ctx: Any) -> Any:
        """Run the subcommand."""
        try:
            with warnings_in_a_line():
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
    app.callback()(_with_version)
    for name in commands:
        app.command()(getattr(importlib.import_module(f"{package}.{name}"), name))
    return app


def _say_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"pbekit {__version__}")
        raise typer.Exit


def _with_version(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_say_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    """Options of the program itself."""


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
