"""A table made or extended: rounds of designed encounters, written whole at every moment."""

from __future__ import annotations

import json
import shlex
import sys
import time as clock
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.similarity import sensitivities
from mcdem.encounter.simulate import EncounterResult, simulate_encounter
from mcdem.errors import DataFileError, MachineWarning, UserError
from mcdem.kernel_tables.design import ROUND, Plan, plan
from mcdem.kernel_tables.library import Library, record_of
from mcdem.kernel_tables.runs import groups_of_scene, only_designed, records_of_run, same_physics
from mcdem.monte_carlo import executors
from mcdem.monte_carlo.executors import Encounter, ExecutorError
from mcdem.netcdf.origin import Machines
from mcdem.netcdf.whole_files import FILES
from mcdem.quantities.random_streams import checked, stream
from mcdem.scene import Scene
from pbekit import endings
from pbekit.errors import PBEError
from pbekit.outputs import TABLE
from pbekit.tables.kernel_table import SHAPES, KernelTable, Records

DESIGNED_EPOCH = 1 << 40
"""Epoch of the random streams of designed encounters, far from those of any run."""


CHECKPOINT_EVERY = 60.0
"""Longest time between two writings of the table [s]."""
WANTED = ("until_error_of", "until_error_pair")
"""Attributes of a table whose designed encounters were drawn for one probability of one pair of sizes (`until_error`)."""


@dataclass(frozen=True)
class TableProgress:
    """Where a tabulation stands."""

    reused: int
    designed: int
    wanted: int
    mean_size: float | None
    error: float | None
    elapsed: float

    @property
    def done(self) -> float:
        """Share of the designed encounters that are wanted."""
        return self.designed / self.wanted if self.wanted else 1.0

    def __str__(self) -> str:
        state = f"{self.reused} from runs, {self.designed} of {self.wanted} designed"
        if self.mean_size is not None and self.error is not None:
            state += f"; steady <P> = {self.mean_size:.3g} +- {100 * self.error:.2g} %"
        return state


@dataclass(frozen=True)
class TableSummary:
    """What a call of `tabulate` left."""

    path: Path
    reused: int
    designed: int
    mean_size: float | None
    error: float | None
    ended_by: str
    """"encounters", "error" or "interruption"."""
    refusal: str = ""
    """Why there is no steady <P>, and what would give one; empty where there is one."""

    def __str__(self) -> str:
        line = f"{self.path}: {self.reused} encounters from runs, {self.designed} designed"
        if self.mean_size is not None and self.error is not None:
            line += f"; steady <P> = {self.mean_size:.3g}, standard error {100 * self.error:.2g} %"
        return f"{line}; ended by {self.ended_by}" + (f"\n{self.refusal}" if self.refusal else "")


