"""Random numbers by name: every draw of a run is a function of the seed, its purpose and its place in the process.

The streams are counter-based (Philox 4x64-10: Salmon, Moraes, Dror & Shaw, SC'11, 2011), so that any of them can be
opened at any place without drawing what comes before.  So an encounter that is computed early, late, twice or elsewhere starts
from the same numbers, and is the same encounter bit for bit on machines of one kind (`mcdem.netcdf.origin`); where round-off
differs, the motion, which is chaotic, takes another course.
"""

from __future__ import annotations

import hashlib
from numbers import Integral
from typing import TYPE_CHECKING

from mcdem.errors import UserError

if TYPE_CHECKING:
    from numpy.random import Generator

LARGEST_SEED = 2**63 - 1
"""Seeds are stored as signed 64-bit integers."""


def checked(seed: int) -> int:
    """The seed, if it is one; raises `UserError` if not."""
    if not isinstance(seed, Integral) or isinstance(seed, bool) or not 0 <= seed <= LARGEST_SEED:
        raise UserError(f"seed = {seed}: expected an integer from 0 to {LARGEST_SEED}")
    return int(seed)


def stream(seed: int, purpose: str, *place: int) -> Generator:
    """The generator of `purpose` at `place` in the run of `seed`.

    Streams of different seed, purpose or place never overlap: seed and purpose are the key of Philox, the place is the upper
    three words of its counter, and the lowest word counts the draws.

    Parameters
    ----------
    seed : int
        Of the run.
    purpose : str
        What is drawn.
    *place : int
        Up to three non-negative integers, for one purpose always as many.

    Returns
    -------
    numpy.random.Generator
        At its first draw.

    References
    ----------
    Salmon, Moraes, Dror & Shaw (2011), Parallel random numbers: as easy as 1, 2, 3.

    Examples
    --------
    Encounter 12 of a run draws the same, whichever process computes it:

    >>> from mcdem.quantities import stream
    >>> stream(1, "orientation", 12).random() == stream(1, "orientation", 12).random()
    True
    >>> stream(1, "orientation", 12).random() == stream(1, "orientation", 13).random()
    False
    """
    import numpy as np  # not above: commands know the largest seed without it
    from numpy.random import Generator, Philox

    purpose_word = int.from_bytes(hashlib.blake2b(purpose.encode(), digest_size=8).digest(), "little")
    key = np.array([seed, purpose_word], dtype=np.uint64)
    counter = np.zeros(4, dtype=np.uint64)
    counter[1 : 1 + len(place)] = place
    return Generator(Philox(key=key, counter=counter))
