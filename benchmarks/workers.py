"""How much faster two workers are than one on the same encounters, measured side by side.

    python benchmarks/workers.py RUN.nc                          2 workers against 1, 60 encounters, 4 turns
    python benchmarks/workers.py RUN.nc --events 200 --turns 6 --workers 4

Each turn continues a copy of the dataset by the same encounters once with one worker and once with many, so both see
the same population; turns go in the order 1, n, n, 1, ..., against a machine that becomes slower or faster.  The clock
starts at the first encounter of a call, when its workers are up and have compiled or loaded the engine: a run of hours
starts only once.  The dataset is left as it is, and the copies must end up alike, bit for bit.

Use a dataset whose population is steady: `mcdem report RUN.nc` says whether it is.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import tempfile
from concurrent.futures import Executor, wait
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from mcdem.aggregates.aggregate import Aggregate
from mcdem.encounter.simulate import simulate_encounter
from mcdem.monte_carlo import executors, run_control
from mcdem.monte_carlo.comparison import differences
from mcdem.scene import Scene


class Turn(NamedTuple):
    """A continuation of the dataset."""

    elapsed: float
    """Wall-clock time [s]."""
    computed: int
    discarded: int
    cpu_time: float
    """Of the encounters that took place [s]."""


def warm(scene: Scene, executor: Executor, workers: int) -> None:
    """Every worker computes an encounter of two primary particles, which loads the engine."""
    monomer = Aggregate.monomer()
    compute = executors.computation(scene, simulate_encounter, 0, executor)
    wait([executor.submit(compute, monomer, monomer, 0, k) for k in range(4 * workers)])


def continued(scene: Scene, copy: Path, until_event: int, executor: Executor, workers: int) -> Turn:
    """The dataset at `copy`, continued until it holds so many encounters."""
    begun = xr.open_dataset(copy).sizes["row"] - 1
    done = run_control.run(
        scene, copy, events=until_event, executor=executor, workers=workers, resume=True, checkpoint_every=1e9
    )
    with xr.open_datatree(copy) as tree:
        cpu_time = float(tree["events"]["cpu_time"][begun:].sum())
    return Turn(done.elapsed, done.computed, done.discarded, cpu_time)


def main() -> None:
    """Print each turn and the ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--events", type=int, default=60, help="encounters of a turn")
    parser.add_argument("--turns", type=int, default=4, help="of each number of workers")
    parser.add_argument("--workers", type=int, default=2, help="against one")
    given = parser.parse_args()
    with xr.open_dataset(given.dataset) as start:
        scene = Scene.from_text(start.attrs["scene"], given.dataset.name)
        begun = start.sizes["row"] - 1
    crews = (1, given.workers)
    turns: dict[int, list[Turn]] = {crew: [] for crew in crews}
    print(f"{given.dataset.name}: {begun} encounters, continued by {given.events}")
    print(f"{'workers':>8}{'wall':>10}{'computed':>10}{'discarded':>9}{'CPU of encounters':>20}")
    with (
        tempfile.TemporaryDirectory() as folder,
        executors.local_processes(1) as one,
        executors.local_processes(given.workers) as many,
    ):
        pools = dict(zip(crews, (one, many), strict=True))
        for crew, pool in pools.items():
            warm(scene, pool, crew)
        copies = {crew: Path(folder) / f"{crew}.nc" for crew in crews}
        for turn in range(given.turns):
            for crew in crews if turn % 2 == 0 else reversed(crews):
                shutil.copyfile(given.dataset, copies[crew])
                found = continued(scene, copies[crew], begun + given.events, pools[crew], crew)
                turns[crew].append(found)
                print(
                    f"{crew:8d}{found.elapsed:8.1f} s{found.computed:10d}{found.discarded:9d}{found.cpu_time:18.1f} s",
                    flush=True,
                )
            if unlike := differences(*copies.values()):
                raise SystemExit(f"the datasets differ: {unlike}")
    ratios = [one.elapsed / many.elapsed for one, many in zip(*turns.values(), strict=True)]
    many = turns[given.workers]
    discarded = sum(turn.discarded for turn in many) / sum(turn.computed for turn in many)
    print(
        f"{given.workers} workers are {statistics.median(ratios):.2f} times as fast as 1 (median of {len(ratios)}; "
        f"{min(ratios):.2f} to {max(ratios):.2f}); {discarded:.1%} of what they computed was discarded"
    )


if __name__ == "__main__":
    main()
