"""The balance at a stress that nobody sampled, from tables at one below and one above it.

Every rate is interpolated in the logarithm of stress: probabilities of outcomes in their logarithms (so that their ratios
follow power laws of stress, as breakup does), fragments, shapes and radii as mixtures.  Mass is exact and probabilities add
to one whatever the weight.  Draws of the two tables are independent, so their uncertainty is carried along; that of the
interpolation itself is estimated by leaving tables out (`interpolation_error`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from pbekit import arguments
from pbekit.balance.encounters import ShapeMemory
from pbekit.balance.grid import Grid
from pbekit.balance.population_balance import PopulationBalance
from pbekit.errors import PBEError
from pbekit.estimated_rates.estimated_rates import EstimatedRates, Rates, extrapolated_shares, grid_for
from pbekit.tables.kernel_table import KernelTable

Joined = np.ndarray | ShapeMemory | None
"""Shapes of products of aggregation, as in `Rates`."""


class InterpolatedRates:
    """Two tables as one at a stress between theirs; what `EstimatedRates` is for one table.

    stress : [Pa], from the lower table's to the upper's
    grid : sizes to twice the largest seen in either, shapes of the lower's classes, unless given
    outcomes : as of `EstimatedRates`

    Raises `PBEError` where the tables say no stress, or not one below and one above, or differ in more than viscosity and
    aggregates.

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.estimated_rates import InterpolatedRates
    >>> lower, upper = (pbekit.open_table(f"notebooks/data/designed-{stress}Pa.nc") for stress in (750, 1000))
    >>> between = InterpolatedRates(lower, upper, 875.0)
    >>> between.grid.discrete
    True
    """

    def __init__(
        self,
        lower: KernelTable,
        upper: KernelTable,
        stress: float,
        grid: Grid | None = None,
        outcomes: str = "table",
    ) -> None:
        _check(lower, upper, stress)
        grid = common_grid([lower, upper]) if grid is None else grid
        self._set(EstimatedRates(lower, grid, outcomes), EstimatedRates(upper, grid, outcomes), stress)

    @classmethod
    def of(cls, lower: EstimatedRates, upper: EstimatedRates, stress: float) -> InterpolatedRates:
        """Of two tables that are on one grid already.

        Parameters
        ----------
        lower, upper : rates estimated on the same grid and with the same options, of the tables at the stress below and above
        stress : [Pa]

        Raises
        ------
        PBEError : where grids or options differ, or the stress is not between the tables'
        """
        _check(lower.table, upper.table, stress)
        _check_options(lower, upper)
        found = cls.__new__(cls)
        found._set(lower, upper, stress)
        return found

    def _set(self, lower: EstimatedRates, upper: EstimatedRates, stress: float) -> None:
        low, high = stress_of(lower.table), stress_of(upper.table)
        self.grid, self.stress, self.of_tables = lower.grid, stress, (lower, upper)
        self.weight = float(np.log(stress / low) / np.log(high / low))
        """Of the upper table."""

    @property
    def gap(self) -> float:
        """ln(s/s_1) ln(s_2/s), by which the error of the interpolation goes (`interpolation_error`)."""
        low, high = (stress_of(table) for table in self.tables)
        return float(np.log(self.stress / low) * np.log(high / self.stress))

    def balance(
        self, rng: np.random.Generator | None = None, scheme: str = "fixed pivot"
    ) -> PopulationBalance:
        """The mean balance, or a draw of it."""
        lower, upper = self.of_tables
        mixed = self.mean_rates if rng is None else mix(lower.rates(rng), upper.rates(rng), self.weight)
        return mixed.balance(self.grid, lower.partner_start, scheme, lower.edge)

    @property
    def unresolved(self) -> float:
        """Share of the encounters that were left unresolved, the larger of the two tables'."""
        return max(estimated.unresolved for estimated in self.of_tables)

    @cached_property
    def mean(self) -> PopulationBalance:
        """The balance with weights of one."""
        return self.balance()

    @cached_property
    def mean_rates(self) -> Rates:
        """Rates with weights of one."""
        lower, upper = self.of_tables
        return mix(lower.mean_rates, upper.mean_rates, self.weight)

    @property
    def tables(self) -> tuple[KernelTable, KernelTable]:
        """The table below and the one above."""
        lower, upper = self.of_tables
        return lower.table, upper.table

    def on(self, grid: Grid) -> InterpolatedRates:
        """The same tables on another grid."""
        lower, upper = self.of_tables
        return InterpolatedRates.of(lower.on(grid), upper.on(grid), self.stress)

    def extrapolated_changes(self, population: np.ndarray) -> tuple[float, float]:
        """As `EstimatedRates.extrapolated_changes`, of pairs of classes that neither table sampled.

        What one table alone lacks is part of the error of interpolation, which leaving tables out estimates.
        """
        lower, upper = self.of_tables
        changes = self.mean_rates.size_changes * np.outer(population, population)
        return extrapolated_shares(changes, self.grid.mass, lower.extrapolated & upper.extrapolated)

    def missing_pairs(self, population: np.ndarray) -> list[tuple[str, float, int]]:
        """Those of the table that lacks more (`EstimatedRates.missing_pairs`)."""
        lacking = max(self.of_tables, key=lambda estimated: estimated.extrapolated_changes(population)[1])
        return lacking.missing_pairs(population)


