"""`pbekit compare`: the balance beside its Monte Carlo."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pbekit import arguments, endings
from pbekit.arguments import LARGEST_SEED
from pbekit.commands import Draws, FigureFolder, Tables
from pbekit.program import checked


def compare(
    kernels: Tables,
    output: FigureFolder,
    runs: Annotated[
        list[Path] | None,
        typer.Option("--run", metavar="RUN", help="Dataset of `mcdem run` of the same scene; one per table."),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            callback=checked(lambda time: arguments.until(time, "--until")),
            help='Time to stop at, such as "10 s"; the run\'s end by default.',
        ),
    ] = None,
    draws: Draws = 60,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the draws.")] = 0,
) -> None:
    """Balance on tabulated encounters beside the Monte Carlo and beside analytical laws: figures with bands, and numbers."""
    from pbekit.commands.stresses import draw_over_stresses
    from pbekit.figures.comparison import draw_comparison
    from pbekit.outputs import FILES
    from pbekit.progress import ProgressBar
    from pbekit.study.compare import compare_table, run_of_each
    from pbekit.study.monte_carlo import MonteCarlo
    from pbekit.study.report import comparison_report
    from pbekit.study.solve_table import open_table

    stop = None if until is None else arguments.until(until, "--until")
    tables = [open_table(k) for k in kernels]
    own = run_of_each(tables, [MonteCarlo.read(r) for r in runs or []])
    steady: dict[float, tuple[float, float]] = {}
    with FILES.folder(output):
        for file, table, run in zip(kernels, tables, own, strict=True):
            kept = f"{output} holds the figures of the tables before it; the same command begins again"
            with ProgressBar(f"pbekit compare {file.name}") as progress, endings.keeping(kept):
                result = compare_table(table, run, draws, stop, seed, progress)
            left_out = draw_comparison(result, output / file.name.removesuffix(".nc"))
            if run is not None and run.is_steady:
                steady[float(table.about.get("shear_stress", float("nan")))] = run.steady["mean_size"]
            typer.echo("\n  ".join([str(file), *comparison_report(result), *left_out]))
        if all("viscosity" in t.about for t in tables):
            draw_over_stresses(tables, steady, output, draws)
    typer.echo(f"figures and their numbers in {output}")
