"""What eta_11 of a scene rests on: the numerical step and the cut-off of lubrication; and what was found, in words.

The cut-off is a choice of the model and not of the numerics: the two conventions of what lies below it, a frozen matrix or a
frozen gap, differ where capture happens within it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mcdem.encounter.capture_efficiency import (
    PairEfficiency,
    attraction_number,
    critical_offset,
    initial_growth,
    pair_efficiency,
    van_de_ven_mason,
)
from mcdem.errors import UserError
from mcdem.hydrodynamics import LEVELS
from mcdem.quantities.toml_tables import choices

if TYPE_CHECKING:
    from rich.table import Table

    from mcdem.scene import Scene

STEPS = (2.0, 1.0, 0.5, 0.25)
"""Steps that are tried, over the scene's."""
CONVENTIONS = ("matrix", "gap")
"""What is frozen below the cut-off of lubrication."""
EQUATION_23_ABOVE = 1e-4
"""Attraction number above which the law of van de Ven & Mason is meant to hold."""

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class AtStep:
    """eta_11 and the critical offset y_c(0), over the primary radius, at one step."""

    step: float
    """In `unit`: that of the scene's key."""
    unit: str
    efficiency: float
    critical_offset: float


def against_steps(
    scene: Scene, factors: Sequence[float] = STEPS, progress: Progress = lambda state, share: None
) -> list[AtStep]:
    """eta_11 and y_c(0) for several steps of the scene's scheme.

    Parameters
    ----------
    factors : steps over the scene's, from coarse to fine
    progress : called with where it stands, in words, and the share of one step that is done
    """
    found = []
    for factor in factors:
        step = factor * scene.numerics.step
        changed = scene.model_copy(update={"numerics": scene.numerics.with_step(step)})
        found.append(
            AtStep(
                step,
                scene.numerics.step_unit,
                pair_efficiency(changed, progress=progress).efficiency,
                critical_offset(changed, 0.0) / scene.suspension.radius,
            )
        )
    return found


def steps_table(found: Sequence[AtStep]) -> Table:
    """The same as a table, each row with its change from the one above."""
    from rich.table import Table

    table = Table("step", "eta_11", "change", "y_c(0)/a", "change", title="against the step")
    before = None
    for at in found:
        row = (at.efficiency, at.critical_offset)
        changes = [f"{new / old - 1.0:+.2%}" for new, old in zip(row, before)] if before else ["", ""]
        table.add_row(f"{at.step:g}{at.unit}", f"{row[0]:.5f}", changes[0], f"{row[1]:.5f}", changes[1])
        before = row
    return table


@dataclass(frozen=True, eq=False)
class AtCutoff:
    """eta_11 with one cut-off of lubrication (a gap over the radius), for each of CONVENTIONS."""

    cutoff: float
    found: dict[str, PairEfficiency]


def against_cutoff(
    scene: Scene, cutoffs: Sequence[float], progress: Progress = lambda state, share: None
) -> list[AtCutoff]:
    """eta_11 for several cut-offs of lubrication and both conventions of what lies below them.

    Parameters
    ----------
    cutoffs : gaps over the radius, from 0 to below 1
    progress : called with where it stands, in words, and the share of one efficiency that is done

    Raises
    ------
    UserError : of a scene whose level of hydrodynamics has no lubrication
    """
    if not scene.hydrodynamics.lubrication:
        raise UserError(
            f'{scene.name}: [hydrodynamics] level = "{scene.hydrodynamics.level}" has no lubrication to cut off; '
            f"use level = {choices(LEVELS, 'lubrication')}, or leave out the cut-offs"
        )

    def under(cutoff: float, convention: str) -> PairEfficiency:
        changes = {"lubrication_cutoff": cutoff, "cutoff_convention": convention}
        hydrodynamics = scene.hydrodynamics.model_copy(update=changes)
        return pair_efficiency(scene.model_copy(update={"hydrodynamics": hydrodynamics}), progress=progress)

    return [
        AtCutoff(cutoff, {convention: under(cutoff, convention) for convention in CONVENTIONS})
        for cutoff in cutoffs
    ]


def cutoff_table(scene: Scene, found: Sequence[AtCutoff]) -> Table:
    """The same as a table, beside the law of van de Ven & Mason (Eq. 23 of Frungieri & Vanni 2021)."""
    from rich.table import Table

    heads = [head for convention in CONVENTIONS for head in (f"frozen {convention}", "over Eq. 23")]
    table, law = Table("delta", *heads, title="against the cut-off"), van_de_ven_mason(scene)
    for at in found:
        etas = [at.found[convention] for convention in CONVENTIONS]
        cells = [
            cell
            for eta in etas
            for cell in (f"{eta.efficiency:.5f} +- {eta.error:.5f}", f"{eta.efficiency / law:.3f}")
        ]
        table.add_row(f"{at.cutoff:g}", *cells)
    return table


def efficiency_report(scene: Scene, found: PairEfficiency, offset: float) -> list[str]:
    """eta_11 in words, with its errors, the critical offset y_c(0) [m], the growth it means (Eq. 22) and the law of Eq. 23."""
    attraction, law = attraction_number(scene), van_de_ven_mason(scene)
    lines = [
        f"eta_11 = {found.efficiency:.5f} +- {found.error:.5f}  ({found.error / found.efficiency:.1%})"
        if found.efficiency > 0.0
        else "eta_11 = 0: no offset ends in a doublet",
        f"  error: quadrature {found.quadrature_error:.1e}, steps {found.step_error:.1e}, "
        f"bisection {found.bisection_error:.1e}, approaches too long {found.unresolved_error:.1e}",
        f"critical offset y_c(0) = {offset / scene.suspension.radius:.4f} a",
        f"initial slope of <P> (Eq. 22) = {initial_growth(scene, found.efficiency):.4g} 1/s",
    ]
    if attraction > 0.0:
        range_ = "" if attraction >= EQUATION_23_ABOVE else f", below its range (above {EQUATION_23_ABOVE:g})"
        lines.append(
            f"Eq. 23, 0.95 C_A^0.18 = {law:.5f}  (C_A = {attraction:.2e}{range_}; "
            f"eta_11 is {found.efficiency / law - 1.0:+.1%} from it)"
        )
    return lines
