"""Direct forces between primary particles.

One effect a file: its source, its table in a scene, its parameters in reduced units and its compiled law.  An effect that the
scene does not name is `None`, and compiled code drops all that belongs to it.  How effects combine is said here, once:

    forces between spheres not in contact    these add: van der Waals, double layer, Born, steric
    the law of a contact                     choose one: JKR, DMT; or none, where Born or steric repulsion keeps spheres apart
    resistance of contacts                   these add: sliding, rolling, twisting; or rods instead of sliding and rolling

Forces return (F, dF/dh) along the line of centres, F > 0 repelling, as a function of the surface gap `h` and of the harmonic
mean `radius` 2 a1 a2/(a1 + a2) of the two spheres: 1 for two primaries of radius a.  A new effect is a file, a line in
`Effects` and in `Kernels`, and a line in one of the functions below.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numba import njit
from pydantic import model_validator

from mcdem.effects import rods as rods_law
from mcdem.effects import rolling as rolling_law
from mcdem.effects import sliding as sliding_law
from mcdem.effects import twisting as twisting_law
from mcdem.effects.born import Born
from mcdem.effects.dmt import DMT, DMTKernel
from mcdem.effects.dmt import force as dmt_force
from mcdem.effects.dmt import gap as dmt_gap
from mcdem.effects.double_layer import DoubleLayer, DoubleLayerKernel
from mcdem.effects.double_layer import force as double_layer_force
from mcdem.effects.jkr import JKR, JKRKernel
from mcdem.effects.jkr import force as jkr_force
from mcdem.effects.jkr import gap as jkr_gap
from mcdem.effects.rods import Rods, RodsKernel
from mcdem.effects.rolling import Rolling, RollingKernel
from mcdem.effects.short_range import ShortRangeKernel
from mcdem.effects.short_range import force as short_range_force
from mcdem.effects.sliding import Sliding, SlidingKernel
from mcdem.effects.steric import Steric
from mcdem.effects.tangential import STUCK
from mcdem.effects.twisting import Twisting, TwistingKernel
from mcdem.effects.van_der_waals import VanDerWaals, VanDerWaalsKernel
from mcdem.effects.van_der_waals import force as van_der_waals_force
from mcdem.quantities.toml_tables import Table

if TYPE_CHECKING:
    from mcdem.scene import Scene

__all__ = [
    "DMT",
    "JKR",
    "Born",
    "DoubleLayer",
    "Effects",
    "Kernels",
    "Rods",
    "Rolling",
    "Sliding",
    "Steric",
    "Twisting",
    "VanDerWaals",
    "contact_equilibrium",
    "contact_force",
    "contact_gap",
    "contact_limits",
    "contact_pull_off_force",
    "contact_pull_off_gap",
    "contact_resistance",
    "non_contact_force",
]


class Effects(Table):
    """Each effect that the scene calls for, with all its parameters; the others are absent."""

    van_der_waals: VanDerWaals | None = None
    double_layer: DoubleLayer | None = None
    born: Born | None = None
    steric: Steric | None = None
    jkr: JKR | None = None
    dmt: DMT | None = None
    sliding: Sliding | None = None
    rolling: Rolling | None = None
    twisting: Twisting | None = None
    rods: Rods | None = None

    @property
    def contact(self) -> JKR | DMT | None:
        """The law of a contact."""
        return self.jkr or self.dmt

    @property
    def resisting(self) -> bool:
        """Whether contacts resist sliding, rolling or twisting, so that they have a history."""
        return bool(self.sliding or self.rolling or self.twisting or self.rods)

    @model_validator(mode="after")
    def _effects_go_together(self) -> Self:
        if self.jkr and self.dmt:
            raise ValueError(
                "jkr and dmt are two laws of the same contact: keep one (JKR for a large Tabor number)"
            )
        for name in ("born", "steric"):
            if getattr(self, name) and self.contact:
                law = "jkr" if self.jkr else "dmt"
                raise ValueError(
                    f"{name} keeps spheres from the contact that {law} describes: keep one of them"
                )
        if self.born and not self.van_der_waals:
            raise ValueError(
                "born takes its Hamaker constant from van_der_waals: add [effects.van_der_waals]"
            )
        for name in ("sliding", "rolling", "twisting", "rods"):
            if getattr(self, name) and not self.contact:
                raise ValueError(f"{name} is a resistance of contacts: add a contact law, jkr or dmt")
        if self.rolling and not self.jkr:
            raise ValueError("rolling is a law of JKR contacts: use jkr, or rods, whose stiffness is given")
        if self.rods and (self.sliding or self.rolling):
            raise ValueError("rods resist sliding and rolling already: remove sliding and rolling, or rods")
        return self

    def kernels(self, scene: Scene) -> Kernels:
        """The parameters of all effects in reduced units; `None` is what the scene does not name."""
        kernel = {name: effect and effect.kernel(scene) for name, effect in self}
        born, steric = kernel.pop("born"), kernel.pop("steric")
        return Kernels(short_range=ShortRangeKernel(born, steric) if born or steric else None, **kernel)


class Kernels(NamedTuple):
    """Parameters of all effects, for compiled code; open it at the call, so that what is None is dropped."""

    van_der_waals: VanDerWaalsKernel | None
    double_layer: DoubleLayerKernel | None
    short_range: ShortRangeKernel | None
    jkr: JKRKernel | None
    dmt: DMTKernel | None
    sliding: SlidingKernel | None
    rolling: RollingKernel | None
    twisting: TwistingKernel | None
    rods: RodsKernel | None


@njit(cache=True)
def non_contact_force(h, radius, van_der_waals, double_layer, short_range):
    """(F, dF/dh) of two spheres not in contact: the sum over the kernels that are not None."""
    force, slope = 0.0, 0.0
    if van_der_waals is not None:
        f, s = van_der_waals_force(h, radius, van_der_waals)
        force += f
        slope += s
    if double_layer is not None:
        f, s = double_layer_force(h, radius, double_layer)
        force += f
        slope += s
    if short_range is not None:
        f, s = short_range_force(h, radius, short_range)
        force += f
        slope += s
    return force, slope


@njit(cache=True)
def contact_force(h, radius, jkr, dmt):
    """(F, dF/dh) of two spheres in contact: the one contact law that is not None; no force where there is none."""
    if jkr is not None:
        return jkr_force(h, radius, jkr)
    if dmt is not None:
        return dmt_force(h, radius, dmt)
    return 0.0, 0.0


@njit(cache=True)
def contact_gap(force, radius, jkr, dmt):
    """Gap at which a contact bears `force`, compression > 0; without bound where there are no contacts."""
    if jkr is not None:
        return jkr_gap(force, radius, jkr)
    if dmt is not None:
        return dmt_gap(force, radius, dmt)
    return -np.inf


@njit(cache=True)
def contact_pull_off_gap(radius, jkr, dmt):
    """Gap beyond which a contact is lost."""
    if jkr is not None:
        return jkr.pull_off_gap * (radius ** (1.0 / 3.0) if radius != 1.0 else 1.0)
    return 0.0


@njit(cache=True)
def contact_pull_off_force(radius, jkr, dmt):
    """Largest tension that a contact bears."""
    if jkr is not None:
        return jkr.pull_off_force * radius
    if dmt is not None:
        return dmt.pull_off_force * radius
    return 0.0


@njit(cache=True)
def contact_equilibrium(radius, jkr, dmt):
    """(gap, stiffness) of a contact without load."""
    growth = radius ** (1.0 / 3.0) if radius != 1.0 else 1.0
    if jkr is not None:
        return jkr.equilibrium_gap * growth, jkr.equilibrium_stiffness * growth * growth
    if dmt is not None:
        return dmt.equilibrium_gap * growth, dmt.equilibrium_stiffness * growth * growth
    return 0.0, 0.0


@njit(cache=True)
def contact_limits(radius, sliding, rolling, twisting, rods, limits):
    """Largest lengths of the three springs of a contact, [0:3], [3:6] and [6], into `limits` (3, 2).

    Each as (that without load, its growth per unit of compression); inf where nothing limits a spring or none is kept.
    """
    limits[:, 0] = np.inf
    limits[:, 1] = 0.0
    if sliding is not None:
        limits[0, 0], limits[0, 1] = sliding_law.limit(radius, sliding)
    if rolling is not None:
        limits[1, 0], limits[1, 1] = rolling_law.limit(radius, rolling)
    if twisting is not None:
        limits[2, 0], limits[2, 1] = twisting_law.limit(radius, twisting)
    if rods is not None:
        limits[0, 0], limits[0, 1] = rods_law.limit(radius, rods)
        limits[1, 0], limits[1, 1] = rods_law.limit(radius, rods)


@njit(cache=True)
def contact_resistance(
    carried,
    q,
    normal,
    distance,
    share_1,
    radius,
    normal_force,
    sliding,
    rolling,
    twisting,
    rods,
    spring,
    loads,
    tangent,
):
    """Springs, loads (7,) and stiffness (7, 7) of a contact after the turns `q`; `mcdem.effects.tangential` tells how to use it.

    `carried` are the springs before, carried to the middle of the step; `share_1` is the radius of sphere 1 over the sum of
    both; `normal_force` is F > 0 in compression.  Returns which springs are at their limits (SLIDES, ROLLS, TWISTS), or STUCK.
    """
    spring[:] = 0.0
    loads[:] = 0.0
    tangent[:] = 0.0
    code = STUCK
    if sliding is not None:
        code |= sliding_law.resist(
            carried, q, normal, distance, share_1, radius, normal_force, sliding, spring, loads, tangent
        )
    if rolling is not None:
        code |= rolling_law.resist(carried, q, normal, radius, rolling, spring, loads, tangent)
    if twisting is not None:
        code |= twisting_law.resist(carried, q, radius, normal_force, twisting, spring, loads, tangent)
    if rods is not None:
        code |= rods_law.resist(carried, q, normal, distance, radius, rods, spring, loads, tangent)
    return code
