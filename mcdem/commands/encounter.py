"""`mcdem encounter`: one encounter of two aggregates."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcdem.commands import Overwrite, SceneFile, Seed, note, quantity
from mcdem.quantities.units import LENGTH
from pbekit.program import finite

AGGREGATE = (
    "A number P: a straight chain of P primaries. A file: a row x y z for each primary, in units of its radius; "
    "of a scene with several radii x y z radius, in units of the largest."
)


def encounter(
    scene: SceneFile,
    first: Annotated[
        str, typer.Option("--first", "-i", metavar="AGGREGATE", help=f"Aggregate i. {AGGREGATE}")
    ] = "1",
    second: Annotated[
        str, typer.Option("--second", "-j", metavar="AGGREGATE", help="Aggregate j, the same way.")
    ] = "1",
    offset: Annotated[
        tuple[str, str] | None,
        typer.Option(
            metavar="X0 Y0",
            help='Offset of j along vorticity and gradient, such as "0 nm" "300 nm"; drawn if absent.',
        ),
    ] = None,
    seed: Seed = None,
    film: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Film to make (mp4, gif): spheres, and bonds by tension."),
    ] = None,
    trajectory: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Trajectory to write: NetCDF in the AMBER convention (nc), extended XYZ (xyz), or a folder of VTK files.",
        ),
    ] = None,
    every: Annotated[
        float, typer.Option(min=1e-3, max=1e6, callback=finite, help="Strain between two frames of either.")
    ] = 0.2,
    overwrite: Overwrite = False,
) -> None:
    """Follow one encounter of two aggregates and report what came of it."""
    from mcdem.aggregates.shapes import aggregate_of
    from mcdem.encounter import trajectory as trajectories
    from mcdem.encounter.report import encounter_report
    from mcdem.encounter.simulate import Recorder
    from mcdem.monte_carlo.apart import duration_note, follow_apart
    from mcdem.scene import load_scene
    from pbekit.progress import ProgressBar

    loaded = load_scene(scene)
    length = quantity("--offset", LENGTH)
    place = None if offset is None else (length(offset[0]), length(offset[1]))
    pair = aggregate_of(loaded, first, "--first"), aggregate_of(loaded, second, "--second")
    if film is not None:
        from mcdem.figures.film import check, require_writer

        require_writer(film)
        check(film, overwrite=overwrite)
    if trajectory is not None:
        trajectories.check(trajectory, overwrite=overwrite)
    if words := duration_note(pair[0].size + pair[1].size):
        note(words)
    recorder = Recorder(interval=every) if film or trajectory else None
    with ProgressBar("encounter", interval=10.0) as progress:
        chosen = loaded.run.seed if seed is None else seed
        result, recorder = follow_apart(loaded, pair, place, chosen, recorder, progress)
    typer.echo("\n".join(encounter_report(loaded, result)))
    if recorder is not None:
        course = trajectories.Trajectory.of_encounter(loaded, recorder, result)
        if trajectory is not None:
            trajectories.export(course, trajectory)
        if film is not None:
            from mcdem.figures.film import film as make_film

            with ProgressBar("film", interval=10.0) as progress:
                make_film(course, film, progress=progress)
