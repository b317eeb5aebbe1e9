"""Encounters of two sizes until one probability is known: `mcdem kernels --until-error eta=5%`.

What is wanted is a quantity of the user and not a course: offsets are drawn where they narrow its error most
(`mcdem.encounter.offset_strata`), aggregates of the two sizes by their flux from those of the runs, orientations as ever.  Each
encounter is whole and carries its weight, so that means with the weights are those of a uniform flux for everything that a
table says: outcomes, fragments, shapes, radii.

The table is a function of scene, runs, seed and what is wanted, whatever the workers and however often it was interrupted: a
round is planned from what whole rounds before it say, and encounter k has its own random stream.
"""

from __future__ import annotations

import re
import shlex
import sys
import time as clock
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcdem.encounter.offset_strata import (
    Estimate,
    Tally,
    allotted,
    draw_in,
    estimate,
    round_length,
    weights,
)
from mcdem.encounter.simulate import EncounterResult, simulate_encounter
from mcdem.errors import DataFileError, MachineWarning, UserError
from mcdem.kernel_tables.library import Library, record_of
from mcdem.kernel_tables.runs import records_of_run
from mcdem.kernel_tables.tabulation import (
    CHECKPOINT_EVERY,
    WANTED,
    classes,
    designed_before,
    opened_for,
    refuse_unwritable,
)
from mcdem.monte_carlo import executors
from mcdem.monte_carlo.executors import Encounter, ExecutorError
from mcdem.netcdf.origin import Machines
from mcdem.netcdf.whole_files import FILES
from mcdem.quantities.random_streams import checked, stream
from mcdem.scene import Scene
from pbekit import endings
from pbekit.errors import PBEError
from pbekit.tables.kernel_table import AGGREGATION, SCATTERED, SHAPES, UNRESOLVED, KernelTable, Records

EPOCH = (1 << 40) + 1
"""Epoch of the random streams of these encounters, beside that of other designed ones."""
BEFORE_ANY = 10.0
"""Work of an encounter before its first step, in evaluations of the hydrodynamics: bodies are analysed, and pass each other."""
KINDS = {"eta": (AGGREGATION,), "breakup": SCATTERED}
"""Outcomes of what may be wanted: aggregation efficiency, and breakup probability."""
FORM = 'expected such as "eta=5%" or "breakup=10%": the relative standard error to reach, from 0.1% to below 100%'
SMALLEST = 1e-3
MOST = 10**6
"""Encounters at most, unless another bound is given."""


@dataclass(frozen=True)
class Wanted:
    """A quantity, "eta" or "breakup", and the relative standard error to reach."""

    quantity: str
    error: float

    @classmethod
    def read(cls, given: str) -> Wanted:
        """From text such as "eta=5%"; raises `UserError` that says what was expected."""
        found = re.fullmatch(r"\s*(\w+)\s*=\s*([0-9.eE+-]+)\s*(%?)\s*", str(given))
        try:
            if found is None or found[1] not in KINDS:
                raise ValueError
            error = float(found[2]) / (100.0 if found[3] else 1.0)
        except ValueError:
            raise UserError(f'--until-error "{given}": {FORM}') from None
        if not SMALLEST <= error < 1.0:
            raise UserError(f'--until-error "{given}": {FORM}')
        return cls(found[1], error)


def sizes_of(given: str) -> tuple[int, int]:
    """Two sizes from text such as "10+10"; raises `UserError`."""
    found = re.fullmatch(r"\s*(\d{1,6})\s*\+\s*(\d{1,6})\s*", str(given))
    sizes = (int(found[1]), int(found[2])) if found else (0, 0)
    if min(sizes) < 1:
        raise UserError(f'--pair "{given}": expected two sizes in primaries, such as 10+10')
    return sizes


