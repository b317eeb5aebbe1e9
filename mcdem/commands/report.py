"""`mcdem report`: a page about a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import Dataset, refuse_existing


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
    refuse_existing(page, overwrite=overwrite)

    from mcdem.errors import UserError
    from mcdem.figures.report import report as report_of

    text = report_of(file)
    try:
        page.write_text(text, encoding="utf-8")
    except OSError as problem:
        raise UserError(f"{page}: cannot be written: {problem.strerror}") from None
    typer.echo(f"{page} written")
