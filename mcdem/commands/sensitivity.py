"""`mcdem sensitivity`: what an assumption changes."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcdem.commands import LARGEST_SEED, MOST_SAMPLED, SampledRuns, SceneFile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mcdem.analysis.sensitivity import Difference


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
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the sample.")] = 0,
    workers: Annotated[int | None, typer.Option(min=1, help="Workers that compute encounters.")] = None,
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
    from mcdem.commands import end_early
    from mcdem.commands.progress import NowAndThen
    from mcdem.figures.sensitivity import draw_differences
    from mcdem.monte_carlo import executors
    from mcdem.monte_carlo.executors import EngineError
    from mcdem.monte_carlo.sweep import parse_settings, replaced
    from mcdem.netcdf.whole_files import FILES, SENSITIVITY
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    loaded.require_one_radius("eta_11 is of two equal primaries")
    figure = output or Path(f"{loaded.name}.sensitivity.png")
    table = figure.with_suffix(".csv")
    FILES.check_picture(figure, overwrite=overwrite)
    FILES.check(table, SENSITIVITY, overwrite=overwrite)
    values = parse_settings(settings)
    for key in values:
        for line in replaced(loaded, [key]):
            typer.echo(line, err=True)
    chosen = settings_from(values)
    for setting in chosen:
        setting.of(loaded)
    console = Console(stderr=True)
    found: list[Difference] = []
    cut_off: BaseException | None = None
    with (
        executors.opened("process", workers) as crew,
        Progress(console=console, disable=not console.is_terminal) as bar,
    ):
        task = bar.add_task("aggregates to try on", total=len(chosen) * (encounters + 1))
        tell = NowAndThen(console)

        def young(share: float) -> None:
            bar.update(task, description=f"aggregates to try on: {share:.0%}")
            tell(f"aggregates to try on: {share:.0%}")

        pairs = sample_for(loaded, runs or [], encounters, seed, 4000, crew.workers, crew.executor, young)
        finished = 0

        def show(name: str, done: int, wanted: int) -> None:
            tell(f"{name}: {done} of {wanted}")
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
        except (KeyboardInterrupt, EngineError) as problem:
            if finished < 2:
                raise
            cut_off = problem
    typer.echo(told(found))
    write(found, table)
    draw_differences(found, figure, loaded.name)
    typer.echo(f"{figure} and {table} written")
    if cut_off is not None:
        end_early(cut_off, f"{figure} and {table}", finished, len(chosen))


def told(found: Sequence[Difference]) -> str:
    """The differences in words, a line each; those that are surely there are marked."""
    from mcdem.analysis.accuracy_cost import GIVEN
    from mcdem.analysis.sensitivity import ETA
    from mcdem.analysis.statistics import share

    count = found[0].encounters
    lines = [f"{count} encounters; [95 % limits of the difference]; * where they leave nought out"]
    for name in dict.fromkeys(d.setting.name for d in found):
        of = [d for d in found if d.setting.name == name]
        lines.append(f"{name}  ({1e3 * of[0].cpu_time:.1f} ms)")
        for d in of:
            if d.given != d.given:
                continue
            line = f"  {d.quantity:16s} {d.given:8.4f} -> {d.changed:8.4f}"
            if d.setting.name == GIVEN:
                line = f"  {d.quantity:16s} {d.given:8.4f}"
            elif d.quantity == ETA:
                line += f"  {d.value:+.4f}"
            elif not d.differing:
                line += f"  none of {count} differs [at most {share(0, count)[2]:.1%} do]"
            elif d.low == d.low:
                line += f"  {d.value:+.4f} [{d.low:+.4f}, {d.high:+.4f}]{' *' * d.is_seen}"
            else:
                line += f"  {d.value:+.4f}, of one encounter"
            lines.append(line)
    return "\n".join(lines)


def write(found: Sequence[Difference], path: Path) -> None:
    """The same as a file, one row a setting and quantity."""
    from mcdem.netcdf.whole_files import FILES, SENSITIVITY

    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(
        "setting key quantity as_given changed difference standard_error low high differing encounters cpu_time_s".split()
    )
    for d in found:
        rows.writerow(
            [d.setting.name, d.setting.knob, d.quantity, d.given, d.changed, d.value, d.error,
             d.low, d.high, d.differing, d.encounters, d.cpu_time]
        )  # fmt: skip
    FILES.write(path, SENSITIVITY, text.getvalue())
