"""`pbekit export`: a table handed over to another solver."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pbekit import arguments
from pbekit.arguments import LARGEST_SEED, MOST_EXACT
from pbekit.commands import Cohesion, Draws, Radius, Scene, ShearRate, Table, Until, Viscosity, VolumeFraction
from pbekit.export.menu import TARGETS


def export(
    kernels: Table,
    to: Annotated[
        str,
        typer.Option(
            "--to", metavar="TARGET", help=f"The solver that is to use the table: {', '.join(TARGETS)}."
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder to write to; made if not there.")
    ],
    scene: Scene = None,
    radius: Radius = None,
    viscosity: Viscosity = None,
    shear_rate: ShearRate = None,
    cohesion: Cohesion = None,
    volume_fraction: VolumeFraction = None,
    until: Until = "300 s",
    draws: Draws = 60,
    exact_to: Annotated[
        int, typer.Option(min=2, max=MOST_EXACT, help="Largest size with a class of its own.")
    ] = 32,
    largest: Annotated[
        int | None,
        typer.Option(help="Largest size, from the largest seen on; twice the largest seen by default."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the draws.")] = 0,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace files of an export that are in FOLDER.")
    ] = False,
) -> None:
    """Write a table's rates for another solver, with a page that says what each file is and how to check it.

    Always: tables of text with units (classes, pairs, daughters, first-order rates, the course to compare with), `fit.json`
    with short forms, their errors and ranges, and README.md. Beside them what the solver reads: a MATLAB file and a script,
    dictionaries, or a Python module.
    """
    from pbekit.export import export_table
    from pbekit.export.menu import target
    from pbekit.export.write import exported_report
    from pbekit.progress import ProgressBar
    from pbekit.scenes import conditions_given
    from pbekit.study.solve_table import open_table

    target(to)
    table = open_table(kernels)
    conditions, volume_fraction = conditions_given(
        table,
        scene,
        volume_fraction,
        radius=radius,
        viscosity=viscosity,
        shear_rate=shear_rate,
        cohesion=cohesion,
    )
    with ProgressBar("pbekit export") as progress:
        done = export_table(
            table,
            to,
            output,
            overwrite=overwrite,
            progress=progress,
            source=kernels.name,
            conditions=conditions,
            draws=draws,
            seed=seed,
            until=arguments.until(until, "--until"),
            volume_fraction=volume_fraction,
            exact_to=exact_to,
            largest=largest,
        )
    for line in exported_report(done):
        typer.echo(line)
