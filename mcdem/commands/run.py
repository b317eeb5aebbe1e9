"""`mcdem run`: a scene to a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.arguments import ExecutorKind
from mcdem.commands import Events, Kind, Overwrite, SceneFile, Scheduler, Seed, Until, Workers, note


def run(
    scene: SceneFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Dataset to write; default: SCENE's name, with .nc."
        ),
    ] = None,
    seed: Seed = None,
    until: Until = None,
    events: Events = None,
    workers: Workers = None,
    executor: Kind = ExecutorKind.process,
    scheduler: Scheduler = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from what FILE holds, if it exists.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Follow the suspension of a scene and write every event to a NetCDF dataset.

    Ctrl-C, SIGTERM and SIGHUP keep what was computed; `--resume` goes on from there.
    """
    from mcdem.analysis.dimensionless_groups import warnings_before
    from mcdem.monte_carlo import executors, run_control
    from mcdem.scene import load_scene
    from pbekit.progress import ProgressBar

    loaded = load_scene(scene)
    file = output or Path(f"{loaded.name}.nc")
    for line in warnings_before(loaded, until, events):
        note(line)
    with (
        executors.opened(executor, workers, scheduler) as crew,
        ProgressBar(loaded.name, begins="compiling what is not yet compiled", at_once=True) as progress,
    ):
        done = run_control.run(
            loaded,
            file,
            seed=seed,
            until=until,
            events=events,
            workers=crew.workers,
            executor=crew.executor,
            resume=resume,
            overwrite=overwrite,
            progress=lambda now: progress(str(now), now.done),
        )
    typer.echo(f"{file}: {done}")
    if done.ended_by == "interruption":
        raise KeyboardInterrupt(f"{file} holds all that was computed: --resume goes on from there")
