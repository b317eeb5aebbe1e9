"""What a run shows while it goes: process time, events, mean size, outcomes, time left; and what other long commands show."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from concurrent.futures import Future, wait
from datetime import timedelta
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from mcdem.monte_carlo import run_control


class RunDisplay:
    """Follows a run: a bar on a terminal, elsewhere a line every `interval` seconds.  Call it with where the run stands."""

    def __init__(self, name: str, console: Console | None = None, interval: float = 30.0) -> None:
        self.console = console or Console(stderr=True)
        self.interval = interval
        self._next_line = 0.0
        self._bar = Progress(
            TextColumn(name, markup=False),
            BarColumn(bar_width=20),
            TaskProgressColumn(),
            TextColumn("{task.fields[state]}", markup=False),
            console=self.console,
            disable=not self.console.is_terminal,
        )
        self._task = self._bar.add_task("run", total=1.0, state="compiling what is not yet compiled")

    def __call__(self, now: run_control.RunProgress) -> None:
        """Show where the run stands."""
        # The first events wait for the compiler, and say nothing about the pace.
        remaining = now.remaining if now.done > 0.01 else None
        line = state(now.time, now.events, now.outcomes, now.mean_size, remaining)
        self._bar.update(self._task, completed=now.done, state=line)
        if not self.console.is_terminal and now.elapsed >= self._next_line:
            self._next_line = now.elapsed + self.interval
            self.console.print(f"{now.done:4.0%}  {line}", markup=False, highlight=False, soft_wrap=True)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()


def state(
    time: float,
    events: int,
    outcomes: Mapping[str, int],
    mean_size: float | None = None,
    remaining: float | None = None,
) -> str:
    """A run's state in one line; `time` [s] of the process, `remaining` [s] of the wall clock."""
    counts = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.items() if count)
    parts = [f"t = {time:.4g} s", f"{events} events" + (f" ({counts})" if counts else "")]
    if mean_size is not None:
        parts.append(f"<P> = {mean_size:.2f}")
    if remaining is not None:
        parts.append(f"{timedelta(seconds=round(remaining))} left")
    return ", ".join(parts)


class NowAndThen:
    """Prints a line where there is no terminal, if none was printed for `interval` seconds."""

    def __init__(self, console: Console, interval: float = 30.0) -> None:
        self.console, self.interval = console, interval
        self._next = clock.monotonic() + interval

    def __call__(self, line: str) -> None:
        if not self.console.is_terminal and clock.monotonic() >= self._next:
            self._next = clock.monotonic() + self.interval
            self.console.print(line, markup=False, highlight=False, soft_wrap=True)


class Steady:
    """Reports on something long: a bar on a terminal, elsewhere a line every `interval` seconds; nothing if it is short.

    with Steady("eta_11") as tell:
        tell("8 of 16 rays", 0.5)
    """

    def __init__(self, name: str, interval: float = 10.0, console: Console | None = None) -> None:
        self.name = name
        self.console = console or Console(stderr=True)
        self._began = clock.monotonic()
        self._line = NowAndThen(self.console, interval)
        self._bar = Progress(
            TextColumn(name, markup=False),
            BarColumn(bar_width=20),
            TextColumn("{task.fields[state]}", markup=False),
            TimeElapsedColumn(),
            console=self.console,
            disable=not self.console.is_terminal,
            transient=True,
        )
        self._task = self._bar.add_task(name, total=None, state="")

    def __call__(self, state: str = "", share: float | None = None) -> None:
        """Show where it stands; `share` of the whole, None where that is not known."""
        self._bar.update(
            self._task, total=None if share is None else 1.0, completed=share or 0.0, state=state
        )
        passed = timedelta(seconds=round(clock.monotonic() - self._began))
        parts = ["" if share is None else f"{share:.0%}", state, f"{passed} until now"]
        self._line(f"{self.name}: " + ", ".join(part for part in parts if part))

    def until_done(self, future: Future[Any], state: str = "") -> None:
        """Show that time passes until a task is done."""
        while wait([future], timeout=0.2).not_done:
            self(state)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
