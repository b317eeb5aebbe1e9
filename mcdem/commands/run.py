"""`mcdem run`: a scene to a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import SceneFile, read_quantity, refuse_existing
from mcdem.units import TIME


def run(
    scene: SceneFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Dataset to write; default: SCENE's name, with .nc."
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of every random stream, instead of the scene's.")
    ] = None,
    until: Annotated[
        str | None, typer.Option(metavar="TIME", help='Process time to stop at, such as "10 s".')
    ] = None,
    events: Annotated[int | None, typer.Option(min=1, help="Number of encounters to stop after.")] = None,
    workers: Annotated[
        int, typer.Option(min=1, help="Processes that resolve encounters; the dataset is the same.")
    ] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from what FILE holds.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE if it exists.")] = False,
) -> None:
    """Follow the suspension of a scene and write every event to a NetCDF dataset.

    Ctrl-C keeps what was computed; --resume goes on from there.
    """
    from mcdem.progress import RunProgress
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    stop = read_quantity("--until", until, TIME.positive) if until is not None else None
    file = output or Path(f"{loaded.name}.nc")
    if not resume:
        refuse_existing(file, overwrite=overwrite)

    from mcdem.simulate import run as simulate

    with RunProgress(loaded, until=stop, events=events) as progress:
        try:
            simulate(
                loaded,
                file,
                seed=seed,
                until=stop,
                events=events,
                workers=workers,
                resume=resume,
                progress=progress,
            )
        except KeyboardInterrupt:
            progress.close()
            typer.secho(f"interrupted; {file} holds what was computed, --resume goes on from there", err=True)
            raise typer.Exit(130) from None
    typer.echo(f"{file} written")
