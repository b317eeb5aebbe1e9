"""Computing the encounters ahead while the present one is still being computed.

An encounter is a function of its two aggregates and its own random stream.  The clocks tell which encounters come next
if nothing changes; one that shares no aggregate with those before it will most likely stand, so it is computed ahead,
and is used only if both aggregates are still the same when its turn comes.  Otherwise it was computed in vain and is
done again: the process is the same whatever the number of workers, the order or the place of the computation.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from mcdem.aggregate import Aggregate
    from mcdem.encounter import EncounterResult
    from mcdem.pair_selection import Meeting
    from mcdem.population import Population

DEPTH = 16
"""Encounters looked at ahead, per worker."""
QUEUE = 2
"""Encounters submitted and unfinished, per worker: one at work, one at hand."""


class Ahead(NamedTuple):
    """An encounter being computed."""

    first: Aggregate
    second: Aggregate
    future: Future[EncounterResult]


class Foresight:
    """Results of encounters, most of them ready when asked for.

    Attributes
    ----------
    depth : how many encounters ahead `result` should be told of
    computed : encounters computed, those in vain included
    in_vain : encounters computed, or begun, that did not take place
    """

    def __init__(
        self, compute: Callable[..., EncounterResult], executor: Executor, workers: int, alone: bool
    ) -> None:
        self.depth = 1 if alone else DEPTH * workers
        self.computed = 0
        self.in_vain = 0
        self._compute = compute
        self._executor = executor
        self._queue = QUEUE * workers
        self._ahead: dict[tuple[int, int], Ahead] = {}

    def result(self, meetings: list[Meeting], population: Population) -> EncounterResult:
        """The result of the first of the encounters ahead."""
        self._drop_invalid(meetings, population)
        head = meetings[0]
        while True:
            self._submit(meetings, population)
            if self._ahead[head.epoch, head.number].future.done():
                return self._ahead.pop((head.epoch, head.number)).future.result()
            unfinished = [ahead.future for ahead in self._ahead.values() if not ahead.future.done()]
            wait(unfinished, return_when=FIRST_COMPLETED)

    def _submit(self, meetings: list[Meeting], population: Population) -> None:
        """Keep the workers busy with encounters whose aggregates no encounter before them will change."""
        unfinished = sum(not ahead.future.done() for ahead in self._ahead.values())
        touched: set[int] = set()
        for position, meeting in enumerate(meetings):
            key = (meeting.epoch, meeting.number)
            places = {meeting.first, meeting.second}
            if (
                key not in self._ahead
                and not places & touched
                and (unfinished < self._queue or position == 0)
            ):
                first, second = population.at(meeting.first), population.at(meeting.second)
                future = self._executor.submit(self._compute, first, second, meeting.epoch, meeting.number)
                self._ahead[key] = Ahead(first, second, future)
                self.computed += 1
                unfinished += 1
            touched |= places
            if unfinished >= self._queue:
                break

    def _drop_invalid(self, meetings: list[Meeting], population: Population) -> None:
        """Forget what will not take place: overtaken, or with an aggregate that is no longer the same."""
        expected = {(m.epoch, m.number): m for m in meetings}
        epoch, last = meetings[-1].epoch, meetings[-1].number
        for key, ahead in list(self._ahead.items()):
            meeting = expected.get(key)
            if meeting is None:
                stands = key[0] == epoch and key[1] > last
            else:
                stands = ahead.first is population.at(meeting.first) and ahead.second is population.at(
                    meeting.second
                )
            if not stands:
                self._forget(key)

    def _forget(self, key: tuple[int, int]) -> None:
        if self._ahead.pop(key).future.cancel():
            self.computed -= 1
        else:
            self.in_vain += 1

    def close(self) -> None:
        """Give up everything ahead."""
        for key in list(self._ahead):
            self._forget(key)
