"""Encounters with known statistics, in place of the motion of every primary: they judge the Monte Carlo alone.

Aggregates are lattice clusters and chains of touching spheres: their radii, contacts and primaries are real.
"""

from __future__ import annotations

import math
import os
import time
from dataclasses import replace
from functools import cache

import numpy as np

from mcdem.aggregates.aggregate import Aggregate
from mcdem.encounter.simulate import EncounterResult
from mcdem.quantities.linear_flows import draw_offset
from mcdem.scene import Scene

SCENE = """\
# Does the Monte Carlo sample the law it should?
[suspension]
radius = "500 nm"
volume_fraction = 1e-4

[flow]
shear_rate = "1e4 1/s"
viscosity = "100 mPa s"
"""


SMALL: dict[str, object] = {"population__initial": 60, "run__snapshot_every": "50 ms"}
"""Changes that make a run of a few hundred encounters see doublings, epochs and snapshots."""


def scene(**changes: object) -> Scene:
    """The paper's suspension; `changes` as `population__initial=20`."""
    given = {key.replace("__", "."): value for key, value in changes.items()}
    return Scene.from_text(SCENE, "synthetic.toml").with_changes(given)


def result(
    outcome: str, products: list[Aggregate], members: list[np.ndarray], contact: bool = False
) -> EncounterResult:
    return EncounterResult(
        outcome=outcome,
        products=tuple(products),
        members=tuple(members),
        centres=np.zeros((len(products), 3)),
        offset=(0.0, 1e-6),
        contact=contact,
        simulated_time=1e-3,
        first_contact_time=math.nan,
        last_bond_change_time=math.nan,
        first_bond_loss_time=math.nan,
        largest_tension=0.0,
        smallest_gap=0.0,
        steps=1,
        solves=1,
        cpu_time=time.process_time(),
    )


def missed(first: Aggregate, second: Aggregate) -> EncounterResult:
    total = first.size + second.size
    return result("missed", [first, second], [np.arange(first.size), np.arange(first.size, total)])


@cache
def compact(size: int, radius: float) -> Aggregate:
    """The `size` points of a cubic lattice nearest to a lattice point, touching."""
    side = np.arange(-6, 7)
    points = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    points = points[np.argsort((points**2).sum(axis=1), kind="stable")][:size]
    near = np.abs(points[:, None] - points[None]).sum(axis=2) == 1
    bonds = np.argwhere(np.triu(near)).astype(np.int32)
    return Aggregate(2.0 * radius * (points - points.mean(axis=0)), bonds)


def merged(first: Aggregate, second: Aggregate, radius: float) -> EncounterResult:
    """One compact aggregate of both."""
    total = first.size + second.size
    return result("aggregation", [compact(total, radius)], [np.arange(total)], contact=True)


def chain(size: int, radius: float) -> Aggregate:
    z = 2.0 * radius * np.arange(size)
    positions = np.stack([np.zeros(size), np.zeros(size), z - z.mean()], axis=1)
    bonds = np.stack([np.arange(size - 1), np.arange(1, size)], axis=1)
    return Aggregate(positions, bonds.astype(np.int32))


def always_merge(
    scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator
) -> EncounterResult:
    return merged(first, second, scene.suspension.radius)


def always_miss(
    scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator
) -> EncounterResult:
    return missed(first, second)


def constant_kernel(
    scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator
) -> EncounterResult:
    """Efficiency (2a)^3/(R_i + R_j)^3: every pair merges at the rate of two primaries' encounters."""
    radius = scene.suspension.radius
    reach = first.outer_radius(radius) + second.outer_radius(radius)
    if seed.random() < (2.0 * radius / reach) ** 3:
        return merged(first, second, radius)
    return missed(first, second)


def aggregation_and_breakup(
    scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator
) -> EncounterResult:
    """Misses that reshape, mergers, pairs that touch and part, exchanges, fragmentation, unresolved: all outcomes."""
    radius = scene.suspension.radius
    total = first.size + second.size
    draw = seed.random()
    if draw < 0.05:
        found = missed(first, second)
        return EncounterResult(**{**found.__dict__, "outcome": "unresolved", "reason": "drawn so"})
    if draw < 0.40 and total > 2:
        turned = [chain(a.size, radius * (1.0 + 1e-3 * seed.random())) for a in (first, second)]
        found = missed(*turned)
        return (
            found
            if draw < 0.3
            else EncounterResult(**{**found.__dict__, "outcome": "parted", "contact": True})
        )
    if total <= 8:
        return merged(first, second, radius)
    parts = int(seed.integers(2, 5))
    cuts = np.sort(seed.choice(np.arange(1, total), parts - 1, replace=False))
    members = [np.sort(m) for m in np.split(seed.permutation(total), cuts)]
    members.sort(key=lambda m: int(m[0]))
    products = [chain(len(m), radius) if len(m) > 1 else Aggregate.monomer() for m in members]
    return result("exchange" if parts == 2 else "fragmentation", products, members, contact=True)


def slow_aggregation_and_breakup(
    scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator
) -> EncounterResult:
    """The same at a pace that leaves time to be killed."""
    time.sleep(2e-3)
    return aggregation_and_breakup(scene, first, second, seed)


def unhurried_aggregation_and_breakup(
    scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator
) -> EncounterResult:
    """The same at a pace that leaves seconds to be interrupted, on a busy machine too."""
    time.sleep(25e-3)
    return aggregation_and_breakup(scene, first, second, seed)


def broken(scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator) -> EncounterResult:
    """A defect that shows itself at the first contact of three."""
    if first.size + second.size > 2:
        raise ArithmeticError("three is a crowd")
    return merged(first, second, scene.suspension.radius)


def deadly(scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator) -> EncounterResult:
    """Takes its worker with it at the first contact of three."""
    if first.size + second.size > 2:
        os._exit(9)
    return merged(first, second, scene.suspension.radius)


def deadly_in_one(
    scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator
) -> EncounterResult:
    """Takes its worker with it at one viscosity and in the streams of one replica."""
    if scene.flow.viscosity < 0.09 and seed.bit_generator.state["state"]["key"][0] % 5 == 0:
        os._exit(9)
    return aggregation_and_breakup(scene, first, second, seed)


def restless(scene: Scene, first: Aggregate, second: Aggregate, seed: np.random.Generator) -> EncounterResult:
    """Aggregates stretch and fold with every miss; mergers up to eight primary particles, then only misses."""
    radius = scene.suspension.radius
    if first.size + second.size <= 8 and seed.random() < 0.3:
        return merged(first, second, radius)
    return missed(*((chain if seed.random() < 0.5 else compact)(a.size, radius) for a in (first, second)))


def captured_share(offset: tuple[float, float], reach: float) -> float:
    """A known efficiency: largest for small y, and the less the further out in x."""
    x, y = offset[0] / reach, offset[1] / reach
    return 0.35 * math.exp(-((y / 0.25) ** 4)) * (1.0 - x * x)


def by_offset(
    scene: Scene,
    first: Aggregate,
    second: Aggregate,
    offset: tuple[float, float] | None = None,
    seed: np.random.Generator | None = None,
) -> EncounterResult:
    """Pairs merge with the probability `captured_share` at their offset, drawn by the flux if none is given."""
    assert seed is not None
    radius = scene.suspension.radius
    reach = first.outer_radius(radius) + second.outer_radius(radius)
    offset = draw_offset(scene.flow, reach, seed) if offset is None else offset
    hit = seed.random() < captured_share(offset, reach)
    found = merged(first, second, radius) if hit else missed(first, second)
    return replace(found, offset=offset, cpu_time=1.0)
