"""Encounters with known statistics in place of the motion of every primary: they judge the Monte Carlo alone."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from mcdem.aggregates.aggregate import Aggregate
from mcdem.encounter.simulate import EncounterResult


@cache
def compact(size: int, radius: float) -> Aggregate:
    """The `size` points of a cubic lattice nearest to a lattice point, touching."""
    side = np.arange(-8, 9)
    points = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    points = points[np.argsort((points**2).sum(axis=1), kind="stable")][:size]
    near = np.abs(points[:, None] - points[None]).sum(axis=2) == 1
    return Aggregate(
        2.0 * radius * (points - points.mean(axis=0)), np.argwhere(np.triu(near)).astype(np.int32)
    )


def constant_kernel(scene, first, second, seed) -> EncounterResult:
    """Efficiency (2a)^3/(R_i + R_j)^3: every pair merges at the rate at which two primaries meet."""
    radius = scene.suspension.radius
    reach = first.outer_radius(radius) + second.outer_radius(radius)
    return _met(scene, first, second, seed.random() < (2.0 * radius / reach) ** 3)


def sticking(scene, first, second, seed, efficiency: float, largest: int) -> EncounterResult:
    """Pairs merge with one efficiency; what would be larger than `largest` falls into halves."""
    return _met(scene, first, second, seed.random() < efficiency, largest)


def _met(scene, first, second, sticks: bool, largest: float = math.inf) -> EncounterResult:
    """An encounter whose parents merge, or pass; too large a product splits."""
    radius, total = scene.suspension.radius, first.size + second.size
    if not sticks:
        outcome, sizes = "missed", [first.size, second.size]
        products: tuple[Aggregate, ...] = (first, second)
    else:
        sizes = [total] if total <= largest else [total // 2, total - total // 2]
        outcome = "aggregation" if len(sizes) == 1 else "fragmentation"
        products = tuple(compact(size, radius) for size in sizes)
    return EncounterResult(
        outcome=outcome,
        products=products,
        members=tuple(np.split(np.arange(total), np.cumsum(sizes)[:-1])),
        centres=np.zeros((len(products), 3)),
        offset=(0.0, radius),
        contact=sticks,
        simulated_time=0.0,
        first_contact_time=math.nan,
        last_bond_change_time=math.nan,
        first_bond_loss_time=math.nan,
        largest_tension=0.0,
        smallest_gap=0.0,
        steps=0,
        solves=0,
        cpu_time=0.0,
    )
