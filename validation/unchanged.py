"""Runs that must give the same bits after a change that is not one of the physics.

    python -m validation.unchanged FILE      writes FILE where it is not there yet, else compares with it, variable by variable

Write the file at the commit before the change and compare after it, on one machine: the course of an aggregate is chaotic, so
bits agree on one type of processor, with the same versions of numba and of the linear algebra, only.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import netCDF4
import numpy as np

import mcdem
from mcdem.netcdf.origin import machine

SCENES = Path(__file__).parents[1] / "scenes"
NOT_COMPARED = ("cpu_time",)
"""Variables that no two runs have in common."""


class FixedRun(NamedTuple):
    """A run."""

    scene: str
    events: int
    primaries: int


CASES = {
    "simple shear at 1000 Pa": FixedRun("paper-1000Pa", 300, 60),
    "contact torques": FixedRun("moments-1000Pa", 60, 24),
    "two sizes": FixedRun("two-sizes", 150, 40),
    "extension": FixedRun("uniaxial-extension", 150, 40),
}


def follow(case: FixedRun, path: Path) -> None:
    """Write the dataset of a run."""
    scene = mcdem.load_scene(SCENES / f"{case.scene}.toml")
    mcdem.run(scene.with_changes({"population.initial": case.primaries}), path, events=case.events, seed=1)


def digests(path: Path) -> dict[str, str]:
    """A digest of each variable of a dataset."""
    found: dict[str, str] = {}

    def visit(group: Any, place: str) -> None:
        group.set_auto_maskandscale(False)
        for name, variable in group.variables.items():
            if name not in NOT_COMPARED:
                values = np.ascontiguousarray(variable[...])
                found[place + name] = hashlib.sha256(values.tobytes()).hexdigest()[:16]
        for name, inner in group.groups.items():
            visit(inner, f"{place}{name}/")

    with netCDF4.Dataset(path) as file:
        visit(file, "")
    return found


def measure(names: list[str]) -> dict[str, dict[str, str]]:
    """What the runs give here."""
    found: dict[str, dict[str, str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            path = Path(folder) / f"{CASES[name].scene}.nc"
            follow(CASES[name], path)
            found[name] = digests(path)
    return found


def compare(saved: dict[str, dict[str, str]], found: dict[str, dict[str, str]]) -> list[str]:
    """What differs, a line for each run."""
    lines = []
    for name, now in found.items():
        before = saved.get(name, {})
        differ = sorted(v for v in before.keys() | now.keys() if before.get(v) != now.get(v))
        if differ:
            lines.append(f"{name}: {len(differ)} of {len(now)} variables differ: {', '.join(differ[:5])}")
    return lines


def main() -> int:
    """Run, then compare or save; the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("file", type=Path, metavar="FILE", help="JSON; written where it is not there yet")
    asked = parser.parse_args()
    kept = json.loads(asked.file.read_text()) if asked.file.exists() else None
    if kept is not None and kept["machine"] != machine():
        print(
            f"{asked.file}: of {kept['machine']}, here {machine()}: bits agree on one machine only; write another FILE here, "
            "at the commit before the change",
            file=sys.stderr,
        )
        return 2
    found = measure(list(CASES))
    if kept is None:
        asked.file.write_text(json.dumps({"machine": machine(), "runs": found}, indent=1) + "\n")
        return 0
    lines = compare(kept["runs"], found)
    print("\n".join(lines) or f"{len(found)} runs, {sum(map(len, found.values()))} variables: the same bits")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
