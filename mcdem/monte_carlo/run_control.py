"""A run led from its start to its end: who computes the encounters, when the dataset is written, how the run may end.

What happens to the suspension is in `mcdem.monte_carlo.process`; here are wall-clock time, the processors, the file and the
user, none of which changes a bit of the dataset.
"""

from __future__ import annotations

import contextlib
import time as clock
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

import threadpoolctl

from mcdem.arguments import scene_at_door, stop_at_door
from mcdem.encounter.simulate import simulate_encounter
from mcdem.errors import DataFileError, MachineWarning, UserError
from mcdem.monte_carlo import executors
from mcdem.monte_carlo.executors import Encounter, ExecutorError
from mcdem.monte_carlo.process import Process
from mcdem.monte_carlo.speculative_execution import SpeculativeExecution
from mcdem.netcdf.whole_files import FILES, RUN
from mcdem.scene import Scene
from pbekit import endings

CHECKPOINT_EVERY = 60.0
"""Longest time between two writings of the dataset [s]; as much work is lost if the machine goes down."""
SHARE_OF_WRITING = 0.02
"""Writing takes no larger share of the run's time: a file slow to write is written less often."""


@dataclass(frozen=True)
class RunProgress:
    """Where a run stands.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import mcdem
    >>> scene, seen = mcdem.load_scene("scenes/paper-1000Pa.toml"), []
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     summary = mcdem.run(scene, Path(folder) / "run.nc", events=20, progress=seen.append)
    >>> seen[-1].events, seen[-1].done
    (20, 1.0)
    """

    time: float
    """Process time [s]."""
    events: int
    aggregates: int
    mean_size: float
    """<P>"""
    outcomes: dict[str, int]
    """Encounters by outcome."""
    done: float
    """Share of the wanted time or number of encounters, whichever is nearer."""
    remaining: float | None
    """Wall-clock time left at the present pace [s]; None until a pace is known."""
    elapsed: float
    """Wall-clock time since `run` was called [s]."""

    def __str__(self) -> str:
        parts = [_reached(self.time, self.events, self.outcomes), f"<P> = {self.mean_size:.2f}"]
        # The first events wait for the compiler, and say nothing about the pace.
        if self.remaining is not None and self.done > 0.01:
            parts.append(f"{timedelta(seconds=round(self.remaining))} left")
        return ", ".join(parts)


@dataclass(frozen=True)
class RunSummary:
    """What a call of `run` did.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     summary = mcdem.run(scene, Path(folder) / "run.nc", events=20)
    >>> summary.events, sum(summary.outcomes.values())
    (20, 20)
    """

    path: Path
    time: float
    """Process time reached [s]."""
    events: int
    """Encounters in the dataset."""
    outcomes: dict[str, int]
    ended_by: str
    """"time", "events", "interruption", or "one aggregate left"."""
    computed: int
    """Encounters computed by this call, ..."""
    discarded: int
    """... those among them that did not take place, ..."""
    elapsed: float
    """... and its wall-clock time [s]."""

    def __str__(self) -> str:
        return f"{_reached(self.time, self.events, self.outcomes)}; ended by {self.ended_by}"


def _reached(time: float, events: int, outcomes: Mapping[str, int]) -> str:
    """Where a process is, in words."""
    counts = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.items() if count)
    return f"t = {time:.4g} s, {events} events" + (f" ({counts})" if counts else "")


