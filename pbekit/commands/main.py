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
from typer.core import TyperGroup

from pbekit import endings
from pbekit.arguments import DENSEST, DILUTE, LARGEST_SEED, METHODS, MOST_EXACT, SCHEMES, shown
from pbekit.errors import PBEError


class Commands(TyperGroup):
    """Subcommands that answer a mistake with its message."""

    def invoke(self, ctx: Any) -> Any:
        """Run the subcommand."""
        try:
            done = super().invoke(ctx)
            sys.stdout.flush()
            return done
        except PBEError as problem:
            typer.secho(f"error: {problem}", fg="red", err=True)
            raise typer.Exit(2) from None
        except OSError as problem:
            from pbekit.files import said_of_system

            if (said := said_of_system(problem)) is None:
                raise
            typer.secho(f"error: {said}", fg="red", err=True)
            raise typer.Exit(2) from None
        except KeyboardInterrupt as problem:
            endings.tell(problem)
            raise typer.Exit(endings.exit_code()) from None


app = typer.Typer(
    cls=Commands,
    help="Population balances in size and shape, on tables of encounters that mcdem kernels wrote.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
LONGEST_TIME = 1e12
"""[s] thirty thousand years; what has not come to rest by then is followed no further."""
Table = Annotated[Path, typer.Argument(metavar="KERNELS", help="Table that `mcdem kernels` wrote (NetCDF).")]


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


def _refuse_options(method: str, scheme: str, volume_fraction: float | None, stress: float | None) -> None:
    """Refuse what cannot be meant, before anything is read."""
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


def _warn_if_crowded(volume_fraction: Any) -> None:
    if volume_fraction is not None and float(volume_fraction) > DILUTE:
        typer.secho(
            f"warning: at a volume fraction of {float(volume_fraction):g} encounters are not of two aggregates alone (above "
            f"{DILUTE:g}): the balance of binary encounters is no longer that of the suspension",
            fg="yellow",
            err=True,
        )


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
        int, typer.Option(min=0, max=10**6, help="Posterior draws for 90 % bands; 0 for none.")
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
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Of the draws.")] = 0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it exists.")] = False,
) -> None:
    """Solve the balance on a table over time and at steady state, or at a stress between those of two tables."""
    import numpy as np

    from pbekit.estimated_rates.closures import Closure, grid_for, start_of
    from pbekit.estimated_rates.stress_interpolation import Between, between
    from pbekit.outputs import FILES, SOLUTION
    from pbekit.solution.solve import solve as march
    from pbekit.solution.steady import steady_state
    from pbekit.study.uncertainty import band, course_output, draws_of, steady_output, steady_summary
    from pbekit.tables.kernel_table import KernelTable

    if not 0.0 < until <= LONGEST_TIME:
        raise PBEError(f"--until {until:g}: expected a time above 0 and up to {LONGEST_TIME:g}, in seconds")
    FILES.check(output, SOLUTION, overwrite=overwrite)
    _refuse_options(method, scheme, volume_fraction, stress)
    tables = [KernelTable.load(k) for k in kernels]
    table = max(tables, key=lambda t: t.records.size.max(initial=1))
    grid = grid_for(table, exact_to, largest, shapes=None if mean_shape else "table")
    outcomes = "smooth" if smooth else "table"
    closure: Closure | Between
    if stress is not None:
        closure = between(tables, stress, grid, outcomes)
    elif len(tables) == 1:
        closure = Closure(table, grid, outcomes)
    else:
        raise PBEError(f"{len(tables)} tables: say by --stress at which stress between theirs, or give one")
    if largest is not None and largest < exact_to:
        typer.echo(f"--exact-to {exact_to} is taken as {largest}, the largest size", err=True)
    start = start_of(grid, table, volume_fraction)
    _warn_if_crowded(volume_fraction if volume_fraction is not None else table.about.get("volume_fraction"))
    times = np.linspace(0.0, until, samples)
    interrupted = False
    with _Bar("pbekit solve") as bar:
        bar("integrating", 0.0)
        balance = closure.balance(scheme=scheme)
        data = march(
            balance,
            start,
            times,
            method=method,
            rtol=1e-6,
            progress=lambda t: bar("integrating", 0.4 * min(t / until, 1)),
        )
        bar("steady state", 0.45)
        steady = steady_state(balance, start)
        summary = steady_summary(balance, steady.population)
        data["steady_number"] = (
            "cell",
            steady.population,
            {"units": "m-3", "long_name": "steady number concentration"},
        )
        if draws:
            settled, course = (
                steady_output(start, guess=steady.population),
                course_output(start, times, rtol=1e-5),
            )
            try:
                drawn = draws_of(
                    closure,
                    lambda b: {"steady_mean_size": settled(b)["mean_size"], **course(b)},
                    draws,
                    seed,
                    lambda k: bar("draws", 0.5 + 0.5 * k / draws),
                )
            except KeyboardInterrupt:
                interrupted, draws = True, 0
        if draws:
            for name in ("mean_size", "size_deviation", "sauter_diameter"):
                for end, values in zip(("low", "high"), band(drawn[name].values), strict=True):
                    data[f"{name}_{end}"] = ("time", values, {"long_name": f"90 % band of {name}"})
            data.attrs["steady_mean_size_low"], data.attrs["steady_mean_size_high"] = band(
                drawn.steady_mean_size.values
            )
        bar("done", 1.0)
    data.attrs |= {
        "title": "Course of a population balance",
        "kernels": " ".join(map(str, kernels)),
        "command": shlex.join(["pbekit", *sys.argv[1:]]),
        "scene": str(table.about.get("scene", "")) if stress is None else "",
        "steady_mean_size": float(summary["mean_size"]),
        "extrapolated_flux": closure.extrapolated_flux(steady.population),
        "edge_flux": balance.edge_flux(steady.population),
        "unresolved": closure.unresolved,
    }
    if stress is not None:
        data.attrs["shear_stress"] = stress
    data["number"].attrs["units"] = "m-3"
    FILES.write_dataset(output, SOLUTION, {"": data})
    line = f"{output}: steady <P> = {summary['mean_size']:.4g}"
    if draws:
        line += f" ({data.attrs['steady_mean_size_low']:.4g} ... {data.attrs['steady_mean_size_high']:.4g})"
    if "at_rest_from" in data.attrs:
        line += f", at rest from t = {data.attrs['at_rest_from']:.4g} s on"
    typer.echo(
        f"{line}, sigma_P/<P> = {summary['relative_deviation']:.3g}, d32 = {1e6 * float(summary['sauter_diameter']):.3g} um; "
        f"mass drift {float(abs(data.mass_drift).max()):.1e}; "
        f"{100 * data.attrs['extrapolated_flux']:.2g} % of encounters extrapolated, "
        f"{100 * data.attrs['edge_flux']:.2g} % of mass flux beyond the grid"
    )
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
    draws: Annotated[int, typer.Option(min=5, max=10**6, help="Posterior draws for the 90 % bands.")] = 60,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Of the draws.")] = 0,
) -> None:
    """Balance on tabulated encounters beside the Monte Carlo and beside analytical laws: figures with bands, and numbers."""
    import matplotlib

    matplotlib.use("Agg")
    from pbekit import figures
    from pbekit.outputs import FILES
    from pbekit.study import compare as comparing
    from pbekit.study.monte_carlo import MonteCarlo
    from pbekit.tables.kernel_table import KernelTable

    tables = [KernelTable.load(k) for k in kernels]
    found = [MonteCarlo.read(r) for r in runs or []]
    by_scene = {run.scene: run for run in found}
    strangers = set(by_scene) - {str(t.about.get("scene")) for t in tables}
    if strangers:
        raise PBEError(f"{by_scene[strangers.pop()].path}: none of the tables is of its scene")
    if until is not None and not 0.0 < until <= LONGEST_TIME:
        raise PBEError(f"--until {until:g}: expected a time above 0 and up to {LONGEST_TIME:g}, in seconds")
    with FILES.folder(output):
        seen: dict[float, tuple[float, float]] = {}
        for file, table in zip(kernels, tables, strict=True):
            run = by_scene.get(str(table.about.get("scene")))
            stress = float(table.about.get("shear_stress", float("nan")))
            prefix = output / file.name.removesuffix(".nc")
            kept = f"{output} holds the figures of the tables before it; the same command begins again"
            with _Bar(f"pbekit compare {file.name}") as bar, endings.keeping(kept):
                result = comparing.compare(table, run, draws, until, seed, bar)
            figures.draw_table(table, prefix.with_name(prefix.name + "-table"))
            figures.draw_course(result, prefix.with_name(prefix.name + "-course"))
            figures.draw_distribution(result, prefix.with_name(prefix.name + "-distribution"))
            figures.draw_switches(result, prefix.with_name(prefix.name + "-switches"))
            if "volume_fraction" in table.about:
                data = comparing.volume_fractions(table, result.numbers["mean_size"])
                figures.draw_volume_fractions(data, prefix.with_name(prefix.name + "-volume-fractions"))
            if run is not None and run.is_steady:
                seen[stress] = run.steady["mean_size"]
            _tell(file, result)
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
    draws: Annotated[int, typer.Option(min=5, max=10**6, help="Posterior draws for the 90 % bands.")] = 60,
) -> None:
    """Efficiency of two primaries, steady sizes and breakup size against stress, with their exponents and analytical laws."""
    import matplotlib

    matplotlib.use("Agg")
    from pbekit.outputs import FILES
    from pbekit.tables.kernel_table import KernelTable

    tables = [KernelTable.load(k) for k in kernels]
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
    from pbekit.study.over_stresses import efficiencies, stress_law

    etas = efficiencies(tables)
    figures.draw_efficiencies(etas, output / "eta_11")
    if len(tables) < 2:
        return
    kept = f"{output} holds what was drawn until then; the same command begins again"
    with _Bar("pbekit stresses") as bar, endings.keeping(kept):
        law = stress_law(tables, draws, lambda share: bar("stresses", share))
    figures.draw_stress_law(law, runs, output / "stress")
    for k, stress in enumerate(law.stress.values):
        one, eta = law.isel(stress=k), etas.isel(stress=k)
        beside = ""
        if "mean_size_interpolated" in one and one.mean_size_interpolated == one.mean_size_interpolated:
            values = [float(one[f"mean_size_interpolated{end}"]) for end in ("", "_low", "_high")]
            beside = f"  from its neighbours {values[0]:.3g} ({values[1]:.3g} ... {values[2]:.3g})"
        typer.echo(
            f"  {stress:6.4g} Pa  eta_11 {float(eta.eta_11):.4f} ({float(eta.eta_11_low):.4f} ... "
            f"{float(eta.eta_11_high):.4f}; Eq. 23 {float(eta.equation_23):.4f})  "
            + "  ".join(
                f"{name} {unit * float(one[key]):.3g} ({unit * float(one[key + '_low']):.3g} ... "
                f"{unit * float(one[key + '_high']):.3g})"
                for key, name, unit in STRESS_ROWS
            )
            + f"{beside}  {100 * float(one.extrapolated):.2g} % extrapolated"
        )
    for key, name, _ in STRESS_ROWS:
        q = [law.attrs[f"q_{key}{end}"] for end in ("", "_low", "_high")]
        laws = law.attrs.get(f"q_{key}_analytical")
        beside = "" if laws is None else f"; analytical laws {laws:.2f}"
        typer.echo(f"{name} ~ stress^-q: q = {q[0]:.2f} ({q[1]:.2f} ... {q[2]:.2f}){beside}")


