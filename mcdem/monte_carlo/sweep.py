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
import math
import os
import signal
import threading
import time as clock
import tomllib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed, wait
from dataclasses import dataclass, replace
from multiprocessing import active_children
from pathlib import Path
from typing import Any

from mcdem.arguments import scene_at_door, stop_at_door, whole_number
from mcdem.encounter.simulate import simulate_encounter
from mcdem.errors import UserError
from mcdem.monte_carlo import run_control
from mcdem.monte_carlo.executors import Encounter, ExecutorError, local_processes, result_of, submit
from mcdem.monte_carlo.record import reached
from mcdem.netcdf.whole_files import FILES, INDEX
from mcdem.quantities.random_streams import checked
from mcdem.quantities.units import shown
from mcdem.scene import Scene
from pbekit import endings

MOST_MEMBERS = 10_000
LONGEST_VALUE = 500
"""Characters of a value."""
LONGEST_NAME = 200
"""Bytes of a member's file name before its number; file systems take 255."""
PATIENCE = 20.0
"""How long members may take to write what they have when the end is asked for [s]; batch systems kill after 30 s."""

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

    def __str__(self) -> str:
        line = f"{self.file.name}: {self.state}, t = {self.time:.4g} s, {self.events} events"
        return f"{line}: {self.why}" if self.why else line


def parse_setting(given: str) -> tuple[str, list[str]]:
    """("flow.shear_stress", ["750Pa", "875Pa"]) of "flow.shear_stress=750Pa,875Pa"; raises `UserError`."""
    key, equals, values = (part.strip() for part in given.partition("="))
    found = [value.strip() for value in _split(values)]
    if not equals or not all(key.split(".")) or "." not in key or not all(found) or not given.isprintable():
        raise UserError(
            f"--set {shown(given)}: expected TABLE.KEY=VALUE,VALUE,... such as flow.shear_stress=750Pa,875Pa"
        )
    if max(map(len, found)) > LONGEST_VALUE:
        raise UserError(
            f"--set {shown(given)}: a value of more than {LONGEST_VALUE} characters is none of a scene's"
        )
    return key, found


def parse_settings(given: Sequence[str]) -> dict[str, list[str]]:
    """Key -> values of every --set; raises `UserError` where a key is named twice."""
    found: dict[str, list[str]] = {}
    for one in given:
        key, values = parse_setting(one)
        if key in found:
            raise UserError(
                f"--set {shown(one)}: {key} is given twice; write its values in one, {key}=VALUE,VALUE"
            )
        found[key] = values
    return found


def _split(values: str) -> list[str]:
    """At the commas between values, not at those inside brackets, braces or quotes."""
    found, depth, quote = [""], 0, ""
    for character in values:
        if quote:
            quote = "" if character == quote else quote
        elif character in "\"'":
            quote = character
        else:
            depth += (character in "[{") - (character in "]}")
        if character == "," and depth <= 0 and not quote:
            found.append("")
        else:
            found[-1] += character
    return found


def replaced(scene: Scene, keys: Sequence[str]) -> list[str]:
    """In words, which keys of the scene give way to new values of others, without being named."""
    gone = [".".join(path) for path in scene.gives_way(dict.fromkeys(keys, ""))]
    if not gone:
        return []
    return [
        f"{' and '.join(keys)} given: {' and '.join(gone)} of the scene {'give' if gone[1:] else 'gives'} way"
    ]


def members(
    scene: Scene, settings: Mapping[str, Sequence[str]], replicas: int, seed: int, folder: Path
) -> list[Member]:
    """Every combination of the values, `replicas` times; raises `UserError` if one is not a scene."""
    whole_number("replicas", replicas, 1, MOST_MEMBERS)
    if (count := replicas * math.prod(len(values) for values in settings.values())) > MOST_MEMBERS:
        raise UserError(f"{count} members: expected at most {MOST_MEMBERS}; take fewer values or replicas")
    found: list[Member] = []
    points: dict[Scene, str] = {}
    for values in itertools.product(*settings.values()):
        asked = {key: (value, toml_value(value)) for key, value in zip(settings, values, strict=True)}
        changed = scene.with_changes({key: value for key, (_, value) in asked.items()}, as_in_file=True)
        # What the scene says, in the words in which it was asked for.
        chosen = {key: said_by(changed, key, *given) for key, given in asked.items()}
        point = ",".join(
            f"{_short(key, settings)}={value.replace(' ', '_')}" for key, value in chosen.items()
        )
        if changed in points:
            raise UserError(
                f"--set: a value is given twice, {point} and {points[changed]} are the same scene"
            )
        points[changed] = point
        stem = (point or scene.name).replace("/", "_per_")
        if len(stem.encode()) > LONGEST_NAME:
            digest = hashlib.blake2b(stem.encode(), digest_size=8).hexdigest()
            stem = f"{stem[: LONGEST_NAME // 4]}...{digest}"
        for replica in range(1, replicas + 1):
            name = f"{stem}.{replica}.nc"
            found.append(Member(changed, folder / name, chosen, replica, _seed(seed, point, replica)))
    return found


def said_by(scene: Scene, key: str, words: str, value: Any) -> str:
    """What a changed scene says at a key: the words in which it was asked for, if it says that, else its own."""
    said = scene.value_at(key)
    expected = str(value).lower() if isinstance(value, bool) else "" if value is None else str(value)
    return words if said == expected else said


