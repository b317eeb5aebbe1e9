"""Resistance of rigid spheres from point forces inside them, met by collocation: no multipoles, no pair sums, no far field.

Where two spheres are close, point forces and collocation points gather on rings about the line of centres, the nearer to the
surface the smaller the ring: an image system as for close charges.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcdem.hydrodynamics.two_sphere.tensors import STRAIN_BASIS

PERMUTATION = np.array(
    [[[(i - j) * (j - k) * (k - i) / 2 for k in range(3)] for j in range(3)] for i in range(3)]
)
CLOSE = 0.5
"""Gap over the smaller radius below which a pair gets rings; without relative motion of the spheres none are needed."""


def sphere_points(n: int) -> NDArray[np.float64]:
    """(n, 3) points spread evenly over the unit sphere."""
    i = np.arange(n) + 0.5
    z, angle = 1 - 2 * i / n, np.pi * (1 + np.sqrt(5)) * i
    return np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], axis=1)


def rings(towards, angles, count: int, depths) -> NDArray[np.float64]:
    """(rings x count, 3) points at these angles from a direction and these depths below the unit sphere."""
    along = towards / np.linalg.norm(towards)
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first /= np.linalg.norm(first)
    second = np.cross(along, first)
    around = 2 * np.pi * (np.arange(count) + 0.5) / count
    circle = np.cos(around)[:, None] * first + np.sin(around)[:, None] * second
    return np.concatenate(
        [(1 - d) * (np.cos(t) * along + np.sin(t) * circle) for t, d in zip(angles, depths)]
    )


def placed(centres, radii, sources: int, depth: float, close: float):
    """Point forces and collocation points of each sphere, about its centre: two lists of (points, 3)."""
    inner = [a * depth * sphere_points(sources) for a in radii]
    outer = [a * sphere_points(2 * sources) for a in radii]
    for i, j in itertools.permutations(range(len(radii)), 2):
        r = centres[j] - centres[i]
        gap = np.linalg.norm(r) - radii[i] - radii[j]
        if gap > close * min(radii[i], radii[j]):
            continue
        smallest = 0.5 * np.sqrt(max(gap, 1e-3) / radii[i])
        angles = np.geomspace(0.7, smallest, max(2, int(np.ceil(np.log(0.7 / smallest) / np.log(1.5))) + 1))
        inner[i] = np.concatenate([inner[i], radii[i] * rings(r, angles, 10, 0.8 * angles)])
        fine = np.geomspace(0.9, 0.4 * smallest, 3 * len(angles))
        outer[i] = np.concatenate([outer[i], radii[i] * rings(r, fine, 16, 0.0 * fine)])
    return inner, outer


def resistance(
    centres: ArrayLike, radii: ArrayLike, sources: int = 250, depth: float = 0.5, close: float = CLOSE
) -> NDArray[np.float64]:
    """(11N, 11N) resistance (F.. T.. S..) from (U - u.. Omega - w.. -E..), in units of 6 pi mu a^n.

    centres (N, 3), radii (N,); `sources` point forces inside each sphere at `depth` times its radius meet, in the sense of least
    squares, each unit motion on twice as many points of the surfaces.
    """
    centres, radii = np.asarray(centres, float), np.asarray(radii, float)
    n = len(radii)
    inner, outer = placed(centres, radii, sources, depth, close)
    places = np.concatenate([c + x for c, x in zip(centres, inner)])
    surface = np.concatenate([c + x for c, x in zip(centres, outer)])
    x = surface[:, None] - places[None]
    r = np.linalg.norm(x, axis=-1)[..., None, None]
    oseen = 0.75 * (np.eye(3) / r + x[..., :, None] * x[..., None, :] / r**3)
    starts = np.cumsum([0, *map(len, inner)]), np.cumsum([0, *map(len, outer)])
    velocity = np.zeros((len(surface), 3, 11 * n))
    moment = np.zeros((11 * n, len(places), 3))
    for k in range(n):
        u, spin, strain = (
            slice(first * n + width * k, first * n + width * (k + 1))
            for first, width in ((0, 3), (3, 3), (6, 5))
        )
        force, point = (slice(start[k], start[k + 1]) for start in starts)
        velocity[point, :, u] = np.eye(3)
        velocity[point, :, spin] = np.einsum("ijk,pk->pij", PERMUTATION, outer[k])
        velocity[point, :, strain] = np.einsum("bij,pj->pib", STRAIN_BASIS, outer[k])
        moment[u, force] = np.eye(3)[:, None, :]
        moment[spin, force] = np.einsum("ijk,pj->ipk", PERMUTATION, inner[k])
        moment[strain, force] = np.einsum("bij,pj->bpi", STRAIN_BASIS, inner[k])
    matrix = oseen.transpose(0, 2, 1, 3).reshape(3 * len(surface), 3 * len(places))
    forces = np.linalg.lstsq(matrix, velocity.reshape(3 * len(surface), 11 * n), rcond=1e-13)[0]
    return moment.reshape(11 * n, -1) @ forces
