"""What the paper's own scheme makes of the encounters that matter: those that touch or break.

    python benchmarks/paper_scheme.py RUN.nc -o FILE.csv                    Eq. 20 by the velocity along the line of centres
    python benchmarks/paper_scheme.py RUN.nc -o FILE.csv --reading relative --encounters 40        ... literally
    python benchmarks/paper_scheme.py FILE.csv                                               the table of what is there

Pairs are drawn from the late population of a run, each with one orientation and offset for both schemes, and sorted by what
the default scheme makes of them: a primary that meets an aggregate, caught or nearly so; two aggregates that part, hold,
break, or lose one or two primaries.  A few of each kind are followed by explicit Euler with the time step of Eq. 20.  It takes
some ten seconds an encounter by the first convention, minutes by the second; what is in FILE.csv is not done again.

An encounter of many contacts is chaotic: where one scheme tears a primary out, the other may not.  What counts is whether a
kind that the default leaves alone breaks under the paper's scheme more often than the other way round.
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

import mcdem
from mcdem.analysis.dataset import RunDataset
from mcdem.encounter.simulate import EncounterResult
from mcdem.netcdf.whole_files import FILES, Kind

SMALLEST = 8
"""Primaries of the aggregates that meet."""
WANTED = {"caught": 40, "near": 5, "parted": 50, "aggregation": 15, "broken": 10, "eroded": 8}
"""Encounters of each kind."""
NEAR = 0.2
"""Smallest gap over radius of a miss that is nearly a capture."""
ERODED = 0.88
"""An aggregate of which one piece keeps at least this share, but not all, lost a primary or two."""
MOST_DRAWN = 8_000


@dataclass(frozen=True)
class Followed:
    """One encounter by the paper's scheme, beside what the default made of it."""

    kind: str
    seed: int
    size_i: int
    size_j: int
    reading: str
    given: str
    """outcome under the default"""
    outcome: str
    pieces: str
    """primaries of i, then of j, in each product that holds some"""
    eroded: bool
    steps: int
    cpu_time: float


def own_pieces(result: EncounterResult, size_i: int) -> list[list[int]]:
    """How many of i's primaries, and of j's, each product holds, largest first."""
    of_i = [[int((members < size_i).sum()), int((members >= size_i).sum())] for members in result.members]
    return [sorted((pair[k] for pair in of_i if pair[k]), reverse=True) for k in (0, 1)]


def is_eroded(pieces: list[list[int]]) -> bool:
    """Whether an aggregate lost one or two primaries."""
    return any(len(own) > 1 and own[0] >= ERODED * sum(own) for own in pieces)


def kind_of(result: EncounterResult, size_i: int, radius: float) -> str:
    """Its kind by what came of it under the default; empty for those left out."""
    if size_i == 1:
        return "caught" if result.contact else "near" if result.smallest_gap < NEAR * radius else ""
    if result.outcome in ("exchange", "fragmentation"):
        return "eroded" if is_eroded(own_pieces(result, size_i)) else "broken"
    return result.outcome if result.outcome in ("parted", "aggregation") else ""


def drawn(scene: mcdem.Scene, pool: list[mcdem.Aggregate]) -> Iterator[tuple[str, int, list, str]]:
    """(kind, seed, the two aggregates, outcome) until there are enough of each kind."""
    large = [aggregate for aggregate in pool if aggregate.size >= SMALLEST]
    if not large:
        sys.exit(
            f"no aggregate of {SMALLEST} primaries or more in the snapshots chosen; take more of them by an earlier --since"
        )
    left = dict(WANTED)
    for group, kinds in ((1, ("caught", "near")), (2, ("parted", "aggregation", "broken", "eroded"))):
        for seed in range(1, MOST_DRAWN + 1):
            if not any(left[kind] for kind in kinds):
                break
            rng = np.random.default_rng([group, seed])
            pair = [large[k] for k in rng.integers(len(large), size=group)]
            if group == 1:
                pair.insert(0, mcdem.Aggregate.monomer())
            result = mcdem.simulate_encounter(scene, *pair, seed=seed)
            kind = kind_of(result, pair[0].size, scene.suspension.radius)
            if left.get(kind):
                left[kind] -= 1
                yield kind, seed, pair, result.outcome


