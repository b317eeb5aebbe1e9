"""A file that is damaged, cut off, or of another kind is refused by its name, in one line; nothing of it is believed."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest
import synthetic
from small_files import (
    RUN_OF_BEFORE,
    TABLE_OF_BEFORE,
    course,
    given_to_commands,
    make_run,
    make_table,
)
from typer.testing import CliRunner

from mcdem.commands import main as mcdem_cli
from mcdem.encounter.trajectory import export, read
from mcdem.errors import DataFileError
from mcdem.monte_carlo.compress import compress
from mcdem.monte_carlo.record import opened
from mcdem.monte_carlo.run_control import run
from mcdem.monte_carlo.sweep import sweep
from pbekit.checksum import SEAL, SEALED
from pbekit.commands import main as pbekit_cli
from pbekit.errors import PBEError
from pbekit.tables.kernel_table import KernelTable


@pytest.fixture(scope="module")
def given(tmp_path_factory) -> Path:
    return given_to_commands(tmp_path_factory.mktemp("given"))


READING = {
    "plot": ("mcdem", "plot {damaged} -o out.png"),
    "figures": ("mcdem", "figures {damaged} -o out"),
    "report": ("mcdem", "report {damaged} -o out.html"),
    "compress": ("mcdem", "compress {damaged} -o out.nc"),
    "view": ("mcdem", "view {damaged} -o out.html"),
    "run": ("mcdem", "run {given}/quickstart.toml -o {damaged} --resume --events 1 --workers 1"),
    "kernels": ("mcdem", "kernels {given}/quickstart.toml --from {damaged} -o out.nc --workers 1"),
    "cost": ("mcdem", "cost {given}/quickstart.toml --from {damaged} -o out.png --workers 1"),
    "sensitivity": (
        "mcdem",
        "sensitivity {given}/quickstart.toml --set flow.shear_stress=5Pa --from {damaged} -o out.png --workers 1",
    ),
    "solve": ("pbekit", "solve {damaged} -o out.nc"),
    "compare": ("pbekit", "compare {damaged} -o out"),
    "compare with a run": ("pbekit", "compare {given}/kernels.nc --run {damaged} -o out"),
    "stresses": ("pbekit", "stresses {damaged} {damaged} -o out"),
    "show": ("pbekit", "show {damaged}"),
}


@pytest.mark.parametrize("name", READING)
def test_a_command_reports_damage_in_a_line(given, tmp_path, monkeypatch, name):
    """A zeroed block, flipped bits and a lost end, in datasets with a checksum and without."""
    monkeypatch.chdir(tmp_path)
    program, words = READING[name]
    table = program == "pbekit" and name != "compare with a run"
    old = (TABLE_OF_BEFORE if table else RUN_OF_BEFORE).read_bytes()
    make = tmp_path / "sound.nc"
    (make_table if table else make_run)(make)
    new = make.read_bytes()
    make.unlink()
    damaged = tmp_path / "damaged.nc"
    app = {"mcdem": mcdem_cli.app, "pbekit": pbekit_cli.app}[program]
    for whole, sealed in ((new, True), (old, False)):
        half = len(whole) // 2
        contents = {
            "zeroed": whole[: half // 4] + bytes(len(whole) - half) + whole[half // 4 + len(whole) - half :],
            "no end": whole[:half],
            "no header": bytes(2000) + whole[2000:],
            "text": b"dear diary",
        }
        if sealed:
            contents["a bit"] = whole[: half // 2] + bytes([whole[half // 2] ^ 4]) + whole[half // 2 + 1 :]
            contents["no checksum"] = whole[: whole.rindex(SEAL)]
        for what, content in contents.items():
            damaged.write_bytes(content)
            done = CliRunner().invoke(app, words.format(given=given, damaged=damaged).split())
            assert done.exit_code == 2, (what, sealed, done.output, done.exception)
            said = [line for line in done.output.splitlines() if line.startswith("error: ")]
            assert len(said) == 1 and said[0].startswith(f"error: {damaged}: "), (what, sealed, done.output)
            assert damaged.read_bytes() == content
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == [damaged]


def test_a_flipped_seed_does_not_go_on_as_another_process(tmp_path):
    path = tmp_path / "run.nc"
    make_run(path)
    with opened(path) as (file,):
        seed = int(file.seed)
    content = bytearray(path.read_bytes())
    changed = 0
    for place in range(len(content)):
        if content[place : place + 8] == seed.to_bytes(8, "little"):
            content[place] ^= 1
            changed += 1
    assert changed
    path.write_bytes(content)
    with pytest.raises(DataFileError, match=r"run\.nc: .*damaged"):
        run(synthetic.scene(), path, events=9, resume=True, encounter=synthetic.always_miss)
    assert path.read_bytes() == content


def test_a_trajectory_is_whole_or_refused(tmp_path):
    path = tmp_path / "course.nc"
    export(course(), path)
    whole = path.read_bytes()
    np.testing.assert_allclose(read(path).positions, course().positions, rtol=1e-12)
    for place in range(0, len(whole), 41):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 16]) + whole[place + 1 :])
        with pytest.raises(DataFileError, match=r"course\.nc: "):
            read(path)
    # an earlier one: its end, without the line and the word of it
    path.write_bytes(whole[: whole.rindex(SEAL)].replace(SEALED.encode(), b"x" * len(SEALED)))
    np.testing.assert_allclose(read(path).time, course().time, rtol=1e-12)


def test_pipes_are_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.nc")
    for reading in (read, KernelTable.load, lambda path: compress(path, tmp_path / "out.nc")):
        with pytest.raises((DataFileError, PBEError), match="a named pipe"):
            reading(tmp_path / "pipe.nc")


def test_a_damaged_member_of_a_sweep_fails_by_name_and_the_others_run(tmp_path):
    settings = {"population.initial": ["20", "30", "40"]}

    def go_on(events: int):
        from mcdem.monte_carlo.executors import Here

        return sweep(
            synthetic.scene(),
            tmp_path,
            settings,
            events=events,
            executor=Here(),
            encounter=synthetic.always_miss,
        )

    assert {m.state for m in go_on(3)} == {"done"}
    damaged = tmp_path / "initial=30.1.nc"
    content = bytearray(damaged.read_bytes())
    content[2000:6000] = bytes(4000)
    damaged.write_bytes(content)
    found = go_on(5)
    assert [m.state for m in found] == ["done", "failed", "done"]
    assert found[1].why.startswith(f"{damaged}: ") and "damaged" in found[1].why
    assert [m.events for m in found] == [5, 0, 5]
    assert damaged.read_bytes() == content
    with (tmp_path / "index.csv").open(newline="") as file:
        row = list(csv.DictReader(file))[1]
    assert row["state"] == "failed" and row["why"] == found[1].why
