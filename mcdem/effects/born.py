"""Born repulsion: the short-range wall of two spheres in a scene without a contact law.

Source: Feke, Prabhu, Mann & Mann (1984), J. Phys. Chem. 88, 5735, in the limit of gaps small against the radius: the r^-12 part
of the Lennard-Jones potential of all pairs of atoms, whose r^-6 part is the van der Waals attraction of the same scene,

    F = A_H sigma^6 a_eff / (360 h^8),     sigma the diameter at which two atoms have zero energy.

Exact tests: the integral of r^-12 over two half-spaces, carried to spheres by Derjaguin's approximation; with the unretarded
attraction for l0 = 0 the force vanishes at h = sigma 30^(-1/6).
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple

from mcdem.compilation import compiled
from mcdem.effects.kinds import Companions, EffectTable, PairForce, refuse_contact
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.units import LENGTH


class Born(EffectTable):
    """Born repulsion, with the Hamaker constant of the van der Waals attraction."""

    title: ClassVar[str] = "Born repulsion"

    below_radius: ClassVar[tuple[str, ...]] = ("collision_diameter",)

    collision_diameter: Annotated[float, LENGTH.positive.between("1 pm", "1 um", '"0.5 nm"')]
    """Lennard-Jones diameter sigma of the atoms, about 0.5 nm."""

    keeps_apart: ClassVar[bool] = True

    def refuse_company(self, effects: Companions) -> None:
        refuse_contact("born", effects)
        if effects.attraction is None:
            there_are = " or ".join(f"[effects.{name}]" for name in effects.attractions)
            raise ValueError(f"born takes its Hamaker constant from an attraction: add {there_are}")

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> BornKernel:
        """The parameters in reduced units."""
        return BornKernel(
            strength=effects.attraction.hamaker_constant / (360.0 * units.energy),
            diameter=self.collision_diameter / units.length,
        )


class BornKernel(NamedTuple):
    """Parameters of `force`; the formulas hold in any consistent units."""

    strength: float
    """A_H/360 [energy]"""
    diameter: float
    """sigma [length]"""


@compiled
def force(h, radius, p):
    """Force (F, dF/dh) at gap `h` between spheres of harmonic mean radius `radius`; F > 0 repels.

    Below a tenth of the atoms' diameter, where it is 1e8/30 of the attraction at one diameter, it goes on along its tangent, so
    that an overlap too is pushed apart by a finite force.
    """
    floor = 0.1 * p.diameter
    inverse = p.diameter / max(h, floor)
    fourth = (inverse * inverse) * (inverse * inverse)
    value = p.strength * radius / (p.diameter * p.diameter) * (fourth * fourth)
    slope = -8.0 * value * inverse / p.diameter
    if h < floor:
        return value + slope * (h - floor), slope
    return value, slope


EFFECT = PairForce(Born, BornKernel, force)
