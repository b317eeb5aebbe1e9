"""Tables of encounters for the population balance: the one crossing from mcdem to pbekit.

Two sources, one table.  A run's event log is re-used as it is.  Designed encounters fill what the run met seldom: pairs of
classes are chosen by what they contribute to the error of the steady mean size (`pbekit.study.uncertainty`), per unit of
work; two aggregates that the run produced are drawn from the classes in proportion to their flux (R_i + R_j)^3, and meet
under the uniform flux of `mcdem.encounter.simulate`.  So within a pair of classes all encounters follow one law.  A steady state
says little about how growth begins, so encounters of two primaries can be asked for apart.

The table is a function of scene, run, seed and number of encounters, whatever the workers and however often it was
interrupted: designed encounter k has its own random stream, and rounds of ROUND encounters are planned from what was
known at their start.
"""

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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcdem.aggregates.aggregate import Aggregate
from mcdem.aggregates.morphology import aspect_ratio, second_moments, semi_axes
from mcdem.analysis.dataset import RunDataset
from mcdem.analysis.similarity import COHESION, groups, sensitivities
from mcdem.encounter.simulate import EncounterResult, simulate_encounter
from mcdem.errors import DataFileError, MachineWarning, UserError
from mcdem.monte_carlo import executors
from mcdem.monte_carlo.executors import Encounter, ExecutorError
from mcdem.netcdf.origin import Machines
from mcdem.netcdf.whole_files import FILES
from mcdem.quantities.random_streams import checked, stream
from mcdem.scene import Scene
from pbekit import endings
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for
from pbekit.outputs import TABLE
from pbekit.solution.steady import NotReachedError, steady_state
from pbekit.study.evidence import Evidence, counted, judged
from pbekit.study.uncertainty import VarianceShares, mean_size_gradient, variance_shares
from pbekit.tables.atlas import Atlas, Part
from pbekit.tables.kernel_table import OUTCOMES, SHAPES, SOURCES, KernelTable, Records

ROUND = 200
"""Designed encounters between two updates of the estimate."""
DESIGNED_EPOCH = 1 << 40
"""Epoch of the random streams of designed encounters, far from those of any run."""
CHECKPOINT_EVERY = 60.0
"""Longest time between two writings of the table [s]."""
PHYSICS = ("suspension", "flow", "effects", "hydrodynamics", "numerics")
"""Tables of a scene that decide what an encounter does."""


# -- a run's events -------------------------------------------------------------------------------------------------


def outcome_of(word: str, contact: bool) -> int:
    """pbekit's outcome of mcdem's."""
    if word == "fragmentation":
        word += " with contact" if contact else " without contact"
    return OUTCOMES.index(word)


def records_of_run(run: RunDataset) -> Records:
    """Every encounter of a run's event log."""
    e = run.events
    names = [
        f"{of}_{name}" for of in ("parent", "product") for name in ("aspect_ratio", "radius_of_gyration")
    ]
    # Runs made before these were recorded are told apart by outer radius alone.
    shapes = [
        e[n].values if n in e else np.full_like(e[n.partition("_")[0] + "_outer_radius"].values, np.nan)
        for n in names
    ]
    touched = e["contact"].values.astype(bool)
    return Records(
        size=e["parent_size"].values,
        aspect_ratio=shapes[0],
        outer_radius=e["parent_outer_radius"].values,
        radius_of_gyration=shapes[1],
        offset=e["offset"].values,
        outcome=np.array(
            [outcome_of(str(w), c) for w, c in zip(run.outcome, touched, strict=True)], np.int64
        ),
        source=np.full(len(touched), SOURCES.index("run")),
        time=e["time"].values,
        solves=e["solves"].values,
        cpu_time=e["cpu_time"].values,
        products=e["number_of_products"].values,
        product_size=e["product_size"].values,
        product_from_first=e["product_from_first"].values,
        product_aspect_ratio=shapes[2],
        product_outer_radius=e["product_outer_radius"].values,
        product_radius_of_gyration=shapes[3],
    )


