"""`mcdem figures`: the paper's figures, and a few it lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def figures(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Datasets of `mcdem run`, and trajectories of `mcdem encounter`, in any order.",
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="DIRECTORY",
            help="Folder of figures and numbers; those drawn before are replaced.",
        ),
    ] = Path("figures"),
) -> None:
    """Draw every figure that the datasets allow; each figure's numbers are saved beside it (NetCDF).

    Replicas of one shear stress are taken together; what the paper prints is marked where its scene is the run's.
    A figure that would show nothing is left out, with a line on why.
    """
    from mcdem.figures import draw_all

    def left_out(line: str) -> None:
        typer.echo(f"left out: {line}", err=True)

    for picture in draw_all(files, output, left_out):
        typer.echo(picture)
