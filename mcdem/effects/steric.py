"""Steric repulsion of grafted polymer brushes, in a scene without a contact law.

Source: pressure between brushes of thickness L in a good solvent, Alexander (1977) and de Gennes (1987), Adv. Colloid Interface
Sci. 27, 189, integrated to spheres by Derjaguin's approximation.  With s the distance between grafted chains and D = h/2L < 1,

    P = kT/s^3 (D^(-9/4) - D^(3/4)),     F = 8 pi a_eff L kT/(35 s^3) (7 D^(-5/4) + 5 D^(7/4) - 12),     F = 0 for D >= 1.

Exact tests: -dF/dh is pi a_eff P; force and slope vanish where the brushes part, at h = 2L.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Annotated, ClassVar, NamedTuple

from mcdem.compilation import compiled
from mcdem.effects.kinds import Companions, EffectTable, PairForce, refuse_contact
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.units import LENGTH, TEMPERATURE

BOLTZMANN = 1.380649e-23  # [J/K]


class Steric(EffectTable):
    """Steric repulsion of polymer brushes in a good solvent (Alexander and de Gennes)."""

    title: ClassVar[str] = "steric repulsion"

    brush_thickness: Annotated[float, LENGTH.positive.between("1 pm", "100 um", '"5 nm"')]
    """Thickness L of the brush on each particle."""
    grafting_distance: Annotated[float, LENGTH.positive.between("1 pm", "100 um", '"2 nm"')]
    """Mean distance s between grafted chains."""
    temperature: Annotated[float, TEMPERATURE.positive.between("1 K", "5000 K")]
    """Absolute temperature."""

    keeps_apart: ClassVar[bool] = True

    def refuse_company(self, effects: Companions) -> None:
        refuse_contact("steric", effects)

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> StericKernel:
        """The parameters in reduced units."""
        pressure = BOLTZMANN * self.temperature / self.grafting_distance**3
        return StericKernel(
            pressure=pressure / (units.force / units.length**2),
            range=2.0 * self.brush_thickness / units.length,
        )


class StericKernel(NamedTuple):
    """Parameters of `force`; the formulas hold in any consistent units."""

    pressure: float
    """kT/s^3 [force/length^2]"""
    range: float
    """2L [length]"""


@compiled
def force(h, radius, p):
    """Force (F, dF/dh) at gap `h` between spheres of harmonic mean radius `radius`; F > 0 repels.

    Below a hundredth of its range, a brush pressed to a density beyond any melt, it goes on along its tangent, so that an
    overlap too is pushed apart by a finite force.
    """
    if h >= p.range:
        return 0.0, 0.0
    floor = 0.01 * p.range
    d = max(h, floor) / p.range
    root = sqrt(d)
    fourth = sqrt(root)
    slope = -pi * p.pressure * radius * (1.0 / (d * d * fourth) - root * fourth)
    value = (
        pi
        * p.pressure
        * radius
        * p.range
        * (0.8 / (d * fourth) + 4.0 / 7.0 * d * root * fourth - 48.0 / 35.0)
    )
    if h < floor:
        return value + slope * (h - floor), slope
    return value, slope


EFFECT = PairForce(Steric, StericKernel, force)