@dataclass(frozen=True)
class Sought:
    """What is known of the wanted probability.

    found : None before the first whole round;  cpu_time : [s] of all encounters, those computed before an interruption too
    """

    wanted: Wanted
    pair: tuple[int, int]
    encounters: int
    cpu_time: float
    found: Estimate | None

    @property
    def done(self) -> float:
        """Share of the work, as errors fall with its root."""
        if self.found is None or not self.found.value:
            return 0.0
        return min((self.wanted.error / self.found.relative) ** 2, 1.0)

    def __str__(self) -> str:
        line = (
            f"{self.encounters} encounters of {self.pair[0]} + {self.pair[1]}, {self.cpu_time:.3g} s of CPU"
        )
        if self.found is None:
            return line
        name, e = self.wanted.quantity, self.found
        line += f"; {name} = {e.value:.4g}"
        if e.value > 0.0:
            line += f", standard error {100 * e.relative:.2g} % of {100 * self.wanted.error:g} % wanted"
        return f"{line}, 95 % interval {e.low:.4g} to {e.high:.4g}"


@dataclass(frozen=True)
class SoughtSummary:
    """What a call of `tabulate_until` left.

    Parameters
    ----------
    path : Path
        The table.
    sought : Sought
        What is known of the wanted probability: `found` has it with its error and interval.
    ended_by : str
        "error", "encounters" or "interruption".

    Examples
    --------
    >>> from pathlib import Path
    >>> import mcdem
    >>> from mcdem.kernel_tables.until_error import Sought, Wanted
    >>> print(mcdem.SoughtSummary(Path("pair.nc"), Sought(Wanted.read("eta=5%"), (1, 1), 100, 0.7, None), "encounters"))
    pair.nc: 100 encounters of 1 + 1, 0.7 s of CPU; ended by encounters
    """

    path: Path
    sought: Sought
    ended_by: str

    def __str__(self) -> str:
        line = f"{self.path}: {self.sought}; ended by {self.ended_by}"
        e = self.sought.found
        if e is not None and e.unresolved > 0.0:
            line += f"\n{100 * e.unresolved:.2g} % could not be followed and are left out"
        return line


@dataclass
class Rounds:
    """The rounds of strata, as far as encounters are known.

    strata, weight : (n_t,) of the encounters of the round under way, in their order
    """

    seed: int
    kinds: tuple[int, ...]
    whole: list[Tally] = field(default_factory=list)
    done: int = 0
    strata: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, np.intp))
    weight: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def begin(self) -> None:
        """Plan the next round from the whole ones.

        Its order is random, so that as much of it as was computed when it is interrupted has the same weights.
        """
        trials = allotted(self.whole, round_length(self.done))
        every = np.repeat(np.arange(trials.size), trials)
        self.strata = stream(self.seed, "strata", len(self.whole)).permutation(every)
        self.weight = weights(trials)[self.strata]

    def end(self, records: Records) -> None:
        """Count a round that is whole."""
        hit, lost = np.isin(records.outcome, self.kinds), records.outcome == UNRESOLVED
        self.whole.append(Tally.of(self.strata, hit, lost, records.solves + BEFORE_ANY))
        self.done += len(self.strata)


