"""What the long-range attractions share, as the rest of the program asks for it: two numbers that say how strong one is.

Hamaker (1937) in the limit of gaps small against the radius: F = A_H a_eff/12 (h + l0)^2 before any retardation.
"""

from __future__ import annotations

from math import pi
from typing import Annotated

from mcdem.effects.kinds import EffectTable
from mcdem.quantities.units import ENERGY, LENGTH


class Attraction(EffectTable):
    """An attraction of two primaries that falls as the square of their distance."""

    hamaker_constant: Annotated[float, ENERGY.positive.between("1e-60 J", "1e-12 J")]
    """Hamaker constant A_H of solid against solid through the medium."""
    minimum_approach: Annotated[float, LENGTH.positive.between("1e-15 m", "1 mm", '"0.165 nm"')]
    """Molecular roughness l0 that keeps the attraction finite at contact."""

    @property
    def reach(self) -> float | None:
        """Length [m] over which the attraction weakens beyond the square of the distance; None if it does not."""
        return None

    @property
    def step_length(self) -> float:
        """l0, within which the attraction falls to a quarter."""
        return self.minimum_approach

    def at_contact(self, radius: float) -> float:
        """Attraction [N] of two touching spheres of `radius` [m]."""
        return self.hamaker_constant * radius / (12.0 * self.minimum_approach**2)

    def work_of_adhesion(self) -> float:
        """A_H/(12 pi l0^2) [J/m^2], the work of parting two flat surfaces that touch."""
        return self.hamaker_constant / (12.0 * pi * self.minimum_approach**2)

    def number(self, shear_stress: float, radius: float) -> float:
        """C_A = A_H/(36 pi mu g a^3), the attraction over the pull of the flow (van de Ven & Mason 1977)."""
        return self.hamaker_constant / (36.0 * pi * shear_stress * radius**3)
