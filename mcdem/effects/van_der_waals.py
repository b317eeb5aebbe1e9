"""Van der Waals attraction of two spheres not in contact.

Source: Hamaker (1937) in the limit of gaps small against the radius; retardation of Schenkel & Kitchener (1960) in the form
for the force, as Eqs. 11-12 of Frungieri & Vanni (2021).  Eq. 12 is misprinted there (its branches do not meet and its first
exceeds 1); with the denominator (1 + 1.77 p)^2 they cross within 0.1 % of the stated p0 = 0.5709, where f = 0.7474.

    F(h) = -A_H a_eff / (12 (h + l0)^2) f(p),     p = 2 pi (h + l0)/lambda,     a_eff = 2 a1 a2/(a1 + a2)

Exact tests: the force at contact of the paper's spheres is 1.34 times their adhesion force; F is continuous at p0; without
retardation F (h + l0)^2 is constant; F falls as h^-3 far away.
"""

from __future__ import annotations

from math import pi
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import Field, model_validator

from mcdem.compilation import compiled
from mcdem.effects.attraction import Attraction
from mcdem.effects.kinds import Companions, PairForce
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.units import LENGTH

# Where the two branches of the retardation function cross.  The published 0.5709 leaves a step of 2e-4 in the force;
# here it is none beyond round-off (the slope has its kink either way).
BRANCH_POINT = 0.5717075264733067


class VanDerWaals(Attraction):
    """Van der Waals attraction, retarded unless the scene says otherwise."""

    title: ClassVar[str] = "van der Waals"
    below_radius: ClassVar[tuple[str, ...]] = ("minimum_approach",)
    retarded: bool = True
    """Whether the attraction weakens over distances comparable to the London wavelength."""
    london_wavelength: Annotated[float, LENGTH.positive.between("1 pm", "1 m", '"100 nm"')] | None = Field(
        100e-9, json_schema_extra={"default": "100 nm"}
    )
    """London wavelength lambda of the retardation.  The default is an assumption (the paper gives no value) of little weight."""

    @model_validator(mode="before")
    @classmethod
    def _wavelength_only_where_retarded(cls, table: Any) -> Any:
        if not isinstance(table, dict) or table.get("retarded", True) is not False:
            return table
        if table.get("london_wavelength") is not None:
            raise ValueError(
                "london_wavelength belongs to the retarded attraction: remove it, or retarded = false"
            )
        return table | {"london_wavelength": None}

    @property
    def reach(self) -> float | None:
        """The London wavelength [m]; None without retardation."""
        return self.london_wavelength

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> VanDerWaalsKernel:
        """The parameters in reduced units."""
        return VanDerWaalsKernel(
            strength=self.hamaker_constant / (12.0 * units.energy),
            minimum_approach=self.minimum_approach / units.length,
            wavenumber=None
            if self.london_wavelength is None
            else 2.0 * pi * units.length / self.london_wavelength,
        )


class VanDerWaalsKernel(NamedTuple):
    """Parameters of `force`; the formulas hold in any consistent units."""

    strength: float
    """A_H/12 [energy]"""
    minimum_approach: float
    """l0 [length]"""
    wavenumber: float | None
    """2 pi/lambda [1/length]; None without retardation"""


@compiled
def retardation(distance, wavenumber):
    """(f, df/d distance) of the retardation function; exactly (1, 0) where `wavenumber` is None."""
    if wavenumber is None:
        return 1.0, 0.0
    p = wavenumber * distance
    if p < BRANCH_POINT:
        q = 1.0 / (1.0 + 1.77 * p)
        return (1.0 + 3.54 * p) * q * q, -2.0 * 1.77**2 * p * q * q * q * wavenumber
    q = 1.0 / p
    return (
        q * (0.98 - q * (0.434 - q * 0.0674)),
        -q * q * (0.98 - q * (2.0 * 0.434 - q * 3.0 * 0.0674)) * wavenumber,
    )


@compiled
def force(h, radius, p):
    """Force (F, dF/dh) at gap `h` between spheres of harmonic mean radius `radius`; F > 0 repels.

    An overlap (h < 0) of spheres not in contact is read as touching: the force at contact, with no stiffness.
    """
    distance = p.minimum_approach + max(h, 0.0)
    f, slope = retardation(distance, p.wavenumber)
    inverse = 1.0 / distance
    scale = p.strength * radius * inverse * inverse
    if h < 0.0:
        return -scale * f, 0.0
    return -scale * f, scale * (2.0 * f * inverse - slope)


EFFECT = PairForce(VanDerWaals, VanDerWaalsKernel, force)
