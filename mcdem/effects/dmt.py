"""Adhesive elastic contact of Derjaguin, Muller & Toporov (1975), for stiff and weakly adhering spheres (small Tabor number).

Source: Derjaguin, Muller & Toporov, J. Colloid Interface Sci. 53, 314 (1975), in the form of Maugis (1992): the attraction acts
outside the contact and leaves its profile that of Hertz,

    F = 4/3 E* R*^(1/2) (-h)^(3/2) - F_adh,     F_adh = 2 pi gamma a_eff,     R* = a_eff/2,

so the pull-off force is 4/3 of the JKR one and the contact is lost where it was made, at h = 0: no hysteresis.

Exact tests: pull-off force over JKR's is 4/3; F + F_adh is Hertz' force; the stiffness at equilibrium is 3/2 F_adh/(-h_eq).
"""

from __future__ import annotations

from math import pi, sqrt
from typing import ClassVar, NamedTuple

from mcdem.compilation import compiled
from mcdem.effects.elastic_contact import ElasticContact
from mcdem.effects.kinds import Companions, ContactLaw
from mcdem.quantities.reduced_units import ReducedUnits
from mcdem.quantities.suspension import Suspension


class DMT(ElasticContact):
    """Adhesive elastic contacts of stiff particles, without hysteresis."""

    title: ClassVar[str] = "DMT"
    friction_share: ClassVar[float] = 1.0
    tabor_numbers: ClassVar[tuple[float, float]] = (0.0, 0.1)

    def pull_off_force(self, radius: float) -> float:
        """F_adh [N] of two spheres of `radius` [m]."""
        return 2.0 * pi * self.surface_energy * radius

    def contact_radius(self, radius: float) -> float:
        """b0 [m], without load, of two spheres of `radius` [m]: 4/3 E* b0^3/R* = F_adh."""
        return float((0.375 * self.pull_off_force(radius) * radius / self.reduced_modulus) ** (1.0 / 3.0))

    def kernel(self, units: ReducedUnits, suspension: Suspension, effects: Companions) -> DMTKernel:
        """The parameters in reduced units, for two primaries of radius a."""
        self.require_small_contact(suspension, "dmt")
        pull_off_force = self.pull_off_force(units.length) / units.force
        equilibrium_gap = -2.0 * (self.contact_radius(units.length) / units.length) ** 2
        return DMTKernel(
            pull_off_force=pull_off_force,
            modulus=pull_off_force / (-equilibrium_gap) ** 1.5,
            pull_off_gap=0.0,
            equilibrium_gap=equilibrium_gap,
            equilibrium_stiffness=-1.5 * pull_off_force / equilibrium_gap,
        )


class DMTKernel(NamedTuple):
    """Parameters of `force`, for a_eff = 1; each names the power of a_eff with which it grows."""

    pull_off_force: float
    """F_adh ~ a_eff"""
    modulus: float
    """4/3 E* 2^(-1/2) [force/length^2]"""
    pull_off_gap: float
    """0"""
    equilibrium_gap: float
    """h_eq < 0, where F = 0, ~ a_eff^(1/3)"""
    equilibrium_stiffness: float
    """-dF/dh at h_eq, ~ a_eff^(2/3)"""


@compiled
def force(h, radius, p):
    """Force (F, dF/dh) of a contact at gap `h` between spheres of harmonic mean radius `radius`; F > 0 repels.

    Beyond the pull-off gap F = -F_adh and dF/dh = 0: continuous, so that an iteration may step across it.
    """
    pull_off_force = p.pull_off_force * radius
    if h >= 0.0:
        return -pull_off_force, 0.0
    slope = p.modulus * radius * sqrt(-h / radius)
    return -slope * h - pull_off_force, -1.5 * slope


@compiled
def pull_off_gap(radius, p):
    """Gap beyond which a contact is lost: where it was made."""
    return 0.0


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
    """Gap at which a contact bears `force` > -F_adh: the inverse of `force`."""
    return -(((force + p.pull_off_force * radius) / (p.modulus * sqrt(radius))) ** (2.0 / 3.0))


EFFECT = ContactLaw(DMT, DMTKernel, force, gap, pull_off_gap, pull_off_force, equilibrium)
