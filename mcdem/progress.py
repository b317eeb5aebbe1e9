"""What a run shows while it goes: process time, events, mean size, outcomes, time left."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

if TYPE_CHECKING:
    from mcdem.scene import Scene


class RunProgress:
    """A line that follows a run on a terminal; where output is not a terminal, a line every `interval` seconds.

    Called after each event with the state of the run; both stops may be given, the nearer one sets the bar.
    """

    def __init__(
        self,
        scene: Scene,
        until: float | None = None,
        events: int | None = None,
        console: Console | None = None,
        interval: float = 10.0,
    ) -> None:
        self.until = until if until is not None or events is not None else scene.run.until
        self.events = events if until is not None or events is not None else scene.run.events
        self.console = console or Console(stderr=True)
        self.interval = interval
        self._last_line = time.monotonic()
        self._bar = Progress(
            TextColumn(scene.name),
            BarColumn(bar_width=20),
            TaskProgressColumn(),
            TextColumn("{task.fields[state]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=self.console,
            disable=not self.console.is_terminal,
        )
        self._task = self._bar.add_task("run", total=1.0, state="compiling")

    def __call__(
        self, process_time: float, events: int, mean_size: float, outcomes: Mapping[str, int]
    ) -> None:
        """Show the state: process time [s], number of events, <P>, events by outcome."""
        done = max(
            process_time / self.until if self.until else 0.0,
            events / self.events if self.events else 0.0,
        )
        state = f"t = {process_time:.3g} s, {events} events, <P> = {mean_size:.2f}"
        counts = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.items() if count)
        if counts:
            state += f" ({counts})"
        self._bar.update(self._task, completed=min(done, 1.0), state=state)
        if not self.console.is_terminal and time.monotonic() - self._last_line > self.interval:
            self._last_line = time.monotonic()
            self.console.print(
                f"{100.0 * done:3.0f} %  {state}", markup=False, highlight=False, soft_wrap=True
            )

    def close(self) -> None:
        """Leave the terminal as it was."""
        self._bar.stop()

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