def tabulate(
    scene: Scene,
    output: Path | str,
    runs: Sequence[Path | str],
    *,
    encounters: int = 0,
    error: float | None = None,
    primaries: int = 0,
    aggregates_only: bool = False,
    shape: str = "aspect ratio",
    shapes: int = 3,
    sensitivity: Path | str | None = None,
    seed: int | None = None,
    executor: Executor | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[TableProgress], None] | None = None,
    encounter: Encounter = simulate_encounter,
    checkpoint_every: float = CHECKPOINT_EVERY,
) -> TableSummary:
    """Make or extend the kernel table of `scene` at `output`.

    Parameters
    ----------
    scene : whose encounters are tabulated
    output : file to write; whole at every moment
    runs : datasets of `mcdem run`; their events are re-used and their aggregates are drawn from
    encounters : designed encounters, at most
    error : stop as soon as the relative standard error of the steady <P> is below
    primaries : designed encounters are of two primaries until the table holds so many of these, for eta_11 and growth
    aggregates_only : draw aggregates from the runs but do not re-use their events (they are of other physics)
    sensitivity : table that `mcdem sensitivity` wrote, of which the table keeps how outcomes go with dimensionless groups
    shape, shapes : second coordinate of the classes (see `pbekit.tables.kernel_table.SHAPES`) and how many classes it has
    seed : of the designed encounters, instead of the scene's
    executor : computes them: anything with the contract of `concurrent.futures.Executor`; the table is the same
    resume : extend what `output` holds, if it exists
    overwrite : replace `output` if it exists
    progress : called with a `TableProgress`
    encounter : resolves an encounter, `simulate_encounter` or anything of its form
    checkpoint_every : longest time between two writings [s]

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import mcdem
    >>> import pbekit
    >>> scene = mcdem.load_scene("scenes/paper-1500Pa.toml")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table = Path(folder) / "kernels.nc"
    ...     summary = mcdem.tabulate(scene, table, ["notebooks/data/run-1500Pa-of-100.nc"])
    ...     records = pbekit.open_table(table).records
    >>> len(records.size)
    105400
    """
    path, seed = Path(output), checked(scene.run.seed if seed is None else seed)
    scene.require_one_radius("a table for the balance counts equal primaries")
    if shape not in SHAPES:
        raise UserError(f'shape = "{shape}": expected one of {", ".join(SHAPES)}')
    refuse_unwritable(path, resume=resume, overwrite=overwrite)
    opened = opened_for(scene, runs, aggregates_only=aggregates_only)
    started = clock.monotonic()
    with FILES.locked(path), endings.Deferred() as interruption:
        with interruption.allowed(), endings.keeping("nothing was computed, nothing written"):
            reused = Records.join([] if aggregates_only else [records_of_run(run) for run in opened])
            base = classes(scene, opened, reused, shape, shapes, seed)
            if sensitivity is not None:
                powers = json.dumps(sensitivities(scene, sensitivity))
                base = replace(base, about={**base.about, "sensitivities": powers})
            designed, machines = (
                designed_before(path, base) if resume and path.exists() else (Records.empty(), Machines())
            )
            library = Library.of(opened, base)
        parts = [designed] if len(designed) else []
        done, known, saved = len(designed), Plan(np.zeros(0, np.intp)), -np.inf

        def table(count: int) -> KernelTable:
            every = Records.join(parts)
            return base.with_records(Records.join([reused, every.select(np.arange(count))]))

        def save() -> None:
            about = {
                **base.about,
                "designed": done,
                "machines": str(machines),
                "command": shlex.join(["mcdem", *sys.argv[1:]]),
            }
            full = table(done)
            try:
                KernelTable(
                    full.records,
                    base.size_edges,
                    base.shape_edges,
                    base.radius,
                    base.shear_rate,
                    shape,
                    about,
                ).save(path)
            except PBEError as problem:
                raise DataFileError(str(problem)) from None

        pool: Executor = executor or executors.Here()
        compute = executors.computation(scene, encounter, seed, pool)
        ended_by = ""
        futures: list[Future[EncounterResult]] = []
        try:
            while not ended_by:
                begun = done - done % ROUND
                with interruption.allowed():
                    known = plan(
                        table(begun), library, scene.suspension.volume_fraction, seed, begun, primaries
                    )
                if progress is not None:
                    progress(_now(reused, done, encounters, known, started))
                if error is not None and known.error is not None and known.error <= error and begun == done:
                    ended_by = "error"
                    break
                if done >= encounters:
                    ended_by = "encounters"
                    break
                last = min(begun + ROUND, encounters)
                rng = stream(seed, "kernel pairs", begun)
                drawn = [library.draw(*_classes_of(pair), rng) for pair in known.pairs][
                    done - begun : last - begun
                ]

                def begin(number: int, pair: tuple[int, int]) -> Future[EncounterResult]:
                    first, second = (library.aggregates[k] for k in pair)
                    return executors.submit(pool, compute, first, second, DESIGNED_EPOCH, number)

                ahead = not isinstance(pool, executors.Here)
                futures = [begin(done + k, pair) for k, pair in enumerate(drawn)] if ahead else []
                for k, (i, j) in enumerate(drawn):
                    with interruption.allowed():
                        result = executors.result_of(futures[k] if ahead else begin(done, (i, j)))
                    if told := machines.computed(result.machine):
                        warnings.warn(f"{path}: {told}", MachineWarning, stacklevel=2)
                    parts.append(record_of(library.aggregates[i], library.aggregates[j], result, base.radius))
                    done += 1
                    if clock.monotonic() - saved > checkpoint_every:
                        save()
                        saved = clock.monotonic()
                    if progress is not None:
                        progress(_now(reused, done, encounters, known, started))
                parts[:] = [Records.join(parts)]
        except KeyboardInterrupt:
            ended_by = "interruption"
        except BaseException as problem:
            if not (isinstance(problem, ExecutorError) and endings.asked(within=0.5)):
                save()
                if isinstance(problem, ExecutorError):
                    raise ExecutorError(
                        f"{problem}; {path} holds {done} designed encounters: extend it with --resume, maybe on fewer workers"
                    ) from problem
                raise
            ended_by = "interruption"
        finally:
            for future in futures:
                future.cancel()
        save()
    return TableSummary(path, len(reused), done, known.mean_size, known.error, ended_by, known.refusal)


