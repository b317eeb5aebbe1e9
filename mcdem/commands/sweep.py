"""`mcdem sweep`: a scene over values of its keys, and replicas."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.arguments import ExecutorKind
from mcdem.commands import Events, Kind, SceneFile, Scheduler, Seed, Until, Workers
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
    seed: Seed = None,
    until: Until = None,
    events: Events = None,
    workers: Workers = None,
    executor: Kind = ExecutorKind.process,
    scheduler: Scheduler = None,
) -> None:
    """Run a scene over values of its keys and over replicas: one dataset each, and index.csv.

    As many members run at once as there are workers, each with a seed drawn from SEED.  Given again, the command runs what is
    not finished, and only that.  A member that fails does not stop the others.
    """
    from mcdem.monte_carlo import executors
    from mcdem.monte_carlo.sweep import parse_settings, replaced
    from mcdem.monte_carlo.sweep import sweep as run_sweep
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    folder = output or Path(loaded.name)
    values = parse_settings(settings or [])
    for line in replaced(loaded, list(values)):
        typer.echo(line, err=True)
    with executors.opened(executor, workers, scheduler, apart=True) as crew:
        members = run_sweep(
            loaded,
            folder,
            values,
            replicas=replicas,
            seed=seed,
            until=until,
            events=events,
            executor=crew.executor,
            progress=typer.echo,
        )
    states = [member.state for member in members]
    done, failed = states.count("done"), states.count("failed")
    typer.echo(f"{folder / 'index.csv'}: {done} of {len(members)} done, {failed} failed")
    if failed and not endings.asked():
        raise typer.Exit(1)
    if done < len(members):
        raise KeyboardInterrupt(f"{folder} holds all that was computed: the same command goes on from there")
