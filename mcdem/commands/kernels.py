"""`mcdem kernels`: encounters to a table for the population balance."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcdem.arguments import ExecutorKind
from mcdem.commands import MOST_SAMPLED, Kind, Overwrite, SceneFile, Scheduler, Seed, Workers
from pbekit.program import finite

if TYPE_CHECKING:
    from mcdem.kernel_tables.tabulation import TableSummary
    from mcdem.kernel_tables.until_error import SoughtSummary
    from mcdem.monte_carlo.executors import Crew
    from mcdem.scene import Scene


def kernels(
    scene: SceneFile,
    runs: Annotated[
        list[Path] | None,
        typer.Option(
            "--from",
            metavar="RUN",
            help="Dataset of `mcdem run` whose events are re-used and whose aggregates are drawn from; may be repeated. "
            "Without it the scene is run first, to KERNELS.run.nc.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="KERNELS", help="Table to write; default: SCENE.kernels.nc."),
    ] = None,
    into: Annotated[
        Path | None,
        typer.Option(
            metavar="ATLAS",
            help="Instead of a table, add the runs' encounters to this atlas of counts over cohesion number and sizes, "
            "if its groups are the scene's; made if it is not there.",
        ),
    ] = None,
    encounters: Annotated[
        int,
        typer.Option(
            min=0, max=MOST_SAMPLED, help="Designed encounters to add to the runs' events, at most."
        ),
    ] = 0,
    error: Annotated[
        float | None,
        typer.Option(
            min=0,
            callback=finite,
            help="Stop when the relative standard error of the steady mean size is below this.",
        ),
    ] = None,
    primaries: Annotated[
        int,
        typer.Option(
            min=0,
            max=MOST_SAMPLED,
            help="Designed encounters are of two primaries until there are so many, for eta_11.",
        ),
    ] = 0,
    aggregates_only: Annotated[
        bool, typer.Option("--aggregates-only", help="Take aggregates from the runs, not their events.")
    ] = False,
    until_error: Annotated[
        str | None,
        typer.Option(
            metavar="WANTED",
            help='Such as "eta=5%" or "breakup=10%": encounters of --pair alone, with offsets drawn where they narrow its error '
            "most and weights in the table, until this relative standard error is reached.",
        ),
    ] = None,
    pair: Annotated[
        str, typer.Option(metavar="P+P", help="Sizes that --until-error is about, in primaries.")
    ] = "1+1",
    shape: Annotated[
        str,
        typer.Option(help='Second coordinate: "aspect ratio", "outer radius" or "radius of gyration".'),
    ] = "aspect ratio",
    shapes: Annotated[int, typer.Option(min=1, max=20, help="Classes of shape; 1 for sizes alone.")] = 3,
    sensitivity: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            help="What `mcdem sensitivity` wrote: the table keeps how outcomes go with the groups of the scene, for its use "
            "at other conditions.",
        ),
    ] = None,
    seed: Seed = None,
    workers: Workers = None,
    executor: Kind = ExecutorKind.process,
    scheduler: Scheduler = None,
    resume: Annotated[bool, typer.Option("--resume", help="Extend KERNELS, if it exists.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Tabulate the outcomes of encounters, class by class, for `pbekit solve` and `pbekit compare`.

    A run's events are re-used; designed encounters go where they reduce the error of the balance's steady mean size most, or
    with --until-error that of one probability.
    """
    from mcdem.kernel_tables.tabulation import refuse_unwritable, tabulate
    from mcdem.kernel_tables.until_error import tabulate_until
    from mcdem.monte_carlo import executors
    from mcdem.scene import load_scene
    from pbekit.progress import ProgressBar

    loaded = load_scene(scene)
    if into is not None:
        add_to_atlas(loaded, runs, into, output)
        return
    file = output or Path(f"{loaded.name}.kernels.nc")
    refuse_unwritable(file, resume=resume, overwrite=overwrite)
    options: dict[str, Any] = {"aggregates_only": aggregates_only, "shape": shape, "shapes": shapes}
    options |= {"seed": seed, "resume": resume, "overwrite": overwrite}
    others: dict[str, Any] = {"error": error, "primaries": primaries, "sensitivity": sensitivity}
    if until_error is not None:
        refuse_beside(until_error, pair, others)
    with executors.opened(executor, workers, scheduler) as crew, ExitStack() as bars:
        if not runs and (until_error is None or pair != "1+1"):
            runs = [file.with_suffix(".run.nc")]
            run_first(loaded, runs[0], crew)
        progress = bars.enter_context(ProgressBar("designed encounters", at_once=True))
        options |= {"executor": crew.executor, "progress": lambda now: progress(str(now), now.done)}
        done: SoughtSummary | TableSummary
        if until_error is not None:
            options |= {"wanted": until_error, "pair": pair, "encounters": encounters or MOST_SAMPLED}
            done = tabulate_until(loaded, file, runs or [], **options)
        else:
            done = tabulate(loaded, file, runs or [], encounters=encounters, **options, **others)
    typer.echo(str(done))
    if done.ended_by == "interruption":
        raise KeyboardInterrupt(f"{file} holds all that was computed: --resume goes on from there")


def refuse_beside(until_error: str, pair: str, others: dict[str, object]) -> None:
    """Refuse a form of --until-error or --pair that is not known, and options that say what else to sample."""
    from mcdem.errors import UserError
    from mcdem.kernel_tables.until_error import Wanted, sizes_of

    Wanted.read(until_error)
    sizes_of(pair)
    given = [f"--{name}" for name, value in others.items() if value]
    if given:
        raise UserError(f"--until-error samples for one probability alone: leave out {' and '.join(given)}")


def add_to_atlas(scene: Scene, runs: list[Path] | None, atlas: Path, output: Path | None) -> None:
    """Add the encounters of runs to an atlas, and list its parts."""
    from mcdem.errors import UserError
    from mcdem.kernel_tables import into_atlas

    if output is not None or not runs:
        raise UserError("--into takes runs (--from RUN) and writes the atlas alone: leave out --output")
    for part in into_atlas(scene, runs, atlas).parts:
        runs_of = part.origin.get("runs", "?")
        typer.echo(f"{atlas}: N = {part.cohesion:.4g}, {part.encounters} encounters of {runs_of}")


def run_first(scene: Scene, file: Path, crew: Crew) -> None:
    """Run a scene, or go on with its run, whose encounters are to be tabulated."""
    from mcdem.monte_carlo import run_control
    from pbekit.progress import ProgressBar

    with ProgressBar(scene.name, at_once=True) as progress:
        run = run_control.run(
            scene,
            file,
            workers=crew.workers,
            executor=crew.executor,
            resume=True,
            progress=lambda now: progress(str(now), now.done),
        )
    if run.ended_by == "interruption":
        raise KeyboardInterrupt(
            f"{file} holds the encounters computed, the table is not begun: the same command goes on from there"
        )
