"""Aggregates of known geometry, primaries of unit radius; `settled` gives them their contacts at rest in a scene."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from mcdem.aggregates.aggregate import Aggregate
from mcdem.effects.sums import contact_equilibrium, contact_pull_off_gap

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from mcdem.scene import Scene

    Shape = Callable[[Scene], Aggregate]
    """What a start is made of: the aggregate that the shape is in a scene."""


def settled(scene: Scene, centres: ArrayLike, seed: int | None = 0) -> Aggregate:
    """The aggregate of touching unit spheres at `centres` (P, 3), every contact at its unloaded gap.

    It is turned at random by `seed`, so that nothing is aligned with the axes by chance; None leaves it as it is.
    """
    points = np.asarray(centres, float)
    bonds = sorted(cKDTree(points).query_pairs(2.0 + 1e-6))
    gap, _ = contact_equilibrium(1.0, scene.kernels.contact)
    scaled = points * (1.0 + 0.5 * gap) * scene.suspension.radius
    aggregate = Aggregate.from_positions(scene, scaled, np.array(bonds).reshape(-1, 2))
    return aggregate if seed is None else aggregate.turned(np.random.default_rng(seed))


def monomer(scene: Scene) -> Aggregate:
    """A free primary."""
    return Aggregate.monomer()


def chain_centres(count: int) -> NDArray[np.float64]:
    """A straight chain along z."""
    return np.array([[0.0, 0.0, 2.0 * k] for k in range(count)])


def raft_centres(shells: int) -> NDArray[np.float64]:
    """A planar hexagonal raft: 1 + 3 shells (shells + 1) spheres."""
    return np.array(
        [
            [2.0 * i + j, np.sqrt(3.0) * j, 0.0]
            for i in range(-shells, shells + 1)
            for j in range(-shells, shells + 1)
            if abs(i + j) <= shells
        ]
    )


def ball_centres(count: int) -> NDArray[np.float64]:
    """The `count` sites of a hexagonal close packing nearest to one of its sites."""
    n = 2 + round(count ** (1.0 / 3.0))
    span = range(-n, n + 1)
    sites = np.array(
        [
            [2 * i + (j + k) % 2, np.sqrt(3.0) * (j + (k % 2) / 3.0), 2.0 * np.sqrt(6.0) / 3.0 * k]
            for i in span
            for j in span
            for k in span
        ]
    )
    # Sites of one shell in a fixed order, whatever the rounding of their distances.
    order = np.lexsort((*sites.round(6).T, np.linalg.norm(sites, axis=1).round(6)))
    return sites[order[:count]]


def ring_centres(count: int) -> NDArray[np.float64]:
    """A closed necklace."""
    angle = 2.0 * np.pi * np.arange(count) / count
    radius = 1.0 / np.sin(np.pi / count)
    return radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])


def walk_centres(count: int, seed: int) -> NDArray[np.float64]:
    """An open necklace: a random walk whose spheres keep a tenth of a radius from all but their neighbours."""
    rng = np.random.default_rng(seed)
    centres = [np.zeros(3)]
    while len(centres) < count:
        step = rng.standard_normal(3)
        site = centres[-1] + 2.0 * step / np.linalg.norm(step)
        if all(np.linalg.norm(site - other) > 2.1 for other in centres[:-1]):
            centres.append(site)
    return np.array(centres)


def one_redundant_centres() -> NDArray[np.float64]:
    """A rigid cluster with 3P - 5 contacts, one more than it needs.

    An octahedron, isostatic, grows on the hexagonal packing by sites that touch three of its spheres, then by one that
    touches four.
    """
    sites = ball_centres(57)
    opposite = sites[np.isclose(np.linalg.norm(sites, axis=1), np.sqrt(8.0))][0]
    inside = np.isclose(np.linalg.norm(sites - 0.5 * opposite, axis=1), np.sqrt(2.0))
    while True:
        touching = np.isclose(np.linalg.norm(sites[:, None] - sites[inside], axis=2), 2.0).sum(axis=1)
        four = np.flatnonzero(~inside & (touching == 4))
        inside[four[0] if len(four) else np.flatnonzero(~inside & (touching == 3))[0]] = True
        if len(four):
            return sites[inside]


def bipyramid_centres() -> NDArray[np.float64]:
    """A pentagonal bipyramid: 7 spheres, 15 contacts, isostatic."""
    ring = ring_centres(5)
    height = np.sqrt(4.0 - (ring[0] ** 2).sum())
    return np.vstack([ring, [[0.0, 0.0, height], [0.0, 0.0, -height]]])


def tetrahedron_centres() -> NDArray[np.float64]:
    """Four spheres, all in contact."""
    return np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(2.0)


def shape(centres: ArrayLike, seed: int | None = 0) -> Shape:
    """The shape at `centres` (P, 3), to be settled in a scene."""
    return partial(settled, centres=centres, seed=seed)


def doublet(gap: float) -> Shape:
    """Two primaries in contact at a surface gap [a] of the user's choice, along z."""

    def make(scene: Scene) -> Aggregate:
        rest = (1.0 + 0.5 * gap) * scene.suspension.radius
        return Aggregate.from_positions(scene, [[0.0, 0.0, -rest], [0.0, 0.0, rest]], [[0, 1]])

    return make


def bent(gap: float) -> Shape:
    """Three primaries in a row, bent until the outer two are a surface gap [a] apart, though not in contact."""

    def make(scene: Scene) -> Aggregate:
        side, third = 2.0, 2.0 + gap
        height = np.sqrt(side**2 - 0.25 * third**2)
        centres = np.array([[0.0, 0.0, -0.5 * third], [0.0, height, 0.0], [0.0, 0.0, 0.5 * third]])
        return Aggregate.from_positions(scene, centres * scene.suspension.radius, [[0, 1], [1, 2]])

    return make


def at_pull_off(excess: float) -> Shape:
    """A doublet whose contact is stretched to its pull-off gap plus `excess` [a]."""

    def make(scene: Scene) -> Aggregate:
        return doublet(contact_pull_off_gap(1.0, scene.kernels.contact) + excess)(scene)

    return make