def same_physics(one: Scene, other: Scene) -> str | None:
    """The first table in which two scenes differ in what an encounter does, or None."""
    for table in PHYSICS:
        if getattr(one, table) != getattr(other, table) and table != "suspension":
            return table
    return None if one.suspension.radius == other.suspension.radius else "suspension"


def with_runs(designed: KernelTable, runs: Sequence[RunDataset]) -> KernelTable:
    """The table that `tabulate` made of these runs, from its designed encounters alone and the event logs again.

    Parameters
    ----------
    designed : KernelTable
        Of which only the designed encounters were kept; its classes stay as they are.
    runs : sequence of RunDataset
        Those that it names in `about["runs"]`.

    Returns
    -------
    KernelTable
        With every encounter of the runs.

    Raises
    ------
    UserError
        Of other runs.

    Examples
    --------
    >>> import mcdem
    >>> import pbekit
    >>> designed = pbekit.open_table("notebooks/data/designed-1500Pa.nc")
    >>> run = mcdem.open_run("notebooks/data/run-1500Pa-of-100.nc")
    >>> table = mcdem.with_runs(designed, [run])
    >>> designed.records.size.shape[0], table.records.size.shape[0]
    (400, 105800)
    """
    names = " ".join(run.path.name for run in runs)
    if names != designed.about["runs"]:
        raise UserError(f"runs = {names}: expected {designed.about['runs']}, with which the table was made")
    table = designed.with_records(
        Records.join([*(records_of_run(run) for run in runs), only_designed(designed).records])
    )
    return replace(table, about={**table.about, **_groups(runs[0].scene)}) if runs else table


def only_designed(table: KernelTable) -> KernelTable:
    """The designed encounters of a table, in its classes; `with_runs` gives it back."""
    return table.with_records(table.records.select(table.records.source == SOURCES.index("designed")))


def into_atlas(scene: Scene, runs: Sequence[Path | str], path: Path | str) -> Atlas:
    """Add the encounters of runs of a scene to an atlas, each run as a part of its own; made if it is not there.

    Parameters
    ----------
    scene : that the runs are of
    runs : datasets of `mcdem run`
    path : the atlas (.nc)

    Raises
    ------
    UserError : of runs of another scene
    DataFileError : of an atlas of other groups than the scene's, or one that holds a run already

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-750Pa.toml")
    >>> mcdem.into_atlas(scene, ["notebooks/data/run-750Pa.nc"], "my-atlas.nc")  # doctest: +SKIP
    """
    path = Path(path)
    if path.suffix != ".nc":
        raise UserError(f"{path}: expected a name that ends in .nc, the atlas that is written is NetCDF")
    scene.require_one_radius("an atlas counts equal primaries")
    with FILES.locked(path):
        try:
            atlas = Atlas.load(path) if path.exists() else Atlas(())
            for place in runs:
                run = RunDataset(place)
                differs = same_physics(scene, run.scene)
                if differs:
                    raise UserError(f"{place}: was run with another [{differs}] than {scene.name}")
                about = {
                    "scene": run.scene.text,
                    "scene_name": scene.name,
                    "runs": Path(place).name,
                    "seed": str(run.attributes.get("seed", "")),
                    "command": shlex.join(["mcdem", *sys.argv[1:]]),
                    **_groups(scene),
                }
                flow = scene.flow
                table = KernelTable.of(
                    records_of_run(run), scene.suspension.radius, flow.shear_rate, shapes=1, about=about
                )
                atlas = atlas.merged(Part.of(table))
            atlas.save(path)
        except PBEError as problem:
            raise DataFileError(str(problem)) from None
    return atlas


