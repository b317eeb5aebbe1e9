"""Encounters with known statistics in place of the motion of every primary: they judge the Monte Carlo alone."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from mcdem.aggregate import Aggregate
from mcdem.encounter import EncounterResult


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
    total = first.size + second.size
    sticks = seed.random() < (2.0 * radius / reach) ** 3
    products: tuple[Aggregate, ...]
    members: tuple[np.ndarray, ...]
    if sticks:
        products, members = (compact(total, radius),), (np.arange(total),)
    else:
        products, members = (first, second), (np.arange(first.size), np.arange(first.size, total))
    return EncounterResult(
        outcome="aggregation" if sticks else "missed",
        products=products,
        members=members,
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
