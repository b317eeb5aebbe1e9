"""Aggregates of known geometry, primaries of unit radius in contact: (positions, bonds)."""

from itertools import combinations

import numpy as np


def touching(positions, radius=1.0):
    """Pairs whose centres lie one diameter apart, by looking at every pair."""
    return np.array(
        [
            (i, j)
            for i, j in combinations(range(len(positions)), 2)
            if abs(np.linalg.norm(positions[i] - positions[j]) - 2 * radius) < 1e-9 * radius
        ],
        dtype=np.int64,
    ).reshape(-1, 2)


def with_bonds(positions):
    positions = np.asarray(positions, dtype=float)
    return positions, touching(positions)


def monomer():
    return with_bonds([[0, 0, 0]])


def chain(n):
    return with_bonds([[2 * k, 0, 0] for k in range(n)])


def dimer():
    return chain(2)


def triangle():
    return with_bonds([[0, 0, 0], [2, 0, 0], [1, np.sqrt(3), 0]])


def tetrahedron():
    return with_bonds(np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(2))


def octahedron():
    return with_bonds(np.sqrt(2) * np.vstack([np.eye(3), -np.eye(3)]))


def icosahedron():
    """12 around one. The shell's edges are 5 % longer than its radius: only the 12 spokes touch."""
    golden = (1 + np.sqrt(5)) / 2
    shell = [np.roll([0, s, t * golden], k) for k in range(3) for s in (1, -1) for t in (1, -1)]
    shell = 2 * np.array(shell) / np.linalg.norm(shell[0])
    return with_bonds(np.vstack([np.zeros(3), shell]))


def hcp_ball(radius):
    """Hexagonal close packing about one sphere: all centres within `radius` (in primary radii)."""
    n = int(radius) + 2
    centres = [
        [2 * i + (j + k) % 2, np.sqrt(3) * (j + (k % 2) / 3), 2 * np.sqrt(6) / 3 * k]
        for i in range(-n, n + 1)
        for j in range(-n, n + 1)
        for k in range(-n, n + 1)
    ]
    centres = np.array(centres)
    return with_bonds(centres[np.linalg.norm(centres, axis=1) <= radius + 1e-9])


def stack_of_octahedra(layers):
    """Triangles stacked face to face, each turned by half a turn: isostatic, as stiff as it is long."""
    turn = np.arange(3) * 2 * np.pi / 3
    return with_bonds(
        [
            [
                2 / np.sqrt(3) * np.cos(t + np.pi * k),
                2 / np.sqrt(3) * np.sin(t + np.pi * k),
                k * np.sqrt(8 / 3),
            ]
            for k in range(layers)
            for t in turn
        ]
    )


def ragged(shapes, radius=1.0):
    """sizes, positions, bonds, bond_counts of a list of (positions, bonds)."""
    return (
        radius * np.vstack([p for p, _ in shapes]),
        np.array([len(p) for p, _ in shapes]),
        np.vstack([b for _, b in shapes]),
        np.array([len(b) for _, b in shapes]),
    )
