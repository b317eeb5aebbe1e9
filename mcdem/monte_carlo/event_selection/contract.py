"""What a way to draw the sequence of encounters is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Meeting(NamedTuple):
    """An encounter about to happen."""

    time: float
    """[s]"""
    first: int
    second: int
    """Places of the two aggregates."""
    epoch: int
    number: int
    """With the epoch, the identity of the encounter, from which its own random stream is opened."""


@dataclass(frozen=True, eq=False)
class Meetings:
    """Encounters that follow each other, all of one epoch."""

    times: NDArray[np.float64]
    """(n,) rising [s]"""
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    """(n,) places of the aggregates"""
    epoch: int
    numbers: NDArray[np.int64]
    """(n,)"""

    def __len__(self) -> int:
        return len(self.times)

    def cut(self, count: int | None, until: float | None) -> Meetings:
        """At most `count` of them, none after `until` [s]; `None` for no limit."""
        end = len(self) if until is None else int(np.searchsorted(self.times, until, side="right"))
        end = end if count is None else min(end, count)
        return Meetings(self.times[:end], self.first[:end], self.second[:end], self.epoch, self.numbers[:end])

    def meeting(self, k: int) -> Meeting:
        return Meeting(
            float(self.times[k]), int(self.first[k]), int(self.second[k]), self.epoch, int(self.numbers[k])
        )


class EventSelection(Protocol):
    """A way to draw the sequence of encounters of a population that changes between them."""

    def ahead(self, count: int) -> Meetings:
        """The next encounters, at most `count`, as they stand if no aggregate changes before them; none if none can be."""

    def happened(self, meeting: Meeting, changed: Iterable[int]) -> None:
        """The first of those ahead took place and changed what these places of the population hold."""

    def stays(self, place: int, outer_radius: float) -> bool:
        """Whether the encounters ahead of a place would mostly stand if its aggregate became so large [m]."""

    def doubled(self, time: float) -> None:
        """The population was doubled at `time` [s]."""

    def state(self) -> dict[str, Any]:
        """Numbers and arrays from which to continue bit for bit."""


def encounter_rate(shear_rate: float, volume: float) -> float:
    """Factor of (R_i + R_j)^3 in f_ij, (4/3) g / Delta V [1/(s m^3)] (Frungieri & Vanni, Eq. 2)."""
    return 4.0 / 3.0 * shear_rate / volume
