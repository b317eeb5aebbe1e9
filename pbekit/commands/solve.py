"""`pbekit solve`: the balance on a table."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from pbekit import arguments
from pbekit.arguments import (
    LARGEST_SEED,
    LEVEL,
    METHODS,
    MOST_DRAWS,
    MOST_EXACT,
    SCHEMES,
    least_draws,
)
from pbekit.commands import Cohesion, Radius, Scene, ShearRate, Until, Viscosity, VolumeFraction
from pbekit.program import checked


def solve(
    kernels: Annotated[
        list[Path],
        typer.Argument(
            metavar="KERNELS...", help="A table that `mcdem kernels` wrote; several with --stress."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Dataset to write.")],
    until: Until = "300 s",
    samples: Annotated[int, typer.Option(min=2, max=10**6, help="Times to keep.")] = 201,
    stress: Annotated[
        float | None,
        typer.Option(
            callback=checked(lambda stress: arguments.stress(stress, "--stress")),
            help="Shear stress [Pa] to interpolate to, between those of two tables.",
        ),
    ] = None,
    scene: Scene = None,
    radius: Radius = None,
    viscosity: Viscosity = None,
    shear_rate: ShearRate = None,
    cohesion: Cohesion = None,
    volume_fraction: VolumeFraction = None,
    draws: Annotated[
        int,
        typer.Option(
            min=0,
            max=MOST_DRAWS,
            callback=checked(lambda count: arguments.draws(count, "--draws", none=True)),
            help=f"Posterior draws for {100 * LEVEL:g} % bands, {least_draws()} or more; 0 for none.",
        ),
    ] = 0,
    mean_shape: Annotated[bool, typer.Option("--mean-shape", help="One mean shape per size.")] = False,
    smooth: Annotated[bool, typer.Option("--smooth", help="Outcomes by the fitted law alone.")] = False,
    scheme: Annotated[
        str,
        typer.Option(
            callback=checked(lambda name: arguments.scheme(name, "--scheme")),
            help=" or ".join(f'"{name}"' for name in SCHEMES) + ".",
        ),
    ] = "fixed pivot",
    exact_to: Annotated[
        int, typer.Option(min=2, max=MOST_EXACT, help="Largest size with a class of its own.")
    ] = 32,
    largest: Annotated[
        int | None,
        typer.Option(help="Largest size, from the largest seen on; twice the largest seen by default."),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            callback=checked(lambda name: arguments.method(name, "--method")),
            help=f"Integrator of scipy: {', '.join(METHODS)}.",
        ),
    ] = "LSODA",
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the draws.")] = 0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it exists.")] = False,
) -> None:
    """Solve the balance on a table over time and at steady state, or at a stress between those of two tables."""
    from pbekit.outputs import FILES, SOLUTION, check_solution
    from pbekit.progress import ProgressBar
    from pbekit.scenes import conditions_given
    from pbekit.study.report import solution_report
    from pbekit.study.solve_table import InterruptedDraws, cautions, open_table, solve_table

    check_solution(output, overwrite=overwrite)
    tables = [open_table(k) for k in kernels]
    given = {"radius": radius, "viscosity": viscosity, "shear_rate": shear_rate, "cohesion": cohesion}
    conditions, volume_fraction = conditions_given(tables[0], scene, volume_fraction, **given)
    for line in cautions(tables, volume_fraction, exact_to, largest):
        typer.secho(line, fg="yellow", err=True)
    interrupted = False
    with ProgressBar("pbekit solve") as progress:
        try:
            data = solve_table(
                tables,
                stress=stress,
                conditions=conditions,
                volume_fraction=volume_fraction,
                shapes=None if mean_shape else "table",
                exact_to=exact_to,
                largest=largest,
                progress=progress,
                until=arguments.until(until, "--until"),
                samples=samples,
                draws=draws,
                scheme=scheme,
                outcomes="smooth" if smooth else "table",
                method=method,
                seed=seed,
            )
        except InterruptedDraws as problem:
            data, interrupted = problem.solution, True
    data.attrs |= {"kernels": " ".join(map(str, kernels)), "command": shlex.join(["pbekit", *sys.argv[1:]])}
    FILES.write_dataset(output, SOLUTION, {"": data})
    for line in solution_report(data):
        typer.echo(f"{output}: {line}")
    if interrupted:
        raise KeyboardInterrupt(
            f"{output} holds the solution without its bands; given again with --overwrite the command begins anew"
        )
