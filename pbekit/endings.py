"""How a program ends when it is asked to: in one line, with what was computed kept, and a code that says who asked.

Ctrl-C (SIGINT), the end of a batch job (SIGTERM) and a closed terminal (SIGHUP) are one request.  It reaches the program as
`KeyboardInterrupt`: what must not be cut in two is done within `Deferred`, and `keeping` says what stays on the disk and how
to go on.  Exit codes are those of the shell: 128 plus the number of the signal.

mcdem and pbekit share this file, and it needs the standard library alone: it stands before all that takes time to load.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType, TracebackType
from typing import Self

REQUESTS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that ask for the end."""
NOTHING = "nothing was written"

_request: int | None = None
"""The first of them that came to whoever listens."""
_depth = 0
"""How many listen, one within the other."""
_said = False


def exit_code() -> int:
    """The code to end with after an interruption: 130 by Ctrl-C, 143 by SIGTERM, 129 by SIGHUP."""
    return 128 + (_request or signal.SIGINT)


def asked(within: float = 0.0) -> bool:
    """Whether the end was asked for, or is within so many seconds.

    A terminal and a batch system signal all processes of a job, so that a worker's death may be seen before the request.
    """
    end = time.monotonic() + within
    while _request is None and time.monotonic() < end:
        time.sleep(0.02)
    return _request is not None


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _request
    _request = _request or number
    raise KeyboardInterrupt


@contextlib.contextmanager
def listening(handle: Callable[[int, FrameType | None], None] = _interrupt) -> Iterator[None]:
    """Within, every request for the end comes to `handle`, which raises `KeyboardInterrupt` unless another is given.

    A signal that whoever started the program has it ignore (nohup) stays ignored.  Only the main thread can listen.
    """
    global _request, _depth
    before = {}
    if threading.current_thread() is threading.main_thread():
        _request = _request if _depth else None
        for number in REQUESTS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handle)
    _depth += 1
    try:
        yield
    finally:
        _depth -= 1
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)


@contextlib.contextmanager
def keeping(words: str) -> Iterator[None]:
    """An interruption within prints `words`: what is kept, and how to go on.  Of several the innermost speaks."""
    try:
        yield
    except KeyboardInterrupt as problem:
        if not problem.args:
            problem.args = (words,)
        raise


class Deferred:
    """Lets requests for the end through only where all is whole: within `allowed`; others wait until then.

    with Deferred() as interruption:
        while ...:
            with interruption.allowed():
                result = what takes time
            note(result)  # never cut in two
    """

    def __init__(self) -> None:
        self.asked = False
        self._allowed = False
        self._listening = listening(self._handle)

    def __enter__(self) -> Self:
        self._listening.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listening.__exit__(kind, error, trace)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        global _request
        _request = _request or number
        self.asked = True
        if self._allowed:
            self._allowed = False
            raise KeyboardInterrupt

    @contextlib.contextmanager
    def allowed(self) -> Iterator[None]:
        self._allowed = True
        try:
            if self.asked:
                raise KeyboardInterrupt
            yield
        finally:
            self._allowed = False


def say(problem: KeyboardInterrupt | None = None, nothing: str = NOTHING) -> None:
    """The one line of an interrupted program."""
    global _said
    words = problem.args[0] if problem is not None and problem.args else nothing
    _said = True
    with contextlib.suppress(OSError, ValueError):  # the terminal may be gone
        sys.stderr.write(f"interrupted: {words}\n")
        sys.stderr.flush()


def _interruption_behind(problem: BaseException | None) -> KeyboardInterrupt | None:
    """The interruption that a library turned into another exception."""
    while problem is not None and not isinstance(problem, KeyboardInterrupt):
        problem = problem.__context__
    return problem


def program(start: Callable[[], None]) -> None:
    """Run a command line program from its first import on; it ends within a moment of being asked to.

    An interrupted program leaves at once, without waiting for threads and processes that serve nobody any more.
    """
    try:
        with listening():
            try:
                start()
                return
            except KeyboardInterrupt as problem:
                say(problem)
            except SystemExit as end:
                if _request is None or end.code not in (130, exit_code()):
                    raise
                if not _said:
                    say(_interruption_behind(end))
            code = exit_code()
            for stream in (sys.stdout, sys.stderr):
                with contextlib.suppress(OSError, ValueError):
                    stream.flush()
            os._exit(code)
    finally:
        # What comes now finds nothing to keep, and should not be answered by a traceback of Python's own ending.
        for number in REQUESTS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, signal.SIG_DFL)
