"""Encounters as the paper draws them: inverse-transform sampling from the table of all pair frequencies
(Frungieri & Vanni, Eqs. 2-6).

The table costs N^2 memory and its sums N^2 time per event; it is the reference with which `majorant_rejection` is compared.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from mcdem.monte_carlo.event_selection.contract import Meeting, Meetings, encounter_rate
from mcdem.quantities.random_streams import stream

if TYPE_CHECKING:
    from mcdem.monte_carlo.population import SamplePopulation


class InverseTransform:
    """`EventSelection` by Eqs. 2-6.  Every change of the population changes what is drawn next: one ahead, no more."""

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
        self.time = 0.0 if state is None else float(state["time"])
        self.number = 0 if state is None else int(state["number"])
        self._fill()

    def _fill(self) -> None:
        """f_ij of every pair i < j of places [1/s], 0 where one is free (Eq. 2)."""
        places = len(self.population.sizes)
        self.frequency = np.zeros((places, places))
        for place in range(places):
            self._update(place)

    def _update(self, place: int) -> None:
        radii = self.population.outer_radii
        rate = encounter_rate(self.shear_rate, self.population.volume)
        row = np.where((radii > 0.0) & (radii[place] > 0.0), rate * (radii + radii[place]) ** 3, 0.0)
        self.frequency[:place, place] = row[:place]
        self.frequency[place, place + 1 :] = row[place + 1 :]

    def ahead(self, count: int) -> Meetings:
        if self.population.number < 2 or count < 1:
            none = np.empty(0, dtype=np.int64)
            return Meetings(np.empty(0), none, none, 0, none)
        waiting, choice = stream(self.seed, "inverse_transform", self.number).random(2)
        cumulative = np.cumsum(self.frequency)
        total = cumulative[-1]
        quiescence = -np.log1p(-waiting) / total
        pair = int(np.searchsorted(cumulative, choice * total, side="right"))
        first, second = divmod(pair, len(self.frequency))
        return Meetings(
            np.array([self.time + quiescence]),
            np.array([first]),
            np.array([second]),
            0,
            np.array([self.number]),
        )

    def happened(self, meeting: Meeting, changed: Iterable[int]) -> None:
        self.time = meeting.time
        self.number += 1
        if len(self.population.sizes) != len(self.frequency):
            self._fill()
        else:
            for place in changed:
                self._update(place)

    def stays(self, place: int, outer_radius: float) -> bool:
        return False

    def doubled(self, time: float) -> None:
        self.time = time
        self._fill()

    def state(self) -> dict[str, Any]:
        return {"time": self.time, "number": self.number}
