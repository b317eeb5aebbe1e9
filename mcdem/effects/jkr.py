"""Adhesive elastic contact of Johnson, Kendall & Roberts (1971), for soft and strongly adhering spheres (large Tabor number).

Source: Eqs. 13-15 of Frungieri & Vanni (2021), solved for the force.  With the adhesion force F_adh = 3/2 pi gamma a_eff, the
contact radius without load b0 = (9 pi gamma a_eff^2 (1 - nu^2)/2E)^(1/3) and the length L = b0^2/a_eff,

    h/L = y (4 - 6 y^3)/3,     F/F_adh = c^2 - 1,     c = 2 y^3 - 1,

where y^2 = b/b0 is the contact radius over its value without load.  The branch of a bearing contact is y >= 2^(-1/3); it ends
at the pull-off gap h_po = L 2^(-1/3)/3 with F = -F_adh and dF/dh = 0.  F > 0 is compression.  The radii of two different
spheres enter through a_eff = 2 a1 a2/(a1 + a2) alone: F_adh ~ a_eff and L ~ a_eff^(1/3).

Exact tests: Eq. 13 read backwards; the numbers of the paper's spheres (F_adh = 11.07 nN, h_eq = -0.317 nm, h_po = 0.126 nm,
41.9 N/m without load); Hertz' law in deep compression.
"""

from __future__ import annotations

from math import inf, pi, sqrt
from typing import ClassVar, NamedTuple

from mcdem.compilation import compiled
from mcdem.effects.elastic_contact import ElasticContact
from mcdem.effects.kinds import Companions, ContactLaw
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension


class JKR(ElasticContact):
    """Adhesive elastic contacts that bear tension up to the pull-off force."""

    title: ClassVar[str] = "JKR"
    friction_share: ClassVar[float] = 2.0
    tabor_numbers: ClassVar[tuple[float, float]] = (5.0, inf)
    rolls: ClassVar[bool] = True

    def pull_off_force(self, radius: float) -> float:
        """F_adh [N] of two spheres of `radius` [m] (Eq. 14)."""
        return 1.5 * pi * self.surface_energy * radius

    def contact_radius(self, radius: float) -> float:
        """b0 [m], without load, of two spheres of `radius` [m]."""
        return float((2.25 * pi * self.surface_energy * radius**2 / self.reduced_modulus) ** (1.0 / 3.0))

    def pull_off_gap(self, radius: float) -> float:
        """h_po [m] of two spheres of `radius` [m] (Eq. 15)."""
        return (self.contact_radius(radius) / radius) ** 2 * 0.5 ** (1.0 / 3.0) / 3.0 * radius

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> JKRKernel:
        """The parameters in reduced units, for two primaries of radius a."""
        self.require_small_contact(suspension, "jkr")
        return from_scales(
            pull_off_force=self.pull_off_force(units.length) / units.force,
            indentation=(self.contact_radius(units.length) / units.length) ** 2,
        )


class JKRKernel(NamedTuple):
    """Parameters of `force`, for a_eff = 1; each names the power of a_eff with which it grows."""

    pull_off_force: float
    """F_adh ~ a_eff"""
    indentation: float
    """L = b0^2/a_eff ~ a_eff^(1/3)"""
    pull_off_gap: float
    """h_po ~ a_eff^(1/3)"""
    equilibrium_gap: float
    """h_eq < 0, where F = 0, ~ a_eff^(1/3)"""
    equilibrium_stiffness: float
    """-dF/dh at h_eq, ~ a_eff^(2/3)"""


def from_scales(pull_off_force: float, indentation: float) -> JKRKernel:
    """The contact whose force and length scales, at a_eff = 1, are these."""
    return JKRKernel(
        pull_off_force=pull_off_force,
        indentation=indentation,
        pull_off_gap=indentation * 0.5 ** (1.0 / 3.0) / 3.0,
        equilibrium_gap=-2.0 / 3.0 * indentation,
        equilibrium_stiffness=1.8 * pull_off_force / indentation,
    )


@compiled
def root_of_contact_radius(s):
    """y(s), the largest root of s = y (4 - 6 y^3)/3, for s = h/L up to pull-off (0.2646).

    y^4 is a concave function of s, so its tangent at the equilibrium (s = -2/3, y = 1) bounds it from above, by less than
    5 % in y however deep the compression; from there Halley's iteration falls on the root to round-off in three steps.
    """
    y = sqrt(sqrt(0.6 * (1.0 - s)))
    for _ in range(3):
        cube = y * y * y
        value = y * (cube - 2.0 / 3.0) + 0.5 * s
        slope = 4.0 * cube - 2.0 / 3.0
        y -= value * slope / (slope * slope - 6.0 * y * y * value)
    return y


@compiled
def force(h, radius, p):
    """Force (F, dF/dh) of a contact at gap `h` between spheres of harmonic mean radius `radius`; F > 0 repels.

    Beyond the pull-off gap, where there is no equilibrium, F = -F_adh and dF/dh = 0: continuous, so that an iteration may step
    across it; whether the contact still exists there is for the caller to say.
    """
    pull_off_force = p.pull_off_force * radius
    growth = radius ** (1.0 / 3.0) if radius != 1.0 else 1.0
    indentation = p.indentation * growth
    if h >= p.pull_off_gap * growth:
        return -pull_off_force, 0.0
    y = root_of_contact_radius(h / indentation)
    cube = y * y * y
    c = 2.0 * cube - 1.0
    return (
        4.0 * pull_off_force * cube * (cube - 1.0),
        -9.0 * c * y * y / (6.0 * cube - 1.0) * (pull_off_force / indentation),
    )


@compiled
def pull_off_gap(radius, p):
    """Gap beyond which a contact is lost."""
    return p.pull_off_gap * (radius ** (1.0 / 3.0) if radius != 1.0 else 1.0)


@compiled
def pull_off_force(radius, p):
    """Largest tension that a contact bears."""
    return p.pull_off_force * radius


@compiled
def equilibrium(radius, p):
    """(gap, stiffness) of a contact without load."""
    growth = radius ** (1.0 / 3.0) if radius != 1.0 else 1.0
    return p.equilibrium_gap * growth, p.equilibrium_stiffness * growth * growth


@compiled
def gap(force, radius, p):
    """Gap at which a contact bears `force` > -F_adh: the inverse of `force`, Eq. 13 as it stands."""
    growth = radius ** (1.0 / 3.0) if radius != 1.0 else 1.0
    cube = 0.5 * (1.0 + sqrt(1.0 + force / (p.pull_off_force * radius)))
    return p.indentation * growth * cube ** (1.0 / 3.0) * (4.0 - 6.0 * cube) / 3.0


EFFECT = ContactLaw(JKR, JKRKernel, force, gap, pull_off_gap, pull_off_force, equilibrium)
