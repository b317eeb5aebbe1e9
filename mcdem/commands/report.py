"""`mcdem report`: a page about a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import Dataset


def report(
    file: Dataset,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="PAGE", help="Page to write; default: FILE's name, with .html."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the page if it exists.")] = False,
) -> None:
    """Write a page about a run: parameters, outcomes, figures, the paper's numbers beside its own, warnings."""
    page = output or file.with_suffix(".html")
    from mcdem.netcdf.whole_files import FILES

    FILES.check(page, FILES.page, overwrite=overwrite)

    from mcdem.figures.report import report as report_of

    text = report_of(file)
    FILES.write(page, FILES.page, text)
    typer.echo(f"{page} written")
