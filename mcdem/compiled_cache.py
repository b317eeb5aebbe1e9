"""Keep numba's cache on disk honest.

numba notices an edit of the file in which a kernel is defined, not an edit of a kernel that it calls from
another file, and would go on running the old one.  So the cache folder is named by a hash of every source
file of the package that holds compiled code.  A `NUMBA_CACHE_DIR` set by the user is respected.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numba


def key_by_sources(package: Path) -> Path | None:
    """Point numba at a cache folder that belongs to exactly these sources; returns it, or None if the user chose one."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return None
    digest = hashlib.sha256(f"numba {numba.__version__}".encode())
    for source in sorted(package.rglob("*.py")):
        text = source.read_bytes()
        if b"njit" in text or b"overload" in text or b"NamedTuple" in text:
            digest.update(str(source.relative_to(package)).encode())
            digest.update(text)
    root = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    folder = root / package.name / digest.hexdigest()[:16]
    numba.config.CACHE_DIR = str(folder)
    return folder
