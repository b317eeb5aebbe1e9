"""Every member of a sweep is a run like any other, made once."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path

import pytest
import synthetic
import xarray as xr
from child_signals import as_in_a_terminal

from mcdem.errors import UserError
from mcdem.monte_carlo import run_control
from mcdem.monte_carlo.comparison import differences
from mcdem.monte_carlo.sweep import members, parse_setting, parse_settings, replaced, sweep

SETTINGS = {"flow.viscosity": ["75 mPa s", "100 mPa s"], "population.initial": ["30", "50"]}
SCRIPT = Path(__file__).parents[1] / "helpers" / "run_synthetic_sweep.py"


def run(folder: Path, settings=SETTINGS, **options):
    with ThreadPoolExecutor(2) as executor:
        given = {"events": 60, "encounter": synthetic.aggregation_and_breakup, **options}
        return sweep(synthetic.scene(**synthetic.SMALL), folder, settings, executor=executor, **given)


def index(folder: Path) -> list[dict[str, str]]:
    with (folder / "index.csv").open() as file:
        return list(csv.DictReader(file))


def test_members_are_runs_like_any_other(tmp_path):
    found = run(tmp_path, replicas=2)
    assert [member.state for member in found] == ["done"] * 8
    rows = index(tmp_path)
    assert [row["file"] for row in rows] == [member.file.name for member in found]
    assert (tmp_path / "viscosity=75_mPa_s,initial=30.1.nc").exists()
    assert {row["flow.viscosity"] for row in rows} == {"75 mPa s", "100 mPa s"}
    one = found[5]
    assert one.scene.flow.viscosity == pytest.approx(0.1) and one.scene.population.initial == 30
    alone = tmp_path / "alone.nc"
    run_control.run(one.scene, alone, seed=one.seed, events=60, encounter=synthetic.aggregation_and_breakup)
    assert differences(alone, one.file) == []


def test_members_draw_independent_numbers_and_keep_them_when_the_sweep_grows(tmp_path):
    scene = synthetic.scene()
    small = members(scene, {"flow.viscosity": ["75 mPa s"]}, 2, 7, tmp_path)
    large = members(scene, {"flow.viscosity": ["50 mPa s", "75 mPa s"]}, 3, 7, tmp_path)
    assert len({member.seed for member in large}) == 6
    assert {m.file: m.seed for m in small}.items() <= {m.file: m.seed for m in large}.items()
    assert not {m.seed for m in members(scene, {"flow.viscosity": ["75 mPa s"]}, 2, 8, tmp_path)} & {
        m.seed for m in small
    }


def test_what_is_finished_is_not_run_again_and_what_is_not_goes_on(tmp_path):
    def stamps() -> dict[str, int]:
        return {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*.nc")}

    first = run(tmp_path)
    before = stamps()
    said = []
    again = run(tmp_path, progress=said.append, encounter=synthetic.broken)
    assert [member.state for member in again] == ["done"] * 4
    assert stamps() == before and said == []
    longer = run(tmp_path, events=90)
    assert [member.events for member in longer] == [90] * 4
    assert [member.seed for member in longer] == [member.seed for member in first]
    grown = run(tmp_path, {**SETTINGS, "population.initial": ["30", "50", "70"]}, events=90)
    assert len(grown) == 6 and all(member.state == "done" for member in grown)


def test_a_failed_member_says_why_and_does_not_stop_the_others(tmp_path):
    (tmp_path / "viscosity=75_mPa_s,initial=30.1.nc").write_text("not a dataset")
    found = run(tmp_path)
    assert [member.state for member in found] == ["failed", "done", "done", "done"]
    assert "cannot be read" in index(tmp_path)[0]["why"]
    found = run(tmp_path / "broken", encounter=synthetic.broken)
    assert {member.state for member in found} == {"failed"}
    assert index(tmp_path / "broken")[0]["why"] == "ArithmeticError: three is a crowd"


@pytest.mark.parametrize(
    ("given", "cure"),
    [
        ("flow.shear_stress", "expected TABLE.KEY=VALUE"),
        ("shear_stress=750Pa", "expected TABLE.KEY=VALUE"),
        ("flow.shear_stress=750Pa,,875Pa", "expected TABLE.KEY=VALUE"),
    ],
)
def test_a_setting_that_is_none_is_refused(given, cure):
    with pytest.raises(UserError, match=cure):
        parse_setting(given)


def test_a_wrong_value_is_refused_before_anything_runs(tmp_path):
    for given, values in (
        ("[1, 2],[3]", ["[1, 2]", "[3]"]),
        ("[[1,0],[0,1]]", ["[[1,0],[0,1]]"]),
        ("['1 nm', '2, nm'],none", ["['1 nm', '2, nm']", "none"]),
        ('"a,b"', ['"a,b"']),
    ):
        assert parse_setting(f"suspension.radii={given}") == ("suspension.radii", values)
    assert parse_setting("flow.shear_stress=750Pa, 1 kPa") == ("flow.shear_stress", ["750Pa", "1 kPa"])
    with pytest.raises(UserError, match="viscosity"):
        run(tmp_path / "sweep", {"flow.viscosity": ["75 mPa s", "100 Hz"]})
    with pytest.raises(UserError, match="twice"):
        run(tmp_path / "sweep", {"flow.viscosity": ["75 mPa s", "75 mPa s"]})
    assert not (tmp_path / "sweep").exists()


def both_ways(*settings: str) -> list[dict[str, list[str]]]:
    return [parse_settings(list(order)) for order in (settings, settings[::-1])]


def test_names_and_index_say_what_the_scenes_say(tmp_path):
    """Two of the flow set together stay, in either order: what is written on a member is what runs in it."""
    scene = synthetic.scene()
    for settings in both_ways("flow.shear_stress=750Pa,10Pa", "flow.viscosity=1cP"):
        for member in members(scene, settings, 1, 7, tmp_path):
            flow, stress = member.scene.flow, float(member.settings["flow.shear_stress"].removesuffix("Pa"))
            assert (flow.shear_stress, flow.viscosity) == (
                stress,
                1e-3,
            ) and f"shear_stress={stress:g}Pa" in member.file.name
            for key, words in member.settings.items():
                assert member.scene.value_at(key) == words
    with pytest.raises(UserError, match="give exactly two of shear_rate, viscosity and shear_stress"):
        members(
            scene,
            parse_settings(["flow.shear_stress=1Pa", "flow.viscosity=1cP", "flow.shear_rate=5 1/s"]),
            1,
            7,
            tmp_path,
        )
    assert replaced(scene, ["flow.shear_stress"]) == [
        "flow.shear_stress given: flow.viscosity of the scene gives way"
    ]
    assert replaced(scene, ["flow.viscosity"]) == []


def test_values_are_split_between_brackets_and_quotes_only(tmp_path):
    shear, mixed = "[[0,0,0],[0,0,0],[0,1,0]]", "[[-0.7,0,0],[0,-0.3,0],[0,0,1]]"
    key, values = parse_setting(f"flow.gradient={shear},{mixed}")
    assert values == [shear, mixed]
    found = members(synthetic.scene(), {"flow.kind": ["linear"], key: values}, 1, 7, tmp_path)
    assert [m.scene.flow.gradient[2] for m in found] == [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    assert parse_setting("effects.jkr={a = '1,2', b = 3}, none")[1] == ["{a = '1,2', b = 3}", "none"]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["flow.viscosity=75 mPa s,75cP"], "viscosity=75cP and viscosity=75_mPa_s are the same scene"),
        (["flow.viscosity=75cP", "flow.viscosity=50cP"], "flow.viscosity is given twice"),
        (["flow.viscosity=75"], "viscosity = 75 has no unit"),
        (["population.initial=30 # few"], "initial = .* expected an integer"),
        (["population.initial=30\nrun.seed = 3"], "expected TABLE.KEY=VALUE"),
        (["run.seed=" + ",".join(map(str, range(20_000)))], "20000 members: expected at most 10000"),
        (["population.initial=" + "[" * 400], "expected an integer"),
        (["population.initial=" + "[" * 5000], "a value of more than 500 characters"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, settings, words):
    with pytest.raises(UserError, match=words) as caught:
        members(synthetic.scene(), parse_settings(settings), 1, 7, tmp_path)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def start(folder: Path, workers: int, encounter: str) -> subprocess.Popen[str]:
    paths = os.pathsep.join([str(SCRIPT.parents[2]), str(SCRIPT.parent)])
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), str(folder), str(workers), encounter],
        env=os.environ | {"PYTHONPATH": paths},
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=as_in_a_terminal,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_asked_to_stop_every_member_keeps_what_it_has(tmp_path, number):
    process = start(tmp_path, 2, "unhurried_aggregation_and_breakup")
    end = time.monotonic() + 60.0
    while len(list(tmp_path.glob("*.nc"))) < 2:
        assert time.monotonic() < end
        time.sleep(0.01)
    process.send_signal(number)
    said, _ = process.communicate(timeout=600)
    states = said.split()
    assert process.returncode == 0 and len(states) == 4
    assert states.count("interrupted") >= 1 and set(states) <= {"interrupted", "waiting", "done"}
    for row in index(tmp_path):
        if row["state"] == "interrupted":
            assert xr.open_dataset(tmp_path / row["file"]).sizes["row"] == int(row["events"]) + 1


class AskedTooEarly(Executor):
    """Every member is asked to stop before its dataset is opened."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        future.set_exception(KeyboardInterrupt())
        return future


def test_members_asked_before_they_began_wait(tmp_path):
    found = sweep(synthetic.scene(), tmp_path, {}, replicas=3, events=5, executor=AskedTooEarly())
    assert [member.state for member in found] == ["waiting"] * 3
    assert [row["state"] for row in index(tmp_path)] == ["waiting"] * 3


def test_a_dead_worker_fails_its_member_alone(tmp_path):
    process = start(tmp_path, 2, "deadly_in_one")
    said, _ = process.communicate(timeout=600)
    assert said.split().count("failed") == 1 and said.split().count("done") == 3
    assert [row["why"] for row in index(tmp_path) if row["why"]] == [
        "its worker died: of lack of memory, or killed"
    ]
