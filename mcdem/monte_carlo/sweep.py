"""Ensembles: the runs of a scene over values of its keys and over replicas, one dataset each and one index.

The folder holds, for `flow.shear_stress=750Pa,1000Pa` and two replicas,

    index.csv                       a line for each member: file, settings, seed, state, what it reached or why it failed
    shear_stress=750Pa.1.nc         datasets of `mcdem run`
    shear_stress=750Pa.2.nc  ...

A member's seed follows from the sweep's seed, its settings and its replica alone, so that a sweep may be extended later
by values or replicas: members that are finished are never run again, those cut off go on where they stopped.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import itertools
import os
import signal
import threading
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, as_completed
from dataclasses import dataclass, replace
from multiprocessing import active_children
from pathlib import Path
from typing import Any

from mcdem.encounter.simulate import simulate_encounter
from mcdem.errors import DataFileError, UserError
from mcdem.monte_carlo import process as simulate
from mcdem.monte_carlo.executors import Encounter, local_processes
from mcdem.monte_carlo.record import reached
from mcdem.netcdf.whole_files import locked, write_text
from mcdem.scene import Scene

STATES = ("waiting", "running", "done", "interrupted", "failed")


@dataclass(frozen=True)
class Member:
    """One run of a sweep."""

    scene: Scene
    file: Path
    settings: dict[str, str]
    """Dotted key -> value, as given."""
    replica: int
    seed: int
    state: str = "waiting"
    """One of STATES."""
    time: float = 0.0
    """Process time reached [s]."""
    events: int = 0
    why: str = ""
    """Why it failed."""


def parse_setting(given: str) -> tuple[str, list[str]]:
    """("flow.shear_stress", ["750Pa", "875Pa"]) of "flow.shear_stress=750Pa,875Pa"; raises `UserError`."""
    key, equals, values = (part.strip() for part in given.partition("="))
    found = [value.strip() for value in values.split(",")]
    if not equals or not all(key.split(".")) or "." not in key or not all(found):
        raise UserError(
            f'--set "{given}": expected TABLE.KEY=VALUE,VALUE,... such as flow.shear_stress=750Pa,875Pa'
        )
    return key, found


def members(
    scene: Scene, settings: Mapping[str, Sequence[str]], replicas: int, seed: int, folder: Path
) -> list[Member]:
    """Every combination of the values, `replicas` times; raises `UserError` if one is not a scene."""
    if replicas < 1:
        raise UserError(f"replicas = {replicas}: expected 1 or more")
    found = []
    for values in itertools.product(*settings.values()):
        chosen = dict(zip(settings, values, strict=True))
        changed = scene.with_changes({key: toml_value(value) for key, value in chosen.items()})
        point = ",".join(
            f"{_short(key, settings)}={value.replace(' ', '_')}" for key, value in chosen.items()
        )
        for replica in range(1, replicas + 1):
            name = f"{(point or scene.name).replace('/', '_per_')}.{replica}.nc"
            found.append(Member(changed, folder / name, chosen, replica, _seed(seed, point, replica)))
    if len({member.file for member in found}) < len(found):
        raise UserError("--set: a value is given twice")
    return found


def toml_value(value: str) -> Any:
    """A value as the scene file would hold it: number, boolean, or text with a unit; "none" removes the key."""
    if value == "none":
        return None
    try:
        return tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return value


def _short(key: str, settings: Mapping[str, Sequence[str]]) -> str:
    """The key without its table, where that is clear."""
    last = key.rpartition(".")[2]
    return last if sum(other.rpartition(".")[2] == last for other in settings) == 1 else key


def _seed(seed: int, point: str, replica: int) -> int:
    """Members draw independent numbers, also those of the same replica at different points."""
    digest = hashlib.blake2b(f"{seed} {point} {replica}".encode(), digest_size=4).digest()
    return int.from_bytes(digest, "little")


def sweep(
    scene: Scene,
    folder: Path | str,
    settings: Mapping[str, Sequence[str]],
    *,
    replicas: int = 1,
    seed: int | None = None,
    until: float | None = None,
    events: int | None = None,
    executor: Executor,
    progress: Callable[[Member], None] | None = None,
    encounter: Encounter = simulate_encounter,
) -> list[Member]:
    """Run what of a sweep is not finished, each member on one worker of `executor`.

    Parameters
    ----------
    folder : of the datasets and the index; made if it is not there
    settings : dotted key -> values, as in the scene file
    seed, until [s], events : as for `simulate.run`
    progress : called with each member when it is done, has failed or was interrupted

    A member that fails does not stop the others; Ctrl-C lets each write its dataset.  Returns all members.
    """
    folder = Path(folder)
    if until is None and events is None:
        until, events = scene.run.until, scene.run.events
    every = members(scene, settings, replicas, scene.run.seed if seed is None else seed, folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise DataFileError(f"{folder}: cannot be made a folder ({problem.strerror}); name another") from None
    with locked(folder / "index.csv"), _termination_as_interruption():
        return _Sweep(every, folder / "index.csv", until, events, executor, progress, encounter).run()


@contextlib.contextmanager
def _termination_as_interruption() -> Iterator[None]:
    """SIGTERM, with which batch systems end a job, as Ctrl-C."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


