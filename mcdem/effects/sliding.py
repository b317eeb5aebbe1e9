"""Resistance of a contact to sliding: an elastic spring with a limit of friction.

Source: the no-slip stiffness k_T = 8 G* b of Mindlin (1949), J. Appl. Mech. 16, 259, with the limit of Thornton (1991) as in
Marshall & Li, Adhesive Particle Flow (2014), chapter 4,

    F_t = -k_T s,     |F_t| <= mu_f (F_n + 2 F_adh) for a JKR contact, mu_f (F_n + F_adh) for a DMT one,

so that a contact without load, and one about to be pulled off, still bears friction.  The radius b of the contact is that
without load (C): k_T then belongs to an energy; the true b is 0.63 of it at pull-off.
History [0:3]: sliding displacement s of the surface of sphere 2 over that of sphere 1.

Exact tests: the work of any motion within the limit is the energy k_T s^2/2; the load stays at the limit beyond it.
"""

from __future__ import annotations

from math import inf
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from mcdem.compilation import compiled
from mcdem.effects.kinds import Companions, EffectTable, Resistance, require_contact
from mcdem.effects.tangential import SLIDES, STUCK, add_stiffness, cut_back, direction
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.units import DIMENSIONLESS


class Sliding(EffectTable):
    """Friction of contacts; needs a contact law, whose material sets the stiffness."""

    title: ClassVar[str] = "sliding"

    friction_coefficient: Annotated[float, DIMENSIONLESS.positive.between("1e-9", "1e6", "0.3")]
    """Largest tangential over normal force mu_f, the normal force with the adhesion added."""

    def refuse_company(self, effects: Companions) -> None:
        require_contact("sliding", effects)

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> SlidingKernel:
        """The parameters in reduced units."""
        contact = effects.contact
        stiffness = 8.0 * contact.reduced_shear_modulus * contact.contact_radius(units.length)
        return SlidingKernel(
            stiffness=stiffness / units.stiffness,
            friction_coefficient=self.friction_coefficient,
            cohesion=contact.cohesion(units.length) / units.force,
        )


class SlidingKernel(NamedTuple):
    """Parameters of `resist`, for a_eff = 1."""

    stiffness: float
    """k_T ~ a_eff^(2/3)"""
    friction_coefficient: float
    """mu_f"""
    cohesion: float
    """2 F_adh or F_adh, ~ a_eff"""


@compiled
def limit(radius, p):
    """Largest displacement: (that without load, its growth per unit of compression)."""
    stiffness = p.stiffness * (radius ** (2.0 / 3.0) if radius != 1.0 else 1.0)
    if stiffness == 0.0:
        return inf, 0.0
    return p.friction_coefficient * p.cohesion * radius / stiffness, p.friction_coefficient / stiffness


@compiled
def limits(radius, p, out):
    """Its row of the limits (3, 2) of the springs of a contact."""
    out[0, 0], out[0, 1] = limit(radius, p)


@compiled
def resist(turned, p, response):
    """Add the loads and the stiffness of sliding; F_n > 0 is compression; returns SLIDES or STUCK."""
    carried, q, normal, distance, share_1, radius, normal_force = turned
    spring, loads, tangent = response
    stiffness = p.stiffness * (radius ** (2.0 / 3.0) if radius != 1.0 else 1.0)
    unloaded, growth = limit(radius, p)
    share_2 = 1.0 - share_1
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        turn_a = share_1 * q[a] + share_2 * q[3 + a]
        turn_b = share_1 * q[b] + share_2 * q[3 + b]
        spring[k] = carried[k] + distance * (normal[a] * turn_b - normal[b] * turn_a)
    share = cut_back(spring, 0, max(unloaded + growth * normal_force, 0.0))
    # Its load on the mean turn is r F x n; the limit's direction turns with it.
    along, across = np.empty(3), np.empty(3)
    direction(spring, 0, share, along)
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        load = -stiffness * distance * (spring[a] * normal[b] - spring[b] * normal[a])
        loads[k] += share_1 * load
        loads[3 + k] += share_2 * load
        across[k] = along[a] * normal[b] - along[b] * normal[a]
    scale = stiffness * share * distance * distance
    add_stiffness(tangent, 0, 0, scale * share_1 * share_1, normal, across)
    add_stiffness(tangent, 0, 3, scale * share_1 * share_2, normal, across)
    add_stiffness(tangent, 3, 0, scale * share_1 * share_2, normal, across)
    add_stiffness(tangent, 3, 3, scale * share_2 * share_2, normal, across)
    return SLIDES if share < 1.0 else STUCK


EFFECT = Resistance(Sliding, SlidingKernel, resist, limits)
