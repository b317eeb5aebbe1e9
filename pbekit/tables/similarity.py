"""A table at other dimensional conditions: what it says holds wherever its dimensionless groups are the same.

Lengths of a table go with the radius a of its primaries, times with 1/g; its outcomes depend on groups alone,
foremost the cohesion number N = 6 pi mu a^2 g/F_adh.  For the table's material every group is a power of the radius
and of the stress mu g, which the table keeps (`about["groups"]`).  So the conditions asked for have their groups,
too, and they are compared: an N that differs is refused, or interpolated to between tables; others that differ are
said, with what is known of how much they matter (`about["sensitivities"]`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from pbekit.arguments import number
from pbekit.errors import PBEError
from pbekit.tables.kernel_table import KernelTable

COHESION = "cohesion_number"
SAME = 1e-6
"""Relative difference of a group up to which it is the same."""


class Group(NamedTuple):
    """A dimensionless group, and its powers of the radius and of the stress for the table's material."""

    value: float
    radius: float
    stress: float


@dataclass(frozen=True)
class Conditions:
    """Dimensional conditions of a suspension in shear.

    Parameters
    ----------
    radius : of its primaries [m]
    viscosity : of the medium [Pa s]
    shear_rate : [1/s]
    cohesion : N of its contacts; that of the table's material at these conditions where it is None
    groups : all dimensionless groups there, by name, of a material of its own (`pbekit.scenes`); None for the table's

    Examples
    --------
    >>> import pbekit
    >>> water = pbekit.Conditions(radius=0.5e-6, viscosity=1e-3, shear_rate=1e4)
    >>> water.viscosity * water.shear_rate
    10.0
    """

    radius: float
    viscosity: float
    shear_rate: float
    cohesion: float | None = None
    groups: Mapping[str, Group] | None = None

    def __post_init__(self) -> None:
        number("radius", self.radius, 1e-10, 1.0, "a radius of primaries in m")
        number("viscosity", self.viscosity, 1e-9, 1e9, "a viscosity in Pa s")
        number("shear rate", self.shear_rate, 1e-9, 1e12, "a shear rate in 1/s")
        if self.cohesion is not None:
            number("cohesion number", self.cohesion, 1e-12, 1e12)

    @property
    def stress(self) -> float:
        """Shear stress mu g [Pa]."""
        return self.viscosity * self.shear_rate


def conditions_of(table: KernelTable) -> Conditions:
    """Those at which a table was made; raises `PBEError` where it does not say its viscosity."""
    if "viscosity" not in table.about:
        raise PBEError("the table does not say its viscosity, so it cannot be used at other conditions")
    return Conditions(table.radius, float(table.about["viscosity"]), table.shear_rate)


def elsewhere(
    table: KernelTable,
    radius: float | None = None,
    viscosity: float | None = None,
    shear_rate: float | None = None,
    cohesion: float | None = None,
) -> Conditions:
    """Those of a table, where no other value is given."""
    own = conditions_of(table)
    return Conditions(
        own.radius if radius is None else radius,
        own.viscosity if viscosity is None else viscosity,
        own.shear_rate if shear_rate is None else shear_rate,
        cohesion,
    )


def groups_of(table: KernelTable) -> dict[str, Group]:
    """The groups that a table is of, by name; raises `PBEError` where it does not say them."""
    if "groups" not in table.about:
        raise PBEError(
            "the table does not say its dimensionless groups (it is of an older version): make it again with mcdem kernels"
        )
    return {name: Group(*values) for name, values in json.loads(str(table.about["groups"])).items()}


def groups_at(table: KernelTable, conditions: Conditions) -> dict[str, Group]:
    """Groups of the table's material at other conditions, or the conditions' own; N is theirs where they state one."""
    if conditions.groups is not None:
        return dict(conditions.groups)
    own = conditions_of(table)
    a, s = conditions.radius / own.radius, conditions.stress / own.stress
    found = {
        name: group._replace(value=group.value * a**group.radius * s**group.stress)
        for name, group in groups_of(table).items()
    }
    if conditions.cohesion is not None and COHESION in found:
        found[COHESION] = found[COHESION]._replace(value=conditions.cohesion)
    return found


def rescaled(table: KernelTable, conditions: Conditions) -> KernelTable:
    """The table with its lengths and times at other conditions, its outcomes as they are."""
    length, time = conditions.radius / table.radius, table.shear_rate / conditions.shear_rate
    about = {
        **table.about,
        "viscosity": conditions.viscosity,
        "shear_stress": conditions.stress,
        "made_at": json.dumps([table.radius, float(table.about["viscosity"]), table.shear_rate]),
    }
    return replace(
        table,
        records=table.records.scaled(length, time),
        radius=conditions.radius,
        shear_rate=conditions.shear_rate,
        about=about,
    )


