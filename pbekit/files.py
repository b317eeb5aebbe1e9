"""The one way in which files are written, and the one guard under which they are read; both programs use it.

Writing: beside the place, to the disk, then into the place in one step.  Whatever ends the writing before (an error, a full
disk, Ctrl-C, SIGTERM), the place holds what it held and nothing half-made stays.  Symbolic links are followed first, so that
two names of one file are one file here, too.

What is replaced: only a regular file, and only one of the very kind that is written.  A `Kind` says how its files are
recognised by their contents; each says so in its own way (the title of a dataset, the author of a picture, the
generator of a page, the header of a table), as a name alone proves nothing.

Reading: a dataset's checksum (`pbekit.checksum`) is compared before a library sees a byte; earlier datasets have none and are
read under the guard alone.

This file knows no physics and neither package: it is what mcdem may take from here beside the balance.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import mmap
import os
import shutil
import signal
import socket
import stat
import sys
import tempfile
import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from pbekit.checksum import SEALED, add, agrees
from pbekit.version import __version__

HDF5, CLASSIC = b"\x89HDF\r\n\x1a\n", b"CDF"
"""How NetCDF files begin: the new and the classic format."""


class Kind(NamedTuple):
    """Files of one sort: how a message calls them, and what shows that one is ours."""

    words: str
    begins: tuple[bytes, ...]
    """One of these stands at the start."""
    bears: tuple[bytes, ...] = (b"",)
    """One of these stands anywhere, ..."""
    within: int | None = None
    """... among the first so many bytes."""
    sealed: bool = False
    """Ends in its checksum."""


LACKS_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
LACKS_RIGHT = (errno.EACCES, errno.EPERM, errno.EROFS)
PICTURES = {".png": b"\x89PNG\r\n\x1a\n", ".pdf": b"%PDF-", ".svg": b"<?xml"}
"""Formats of pictures, and how they begin."""

OF_DAMAGE = (
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)
"""What libraries raise over a file that is not what it was."""

_HELD: set[Path] = set()
"""Places that this process has the right to write."""


class Files:
    """Writing and reading for one program; what the user can mend is raised as `error`."""

    def __init__(self, program: str, error: type[Exception]) -> None:
        self.program, self.error = program, error
        signed = f"{program} "
        self.picture = Kind(
            f"picture of {program}",
            tuple(PICTURES.values()),
            tuple(
                mark.encode()
                for mark in (f"Software\0{signed}", f"/Creator ({signed}", f"<dc:title>{signed}")
            ),
        )
        self.page = Kind(
            f"page of {program}",
            (b"<!doctype html", b"<!DOCTYPE html"),
            (f'<meta name="generator" content="{signed}'.encode(),),
        )
        self.numbers = Kind(
            f"file of a figure's numbers of {program}", (HDF5,), (self._numbers.encode(),), sealed=True
        )

    @property
    def signature(self) -> str:
        """Program and version, as a file's origin."""
        return f"{self.program} {__version__}"

    @property
    def _numbers(self) -> str:
        return f"numbers of a figure of {self.program}"

    # What may be written

    def place(self, path: Path | str) -> Path:
        """The file that a name stands for: absolute, with symbolic links followed."""
        try:
            return Path(os.path.realpath(path, strict=False))
        except (OSError, ValueError) as problem:  # a loop of links, a NUL byte
            raise self.error(f"{str(path)!r}: no name of a file ({problem})") from None

    def check(self, path: Path | str, kind: Kind, *, overwrite: bool = True) -> Path:
        """The place of `path`, where a file of this kind may be written.

        Raises `error` where there is something other than a regular file, a file while `overwrite` is not set, a file of
        another kind or that is write-protected, or no folder.
        """
        place = self.place(path)
        try:
            now = place.stat()
        except FileNotFoundError:
            self._check_folder(path, place)
            return place
        except (OSError, ValueError) as problem:
            raise self.error(f"{path}: cannot be written ({_why(problem)})") from None
        if stat.S_ISDIR(now.st_mode):
            raise self.error(f"{path}: a folder, expected the name of a file in it")
        if not stat.S_ISREG(now.st_mode):
            raise self.error(
                f"{path}: is {_sort(now.st_mode)}; expected a regular file or a new name, nothing else is written to"
            )
        if not overwrite:
            raise self.error(f"{path} exists; give another name, or --overwrite to replace it")
        if not now.st_mode & 0o222:
            raise self.error(f"{path}: is write-protected; lift that (chmod u+w), or give another name")
        if not self._is(place, kind, now.st_size):
            raise self.error(
                f"{path}: is no {kind.words}, and nothing else is replaced by one; "
                "give another name, or remove it yourself"
            )
        self._check_folder(path, place)
        return place

    def _check_folder(self, path: Path | str, place: Path) -> None:
        if not place.parent.is_dir():
            raise self.error(
                f"{path}: cannot be written: there is no folder {Path(path).parent}; make it, or name another"
            )
        if not os.access(place.parent, os.W_OK | os.X_OK):
            raise self.error(
                f"{path}: cannot be written: its folder is read-only; expected a folder that can be written"
            )

    def _is(self, place: Path, kind: Kind, size: int) -> bool:
        """Whether a file is of a kind; an empty one has nothing to lose."""
        if size == 0:
            return True
        try:
            with place.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                end = len(content) if kind.within is None else min(kind.within, len(content))
                return any(content[: len(begin)] == begin for begin in kind.begins) and any(
                    content.find(mark, 0, end) >= 0 for mark in kind.bears
                )
        except OSError as problem:
            raise self.error(f"{place}: cannot be read ({_why(problem)}), so it is not replaced") from None

    @contextlib.contextmanager
    def folder(self, path: Path | str) -> Iterator[Path]:
        """The folder `path`, made if it is not there, and gone again if nothing is in it at the end.

        Raises `error` where it cannot be made or written.
        """
        path = Path(path)
        with _ended_in_order():
            try:
                new = [folder for folder in (path, *path.parents) if not folder.exists()]
                path.mkdir(parents=True, exist_ok=True)
            except (OSError, ValueError) as problem:
                raise self.error(f"{path}: cannot be made a folder ({_why(problem)}); name another") from None
            try:
                if not os.access(path, os.W_OK | os.X_OK):
                    raise self.error(f"{path}: the folder is read-only; name another")
                yield path
            finally:
                for folder in new:
                    with contextlib.suppress(OSError):  # it holds something
                        folder.rmdir()

    # Writing

    @contextlib.contextmanager
    def replacing(self, path: Path | str, kind: Kind, then: str = "give the command again") -> Iterator[Path]:
        """A name beside `path` to write to; what it holds at the end takes the place of `path` in one step.

        then : what to do when there is space again
        """
        place = self.check(path, kind)
        beside = place.with_name(f".{place.name}.part")
        with contextlib.ExitStack() as stack:
            if place not in _HELD:
                stack.enter_context(self.locked(path))
            stack.enter_context(_ended_in_order())
            try:
                beside.unlink(missing_ok=True)  # of a process that was killed; a link here is not followed
                yield beside
                if kind.sealed:
                    add(beside)
                _to_disk(beside)
                if place.exists():
                    shutil.copymode(place, beside)
                beside.replace(place)
                _to_disk(place.parent)
            except (OSError, RuntimeError, ValueError) as problem:
                if isinstance(problem, self.error):
                    raise
                # Libraries give other reasons than the system, or none.
                reason = _tried(beside) or problem
                if not isinstance(reason, OSError) and "NetCDF" not in str(problem):
                    raise  # not the disk's doing
                raise self.error(self._failed(path, place, reason, then)) from problem
            finally:
                with contextlib.suppress(OSError):
                    beside.unlink(missing_ok=True)

    @contextlib.contextmanager
    def filling(self, path: Path | str, kind: Kind, pattern: str) -> Iterator[Path]:
        """A folder in `path` to write files to; at the end they take their places in `path`, all or none.

        Those there of the given pattern go: they must be of the kind.
        """
        with contextlib.ExitStack() as stack:
            folder = stack.enter_context(self.folder(path))
            before = sorted(folder.glob(pattern))
            for file in before:
                self.check(file, kind)
            beside = folder / ".part"
            stack.enter_context(self.locked(folder / "part"))
            try:
                shutil.rmtree(beside, ignore_errors=True)
                beside.mkdir()
                yield beside
                written = sorted(beside.iterdir())
                for file in written:
                    _to_disk(file)
                for file in written:
                    file.replace(folder / file.name)
                names = {file.name for file in written}
                for file in before:
                    if file.name not in names:
                        file.unlink(missing_ok=True)
                _to_disk(folder)
            except OSError as problem:
                raise self.error(
                    self._failed(path, folder / "part", problem, "give the command again")
                ) from problem
            finally:
                shutil.rmtree(beside, ignore_errors=True)

    @contextlib.contextmanager
    def scratch(self) -> Iterator[Path]:
        """A folder of the system's for files that nobody keeps."""
        with _ended_in_order(), contextlib.ExitStack() as stack:
            try:
                folder = stack.enter_context(tempfile.TemporaryDirectory())
            except OSError as problem:
                raise self.error(
                    f"{tempfile.tempdir or 'TMPDIR'}: no folder for temporary files can be made ({_why(problem)}); "
                    "free some space, or set TMPDIR to another"
                ) from None
            yield Path(folder)

    def _failed(self, path: Path | str, place: Path, problem: BaseException, then: str) -> str:
        number = problem.errno if isinstance(problem, OSError) else None
        with contextlib.suppress(OSError):
            free = shutil.disk_usage(place.parent).free / 2**20
            why = f"{_why(problem)}; {free:.0f} MiB free on its disk"
        stays = "; what it held before is intact" if place.exists() else ""
        cure = "name another place"
        if number in LACKS_SPACE or number is None:
            cure = f"free some space or lift the quota, then {then}"
        elif number in LACKS_RIGHT:
            cure = "expected a folder that can be written"
        return f"{path}: cannot be written ({why}){stays}: {cure}"

    def write(self, path: Path | str, kind: Kind, text: str) -> None:
        """Put text (UTF-8) into the place of `path`."""
        with self.replacing(path, kind) as beside:
            beside.write_text(text, encoding="utf-8", newline="")

    def write_picture(self, path: Path | str, figure: Any, **options: Any) -> Path:
        """A figure of matplotlib in the format that the name ends in; `options` of its `savefig`."""
        path = Path(path)
        kind = self.check_picture(path)
        form = path.suffix.lower().lstrip(".")
        author = {"png": "Software"}.get(form, "Creator")
        with self.replacing(path, kind) as beside:
            figure.savefig(beside, format=form, metadata={author: self.signature}, **options)
        return path

    def check_picture(self, path: Path | str, *, overwrite: bool = True) -> Kind:
        """The kind of a picture of this name, which may be written."""
        ending = Path(path).suffix.lower()
        if ending not in PICTURES and not Path(path).is_dir():
            raise self.error(f"{path}: expected a name that ends in {', '.join(PICTURES)}")
        self.check(path, self.picture, overwrite=overwrite)
        return self.picture

    def write_numbers(self, path: Path | str, numbers: Any, title: str = "") -> Path:
        """What a figure draws (an xarray Dataset), as NetCDF."""
        kept = numbers.assign_attrs(title=f"{title or Path(path).stem}: {self._numbers}")
        self.write_dataset(path, self.numbers, {"": kept})
        return Path(path)

    def write_dataset(
        self,
        path: Path | str,
        kind: Kind,
        groups: dict[str, Any],
        encoding: dict[str, dict[str, Any]] | None = None,
        **options: Any,
    ) -> None:
        """xarray Datasets by the name of their group ("" for the root, first) as one NetCDF file.

        encoding : of each group, as in `Dataset.to_netcdf`, which takes the other options
        """
        with self.replacing(path, kind) as beside:
            for name, group in groups.items():
                attributes = dict(group.attrs)
                if not name:
                    attributes = {"software": self.signature, **attributes, "checksum": SEALED}
                group.assign_attrs(attributes).to_netcdf(
                    beside,
                    mode="a" if name else "w",
                    **({"group": name} if name else {}),
                    encoding=(encoding or {}).get(name),
                    **options,
                )

    # Who writes

    @contextlib.contextmanager
    def locked(self, path: Path | str) -> Iterator[None]:
        """Hold the right to write `path`; a second process or thread that asks for it is refused.

        The system frees the lock when its holder ends in whatever way, so that no lock is ever stale; the lock's file is gone
        after an end in order.
        """
        place = self.place(path)
        lock = place.with_name(f".{place.name}.lock")
        with _ended_in_order():
            file = self._lock(path, lock)
            _HELD.add(place)
            try:
                yield
            finally:
                _HELD.discard(place)
                with contextlib.suppress(OSError):
                    lock.unlink(missing_ok=True)
                os.close(file)

    def _lock(self, path: Path | str, lock: Path) -> int:
        """The open file that holds the lock."""
        while True:
            try:
                file = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
            except OSError as problem:
                if problem.errno in LACKS_SPACE:
                    raise self.error(
                        self._failed(path, self.place(path), problem, "give the command again")
                    ) from None
                raise self.error(
                    f"{path}: cannot be written ({_why(problem)}); expected a folder that exists and can be written"
                ) from None
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # A holder that ends takes its file away: then this is the lock of nothing.
                with contextlib.suppress(OSError):
                    if os.path.samestat(os.fstat(file), lock.stat()):
                        break
                os.close(file)
            except OSError as problem:
                holder = os.read(file, 1000).decode(errors="replace")
                os.close(file)
                if problem.errno not in (errno.EACCES, errno.EAGAIN):
                    raise self.error(
                        f"{path}: its folder's file system has no locks ({_why(problem)}); name another folder"
                    ) from None
                with contextlib.suppress(ValueError, KeyError, TypeError):
                    known = json.loads(holder)
                    holder = f"process {known['process']} on {known['host']}, since {known['since']}"
                raise self.error(
                    f"{path}: another run is writing it ({holder or 'just started'}); wait for its end or choose another file"
                ) from None
        now = datetime.now(UTC).isoformat(timespec="seconds")
        holder = json.dumps({"process": os.getpid(), "host": socket.gethostname(), "since": now})
        with contextlib.suppress(OSError):  # on a full disk the lock holds without saying whose it is
            os.ftruncate(file, 0)
            os.write(file, holder.encode())
        return file

    # Reading

    @contextlib.contextmanager
    def reading(self, path: Path | str, expected: str) -> Iterator[None]:
        """Whatever goes wrong within is the file's doing; what ends in a checksum is compared with it first.

        expected : what the file should be and where it comes from, for the message
        """
        self.verify(path, expected)
        try:
            yield
        except self.error:
            raise
        except FileNotFoundError:
            raise self.error(f"{path}: no such file; expected {expected}") from None
        except OF_DAMAGE as problem:
            raise self.error(
                f"{path}: cannot be read as NetCDF of this kind ({_why(problem)}); expected {expected}, "
                "this one is damaged, truncated or of another kind: restore it from a copy, or make it again"
            ) from problem

    def verify(self, path: Path | str, expected: str) -> None:
        """Raise `error` unless there is a regular file that agrees with its checksum, if it has one."""
        try:
            now = Path(path).stat()
            if not stat.S_ISREG(now.st_mode):
                raise self.error(f"{path}: is {_sort(now.st_mode)}; expected {expected}")
            with Path(path).open("rb") as file:
                if not file.read(8).startswith((HDF5, CLASSIC)):
                    raise self.error(
                        f"{path}: cannot be read as NetCDF (Unknown file format); expected {expected}"
                    )
                whole = agrees(file.fileno(), now.st_size)
        except FileNotFoundError:
            raise self.error(f"{path}: no such file; expected {expected}") from None
        except (OSError, ValueError) as problem:
            if isinstance(problem, self.error):
                raise
            raise self.error(f"{path}: cannot be read ({_why(problem)}); expected {expected}") from None
        if not whole:
            raise self.error(
                f"{path}: cannot be read: is damaged, truncated or changed by another program, as its contents and its "
                "checksum differ; restore it from a copy, or make it again"
            )


