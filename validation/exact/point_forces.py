"""Resistance of rigid spheres from point forces inside them, met by collocation: no multipoles, no pair sums, no far field."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcdem.hydrodynamics.pair_tensors import STRAIN_BASIS

PERMUTATION = np.array(
    [[[(i - j) * (j - k) * (k - i) / 2 for k in range(3)] for j in range(3)] for i in range(3)]
)


def sphere_points(n: int) -> NDArray[np.float64]:
    """(n, 3) points spread evenly over the unit sphere."""
    i = np.arange(n) + 0.5
    z, angle = 1 - 2 * i / n, np.pi * (1 + np.sqrt(5)) * i
    return np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], axis=1)


def resistance(
    centres: ArrayLike, radii: ArrayLike, sources: int = 250, depth: float = 0.5
) -> NDArray[np.float64]:
    """(11N, 11N) resistance (F.. T.. S..) from (U - u.. Omega - w.. -E..), in units of 6 pi mu a^n.

    centres (N, 3), radii (N,); `sources` point forces inside each sphere at `depth` times its radius meet, in the sense of least
    squares, each unit motion on twice as many points of the surfaces.
    """
    centres, radii = np.asarray(centres, float), np.asarray(radii, float)
    n, points = len(radii), 2 * sources
    inner, outer = depth * sphere_points(sources), sphere_points(points)
    places = np.concatenate([c + a * inner for c, a in zip(centres, radii)])
    surface = np.concatenate([c + a * outer for c, a in zip(centres, radii)])
    x = surface[:, None] - places[None]
    r = np.linalg.norm(x, axis=-1)[..., None, None]
    oseen = 0.75 * (np.eye(3) / r + x[..., :, None] * x[..., None, :] / r**3)
    velocity = np.zeros((n, points, 3, 11 * n))
    moment = np.zeros((11 * n, n, sources, 3))
    for k, a in enumerate(radii):
        u, spin, strain = (
            slice(first * n + width * k, first * n + width * (k + 1))
            for first, width in ((0, 3), (3, 3), (6, 5))
        )
        velocity[k, :, :, u] = np.eye(3)
        velocity[k, :, :, spin] = np.einsum("ijk,pk->pij", PERMUTATION, a * outer)
        velocity[k, :, :, strain] = np.einsum("bij,pj->pib", STRAIN_BASIS, a * outer)
        moment[u, k] = np.eye(3)[:, None, :]
        moment[spin, k] = np.einsum("ijk,pj->ipk", PERMUTATION, a * inner)
        moment[strain, k] = np.einsum("bij,pj->bpi", STRAIN_BASIS, a * inner)
    matrix = oseen.transpose(0, 2, 1, 3).reshape(3 * n * points, 3 * n * sources)
    forces = np.linalg.lstsq(matrix, velocity.reshape(3 * n * points, 11 * n), rcond=1e-13)[0]
    return moment.reshape(11 * n, -1) @ forces
