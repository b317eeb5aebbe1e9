"""`mcdem encounter`: one encounter of two aggregates."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcdem.commands import LARGEST_SEED, SceneFile, finite, read_quantity
from mcdem.errors import UserError
from mcdem.quantities.units import LENGTH, shown

if TYPE_CHECKING:
    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.encounter.simulate import EncounterResult, Recorder
    from mcdem.scene import Scene

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
    seed: Annotated[
        int | None, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the orientations and the offset.")
    ] = None,
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
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that exist.")] = False,
) -> None:
    """Follow one encounter of two aggregates and report what came of it."""
    from mcdem.scene import load_scene

    loaded = load_scene(scene)
    place = (
        (read_quantity("--offset", offset[0], LENGTH), read_quantity("--offset", offset[1], LENGTH))
        if offset
        else None
    )
    parents = aggregate_of(loaded, "--first", first), aggregate_of(loaded, "--second", second)

    if film is not None:
        from mcdem.figures.film import check as check_film
        from mcdem.figures.film import require_writer

        require_writer(film)
        check_film(film, overwrite=overwrite)
    if trajectory is not None:
        from mcdem.encounter.trajectory import check as check_trajectory

        check_trajectory(trajectory, overwrite=overwrite)

    from mcdem.encounter.simulate import Recorder

    recorder = Recorder(interval=every) if film or trajectory else None
    chosen = loaded.run.seed if seed is None else seed
    result, recorder = followed(loaded, parents, place, chosen, recorder)
    width = max(len(name) for name, _ in report(loaded, result))
    for name, value in report(loaded, result):
        typer.echo(f"{name:{width}}  {value}")
    if recorder is not None:
        from mcdem.encounter.trajectory import Trajectory, export

        course = Trajectory.of_encounter(loaded, recorder, result)
        if trajectory is not None:
            export(course, trajectory)
        if film is not None:
            from mcdem.commands.progress import Steady
            from mcdem.figures.film import film as make_film

            with Steady("film") as tell:
                make_film(course, film, progress=tell)


APART = 100
"""From so many primaries on, one step may take longer than anybody waits for an answer to Ctrl-C."""
STEPS = 300
"""Steps of an encounter, as a rule at least."""


def follow(
    scene: Scene, parents: tuple[Aggregate, Aggregate], place: Any, seed: int, recorder: Recorder | None
) -> tuple[EncounterResult, Recorder | None]:
    """Follow an encounter; returns what came of it, and its course if it was recorded."""
    from mcdem.encounter.simulate import simulate_encounter

    return simulate_encounter(scene, *parents, offset=place, seed=seed, record=recorder), recorder


def followed(
    scene: Scene, parents: tuple[Aggregate, Aggregate], place: Any, seed: int, recorder: Recorder | None
) -> tuple[EncounterResult, Recorder | None]:
    """The same; a large one in a process of its own, so that this one can report its progress, and end it."""
    from mcdem.commands.progress import Steady
    from mcdem.monte_carlo import executors

    count = parents[0].size + parents[1].size
    if count < APART:
        return follow(scene, parents, place, seed, recorder)
    long = STEPS * step_time(count)
    if long > 10.0:
        told = timedelta(seconds=float(f"{long:.1g}"))
        typer.secho(
            f"note: {count} primaries: {told} is to be expected, or a few times that; an encounter is kept when it is over",
            fg="yellow",
            err=True,
        )
    with executors.opened("process", 1, apart=True) as crew, Steady("encounter") as tell:
        future = executors.submit(crew.executor, follow, scene, parents, place, seed, recorder)
        tell.until_done(future, f"{count} primaries")
        found: tuple[EncounterResult, Recorder | None] = executors.result_of(future)
        return found


def step_time(count: int) -> float:
    """[s] that a step of so many primaries takes here at least: a factorisation of its 11 unknowns a primary, as measured."""
    import time

    import numpy as np
    from scipy.linalg import cho_factor

    size = 500
    matrix = np.eye(size) + 1e-3
    began = time.perf_counter()
    for _ in range(3):
        cho_factor(matrix)
    return (time.perf_counter() - began) / 3 * (11 * count / size) ** 3


def aggregate_of(scene: Scene, option: str, given: str) -> Aggregate:
    """The aggregate that an option names; raises `UserError` that names the option."""
    import numpy as np

    from mcdem.aggregates.aggregate import Aggregate
    from mcdem.effects.sums import contact_equilibrium

    radius = scene.suspension.radius
    if given.isdecimal():
        if len(given) > 4 or not 1 <= int(given) <= 1000:
            raise UserError(f"{option} {shown(given)[1:-1]}: expected 1 to 1000 primaries")
        scene.require_one_radius(f"for {option} {given} of several, give a file with rows x y z radius")
        rest, _ = contact_equilibrium(1.0, scene.kernels.contact)
        spacing = 2.0 * radius * (1.0 + 0.5 * rest)
        return Aggregate.from_positions(scene, np.arange(int(given))[:, None] * [[0.0, 0.0, spacing]])
    try:
        rows = np.loadtxt(Path(given), ndmin=2)
    except OSError as problem:
        raise UserError(
            f"{option} {given}: cannot be read: {problem.strerror or problem}; or give a number"
        ) from None
    except ValueError as problem:
        raise UserError(f"{option} {given}: not a table of numbers: {problem}") from None
    several = scene.suspension.radii is not None
    if rows.ndim != 2 or rows.shape[1] != (4 if several else 3) or len(rows) == 0:
        raise UserError(
            f"{option} {given}: expected a row x y z{' radius' if several else ''} for each primary, found "
            f"{rows.shape[1]} columns"
        )
    try:
        return Aggregate.from_positions(
            scene, rows[:, :3] * radius, radii=rows[:, 3] * radius if several else None
        )
    except UserError as problem:
        raise UserError(f"{option} {given}: {problem}") from None


def report(scene: Scene, result: EncounterResult) -> list[tuple[str, str]]:
    """What came of an encounter, in words: (name, value) pairs."""
    from mcdem.encounter.simulate import PAPER_BREAKUP, STRICT_BREAKUP

    rate = scene.flow.shear_rate
    strict = "breakup" if result.outcome in STRICT_BREAKUP else "no breakup"
    convention = {True: f" (breakup as the paper counts it; read strictly, {strict})", False: ""}
    told = [("outcome", result.outcome + convention[result.outcome in PAPER_BREAKUP])]
    if result.reason:
        told.append(("reason", result.reason))
    told += [
        ("products", " + ".join(str(product.size) for product in result.products) + " primaries"),
        ("offset", f"x0 = {result.offset[0]:.4g} m, y0 = {result.offset[1]:.4g} m"),
        ("simulated", _time(result.simulated_time, rate)),
        ("first contact", _time(result.first_contact_time, rate)),
        ("last bond change", _time(result.last_bond_change_time, rate)),
        ("smallest gap", f"{result.smallest_gap:.3g} m"),
        ("largest tension", _tension(scene, result.largest_tension)),
        ("effort", f"{result.steps} steps, {result.cpu_time:.3g} s of processor time"),
    ]
    return told


def _time(seconds: float, rate: float) -> str:
    return "none" if seconds != seconds else f"{seconds:.4g} s (strain {seconds * rate:.4g})"


def _tension(scene: Scene, tension: float) -> str:
    contact = scene.effects.contact
    if tension <= 0.0 or contact is None:
        return "none" if tension <= 0.0 else f"{tension:.3g} N"
    pull_off = contact.pull_off_force(scene.suspension.radius)
    return f"{tension:.3g} N ({tension / pull_off:.2f} of pull-off)"
