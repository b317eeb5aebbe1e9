"""Short forms of what a table says, for solvers and scripts that take a formula: coefficients, covariance, range, residual.

    radius        R = a (P/k)^(1/d)
    efficiency    ln(eta/(1 - eta)) = sum of c_m x_m(P_i, P_j; N)              (`outcome_laws`)
    breakup       ln(p/(1 - p)) = sum of c_m x_m(P_i, P_j, shapes; N)
    breakage      S = k phi g N^p P^q, and as a step in P                      (`breakage_laws`)
    daughters     mass-weighted density over x = P_f/(P_i + P_j)               (`daughter_laws`)
    parts         of an aggregate that itself falls apart, over x = P_f/P_i

A form is not the table: each says by how much it misses what it was fitted to, and refuses outside the range of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pbekit.errors import PBEError
from pbekit.study.breakage_laws import BreakageLaw, BreakageStepLaw, power_law, preferred, step_law
from pbekit.study.daughter_laws import DaughtersLaw, PartsLaw, daughters_law, parts_law
from pbekit.study.fitted_form import FittedLaw, weighted
from pbekit.study.outcome_laws import OutcomeLaw, outcome_law
from pbekit.study.size_rates import SizeRates
from pbekit.tables.kernel_table import AGGREGATION, SCATTERED


@dataclass(frozen=True)
class RadiusLaw(FittedLaw):
    """R = a (P/k)^(1/d)."""

    def __call__(self, size: ArrayLike) -> np.ndarray:
        """R [m] of aggregates of so many primaries."""
        p = np.asarray(size, float)
        self.within(P=p)
        return self.constants["a"] * (p / self.coefficient("k")) ** (1 / self.coefficient("d"))


@dataclass(frozen=True)
class FittedLaws:
    """The laws of one table, or of several over the cohesion number; those that nothing bears are None."""

    radius: RadiusLaw
    efficiency: OutcomeLaw | None
    breakup: OutcomeLaw | None
    breakage: BreakageLaw | None
    breakage_step: BreakageStepLaw | None
    daughters: DaughtersLaw | None
    parts: PartsLaw | None

    @property
    def best_breakage(self) -> BreakageLaw | None:
        """The power or the step, whichever the table bears by Schwarz's criterion."""
        return preferred(self.breakage, self.breakage_step)

    def record(self) -> dict[str, Any]:
        """As they stand in fit.json."""
        names = ("radius", "efficiency", "breakup", "breakage", "breakage_step", "daughters", "parts")
        every = {name: getattr(self, name) for name in names}
        return {name: None if law is None else law.record() for name, law in every.items()}


def fitted_laws(rates: SizeRates | Sequence[SizeRates]) -> FittedLaws:
    """Fit all laws to the rates of a table, or of several at different cohesion numbers.

    Parameters
    ----------
    rates : SizeRates or sequence of SizeRates
        Of `size_rates`.

    Returns
    -------
    FittedLaws
        The short forms, each with its residuals.

    Raises
    ------
    PBEError
        Of several tables of other shapes or without their cohesion numbers.

    Examples
    --------
    >>> import pbekit
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> laws = pbekit.fitted_laws(pbekit.size_rates(table, draws=20, largest=40))
    >>> [name for name in vars(laws)][:4]
    ['radius', 'efficiency', 'breakup', 'breakage']
    """
    every = [rates] if isinstance(rates, SizeRates) else list(rates)
    tables = [one.table for one in every]
    cohesion = [one.about.get("cohesion_number") for one in tables]
    if len(every) > 1:
        if any(n is None for n in cohesion):
            raise PBEError("tables: one does not say its cohesion number, and a law over several needs it")
        if len({one.shape_name for one in tables}) > 1:
            raise PBEError("tables: of different shape coordinates, so that one law cannot hold for all")
    numbers = np.array([np.nan if n is None else float(n) for n in cohesion])
    return FittedLaws(
        radius=_radius(every),
        efficiency=outcome_law("efficiency", tables, numbers, (AGGREGATION,)),
        breakup=outcome_law("breakup", tables, numbers, SCATTERED),
        breakage=power_law(every, numbers),
        breakage_step=step_law(every, numbers),
        daughters=daughters_law(tables),
        parts=parts_law(tables),
    )


def _radius(every: Sequence[SizeRates]) -> RadiusLaw:
    """Of the classes that were seen, from three primaries on; each counts alike."""
    size, radius = [], []
    for one in every:
        records = one.table.records
        seen = (one.pivots >= 3) & (one.pivots <= records.size.max(initial=1))
        size.append(one.pivots[seen])
        radius.append((one.outer_radius / one.table.radius)[seen])
    p, r = np.concatenate(size), np.concatenate(radius)
    a = every[0].table.radius
    if p.size < 3:
        # Primaries and doublets alone: R = a P.
        return RadiusLaw(
            "radius", "R = a (P/k)^(1/d)", ("k", "d"), np.ones(2), np.zeros((2, 2)), {"P": (1.0, 2.0)}, 0.0,
            "R, relative", {"a": a},
        )  # fmt: skip
    (c0, c1), covariance = weighted(
        np.stack([np.ones(p.size), np.log(p)], axis=1), np.log(r), np.ones(p.size)
    )
    # ln R/a = (ln P - ln k)/d.
    d, k = 1 / c1, np.exp(-c0 / c1)
    jacobian = np.array([[-k / c1, k * c0 / c1**2], [0.0, -1 / c1**2]])
    fit = np.exp(c0 + c1 * np.log(p))
    return RadiusLaw(
        "radius",
        "R = a (P/k)^(1/d)",
        ("k", "d"),
        np.array([k, d]),
        jacobian @ covariance @ jacobian.T,
        {"P": (float(p.min()), float(p.max()))},
        float(np.abs(fit / r - 1).max()),
        "R, relative",
        {"a": a},
    )
