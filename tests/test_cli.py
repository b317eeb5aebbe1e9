"""The command line: exit codes, one clear line for each mistake, nothing overwritten."""

import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

import mcdem
from mcdem.cli import app
from mcdem.progress import RunProgress

SCENES = Path(__file__).parent.parent / "scenes"


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


@pytest.mark.parametrize(
    "arguments", [["--help"], *([name, "--help"] for name in ("run", "plot", "describe"))]
)
def test_help(arguments):
    done = mcdem_command(*arguments)
    assert done.exit_code == 0
    assert "Usage: mcdem" in done.output


def test_runs_as_a_module():
    done = subprocess.run(
        [sys.executable, "-m", "mcdem", "describe", "run"], capture_output=True, text=True, check=True
    )
    assert "[run]" in done.stdout
    assert done.stderr == ""


def test_describe_lists_units_defaults_and_meaning():
    listing = mcdem_command("describe").output
    assert 'radius  a positive length, such as "500 nm"' in listing
    assert "lubrication_cutoff  a non-negative number, such as 0.5; default 0.005" in listing
    assert "Poisson" not in mcdem_command("describe", "flow").output
    assert refusal("describe", "flwo").startswith('no table "flwo"; known are suspension, flow')


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("radius", "radios", '[suspension] unknown key "radios"; did you mean "radius"?'),
        (
            '"1e4 1/s"',
            '"0 1/s"',
            '[flow] shear_rate = "0 1/s" is not positive; expected a positive rate, such as "1e4 1/s"',
        ),
        (
            "1e-4",
            "nan",
            "[suspension] volume_fraction = nan is not finite; expected a positive number, such as 0.5",
        ),
    ],
)
def test_a_bad_scene_is_refused_and_nothing_written(tmp_path, old, new, words):
    scene = tmp_path / "bad.toml"
    scene.write_text((SCENES / "quickstart.toml").read_text().replace(old, new))
    output = tmp_path / "out.nc"
    assert refusal("run", scene, "-o", output) == f"{scene}: {words}"
    assert not output.exists()


def test_a_missing_scene(tmp_path):
    missing = tmp_path / "none.toml"
    assert refusal("run", missing) == f"{missing}: cannot be read: No such file or directory"


def test_an_existing_output_is_kept(tmp_path):
    output = tmp_path / "precious.nc"
    output.write_text("precious")
    message = refusal("run", SCENES / "quickstart.toml", "-o", output)
    assert message == f"{output} exists; give another name, or --overwrite to replace it"
    assert output.read_text() == "precious"
    assert refusal("run", SCENES / "quickstart.toml", "-o", tmp_path).startswith(f"{tmp_path} is a folder")


@pytest.mark.parametrize(
    ("until", "words"),
    [
        ("10 Pa", "has the wrong dimension (Pa)"),
        ("10", "has no unit"),
        ("0 s", "is not positive"),
        ("nan s", "is not finite"),
        ("soon", "is not a number with a unit that can be read"),
    ],
)
def test_until_carries_a_unit(tmp_path, until, words):
    message = refusal("run", SCENES / "quickstart.toml", "-o", tmp_path / "out.nc", "--until", until)
    assert message == f'--until "{until}" {words}; expected a positive time, such as "10 s"'


def test_usage_errors_exit_with_2():
    assert mcdem_command("run").exit_code == 2
    assert mcdem_command("run", SCENES / "quickstart.toml", "--events", "0").exit_code == 2
    assert mcdem_command("rum").exit_code == 2


def test_progress_away_from_a_terminal_is_plain_lines(capsys):
    scene = mcdem.load_scene(SCENES / "quickstart.toml")
    console = Console(file=sys.stdout, force_terminal=False, width=200)
    with RunProgress(scene, console=console, interval=-1.0) as progress:
        progress(2.5, 40, 1.25, {"missed": 30, "aggregation": 10, "exchange": 0})
    line = capsys.readouterr().out
    assert line.strip() == "25 %  t = 2.5 s, 40 events, <P> = 1.25 (30 missed, 10 aggregation)"


def test_progress_follows_the_nearer_stop(capsys):
    scene = mcdem.load_scene(SCENES / "quickstart.toml")
    console = Console(file=sys.stdout, force_terminal=False, width=200)
    with RunProgress(scene, until=10.0, events=100, console=console, interval=-1.0) as progress:
        progress(2.5, 40, 1.0, {})
        progress(5.0, 41, 1.0, {})
    shares = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert shares == ["40", "50"]
