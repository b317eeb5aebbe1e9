"""`pbekit show`: what a table holds."""

from __future__ import annotations

from typing import Annotated

import typer

from pbekit.commands import Table


def show(
    kernels: Table,
    largest: Annotated[int, typer.Option(min=1, help="How many pairs of classes to list.")] = 10,
) -> None:
    """Say what a table holds, how sure its balance is, and which pairs of classes make its error."""
    from pbekit.study.report import table_report
    from pbekit.study.solve_table import open_table

    typer.echo(f"{kernels}: " + "\n  ".join(table_report(open_table(kernels), largest)))
