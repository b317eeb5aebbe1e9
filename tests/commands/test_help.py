"""What the help of a command says is what was written for it: nothing is swallowed on the way to the screen."""

from __future__ import annotations

import re

import pytest
from typer.main import get_command
from typer.testing import CliRunner

import mcdem.commands.main
import pbekit.commands.main

APPS = {"mcdem": mcdem.commands.main.app, "pbekit": pbekit.commands.main.app}
COMMANDS = [(name, command) for name, app in APPS.items() for command in get_command(app).commands]


@pytest.mark.parametrize(("name", "command"), COMMANDS)
def test_help_shows_every_word(name, command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    monkeypatch.setenv("NO_COLOR", "1")
    shown = CliRunner().invoke(APPS[name], [command, "--help"]).output
    found = get_command(APPS[name]).commands[command]
    texts = [found.help or "", *(getattr(p, "help", "") or "" for p in found.params)]
    for text in texts:
        for word in re.findall(r"\S+", text.partition("\f")[0]):
            plain = word.strip("`*\\")
            assert plain.replace("`", "").replace("\\", "") in shown, f"{word!r} of {text!r} is not shown"
