"""Similarity: the dimensionless groups that an encounter depends on, and how each goes with size of primaries and stress.

In reduced units (a, 1/g, 6 pi mu a^2 g) the parameters of the effects are numbers: pull-off force, indentation,
strength and range of attraction and so on, each over the unit that it has.  With the level of hydrodynamics, the
numerics and the kind of flow, which are dimensionless from the start, they are all that an encounter knows of its
scene.  Two scenes of equal groups have the same outcomes, encounter by encounter, whatever their radius, viscosity
and rate: lengths go with a, times with 1/g.

For a given material each group is a power of the radius and of the shear stress mu g; its exponents say what becomes
of it at other conditions.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from mcdem.effects.kinds import ContactLaw, PairForce, Resistance
from mcdem.quantities.reduced_units import ReducedUnits

if TYPE_CHECKING:
    from mcdem.scene import Scene

STEP = 1e-4
"""Relative change by which exponents are taken; they are rounded to its square."""
COHESION, ATTRACTION = "cohesion_number", "attraction_number"


class Group(NamedTuple):
    """A dimensionless group of a scene, and its powers of the radius a and of the stress mu g for the scene's material."""

    value: float
    radius: float
    stress: float


def groups(scene: Scene) -> dict[str, Group]:
    """Every group that the effects of a scene make, by name: `jkr.pull_off_force`, `van_der_waals.strength` ...

    The cohesion number 6 pi mu a^2 g/F_adh and the attraction number A_H/(36 pi mu g a^3) come first, where there are such.
    """
    now = _values(scene)
    found = {}
    for name, value in now.items():
        powers = []
        for radius, stress in ((1.0, 0.0), (0.0, 1.0)):
            up, down = (
                _values(scene, (1 + s * STEP) ** radius, (1 + s * STEP) ** stress)[name] for s in (1, -1)
            )
            slope = 0.0
            if value != 0.0 and up / value > 0 and down / value > 0:
                slope = (math.log(up / value) - math.log(down / value)) / (2 * math.atanh(STEP))
            powers.append(round(slope, 6))
        found[name] = Group(value, *powers)
    return found


def _values(scene: Scene, radius: float = 1.0, stress: float = 1.0) -> dict[str, float]:
    """Groups of the scene's material at a radius and a stress that are so many times the scene's."""
    unit, suspension = scene.reduced, scene.suspension
    units = ReducedUnits(unit.length * radius, unit.time, unit.force * radius**2 * stress)
    changed = suspension.model_copy(update={"radius": suspension.radius * radius})
    effects = scene.effects
    found: dict[str, float] = {}
    if effects.contact is not None:
        found[COHESION] = units.force / effects.contact.pull_off_force(units.length)
    if effects.attraction is not None:
        found[ATTRACTION] = effects.attraction.number(scene.flow.shear_stress * stress, changed.radius)
    kernels = effects.kernels(units, changed)
    contact = [] if kernels.contact is None else [kernels.contact]
    for kind, of_kind in (
        (PairForce, kernels.pair_forces),
        (ContactLaw, contact),
        (Resistance, kernels.resistances),
    ):
        for name, kernel in zip(effects.present(kind), of_kind, strict=True):
            for field in kernel._fields:
                value = getattr(kernel, field)
                if isinstance(value, int | float):
                    found[f"{name}.{field}"] = float(value)
    return found


def unlike(one: Scene, other: Scene, tolerance: float = 1e-9) -> list[str]:
    """What two scenes differ in that an encounter depends on, in words; empty where they are similar.

    Parameters
    ----------
    tolerance : relative, of a group's value
    """
    found = []
    for table in ("hydrodynamics", "numerics"):
        if getattr(one, table) != getattr(other, table):
            found.append(f"[{table}]")
    flows = [(s.flow.kind, s.flow.alpha, s.flow.gradient) for s in (one, other)]
    if flows[0] != flows[1]:
        found.append("kind of flow")
    ratios = [
        None
        if s.suspension.radii is None
        else (tuple(r / s.suspension.radius for r in s.suspension.radii), s.suspension.number_fractions)
        for s in (one, other)
    ]
    if ratios[0] != ratios[1]:
        found.append("radii of primaries")
    first, second = groups(one), groups(other)
    for name in first.keys() | second.keys():
        a, b = first.get(name), second.get(name)
        if a is None or b is None:
            found.append(f"{name} in one alone")
        elif not math.isclose(a.value, b.value, rel_tol=tolerance, abs_tol=1e-300):
            found.append(f"{name} {a.value:.6g} and {b.value:.6g}")
    return sorted(found)
