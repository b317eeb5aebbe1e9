"""What a run shows while it goes: process time, events, mean size, outcomes, time left."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import timedelta
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

if TYPE_CHECKING:
    from mcdem.monte_carlo import process as simulate


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

    def __call__(self, now: simulate.Progress) -> None:
        """Show where the run stands."""
        # The first events wait for the compiler, and tell nothing of the pace.
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
