"""`mcdem report`: a page about a run."""

from __future__ import annotations

import typer

from mcdem.commands import Dataset, Overwrite, Page


def report(
    file: Dataset,
    output: Page = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a page about a run: parameters, outcomes, figures, the paper's numbers beside its own, warnings."""
    page = output or file.with_suffix(".html")
    from mcdem.netcdf.whole_files import FILES

    FILES.check(page, FILES.page, overwrite=overwrite)

    from mcdem.figures.report import report as report_of

    text = report_of(file)
    FILES.write(page, FILES.page, text)
    typer.echo(f"{page} written")