class _Sweep:
    """Members, their states, and the index that tells them."""

    def __init__(
        self,
        every: Sequence[Member],
        index: Path,
        until: float | None,
        events: int | None,
        executor: Executor,
        progress: Callable[[Member], None] | None,
        encounter: Encounter,
    ) -> None:
        self._members = list(every)
        self._index, self._until, self._events = index, until, events
        self._executor, self._progress, self._encounter = executor, progress, encounter

    def run(self) -> list[Member]:
        for k, member in enumerate(self._members):
            self._look(k, member)
        self._write_index()
        waiting = [k for k, member in enumerate(self._members) if member.state == "waiting"]
        try:
            broken = self._run_on(self._executor, waiting)
            for k in broken:  # one of them took the others' workers with it: each gets a worker of its own
                with local_processes(1) as alone:
                    if self._run_on(alone, [k]):
                        self._update(k, state="failed", why="its worker died: of lack of memory, or killed")
        except KeyboardInterrupt:
            self._write_index()
        return self._members

    def _look(self, k: int, member: Member) -> None:
        """Find out what a dataset that is there has reached."""
        if not member.file.exists():
            return
        try:
            time, events = reached(member.file, member.scene, member.seed)
        except UserError as problem:
            self._update(k, state="failed", why=str(problem))
            return
        done = (self._until is not None and time >= self._until) or (
            self._events is not None and events >= self._events
        )
        self._members[k] = replace(member, state="done" if done else "waiting", time=time, events=events)

    def _run_on(self, executor: Executor, waiting: Sequence[int]) -> list[int]:
        """Run these members; returns those whose worker died."""
        futures: dict[Future[simulate.Summary], int] = {}
        broken = []
        try:
            for k in waiting:
                futures[
                    executor.submit(_run_member, self._members[k], self._until, self._events, self._encounter)
                ] = k
                self._members[k] = replace(self._members[k], state="running")
            self._write_index()
            for future in as_completed(futures):
                if isinstance(future.exception(), BrokenExecutor):
                    broken.append(futures[future])
                else:
                    self._settle(futures[future], future)
        except BrokenExecutor:
            broken = [k for k in waiting if self._members[k].state in ("waiting", "running")]
        except KeyboardInterrupt:
            self._interrupt(futures)
            raise
        return sorted(broken)

    def _interrupt(self, futures: Mapping[Future[simulate.Summary], int]) -> None:
        """Wait until every member that is running has written what it has."""
        for future in futures:
            future.cancel()
        for process in active_children():
            if process.pid is not None:
                os.kill(process.pid, signal.SIGINT)  # which a worker without a member ignores
        for future, k in futures.items():
            if future.cancelled():
                self._members[k] = replace(self._members[k], state="waiting")
            elif self._members[k].state == "running":
                self._settle(k, future)

    def _settle(self, k: int, future: Future[simulate.Summary]) -> None:
        problem = future.exception()
        if problem is not None:
            reason = (
                str(problem) if isinstance(problem, UserError) else f"{type(problem).__name__}: {problem}"
            )
            self._update(k, state="failed", why=reason)
            return
        summary = future.result()
        state = "interrupted" if summary.ended_by == "interruption" else "done"
        self._update(k, state=state, time=summary.time, events=summary.events)

    def _update(self, k: int, **changes: Any) -> None:
        self._members[k] = replace(self._members[k], **changes)
        self._write_index()
        if self._progress is not None:
            self._progress(self._members[k])

    def _write_index(self) -> None:
        keys = list(self._members[0].settings)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["file", *keys, "replica", "seed", "state", "time [s]", "events", "why"])
        for m in self._members:
            writer.writerow(
                [
                    m.file.name,
                    *m.settings.values(),
                    m.replica,
                    m.seed,
                    m.state,
                    f"{m.time:.9g}",
                    m.events,
                    m.why,
                ]
            )
        write_text(self._index, text.getvalue())


def _run_member(
    member: Member, until: float | None, events: int | None, encounter: Encounter
) -> simulate.Summary:
    """On a worker."""
    return simulate.run(
        member.scene,
        member.file,
        seed=member.seed,
        until=until,
        events=events,
        resume=True,
        encounter=encounter,
    )
