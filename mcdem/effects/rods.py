"""Bonds that transmit bending moments: rods and springs between the two spheres of a contact.

Source: Becker & Briesen (2008), Phys. Rev. E 78, 061404, a model for the bending moments that Pantina & Furst (2005) measured
between bonded latex spheres; used by Vanni & Frungieri (2017).  Each sphere carries a rod that points to the centre of its
partner when the contact is made; a spring of rest length zero pulls the tip of the rod across the line of centres back to that
centre, with a stiffness k_t and a largest displacement xi_max at which the rod slips.  For small displacements,

    E = k_t (xi_1^2 + xi_2^2)/2,     xi_i = r (turn of sphere i, seen from the line of centres),     xi_i <= xi_max.

For two equal spheres that is a sliding spring 2 k_t and a rolling spring 2 k_t a^2 with limits of their own (C: the model gives
no law for other radii; k_t and xi_max are taken as they are).  It does not resist twisting.
History [0:3], [3:6]: r times the turn of the rod of sphere 1 and of sphere 2 against the line of centres, of length xi_i.

Exact tests: the deflection (F/k_t) n (2 n^2 + 1)/3 of a clamped chain of n bonds, for many bonds an elastic beam with
E I = k_t (2a)^3/2; a twin that keeps the rods as vectors fixed in the spheres.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from mcdem.compilation import compiled
from mcdem.effects.kinds import Companions, EffectTable, Resistance, require_contact
from mcdem.effects.tangential import ROLLS, STUCK, add_stiffness, cut_back, direction
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension
from mcdem.quantities.units import LENGTH, STIFFNESS


class Rods(EffectTable):
    """Bonds that resist sliding and rolling alike (Becker & Briesen 2008); instead of sliding and rolling."""

    title: ClassVar[str] = "rods"

    below_radius: ClassVar[tuple[str, ...]] = ("largest_displacement",)

    stiffness: Annotated[float, STIFFNESS.positive.between("1e-12 N/m", "1e6 N/m", '"10 mN/m"')]
    """Stiffness k_t of the spring at the tip of each rod."""
    largest_displacement: Annotated[float, LENGTH.positive.between("1e-15 m", "1 mm", '"20 nm"')]
    """Displacement xi_max of the tip at which the rod slips; the bond bears a moment of at most 2 a k_t xi_max at each end."""

    def refuse_company(self, effects: Companions) -> None:
        require_contact("rods", effects)
        if effects.get("sliding") or effects.get("rolling"):
            raise ValueError("rods resist sliding and rolling already: remove sliding and rolling, or rods")

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> RodsKernel:
        """The parameters in reduced units."""
        return RodsKernel(
            stiffness=self.stiffness / units.stiffness,
            largest_displacement=self.largest_displacement / units.length,
        )


class RodsKernel(NamedTuple):
    """Parameters of `resist`."""

    stiffness: float
    """k_t [force/length]"""
    largest_displacement: float
    """xi_max [length]"""


@compiled
def limit(radius, p):
    """Largest displacement of a tip: (that without load, its growth per unit of compression)."""
    return p.largest_displacement, 0.0


@compiled
def limits(radius, p, out):
    """Its rows of the limits (3, 2) of the springs of a contact."""
    out[0, 0], out[0, 1] = limit(radius, p)
    out[1, 0], out[1, 1] = limit(radius, p)


@compiled
def resist(turned, p, response):
    """Add the loads and the stiffness of both rods; returns ROLLS if one of them slips, else STUCK."""
    carried, q, normal, distance, radius = (
        turned.carried,
        turned.q,
        turned.normal,
        turned.distance,
        turned.radius,
    )
    spring, loads, tangent = response
    along = np.empty(3)
    code = STUCK
    for first in (0, 3):
        for k in range(first, first + 3):
            spring[k] = carried[k] + distance * q[k]
        share = cut_back(spring, first, limit(radius, p)[0])
        for k in range(first, first + 3):
            loads[k] -= p.stiffness * distance * spring[k]
        direction(spring, first, share, along)
        add_stiffness(tangent, first, first, p.stiffness * distance * distance * share, normal, along)
        if share < 1.0:
            code = ROLLS
    return code


EFFECT = Resistance(Rods, RodsKernel, resist, limits, fixed_in_spheres=True)
