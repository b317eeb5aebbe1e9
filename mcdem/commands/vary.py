"""`mcdem vary`: what an assumption changes."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcdem.commands import SampledRuns, SceneFile
from mcdem.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mcdem.analysis.sensitivity import Difference


def vary(
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
            help="Figure to write; a table (.csv) goes beside it. Default: SCENE.vary.png.",
        ),
    ] = None,
    encounters: Annotated[int, typer.Option(min=2, help="In the sample.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Of the sample.")] = 0,
    workers: Annotated[int | None, typer.Option(min=1, help="How many compute encounters.")] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace FIGURE and its table if they exist.")
    ] = False,
) -> None:
    """Show what an assumption changes: the same encounters under the scene as given and with other values of its keys.

    Prints and draws the difference of eta_11, of the share of each outcome, of the largest product and of the geometry, with
    paired errors.
    """
    from rich.console import Console
    from rich.progress import Progress

    from mcdem.analysis.accuracy_cost import sample_for
    from mcdem.analysis.sensitivity import settings_from
    from mcdem.analysis.sensitivity import vary as vary_settings
    from mcdem.commands import refuse_existing
    from mcdem.figures.vary import draw_differences
    from mcdem.monte_carlo import executors
    from mcdem.monte_carlo.sweep import parse_setting
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    loaded.require_one_radius("eta_11 is of two equal primaries")
    figure = output or Path(f"{loaded.name}.vary.png")
    table = figure.with_suffix(".csv")
    for path in (figure, table):
        refuse_existing(path, overwrite=overwrite)
    chosen = settings_from(dict(parse_setting(given) for given in settings))
    for setting in chosen:
        setting.of(loaded)
    console = Console(stderr=True)
    found: list[Difference] = []
    with (
        executors.opened("process", workers) as crew,
        Progress(console=console, disable=not console.is_terminal) as bar,
    ):
        task = bar.add_task("aggregates to try on", total=len(chosen) * (encounters + 1))
        pairs = sample_for(loaded, runs or [], encounters, seed, 4000, crew.workers, crew.executor)
        finished = 0

        def show(name: str, done: int, wanted: int) -> None:
            bar.update(task, description=name, completed=finished * wanted + done)

        try:
            for of_setting in vary_settings(
                loaded, chosen, pairs, seed=seed, executor=crew.executor, progress=show
            ):
                found += of_setting
                finished += 1
                if not console.is_terminal:
                    name, time = of_setting[0].setting.name, of_setting[0].cpu_time
                    console.print(f"{name}: {1e3 * time:.1f} ms", highlight=False, markup=False)
        except KeyboardInterrupt:
            if finished < 2:
                raise
            console.print("interrupted: what was followed until now follows")
    typer.echo(told(found))
    write(found, table)
    draw_differences(found, figure, loaded.name)
    typer.echo(f"{figure} and {table} written")


def told(found: Sequence[Difference]) -> str:
    """The differences in words, a line each; those that are surely there are marked."""
    lines = [f"{found[0].encounters} encounters; * where the difference is beyond two paired standard errors"]
    for name in dict.fromkeys(d.setting.name for d in found):
        of = [d for d in found if d.setting.name == name]
        lines.append(f"{name}  ({1e3 * of[0].cpu_time:.1f} ms)")
        for d in of:
            if d.given == d.changed == 0.0 or d.given != d.given:
                continue
            spread = f" +- {d.error:.4f}" if d.error else ""
            mark = " *" if d.error and abs(d.value) > 2.0 * d.error else ""
            lines.append(
                f"  {d.quantity:16s} {d.given:8.4f} -> {d.changed:8.4f}  {d.value:+.4f}{spread}{mark}"
            )
    return "\n".join(lines)


def write(found: Sequence[Difference], path: Path) -> None:
    """The same as a file, one row a setting and quantity."""
    try:
        with path.open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(
                "setting key quantity as_given changed difference standard_error encounters cpu_time_s".split()
            )
            for d in found:
                rows.writerow(
                    [d.setting.name, d.setting.knob, d.quantity, d.given, d.changed, d.value, d.error,
                     d.encounters, d.cpu_time]
                )  # fmt: skip
    except OSError as problem:
        raise UserError(f"{path}: cannot be written ({problem.strerror})") from None
