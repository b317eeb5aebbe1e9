"""Do the shortcuts change the science?  The same encounters of a real population, followed in three ways.

    python -m validation.agreement SCENE --from RUN.nc -o validation/data/agreement-1000Pa.nc

reference   implicit steps, all shortcuts off, a fresh far field in each step and a quarter of the scene's step
default     the scene as it is
paper       the paper's explicit scheme, on the first encounters only: it takes hundreds of times longer

The dataset holds the aggregates that met, bonds and all, and what came of each encounter in each way; it says all that it
takes to follow an encounter again (`pairs`, `again`).  It is written as it grows, and an unfinished one is gone on with.
"""

from __future__ import annotations

import math
import shlex
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
import xarray as xr
from numpy.typing import NDArray
from scipy import stats

from mcdem.aggregates.aggregate import Aggregate
from mcdem.analysis.accuracy_cost import settings_of
from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.paired_encounters import REFERENCE, Pair, Sample, draw_pairs, follow
from mcdem.encounter.simulate import OUTCOMES
from mcdem.errors import UserError
from mcdem.monte_carlo.executors import opened
from mcdem.monte_carlo.record import software
from mcdem.netcdf.whole_files import FILES, HDF5, Kind
from mcdem.scene import Scene, load_scene
from pbekit import endings

WAYS = (REFERENCE, "default", "paper")
TITLE = "mcdem agreement: the same encounters with and without shortcuts"
SAMPLE = Kind("sample of this command", (HDF5,), (TITLE.encode(),), sealed=True)
FORMAT = 1
EVERY = 60.0
"""Time between two writings [s]."""


def scene_of(scene: Scene, way: str) -> Scene:
    """The scene as it is followed in one way."""
    if way == REFERENCE:
        return settings_of(scene)[0].of(scene)
    if way == "paper":
        return scene.with_changes(
            {"numerics.scheme": "explicit_euler", "numerics.explicit_euler.step_velocity": "normal"}
        )
    return scene


def store(pairs: Sequence[Pair], scene: Scene, run: Path, seed: int) -> xr.Dataset:
    """The dataset of a sample, no encounter followed yet."""
    aggregates = [a for pair in pairs for a in pair]
    shape = (len(WAYS), len(pairs))
    results = {
        "outcome": (np.full(shape, -1, np.int8), "1", f"index in: {', '.join(OUTCOMES)}; -1 if not followed"),
        "fragment": (np.full(shape, np.nan), "1", "mass share of the largest product"),
        "geometry": (np.full(shape, np.nan), "1", "relative change of the mass-weighted radius of gyration"),
        "cpu_time": (np.full(shape, np.nan), "s", "processor time"),
        "steps": (np.full(shape, -1, np.int32), "1", "steps primary by primary"),
    }
    ends = RunDataset(run)
    return xr.Dataset(
        {
            "size": ("aggregate", np.array([a.size for a in aggregates], np.int32)),
            "bonds": ("aggregate", np.array([len(a.bonds) for a in aggregates], np.int32)),
            "position": (
                ("primary", "axis"),
                np.concatenate([a.positions for a in aggregates]),
                {"units": "m", "long_name": "centres of primaries, aggregate after aggregate, two an encounter"},
            ),
            "bond": (("contact", "end"), np.concatenate([a.bonds for a in aggregates]).astype(np.int32)),
            **{
                name: (("way", "encounter"), values, {"units": units, "long_name": meaning})
                for name, (values, units, meaning) in results.items()
            },
        },
        coords={"way": list(WAYS)},
        attrs={
            "title": TITLE,
            "format": FORMAT,
            "scene": scene.text,
            "scene_name": scene.name,
            "run": run.name,
            "run_time": float(ends.events["time"].values[-1]),
            "mean_size": float(np.mean([a.size for a in aggregates])),
            "seed": seed,
            "command": shlex.join(sys.argv),
            "software": software(),
        },
    )  # fmt: skip


def scene_in(data: xr.Dataset) -> Scene:
    """The scene of a sample."""
    return Scene.from_dataset(data.attrs["scene"], Path(data.attrs["scene_name"]))


def pairs(data: xr.Dataset) -> list[Pair]:
    """The aggregates that met, encounter by encounter."""
    ends, bond_ends = np.cumsum(data["size"].values)[:-1], np.cumsum(data["bonds"].values)[:-1]
    aggregates = [
        Aggregate(position, bond)
        for position, bond in zip(
            np.split(data["position"].values, ends), np.split(data["bond"].values, bond_ends), strict=True
        )
    ]
    return list(zip(aggregates[::2], aggregates[1::2], strict=True))


def again(data: xr.Dataset, way: str, number: int, scene: Scene | None = None) -> Sample:
    """Follow an encounter of the sample once more; `scene` instead of its own."""
    scene = scene_of(scene_in(data) if scene is None else scene, way)
    return follow(scene, int(data.attrs["seed"]), number, pairs(data)[number])


def followed(data: xr.Dataset, way: str) -> NDArray[np.intp]:
    """Numbers of the encounters that were followed in a way."""
    return np.flatnonzero(data["outcome"].sel(way=way).values >= 0)


