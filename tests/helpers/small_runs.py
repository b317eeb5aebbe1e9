"""Two small datasets made by `mcdem.monte_carlo.run_control` with toy encounters, once for all tests of a session."""

import tempfile
from functools import cache
from pathlib import Path

from toy_encounters import toy_encounter

from mcdem.monte_carlo.run_control import run
from mcdem.scene import load_scene

SCENES = Path(__file__).parents[2] / "scenes"


@cache
def small_runs() -> tuple[Path, ...]:
    folder = Path(tempfile.mkdtemp(prefix="small_runs"))
    made = []
    for stress in (750, 1000):
        scene = load_scene(SCENES / f"paper-{stress}Pa.toml").with_changes(
            {"population.initial": 50, "run.snapshot_every": "0.5 s", "run.until": None}
        )
        made.append(folder / f"run-{stress}Pa.nc")
        run(scene, made[-1], events=500, encounter=toy_encounter)
    return tuple(made)
