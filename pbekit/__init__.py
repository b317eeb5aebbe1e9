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

_HOME = {
    "Aggregation": "pbekit.balance.encounters",
    "Breakage": "pbekit.balance.encounters",
    "Cells": "pbekit.balance.grid",
    "CollisionalBreakup": "pbekit.balance.encounters",
    "Grid": "pbekit.balance.grid",
    "KernelError": "pbekit.errors",
    "PBEError": "pbekit.errors",
    "PopulationBalance": "pbekit.balance.population_balance",
    "RangeWarning": "pbekit.errors",
    "Restructuring": "pbekit.balance.encounters",
    "ShapeMemory": "pbekit.balance.encounters",
    "SteadyState": "pbekit.solution.steady",
    "TwoComponentGrid": "pbekit.balance.grid",
    "integrate": "pbekit.solution.solve",
    "solve": "pbekit.solution.solve",
    "steady_state": "pbekit.solution.steady",
}

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


class _Package(ModuleType):
    """Keeps `pbekit.solution.solve` the function, though a file is called so too and Python would put it there when it is loaded."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package

if not TYPE_CHECKING:  # or a type checker would take every unknown name for an object

    def __getattr__(name: str) -> object:
        if name not in _HOME:
            raise AttributeError(f"module 'pbekit' has no attribute {name!r}")
        return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
