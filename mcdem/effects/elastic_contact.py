"""What the laws of an adhesive elastic contact share: the material of the primaries, and which law suits it.

Tabor (1977), J. Colloid Interface Sci. 58, 2; the ranges of the two laws after Johnson & Greenwood (1997),
J. Colloid Interface Sci. 192, 326.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar

from mcdem.effects.kinds import EffectTable
from mcdem.errors import SceneError
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.units import DIMENSIONLESS, ENERGY, LENGTH, PRESSURE, SURFACE_ENERGY, shown

LARGEST_CONTACT = 1.0
"""Contact radius over that of the smallest primaries, beyond which two spheres are no longer two."""


class ElasticContact(EffectTable):
    """An adhesive elastic contact of two primaries of one material."""

    surface_energy: Annotated[float, SURFACE_ENERGY.positive.between("1e-12 J/m^2", "1e3 J/m^2")]
    """Surface energy gamma of the solid against the medium; the work of adhesion is 2 gamma."""
    elastic_modulus: Annotated[float, PRESSURE.positive.between("1 Pa", "1e14 Pa")]
    """Elastic modulus E of the primary particles."""
    poisson_ratio: Annotated[float, DIMENSIONLESS.between("-0.99", "0.5", "0.3")]
    """Poisson ratio nu of the primary particles."""

    @classmethod
    def offers(cls, tables: list[dict[str, Any]]) -> dict[str, str]:
        """The surface energy that belongs to an attraction of the scene, A_H/(24 pi l0^2) (Israelachvili 2011, Eq. 13.16)."""
        offer = "or A_H/(24 pi l0^2), with Hamaker constant and least distance"
        for given in tables:
            try:
                constant = ENERGY.to_si(given["hamaker_constant"])
                distance = LENGTH.to_si(given["minimum_approach"])
                value = shown(f"{constant / (24.0 * math.pi * distance**2):.3g} J/m^2")
            except (KeyError, TypeError, ValueError, ArithmeticError):
                continue
            offer = f"A_H/(24 pi l0^2) from the van der Waals attraction is {value}"
        return {"surface_energy": offer}

    friction_share: ClassVar[float]
    """Adhesion that adds to the normal load in the friction law, over the pull-off force."""
    tabor_numbers: ClassVar[tuple[float, float]]
    """The Tabor numbers for which it holds."""
    rolls: ClassVar[bool] = False
    """Whether the contact area trails behind spheres that roll over it (Dominik & Tielens 1995)."""

    def pull_off_force(self, radius: float) -> float:
        """F_adh [N] of two spheres of `radius` [m]."""
        raise NotImplementedError

    def contact_radius(self, radius: float) -> float:
        """b0 [m], without load, of two spheres of `radius` [m]."""
        raise NotImplementedError

    def pull_off_gap(self, radius: float) -> float:
        """h_po [m] of two spheres of `radius` [m], at which a contact is lost; it grows with the cube root of the radius."""
        return 0.0

    def require_small_contact(self, suspension: Suspension, law: str) -> None:
        """Refuse a contact that is no small part of its spheres, where the laws of contact end; raises `SceneError`."""
        smallest = min(suspension.species)
        ratio = self.contact_radius(smallest) / smallest
        if ratio > LARGEST_CONTACT:
            raise SceneError(
                f"[effects.{law}] surface_energy = {self.surface_energy:g} J/m^2 and elastic_modulus "
                f"= {self.elastic_modulus:g} Pa make a contact of {ratio:.3g} times the radius of the primaries, expected less "
                f"than {LARGEST_CONTACT:g}: a smaller surface energy or a larger modulus"
            )

    def cohesion(self, radius: float) -> float:
        """Force [N] by which adhesion adds to the normal load in the friction law."""
        return self.friction_share * self.pull_off_force(radius)

    @classmethod
    def tabor_range(cls) -> str:
        """The range of its Tabor number, in words."""
        low, high = cls.tabor_numbers
        return f"above {low:g}" if low > 0.0 else f"below {high:g}"

    @property
    def reduced_modulus(self) -> float:
        """E* = E/(2 (1 - nu^2)) [Pa] of two bodies of the material."""
        return 0.5 * self.elastic_modulus / (1.0 - self.poisson_ratio**2)

    @property
    def reduced_shear_modulus(self) -> float:
        """G* = G/(2 (2 - nu)) [Pa] of two bodies of the material, G = E/(2 (1 + nu)) (Mindlin 1949)."""
        return 0.25 * self.elastic_modulus / ((1.0 + self.poisson_ratio) * (2.0 - self.poisson_ratio))

    def tabor_number(self, radius: float, equilibrium_distance: float) -> float:
        """(R* W^2/(E*^2 z0^3))^(1/3): height of the elastic neck over the attraction's range, for two spheres of `radius` [m].

        JKR holds above about 5, DMT below about 0.1; between them the truth lies between the two laws.
        """
        work = 2.0 * self.surface_energy
        cube = 0.5 * radius * work**2 / (self.reduced_modulus**2 * equilibrium_distance**3)
        return float(cube ** (1.0 / 3.0))
