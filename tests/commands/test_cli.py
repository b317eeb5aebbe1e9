"""The command line: exit codes, one clear line for each mistake, nothing overwritten."""

import re
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
from asked import mcdem_command, refusal
from rich.console import Console

from mcdem.monte_carlo.run_control import RunProgress
from pbekit.errors import RangeWarning
from pbekit.program import warnings_in_a_line
from pbekit.progress import ProgressBar

SCENES = Path(__file__).parents[2] / "scenes"


@pytest.mark.parametrize(
    "arguments",
    [["--help"], *([name, "--help"] for name in ("run", "plot", "encounter", "efficiency", "describe"))],
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
    assert 'radius  a length from 0.1 nm to 1 cm, such as "500 nm"' in listing
    assert "lubrication_cutoff  a number from 0 to 10, such as 5e-3; default 0.005" in listing
    assert "Poisson" not in mcdem_command("describe", "flow").output
    assert refusal("describe", "flwo").startswith('no table "flwo"; known are suspension, flow')


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("radius", "radios", '[suspension] unknown key "radios"; did you mean "radius"?'),
        (
            '"1e4 1/s"',
            '"0 1/s"',
            '[flow] shear_rate = "0 1/s" is not positive; expected a rate from 1e-9 1/s to 1e12 1/s, such as "1e4 1/s"',
        ),
        (
            "1e-4",
            "nan",
            "[suspension] volume_fraction = nan is not finite; expected a number from 1e-15 to 0.74, such as 1e-4",
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
    message = refusal("run", SCENES / "quickstart.toml", "-o", output, "--workers", 1)
    assert str(output) in message
    assert "--overwrite" in message
    assert output.read_text() == "precious"
    assert str(tmp_path) in refusal("run", SCENES / "quickstart.toml", "-o", tmp_path, "--workers", 1)


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
    assert message == f'--until "{until}" {words}; expected a time from 1e-15 s to 1e15 s, such as "10 s"'


def test_plot_refuses_what_is_no_dataset_and_what_is_no_figure(tmp_path):
    foreign, figure = tmp_path / "foreign.nc", tmp_path / "figure.png"
    foreign.write_text("not NetCDF")
    for file, reason in [
        (foreign, "Unknown file format"),
        (tmp_path / "none.nc", "no such file"),
    ]:
        message = refusal("plot", file, "-o", figure)
        assert message.startswith(f"{file}: ")
        assert reason in message
    assert not figure.exists()
    assert (
        refusal("plot", foreign, "-o", tmp_path) == f"{tmp_path}: a folder, expected the name of a file in it"
    )


def test_an_encounter_is_said_in_words():
    done = mcdem_command("encounter", SCENES / "paper-750Pa.toml", "--offset", "0 nm", "250 nm")
    assert done.exit_code == 0, done.output
    said = dict(re.split(r"\s{2,}", line, maxsplit=1) for line in done.stdout.splitlines())
    assert said["outcome"] == "aggregation"
    assert said["products"] == "2 primaries"
    assert said["offset"] == "x0 = 0 m, y0 = 2.5e-07 m"
    assert re.fullmatch(r"[\d.e-]+ s \(strain [\d.]+\)", said["first contact"])
    assert re.fullmatch(r"[\d.e-]+ N \(0\.\d\d of pull-off\)", said["largest tension"])


def test_aggregates_and_offsets_are_refused_by_name(tmp_path):
    scene = SCENES / "paper-750Pa.toml"
    apart, flat, words = tmp_path / "apart.txt", tmp_path / "flat.txt", tmp_path / "words.txt"
    apart.write_text("0 0 0\n0 0 3\n")
    flat.write_text("0 0\n0 2\n")
    words.write_text("carbon 0 0\n")
    overlapping = tmp_path / "overlapping.txt"
    overlapping.write_text("0 0 0\n0 0 1.5\n")
    for given, reason in [
        ("0", "expected 1 to 1000 primaries"),
        (apart, "do not touch"),
        (overlapping, "overlap"),
        (flat, "expected a row x y z for each primary, found 2 columns"),
        (words, "not a table of numbers"),
        (tmp_path / "none.txt", "cannot be read"),
    ]:
        message = refusal("encounter", scene, "-j", given)
        assert message.startswith(f"--second {given}: ")
        assert reason in message
    message = refusal("encounter", scene, "--offset", "0 nm", "300 Pa")
    assert message.startswith('--offset "300 Pa" has the wrong dimension (Pa); expected a length')


@pytest.mark.parametrize(("ended_by", "code"), [("time", 0), ("events", 0), ("interruption", 130)])
def test_exit_code_marks_an_interrupted_run(tmp_path, monkeypatch, ended_by, code):
    from mcdem.monte_carlo import run_control

    asked = {}

    def run(scene, output, **options):
        asked.update(options, scene=scene.name, output=output)
        return run_control.RunSummary(output, 1.5, 7, {"missed": 7}, ended_by, 7, 0, 0.1)

    monkeypatch.setattr(run_control, "run", run)
    output = tmp_path / "out.nc"
    options = ["--seed", 5, "--until", "1500 ms", "--events", 7, "--workers", 1, "--resume"]
    done = mcdem_command("run", SCENES / "quickstart.toml", "-o", output, *options)
    assert done.exit_code == code, done.output
    assert done.stdout == f"{output}: t = 1.5 s, 7 events (7 missed); ended by {ended_by}\n"
    assert ("--resume" in done.stderr) == (code == 130)
    passed = {key: asked[key] for key in ("seed", "until", "events", "workers", "resume", "overwrite")}
    assert passed == dict(seed=5, until=1.5, events=7, workers=1, resume=True, overwrite=False)
    assert (asked["scene"], asked["output"]) == ("quickstart", output)


def test_usage_errors_exit_with_2():
    assert mcdem_command("run").exit_code == 2
    assert mcdem_command("run", SCENES / "quickstart.toml", "--events", "0").exit_code == 2
    assert mcdem_command("rum").exit_code == 2


def where_it_stands(**changes):
    known = dict(
        time=2.5, events=40, mean_size=1.25, outcomes={"missed": 30, "aggregation": 10, "exchange": 0}
    )
    return RunProgress(**(known | dict(aggregates=10, done=0.25, remaining=90.4, elapsed=30.0) | changes))


def test_a_run_says_time_events_outcomes_size_and_time_left():
    words = "t = 2.5 s, 40 events (30 missed, 10 aggregation), <P> = 1.25"
    assert str(where_it_stands()) == f"{words}, 0:01:30 left"
    assert str(where_it_stands(remaining=None)) == words
    # The first encounters wait for the compiler.
    assert str(where_it_stands(done=0.005)) == words


def test_without_a_terminal_a_line_comes_now_and_then(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("pbekit.progress.clock.monotonic", lambda: now[0])
    console = Console(file=sys.stdout, force_terminal=False, width=20)
    with ProgressBar("quickstart", console=console) as patient:
        for now[0], share in ((0.0, 0.0), (29.0, 0.25), (31.0, 0.5), (32.0, 0.6), (62.0, None)):
            patient("[so] many events of a long line", share)
    with ProgressBar("film", at_once=True, console=console) as impatient:
        impatient("1 of 2 pictures", 0.5)
    assert capsys.readouterr().out.splitlines() == [
        "quickstart: 50%, [so] many events of a long line",
        "quickstart: [so] many events of a long line, 0:01:02 until now",
        "film: 50%, 1 of 2 pictures",
    ]


def test_on_a_terminal_a_bar_stays_readable(capsys):
    console = Console(file=sys.stdout, force_terminal=True, width=140, color_system=None)
    with ProgressBar("quickstart", console=console) as progress:
        progress(str(where_it_stands()), 0.25)
        progress.line("nothing of this")
    shown = capsys.readouterr().out
    assert "quickstart" in shown and "nothing" not in shown
    assert "25% t = 2.5 s, 40 events (30 missed, 10 aggregation), <P> = 1.25, 0:01:30 left" in shown


def test_warnings_of_libraries_do_not_reach_the_terminal(capsys):
    """Ours are a line each; a library's are for developers, who ask for them by -W."""
    with warnings_in_a_line():
        warnings.simplefilter("always")
        warnings.warn("numba will drop this", DeprecationWarning, stacklevel=1)
        warnings.warn("overflow encountered", RuntimeWarning, stacklevel=1)
        warnings.warn("q is outside its range", RangeWarning, stacklevel=1)
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.strip() == "warning: q is outside its range"
