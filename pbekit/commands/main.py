"""The command `pbekit`: balances on tables of encounters.

Exit codes as of mcdem: 0 done; 2 something to mend in what was given; 130, 143, 129 interrupted (`pbekit.endings`).
"""

from __future__ import annotations

import math
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from pbekit import arguments, endings
from pbekit.arguments import (
    DENSEST,
    LARGEST_SEED,
    LEVEL,
    METHODS,
    MOST_DRAWS,
    MOST_EXACT,
    SCHEMES,
    least_draws,
    shown,
)
from pbekit.errors import PBEError
from pbekit.program import Program


class Commands(Program):
    """Subcommands of pbekit."""

    mistakes = PBEError


app = typer.Typer(
    cls=Commands,
    help="Population balances in size and shape, on tables of encounters that mcdem kernels wrote.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
Table = Annotated[Path, typer.Argument(metavar="KERNELS", help="Table that `mcdem kernels` wrote (NetCDF).")]
Draws = Annotated[
    int,
    typer.Option(min=least_draws(), max=MOST_DRAWS, help=f"Posterior draws for the {100 * LEVEL:g} % bands."),
]


class _Bar:
    """A bar on a terminal, elsewhere a line now and then."""

    def __init__(self, name: str) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        self.console = Console(stderr=True)
        columns = (
            TextColumn(name),
            BarColumn(bar_width=20),
            TaskProgressColumn(),
            TextColumn("{task.fields[state]}"),
        )
        self.bar = Progress(*columns, console=self.console, disable=not self.console.is_terminal)
        self.task = self.bar.add_task("", total=1.0, state="")
        self.said = -1.0

    def __call__(self, state: str, share: float) -> None:
        self.bar.update(self.task, completed=share, state=state)
        if not self.console.is_terminal and share >= self.said + 0.25:
            self.said = share
            self.console.print(f"{share:4.0%}  {state}", markup=False, highlight=False)

    def __enter__(self) -> _Bar:
        self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.bar.stop()


def _finite(value: float | None) -> float | None:
    """A callback of options that are numbers: typer's bounds let nan and inf pass."""
    if value is not None and not math.isfinite(value):
        raise typer.BadParameter(f"{value} is not a finite number")
    return value


def _refuse_options(
    until: float, draws: int, method: str, scheme: str, volume_fraction: float | None, stress: float | None
) -> None:
    """Refuse what cannot be meant, before anything is read."""
    arguments.until("--until", until)
    arguments.draws("--draws", draws, none=True)
    if method not in METHODS:
        raise PBEError(f"--method {shown(method)}: expected one of {', '.join(METHODS)}")
    if scheme not in SCHEMES:
        raise PBEError(f"--scheme {shown(scheme)}: expected one of {', '.join(SCHEMES)}")
    if volume_fraction is not None and not 0.0 < volume_fraction < DENSEST:
        raise PBEError(
            f"--volume-fraction {volume_fraction:g}: expected a share above 0 and below {DENSEST:g}"
        )
    if stress is not None and not stress > 0.0:
        raise PBEError(f"--stress {stress:g}: expected a stress above 0, in Pa")


@app.command()
def solve(
    kernels: Annotated[
        list[Path],
        typer.Argument(
            metavar="KERNELS...", help="A table that `mcdem kernels` wrote; several with --stress."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Dataset to write.")],
    until: Annotated[float, typer.Option(help="Time to stop at [s].")] = 300.0,
    samples: Annotated[int, typer.Option(min=2, max=10**6, help="Times to keep.")] = 201,
    stress: Annotated[
        float | None,
        typer.Option(
            callback=_finite, help="Shear stress [Pa] to interpolate to, between those of two tables."
        ),
    ] = None,
    volume_fraction: Annotated[
        float | None, typer.Option(callback=_finite, help="Instead of the table's; above 0, below 0.74.")
    ] = None,
    draws: Annotated[
        int,
        typer.Option(
            min=0,
            max=MOST_DRAWS,
            help=f"Posterior draws for {100 * LEVEL:g} % bands, {least_draws()} or more; 0 for none.",
        ),
    ] = 0,
    mean_shape: Annotated[bool, typer.Option("--mean-shape", help="One mean shape per size.")] = False,
    smooth: Annotated[bool, typer.Option("--smooth", help="Outcomes by the fitted law alone.")] = False,
    scheme: Annotated[str, typer.Option(help='"fixed pivot" or "cell average".')] = "fixed pivot",
    exact_to: Annotated[
        int, typer.Option(min=2, max=MOST_EXACT, help="Largest size with a class of its own.")
    ] = 32,
    largest: Annotated[
        int | None,
        typer.Option(help="Largest size, from the largest seen on; twice the largest seen by default."),
    ] = None,
    method: Annotated[str, typer.Option(help=f"Integrator of scipy: {', '.join(METHODS)}.")] = "LSODA",
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the draws.")] = 0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it exists.")] = False,
) -> None:
    """Solve the balance on a table over time and at steady state, or at a stress between those of two tables."""
    from pbekit.commands.telling import cautions, solved_in_words, writable_dataset
    from pbekit.outputs import FILES, SOLUTION
    from pbekit.study.solve_table import InterruptedDraws, open_table, solve_table

    writable_dataset(output, overwrite)
    _refuse_options(until, draws, method, scheme, volume_fraction, stress)
    tables = [open_table(k) for k in kernels]
    for line in cautions(tables, volume_fraction, exact_to, largest):
        typer.secho(line, fg="yellow", err=True)
    interrupted = False
    with _Bar("pbekit solve") as bar:
        try:
            data = solve_table(
                tables,
                stress=stress,
                volume_fraction=volume_fraction,
                shapes=None if mean_shape else "table",
                exact_to=exact_to,
                largest=largest,
                progress=bar,
                until=until,
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
    for line in solved_in_words(data):
        typer.echo(f"{output}: {line}")
    if interrupted:
        raise KeyboardInterrupt(
            f"{output} holds the solution without its bands; given again with --overwrite the command begins anew"
        )


@app.command()
def compare(
    kernels: Annotated[list[Path], typer.Argument(metavar="KERNELS...", help="Tables, one per stress.")],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="Folder for figures and numbers; those drawn before are replaced.",
        ),
    ],
    runs: Annotated[
        list[Path] | None,
        typer.Option("--run", metavar="RUN", help="Dataset of `mcdem run` of the same scene; one per table."),
    ] = None,
    until: Annotated[
        float | None,
        typer.Option(min=0, callback=_finite, help="Time to stop at [s]; the run's end by default."),
    ] = None,
    draws: Draws = 60,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the draws.")] = 0,
) -> None:
    """Balance on tabulated encounters beside the Monte Carlo and beside analytical laws: figures with bands, and numbers."""
    import matplotlib

    matplotlib.use("Agg")
    from pbekit import figures
    from pbekit.commands.telling import comparison_in_words
    from pbekit.outputs import FILES
    from pbekit.study import compare as comparing
    from pbekit.study.monte_carlo import MonteCarlo
    from pbekit.study.solve_table import open_table

    if until is not None:
        arguments.until("--until", until)
    tables = [open_table(k) for k in kernels]
    own = comparing.run_of_each(tables, [MonteCarlo.read(r) for r in runs or []])
    with FILES.folder(output):
        seen: dict[float, tuple[float, float]] = {}
        for file, table, run in zip(kernels, tables, own, strict=True):
            kept = f"{output} holds the figures of the tables before it; the same command begins again"
            with _Bar(f"pbekit compare {file.name}") as bar, endings.keeping(kept):
                result = comparing.compare_table(table, run, draws, until, seed, bar)
            left_out = figures.draw_comparison(result, output / file.name.removesuffix(".nc"))
            if run is not None and run.is_steady:
                seen[float(table.about.get("shear_stress", float("nan")))] = run.steady["mean_size"]
            typer.echo(f"{file}")
            for line in [*comparison_in_words(result), *left_out]:
                typer.echo(f"  {line}")
        if all("viscosity" in t.about for t in tables):
            _over_stresses(tables, seen, output, draws)
    typer.echo(f"figures and their numbers in {output}")