def said_of_system(problem: OSError) -> str | None:
    """One line for what the user can mend of a refusal of the system that nobody expected; None if it is no such."""
    if problem.errno not in (*LACKS_SPACE, *LACKS_RIGHT, errno.EIO, errno.EMFILE, errno.ENFILE):
        return None
    if problem.filename is None:
        # Most likely what is reported; nothing of it is to be tried again when the interpreter ends.
        with contextlib.suppress(OSError, ValueError, AttributeError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return f"{problem.filename or 'output'}: {_why(problem)}; free some space, lift the quota or name another place"


def _tried(beside: Path) -> OSError | None:
    """What the system says of writing there, where a library said no more than that it failed."""
    try:
        with beside.open("ab") as file:
            file.write(bytes(1 << 20))
            file.flush()
            os.fsync(file.fileno())
    except OSError as problem:
        return problem
    return None


def _why(problem: BaseException) -> str:
    """The first line of what a library says."""
    said = getattr(problem, "strerror", None) or str(problem) or type(problem).__name__
    return " ".join(str(said).splitlines()[0].split())[:200]


def _sort(mode: int) -> str:
    sorts = (
        (stat.S_ISDIR, "a folder"),
        (stat.S_ISFIFO, "a named pipe"),
        (stat.S_ISSOCK, "a socket"),
        (stat.S_ISCHR, "a device"),
        (stat.S_ISBLK, "a device"),
    )
    return next((words for test, words in sorts if test(mode)), "no regular file")


def _to_disk(path: Path) -> None:
    """Wait until what the system holds of a file or folder is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def _ended_in_order() -> Iterator[None]:
    """SIGTERM and SIGHUP, where nobody listens to them, end the program by an exception, so that what is half-made goes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    caught = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) is signal.SIG_DFL]
    for number in caught:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in caught:
            signal.signal(number, signal.SIG_DFL)
