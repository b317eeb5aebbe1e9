"""`mcdem cost`: error against time for each setting of a scene."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcdem.commands import LARGEST_SEED, MOST_SAMPLED, SampledRuns, SceneFile, finite

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from mcdem.analysis.accuracy_cost import Price


WIDTH = 130
"""Columns of the table where there is no terminal to ask."""


def cost(
    scene: SceneFile,
    runs: SampledRuns = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FIGURE",
            help="Figure to write; a table (.csv) goes beside it. Default: SCENE.cost.png.",
        ),
    ] = None,
    encounters: Annotated[
        int | None,
        typer.Option(
            min=2, max=MOST_SAMPLED, help="Encounters in the sample; default 100, or 12 with --quick."
        ),
    ] = None,
    error: Annotated[
        float,
        typer.Option(min=0.0, callback=finite, help="Wanted error, for which the cheapest setting is named."),
    ] = 0.05,
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer settings and encounters: a first look.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the sample.")] = 0,
    workers: Annotated[int | None, typer.Option(min=1, help="Workers that compute encounters.")] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace FIGURE and its table if they exist.")
    ] = False,
) -> None:
    """Show what accuracy costs in time: the scene's encounters under each setting of its numerics, against a reference.

    Prints error and CPU time of every setting, draws the front of those that no other beats in both, and names the cheapest
    one within the wanted error.
    """
    from rich.console import Console
    from rich.progress import Progress

    from mcdem.analysis.accuracy_cost import (
        cheapest,
        encounters_to_decide,
        few_aggregates,
        measure,
        sample_for,
        settings_of,
        timed,
    )
    from mcdem.analysis.statistics import share
    from mcdem.commands import end_early
    from mcdem.commands.progress import NowAndThen
    from mcdem.figures.cost import draw_front
    from mcdem.monte_carlo import executors
    from mcdem.monte_carlo.executors import EngineError
    from mcdem.netcdf.whole_files import COST, FILES
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    loaded.require_one_radius("the reference of a setting is eta_11, of two equal primaries")
    figure = output or Path(f"{loaded.name}.cost.png")
    table = figure.with_suffix(".csv")
    FILES.check_picture(figure, overwrite=overwrite)
    FILES.check(table, COST, overwrite=overwrite)
    settings = settings_of(loaded, quick=quick)
    count = encounters or (12 if quick else 100)
    console = Console(stderr=True)
    prices: list[Price] = []
    cut_off: BaseException | None = None
    with (
        executors.opened("process", workers) as crew,
        Progress(console=console, disable=not console.is_terminal) as bar,
    ):
        task = bar.add_task("aggregates to try on", total=len(settings) * (count + 1))
        tell = NowAndThen(console)

        def young(share: float) -> None:
            bar.update(task, description=f"aggregates to try on: {share:.0%}")
            tell(f"aggregates to try on: {share:.0%}")

        pairs = sample_for(
            loaded, runs or [], count, seed, 600 if quick else 4000, crew.workers, crew.executor, young
        )

        def show(name: str, done: int, wanted: int) -> None:
            tell(f"{name}: {done} of {wanted}")
            bar.update(task, description=name, completed=len(prices) * wanted + done)

        try:
            for found in measure(
                loaded,
                settings,
                pairs,
                seed=seed,
                rays=2 if quick else 4,
                executor=crew.executor,
                progress=show,
            ):
                prices.append(found)
                if not console.is_terminal:
                    console.print(f"{found.setting.name}: {1e3 * found.cpu_time:.1f} ms", highlight=False)
        except (KeyboardInterrupt, EngineError) as problem:
            if len(prices) < 2:
                raise
            cut_off = problem
        else:
            bar.update(task, description="times side by side")
            prices = timed(loaded, prices, pairs, seed, crew.executor)
    terminal = Console(highlight=False)
    out = terminal if terminal.is_terminal else Console(highlight=False, width=WIDTH)
    out.print(told(prices, count))
    write(prices, table)
    draw_front(prices, figure, loaded.name, count)
    best = cheapest(prices, error)
    if warning := few_aggregates(pairs):
        out.print(f"Beware: {warning}.")
    if best is None:
        out.print(
            f"No setting is shown to be within {error:g}: of {count} encounters none that differs still leaves a share of "
            f"{share(0, count)[2]:.2g} (95 %). It takes {encounters_to_decide(error)} without a difference, more with some: "
            "raise --encounters, or --error."
        )
    else:
        changes = ", ".join(f"{k} = {v}" for k, v in best.setting.changes.items()) or "the scene as it is"
        out.print(
            f"Cheapest within {error:g}: {best.setting.name} ({changes}), {1e3 * best.cpu_time:.1f} ms an encounter, "
            f"{prices[0].cpu_time / best.cpu_time:.1f} times less than the reference."
        )
    out.print(f"{figure} and {table} written")
    if cut_off is not None:
        end_early(cut_off, f"{figure} and {table}", len(prices), len(settings))


def told(prices: Sequence[Price], count: int) -> Table:
    """The prices as a table for the terminal."""
    from rich.table import Table

    from mcdem.analysis.accuracy_cost import REFERENCE
    from mcdem.analysis.statistics import share

    table = Table(
        "setting",
        "CPU, ms",
        "steps",
        "eta_11",
        "outcome",
        "fragment",
        "geometry",
        "other outcome",
        title=f"error against the reference, {count} encounters (below: 95 % limit); * changes physics, not only numerics",
    )
    for p in prices:
        errors = [
            f"{e:.4f}" + (f" (below {limit:.2g})" if k and p.setting.name != REFERENCE else "")
            for k, (e, limit) in enumerate(zip(p.error, p.limit, strict=True))
        ]
        time = f"{1e3 * p.cpu_time:.1f}"
        if p.time_error > 0.0:
            time += f" +- {1e3 * p.time_error:.1f}"
        low, high = share(round(p.differing * count), count)[1:]
        name = p.setting.name + (" *" if p.setting.of_physics else "")
        table.add_row(name, time, f"{p.steps:.0f}", *errors, f"{p.differing:.1%} ({low:.1%} to {high:.1%})")
    return table


def write(prices: Sequence[Price], path: Path) -> None:
    """The same as a file."""
    from mcdem.analysis.accuracy_cost import QUANTITIES
    from mcdem.netcdf.whole_files import COST, FILES

    text = io.StringIO()
    rows = csv.writer(text)
    names = [name for q in QUANTITIES for name in (f"error_{q}", f"standard_error_{q}", f"limit_{q}")]
    rows.writerow(["setting", "knob", "cpu_time_s", "time_error_s", "steps", "other_outcome", *names])
    for p in prices:
        values = [v for row in zip(p.error, p.deviation, p.limit, strict=True) for v in row]
        first = [p.setting.name, p.setting.knob, p.cpu_time, p.time_error]
        rows.writerow([*first, p.steps, p.differing, *values])
    FILES.write(path, COST, text.getvalue())
