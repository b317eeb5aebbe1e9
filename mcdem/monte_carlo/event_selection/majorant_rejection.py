"""Encounters by majorant rejection (thinning): exact, no table of pairs, and those ahead are known.

Places are grouped in classes of outer radius, and each class has more *slots* than members.  Pairs of slots (not of
aggregates) propose encounters at a rate that no pair of their classes can exceed,

    k_cd = (4/3) g (b_c + b_d)^3 / Delta V,     b_c the upper bound of R in class c,

and a proposal becomes an encounter with probability (R_i + R_j)^3 / (b_c + b_d)^3, never if a slot is empty (Lewis &
Shedler, Nav. Res. Logist. Q. 26, 403, 1979).  So each pair of aggregates meets as a Poisson process of rate f_ij, as
Eqs. 2-6 of Frungieri & Vanni ask, while the proposals depend on the capacities of the classes alone: whatever happens in
the slots, the proposals ahead stay, and an encounter ahead stands unless one of its two slots changes before.

When a class has no slot left, or most proposals are rejected, or the volume doubles, a new *epoch* begins with new
capacities and new streams; the process has no memory, so it may begin anew after any event.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from mcdem.compilation import compiled
from mcdem.monte_carlo.event_selection.contract import Meeting, Meetings, encounter_rate
from mcdem.quantities.random_streams import stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mcdem.monte_carlo.population import SamplePopulation

CLASSES_PER_DOUBLING = 3
"""Of R: within a class (R_i + R_j)^3 then varies by 2 at most."""
BLOCK = 512
"""Proposals drawn at once, from one stream."""
PATIENCE = 100
"""Proposals per encounter beyond which, in the long run, the capacities are adapted."""


def capacity_for(members: NDArray[np.int64]) -> NDArray[np.int64]:
    """Slots given to classes of so many members: a rejected proposal costs far less than a new epoch."""
    capacity = members + members // 2 + 6
    largest = np.max(np.nonzero(members)[0], initial=0)
    capacity[largest + 2 :] = 0
    return capacity


@compiled
def accepted(
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    reach: NDArray[np.float64],
    radius: NDArray[np.float64],
    start: int,
    found: NDArray[np.int64],
) -> int:
    """Fill `found` with the indices from `start` on of proposals that are encounters; returns how many.

    first, second : (n,) slots; reach : (n,) sum of outer radii from which on the proposal is an encounter [m];
    radius : (slots,) outer radii [m], -inf where empty
    """
    count = 0
    for k in range(start, first.size):
        if first[k] != second[k] and radius[first[k]] + radius[second[k]] > reach[k]:
            found[count] = k
            count += 1
            if count == found.size:
                break
    return count


class MajorantRejection:
    """`EventSelection` by proposals of which some are rejected.

    Attributes
    ----------
    epoch : number of the epoch, from 0
    bounds : (classes,) b_c, largest outer radius of each class [m]
    capacity : (classes,) slots of each class; those of class c are `_base[c]`, `_base[c]` + 1, ...
    """

    epoch: int
    capacity: NDArray[np.int64]
    _encounters: int  # of this epoch
    # The proposals known, from number _first_block * BLOCK of the epoch on, and where the process stands among them.
    _first_block: int
    _next_block: int
    _first_time: float
    _end_time: float
    _times: NDArray[np.float64]
    _proposals: tuple[NDArray[Any], ...]
    _cursor: int
    # Slot of each place, or -1; place and outer radius of each slot, or -1 and -inf; free slots of each class.
    _slot: NDArray[np.int64]
    _place: NDArray[np.int64]
    _radius: NDArray[np.float64]
    _free: list[list[int]]

    def __init__(
        self,
        population: SamplePopulation,
        shear_rate: float,
        seed: int,
        state: dict[str, Any] | None = None,
    ) -> None:
        self.population = population
        self.shear_rate = shear_rate
        self.seed = seed
        # b_0 = a: primary particles fill their class exactly and are never refused.
        self.bounds = (
            population.primary_radius
            * 2.0 ** (np.arange(0, 40 * CLASSES_PER_DOUBLING) / CLASSES_PER_DOUBLING)
            * (1.0 + 1e-12)
        )
        if state is None:
            self._begin_epoch(0, 0.0)
        else:
            self._restore(state)

    # The encounters ahead

    def ahead(self, count: int) -> Meetings:
        found = np.empty(count, dtype=np.int64)
        if self.population.number < 2:
            found = found[:0]
        else:
            first, second, reach = self._proposals
            while accepted(first, second, reach, self._radius, self._cursor, found) < count:
                self._draw()
                first, second, reach = self._proposals
        first, second, _ = self._proposals
        return Meetings(
            self._times[found],
            self._place[first[found]],
            self._place[second[found]],
            self.epoch,
            self._first_block * BLOCK + found,
        )

    def _draw(self) -> None:
        """Append a block of proposals to those known."""
        uniform = stream(self.seed, "proposals", self.epoch, self._next_block).random((BLOCK, 5))
        pair = np.searchsorted(self._cumulative[:-1], uniform[:, 1] * self._cumulative[-1], side="right")
        lower, upper = self._pairs[pair].T
        times = self._end_time + np.cumsum(-np.log1p(-uniform[:, 0])) / self._cumulative[-1]
        block = (
            self._base[lower] + (uniform[:, 2] * self.capacity[lower]).astype(np.int64),
            self._base[upper] + (uniform[:, 3] * self.capacity[upper]).astype(np.int64),
            np.cbrt(uniform[:, 4]) * (self.bounds[lower] + self.bounds[upper]),
        )
        self._times = np.concatenate([self._times, times])
        self._proposals = tuple(np.concatenate(pair) for pair in zip(self._proposals, block, strict=True))
        self._end_time = float(times[-1])
        self._next_block += 1

    def _open(self, block: int, time: float) -> None:
        """Know no proposal; `block` is the first to be drawn, from `time` [s] on."""
        self._first_block = self._next_block = block
        self._first_time = self._end_time = time
        self._times = np.empty(0)
        self._proposals = (
            np.empty(0, np.int64),
            np.empty(0, np.int64),
            np.empty(0),
        )
        self._cursor = 0

    # What happened

    def happened(self, meeting: Meeting, changed: Iterable[int]) -> None:
        self._cursor = meeting.number - self._first_block * BLOCK + 1
        self._encounters += 1
        while self._cursor > BLOCK:
            self._first_time = float(self._times[BLOCK - 1])
            self._times = self._times[BLOCK:]
            self._proposals = tuple(column[BLOCK:] for column in self._proposals)
            self._first_block += 1
            self._cursor -= BLOCK
        has_room = all([self._settle(place) for place in changed])
        if not has_room or self._impatient():
            self._begin_epoch(self.epoch + 1, meeting.time)

    def doubled(self, time: float) -> None:
        self._begin_epoch(self.epoch + 1, time)

    def _impatient(self) -> bool:
        tested = self._first_block * BLOCK + self._cursor
        return tested > PATIENCE * (self._encounters + self.population.number) + BLOCK

    def stays(self, place: int, outer_radius: float) -> bool:
        slot = int(self._slot[place])
        return slot >= 0 and self._fits(self._class_of(slot), outer_radius)

    def _class_of(self, slot: int) -> int:
        return int(np.searchsorted(self._base, slot, side="right")) - 1

    def _fits(self, size_class: int, outer_radius: float) -> bool:
        """Whether an aggregate may keep its slot: outer radii go up and down, and not every time need it move."""
        smaller = size_class - CLASSES_PER_DOUBLING
        return (smaller < 0 or self.bounds[smaller] < outer_radius) and outer_radius <= self.bounds[
            size_class
        ]

    def _settle(self, place: int) -> bool:
        """Give the aggregate at `place` a slot of its class, or free the slot it had; False if there is none left."""
        radius = self.population.outer_radii[place]
        if place >= len(self._slot):
            self._slot = np.concatenate([self._slot, np.full(place + 1, -1)])
        slot = self._slot[place]
        if slot >= 0:
            held = self._class_of(slot)
            if radius > 0.0 and self._fits(held, radius):
                self._radius[slot] = radius
                return True
            self._radius[slot] = -np.inf
            self._place[slot] = -1
            self._slot[place] = -1
            heapq.heappush(self._free[held], int(slot))
        if radius == 0.0:
            return True
        size_class = int(np.searchsorted(self.bounds, radius))
        if not self._free[size_class]:
            return False
        slot = heapq.heappop(self._free[size_class])
        self._slot[place] = slot
        self._place[slot] = place
        self._radius[slot] = radius
        return True

    # Epochs

    def _begin_epoch(self, epoch: int, time: float) -> None:
        """New capacities and new streams from `time` [s] on."""
        self.epoch = epoch
        self._encounters = 0
        self._open(0, time)
        places, size_class = self._classified()
        members = np.bincount(size_class, minlength=len(self.bounds))
        self._set_capacity(capacity_for(members))
        order = np.argsort(size_class, kind="stable")
        rank = np.empty(len(places), dtype=np.int64)
        rank[order] = np.arange(len(places)) - np.repeat(np.cumsum(members) - members, members)
        self._seat(places, self._base[size_class] + rank)

    def _classified(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The occupied places and their size classes."""
        places = np.nonzero(self.population.sizes)[0]
        return places, np.searchsorted(self.bounds, self.population.outer_radii[places])

    def _set_capacity(self, capacity: NDArray[np.int64]) -> None:
        self.capacity = capacity
        self._base = np.cumsum(capacity) - capacity
        used = np.nonzero(capacity)[0]
        lower, upper = (used[index] for index in np.triu_indices(len(used)))
        slot_pairs = capacity[lower] * capacity[upper] * np.where(lower == upper, 0.5, 1.0)
        rate = encounter_rate(self.shear_rate, self.population.volume)
        self._pairs = np.stack([lower, upper], axis=1)
        self._cumulative = np.cumsum(rate * slot_pairs * (self.bounds[lower] + self.bounds[upper]) ** 3)

    def _seat(self, places: NDArray[np.int64], slots: NDArray[np.int64]) -> None:
        """Put the aggregates of `places` in `slots`, all others empty."""
        total = int(self.capacity.sum())
        self._slot = np.full(len(self.population.sizes), -1)
        self._slot[places] = slots
        self._place = np.full(total, -1)
        self._place[slots] = places
        self._radius = np.full(total, -np.inf)
        self._radius[slots] = self.population.outer_radii[places]
        self._free = [
            [base + int(k) for k in np.nonzero(self._place[base : base + size] < 0)[0]]
            for base, size in zip(self._base.tolist(), self.capacity.tolist(), strict=True)
        ]

    # Checkpoints

    def state(self) -> dict[str, Any]:
        places = np.nonzero(self.population.sizes)[0]
        return {
            "epoch": self.epoch,
            "encounters_of_epoch": self._encounters,
            "block": self._first_block,
            "block_time": self._first_time,
            "cursor": self._cursor,
            "class_capacity": self.capacity,
            "slot": self._slot[places],
        }

    def _restore(self, state: dict[str, Any]) -> None:
        self.epoch = int(state["epoch"])
        self._encounters = int(state["encounters_of_epoch"])
        self._set_capacity(np.asarray(state["class_capacity"], dtype=np.int64))
        self._seat(np.nonzero(self.population.sizes)[0], np.asarray(state["slot"], dtype=np.int64))
        self._open(int(state["block"]), float(state["block_time"]))
        self._cursor = int(state["cursor"])
        while len(self._times) < self._cursor:
            self._draw()