def _check(lower: KernelTable, upper: KernelTable, stress: float) -> None:
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


def _check_options(lower: EstimatedRates, upper: EstimatedRates) -> None:
    """Refuse rates that cannot be mixed cell by cell; raises `PBEError`."""
    for name in ("pivots", "shape_edges"):
        if not np.array_equal(getattr(lower.grid, name), getattr(upper.grid, name)):
            raise PBEError(
                f"grids of the lower and the upper table differ in {name}: estimate the rates of both on one, such as "
                "common_grid([lower, upper])"
            )
    for name in ("memory", "smooth", "partners", "edge"):
        one, other = getattr(lower, name), getattr(upper, name)
        if one != other:
            raise PBEError(
                f"rates of the lower and the upper table differ in {name} ({one} and {other}): estimate both with the same "
                "options of EstimatedRates"
            )


def common_grid(
    tables: Sequence[KernelTable],
    exact_to: int = 32,
    largest: int | None = None,
    shapes: ArrayLike | None = "table",
) -> Grid:
    """One grid for several tables: sizes to twice the largest seen in any, shape classes of the one at the lowest stress."""
    # A largest size must hold what any of the tables saw.
    ends = [grid_for(table, exact_to, largest).pivots[-1] for table in tables]
    if largest is None:
        largest = int(max(ends))
    return grid_for(min(tables, key=stress_of), exact_to, largest, shapes)


def stress_of(table: KernelTable) -> float:
    """Shear stress [Pa]; raises `PBEError` where the table does not say its viscosity."""
    if "viscosity" not in table.about:
        raise PBEError("the table does not say its viscosity, so its stress is not known")
    return float(table.about["viscosity"]) * table.shear_rate


def interpolate(
    tables: Sequence[KernelTable], stress: float, grid: Grid | None = None, outcomes: str = "table"
) -> InterpolatedRates:
    """The balance at `stress` [Pa] from the nearest of the tables below and above it; raises `PBEError` without them.

    Parameters
    ----------
    tables : sequence of KernelTable
        Of two or more stresses.
    stress : float
        [Pa], between them.
    grid : Grid
        Of both by default.
    outcomes : {"table", "smooth"}
        Classes with the fitted law as prior, or the law alone.

    Returns
    -------
    InterpolatedRates
        From which balances are made.

    Raises
    ------
    PBEError
        Without tables on either side.

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.estimated_rates import interpolate
    >>> tables = [pbekit.open_table(f"notebooks/data/designed-{stress}Pa.nc") for stress in (750, 1000)]
    >>> between = interpolate(tables, 875.0, pbekit.Grid.primaries(exact_to=16, largest=40))
    >>> between.balance().cells
    22
    """
    arguments.stress(stress)
    known = sorted(tables, key=stress_of)
    lower = [table for table in known if stress_of(table) <= stress]
    upper = [table for table in known if stress_of(table) > stress]
    if not lower or not upper:
        stresses = ", ".join(f"{stress_of(table):g}" for table in known)
        raise PBEError(
            f"stress = {stress:g} Pa: expected one between two of the tables' ({stresses} Pa); beyond them nothing is known"
        )
    return InterpolatedRates(lower[-1], upper[0], stress, grid, outcomes)


def mix(lower: Rates, upper: Rates, weight: float) -> Rates:
    """Rates between two sets on the same grid; `weight` of the upper, from 0 to 1."""

    def of(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (1.0 - weight) * a + weight * b

    def shapes(a: np.ndarray | None, b: np.ndarray | None) -> np.ndarray | None:
        if a is None or b is None:
            assert a is b, "on one grid both have shapes or neither"
            return None
        return of(a, b)

    def joined(a: Joined, b: Joined) -> Joined:
        if isinstance(a, ShapeMemory) and isinstance(b, ShapeMemory):
            return ShapeMemory(of(a.shares, b.shares), a.group_of_shape)
        assert not isinstance(a, ShapeMemory) and not isinstance(b, ShapeMemory), "both remember or neither"
        return shapes(a, b)

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
        joined(lower.joined, upper.joined),
        shapes(lower.broken, upper.broken),
        shapes(lower.transitions, upper.transitions),
    )