def at_conditions(
    tables: Sequence[KernelTable], conditions: Conditions
) -> tuple[list[KernelTable], float | None, list[str]]:
    """Tables used at other conditions.

    Parameters
    ----------
    tables : one, or several at different cohesion numbers
    conditions : at which the balance is wanted

    Returns
    -------
    The tables at these conditions; the stress [Pa] to interpolate to between them, or None where one is of the cohesion
    number asked for; and lines that say what is assumed.  Of several, viscosities are such that their stresses are in
    proportion to their cohesion numbers, so that an interpolation in stress is one in N.

    Raises
    ------
    PBEError : of a cohesion number that no table is of, nor two lie about
    """
    first = tables[0]
    wanted = groups_at(first, conditions)
    if COHESION not in wanted:
        raise PBEError("the table is of a suspension without contacts, and has no cohesion number to compare")
    n = wanted[COHESION].value
    own = [groups_of(table)[COHESION].value for table in tables]
    exact = [k for k, known in enumerate(own) if abs(known / n - 1) <= SAME]
    if not exact and not (len(tables) > 1 and min(own) < n < max(own)):
        cure = _cure(first, conditions)
        known = ", ".join(f"{value:.4g}" for value in sorted(own))
        raise PBEError(
            f"cohesion number N = {n:.4g} at radius {conditions.radius:g} m, viscosity {conditions.viscosity:g} Pa s and "
            f"shear rate {conditions.shear_rate:g} 1/s: expected "
            f"{known if len(own) == 1 else f'one between those of the tables ({known})'}; {cure}"
        )
    lines = _assumed(first, conditions, n)
    if exact:
        return [rescaled(tables[exact[0]], conditions)], None, lines
    moved = [
        rescaled(table, replace(conditions, viscosity=conditions.viscosity * known / n))
        for table, known in zip(tables, own, strict=True)
    ]
    return moved, conditions.stress, lines


def _cure(table: KernelTable, conditions: Conditions) -> str:
    """The shear rate that keeps the table's cohesion number, or how to state another."""
    group, own = groups_of(table)[COHESION], conditions_of(table)
    if conditions.groups is not None:
        there = conditions.groups[COHESION]
        if there.stress == 0:
            return "beyond them nothing is known"
        kept = conditions.shear_rate * (group.value / there.value) ** (1.0 / there.stress)
        return f"a shear rate of {kept:.6g} 1/s gives the scene the table's"
    if conditions.cohesion is not None or group.stress == 0:
        return "beyond them nothing is known"
    kept = (
        (conditions.radius / own.radius) ** (-group.radius / group.stress) * own.stress / conditions.viscosity
    )
    return (
        f"a shear rate of {kept:.6g} 1/s keeps it for the table's material; give --cohesion for another "
        "material, or tables on both "
        "sides"
    )


def _assumed(table: KernelTable, conditions: Conditions, cohesion: float) -> list[str]:
    """What differs between the table's groups and those at the conditions, and how much that matters."""
    lines = [
        f"N = {cohesion:.4g} at {conditions.radius * 1e9:g} nm, {conditions.viscosity:g} Pa s and {conditions.shear_rate:g} 1/s"
        + (
            ", of the scene"
            if conditions.groups is not None
            else " as stated"
            if conditions.cohesion is not None
            else ", for the material of the table"
        )
    ]
    if conditions.cohesion is not None:
        lines.append("all other groups are taken to be the table's: nothing is known of the material")
        return lines
    before, after = groups_of(table), groups_at(table, conditions)
    slopes = json.loads(str(table.about.get("sensitivities", "{}")))
    unknown: list[str] = []
    named: list[Group] = []
    for name, group in before.items():
        if name not in after:
            lines.append(f"{name} is of the table alone, {group.value:.4g}: the scene has other effects")
            continue
        factor = after[name].value / group.value if group.value else 1.0
        if name == COHESION or abs(factor - 1) <= SAME:
            continue
        # What goes with N, or with N and a group that was named, says nothing new of one material.
        of_one = conditions.groups is None and COHESION in before
        if of_one and name not in slopes and _follows(group, named, before[COHESION]):
            continue
        named.append(group)
        line = f"{name} would be {after[name].value:.4g}, the table has {group.value:.4g} and is used with it"
        known = slopes.get(name) if factor > 0 else None
        if known:
            line += ": " + ", ".join(
                f"{quantity} goes with its power {power:.2g}, so by a factor of {factor**power:.2g}"
                for quantity, power in known.items()
            )
        else:
            unknown.append(name)
        lines.append(line)
    lines += [
        f"{name} is of the scene alone, {group.value:.4g}: the table has other effects"
        for name, group in after.items()
        if name not in before
    ]
    if unknown:
        lines.append(f"how much they matter was not measured (mcdem sensitivity): {', '.join(unknown)}")
    return lines


def _follows(group: Group, named: Sequence[Group], cohesion: Group) -> bool:
    """Whether the powers of a group are those of N to some power, alone or times one of the named groups or its inverse."""
    parts = [(0.0, 0.0)] + [(sign * g.radius, sign * g.stress) for g in named for sign in (1, -1)]
    for radius, stress in parts:
        left = group.radius - radius, group.stress - stress
        if abs(left[0] * cohesion.stress - left[1] * cohesion.radius) < 1e-5:
            return True
    return False
