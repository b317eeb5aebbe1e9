"""What compiling costs: by function and signature, for a scene on an empty cache and on what the quickstart has compiled.

    python benchmarks/compilation.py                        the quickstart alone, then every scene after it
    python benchmarks/compilation.py scenes/two-sizes.toml  the quickstart alone, then this scene after it
    python benchmarks/compilation.py --most 40              ... with the 40 dearest functions of each

Processor time is that of compiling alone, each function without those that it has compiled; the time to start is from the start
of Python to the end of a first encounter of two primaries and of two tetrahedra that meet, pass and turn as bodies.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from numba.core.event import Listener, register

SCENES = Path(__file__).parents[1] / "scenes"
FIRST = SCENES / "quickstart.toml"


class CompileTimes(Listener):
    """Listens to numba: processor time [s] of each function and signature, without what it compiles on the way."""

    def __init__(self) -> None:
        self.seconds: dict[tuple[str, str], float] = {}
        self._open: list[list[float]] = []

    def on_start(self, event: Any) -> None:
        """A function begins to be compiled."""
        self._open.append([time.process_time(), 0.0])

    def on_end(self, event: Any) -> None:
        """It is compiled."""
        started, inner = self._open.pop()
        spent = time.process_time() - started
        function = event.data["dispatcher"].py_func
        key = f"{function.__module__}.{function.__qualname__}", ", ".join(map(str, event.data["args"]))
        self.seconds[key] = self.seconds.get(key, 0.0) + spent - inner
        if self._open:
            self._open[-1][1] += spent


def follow(scene_file: str) -> None:
    """In a process of its own: have all of a scene compiled, and print what it took as JSON."""
    times = CompileTimes()
    register("numba:compile", times)
    import mcdem
    from mcdem.analysis.paired_encounters import warm_up

    scene = mcdem.load_scene(scene_file)
    primary = mcdem.Aggregate.monomer(scene.suspension.radius)
    warm_up(scene, (primary, primary))
    print(json.dumps([[*key, seconds] for key, seconds in times.seconds.items()]))


def measure(scene: Path, cache: Path) -> tuple[list[tuple[str, str, float]], float]:
    """(function, signature, processor time [s]) of what a scene compiles on a cache, dearest first, and its time to start [s]."""
    started = time.perf_counter()
    done = subprocess.run(
        [sys.executable, __file__, "--child", str(scene)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise SystemExit(f"{scene}: {done.stderr.strip().splitlines()[-1]}")
    rows = [
        (name, signature, seconds) for name, signature, seconds in json.loads(done.stdout.splitlines()[-1])
    ]
    return sorted(rows, key=lambda row: -row[2]), time.perf_counter() - started


def report(title: str, rows: list[tuple[str, str, float]], start: float, most: int) -> None:
    """Print what a scene cost, and its dearest functions."""
    total = sum(row[2] for row in rows)
    print(
        f"{title:40} {len(rows):4d} compiled {total:7.1f} s of processor {start:7.1f} s to start", flush=True
    )
    for name, signature, seconds in rows[:most]:
        short = signature if len(signature) < 60 else f"{signature[:57]}..."
        print(f"    {seconds:6.2f} s  {name}({short})")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--most", type=int, default=0, help="dearest functions to list of each scene")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        follow(given.child)
        return
    scenes = given.scenes or sorted(path for path in SCENES.glob("*.toml") if path != FIRST)
    with tempfile.TemporaryDirectory() as folder:
        first = Path(folder) / "first"
        report(f"{FIRST.name}, empty cache", *measure(FIRST, first), given.most)
        report(f"{FIRST.name} again", *measure(FIRST, first), given.most)
        for number, scene in enumerate(scenes):
            own = shutil.copytree(first, Path(folder) / str(number))
            report(f"{scene.name} after it", *measure(scene, own), given.most)
            shutil.rmtree(own)


if __name__ == "__main__":
    main()
