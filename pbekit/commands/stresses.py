"""`pbekit stresses`: several tables against stress."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pbekit import endings
from pbekit.commands import Draws, FigureFolder, Tables
from pbekit.errors import PBEError

if TYPE_CHECKING:
    from pbekit.tables.kernel_table import KernelTable


def stresses(kernels: Tables, output: FigureFolder, draws: Draws = 60) -> None:
    """Efficiency of two primaries, steady sizes and breakup size against stress, with their exponents and analytical laws."""
    from pbekit.outputs import FILES
    from pbekit.study.solve_table import open_table

    tables = [open_table(k) for k in kernels]
    for file, table in zip(kernels, tables, strict=True):
        if "viscosity" not in table.about:
            raise PBEError(f"{file}: does not say its viscosity, so its stress is not known")
    if len(tables) < 2:
        raise PBEError(
            f"{kernels[0]}: one table alone says nothing over stresses; give one for each of several"
        )
    with FILES.folder(output):
        draw_over_stresses(tables, {}, output, draws)
    typer.echo(f"figures and their numbers in {output}")


def draw_over_stresses(
    tables: list[KernelTable], runs: dict[float, tuple[float, float]], output: Path, draws: int
) -> None:
    """Figures and words of tables against their stress; `runs` : {stress [Pa]: (steady mean size, its error) of a run}."""
    from pbekit.figures.stresses import draw_efficiencies, draw_stress_law
    from pbekit.progress import ProgressBar
    from pbekit.study.over_stresses import efficiencies, stress_law
    from pbekit.study.report import stress_report

    etas = efficiencies(tables)
    draw_efficiencies(etas, output / "eta_11")
    if len(tables) < 2:
        return
    kept = f"{output} holds what was drawn until then; the same command begins again"
    with ProgressBar("pbekit stresses") as progress, endings.keeping(kept):
        law = stress_law(tables, draws, lambda share: progress("stresses", share))
    if bool(law.mean_size.notnull().any()):
        draw_stress_law(law, runs, output / "stress")
    else:
        typer.echo("  figure of sizes over stress left out: no table bears a steady state")
    for line in stress_report(law, etas):
        typer.echo(f"  {line}")
