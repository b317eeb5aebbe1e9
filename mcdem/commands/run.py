"""`mcdem run`: a scene to a dataset."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mcdem.arguments import PERIOD
from mcdem.commands import LARGEST_SEED, MOST_EVENTS, SceneFile, read_quantity
from pbekit import endings


class Engine(StrEnum):
    """What computes the encounters."""

    process = "process"
    mpi = "mpi"
    dask = "dask"


def run(
    scene: SceneFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Dataset to write; default: SCENE's name, with .nc."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, max=LARGEST_SEED, help="Seed of every random stream, instead of the scene's."),
    ] = None,
    until: Annotated[
        str | None, typer.Option(metavar="TIME", help='Process time to stop at, such as "10 s".')
    ] = None,
    events: Annotated[
        int | None, typer.Option(min=1, max=MOST_EVENTS, help="Number of encounters to stop after.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Workers that compute encounters; on machines of one kind the dataset is the same for any number. "
            "Default: all available.",
        ),
    ] = None,
    executor: Annotated[
        Engine, typer.Option(help="process: this machine; mpi: ranks of mpiexec; dask: a cluster.")
    ] = Engine.process,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Address of the dask cluster, such as tcp://host:8786."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from what FILE holds, if it exists.")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it exists.")] = False,
) -> None:
    """Follow the suspension of a scene and write every event to a NetCDF dataset.

    Ctrl-C, SIGTERM and SIGHUP keep what was computed; `--resume` goes on from there.
    """
    from mcdem.analysis.dimensionless_groups import check
    from mcdem.commands.progress import RunDisplay, state
    from mcdem.monte_carlo.expected_output import output_of
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    stop = read_quantity("--until", until, PERIOD) if until is not None else None
    file = output or Path(f"{loaded.name}.nc")
    expected = output_of(loaded, stop, events)
    if expected is not None and expected.large:
        typer.secho(f"note: {expected.words}", fg="yellow", err=True)
    loaded_alone = loaded.model_copy(
        update={"run": loaded.run.model_copy(update={"until": None, "events": None})}
    )
    for finding in check(loaded_alone):
        if finding.verdict == "warning":
            typer.secho(
                f"warning: {finding.name} = {finding.value:.3g}: {finding.words}", fg="yellow", err=True
            )

    from mcdem.monte_carlo import executors, run_control

    with executors.opened(executor.value, workers, scheduler) as crew, RunDisplay(loaded.name) as display:
        done = run_control.run(
            loaded,
            file,
            seed=seed,
            until=stop,
            events=events,
            workers=crew.workers,
            executor=crew.executor,
            resume=resume,
            overwrite=overwrite,
            progress=display,
        )
    typer.echo(f"{file}: {state(done.time, done.events, done.outcomes)}; ended by {done.ended_by}")
    if done.ended_by == "interruption":
        endings.tell(KeyboardInterrupt(f"{file} holds all that was computed: --resume goes on from there"))
        raise typer.Exit(endings.exit_code())
