"""`mcdem view`: an encounter or a population in three dimensions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import refuse_existing


def view(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Trajectory of `mcdem encounter`, or dataset of `mcdem run`."),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="PAGE", help="Page to write; default: FILE's name, with .html."
        ),
    ] = None,
    snapshot: Annotated[
        int, typer.Option(help="Which snapshot of a dataset, from 0; negative numbers count from the end.")
    ] = -1,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the page if it exists.")] = False,
) -> None:
    """Write a page in which an encounter can be turned and played, or a population looked at; it needs no network."""
    page = output or file.with_suffix(".html")
    refuse_existing(page, overwrite=overwrite)

    from mcdem.errors import UserError
    from mcdem.figures.view import page_of

    text = page_of(file, snapshot)
    try:
        page.write_text(text, encoding="utf-8")
    except OSError as problem:
        raise UserError(f"{page}: cannot be written: {problem.strerror}") from None
    typer.echo(f"{page} written")