@app.command()
def stresses(
    kernels: Annotated[list[Path], typer.Argument(metavar="KERNELS...", help="Tables, one per stress.")],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="Folder for figures and numbers; those drawn before are replaced.",
        ),
    ],
    draws: Draws = 60,
) -> None:
    """Efficiency of two primaries, steady sizes and breakup size against stress, with their exponents and analytical laws."""
    import matplotlib

    matplotlib.use("Agg")
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
        _over_stresses(tables, {}, output, draws)
    typer.echo(f"figures and their numbers in {output}")


def _over_stresses(
    tables: list[Any], runs: dict[float, tuple[float, float]], output: Path, draws: int
) -> None:
    from pbekit import figures
    from pbekit.commands.telling import stresses_in_words
    from pbekit.study.over_stresses import efficiencies, stress_law

    etas = efficiencies(tables)
    figures.draw_efficiencies(etas, output / "eta_11")
    if len(tables) < 2:
        return
    kept = f"{output} holds what was drawn until then; the same command begins again"
    with _Bar("pbekit stresses") as bar, endings.keeping(kept):
        law = stress_law(tables, draws, lambda share: bar("stresses", share))
    if bool(law.mean_size.notnull().any()):
        figures.draw_stress_law(law, runs, output / "stress")
    else:
        typer.echo("  figure of sizes over stress left out: no table bears a steady state")
    for line in stresses_in_words(law, etas):
        typer.echo(f"  {line}")


@app.command()
def show(
    kernels: Table,
    largest: Annotated[int, typer.Option(min=1, help="How many pairs of classes to list.")] = 10,
) -> None:
    """Say what a table holds, how sure its balance is, and which pairs of classes make its error."""
    from pbekit.commands.telling import table_in_words
    from pbekit.study.solve_table import open_table

    typer.echo(f"{kernels}: {table_in_words(open_table(kernels), largest)}")
