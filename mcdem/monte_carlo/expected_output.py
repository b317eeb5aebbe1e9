"""What a run will write, stated before it begins: how many snapshots, and how large a file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mcdem.scene import Scene

MOST_UNCHANGED = 10
"""After an encounter at most so many snapshots show the population that it left: further ones would repeat the last."""
PRIMARY, ENCOUNTER = 56, 450
"""Bytes in the file: of a free primary in a snapshot, and of an encounter."""
MANY_SNAPSHOTS, LARGE, VERY_LARGE = 10_000, 1e9, 1e10
"""From how many snapshots, or bytes, on it is worth a word; from how many bytes on a warning."""


@dataclass(frozen=True)
class Output:
    """What a run will write, to within a factor of a few."""

    snapshots: float
    encounters: float
    size: float
    """[bytes]"""

    @property
    def large(self) -> bool:
        """Whether it is worth a word."""
        return self.snapshots > MANY_SNAPSHOTS or self.size > LARGE

    @property
    def words(self) -> str:
        """In words, with what to change."""
        size, unit = (self.size / 1e9, "GB") if self.size >= 1e9 else (self.size / 1e6, "MB")
        return (
            f"about {self.snapshots:.2g} snapshots and {self.encounters:.2g} encounters are to come, a file of about "
            f"{size:.2g} {unit}, held in memory too: a longer [run] snapshot_every or a smaller [population] initial makes "
            "it smaller"
        )


def output_of(scene: Scene, until: float | None = None, events: int | None = None) -> Output | None:
    """What a run of the scene will write; None where nothing says when it stops.

    until [s], events : instead of the scene's.  The sample volume is taken as it is at the start, where N primaries meet
    N 4 phi g/pi times in unit time (Frungieri & Vanni 2021, Eqs. 2 and 22 with every encounter counted).
    """
    if until is None and events is None:
        until, events = scene.run.until, scene.run.events
    if until is None and events is None:
        return None
    number = scene.population.initial
    rate = number * 4.0 / math.pi * scene.suspension.volume_fraction * scene.flow.equivalent_shear_rate
    time = min(math.inf if until is None else until, math.inf if events is None else events / rate)
    encounters = rate * time
    snapshots = min(time / scene.run.snapshot_every, MOST_UNCHANGED * (encounters + 1.0)) + 2.0
    return Output(snapshots, encounters, snapshots * number * PRIMARY + encounters * ENCOUNTER)
