"""Resistance of a contact to twisting about the line of centres: friction over the area of the contact.

Source: Marshall (2009), J. Comput. Phys. 228, 1541, Eqs. 32-33, as in Marshall & Li, Adhesive Particle Flow (2014), chapter 4:
with the stiffness k_T and the limit F_t of sliding, spread evenly over a contact of radius b,

    M = -1/2 k_T b^2 (angle),     |M| <= 2/3 b F_t.

The radius b of the contact is that without load (C), as for sliding.  History [6]: twist angle of sphere 2 against sphere 1.

Exact tests: the work of any motion within the limit is its elastic energy; the torque stays at the limit beyond it; both
factors are the moments of uniform friction and of uniform displacement over a disc.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Annotated, NamedTuple

from numba import njit

from mcdem.effects.sliding import cohesion
from mcdem.effects.tangential import STUCK, TWISTS
from mcdem.quantities.toml_tables import Table
from mcdem.quantities.units import DIMENSIONLESS

if TYPE_CHECKING:
    from mcdem.scene import Scene


class Twisting(Table):
    """Twisting resistance of contacts; needs a contact law, whose material sets the stiffness."""

    friction_coefficient: Annotated[float, DIMENSIONLESS.positive.between("1e-9", "1e6", "0.3")]
    """Largest tangential over normal stress in the contact, mu_f, as for sliding."""

    def kernel(self, scene: Scene) -> TwistingKernel:
        """The parameters in reduced units."""
        unit, contact = scene.reduced, scene.effects.contact
        assert contact is not None  # `Effects` refuses a resistance without a contact
        contact_radius = contact.contact_radius(unit.length) / unit.length
        sliding = 8.0 * contact.reduced_shear_modulus * contact_radius * unit.length / unit.stiffness
        return TwistingKernel(
            stiffness=0.5 * sliding * contact_radius**2,
            lever=2.0 / 3.0 * contact_radius,
            friction_coefficient=self.friction_coefficient,
            cohesion=cohesion(contact, unit.length) / unit.force,
        )


class TwistingKernel(NamedTuple):
    """Parameters of `resist`, for a_eff = 1."""

    stiffness: float
    """k_T b^2/2 [torque] ~ a_eff^2"""
    lever: float
    """2 b/3 ~ a_eff^(2/3)"""
    friction_coefficient: float
    """mu_f"""
    cohesion: float
    """2 F_adh or F_adh, ~ a_eff"""


@njit(cache=True)
def limit(radius, p):
    """Largest angle: (that without load, its growth per unit of compression)."""
    stiffness = p.stiffness * radius * radius
    if stiffness == 0.0:
        return inf, 0.0
    lever = p.lever * (radius ** (2.0 / 3.0) if radius != 1.0 else 1.0)
    growth = lever * p.friction_coefficient / stiffness
    return growth * p.cohesion * radius, growth


@njit(cache=True)
def resist(carried, q, radius, normal_force, p, spring, loads, tangent):
    """Add the load and the stiffness of twisting; F_n > 0 is compression; returns TWISTS or STUCK."""
    stiffness = p.stiffness * radius * radius
    unloaded, growth = limit(radius, p)
    largest = max(unloaded + growth * normal_force, 0.0)
    trial = carried[6] + q[6]
    spring[6] = min(max(trial, -largest), largest)
    loads[6] -= stiffness * spring[6]
    if abs(trial) > largest:
        return TWISTS
    tangent[6, 6] += stiffness
    return STUCK
