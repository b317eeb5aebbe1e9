"""The balance at a stress that nobody sampled, from tables at one below and one above it.

Every rate is interpolated in the logarithm of stress: probabilities of outcomes in their logarithms (so that their ratios
follow power laws of stress, as breakup does), fragments, shapes and radii as mixtures.  Mass is exact and probabilities add
to one whatever the weight.  Draws of the two tables are independent, so their uncertainty is carried along; that of the
interpolation itself is in no band: a table in between, left out, tells it (`over_stresses.stress_law`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from pbekit.arguments import number
from pbekit.balance.encounters import ShapeMemory
from pbekit.balance.grid import Grid
from pbekit.balance.population_balance import PopulationBalance
from pbekit.errors import PBEError
from pbekit.estimated_rates.closures import Closure, Rates, grid_for
from pbekit.tables.kernel_table import KernelTable


class Between:
    """Two tables as one at a stress between theirs; what `Closure` is for one table.

    stress : [Pa], from the lower table's to the upper's
    grid : sizes to twice the largest seen in either, shapes of the lower's classes, unless given
    outcomes : as of `Closure`

    Raises `PBEError` where the tables say no stress, or not one below and one above, or differ in more than viscosity and
    aggregates.
    """

    def __init__(
        self,
        lower: KernelTable,
        upper: KernelTable,
        stress: float,
        grid: Grid | None = None,
        outcomes: str = "table",
    ) -> None:
        low, high = stress_of(lower), stress_of(upper)
        if not low <= stress <= high or low == high:
            raise PBEError(
                f"stress = {stress:g} Pa: expected one from {low:g} to {high:g} Pa, the stresses of the two tables; "
                "beyond them nothing is known"
            )
        for name in ("radius", "shear_rate", "shape_name"):
            if getattr(lower, name) != getattr(upper, name):
                raise PBEError(
                    f"tables differ in {name} ({getattr(lower, name)} and {getattr(upper, name)}): "
                    "only between stresses of one suspension can be interpolated"
                )
        if grid is None:
            largest = max(grid_for(table).pivots[-1] for table in (lower, upper))
            grid = grid_for(lower, largest=int(largest))
        self.grid, self.stress = grid, stress
        self.closures = (Closure(lower, grid, outcomes), Closure(upper, grid, outcomes))
        self.weight = float(np.log(stress / low) / np.log(high / low))
        """Of the upper table."""

    def balance(
        self, rng: np.random.Generator | None = None, scheme: str = "fixed pivot"
    ) -> PopulationBalance:
        """The mean balance, or a draw of it."""
        lower, upper = self.closures
        mixed = mix(lower.rates(rng), upper.rates(rng), self.weight)
        return mixed.balance(self.grid, lower.partner_start, scheme, lower.edge)

    @property
    def unresolved(self) -> float:
        """Share of the encounters that were left unresolved, the larger of the two tables'."""
        return max(closure.unresolved for closure in self.closures)

    @cached_property
    def mean(self) -> PopulationBalance:
        """The balance with weights of one."""
        return self.balance()

    def extrapolated_flux(self, population: np.ndarray) -> float:
        """Share of all encounters, in number, that a table did not sample in their classes; the larger of the two."""
        return max(closure.extrapolated_flux(population) for closure in self.closures)


def stress_of(table: KernelTable) -> float:
    """Shear stress [Pa]; raises `PBEError` where the table does not say its viscosity."""
    if "viscosity" not in table.about:
        raise PBEError("the table does not say its viscosity, so its stress is not known")
    return float(table.about["viscosity"]) * table.shear_rate


def between(
    tables: Sequence[KernelTable], stress: float, grid: Grid | None = None, outcomes: str = "table"
) -> Between:
    """The balance at `stress` [Pa] from the nearest of the tables below and above it; raises `PBEError` without them."""
    number("stress", stress, 1e-12, 1e12, "a shear stress in Pa")
    known = sorted(tables, key=stress_of)
    lower = [table for table in known if stress_of(table) <= stress]
    upper = [table for table in known if stress_of(table) > stress]
    if not lower or not upper:
        told = ", ".join(f"{stress_of(table):g}" for table in known)
        raise PBEError(
            f"stress = {stress:g} Pa: expected one between two of the tables' ({told} Pa); beyond them nothing is known"
        )
    return Between(lower[-1], upper[0], stress, grid, outcomes)


def mix(lower: Rates, upper: Rates, weight: float) -> Rates:
    """Rates between two sets on the same grid; `weight` of the upper, from 0 to 1."""

    def of(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (1.0 - weight) * a + weight * b

    def shapes(a, b):
        if isinstance(a, ShapeMemory):
            return ShapeMemory(of(a.shares, b.shares), a.group_of_shape)
        return None if a is None else of(a, b)

    with np.errstate(divide="ignore"):
        # An outcome that one table excludes is excluded between them.
        logarithms = [
            share * np.log(p)
            for p, share in ((lower.outcomes, 1.0 - weight), (upper.outcomes, weight))
            if share
        ]
    outcomes = np.exp(sum(logarithms))
    return Rates(
        of(lower.encounters, upper.encounters),
        outcomes / outcomes.sum(axis=-1, keepdims=True),
        of(lower.fragments, upper.fragments),
        of(lower.radius_moments, upper.radius_moments),
        shapes(lower.joined, upper.joined),
        shapes(lower.broken, upper.broken),
        shapes(lower.transitions, upper.transitions),
    )
