"""`mcdem sensitivity`: what an assumption changes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import MOST_SAMPLED, Overwrite, SampledRuns, SampleSeed, SceneFile, Workers, show
from mcdem.commands.paired import end_early, figure_and_table, opened, until_stopped


def sensitivity(
    scene: SceneFile,
    settings: Annotated[
        list[str],
        typer.Option(
            "--set",
            metavar="KEY=VALUE,...",
            help="Values of a key, each tried alone, such as hydrodynamics.lubrication_cutoff=1e-3,1e-2; "
            "none removes a key or a table. May be repeated.",
        ),
    ],
    runs: SampledRuns = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FIGURE",
            help="Figure to write; a table (.csv) goes beside it. Default: SCENE.sensitivity.png.",
        ),
    ] = None,
    encounters: Annotated[int, typer.Option(min=2, max=MOST_SAMPLED, help="Encounters in the sample.")] = 200,
    seed: SampleSeed = 0,
    workers: Workers = None,
    overwrite: Overwrite = False,
) -> None:
    """Show what an assumption changes: the same encounters under the scene as given and with other values of its keys.

    Prints and draws the difference of eta_11, of the share of each outcome, of the largest product and of the geometry, with
    paired errors.
    """
    import mcdem.analysis.sensitivity as analysis
    from mcdem.figures.sensitivity import draw_differences
    from mcdem.monte_carlo.sweep import parse_settings, replaced
    from mcdem.netcdf.whole_files import SENSITIVITY
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    loaded.require_one_radius("eta_11 is of two equal primaries")
    figure, table = figure_and_table(output or Path(f"{loaded.name}.sensitivity.png"), SENSITIVITY, overwrite)
    values = parse_settings(settings)
    for key in values:
        for line in replaced(loaded, [key]):
            typer.echo(line, err=True)
    chosen = analysis.settings_from(values)
    for setting in chosen:
        setting.of(loaded)
    with opened(loaded, runs or [], encounters, seed, 4000, workers) as (executor, pairs, progress):
        found, stopped = until_stopped(
            analysis.compare_settings(loaded, chosen, pairs, seed=seed, executor=executor, progress=progress),
            lambda of: progress.line(f"{of[0].setting.name}: {1e3 * of[0].cpu_time:.1f} ms"),
        )
    every = [difference for of_setting in found for difference in of_setting]
    analysis.write_differences(every, table)
    draw_differences(every, figure, loaded.name)
    show(*analysis.sensitivity_report(every), f"{figure} and {table} written")
    if stopped is not None:
        end_early(stopped, f"{figure} and {table}", len(found), len(chosen))
