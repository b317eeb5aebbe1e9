"""Computing the encounters ahead while the present one is still being computed.

An encounter is a function of its two aggregates and its own random stream.  The event selection says which come next
if nothing changes.  One whose two aggregates are known is computed ahead: they are known if no encounter before it
involves them, or if those that do are computed already and left them whole, reshaped perhaps.  When its turn comes, its
result is used only if both aggregates are the very ones it was computed with; otherwise it is discarded and the encounter
computed again.  So the process is the same whatever the number of workers, the order or the place of the computation.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import defaultdict
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from functools import partial
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from mcdem.monte_carlo.executors import result_of, submit
from mcdem.monte_carlo.population import surviving, unless_same

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.encounter.simulate import EncounterResult
    from mcdem.monte_carlo.event_selection import EventSelection, Meetings
    from mcdem.monte_carlo.population import SamplePopulation

DEPTH = 16
"""Encounters looked at ahead, per worker."""
QUEUE = 2
"""Encounters submitted and unfinished, per worker: one at work, one at hand."""

UNTOUCHED, BEGUN, PASSED = 0, 1, 2
"""States of an encounter ahead: not begun; begun, or done with products that no one can be sure to meet; done, and both
aggregates are there afterwards, as known."""


@njit(cache=True)
def ready(
    first: NDArray[np.int64], second: NDArray[np.int64], status: NDArray[np.int8], places: int
) -> NDArray[np.bool_]:
    """(n,) whether each encounter is not begun and both its aggregates are known.

    first, second : (n,) places, all below `places`; status : (n,) UNTOUCHED, BEGUN or PASSED
    """
    unknown = np.zeros(places, dtype=np.bool_)
    found = np.zeros(first.size, dtype=np.bool_)
    for k in range(first.size):
        known = not (unknown[first[k]] or unknown[second[k]])
        found[k] = known and status[k] == UNTOUCHED
        if status[k] != PASSED or not known:
            unknown[first[k]] = unknown[second[k]] = True
    return found


@dataclass
class Ahead:
    """An encounter being computed, or computed."""

    places: tuple[int, int]
    parents: tuple[Aggregate, Aggregate]
    future: Future[EncounterResult]
    after: tuple[Aggregate, Aggregate] | None = None
    """What the places hold after it, if it is done and both parents are whole."""

    def at(self, place: int) -> Aggregate:
        """What a place holds after it."""
        assert self.after is not None
        return self.after[self.places.index(place)]


class SpeculativeExecution:
    """Results of encounters, most of them ready when asked for.

    Attributes
    ----------
    depth : how many encounters ahead are looked at
    computed : encounters computed, those discarded included
    discarded : encounters computed, or begun, that did not take place
    """

    def __init__(
        self,
        compute: Callable[..., EncounterResult],
        executor: Executor,
        workers: int,
        population: SamplePopulation,
        selection: EventSelection,
        alone: bool = False,
        finished: SimpleQueue[Any] | None = None,
    ) -> None:
        self.depth = 1 if alone else DEPTH * workers
        self.computed = 0
        self.discarded = 0
        self._compute = compute
        self._executor = executor
        self._population = population
        self._selection = selection
        self._queue = QUEUE * workers
        self._unfinished = 0
        self._finished: SimpleQueue[Any] = finished or SimpleQueue()
        self._epoch = -1
        self._passed = 0  # no encounter before this number is still to come
        self._ahead: dict[int, Ahead] = {}  # by number within the epoch
        self._chain: defaultdict[int, list[int]] = defaultdict(list)  # their numbers, rising, by place
        self._status = np.zeros(1024, dtype=np.int8)  # by number

    def result(self, meetings: Meetings) -> EncounterResult:
        """The result of the first of the encounters ahead.

        Raises the encounter's own exception, or `ExecutorError` for whatever else fails.
        """
        if meetings.epoch != self._epoch:
            self.close()
            self._epoch, self._passed = meetings.epoch, 0
        self._drop_refused(meetings)
        head = int(meetings.numbers[0])
        while True:
            while not self._finished.empty():
                self._note(*self._finished.get())
            self._submit(meetings)
            if self._ahead[head].future.done():
                result: EncounterResult = result_of(self._remove(head).future)
                return result
            self._note(*self._finished.get())

    def happened(self, changed: Iterable[int]) -> None:
        """The first of those ahead took place, and these places hold another content; forget what counted on the old."""
        aggregates = self._population.aggregates
        for place in changed:
            chain = self._chain.get(place)
            if chain:
                following = self._ahead[chain[0]]
                if following.parents[following.places.index(place)] is not aggregates[place]:
                    self._forget(chain[0])

    def close(self) -> None:
        """Forget everything ahead."""
        for number in sorted(self._ahead):
            self._forget(number)

    def _drop_refused(self, meetings: Meetings) -> None:
        """Forget what will not take place any more, since an aggregate has become smaller."""
        first, last = self._passed, int(meetings.numbers[-1])
        if last >= len(self._status):
            self._status = np.concatenate([self._status, np.zeros(last, dtype=np.int8)])
        begun = self._status[first : last + 1] != UNTOUCHED
        begun[meetings.numbers - first] = False
        for number in np.nonzero(begun)[0] + first:
            self._forget(int(number))
        self._passed = int(meetings.numbers[0])

    def _submit(self, meetings: Meetings) -> None:
        """Keep the workers busy with encounters whose aggregates are known."""
        head_begun = self._status[meetings.numbers[0]] != UNTOUCHED
        if self._unfinished >= self._queue and head_begun:
            return
        can_begin = ready(
            meetings.first,
            meetings.second,
            self._status[meetings.numbers],
            len(self._population.aggregates),
        )
        for k in np.nonzero(can_begin)[0]:
            if k > 0 and self._unfinished >= self._queue:
                break
            number, places = int(meetings.numbers[k]), (int(meetings.first[k]), int(meetings.second[k]))
            parents = (self._expected(places[0], number), self._expected(places[1], number))
            self._unfinished += 1
            self.computed += 1
            future = submit(self._executor, self._compute, *parents, meetings.epoch, number)
            self._ahead[number] = Ahead(places, parents, future)
            self._status[number] = BEGUN
            for place in places:
                insort(self._chain[place], number)
            future.add_done_callback(partial(self._note_finished, number))

    def _note_finished(self, number: int, future: Future[EncounterResult]) -> None:
        """Called in whatever thread."""
        self._finished.put((number, future))

    def _expected(self, place: int, number: int) -> Aggregate:
        """The aggregate that the encounter of that number will find at a place."""
        before = bisect_left(self._chain[place], number)
        if not before:
            return self._population.at(place)
        return self._ahead[self._chain[place][before - 1]].at(place)

    def _note(self, number: int, future: Future[EncounterResult]) -> None:
        """An encounter is done: see whether what follows it can be known."""
        self._unfinished -= 1
        ahead = self._ahead.get(number)
        if ahead is None or ahead.future is not future:
            return
        try:
            result = result_of(future)
        except Exception:
            return  # raised again when its turn comes
        if result.outcome == "unresolved":
            ahead.after = ahead.parents
        else:
            first, second = surviving(ahead.parents, result.products, result.members)
            if first is None or second is None:
                return
            ahead.after = (
                unless_same(result.products[first], ahead.parents[0]),
                unless_same(result.products[second], ahead.parents[1]),
            )
        radius = self._population.primary_radius
        if all(
            self._selection.stays(place, after.outer_radius(radius))
            for place, after in zip(ahead.places, ahead.after, strict=True)
        ):
            self._status[number] = PASSED

    def _forget(self, number: int) -> None:
        """Drop an encounter ahead and those that counted on what it leaves behind."""
        if number not in self._ahead:
            return
        ahead = self._remove(number)
        if ahead.future.cancel():
            self.computed -= 1
        else:
            self.discarded += 1
        for place in ahead.places:
            for later in self._chain[place][bisect_left(self._chain[place], number) :]:
                self._forget(later)

    def _remove(self, number: int) -> Ahead:
        ahead = self._ahead.pop(number)
        self._status[number] = UNTOUCHED
        for place in ahead.places:
            self._chain[place].remove(number)
        return ahead