def complete(
    data: xr.Dataset, paper: int, workers: int, save: Callable[[], None], report: Callable[[str], None]
) -> None:
    """Follow what has not been followed yet, `paper` encounters by the paper's scheme too."""
    scene, seed, met = scene_in(data), int(data.attrs["seed"]), pairs(data)
    written = time.monotonic()
    with opened("process", workers) as crew:
        for way in ("default", REFERENCE, "paper"):
            wanted = range(min(paper, len(met)) if way == "paper" else len(met))
            missing = sorted(set(wanted) - set(followed(data, way).tolist()))
            changed, row = scene_of(scene, way), WAYS.index(way)
            # No more ahead than the workers can use: one worker computes at once what is given to it.
            ahead: deque[Future[Sample]] = deque()
            waiting = iter(missing)
            for done, k in enumerate(missing, start=1):
                for number in islice(waiting, crew.workers - len(ahead)):
                    ahead.append(crew.executor.submit(follow, changed, seed, number, met[number]))
                sample = ahead.popleft().result()
                for name in ("outcome", "fragment", "geometry", "cpu_time", "steps"):
                    data[name].values[row, k] = getattr(sample, name)
                if time.monotonic() - written > EVERY:
                    save()
                    written = time.monotonic()
                    report(f"{way}: {done} of {len(missing)}")
            save()
            report(f"{way}: all {len(wanted)}")


class Difference(NamedTuple):
    """A mean in one way less that in another, over the same encounters, with its simultaneous 95 % half width."""

    quantity: str
    mean: float
    other: float
    width: float

    @property
    def value(self) -> float:
        return self.mean - self.other


def differences(data: xr.Dataset, way: str, other: str) -> list[Difference]:
    """Paired differences of the means of what comes out of encounters; wide enough for all of them together.

    An encounter in a hundred may differ unseen: the half width of a share is never below that of one more differing pair.
    """
    common = np.intersect1d(followed(data, way), followed(data, other))
    rows: list[tuple[str, NDArray[np.float64], NDArray[np.float64]]] = []

    def of(name: str, which: str) -> NDArray[np.float64]:
        return data[name].sel(way=which).values[common].astype(float)

    for k, name in enumerate(OUTCOMES):
        one, two = (1.0 * (of("outcome", which) == k) for which in (way, other))
        if one.any() or two.any():
            rows.append((f"share of {name}", one, two))
    rows.append(("mass share of the largest product", of("fragment", way), of("fragment", other)))
    rows.append(("relative change of the radius of gyration", of("geometry", way), of("geometry", other)))
    quantile = stats.norm.isf(0.025 / len(rows))
    count = len(common)
    found = []
    for name, one, two in rows:
        difference = one - two
        spread = math.sqrt(float((difference**2).mean()) / count)
        if name.startswith("share"):
            spread = max(spread, 1.0 / count)
        found.append(Difference(name, float(one.mean()), float(two.mean()), quantile * spread))
    return found


def load(path: Path) -> xr.Dataset:
    """A sample from its file, in memory; raises `UserError` for a file that holds none."""
    with FILES.reading(path, "a sample of this command"), xr.open_dataset(path) as opened_file:
        data = opened_file.load()
    if data.attrs.get("title") != TITLE or data.attrs.get("format") != FORMAT:
        raise UserError(f"{path}: expected a sample of this command, layout {FORMAT}; choose another file")
    return data


def save(data: xr.Dataset, path: Path) -> None:
    """Write a sample, whole or not at all."""
    packed: dict[str, Any] = {str(name): {"zlib": True, "complevel": 9} for name in data.data_vars}
    FILES.write_dataset(path, SAMPLE, {"": data}, {"": packed})


def main(
    scene: Annotated[Path, typer.Argument(help="Scene file.")],
    run: Annotated[Path, typer.Option("--from", help="Dataset of `mcdem run`, its late population.")],
    out: Annotated[Path, typer.Option("-o", "--output", help="Dataset to write, or to go on with.")],
    encounters: Annotated[int, typer.Option(min=1, help="How many.")] = 200,
    paper: Annotated[int, typer.Option(min=0, help="How many of them by the paper's scheme too.")] = 20,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    workers: Annotated[int, typer.Option(min=1)] = 1,
    anew: Annotated[
        bool, typer.Option("--anew", help="Follow those by default once more, as the engine has changed.")
    ] = False,
) -> None:
    """Follow encounters of a population with and without shortcuts, and print how they agree."""
    try:
        asked = load_scene(scene)
        if out.exists():
            data = load(out)
            if data.attrs["scene"] != asked.text or data.attrs["seed"] != seed:
                raise UserError(f"{out}: holds a sample of another scene or seed; choose another file")
        else:
            data = store(draw_pairs(asked, [run], encounters, seed), asked, run, seed)
        if anew:
            data["outcome"].values[WAYS.index("default")] = -1
        try:
            complete(data, paper, workers, lambda: save(data, out), lambda line: print(line, flush=True))
        finally:
            save(data, out)
    except UserError as problem:
        print(problem, file=sys.stderr)
        raise typer.Exit(1) from None
    for way, other in (("default", REFERENCE), ("default", "paper")):
        common = np.intersect1d(followed(data, way), followed(data, other))
        if not len(common):
            continue
        print(f"\n{way} against {other}, {len(common)} encounters of {data.attrs['run']}")
        for d in differences(data, way, other):
            print(f"  {d.quantity:45s} {d.mean:8.4f} - {d.other:8.4f} = {d.value:8.4f} +- {d.width:.4f}")
        times = [data["cpu_time"].sel(way=w).values[common] for w in (other, way)]
        print(f"  time: {np.median(times[0] / times[1]):.0f} times less (median), "
              f"{1e3 * times[1].mean():.1f} ms against {1e3 * times[0].mean():.0f} ms")  # fmt: skip


if __name__ == "__main__":
    endings.program(lambda: typer.run(main))
