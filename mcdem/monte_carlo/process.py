"""The paper's process from a scene to a dataset (Frungieri & Vanni, section 2.1 and Fig. 4).

The method, in `Process`, led by `mcdem.monte_carlo.run_control`:

1. the sample volume holds `population.initial` free primary particles;
2. the event selection draws which two aggregates meet next, and when (`event_selection`, Eqs. 1-6);
3. the encounter is resolved by the motion of every primary particle (`encounter`): what comes out takes its parents'
   places, with its own geometry;
4. when the aggregates have become few, an exact copy of all is added and the volume doubled;
5. back to 2, until the wanted time or number of encounters.

Everything drawn at random is a function of the seed and of its place in the process (`random_streams`), so a run
repeats bit for bit on machines of one kind (`mcdem.netcdf.origin`), however its encounters are computed: here, ahead of time
on other processors (`speculative_execution`, `executors`), or after a restart (`record`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from mcdem.encounter.simulate import EncounterResult
from mcdem.monte_carlo.event_selection import EventSelection, Meeting, event_selection
from mcdem.monte_carlo.expected_output import MOST_UNCHANGED
from mcdem.monte_carlo.population import Product, SamplePopulation
from mcdem.monte_carlo.record import Record
from mcdem.quantities.random_streams import checked
from mcdem.scene import Scene


def multiples(every: float, since: float, begin: float, end: float) -> range:
    """Which multiples of `every` are times of snapshots between `begin` and `end`, not included, if nothing happened `since`.

    All times in s.  They follow from the last encounter alone, not from where a run was cut off.
    """

    def from_(time: float) -> int:
        """The first multiple that is not before a time."""
        number = math.ceil(time / every)
        while number > 0 and (number - 1) * every >= time:
            number -= 1
        while number * every < time:
            number += 1
        return number

    return range(from_(begin), min(from_(end), from_(since) + MOST_UNCHANGED))


@dataclass
class Process:
    """The suspension in time: a population, the selection of its encounters, and the record of what happened."""

    scene: Scene
    population: SamplePopulation
    selection: EventSelection
    record: Record
    time: float = 0.0
    """Process time [s]."""

    @classmethod
    def begin(cls, scene: Scene, seed: int, keep_parents: tuple[str, ...]) -> Process:
        population = SamplePopulation.of_primaries(scene)
        record = Record(scene, checked(seed), keep_parents)
        record.sample(0.0, population)
        return cls(scene, population, event_selection(scene, population, seed), record)

    @classmethod
    def resume(cls, scene: Scene, path: Path) -> Process:
        """The process as a dataset left it."""
        record, time, population, selection = Record.read(path, scene)
        return cls(
            scene, population, event_selection(scene, population, record.seed, selection), record, time
        )

    @property
    def events(self) -> int:
        return self.record.events.rows

    @property
    def unchanged(self) -> tuple[str, ...]:
        """Outcomes after which both aggregates go on as they came."""
        return ("unresolved",) if self.scene.population.restructuring else ("unresolved", "missed", "parted")

    def wait(self, time: float) -> None:
        """Nothing happens until `time` [s]."""
        every, events = self.scene.run.snapshot_every, self.record.events
        since = float(events["time"][-1]) if events.rows else 0.0
        for number in multiples(every, since, self.time, time):
            self.record.snapshots.append(number * every, self.population)
        self.time = time

    def encounter(self, meeting: Meeting, result: EncounterResult) -> list[int]:
        """Two aggregates meet, and what comes out takes their places; returns the places that hold another content."""
        self.wait(meeting.time)
        places = (meeting.first, meeting.second)
        parents = [(self.population.serials[place], self.population.at(place)) for place in places]
        if result.outcome in self.unchanged:
            products = [
                Product(aggregate, serial, place, aggregate.size if place == meeting.first else 0)
                for place, (serial, aggregate) in zip(places, parents, strict=True)
            ]
            changed: list[int] = []
        else:
            products, changed = self.population.replace(*places, result.products, result.members)
        self.record.encounter(meeting, parents, result, products, self.population.primary_radius)
        self.selection.happened(meeting, changed)

        enough = self.scene.population.doubling_below * self.scene.population.initial
        while self.population.number < enough:
            self.population.double()
            self.selection.doubled(self.time)
        self.record.sample(self.time, self.population)
        return changed

    def write(self, path: Path, discarded: int) -> None:
        self.record.write(path, self.time, self.population, self.selection.state(), discarded)
