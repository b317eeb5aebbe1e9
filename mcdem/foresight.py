"""Computing the encounters ahead while the present one is still being computed.

An encounter is a function of its two aggregates and its own random stream.  The clocks tell which encounters come next
if nothing changes; one that shares no aggregate with those before it will most likely stand, so it is computed ahead,
and is used only if both aggregates are still the same when its turn comes.  Otherwise it was computed in vain and is
done again: the process is the same whatever the number of workers, the order or the place of the computation.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from mcdem.encounter import EncounterResult
    from mcdem.pair_selection import Meetings
    from mcdem.population import Population

DEPTH = 16
"""Encounters looked at ahead, per worker."""
QUEUE = 2
"""Encounters submitted and unfinished, per worker: one at work, one at hand."""


@njit(cache=True)
def independent(first, second, places):
    """(n,) whether each encounter shares no aggregate with those before it; first, second : (n,) places < `places`."""
    touched = np.zeros(places, dtype=np.bool_)
    free = np.empty(first.size, dtype=np.bool_)
    for k in range(first.size):
        free[k] = not (touched[first[k]] or touched[second[k]])
        touched[first[k]] = touched[second[k]] = True
    return free


class Ahead(NamedTuple):
    """An encounter being computed, of the aggregates at these places."""

    future: Future[EncounterResult]
    first: int
    second: int


class Foresight:
    """Results of encounters, most of them ready when asked for.

    Attributes
    ----------
    depth : how many encounters ahead `result` should be told of
    computed : encounters computed, those in vain included
    in_vain : encounters computed, or begun, that did not take place
    """

    def __init__(
        self,
        compute: Callable[..., EncounterResult],
        executor: Executor,
        workers: int,
        alone: bool = False,
        finished: SimpleQueue[Any] | None = None,
    ) -> None:
        self.depth = 1 if alone else DEPTH * workers
        self.computed = 0
        self.in_vain = 0
        self._compute = compute
        self._executor = executor
        self._queue = QUEUE * workers
        self._unfinished = 0
        self._finished: SimpleQueue[Any] = finished or SimpleQueue()
        self._epoch = -1
        self._ahead: dict[int, Ahead] = {}  # by number within the epoch
        self._at: defaultdict[int, set[int]] = defaultdict(set)  # their numbers, by place

    def result(self, meetings: Meetings, population: Population) -> EncounterResult:
        """The result of the first of the encounters ahead."""
        if meetings.epoch != self._epoch:
            self.close()
            self._epoch = meetings.epoch
        head = int(meetings.numbers[0])
        while True:
            while not self._finished.empty():
                self._finished.get()
                self._unfinished -= 1
            self._submit(meetings, population)
            if self._ahead[head].future.done():
                return self._remove(head).future.result()
            self._finished.get()
            self._unfinished -= 1

    def _submit(self, meetings: Meetings, population: Population) -> None:
        """Keep the workers busy with encounters whose aggregates no encounter before them will change."""
        if self._unfinished >= self._queue and int(meetings.numbers[0]) in self._ahead:
            return
        free = independent(meetings.first, meetings.second, len(population.aggregates))
        for k in np.nonzero(free)[0]:
            number = int(meetings.numbers[k])
            if number in self._ahead:
                continue
            if k > 0 and self._unfinished >= self._queue:
                break
            first, second = int(meetings.first[k]), int(meetings.second[k])
            self._unfinished += 1
            self.computed += 1
            future = self._executor.submit(
                self._compute, population.at(first), population.at(second), meetings.epoch, number
            )
            future.add_done_callback(self._finished.put)
            self._ahead[number] = Ahead(future, first, second)
            self._at[first].add(number)
            self._at[second].add(number)

    def changed(self, places: Iterable[int]) -> None:
        """Forget the encounters ahead of aggregates that are no longer the same."""
        for place in places:
            for number in list(self._at.get(place, ())):
                self._forget(number)

    def close(self) -> None:
        """Forget everything ahead."""
        for number in list(self._ahead):
            self._forget(number)

    def _forget(self, number: int) -> None:
        if self._remove(number).future.cancel():
            self.computed -= 1
        else:
            self.in_vain += 1

    def _remove(self, number: int) -> Ahead:
        ahead = self._ahead.pop(number)
        for place in (ahead.first, ahead.second):
            self._at[place].discard(number)
        return ahead