def tabulate_until(
    scene: Scene,
    output: Path | str,
    runs: Sequence[Path | str] = (),
    *,
    wanted: str,
    pair: str | tuple[int, int] = (1, 1),
    encounters: int = MOST,
    aggregates_only: bool = False,
    shape: str = "aspect ratio",
    shapes: int = 3,
    seed: int | None = None,
    executor: Executor | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[Sought], None] | None = None,
    encounter: Encounter = simulate_encounter,
    checkpoint_every: float = CHECKPOINT_EVERY,
) -> SoughtSummary:
    """Make the table of encounters of two sizes that says one of their probabilities to a wanted error.

    Parameters
    ----------
    scene : Scene
        Whose encounters are tabulated.
    output : path
        File to write; whole at every moment.
    runs : sequence of paths
        Datasets of `mcdem run` whose aggregates of these sizes meet, drawn by their flux, and whose events the table takes along.
    wanted : str
        "eta=5%" or "breakup=10%": aggregation efficiency or breakup probability, and the relative standard error to reach.
    pair : str or (int, int)
        Their sizes in primaries: "10+10" or (10, 10).
    encounters : int
        At most so many.
    aggregates_only : bool
        Leave the runs' events out of the table.
    shape, shapes : str, int
        Second coordinate of the classes, and how many classes it has.
    seed : int
        Instead of the scene's.
    executor : Executor
        Computes the encounters; the table is the same.
    resume, overwrite : bool
        Go on with what `output` holds; replace it.
    progress : callable
        Called with a `Sought`.
    encounter : callable
        Resolves an encounter, `simulate_encounter` or anything of its form.
    checkpoint_every : float
        Longest time between two writings [s].

    Returns
    -------
    SoughtSummary
        The probability with its error and interval, and what it took.

    Raises
    ------
    UserError
        Of a form of `wanted` or `pair` that is not known, and sizes of which the runs hold no aggregate.

    Examples
    --------
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> mcdem.tabulate_until(scene, "pair.nc", wanted="eta=5", pair="1+1")
    Traceback (most recent call last):
    mcdem.errors.UserError: --until-error "eta=5": expected such as "eta=5%" or "breakup=10%": the relative standard error ...
    >>> found = mcdem.tabulate_until(scene, "pair.nc", wanted="eta=5%", pair="1+1").sought.found  # doctest: +SKIP
    """
    path, seed = Path(output), checked(scene.run.seed if seed is None else seed)
    aim = Wanted.read(wanted)
    sizes = sizes_of(pair if isinstance(pair, str) else "+".join(str(p) for p in pair))
    if not 1 <= encounters <= MOST:
        raise UserError(f"encounters = {encounters}: expected 1 to {MOST}, the most to spend")
    scene.require_one_radius("a table for the balance counts equal primaries")
    if shape not in SHAPES:
        raise UserError(f'shape = "{shape}": expected one of {", ".join(SHAPES)}')
    refuse_unwritable(path, resume=resume, overwrite=overwrite)
    opened = opened_for(scene, runs, aggregates_only=aggregates_only)
    with FILES.locked(path), endings.Deferred() as interruption:
        with interruption.allowed(), endings.keeping("nothing was computed, nothing written"):
            reused = Records.join([] if aggregates_only else [records_of_run(run) for run in opened])
            base = classes(scene, opened, reused, shape, shapes, seed)
            about = dict(zip(WANTED, (aim.quantity, f"{sizes[0]}+{sizes[1]}"), strict=True))
            base = replace(base, about={**base.about, **about})
            library = Library.of(opened, base)
            members = [of_size(library, size) for size in sizes]
            records, machines = (
                designed_before(path, base) if resume and path.exists() else (Records.empty(), Machines())
            )
        work = _Work(path, scene, base, reused, library, members, aim, sizes, seed, machines)
        work.take_up(records)
        return work.go_on(
            executor or executors.Here(), encounter, encounters, interruption, progress, checkpoint_every
        )


def of_size(library: Library, size: int) -> NDArray[np.intp]:
    """The aggregates of a size; raises `UserError` where there are none."""
    sizes = np.array([a.size for a in library.aggregates])
    if not (sizes == size).any():
        near = np.unique(sizes)[np.argsort(np.abs(np.unique(sizes) - size), kind="stable")[:4]]
        raise UserError(
            f"--pair: the runs hold no aggregate of {size} primaries; the sizes next to it are "
            f"{', '.join(map(str, np.sort(near)))}: choose among these, or add a run (--from) that holds some"
        )
    return np.flatnonzero(sizes == size)


