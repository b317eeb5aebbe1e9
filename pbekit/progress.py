"""What a long command of either program shows while it goes."""

from __future__ import annotations

import time as clock
from concurrent.futures import Future, wait
from datetime import timedelta
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn


class ProgressBar:
    """How far something has come: a bar on a terminal; elsewhere a line now and then, and none where it is short.

    with ProgressBar("eta_11") as progress:
        progress("8 of 16 rays", 0.5)

    Parameters
    ----------
    name : what takes the time
    interval : [s] between two lines, and before the first
    begins : what a terminal shows before the first call
    at_once : whether the first line comes at the first call
    console : the terminal; stderr by default
    """

    def __init__(
        self,
        name: str,
        interval: float = 30.0,
        *,
        begins: str = "",
        at_once: bool = False,
        console: Console | None = None,
    ) -> None:
        self.name, self.interval = name, interval
        self.console = console or Console(stderr=True)
        self._began = clock.monotonic()
        self._next_line = self._began + (0.0 if at_once else interval)
        self._bar = Progress(
            TextColumn(name, markup=False),
            BarColumn(bar_width=20),
            TaskProgressColumn(),
            TextColumn("{task.fields[state]}", markup=False),
            TimeElapsedColumn(),
            console=self.console,
            disable=not self.console.is_terminal,
        )
        self._task = self._bar.add_task(name, total=None, state=begins)

    def __call__(self, state: str = "", share: float | None = None) -> None:
        """Show where it stands; `share` of the whole, None where that is not known."""
        total = None if share is None else 1.0
        self._bar.update(self._task, total=total, completed=share or 0.0, state=state)
        now = clock.monotonic()
        if not self.console.is_terminal and now >= self._next_line:
            self._next_line = now + self.interval
            elapsed = timedelta(seconds=round(now - self._began))
            parts = [state, f"{elapsed} until now"] if share is None else [f"{share:.0%}", state]
            self.line(f"{self.name}: " + ", ".join(part for part in parts if part))

    def line(self, text: str) -> None:
        """A line of its own, where there is no terminal."""
        if not self.console.is_terminal:
            self.console.print(text, markup=False, highlight=False, soft_wrap=True)

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