def toml_value(value: str) -> Any:
    """A value as the scene file would hold it: number, boolean, or text with a unit; "none" removes the key."""
    if value == "none":
        return None
    try:
        read = tomllib.loads(f"value = {value}")
    except (ValueError, RecursionError):
        return value
    # Text such as "1 # half" is a number and a comment to TOML, and "1\nb = 2" two keys: neither is the value given.
    return read["value"] if read.keys() == {"value"} and "#" not in value else value


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
    until: float | str | None = None,
    events: int | None = None,
    executor: Executor,
    progress: Callable[[Member], None] | None = None,
    encounter: Encounter = simulate_encounter,
) -> list[Member]:
    """Run what of a sweep is not finished, each member on one worker of `executor`.

    A member that fails does not stop the others; Ctrl-C, SIGTERM and SIGHUP let each write its dataset.

    Parameters
    ----------
    scene : Scene
        What is changed.
    folder : Path or str
        Of the datasets and the index; made if it is not there.
    settings : mapping of str to sequence of str
        Dotted key to its values, as in the scene file.
    replicas : int
        Runs of each combination, each of its own seed.
    seed, until, events : int, float or str, int
        As for `mcdem.run`.
    executor : concurrent.futures.Executor
        Whose workers run the members.
    progress : callable
        Called with each member when it is done, has failed or was interrupted.
    encounter : callable
        Resolves an encounter, as for `mcdem.run`.

    Returns
    -------
    list of Member
        All members, with what became of each.

    Raises
    ------
    UserError
        Of settings that are no scene's.
    ExecutorError
        Where a cluster is lost; members on it have their datasets.
    """
    scene_at_door(scene)
    folder = Path(folder)
    stop, events = stop_at_door(until, events)
    if stop is None and events is None:
        stop, events = scene.run.until, scene.run.events
    every = members(scene, settings, replicas, checked(scene.run.seed if seed is None else seed), folder)
    index = folder / "index.csv"
    with FILES.folder(folder), FILES.locked(index), endings.listening():
        FILES.check(index, INDEX)
        return _Sweep(every, index, stop, events, executor, progress, encounter).run()


class _Sweep:
    """Members, their states, and the index that lists them."""

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
        if not os.path.lexists(member.file):
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
        futures: dict[Future[run_control.RunSummary], int] = {}
        broken = []
        try:
            for k in waiting:
                task = (_run_member, self._members[k], self._until, self._events, self._encounter)
                futures[submit(executor, *task)] = k
                self._members[k] = replace(self._members[k], state="running")
            self._write_index()
            for future in as_completed(futures):
                try:
                    self._settle(futures[future], future)
                except ExecutorError:
                    broken.append(futures[future])
        except ExecutorError:
            broken = [k for k in waiting if self._members[k].state in ("waiting", "running")]
        except KeyboardInterrupt:
            self._interrupt(executor, futures)
            raise
        if broken and not isinstance(executor, ProcessPoolExecutor):
            for k in broken:
                self._members[k] = replace(self._members[k], state="waiting")
            self._write_index()
            raise ExecutorError(
                f"{len(broken)} members were lost with the cluster that ran them; {self._index.parent} holds what they "
                "had written: the same command goes on from there"
            )
        return sorted(broken)

    def _interrupt(self, executor: Executor, futures: Mapping[Future[run_control.RunSummary], int]) -> None:
        """Wait until every member that is running here has written what it has."""
        for future in futures:
            future.cancel()
        end = clock.monotonic() + (PATIENCE if isinstance(executor, ProcessPoolExecutor) else 0.0)
        running = set(futures)
        while running and clock.monotonic() < end:
            for process in active_children():
                if (
                    process.pid is not None
                ):  # one without a member, or not yet at it, ignores it: so again and again
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(process.pid, signal.SIGINT)
            running = set(wait(running, timeout=0.2).not_done)
        for future, k in futures.items():
            if self._members[k].state == "running":
                if future.done() and not future.cancelled():
                    # A member that was asked before its dataset was opened hands its own interruption back.
                    with contextlib.suppress(ExecutorError, KeyboardInterrupt):
                        self._settle(k, future)
                        continue
                self._members[k] = replace(self._members[k], state="waiting")

    def _settle(self, k: int, future: Future[run_control.RunSummary]) -> None:
        """Note what came of a member; raises `ExecutorError` if its worker died."""
        try:
            summary: run_control.RunSummary = result_of(future)
        except ExecutorError:
            raise
        except UserError as problem:
            self._update(k, state="failed", why=str(problem))
        except Exception as problem:
            self._update(k, state="failed", why=f"{type(problem).__name__}: {problem}")
        else:
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
        FILES.write(self._index, INDEX, text.getvalue())


def _run_member(
    member: Member, until: float | None, events: int | None, encounter: Encounter
) -> run_control.RunSummary:
    """On a worker, which ignores Ctrl-C but for the run itself."""
    heard = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, lambda number, frame: None) if heard else None
    try:
        return run_control.run(
            member.scene,
            member.file,
            seed=member.seed,
            until=until,
            events=events,
            resume=True,
            encounter=encounter,
        )
    finally:
        if heard:
            signal.signal(signal.SIGINT, before)