def run(
    scene: Scene,
    output: Path | str,
    *,
    seed: int | None = None,
    until: float | str | None = None,
    events: int | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[RunProgress], None] | None = None,
    encounter: Encounter = simulate_encounter,
    keep_parents: tuple[str, ...] = ("unresolved",),
    checkpoint_every: float = CHECKPOINT_EVERY,
) -> RunSummary:
    """Follow the suspension of `scene` and write its dataset (layout: `mcdem.monte_carlo.record`).

    Parameters
    ----------
    scene : what is followed
    output : file to write; whole at every moment
    seed, until, events : instead of the scene's; the run ends at `until` (a number in s or with a unit) or after `events`
        encounters
    workers : processes that compute encounters; the dataset is the same for any number
    executor : computes the encounters instead: anything with the contract of `concurrent.futures.Executor`
    resume : go on from what `output` holds, if it exists
    overwrite : replace `output` if it exists
    progress : called with a `RunProgress` a few times a second
    encounter : resolves an encounter, `simulate_encounter` or anything of its form
    keep_parents : outcomes for which the geometry of the parents is kept
    checkpoint_every : longest time between two writings [s]; but writing takes at most 2 % of the time

    Ctrl-C, SIGTERM and SIGHUP end the run in order; the dataset then holds everything until the last encounter.
    The dataset is the same, bit for bit, for any number of workers of one kind of machine (`mcdem.netcdf.origin`); where kinds
    are mixed, in one call or by `resume`, it warns (`MachineWarning`).
    Raises `UserError` for what the user can mend; `ExecutorError`, the dataset written, for whatever befell the executor.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import mcdem
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     summary = mcdem.run(scene, Path(folder) / "run.nc", events=100)
    ...     run = mcdem.open_run(summary.path)
    >>> summary.events, f"{len(run.series.time)} rows"
    (100, '101 rows')
    """
    scene_at_door(scene)
    end, events = stop_at_door(until, events)
    path = Path(output)
    if end is None and events is None:
        end, events = scene.run.until, scene.run.events
    if end is None and events is None:
        raise UserError(
            f'{scene.name}: nothing says when to stop; give "until" or "events", here or in [run]'
        )
    started = clock.monotonic()
    with FILES.locked(path), threadpoolctl.threadpool_limits(limits=1), endings.Deferred() as interruption:
        with interruption.allowed(), endings.keeping("nothing was computed, nothing written"):
            process = _open(scene, path, seed, resume=resume, overwrite=overwrite, keep_parents=keep_parents)
        crew = _crew(executor, workers)
        with crew as (pool, width):
            compute = executors.computation(scene, encounter, process.record.seed, pool)
            speculation = SpeculativeExecution(
                compute,
                pool,
                width,
                process.population,
                process.selection,
                alone=isinstance(pool, executors.Here),
            )
            writing = _Writing(process, path, speculation, checkpoint_every)
            pace = _Pace(process, end, events, started)
            writing.now()
            ended_by = ""
            while not ended_by:
                left = None if events is None else events - process.events
                if left is not None and left <= 0:
                    ended_by = "events"
                    continue
                ahead = process.selection.ahead(speculation.depth).cut(left, end)
                if not len(ahead):
                    if end is not None:
                        process.wait(max(end, process.time))
                    ended_by = "one aggregate left" if end is None else "time"
                    continue
                try:
                    with interruption.allowed():
                        result = speculation.result(ahead)
                except KeyboardInterrupt:
                    ended_by = "interruption"
                    continue
                except BaseException as problem:
                    of_executor = isinstance(problem, ExecutorError)
                    if of_executor and endings.asked(within=0.5):
                        ended_by = "interruption"
                        continue
                    writing.now()
                    if of_executor:
                        raise ExecutorError(
                            f"{problem}; {path} holds everything until t = {process.time:.6g} s: continue with "
                            "--resume, maybe on fewer workers"
                        ) from problem
                    raise
                if told := process.record.machines.computed(result.machine):
                    warnings.warn(f"{path}: {told}", MachineWarning, stacklevel=2)
                speculation.happened(process.encounter(ahead.meeting(0), result))
                writing.if_due()
                if progress is not None and pace.report_due():
                    progress(pace.report())
            speculation.close()
            writing.now()
            if progress is not None:
                progress(pace.report())
    return RunSummary(
        path,
        process.time,
        process.events,
        process.record.outcomes,
        ended_by,
        speculation.computed,
        speculation.discarded,
        clock.monotonic() - started,
    )


def _open(
    scene: Scene,
    path: Path,
    seed: int | None,
    *,
    resume: bool,
    overwrite: bool,
    keep_parents: tuple[str, ...],
) -> Process:
    """The process at its start, or as the file at `path` left it."""
    if not path.exists() or not resume:
        if path.is_file() and not overwrite:
            raise DataFileError(
                f"{path}: exists already; continue it with --resume, or replace it with --overwrite"
            )
        FILES.check(path, RUN)
        return Process.begin(scene, scene.run.seed if seed is None else seed, keep_parents)
    process = Process.resume(scene, path)
    FILES.check(path, RUN)
    if seed is not None and seed != process.record.seed:
        raise DataFileError(
            f"{path}: was begun with seed {process.record.seed}, not {seed}; leave the seed out"
        )
    return process


@contextlib.contextmanager
def _crew(executor: Executor | None, workers: int) -> Iterator[executors.Crew]:
    if executor is not None:
        yield executors.Crew(executor, max(workers, executors.width(executor)))
    else:
        with executors.opened("process", workers) as crew:
            yield crew


class _Writing:
    """Writes the dataset now and then."""

    def __init__(self, process: Process, path: Path, speculation: SpeculativeExecution, every: float) -> None:
        self._process, self._path, self._speculation, self._every = process, path, speculation, every
        self._next = 0.0

    def now(self) -> None:
        began = clock.monotonic()
        self._process.write(self._path, self._speculation.discarded)
        ended = clock.monotonic()
        self._next = ended + max(self._every, (ended - began) / SHARE_OF_WRITING)

    def if_due(self) -> None:
        if clock.monotonic() >= self._next:
            self.now()


class _Pace:
    """How fast the run goes, from the last half minute or so."""

    def __init__(self, process: Process, until: float | None, events: int | None, started: float) -> None:
        self._process, self._until, self._events, self._started = process, until, events, started
        self._shares = deque([(clock.monotonic(), self._done())], maxlen=30)
        self._reported = 0.0

    def _done(self) -> float:
        shares = [0.0]
        if self._until is not None:
            shares.append(self._process.time / self._until)
        if self._events is not None:
            shares.append(self._process.events / self._events if self._events else 1.0)
        return min(max(shares), 1.0)

    def report_due(self) -> bool:
        return clock.monotonic() - self._reported > 0.2

    def report(self) -> RunProgress:
        now, done = clock.monotonic(), self._done()
        self._reported = now
        then, done_then = self._shares[0]
        remaining = (1.0 - done) * (now - then) / (done - done_then) if done > done_then else None
        if now - self._shares[-1][0] > 1.0:
            self._shares.append((now, done))
        process = self._process
        return RunProgress(
            process.time,
            process.events,
            process.population.number,
            process.population.mean_size,
            process.record.outcomes,
            done,
            remaining,
            now - self._started,
        )
