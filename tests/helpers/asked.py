"""Commands as a user types them."""

from __future__ import annotations

from typer.testing import CliRunner

from mcdem.commands.main import app


def mcdem_command(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="mcdem")


def refusal(*arguments):
    """The line on stderr with which a command is refused, exit code 2."""
    done = mcdem_command(*arguments)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    message = done.stderr.strip()
    assert message.startswith("error: ")
    assert "\n" not in message
    return message.removeprefix("error: ")
