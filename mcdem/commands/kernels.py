"""`mcdem kernels`: encounters to a table for the population balance."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import LARGEST_SEED, MOST_SAMPLED, SceneFile, finite
from mcdem.commands.run import Engine
from pbekit import endings


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
    shape: Annotated[
        str,
        typer.Option(help='Second coordinate: "aspect ratio", "outer radius" or "radius of gyration".'),
    ] = "aspect ratio",
    shapes: Annotated[int, typer.Option(min=1, max=20, help="Classes of shape; 1 for sizes alone.")] = 3,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0, max=LARGEST_SEED, help="Seed of the designed encounters, instead of the scene's."
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Workers that compute encounters; the table is the same.")
    ] = None,
    executor: Annotated[
        Engine, typer.Option(help="process: this machine; mpi: ranks of mpiexec; dask: a cluster.")
    ] = Engine.process,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Address of the dask cluster, such as tcp://host:8786."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Extend KERNELS, if it exists.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace KERNELS if it exists.")] = False,
) -> None:
    """Tabulate the outcomes of encounters, class by class, for `pbekit solve` and `pbekit compare`.

    A run's events are re-used; designed encounters go where they reduce the error of the balance's steady mean size most.
    """
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    from mcdem.commands.progress import RunDisplay
    from mcdem.kernel_tables import TableProgress, refuse_unwritable, tabulate
    from mcdem.monte_carlo import executors, run_control
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    file = output or Path(f"{loaded.name}.kernels.nc")
    refuse_unwritable(file, resume=resume, overwrite=overwrite)
    with executors.opened(executor.value, workers, scheduler) as crew:
        if not runs:
            runs = [file.with_suffix(".run.nc")]
            with RunDisplay(loaded.name) as display:
                run = run_control.run(
                    loaded,
                    runs[0],
                    workers=crew.workers,
                    executor=crew.executor,
                    resume=runs[0].exists(),
                    progress=display,
                )
            if run.ended_by == "interruption":
                raise KeyboardInterrupt(
                    f"{runs[0]} holds the encounters computed, the table is not begun: the same command goes on from there"
                )
        console = Console(stderr=True)
        columns = (
            TextColumn("designed encounters"),
            BarColumn(bar_width=20),
            TextColumn("{task.fields[state]}"),
        )
        with Bar(*columns, console=console, disable=not console.is_terminal) as bar:
            task = bar.add_task("", total=encounters, state="")
            said = [0.0]

            def show(now: TableProgress) -> None:
                state = f"{now.reused} from runs, {now.designed} of {now.wanted} designed"
                if now.mean_size is not None and now.error is not None:
                    state += f"; steady <P> = {now.mean_size:.3g} +- {100 * now.error:.2g} %"
                bar.update(task, completed=now.designed, state=state)
                if not console.is_terminal and now.elapsed >= said[0]:
                    said[0] = now.elapsed + 30.0
                    console.print(state, markup=False, highlight=False, soft_wrap=True)

            done = tabulate(
                loaded,
                file,
                runs,
                encounters=encounters,
                error=error,
                primaries=primaries,
                aggregates_only=aggregates_only,
                shape=shape,
                shapes=shapes,
                seed=seed,
                executor=crew.executor,
                resume=resume,
                overwrite=overwrite,
                progress=show,
            )
    line = f"{done.path}: {done.reused} encounters from runs, {done.designed} designed"
    if done.mean_size is not None and done.error is not None:
        line += f"; steady <P> = {done.mean_size:.3g}, standard error {100 * done.error:.2g} %"
    typer.echo(f"{line}; ended by {done.ended_by}")
    if done.refusal:
        typer.echo(done.refusal)
    if done.ended_by == "interruption":
        endings.tell(KeyboardInterrupt(f"{file} holds all that was computed: --resume goes on from there"))
        raise typer.Exit(endings.exit_code())