@dataclass
class _Work:
    """A table under way."""

    path: Path
    scene: Scene
    base: KernelTable
    reused: Records
    library: Library
    members: list[NDArray[np.intp]]
    wanted: Wanted
    sizes: tuple[int, int]
    seed: int
    machines: Machines

    def __post_init__(self) -> None:
        self.rounds = Rounds(self.seed, KINDS[self.wanted.quantity])
        self.rounds.begin()
        self.kept: list[Records] = []
        self.current: list[Records] = []
        self.done, self.cpu_time = 0, 0.0

    # -- what is known -------------------------------------------------------------------------------------------------

    def take_up(self, records: Records) -> None:
        """Go on from encounters of an interrupted call: rounds are planned again as they were."""
        first = 0
        while first < len(records):
            own = records.select(np.arange(first, min(first + len(self.rounds.strata), len(records))))
            first += len(own)
            self.add(own)

    def add(self, records: Records) -> None:
        """Encounters of the round under way, which may be whole with them."""
        self.current.append(records)
        self.done += len(records)
        self.cpu_time += float(records.cpu_time.sum())
        if self.done == self.rounds.done + len(self.rounds.strata):
            whole = Records.join(self.current)
            self.kept, self.current = [*self.kept, whole], []
            self.rounds.end(whole)
            self.rounds.begin()

    @property
    def sought(self) -> Sought:
        found = estimate(self.rounds.whole) if self.rounds.whole else None
        return Sought(self.wanted, self.sizes, self.done, self.cpu_time, found)

    @property
    def reached(self) -> bool:
        """Whether whole rounds say it well enough."""
        found = self.sought.found
        return found is not None and found.relative <= self.wanted.error

    def save(self) -> None:
        """Write the table with all that is known."""
        about = {
            **self.base.about,
            "designed": self.done,
            "machines": str(self.machines),
            "command": shlex.join(["mcdem", *sys.argv[1:]]),
        }
        found = self.sought.found
        if found is not None:
            about |= {
                self.wanted.quantity: found.value,
                f"{self.wanted.quantity}_standard_error": found.deviation,
                f"{self.wanted.quantity}_interval": [found.low, found.high],
            }
        records = Records.join([self.reused, *self.kept, *self.current])
        try:
            replace(self.base.with_records(records), about=about).save(self.path)
        except PBEError as problem:
            raise DataFileError(str(problem)) from None

    # -- encounters --------------------------------------------------------------------------------------------------

    def drawn(self, number: int) -> tuple[int, int, tuple[float, float]]:
        """Aggregates and offset [m] of an encounter of the round under way."""
        rng = stream(self.seed, "encounter by strata", number)
        i, j = self.library.draw_of(self.members[0], self.members[1], rng)
        reach = float(self.library.outer_radius[[i, j]].sum())
        return i, j, draw_in(int(self.rounds.strata[number - self.rounds.done]), reach, rng)

    def go_on(
        self,
        pool: Executor,
        encounter: Encounter,
        most: int,
        interruption: endings.Deferred,
        progress: Callable[[Sought], None] | None,
        checkpoint_every: float,
    ) -> SoughtSummary:
        """Compute encounters until the error, or the bound, is reached."""
        compute = executors.computation(self.scene, encounter, self.seed, pool)
        ahead, saved, ended_by = not isinstance(pool, executors.Here), clock.monotonic(), ""
        futures: list[Future[EncounterResult]] = []

        def begin(number: int) -> Future[EncounterResult]:
            i, j, offset = self.drawn(number)
            first, second = self.library.aggregates[i], self.library.aggregates[j]
            task = partial(compute, offset=offset)
            return executors.submit(pool, task, first, second, EPOCH, number)

        try:
            while not ended_by:
                if self.reached or self.done >= most:
                    ended_by = "error" if self.reached else "encounters"
                    break
                numbers = range(self.done, min(self.rounds.done + len(self.rounds.strata), most))
                futures = [begin(number) for number in numbers] if ahead else []
                for number in numbers:
                    i, j, _ = self.drawn(number)
                    with interruption.allowed():
                        result = executors.result_of(
                            futures[number - numbers.start] if ahead else begin(number)
                        )
                    if told := self.machines.computed(result.machine):
                        warnings.warn(f"{self.path}: {told}", MachineWarning, stacklevel=2)
                    first, second = self.library.aggregates[i], self.library.aggregates[j]
                    weight = float(self.rounds.weight[number - self.rounds.done])
                    self.add(record_of(first, second, result, self.base.radius, weight))
                    if clock.monotonic() - saved > checkpoint_every:
                        self.save()
                        saved = clock.monotonic()
                    if progress is not None:
                        progress(self.sought)
        except KeyboardInterrupt:
            ended_by = "interruption"
        except BaseException as problem:
            if not (isinstance(problem, ExecutorError) and endings.asked(within=0.5)):
                self.save()
                raise
            ended_by = "interruption"
        finally:
            for future in futures:
                future.cancel()
        self.save()
        return SoughtSummary(self.path, self.sought, ended_by)
