"""`mcdem sweep`: a scene over values of its keys, and replicas."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.arguments import PERIOD
from mcdem.commands import LARGEST_SEED, MOST_EVENTS, SceneFile, read_quantity
from mcdem.commands.run import Engine
from pbekit import endings


def sweep(
    scene: SceneFile,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE,...",
            help="Values of a key, such as flow.shear_stress=750Pa,875Pa; several --set give every combination.",
        ),
    ] = None,
    replicas: Annotated[int, typer.Option(min=1, help="Runs of each combination, with their own seeds.")] = 1,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="Folder of the datasets and the index; default: SCENE's name.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0, max=LARGEST_SEED, help="From which the members' seeds are drawn, instead of the scene's."
        ),
    ] = None,
    until: Annotated[
        str | None, typer.Option(metavar="TIME", help='Process time to stop at, such as "10 s".')
    ] = None,
    events: Annotated[
        int | None, typer.Option(min=1, max=MOST_EVENTS, help="Number of encounters to stop after.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="How many members run at once. Default: as many as there are workers."),
    ] = None,
    executor: Annotated[
        Engine, typer.Option(help="process: this machine; mpi: ranks of mpiexec; dask: a cluster.")
    ] = Engine.process,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Address of the dask cluster, such as tcp://host:8786."),
    ] = None,
) -> None:
    """Run a scene over values of its keys and over replicas: one dataset each, and index.csv.

    Given again, it runs what is not finished, and only that.  A member that fails does not stop the others.
    """
    from mcdem.monte_carlo import executors
    from mcdem.monte_carlo.sweep import Member, parse_settings, replaced
    from mcdem.monte_carlo.sweep import sweep as run_sweep
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    stop = read_quantity("--until", until, PERIOD) if until is not None else None
    folder = output or Path(loaded.name)
    values = parse_settings(settings or [])
    for line in replaced(loaded, list(values)):
        typer.echo(line, err=True)

    def tell(member: Member) -> None:
        line = f"{member.file.name}: {member.state}, t = {member.time:.4g} s, {member.events} events"
        typer.echo(f"{line}: {member.why}" if member.why else line)

    with executors.opened(executor.value, workers, scheduler, apart=True) as crew:
        members = run_sweep(
            loaded,
            folder,
            values,
            replicas=replicas,
            seed=seed,
            until=stop,
            events=events,
            executor=crew.executor,
            progress=tell,
        )
    states = [member.state for member in members]
    typer.echo(
        f"{folder / 'index.csv'}: {states.count('done')} of {len(members)} done, {states.count('failed')} failed"
    )
    if states.count("failed") and not endings.asked():
        raise typer.Exit(1)
    if states.count("done") < len(members):
        endings.tell(
            KeyboardInterrupt(f"{folder} holds all that was computed: the same command goes on from there")
        )
        raise typer.Exit(endings.exit_code())
