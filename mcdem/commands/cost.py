"""`mcdem cost`: error against time for each setting of a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import MOST_SAMPLED, Overwrite, SampledRuns, SampleSeed, SceneFile, Workers, show
from mcdem.commands.paired import end_early, figure_and_table, opened, until_stopped
from pbekit.program import finite


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
    seed: SampleSeed = 0,
    workers: Workers = None,
    overwrite: Overwrite = False,
) -> None:
    """Show what accuracy costs in time: the scene's encounters under each setting of its numerics, against a reference.

    Prints error and CPU time of every setting, draws the front of those that no other beats in both, and names the cheapest
    one within the wanted error.
    """
    from mcdem.analysis.accuracy_cost import (
        measure,
        price_table,
        recommendation,
        settings_of,
        timed,
        write_prices,
    )
    from mcdem.figures.cost import draw_front
    from mcdem.netcdf.whole_files import COST
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    loaded.require_one_radius("the reference of a setting is eta_11, of two equal primaries")
    figure, table = figure_and_table(output or Path(f"{loaded.name}.cost.png"), COST, overwrite)
    settings = settings_of(loaded, quick=quick)
    count, events, rays = encounters or (12 if quick else 100), 600 if quick else 4000, 2 if quick else 4
    with opened(loaded, runs or [], count, seed, events, workers) as (executor, pairs, progress):
        prices, stopped = until_stopped(
            measure(loaded, settings, pairs, seed=seed, rays=rays, executor=executor, progress=progress),
            lambda price: progress.line(f"{price.setting.name}: {1e3 * price.cpu_time:.1f} ms"),
        )
        if stopped is None:
            progress("times side by side", 1.0)
            prices = timed(loaded, prices, pairs, seed, executor)
    write_prices(prices, table)
    draw_front(prices, figure, loaded.name, count)
    show(price_table(prices, count), *recommendation(prices, pairs, error))
    show(f"{figure} and {table} written")
    if stopped is not None:
        end_early(stopped, f"{figure} and {table}", len(prices), len(settings))
