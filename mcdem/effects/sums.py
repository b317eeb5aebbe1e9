"""The laws of all effects of a scene, summed in compiled code.

Compiled code holds the parameters of what a scene calls for and nothing else: a tuple of those of the pair forces, those of the
contact law or None, a tuple of those of the resistances.  Which law belongs to which parameters is looked up by their type, when
the code is compiled; an effect that is absent leaves nothing behind.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from mcdem.compilation import compiled
from mcdem.effects.kinds import Effect

_EFFECT_OF: dict[type, Any] = {}


def know(effect: Effect) -> None:
    """Let compiled code find the laws of an effect by the type of its parameters."""
    _EFFECT_OF[effect.kernel] = effect


def effect_of(parameters: Any) -> Any:
    """The effect whose parameters have this numba type."""
    return _EFFECT_OF[parameters.instance_class]


def is_absent(parameters: Any) -> bool:
    """Whether this numba type is that of None."""
    return not hasattr(parameters, "instance_class")


def _force_of(h, radius, parameters):
    raise NotImplementedError("compiled code only")


@overload(_force_of)
def _(h, radius, parameters):
    law = effect_of(parameters).force
    return lambda h, radius, parameters: law(h, radius, parameters)


def _add_forces(h, radius, pair_forces, force, slope):
    raise NotImplementedError("compiled code only")


@overload(_add_forces)
def _(h, radius, pair_forces, force, slope):
    if len(pair_forces) == 0:
        return lambda h, radius, pair_forces, force, slope: (force, slope)

    def add_first(h, radius, pair_forces, force, slope):
        f, s = _force_of(h, radius, pair_forces[0])
        return _add_forces(h, radius, pair_forces[1:], force + f, slope + s)

    return add_first


@compiled
def non_contact_force(h, radius, pair_forces):
    """(F, dF/dh) of two spheres not in contact: the sum over the pair forces of a scene."""
    return _add_forces(h, radius, pair_forces, 0.0, 0.0)


def _contact_force(h, radius, contact):
    raise NotImplementedError("compiled code only")


@overload(_contact_force)
def _(h, radius, contact):
    if is_absent(contact):
        return lambda h, radius, contact: (0.0, 0.0)
    law = effect_of(contact).force
    return lambda h, radius, contact: law(h, radius, contact)


@compiled
def contact_force(h, radius, contact):
    """(F, dF/dh) of two spheres in contact; no force where the scene has no contact law."""
    return _contact_force(h, radius, contact)


def _contact_gap(force, radius, contact):
    raise NotImplementedError("compiled code only")


@overload(_contact_gap)
def _(force, radius, contact):
    if is_absent(contact):
        return lambda force, radius, contact: -np.inf
    law = effect_of(contact).gap
    return lambda force, radius, contact: law(force, radius, contact)


@compiled
def contact_gap(force, radius, contact):
    """Gap at which a contact bears `force`, compression > 0; without bound where there are no contacts."""
    return _contact_gap(force, radius, contact)


def _pull_off_gap(radius, contact):
    raise NotImplementedError("compiled code only")


@overload(_pull_off_gap)
def _(radius, contact):
    if is_absent(contact):
        return lambda radius, contact: 0.0
    law = effect_of(contact).pull_off_gap
    return lambda radius, contact: law(radius, contact)


@compiled
def contact_pull_off_gap(radius, contact):
    """Gap beyond which a contact is lost."""
    return _pull_off_gap(radius, contact)


def _pull_off_force(radius, contact):
    raise NotImplementedError("compiled code only")


@overload(_pull_off_force)
def _(radius, contact):
    if is_absent(contact):
        return lambda radius, contact: 0.0
    law = effect_of(contact).pull_off_force
    return lambda radius, contact: law(radius, contact)


@compiled
def contact_pull_off_force(radius, contact):
    """Largest tension that a contact bears."""
    return _pull_off_force(radius, contact)


def _equilibrium(radius, contact):
    raise NotImplementedError("compiled code only")


@overload(_equilibrium)
def _(radius, contact):
    if is_absent(contact):
        return lambda radius, contact: (0.0, 0.0)
    law = effect_of(contact).equilibrium
    return lambda radius, contact: law(radius, contact)


@compiled
def contact_equilibrium(radius, contact):
    """(gap, stiffness) of a contact without load."""
    return _equilibrium(radius, contact)


def _limits_of(radius, resistances, limits):
    raise NotImplementedError("compiled code only")


@overload(_limits_of)
def _(radius, resistances, limits):
    if len(resistances) == 0:
        return lambda radius, resistances, limits: None
    law = effect_of(resistances[0]).limits

    def first_and_others(radius, resistances, limits):
        law(radius, resistances[0], limits)
        _limits_of(radius, resistances[1:], limits)

    return first_and_others


@compiled
def contact_limits(radius, resistances, limits):
    """Largest lengths of the three springs of a contact, [0:3], [3:6] and [6], into `limits` (3, 2).

    Each as (that without load, its growth per unit of compression); inf where nothing limits a spring or none is kept.
    """
    limits[:, 0] = np.inf
    limits[:, 1] = 0.0
    _limits_of(radius, resistances, limits)


def _resist(turned, resistances, response, code):
    raise NotImplementedError("compiled code only")


@overload(_resist)
def _(turned, resistances, response, code):
    if len(resistances) == 0:
        return lambda turned, resistances, response, code: code
    law = effect_of(resistances[0]).resist

    def first_and_others(turned, resistances, response, code):
        found = law(turned, resistances[0], response)
        return _resist(turned, resistances[1:], response, code | found)

    return first_and_others


@compiled
def contact_resistance(turned, resistances, response):
    """Springs, loads (7,) and stiffness (7, 7) of a contact after a motion; see `tangential` for its use.

    Returns which springs are at their limits (SLIDES, ROLLS, TWISTS), or STUCK.
    """
    response.spring[:] = 0.0
    response.loads[:] = 0.0
    response.tangent[:] = 0.0
    return _resist(turned, resistances, response, 0)


def _fixed_in_spheres(resistances):
    raise NotImplementedError("compiled code only")


@overload(_fixed_in_spheres)
def _(resistances):
    fixed = any(effect_of(one).fixed_in_spheres for one in resistances)
    return lambda resistances: fixed


@compiled
def fixed_in_spheres(resistances):
    """Whether the springs of contacts turn about the line of centres with their spheres, not with the pair."""
    return _fixed_in_spheres(resistances)