# -- aggregates to draw from ------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Library:
    """Aggregates that runs produced, by class of the table.

    members : (classes) row numbers of the aggregates in each class
    """

    aggregates: tuple[Aggregate, ...]
    outer_radius: NDArray[np.float64]
    members: tuple[NDArray[np.intp], ...]

    @classmethod
    def of(cls, runs: Sequence[RunDataset], table: KernelTable) -> Library:
        """All aggregates of all snapshots, and a monomer."""
        found = [Aggregate.monomer()]
        for run in runs:
            for snapshot in range(len(run.snapshot_times)):
                found += [a for a in run.aggregates(snapshot) if a.size > 1]
        ratios, gyration, outer = _shapes(found, table.radius)
        size = np.array([a.size for a in found])
        shape = {
            "aspect ratio": ratios,
            "outer radius": outer / (table.radius * np.cbrt(size)),
            "radius of gyration": gyration / (table.radius * np.cbrt(size)),
        }[table.shape_name]
        beyond = size >= table.size_edges[-1]
        of_class = np.where(beyond, -1, table.class_of(size, shape))
        return cls(tuple(found), outer, tuple(np.flatnonzero(of_class == k) for k in range(table.classes)))

    def has(self, a: NDArray[np.intp], b: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether there are aggregates of both classes."""
        some = np.array([len(m) > 0 for m in self.members])
        return some[a] & some[b]

    def draw(self, a: int, b: int, rng: np.random.Generator) -> tuple[int, int]:
        """An aggregate of each class, the pair in proportion to its flux."""
        one, other = self.members[a], self.members[b]
        most = (self.outer_radius[one].max() + self.outer_radius[other].max()) ** 3
        while True:
            i, j = rng.choice(one), rng.choice(other)
            if rng.random() * most < (self.outer_radius[i] + self.outer_radius[j]) ** 3:
                return int(i), int(j)


def _shapes(
    aggregates: Sequence[Aggregate], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Aspect ratio, radius of gyration [m] and outer radius [m] of each."""
    sizes = np.array([a.size for a in aggregates])
    moments = second_moments(np.concatenate([a.positions for a in aggregates]), sizes)
    outer = np.array([a.outer_radius(radius) for a in aggregates])
    return aspect_ratio(semi_axes(moments, radius)), np.sqrt(moments.sum(axis=1)), outer


def record_of(first: Aggregate, second: Aggregate, result: EncounterResult, radius: float) -> Records:
    """One designed encounter."""
    everyone = [first, second, *result.products]
    ratios, gyration, outer = _shapes(everyone, radius)
    sizes = np.array([a.size for a in everyone])
    return Records(
        size=sizes[None, :2],
        aspect_ratio=ratios[None, :2],
        outer_radius=outer[None, :2],
        radius_of_gyration=gyration[None, :2],
        offset=np.array([result.offset]),
        outcome=np.array([outcome_of(result.outcome, result.contact)]),
        source=np.array([SOURCES.index("designed")]),
        time=np.array([np.nan]),
        solves=np.array([result.solves]),
        cpu_time=np.array([result.cpu_time]),
        products=np.array([len(result.products)]),
        product_size=sizes[2:],
        product_from_first=np.array([int((m < first.size).sum()) for m in result.members]),
        product_aspect_ratio=ratios[2:],
        product_outer_radius=outer[2:],
        product_radius_of_gyration=gyration[2:],
    )


# -- the design --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Plan:
    """The encounters of a round: pairs of classes, and what the records so far say of the steady mean size."""

    pairs: NDArray[np.intp]
    mean_size: float | None = None
    error: float | None = None
    """Relative standard error of the steady <P>; None, as the size, where encounters that were seen bear none yet."""
    refusal: str = ""
    """Why there is no steady state, and what would give one."""


def steady_shares(table: KernelTable, volume_fraction: float) -> tuple[float, VarianceShares]:
    """Steady <P> of the balance on the table, and where its variance comes from.

    Parameters
    ----------
    table : KernelTable
        With encounters enough for a steady state.
    volume_fraction : float
        Of primaries [-].

    Returns
    -------
    mean_size : float
        Steady <P>.
    shares : VarianceShares
        Whose `deviation` is its standard error, and whose `largest` are the pairs of classes that make it.

    Raises
    ------
    PBEError
        Where encounters that were seen bear no steady state, with what is missing.
    """
    value, shares, evidence = _shares(table, volume_fraction)
    if value is None or shares is None or not evidence.holds:
        raise PBEError(evidence.refusal(table))
    return value, shares


def _shares(
    table: KernelTable, volume_fraction: float
) -> tuple[float | None, VarianceShares | None, Evidence]:
    """Steady <P> and variance shares, None where sizes only grow; and whether encounters that were seen bear them."""
    estimated = EstimatedRates(table, grid_for(table))
    evidence = counted(estimated)
    if evidence.breakups == 0:
        return None, None, evidence
    number = volume_fraction / (4 / 3 * np.pi * table.radius**3)
    try:
        steady = steady_state(estimated.mean, estimated.grid.monodisperse(number))
    except NotReachedError:
        return None, None, replace(evidence, moved=np.inf)
    gradient = mean_size_gradient(estimated.mean, steady.population)
    shares = variance_shares(estimated, steady, gradient)
    if evidence.holds:
        evidence = judged(estimated, steady)
    return number / float(steady.population.sum()), shares, evidence


def plan(
    table: KernelTable, library: Library, volume_fraction: float, seed: int, done: int, primaries: int = 0
) -> Plan:
    """What the next round should sample: by variance shares, or evenly where no steady state is in sight.

    primaries : encounters of two primaries that come before any others
    """
    b, a = np.tril_indices(table.classes)
    possible = library.has(a, b)
    rng = stream(seed, "kernel design", done)
    mean_size = error = None
    trials = table.counts.sum(axis=1)
    # Where too little is known: the fewer the trials of a pair, the more likely it is.
    weight = possible / (1.0 + trials)
    try:
        value, shares, evidence = _shares(table, volume_fraction)
    except PBEError as problem:
        shares, refusal = None, f"no steady state: {problem}"
    else:
        refusal = "" if evidence.holds else evidence.refusal(table)
        if shares is not None and value is not None and not refusal:
            mean_size, error = value, shares.deviation / value
    if shares is not None:
        spent = np.bincount(table.pair, table.records.work, table.pairs)
        cost = np.divide(spent, trials, out=np.zeros(table.pairs), where=trials > 0)
        wanted = np.where(possible, shares.next_trials(8 * ROUND, cost), 0)
        # A steady state that nothing bears says little of where to look: then half of the encounters go where few were.
        even = 0.5 if refusal else 0.0
        if wanted.sum() > 0:
            weight = even * weight / weight.sum() + (1.0 - even) * wanted / wanted.sum()
    weight = weight / weight.sum()
    pairs = rng.choice(table.pairs, ROUND, p=weight)
    pairs[: max(0, primaries - int(table.counts[0].sum()))] = 0
    return Plan(pairs, mean_size, error, refusal)


# -- the process -------------------------------------------------------------------------------------------------------


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
    opened = [RunDataset(p) for p in runs]
    for run in opened:
        differs = same_physics(scene, run.scene)
        if differs and not aggregates_only:
            raise UserError(
                f"{run.path}: was run with another [{differs}] than {scene.name}; its events do not apply here: "
                "add --aggregates-only to use its aggregates alone"
            )
    started = clock.monotonic()
    with FILES.locked(path), endings.Deferred() as interruption:
        with interruption.allowed(), endings.keeping("nothing was computed, nothing written"):
            reused = Records.join([] if aggregates_only else [records_of_run(run) for run in opened])
            base = _classes(scene, opened, reused, shape, shapes, seed)
            if sensitivity is not None:
                powers = json.dumps(sensitivities(scene, sensitivity))
                base = replace(base, about={**base.about, "sensitivities": powers})
            designed, machines = (
                _designed(path, base) if resume and path.exists() else (Records.empty(), Machines())
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


def _classes(
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
    about |= _groups(scene)
    return KernelTable.of(
        seen, scene.suspension.radius, flow.shear_rate, shapes=shapes, shape_name=shape, about=about
    ).with_records(Records.empty())


def _groups(scene: Scene) -> dict[str, Any]:
    """Attributes of a table that say the dimensionless groups of its scene."""
    found = groups(scene)
    about: dict[str, Any] = {"groups": json.dumps(found)}
    if COHESION in found:
        about[COHESION] = found[COHESION].value
    return about


def _designed(path: Path, base: KernelTable) -> tuple[Records, Machines]:
    """The designed encounters of a table begun before and who computed them, if it is of the same scene, seed and classes."""
    try:
        old = KernelTable.load(path)
    except PBEError as problem:
        raise DataFileError(str(problem)) from None
    for key in ("scene", "seed", "runs"):
        if old.about.get(key) != base.about[key]:
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