def refuse_unwritable(path: Path, *, resume: bool, overwrite: bool) -> None:
    """Raise `UserError` where no table may be written."""
    if path.suffix != ".nc":
        raise UserError(f"{path}: expected a name that ends in .nc, the table that is written is NetCDF")
    if path.is_file() and not (resume or overwrite):
        raise DataFileError(
            f"{path}: exists already; extend it with --resume, or replace it with --overwrite"
        )
    FILES.check(path, TABLE)


def classes(
    scene: Scene, runs: Sequence[RunDataset], reused: Records, shape: str, shapes: int, seed: int
) -> KernelTable:
    """An empty table whose classes fit what the runs saw."""
    seen = reused if len(reused) else Records.join([records_of_run(run) for run in runs])
    if len(seen) and shape == "aspect ratio" and np.isnan(seen.aspect_ratio[seen.size > 2]).any():
        raise UserError(
            'the runs recorded no aspect ratios (they are of an older version): use --shape "outer radius", or run again'
        )
    flow = scene.flow
    if flow.kind != "simple_shear":
        raise UserError(
            f'{scene.name}: a table for the balance counts meetings in simple shear, the scene has flow.kind = "{flow.kind}"'
        )
    about = {
        "scene": scene.text,
        "scene_name": scene.name,
        "seed": seed,
        "runs": " ".join(run.path.name for run in runs),
        "viscosity": flow.viscosity,
        "shear_stress": flow.shear_stress,
        "volume_fraction": scene.suspension.volume_fraction,
    }
    if scene.effects.attraction is not None:
        about["hamaker_constant"] = scene.effects.attraction.hamaker_constant
    about |= groups_of_scene(scene)
    return KernelTable.of(
        seen, scene.suspension.radius, flow.shear_rate, shapes=shapes, shape_name=shape, about=about
    ).with_records(Records.empty())


def opened_for(scene: Scene, runs: Sequence[Path | str], *, aggregates_only: bool) -> list[RunDataset]:
    """Datasets of runs whose events apply to a scene; any, where only their aggregates are used."""
    opened = [RunDataset(p) for p in runs]
    for run in opened:
        differs = same_physics(scene, run.scene)
        if differs and not aggregates_only:
            raise UserError(
                f"{run.path}: was run with another [{differs}] than {scene.name}; its events do not apply here: "
                "add --aggregates-only to use its aggregates alone"
            )
    return opened


def designed_before(path: Path, base: KernelTable) -> tuple[Records, Machines]:
    """The designed encounters of a table begun before and who computed them, if it is of the same scene, seed and classes."""
    try:
        old = KernelTable.load(path)
    except PBEError as problem:
        raise DataFileError(str(problem)) from None
    for key in ("scene", "seed", "runs", *WANTED):
        if old.about.get(key, "") != base.about.get(key, ""):
            raise DataFileError(
                f"{path}: was begun with another {key}; give the same, or replace it with --overwrite"
            )
    if not np.array_equal(old.size_edges, base.size_edges) or old.shape_name != base.shape_name:
        raise DataFileError(
            f"{path}: the runs have gone on since it was begun and its classes changed; use --overwrite"
        )
    records = only_designed(old).records
    return records, Machines.read(old.about.get("machines"), len(records))


def _classes_of(pair: int) -> tuple[int, int]:
    """(a, b) of an unordered pair b (b + 1) / 2 + a."""
    b = int((np.sqrt(8 * pair + 1) - 1) // 2)
    return int(pair - b * (b + 1) // 2), b


def _now(reused: Records, done: int, wanted: int, known: Plan, started: float) -> TableProgress:
    return TableProgress(len(reused), done, wanted, known.mean_size, known.error, clock.monotonic() - started)
