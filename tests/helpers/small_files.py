"""Small files of every kind that the programs write, and a folder of what commands are given."""

from __future__ import annotations

import shutil
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import synthetic

from mcdem.encounter.trajectory import Trajectory, export
from mcdem.monte_carlo.run_control import run
from pbekit.tables.kernel_table import KernelTable

ROOT = Path(__file__).parents[2]
RUN_OF_BEFORE = ROOT / "tests/monte_carlo/run_of_before.nc"
TABLE_OF_BEFORE = ROOT / "notebooks/data/designed-750Pa.nc"


def course(frames: int = 3) -> Trajectory:
    """Two primaries that part."""
    z = np.linspace(2.0, 9.0, frames)
    positions = np.zeros((frames, 2, 3))
    positions[:, 1, 2] = 1e-7 * z
    return Trajectory(
        1e-7,
        1e4,
        1e-9,
        1e-4 * np.arange(frames),
        positions,
        np.full((frames, 2, 2), np.nan),
        np.array([0, 1]),
    )


def make_run(path: Path) -> None:
    run(synthetic.scene(), path, events=2, encounter=synthetic.always_miss, overwrite=True)


def make_table(path: Path) -> None:
    table_of_synthetic_encounters().save(path)


@cache
def table_of_synthetic_encounters() -> KernelTable:
    whole = KernelTable.load(TABLE_OF_BEFORE)
    return whole.with_records(whole.records.select(np.arange(100)))


@cache
def small_run() -> Path:
    path = Path(tempfile.mkdtemp(prefix="files")) / "run.nc"
    make_run(path)
    return path


def names(folder: Path) -> list[str]:
    """What a folder holds."""
    return sorted(file.name for file in folder.iterdir())


def given_to_commands(folder: Path) -> Path:
    """The folder with a run, a table, a trajectory and a scene."""
    shutil.copy(RUN_OF_BEFORE, folder / "run.nc")
    shutil.copy(TABLE_OF_BEFORE, folder / "kernels.nc")
    export(course(), folder / "course.nc")
    shutil.copy(ROOT / "scenes/quickstart.toml", folder / "quickstart.toml")
    return folder
