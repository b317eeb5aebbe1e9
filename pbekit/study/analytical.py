"""The balance of analytical laws: van de Ven & Mason's efficiency with power-law breakup, in a table's place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize

from pbekit.balance.breakage import PowerLawRate, TwoPeak
from pbekit.balance.efficiencies import attraction_number
from pbekit.balance.encounters import Aggregation, Breakage, Event
from pbekit.balance.grid import Grid
from pbekit.balance.population_balance import PopulationBalance
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import EstimatedRates, grid_for, start_of
from pbekit.solution.steady import steady_state
from pbekit.tables.kernel_table import KernelTable


def van_de_ven_mason_of(table: KernelTable, prefactor: float = 0.95) -> float:
    """Eq. 23 for the table's scene; no warning here, the comparison is the point."""
    about = table.about
    if "hamaker_constant" not in about or "viscosity" not in about:
        raise PBEError("the table does not say hamaker_constant and viscosity, which Eq. 23 needs")
    attraction = attraction_number(
        float(about["hamaker_constant"]), float(about["viscosity"]), table.shear_rate, table.radius
    )
    return prefactor * attraction**0.18


@dataclass(frozen=True)
class AnalyticalBalance:
    """Encounters of Eq. 1 with one efficiency, and first-order breakup S = c (P - 1)^power into two pieces.

    efficiency : Eq. 23; radii : as tabulated; c : the one fitted number
    """

    grid: Grid
    encounter_rate: np.ndarray
    efficiency: float
    power: float
    rate: float

    def at(self, table: KernelTable, ratio: float, q: float) -> AnalyticalBalance:
        """The same laws for a table at `ratio` times the stress, breakup being a function of P/P_br, P_br ~ stress^-q."""
        grid, rate = tabulated_encounters(table)
        rate_of_breakup = self.rate * ratio ** (self.power * q)
        return AnalyticalBalance(grid, rate, van_de_ven_mason_of(table), self.power, rate_of_breakup)

    def balance(self) -> PopulationBalance:
        events: list[Event] = [
            Aggregation(self.efficiency * self.encounter_rate),
            Breakage(PowerLawRate(self.rate, self.power, offset=1), TwoPeak(0.35, 20.0)),
        ]
        return PopulationBalance(self.grid, events, edge="closed")

    @classmethod
    def fitted(cls, table: KernelTable, mean_size: float, power: float = 2.0) -> AnalyticalBalance:
        """c such that the steady <P> is `mean_size`; everything else is given."""
        grid, rate = tabulated_encounters(table)
        efficiency = van_de_ven_mason_of(table)
        start = start_of(grid, table)

        def off(log_c: float) -> float:
            trial = cls(grid, rate, efficiency, power, float(np.exp(log_c)))
            n = steady_state(trial.balance(), start).population
            return n @ grid.mass / n.sum() - mean_size

        # Where an aggregate of the wanted size meets a partner about as often as it breaks; then out to both sides.
        low = high = float(np.log(efficiency * rate[0, 0] * start.sum() / mean_size**power))
        while off(low) < 0:
            low -= 1.5
        while off(high) > 0:
            high += 1.5
        c = optimize.brentq(off, low, high, xtol=1e-3)
        return cls(grid, rate, efficiency, power, float(np.exp(c)))


def tabulated_encounters(table: KernelTable) -> tuple[Grid, np.ndarray]:
    """Sizes with their mean radii, and the rate at which they meet (K, K) [m^3/s]."""
    estimated = EstimatedRates(table, grid_for(table, shapes=None))
    weight = estimated.weights(None)
    grid = estimated.grid.with_outer_radius(estimated.radius_moments(weight)[0])
    return grid, estimated.encounter_rate(weight)
