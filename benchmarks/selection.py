"""How the Monte Carlo scales: the cost of selecting an encounter, and what speculative execution discards.

    python benchmarks/selection.py                   the cost per event at N = 1e3, 1e4, 1e5 and the paper's table up to 4000
    python benchmarks/selection.py workers [N ...]   share discarded and use of 1 ... 1000 workers, by simulation

The encounters are stand-ins that keep a population like that of the paper at 1000 Pa steady (mean size about 20, a
third of the aggregates free primaries): most reshape the two aggregates, some merge them, and what is too large breaks.
Everything else is the program itself.  For `workers`, time is simulated: an encounter takes 1 on average, with the
scatter and the growth with size of a steady population, and the leader takes no time.
"""

from __future__ import annotations

import heapq
import math
import sys
import time
import tracemalloc
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Executor, Future
from dataclasses import replace
from typing import Any

import numpy as np

from mcdem.aggregates.aggregate import Aggregate
from mcdem.encounter.simulate import EncounterResult
from mcdem.monte_carlo.event_selection import EventSelection
from mcdem.monte_carlo.event_selection.inverse_transform import InverseTransform
from mcdem.monte_carlo.event_selection.majorant_rejection import MajorantRejection
from mcdem.monte_carlo.population import SamplePopulation
from mcdem.monte_carlo.process import Process
from mcdem.monte_carlo.record import Record
from mcdem.monte_carlo.speculative_execution import DEPTH, QUEUE, SpeculativeExecution
from mcdem.quantities.random_streams import stream
from mcdem.scene import Scene

SCENE = """\
# How does the Monte Carlo scale?
[suspension]
radius = "500 nm"
volume_fraction = 1e-4
[flow]
shear_rate = "1e4 1/s"
viscosity = "100 mPa s"
[run]
snapshot_every = "1e9 s"
"""
MEAN_SIZE = 20
LARGEST = 60


def cluster(size: int, radius: float, rng: np.random.Generator) -> Aggregate:
    """A stand-in of an outer radius near that of the paper's clusters, R = a (P/1.2)^(1/1.6), and of no other use."""
    if size == 1:
        return Aggregate.monomer()
    reach = radius * ((size / 1.2) ** (1.0 / 1.6) * math.exp(0.1 * rng.normal()) - 1.0)
    positions = np.zeros((size, 3))
    positions[0, 2], positions[1, 2] = reach, -reach
    return Aggregate(positions, np.zeros((0, 2), np.int32))


def result(outcome: str, products: list[Aggregate], total: int) -> EncounterResult:
    """What came of an encounter of `total` primary particles."""
    cuts = np.cumsum([product.size for product in products])[:-1]
    nan = math.nan
    return EncounterResult(
        outcome=outcome,
        products=tuple(products),
        members=tuple(np.split(np.arange(total), cuts)),
        centres=np.zeros((len(products), 3)),
        offset=(0.0, 0.0),
        contact=outcome != "missed",
        simulated_time=nan,
        first_contact_time=nan,
        last_bond_change_time=nan,
        first_bond_loss_time=nan,
        largest_tension=nan,
        smallest_gap=nan,
        steps=0,
        solves=0,
        cpu_time=0.0,
    )


def encounter(
    radius: float, first: Aggregate, second: Aggregate, rng: np.random.Generator
) -> EncounterResult:
    """Four in five miss and reshape; the others merge, and break in two if larger than about LARGEST."""
    total = first.size + second.size
    if rng.random() > 0.2:
        return result("missed", [cluster(a.size, radius, rng) for a in (first, second)], total)
    if total < LARGEST * math.exp(0.3 * rng.normal()):
        return result("aggregation", [cluster(total, radius, rng)], total)
    part = max(1, round(total * rng.uniform(0.4, 0.6))) if rng.random() < 0.8 else 1
    return result("parted", [cluster(p, radius, rng) for p in (part, total - part)], total)


def steady(number: int, seed: int, event_selection: type[EventSelection] = MajorantRejection) -> Process:
    """A process whose population has the sizes of the steady state from the start."""
    scene = Scene.from_text(SCENE).with_changes({"population.initial": number})
    radius, rng = scene.suspension.radius, stream(seed, "sizes")
    sizes = np.where(
        rng.random(number) < 0.3,
        1,
        np.ceil(rng.lognormal(math.log(1.2 * MEAN_SIZE), 0.5, number)).astype(int),
    )
    volume = sizes.sum() * 4.0 / 3.0 * math.pi * radius**3 / scene.suspension.volume_fraction
    population = SamplePopulation(radius, volume, number)
    for size in sizes.tolist():
        population.add(cluster(size, radius, rng))
    selection = event_selection(population, scene.flow.shear_rate, seed)
    return Process(scene, population, selection, Record(scene, seed))


