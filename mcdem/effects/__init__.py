"""Direct forces between primary particles: these add.

One effect a file: its source, its table in a scene, its parameters in reduced units and its compiled force.  An effect that the
scene does not name is `None`, and compiled code drops what belongs to it.

Compiled forces return (F, dF/dh) along the line of centres, F > 0 repelling, as a function of the surface gap `h` and of the
harmonic mean `radius` 2 a1 a2/(a1 + a2) of the two spheres: 1 for two primaries of radius a.
"""

from __future__ import annotations

from numba import njit

from mcdem.effects.effect import Effect
from mcdem.effects.jkr import JKR
from mcdem.effects.jkr import force as jkr_force
from mcdem.effects.van_der_waals import VanDerWaals
from mcdem.effects.van_der_waals import force as van_der_waals_force

__all__ = ["JKR", "Effects", "VanDerWaals", "contact_force", "non_contact_force"]


class Effects(Effect):
    """Table `[effects]`: each effect that the scene calls for, with all its parameters; the others are absent."""

    van_der_waals: VanDerWaals | None = None
    jkr: JKR | None = None


@njit(cache=True)
def non_contact_force(h, radius, van_der_waals, double_layer, short_range):
    """(F, dF/dh) of two spheres not in contact: the sum over the kernels that are not None."""
    force, slope = 0.0, 0.0
    if van_der_waals is not None:
        f, s = van_der_waals_force(h, radius, van_der_waals)
        force += f
        slope += s
    return force, slope


@njit(cache=True)
def contact_force(h, radius, jkr, dmt):
    """(F, dF/dh) of two spheres in contact: the one contact law that is not None; no force where there is none."""
    if jkr is not None:
        return jkr_force(h, radius, jkr)
    return 0.0, 0.0
