"""Files that are whole at every moment, and written by one run at a time."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import shutil
import socket
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import netCDF4
from xarray.backends.locks import HDF5_LOCK, NETCDFC_LOCK, combine_locks

from mcdem.errors import DataFileError

LIBRARY_LOCK = combine_locks([NETCDFC_LOCK, HDF5_LOCK])
"""xarray's own: the libraries bear one thread at a time, and the collector may close a user's dataset in any thread."""


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[netCDF4.Dataset]:
    """A dataset that takes the place of the one at `path` in one step, when it is complete; if not, that one stays."""
    beside = path.with_name(f".{path.name}.part")
    try:
        with LIBRARY_LOCK:
            file = netCDF4.Dataset(beside, "w")
            try:
                yield file
            finally:
                file.close()
        _to_disk(beside)
        beside.replace(path)
        _to_disk(path.parent)
    except (OSError, RuntimeError) as problem:  # the latter from NetCDF, which says no more than "HDF error"
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
        free = shutil.disk_usage(path.parent).free / 2**20
        stays = "; what it held before is intact" if path.exists() else ""
        raise DataFileError(
            f"{path}: cannot be written ({problem}; {free:.0f} MiB free on its disk){stays}: "
            "free some space or lift the quota, then continue with --resume"
        ) from problem


def write_text(path: Path, text: str) -> None:
    """Replace the file at `path` in one step."""
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_text(text)
        _to_disk(beside)
        beside.replace(path)
    except OSError as problem:
        raise DataFileError(f"{path}: cannot be written ({problem.strerror})") from problem


def _to_disk(path: Path) -> None:
    """Wait until what the system holds of a file or folder is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the right to write `path`; a second run that asks for it is refused.

    The system frees the lock when its holder ends in whatever way, so that no lock is ever stale.
    """
    lock = path.with_name(f".{path.name}.lock")
    try:
        file = os.open(lock, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as problem:
        raise DataFileError(
            f"{path}: cannot be written ({problem.strerror}); expected a folder that exists and can be written"
        ) from problem
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as problem:
            if problem.errno not in (errno.EACCES, errno.EAGAIN):
                raise DataFileError(
                    f"{path}: its folder's file system has no locks ({problem.strerror})"
                ) from problem
            holder = os.read(file, 1000).decode(errors="replace")
            with contextlib.suppress(ValueError, KeyError):
                known = json.loads(holder)
                holder = f"process {known['process']} on {known['host']}, since {known['since']}"
            raise DataFileError(
                f"{path}: another run is writing it ({holder or 'just started'}); wait for its end or choose another file"
            ) from None
        holder = json.dumps(
            {
                "process": os.getpid(),
                "host": socket.gethostname(),
                "since": datetime.now(UTC).isoformat(timespec="seconds"),
            }
        )
        os.ftruncate(file, 0)
        os.write(file, holder.encode())
        yield
    finally:
        os.close(file)
