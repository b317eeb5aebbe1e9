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

import csv
import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from mcdem.effects.kinds import ContactLaw, PairForce, Resistance
from mcdem.errors import UserError
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


def sensitivities(scene: Scene, path: Path | str) -> dict[str, dict[str, float]]:
    """How outcomes go with each group: d ln(outcome)/d ln(group), from what `mcdem sensitivity` wrote (.csv).

    Of each key of the scene whose change moved one group alone (and what is the same power of it); of outcomes that moved by
    more than two standard errors.  Where a key has several values, the one that moves the group least counts.

    Parameters
    ----------
    scene : that the sensitivities are of
    path : table of `mcdem sensitivity`

    Raises
    ------
    UserError : of a file that is no such table
    """
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as problem:
        raise UserError(
            f"{path}: cannot be read ({problem}); expected the table that mcdem sensitivity wrote"
        ) from None
    if not rows or not {"setting", "quantity", "as_given", "changed", "standard_error"} <= rows[0].keys():
        raise UserError(f"{path}: no table of sensitivities; expected the .csv that mcdem sensitivity wrote")
    own, moved = groups(scene), dict[str, tuple[str, float] | None]()
    found: dict[str, dict[str, float]] = {}
    nearest: dict[tuple[str, str], float] = {}
    for row in rows:
        setting = row["setting"]
        if setting not in moved:
            moved[setting] = _moved(scene, own, setting)
        group = moved[setting]
        given, changed, error = (float(row[c]) for c in ("as_given", "changed", "standard_error"))
        if group is None or given <= 0 or changed <= 0 or abs(changed - given) <= 2 * error:
            continue
        name, log_ratio = group
        at = (name, row["quantity"])
        if abs(log_ratio) < nearest.get(at, math.inf):
            nearest[at] = abs(log_ratio)
            found.setdefault(name, {})[row["quantity"]] = math.log(changed / given) / log_ratio
    return found


def _moved(scene: Scene, own: dict[str, Group], setting: str) -> tuple[str, float] | None:
    """The group that a setting `key = value` moves, and the logarithm of its ratio; None where it moves none or several.

    Others may move with it that follow from it and from N: their powers of radius and stress are those of the group, times the
    ratio of the logarithms, and of N.  So the modulus of a contact moves its indentation, and the stiffness that goes with
    the inverse of that.
    """
    key, _, text = setting.partition(" = ")
    if not text or text == "none" or key.partition(".")[0] != "effects":
        return None
    there = groups(scene.with_changes({key: text}))
    ratios = {
        name: math.log(there[name].value / group.value)
        for name, group in own.items()
        if name in there and group.value and there[name].value / group.value > 0
    }
    ratios = {name: ratio for name, ratio in ratios.items() if abs(ratio) > 1e-9}
    if not ratios:
        return None
    leading, ratio = next(iter(ratios.items()))
    for name, other in ratios.items():
        power = other / ratio
        left = [own[name][k] - power * own[leading][k] for k in (1, 2)]
        unit = own[COHESION][1:] if COHESION in own and COHESION not in ratios else (0.0, 0.0)
        # Proportional to the powers of N, or nothing left where N itself moved.
        if max(map(abs, left)) > 1e-4 and (
            not any(unit) or abs(left[0] * unit[1] - left[1] * unit[0]) > 1e-4 * max(map(abs, unit))
        ):
            return None
    return leading, ratio


def conditions_of_file(path: Path | str) -> dict[str, object]:
    """What a balance may ask of a scene file: its conditions and groups, in plain types.

    Returns
    -------
    radius [m], viscosity [Pa s], shear_rate [1/s], volume_fraction, and groups: {name: (value, power of radius, power of stress)}

    Raises
    ------
    UserError : of a file that is no scene, or a flow other than simple shear
    """
    from mcdem.scene import load_scene

    scene = load_scene(Path(path))
    if scene.flow.kind != "simple_shear":
        raise UserError(
            f'{path}: flow.kind = "{scene.flow.kind}": a table for the balance counts meetings in simple shear'
        )
    scene.require_one_radius("a table for the balance counts equal primaries")
    return {
        "radius": scene.suspension.radius,
        "viscosity": scene.flow.viscosity,
        "shear_rate": scene.flow.shear_rate,
        "volume_fraction": scene.suspension.volume_fraction,
        "groups": {name: tuple(group) for name, group in groups(scene).items()},
    }
