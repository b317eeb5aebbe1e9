"""`mcdem plot`: the course of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import Dataset
from mcdem.errors import UserError


def plot(
    file: Dataset,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FIGURE", help="Figure to write (png, pdf, svg).")
    ],
) -> None:
    """Draw the mean size `<P>(t)` and the Sauter diameter `d32(t)` with the slope of Eq. 22 at the start."""
    if output.is_dir():
        raise UserError(f"{output}: a folder, expected the name of a figure in it")
    from mcdem.figures import plot_run

    plot_run(file, output)
    typer.echo(f"{output} written")