def follow(process: Process, events: int) -> tuple[float, float]:
    """Seconds of CPU per event: of the selection, and of all that the leader does but the encounter."""
    radius = process.scene.suspension.radius
    selecting = stepping = 0.0
    for _ in range(events):
        began = time.process_time()
        meeting = process.selection.ahead(1).meeting(0)
        selected = time.process_time()
        first, second = process.population.at(meeting.first), process.population.at(meeting.second)
        found = encounter(radius, first, second, stream(1, "encounter", meeting.epoch, meeting.number))
        met = time.process_time()
        happened = process.selection.happened

        def timed(*arguments: Any, happened: Any = happened) -> None:
            nonlocal selecting
            start = time.process_time()
            happened(*arguments)
            selecting += time.process_time() - start

        process.selection.happened = timed  # type: ignore[method-assign]
        process.encounter(meeting, found)
        process.selection.happened = happened  # type: ignore[method-assign]
        ended = time.process_time()
        selecting += selected - began
        stepping += (selected - began) + (ended - met)
    return selecting / events, stepping / events


def cost() -> None:
    """Print what an event costs, for both ways of selection."""
    follow(steady(100, 1), 500)  # compiles
    print(f"{'selection':12}{'N':>8}{'selection':>14}{'whole step':>14}{'epochs':>10}{'memory':>16}")
    for name, way, numbers, events in (
        ("majorant_rejection", MajorantRejection, (10**3, 10**4, 10**5), 20_000),
        ("inverse_transform", InverseTransform, (250, 1000, 4000), 60),
    ):
        costs = []
        for number in numbers:
            tracemalloc.start()
            process = steady(number, 2, way)
            memory = tracemalloc.get_traced_memory()[0] / number
            tracemalloc.stop()
            selecting, stepping = follow(process, events)
            costs.append(selecting)
            epochs = (
                f"{events / max(getattr(process.selection, 'epoch', 0), 1):.0f} ev."
                if way is MajorantRejection
                else ""
            )
            print(
                f"{name:12}{number:8d}{1e6 * selecting:11.1f} us{1e6 * stepping:11.1f} us{epochs:>10}"
                f"{memory:10.0f} B/agg."
            )
        exponent = np.polyfit(np.log(numbers), np.log(costs), 1)[0]
        print(
            f"{name}: cost of selection ~ N^{exponent:.2f}, times {costs[-1] / costs[0]:.1f} over the range"
        )


class SimulatedWorkers(Executor):
    """Workers in simulated time; stands for the queue of finished futures too, whose `get` lets time pass."""

    def __init__(self, workers: int) -> None:
        self.now = 0.0
        self._idle = workers
        self._waiting: deque[tuple[Future[Any], Any]] = deque()
        self._running: list[tuple[float, int, Future[Any], Any]] = []
        self._finished: deque[Any] = deque()
        self._count = 0

    def submit(self, function: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self._waiting.append((future, function(*arguments, **options)))
        self._start()
        return future

    def _start(self) -> None:
        while self._idle and self._waiting:
            future, found = self._waiting.popleft()
            if future.set_running_or_notify_cancel():
                self._count += 1
                heapq.heappush(self._running, (self.now + found.cpu_time, self._count, future, found))
                self._idle -= 1

    def put(self, item: Any) -> None:
        self._finished.append(item)

    def empty(self) -> bool:
        return not self._finished

    def get(self) -> Any:
        while not self._finished:
            self.now, _, future, found = heapq.heappop(self._running)
            self._idle += 1
            future.set_result(found)
            self._start()
        return self._finished.popleft()


def workers(numbers: Sequence[int]) -> None:
    """Print what speculative execution achieves on simulated workers."""
    print(f"looking {DEPTH} encounters ahead and queueing {QUEUE}, per worker")
    print(f"{'N':>8}{'workers':>9}{'discarded':>10}{'use':>8}{'speed-up':>10}{'leader':>16}")
    for number in numbers:
        for crew in (1, 2, 4, 8, 32, 100, 300, 1000):
            events = max(2000, 40 * crew)  # so many that the longest encounter of the last ones counts little
            process = steady(number, 3)
            radius = process.scene.suspension.radius

            def compute(
                first: Aggregate, second: Aggregate, epoch: int, k: int, radius: float = radius
            ) -> Any:
                rng = stream(3, "encounter", epoch, k)
                duration = ((first.size + second.size) / (2 * MEAN_SIZE)) ** 1.5 * rng.lognormal(-0.5, 1.0)
                return replace(encounter(radius, first, second, rng), cpu_time=duration)

            simulated = SimulatedWorkers(crew)
            speculation = SpeculativeExecution(
                compute,
                simulated,
                crew,
                process.population,
                process.selection,
                finished=simulated,  # type: ignore[arg-type]
            )
            began = time.process_time()
            for _ in range(events):
                ahead = process.selection.ahead(speculation.depth)
                found = speculation.result(ahead)
                speculation.happened(process.encounter(ahead.meeting(0), found))
            leader = (time.process_time() - began) / events
            discarded = speculation.discarded / (events + speculation.discarded)
            speed = process.record.events["cpu_time"].sum() / simulated.now
            print(
                f"{number:8d}{crew:9d}{discarded:10.1%}{speed / crew:8.0%}{speed:10.1f}{1e6 * leader:10.0f} us/ev.",
                flush=True,
            )


if __name__ == "__main__":
    if sys.argv[1:2] == ["workers"]:
        workers([int(number) for number in sys.argv[2:]] or (200, 10**3, 10**4, 10**5))
    else:
        cost()
