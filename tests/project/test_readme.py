"""What README says is so: its two commands run, what it names is there, and it fits on a screen and a half."""

import re
import shlex
from pathlib import Path

from typer.testing import CliRunner

import mcdem.commands.main
import pbekit.commands.main

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_quickstart_runs(tmp_path, monkeypatch):
    """Word for word, but for the installation and with a stop after three encounters."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    (command,) = re.findall(r"<!-- quickstart -->\n```bash\n(.*)\n```", README)
    words = [shlex.split(part)[1:] for part in command.split(" && ") if part.startswith(".venv/bin/mcdem ")]
    assert [arguments[0] for arguments in words] == ["run", "plot"]
    for arguments in (words[0] + ["--events", "3", "--workers", "1"], words[1]):
        done = CliRunner().invoke(mcdem.commands.main.app, arguments)
        assert done.exit_code == 0, done.output
    picture = words[1][words[1].index("-o") + 1]
    assert f'<img src="docs/{picture}"' in README
    assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")


def test_its_questions_have_commands():
    rows = re.findall(r"^\| .*\? \| (.*) \|$", README, re.MULTILINE)
    assert len(rows) == 6
    known = {"mcdem": mcdem.commands.main.COMMANDS, "pbekit": pbekit.commands.main.COMMANDS}
    for program, command in re.findall(r"`(mcdem|pbekit) (\w+)", "".join(rows)):
        assert command in known[program]


def test_what_it_links_to_is_there():
    places = re.findall(r"\]\(([^)#]+)\)", README) + re.findall(r'src="([^"]+)"', README)
    assert len(places) > 8
    assert not [place for place in places if not (ROOT / place).exists()]


def test_it_fits_on_a_screen_and_a_half():
    assert len(README.splitlines()) < 80
