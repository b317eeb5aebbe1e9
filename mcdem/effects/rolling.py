"""Resistance of a contact to rolling: an adhesive contact area trails behind the spheres that roll over it.

Source: Dominik & Tielens (1995), Phil. Mag. A 72, 783, for JKR contacts, as in Marshall & Li, Adhesive Particle Flow (2014),
chapter 4: a torque 4 F_adh (b/b0)^(3/2) xi resists the rolling displacement xi = R* (turn of 2 - turn of 1), R* = a_eff/2, up
to a critical displacement at which the contact moves on.  The radius b of the contact is that without load, b0 (C).
History [3:6]: rolling angle, the turn of sphere 2 less that of sphere 1 across the line of centres.

Exact tests: the work of any motion within the limit is its elastic energy; the torque stays at 4 F_adh xi_crit beyond it.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from mcdem.compilation import compiled
from mcdem.effects.kinds import Companions, EffectTable, Resistance, require_contact
from mcdem.effects.tangential import ROLLS, STUCK, add_stiffness, cut_back, direction
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.units import LENGTH


class Rolling(EffectTable):
    """Rolling resistance of JKR contacts."""

    title: ClassVar[str] = "rolling"

    below_radius: ClassVar[tuple[str, ...]] = ("critical_displacement",)

    critical_displacement: Annotated[float, LENGTH.positive.between("1e-15 m", "1 mm", '"0.5 nm"')]
    """Rolling displacement xi_crit at which the contact moves on, between an atom's size and the radius of the contact."""

    def refuse_company(self, effects: Companions) -> None:
        require_contact("rolling", effects)
        if not effects.contact.rolls:
            raise ValueError("rolling is a law of JKR contacts: use jkr, or rods, whose stiffness is given")

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> RollingKernel:
        """The parameters in reduced units."""
        contact = effects.contact
        return RollingKernel(
            stiffness=2.0 * contact.pull_off_force(units.length) / units.force,
            largest_angle=2.0 * self.critical_displacement / units.length,
        )


class RollingKernel(NamedTuple):
    """Parameters of `resist`, for a_eff = 1."""

    stiffness: float
    """4 F_adh R* [torque] ~ a_eff^2"""
    largest_angle: float
    """xi_crit/R* ~ 1/a_eff"""


@compiled
def limit(radius, p):
    """Largest angle: (that without load, its growth per unit of compression)."""
    return p.largest_angle / radius, 0.0


@compiled
def limits(radius, p, out):
    """Its row of the limits (3, 2) of the springs of a contact."""
    out[1, 0], out[1, 1] = limit(radius, p)


@compiled
def resist(turned, p, response):
    """Add the loads and the stiffness of rolling; returns ROLLS or STUCK."""
    carried, q, normal, radius = turned.carried, turned.q, turned.normal, turned.radius
    spring, loads, tangent = response
    stiffness = p.stiffness * radius * radius
    for k in range(3):
        spring[3 + k] = carried[3 + k] + q[3 + k] - q[k]
    share = cut_back(spring, 3, limit(radius, p)[0])
    for k in range(3):
        loads[k] += stiffness * spring[3 + k]
        loads[3 + k] -= stiffness * spring[3 + k]
    along = np.empty(3)
    direction(spring, 3, share, along)
    add_stiffness(tangent, 0, 0, stiffness * share, normal, along)
    add_stiffness(tangent, 0, 3, -stiffness * share, normal, along)
    add_stiffness(tangent, 3, 0, -stiffness * share, normal, along)
    add_stiffness(tangent, 3, 3, stiffness * share, normal, along)
    return ROLLS if share < 1.0 else STUCK


EFFECT = Resistance(Rolling, RollingKernel, resist, limits)
