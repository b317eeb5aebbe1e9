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
from typing import Annotated, ClassVar, NamedTuple

from mcdem.compilation import compiled
from mcdem.effects.kinds import Companions, EffectTable, Resistance, require_contact
from mcdem.effects.tangential import STUCK, TWISTS
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.units import DIMENSIONLESS


class Twisting(EffectTable):
    """Twisting resistance of contacts; needs a contact law, whose material sets the stiffness."""

    title: ClassVar[str] = "twisting"

    friction_coefficient: Annotated[float, DIMENSIONLESS.positive.between("1e-9", "1e6", "0.3")]
    """Largest tangential over normal stress in the contact, mu_f, as for sliding."""

    def refuse_company(self, effects: Companions) -> None:
        require_contact("twisting", effects)

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> TwistingKernel:
        """The parameters in reduced units."""
        contact = effects.contact
        contact_radius = contact.contact_radius(units.length) / units.length
        sliding = 8.0 * contact.reduced_shear_modulus * contact_radius * units.length / units.stiffness
        return TwistingKernel(
            stiffness=0.5 * sliding * contact_radius**2,
            lever=2.0 / 3.0 * contact_radius,
            friction_coefficient=self.friction_coefficient,
            cohesion=contact.cohesion(units.length) / units.force,
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


@compiled
def limit(radius, p):
    """Largest angle: (that without load, its growth per unit of compression)."""
    stiffness = p.stiffness * radius * radius
    if stiffness == 0.0:
        return inf, 0.0
    lever = p.lever * (radius ** (2.0 / 3.0) if radius != 1.0 else 1.0)
    growth = lever * p.friction_coefficient / stiffness
    return growth * p.cohesion * radius, growth


@compiled
def limits(radius, p, out):
    """Its row of the limits (3, 2) of the springs of a contact."""
    out[2, 0], out[2, 1] = limit(radius, p)


@compiled
def resist(turned, p, response):
    """Add the load and the stiffness of twisting; F_n > 0 is compression; returns TWISTS or STUCK."""
    carried, q, radius, normal_force = turned.carried, turned.q, turned.radius, turned.normal_force
    spring, loads, tangent = response
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


EFFECT = Resistance(Twisting, TwistingKernel, resist, limits)
