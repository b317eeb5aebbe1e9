"""Edges at which a shortcut could lie: where an outcome changes, found with the shortcut, without it, and by exact theory.

Each function gives the place of an edge under a scene, a number that a shortcut must not move.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

import mcdem
from mcdem.scene import Scene
from validation.exact import alone, two_spheres
from validation.hard_cases.shapes import monomer

if TYPE_CHECKING:
    from validation.hard_cases.shapes import Shape

Edge = Callable[[Scene], float]


def bisect(holds: Callable[[float], bool], low: float, high: float, width: float) -> float:
    """Where something that holds at `low` holds no more, to `width`; nan if it does not hold there, or still does at `high`."""
    if not holds(low) or holds(high):
        return math.nan
    while high - low > width:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return 0.5 * (low + high)


def capture_offset(x0: float, low: float, high: float) -> Edge:
    """Offset y0 [a] below which two primaries at x0 [a] end as a doublet."""
    return lambda scene: bisect(
        lambda y: outcome(scene, monomer, monomer, (x0, y)) == "aggregation", low, high, 1e-4
    )


def exact_capture_offset(x0: float, low: float, high: float) -> Edge:
    """The same by exact trajectories, orbits that come back included, in the time that the scene has."""

    @cache
    def found(scene_text: str) -> float:
        scene = Scene.from_text(scene_text)
        force, start = two_spheres.van_der_waals(scene), 2.0 * scene.numerics.start_distance
        rest = 4.0 * math.pi * scene.numerics.rotations

        def meets(y: float) -> bool:
            # At z = 60 a no pair is left that turns back within the time.
            path = two_spheres.trajectory(x0, y, -start, leave=60.0, duration=start / y + rest, force=force)
            return bool(path.met)

        return bisect(meets, low, high, 2e-4)

    return lambda scene: found(scene.text)


def touching_offset(first: Shape, second: Shape, low: float, high: float) -> Edge:
    """Offset y0 [R_i + R_j] below which two aggregates, as they lie, touch."""

    def touch(scene: Scene, y: float) -> bool:
        return outcome(scene, first, second, (0.0, y), True) != "missed"

    return lambda scene: bisect(lambda y: touch(scene, y), low, high, 5e-4)


def breaking_stress(shape: Shape, low: float, high: float, strain: float = 40.0) -> Edge:
    """Stress [Pa] from which on an aggregate alone breaks, to a hundredth.

    Its primaries and contacts stay as they are at 1000 Pa, so do the scene's other numbers.
    """

    def breaks(scene: Scene, stress: float) -> bool:
        changed = scene.with_changes(
            {
                "flow.shear_stress": f"{stress} Pa",
                "numerics.rotations": (strain - 1.0) / (4.0 * math.pi),
            }
        )
        aggregate = shape(changed)
        radius = changed.suspension.radius
        y0 = changed.numerics.start_distance * (aggregate.outer_radius(radius) + radius)
        passed = mcdem.simulate_encounter(
            changed, aggregate, mcdem.Aggregate.monomer(), (alone.FAR * radius, y0), orient=False
        )
        return alone.is_split(passed, aggregate.size)

    return lambda scene: alone.threshold(lambda stress: breaks(scene, stress), low, high)


def passing_gap(first: Shape, second: Shape, offset: tuple[float, float]) -> Edge:
    """Smallest gap [a] between primaries of two aggregates that pass each other."""
    return lambda scene: followed(scene, first, second, offset, True).smallest_gap / scene.suspension.radius


def returns(first: Shape, second: Shape, offsets: tuple[tuple[float, float], ...]) -> Edge:
    """How many of some offsets [R_i + R_j] end with a contact, now or when the aggregates come back."""
    return lambda scene: float(
        sum(followed(scene, first, second, offset, True).contact for offset in offsets)
    )


def stray(offset: tuple[float, float], leave: float) -> Edge:
    """Largest distance [a] of two primaries from their exact path once they are past each other and 3 a apart."""

    def furthest(scene: Scene) -> float:
        radius, record = scene.suspension.radius, mcdem.Recorder(interval=0.2)
        exact = two_spheres.trajectory(
            *offset, -2.0 * scene.numerics.start_distance, leave, force=two_spheres.van_der_waals(scene)
        )
        curve = exact.sol(np.linspace(0.0, exact.t[-1], 6000)).T
        mote = mcdem.Aggregate.monomer()
        mcdem.simulate_encounter(
            scene, mote, mote, (offset[0] * radius, offset[1] * radius), record=record, orient=False
        )
        path = (record.positions[:, 1] - record.positions[:, 0]) / radius
        path = path[(path[:, 2] > 3.0) & (path[:, 2] < leave - 1.0)]
        nearest = np.linalg.norm(path[:, None] - curve[None], axis=2).argmin(axis=1)
        before, after = curve[np.maximum(nearest - 1, 0)], curve[np.minimum(nearest + 1, len(curve) - 1)]
        along = (after - before) / np.linalg.norm(after - before, axis=1)[:, None]
        return float(np.linalg.norm(np.cross(path - curve[nearest], along), axis=1).max())

    return furthest


def followed(
    scene: Scene, first: Shape, second: Shape, offset: tuple[float, float], in_reach: bool
) -> mcdem.EncounterResult:
    """An encounter of two shapes as they lie; the offset in R_i + R_j if `in_reach`, else in a."""
    pair, radius = (first(scene), second(scene)), scene.suspension.radius
    unit = sum(a.outer_radius(radius) for a in pair) if in_reach else radius
    return mcdem.simulate_encounter(scene, *pair, (offset[0] * unit, offset[1] * unit), orient=False)


def outcome(
    scene: Scene, first: Shape, second: Shape, offset: tuple[float, float], in_reach: bool = False
) -> str:
    """Its outcome."""
    return followed(scene, first, second, offset, in_reach).outcome