STRESS_ROWS = (
    ("mean_size", "steady <P>", 1.0),
    ("breakup_size", "P_br", 1.0),
    ("sauter_diameter", "d32 [um]", 1e6),
)


INSIDE = (
    ("mean_size", "<P>(t)"),
    ("size_deviation", "sigma_P(t)"),
    ("sauter_diameter", "d32(t)"),
    ("late_share", "sizes late in the run"),
)


def _tell(file: Path, result: Any) -> None:
    n = result.numbers
    typer.echo(f"{file}")
    heads = ["", "balance (90 % band)", "Monte Carlo (90 %)", "analytical"]
    rows: list[list[str]] = [heads]
    for key, name, unit in (
        ("mean_size", "steady <P>", 1.0),
        ("relative_deviation", "sigma_P/<P>", 1.0),
        ("sauter_diameter", "d32 [um]", 1e6),
    ):
        cells = [
            name,
            f"{unit * n[key]:.3g} ({unit * n[key + '_low']:.3g} ... {unit * n[key + '_high']:.3g})",
        ]
        mean, error = n.get(f"{key}_monte_carlo"), n.get(f"{key}_monte_carlo_error")
        cells.append(
            "" if mean is None or error is None else f"{unit * mean:.3g} +- {1.645 * unit * error:.2g}"
        )
        cells.append("" if f"{key}_analytical" not in n else f"{unit * n[f'{key}_analytical']:.3g}")
        rows.append(cells)
    eta = f"{n['eta_11']:.3g} ({n['eta_11_low']:.3g} ... {n['eta_11_high']:.3g})"
    rows.append(["eta_11", eta, "", f"{n['eta_11_equation_23']:.3g}" if "eta_11_equation_23" in n else ""])
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    for row in rows:
        typer.echo("  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip())
    if result.run is not None:
        if not result.run.is_steady:
            typer.echo(
                f"  the run is not steady: <P> still drifts ({result.run.trend:+.1f} standard errors a block)"
            )
        typer.echo(
            f"  <P> at t = {n['end']:.4g} s: balance {n['end_mean_size']:.3g} "
            f"({n['end_mean_size_low']:.3g} ... {n['end_mean_size_high']:.3g}), "
            f"single runs {n['end_mean_size_run_low']:.3g} ... {n['end_mean_size_run_high']:.3g}, "
            f"Monte Carlo {n['end_mean_size_monte_carlo']:.3g}"
        )
        typer.echo(
            "  share of the Monte Carlo within the 90 % band of single runs: "
            + ", ".join(f"{name} {100 * n[f'{key}_inside']:.0f} %" for key, name in INSIDE)
        )
        typer.echo(
            f"  distance of sizes from {n['late_from']:.3g} s on: {n['late_distance']:.3f}; "
            f"90 % of single runs are within {n['late_distance_run_high']:.3f}"
        )
    guessed, lost = 100 * n["extrapolated_flux"], 100 * n["unresolved"]
    typer.echo(f"  {guessed:.2g} % of encounters extrapolated, {lost:.2g} % unresolved")
    table = result.switches
    typer.echo(
        f"  <P> at t = {table.attrs['until']:.4g} s, steady <P> and distance of sizes from the Monte Carlo's, "
        "with one assumption changed:"
    )
    columns = (table.end_mean_size.values, table.mean_size.values, table.late_distance.values)
    for name, then, value, off in zip(table.switch.values, *columns, strict=True):
        typer.echo(f"    {name:36s} {then:8.3f} {value:8.3f}" + ("" if off != off else f" {off:8.3f}"))


@app.command()
def show(
    kernels: Table,
    largest: Annotated[int, typer.Option(min=1, help="How many pairs of classes to list.")] = 10,
) -> None:
    """Tell what a table holds, how sure its balance is, and which pairs of classes make its error."""
    from pbekit.estimated_rates.closures import Closure, grid_for, start_of
    from pbekit.solution.steady import steady_state
    from pbekit.study.uncertainty import eta_11, mean_size_gradient, variance_shares
    from pbekit.tables.kernel_table import OUTCOMES, KernelTable

    table = KernelTable.load(kernels)
    totals = table.counts.sum(axis=0)
    seen = ", ".join(f"{n} {o}" for n, o in zip(totals, OUTCOMES, strict=True) if n)
    typer.echo(f"{kernels}: {len(table.records)} encounters ({seen})")
    sampled = int((table.counts.sum(axis=1) > 0).sum())
    typer.echo(
        f"  {table.classes} classes of size and {table.shape_name}; {sampled} of {table.pairs} pairs sampled"
    )
    eta, low, high = eta_11(table)
    typer.echo(f"  eta_11 = {eta:.3g} ({low:.3g} ... {high:.3g})")
    closure = Closure(table, grid_for(table))
    steady = steady_state(closure.mean, start_of(closure.grid, table))
    shares = variance_shares(closure, steady, mean_size_gradient(closure.mean, steady.population))
    mean = steady.population @ closure.grid.mass / steady.population.sum()
    typer.echo(f"  steady <P> = {mean:.4g}, standard error {shares.deviation:.2g}; shares of its variance:")
    for name, share, trials in shares.largest(largest):
        typer.echo(f"    {100 * share:5.1f} %  {name} ({trials} trials)")
    if shares.of_law > 0:
        typer.echo(
            f"    {100 * shares.of_law / shares.deviation**2:5.1f} %  the fitted law, where classes lean on it"
        )


def main() -> None:
    """The command, where the console script of an older installation looks for it."""
    endings.program(lambda: app(prog_name="pbekit"))
