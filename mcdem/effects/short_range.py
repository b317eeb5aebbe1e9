"""The repulsion that keeps spheres apart where a scene has no contact law: Born, steric, or both; these add."""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from mcdem.effects.born import BornKernel
from mcdem.effects.born import force as born_force
from mcdem.effects.steric import StericKernel
from mcdem.effects.steric import force as steric_force


class ShortRangeKernel(NamedTuple):
    """Parameters of `force`; what is absent is None."""

    born: BornKernel | None
    steric: StericKernel | None


@njit(cache=True)
def force(h, radius, p):
    """Force (F, dF/dh) at gap `h` between spheres of harmonic mean radius `radius`; F > 0 repels."""
    return sum_of_repulsions(h, radius, p.born, p.steric)


@njit(cache=True)
def sum_of_repulsions(h, radius, born, steric):
    """The same with the bundle opened: compiled code drops what is None only among a function's own arguments."""
    value, slope = 0.0, 0.0
    if born is not None:
        f, s = born_force(h, radius, born)
        value += f
        slope += s
    if steric is not None:
        f, s = steric_force(h, radius, steric)
        value += f
        slope += s
    return value, slope
