"""Rigidity of bond networks: floppy modes and redundant bonds.

Row b of the rigidity matrix takes small displacements of the primaries to the stretching of bond b. Its null space
holds the rigid-body motions and the floppy modes; bonds beyond its rank are redundant (Maxwell 1864, Calladine 1978):
n_b - rank redundant bonds, 3P - rank - (rigid-body motions) floppy modes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Singular values of real packings are O(0.1); rounding of stored coordinates leaves 1e-9 where there should be zero.
RELATIVE_ZERO = 1e-6


def rigidity_matrix(positions: NDArray[np.float64], bonds: NDArray[np.integer]) -> NDArray[np.float64]:
    """(n_b, 3P), from positions (P, 3) and bonds (n_b, 2).

    Parameters
    ----------
    positions : (P, 3)
        Centres, in any unit.
    bonds : (n_b, 2) integers
        Contacts.

    Returns
    -------
    (n_b, 3P) array
        Stretching of each bond by small displacements.

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.aggregates import rigidity_matrix
    >>> triangle = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.75**0.5, 0]])
    >>> rigidity_matrix(triangle, np.array([[0, 1], [1, 2], [0, 2]])).shape
    (3, 9)
    """
    first, second = bonds[:, 0], bonds[:, 1]
    direction = positions[first] - positions[second]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    matrix = np.zeros((len(bonds), len(positions), 3))
    row = np.arange(len(bonds))
    matrix[row, first] = direction
    matrix[row, second] = -direction
    return matrix.reshape(len(bonds), 3 * len(positions))


def rank(matrix: NDArray[np.float64]) -> int:
    """Number of singular values that are not zero."""
    if matrix.size == 0:
        return 0
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.count_nonzero(values > RELATIVE_ZERO * values[0])) if values[0] > 0 else 0


def rigid_motions(positions: NDArray[np.float64]) -> int:
    """Rigid-body motions of centres (P, 3): 6; 5 when they lie on a line, 3 for one."""
    return 3 + {0: 0, 1: 2}.get(rank(positions - positions.mean(axis=0)), 3)


def count_modes(
    positions: NDArray[np.float64],
    sizes: NDArray[np.integer],
    bonds: NDArray[np.integer],
    bond_counts: NDArray[np.integer],
) -> NDArray[np.int64]:
    """(A, 2): floppy modes and redundant bonds of every aggregate of a ragged population (see `morphology`).

    Parameters
    ----------
    positions : (sum P, 3)
        Centres of the primaries, aggregate after aggregate, in any unit.
    sizes, bond_counts : (A,) integers
        Primaries and contacts of each aggregate.
    bonds : (sum B, 2) integers
        Contacts, numbered from 0 within their own aggregate.

    Returns
    -------
    (A, 2) integers
        Floppy modes and redundant bonds.

    Examples
    --------
    A triangle of three is rigid; without one of its bonds it has a floppy mode.

    >>> import numpy as np
    >>> from mcdem.aggregates import count_modes
    >>> triangle = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.75**0.5, 0]])
    >>> one, bonds = np.array([3]), np.array([[0, 1], [1, 2], [0, 2]])
    >>> count_modes(triangle, one, bonds, np.array([3])).tolist()
    [[0, 0]]
    >>> count_modes(triangle, one, bonds[:2], np.array([2])).tolist()
    [[1, 0]]
    """
    counts = np.empty((len(sizes), 2), dtype=np.int64)
    first_primary, first_bond = np.cumsum(sizes) - sizes, np.cumsum(bond_counts) - bond_counts
    for k, (size, bond_count, i, b) in enumerate(
        zip(sizes, bond_counts, first_primary, first_bond, strict=True)
    ):
        centres = positions[i : i + size]
        independent = rank(rigidity_matrix(centres, bonds[b : b + bond_count]))
        counts[k] = 3 * size - rigid_motions(centres) - independent, bond_count - independent
    return counts
