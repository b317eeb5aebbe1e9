"""`mcdem efficiency`: the pair efficiency eta_11 of a scene."""

from __future__ import annotations

from typing import Annotated

import typer

from mcdem.commands import SceneFile, show
from mcdem.errors import UserError
from mcdem.quantities.units import shown


def gaps(given: str) -> list[float]:
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
    cutoffs = [] if cutoff is None else gaps(cutoff)
    from mcdem.analysis import efficiency_studies as studies
    from mcdem.encounter.capture_efficiency import critical_offset, pair_efficiency
    from mcdem.scene import load_scene
    from pbekit.progress import ProgressBar

    loaded = load_scene(scene)
    with ProgressBar("eta_11", interval=10.0) as progress:
        found = pair_efficiency(loaded, progress=progress)
        show(*studies.efficiency_report(loaded, found, critical_offset(loaded, 0.0)))
    if steps:
        with ProgressBar("eta_11 against the step", interval=10.0) as progress:
            show(studies.steps_table(studies.against_steps(loaded, progress=progress)))
    if cutoffs:
        with ProgressBar("eta_11 against the cut-off", interval=10.0) as progress:
            show(studies.cutoff_table(loaded, studies.against_cutoff(loaded, cutoffs, progress)))
