"""Every member of a sweep is a run like any other, made once."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import synthetic
import xarray as xr

from mcdem.errors import UserError
from mcdem.monte_carlo import process as simulate
from mcdem.monte_carlo.sweep import members, parse_setting, sweep
from mcdem.netcdf.comparison import differences

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
    simulate.run(one.scene, alone, seed=one.seed, events=60, encounter=synthetic.aggregation_and_breakup)
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
    told = []
    again = run(tmp_path, progress=told.append, encounter=synthetic.broken)
    assert [member.state for member in again] == ["done"] * 4
    assert stamps() == before and told == []
    longer = run(tmp_path, events=90)
    assert [member.events for member in longer] == [90] * 4
    assert [member.seed for member in longer] == [member.seed for member in first]
    grown = run(tmp_path, {**SETTINGS, "population.initial": ["30", "50", "70"]}, events=90)
    assert len(grown) == 6 and all(member.state == "done" for member in grown)


def test_a_failed_member_tells_why_and_does_not_stop_the_others(tmp_path):
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
    assert parse_setting("flow.shear_stress=750Pa, 1 kPa") == ("flow.shear_stress", ["750Pa", "1 kPa"])
    with pytest.raises(UserError, match="viscosity"):
        run(tmp_path / "sweep", {"flow.viscosity": ["75 mPa s", "100 Hz"]})
    with pytest.raises(UserError, match="twice"):
        run(tmp_path / "sweep", {"flow.viscosity": ["75 mPa s", "75 mPa s"]})
    assert not (tmp_path / "sweep").exists()


def start(folder: Path, workers: int, encounter: str) -> subprocess.Popen[str]:
    paths = os.pathsep.join([str(SCRIPT.parents[2]), str(SCRIPT.parent)])
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), str(folder), str(workers), encounter],
        env=os.environ | {"PYTHONPATH": paths},
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_asked_to_stop_every_member_keeps_what_it_has(tmp_path, number):
    process = start(tmp_path, 2, "unhurried_aggregation_and_breakup")
    end = time.monotonic() + 60.0
    while len(list(tmp_path.glob("*.nc"))) < 2:
        assert time.monotonic() < end
        time.sleep(0.01)
    process.send_signal(number)
    told, _ = process.communicate(timeout=600)
    states = told.split()
    assert process.returncode == 0 and len(states) == 4
    assert states.count("interrupted") >= 1 and set(states) <= {"interrupted", "waiting", "done"}
    for row in index(tmp_path):
        if row["state"] == "interrupted":
            assert xr.open_dataset(tmp_path / row["file"]).sizes["row"] == int(row["events"]) + 1


def test_a_dead_worker_fails_its_member_alone(tmp_path):
    process = start(tmp_path, 2, "deadly_in_one")
    told, _ = process.communicate(timeout=600)
    assert told.split().count("failed") == 1 and told.split().count("done") == 3
    assert [row["why"] for row in index(tmp_path) if row["why"]] == [
        "its worker died: of lack of memory, or killed"
    ]
