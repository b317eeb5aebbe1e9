"""`mcdem view`: an encounter or a population in three dimensions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import Overwrite, Page


def view(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Trajectory of `mcdem encounter`, or dataset of `mcdem run`."),
    ],
    output: Page = None,
    snapshot: Annotated[
        int, typer.Option(help="Which snapshot of a dataset, from 0; negative numbers count from the end.")
    ] = -1,
    overwrite: Overwrite = False,
) -> None:
    """Write a page in which an encounter can be turned and played, or a population looked at; it needs no network."""
    page = output or file.with_suffix(".html")
    from mcdem.netcdf.whole_files import FILES

    FILES.check(page, FILES.page, overwrite=overwrite)

    from mcdem.figures.view import page_of

    text = page_of(file, snapshot)
    FILES.write(page, FILES.page, text)
    typer.echo(f"{page} written")
