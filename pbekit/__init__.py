"""Population balances in size and shape, fed by analytic kernels or by tabulated encounters."""

from pbekit.balance.encounters import Aggregation, Breakage, CollisionalBreakup, Restructuring, ShapeMemory
from pbekit.balance.grid import Cells, Grid, TwoComponentGrid
from pbekit.balance.population_balance import PopulationBalance
from pbekit.errors import KernelError, PBEError, RangeWarning
from pbekit.solution.solve import integrate, solve
from pbekit.solution.steady import SteadyState, steady_state

__all__ = [
    "Aggregation",
    "Breakage",
    "Cells",
    "CollisionalBreakup",
    "Grid",
    "KernelError",
    "PBEError",
    "PopulationBalance",
    "RangeWarning",
    "Restructuring",
    "ShapeMemory",
    "SteadyState",
    "TwoComponentGrid",
    "integrate",
    "solve",
    "steady_state",
]
