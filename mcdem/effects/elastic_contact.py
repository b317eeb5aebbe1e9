"""What the laws of an adhesive elastic contact share: the material of the primaries, and which law suits it.

Tabor (1977), J. Colloid Interface Sci. 58, 2; the ranges of the two laws after Johnson & Greenwood (1997),
J. Colloid Interface Sci. 192, 326.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from mcdem.effects.kinds import EffectTable
from mcdem.quantities.units import Dimensionless, PositivePressure, PositiveSurfaceEnergy


class ElasticContact(EffectTable):
    """An adhesive elastic contact of two primaries of one material."""

    surface_energy: PositiveSurfaceEnergy
    """Surface energy gamma of the solid against the medium; the work of adhesion is 2 gamma."""
    elastic_modulus: PositivePressure
    """Elastic modulus E of the primary particles."""
    poisson_ratio: Annotated[Dimensionless, Field(gt=-1.0, le=0.5)]
    """Poisson ratio nu of the primary particles."""

    friction_share: ClassVar[float]
    """Adhesion that friction feels beside the load, over the pull-off force."""
    tabor_numbers: ClassVar[tuple[float, float]]
    """The Tabor numbers for which it holds."""
    rolls: ClassVar[bool] = False
    """Whether the contact lags behind spheres that roll over it (Dominik & Tielens 1995)."""

    def pull_off_force(self, radius: float) -> float:
        """F_adh [N] of two spheres of `radius` [m]."""
        raise NotImplementedError

    def contact_radius(self, radius: float) -> float:
        """b0 [m], without load, of two spheres of `radius` [m]."""
        raise NotImplementedError

    def pull_off_gap(self, radius: float) -> float:
        """h_po [m] of two spheres of `radius` [m], at which a contact is lost; it grows with the cube root of the radius."""
        return 0.0

    def cohesion(self, radius: float) -> float:
        """Force [N] by which adhesion adds to the load that friction feels."""
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
        """(R* W^2/(E*^2 z0^3))^(1/3): reach of the elastic neck over that of the attraction, for two spheres of `radius` [m].

        JKR holds above about 5, DMT below about 0.1; between them the truth lies between the two laws.
        """
        work = 2.0 * self.surface_energy
        cube = 0.5 * radius * work**2 / (self.reduced_modulus**2 * equilibrium_distance**3)
        return float(cube ** (1.0 / 3.0))
