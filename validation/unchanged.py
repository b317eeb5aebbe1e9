"""Runs that must give the same bits after a change that is not one of the physics.

    python -m validation.unchanged          compares with what was saved, variable by variable
    python -m validation.unchanged --save   saves what the runs give now: after a change of arithmetic, with its reason

The course of an aggregate is chaotic, so bits are the same on one type of processor, with the same versions of numba and of the
linear algebra, only; elsewhere the shares of outcomes are compared.
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

KEPT = Path(__file__).parent / "data" / "unchanged.json"
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


def outcomes(path: Path) -> dict[str, int]:
    """Encounters by the code of their outcome."""
    with netCDF4.Dataset(path) as file:
        codes, counts = np.unique(np.asarray(file["events/outcome"][...]), return_counts=True)
    return {str(code): int(count) for code, count in zip(codes, counts, strict=True)}


def measure(names: list[str]) -> dict[str, Any]:
    """What the runs give here."""
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            path = Path(folder) / f"{CASES[name].scene}.nc"
            follow(CASES[name], path)
            found[name] = {"digests": digests(path), "outcomes": outcomes(path)}
    return found


def compare(saved: dict[str, Any], found: dict[str, Any], same_machine: bool) -> list[str]:
    """What differs, a line each."""
    lines = []
    for name, now in found.items():
        before = saved[name]
        if same_machine:
            differ = [v for v, digest in before["digests"].items() if now["digests"].get(v) != digest]
            if differ:
                lines.append(
                    f"{name}: {len(differ)} of {len(before['digests'])} variables differ: {', '.join(differ[:5])}"
                )
        elif before["outcomes"] != now["outcomes"]:
            lines.append(f"{name}: outcomes {now['outcomes']}, saved {before['outcomes']}")
    return lines


def main() -> int:
    """Run, compare or save; the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", choices=[*CASES, []], help="all by default")
    parser.add_argument("--save", action="store_true", help="keep what the runs give now")
    asked = parser.parse_args()
    names = list(asked.cases or CASES)
    found = measure(names)
    if asked.save:
        saved = json.loads(KEPT.read_text())["runs"] if KEPT.exists() else {}
        KEPT.write_text(json.dumps({"machine": machine(), "runs": saved | found}, indent=1) + "\n")
        return 0
    kept = json.loads(KEPT.read_text())
    same = kept["machine"] == machine()
    if not same:
        print(f"saved on {kept['machine']}, here {machine()}: outcomes are compared, not bits")
    lines = compare(kept["runs"], found, same)
    print("\n".join(lines) or f"{len(names)} runs: {'the same bits' if same else 'the same outcomes'}")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
