"""What is handed over, and what a target is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from pbekit.errors import PBEError
from pbekit.study.fitted_laws import FittedLaws
from pbekit.study.size_rates import SizeRates

MARK = "pbekit export"
"""Stands in every file that is written, so that it is known again; a table of text is known by its first column."""


@dataclass(frozen=True)
class HandOver:
    """What a target may take.

    Parameters
    ----------
    rates, laws : of the table
    solution : of the balance on one shape per size, with bands (`solve_table`): what a solver should come to
    source : name of the table's file, for the reader
    assumed : lines on what is assumed where the conditions are not the table's

    Examples
    --------
    >>> from pbekit.export import hand_over
    >>> given = hand_over("notebooks/data/designed-1000Pa.nc", draws=20, largest=40, until=10.0)
    >>> given.source, given.assumed
    ('designed-1000Pa.nc', ())
    """

    rates: SizeRates
    laws: FittedLaws
    solution: xr.Dataset
    source: str
    assumed: tuple[str, ...] = ()

    @property
    def shear_rate(self) -> float:
        """g [1/s]."""
        return self.rates.table.shear_rate

    @property
    def radius(self) -> float:
        """a of the primaries [m]."""
        return self.rates.table.radius

    @property
    def volume_fraction(self) -> float:
        """Of primaries; nan where the table does not say it."""
        if self.rates.first_order is not None:
            return self.rates.first_order.volume_fraction
        return float(self.rates.table.about.get("volume_fraction", np.nan))

    @property
    def primaries(self) -> float:
        """Number concentration of free primaries at the start [1/m^3]."""
        return self.volume_fraction / (4 / 3 * np.pi * self.radius**3)

    @property
    def steady_mean_size(self) -> tuple[float, float, float] | None:
        """Steady <P> with its band, or None where the table bears none."""
        about = self.solution.attrs
        if "steady_mean_size" not in about:
            return None
        mean = float(about["steady_mean_size"])
        low, high = (float(about.get(f"steady_mean_size_{end}", np.nan)) for end in ("low", "high"))
        return mean, low, high

    def needs_breakup(self, target: str) -> None:
        """Refuse a table of which no first-order breakup can be made; raises `PBEError`."""
        if not self.rates.breaks:
            raise PBEError(
                f"{self.source}: no encounter of the table broke an aggregate, and {target} would be given a breakup that nobody "
                "saw; export to csv, pysdm or particula, or let the run go on until aggregates break"
            )
        if self.rates.first_order is None or self.laws.breakage is None:
            raise PBEError(
                f"{self.source}: {target} knows breakup of first order alone, which takes a population: "
                f"{self.rates.no_first_order or 'too few encounters broke aggregates'}"
            )


@dataclass(frozen=True)
class Target:
    """A solver to hand over to.

    Parameters
    ----------
    title : what it is, in a line
    files : what is written beside the plain files, as text or bytes by name
    notes : how each file is used, by name; what each file of `files` is
    cannot : what the solver cannot represent, in sentences
    check : how to check what was handed over, in a sentence or two

    Examples
    --------
    >>> from pbekit.export import TARGETS
    >>> TARGETS
    ('csv', 'matlab', 'openfoam', 'openqbmm', 'pysdm', 'particula', 'dustpy')
    >>> from pbekit.export.menu import target
    >>> print(target("openfoam").title)
    OpenFOAM's population balance (multiphaseEuler)
    """

    title: str
    files: Callable[[HandOver], Mapping[str, str | bytes]]
    notes: Mapping[str, str]
    cannot: tuple[str, ...]
    check: str


def columns(table: Mapping[str, Any]) -> str:
    """Comma-separated values with a header line, numbers to the digits that give them back."""
    values = [np.asarray(value) for value in table.values()]
    lines = [",".join(table)]
    for row in zip(*(v.ravel() for v in values), strict=True):
        lines.append(
            ",".join(str(int(v)) if isinstance(v, np.integer | np.bool_) else f"{v:.12g}" for v in row)
        )
    return "\n".join(lines) + "\n"
