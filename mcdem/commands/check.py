"""`mcdem check`: what the numbers of a scene say."""

from __future__ import annotations

import typer

from mcdem.commands import SceneFile


def check(scene: SceneFile) -> None:
    """Say from a scene's dimensionless groups what matters, what is left out and whether its numerics can follow.

    Exit code 0: nothing to warn of; 3: the scene leaves out something that matters, or steps past a limit.
    """
    from rich.console import Console
    from rich.padding import Padding
    from rich.text import Text

    from mcdem.analysis.dimensionless_groups import check as findings
    from mcdem.scene import load_scene

    found = findings(load_scene(scene))
    styles = {"fine": "green", "note": "yellow", "warning": "bold red"}
    console = Console()
    for finding in found:
        verdict = (f"{finding.verdict:8}", styles[finding.verdict])
        console.print(Text.assemble(verdict, f"{finding.name} = ", (f"{finding.value:.3g}", "bold")))
        console.print(Padding(Text(finding.words), (0, 0, 0, 8), expand=False))
    if any(finding.verdict == "warning" for finding in found):
        raise typer.Exit(3)
