"""Population balances in size and shape, fed by analytic kernels or by tabulated encounters.

Names are imported when they are first used, so that a command answers, and can be interrupted, before all is loaded.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pbekit.balance.encounters import Aggregation as Aggregation
    from pbekit.balance.encounters import Breakage as Breakage
    from pbekit.balance.encounters import CollisionalBreakup as CollisionalBreakup
    from pbekit.balance.encounters import Restructuring as Restructuring
    from pbekit.balance.encounters import ShapeMemory as ShapeMemory
    from pbekit.balance.grid import Cells as Cells
    from pbekit.balance.grid import Grid as Grid
    from pbekit.balance.grid import TwoComponentGrid as TwoComponentGrid
    from pbekit.balance.population_balance import PopulationBalance as PopulationBalance
    from pbekit.errors import KernelError as KernelError
    from pbekit.errors import PBEError as PBEError
    from pbekit.errors import RangeWarning as RangeWarning
    from pbekit.solution.solve import integrate as integrate
    from pbekit.solution.solve import solve as solve
    from pbekit.solution.steady import SteadyState as SteadyState
    from pbekit.solution.steady import steady_state as steady_state
    from pbekit.study.compare import Comparison as Comparison
    from pbekit.study.compare import compare as compare_table
    from pbekit.study.over_stresses import efficiencies as efficiencies
    from pbekit.study.over_stresses import stress_law as stress_law
    from pbekit.study.solve_table import open_table as open_table
    from pbekit.study.solve_table import solve_table as solve_table
    from pbekit.tables.kernel_table import KernelTable as KernelTable

_HOME = {
    "Aggregation": "pbekit.balance.encounters",
    "Breakage": "pbekit.balance.encounters",
    "Cells": "pbekit.balance.grid",
    "CollisionalBreakup": "pbekit.balance.encounters",
    "Comparison": "pbekit.study.compare",
    "Grid": "pbekit.balance.grid",
    "KernelError": "pbekit.errors",
    "KernelTable": "pbekit.tables.kernel_table",
    "PBEError": "pbekit.errors",
    "PopulationBalance": "pbekit.balance.population_balance",
    "RangeWarning": "pbekit.errors",
    "Restructuring": "pbekit.balance.encounters",
    "ShapeMemory": "pbekit.balance.encounters",
    "SteadyState": "pbekit.solution.steady",
    "TwoComponentGrid": "pbekit.balance.grid",
    "compare_table": "pbekit.study.compare",
    "efficiencies": "pbekit.study.over_stresses",
    "integrate": "pbekit.solution.solve",
    "open_table": "pbekit.study.solve_table",
    "solve": "pbekit.solution.solve",
    "solve_table": "pbekit.study.solve_table",
    "steady_state": "pbekit.solution.steady",
    "stress_law": "pbekit.study.over_stresses",
}
_OTHERWISE = {"compare_table": "compare"}
"""What a name is called at home, where it is called otherwise."""

__all__ = [
    "Aggregation",
    "Breakage",
    "Cells",
    "CollisionalBreakup",
    "Comparison",
    "Grid",
    "KernelError",
    "KernelTable",
    "PBEError",
    "PopulationBalance",
    "RangeWarning",
    "Restructuring",
    "ShapeMemory",
    "SteadyState",
    "TwoComponentGrid",
    "compare_table",
    "efficiencies",
    "integrate",
    "open_table",
    "solve",
    "solve_table",
    "steady_state",
    "stress_law",
]


class _Package(ModuleType):
    """Keeps `pbekit.solution.solve` and others functions, though files are called so too and Python would put them there when loaded."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package

if not TYPE_CHECKING:  # or a type checker would take every unknown name for an object

    def __getattr__(name: str) -> object:
        if name not in _HOME:
            raise AttributeError(f"module 'pbekit' has no attribute {name!r}")
        return getattr(import_module(_HOME[name]), _OTHERWISE.get(name, name))


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
