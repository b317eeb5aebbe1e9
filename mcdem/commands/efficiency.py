"""`mcdem efficiency`: the pair efficiency eta_11 of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from mcdem.commands import SceneFile
from mcdem.errors import UserError
from mcdem.quantities.units import shown

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.table import Table

    from mcdem.encounter.capture_efficiency import PairEfficiency
    from mcdem.scene import Scene

STEPS = (2.0, 1.0, 0.5, 0.25)
"""Steps tried by --steps, over the scene's."""


def efficiency(
    scene: SceneFile,
    steps: Annotated[bool, typer.Option("--steps", help="Show how it converges with the step.")] = False,
    cutoff: Annotated[
        str | None,
        typer.Option(
            metavar="DELTA,...",
            help="Show it against the lubrication cut-off, for both conventions of it: 0,1e-4,1e-3,5e-3,1e-2.",
        ),
    ] = None,
) -> None:
    """Compute the efficiency eta_11 with which two primaries that meet form a doublet.

    Found from the critical offsets of exact encounters, without sampling, and given with its numerical error next to the law of
    van de Ven & Mason (Eq. 23 of the paper).
    """
    cutoffs = read_cutoffs(cutoff) if cutoff is not None else []

    from rich.console import Console

    from mcdem.commands.progress import Steady
    from mcdem.encounter.capture_efficiency import critical_offset, pair_efficiency
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    console = Console(highlight=False)
    with Steady("eta_11") as tell:
        found = pair_efficiency(loaded, progress=tell)
    for line in told(loaded, found, critical_offset(loaded, 0.0)):
        console.print(line)
    if steps:
        with Steady("eta_11 against the step") as tell:
            table = against_steps(loaded, tell)
        console.print(table)
    if cutoffs:
        with Steady("eta_11 against the cut-off") as tell:
            table = against_cutoff(loaded, cutoffs, tell)
        console.print(table)


def read_cutoffs(given: str) -> list[float]:
    """The numbers of --cutoff."""
    try:
        values = [float(part) for part in given.split(",")]
    except ValueError:
        raise UserError(
            f"--cutoff {shown(given)}: expected numbers between commas, such as 0,1e-3,5e-3"
        ) from None
    if not all(0.0 <= value < 1.0 for value in values):
        raise UserError(f"--cutoff {shown(given)}: expected gaps over the radius, from 0 to below 1")
    return values


def told(scene: Scene, found: PairEfficiency, offset: float) -> list[str]:
    """What was found, in words."""
    from mcdem.encounter.capture_efficiency import attraction_number, initial_growth, van_de_ven_mason

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
        range_ = "" if attraction >= 1e-4 else ", below its range (above 1e-4)"
        lines.append(
            f"Eq. 23, 0.95 C_A^0.18 = {law:.5f}  (C_A = {attraction:.2e}{range_}; "
            f"eta_11 is {found.efficiency / law - 1.0:+.1%} from it)"
        )
    return lines


def against_steps(scene: Scene, progress: Callable[[str, float], None]) -> Table:
    """eta_11 and y_c(0) for several steps."""
    from rich.table import Table

    from mcdem.encounter.capture_efficiency import critical_offset, pair_efficiency

    table = Table("step", "eta_11", "change", "y_c(0)/a", "change", title="against the step")
    step = scene.numerics.step
    before: tuple[float, float] | None = None
    for factor in STEPS:
        numerics = scene.numerics.with_step(factor * step)
        changed = scene.model_copy(update={"numerics": numerics})
        row = (
            pair_efficiency(changed, progress=progress).efficiency,
            critical_offset(changed, 0.0) / scene.suspension.radius,
        )
        changes = [f"{new / old - 1.0:+.2%}" for new, old in zip(row, before)] if before else ["", ""]
        table.add_row(
            f"{factor * step:g}{scene.numerics.step_unit}",
            f"{row[0]:.5f}",
            changes[0],
            f"{row[1]:.5f}",
            changes[1],
        )
        before = row
    return table


def against_cutoff(scene: Scene, cutoffs: list[float], progress: Callable[[str, float], None]) -> Table:
    """eta_11 for several cut-offs and both conventions of what lies below them."""
    from rich.table import Table

    from mcdem.encounter.capture_efficiency import pair_efficiency, van_de_ven_mason
    from mcdem.hydrodynamics import LEVELS
    from mcdem.quantities.toml_tables import choices

    if not scene.hydrodynamics.lubrication:
        raise UserError(
            f'{scene.name}: [hydrodynamics] level = "{scene.hydrodynamics.level}" has no lubrication to cut off; '
            f"use level = {choices(LEVELS, 'lubrication')}, or leave out the cut-offs"
        )
    law = van_de_ven_mason(scene)
    table = Table(
        "delta", "frozen matrix", "over Eq. 23", "frozen gap", "over Eq. 23", title="against the cut-off"
    )
    for delta in cutoffs:
        cells = []
        for convention in ("matrix", "gap"):
            hydrodynamics = scene.hydrodynamics.model_copy(
                update={"lubrication_cutoff": delta, "cutoff_convention": convention}
            )
            changed = scene.model_copy(update={"hydrodynamics": hydrodynamics})
            found = pair_efficiency(changed, progress=progress)
            cells += [f"{found.efficiency:.5f} +- {found.error:.5f}", f"{found.efficiency / law:.3f}"]
        table.add_row(f"{delta:g}", *cells)
    return table
