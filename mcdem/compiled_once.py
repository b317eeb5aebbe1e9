"""Each function is compiled by one process and read by the others, however many start together on an empty cache.

A function has a lock beside its cached code, of the operating system's kind, which ends with the process that holds it.  A
process holds the locks of the functions that it is compiling, callers before what they call, so that none waits for another in a
circle.  One that has to wait while it holds none compiles ahead: what code compiled so far will call by pointer, the last first,
since they are called for in order.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout
from numba import njit
from numba.core import sigutils
from numba.core.compiler_lock import global_compiler_lock

_WAIT = 0.02
_held: list[str] = []
"""Names of the functions whose locks this process holds; the compiler's lock is held whenever one is."""
_looked_at: set[str] = set()


def kernel_of(function: Callable[..., Any], ahead: Callable[[bytes], object]) -> Any:
    """numba's compiled form of a function that compiled code calls, compiled once for all processes that share a cache.

    ahead : compiles what `ask` was given, by this process or by another
    """
    kernel = njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)
    return once(kernel, ahead)


def once(kernel: Any, ahead: Callable[[bytes], object]) -> Any:
    """Let one process at a time compile a kernel; the others then find it in the cache."""
    compile_here = kernel.compile

    def compile_once(sig: Any) -> Any:
        known = kernel.overloads.get(tuple(sigutils.normalize_signature(sig)[0]))
        if known is not None:
            return known.entry_point
        with global_compiler_lock, _lock_of(kernel, ahead):
            return compile_here(sig)

    kernel.compile = compile_once
    return kernel


@contextmanager
def one_at_a_time(lock_file: Path) -> Iterator[None]:
    """Hold a lock of all processes that share a cache; nothing where none can be written."""
    lock = FileLock(lock_file)
    with suppress(OSError):
        lock_file.parent.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    try:
        yield
    finally:
        lock.release()


@contextmanager
def _lock_of(kernel: Any, ahead: Callable[[bytes], object]) -> Iterator[None]:
    """Hold the lock of a function; nothing where the cache cannot be written."""
    folder = Path(kernel._cache.cache_path)
    name = f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"
    lock = FileLock(folder / f"{hashlib.sha256(name.encode()).hexdigest()[:16]}.lock")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        while not lock.is_locked:
            try:
                lock.acquire(timeout=0)
            except Timeout:
                if _held or not _compile_ahead(ahead):
                    time.sleep(_WAIT)
    except OSError:
        yield
        return
    _held.append(name)
    try:
        yield
    finally:
        _held.remove(name)
        lock.release()


def _asked() -> Path | None:
    """Where it is written what compiled code will call; None without a cache folder of one's own."""
    folder = os.environ.get("NUMBA_CACHE_DIR")
    return Path(folder) / "asked" if folder else None


class CompilationWatch:
    """Says that this machine is compiling and for how long about, from what appears in the cache; asked now and then.

    It holds for all processes that share the cache.  How many functions are still to come is known on an empty cache alone, where
    it is about `WHOLE`, those of the quickstart.
    """

    WHOLE = 170
    QUIET = 15.0
    """Seconds without a newly compiled function after which it is taken for done."""

    def __init__(self) -> None:
        self._before = self._seen = _count_compiled()
        self._began = self._changed = time.monotonic()

    def __call__(self) -> str:
        """What to show: that it compiles and how long it may take, or nothing once it no longer does."""
        now, count = time.monotonic(), _count_compiled()
        if count > self._seen:
            self._seen, self._changed = count, now
        if now - self._changed > self.QUIET:
            return ""
        if self._before > self.WHOLE // 5:  # a little is compiled before a run is shown
            return "compiling what no scene before has called for" if count > self._before else ""
        done = count / self.WHOLE
        if done < 0.05 or done >= 1.0:
            return "compiling (first run only)"
        left = (now - self._began) * (1.0 - done) / done
        return f"compiling (first run only), about {left:.0f} s left"


def _count_compiled() -> int:
    """How many compiled functions the cache holds."""
    folder = os.environ.get("NUMBA_CACHE_DIR")
    return sum(1 for _ in Path(folder).glob("*/*.nbc")) if folder else 0


def ask(question: bytes) -> None:
    """Write down what the code that is being compiled will call."""
    folder = _asked()
    if folder is None:
        return
    name = hashlib.sha256(question).hexdigest()[:32]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / name).exists():
            beside = folder / f"{name}.{os.getpid()}"
            beside.write_bytes(question)
            beside.replace(folder / name)
    except OSError:
        return


def _compile_ahead(ahead: Callable[[bytes], object]) -> bool:
    """Compile one of the functions that are asked for, the last first; False if none is left that this process did not see."""
    folder = _asked()
    try:
        waiting = [
            entry
            for entry in os.scandir(folder or "")
            if len(entry.name) == 32 and entry.name not in _looked_at
        ]
        if not waiting:
            return False
        last = max(waiting, key=lambda entry: entry.stat().st_mtime_ns)
        _looked_at.add(last.name)
        ahead(Path(last.path).read_bytes())
    except OSError:
        return False
    return True