def follow(
    run: RunDataset, since: float, reading: str, most: int | None, rows: list[Followed]
) -> Iterator[Followed]:
    """Those that `rows` lack, kinds taking turns."""
    done = {(row.kind, row.seed, row.reading) for row in rows}
    late = [k for k, time in enumerate(run.snapshot_times[:-1]) if time >= since]
    scene = run.scene
    scheme = scene.with_changes(
        {"numerics.scheme": "explicit_euler", "numerics.explicit_euler.step_velocity": reading}
    )
    found = list(drawn(scene, [aggregate for k in late for aggregate in run.aggregates(k)]))
    order = np.random.default_rng(0).permutation(len(found))
    for k in order[:most]:
        kind, seed, pair, given = found[k]
        if (kind, seed, reading) in done:
            continue
        result = mcdem.simulate_encounter(scheme, *pair, seed=seed)
        pieces = own_pieces(result, pair[0].size)
        yield Followed(
            kind, seed, pair[0].size, pair[1].size, reading, given, result.outcome,
            " | ".join("+".join(map(str, own)) for own in pieces), is_eroded(pieces), result.steps, result.cpu_time,
        )  # fmt: skip


def read(path: Path) -> list[Followed]:
    """The rows of a table."""
    with path.open(newline="") as file:
        return [
            Followed(
                **{
                    field.name: row[field.name] == "True" if field.type == "bool"
                    else {"int": int, "float": float, "str": str}[str(field.type)](row[field.name])
                    for field in fields(Followed)
                }
            )
            for row in csv.DictReader(file)
        ]  # fmt: skip


def table(rows: list[Followed]) -> str:
    """What became of each kind, in words."""
    lines = []
    for reading in dict.fromkeys(row.reading for row in rows):
        lines.append(f"Eq. 20 by the {reading} velocity")
        for kind in WANTED:
            chosen = [row for row in rows if (row.kind, row.reading) == (kind, reading)]
            counts = {
                name: sum(row.outcome == name for row in chosen)
                for name in sorted({r.outcome for r in chosen})
            }
            eroded = sum(row.eroded for row in chosen)
            words = ", ".join(f"{count} {name}" for name, count in counts.items())
            lines.append(f"  {kind:12s} {len(chosen):3d}: {words}; {eroded} eroded")
        seconds = sum(row.cpu_time for row in rows if row.reading == reading)
        lines.append(f"  {seconds / max(sum(r.reading == reading for r in rows), 1):.0f} s an encounter")
    return "\n".join(lines)


def main() -> None:
    """Go on with a table, or show one."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path, help="dataset of mcdem run, or a table to show")
    parser.add_argument("-o", "--output", type=Path, help="table to write or go on with")
    parser.add_argument(
        "--since", type=float, default=70.0, help="process time from which snapshots are taken [s]"
    )
    parser.add_argument("--reading", choices=["normal", "relative"], default="normal")
    parser.add_argument("--encounters", type=int, help="at most so many, of all kinds in turn")
    given = parser.parse_args()
    if given.file.suffix == ".csv":
        print(table(read(given.file)))
        return
    if given.output is None:
        sys.exit("say with -o where the table goes")
    rows = read(given.output) if given.output.exists() else []
    for row in follow(RunDataset(given.file), given.since, given.reading, given.encounters, rows):
        rows.append(row)
        text = io.StringIO()
        names = [field.name for field in fields(Followed)]
        writer = csv.DictWriter(text, names)
        writer.writeheader()
        writer.writerows(asdict(one) for one in rows)
        FILES.write(given.output, Kind("table of this command", (",".join(names).encode(),)), text.getvalue())
        print(
            f"{len(rows)}: {row.kind} of {row.size_i} and {row.size_j}: {row.given} -> {row.outcome}, {row.pieces}"
        )
    print(table(rows))


if __name__ == "__main__":
    main()
