"""A population balance: a grid, the events that happen on it, and how products are put on pivots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pbekit import arguments
from pbekit.arguments import shown
from pbekit.balance import right_hand_side as compiled
from pbekit.balance.encounters import Event, assemble
from pbekit.balance.grid import Grid, TwoComponentGrid
from pbekit.errors import PBEError

EDGES = ("overflow", "closed")


class PopulationBalance:
    """dn/dt of the state (n_1 ... n_K, overflow number, overflow mass(es)).

    scheme : "fixed pivot" is bilinear, with exact Jacobian and sensitivities; "cell average" is 3 to 60 times better
        in the second moment per cell, and bilinear between kinks only; "three pivots" is bilinear, exact in the second
        moment of every product and of third order in all others, but may leave numbers below zero where a population ends
        abruptly
    edge : "overflow": products beyond the last pivot leave into the explicit overflow; "closed": they are put
        on the last pivot with their mass, not their number, so that a steady state exists; `edge_flux` says how much

    Examples
    --------
    >>> import numpy as np
    >>> import pbekit
    >>> grid = pbekit.Grid.primaries(exact_to=32, largest=200)
    >>> shear = pbekit.Aggregation(lambda m, n: 4 / 3 * 100.0 * (0.5e-6) ** 3 * (m ** (1 / 3) + n ** (1 / 3)) ** 3)
    >>> balance = pbekit.PopulationBalance(grid, shear)

    Of primaries of 1 um at a volume fraction of 1e-4 that all stick, one in 40 is lost in a second:

    >>> start = np.zeros(balance.cells)
    >>> start[0] = 1e-4 / (np.pi / 6 * 1e-18)
    >>> f"{balance.rhs(0.0, balance.state(start))[0] / start[0]:.4f} 1/s"
    '-0.0255 1/s'
    """

    def __init__(
        self,
        grid: Grid | TwoComponentGrid,
        events: Sequence[Event] | Event,
        scheme: str = "fixed pivot",
        edge: str = "overflow",
    ) -> None:
        arguments.scheme(scheme)
        if edge not in EDGES:
            raise PBEError(f"edge: got {edge!r}, expected one of {EDGES}")
        if not isinstance(grid, Grid | TwoComponentGrid):
            raise PBEError(f"grid: got {shown(grid)}, expected a Grid, such as Grid.primaries(100)")
        if isinstance(events, Event):
            events = [events]
        strangers = [e for e in events if not isinstance(e, Event)]
        if strangers:
            raise PBEError(
                f"events: got {shown(strangers[0])}, expected Aggregation, CollisionalBreakup, Breakage or Restructuring"
            )
        self.grid, self.events, self.scheme, self.edge = grid, list(events), scheme, edge
        self.averaged = scheme == "cell average"
        self.arrays = assemble(grid, self.events, scheme, edge == "closed")

    @property
    def cells(self) -> int:
        return self.grid.cells

    @property
    def tail(self) -> int:
        return self.arrays.geometry.tail

    @property
    def conserved(self) -> np.ndarray:
        """(K + tail, M) weights of the state whose sums are the conserved masses, overflow included."""
        masses = self.grid.masses
        return np.concatenate([masses, np.zeros((1, masses.shape[1])), np.eye(masses.shape[1])])

    def state(self, population: ArrayLike) -> np.ndarray:
        """(K + tail,) a population with an empty overflow."""
        try:
            population = np.asarray(population, float)
        except (TypeError, ValueError):
            raise PBEError(f"population: expected ({self.cells},) numbers, got {shown(population)}") from None
        if population.shape == (self.cells + self.tail,) and np.all(np.isfinite(population)):
            return population.copy()
        if population.shape != (self.cells,):
            raise PBEError(f"population: got shape {population.shape}, expected ({self.cells},)")
        if np.any(~np.isfinite(population)) or np.any(population < 0):
            raise PBEError("population: numbers must be finite and non-negative")
        return np.concatenate([population, np.zeros(self.tail)])

    def rhs(self, time: float, state: np.ndarray) -> np.ndarray:
        out = np.empty(state.size)
        a = self.arrays
        compiled.right_hand_side(
            state, a.geometry, a.encounters, a.first_order, a.restructuring, self.averaged, out
        )
        return out

    def jacobian(self, time: float, state: np.ndarray) -> np.ndarray:
        a = self.arrays
        return compiled.jacobian_transposed(
            state, a.geometry, a.encounters, a.first_order, a.restructuring, self.averaged
        ).T

    def edge_flux(self, population: np.ndarray) -> float:
        """Mass that products beyond the last pivot carry, over the mass of all products, per unit time."""
        open_edge = PopulationBalance(self.grid, self.events, self.scheme)
        state = open_edge.state(population)
        gained = open_edge.rhs(0.0, state)[self.cells + 1 :].sum()
        jacobian = open_edge.jacobian(0.0, state)
        passing = np.abs(np.diag(jacobian))[: self.cells] * state[: self.cells] @ self.grid.mass
        return gained / passing


def balance_at_door(given: object) -> None:
    """Refuse what is no balance; raises `PBEError`."""
    if not isinstance(given, PopulationBalance):
        raise PBEError(f"balance: got {shown(given)}, expected a PopulationBalance")
