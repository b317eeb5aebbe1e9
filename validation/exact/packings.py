"""Clusters of touching unit spheres made by rule: isostatic packings of a shape, and fractal trees of a dimension."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

CLEAR = 2.03
"""Nearest that centres come without touching: gaps that a contact's stretch would close are left out."""
CHOICE = 6
"""Of this many innermost sites one is taken at random."""


def isostatic(count: int, aspect_ratio: float, seed: int) -> NDArray[np.float64]:
    """(P, 3) spheres with 3P - 6 contacts that fill an ellipsoid stretched along z.

    A tetrahedron grows by spheres that touch three of it each, so nothing is floppy and nothing redundant.
    """
    rng = np.random.default_rng(seed)
    spheres = list(np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / math.sqrt(2.0))
    sites = np.concatenate([_sites_on(spheres[:k], spheres[k]) for k in range(2, 4)])
    sites = sites[_clear(sites, spheres)]
    while len(spheres) < count:
        stretched = sites / [1.0, 1.0, aspect_ratio]
        inner = np.argsort((stretched**2).sum(axis=1), kind="stable")[:CHOICE]
        new = sites[rng.choice(inner)]
        fresh = _sites_on(spheres, new)
        spheres.append(new)
        sites = np.concatenate([sites[_clear(sites, [new])], fresh[_clear(fresh, spheres)]])
    return np.array(spheres)


def _clear(sites, spheres):
    """Which sites touch spheres or keep CLEAR of them."""
    apart = np.linalg.norm(sites[:, None] - np.array(spheres)[None], axis=2)
    return ((apart > CLEAR) | (np.abs(apart - 2.0) < 1e-9)).all(axis=1) & (
        (np.abs(apart - 2.0) < 1e-9).sum(axis=1) <= 3
    )


def _sites_on(spheres, new):
    """(S, 3) where a sphere touches `new` and two of the others."""
    near = [s for s in spheres if np.linalg.norm(s - new) < 3.99]
    found = []
    for first, second in itertools.combinations(near, 2):
        u, v = first - new, second - new
        normal = np.cross(u, v)
        area = normal @ normal
        if area < 1e-3:
            continue
        foot = new + (np.cross(normal, u) * (v @ v) + np.cross(v, normal) * (u @ u)) / (2.0 * area)
        height = 4.0 - ((foot - new) ** 2).sum()
        if height > 0.05:
            step = math.sqrt(height / area) * normal
            found += [foot + step, foot - step]
    return np.array(found).reshape(-1, 3)


FRACTAL_PREFACTOR = 1.3


def fractal(doublings: int, dimension: float, seed: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(2^k, 3) spheres and (2^k - 1, 2) contacts of a tree with P = 1.3 (R_g/a)^d_f at every level.

    Two clusters of one size are joined at the distance of their centres that the law asks for (Thouy & Jullien 1994;
    Filippov, Zurita & Rosner 2000), in orientations tried until one pair of spheres touches and none overlaps.
    """
    rng = np.random.default_rng(seed)
    level = [(np.zeros((1, 3)), np.zeros((0, 2), np.int64)) for _ in range(2**doublings)]
    while len(level) > 1:
        level = [_joined(one, two, dimension, rng) for one, two in zip(level[::2], level[1::2])]
    return level[0]


def _joined(one, two, dimension, rng):
    n = len(one[0])
    if n == 1:
        return np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]), np.array([[0, 1]])
    wanted = (2 * n / FRACTAL_PREFACTOR) ** (1.0 / dimension)
    inner = 0.5 * sum((x**2).sum(axis=1).mean() for x, _ in (one, two))
    asked = 2.0 * math.sqrt(max(wanted**2 - inner, 0.25))
    for attempt in range(100000):
        a, b = (Rotation.random(rng=rng).apply(x) for x, _ in (one, two))
        # The furthest shift along z at which they touch: from there on inwards they would overlap.
        apart = b[None, :] - a[:, None]
        across = (apart[..., :2] ** 2).sum(axis=2)
        reach = np.where(across < 4.0, np.sqrt(np.maximum(4.0 - across, 0.0)) - apart[..., 2], -np.inf)
        shift = reach.max()
        # What can be had is taken ever less exactly.
        if abs(shift - asked) > (0.02 + 1e-4 * attempt) * asked:
            continue
        i, j = np.unravel_index(reach.argmax(), reach.shape)
        x = np.concatenate([a, b + [0.0, 0.0, shift]])
        if np.sort(np.linalg.norm(x[:n, None] - x[None, n:], axis=2).ravel())[1] < CLEAR:
            continue
        bonds = np.concatenate([one[1], two[1] + n, [[i, j + n]]])
        return x - x.mean(axis=0), bonds
    raise ArithmeticError("no way was found to join two clusters")
