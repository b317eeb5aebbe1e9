"""Checks at the door of public functions: what is refused, in one line that says what was expected.

Quantities are read by `mcdem.quantities.units.si`; files of scenes by `mcdem.scene`.
"""

from __future__ import annotations

from enum import StrEnum
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

from mcdem.errors import UserError
from mcdem.quantities.random_streams import LARGEST_SEED
from mcdem.quantities.units import LENGTH, TIME, shown, si

if TYPE_CHECKING:
    import numpy as np

    from mcdem.scene import Scene

PERIOD = TIME.positive.between("1e-15 s", "1e15 s")
"""A process time."""
MOST_EVENTS = 10**12


class ExecutorKind(StrEnum):
    """Where encounters are computed."""

    process = "process"
    mpi = "mpi"
    dask = "dask"


def scene_at_door(scene: object) -> None:
    """Refuse what is no scene, such as the path of one; raises `UserError`."""
    from mcdem.scene import Scene

    if not isinstance(scene, Scene):
        raise UserError(
            f"scene = {shown(scene)}: expected a Scene, as mcdem.load_scene(path) reads it from a file"
        )


def generator_at_door(seed: object) -> np.random.Generator:
    """The random numbers of a seed: an integer from 0 on, a Generator of numpy, or None for any; raises `UserError`."""
    import numpy as np  # not above: commands know their bounds without it

    if seed is None or isinstance(seed, np.random.Generator | np.random.SeedSequence):
        return np.random.default_rng(seed)
    return np.random.default_rng(whole_number("seed", seed, 0, LARGEST_SEED))


def whole_number(name: str, given: object, least: int, most: int) -> int:
    """An integer from `least` to `most`; raises `UserError`."""
    if not isinstance(given, Integral) or isinstance(given, bool) or not least <= int(given) <= most:
        raise UserError(f"{name} = {shown(given)}: expected an integer from {least} to {most}")
    return int(given)


def real_number(name: str, given: object, least: float, most: float) -> float:
    """A number from `least` to `most`; raises `UserError`."""
    if not isinstance(given, Real) or isinstance(given, bool) or not least <= float(given) <= most:
        raise UserError(f"{name} = {shown(given)}: expected a number from {least:g} to {most:g}")
    return float(given)


FAR = 1000.0
"""Largest offset of two aggregates [sum of their radii]."""


def offset_at_door(scene: Scene, offset: object, reach: float) -> tuple[float, float]:
    """Two lengths [m] given as an offset of aggregates of summed radii `reach` [m], a thousand of these at most.

    One that passes at a hundred radii leaves the other alone in the flow; a number in radii or micrometres is refused.  Raises
    `UserError`.
    """
    try:
        pair: tuple[Any, ...] = tuple(offset)  # type: ignore[arg-type]  # fails if it is no pair
    except TypeError:
        pair = ()
    if len(pair) != 2 or isinstance(offset, str):
        raise UserError(f"offset = {shown(offset)}: expected two lengths, numbers in metres or with units")
    x0, y0 = (si(f"offset[{k}]", one, LENGTH) for k, one in enumerate(pair))
    limit = max(scene.numerics.start_distance, FAR) * reach
    if x0 * x0 + y0 * y0 > limit * limit:
        raise UserError(
            f"offset: ({x0:g}, {y0:g}) m, expected within {limit:.4g} m, a thousand times the summed radii of the "
            "aggregates (is the offset in metres?)"
        )
    return x0, y0


def stop_at_door(until: object, events: object) -> tuple[float | None, int | None]:
    """When a run shall stop: a process time [s] and a number of encounters, either may be None; raises `UserError`."""
    return (
        None if until is None else si("until", until, PERIOD),
        None if events is None else whole_number("events", events, 0, MOST_EVENTS),
    )
