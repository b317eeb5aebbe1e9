"""What a level of hydrodynamics is: the contract, and the compiled functions that serve all of them.

    R (u - u_inf) = F + strain_load

A file of this package states its level as `LEVEL`.  Compiled code holds the parameters of the level that a scene chooses, and
its functions are looked up by their type when the code is compiled: a coarser level leaves nothing of a finer one behind.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numba.extending import overload

from mcdem.compilation import compiled


@dataclass(frozen=True)
class Level:
    """A level of hydrodynamics; work arrays are those of `resistance.workspace`, radii (N,).

    parameters : NamedTuple of what it needs
    build : (cut-off over a, whether the strain sees the cut-off too, radii over a) -> its parameters
    resistance : compiled, (parameters, work, radii) -> 0 or an error code; that without the two-body part into `work.resistance`
    strain_load : compiled, (parameters, work, strain (5,)); what it exerts, into `work.strain_load`, after `resistance`
    two_body : compiled, (parameters, work, radii, strain (3, 3)) adds the two-body part to both
    stresslets : compiled, (parameters, work, radii, rates (6N,), strain (5,), out (N, 5)); those exerted on the fluid
    two_body_of_strains : compiled, (parameters, work, radii, strains (5, 5), strain_loads (5, 6N)), `two_body` of five at once
    squeeze : gap over a -> resistance over 6 pi mu a to changing the gap of two spheres that are this near, for estimates
    stresslet_couplings : whether spheres interact through their stresslets too, so that a far field is
        worth keeping and rigid aggregates may approach as bodies with a stresslet;  lubrication : whether pairs have it
    """

    parameters: type
    build: Callable[..., Any]
    resistance: Callable[..., Any]
    strain_load: Callable[..., Any]
    two_body: Callable[..., Any]
    stresslets: Callable[..., Any]
    squeeze: Callable[[float], float]
    two_body_of_strains: Callable[..., Any] | None = None
    stresslet_couplings: bool = False
    lubrication: bool = False


@compiled
def no_strain_load(level, work, strain_five):
    """Strain exerts nothing on spheres held still."""
    work.strain_load[:] = 0.0


@compiled
def no_two_body(level, work, radii, strain):
    """Pairs have no two-body part."""


@compiled
def no_two_body_of_strains(level, work, radii, strains, strain_loads):
    """Pairs have no two-body part."""


@compiled
def single_stresslets(level, work, radii, rates, strain_five, out):
    """Stresslets of single spheres, -10/9 a^3 E exerted on the fluid, into out (N, 5)."""
    for i in range(radii.shape[0]):
        for k in range(5):
            out[i, k] = -10.0 / 9.0 * radii[i] ** 3 * strain_five[k]


_LEVEL_OF: dict[type, Level] = {}


def know(level: Level) -> None:
    """Let compiled code find the functions of a level by the type of its parameters."""
    _LEVEL_OF[level.parameters] = level


def level_of(parameters: Any) -> Level:
    """The level whose parameters have this numba type."""
    return _LEVEL_OF[parameters.instance_class]


def _resistance(level, work, radii):
    raise NotImplementedError("compiled code only")


@overload(_resistance, inline="always")
def _(level, work, radii):
    own = level_of(level).resistance
    return lambda level, work, radii: own(level, work, radii)


@compiled
def resistance(level, work, radii):
    """Resistance without the two-body part into `work.resistance`; 0 or an error code."""
    return _resistance(level, work, radii)


def _strain_load(level, work, strain_five):
    raise NotImplementedError("compiled code only")


@overload(_strain_load, inline="always")
def _(level, work, strain_five):
    own = level_of(level).strain_load
    return lambda level, work, strain_five: own(level, work, strain_five)


@compiled
def strain_load(level, work, strain_five):
    """What a uniform strain (5,) exerts on spheres held still into `work.strain_load`, after `resistance`."""
    _strain_load(level, work, strain_five)


def _two_body(level, work, radii, strain):
    raise NotImplementedError("compiled code only")


@overload(_two_body, inline="always")
def _(level, work, radii, strain):
    own = level_of(level).two_body
    return lambda level, work, radii, strain: own(level, work, radii, strain)


@compiled
def two_body(level, work, radii, strain):
    """Add the two-body part of every pair to the resistance and to what a strain (3, 3) exerts."""
    _two_body(level, work, radii, strain)


def _two_body_of_strains(level, work, radii, strains, strain_loads):
    raise NotImplementedError("compiled code only")


@overload(_two_body_of_strains, inline="always")
def _(level, work, radii, strains, strain_loads):
    own = level_of(level).two_body_of_strains or no_two_body_of_strains
    return lambda level, work, radii, strains, strain_loads: own(level, work, radii, strains, strain_loads)


@compiled
def two_body_of_strains(level, work, radii, strains, strain_loads):
    """Add the two-body part of every pair to the resistance and to the strain_loads (5, 6N) of five strains (5, 5)."""
    _two_body_of_strains(level, work, radii, strains, strain_loads)


def _stresslets(level, work, radii, rates, strain_five, out):
    raise NotImplementedError("compiled code only")


@overload(_stresslets, inline="always")
def _(level, work, radii, rates, strain_five, out):
    own = level_of(level).stresslets
    return lambda level, work, radii, rates, strain_five, out: own(
        level, work, radii, rates, strain_five, out
    )


@compiled
def stresslets(level, work, radii, rates, strain_five, out):
    """Stresslets exerted on the fluid into out (N, 5), from rates (6N,) of spheres in a strain (5,).

    `work` holds the factor of `resistance` and what `strain_load` left of the same strain; the latter is used up.
    """
    _stresslets(level, work, radii, rates, strain_five, out)
