"""The checksum in which a dataset ends: a line with the BLAKE2b digest of all bytes before it.

NetCDF's libraries do not look beyond what their headers name, so the line disturbs no reader.  It covers values, attributes
and layout.
"""

from __future__ import annotations

import hashlib
import mmap
import os
from pathlib import Path
from typing import Any

SEAL = b"\nBLAKE2b of all before this line: "
DIGEST = 32
"""Bytes of the digest."""
SEAL_LENGTH = len(SEAL) + 2 * DIGEST + 1
SEALED = "BLAKE2b of all bytes before it, in the last line of the file"
"""Attribute `checksum` of a dataset: without the line, a file that says so has lost its end or was changed."""


def seal(path: Path | str) -> None:
    """Renew the checksum of a dataset that was changed on purpose."""
    size = Path(path).stat().st_size
    with Path(path).open("r+b") as file:
        file.seek(max(0, size - SEAL_LENGTH))
        if file.read(len(SEAL)) == SEAL:
            file.truncate(size - SEAL_LENGTH)
    add(Path(path))


def add(path: Path) -> None:
    """Put the checksum of all that a file holds at its end."""
    with path.open("r+b") as file:
        digest = _digest(file, os.fstat(file.fileno()).st_size)
        file.seek(0, os.SEEK_END)
        file.write(SEAL + digest + b"\n")


def _digest(file: Any, length: int) -> bytes:
    """Hexadecimal digest of the first `length` bytes."""
    digest = hashlib.blake2b(digest_size=DIGEST)
    file.seek(0)
    while length > 0 and (chunk := file.read(min(length, 1 << 20))):
        digest.update(chunk)
        length -= len(chunk)
    return digest.hexdigest().encode()


def agrees(descriptor: int, size: int) -> bool:
    """Whether an open file and its checksum agree; one that never had any does."""
    with os.fdopen(os.dup(descriptor), "rb") as file:
        file.seek(max(0, size - SEAL_LENGTH))
        end = file.read(SEAL_LENGTH)
        if end.startswith(SEAL):
            return end[len(SEAL) :] == _digest(file, size - SEAL_LENGTH) + b"\n"
        if size == 0:
            return True
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            return content.find(SEALED.encode()) < 0 and content.rfind(SEAL[:12]) < 0
